"""Motions of meshes that are not convex: pairs left open by `certify_motions`, proven in the same way.

All pairs in all their intervals, or cells of boxes, are asked together, in the middle; what is still open is halved.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.robots import open_pairs
from collide.robots.check_workspace import CheckWorkspace, MotionWorkspace
from collide.robots.checker_scene import CheckerScene
from collide.robots.motion_bounds import OPEN_INTERVAL, bound_motions


def settle_meshes(
    checker: CheckerScene, space: CheckWorkspace, work: MotionWorkspace, q0: np.ndarray, q1: np.ndarray,
    rows: np.ndarray, times: np.ndarray, resolution: float,
) -> list[np.ndarray]:
    """Intervals of pairs of bodies still open, as rows; ``times`` (N,) of collisions are written.

    q0, q1 : of the motions named in rows, as of `certify_motions`.   rows : (k, OPEN_INTERVAL or more).
    """
    setting, dof = checker.setting, q0.shape[-1]
    still_open: list[np.ndarray] = []
    rows = np.unique(rows, axis=0)
    while len(rows):
        rows = np.ascontiguousarray(rows[_may_matter(work, rows, times)])
        if not len(rows):
            break
        if work.cell_limit and len(rows) > work.cell_limit:
            return [*still_open, rows]
        answers, numbers = np.empty((len(rows), dof + 2)), rows[:, 0].astype(np.int64)
        bound_motions(
            space.address, work.address, address_of(q0), address_of(q1), dof, address_of(rows), len(rows),
            address_of(answers),
        )
        bounds, widths, q = np.ascontiguousarray(answers[:, 0]), answers[:, 1], np.ascontiguousarray(answers[:, 2:])
        middle = 0.5 * (rows[:, 1] + rows[:, 2])
        measured = open_pairs.distances(
            _numbered(rows, setting.self_pairs), checker.link_poses(q), setting.bodies, setting.surroundings.bodies,
            limit=bounds, signed=False,
        )
        is_hit = measured["hit"].astype(bool)
        for k in np.flatnonzero(is_hit).tolist():
            work.note_hit(times, numbers[k], middle[k], q[k])
        remaining = ~(measured["lower"] > bounds) & (~is_hit | work.is_earliest)
        rows[is_hit, 2] = np.where(work.is_earliest, middle, rows[:, 2])[is_hit]
        is_last = widths <= resolution
        still_open.append(rows[remaining & is_last])
        is_halved = remaining & ~is_last
        rows = _halved(rows[is_halved], q[is_halved], is_hit[is_halved])
    return still_open


def _may_matter(work: MotionWorkspace, rows: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(k,) bool: intervals of motions without a known collision; before the known one where the earliest is wanted."""
    known = times[rows[:, 0].astype(np.int64)]
    return ~(known <= rows[:, 1]) if work.is_earliest else np.isnan(known)


def _halved(rows: np.ndarray, q: np.ndarray, is_cut: np.ndarray) -> np.ndarray:
    """Both halves of each interval or cell around its middle q; an interval with ``is_cut`` ends there already."""
    whole, rows, q = rows[is_cut], rows[~is_cut], q[~is_cut]
    first, last = rows.copy(), rows.copy()
    if rows.shape[1] > OPEN_INTERVAL:
        which, column = np.arange(len(rows)), OPEN_INTERVAL + rows[:, 1].astype(np.int64)
        first[which, column + q.shape[1]] = last[which, column] = q[which, column - OPEN_INTERVAL]
    else:
        first[:, 2] = last[:, 1] = 0.5 * (rows[:, 1] + rows[:, 2])
    return np.concatenate([whole, first, last])


def _numbered(rows: np.ndarray, self_pairs: np.ndarray) -> np.ndarray:
    """(k, 3) int64: row of the poses, and both bodies as pairs that are left to others name them."""
    out = np.empty((len(rows), 3), dtype=np.int64)
    out[:, 0] = np.arange(len(rows))
    out[:, 1:] = rows[:, 3:5]
    of_robot = rows[:, 3] < 0
    out[of_robot, 1:] = self_pairs[out[of_robot, 2]]
    return out
