"""A closed surface of triangles under change by kernels: lists of corners at each vertex, and steps.

Every step replaces triangles by triangles with the same border: a closed surface stays closed. A surface is opened from
a header of addresses made by `SurfaceArrays`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64
from collide.numerics.vec3 import cross, divide, dot, norm, put_vec3, sub, vec3_at

#: Vertices with more triangles around are not taken away.
MAX_RING = 64
#: Numbers of a plane: a point, a unit normal.
PLANE = 6
#: Places of `Surface.counts`: planes, vertices and triangles in use.
N_PLANES, N_VERTICES, N_TRIANGLES = range(3)


class Ring(NamedTuple):
    """What is around a vertex, counter-clockwise.

    points : the border, from corner to corner.   triangles : from points[k] to points[k + 1].
    turns : places in the border of edges between two planes or classes.   ids, seen : of a polygon, for its ears.
    made : triangles of ears.   sources, planes : of these.
    """

    points: Any
    triangles: Any
    turns: Any
    ids: Any
    made: Any
    sources: Any
    planes: Any
    seen: Any


class Edges(NamedTuple):
    """Edges p, q listed by the lower end of their boxes along an axis.   lowest, highest : keys along the axis.
    order, starts, items : of `order_by_key`.
    """

    p: Any
    q: Any
    lowest: Any
    highest: Any
    order: Any
    starts: Any
    items: Any


class Surface(NamedTuple):
    """A closed surface of triangles, the first corner −1 where a triangle is gone.

    points : (3 V).   corners : (3 T) vertices.   sources : (T,) numbers of input triangles.
    plane : (T,) the plane of each triangle.   class_of : by source.   planes : PLANE numbers a plane.
    held, next_held : (T,), (2 V,) lists of vertices taken away, by the triangle in their place: 2 v or 2 v + 1 is
        vertex v, for either side of a border.
    first, following : lists of the corners at each vertex, −1 at the end.
    drift : how far points at each vertex were shifted.   movable : whether a vertex may be taken away.
    stack, waiting : vertices to be looked at.   ring, edges : workspace.   reach : τ [m].
    far : (1,) the farthest any corner or held vertex is from the plane of its triangle, where looked at.
    counts : N_PLANES, N_VERTICES, N_TRIANGLES.
    """

    points: Any
    corners: Any
    sources: Any
    plane: Any
    class_of: Any
    planes: Any
    held: Any
    next_held: Any
    first: Any
    following: Any
    drift: Any
    movable: Any
    stack: Any
    waiting: Any
    far: Any
    counts: Any
    reach: float
    ring: Ring
    edges: Edges


class SurfaceArrays:
    """The arrays of a surface; to join its features with room for as much again twice, and for lists of edges.

    vertices : (n, 3).   corners : (m, 3).   sources : (m,).   plane : (m,).   class_of : (k,).   planes : (p, PLANE).
    movable : (n,) bool.
    """

    def __init__(self, vertices, corners, sources, plane, class_of, planes, movable, joins: bool):
        n, m, n_planes = len(vertices), len(corners), len(planes)
        V, T, S = (3 * n + 64, 3 * m + 128, MAX_RING + 2) if joins else (n, m, MAX_RING + 2)
        capacity = n_planes + 2 * V
        self.counts = np.array([n_planes, n, m], dtype=np.int64)
        self.far = np.zeros(1)
        floats = [(vertices, 3 * V), (planes, PLANE * capacity)]
        integers = [(corners, 3 * T), (sources, T), (plane, T), (movable, V)]
        self.points, self.planes = (_filled(x, size, np.float64) for x, size in floats)
        self.corners, self.sources, self.plane, self.movable = (_filled(x, size, np.int64) for x, size in integers)
        self.class_of = np.ascontiguousarray(class_of, dtype=np.int64)
        self.integers = np.empty(4 * T + 5 * V + 14 * S + (21 * T + 2 if joins else 0), dtype=np.int64)
        self.doubles = np.empty(V + 2 * S)
        arrays = (
            self.points, self.corners, self.sources, self.plane, self.class_of, self.planes, self.movable,
            self.integers, self.doubles, self.far, self.counts,
        )
        self.header = np.array([V, T, capacity, len(self.class_of), *map(address_of, arrays)], dtype=np.int64)


def _filled(values, size: int, dtype) -> np.ndarray:
    made = np.empty(size, dtype=dtype)
    made[: values.size] = values.ravel()
    return made


@entry("void(int64, int64, int64, int64, int64, int64, int64)")
def write_planes(places_at, n, corners_at, n_facets, sides_at, k, planes_at):
    """Planes of facets, a point and a unit normal each, in doubles; the normal 0 of facets without area.

    places : (n, 3) vertices.   corners : (F, 3).   sides : (k,) 2 · facet, and 1 more for facets turned over.
    planes : out, (k, PLANE).
    """
    places, corners = view_f64(places_at, 3 * n), view_i64(corners_at, 3 * n_facets)
    sides, planes = view_i64(sides_at, k), view_f64(planes_at, PLANE * k)
    for row in range(k):
        at = 3 * (sides[row] >> 1)
        p = vec3_at(places, 3 * corners[at])
        q, r = vec3_at(places, 3 * corners[at + 1]), vec3_at(places, 3 * corners[at + 2])
        normal = cross(sub(q, p), sub(r, p))
        size = norm(normal) if sides[row] & 1 == 0 else -norm(normal)
        put_vec3(planes, PLANE * row, p)
        put_vec3(planes, PLANE * row + 3, divide(normal, size if size != 0.0 else 1.0))


# --- corners and lists --------------------------------------------------------------------------


@kernel
def next_corner(c):
    """The following corner of a triangle."""
    return c - 2 if c % 3 == 2 else c + 1


@kernel
def vertex_after(surface, c):
    """The vertex at the following corner."""
    return surface.corners[next_corner(c)]


@kernel
def vertex_before(surface, c):
    """The vertex at the corner before."""
    return surface.corners[next_corner(next_corner(c))]


@kernel
def _unlink(surface, c):
    vertex = surface.corners[c]
    at = surface.first[vertex]
    if at == c:
        surface.first[vertex] = surface.following[c]
        return
    while surface.following[at] != c:
        at = surface.following[at]
    surface.following[at] = surface.following[c]


@kernel
def _link(surface, c, vertex):
    surface.corners[c] = vertex
    surface.following[c] = surface.first[vertex]
    surface.first[vertex] = c


@kernel
def remove(surface, t):
    """Take a triangle out of the surface."""
    for k in range(3):
        _unlink(surface, 3 * t + k)
    surface.corners[3 * t] = -1


@kernel
def put(surface, t, a, b, c, source, plane):
    """A triangle in place of a removed triangle."""
    _link(surface, 3 * t, a)
    _link(surface, 3 * t + 1, b)
    _link(surface, 3 * t + 2, c)
    surface.sources[t] = source
    surface.plane[t] = plane


@kernel
def half_edge(surface, p, q):
    """The corner at p of a triangle with the edge from p to q, −1 without."""
    c = surface.first[p]
    while c >= 0 and vertex_after(surface, c) != q:
        c = surface.following[c]
    return c


@kernel
def push(surface, size, vertex):
    """Note a vertex to be looked at; returns how many wait."""
    if surface.waiting[vertex] != 0:
        return size
    surface.waiting[vertex] = 1
    surface.stack[size] = vertex
    return size + 1


@kernel
def push_all(surface, movable_only):
    """Note all vertices, or the movable ones; returns how many."""
    size = 0
    for vertex in range(surface.counts[N_VERTICES]):
        if surface.first[vertex] >= 0 and (surface.movable[vertex] != 0 or not movable_only):
            size = push(surface, size, vertex)
    return size


@kernel
def cancel(surface, vertex, only_lowest):
    """Remove pairs of triangles of opposite sense with the same corners at a vertex.   only_lowest : look only at
    triangles whose lowest vertex this is: enough where all vertices are asked, in order.
    """
    c = surface.first[vertex]
    while c >= 0:
        p, q = vertex_after(surface, c), vertex_before(surface, c)
        if only_lowest and (p < vertex or q < vertex):
            c = surface.following[c]
            continue
        d = surface.first[vertex]
        while d >= 0 and not (vertex_after(surface, d) == q and vertex_before(surface, d) == p):
            d = surface.following[d]
        if d < 0:
            c = surface.following[c]
            continue
        remove(surface, c // 3)
        remove(surface, d // 3)
        c = surface.first[vertex]


@kernel
def edge_length(surface, p, q):
    """The distance of two vertices."""
    return norm(sub(vec3_at(surface.points, 3 * p), vec3_at(surface.points, 3 * q)))


@kernel
def over(surface, plane, vertex):
    """How far a vertex is from a plane."""
    w = sub(vec3_at(surface.points, 3 * vertex), vec3_at(surface.planes, PLANE * plane))
    return abs(dot(w, vec3_at(surface.planes, PLANE * plane + 3)))


@kernel
def height_over(surface, t, vertex):
    """How far a vertex is from the plane of a triangle."""
    return over(surface, surface.plane[t], vertex)


@kernel
def note_shift(surface, t, vertex, shift):
    """Count a triangle drawn to a vertex, its surface shifted by no more than ``shift``.

    The plane of a thin triangle may be far from the whole triangle: the surface is no farther off than before and the
    shift.
    """
    far = surface.far[0]
    surface.far[0] = min(max(far, height_over(surface, t, vertex)), far + shift)


@kernel
def farthest_plane(surface, vertex, place):
    """How far a place is from the farthest plane of the triangles at a vertex."""
    farthest = 0.0
    c = surface.first[vertex]
    while c >= 0:
        farthest = max(farthest, height_over(surface, c // 3, place))
        c = surface.following[c]
    return farthest


@kernel
def is_smooth(surface, s, t, before, after):
    """Whether neighbours s, t are of a class and nearly of a plane, facing the same way.   before, after : corners off
    their common edge, of s and of t.
    """
    if surface.class_of[surface.sources[s]] != surface.class_of[surface.sources[t]]:
        return False
    p, q = surface.plane[s], surface.plane[t]
    if p == q:
        return True
    if not dot(vec3_at(surface.planes, PLANE * p + 3), vec3_at(surface.planes, PLANE * q + 3)) > 0.5:
        return False
    return height_over(surface, s, after) <= surface.reach or height_over(surface, t, before) <= surface.reach


@kernel
def merge(surface, size, u, w):
    """Move vertex u to vertex w; returns how many wait."""
    surface.drift[w] = max(surface.drift[w], surface.drift[u] + edge_length(surface, u, w))
    c = surface.first[u]
    while c >= 0:
        following = surface.following[c]
        p, q = vertex_after(surface, c), vertex_before(surface, c)
        size = push(surface, push(surface, size, p), q)
        if p == w or q == w:
            remove(surface, c // 3)
        else:
            _unlink(surface, c)
            _link(surface, c, w)
        c = following
    cancel(surface, w, False)
    return push(surface, size, w)


@kernel
def open_surface(header, reach):
    """The surface behind a header, its lists made anew."""
    V, T, S = int(header[0]), int(header[1]), MAX_RING + 2
    at, doubles = int(header[11]), int(header[12])
    ring_at = at + 8 * (4 * T + 5 * V)
    ring = Ring(
        view_i64(ring_at, S), view_i64(ring_at + 8 * S, S), view_i64(ring_at + 16 * S, S),
        view_i64(ring_at + 24 * S, S), view_i64(ring_at + 32 * S, 6 * S), view_i64(ring_at + 80 * S, 2 * S),
        view_i64(ring_at + 96 * S, 2 * S), view_f64(doubles + 8 * V, 2 * S),
    )
    edges_at, E = ring_at + 112 * S, 3 * T
    edges = Edges(
        view_i64(edges_at, E), view_i64(edges_at + 8 * E, E), view_i64(edges_at + 16 * E, E),
        view_i64(edges_at + 24 * E, E), view_i64(edges_at + 32 * E, E), view_i64(edges_at + 40 * E, E + 2),
        view_i64(edges_at + 48 * E + 16, E),
    )
    surface = Surface(
        view_f64(header[4], 3 * V), view_i64(header[5], 3 * T), view_i64(header[6], T), view_i64(header[7], T),
        view_i64(header[8], int(header[3])), view_f64(header[9], PLANE * int(header[2])), view_i64(at, T),
        view_i64(at + 8 * T, 2 * V), view_i64(at + 8 * (T + 2 * V), V), view_i64(at + 8 * (T + 3 * V), 3 * T),
        view_f64(doubles, V), view_i64(header[10], V), view_i64(at + 8 * (4 * T + 3 * V), V),
        view_i64(at + 8 * (4 * T + 4 * V), V), view_f64(header[13], 1), view_i64(header[14], 3), reach, ring, edges,
    )
    for v in range(V):
        surface.first[v] = -1
        surface.drift[v] = 0.0
        surface.waiting[v] = 0
    for t in range(T):
        surface.held[t] = -1
    for c in range(3 * surface.counts[N_TRIANGLES]):
        _link(surface, c, surface.corners[c])
    for v in range(surface.counts[N_VERTICES]):
        cancel(surface, v, True)
    return surface
