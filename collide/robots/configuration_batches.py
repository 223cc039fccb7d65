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
from collide.robots.nearest_pairs import FIRST_LIMIT, GROWTH, NONE, nearest_pairs
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
            space.ask_meshes(checker.setting)
            pairs = pairs[verdicts[pairs[:, 0]] == IS_OPEN]
            hits = open_pairs.are_hits(*_asked_poses(checker, pairs, q), *_both(checker), once=True)
            verdicts[pairs[hits, 0]] = COLLIDES
    out[:] = verdicts == COLLIDES


def measure_piece(
    checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, out: np.ndarray, gradient: np.ndarray, limit: float
) -> None:
    """``out`` (n,) NEAREST_DTYPE and ``gradient`` (n, dof) become those of configurations q (n, dof)."""
    rows = _nearest_rows(checker, space, q, limit)
    distance_gradients(
        space.address, address_of(q), checker.robot.dof, len(q), address_of(checker.robot.moves), address_of(rows),
        address_of(gradient),
    )
    for field in NEAREST_DTYPE.names or ():
        out[field] = rows[field]
    far = rows["a"] < 0
    out["beyond"], out["certified"] = far, rows["certified"] | far
    out["distance"][far] = out["upper"][far] = np.inf
    out["lower"][far] = limit


def _nearest_rows(checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, limit: float) -> np.ndarray:
    """(n,) rows of PAIR_DTYPE of the nearest pairs within the limit; ``a`` is NONE where no pair is within.

    Where a pair left to others turns out farther apart than the kernel's limit, the kernel searches once more, up to
    the distance of the nearest known pair.
    """
    rows, within = np.zeros(len(q), dtype=PAIR_DTYPE), np.full(len(q), min(FIRST_LIMIT, limit))
    asked = _search(checker, space, q, within, rows, None, np.zeros((0, 3), dtype=np.int64), limit)
    while len(asked):
        known = open_pairs.distances_of(rows)
        some = np.flatnonzero((known > within) & (within < limit))
        if not len(some):
            break
        within[some] = np.where(np.isfinite(known), known, GROWTH * within)[some].clip(max=limit)
        asked = _search(checker, space, q, within, rows, some, asked, limit)
    return rows


def _search(
    checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, within: np.ndarray, rows: np.ndarray,
    some: np.ndarray | None, asked: np.ndarray, limit: float,
) -> np.ndarray:
    """Write into ``rows`` (n,) the nearest pairs of configurations q (n, dof), or of ``some`` (k,) of them, within the
    limits ``within`` (n,); ``within`` becomes the limits searched. Returns (m, 3) all pairs left to others and asked so
    far.
    """
    nearest = rows if some is None else np.zeros(len(some), dtype=PAIR_DTYPE)
    q_some, limits = (q, within) if some is None else (np.ascontiguousarray(q[some]), within[some])
    done = 0
    while done < len(nearest):
        first, done = done, nearest_pairs(
            space.address, address_of(q_some), checker.robot.dof, done, len(nearest), limit, address_of(limits),
            address_of(nearest),
        )
        if some is not None:
            rows[some[first:done]] = open_pairs.nearer_of(rows[some[first:done]], nearest[first:done])
        if len(space.open_pairs):
            pairs = space.open_pairs.copy()
            pairs[:, 0] = pairs[:, 0] if some is None else some[pairs[:, 0]]
            asked = _measure_open(checker, rows, pairs, asked, q, limit)
    if some is not None:
        within[some] = limits
    return asked


def _measure_open(
    checker: CheckerScene, rows: np.ndarray, pairs: np.ndarray, asked: np.ndarray, q: np.ndarray, limit: float
) -> np.ndarray:
    """Replace each row by an open pair's where the open pair is nearer; returns (k, 3) all open pairs asked so far.

    Pairs with the least lower bounds are measured first; pairs whose lower bounds exceed the result are not measured.
    """
    # A pair of bodies is left to others once for every two of their parts: the nearest of these speaks for it.
    pairs = pairs[np.lexsort((pairs[:, OPEN_LOWER].view(np.float64), *pairs[:, 2::-1].T))]
    is_new = (np.diff(pairs[:, :3], axis=0, prepend=-1) != 0).any(axis=1)
    is_new[is_new] = ~_are_among(pairs[is_new, :3], asked)
    pairs = np.ascontiguousarray(pairs[is_new])
    lowers = pairs[:, OPEN_LOWER].view(np.float64)
    while True:
        may_be_nearer = lowers < open_pairs.distances_of(rows[pairs[:, 0]])
        pairs, lowers = pairs[may_be_nearer], lowers[may_be_nearer]
        if not len(pairs):
            return asked
        order = np.lexsort((lowers, pairs[:, 0]))
        is_first = np.zeros(len(pairs), dtype=bool)
        is_first[order[np.flatnonzero(np.diff(pairs[order, 0], prepend=-1))]] = True
        numbered, X_WLs = _asked_poses(checker, pairs[is_first], q)
        measured = open_pairs.distances(numbered, X_WLs, *_both(checker), limit=limit, by_parts=True)
        measured["a"][measured["beyond"]] = NONE
        at = pairs[is_first, 0]
        rows[at] = open_pairs.nearer_of(rows[at], measured)
        asked = np.concatenate([asked, pairs[is_first, :3]])
        pairs, lowers = pairs[~is_first], lowers[~is_first]


def _are_among(pairs: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(k,) bool: which rows of integers (k, 3) are among (m, 3)."""
    if not len(others):
        return np.zeros(len(pairs), dtype=bool)
    numbers = np.unique(np.concatenate([pairs, others]), axis=0, return_inverse=True)[1].reshape(-1)
    return np.isin(numbers[: len(pairs)], numbers[len(pairs) :])


def _both(checker: CheckerScene) -> tuple:
    """Bodies that move, and bodies around."""
    return checker.setting.bodies, checker.setting.surroundings.bodies


def _asked_poses(checker: CheckerScene, pairs: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(pairs whose configurations are rows of the poses, (k, links, 4, 4) poses) of the configurations they name."""
    asked, inverse = np.unique(pairs[:, 0], return_inverse=True)
    pairs = pairs.copy()
    pairs[:, 0] = inverse.reshape(-1)
    return pairs, checker.link_poses(q[asked])
