"""Neighbours of every vertex of a hull, in cyclic order."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.hull.triangle_neighbours import SideWorkspace, find_neighbours
from collide.kernels import entry, kernel, view_f64, view_i32
from collide.numerics.vec3 import Vec3, add, cross, divide, dot, max_abs, neg, norm1, put_vec3, sub, vec3_at

#: Facets whose unit normals differ less are taken for one: the arc between them is nothing but rounding.
SAME_NORMAL = 1e-12


class Rings(NamedTuple):
    """Neighbours of every vertex of a closed surface, counter-clockwise from outside, and the facets' unit normals.

    starts : (n + 2,) where the ring of a vertex begins.   ring : neighbours.
    ring_facets : the facet between a neighbour and the next; of flat hulls side 0 or 1.
    normals : (f, 3), of flat hulls those of their two sides.
    corner : (n + 1,) whether a vertex is extreme in a range of directions, as far as rounded normals tell.
    following : (6 f,) of workspace.
    """

    starts: Any
    ring: Any
    ring_facets: Any
    normals: Any
    corner: Any
    following: Any


class FlatWorkspace(NamedTuple):
    """Where rings of a flat hull of n points are worked out: its border, and one side closed to a surface.

    following, previous : (n,) along the border.   bent : (n,).   closed : (f + 2, 3) facets.
    """

    sides: SideWorkspace
    following: Any
    previous: Any
    bent: Any
    closed: Any


@kernel
def put_rings(points, n, facets, n_facets, rings, space):
    """Rings of a hull's surface: 0, of a flat one 1, and −1 where facets are no closed surface.

    points : (n + 1, 3), the last of any value.   facets : as `exact_hull.convex_hull` gives them: the second half of a
    flat hull's is the first from the other side.   rings : for two facets and a point more.
    """
    status = put_in_order(points, n, facets, n_facets, rings)
    if status == 0:
        return 0
    return 1 if status == 1 and _put_polygon(points, n, facets, n_facets, rings, space) else -1


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def order_rings(
    points_at, n, facets_at, n_facets, starts_at, ring_at, ring_facets_at, following_at, corner_at, normals_at
):
    """`put_in_order` outside kernels: (n + 1) starts, (3 f,) ring and ring_facets, (6 f,) of workspace, (n,)
    corner, 32-bit integers, and (f, 3) normals, doubles.
    """
    rings = Rings(
        view_i32(starts_at, n + 1), view_i32(ring_at, 3 * n_facets), view_i32(ring_facets_at, 3 * n_facets),
        view_f64(normals_at, 3 * n_facets), view_i32(corner_at, n), view_i32(following_at, 6 * n_facets),
    )
    return put_in_order(view_f64(points_at, 3 * n), n, view_i32(facets_at, 3 * n_facets), n_facets, rings)


@kernel
def put_in_order(points, n, facets, n_facets, rings):
    """Rings of a surface of n points, with a normal of each facet. O(n_facets).

    Returns 0; 1 where two facets have the same directed edge, as both sides of a flat hull may; 2 where the surface is
    not closed or a vertex joins several sheets.
    """
    starts, ring, ring_facets, normals = rings.starts, rings.ring, rings.ring_facets, rings.normals
    following, place = rings.following, rings.corner
    for i in range(n + 1):
        starts[i] = 0
    for i in range(3 * n_facets):
        starts[facets[i] + 1] += 1
    for i in range(n):
        starts[i + 1] += starts[i]
        place[i] = starts[i]
    for facet in range(n_facets):
        _unit_normal(points, facets, facet, normals)
        for k in range(3):
            vertex = facets[3 * facet + k]
            slot = place[vertex]
            place[vertex] += 1
            ring[slot] = facets[3 * facet + (k + 1) % 3]
            following[2 * slot] = facets[3 * facet + (k + 2) % 3]
            following[2 * slot + 1] = facet
    for i in range(n):
        place[i] = -1
    for vertex in range(n):
        status = _order_ring(starts[vertex], starts[vertex + 1], ring, ring_facets, following, place)
        if status != 0:
            return status
    for vertex in range(n):
        bends = _bends(normals, ring_facets, starts[vertex], starts[vertex + 1])
        place[vertex] = 1 if bends >= 3 else 0
    return 0


@kernel
def _bends(normals, ring_facets, begin, end):
    """How many edges of a ring have facets of different normals on their sides."""
    bends = 0
    for k in range(begin, end):
        p = 3 * ring_facets[k - 1 if k > begin else end - 1]
        q = 3 * ring_facets[k]
        if differ(vec3_at(normals, p), vec3_at(normals, q)):
            bends += 1
    return bends


@kernel
def differ(p, q):
    """Whether two unit normals are those of different planes."""
    return max_abs(sub(p, q)) > SAME_NORMAL


@kernel
def _order_ring(begin, end, ring, ring_facets, following, place):
    """Bring one ring into cyclic order; ``place`` finds the slot of a neighbour."""
    for slot in range(begin, end):
        neighbour = ring[slot]
        if begin <= place[neighbour] < end:
            return 1
        place[neighbour] = slot
    slot = begin
    for i in range(begin, end):
        if not begin <= slot < end or (slot == begin and i > begin):
            return 2
        # The slot's neighbour is the follower of the slot before it: ``ring`` may be overwritten.
        follower = following[2 * slot]
        ring_facets[i] = following[2 * slot + 1]
        slot = place[follower]
        ring[i] = follower
    if end > begin and slot != begin:
        return 2
    # What was written is one place late: turn it back.
    if end > begin:
        last = ring[end - 1]
        for i in range(end - 1, begin, -1):
            ring[i] = ring[i - 1]
        ring[begin] = last
    return 0


@kernel
def _unit_normal(points, facets, facet, normals):
    """Outward unit normal, or 0 where rounding leaves nothing of it."""
    a = vec3_at(points, 3 * facets[3 * facet])
    b = vec3_at(points, 3 * facets[3 * facet + 1])
    c = vec3_at(points, 3 * facets[3 * facet + 2])
    put_vec3(normals, 3 * facet, unit(cross(sub(b, a), sub(c, a))))


@kernel
def unit(v):
    """v scaled to length 1; zeros where v has no length."""
    largest = max_abs(v)
    if not largest > 0.0:
        return Vec3(0.0, 0.0, 0.0)
    scaled = divide(v, largest)
    length = math.sqrt(dot(scaled, scaled))
    return divide(scaled, length) if length > 0.0 else Vec3(0.0, 0.0, 0.0)


# --- flat hulls ----------------------------------------------------------------------------------


@kernel
def _put_polygon(points, n, facets, n_facets, rings, space):
    """Rings of a flat hull; False where its two sides are not the same triangulated disc.

    A side, closed by triangles from its border to an added point, is a surface with ordered rings; without the added
    point, these are the rings of the side. Where all vertices are corners of the border, the border alone is kept:
    diagonals may have thousands of ends.
    """
    half = n_facets // 2
    if n_facets % 2 != 0 or not _are_mirrored(facets, half):
        return False
    normal = vec3_at(rings.normals, 0)
    for k in range(1, n_facets):
        of_facet = vec3_at(rings.normals, 3 * k)
        normal = add(normal, of_facet if k < half else neg(of_facet))
    n_border = _put_border(facets, n, half, space)
    if n_border < 0:
        return False
    following, previous, bent = space.following, space.previous, space.bent
    is_convex = True  # whether all vertices are corners of the border; those of facets begin sides in sides.starts
    for k in range(n):
        bent[k] = 0
        if (following[k] >= 0) != (previous[k] >= 0):
            return False
        if following[k] >= 0 and _turns(points, k, following[k], previous[k]):
            bent[k] = 1
        is_used = space.sides.starts[k + 1] > space.sides.starts[k]
        is_convex = is_convex and is_used == (bent[k] == 1)
    if is_convex:
        _keep_border(n, rings, space)
    elif not _close_disc(points, n, half, n_border, rings, space):
        return False
    for k in range(n):
        rings.corner[k] = bent[k]
    normal = divide(normal, math.sqrt(dot(normal, normal)))
    put_vec3(rings.normals, 0, normal)
    put_vec3(rings.normals, 3, neg(normal))
    return True


@kernel
def _are_mirrored(facets, half):
    for k in range(3 * half):
        if facets[3 * half + k] != facets[k - k % 3 + (2 - k % 3)]:
            return False
    return True


@kernel
def _put_border(facets, n, half, space):
    """Write the next and previous vertex along the border of the first half's triangles, and triangles from the border
    to point n; how many, −1 where these may not fit."""
    following, previous, closed = space.following, space.previous, space.closed
    find_neighbours(facets, n, half, space.sides)
    for k in range(n):
        following[k] = -1
        previous[k] = -1
    for k in range(3 * half):
        closed[k] = facets[k]
    n_border = 0
    for side in range(3 * half):
        if space.sides.beside[side] >= 0:
            continue
        if n_border == half + 2:  # a disc of so many triangles has at most as many sides
            return -1
        a, b = facets[side], facets[side - side % 3 + (side + 1) % 3]
        following[a] = b
        previous[b] = a
        at = 3 * (half + n_border)
        closed[at] = b
        closed[at + 1] = a
        closed[at + 2] = n
        n_border += 1
    return n_border


@kernel
def _turns(points, vertex, following, previous):
    """Whether a border certainly turns at a vertex."""
    p = vec3_at(points, 3 * vertex)
    after, before = sub(vec3_at(points, 3 * following), p), sub(vec3_at(points, 3 * previous), p)
    return max_abs(cross(after, before)) > 4e-15 * norm1(after) * norm1(before)


@kernel
def _keep_border(n, rings, space):
    at = 0
    for k in range(n):
        rings.starts[k] = at
        if space.following[k] >= 0:
            rings.ring[at] = space.following[k]
            rings.ring[at + 1] = space.previous[k]
            rings.ring_facets[at] = 0
            rings.ring_facets[at + 1] = 1
            at += 2
    rings.starts[n] = at


@kernel
def _close_disc(points, n, half, n_border, rings, space):
    """Rings of a side, closed by triangles to point n, then without point n; the two sides are facets 0 and 1.

    A neighbour just before point n loses the facet between the two: the lower side follows.
    """
    put_vec3(points, 3 * n, vec3_at(points, 0))
    if put_in_order(points, n + 1, space.closed, half + n_border, rings) != 0:
        return False
    starts, ring, ring_facets = rings.starts, rings.ring, rings.ring_facets
    at = 0
    k = 0
    for vertex in range(n):
        end = starts[vertex + 1]
        starts[vertex] = at
        while k < end:
            if ring[k] != n:
                ring[at] = ring[k]
                ring_facets[at] = 0 if ring_facets[k] < half else 1
                at += 1
            k += 1
    starts[n] = at
    return True
