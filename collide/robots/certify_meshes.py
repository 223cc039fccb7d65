"""Straight motions of meshes that are not convex: pairs left open by `certify_motions`, proven in the same way.

All pairs in all their intervals are asked together, in the middle; intervals still open are halved.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.robots import open_pairs
from collide.robots.check_workspace import CheckWorkspace, MotionWorkspace
from collide.robots.checker_scene import CheckerScene
from collide.robots.motion_bounds import bound_motions


def settle_meshes(
    checker: CheckerScene, space: CheckWorkspace, work: MotionWorkspace, q0: np.ndarray, q1: np.ndarray,
    rows: np.ndarray, times: np.ndarray, resolution: float,
) -> list[np.ndarray]:
    """Intervals (k, OPEN_INTERVAL) of pairs of bodies left open; ``times`` (N,) of collisions are written.

    q0, q1 : (N, dof) ends of the motions named in rows.   rows : (k, OPEN_INTERVAL).
    """
    setting, still_open = checker.setting, []
    changes = np.abs(q1 - q0).max(axis=1, initial=0.0)
    rows = np.unique(rows, axis=0)
    while len(rows):
        rows = np.ascontiguousarray(rows[np.isnan(times[rows[:, 0].astype(np.int64)])])
        if not len(rows):
            break
        bounds, edges = np.empty(len(rows)), rows[:, 0].astype(np.int64)
        bound_motions(
            space.address, work.address, address_of(q0), address_of(q1), q0.shape[1], address_of(rows), len(rows),
            address_of(bounds),
        )
        middle = 0.5 * (rows[:, 1] + rows[:, 2])
        X_WLs = checker.link_poses(q0[edges] + middle[:, None] * (q1 - q0)[edges])
        measured = open_pairs.distances(
            _numbered(rows, setting.self_pairs), X_WLs, setting.bodies, setting.surroundings.bodies, limit=bounds,
            signed=False,
        )
        for k in np.flatnonzero(measured["hit"]).tolist():
            times[edges[k]] = middle[k]
        lengths = changes[edges] * (rows[:, 2] - rows[:, 1])
        remaining = ~(measured["lower"] > bounds) & ~measured["hit"]
        is_last = lengths <= resolution
        still_open.append(rows[remaining & is_last])
        rows, middle = rows[remaining & ~is_last], middle[remaining & ~is_last]
        first, last = rows.copy(), rows.copy()
        first[:, 2] = last[:, 1] = middle
        rows = np.concatenate([first, last])
    return still_open


def _numbered(rows: np.ndarray, self_pairs: np.ndarray) -> np.ndarray:
    """(k, 3) int64: row of the poses, and both bodies as pairs that are left to others name them."""
    out = np.empty((len(rows), 3), dtype=np.int64)
    out[:, 0] = np.arange(len(rows))
    out[:, 1:] = rows[:, 3:]
    of_robot = rows[:, 3] < 0
    out[of_robot, 1:] = self_pairs[out[of_robot, 2]]
    return out
