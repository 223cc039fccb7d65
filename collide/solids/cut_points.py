"""Points of an arrangement: exact coordinates, one id for each place, and doubles near them to begin a decision with.

A point is (x, y, z, w), integers, w > 0, without a common factor where points are compared by them: x/w, y/w, z/w in
units of the grid of `placed_facets.py`. Vertices keep their ids; where those of several bodies coincide, all
have the id of the first.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cmp_to_key
from typing import Any

import numpy as np

from collide.numerics.exact_points import Point
from collide.numerics.exact_vectors import inner
from collide.solids.placed_facets import PlacedFacets, quotient

Rational = tuple[int, int, int, int]
#: A determinant of two differences of rounded coordinates below D, each off by a unit of M, the largest of them: its
#: error is below 8 D · 2⁻⁵² M + 4 · 2⁻⁵³ D²; twice that.
_ERROR = 2.0**-48


class CutPoints:
    """Points by id: those below the number of vertices are vertices, the others were made by cutting."""

    def __init__(self, facets: PlacedFacets):
        self.facets = facets
        self.n_vertices = len(facets.local)
        self._ids: dict[Rational, int] = {}
        self._exact: dict[int, Rational] = {}
        self._near: dict[int, tuple[float, float, float]] = {}
        self.same_as: dict[int, int] = {}
        self.pierced = np.zeros((0, 3), dtype=np.int64)
        self.crossed = np.zeros((0, 3), dtype=np.int64)
        #: All points in doubles, once `rounded_points.near_points` was asked.
        self.rounded: Any = None
        self._next = self.n_vertices

    def __len__(self) -> int:
        return self._next

    def vertex(self, vertex: int) -> int:
        """The id of the place of a vertex."""
        known = self.same_as.get(vertex)
        if known is None:
            x, y, z = self.facets.exact(vertex)
            known = self._ids.setdefault((x, y, z, 1), vertex)
            self.same_as[vertex] = known
            if known == vertex:
                self._exact[vertex] = (x, y, z, 1)
        return known

    def add_piercings(self, edges: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Ids (k,) of points where edges (k, 2) of vertices go through facets (k,), asked once, before all other new
        points. They are worked out when asked for.
        """
        self.pierced = np.column_stack([edges, rows])
        return self._numbered(len(rows))

    def add_crossings(self, crossed: np.ndarray) -> np.ndarray:
        """Ids (k,) of points where segments go through facets, asked once, after `add_piercings`.

        crossed : (k, 3) ids of a segment's ends, which are piercing points, and the facet.
        """
        self.crossed = crossed
        return self._numbered(len(crossed))

    def _numbered(self, k: int) -> np.ndarray:
        self._next += k
        return np.arange(self._next - k, self._next)

    def kinds(self, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(k,) bool each: vertices, piercing points and crossings among points."""
        first, second = self.n_vertices, self.n_vertices + len(self.pierced)
        return ids < first, (ids >= first) & (ids < second), (ids >= second) & (ids < second + len(self.crossed))

    def place_of(self, point: int) -> int:
        """The id of the place of a cut point; later points with the same coordinates get the same id."""
        self._exact[point] = reduced(*self.exact(point))
        return self._ids.setdefault(self._exact[point], point)

    def _through(self, a: Rational, b: Rational, row: int) -> Rational:
        """Where the segment from a to b goes through a facet's plane."""
        n, start = self.facets.normal(row), self.facets.exact(int(self.facets.corners[row, 0]))
        height = inner(n, start)
        above, below = (abs(inner(n, p[:3]) - height * p[3]) for p in (a, b))
        # Weights of homogeneous points: |below| and |above| meet in the plane.
        x, y, z, w = (p * below + q * above for p, q in zip(a, b))
        return x, y, z, w

    def add(self, point: Rational) -> int:
        """The id of a point, which has no common factor."""
        known = self._ids.get(point)
        if known is None:
            known = self._ids[point] = self._next
            self._exact[known] = point
            self._next += 1
        return known

    def exact(self, point: int) -> Rational:
        known = self._exact.get(point)
        if known is None:
            known = self._exact[point] = self._worked_out(point)
        return known

    def _worked_out(self, point: int) -> Rational:
        row = point - self.n_vertices
        if row < 0:
            return (*self.facets.exact(point), 1)
        if row < len(self.pierced):
            p, q, facet = self.pierced[row].tolist()
            return self._through((*self.facets.exact(p), 1), (*self.facets.exact(q), 1), facet)
        p, q, facet = self.crossed[row - len(self.pierced)].tolist()
        return reduced(*self._through(self.exact(p), self.exact(q), facet))

    def load(self, some: Iterable[int]) -> None:
        """Work out the vertices behind points, all at once: quicker than each alone."""
        ids = np.array(list(some), dtype=np.int64)
        _, _, is_crossing = self.kinds(ids)
        crossed = self.crossed[ids[is_crossing] - self.n_vertices - len(self.pierced)]
        ids = np.concatenate([ids, crossed[:, :2].ravel()])
        is_vertex, is_piercing, _ = self.kinds(ids)
        pierced = self.pierced[ids[is_piercing] - self.n_vertices]
        facets = np.concatenate([pierced[:, 2], crossed[:, 2]])
        vertices = [ids[is_vertex], pierced[:, :2].ravel(), self.facets.corners[facets].ravel()]
        self.facets.load(np.unique(np.concatenate(vertices)).tolist())

    def near(self, point: int) -> tuple[float, float, float]:
        """Coordinates less the origin, in units of the grid, rounded to the nearest doubles (scaled, if need be)."""
        known = self._near.get(point)
        if known is None:
            x, y, z, w = self.exact(point)
            known = self._near[point] = quotient(x, w), quotient(y, w), quotient(z, w)
        return known

    def side(self, a: int, b: int, c: int, u: int, v: int) -> int:
        """Orientation of three points seen along an axis; u, v : the numbers of the other two coordinates."""
        near = self._near
        p, q, r = near.get(a) or self.near(a), near.get(b) or self.near(b), near.get(c) or self.near(c)
        pu, pv = p[u], p[v]
        qu, qv, ru, rv = q[u] - pu, q[v] - pv, r[u] - pu, r[v] - pv
        value = qu * rv - qv * ru
        D = max(abs(qu), abs(qv), abs(ru), abs(rv))
        limit = _ERROR * D * (max(abs(pu), abs(pv)) + D)
        if value > limit:
            return 1
        if value < -limit:
            return -1
        first, second, third = self.exact(a), self.exact(b), self.exact(c)
        pu_, pv_, pw, qw, rw = first[u], first[v], first[3], second[3], third[3]
        if pw == qw == rw == 1:  # vertices: shorter numbers
            exact = (second[u] - pu_) * (third[v] - pv_) - (second[v] - pv_) * (third[u] - pu_)
        else:
            ahead = second[u] * pw - pu_ * qw, second[v] * pw - pv_ * qw
            exact = ahead[0] * (third[v] * pw - pv_ * rw) - ahead[1] * (third[u] * pw - pu_ * rw)
        return (exact > 0) - (exact < 0)

    def before(self, a: int, b: int, u: int, v: int) -> int:
        """−1, 0 or 1 as point a comes before b, is b, or comes after it, by coordinate u, then v."""
        p, q = self.near(a), self.near(b)
        for k in (u, v):
            if p[k] != q[k]:  # rounding keeps the order
                return -1 if p[k] < q[k] else 1
            x, y = self.exact(a), self.exact(b)
            difference = x[k] * y[3] - y[k] * x[3]
            if difference:
                return -1 if difference < 0 else 1
        return 0

    def in_order(self, some: Iterable[int], u: int, v: int) -> list[int]:
        """Points by coordinate u, then v."""
        near = {p: self.near(p)[u] for p in some}
        if len(set(near.values())) == len(near):  # rounding keeps the order
            return sorted(near, key=near.__getitem__)

        def compare(a: int, b: int) -> int:
            return self.before(a, b, u, v)

        return sorted(near, key=cmp_to_key(compare))

    def in_world(self, point: int) -> tuple[float, float, float]:
        """Coordinates in W, each rounded once to the nearest double [m]."""
        return self.facets.in_world(self.exact(point))


def reduced(x: int, y: int, z: int, w: int) -> Rational:
    """Without a common factor, w > 0."""
    common = math.gcd(x, y, z, w)
    if w < 0:
        common = -common
    return x // common, y // common, z // common, w // common


def axis_of(normal: Point) -> tuple[int, int, int]:
    """(the axis along which a facet is seen largest, the numbers of the other two coordinates in cyclic order)."""
    sizes = [abs(x) for x in normal]
    axis = sizes.index(max(sizes))
    return axis, (axis + 1) % 3, (axis + 2) % 3
