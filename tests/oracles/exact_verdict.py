"""Oracle for whether two shapes meet: proven apart, proven overlapping, or a common point in fractions.

`curved_oracle` proves a bracket of the signed distance in 80 digits, which bodies that touch exactly leave open: closed
sets touch where they share a point, and a point whose coordinates are fractions is in a body or is not. Points are
proposed from anywhere, and checked here; nothing is shared with the engine.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

import numpy as np
from curved_oracle import bracket

import collide

Point = tuple[Fraction, Fraction, Fraction]

#: Witness points are rounded to multiples of these.
_DENOMINATORS = (2, 4, 8, 16, 64, 1024, 10, 100, 3 * 2**10)


def verdict(A, B, X_WA, X_WB, points: Iterable = ()) -> str:
    """"apart"; "overlap", by more than nothing; "touch": they share a point, and how deep they overlap, if they do, is
    less than what 80 digits and a search tell; or "open".

    points : (3,) near where they may touch, in the world.
    """
    proven = bracket(A, B, X_WA, X_WB)
    if proven.lower > 0:
        return "apart"
    if proven.upper < 0:
        return "overlap"
    for point in points:
        if any(holds(A, X_WA, p) and holds(B, X_WB, p) for p in _candidates(point)):
            return "touch"
    return "open"


def _candidates(point) -> Iterable[Point]:
    values = np.asarray(point, dtype=float).tolist()
    for denominator in _DENOMINATORS:
        x, y, z = (Fraction(round(value * denominator), denominator) for value in values)
        yield x, y, z


def holds(shape, X, p: Point) -> bool:
    """Whether a closed body holds a point, exactly: the numbers of the shape and of its pose are the problem."""
    R = [[Fraction(float(x)) for x in row[:3]] for row in np.asarray(X)[:3]]
    t = [Fraction(float(row[3])) for row in np.asarray(X)[:3]]
    d = [a - b for a, b in zip(p, t)]
    if isinstance(shape, collide.Sphere):
        return _square(d) <= Fraction(shape.radius) ** 2
    if isinstance(shape, collide.Capsule):
        half = Fraction(shape.length) / 2
        axis = [row[2] for row in R]
        along = max(-half, min(half, _dot(d, axis) / _square(axis)))
        return _square([a - along * b for a, b in zip(d, axis)]) <= Fraction(shape.radius) ** 2
    q = solve(R, d)
    if isinstance(shape, collide.Box):
        return all(abs(2 * x) <= Fraction(float(size)) for x, size in zip(q, shape.size))
    if isinstance(shape, collide.Ellipsoid):
        return sum((x / Fraction(float(radius))) ** 2 for x, radius in zip(q, shape.radii)) <= 1
    if isinstance(shape, (collide.Cylinder, collide.Cone)):
        radius, length = Fraction(shape.radius), Fraction(shape.length)
        if isinstance(shape, collide.Cone):
            radius *= (length / 2 - q[2]) / length
        return abs(2 * q[2]) <= length and q[0] ** 2 + q[1] ** 2 <= radius**2
    if isinstance(shape, collide.Mesh):
        corners = [[tuple(map(Fraction, v)) for v in triangle] for triangle in shape.vertices[shape.faces].tolist()]
        if shape.solid:
            raise NotImplementedError("solid meshes: judge their surfaces")
        return any(_in_triangle(q, *triangle) for triangle in corners)
    return _in_hull(q, [tuple(map(Fraction, v)) for v in np.asarray(shape.points).tolist()])


def solve(R, d) -> list[Fraction]:
    """The q with R q = d, by Cramer's rule."""
    det = _det(R)
    return [_det([[d[i] if j == k else R[i][j] for j in range(3)] for i in range(3)]) / det for k in range(3)]


def _det(M) -> Fraction:
    return _dot(M[0], _cross(M[1], M[2]))


def _dot(a, b) -> Fraction:
    return sum(x * y for x, y in zip(a, b))  # type: ignore[return-value]


def _square(a) -> Fraction:
    return _dot(a, a)


def _minus(a, b) -> list[Fraction]:
    return [x - y for x, y in zip(a, b)]


def _cross(a, b) -> list[Fraction]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _in_triangle(p, a, b, c) -> bool:
    normal = _cross(_minus(b, a), _minus(c, a))
    if _dot(normal, _minus(p, a)):
        return False
    sides = [_dot(normal, _cross(_minus(w, v), _minus(p, v))) for v, w in ((a, b), (b, c), (c, a))]
    return min(sides) >= 0


def _in_hull(p, points: list) -> bool:
    """Of points that are no flat set, few: p is outside where a plane through three of them has all of them behind it,
    and p before it.
    """
    n = len(points)
    if n > 12:
        raise NotImplementedError("hulls of many points: judge their facets")
    for i in range(n):
        for j in range(i + 1, n):
            for k in range(j + 1, n):
                normal = _cross(_minus(points[j], points[i]), _minus(points[k], points[i]))
                sides = [_dot(normal, _minus(q, points[i])) for q in points]
                before = _dot(normal, _minus(p, points[i]))
                if (max(sides) <= 0 < before and min(sides) < 0) or (min(sides) >= 0 > before and max(sides) > 0):
                    return False
    return True
