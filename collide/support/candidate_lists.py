"""Kernels that make a support tree: the candidates of coarse vertices.

Let W be a set of points in convex position and V a subset. Where v is the extreme point of V in a direction g and w the
extreme point of W, w has to stand in the list of v. Such a g exists exactly if the normal cone of w in the hull of W
meets the normal cone of v in the hull of V. Cones are convex and the fine cone of v lies in its coarse cone, so a path
inside the coarse cone of v, from a point shared with the cone of w to the fine cone of v, leaves the cone of w
through an arc: the directions between the normals of two facets on either side of an edge of w. A search along the arc
of every edge of the fine hull for the vertices of V extreme somewhere on the arc is therefore enough. No coarse hull is
intersected with anything.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.kernels import kernel, view_i64
from collide.numerics.vec3 import Vec3, absolute, add, cross, dot, scale, sub, vec3_at
from collide.support.rings import differ, unit
from collide.support.support_tree_query import Lists, descend_lists

#: Arcs are followed between points this fraction inside their ends. At the ends themselves, which are facet
#: normals, many coarse vertices may tie (those around the cap of a prism, say), and only the arc tells which
#: of them are extreme for directions of any extent.
_INSET = 2.0**-20
#: At most so many directions are asked about along one arc. What is left out then costs a climbing step in queries.
_LONGEST_ARC = 4096
#: Intervals of one arc that may be on the stack.
STACK = 512


@kernel
def candidate_lists(points, n, fine, n_fine, rings, lists, coarse, n_coarse, first_node, space):
    """Candidate lists of ``n_coarse`` vertices among ``n_fine`` ones; returns how many pairs were met.

    fine : rows of the fine vertices.   rings : their `Rings`, which may know more vertices: those are no candidates.
    lists : the tree so far, whose scans end at node first_node + i for coarse vertex i, row coarse[i].
    space : a `ListWorkspace`. The rows of list i end up at pairs[list_starts[i] : list_starts[i + 1]]; where more than
        space.capacity pairs are met nothing is made.
    """
    starts, ring, ring_facets, normals = rings.starts, rings.ring, rings.ring_facets, rings.normals
    stamp, known = space.stamp, space.known
    search = ArcSearch(
        points, lists, coarse, first_node, _sizes(points, fine, n_fine), space.stack, stamp, space.pairs, space.capacity
    )
    for i in range(n):
        stamp[i] = -1
        known[i] = 0
    for j in range(n_fine):
        known[fine[j]] = 1
    # A coarse vertex is a candidate of its own.
    n_pairs = 0
    for i in range(n_coarse):
        n_pairs = _note(search, n_pairs, i, search.coarse[i])
    for j in range(n_fine):
        a = fine[j]
        begin = starts[a]
        end = starts[a + 1]
        for k in range(begin, end):
            b = ring[k]
            if a < b or known[b] == 0:
                before = ring_facets[k - 1 if k > begin else end - 1]
                p, q = vec3_at(normals, 3 * before), vec3_at(normals, 3 * ring_facets[k])
                n_pairs = _follow_edge(search, n_pairs, Edge(np.int64(a), np.int64(b), known[b] != 0), p, q)
    if n_pairs <= space.capacity:
        _sort_pairs(search.pairs, n_pairs, n, n_coarse, space.list_starts, stamp, space.rows)
    return n_pairs


class ListWorkspace(NamedTuple):
    """Where `candidate_lists` works, for n points and at most ``capacity`` pairs.

    pairs : (2 capacity,), and list_starts : (n + 1,), out.   rows : (capacity,).   stamp, known : (n,).
    stack : (2 STACK,) doubles.
    """

    pairs: Any
    list_starts: Any
    rows: Any
    stamp: Any
    known: Any
    stack: Any
    capacity: int


class ArcSearch(NamedTuple):
    """What following an arc reads and writes.

    points : three doubles a row.   lists : the tree so far, whose scans end at node first_node + i for row coarse[i].
    size : largest coordinate in size along each axis.   stack : intervals to be looked at: an end and its owner.
    stamp : by row, the owner that noted it last.   pairs : owner and row of each candidate, at most capacity of them.
    """

    points: Any
    lists: Lists
    coarse: Any
    first_node: int
    size: Vec3
    stack: Any
    stamp: Any
    pairs: Any
    capacity: int


class Edge(NamedTuple):
    """An edge a → b of the fine hull.   both : whether b is a candidate, too."""

    a: int
    b: int
    both: bool


@kernel
def _sizes(points, fine, n_fine):
    """Largest coordinate in size along each axis."""
    x = 0.0
    y = 0.0
    z = 0.0
    for j in range(n_fine):
        p = absolute(vec3_at(points, 3 * fine[j]))
        x = max(x, p.x)
        y = max(y, p.y)
        z = max(z, p.z)
    return Vec3(x, y, z)


@kernel
def _note(search, n_pairs, owner, row):
    """Note a candidate; a repetition right after another is left out. Returns the new number of pairs."""
    if search.stamp[row] == owner:
        return n_pairs
    search.stamp[row] = owner
    if n_pairs < search.capacity:
        search.pairs[2 * n_pairs] = owner
        search.pairs[2 * n_pairs + 1] = row
    return n_pairs + 1


@kernel
def _follow_edge(search, n_pairs, edge, p, q):
    """Follow the arc of one edge, from the normal p of the facet on its right to the normal q of the facet on its
    left."""
    if dot(p, p) == 0.0 or dot(q, q) == 0.0:
        return n_pairs
    if dot(p, q) > 0.0:
        return _follow_arc(search, n_pairs, edge, p, q)
    # An arc of 90° and more, up to the 180° of a flat hull's border: through the outward normal.
    e = sub(vec3_at(search.points, 3 * edge.b), vec3_at(search.points, 3 * edge.a))
    middle = unit(cross(e, sub(q, p)))
    n_pairs = _follow_arc(search, n_pairs, edge, p, middle)
    return _follow_arc(search, n_pairs, edge, middle, q)


@kernel
def _follow_arc(search, n_pairs, edge, p, q):
    """Note a, and b if ``both``, as candidates of every coarse vertex extreme along p + t·(q − p), 0 < t < 1.

    Between two directions with different owners both owners are equally far in some direction: either an owner is
    farthest there, and no vertex comes between, or the farthest vertex splits the interval in two.
    """
    if not differ(q, p):
        return n_pairs
    d = sub(q, p)
    no_counters = view_i64(0, 0)
    # Point 0 of the loop asks at the end of the arc, point 1 at its start, later ones where two owners tie.
    depth = 0
    t = 1.0 - _INSET
    t_low = 0.0
    low = -1
    t_high = 0.0
    high = -1
    step = 0
    while step < _LONGEST_ARC:
        g = add(p, scale(t, d))
        extreme = descend_lists(search.lists, 0, g, no_counters)
        owner = extreme.id - search.first_node
        new = True
        if step >= 2:
            gain = dot(sub(extreme.point, vec3_at(search.points, 3 * search.coarse[low])), g)
            noise = 1e-15 * dot(search.size, absolute(g))
            new = owner != low and owner != high and gain > noise
        if new:
            n_pairs = _note(search, n_pairs, owner, edge.a)
            if edge.both:
                n_pairs = _note(search, n_pairs, owner, edge.b)
        if step == 0:
            t_high = t
            high = owner
            t = _INSET
            step = 1
            continue
        step += 1
        if step == 2:
            t_low = t
            low = owner
        elif new:
            if depth < STACK:
                search.stack[2 * depth] = t_high
                search.stack[2 * depth + 1] = float(high)
                depth += 1
            t_high = t
            high = owner
        else:
            # Nobody between low and high: on to the next interval of the stack.
            t_low = t_high
            low = high
            if depth == 0:
                return n_pairs
            depth -= 1
            t_high = search.stack[2 * depth]
            high = int(search.stack[2 * depth + 1])
        if low == high:  # the whole arc; ends of later intervals differ
            return n_pairs
        t = _crossing(search.points, search.coarse[low], search.coarse[high], p, d)
        t = min(max(t, t_low), t_high)
    return n_pairs


@kernel
def _crossing(points, a, b, p, d):
    """The t where p + t·d is as far along a as along b."""
    ab = sub(vec3_at(points, 3 * a), vec3_at(points, 3 * b))
    rate = dot(ab, d)
    ahead = dot(ab, p)
    return -ahead / rate if rate != 0.0 else 0.5


@kernel
def _sort_pairs(pairs, n_pairs, n, n_coarse, list_starts, stamp, rows):
    """Group the rows by owner, each row once; the owners' lists replace the pairs."""
    for i in range(n_coarse + 1):
        list_starts[i] = 0
    for k in range(n_pairs):
        list_starts[pairs[2 * k] + 1] += 1
    for i in range(n_coarse):
        list_starts[i + 1] += list_starts[i]
    for k in range(n_pairs):
        owner = pairs[2 * k]
        rows[list_starts[owner]] = pairs[2 * k + 1]
        list_starts[owner] += 1
    for i in range(n):
        stamp[i] = -1
    total = 0
    begin = 0
    for i in range(n_coarse):
        end = list_starts[i]
        list_starts[i] = total
        for k in range(begin, end):
            row = rows[k]
            if stamp[row] != i:
                stamp[row] = i
                pairs[total] = row
                total += 1
        begin = end
    list_starts[n_coarse] = total
