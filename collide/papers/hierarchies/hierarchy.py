"""Hierarchies of a convex hull: Dobkin and Kirkpatrick's, and Barba and Langerman's with bounded degree.

    P_1 = P ⊇ P_2 ⊇ ... ⊇ P_k, a tetrahedron

Barba, Langerman, "Optimal detection of intersections between convex polyhedra", section 4: properties A1–A5
and B1–B5. Levels count from 0 here: level 0 is P_1. Each level loses an independent set of vertices; in a bounded
hierarchy, vertices of too large a degree are cut off (`vertex_cutting`), and their cut adds vertices, inside the hull.

The walk needs Lemma 4.2 in this form: if level i + 1 lies in the closed half-space H⁺ and
touches its plane in a vertex v, then at most a single vertex u of level i is strictly outside, and u is in
``removed_of(v, i + 1)``. Proof: from a vertex strictly outside edges climb to the farthest
vertex, so the vertices outside are connected; all of them are removed in level i + 1, and removed vertices are
independent; so u is alone, and v, not farthest, has u as its neighbour. A vertex v added by a cut is a convex
combination of the vertex cut, with positive weight, and its neighbours: if v is on the plane, the vertex cut is
outside or on the plane, too, and no other vertex can be outside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.hull.exact_hull import Hull
from collide.kernels import address_of, entry, view_i64
from collide.papers.hierarchies.half_edges import USED
from collide.papers.hierarchies.independent_sets import (
    ANCHORS,
    REMOVED,
    STATE,
    build_mesh,
    measure_degrees,
    thin,
    write_level,
)
from collide.papers.hierarchies.level_rows import by_vertex
from collide.papers.hierarchies.symbolic_perturbation import CENTRES, exact_side
from collide.papers.hierarchies.true_facets import Cloud, Facets, cloud_at, named_in, true_facets
from collide.papers.hierarchies.vertex_cutting import SCRATCH, cut

#: The bound c. The proof of Lemma 4.1 asks for more than 3^(2^17). Measured (benchmarks/hierarchies.py), any bound
#: from 24 on gives the same depth; flat sides and cuts with k corners leave degrees of 2·log2 k + 5, to which 64 leaves
#: room.
DEGREE_BOUND = 64
#: A lower one is met by the neighbours of a cut again and again.
LEAST_BOUND = 12


class Hierarchy(NamedTuple):
    """Levels of polyhedra by rows of ``points``; v's data at a level stand in row ``row[v] + level - birth[v]``.

    points : (N, 3) float64, of the body, then vertices added by cuts, rounded into the level before.
    degree_bound : c, or 0 for unbounded degrees.
    birth, last : (N,) int32, first and last level with the vertex; −1 for a point in no level.
    parent : (N,) int32, for an added vertex the vertex cut off; else −1.
    row : (N,) int64, first row of the vertex; −1.
    neighbour_start : (rows + 1,) int64; neighbours : int32, counter-clockwise seen from outside.
    removed_start : (rows + 1,) int64; removed : int32, vertices possibly beyond a plane tangent at the vertex, a level
        finer.
    level_start : (depth + 1,) int64; level_vertices : (rows,) int32, ascending in each level.
    """

    points: np.ndarray
    degree_bound: int
    birth: np.ndarray
    last: np.ndarray
    parent: np.ndarray
    row: np.ndarray
    neighbour_start: np.ndarray
    neighbours: np.ndarray
    removed_start: np.ndarray
    removed: np.ndarray
    level_start: np.ndarray
    level_vertices: np.ndarray

    @property
    def depth(self) -> int:
        return len(self.level_start) - 1

    @property
    def sizes(self) -> np.ndarray:
        """(depth,) vertices of each level."""
        return np.diff(self.level_start)

    def vertices(self, level: int) -> np.ndarray:
        """Vertices of a level, ascending."""
        return self.level_vertices[self.level_start[level] : self.level_start[level + 1]]

    def row_of(self, vertex: int, level: int) -> int:
        """Where the vertex's data at a level stand; ValueError where the level does not have it."""
        if not 0 <= self.birth[vertex] <= level <= self.last[vertex]:
            raise ValueError(f"level {level} does not have vertex {vertex}")
        return int(self.row[vertex]) + level - int(self.birth[vertex])

    def neighbours_of(self, vertex: int, level: int) -> np.ndarray:
        """Neighbours of a vertex in a level, counter-clockwise seen from outside."""
        row = self.row_of(vertex, level)
        return self.neighbours[self.neighbour_start[row] : self.neighbour_start[row + 1]]

    def removed_of(self, vertex: int, level: int) -> np.ndarray:
        """The vertices of level − 1 possibly beyond a plane through the vertex that supports this level."""
        row = self.row_of(vertex, level)
        return self.removed[self.removed_start[row] : self.removed_start[row + 1]]

    def degrees(self, level: int) -> np.ndarray:
        """Degrees of the vertices of a level."""
        vertices = self.vertices(level)
        row = self.row[vertices] + level - self.birth[vertices]
        return self.neighbour_start[row + 1] - self.neighbour_start[row]

    def triangles(self, level: int) -> np.ndarray:
        """(f, 3) int32 triangles of a level, counter-clockwise seen from outside, each from its lowest corner."""
        triangles = []
        for v in self.vertices(level).tolist():
            ring = self.neighbours_of(v, level)
            after = np.roll(ring, -1)
            lowest = (ring > v) & (after > v)
            corners = np.full(lowest.sum(), v, dtype=np.int32), ring[lowest], after[lowest]
            triangles.append(np.stack(corners, axis=1))
        return np.concatenate(triangles)


def build_hierarchy(points: np.ndarray, hull: Hull, degree_bound: int = DEGREE_BOUND) -> Hierarchy:
    """The hierarchy of the hull of points (n, 3); ``hull`` as `convex_hull` gives it.

    degree_bound : c ≥ 12, what no degree exceeds from level 1 on (B3); 0 for a plain Dobkin-Kirkpatrick hierarchy.
        Neighbours of large degree are cut one level after the other, so the first few levels may still have some.
        So may levels of hulls whose edges differ in length by ten orders of magnitude, see `vertex_cutting`.

    Near-linear on most hulls, O(n log n). Quadratic on curves of unevenly spaced vertices that are all neighbours of
    two (a moment curve at logarithmic steps: 4 s for 10,000 vertices): what replaces a cut vertex is then wrapped at
    O(k) a triangle. Raises ValueError for a hull without interior.
    """
    if hull.dimension != 3:
        kind = ("a point", "a segment", "flat")[hull.dimension]
        raise ValueError(f"a hierarchy ends in a tetrahedron; this hull has no interior, it is {kind}")
    if degree_bound != 0 and degree_bound < LEAST_BOUND:
        raise ValueError(f"degree_bound must be 0 or at least {LEAST_BOUND}, got {degree_bound}")
    cloud = Cloud(points)
    return hierarchy_of(cloud, true_facets(cloud, hull), degree_bound)


def hierarchy_of(cloud: Cloud, facets: Facets, degree_bound: int) -> Hierarchy:
    """The hierarchy above a closed surface as `true_facets.true_facets` makes it."""
    building = _Building(cloud, facets, degree_bound)
    while True:
        building.keep_level()
        if len(building.vertices) == 4:
            return building.finished()
        building.next_level()


class _Building:
    """A surface on its way from the hull to a tetrahedron."""

    def __init__(self, cloud: Cloud, facets: Facets, degree_bound: int):
        triangles, twins, _ = facets
        self.cloud, self.bound = cloud, degree_bound
        self.corners = np.empty(3 * len(triangles), dtype=np.int32)
        self.twins = np.empty_like(self.corners)
        self.leaving = np.empty(len(cloud.scaled), dtype=np.int32)
        self.state = np.zeros(STATE, dtype=np.int64)
        build_mesh(address_of(triangles), address_of(twins), len(triangles), *self._mesh, address_of(self.state))
        self.vertices = named_in(triangles, cloud.count).astype(np.int32)
        self.degree = np.zeros(len(self.leaving), dtype=np.int32)
        measure_degrees(*self._mesh, address_of(self.vertices), len(self.vertices), address_of(self.degree))
        self.state[ANCHORS : ANCHORS + 4] = _anchors(cloud, self.vertices, triangles)
        self.blocked = np.zeros(len(self.leaving), dtype=np.int32)
        self.seen = np.full(len(triangles), -1, dtype=np.int32)
        self.parent = np.full(len(self.leaving), -1, dtype=np.int32)
        self.levels: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    @property
    def _mesh(self) -> tuple[int, int, int, int, int]:
        return (
            address_of(self.corners), address_of(self.twins), len(self.corners) // 3, address_of(self.leaving),
            len(self.leaving),
        )

    def keep_level(self) -> None:
        """Write down the present surface."""
        start = np.zeros(len(self.vertices) + 1, dtype=np.int64)
        np.cumsum(self.degree[self.vertices], out=start[1:])
        neighbours = np.empty(start[-1], dtype=np.int32)
        write_level(
            *self._mesh, address_of(self.vertices), len(self.vertices), address_of(start), address_of(neighbours)
        )
        self.levels.append((self.vertices, start, neighbours))

    def next_level(self) -> None:
        """Cut off vertices of too large degree, none beside another, then remove others."""
        self.blocked = np.zeros(len(self.leaving), dtype=np.int32)
        self.state[REMOVED] = 0
        if self.bound:
            self._cut()
        bound = self.bound or len(self.leaving)
        self._thin(bound)
        # Where nothing can leave, a larger degree is better than no level.
        while self.state[REMOVED] == 0:
            bound *= 2
            if bound > 8 * len(self.leaving):
                raise AssertionError("no vertex of a level can leave it")
            self._thin(bound)
        self.vertices = np.flatnonzero(self.leaving >= 0).astype(np.int32)

    def _thin(self, bound: int) -> None:
        max_degree = int(min(bound, self.degree.max()))
        order = np.empty(len(self.vertices), dtype=np.int32)
        scratch = np.empty(8 * max_degree, dtype=np.int64)
        thin(
            *self.cloud.addresses, self.cloud.count, *self._mesh[:4], address_of(self.vertices), len(self.vertices),
            address_of(self.degree), address_of(self.blocked), address_of(order), bound, max_degree,
            address_of(scratch),
            address_of(self.state),
        )

    def _cut(self) -> None:
        """Cut the vertices over the bound, largest degree first, except neighbours of vertices cut before."""
        large = self.vertices[self.degree[self.vertices] > self.bound]
        if not len(large):
            return
        sizes = self.degree[large].astype(np.int64)
        self._reserve(int(sizes.sum()) + 1)
        scratch = np.empty(SCRATCH * int(sizes.max()), dtype=np.int64)
        for w in large[np.argsort(-sizes, kind="stable")].tolist():
            if self.blocked[w]:
                continue
            # Neighbours of a cut stay. Where they lie in one plane with the other anchors, new vertices must come.
            free = self._replace_anchor(w, self._neighbours(w))
            first = self.cloud.used
            n_new = cut(
                *self.cloud.addresses, self.cloud.exponent, self.cloud.count, *self._mesh[:4],
                address_of(self.seen), address_of(self.degree), address_of(self.blocked), w, first, free,
                address_of(scratch), address_of(self.state),
            )
            if n_new < 0:
                continue
            self.parent[first : first + n_new] = w
            self.cloud.used += n_new
            self.state[REMOVED] += 1
            self._replace_anchor(w, np.arange(first, first + n_new))

    def _reserve(self, added: int) -> None:
        """Rows for that many more vertices, and triangles for them; each takes two."""
        self.cloud.reserve(self.cloud.used + added)
        more = len(self.cloud.scaled) - len(self.leaving)
        if more > 0:
            self.leaving = np.concatenate([self.leaving, np.full(more, -1, dtype=np.int32)])
            self.parent = np.concatenate([self.parent, np.full(more, -1, dtype=np.int32)])
            self.degree = np.concatenate([self.degree, np.zeros(more, dtype=np.int32)])
            self.blocked = np.concatenate([self.blocked, np.zeros(more, dtype=np.int32)])
        short = 3 * (int(self.state[USED]) + 2 * added) - len(self.corners)
        if short > 0:
            self.seen = np.concatenate([self.seen, np.full(short // 3 + 1, -1, dtype=np.int32)])
            self.corners = np.concatenate([self.corners, np.empty(short, dtype=np.int32)])
            self.twins = np.concatenate([self.twins, np.empty(short, dtype=np.int32)])

    def _replace_anchor(self, w: int, candidates: np.ndarray) -> bool:
        """If w is an anchor (a vertex that stays), make a candidate the anchor instead; returns whether w may be
        removed.
        """
        anchors = self.state[ANCHORS : ANCHORS + 4]
        if w not in anchors:
            return True
        remaining = [int(v) for v in anchors if v != w]
        v = first_off_plane(*self.cloud.addresses, *remaining, address_of(candidates), len(candidates))
        if v >= 0:
            anchors[anchors == w] = v
        return v >= 0

    def _neighbours(self, w: int) -> np.ndarray:
        """Of a vertex, at the last level written down."""
        vertices, start, neighbours = self.levels[-1]
        at = int(np.searchsorted(vertices, w))
        return neighbours[start[at] : start[at + 1]].astype(np.int64)

    def finished(self) -> Hierarchy:
        """All levels by vertex. The rows of the centres are taken out."""
        count, used = self.cloud.count, self.cloud.used
        points = np.delete(self.cloud.originals[:used], slice(count, count + CENTRES), axis=0)
        parent = np.delete(self.parent[:used], slice(count, count + CENTRES))
        for ids in (parent, *(ids for vertices, _, neighbours in self.levels for ids in (vertices, neighbours))):
            ids[ids >= count + CENTRES] -= CENTRES
        birth, last, *rest = by_vertex(self.levels, len(points), parent)
        parent[birth < 0] = -1  # new vertices that turned out not to be extreme
        return Hierarchy(points, self.bound, birth, last, parent, *rest)


def _anchors(cloud: Cloud, vertices: np.ndarray, triangles: np.ndarray) -> list[int]:
    """Four anchors: vertices far apart, spanning space, kept up to the last level, so that no level is flat."""
    points = cloud.scaled[vertices]
    corners = [int(np.argmin(points[:, int(np.argmax(np.ptp(points, axis=0)))]))]
    corners.append(int(np.argmax(np.square(points - points[corners[0]]).sum(axis=1))))
    along = points[corners[1]] - points[corners[0]]
    normals = np.cross(along, points - points[corners[0]])
    corners.append(int(np.argmax(np.square(normals).sum(axis=1))))
    # Doubles may take three in line for far apart; three corners of a triangle never are.
    for three in ([int(vertices[k]) for k in corners], triangles[0].tolist()):
        heights = np.abs(((points - points[corners[0]]) * normals[corners[2]]).sum(axis=1))
        candidates = vertices[np.argsort(-heights, kind="stable")].astype(np.int64)
        fourth = int(first_off_plane(*cloud.addresses, *three, address_of(candidates), len(candidates)))
        if fourth >= 0:
            return [*three, fourth]
    raise AssertionError("all vertices of a solid hull are in one plane")


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def first_off_plane(scaled_at, originals_at, rows, work_at, digits_at, a, b, c, candidates_at, count):
    """The first candidate that is not in the plane of a, b, c; −1 where all are, or these are in line; exact."""
    cloud = cloud_at(scaled_at, originals_at, rows, work_at, digits_at, 0, 0)
    candidates = view_i64(candidates_at, count)
    for k in range(count):
        if exact_side(cloud, a, b, c, candidates[k]) != 0:
            return candidates[k]
    return -1
