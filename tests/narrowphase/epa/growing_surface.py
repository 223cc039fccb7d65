"""A polytope of EPA that grows by points given one by one, and what must hold of it after every step."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from exact_simplex import determinant, exact, nearest_to_origin

from collide.kernels import address_of
from collide.narrowphase.epa import polytope_surface as E
from collide.narrowphase.gjk.minkowski_difference import POINT


class Surface:
    """The polytope over points that are given one by one."""

    def __init__(self, corners):
        self._doubles, self._integers = np.zeros(E.DOUBLES), np.zeros(E.INTEGERS, dtype=np.int64)
        self.views = E.surface_at(address_of(self._doubles), address_of(self._integers))
        (self.points, self.planes, self.reaches, self.clearances, self.ids, self.facets, self.starts, _, _) = self.views
        self.corners: list = []
        for corner in corners:
            self._put(corner)
        E.set_tetrahedron(self.views, 0.0, math.inf)
        self.corners = self.points.reshape(-1, POINT)[:4, :3].tolist()
        self.count = 4

    def _put(self, corner) -> int:
        k = len(self.corners)
        self.points[POINT * k : POINT * k + 3] = corner
        self.ids[2 * k : 2 * k + 2] = k
        self.corners.append(list(map(float, corner)))
        return k

    def slots(self) -> list[int]:
        """Of the surface: what neighbours lead to. Where a patch is taken out around two vertices and more, slots are
        given up."""
        newest = len(self.corners) - 1
        waiting = [f for f in range(self.count) if newest in self.facets[E.FACET * f : E.FACET * f + 3]][:1] or [0]
        for f in waiting:
            across = (self.facets[E.FACET * f + E.TWIN : E.FACET * f + E.TWIN + 3] // E.FACET).tolist()
            waiting += [g for g in dict.fromkeys(across) if g not in waiting]
        return sorted(waiting)

    def triangles(self) -> dict[int, list[int]]:
        return {f: self.facets[E.FACET * f : E.FACET * f + 3].tolist() for f in self.slots()}

    def facet_below(self, corner) -> int | None:
        """A facet that the point is in front of: the one that it is highest above."""
        planes = self.planes.reshape(-1, E.PLANE)[: self.count]
        heights = planes[:, :3] @ corner - planes[:, 3]
        f = int(np.argmax(heights))
        return f if heights[f] > 1e-9 else None

    def expand(self, corner) -> bool:
        f = self.facet_below(corner)
        if f is None or not E.may_expand(len(self.corners), self.count):
            return False
        apex = self._put(corner)
        self.starts[2 * apex + 1] = -1
        seen = E.find_patch(self.views, self.views, f, E.point_at(self.views.points, apex), 0.0)
        self.count, nearest, reach = E.expand(self.views, f, apex, self.count, seen, math.inf, 0.0, math.inf)
        assert reach == min(self.reaches[int(f)] for f in self.around(apex)) == self.reaches[int(nearest)]
        return True

    def around(self, vertex: int) -> list[int]:
        return [f for f, triangle in self.triangles().items() if vertex in triangle]

    def check(self) -> None:
        """Closed, every edge run through once either way by neighbours that know each other; a sphere, by Euler."""
        edges: dict[tuple[int, int], int] = {}
        triangles = self.triangles()
        for f, triangle in triangles.items():
            assert len(set(triangle)) == 3
            for e in range(3):
                edges[triangle[e], triangle[(e + 1) % 3]] = E.FACET * f + e
        assert len(edges) == 3 * len(triangles), "an edge is run through twice the same way"
        for (i, j), at in edges.items():
            assert edges[j, i] == self.facets[at + E.TWIN], "a neighbour that is none"
            assert self.facets[at] == i and self.facets[at + 1] == j
        vertices = {v for triangle in triangles.values() for v in triangle}
        assert len(vertices) - len(edges) // 2 + len(triangles) == 2
        assert all(self.reaches[f] == math.inf for f in range(self.count) if f not in triangles), (
            "a slot given up may be asked"
        )
        assert not any(self.facets[E.FACET * f + E.MARKS] & E.SEEN for f in triangles), "a mark that stayed"

    def check_planes(self) -> None:
        """Unit normals, outwards; no corner is nearer along one than said; clearances hold for the triangle,
        exactly."""
        for f, triangle in self.triangles().items():
            *normal, distance = self.planes[E.PLANE * f : E.PLANE * f + E.PLANE].tolist()
            corners = [self.corners[v] for v in triangle]
            if not any(normal):  # collinear corners
                assert distance == math.inf and self.clearances[f] < 0.0
                continue
            assert abs(math.hypot(*normal) - 1.0) < 1e-14
            assert distance <= min(np.dot(normal, corner) for corner in corners) + 1e-14 * np.abs(corners).max()
            if self.clearances[f] >= 0.0:
                assert determinant(*exact(corners)) > 0
                true = nearest_to_origin(corners).square
                assert Fraction(float(self.clearances[f])) ** 2 <= true * (1 + Fraction(1, 10**14))


def around_the_origin(rng) -> np.ndarray:
    """Four points whose tetrahedron holds a ball about the origin."""
    while True:
        corners = rng.normal(size=(4, 3))
        weights = np.linalg.solve(np.vstack([corners.T, np.ones(4)]), [0.0, 0.0, 0.0, 1.0])
        if weights.min() > 0.1:
            return on_a_sphere(corners)


def on_a_sphere(points) -> np.ndarray:
    return points / np.linalg.norm(points, axis=1)[:, None]


CLOUDS = {
    "sphere": lambda rng: on_a_sphere(rng.normal(size=(60, 3))),
    "scattered": lambda rng: rng.normal(size=(60, 3)) * (1.0, 2.0, 0.7),
    "needle": lambda rng: rng.normal(size=(60, 3)) * (20.0, 1.0, 1.0),
    "cube": lambda rng: rng.integers(-2, 3, size=(60, 3)) * 1.0,
}


def triangles(surface, facet: int) -> dict[int, list[int]]:
    """Facets that neighbours lead to from one of them."""
    slots = [facet]
    for f in slots:
        across = (surface.facets[E.FACET * f + E.TWIN : E.FACET * f + E.TWIN + 3] // E.FACET).tolist()
        slots += [g for g in dict.fromkeys(across) if g not in slots]
    return {f: surface.facets[E.FACET * f : E.FACET * f + 3].tolist() for f in slots}
