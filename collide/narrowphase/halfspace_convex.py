"""A half-space against anything convex, in closed form: one support query, and the last digits of a height."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.lowering.packed_convex import POINTS
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.gap.precise_pair import HEIGHT_ERROR, LARGEST_FINE, SMALLEST_FINE, is_composed, scale_of
from collide.narrowphase.gap.tied_vertices import MOST_TIES, tied_vertices
from collide.narrowphase.posed_pair import radius_of
from collide.narrowphase.rows import CERTIFIED, HOW, write_vectors, write_verdict, write_vertices
from collide.numerics.double_double import add as dd_add
from collide.numerics.double_double import bracket, multiply, product_of_vectors, square_root, subtract
from collide.numerics.double_double import divide as dd_divide
from collide.numerics.error_free import two_product, two_sum
from collide.numerics.vec3 import Vec3, add, column_at, cross, divide, dot, neg, rotate, rotate_back, scale, sub, vec3_at
from collide.results import FORMULA, UNDECIDED
from collide.support.support_mapping import settled_vertex, support


class Plane(NamedTuple):
    """A half-space {x : normal·(x − p_WA) ≤ offset} in the world's axes.   length : |normal|."""

    normal: Vec3
    offset: float
    length: float


@kernel
def plane_in_world(pair, body):
    """The `Plane` of a posed half-space.

    The image of {y : m·y ≤ b} under y ↦ R y + p is {x : m·R⁻¹(x − p) ≤ b}. R⁻¹ is the adjugate over
    the determinant, for the matrix as it stands, not its transpose: n = cof(R) m, offset = b·det R.
    """
    p = body.pose_at
    r0, r1, r2 = vec3_at(pair.poses, p), vec3_at(pair.poses, p + 3), vec3_at(pair.poses, p + 6)
    cofactors = cross(r1, r2)
    m = vec3_at(pair.numbers, body.params_at)
    n = Vec3(dot(cofactors, m), dot(cross(r2, r0), m), dot(cross(r0, r1), m))
    return Plane(n, pair.numbers[body.params_at + 3] * dot(r0, cofactors), math.sqrt(dot(n, n)))


@kernel
def reach_of_plane(pair, body):
    """(distance of the plane from the frame's origin, skew): what a half-space adds to S, and by what errors grow.

    n = cof(R) m is rounded at |row|²|m|, the offset at |row|³|b|; a matrix that is no rotation may make that much of |n|.
    """
    plane = plane_in_world(pair, body)
    row = 0.0
    for k in range(3):
        r = vec3_at(pair.poses, body.pose_at + 3 * k)
        row = max(row, dot(r, r))
    m = vec3_at(pair.numbers, body.params_at)
    skew = max(row * math.sqrt(dot(m, m)) / plane.length, 1.0)
    offset = pair.numbers[body.params_at + 3]
    return max(abs(plane.offset), abs(offset) * row * math.sqrt(row)) / plane.length, skew


@kernel
def halfspace_convex(ordered, query, row, work):
    """Write the row of a half-space A and a convex set B: the point of B's core deepest behind the plane, moved by the radius."""
    pair = ordered.pair
    A, B, poses = pair.A, pair.B, pair.poses
    distance, skew = reach_of_plane(pair, A)
    size = ordered.size + distance
    error = ERROR * size * skew + ordered.slop
    plane = plane_in_world(pair, A)
    nhat = divide(plane.normal, plane.length)
    g = neg(rotate_back(poses, B.pose_at, nhat))
    k, x, y, z, _ = support(B.kind, B.coords, B.n, B.padded, pair.numbers, B.params_at, B.tree, 0, -1, g.x, g.y, g.z)
    corner = Vec3(x, y, z)
    if B.tree != 0:
        k = settled_vertex(B.coords, B.n, B.padded, B.tree, k, g.x, g.y, g.z)
        corner = column_at(B.coords, B.padded, k)
    b = rotate(poses, B.pose_at, corner)
    radius = radius_of(pair, B)
    gap = dot(add(b, pair.t), nhat) - plane.offset / plane.length - radius
    lower = gap - error
    upper = gap + error
    decided = lower > 0.0 or upper <= 0.0
    exact_numbers = ordered.exact_numbers and B.kind == POINTS
    if exact_numbers and lower <= query.limit and not query.boolean:
        proven, height, height_low, height_error = polish_height(pair, work.fine_at, work.ties_at, k, size, error, skew)
        if proven:
            height, height_low = dd_add(height, height_low, -radius, 0.0)
            low, gap, high = bracket(height, height_low, height_error)
            lower = max(lower, low)
            upper = min(upper, high)
    width = 0.0 if exact_numbers and not query.boolean else math.inf
    write_verdict(row, gap, lower, upper, FORMULA, width, query.limit)
    if exact_numbers and (not decided or (row.flags[CERTIFIED] == 0 and not query.boolean)):
        row.flags[HOW] = UNDECIDED  # the exact stage settles the sign, or the last digits
    p_WBb = add(b, sub(vec3_at(poses, B.pose_at + 9), scale(radius, nhat)))
    write_vectors(row, nhat, sub(p_WBb, scale(gap, nhat)), p_WBb, ordered.flip)
    work.ids[0] = -1
    work.ids[1] = k
    write_vertices(row, work.ids, 1, ordered.flip)


@kernel(inline=True)
def _cofactor(poses, p, i, j):
    """Entry (i, j) of cof(R), a double-double."""
    r = p + 3 * ((i + 1) % 3)
    s = p + 3 * ((i + 2) % 3)
    c = (j + 1) % 3
    d = (j + 2) % 3
    x, x_low = two_product(poses[r + c], poses[s + d])
    y, y_low = two_product(poses[r + d], poses[s + c])
    return subtract(x, x_low, y, y_low)


@kernel
def _set_fine_plane(numbers, at, poses, p, plane):
    """`plane_in_world` in double-doubles: n and the offset, eight doubles."""
    for i in range(3):
        total = 0.0
        total_low = 0.0
        for j in range(3):
            c, c_low = _cofactor(poses, p, i, j)
            c, c_low = multiply(c, c_low, numbers[at + j], 0.0)
            total, total_low = dd_add(total, total_low, c, c_low)
        plane[2 * i] = total
        plane[2 * i + 1] = total_low
    total = 0.0
    total_low = 0.0
    for j in range(3):
        c, c_low = _cofactor(poses, p, 0, j)
        c, c_low = multiply(c, c_low, poses[p + j], 0.0)
        total, total_low = dd_add(total, total_low, c, c_low)
    total, total_low = multiply(total, total_low, numbers[at + 3], 0.0)
    plane[6] = total
    plane[7] = total_low


@kernel(inline=True)
def _fine_coordinate(coordinates, m, k, poses, p, q, axis):
    """A coordinate of R_B b + p_WB − p_WA for vertex k, a double-double as good as `fine.fine_point`."""
    r = q + 3 * axis
    total, rest = two_sum(poses[q + 9 + axis], -poses[p + 9 + axis])
    for j in range(3):
        term, e = two_product(poses[r + j], coordinates[j * m + k])
        total, f = two_sum(total, term)
        rest += e + f
    return two_sum(total, rest)


@kernel
def polish_height(pair, doubles_at, ties_at, vertex, size, error, skew):
    """(proven, height, low part, error): the signed distance of B's core from a half-space A, to its last digit.

    vertex : the deepest, as doubles say.   size, error, skew : as `reach_of_plane` makes them.
    doubles_at, ties_at : workspace of eight doubles, MOST_TIES + 1 integers.
    Composed poses are left to the exact stage.
    """
    A, B, numbers, poses = pair.A, pair.B, pair.numbers, pair.poses
    p, q = A.pose_at, B.pose_at
    if is_composed(poses, p) or is_composed(poses, q) or not (SMALLEST_FINE < size < LARGEST_FINE):
        return False, 0.0, 0.0, 0.0
    plane = view_f64(doubles_at, 8)
    ties = view_i64(ties_at, MOST_TIES + 1)
    _set_fine_plane(numbers, A.params_at, poses, p, plane)
    square, square_low = product_of_vectors(
        plane[0], plane[1], plane[2], plane[3], plane[4], plane[5],
        plane[0], plane[1], plane[2], plane[3], plane[4], plane[5],
    )  # fmt: skip
    length, length_low = square_root(square, square_low)
    if not (2.0**-300 < length < 2.0**300):
        return False, 0.0, 0.0, 0.0
    dx = plane[0] / length
    dy = plane[2] / length
    dz = plane[4] / length
    gx = poses[q] * dx + poses[q + 3] * dy + poses[q + 6] * dz
    gy = poses[q + 1] * dx + poses[q + 4] * dy + poses[q + 7] * dz
    gz = poses[q + 2] * dx + poses[q + 5] * dy + poses[q + 8] * dz
    ties[0] = vertex
    level, limit = tied_vertices(B.coords, B.n, B.padded, B.tree, ties, gx, gy, gz, error)
    many = level > MOST_TIES
    least = math.inf
    least_low = 0.0
    for k in range(B.n if many else level):
        i = k if many else ties[k]
        if many and B.coords[i] * gx + B.coords[B.padded + i] * gy + B.coords[2 * B.padded + i] * gz > limit:
            continue
        x, x_low = _fine_coordinate(B.coords, B.padded, i, poses, p, q, 0)
        y, y_low = _fine_coordinate(B.coords, B.padded, i, poses, p, q, 1)
        z, z_low = _fine_coordinate(B.coords, B.padded, i, poses, p, q, 2)
        height, height_low = product_of_vectors(
            x, x_low, y, y_low, z, z_low, plane[0], plane[1], plane[2], plane[3], plane[4], plane[5]
        )
        if height < least or (height == least and height_low < least_low):
            least = height
            least_low = height_low
    least, least_low = subtract(least, least_low, plane[6], plane[7])
    least, least_low = dd_divide(least, least_low, length, length_low)
    # The normal, too, is rounded here, to 2⁻¹⁰⁰·3 of |row|²|m|, and the offset to as much of |row|³ times it.
    return True, least, least_low, 8.0 * skew * HEIGHT_ERROR / scale_of(size)
