"""The exact last step of a support query: prove a vertex extreme, or climb to an extreme vertex.

A hull is convex: a vertex w is farthest in direction g exactly if no neighbour is farther; else climbing from neighbour
to neighbour gets there. Signs of (neighbour − w)·g are exact (`exact_dot_sign.py`), so the vertex returned has the
exact maximum over the hull, g being taken as the doubles it consists of.

A vertex of many neighbours is proven by few of them. Its normal cone is a convex spherical polygon with
the normals of its facets as corners; seen from any corner, the others are sorted by angle. Two corners on
either side of g, certain by an error bound, leave only the edges between them to be looked at.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.kernels import kernel, view_f64, view_i32, view_i64
from collide.numerics.exact_dot_sign import exact_sign, product_and_bound, scaled_into_range
from collide.numerics.vec3 import cross, dot, max_abs, sub, vec3_at
from collide.support.tree_layout import (
    AT_POINTS,
    AT_RANGE,
    AT_RING,
    AT_RING_STARTS,
    FLAT,
    HEADER,
    LINKS,
    POINTS,
)

#: What is counted: entries scanned, climbing steps, neighbours looked at, exact signs.
SCANNED, STEPS, LOOKED_AT, EXACT_SIGNS = range(4)
#: Rings longer than this are searched, not scanned.
_LONG_RING = 64
#: A search stops where so many corners remain between two certain ones.
_MAX_SCANNED_CORNERS = 8
#: Error of a component of a facet's normal, in units of the product of its edges' lengths: two differences of rounded
#: differences, four roundings each, and one more. The normal itself is shorter, in long thin facets by far.
_NORMAL_ROUNDING = 8.0 * 2.0**-53
#: Roundings of a triple product of two normals and a direction: three and the sums.
_TRIPLE_ROUNDING = 8.0 * 2.0**-53


class Ring(NamedTuple):
    """A vertex among its neighbours.

    points : three doubles a row.
    neighbours : of all vertices; neighbours[begin : begin + degree] belong to this vertex, in
    cyclic order, counter-clockwise from outside.
    """

    points: Any
    neighbours: Any
    vertex: int
    begin: int
    degree: int


@kernel
def settle_vertex(tree_at, vertex, g):
    """Id of a vertex farthest in direction g, exactly, near ``vertex``.

    Returns −1 − id where nothing can be proven: components of g differ by some 2¹⁸⁰⁰, or are no numbers, or
    ``vertex`` is a point inside the hull.
    O(1) steps from what `extreme_vertex` gives, each O(log degree) unless the vertex has long thin facets or
    coplanar ones, which take O(degree); O(n) in the middle of a facet across g.
    """
    return climb(tree_at, vertex, g, view_i64(0, 0))


@kernel
def climb(tree_at, vertex, g, counters):
    """`settle_vertex`, adding to ``counters`` unless that is empty."""
    header = view_i64(tree_at, HEADER)
    starts = view_i32(header[AT_RING_STARTS], header[POINTS] + 1)
    neighbours = view_i32(header[AT_RING], header[LINKS])
    points = view_f64(header[AT_POINTS], 3 * header[POINTS])
    limits = view_f64(header[AT_RANGE], 3)
    certain, g = scaled_into_range(limits[0], limits[1], limits[2], g)
    if not certain or starts[vertex + 1] == starts[vertex]:
        return -1 - vertex
    if g.x == 0.0 and g.y == 0.0 and g.z == 0.0:
        return vertex
    while True:
        begin = np.int64(starts[vertex])
        degree = np.int64(starts[vertex + 1]) - begin
        ring = Ring(points, neighbours, np.int64(vertex), begin, degree)
        first = 0
        end = degree
        if degree > _LONG_RING:
            first, end = _narrow(ring, g, counters)
        better, level = _best_of(ring, first, end, g, counters)
        if better == vertex:
            if not level or header[FLAT] != 0 or end - first < degree:
                return vertex
            better = _across_plateau(points, starts, header[POINTS], vertex, g, counters)
            if better == vertex:
                return vertex
        if len(counters) > 0:
            counters[STEPS] += 1
        vertex = better


@kernel
def _best_of(ring, first, end, g, counters):
    """(best, level): the neighbour that looks best of all farther than the vertex, else the vertex; and whether all are
    exactly as far.
    """
    w = vec3_at(ring.points, 3 * ring.vertex)
    best = ring.vertex
    best_value = 0.0
    level = True
    for i in range(first, end):
        neighbour = ring.neighbours[ring.begin + (i if i < ring.degree else i - ring.degree)]
        p = vec3_at(ring.points, 3 * neighbour)
        value, bound = product_and_bound(p, w, g)
        sign = 1 if value > bound else -1
        if not (value < -bound or value > bound):
            sign = exact_sign(p, w, g)
            if len(counters) > 0:
                counters[EXACT_SIGNS] += 1
        if sign != 0:
            level = False
        if sign > 0 and (best == ring.vertex or value > best_value):
            best = neighbour
            best_value = value
    if len(counters) > 0:
        counters[LOOKED_AT] += end - first
    return best, level


@kernel
def _across_plateau(points, starts, n, vertex, g, counters):
    """A vertex farther than ``vertex``, which is amid level facets; ``vertex`` itself where all others are no farther.

    The first vertex off the facets' plane decides.
    """
    w = vec3_at(points, 3 * vertex)
    for k in range(n):
        if starts[k + 1] > starts[k]:
            sign = exact_sign(vec3_at(points, 3 * k), w, g)
            if len(counters) > 0:
                counters[EXACT_SIGNS] += 1
            if sign != 0:
                return k if sign > 0 else vertex
    return vertex


@kernel
def _narrow(ring, g, counters):
    """(first, end): if no neighbour of these ring places is farther, none of the whole ring is.

    Corner i of the normal cone is the normal of the facet between neighbours i and i + 1, corner 0 and corner
    ``degree`` are the same. With corners low < high certainly on either side of g, as seen from corner 0,
    g lies in the cone of corners 0, low, …, high exactly if neighbours low + 1, …, high are not farther.
    """
    low = 0
    above = ring.degree  # corners from here on were not certainly before g
    high = ring.degree
    below = 0
    while above - low > _MAX_SCANNED_CORNERS:
        middle = (low + above) // 2
        side = _side(ring, middle, g)
        if len(counters) > 0:
            counters[LOOKED_AT] += 2
        if side > 0:
            low = middle
            below = max(below, low)
        else:
            above = middle
            if side < 0:
                high = min(high, middle)
    while high - below > _MAX_SCANNED_CORNERS:
        middle = (below + high) // 2
        side = _side(ring, middle, g)
        if len(counters) > 0:
            counters[LOOKED_AT] += 2
        if side < 0:
            high = middle
        else:
            below = middle
    return low + 1, high + 1


@kernel
def _side(ring, i, g):
    """Which side of the plane of corners 0 and i the direction certainly lies on: 1 if i comes before the direction, −1
    if after, 0 if open."""
    a, size_a = _corner(ring, 0)
    b, size_b = _corner(ring, i)
    value = dot(cross(a, b), g)
    # Six terms a_i·b_j·g_k. Errors of a and of b are in proportion to their sizes, not to a and b themselves.
    error_a, error_b = _NORMAL_ROUNDING * size_a, _NORMAL_ROUNDING * size_b
    max_a, max_b = max_abs(a) + error_a, max_abs(b) + error_b
    rounding = _TRIPLE_ROUNDING * max_a * max_b
    term = error_a * max_b + max_a * error_b + rounding
    bound = 2.0 * term * (abs(g.x) + abs(g.y) + abs(g.z))
    if not (size_a > 2.0**-400 and size_b > 2.0**-400 and bound > 2.0**-900):
        return 0  # products may have fallen below the smallest normal double
    if value > bound:
        return 1
    return -1 if value < -bound else 0


@kernel
def _corner(ring, i):
    """(normal, size): normal of the facet between neighbours i and i + 1, and a bound of its terms."""
    w = vec3_at(ring.points, 3 * ring.vertex)
    p = sub(vec3_at(ring.points, 3 * ring.neighbours[ring.begin + i]), w)
    q = sub(vec3_at(ring.points, 3 * ring.neighbours[ring.begin + (i + 1 if i + 1 < ring.degree else 0)]), w)
    size = (abs(p.x) + abs(p.y) + abs(p.z)) * (abs(q.x) + abs(q.y) + abs(q.z))
    return cross(p, q), size
