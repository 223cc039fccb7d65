"""A piece of a batch of configurations: what the kernels answer, then what they leave to others."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.results import PAIR_DTYPE
from collide.robots import open_pairs
from collide.robots.check_configurations import COLLIDES, IS_OPEN, check_configurations
from collide.robots.check_scene import OPEN_LOWER
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.checker_scene import CheckerScene
from collide.robots.distance_gradients import distance_gradients
from collide.robots.nearest_pairs import nearest_pairs
from collide.robots.robot_distances import NEAREST_DTYPE


def check_piece(checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, out: np.ndarray) -> None:
    """``out`` (n,) becomes whether configurations q (n, dof) collide."""
    verdicts = np.empty(len(q), dtype=np.uint8)
    done = 0
    while done < len(q):
        done = check_configurations(
            space.address, address_of(q), checker.robot.dof, done, len(q), address_of(verdicts)
        )
        pairs = space.open_pairs
        if len(pairs):
            pairs = pairs[verdicts[pairs[:, 0]] == IS_OPEN]
            hits = open_pairs.are_hits(*_asked_poses(checker, pairs, q), *_both(checker))
            verdicts[pairs[hits, 0]] = COLLIDES
    out[:] = verdicts == COLLIDES


def measure_piece(
    checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, out: np.ndarray, gradient: np.ndarray, limit: float
) -> None:
    """``out`` (n,) NEAREST_DTYPE and ``gradient`` (n, dof) become those of configurations q (n, dof)."""
    rows = np.zeros(len(q), dtype=PAIR_DTYPE)
    done = 0
    while done < len(q):
        done = nearest_pairs(space.address, address_of(q), checker.robot.dof, done, len(q), limit, address_of(rows))
        if len(space.open_pairs):
            _take_nearer(checker, rows, space.open_pairs.copy(), q, limit)
    distance_gradients(
        space.address, address_of(q), checker.robot.dof, len(q), address_of(checker.robot.moves), address_of(rows),
        address_of(gradient),
    )  # fmt: skip
    for field in NEAREST_DTYPE.names or ():
        out[field] = rows[field]
    far = rows["a"] < 0
    out["beyond"], out["certified"] = far, rows["certified"] | far
    out["distance"][far] = out["upper"][far] = np.inf
    out["lower"][far] = limit


def _take_nearer(checker: CheckerScene, rows: np.ndarray, pairs: np.ndarray, q: np.ndarray, limit: float) -> None:
    """Where a pair left to others is nearer than what a row tells, the row becomes its.

    Those that may be the nearest go first: what lies beyond them need not be measured.
    """
    lowers = pairs[:, OPEN_LOWER].view(np.float64)
    while True:
        known = np.where(rows["a"][pairs[:, 0]] >= 0, rows["distance"][pairs[:, 0]], np.inf)
        may_be_nearer = lowers < known
        pairs, lowers = pairs[may_be_nearer], lowers[may_be_nearer]
        if not len(pairs):
            return
        order = np.lexsort((lowers, pairs[:, 0]))
        is_first = np.zeros(len(pairs), dtype=bool)
        is_first[order[np.flatnonzero(np.diff(pairs[order, 0], prepend=-1))]] = True
        numbered, X_WLs = _asked_poses(checker, pairs[is_first], q)
        measured = open_pairs.distances(numbered, X_WLs, *_both(checker), limit=limit)
        at = pairs[is_first, 0]
        better = ~measured["beyond"] & ((rows["a"][at] < 0) | (measured["distance"] < rows["distance"][at]))
        rows[at[better]] = measured[better]
        pairs, lowers = pairs[~is_first], lowers[~is_first]


def _both(checker: CheckerScene) -> tuple:
    """Bodies that move, and bodies around."""
    return checker.setting.bodies, checker.setting.surroundings.bodies


def _asked_poses(checker: CheckerScene, pairs: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(pairs whose configurations are rows of the poses, (k, links, 4, 4) poses) of the configurations they name."""
    asked, inverse = np.unique(pairs[:, 0], return_inverse=True)
    pairs = pairs.copy()
    pairs[:, 0] = inverse.reshape(-1)
    return pairs, checker.link_poses(q[asked])
