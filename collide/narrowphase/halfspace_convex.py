"""A half-space against anything convex, and against another half-space, in closed form."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.narrowphase.gap.precise_pair import (
    HEIGHT_ERROR,
    add_products,
    is_composed,
    is_refinable,
    unit_scale,
)
from collide.narrowphase.gap.tied_vertices import MAX_TIES, tied_vertices, vertices_of
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD, DDVec3
from collide.numerics.error_free import two_product, two_sum
from collide.numerics.vec3 import column_at, divide, dot, rotate_back


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
    return dd.sub(two_product(poses[r + c], poses[s + d]), two_product(poses[r + d], poses[s + c]))


@kernel
def _put_fine_plane(numbers, at, poses, p, plane):
    """`plane_in_world` in double-doubles: n and the offset, eight doubles."""
    for i in range(4):
        total = DD(0.0, 0.0)
        for j in range(3):
            # The offset's determinant is expanded along the first row.
            factor = numbers[at + j] if i < 3 else poses[p + j]
            total = dd.add(total, dd.mul(_cofactor(poses, p, i % 3, j), DD(factor, 0.0)))
        if i == 3:
            total = dd.mul(total, DD(numbers[at + 3], 0.0))
        plane[2 * i] = total.high
        plane[2 * i + 1] = total.low


@kernel(inline=True)
def _fine_coordinate(b, poses, p, q, axis):
    """A coordinate of R_B b + p_WB − p_WA, as good as those of `precise_pair.put_difference`."""
    total, rest = two_sum(poses[q + 9 + axis], -poses[p + 9 + axis])
    total, rest = add_products(total, rest, poses, q + 3 * axis, b)
    return two_sum(total, rest)


class RefinedHeight(NamedTuple):
    """Signed distance of a core from a half-space [m], within ``error``, if proven."""

    proven: bool
    height: DD
    error: float


@kernel
def refine_height(pair, doubles_at, ties_at, vertex, size, error, skew):
    """The signed distance of B's core from a half-space A, to its last digit.

    vertex : the deepest, as doubles say.   size, error, skew : as `reach_of_plane` makes them.
    doubles_at, ties_at : workspace of eight doubles, MAX_TIES + 1 integers.
    Composed poses are left to the exact stage.
    """
    A, B, numbers, poses = pair.A, pair.B, pair.numbers, pair.poses
    p, q = A.pose_at, B.pose_at
    if is_composed(poses, p) or is_composed(poses, q) or not is_refinable(size):
        return RefinedHeight(False, DD(0.0, 0.0), 0.0)
    plane = view_f64(doubles_at, 8)
    ties = view_i64(ties_at, MAX_TIES + 1)
    _put_fine_plane(numbers, A.params_at, poses, p, plane)
    normal = dd.vec3_at(plane, 0)
    length = dd.sqrt(dd.inner(normal, normal))
    if not (2.0**-300 < length.high < 2.0**300):
        return RefinedHeight(False, DD(0.0, 0.0), 0.0)
    g = rotate_back(poses, q, divide(dd.leading(normal), length.high))
    ties[0] = vertex
    n_tied, limit = tied_vertices(vertices_of(B), ties, g, error)
    too_many = n_tied > MAX_TIES
    least = DD(math.inf, 0.0)
    for k in range(B.n if too_many else n_tied):
        b = column_at(B.coords, B.padded, k if too_many else ties[k])
        if too_many and dot(b, g) > limit:
            continue
        point = DDVec3(
            _fine_coordinate(b, poses, p, q, 0), _fine_coordinate(b, poses, p, q, 1), _fine_coordinate(b, poses, p, q, 2)
        )
        height = dd.inner(point, normal)
        if dd.less(height, least):
            least = height
    distance = dd.div(dd.sub(least, DD(plane[6], plane[7])), length)
    # The normal, too, is rounded here, to 2⁻¹⁰⁰·3 of |row|²|m|, and the offset to as much of |row|³ times it.
    return RefinedHeight(True, distance, 8.0 * skew * HEIGHT_ERROR / unit_scale(size))
