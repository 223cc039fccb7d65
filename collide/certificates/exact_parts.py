"""Convex parts at their poses as exact numbers: vertices as integers on one grid, planes and matrices as fractions."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from collide.lowering.convex_sets import HALFSPACE, POINTS, ConvexSet, convex_set
from collide.numerics.exact_points import PlacedPoints
from collide.numerics.exact_vectors import cross, inner
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape

if TYPE_CHECKING:
    from collide.lowering.packed_convex import PackedConvex

IDENTITY = np.eye(4)


#: A vector of fractions.
Exact3 = tuple[Fraction, Fraction, Fraction]


class ExactPart:
    """Points swept by a ball, a cylinder, cone or ellipsoid, or a half-space, placed by poses whose entries are taken
    as exact numbers.

    points_P : (n, 3) [m].   radius : of the ball [m].   params : doubles, as of `convex_sets.ConvexSet`: (normal,
    offset) of a half-space, (radius, half length) or three radii of the curved kinds.
    poses : (4, 4), the outermost first; kept with the innermost first, without identities.
    """

    def __init__(self, kind: int, points_P: np.ndarray, radius: float, params, *poses: np.ndarray):
        self.kind, self.points_P, self.params = kind, points_P, params
        self.radius = Fraction(radius)
        self.poses = tuple(X for X in poses[:0:-1] if not np.array_equal(X, IDENTITY)) + poses[:1]

    def __len__(self) -> int:
        return len(self.points_P)

    @cached_property
    def vertices(self) -> PlacedPoints:
        """The vertices in W [m]."""
        return PlacedPoints(self.points_P, self.poses)

    @cached_property
    def plane(self) -> tuple[Exact3, Fraction]:
        """(n, offset) of the half-space {x : n·x ≤ offset} in W: n = cof(R) m, offset = det(R) offset_P + n·t."""
        x, y, z, offset = (Fraction(v) for v in self.params[:4])
        rows, t = self.placement
        r0, r1, r2 = rows
        cofactors = cross(r1, r2), cross(r2, r0), cross(r0, r1)
        n = tuple(inner(c, (x, y, z)) for c in cofactors)
        return n, offset * inner(r0, cofactors[0]) + inner(n, t)  # type: ignore[return-value]

    def at(self, u: Exact3) -> Exact3:
        """R u + t, the place in W of a point of the part's frame."""
        rows, t = self.placement
        return inner(rows[0], u) + t[0], inner(rows[1], u) + t[1], inner(rows[2], u) + t[2]

    @cached_property
    def placement(self) -> tuple[tuple[Exact3, Exact3, Exact3], Exact3]:
        """(rows of R, t): the product of all poses takes a point p of the part's frame to R p + t in W."""
        rows: tuple = tuple(tuple(Fraction(int(i == k)) for k in range(3)) for i in range(3))
        t: tuple = (Fraction(0),) * 3
        for X in self.poses:
            entries = [[Fraction(v) for v in row] for row in X[:3].tolist()]
            columns = tuple(zip(*rows))
            rows = tuple(tuple(inner(row, c) for c in columns) for row in entries)
            t = tuple(inner(row, t) + row[3] for row in entries)
        return rows, t


def exact_parts(shape: Shape, X_WB: np.ndarray) -> list[ExactPart]:
    """The convex parts of a shape at a pose (4, 4), in their order; poses of nested unions are multiplied exactly."""
    return [exact_part(convex_set(leaf), *poses[::-1]) for leaf, poses in leaves_of(shape, (X_WB,))]


def leaves_of(shape: Shape, poses: tuple[np.ndarray, ...] = ()) -> Iterator[tuple[Shape, tuple[np.ndarray, ...]]]:
    """The parts of a body in their order, each with the poses (4, 4) to be applied, the first pose first."""
    if isinstance(shape, Compound):
        for item, X in shape.items:
            yield from leaves_of(item, (X, *poses))
    else:
        yield shape, poses


def exact_part(part: ConvexSet | PackedConvex, *poses: np.ndarray) -> ExactPart:
    """A convex set at the product of poses (4, 4), the outermost first."""
    return ExactPart(part.kind, part.points, part.radius, part.params, *poses)


def has_exact_numbers(part: ExactPart) -> bool:
    """Whether a part is made of vertices or a plane: cylinders, cones and ellipsoids are not."""
    return part.kind in (POINTS, HALFSPACE)


def common_vertices(A: ExactPart, B: ExactPart) -> tuple[PlacedPoints, PlacedPoints, int]:
    """(vertices of A, vertices of B, e) as integers on one grid: in W they are these times 2^e [m]."""
    grid = min(A.vertices.grid, B.vertices.grid)
    return A.vertices.on_grid(grid), B.vertices.on_grid(grid), grid
