"""Places of the new vertices of a cut, and the proof of the properties required of these places.

Vertex w is cut by a plane perpendicular to an axis, half-way to its nearest neighbour. New vertex j belongs on the edge
from w to its neighbour r_j, a little deeper than the plane (`vertex_cutting` says why), and is moved towards a point s
below all facets at w. Doubles propose; exact tests prove that the new vertex is in a tetrahedron of w, r_j, the next
neighbour and s.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, add, cross, divide, dot, put_vec3, scale, sub, vec3_at
from collide.papers.hierarchies.symbolic_perturbation import exact_side
from collide.papers.hierarchies.true_facets import SMALL

#: How far new vertices are moved towards s, as a part of the way along the edge: 2⁻³⁶, 2⁻²⁸, ..., then 2⁻⁵⁰, 2⁻⁴⁷, ...
#: Where neighbours of w are as near each other as the square root of a move, a move bends the strip between inwards.
_LARGE_INSETS = 5
INSETS = _LARGE_INSETS + 5
#: Where the plane stands, as a part of the way to the nearest neighbour, seen along the axis.
_DEPTH = 0.5
#: How much deeper than the top of the dome its lowest vertices are.
_DOME = 0.25


class Cut(NamedTuple):
    """A vertex to be cut off.

    w : the vertex.   k : its degree.
    ring, outer : k each, its neighbours and the half-edges beyond them (`read_ring`).
    fresh : k rows for new vertices, in a run.   inside : the row of s.
    axis : a direction in which all neighbours are ahead of w.
    nearest : distance of the nearest neighbour along the axis; −1 for no axis.
    """

    w: int
    k: int
    ring: Any
    outer: Any
    fresh: Any
    inside: int
    axis: Vec3
    nearest: float


@kernel
def inset_of(attempt):
    if attempt < _LARGE_INSETS:
        return math.ldexp(_DEPTH, -36 + 8 * attempt)
    return math.ldexp(_DEPTH, -50 + 3 * (attempt - _LARGE_INSETS))


@kernel
def prove_new(cloud, cut, j, least):
    """Write new vertex j at the first provable distance from its edge; ``False`` where all proofs fail."""
    for attempt in range(INSETS):
        if put_new(cloud, cut, j, inset_of(attempt) * least):
            return True
    return False


@kernel
def difference(points, a, b):
    """From point a to point b."""
    return sub(vec3_at(points, 3 * b), vec3_at(points, 3 * a))


@kernel
def unit_normal(points, a, b, c):
    """Normal of a triangle, of length 1; zeros where it underflows."""
    normal = cross(difference(points, a, b), difference(points, a, c))
    size = math.sqrt(dot(normal, normal))
    return divide(normal, size) if size != 0.0 else Vec3(0.0, 0.0, 0.0)


@kernel
def axis_of(points, w, ring, k):
    """(axis, nearest) of a `Cut`."""
    axis = Vec3(0.0, 0.0, 0.0)
    for j in range(k):
        axis = sub(axis, unit_normal(points, w, ring[j], ring[j + 1 if j + 1 < k else 0]))
    for _ in range(2):
        nearest = math.inf
        for j in range(k):
            nearest = min(nearest, dot(axis, difference(points, w, ring[j])))
        if nearest > 0.0:
            return axis, nearest
        axis = Vec3(0.0, 0.0, 0.0)
        for j in range(k):
            d = difference(points, w, ring[j])
            size = math.sqrt(dot(d, d))
            if size > 0.0:
                axis = add(axis, divide(d, size))
    return axis, -1.0


@kernel
def write_point(cloud, i, p):
    """Row i becomes a point of scaled coordinates."""
    exponent = cloud.exponent
    half = -exponent // 2
    factor0 = math.ldexp(1.0, half)
    factor1 = math.ldexp(1.0, -exponent - half)
    at = 3 * i
    put_vec3(cloud.originals, at, Vec3(math.ldexp(p.x, exponent), math.ldexp(p.y, exponent), math.ldexp(p.z, exponent)))
    for k in range(at, at + 3):
        cloud.scaled[k] = cloud.originals[k] * factor0 * factor1
    # The new point lies on no lattice, and may have small coordinates.
    cloud.work[1] = 0.0
    cloud.work[0] = max(math.ldexp(1.0, exponent + SMALL), 5e-324)


@kernel
def within(cloud, w, r, beside, s, x):
    """Whether x is in the tetrahedron of w, r, beside, s: strictly inside, or inside its face w, r, s; exact."""
    sign = exact_side(cloud, w, r, beside, s)
    return (
        sign != 0
        and exact_side(cloud, w, r, beside, x) == sign
        and exact_side(cloud, x, r, beside, s) == sign
        and exact_side(cloud, w, x, beside, s) == sign
        and exact_side(cloud, w, r, x, s) != -sign
    )


@kernel
def find_inner(cloud, w, ring, k, inside):
    """Write s: the middle of w and three of its neighbours, in row ``inside``; False where none is strictly inside."""
    points = cloud.scaled
    for shift in range(4):
        a = ring[shift % k]
        b = ring[(shift + k // 3) % k]
        c = ring[(shift + 2 * k // 3) % k]
        quarter = add(scale(0.25, vec3_at(points, 3 * w)), scale(0.25, vec3_at(points, 3 * a)))
        s = add(add(quarter, scale(0.25, vec3_at(points, 3 * b))), scale(0.25, vec3_at(points, 3 * c)))
        write_point(cloud, inside, s)
        if within(cloud, w, a, b, c, inside):
            return True
    return False


@kernel
def shortest_part(cloud, cut):
    """The smallest part of an edge of w before the plane."""
    farthest = 0.0
    for j in range(cut.k):
        farthest = max(farthest, dot(cut.axis, difference(cloud.scaled, cut.w, cut.ring[j])))
    return _DEPTH * cut.nearest / farthest


@kernel
def place(cloud, cut, inset):
    """Write all new vertices; False where one is not proven."""
    move = inset * shortest_part(cloud, cut)
    for j in range(cut.k):
        if not put_new(cloud, cut, j, move):
            return False
    return True


@kernel
def put_new(cloud, cut, j, move):
    """Write new vertex j, on the edge from w to its neighbour and moved by this part of the way to s.

    Returns whether the new vertex is in a tetrahedron of w, ring[j], a neighbour of ring[j], and s, and not on the
    surface; exact.
    """
    points, ring, w, v = cloud.scaled, cut.ring, cut.w, cut.fresh[j]
    to_inner = difference(points, w, cut.inside)
    d = difference(points, w, ring[j])
    part = _DEPTH * cut.nearest / dot(cut.axis, d) * (1.0 + _DOME * math.ldexp(1.0, -twos(j)))
    write_point(cloud, v, add(vec3_at(points, 3 * w), add(scale(part, d), scale(move, to_inner))))
    after = ring[j + 1 if j + 1 < cut.k else 0]
    before = ring[j - 1 if j > 0 else cut.k - 1]
    return within(cloud, w, ring[j], after, cut.inside, v) or within(cloud, w, ring[j], before, cut.inside, v)


@kernel
def twos(j):
    """How often 2 divides j; 40 for 0."""
    if j == 0:
        return 40
    power = 0
    while j % 2 == 0:
        j //= 2
        power += 1
    return power
