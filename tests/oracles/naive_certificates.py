"""Certificates of fields judged by their definition, in integers: every vertex of every item, plane by plane. Shares no
code with the engine; fields are read as their arguments say.
"""

from __future__ import annotations

from fractions import Fraction
from math import lcm

import naive
import numpy as np
from exact_simplex import nearest_to_origin, solved
from naive_triangles import inner, minus
from solid_membership import windings

import collide


def placed(points, X: np.ndarray) -> list[list[Fraction]]:
    """R v + t of points of fractions."""
    rows = [[Fraction(v) for v in row] for row in X[:3].tolist()]
    return [[inner(row, p) + row[3] for row in rows] for p in points]


def exact(points) -> list[list[Fraction]]:
    return [[Fraction(v) for v in p] for p in np.asarray(points, dtype=float).tolist()]


def items_of(field) -> list[tuple[list[list[float]], float]]:
    """(vertices, radius) of the balls of a cloud, swept triangles, or prisms below terrain, in the field's frame."""
    if isinstance(field, collide.PointCloud):
        return [([p], r) for p, r in zip(field.points.tolist(), field.radii.tolist())]
    if isinstance(field, collide.SweptMesh):
        return [(field.mesh.vertices[face].tolist(), field.radius) for face in field.mesh.faces]
    (r, c), (dx, dy) = field.heights.shape, field.cell.tolist()
    x = [float(Fraction(2 * k - c + 1, 2) * Fraction(dx)) for k in range(c)]
    y = [float(Fraction(2 * k - r + 1, 2) * Fraction(dy)) for k in range(r)]
    z, prisms = field.heights.tolist(), []
    for i in range(r - 1):
        for j in range(c - 1):
            around = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)]
            if any(z[k][l] != z[k][l] for k, l in around):
                continue
            for third in (1, 3):
                grid = [around[0], around[2], around[third]]
                prisms.append(([[x[l], y[k], h] for k, l in grid for h in (z[k][l], field.bottom)], 0.0))
    return prisms


def _plane(n, offset: Fraction, unit: int) -> tuple:
    """A half-space in whole numbers, of points in the unit 1/unit."""
    scale = lcm(*(v.denominator for v in (*n, offset)))
    return None, [int(v * scale) for v in n], int(offset * scale * unit)


class FieldJudge:
    """A field and a body of convex parts at poses (4, 4)."""

    def __init__(self, field, body, X_WF: np.ndarray, X_WS: np.ndarray):
        self.is_solid = isinstance(field, collide.SweptMesh) and field.mesh.solid
        items = items_of(field)
        vertices = list(dict.fromkeys(tuple(p) for points, _ in items for p in points))
        place = {p: k for k, p in enumerate(vertices)}
        self.items = [([place[p] for p in sorted({tuple(p) for p in points})], Fraction(r)) for points, r in items]
        self.vertices = placed(exact(vertices), X_WF)
        #: Vertices of points and radius, or normal and offset of half-spaces.
        self.parts: list[tuple] = []
        for shape, X_SP in body.items if isinstance(body, collide.Compound) else [(body, np.eye(4))]:
            if isinstance(shape, collide.Halfspace):
                assert (X_SP == np.eye(4)).all()
                turned = [[Fraction(X_WS[k, i]) for k in range(3)] for i in range(3)]
                n = solved(turned, [Fraction(v) for v in shape.normal.tolist()])
                self.parts.append((None, n, Fraction(shape.offset) + inner(n, [Fraction(v) for v in X_WS[:3, 3]])))
                continue
            points, radius = naive.corners(shape)
            self.parts.append((placed(placed(exact(points), X_SP), X_WS), Fraction(radius), None))
        numbers = [v for p in self.vertices for v in p] + [r for _, r in self.items]
        numbers += [v for points, r, _ in self.parts if points for v in [r, *(v for p in points for v in p)]]
        unit = lcm(*{v.denominator for v in numbers})
        self.vertices = [[int(v * unit) for v in p] for p in self.vertices]
        self.items = [(corners, int(r * unit)) for corners, r in self.items]
        self.parts = [
            ([[int(v * unit) for v in p] for p in points], int(r * unit), None) if points else _plane(r, offset, unit)
            for points, r, offset in self.parts
        ]
        self._windings: dict[tuple[int, int], int] = {}
        self.faces = [corners for corners, _ in self.items]
        if self.is_solid:  # corners in the order of the faces, from which the winding follows
            self.faces = [[place[tuple(p)] for p in points] for points, _ in items]

    def proves(self, certificates, *, hit: bool) -> bool:
        """Whether certificates (kind, item, part, rows), the field first, prove the boolean."""
        return self._prove_hit(certificates) if hit else self._prove_gap(certificates)

    def _prove_hit(self, certificates) -> bool:
        if len(certificates) != 1:
            return False
        kind, i, j, rows = certificates[0]
        if kind not in ("together", "inside") or not 0 <= j < len(self.parts):
            return False
        points, radius, offset = self.parts[j]
        if kind == "inside":
            is_named = self.is_solid and i == len(self.items) and points is not None and len(rows) == 1
            return is_named and rows[0][0] == -1 and 0 <= rows[0][1] < len(points) and self.winding(j, rows[0][1]) > 0
        if not 0 <= i < len(self.items):
            return False
        corners, own = self.items[i]
        if points is None:
            return any(0 <= p < len(corners) and self._reaches(radius, offset, corners[p], own) for p, _ in rows)
        if not 1 <= len(rows) <= 4 or not all(0 <= p < len(corners) and 0 <= q < len(points) for p, q in rows):
            return False
        away = [minus(self.vertices[corners[p]], points[q]) for p, q in rows]
        return nearest_to_origin(away).square <= (own + radius) ** 2

    def _prove_gap(self, certificates) -> bool:
        if any(kind != "plane" or i != -1 or not 0 <= j < len(self.parts) for kind, i, j, _ in certificates):
            return False
        return all(
            self._parted(j, [rows[0] for _, _, k, rows in certificates if k == j]) for j in range(len(self.parts))
        )

    def _parted(self, j: int, normals) -> bool:
        points, radius, offset = self.parts[j]
        if points is None:
            clear = not any(self._reaches(radius, offset, k, own) for corners, own in self.items for k in corners)
            return bool(normals) and clear
        remaining = self.items
        for n in normals:
            top, square = max(inner(n, q) for q in points), inner(n, n)
            heights = [inner(n, p) - top for p in self.vertices]
            remaining = [
                item for item in remaining
                if (least := min(heights[k] for k in item[0])) <= 0 or least**2 <= (item[1] + radius) ** 2 * square
            ]
        return not remaining and (not self.is_solid or self.winding(j, 0) == 0)

    def _reaches(self, n, offset: int, vertex: int, radius: int) -> bool:
        height = inner(n, self.vertices[vertex]) - offset
        return height <= 0 or height**2 <= radius**2 * inner(n, n)

    def winding(self, j: int, vertex: int) -> int:
        """How often a solid winds around a vertex of a part, 1 on a facet."""
        if (j, vertex) not in self._windings:
            self._windings[j, vertex] = self._winding(j, vertex)
        return self._windings[j, vertex]

    def _winding(self, j: int, vertex: int) -> int:
        origin = self.parts[j][0][vertex]
        away = [minus(p, origin) for p in self.vertices]
        scale = max(abs(v) for p in away for v in p)
        corners = [[[Fraction(v, scale) for v in away[k]] for k in face] for face in self.faces]
        number = windings(corners, np.zeros((1, 3)))[0]
        return 1 if number is None else number
