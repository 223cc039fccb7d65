"""Where the new vertices of a cut are put, and the proof that they are where they must be.

Vertex w is cut by a plane square to an axis, half-way to its nearest neighbour. New vertex j belongs on the edge from w to
its neighbour r_j, a little deeper than the plane (`cutting` says why), and is moved towards a point s below all
facets at w. Doubles choose; exact tests prove that it is in a tetrahedron of w, r_j, the next neighbour and s.
"""

from __future__ import annotations

import math

from collide.hierarchies.symbolic_perturbation import exact_side
from collide.hierarchies.true_facets import SMALL
from collide.kernels import kernel

#: How far new vertices are moved towards s, as a part of the way along the edge: 2⁻³⁶, 2⁻²⁸, ...
INSETS = 5
#: Where the plane stands, as a part of the way to the nearest neighbour, seen along the axis.
_DEPTH = 0.5
#: How much deeper than the top of the dome its lowest vertices are.
_DOME = 0.25


@kernel
def inset_of(attempt):
    return math.ldexp(_DEPTH, -36 + 8 * attempt)


@kernel
def prove_new(cloud, exponent, w, ring, k, j, v, inner, axis, least):
    """Write new vertex v as near to its edge as it can be proven; False where it cannot."""
    for attempt in range(INSETS):
        if put_new(cloud, exponent, w, ring, k, j, v, inner, axis, inset_of(attempt) * least):
            return True
    return False


@kernel
def difference(points, a, b):
    return (
        points[3 * b] - points[3 * a], points[3 * b + 1] - points[3 * a + 1], points[3 * b + 2] - points[3 * a + 2]
    )  # fmt: skip


@kernel
def unit_normal(points, a, b, c):
    """Normal of a triangle, of length 1; zeros where it underflows."""
    ux, uy, uz = difference(points, a, b)
    vx, vy, vz = difference(points, a, c)
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    size = math.sqrt(x * x + y * y + z * z)
    if size == 0.0:
        return 0.0, 0.0, 0.0
    return x / size, y / size, z / size


@kernel
def axis_of(cloud, w, ring, k):
    """(x, y, z, nearest): a direction in which all neighbours of w are ahead, and how far the nearest is; else −1."""
    points = cloud[0]
    x = y = z = 0.0
    for j in range(k):
        nx, ny, nz = unit_normal(points, w, ring[j], ring[j + 1 if j + 1 < k else 0])
        x -= nx
        y -= ny
        z -= nz
    for _ in range(2):
        nearest = math.inf
        for j in range(k):
            dx, dy, dz = difference(points, w, ring[j])
            nearest = min(nearest, x * dx + y * dy + z * dz)
        if nearest > 0.0:
            return x, y, z, nearest
        x = y = z = 0.0
        for j in range(k):
            dx, dy, dz = difference(points, w, ring[j])
            size = math.sqrt(dx * dx + dy * dy + dz * dz)
            if size > 0.0:
                x += dx / size
                y += dy / size
                z += dz / size
    return 0.0, 0.0, 0.0, -1.0


@kernel
def write_point(cloud, exponent, i, x, y, z):
    """Row i: a point given in scaled coordinates."""
    points, originals, work, _ = cloud
    half = -exponent // 2
    factor0 = math.ldexp(1.0, half)
    factor1 = math.ldexp(1.0, -exponent - half)
    at = 3 * i
    originals[at] = math.ldexp(x, exponent)
    originals[at + 1] = math.ldexp(y, exponent)
    originals[at + 2] = math.ldexp(z, exponent)
    for k in range(at, at + 3):
        points[k] = originals[k] * factor0 * factor1
    # The new point lies on no lattice, and may have small coordinates.
    work[1] = 0.0
    work[0] = max(math.ldexp(1.0, exponent + SMALL), 5e-324)


@kernel
def within(cloud, w, r, other, s, x):
    """Whether x is in the tetrahedron of w, r, other, s: strictly inside, or inside its face w, r, s; exact."""
    sign = exact_side(cloud, w, r, other, s)
    return (
        sign != 0
        and exact_side(cloud, w, r, other, x) == sign
        and exact_side(cloud, x, r, other, s) == sign
        and exact_side(cloud, w, x, other, s) == sign
        and exact_side(cloud, w, r, x, s) != -sign
    )


@kernel
def find_inner(cloud, exponent, w, ring, k, inner):
    """Write s: the middle of w and three of its neighbours, in row ``inner``; False where none is strictly inside."""
    points = cloud[0]
    for turn in range(4):
        a = ring[turn % k]
        b = ring[(turn + k // 3) % k]
        c = ring[(turn + 2 * k // 3) % k]
        at = 3 * w
        x = 0.25 * points[at] + 0.25 * points[3 * a] + 0.25 * points[3 * b] + 0.25 * points[3 * c]
        y = 0.25 * points[at + 1] + 0.25 * points[3 * a + 1] + 0.25 * points[3 * b + 1] + 0.25 * points[3 * c + 1]
        z = 0.25 * points[at + 2] + 0.25 * points[3 * a + 2] + 0.25 * points[3 * b + 2] + 0.25 * points[3 * c + 2]
        write_point(cloud, exponent, inner, x, y, z)
        if within(cloud, w, a, b, c, inner):
            return True
    return False


@kernel
def along(axis, dx, dy, dz):
    return axis[0] * dx + axis[1] * dy + axis[2] * dz


@kernel
def shortest_part(cloud, w, ring, k, axis):
    """The smallest part of an edge of w before the plane."""
    farthest = 0.0
    for j in range(k):
        dx, dy, dz = difference(cloud[0], w, ring[j])
        farthest = max(farthest, along(axis, dx, dy, dz))
    return _DEPTH * axis[3] / farthest


@kernel
def place(cloud, exponent, w, ring, k, fresh, inner, axis, inset):
    """Write all new vertices; False where one is not proven."""
    move = inset * shortest_part(cloud, w, ring, k, axis)
    for j in range(k):
        if not put_new(cloud, exponent, w, ring, k, j, fresh[j], inner, axis, move):
            return False
    return True


@kernel
def put_new(cloud, exponent, w, ring, k, j, v, inner, axis, move):
    """Write new vertex v, on the edge from w to ring[j] and moved by this part of the way to s.

    Returns whether it is in a tetrahedron of w, ring[j], a neighbour of that, and s, and not on the surface; exact.
    """
    points = cloud[0]
    sx, sy, sz = difference(points, w, inner)
    dx, dy, dz = difference(points, w, ring[j])
    part = _DEPTH * axis[3] / along(axis, dx, dy, dz) * (1.0 + _DOME * math.ldexp(1.0, -twos(j)))
    x = points[3 * w] + (part * dx + move * sx)
    y = points[3 * w + 1] + (part * dy + move * sy)
    z = points[3 * w + 2] + (part * dz + move * sz)
    write_point(cloud, exponent, v, x, y, z)
    after = ring[j + 1 if j + 1 < k else 0]
    before = ring[j - 1 if j > 0 else k - 1]
    return within(cloud, w, ring[j], after, inner, v) or within(cloud, w, ring[j], before, inner, v)


@kernel
def twos(j):
    """How often 2 divides j; 40 for 0."""
    if j == 0:
        return 40
    many = 0
    while j % 2 == 0:
        j //= 2
        many += 1
    return many
