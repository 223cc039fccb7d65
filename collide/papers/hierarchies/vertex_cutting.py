"""Vertices of large degree are cut off: section 4's splitting, in doubles, with the new vertices proven inside.

Barba and Langerman put a plane between a vertex w and all others; new vertices are made at its crossings with the edges
of w, and w is removed. In doubles no new vertex would lie on its edge. Here the new vertex is rounded to a point of a
tetrahedron w, r, r', s, where r, r' follow each other around w and s is a point proven to lie among w and its
neighbours. Exact tests decide, so the new vertex is a convex combination of w, with positive weight, and its
neighbours: enough for B2 and the walk.

All new vertices in a plane would leave a facet of many corners, triangulated by rounding errors, and its
triangulation may again have vertices of large degree. So new vertex j is put a little deeper the less often 2 divides
j: the lid over them is a shallow dome in which every other vertex is cut off by a triangle, then
every other vertex of the rest, and so on. Its degrees grow like 2·log2 of the degree of w.

The surface is kept only if proven convex. Nearly coplanar faces at w have no convex surface of rounded
vertices. Then w is removed, and the new vertices are inserted in sequence, as many as are extreme. If even the
proof fails, since the edges of w differ too much in length for doubles, w stays, with a degree over the
bound, falling as neighbours are removed.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import entry, kernel, view_i32, view_i64
from collide.papers.hierarchies.cut_placement import (
    INSETS,
    Cut,
    axis_of,
    find_inner,
    inset_of,
    place,
    prove_new,
    shortest_part,
)
from collide.papers.hierarchies.half_edges import (
    degree_of,
    drop_star,
    drop_triangle,
    fill_hole,
    following,
    join,
    new_triangle,
    plan_hole,
    preceding,
    read_ring,
)
from collide.papers.hierarchies.independent_sets import mesh_at
from collide.papers.hierarchies.symbolic_perturbation import exact_side, side
from collide.papers.hierarchies.true_facets import cloud_at
from collide.papers.hierarchies.vertex_insertion import insert_near

#: Integers of workspace for each neighbour of the vertex: ring, outer, fresh, and what either way of cutting takes.
SCRATCH = 20


@entry(
    "int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64,"
    " int64, int64, int64, int64)"
)
def cut(
    scaled_at, originals_at, rows, work_at, digits_at, exponent, centres, corners_at, twins_at, triangles, leaving_at,
    seen_at, degree_at, blocked_at, w, first, may_go, scratch_at, state_at,
):
    """Cut vertex w off; rows first, first + 1, ... are for new vertices, and one more.

    may_go : whether w may go even where no new vertex can take its place.

    Returns how many rows are used, as many as w had neighbours; −1 where w had to stay.
    Arguments are flat: entries take integers, doubles and booleans alone.
    """
    cloud = cloud_at(scaled_at, originals_at, rows, work_at, digits_at, centres, exponent)
    mesh = mesh_at(corners_at, twins_at, triangles, leaving_at, rows, state_at)
    seen = view_i32(seen_at, triangles)
    degree = view_i32(degree_at, rows)
    blocked = view_i32(blocked_at, rows)
    k = np.int64(degree[w])
    ring = view_i64(scratch_at, k)
    outer = view_i64(scratch_at + 8 * k, k)
    fresh = view_i64(scratch_at + 16 * k, k)
    workspace = scratch_at + 24 * k
    read_ring(mesh, w, ring, outer)
    for j in range(k):
        fresh[j] = first + j
    axis, nearest = axis_of(cloud.scaled, w, ring, k)
    inner = first + k  # behind the new vertices
    this = Cut(w, k, ring, outer, fresh, inner, axis, nearest)
    provable = nearest > 0.0 and find_inner(cloud, w, ring, k, inner)
    done = False
    for attempt in range(INSETS if provable else 0):
        if not done and place(cloud, this, inset_of(attempt)):
            done = strip_and_lid(cloud, mesh, this, workspace)
    if not done and provable and may_go != 0:
        done = one_by_one(cloud, mesh, seen, this, workspace)
    if not done:
        return -1
    for j in range(k):
        blocked[ring[j]] = 1
        degree[ring[j]] = degree_of(mesh, ring[j])
        if mesh.leaving[fresh[j]] >= 0:
            blocked[fresh[j]] = 1
            degree[fresh[j]] = degree_of(mesh, fresh[j])
    degree[w] = 0
    mesh.leaving[w] = -1
    return k


@kernel
def strip_and_lid(cloud, mesh, cut, workspace):
    """Put the new vertices in the place of w, as a strip along the ring and a lid; False, and nothing changed, where
    that is not convex.
    """
    k, fresh = cut.k, cut.fresh
    before = view_i64(workspace, k)
    after = view_i64(workspace + 8 * k, k)
    lid = view_i64(workspace + 16 * k, k)
    plan = view_i64(workspace + 24 * k, 3 * k)
    stack = view_i64(workspace + 48 * k, 2 * k)
    open_edges = view_i64(workspace + 64 * k, k)
    made = view_i64(workspace + 72 * k, 3 * k)
    if not plan_hole(cloud, fresh, 0, k, plan, stack):
        return False
    drop_star(mesh, cut.w)
    put_strip(cloud, mesh, cut, before, after, lid)
    fill_hole(mesh, fresh, 0, k, lid, plan, open_edges)
    if convex_at_all(cloud, mesh, cut) and all_extreme(cloud, mesh, cut):
        return True
    take_back(mesh, cut, made)
    return False


@kernel
def one_by_one(cloud, mesh, seen, cut, workspace):
    """Remove w, then insert the new vertices; new vertices not strictly extreme are removed again.

    Returns ``False``, with the surface unchanged, for a new vertex without a proof of its place, or an open hole.
    """
    k, ring, fresh = cut.k, cut.ring, cut.fresh
    least = shortest_part(cloud, cut)
    for j in range(k):
        if not prove_new(cloud, cut, j, least):
            return False
    plan = view_i64(workspace, 3 * k)
    stack = view_i64(workspace + 24 * k, 2 * k)
    open_edges = view_i64(workspace + 40 * k, k)
    if not plan_hole(cloud, ring, 0, k, plan, stack):
        return False
    drop_star(mesh, cut.w)
    fill_hole(mesh, ring, 0, k, cut.outer, plan, open_edges)
    region = view_i64(workspace, 3 * k)
    rim = view_i64(workspace + 24 * k, 3 * k)
    search = view_i64(workspace + 48 * k, 7 * k)
    step = coprime_step(k)
    for number in range(k):
        j = (number * step) % k  # next to none inserted just before: each sees few triangles
        insert_near(cloud, mesh, seen, fresh[j], ring[j], region, rim, search)
    for j in range(k):
        if mesh.leaving[fresh[j]] >= 0 and not proven_extreme(cloud, mesh, fresh[j]):
            close_over(cloud, mesh, fresh[j], k, workspace)
    return True


@kernel
def close_over(cloud, mesh, v, k, workspace):
    """Remove v, which has at most 2 k neighbours."""
    ring = view_i64(workspace, 2 * k)
    outer = view_i64(workspace + 16 * k, 2 * k)
    plan = view_i64(workspace + 32 * k, 6 * k)
    stack = view_i64(workspace + 80 * k, 4 * k)
    open_edges = view_i64(workspace + 112 * k, 2 * k)
    degree = read_ring(mesh, v, ring, outer)
    if plan_hole(cloud, ring, 0, degree, plan, stack):
        drop_star(mesh, v)
        fill_hole(mesh, ring, 0, degree, outer, plan, open_edges)
        mesh.leaving[v] = -1


@kernel
def coprime_step(k):
    """A number about 0.618·k without a divisor in common with k."""
    step = max(1, (k * 618) // 1000)
    while True:
        a, b = k, step
        while b > 0:
            a, b = b, a % b
        if a == 1:
            return step
        step += 1


@kernel
def put_strip(cloud, mesh, cut, before, after, lid):
    """The quadrilaterals between the ring and the new vertices, two triangles each.

    before, after, lid : k half-edges each, out: of the quadrilaterals towards their neighbours and the new vertices.
    """
    k, ring, fresh = cut.k, cut.ring, cut.fresh
    for j in range(k):
        n = j + 1 if j + 1 < k else 0
        r0, r1, v0, v1 = ring[j], ring[n], fresh[j], fresh[n]
        if side(cloud, r0, r1, v0, v1) < 0:
            h = new_triangle(mesh, r0, r1, v0)
            g = new_triangle(mesh, v0, r1, v1)
            join(mesh, h + 1, g)
            before[j], after[j], lid[j] = h + 2, g + 1, g + 2
        else:
            h = new_triangle(mesh, r0, r1, v1)
            g = new_triangle(mesh, r0, v1, v0)
            join(mesh, h + 2, g)
            before[j], after[j], lid[j] = g + 2, h + 1, g + 1
        join(mesh, h, cut.outer[j])
    for j in range(k):
        join(mesh, after[j], before[j + 1 if j + 1 < k else 0])


@kernel
def bent_inwards(cloud, mesh, h):
    """Whether the perturbed surface is strictly convex at half-edge h."""
    corners, twins = mesh.corners, mesh.twins
    a = np.int64(corners[h])
    b = np.int64(corners[following(h)])
    c = np.int64(corners[preceding(h)])
    d = np.int64(corners[preceding(np.int64(twins[h]))])
    return side(cloud, a, b, c, d) < 0


@kernel
def convex_at_all(cloud, mesh, cut):
    """Whether the surface is convex at all edges of the new triangles."""
    twins, leaving = mesh.twins, mesh.leaving
    for j in range(cut.k):
        if not bent_inwards(cloud, mesh, cut.outer[j]):
            return False
        first = np.int64(leaving[cut.fresh[j]])
        h = first
        while True:
            if not bent_inwards(cloud, mesh, h):
                return False
            h = np.int64(twins[preceding(h)])
            if h == first:
                break
    return True


@kernel
def all_extreme(cloud, mesh, cut):
    """Whether all new vertices are proven extreme."""
    for j in range(cut.k):
        if not proven_extreme(cloud, mesh, cut.fresh[j]):
            return False
    return True


@kernel
def proven_extreme(cloud, mesh, v):
    """Whether v is strictly extreme on a surface that is convex: its facets are in three planes or more, exactly."""
    corners, twins, leaving = mesh.corners, mesh.twins, mesh.leaving
    bends = 0
    first = np.int64(leaving[v])
    h = first
    while True:
        b, c = np.int64(corners[following(h)]), np.int64(corners[preceding(h)])
        d = np.int64(corners[preceding(np.int64(twins[h]))])
        if exact_side(cloud, v, b, c, d) != 0:
            bends += 1
            if bends == 3:
                return True
        h = np.int64(twins[preceding(h)])
        if h == first:
            return False


@kernel
def take_back(mesh, cut, made):
    """Put the star of w back in place of the new triangles. made : workspace for their numbers."""
    corners, twins, leaving = mesh.corners, mesh.twins, mesh.leaving
    k, ring, fresh = cut.k, cut.ring, cut.fresh
    n_made = 0
    for j in range(k):
        v = fresh[j]
        first = np.int64(leaving[v])
        h = first
        while True:
            # Once each: from the first new vertex among its corners.
            b, c = corners[following(h)], corners[preceding(h)]
            if not (fresh[0] <= b < v or fresh[0] <= c < v):
                made[n_made] = h // 3
                n_made += 1
            h = np.int64(twins[preceding(h)])
            if h == first:
                break
    for j in range(n_made):
        drop_triangle(mesh, made[j])
    for j in range(k):
        leaving[fresh[j]] = -1
        h = new_triangle(mesh, cut.w, ring[j], ring[j + 1 if j + 1 < k else 0])
        join(mesh, h + 1, cut.outer[j])
        made[j] = h
    for j in range(k):
        join(mesh, made[j] + 2, made[j + 1 if j + 1 < k else 0])
