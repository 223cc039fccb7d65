"""The facets of r posed solids, all in one world: numbers for vertices and facets, and exact coordinates on demand.

A vertex R v + t is a whole number times a power of two in every coordinate. All bodies share one such power, the grid,
and one origin on it near the bodies, so that the integers are as short as they can be.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from collide.lowering.facet_bodies import Body
from collide.mesh.mesh_survey import NO_AREA
from collide.mesh.mesh_topology import COLLAPSED
from collide.numerics.exact_points import Point, cross, minus, placed
from collide.numerics.lowest_bits import NO_BITS, lowest_exponents
from collide.shapes.mesh import Mesh


class Operand(NamedTuple):
    """One of the bodies: its shape's facets under their tree, the same as a solid mesh, and its pose X (4, 4)."""

    body: Body
    mesh: Mesh
    X: np.ndarray


class PlacedFacets:
    """Facets of r bodies; those without area are left out, their corners kept as points of the edges they lie on.

    corners : (F, 3) int64 vertex ids, counter-clockwise from outside; equal vertices of a body have one id.
    body, number : (F,) int64: whose facet, and its row in that body's faces.
    local : (V, 3) vertices in the frames of their bodies.   body_of : (V,) int64.
    first_facet, first_vertex : (r + 1,) where each body's begin.
    grid : exponent of the unit of exact coordinates.   origin : their origin in that unit.
    thin : ids (k, 3) of facets whose corners are distinct and lie on one line.
    """

    def __init__(self, operands: list[Operand]):
        self.operands = operands
        corners, bodies, numbers, local, owner, thin = [], [], [], [], [], []
        self._place_of: list[np.ndarray] = []
        n_vertices = n_facets = 0
        first_vertex, first_facet = [0], [0]
        for k, operand in enumerate(operands):
            mesh = operand.mesh
            flags, ids = mesh.survey.flags, mesh.survey.corners.astype(np.int64)
            proper = np.flatnonzero((flags & (NO_AREA | COLLAPSED)) == 0)
            place = np.full(len(ids), -1, dtype=np.int64)
            place[proper] = n_facets + np.arange(len(proper))
            self._place_of.append(place)
            corners.append(ids[proper] + n_vertices)
            thin.append(ids[(flags & NO_AREA != 0) & (flags & COLLAPSED == 0)] + n_vertices)
            bodies.append(np.full(len(proper), k))
            numbers.append(proper)
            local.append(mesh.vertices)
            owner.append(np.full(len(mesh.vertices), k))
            n_vertices += len(mesh.vertices)
            n_facets += len(proper)
            first_vertex.append(n_vertices)
            first_facet.append(n_facets)
        self.corners, self.thin = np.concatenate(corners), np.concatenate(thin)
        self.body, self.number = np.concatenate(bodies), np.concatenate(numbers)
        self.local, self.body_of = np.concatenate(local), np.concatenate(owner)
        self.first_vertex, self.first_facet = np.array(first_vertex), np.array(first_facet)
        self.grid = min(_grid_of(operand) for operand in operands)
        self.origin = self._on_grid(*placed(operands[0].X, operands[0].mesh.vertices[:1]))[0]
        self._exact: dict[int, Point] = {}
        self._normals: dict[int, Point] = {}

    def rows_of(self, body: int, numbers: np.ndarray) -> np.ndarray:
        """(k,) rows here of facets of a body by their own numbers; −1 for facets without area."""
        return self._place_of[body][numbers]

    def load(self, vertices: Iterable[int]) -> None:
        """Work out the exact coordinates of vertices, all at once: quicker than one by one."""
        missing = np.array([v for v in vertices if v not in self._exact], dtype=np.int64)
        for k, operand in enumerate(self.operands):
            ids = missing[self.body_of[missing] == k] if len(missing) else missing
            if len(ids):
                points = self._on_grid(*placed(operand.X, self.local[ids]))
                self._exact.update(zip(ids.tolist(), (minus(p, self.origin) for p in points)))

    def exact(self, vertex: int) -> Point:
        """A vertex less the origin, in units of the grid."""
        if vertex not in self._exact:
            self.load([vertex])
        return self._exact[vertex]

    def exact_corners(self, facet: int) -> list[Point]:
        return [self.exact(v) for v in self.corners[facet].tolist()]

    def normal(self, facet: int) -> Point:
        """(v1 − v0) × (v2 − v0) in units of the grid squared."""
        n = self._normals.get(facet)
        if n is None:
            a, b, c = self.exact_corners(facet)
            n = self._normals[facet] = cross(minus(b, a), minus(c, a))
        return n

    def _on_grid(self, points: list[Point], grid: int) -> list[Point]:
        shift = grid - self.grid
        if shift < 0:  # integers that end in zeros, all of them
            return [(x >> -shift, y >> -shift, z >> -shift) for x, y, z in points]
        return [(x << shift, y << shift, z << shift) for x, y, z in points]


def _grid_of(operand: Operand) -> int:
    """The exponent of the unit in which all vertices of a placed body are whole."""
    R = int(lowest_exponents(operand.X[:3, :3].ravel()))
    v = int(lowest_exponents(operand.mesh.vertices.ravel()))
    t = int(lowest_exponents(operand.X[:3, 3]))
    product = R + v if NO_BITS not in (R, v) else NO_BITS
    return min(product, t) if min(product, t) < NO_BITS else 0
