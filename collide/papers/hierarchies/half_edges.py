"""A closed, changing surface of triangles: rings of vertices, and holes filled with the hull of their rim.

Half-edge h = 3 t + e runs from corner e of triangle t to the next corner, counter-clockwise seen
from outside. ``corners[h]`` is its start, ``twins[h]`` the opposite half-edge,
``leaving[v]`` a half-edge from vertex v. Free triangles are chained through ``twins`` from ``state[FREE]``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.kernels import kernel
from collide.papers.hierarchies.symbolic_perturbation import side

#: Places in the state: first free triangle or −1, triangles ever used.
FREE, USED = 0, 1


class HalfEdges(NamedTuple):
    """A changing surface in kernels.   state : FREE, USED, and what `independent_sets` adds."""

    corners: Any
    twins: Any
    leaving: Any
    state: Any


@kernel
def following(h):
    """The next half-edge of the triangle."""
    return h - 2 if h % 3 == 2 else h + 1


@kernel
def preceding(h):
    return h + 2 if h % 3 == 0 else h - 1


@kernel
def new_triangle(mesh, a, b, c):
    """First half-edge of a triangle a, b, c without neighbours."""
    corners, twins, leaving = mesh.corners, mesh.twins, mesh.leaving
    t = mesh.state[FREE]
    if t >= 0:
        mesh.state[FREE] = twins[3 * t]
    else:
        t = mesh.state[USED]
        mesh.state[USED] += 1
    h = 3 * t
    corners[h] = a
    corners[h + 1] = b
    corners[h + 2] = c
    leaving[a] = h
    leaving[b] = h + 1
    leaving[c] = h + 2
    return h


@kernel
def drop_triangle(mesh, t):
    corners, twins = mesh.corners, mesh.twins
    corners[3 * t] = -1
    twins[3 * t] = mesh.state[FREE]
    mesh.state[FREE] = t


@kernel
def join(mesh, g, h):
    """Make two half-edges each other's twins."""
    mesh.twins[g] = h
    mesh.twins[h] = g


@kernel
def read_ring(mesh, v, ring, outer):
    """Degree of v; its neighbours counter-clockwise, and the half-edges beyond the rim: outer[k] runs from
    ring[k + 1] to ring[k].
    """
    corners, twins, leaving = mesh.corners, mesh.twins, mesh.leaving
    first = leaving[v]
    h = first
    k = 0
    while True:
        ring[k] = corners[following(h)]
        outer[k] = twins[following(h)]
        k += 1
        h = twins[preceding(h)]
        if h == first:
            return k


@kernel
def drop_star(mesh, v):
    """Free all triangles at v; their rim is left without neighbours."""
    twins, leaving = mesh.twins, mesh.leaving
    first = leaving[v]
    h = first
    while True:
        after = twins[preceding(h)]
        drop_triangle(mesh, h // 3)
        h = after
        if h == first:
            return


@kernel
def plan_hole(cloud, ring, start, count, plan, stack):
    """Triangles of the convex surface over a ring of count ≥ 3 vertices, as seen from the side where the ring runs
    counter-clockwise.

    ring[start : start + count] in convex position, its edges and their chain on a convex body: the
    triangle at the edge from the last to the first is found by wrapping, then the chains on both of its
    sides in turn. ``plan`` receives the places (first, apex, last) of count − 2 triangles, each after
    its neighbour across the edge first–last. ``False`` where four coplanar points leave a triangle open. At most count²
    / 2 tests, for balanced surfaces count·log count.
    """
    made = 0
    stack[0] = 0
    stack[1] = count - 1
    depth = 1
    while depth > 0:
        depth -= 1
        i = stack[2 * depth]
        j = stack[2 * depth + 1]
        k = i + 1
        a = ring[start + i]
        c = ring[start + j]
        for m in range(i + 2, j):
            sign = side(cloud, a, ring[start + k], c, ring[start + m])
            if sign == 0:
                return False
            if sign > 0:
                k = m
        plan[3 * made] = i
        plan[3 * made + 1] = k
        plan[3 * made + 2] = j
        made += 1
        # The longer chain is pushed first: the stack stays short.
        if k - i >= j - k:
            depth = push(stack, depth, i, k)
            depth = push(stack, depth, k, j)
        else:
            depth = push(stack, depth, k, j)
            depth = push(stack, depth, i, k)
    return True


@kernel
def push(stack, depth, i, j):
    if j - i < 2:
        return depth
    stack[2 * depth] = i
    stack[2 * depth + 1] = j
    return depth + 1


@kernel
def fill_hole(mesh, ring, start, count, outer, plan, open_edges):
    """Insert the planned triangles; outer[start + k] becomes the twin of half-edge ring k → k + 1.

    open_edges : ``count`` places: the half-edge without a twin from ring[i] to a farther ring vertex.
    """
    for made in range(count - 2):
        i = plan[3 * made]
        k = plan[3 * made + 1]
        j = plan[3 * made + 2]
        h = new_triangle(mesh, ring[start + i], ring[start + k], ring[start + j])
        if made == 0:
            join(mesh, h + 2, outer[start + count - 1])
        else:
            # The chains (i, j) on the stack are nested or apart, and the one planned next ends where another begins:
            # its first place names it.
            join(mesh, h + 2, open_edges[i])
        if k == i + 1:
            join(mesh, h, outer[start + i])
        else:
            open_edges[i] = h
        if j == k + 1:
            join(mesh, h + 1, outer[start + k])
        else:
            open_edges[k] = h + 1


@kernel
def degree_of(mesh, v):
    """Degree of a vertex."""
    twins, leaving = mesh.twins, mesh.leaving
    first = np.int64(leaving[v])
    h = first
    degree = 0
    while True:
        degree += 1
        h = np.int64(twins[preceding(h)])
        if h == first:
            return degree
