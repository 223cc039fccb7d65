"""The facets of r posed solids, all in the world: numbers for vertices and facets, and exact coordinates on demand.

Every coordinate of a vertex R v + t is an integer times a power of two. All bodies share a single power, the grid,
and an origin on the grid near the bodies, for the shortest integers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from collide.lowering.facet_bodies import Body
from collide.mesh.bvh import MeshTree
from collide.numerics.exact_points import Point, placed
from collide.numerics.exact_vectors import cross, minus
from collide.numerics.lowest_bits import NO_BITS, lowest_exponents
from collide.shapes.mesh import Mesh
from collide.solids.facet_edges import FacetEdges, facet_edges


class Operand(NamedTuple):
    """One of the bodies: its shape's facets under their tree, the same as a solid mesh, and its pose X (4, 4)."""

    body: Body
    mesh: Mesh
    X: np.ndarray


class PlacedFacets:
    """Facets of r bodies; facets without area are left out, their corners kept as points of the edges they lie on.

    corners : (F, 3) int64 vertex ids, counter-clockwise from outside; equal vertices of a body have the same id.
    edge : (F, 3) the edges from corner k to corner k + 1.
    body, number : (F,) int64: the body of a facet, and the facet's row in the body's faces.
    local : (V, 3) vertices in the frames of their bodies.   body_of : (V,) int64.
    first_facet, first_vertex, first_edge : (r + 1,) the first of each body.   poses : (r, 4, 4).
    grid : exponent of the unit of exact coordinates.   origin : their origin in that unit.
    thin : ids (k, 3) of facets with distinct collinear corners.
    """

    def __init__(self, operands: list[Operand]):
        self.operands = operands
        self.poses = np.stack([operand.X for operand in operands])
        self.edges = [facet_edges(operand.mesh) for operand in operands]
        counts = [[len(o.mesh.vertices), len(e.rows), len(e.sides)] for o, e in zip(operands, self.edges)]
        starts = np.vstack([np.zeros((1, 3), dtype=np.int64), np.cumsum(counts, axis=0)])
        self.first_vertex, self.first_facet, self.first_edge = starts.T
        self.corners = np.concatenate([e.corners + k for e, k in zip(self.edges, self.first_vertex)])
        self.edge = np.concatenate([e.edge + k for e, k in zip(self.edges, self.first_edge)])
        self.body = np.repeat(np.arange(len(operands)), np.diff(self.first_facet))
        self.number = np.concatenate([e.rows for e in self.edges])
        self.local = np.concatenate([operand.mesh.vertices for operand in operands])
        self.body_of = np.repeat(np.arange(len(operands)), np.diff(self.first_vertex))
        self.thin = np.concatenate([e.thin + k for e, k in zip(self.edges, self.first_vertex)])
        self._exact: dict[int, Point] = {}
        self._normals: dict[int, Point] = {}

    @cached_property
    def grid(self) -> int:
        return min(_grid_of(operand.X, edges) for operand, edges in zip(self.operands, self.edges))

    @cached_property
    def origin(self) -> Point:
        first = self.operands[0]
        return self._on_grid(*placed(first.X, first.mesh.vertices[:1]))[0]

    @cached_property
    def slack(self) -> float:
        """More than the errors of coordinates in W, [m], that are worked out in doubles, and of their differences."""
        # Sums of three products and a shift are off by less than six units of the sum of their sizes.
        return 2.0**-48 * max(
            float(np.abs(o.X[:3, :3]).sum() * np.abs(o.mesh.vertices).max() + np.abs(o.X[:3, 3]).max())
            for o in self.operands
        )

    def tree_of(self, body: int) -> MeshTree:
        """The box-tree of a body's facets, in its frame."""
        return self.operands[body].body.tree

    def beside(self, edges: np.ndarray) -> np.ndarray:
        """(k, 2) the facets at edges of two; −1 at others."""
        body = np.searchsorted(self.first_edge, edges, side="right") - 1
        sides = np.empty((len(edges), 2), dtype=np.int64)
        for k, of_body in enumerate(self.edges):
            rows = np.flatnonzero(body == k)
            two = of_body.sides[edges[rows] - self.first_edge[k]]
            sides[rows] = np.where(two >= 0, two + self.first_facet[k], -1)
        return sides

    def odd_half_edges(self) -> np.ndarray:
        """3 · facet + corner of all edges without exactly two facets."""
        return np.concatenate([edges.odd + 3 * k for edges, k in zip(self.edges, self.first_facet.tolist())])

    def rows_of(self, body: int, numbers: np.ndarray) -> np.ndarray:
        """(k,) rows here of facets of a body by their own numbers; −1 for facets without area."""
        place = self.edges[body].place[numbers]
        return np.where(place >= 0, place + self.first_facet[body], -1)

    def load(self, vertices: Iterable[int]) -> None:
        """Work out the exact coordinates of vertices, all at once: quicker than each alone."""
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

    def in_world(self, point: tuple[int, int, int, int]) -> tuple[float, float, float]:
        """A point x/w, y/w, z/w as exact coordinates are, in W, each rounded once to the nearest double [m]."""
        x, y, z, w = point
        a, b, c = self.origin
        up, down = max(self.grid, 0), max(-self.grid, 0)
        unit = w << down
        return (
            quotient((x + a * w) << up, unit), quotient((y + b * w) << up, unit), quotient((z + c * w) << up, unit)
        )

    def _on_grid(self, points: list[Point], grid: int) -> list[Point]:
        shift = grid - self.grid
        if shift < 0:  # integers that end in zeros, all of them
            return [(x >> -shift, y >> -shift, z >> -shift) for x, y, z in points]
        return [(x << shift, y << shift, z << shift) for x, y, z in points]


def quotient(numerator: int, denominator: int) -> float:
    """Correctly rounded; what is beyond all doubles is ± infinity."""
    try:
        return numerator / denominator
    except OverflowError:
        return math.inf if numerator > 0 else -math.inf


def _grid_of(X: np.ndarray, edges: FacetEdges) -> int:
    """The exponent of a unit in which all vertices of a placed body are whole."""
    R, t = int(lowest_exponents(X[:3, :3].ravel())), int(lowest_exponents(X[:3, 3]))
    product = R + edges.lowest_bit if NO_BITS not in (R, edges.lowest_bit) else NO_BITS
    return min(product, t) if min(product, t) < NO_BITS else 0
