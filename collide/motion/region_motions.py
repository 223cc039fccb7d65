"""Motions with a region of half-spaces as a body: the region closed by a box around the whole way of the other body."""

from __future__ import annotations

import numpy as np

from collide.lowering.closed_regions import closed_shapes, reach_of
from collide.motion.motions import Motions
from collide.shapes.shape import Shape

#: More than what differences of lengths round.
_UP = 1 + 2.0**-20


def with_regions_closed(
    shapes: list[Shape], a: np.ndarray, b: np.ndarray, motions: Motions
) -> tuple[list[Shape], np.ndarray, np.ndarray]:
    """(shapes, numbers of A, of B) with regions closed; regions of a pair of unbounded shapes stay.

    shapes : distinct.   a, b : (n,) numbers of the shapes A and B, motion by motion.
    """
    is_region = np.array([shape.is_region for shape in shapes], dtype=bool)
    if not is_region.any():
        return shapes, a, b
    is_unbounded = np.array([not reach_of(shape) < np.inf for shape in shapes], dtype=bool)
    some = np.flatnonzero((is_region[a] | is_region[b]) & ~(is_unbounded[a] & is_unbounded[b]))
    if not len(some):
        return shapes, a, b
    motions = motions.picked(some)
    start, end = (
        np.broadcast_to(np.linalg.norm((X_WB - X_WA)[:, :3, 3], axis=1), len(some))
        for X_WA, X_WB in ((motions.X_WA0, motions.X_WB0), (motions.X_WA1, motions.X_WB1))
    )
    # Origins move on lines, so that they are farthest from each other at an end.
    leeway = np.maximum(end - start, 0.0) * _UP
    A, B = ([shapes[k] for k in which[some].tolist()] for which in (a, b))
    sides = closed_shapes(A, B, motions.X_WA0, motions.X_WB0, len(some), leeway)
    shapes, numbers = list(shapes), {id(shape): k for k, shape in enumerate(shapes)}
    a, b = a.copy(), b.copy()
    for which, side in zip((a, b), sides):
        for k, shape in zip(some.tolist(), side):
            if id(shape) not in numbers:
                numbers[id(shape)] = len(shapes)
                shapes.append(shape)
            which[k] = numbers[id(shape)]
    return shapes, a, b
