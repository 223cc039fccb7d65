"""Terrain in fractions: what `collide.HeightField` is by its definition, sharing nothing with its mesh.

Its triangles here are others: walls cut along their other diagonals, and the bottom cell by cell.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from naive_triangles import as_integers, facet_pairs, squared_distance, surface_distance


class Terrain:
    """Heights (r, c) over cells (dx, dy), centred, solid down to a bottom."""

    def __init__(self, heights, cell, bottom):
        self.z = [[Fraction(float(h)) for h in row] for row in heights]
        self.bottom = Fraction(float(bottom))
        dx, dy = (cell, cell) if np.ndim(cell) == 0 else cell
        self.x, self.y = self._line(len(self.z[0]), dx), self._line(len(self.z), dy)

    @staticmethod
    def _line(n: int, side) -> list[Fraction]:
        """(k − (n − 1)/2)·side, rounded to the nearest double."""
        return [Fraction(float((Fraction(k) - Fraction(n - 1, 2)) * Fraction(float(side)))) for k in range(n)]

    def cell_at(self, x, y) -> tuple[int, int, Fraction, Fraction] | None:
        """(row, column) of the cell below a place and where in it, both from 0 to 1; None beside the field."""
        if not (self.x[0] <= x <= self.x[-1] and self.y[0] <= y <= self.y[-1]):
            return None
        j = max(k for k in range(len(self.x) - 1) if self.x[k] <= x)
        i = max(k for k in range(len(self.y) - 1) if self.y[k] <= y)
        u = (x - self.x[j]) / (self.x[j + 1] - self.x[j])
        v = (y - self.y[i]) / (self.y[i + 1] - self.y[i])
        return i, j, u, v

    def height(self, x, y) -> Fraction | None:
        """z of the surface over a place; None beside the field."""
        place = self.cell_at(x, y)
        if place is None:
            return None
        i, j, u, v = place
        low, high, z = self.z[i][j], self.z[i + 1][j + 1], self.z
        if u >= v:
            return low + u * (z[i][j + 1] - low) + v * (high - z[i][j + 1])
        return low + v * (z[i + 1][j] - low) + u * (high - z[i + 1][j])

    def holds(self, p) -> bool:
        x, y, z = (Fraction(v) for v in p)
        height = self.height(x, y)
        return height is not None and self.bottom <= z <= height

    def triangles(self) -> list[list[tuple[Fraction, Fraction, Fraction]]]:
        """The surface, any way round."""
        x, y, z, low = self.x, self.y, self.z, self.bottom
        rows, columns = range(len(y) - 1), range(len(x) - 1)

        def top(i, j):
            return x[j], y[i], z[i][j]

        def under(i, j):
            return x[j], y[i], low

        found = []
        for i in rows:
            for j in columns:
                found += [[top(i, j), top(i + 1, j + 1), top(*k)] for k in ((i, j + 1), (i + 1, j))]
                found += [[under(i, j + 1), under(i + 1, j), under(*k)] for k in ((i, j), (i + 1, j + 1))]
        edges = [((i, j), (i, j + 1)) for i in (0, len(y) - 1) for j in columns]
        edges += [((i, j), (i + 1, j)) for j in (0, len(x) - 1) for i in rows]
        for one, other in edges:
            found += [[top(*one), under(*one), top(*other)], [under(*one), top(*other), under(*other)]]
        return found

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """(vertices, faces) of the triangles, loose."""
        points = np.array([[float(v) for v in p] for triangle in self.triangles() for p in triangle])
        return points, np.arange(len(points)).reshape(-1, 3)

    def meets(self, vertices, faces, X) -> bool:
        """Whether a closed polytope that is not larger than the field shares a point with it. X : its pose here."""
        inside = any(self.holds(p) for p in _exactly_placed(vertices, X))
        return inside or bool(facet_pairs(*self.arrays(), np.eye(4), vertices, faces, X))

    def squared_gap(self, vertices, faces, X) -> Fraction:
        """From the surface to that of a polytope."""
        return surface_distance(*self.arrays(), np.eye(4), vertices, faces, X)[0]

    def squared_distance(self, p) -> Fraction:
        """From the surface to a point."""
        triangles = self.triangles()
        points = [list(q) for triangle in triangles for q in triangle]
        exact = [[Fraction(v) for v in p]]
        scale = max(x.denominator for q in points + exact for x in q)
        (own,), corners = as_integers(exact, points)
        squares = [squared_distance([own] * 3, corners[k : k + 3]) for k in range(0, len(corners), 3)]
        return min(squares) / Fraction(scale) ** 2


def _exactly_placed(vertices, X):
    R, t = [[Fraction(v) for v in row[:3]] for row in X[:3].tolist()], [Fraction(row[3]) for row in X[:3].tolist()]
    for p in np.asarray(vertices, dtype=float).tolist():
        yield [sum((r * Fraction(x) for r, x in zip(R[k], p)), t[k]) for k in range(3)]
