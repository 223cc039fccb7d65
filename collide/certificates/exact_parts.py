"""Convex parts at their poses as exact numbers: vertices as integers on one grid, planes as fractions."""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from collide.lowering.convex_sets import HALFSPACE, POINTS, ConvexSet, sets_of
from collide.numerics.exact_points import PlacedPoints
from collide.numerics.exact_vectors import cross, inner

if TYPE_CHECKING:
    from collide.lowering.packed_convex import PackedConvex

IDENTITY = np.eye(4)


class ExactPart:
    """Points swept by a ball, or a half-space, at the pose X_WB X_BP, entries taken as exact numbers.

    points_P : (n, 3) [m].   radius : of the ball [m].   plane_P : (normal, offset), four doubles, of a half-space.
    """

    def __init__(self, kind: int, points_P: np.ndarray, radius: float, plane_P, X_WB: np.ndarray, X_BP: np.ndarray):
        self.kind, self.points_P, self.plane_P = kind, points_P, plane_P
        self.radius = Fraction(radius)
        self._poses = (X_WB,) if np.array_equal(X_BP, IDENTITY) else (X_BP, X_WB)

    def __len__(self) -> int:
        return len(self.points_P)

    @cached_property
    def vertices(self) -> PlacedPoints:
        """The vertices in W [m]."""
        return PlacedPoints(self.points_P, self._poses)

    @cached_property
    def plane(self) -> tuple[tuple[Fraction, Fraction, Fraction], Fraction]:
        """(n, offset) of the half-space {x : n·x ≤ offset} in W: n = cof(R) m, offset = det(R) offset_P + n·t."""
        x, y, z, offset = (Fraction(v) for v in self.plane_P)
        n = x, y, z
        for X in self._poses:
            entries = [[Fraction(v) for v in row] for row in X[:3].tolist()]
            r0, r1, r2 = ((row[0], row[1], row[2]) for row in entries)
            cofactors = cross(r1, r2), cross(r2, r0), cross(r0, r1)
            n = inner(cofactors[0], n), inner(cofactors[1], n), inner(cofactors[2], n)
            offset = offset * inner(r0, cofactors[0]) + inner(n, [row[3] for row in entries])
        return n, offset


def exact_parts(shape, X_WB: np.ndarray) -> list[ExactPart]:
    """The convex parts of a shape at a pose (4, 4), in their order."""
    return [exact_part(part, X_WB, X_BP) for part, X_BP in sets_of(shape)]


def exact_part(part: ConvexSet | PackedConvex, X_WB: np.ndarray, X_BP: np.ndarray = IDENTITY) -> ExactPart:
    return ExactPart(part.kind, part.points, part.radius, part.params, X_WB, X_BP)


def has_exact_numbers(part: ExactPart) -> bool:
    """Whether a part is made of vertices or a plane: cylinders, cones and ellipsoids are not."""
    return part.kind in (POINTS, HALFSPACE)


def common_vertices(A: ExactPart, B: ExactPart) -> tuple[PlacedPoints, PlacedPoints, int]:
    """(vertices of A, vertices of B, e) as integers on one grid: in W they are these times 2^e [m]."""
    grid = min(A.vertices.grid, B.vertices.grid)
    return A.vertices.on_grid(grid), B.vertices.on_grid(grid), grid
