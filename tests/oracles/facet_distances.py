"""Squared distances of points from triangles as fractions: the least over corners, edges and the inside.

Shares no code with the engine. Coordinates are doubles, taken as they are. `to_facets` has the same in doubles.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from naive_triangles import cross, inner, minus


def exact_vector(values) -> list[Fraction]:
    return [x if isinstance(x, Fraction) else Fraction(float(x)) for x in values]


def square_to_triangle(point, triangle) -> Fraction:
    """The squared distance of a point (3,) from a triangle (3, 3)."""
    p, corners = exact_vector(point), [exact_vector(corner) for corner in triangle]
    squares = []
    for a, b in zip(corners, corners[1:] + corners[:1]):
        e, w = minus(b, a), minus(p, a)
        length = inner(e, e)
        t = min(max(inner(e, w) / length, Fraction(0)), Fraction(1)) if length else Fraction(0)
        away = [x - t * y for x, y in zip(w, e)]
        squares.append(inner(away, away))
    a, b, c = corners
    e, f, w = minus(b, a), minus(c, a), minus(p, a)
    n = cross(e, f)
    nn = inner(n, n)
    if nn:
        beta, gamma = inner(cross(w, f), n), inner(cross(e, w), n)
        if beta >= 0 and gamma >= 0 and beta + gamma <= nn:
            squares.append(Fraction(inner(n, w) ** 2, 1) / nn)
    return min(squares)


def nearest_square(point, triangles: np.ndarray) -> Fraction:
    """The least of all triangles (m, 3, 3); left out are those whose box is farther than the nearest corner."""
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    gap = np.maximum(np.maximum(low - point, point - high), 0.0)
    size = max(np.abs(triangles).max(), np.abs(point).max())  # squares neither vanish nor overflow
    gaps = np.sqrt(np.square(gap / size).sum(axis=1))
    corners = np.sqrt(np.square((triangles - point) / size).sum(axis=2))
    near = np.flatnonzero(gaps <= corners.min() * (1.0 + 1e-9) + 1e-300)
    return min(square_to_triangle(point, triangles[k]) for k in near.tolist())


def to_facets(points: np.ndarray, mesh) -> np.ndarray:
    """(n,) distances of points (n, 3) from the facets of a mesh, in doubles: edges, and the inside of each facet."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]][None] for k in range(3))
    p, squares = points[:, None], []
    for u, v in ((a, b), (b, c), (c, a)):
        t = np.clip(((p - u) * (v - u)).sum(axis=2) / ((v - u) ** 2).sum(axis=2), 0.0, 1.0)
        squares.append(((p - u - t[..., None] * (v - u)) ** 2).sum(axis=2))
    n = np.cross(b - a, c - a)
    height = ((p - a) * n).sum(axis=2)
    inside = np.all([(np.cross(v - u, p - u) * n).sum(axis=2) >= 0.0 for u, v in ((a, b), (b, c), (c, a))], axis=0)
    squares.append(np.where(inside, height**2 / (n**2).sum(axis=2), np.inf))
    return np.sqrt(np.min(squares, axis=0)).min(axis=1)
