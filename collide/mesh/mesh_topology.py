"""Which facets meet along which edges, and what follows: borders, orientation, fans, shells.

A surface is read as a chain of oriented triangles. The chain bounds a set exactly where every edge is run
along as often forwards as backwards; then its winding number around a point is defined, and
constant off the surface. More than two facets at an edge, or two fans at a vertex, do no harm.

Facets with two corners in the same place ("collapsed") add nothing to the chain and are left out.

Half-edge e of 3n starts at corner e % 3 of facet e // 3.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_i32, view_i64
from collide.mesh.union_find import find, find_with_parity, union, union_with_parity

# Flags of a facet, bits.
COLLAPSED = 1      # two of its corners are the same point
OPEN = 2           # an edge of it has no other facet
UNBALANCED = 4     # three or more facets meet at an edge of it, and their directions do not cancel
SEVERAL = 8        # the same, and they do cancel
TURNED = 16        # it is turned over against the greater part of its neighbours
ONE_SIDED = 32     # facets around it close to a band with a single side
DOUBLED = 64       # an earlier facet has the same corners in the same sense
BACK_TO_BACK = 128  # another facet has the same corners in the opposite sense
PINCHED = 256      # at a corner of it two fans of facets touch

# Counts; vertices that equal an earlier one are counted by `mesh_survey.py`.
EDGES, OPEN_EDGES, SHELLS, USED, PINCHES, WELDED, COUNTS = range(7)


class _Surface(NamedTuple):
    """n facets over n_vertices vertices.

    corners : three a facet.   flags : an integer a facet, out.   counts : COUNTS, out.
    order : the half-edges of facets that are not collapsed, grouped by edge.
    fan : parents of the facets' corners, in classes of corners around a vertex joined by edges.
    parent, parity : of the facets in classes of neighbours; a parity of 1 is turned over against the parent.
    tally, spare : room for an integer a facet, and a half-edge.
    per_vertex, stamp, upward, downward : room for an integer a vertex.
    """

    corners: np.ndarray
    n: int
    n_vertices: int
    flags: np.ndarray
    counts: np.ndarray
    order: np.ndarray
    spare: np.ndarray
    fan: np.ndarray
    parent: np.ndarray
    parity: np.ndarray
    tally: np.ndarray
    per_vertex: np.ndarray
    stamp: np.ndarray
    upward: np.ndarray
    downward: np.ndarray


@kernel
def _next_half_edge(e):
    return e - 2 if e % 3 == 2 else e + 1


@kernel
def _end(corners, e):
    """The vertex at the end of half-edge e, whose start is ``corners[e]``."""
    return corners[_next_half_edge(e)]


@kernel
def _lower(corners, e):
    return min(corners[e], _end(corners, e))


@kernel
def _higher(corners, e):
    return max(corners[e], _end(corners, e))


@kernel
def _runs_upward(corners, e):
    return corners[e] < _end(corners, e)


@kernel
def _sum_counts(count, n):
    """Prefix sums in place: from ``count[k + 1]``, how many items have key k, to ``count[k]``, where key k begins."""
    for k in range(n):
        count[k + 1] += count[k]


@kernel
def _sort_half_edges(surface):
    """Half-edges of all facets that are not collapsed, by lower and then by higher end; returns how many.

    Two counting sorts, so a vertex of very many facets costs no more than other vertices.
    """
    corners, count, spare, order = surface.corners, surface.per_vertex, surface.spare, surface.order
    n_half_edges = 0
    for k in range(surface.n_vertices + 1):
        count[k] = 0
    for e in range(3 * surface.n):
        if not surface.flags[e // 3] & COLLAPSED:
            count[_higher(corners, e) + 1] += 1
            n_half_edges += 1
    _sum_counts(count, surface.n_vertices)
    for e in range(3 * surface.n):
        if not surface.flags[e // 3] & COLLAPSED:
            v = _higher(corners, e)
            spare[count[v]] = e
            count[v] += 1
    for k in range(surface.n_vertices + 1):
        count[k] = 0
    for i in range(n_half_edges):
        count[_lower(corners, spare[i]) + 1] += 1
    _sum_counts(count, surface.n_vertices)
    for i in range(n_half_edges):
        v = _lower(corners, spare[i])
        order[count[v]] = spare[i]
        count[v] += 1
    return n_half_edges


@kernel
def _edge_end(corners, order, start, n_half_edges):
    """Where the half-edges of the edge that starts at ``start`` end."""
    low = _lower(corners, order[start])
    high = _higher(corners, order[start])
    end = start + 1
    while end < n_half_edges and _lower(corners, order[end]) == low and _higher(corners, order[end]) == high:
        end += 1
    return end


@kernel
def _classify_edges(surface, n_half_edges):
    """Flags of facets by the edges that they meet at, and their classes."""
    flags, order, counts = surface.flags, surface.order, surface.counts
    start = 0
    while start < n_half_edges:
        end = _edge_end(surface.corners, order, start, n_half_edges)
        counts[EDGES] += 1
        if end == start + 1:
            flags[order[start] // 3] |= OPEN
            counts[OPEN_EDGES] += 1
        else:
            net = 0
            for i in range(start, end):
                net += 1 if _runs_upward(surface.corners, order[i]) else -1
            if end > start + 2:
                _set_flag(surface, start, end, UNBALANCED if net != 0 else SEVERAL)
            elif not union_with_parity(
                surface.parent, surface.parity, order[start] // 3, order[start + 1] // 3, 1 if net != 0 else 0
            ):
                _set_flag(surface, start, end, ONE_SIDED)
            _flag_doubles(surface, start, end)
            _join_fans(surface, start, end)
        start = end


@kernel
def _set_flag(surface, start, end, bit):
    for i in range(start, end):
        surface.flags[surface.order[i] // 3] |= bit


@kernel
def _flag_doubles(surface, start, end):
    """Flag the facets at an edge with the same third corner.

    stamp : of a third corner, the last edge where the corner was met.   upward, downward : at this edge, the first
    half-edge opposite the third corner to run upward or downward, −1 without.
    """
    corners, order, stamp, edge = surface.corners, surface.order, surface.stamp, surface.counts[EDGES]
    upward, downward = surface.upward, surface.downward
    for i in range(start, end):
        e = order[i]
        third = _end(corners, _next_half_edge(e))
        if stamp[third] != edge:
            stamp[third] = edge
            upward[third] = -1
            downward[third] = -1
        first = upward if _runs_upward(corners, e) else downward
        if first[third] < 0:
            first[third] = e
        else:
            surface.flags[e // 3] |= DOUBLED
    for i in range(start, end):
        third = _end(corners, _next_half_edge(order[i]))
        if upward[third] >= 0 and downward[third] >= 0:
            surface.flags[order[i] // 3] |= BACK_TO_BACK


@kernel
def _join_fans(surface, start, end):
    """Join the corners common to facets at an edge into a fan."""
    corners, order, fan = surface.corners, surface.order, surface.fan
    first = order[start]
    at_low = first if _runs_upward(corners, first) else _next_half_edge(first)
    at_high = first + _next_half_edge(first) - at_low
    for i in range(start + 1, end):
        e = order[i]
        low = e if _runs_upward(corners, e) else _next_half_edge(e)
        union(fan, at_low, low)
        union(fan, at_high, e + _next_half_edge(e) - low)


@kernel
def _flag_turned(surface):
    """Of two senses among joined facets, the rarer one is wrong; of equally many, not the first facet's."""
    parent, parity, tally = surface.parent, surface.parity, surface.tally
    for f in range(surface.n):
        tally[f] = 0
    for f in range(surface.n):
        root, sense = find_with_parity(parent, parity, f)
        tally[root] += 1 - 2 * sense
    for f in range(surface.n):
        root, sense = find_with_parity(parent, parity, f)
        if sense == (1 if tally[root] >= 0 else 0):
            surface.flags[f] |= TURNED


@kernel
def _join_shells(surface, n_half_edges, part):
    """Where several facets meet at an edge and the facets of a part do not cancel, join the parts into a shell.

    part : room for an integer a facet. Parts are taken as they were before any was joined, whatever the order of edges.
    """
    corners, order, parent, tally = surface.corners, surface.order, surface.parent, surface.tally
    for f in range(surface.n):
        part[f] = find(parent, f)
    start = 0
    while start < n_half_edges:
        end = _edge_end(corners, order, start, n_half_edges)
        if end > start + 2:
            for i in range(start, end):
                tally[part[order[i] // 3]] = 0
            for i in range(start, end):
                e = order[i]
                tally[part[e // 3]] += 1 if _runs_upward(corners, e) else -1
            cancels = True
            for i in range(start, end):
                cancels = cancels and tally[part[order[i] // 3]] == 0
            if not cancels:
                for i in range(start + 1, end):
                    union(parent, order[start] // 3, order[i] // 3)
        start = end


@kernel
def _count_fans(surface):
    """Count vertices in use and vertices where fans touch; flag the facets at vertices where fans touch."""
    corners, flags, counts, n_fans = surface.corners, surface.flags, surface.counts, surface.per_vertex
    for v in range(surface.n_vertices):
        n_fans[v] = 0
    for c in range(3 * surface.n):
        if not flags[c // 3] & COLLAPSED and find(surface.fan, c) == c:
            n_fans[corners[c]] += 1
    for v in range(surface.n_vertices):
        counts[USED] += 1 if n_fans[v] > 0 else 0
        counts[PINCHES] += 1 if n_fans[v] > 1 else 0
    for c in range(3 * surface.n):
        if not flags[c // 3] & COLLAPSED and n_fans[corners[c]] > 1:
            flags[c // 3] |= PINCHED


@kernel
def _number_shells(surface, shells):
    """Shells in the order of their first facets; −1 for collapsed facets."""
    for f in range(surface.n):
        shells[f] = -1
        if not surface.flags[f] & COLLAPSED:
            root = find(surface.parent, f)
            if root == f:
                shells[f] = surface.counts[SHELLS]
                surface.counts[SHELLS] += 1
            else:
                shells[f] = shells[root]


@kernel
def _start(surface):
    """Every facet in a class of its own; flags of collapsed facets."""
    corners = surface.corners
    for f in range(surface.n):
        a = corners[3 * f]
        b = corners[3 * f + 1]
        c = corners[3 * f + 2]
        surface.flags[f] = COLLAPSED if (a == b or b == c or c == a) else 0
        surface.parent[f] = f
        surface.parity[f] = 0
    for c in range(3 * surface.n):
        surface.fan[c] = c
    for v in range(surface.n_vertices):
        surface.stamp[v] = 0
    for k in range(COUNTS):
        surface.counts[k] = 0


@entry("void(int64, int64, int64, int64, int64, int64, int64)")
def classify_facets(corners_at, n, n_vertices, flags_at, shells_at, counts_at, workspace_at):
    """Flags, shells and counts of a surface of n triangles over vertices 0 … n_vertices − 1.

    corners : (n, 3) int32, equal points having equal numbers.   flags : (n,) int32 out.
    shells : (n,) int32 out, numbered in the order of their first facets; −1 for collapsed facets.
    counts : (COUNTS,) int64 out.   workspace : int32 of 12 n + 4 n_vertices + 1.
    O(n + n_vertices), nearly.
    """
    of_vertices = workspace_at + 48 * n
    shells = view_i32(shells_at, n)
    surface = _Surface(
        view_i32(corners_at, 3 * n), n, n_vertices, view_i32(flags_at, n), view_i64(counts_at, COUNTS),
        view_i32(workspace_at, 3 * n), view_i32(workspace_at + 12 * n, 3 * n), view_i32(workspace_at + 24 * n, 3 * n),
        view_i32(workspace_at + 36 * n, n), view_i32(workspace_at + 40 * n, n), view_i32(workspace_at + 44 * n, n),
        view_i32(of_vertices, n_vertices + 1), view_i32(of_vertices + 4 * n_vertices + 4, n_vertices),
        view_i32(of_vertices + 8 * n_vertices + 4, n_vertices), view_i32(of_vertices + 12 * n_vertices + 4, n_vertices),
    )
    _start(surface)
    n_half_edges = _sort_half_edges(surface)
    _classify_edges(surface, n_half_edges)
    _flag_turned(surface)
    _join_shells(surface, n_half_edges, shells)
    _count_fans(surface)
    _number_shells(surface, shells)
