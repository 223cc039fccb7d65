"""The least translation known that parts two overlapping solids of facets, and a proven lower bound.

A point in both solids, a from the surface of A and b from the surface of B, is the middle of a ball of radius a in A
and of a ball of radius b in B: while B moves by less than a + b, the balls meet, and the solids with them. The largest
sum bounds the depth from below: at flat contacts, and where a corner has gone in, the sum is the depth; where two
edges cross, the sum is less. From above the shortest translation is shortened along directions all around, then along
directions nearer and nearer; the exact test tells translations by whether they separate.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from collide.lowering.facet_bodies import Body, body_of
from collide.narrowphase.facets.facet_kernel_calls import hits
from collide.narrowphase.facets.inner_balls import depth_of_solids, directions, distances_within
from collide.narrowphase.facets.separating_translation import length_of_step, shortest_separating
from collide.narrowphase.known_depth import Depth
from collide.shapes.shape import Shape

#: Points of a grid over the common box along each axis, vertices of each body at most, and the points with the largest
#: sums, around which others are tried so many times.
_GRID, _VERTICES, _BEST, _ROUNDS = 8, 400, 6, 12
#: Brackets narrower than this are not made narrower by balls.
_NARROW = 1.01
#: Directions all around, and lengths along each of them, as parts of the shortest known.
_AROUND, _LENGTHS = 160, (0.98, 0.93, 0.86, 0.77, 0.66, 0.52, 0.37)
#: Then directions beside the best: how far beside at first, and by which factor nearer, so many times.
_BESIDE, _NEARER, _TIMES, _NEAR = 0.6, 0.72, 22, 32


def key_of(shape: Shape) -> tuple:
    """Orders the bodies of a pair, so that swapped questions are worked out on the same numbers."""
    return body_of(shape).key


def least_depth(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, known: Depth) -> Depth:
    """The depth of two overlapping bodies of facets at poses (4, 4), no worse than a known one."""
    a, b = body_of(A), body_of(B)
    if a.solid and b.solid:
        known = known.at_least(largest_sum(a, b, X_WA, X_WB))
    known = shorter_depth(lambda X, Y: hits(a, b, X, Y), X_WA, X_WB, known)
    if a.solid and b.solid and known.least * _NARROW < known.proven:
        known = known.at_least(depth_of_solids(A, B, X_WA, X_WB, known.proven))
    return known


# --- from below ---------------------------------------------------------------------------------


def largest_sum(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray) -> float:
    """The largest sum found of the distances [m] to both surfaces from a point in both solids, with the radii; 0 where
    no point is found."""
    corners = [_corners(body, X) for body, X in ((A, X_WA), (B, X_WB))]
    low = np.maximum(corners[0].min(axis=0), corners[1].min(axis=0))
    high = np.minimum(corners[0].max(axis=0), corners[1].max(axis=0))
    if not (low < high).all():
        return 0.0
    steps = (np.arange(_GRID) + 0.5) / _GRID
    grid = low + (high - low) * np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    common = [c[((c >= low) & (c <= high)).all(axis=1)] for c in corners]
    points = np.concatenate([grid, *(c[:: len(c) // _VERTICES + 1] for c in common)])
    sums = _sums(A, B, X_WA, X_WB, points)
    scale = 0.5 * (high - low) / _GRID
    for _ in range(_ROUNDS):
        best = points[np.argsort(-sums, kind="stable")[:_BEST]]
        tried = (best[:, None] + scale * directions(_NEAR)).reshape(-1, 3)
        sums = np.concatenate([np.sort(sums)[::-1][:_BEST], _sums(A, B, X_WA, X_WB, tried)])
        points = np.concatenate([best, tried])
        scale = 0.65 * scale
    largest = float(sums.max())
    return (largest + A.radius + B.radius) * (1.0 - 2.0**-50) if largest > -math.inf else 0.0


def _corners(body: Body, X: np.ndarray) -> np.ndarray:
    """(k, 3) corners of a body's facets in the world, each once, but for rounding."""
    corners = np.unique(body.tree.triangles.reshape(-1, 3), axis=0)
    return corners @ X[:3, :3].T + X[:3, 3]


def _sums(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) proven lower bounds of the sums of distances from points (n, 3) to both surfaces; −∞ of points outside."""
    sums = distances_within(A, X_WA, points)
    some = np.flatnonzero(sums > -math.inf)
    sums[some] += distances_within(B, X_WB, points[some])
    return sums


# --- from above ---------------------------------------------------------------------------------


def shorter_depth(meet: Callable, X_WA: np.ndarray, X_WB: np.ndarray, known: Depth) -> Depth:
    """A depth no longer than a known one."""
    best = known

    def try_shorter(ways: np.ndarray, lengths: np.ndarray) -> bool:
        nonlocal best
        lengths = lengths[lengths > best.least]
        steps = (ways[:, None] * lengths[:, None]).reshape(-1, 3)
        step = shortest_separating(meet, X_WA, X_WB, steps, best.length)
        if step is None:
            return False
        length, proven = length_of_step(step)
        best = best._replace(length=length, proven=proven, normal=step / length)
        return True

    for _ in range(3):
        if not try_shorter(directions(_AROUND), best.length * np.array(_LENGTHS)):
            break
    beside = _BESIDE
    for _ in range(_TIMES):
        if not best.length > best.least * (1.0 + 2.0**-10):
            break
        ways = np.concatenate([best.normal[None], best.normal + beside * directions(_NEAR)])
        ways /= np.sqrt(np.square(ways).sum(axis=1))[:, None]
        if not try_shorter(ways, best.length * (1.0 - beside * np.array([0.01, 0.03, 0.1, 0.3, 0.6]))):
            beside *= _NEARER
    return best
