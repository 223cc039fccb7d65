"""Vertices, edges and facets of a closed surface that come within a reach of each other, joined.

Vertices near each other become a single vertex; a vertex near an edge or a facet splits the edge or the facet. Edges
near each other between their ends are split where nearest; an edge within a flat part of the surface is flipped
instead. Facets lying on one another get the same triangles, and triangles of opposite sense cancel.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.numerics.counting_sort import order_by_key
from collide.numerics.vec3 import Vec3, add, component, cross, dot, norm, scale, sub, vec3_at
from collide.solids.closed_surface import (
    N_TRIANGLES,
    N_VERTICES,
    cancel,
    edge_length,
    half_edge,
    height_over,
    is_smooth,
    merge,
    note_shift,
    put,
    remove,
    vertex_after,
    vertex_before,
)

#: Passes over all pairs before the rest is left as it is.
_MAX_PASSES = 40


@kernel
def join_near_features(surface):
    """Join what comes near among movable vertices; returns how many splits, merges and flips were made."""
    total = 0
    for _ in range(_MAX_PASSES):
        changes = _join_edges(surface, _list_edges(surface), False)
        if changes == 0:
            changes = _join_facets(surface)
        if changes == 0:
            changes = _join_edges(surface, _list_edges(surface), True)
        total += changes
        if changes == 0:
            break
    return total


# --- pairs of edges -----------------------------------------------------------------------------


@kernel
def _list_edges(surface):
    """List the edges between movable vertices, in order along an axis; returns their number."""
    edges, corners = surface.edges, surface.corners
    n = 0
    for c in range(3 * surface.counts[N_TRIANGLES]):
        if corners[c - c % 3] < 0:
            continue
        p, q = corners[c], vertex_after(surface, c)
        if p < q and surface.movable[p] != 0 and surface.movable[q] != 0:
            edges.p[n] = p
            edges.q[n] = q
            n += 1
    _order_along_axis(surface, n)
    return n


@kernel
def _order_along_axis(surface, n):
    """Order n listed edges along the axis of their largest extent, by keys from 0 to n − 1; returns (axis, start, keys
    per unit).
    """
    edges = surface.edges
    low = Vec3(1e300, 1e300, 1e300)
    high = Vec3(-1e300, -1e300, -1e300)
    for e in range(n):
        a, b = vec3_at(surface.points, 3 * edges.p[e]), vec3_at(surface.points, 3 * edges.q[e])
        low = Vec3(min(low.x, a.x, b.x), min(low.y, a.y, b.y), min(low.z, a.z, b.z))
        high = Vec3(max(high.x, a.x, b.x), max(high.y, a.y, b.y), max(high.z, a.z, b.z))
    extent = sub(high, low)
    axis = 0
    for k in range(1, 3):
        if component(extent, k) > component(extent, axis):
            axis = k
    start = component(low, axis) - surface.reach
    per_unit = (n - 1) / (component(extent, axis) + 4.0 * surface.reach) if n > 1 else 0.0
    for e in range(n):
        a = surface.points[3 * edges.p[e] + axis]
        b = surface.points[3 * edges.q[e] + axis]
        edges.lowest[e] = int((min(a, b) - surface.reach - start) * per_unit)
        edges.highest[e] = int((max(a, b) + surface.reach - start) * per_unit)
        edges.items[e] = e
    order_by_key(edges.lowest, edges.items, n, max(n, 1), edges.starts, edges.order)
    return axis, start, per_unit


@kernel
def _join_edges(surface, n, middles):
    """Join near ones of n listed edges, at their ends or between their ends; returns the number of changes."""
    edges = surface.edges
    changes = 0
    for i in range(n):
        e = edges.order[i]
        p, q = edges.p[e], edges.q[e]
        for j in range(i + 1, n):
            f = edges.order[j]
            if edges.lowest[f] > edges.highest[e]:
                break
            a, b = edges.p[f], edges.q[f]
            if _boxes_are_near(surface, p, q, a, b):
                joined = _join_middles(surface, p, q, a, b) if middles else _join_ends(surface, p, q, a, b)
                changes += 1 if joined else 0
    return changes


@kernel
def _boxes_are_near(surface, p, q, a, b):
    """Whether the boxes around edges p – q and a – b come within τ."""
    points, reach = surface.points, surface.reach
    for k in range(3):
        u, v, x, y = points[3 * p + k], points[3 * q + k], points[3 * a + k], points[3 * b + k]
        if min(u, v) > max(x, y) + reach or min(x, y) > max(u, v) + reach:
            return False
    return True


@kernel
def _is_edge(surface, p, q):
    """Whether a triangle has an edge between two vertices."""
    return half_edge(surface, p, q) >= 0 or half_edge(surface, q, p) >= 0


@kernel
def _join_ends(surface, p, q, a, b):
    """Join the ends of two edges to the other edge where near; whether so."""
    return (
        _joins_end(surface, a, p, q) or _joins_end(surface, b, p, q)
        or _joins_end(surface, p, a, b) or _joins_end(surface, q, a, b)
    )


@kernel
def _joins_end(surface, x, p, q):
    """Join a vertex to an edge p – q if near, as an end or by a split; whether so."""
    if x == p or x == q:
        return False
    at, a, b = vec3_at(surface.points, 3 * x), vec3_at(surface.points, 3 * p), vec3_at(surface.points, 3 * q)
    d, w = sub(b, a), sub(at, a)
    squared, along = dot(d, d), dot(w, d)
    size = norm(d)
    if norm(cross(d, w)) > surface.reach * size or along < -surface.reach * size:
        return False
    if along > squared + surface.reach * size or not _is_edge(surface, p, q) or surface.first[x] < 0:
        return False
    for end in (p, q):
        if edge_length(surface, x, end) <= surface.reach:
            merge(surface, 0, x, end)
            _forget(surface)
            return True
    if not 0.0 < along < squared:
        return False
    return split_edge(surface, p, q, x)


@kernel
def _forget(surface):
    """No vertex waits: all are asked again."""
    for v in range(surface.counts[N_VERTICES]):
        surface.waiting[v] = 0


@kernel
def _join_middles(surface, p, q, a, b):
    """Join edges that pass near each other between their ends: an edge in a flat part of the surface is flipped, two
    others are split at a new vertex; whether so.
    """
    if a == p or a == q or b == p or b == q:
        return False
    u, v = vec3_at(surface.points, 3 * p), vec3_at(surface.points, 3 * q)
    x, y = vec3_at(surface.points, 3 * a), vec3_at(surface.points, 3 * b)
    d, e, w = sub(v, u), sub(y, x), sub(x, u)
    n = cross(d, e)
    squared = dot(n, n)
    if not squared > 0.0 or abs(dot(w, n)) > surface.reach * norm(n):
        return False
    s = dot(cross(w, e), n) / squared
    t = dot(cross(w, d), n) / squared
    if not (0.0 < s < 1.0 and 0.0 < t < 1.0) or not _is_edge(surface, p, q) or not _is_edge(surface, a, b):
        return False
    of_first, of_second = _rank(surface, p, q), _rank(surface, a, b)
    if of_first >= 0 or of_second >= 0:
        return _flip(surface, p, q) if of_first >= of_second else _flip(surface, a, b)
    new = surface.counts[N_VERTICES]
    if new >= len(surface.first):
        return False
    middle = scale(0.5, add(add(u, scale(s, d)), add(x, scale(t, e))))
    for k in range(3):
        surface.points[3 * new + k] = component(middle, k)
    surface.movable[new] = 1
    surface.counts[N_VERTICES] += 1
    return split_edge(surface, p, q, new) and split_edge(surface, a, b, new)


@kernel
def _only_half_edge(surface, p, q):
    """The corner at p of the single triangle with the edge from p to q, −1 without or with several."""
    c = half_edge(surface, p, q)
    if c < 0:
        return -1
    d = surface.following[c]
    while d >= 0:
        if vertex_after(surface, d) == q:
            return -1
        d = surface.following[d]
    return c


@kernel
def _rank(surface, p, q):
    """Of an edge in a flat part of the surface a number, the same all over the part in most cases; −1 of others."""
    c, d = _only_half_edge(surface, p, q), _only_half_edge(surface, q, p)
    if c < 0 or d < 0:
        return -1
    if not is_smooth(surface, c // 3, d // 3, vertex_before(surface, c), vertex_before(surface, d)):
        return -1
    source = min(surface.sources[c // 3], surface.sources[d // 3])
    return surface.class_of[source] * len(surface.class_of) + source


@kernel
def _flip(surface, p, q):
    """Flip an edge between two triangles that make a convex quadrangle; whether so."""
    c, d = _only_half_edge(surface, p, q), _only_half_edge(surface, q, p)
    r, o = vertex_before(surface, c), vertex_before(surface, d)
    if r == o:
        return False
    a, b = vec3_at(surface.points, 3 * p), vec3_at(surface.points, 3 * q)
    x, y = vec3_at(surface.points, 3 * r), vec3_at(surface.points, 3 * o)
    normal = cross(sub(b, a), sub(x, a))
    across = sub(y, x)
    limit = surface.reach * norm(across) * norm(normal)
    if not dot(cross(sub(a, x), across), normal) > limit or not dot(cross(across, sub(b, x)), normal) > limit:
        return False
    s, t = c // 3, d // 3
    source, plane = surface.sources[s], surface.plane[s]
    source_behind, plane_behind = surface.sources[t], surface.plane[t]
    surface.far[0] = max(surface.far[0], height_over(surface, s, o), height_over(surface, t, r))
    remove(surface, s)
    remove(surface, t)
    put(surface, s, r, p, o, source, plane)
    put(surface, t, o, q, r, source_behind, plane_behind)
    cancel(surface, r, False)
    cancel(surface, o, False)
    return True


@kernel
def _from_line(surface, p, q, x):
    """How far vertex x is from the line through p and q."""
    a = vec3_at(surface.points, 3 * p)
    d, w = sub(vec3_at(surface.points, 3 * q), a), sub(vec3_at(surface.points, 3 * x), a)
    length = norm(d)
    return norm(cross(d, w)) / length if length > 0.0 else norm(w)


@kernel
def split_edge(surface, p, q, x):
    """Split an edge in all its triangles at a vertex; False without room."""
    for _ in range(2):
        c = half_edge(surface, p, q)
        while c >= 0:
            t, r, new = c // 3, vertex_before(surface, c), surface.counts[N_TRIANGLES]
            if new >= len(surface.sources):
                return False
            remove(surface, t)
            if r != x:
                note_shift(surface, t, x, _from_line(surface, p, q, x))
                put(surface, t, p, x, r, surface.sources[t], surface.plane[t])
                put(surface, new, x, q, r, surface.sources[t], surface.plane[t])
                surface.counts[N_TRIANGLES] += 1
            c = half_edge(surface, p, q)
        p, q = q, p
    cancel(surface, x, False)
    return True


# --- vertices and facets ------------------------------------------------------------------------


@kernel
def _join_facets(surface):
    """Split facets at vertices near their inside; returns how many."""
    edges = surface.edges
    n = 0
    for v in range(surface.counts[N_VERTICES]):
        if surface.first[v] >= 0 and surface.movable[v] != 0:
            edges.p[n] = v
            edges.q[n] = v
            n += 1
    axis, start, per_unit = _order_along_axis(surface, n)
    changes = 0
    for t in range(surface.counts[N_TRIANGLES]):
        if surface.corners[3 * t] < 0:
            continue
        a = surface.points[3 * surface.corners[3 * t] + axis]
        b = surface.points[3 * surface.corners[3 * t + 1] + axis]
        c = surface.points[3 * surface.corners[3 * t + 2] + axis]
        first = max(int((min(a, b, c) - 2.0 * surface.reach - start) * per_unit), 0)
        last = min(int((max(a, b, c) + 2.0 * surface.reach - start) * per_unit), n - 1)
        if first > last:
            continue
        for k in range(edges.starts[first], edges.starts[last + 1]):
            x = edges.p[edges.order[k]]
            if surface.corners[3 * t] >= 0 and surface.first[x] >= 0:
                changes += 1 if _split_facet(surface, t, x) else 0
    return changes


@kernel
def _split_facet(surface, t, x):
    """Split a facet at a vertex near its inside; whether so."""
    i, j, k = surface.corners[3 * t], surface.corners[3 * t + 1], surface.corners[3 * t + 2]
    if x == i or x == j or x == k:
        return False
    a, b, c = vec3_at(surface.points, 3 * i), vec3_at(surface.points, 3 * j), vec3_at(surface.points, 3 * k)
    at = vec3_at(surface.points, 3 * x)
    for axis in range(3):
        u, v, w, y = component(a, axis), component(b, axis), component(c, axis), component(at, axis)
        if y > max(u, v, w) + surface.reach or y < min(u, v, w) - surface.reach:
            return False
    n = cross(sub(b, a), sub(c, a))
    height = abs(dot(n, sub(at, a)))
    if height > surface.reach * norm(n):
        return False
    if not dot(cross(sub(b, a), sub(at, a)), n) > 0.0 or not dot(cross(sub(c, b), sub(at, b)), n) > 0.0:
        return False
    if not dot(cross(sub(a, c), sub(at, c)), n) > 0.0:
        return False
    new = surface.counts[N_TRIANGLES]
    if new + 1 >= len(surface.sources):
        return False
    source, plane = surface.sources[t], surface.plane[t]
    note_shift(surface, t, x, height / norm(n))
    remove(surface, t)
    put(surface, t, i, j, x, source, plane)
    put(surface, new, j, k, x, source, plane)
    put(surface, new + 1, k, i, x, source, plane)
    surface.counts[N_TRIANGLES] += 2
    cancel(surface, x, False)
    return True
