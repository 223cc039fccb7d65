"""A half-space against anything convex, and against another half-space, in closed form."""

from __future__ import annotations

import math

from collide._jit import kernel


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
