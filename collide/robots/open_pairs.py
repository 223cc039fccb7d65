"""Pairs that the kernels of a checker leave to others: meshes that are not convex, and what doubles cannot tell.

Each is asked of `collide.collide` or `collide.distance` at the poses of its links, bodies as they were given.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from collide import query
from collide.results import PAIR_DTYPE
from collide.robots.check_tables import BodyAround, RobotBody

_IDENTITY = np.eye(4)[None]


def are_hits(
    pairs: np.ndarray, X_WLs: np.ndarray, bodies: Sequence[RobotBody], around: Sequence[BodyAround]
) -> np.ndarray:
    """(k,) bool: which pairs meet, where one is around both swollen, by padding and margin.

    pairs : (k, 3 or more), configurations as rows of X_WLs (N, links, 4, 4).
    """
    out = np.zeros(len(pairs), dtype=bool)
    for rows, A, B, X_WA, X_WB, padding, margin in _batches(pairs, X_WLs, bodies, around):
        out[rows] = query.collide(A, B, X_WA, X_WB, security_margin=padding + margin, check_poses=False)
    return out


def distances(
    pairs: np.ndarray, X_WLs: np.ndarray, bodies: Sequence[RobotBody], around: Sequence[BodyAround], *, limit
) -> np.ndarray:
    """(k,) rows of PAIR_DTYPE of such pairs, ``a`` and ``b`` as the pairs name bodies; ``beyond`` a limit [m].

    limit : one of all, or (k,) of each, which may be exceeded.
    Where a body is swollen, distances and its points are those of what it is swollen to.
    """
    out = np.zeros(len(pairs), dtype=PAIR_DTYPE)
    for rows, A, B, X_WA, X_WB, padding, margin in _batches(pairs, X_WLs, bodies, around):
        farthest = float(np.max(limit if np.ndim(limit) == 0 else limit[rows])) + padding + margin
        within = query.distance(A, B, X_WA, X_WB, max_distance=farthest, check_poses=False).rows.copy()
        for field in ("distance", "lower", "upper"):
            within[field] -= padding + margin
        within["point_a"] += padding * within["normal"]
        within["point_b"] -= margin * within["normal"]
        if padding + margin > 0.0:
            within["hit"] |= within["upper"] <= 0.0
            open_ = np.flatnonzero(~within["hit"] & (within["lower"] <= 0.0))
            if len(open_):  # what brackets leave open is decided as `are_hits` does
                swell = padding + margin
                X_WB = np.broadcast_to(X_WB, X_WA.shape)[open_]
                within["hit"][open_] = query.collide(A, B, X_WA[open_], X_WB, security_margin=swell, check_poses=False)
        out[rows] = within
    out["a"], out["b"] = pairs[:, 1], pairs[:, 2]
    return out


def _batches(
    pairs: np.ndarray, X_WLs: np.ndarray, bodies: Sequence[RobotBody], around: Sequence[BodyAround]
) -> Iterator[tuple]:
    """(rows of pairs, A, B, X_WA, X_WB, padding, margin) of those of the same two bodies."""
    if not len(pairs):
        return
    order = np.lexsort((pairs[:, 2], pairs[:, 1]))
    starts = np.flatnonzero((np.diff(pairs[order, 1:3], axis=0, prepend=pairs[order[:1], 1:3] - 1) != 0).any(axis=1))
    for rows in np.split(order, starts[1:]):
        a, b = pairs[rows[0], 1:3].tolist()
        A, k = bodies[a], pairs[rows, 0]
        X_WA = np.ascontiguousarray(X_WLs[k, A.link])
        if b >= 0:
            yield rows, A.shape, bodies[b].shape, X_WA, np.ascontiguousarray(X_WLs[k, bodies[b].link]), 0.0, 0.0
        else:
            B = around[-1 - b]
            yield rows, A.shape, B.shape, X_WA, B.X_WB[None], A.padding, B.margin
