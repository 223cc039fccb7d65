"""Booleans with a security margin: whether two bodies come within a distance of each other.

The proven bracket of the distance decides, lower > margin or upper ≤ margin. Where the margin lies inside it, in its last
digits, one body is grown by the margin instead, and whether it meets the other is decided in integers as any boolean is: a ball
swept over points adds to a radius without rounding wherever the sum of the two is a double. What is left open, next to
curved surfaces, meshes and unions, counts as within.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np

from collide import reading
from collide.batches import ask
from collide.errors import InvalidArgument
from collide.geometry.packing import POINTS
from collide.results import UNDECIDED
from collide.shapes.base import Shape, is_plain
from collide.shapes.hull import ConvexHull
from collide.transforms import LARGEST, SMALLEST

#: (A, B, X_WA, X_WB) of a pair, poses (4, 4).
Pair = tuple[Shape, Shape, np.ndarray, np.ndarray]


def checked_margin(name: str, value) -> float:
    """A margin [m] as given: 0, or of a size that a body may have. Raises InvalidArgument."""
    margin = reading.limit(name, value)
    if margin and not SMALLEST <= margin <= LARGEST:
        raise InvalidArgument(f"{name} must be 0 or within [{SMALLEST:g}, {LARGEST:g}] m, got {reading.told(value)}")
    return margin


def within(rows: np.ndarray, margin: float, pair: Callable[[int], Pair]) -> np.ndarray:
    """bool[n]: which pairs of rows, asked up to a distance of at least ``margin`` [m], are at most that far apart.

    pair : the question of row k; asked for those that their bracket leaves open.
    """
    near = rows["hit"] | (rows["lower"] <= margin)
    for k in np.flatnonzero(near & ~rows["hit"] & (rows["upper"] > margin)).tolist():
        near[k] = _meets_grown(*pair(k), margin)
    return near


def _meets_grown(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, margin: float) -> bool:
    grown = _grown(A, margin)
    if grown is not None:
        A = grown
    else:
        grown = _grown(B, margin)
        if grown is None:
            return True
        B = grown
    row = ask(A, B, X_WA[None], X_WB[None], False, 0.0, False, 1, depths=False)[0]
    return bool(row["hit"] or row["how"] == UNDECIDED)


def _grown(shape: Shape, margin: float) -> Shape | None:
    """All points within a margin of a shape, exactly; None where that is not to be had."""
    if not is_plain(shape):
        return None
    packed = shape.parts()[0][0]
    radius = packed.radius + margin
    if packed.kind != POINTS or packed.slop > 0.0 or Fraction(packed.radius) + Fraction(margin) != Fraction(radius):
        return None
    return ConvexHull(packed.points, radius=radius)
