"""Judges space partitions in integers, from the planes of cells and the mesh alone: shares no code with the engine.

A cell is {x : every plane on its side}. Its corners are found by trying all threes of planes.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cmp_to_key
from itertools import combinations, pairwise
from math import gcd
from typing import NamedTuple

import numpy as np


class Verdict(NamedTuple):
    """What is wrong, in words, and what was looked at."""

    wrong: list[str]
    n_cells: int
    n_inside: int
    n_facet_tests: int
    volume: Fraction
    volume_inside: Fraction


class Judge:
    """Cells of a partition judged against its mesh, both on one grid of integers.

    vertices, faces : of the mesh.   box : (low, high) that the cells were clipped by.
    """

    def __init__(self, vertices, faces, box):
        numbers = [Fraction(float(x)) for x in np.ravel(vertices)] + [Fraction(float(x)) for x in np.ravel(box)]
        self.unit = max(x.denominator for x in numbers)
        self.vertices = [tuple(int(Fraction(float(x)) * self.unit) for x in v) for v in np.asarray(vertices)]
        self.triangles = [tuple(self.vertices[k] for k in face) for face in np.asarray(faces).tolist()]

    def walls(self, planes) -> list[tuple[int, int, int, int]]:
        """Outward planes (a, b, c, d) of a cell, a x + b y + c z + d ≤ 0 inside, from `CellPlanes`."""
        out = []
        columns = (planes.facet.tolist(), planes.axis.tolist(), planes.value.tolist(), planes.side.tolist())
        for facet, axis, value, side in zip(*columns):
            if facet >= 0:
                plane = plane_of(*self.triangles[facet])
            else:
                v = Fraction(value) * self.unit
                plane = [0, 0, 0, -v.numerator]
                plane[axis] = v.denominator
            out.append(tuple(-side * x for x in plane))
        return out

    def judge(self, cells) -> Verdict:
        """All cells: no facet passes through one, what is said of inside is so, volumes."""
        wrong: list[str] = []
        volume, volume_inside, n_tests = Fraction(0), Fraction(0), 0
        boxes = [[(min(p[k] for p in t), max(p[k] for p in t)) for k in range(3)] for t in self.triangles]
        for i in range(len(cells)):
            walls = self.walls(cells.planes(i))
            corners = corners_of(walls)
            own = polytope_volume(walls, corners)
            if own <= 0:
                wrong.append(f"cell {i} has no volume")
                continue
            volume += own
            inside = winding(self.triangles, middle(corners)) > 0
            volume_inside += own if inside else 0
            if inside != bool(cells.inside[i]):
                wrong.append(f"cell {i} is {'inside' if inside else 'outside'}, and said not to be")
            low = [min(p[k] // p[3] for p in corners) for k in range(3)]
            high = [max(-(-p[k] // p[3]) for p in corners) for k in range(3)]
            for f, b in enumerate(boxes):
                if any(b[k][0] > high[k] or b[k][1] < low[k] for k in range(3)):
                    continue
                n_tests += 1
                if passes_through(self.triangles[f], walls):
                    wrong.append(f"facet {f} passes through cell {i}")
        scale = Fraction(1, self.unit**3)
        return Verdict(wrong, len(cells), int(cells.inside.sum()), n_tests, volume * scale, volume_inside * scale)

    def mesh_volume(self) -> Fraction:
        """Signed volume of the mesh."""
        return Fraction(sum(det3(*t) for t in self.triangles), 6 * self.unit**3)


def det3(a, b, c) -> int:
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def cross3(u, v) -> tuple:
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def dot3(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def minus(u, v) -> tuple:
    return (u[0] - v[0], u[1] - v[1], u[2] - v[2])


def plane_of(a, b, c) -> list[int]:
    n = cross3(minus(b, a), minus(c, a))
    return [*n, -dot3(n, a)]


def height(plane, point) -> int:
    """Of a homogeneous point (x, y, z, w), w > 0."""
    return dot3(plane, point) + plane[3] * point[3]


def corners_of(walls) -> list[tuple[int, int, int, int]]:
    """Corners of the polytope, homogeneous, each once."""
    found = set()
    for p, q, r in combinations(walls, 3):
        w = det3(p, q, r)
        if w == 0:
            continue
        qr, rp, pq = cross3(q, r), cross3(r, p), cross3(p, q)
        xyz = [-(p[3] * qr[k] + q[3] * rp[k] + r[3] * pq[k]) for k in range(3)]
        if w < 0:
            xyz, w = [-x for x in xyz], -w
        point = (*xyz, w)
        if all(height(plane, point) <= 0 for plane in walls):
            common = gcd(*point)
            found.add(tuple(x // common for x in point))
    return sorted(found)


def middle(points) -> tuple[Fraction, ...]:
    return tuple(sum(Fraction(p[k], p[3]) for p in points) / len(points) for k in range(3))


def polytope_volume(walls, corners) -> Fraction:
    """Of cones from the first corner over the faces."""
    if len(corners) < 4:
        return Fraction(0)
    points = [tuple(Fraction(p[k], p[3]) for k in range(3)) for p in corners]
    apex, total = points[0], Fraction(0)
    for wall in set(walls):
        on = [p for p, h in zip(points, corners) if height(wall, h) == 0]
        if len(on) < 3 or apex in on:
            continue
        first, n = on[0], wall[:3]

        def turn(a, b, first=first, n=n):
            s = dot3(n, cross3(minus(a, first), minus(b, first)))
            return -1 if s > 0 else int(s < 0)

        rim = sorted(on[1:], key=cmp_to_key(turn))
        total += sum(det3(minus(first, apex), minus(a, apex), minus(b, apex)) for a, b in pairwise(rim))
    return total / 6


def passes_through(triangle, walls) -> bool:
    """Whether a triangle has points strictly inside all walls."""
    polygon = [(*p, 1) for p in triangle]
    for wall in walls:
        heights = [height(wall, p) for p in polygon]
        clipped = []
        for (p, h), (q, k) in zip(zip(polygon, heights), zip(polygon[1:] + polygon[:1], heights[1:] + heights[:1])):
            if h <= 0:
                clipped.append(p)
            if h * k < 0:
                new = [abs(k) * x + abs(h) * y for x, y in zip(p, q)]
                common = gcd(*new)
                clipped.append(tuple(x // common for x in new))
        polygon = clipped
        if not polygon:
            return False
    point = middle(polygon)
    return all(dot3(wall, point) + wall[3] < 0 for wall in walls)


def winding(triangles, point) -> int:
    """How often triangles wind around a rational point that is on none, by a ray in a direction of chance."""
    for direction in ((101, 37, 11), (-7, 89, 23), (13, -5, 97), (-61, -47, 29), (31, 71, -59)):
        total = 0
        for a, b, c in triangles:
            u, v, w = minus(a, point), minus(b, point), minus(c, point)
            turns = [dot3(direction, cross3(p, q)) for p, q in ((u, v), (v, w), (w, u))]
            if min(turns) < 0 < max(turns):
                continue
            if 0 in turns and any(turns):
                break
            if not any(turns):
                continue  # no area, or parallel to the ray: its neighbours tell
            volume = det3(u, v, w)
            ahead = volume > 0 if turns[0] > 0 else volume < 0
            total += (1 if turns[0] > 0 else -1) if ahead else 0
        else:
            return total
    raise AssertionError("every ray passes an edge")
