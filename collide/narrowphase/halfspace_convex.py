"""A half-space against anything convex, and against another half-space, in closed form."""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64, view_i64
from collide.narrowphase.gap.precise_pair import (
    HEIGHT_ERROR,
    LARGEST_FINE,
    SMALLEST_FINE,
    is_composed,
    scale_of,
)
from collide.narrowphase.gap.tied_vertices import MOST_TIES, tied_vertices
from collide.numerics.double_double import add, divide, multiply, product_of_vectors, square_root, subtract
from collide.numerics.error_free import two_product, two_sum


@kernel
def plane_in_world(numbers, at, poses, p):
    """(n, offset, |n|): the half-space at a pose is {x : n·(x − p_WA) ≤ offset}, n in W's axes.

    The image of {y : m·y ≤ b} under y ↦ R y + p is {x : m·R⁻¹(x − p) ≤ b}. R⁻¹ is the adjugate over
    the determinant, for the matrix as it stands, not its transpose: n = cof(R) m, offset = b·det R.
    """
    a = poses[p]
    b = poses[p + 1]
    c = poses[p + 2]
    d = poses[p + 3]
    e = poses[p + 4]
    f = poses[p + 5]
    g = poses[p + 6]
    h = poses[p + 7]
    i = poses[p + 8]
    c0 = e * i - f * h
    c1 = f * g - d * i
    c2 = d * h - e * g
    m0 = numbers[at]
    m1 = numbers[at + 1]
    m2 = numbers[at + 2]
    nx = c0 * m0 + c1 * m1 + c2 * m2
    ny = (c * h - b * i) * m0 + (a * i - c * g) * m1 + (b * g - a * h) * m2
    nz = (b * f - c * e) * m0 + (c * d - a * f) * m1 + (a * e - b * d) * m2
    offset = numbers[at + 3] * (a * c0 + b * c1 + c * c2)
    return nx, ny, nz, offset, math.sqrt(nx * nx + ny * ny + nz * nz)


@kernel
def reach_of_plane(numbers, at, poses, p):
    """(distance of the plane from the frame's origin, skew): what a half-space adds to S, and by what errors grow.

    n = cof(R) m is rounded at |row|²|m|, the offset at |row|³|b|; a matrix that is no rotation may make that much of |n|.
    """
    _, _, _, offset, length = plane_in_world(numbers, at, poses, p)
    row = 0.0
    for k in range(3):
        r = p + 3 * k
        row = max(row, poses[r] * poses[r] + poses[r + 1] * poses[r + 1] + poses[r + 2] * poses[r + 2])
    m0 = numbers[at]
    m1 = numbers[at + 1]
    m2 = numbers[at + 2]
    m = math.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    skew = max(row * m / length, 1.0)
    return max(abs(offset), abs(numbers[at + 3]) * row * math.sqrt(row)) / length, skew


@kernel
def opposite_halfspaces(numbers, at_a, p, at_b, q, poses):
    """(whether the outward normals are opposite within rounding, also of composed poses; nhat_A)."""
    ax, ay, az, _, length_a = plane_in_world(numbers, at_a, poses, p)
    bx, by, bz, _, length_b = plane_in_world(numbers, at_b, poses, q)
    cx = ay * bz - az * by
    cy = az * bx - ax * bz
    cz = ax * by - ay * bx
    across = math.sqrt(cx * cx + cy * cy + cz * cz)
    opposite = ax * bx + ay * by + az * bz < 0.0 and across <= 512.0 * 2.0**-53 * length_a * length_b
    return opposite, ax / length_a, ay / length_a, az / length_a


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
            total, total_low = add(total, total_low, c, c_low)
        plane[2 * i] = total
        plane[2 * i + 1] = total_low
    total = 0.0
    total_low = 0.0
    for j in range(3):
        c, c_low = _cofactor(poses, p, 0, j)
        c, c_low = multiply(c, c_low, poses[p + j], 0.0)
        total, total_low = add(total, total_low, c, c_low)
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
    least, least_low = divide(least, least_low, length, length_low)
    # The normal, too, is rounded here, to 2⁻¹⁰⁰·3 of |row|²|m|, and the offset to as much of |row|³ times it.
    return True, least, least_low, 8.0 * skew * HEIGHT_ERROR / scale_of(size)
