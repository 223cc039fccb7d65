"""The convolution of two closed surfaces: all facet + vertex, vertex + facet and edge + edge pieces, with signs.

A piece exists where the outward normals of both features agree. Its sign is the product of the features' signs: an edge
counts +1 where convex and −1 where reflex, a vertex as often as its normals cover a direction. The pieces close, and
their winding number around a point x off all pieces is the Euler characteristic of A ∩ (x − B)
(P. Schapira, "Operations on constructible functions", 1991; in the plane L. Guibas, L. Ramshaw, J. Stolfi, "A kinetic
framework for computational geometry", 1983). The border of A + B lies on the pieces.

Normals perpendicular to edges, parallel facets and parallel edges are told apart as if B were sheared by an
infinitely small ε: x → x + ε u (v · x). All signs are linear in ε, so every sign is decided where u is perpendicular to
no normal and v to no edge. The shear decides the existence of pieces alone: their places are places of B as given.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.errors import CollideError
from collide.numerics.exact_points import Point, leading_digits
from collide.numerics.exact_vectors import cross, inner, minus
from collide.solids.joined_parts import components

#: Inner products of two vectors with components below 1, each rounded: off by less than this.
_ERROR = 2.0**-48


class ExactSurface(NamedTuple):
    """A closed surface in integers: every edge has two facets, running along the edge in opposite ways.

    points : by id.   faces : (F, 3) ids.   normals : (v1 − v0) × (v2 − v0) of every facet, never zero.
    edges : (E, 2) ids.   sides : (E, 2) the facet running along the edge, then the facet running back.
    bend : (E,) 1 for a convex edge, −1 for a reflex edge, 0 for a flat edge.
    """

    points: list[Point]
    faces: np.ndarray
    normals: list[Point]
    edges: np.ndarray
    sides: np.ndarray
    bend: np.ndarray

    def directions(self) -> list[Point]:
        return [minus(self.points[q], self.points[p]) for p, q in self.edges.tolist()]


class Pieces(NamedTuple):
    """Triangles of sums of points, each repeated as often as counted, turned where counted negatively.

    corners : (k, 3, 2) for every corner the vertex of A and the vertex of B.   facets : (k, 2) a facet of A and a facet
    of B touching at the piece: the piece's own facet, or a facet at its vertex or edge.
    """

    corners: np.ndarray
    facets: np.ndarray


def exact_surface(points: list[Point], faces: np.ndarray) -> ExactSurface:
    """A surface of facets (F, 3) with an area, two at every edge (checked before)."""
    normals = []
    for face in faces.tolist():
        a, b, c = (points[v] for v in face)
        normals.append(cross(minus(b, a), minus(c, a)))
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    key, back = starts * len(points) + ends, ends * len(points) + starts
    order = np.argsort(key)
    partner = order[np.searchsorted(key[order], back)]
    once = np.flatnonzero(starts < ends)
    sides = np.stack([once // 3, partner[once] // 3], axis=1)
    apex = faces.ravel()[partner[once] // 3 * 3 + (partner[once] + 2) % 3]
    bend = np.zeros(len(once), dtype=np.int8)
    for k, (f, v, p) in enumerate(zip(sides[:, 0].tolist(), apex.tolist(), starts[once].tolist())):
        height = inner(normals[f], minus(points[v], points[p]))
        bend[k] = (height < 0) - (height > 0)
    return ExactSurface(points, faces, normals, np.stack([starts[once], ends[once]], axis=1), sides, bend)


class _Shear(NamedTuple):
    """u, v of the module, and 1 where the second surface is sheared so, −1 where it is the first."""

    u: Point
    v: Point
    sense: int


def convolution(A: ExactSurface, B: ExactSurface) -> Pieces:
    """The pieces of the convolution of two surfaces."""
    along_a, along_b = A.directions(), B.directions()
    u = _generic(A.normals + B.normals, 0)
    v = _generic(along_a + along_b, 1)
    there, back = _Shear(u, v, 1), _Shear(u, v, -1)
    of_b = _signs(A.normals, along_b, there)
    of_a = _signs(B.normals, along_a, back)
    at_vertices_of_b = _vertex_counts(A.normals, B, along_b, of_b, there)
    at_vertices_of_a = _vertex_counts(B.normals, A, along_a, of_a, back)
    of_edges = _crossings(of_b[A.sides[:, 0]], of_b[A.sides[:, 1]], of_a[B.sides[:, 0]].T, of_a[B.sides[:, 1]].T,
                          A.bend[:, None], B.bend[None, :])
    some_of_a, some_of_b = _a_facet_at(A), _a_facet_at(B)
    pieces = [
        _facets_and_vertices(A.faces, at_vertices_of_b, some_of_b),
        _turned_round(_facets_and_vertices(B.faces, at_vertices_of_a, some_of_a)),
        _two_edges(A, B, of_edges),
    ]
    made = Pieces(*(np.concatenate(part) for part in zip(*pieces)))
    _check_closed(made.corners[..., 0] * len(B.points) + made.corners[..., 1])
    return made


def _generic(vectors: list[Point], seed: int) -> Point:
    """A small vector perpendicular to no vector of the list."""
    random = np.random.default_rng(seed)
    while True:
        x, y, z = random.integers(-1 << 20, 1 << 20, 3).tolist()
        if all(inner((x, y, z), vector) for vector in vectors):
            return x, y, z


def _signs(normals: list[Point], along: list[Point], shear: _Shear, at_normals: bool = False) -> np.ndarray:
    """(n, m) int8: signs of n · g, never 0.   at_normals : the normals, not the g, are the sheared surface's."""
    n = np.array([leading_digits(x) for x in normals])
    g = np.array([leading_digits(x) for x in along])
    near = n @ g.T
    signs = np.sign(near).astype(np.int8)
    sense = -shear.sense if at_normals else shear.sense
    for i, j in np.argwhere(np.abs(near) <= _ERROR).tolist():
        value = inner(normals[i], along[j])
        value = value or sense * inner(normals[i], shear.u) * inner(shear.v, along[j])
        signs[i, j] = (value > 0) - (value < 0)
    return signs


def _crossings(n1, n2, m1, m2, bend_e, bend_g) -> np.ndarray:
    """Whether the arcs of normals of edges e and g cross, by how n1, n2 at e lie to g and m1, m2 at g to e: 0, or the
    count of the piece e + g, turned as e × g.
    """
    cross = (n1 != n2) & (m1 != m2) & (bend_e * n1 == -bend_g * m1)
    return np.where(cross, bend_g * n1, 0).astype(np.int8)


def _vertex_counts(
    normals: list[Point], Q: ExactSurface, along: list[Point], of_edges: np.ndarray, shear: _Shear
) -> np.ndarray:
    """(n, vertices) how often the normals at each vertex of Q cover each of the given normals.

    The counts are found at a single direction and followed to the others: a count changes at crossings with arcs of
    normals of edges.
    """
    start = _generic(along, 2)
    further = _generic(along, 3)
    opposite = (-start[0], -start[1], -start[2])
    # Twice the count is (count of n + count of −n) + their difference; their sum is 1 less half the changes of sign
    # around the vertex, for each ring of facets there.
    to_further = _jumps(start, [further], Q, _plain(along, [further]), along, shear)
    to_opposite = _jumps(further, [opposite], Q, _plain(along, [opposite]), along, shear)
    difference = -(to_further + to_opposite)[0]
    at_start = (_rings(Q) - _changes(Q, start) + difference) // 2
    return at_start + _jumps(start, normals, Q, of_edges, along, shear)


def _plain(along: list[Point], normals: list[Point]) -> np.ndarray:
    """(n, edges) signs of normals that are perpendicular to no edge."""
    return np.array([[1 if inner(n, g) > 0 else -1 for g in along] for n in normals], dtype=np.int8)


def _jumps(
    start: Point, normals: list[Point], Q: ExactSurface, of_edges: np.ndarray, along: list[Point], shear: _Shear
) -> np.ndarray:
    """(n, vertices) by how much the counts of Q's vertices change from the direction start to each of the normals."""
    axes = [cross(start, n) for n in normals]
    if any(axis == (0, 0, 0) or inner(shear.v, axis) == 0 for axis in axes):
        raise CollideError("a direction chosen at random is a normal of a solid; please report it")
    of_axes = _signs(Q.normals, axes, shear, at_normals=True)
    at_start = _plain(along, [start])
    counts = _crossings(at_start, of_edges, of_axes[Q.sides[:, 0]].T, of_axes[Q.sides[:, 1]].T, 1, Q.bend[None, :])
    out = np.zeros((len(Q.points), len(normals)), dtype=np.int64)
    np.add.at(out, Q.edges[:, 0], counts.T)
    np.subtract.at(out, Q.edges[:, 1], counts.T)
    return out.T


def _rings(Q: ExactSurface) -> np.ndarray:
    """(vertices,) how many rings of facets there are around each."""
    corner = {(f, v): 3 * f + k for f, face in enumerate(Q.faces.tolist()) for k, v in enumerate(face)}
    joined = [
        (corner[f, v], corner[g, v]) for edge, (f, g) in zip(Q.edges.tolist(), Q.sides.tolist()) for v in edge
    ]
    root = components(3 * len(Q.faces), *np.array(joined).T)
    tops = np.flatnonzero(root == np.arange(len(root)))
    return np.bincount(Q.faces.ravel()[tops], minlength=len(Q.points))


def _changes(Q: ExactSurface, n: Point) -> np.ndarray:
    """(vertices,) half the number of sign changes, along n, of the edges in their order around a vertex."""
    height = np.empty(len(Q.points), dtype=object)
    height[:] = [inner(n, p) for p in Q.points]
    out = np.zeros(len(Q.points), dtype=np.int64)
    for k in range(3):
        v, p, q = Q.faces[:, k], Q.faces[:, (k + 1) % 3], Q.faces[:, (k + 2) % 3]
        np.add.at(out, v, ((height[p] > height[v]) != (height[q] > height[v])).astype(np.int64))
    return out // 2


# --- triangles ------------------------------------------------------------------------------------------------------


def _a_facet_at(A: ExactSurface) -> np.ndarray:
    out = np.full(len(A.points), -1, dtype=np.int64)
    out[A.faces] = np.arange(len(A.faces))[:, None]
    return out


def _repeated(corners: np.ndarray, facets: np.ndarray, counts: np.ndarray) -> Pieces:
    corners = np.where(counts[:, None, None] < 0, corners[:, ::-1], corners)
    times = np.abs(counts).astype(np.int64)
    return Pieces(np.repeat(corners, times, axis=0), np.repeat(facets, times, axis=0))


def _facets_and_vertices(faces: np.ndarray, counts: np.ndarray, facet_at: np.ndarray) -> Pieces:
    f, v = np.nonzero(counts)
    corners = np.stack([faces[f], np.repeat(v[:, None], 3, axis=1)], axis=2)
    return _repeated(corners, np.stack([f, facet_at[v]], axis=1), counts[f, v])


def _turned_round(pieces: Pieces) -> Pieces:
    return Pieces(pieces.corners[..., ::-1], pieces.facets[:, ::-1])


def _two_edges(A: ExactSurface, B: ExactSurface, counts: np.ndarray) -> Pieces:
    """Parallelograms of two edges, as two triangles each."""
    i, j = np.nonzero(counts)
    (p, q), (r, s) = A.edges[i].T, B.edges[j].T
    first = np.stack([np.stack([p, q, q], axis=1), np.stack([r, r, s], axis=1)], axis=2)
    second = np.stack([np.stack([p, q, p], axis=1), np.stack([r, s, s], axis=1)], axis=2)
    facets = np.stack([A.sides[i, 0], B.sides[j, 0]], axis=1)
    of_both = np.concatenate([counts[i, j]] * 2)
    return _repeated(np.concatenate([first, second]), np.concatenate([facets] * 2), of_both)


def _check_closed(ids: np.ndarray) -> None:
    starts, ends = ids.ravel(), np.roll(ids, -1, axis=1).ravel()
    edges, which = np.unique(np.sort(np.stack([starts, ends], axis=1), axis=1), axis=0, return_inverse=True)
    if np.bincount(which.ravel(), weights=np.where(starts < ends, 1.0, -1.0), minlength=len(edges)).any():
        raise CollideError("the convolution of two solids does not close; please report it")
