"""Facets of a rounded solid merged: short edges, thin facets and needless vertices of a closed surface taken away.

Every step replaces triangles by triangles with the same border: a closed surface stays closed. Each triangle keeps the
number of an input triangle, its source, and with the source a plane and a class. With the reach τ,

* an edge not longer than τ is shortened to a vertex, triangles of opposite sense at the same corners cancel;
* a triangle not higher than τ over its longest edge gives way to the triangle behind that edge, split at its apex;
* a vertex goes where all triangles around are of a single class and within τ of a plane, or of two planes with the
  vertex within τ of a straight border: the polygon around is split into ears.

Each short edge and needless vertex takes a vertex away, and each split shortens the sum of all edges or leaves fewer
thin triangles; `_MAX_SPLITS` ends what would go on by turns of both.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_i64
from collide.numerics.vec3 import Vec3, add, component, cross, dot, norm, scale, sub, vec3_at
from collide.solids.closed_surface import (
    MAX_RING,
    N_PLANES,
    N_TRIANGLES,
    N_VERTICES,
    PLANE,
    cancel,
    edge_length,
    farthest_plane,
    is_smooth,
    merge,
    note_shift,
    open_surface,
    over,
    push,
    push_all,
    put,
    remove,
    vertex_after,
    vertex_before,
)
from collide.solids.near_features import join_near_features
from collide.solids.polygon_ears import clip_polygon

#: Splits of thin triangles before they are given up, for each vertex: more than rounded solids were seen to need.
_MAX_SPLITS = 64


# --- short edges and thin triangles -------------------------------------------------------------


@kernel
def _longest_edge(surface, t):
    """(the first corner of the longest edge, its length, height of the triangle over the edge)."""
    a = vec3_at(surface.points, 3 * surface.corners[3 * t])
    b = vec3_at(surface.points, 3 * surface.corners[3 * t + 1])
    c = vec3_at(surface.points, 3 * surface.corners[3 * t + 2])
    ab, bc, ca = norm(sub(b, a)), norm(sub(c, b)), norm(sub(a, c))
    slot, longest = 0, ab
    if bc > longest:
        slot, longest = 1, bc
    if ca > longest:
        slot, longest = 2, ca
    area = norm(cross(sub(b, a), sub(c, a)))
    return 3 * t + slot, longest, area / longest if longest > 0.0 else 0.0


@kernel
def _least_height(surface, i, j, k):
    """Height of a triangle of three vertices over its longest edge."""
    a, b, c = vec3_at(surface.points, 3 * i), vec3_at(surface.points, 3 * j), vec3_at(surface.points, 3 * k)
    longest = max(norm(sub(b, a)), norm(sub(c, b)), norm(sub(a, c)))
    return norm(cross(sub(b, a), sub(c, a))) / longest if longest > 0.0 else 0.0


@kernel
def _behind(surface, c):
    """The corner at b of a triangle b, a, d behind the edge from corner c at a to b, −1 without.

    A thin triangle with a longer edge is no choice: its turn is first. A split at apex p has to shorten the sum of all
    edges, or leave no thin triangle of both; two thin ones would be split in turns without end.
    """
    a, b, p = surface.corners[c], vertex_after(surface, c), vertex_before(surface, c)
    d = surface.first[b]
    while d >= 0:
        if vertex_after(surface, d) == a:
            longest, _, height = _longest_edge(surface, d // 3)
            apex = vertex_before(surface, d)
            thinnest = min(_least_height(surface, p, a, apex), _least_height(surface, b, p, apex))
            is_better = edge_length(surface, p, apex) < edge_length(surface, a, b) or thinnest > surface.reach
            if is_better and (height > surface.reach or longest == d):
                return d
        d = surface.following[d]
    return -1


@kernel
def _split_behind(surface, size, c, behind, height):
    """Give the triangle with the longest edge from corner c way to the triangle behind; returns how many wait.

    height : of the triangle over that edge.
    The triangle a, b and apex p; behind its longest edge b, a, d. Both become p, a, d and b, p, d.
    """
    a, b, p, d = surface.corners[c], vertex_after(surface, c), vertex_before(surface, c), vertex_before(surface, behind)
    s, t = c // 3, behind // 3
    remove(surface, s)
    remove(surface, t)
    size = push(surface, push(surface, push(surface, push(surface, size, a), b), p), d)
    if d == p:
        return size
    put(surface, s, p, a, d, surface.sources[t], surface.plane[t])
    put(surface, t, b, p, d, surface.sources[t], surface.plane[t])
    note_shift(surface, t, p, height)
    cancel(surface, p, False)
    return size


@kernel
def _tidy(surface, size, vertex, with_thin):
    """Do away with a short edge or a thin triangle at a vertex; (whether there was, how many vertices wait)."""
    c = surface.first[vertex]
    while c >= 0:
        w = vertex_after(surface, c)
        v = vertex_before(surface, c)
        w = w if edge_length(surface, vertex, w) <= edge_length(surface, vertex, v) else v
        if edge_length(surface, vertex, w) <= surface.reach:
            # Triangles of either end follow to the other: to where their planes are nearer.
            if farthest_plane(surface, vertex, w) <= farthest_plane(surface, w, vertex):
                return True, merge(surface, size, vertex, w)
            return True, merge(surface, size, w, vertex)
        c = surface.following[c]
    c = surface.first[vertex] if with_thin else -1
    while c >= 0:
        longest, length, height = _longest_edge(surface, c // 3)
        if height <= surface.reach and length > surface.reach:
            behind = _behind(surface, longest)
            if behind >= 0:
                return True, _split_behind(surface, size, longest, behind, height)
        c = surface.following[c]
    return False, size


@kernel
def _needs_tidying(surface):
    """Whether a triangle has a short edge or is thin, or nearly: squares are off by less than 2⁻⁴⁰ of themselves."""
    limit = surface.reach * surface.reach * (1.0 + 2.0**-40)
    for t in range(surface.counts[N_TRIANGLES]):
        i = surface.corners[3 * t]
        if i < 0:
            continue
        a = vec3_at(surface.points, 3 * i)
        b = vec3_at(surface.points, 3 * surface.corners[3 * t + 1])
        c = vec3_at(surface.points, 3 * surface.corners[3 * t + 2])
        ab, bc, ca = sub(b, a), sub(c, b), sub(a, c)
        n = cross(ab, ca)
        x, y, z = dot(ab, ab), dot(bc, bc), dot(ca, ca)
        if min(x, y, z) <= limit or dot(n, n) <= limit * max(x, y, z):
            return True
    return False


@kernel
def tidy_all(surface, with_thin):
    """Until no vertex has a short edge, nor, if they are asked for, a thin triangle."""
    size = push_all(surface, False)
    n_splits = 0
    while size > 0:
        size -= 1
        vertex = surface.stack[size]
        surface.waiting[vertex] = 0
        is_done = False
        while not is_done and surface.first[vertex] >= 0 and n_splits < _MAX_SPLITS * surface.counts[N_VERTICES]:
            changed, size = _tidy(surface, size, vertex, with_thin)
            is_done = not changed
            n_splits += 1


# --- needless vertices --------------------------------------------------------------------------


@kernel
def _go_around(surface, vertex):
    """The ring around a vertex; returns its size, 0 where the triangles are no single ring, or too many."""
    ring = surface.ring
    n = 0
    c = surface.first[vertex]
    while c >= 0:
        if n == MAX_RING:
            return 0
        ring.ids[n] = c
        n += 1
        c = surface.following[c]
    if n < 3:
        return 0
    c = ring.ids[0]
    for k in range(n):
        ring.points[k] = vertex_after(surface, c)
        ring.triangles[k] = c // 3
        end = vertex_before(surface, c)
        matches = 0
        for j in range(n):
            if vertex_after(surface, ring.ids[j]) == end:
                matches += 1
                c = ring.ids[j]
        if matches != 1 or (end == ring.points[0]) != (k == n - 1):
            return 0
    return n


@kernel
def _find_turns(surface, n):
    """Places in the border of edges between planes or classes; returns their number, 3 for more."""
    ring = surface.ring
    count = 0
    for k in range(n):
        j = (k + n - 1) % n
        if not is_smooth(
            surface, ring.triangles[j], ring.triangles[k], ring.points[j], ring.points[(k + 1) % n]
        ):
            if count == 2:
                return 3
            ring.turns[count] = k
            count += 1
    return count


@kernel
def _is_straight(surface, p, vertex, q):
    """Whether a vertex is within τ of the segment from p to q, and between its ends."""
    a, b = vec3_at(surface.points, 3 * p), vec3_at(surface.points, 3 * q)
    d, w = sub(b, a), sub(vec3_at(surface.points, 3 * vertex), a)
    length, along = dot(d, d), dot(w, d)
    return 0.0 < along < length and norm(cross(d, w)) <= surface.reach * math.sqrt(length)


@kernel
def _farthest_in_part(surface, plane, vertex, first, count, n, limit):
    """How far a plane is from a part of the ring around a vertex, and from vertices taken away before; the first
    distance beyond a limit.
    """
    ring = surface.ring
    farthest = over(surface, plane, vertex)
    for k in range(count + 1):
        farthest = max(farthest, over(surface, plane, ring.points[(first + k) % n]))
    for k in range(count):
        v = surface.held[ring.triangles[(first + k) % n]]
        while v >= 0 and farthest <= limit:
            farthest = max(farthest, over(surface, plane, v // 2))
            v = surface.next_held[v]
    return farthest


@kernel
def _fit_plane(surface, plane, vertex, first, count, n):
    """Write the mean plane of a part of the ring in place of a plane."""
    ring = surface.ring
    origin = vec3_at(surface.points, 3 * vertex)
    normal = Vec3(0.0, 0.0, 0.0)
    middle = Vec3(0.0, 0.0, 0.0)
    for k in range(count):
        a = sub(vec3_at(surface.points, 3 * ring.points[(first + k) % n]), origin)
        b = sub(vec3_at(surface.points, 3 * ring.points[(first + k + 1) % n]), origin)
        normal = add(normal, cross(a, b))
        middle = add(middle, add(a, b))
    size = norm(normal)
    if not size > 0.0:
        return False
    at = PLANE * plane
    middle = add(origin, scale(0.5 / count, middle))
    normal = scale(1.0 / size, normal)
    for axis in range(3):
        surface.planes[at + axis] = component(middle, axis)
        surface.planes[at + 3 + axis] = component(normal, axis)
    return True


@kernel
def _is_folded(surface, vertex, i, j, n):
    """Whether the two parts of a ring lie on one another within τ, with opposite sense, and the corner sticks out: the
    sheet of no thickness between them may end at the edge from points[i] to points[j].
    """
    ring = surface.ring
    p, q = surface.plane[ring.triangles[i]], surface.plane[ring.triangles[j]]
    normal = vec3_at(surface.planes, PLANE * p + 3)
    if not dot(normal, vec3_at(surface.planes, PLANE * q + 3)) < -0.5:
        return False
    if _farthest_in_part(surface, p, vertex, 0, n, n, surface.reach) > surface.reach:
        return False
    at = vec3_at(surface.points, 3 * vertex)
    a = sub(vec3_at(surface.points, 3 * ring.points[i]), at)
    b = sub(vec3_at(surface.points, 3 * ring.points[j]), at)
    return dot(cross(a, b), normal) > 0.0


@kernel
def _plane_for(surface, vertex, first, count, n):
    """(a triangle of a part of the ring, a plane within τ of the part, how far): planes of its triangles, or their
    mean plane; the plane −1 without.
    """
    ring = surface.ring
    triangle, best, nearest, last = ring.triangles[first], -1, surface.reach, -1
    for i in range(count):
        t = ring.triangles[(first + i) % n]
        plane = surface.plane[t]
        if plane == last:
            continue
        last = plane
        farthest = _farthest_in_part(surface, plane, vertex, first, count, n, nearest)
        if farthest <= nearest:
            triangle, best, nearest = t, plane, farthest
    plane = surface.counts[N_PLANES]
    if best < 0 and PLANE * plane < len(surface.planes) and _fit_plane(surface, plane, vertex, first, count, n):
        farthest = _farthest_in_part(surface, plane, vertex, first, count, n, nearest)
        if farthest <= nearest:
            surface.counts[N_PLANES] += 1
            return triangle, plane, farthest
    return triangle, best, nearest


@kernel
def _ears(surface, vertex, first, count, n, made):
    """Split the part of the ring from triangle ``first`` on; returns the number of triangles made, −1 where the part
    is not flat enough or a new edge would stand where another triangle has the same.
    """
    ring = surface.ring
    t, plane, farthest = _plane_for(surface, vertex, first, count, n)
    if plane < 0:
        return -1
    m = count if count == n else count + 1
    normal = vec3_at(surface.planes, PLANE * plane + 3)
    axis = 0
    for k in range(1, 3):
        if abs(component(normal, k)) > abs(component(normal, axis)):
            axis = k
    u, v = (axis + 1) % 3, (axis + 2) % 3
    if component(normal, axis) < 0.0:
        u, v = v, u
    origin = vec3_at(surface.points, 3 * ring.points[first])
    for k in range(m):
        ring.ids[k] = ring.points[(first + k) % n]
        w = sub(vec3_at(surface.points, 3 * ring.ids[k]), origin)
        ring.seen[2 * k] = component(w, u)
        ring.seen[2 * k + 1] = component(w, v)
    after = clip_polygon(ring.ids, m, ring.seen, 0.125 * surface.reach, ring.made, made)
    for k in range(made, after):
        ring.sources[k] = surface.sources[t]
        ring.planes[k] = plane
        for j in range(3):
            if _is_taken(surface, vertex, ring.made[3 * k + j], ring.made[3 * k + (j + 1) % 3]):
                return -1
    surface.far[0] = max(surface.far[0], farthest)
    return after


@kernel
def _is_taken(surface, vertex, p, q):
    """Whether a triangle off a vertex has the edge from p to q."""
    c = surface.first[p]
    while c >= 0:
        if vertex_after(surface, c) == q and vertex_before(surface, c) != vertex:
            return True
        c = surface.following[c]
    return False


@kernel
def _gather(surface, entry, first, count, n):
    """The list of an entry and all vertices held by a part of the ring."""
    ring = surface.ring
    surface.next_held[entry] = -1
    for k in range(count):
        t = ring.triangles[(first + k) % n]
        e = surface.held[t]
        surface.held[t] = -1
        while e >= 0:
            following = surface.next_held[e]
            surface.next_held[e] = entry
            entry, e = e, following
    return entry


@kernel
def _take_away(surface, vertex):
    """Take a needless vertex away; returns the size of its ring, 0 where the vertex stays."""
    n = _go_around(surface, vertex)
    if n == 0:
        return 0
    ring = surface.ring
    n_turns = _find_turns(surface, n)
    if n_turns != 0 and n_turns != 2:
        return 0
    i, j = 0, n
    if n_turns == 2:
        i, j = ring.turns[0], ring.turns[1]
        is_fold = not _is_straight(surface, ring.points[i], vertex, ring.points[j])
        if is_fold and not _is_folded(surface, vertex, i, j, n):
            return 0
    count = j - i
    of_first = _ears(surface, vertex, i, count, n, 0) if count > 1 else 0
    if of_first < 0:
        return 0
    made = of_first
    if n - count > 1:
        made = _ears(surface, vertex, j, n - count, n, made)
        if made < 0:
            return 0
    held = _gather(surface, 2 * vertex, i, count, n)
    held_too = _gather(surface, 2 * vertex + 1, j, n - count, n)
    for k in range(n):
        remove(surface, ring.triangles[k])
    for k in range(made):
        at = 3 * k
        put(
            surface, ring.triangles[k], ring.made[at], ring.made[at + 1], ring.made[at + 2], ring.sources[k],
            ring.planes[k],
        )
    # A part without triangles was a triangle that ended: what it held is at the border of the other part.
    if of_first > 0:
        surface.held[ring.triangles[0]] = held
    if made > of_first:
        surface.held[ring.triangles[of_first]] = held_too
    for k in range(n):
        cancel(surface, ring.points[k], False)
    return n


@kernel
def _thin_out(surface):
    """Take needless vertices away; returns their number."""
    size = push_all(surface, True)
    count = 0
    while size > 0:
        size -= 1
        vertex = surface.stack[size]
        surface.waiting[vertex] = 0
        n = _take_away(surface, vertex)
        count += 1 if n > 0 else 0
        for k in range(n):
            neighbour = surface.ring.points[k]
            if surface.movable[neighbour] != 0:
                size = push(surface, size, neighbour)
    return count


@kernel
def _simplify(surface):
    """Until there are no short edges, no thin triangles and no needless vertices."""
    while True:
        if _needs_tidying(surface):
            tidy_all(surface, False)
            tidy_all(surface, True)
        if _thin_out(surface) == 0:
            return


@entry("int64(int64, float64, boolean)")
def merge_flat_facets(header_at, reach, joins):
    """Merge facets of the surface behind a header (`SurfaceArrays`); returns how many triangles remain, at the
    beginning of its corners and sources.   reach : τ [m].   joins : join near features as well.
    """
    surface = open_surface(view_i64(header_at, 15), reach)
    _simplify(surface)
    if joins and join_near_features(surface) > 0:
        _simplify(surface)
    corners, sources = surface.corners, surface.sources
    for v in range(surface.counts[N_VERTICES]):
        surface.far[0] = max(surface.far[0], surface.drift[v])
    count = 0
    for t in range(surface.counts[N_TRIANGLES]):
        if corners[3 * t] >= 0:
            for k in range(3):
                corners[3 * count + k] = corners[3 * t + k]
            sources[count] = sources[t]
            count += 1
    return count
