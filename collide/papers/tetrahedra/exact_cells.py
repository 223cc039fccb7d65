"""What two tetrahedra share, in fractions: for pairs that doubles and double-doubles leave open."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from collide.numerics.exact_points import Point
from collide.numerics.exact_vectors import cross, inner, minus

#: Corners of a face, opposite to the corner of its number, counter-clockwise from there.
_FACES = ((1, 3, 2), (0, 2, 3), (0, 3, 1), (0, 1, 2))
#: Shares of corners of the whole cell, and heights over the other's faces, of a point.
_Row = list[Fraction]


class Shared(NamedTuple):
    """The common part of two cells: its volume, and its centroid where it has a volume, in the corners' unit."""

    volume: Fraction
    centroid: tuple[Fraction, Fraction, Fraction] | None


def shared_part(A: list[Point], B: list[Point]) -> Shared:
    """Of two positively oriented tetrahedra with corners in integers. Up to some milliseconds."""
    heights = [_heights_over(B, face, A) for face in _FACES]
    if any(max(row) <= 0 for row in heights) or any(max(_heights_over(A, face, B)) <= 0 for face in _FACES):
        return Shared(Fraction(0), None)
    cutting = [row for row in heights if min(row) < 0]
    # Points are rows: their shares of A's corners, then the heights that still cut.
    corners = [[Fraction(i == k) for i in range(4)] + [Fraction(row[k]) for row in cutting] for k in range(4)]
    simplices = [(Fraction(1), corners)]
    for face in range(4, 4 + len(cutting)):
        simplices = [part for weight, points in simplices for part in _inside(weight, points, face)]
    share = sum((weight for weight, _ in simplices), Fraction(0))
    if not share:
        return Shared(share, None)
    shares = [sum(w * sum(p[k] for p in points) for w, points in simplices) / (4 * share) for k in range(4)]
    x, y, z = (sum((s * p[axis] for s, p in zip(shares, A)), Fraction(0)) for axis in range(3))
    return Shared(share * determinant(A) / 6, (x, y, z))


def determinant(cell: list[Point]) -> int:
    """Six times a cell's volume, positive where corner 3 sees the others counter-clockwise."""
    a, b, c, d = cell
    return inner(cross(minus(b, a), minus(c, a)), minus(d, a))


def _heights_over(cell: list[Point], face: tuple[int, int, int], points: list[Point]) -> list[int]:
    a, b, c = (cell[k] for k in face)
    normal = cross(minus(b, a), minus(c, a))
    return [inner(normal, minus(p, a)) for p in points]


def _inside(weight: Fraction, points: list[_Row], face: int) -> list[tuple[Fraction, list[_Row]]]:
    """The part of a simplex of this volume where value number ``face`` is positive, as simplices."""
    inner_points = [p for p in points if p[face] > 0]
    outer_points = [p for p in points if p[face] <= 0]
    if not inner_points or not any(p[face] < 0 for p in outer_points):
        return [(weight, points)] if inner_points else []
    # How far from p to q the plane is.
    v = [[p[face] / (p[face] - q[face]) for q in outer_points] for p in inner_points]
    cut = [
        [[x + (y - x) * v[i][j] for x, y in zip(p, q)] for j, q in enumerate(outer_points)]
        for i, p in enumerate(inner_points)
    ]
    if len(inner_points) == 1:
        return [(weight * v[0][0] * v[0][1] * v[0][2], [inner_points[0], *cut[0]])]
    if len(inner_points) == 2:
        prism = [inner_points[0], *cut[0], inner_points[1], *cut[1]]
        weights = [v[0][0] * v[0][1], (1 - v[0][0]) * v[0][1] * v[1][0], (1 - v[0][1]) * v[1][0] * v[1][1]]
    else:
        a, b, c = (row[0] for row in v)
        prism = [*inner_points, *(row[0] for row in cut)]
        weights = [a, (1 - a) * b, (1 - a) * (1 - b) * c]
    return [(weight * w, prism[k : k + 4]) for k, w in enumerate(weights) if w]
