"""One level of a hierarchy: an independent set of vertices leaves, and the holes are closed by the hull of their rims.

Dobkin, Kirkpatrick, "A linear algorithm for determining the separation of convex polyhedra" (1985), with
the bounded degree of Barba and Langerman, section 4. The set is taken greedily by rising degree. Because no
two of its vertices are neighbours, their stars are apart and each hole is closed by itself. A vertex stays where
its removal would push a neighbour's degree over the bound: so only the first surface has too large degrees, or
what remains of it next to a cut (`vertex_cutting`).
"""

from __future__ import annotations

import numpy as np

from collide.kernels import entry, kernel, view_i32, view_i64
from collide.papers.hierarchies.half_edges import (
    FREE,
    USED,
    HalfEdges,
    degree_of,
    drop_star,
    fill_hole,
    following,
    plan_hole,
    preceding,
    read_ring,
)
from collide.papers.hierarchies.true_facets import cloud_at

#: Places in the state beyond `half_edges.FREE` and `USED`: the vertices that must stay, and how many were removed.
ANCHORS = 2
REMOVED = 6
STATE = 7


@kernel
def mesh_at(corners_at, twins_at, triangles, leaving_at, rows, state_at):
    """The `HalfEdges` of a surface; state_at may be 0 where nothing changes."""
    return HalfEdges(
        view_i32(corners_at, 3 * triangles), view_i32(twins_at, 3 * triangles), view_i32(leaving_at, rows),
        view_i64(state_at, STATE),
    )


@kernel
def is_anchor(state, v):
    for k in range(ANCHORS, ANCHORS + 4):
        if state[k] == v:
            return True
    return False


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def build_mesh(triangles_at, their_twins_at, count, corners_at, twins_at, triangles, leaving_at, rows, state_at):
    """Start a changing surface from triangles and their twins."""
    their_corners = view_i32(triangles_at, 3 * count)
    their_twins = view_i32(their_twins_at, 3 * count)
    corners, twins, leaving, state = mesh_at(corners_at, twins_at, triangles, leaving_at, rows, state_at)
    for v in range(rows):
        leaving[v] = -1
    for h in range(3 * count):
        corners[h] = their_corners[h]
        twins[h] = their_twins[h]
        leaving[their_corners[h]] = h
    state[FREE] = -1
    state[USED] = count


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64)")
def measure_degrees(corners_at, twins_at, triangles, leaving_at, rows, vertices_at, count, degree_at):
    """Degrees of the vertices listed, by row."""
    mesh = mesh_at(corners_at, twins_at, triangles, leaving_at, rows, 0)
    vertices = view_i32(vertices_at, count)
    degree = view_i32(degree_at, rows)
    for k in range(count):
        degree[vertices[k]] = degree_of(mesh, vertices[k])


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def write_level(corners_at, twins_at, triangles, leaving_at, rows, vertices_at, count, start_at, neighbours_at):
    """Neighbours of the vertices listed, counter-clockwise, each from the one with the lowest number."""
    corners, twins, leaving, _ = mesh_at(corners_at, twins_at, triangles, leaving_at, rows, 0)
    vertices = view_i32(vertices_at, count)
    start = view_i64(start_at, count + 1)
    neighbours = view_i32(neighbours_at, start[count])
    for k in range(count):
        first = leaving[vertices[k]]
        least = first
        h = first
        while True:
            if corners[following(h)] < corners[following(least)]:
                least = h
            h = twins[preceding(h)]
            if h == first:
                break
        h = least
        for at in range(start[k], start[k + 1]):
            neighbours[at] = corners[following(h)]
            h = twins[preceding(h)]


@entry(
    "void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, "
    "int64,"
    " int64, int64, int64)"
)
def thin(
    scaled_at, originals_at, rows, work_at, digits_at, centres, corners_at, twins_at, triangles, leaving_at,
    vertices_at, count, degree_at, blocked_at, order_at, bound, max_degree, scratch_at, state_at,
):
    """Remove an independent set; ``blocked`` vertices stay; neighbours of removed vertices are blocked, too.

    degree : by row, kept up to date; 0 for a vertex removed.
    bound : no degree is raised over this.
    max_degree : only vertices of at most this degree leave.
    Arguments are flat: entries take integers, doubles and booleans alone.
    """
    cloud = cloud_at(scaled_at, originals_at, rows, work_at, digits_at, centres, 0)
    mesh = mesh_at(corners_at, twins_at, triangles, leaving_at, rows, state_at)
    vertices = view_i32(vertices_at, count)
    degree = view_i32(degree_at, rows)
    blocked = view_i32(blocked_at, rows)
    order = view_i32(order_at, count)
    ring = view_i64(scratch_at, max_degree)
    outer = view_i64(scratch_at + 8 * max_degree, max_degree)
    plan = view_i64(scratch_at + 16 * max_degree, 3 * max_degree)
    stack = view_i64(scratch_at + 40 * max_degree, 2 * max_degree)
    open_edges = view_i64(scratch_at + 56 * max_degree, max_degree)
    state = mesh.state
    listed = by_degree(vertices, count, degree, max_degree, order)
    for k in range(listed):
        v = np.int64(order[k])
        if blocked[v] != 0 or is_anchor(state, v):
            continue
        d = read_ring(mesh, v, ring, outer)
        if not plan_hole(cloud, ring, 0, d, plan, stack) or raises(degree, ring, d, plan, bound, open_edges):
            continue
        drop_star(mesh, v)
        fill_hole(mesh, ring, 0, d, outer, plan, open_edges)
        change_degrees(degree, ring, d, plan)
        for m in range(d):
            blocked[ring[m]] = 1
        degree[v] = 0
        mesh.leaving[v] = -1
        state[REMOVED] += 1


@kernel
def by_degree(vertices, count, degree, max_degree, order):
    """The vertices of degree at most ``max_degree`` in ``order``, by rising degree, else in their own order."""
    listed = 0
    d = 3
    remaining = count
    while d <= max_degree and remaining > 0:
        remaining = 0
        after = max_degree + 1
        for k in range(count):
            this = np.int64(degree[vertices[k]])
            if this == d:
                order[listed] = vertices[k]
                listed += 1
            elif this > d:
                remaining += 1
                after = min(after, this)
        d = after
    return listed


@kernel
def raises(degree, ring, d, plan, bound, gain):
    """Whether closing a hole as planned raises a degree over the bound."""
    for m in range(d):
        gain[m] = -1
    for made in range(1, d - 2):  # each triangle but the first brings the diagonal first–last
        gain[plan[3 * made]] += 1
        gain[plan[3 * made + 2]] += 1
    for m in range(d):
        if gain[m] > 0 and degree[ring[m]] + gain[m] > bound:
            return True
    return False


@kernel
def change_degrees(degree, ring, d, plan):
    for m in range(d):
        degree[ring[m]] -= 1
    for made in range(1, d - 2):
        degree[ring[plan[3 * made]]] += 1
        degree[ring[plan[3 * made + 2]]] += 1
