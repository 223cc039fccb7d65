"""The exact last step of a support query: prove that a vertex is extreme, or climb to one that is.

A hull is convex: a vertex w is farthest in direction g exactly if no neighbour is farther, and if one
is, climbing gets there. Signs of (neighbour − w)·g are exact (`exact_dot_sign.py`), so what is returned is
the exact maximum over the hull, g being taken as the doubles it consists of.

A vertex of many neighbours is proven by few of them. Its normal cone is a convex spherical polygon with
the normals of its facets as corners; seen from one corner, the others are sorted by angle. Two corners on
either side of g, certain by an error bound, leave only the edges between them to be looked at.
"""

from __future__ import annotations

from collide.kernels import kernel, view_f64, view_i32, view_i64
from collide.numerics.exact_dot_sign import exact_sign, product_and_bound, scaled_into_range
from collide.numerics.vec3 import Vec3
from collide.support.support_tree import (
    AT_POINTS,
    AT_RANGE,
    AT_RING,
    AT_RING_STARTS,
    FLAT,
    HEADER,
    LINKS,
    POINTS,
)  # fmt: skip

#: What is counted: entries scanned, climbing steps, neighbours looked at, exact signs.
SCANNED, STEPS, LOOKED_AT, EXACT_SIGNS = range(4)
#: Rings longer than this are searched, not scanned.
_LONG_RING = 64
#: Corners left between two certain ones where a search stops.
_FEW = 8
#: Relative error of a triple product of two facet normals and a direction, with room to spare: each term is
#: a product of five differences or components, with at most a dozen roundings along the way.
_TRIPLE_ROUNDING = 64.0 * 2.0**-53


@kernel
def settle_vertex(tree_at, vertex, gx, gy, gz):
    """Id of a vertex farthest in direction g, exactly, near ``vertex``.

    Returns −1 − id where nothing can be proven: components of g differ by some 2¹⁸⁰⁰, or are no numbers, or
    ``vertex`` is a point inside the hull.
    O(1) steps from what `extreme_vertex` gives, each O(log degree) unless the vertex has long thin facets or
    coplanar ones, which take O(degree); O(n) in the middle of a facet across g.
    """
    return climb(tree_at, vertex, gx, gy, gz, view_i64(0, 0))


@kernel
def climb(tree_at, vertex, gx, gy, gz, counters):
    """`settle_vertex`, adding to ``counters`` unless that is empty."""
    header = view_i64(tree_at, HEADER)
    starts = view_i32(header[AT_RING_STARTS], header[POINTS] + 1)
    ring = view_i32(header[AT_RING], header[LINKS])
    coordinates = view_f64(header[AT_POINTS], 3 * header[POINTS])
    limits = view_f64(header[AT_RANGE], 3)
    certain, g = scaled_into_range(limits[0], limits[1], limits[2], Vec3(gx, gy, gz))
    gx, gy, gz = g
    if not certain or starts[vertex + 1] == starts[vertex]:
        return -1 - vertex
    if gx == 0.0 and gy == 0.0 and gz == 0.0:
        return vertex
    while True:
        begin = starts[vertex]
        degree = starts[vertex + 1] - begin
        first = 0
        end = degree
        if degree > _LONG_RING:
            first, end = _narrow(coordinates, ring, begin, degree, vertex, gx, gy, gz, counters)
        better, level = _best_of(coordinates, ring, begin, degree, first, end, vertex, gx, gy, gz, counters)
        if better == vertex:
            if not level or header[FLAT] != 0 or end - first < degree:
                return vertex
            better = _across_plateau(coordinates, starts, header[POINTS], vertex, gx, gy, gz, counters)
            if better == vertex:
                return vertex
        if len(counters) > 0:
            counters[STEPS] += 1
        vertex = better


@kernel
def _best_of(coordinates, ring, begin, degree, first, end, vertex, gx, gy, gz, counters):
    """(best, level): the neighbour that looks best among those farther than the vertex, itself if none is; and
    whether all are exactly as far.
    """
    wx = coordinates[3 * vertex]
    wy = coordinates[3 * vertex + 1]
    wz = coordinates[3 * vertex + 2]
    best = vertex
    best_value = 0.0
    level = True
    for i in range(first, end):
        neighbour = ring[begin + (i if i < degree else i - degree)]
        x = coordinates[3 * neighbour]
        y = coordinates[3 * neighbour + 1]
        z = coordinates[3 * neighbour + 2]
        value, bound = product_and_bound(Vec3(x, y, z), Vec3(wx, wy, wz), Vec3(gx, gy, gz))
        sign = 1 if value > bound else -1
        if not (value < -bound or value > bound):
            sign = exact_sign(Vec3(x, y, z), Vec3(wx, wy, wz), Vec3(gx, gy, gz))
            if len(counters) > 0:
                counters[EXACT_SIGNS] += 1
        if sign != 0:
            level = False
        if sign > 0 and (best == vertex or value > best_value):
            best = neighbour
            best_value = value
    if len(counters) > 0:
        counters[LOOKED_AT] += end - first
    return best, level


@kernel
def _across_plateau(coordinates, starts, n, vertex, gx, gy, gz, counters):
    """A vertex beyond the facets around this one, which all are level: farther, or the vertex itself if none is.

    Only a vertex in the middle of a facet comes here. The first vertex off the facet's plane decides.
    """
    wx = coordinates[3 * vertex]
    wy = coordinates[3 * vertex + 1]
    wz = coordinates[3 * vertex + 2]
    for other in range(n):
        if starts[other + 1] > starts[other]:
            x = coordinates[3 * other]
            y = coordinates[3 * other + 1]
            z = coordinates[3 * other + 2]
            sign = exact_sign(Vec3(x, y, z), Vec3(wx, wy, wz), Vec3(gx, gy, gz))
            if len(counters) > 0:
                counters[EXACT_SIGNS] += 1
            if sign != 0:
                return other if sign > 0 else vertex
    return vertex


@kernel
def _narrow(coordinates, ring, begin, degree, vertex, gx, gy, gz, counters):
    """(first, end): if no neighbour of these ring places is farther, none of the whole ring is.

    Corner i of the normal cone is the normal of the facet between neighbours i and i + 1, corner 0 and corner
    ``degree`` are the same. With corners low < high certainly on either side of g, as seen from corner 0,
    g lies in the cone of corners 0, low, …, high exactly if neighbours low + 1, …, high are not farther.
    """
    low = 0
    above = degree  # corners from here on were not certainly before g
    high = degree
    below = 0
    while above - low > _FEW:
        middle = (low + above) // 2
        side = _side(coordinates, ring, begin, degree, vertex, middle, gx, gy, gz)
        if len(counters) > 0:
            counters[LOOKED_AT] += 2
        if side > 0:
            low = middle
            below = max(below, low)
        else:
            above = middle
            if side < 0:
                high = min(high, middle)
    while high - below > _FEW:
        middle = (below + high) // 2
        side = _side(coordinates, ring, begin, degree, vertex, middle, gx, gy, gz)
        if len(counters) > 0:
            counters[LOOKED_AT] += 2
        if side < 0:
            high = middle
        else:
            below = middle
    return low + 1, high + 1


@kernel
def _side(coordinates, ring, begin, degree, vertex, i, gx, gy, gz):
    """Which side of the plane of corners 0 and i the direction certainly lies on: 1 if i comes before it, −1, 0."""
    ax, ay, az, a = _corner(coordinates, ring, begin, degree, vertex, 0)
    bx, by, bz, b = _corner(coordinates, ring, begin, degree, vertex, i)
    value = (ay * bz - az * by) * gx + (az * bx - ax * bz) * gy + (ax * by - ay * bx) * gz
    # Every term is at most a·b·|g|, and there are six.
    bound = _TRIPLE_ROUNDING * (2.0 * a * b * (abs(gx) + abs(gy) + abs(gz)))
    if not (a > 2.0**-400 and b > 2.0**-400 and bound > 2.0**-900):
        return 0  # products may have fallen below the smallest normal double
    if value > bound:
        return 1
    return -1 if value < -bound else 0


@kernel
def _corner(coordinates, ring, begin, degree, vertex, i):
    """(nx, ny, nz, size): normal of the facet between neighbours i and i + 1, and a bound of its terms."""
    p = 3 * ring[begin + i]
    q = 3 * ring[begin + (i + 1 if i + 1 < degree else 0)]
    w = 3 * vertex
    px = coordinates[p] - coordinates[w]
    py = coordinates[p + 1] - coordinates[w + 1]
    pz = coordinates[p + 2] - coordinates[w + 2]
    qx = coordinates[q] - coordinates[w]
    qy = coordinates[q + 1] - coordinates[w + 1]
    qz = coordinates[q + 2] - coordinates[w + 2]
    size = (abs(px) + abs(py) + abs(pz)) * (abs(qx) + abs(qy) + abs(qz))
    return py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx, size
