"""Bounds of the signed distance of two convex bodies from support functions alone, to judge curved shapes with.

For a unit vector n the gap along it is g(n) = min of n·x over B less max of n·x over A = −h_B(−n) − h_A(n). The
signed distance of two convex bodies is the largest g over all n (Boyd and Vandenberghe, Convex Optimization, 2004,
section 8.2, for bodies apart; of A − B for depths), so that any n gives a lower bound of it. Directions are tried all
around and the best are bettered locally; nothing is shared with the engine. In doubles: what it finds counts only
beyond `SLACK` of the bodies' coordinates.
"""

from __future__ import annotations

import numpy as np

from collide.adapters.peers.question import corners
from collide.shapes import Cone, Cylinder, Ellipsoid, Halfspace, Shape

#: What rounding may do to a gap, as a part of the largest coordinate.
SLACK = 1e-13
#: Times that a direction is bettered: along a ridge the steps get small, and go on for ever.
MAX_TURNS = 150
_SPHERE = np.random.default_rng(7).standard_normal((3000, 3))
_DIRECTIONS = np.concatenate([
    _SPHERE / np.linalg.norm(_SPHERE, axis=1)[:, None], np.eye(3), -np.eye(3),
])
_STEPS = np.random.default_rng(8).standard_normal((60, 3))


def support(shape: Shape, X_WB: np.ndarray, n: np.ndarray) -> np.ndarray | None:
    """(k,) max of n·x over a convex shape at a pose (4, 4), for directions n (k, 3); None where there is no formula."""
    m = n @ X_WB[:3, :3]  # in the body's frame
    there = n @ X_WB[:3, 3]
    if isinstance(shape, Ellipsoid):
        return there + np.linalg.norm(m * shape.radii, axis=1)
    across = np.hypot(m[:, 0], m[:, 1])
    if isinstance(shape, Cylinder):
        return there + shape.radius * across + 0.5 * shape.length * np.abs(m[:, 2])
    if isinstance(shape, Cone):
        return there + np.maximum(0.5 * shape.length * m[:, 2], shape.radius * across - 0.5 * shape.length * m[:, 2])
    points = None if isinstance(shape, Halfspace) else corners(shape)
    if points is None:
        return None
    return there + (m @ points[0].T).max(axis=1) + points[1] * np.linalg.norm(m, axis=1)


def lower_bound(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> tuple[float, np.ndarray] | None:
    """The largest gap along a direction that was found [m], and the direction (3,); None where a shape has no support.

    It is at most the signed distance, and near it for bodies apart; for bodies that overlap another direction may be
    better.
    """

    def gaps(n: np.ndarray) -> np.ndarray | None:
        a, b = support(A, X_WA, n), support(B, X_WB, -n)
        return None if a is None or b is None else -b - a

    first = gaps(_DIRECTIONS)
    if first is None:
        return None
    best, direction = -np.inf, _DIRECTIONS[0]
    n_starts = 1 if first.max() > 0.0 else 3  # of bodies apart the gap has one summit, of others many
    for start in _DIRECTIONS[np.argsort(-first)[:n_starts]]:
        value, n, reach = float(gaps(start[None])[0]), start, 0.05  # type: ignore[index]
        for _ in range(MAX_TURNS):
            if reach < 1e-10:
                break
            tries = n + reach * _STEPS
            tries /= np.linalg.norm(tries, axis=1)[:, None]
            values = gaps(tries)
            k = int(np.argmax(values))  # type: ignore[arg-type]
            if values[k] > value:  # type: ignore[index]
                value, n, reach = float(values[k]), tries[k], min(2.0 * reach, 0.3)  # type: ignore[index]
            else:
                reach *= 0.5
        if value > best:
            best, direction = value, n
    return best, direction
