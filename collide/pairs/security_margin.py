"""Booleans with a security margin: whether two bodies come within a distance of each other.

The proven bracket of the distance decides, lower > margin or upper ≤ margin. Where the margin lies inside it, in its
last digits, the bodies are grown by the margin instead, and whether they meet is decided in integers as any boolean is.
What is left open, next to curved surfaces, meshes and unions, counts as within.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.parts import convex_set_of, is_single_convex
from collide.lowering.split_sums import split_lengths
from collide.narrowphase.convex_batches import Question
from collide.pairs.batches import answer_batch
from collide.results import UNDECIDED
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.shape import Shape
from collide.transforms import LARGEST, SMALLEST

#: (A, B, X_WA, X_WB) of a pair, poses (4, 4).
Pair = tuple[Shape, Shape, np.ndarray, np.ndarray]


def checked_margin(name: str, value) -> float:
    """A margin [m] as given: 0, or of a size that a body may have. Raises InvalidArgument."""
    margin = checks.limit(name, value)
    if margin and not SMALLEST <= margin <= LARGEST:
        raise InvalidArgument(f"{name} must be 0 or within [{SMALLEST:g}, {LARGEST:g}] m, got {checks.brief(value)}")
    return margin


def within(rows: np.ndarray, margin: float, pair: Callable[[int], Pair]) -> np.ndarray:
    """bool[n]: whether pairs of rows, asked up to a distance of at least ``margin`` [m], are at most ``margin`` apart.

    pair : the question of row k; called for rows left open by their bracket.
    """
    near = rows["hit"] | (rows["lower"] <= margin)
    for k in np.flatnonzero(near & ~rows["hit"] & (rows["upper"] > margin)).tolist():
        near[k] = _meets_grown(*pair(k), margin)
    return near


def _meets_grown(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, margin: float) -> bool:
    grown = _grown(A, B, margin)
    if grown is None:
        return True
    row = answer_batch(*grown, X_WA[None], X_WB[None], Question(False, 0.0, depths=False))[0]
    return bool(row["hit"] or row["how"] == UNDECIDED)


def _grown(A: Shape, B: Shape, margin: float) -> tuple[Shape, Shape] | None:
    """Two shapes that meet exactly where A and B are within the margin; ``None`` where they are not to be had.

    Of two swept sets of points only the sum of the radii counts, nearly always the exact sum of two doubles. A
    half-space and a region stay.
    """
    sets = [None if S.is_region or not is_single_convex(S) else convex_set_of(S) for S in (A, B)]
    points = [packed for packed in sets if packed is not None and packed.kind == POINTS and packed.slop == 0.0]
    stay = [S.is_region or (packed is not None and packed.kind == HALFSPACE) for S, packed in zip((A, B), sets)]
    if not points or len(points) + sum(stay) < 2:
        return None
    radii = [packed.radius for packed in points] + [0.0]
    split = split_lengths(margin, radii[0], radii[1])
    if split is None or 0.0 < split[1] < SMALLEST or split[0] > LARGEST:
        return None
    first, rest = split
    if len(points) == 2:
        return ConvexHull(points[0].points, radius=first), ConvexHull(points[1].points, radius=rest)
    if rest != 0.0:
        return None
    grown = ConvexHull(points[0].points, radius=first)
    return (A, grown) if stay[0] else (grown, B)
