"""Which facets meet along which edges, and what follows: borders, orientation, fans, shells.

A surface is read as a chain of oriented triangles. It bounds something exactly where every edge is run
along as often one way as the other; then the number of times it winds around a point is defined, and
constant off the surface. More than two facets at an edge, or two fans at a vertex, do not hinder that.

Facets with two corners in the same place ("collapsed") add nothing to the chain and are left out.
"""

from __future__ import annotations

from collide.kernels import entry, kernel, view_i32, view_i64
from collide.mesh.union_find import join, join_turned, speaker, speaker_and_turn

# What is said of a facet, as bits.
COLLAPSED = 1      # two of its corners are the same point
OPEN = 2           # an edge of it has no other facet
UNBALANCED = 4     # three or more facets meet at an edge of it, and their directions do not cancel
SEVERAL = 8        # the same, and they do cancel
TURNED = 16        # it is turned over against the greater part of its neighbours
ONE_SIDED = 32     # facets around it close to a band with a single side
DOUBLED = 64       # an earlier facet has the same corners in the same sense
BACK_TO_BACK = 128  # another facet has the same corners in the opposite sense
PINCHED = 256      # at a corner of it two fans of facets touch

# Rows of what is counted.
EDGES, OPEN_EDGES, SHELLS, USED, PINCHES, COUNTS = range(6)


@kernel
def _towards(corners, e):
    """The corner at which half-edge e ends; half-edge e starts at corner e."""
    return corners[e - 2] if e % 3 == 2 else corners[e + 1]


@kernel
def _sort_half_edges(corners, facets, n, flags, count, spare, order):
    """Half-edges of all facets that are not collapsed, by lower and then by higher end; returns how many.

    Two counting sorts, so that a vertex of very many facets costs no more than others.
    """
    many = 0
    for k in range(n + 1):
        count[k] = 0
    for e in range(3 * facets):
        if not flags[e // 3] & COLLAPSED:
            count[max(corners[e], _towards(corners, e)) + 1] += 1
            many += 1
    for k in range(n):
        count[k + 1] += count[k]
    for e in range(3 * facets):
        if not flags[e // 3] & COLLAPSED:
            high = max(corners[e], _towards(corners, e))
            spare[count[high]] = e
            count[high] += 1
    for k in range(n + 1):
        count[k] = 0
    for i in range(many):
        e = spare[i]
        count[min(corners[e], _towards(corners, e)) + 1] += 1
    for k in range(n):
        count[k + 1] += count[k]
    for i in range(many):
        e = spare[i]
        low = min(corners[e], _towards(corners, e))
        order[count[low]] = e
        count[low] += 1
    return many


@kernel
def _edge_end(corners, order, start, many):
    """Where the half-edges of the edge that starts at ``start`` end."""
    e = order[start]
    low = min(corners[e], _towards(corners, e))
    high = max(corners[e], _towards(corners, e))
    end = start + 1
    while end < many:
        e = order[end]
        if min(corners[e], _towards(corners, e)) != low or max(corners[e], _towards(corners, e)) != high:
            return end
        end += 1
    return end


@kernel
def _net(corners, order, start, end):
    """How often an edge is run upwards more than downwards."""
    net = 0
    for i in range(start, end):
        e = order[i]
        net += 1 if corners[e] < _towards(corners, e) else -1
    return net


@kernel
def _mark(flags, order, start, end, bit):
    for i in range(start, end):
        flags[order[i] // 3] |= bit


@kernel
def _mark_doubles(corners, flags, order, start, end, edge, stamp, upward, downward):
    """Facets at one edge with the same third corner.

    stamp : (n,), the edge at which a third corner was seen last.   upward, downward : (n,), the first
    half-edge there that runs that way, −1 for none.
    """
    for i in range(start, end):
        e = order[i]
        f = e // 3
        third = _towards(corners, _after(e))
        if stamp[third] != edge:
            stamp[third] = edge
            upward[third] = -1
            downward[third] = -1
        if corners[e] < _towards(corners, e):
            if upward[third] < 0:
                upward[third] = e
            else:
                flags[f] |= DOUBLED
        elif downward[third] < 0:
            downward[third] = e
        else:
            flags[f] |= DOUBLED
    for i in range(start, end):
        third = _towards(corners, _after(order[i]))
        if upward[third] >= 0 and downward[third] >= 0:
            flags[order[i] // 3] |= BACK_TO_BACK


@kernel
def _join_fans(corners, order, start, end, fan):
    """The corners that facets at an edge have in common belong to one fan."""
    first = order[start]
    at_low = first if corners[first] < _towards(corners, first) else _after(first)
    at_high = first + _after(first) - at_low
    for i in range(start + 1, end):
        e = order[i]
        low = e if corners[e] < _towards(corners, e) else _after(e)
        join(fan, at_low, low)
        join(fan, at_high, e + _after(e) - low)


@kernel
def _after(e):
    return e - 2 if e % 3 == 2 else e + 1


@kernel
def _look_at_edges(corners, flags, order, many, parent, turned, fan, stamp, upward, downward, counts):
    start = 0
    while start < many:
        end = _edge_end(corners, order, start, many)
        counts[EDGES] += 1
        if end == start + 1:
            flags[order[start] // 3] |= OPEN
            counts[OPEN_EDGES] += 1
        else:
            net = _net(corners, order, start, end)
            if end == start + 2:
                f = order[start] // 3
                g = order[start + 1] // 3
                if not join_turned(parent, turned, f, g, 1 if net != 0 else 0):
                    _mark(flags, order, start, end, ONE_SIDED)
            else:
                _mark(flags, order, start, end, UNBALANCED if net != 0 else SEVERAL)
            _mark_doubles(corners, flags, order, start, end, counts[EDGES], stamp, upward, downward)
            _join_fans(corners, order, start, end, fan)
        start = end


@kernel
def _mark_turned(flags, facets, parent, turned, tally):
    """Of two senses among joined facets, the rarer one is wrong; of equally many, not the first facet's."""
    for f in range(facets):
        tally[f] = 0
    for f in range(facets):
        root, turn = speaker_and_turn(parent, turned, f)
        tally[root] += 1 - 2 * turn
    for f in range(facets):
        root, turn = speaker_and_turn(parent, turned, f)
        if turn == (1 if tally[root] >= 0 else 0):
            flags[f] |= TURNED


@kernel
def _join_shells(corners, facets, order, many, parent, part, tally):
    """Where several facets meet at an edge and those of one part do not cancel, the parts there are one shell.

    part : (facets,) room. Parts are taken as they were before any was joined, whatever the order of edges.
    """
    for f in range(facets):
        part[f] = speaker(parent, f)
    start = 0
    while start < many:
        end = _edge_end(corners, order, start, many)
        if end > start + 2:
            for i in range(start, end):
                tally[part[order[i] // 3]] = 0
            for i in range(start, end):
                e = order[i]
                tally[part[e // 3]] += 1 if corners[e] < _towards(corners, e) else -1
            whole = True
            for i in range(start, end):
                whole = whole and tally[part[order[i] // 3]] == 0
            if not whole:
                for i in range(start + 1, end):
                    join(parent, order[start] // 3, order[i] // 3)
        start = end


@kernel
def _count_fans(corners, flags, facets, n, fan, seen, counts):
    for v in range(n):
        seen[v] = 0
    for c in range(3 * facets):
        if not flags[c // 3] & COLLAPSED and speaker(fan, c) == c:
            seen[corners[c]] += 1
    for v in range(n):
        counts[USED] += 1 if seen[v] > 0 else 0
        counts[PINCHES] += 1 if seen[v] > 1 else 0
    for c in range(3 * facets):
        if not flags[c // 3] & COLLAPSED and seen[corners[c]] > 1:
            flags[c // 3] |= PINCHED


@entry("void(int64, int64, int64, int64, int64, int64, int64)")
def look_at_facets(corners_at, facets, n, flags_at, shells_at, counts_at, room_at):
    """Flags, shells and counts of a surface of ``facets`` triangles over vertices 0 … n − 1.

    corners : (facets, 3) int32, equal points having equal numbers.   flags : (facets,) int32 out.
    shells : (facets,) int32 out, numbered in the order of their first facets; −1 for collapsed facets.
    counts : (COUNTS,) int64 out.   room : int32 of 12·facets + 4·n + 1.
    O(facets + n), nearly.
    """
    corners = view_i32(corners_at, 3 * facets)
    flags = view_i32(flags_at, facets)
    shells = view_i32(shells_at, facets)
    counts = view_i64(counts_at, COUNTS)
    order = view_i32(room_at, 3 * facets)
    spare = view_i32(room_at + 12 * facets, 3 * facets)
    fan = view_i32(room_at + 24 * facets, 3 * facets)
    parent = view_i32(room_at + 36 * facets, facets)
    turned = view_i32(room_at + 40 * facets, facets)
    tally = view_i32(room_at + 44 * facets, facets)
    count = view_i32(room_at + 48 * facets, n + 1)
    stamp = view_i32(room_at + 48 * facets + 4 * n + 4, n)
    upward = view_i32(room_at + 48 * facets + 8 * n + 4, n)
    downward = view_i32(room_at + 48 * facets + 12 * n + 4, n)

    for f in range(facets):
        a = corners[3 * f]
        b = corners[3 * f + 1]
        c = corners[3 * f + 2]
        flags[f] = COLLAPSED if (a == b or b == c or c == a) else 0
        parent[f] = f
        turned[f] = 0
    for c in range(3 * facets):
        fan[c] = c
    for v in range(n):
        stamp[v] = 0
    for k in range(COUNTS):
        counts[k] = 0

    many = _sort_half_edges(corners, facets, n, flags, count, spare, order)
    _look_at_edges(corners, flags, order, many, parent, turned, fan, stamp, upward, downward, counts)
    _mark_turned(flags, facets, parent, turned, tally)
    _join_shells(corners, facets, order, many, parent, shells, tally)
    _count_fans(corners, flags, facets, n, fan, count, counts)
    for f in range(facets):
        shells[f] = -1
        if not flags[f] & COLLAPSED:
            root = speaker(parent, f)
            if root == f:
                shells[f] = counts[SHELLS]
                counts[SHELLS] += 1
            else:
                shells[f] = shells[root]
