"""Small vectors in kernels: `Vec3`, and the products of geometry.

Sums are taken from left to right, x first, with no contraction: error bounds count on this order, and equal answers are
equal bits. A Vec3 costs nothing in machine code: its three doubles are registers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel


class Vec3(NamedTuple):
    x: float
    y: float
    z: float


@kernel(inline=True)
def dot(a, b):
    return a.x * b.x + a.y * b.y + a.z * b.z


@kernel(inline=True)
def cross(a, b):
    return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@kernel(inline=True)
def add(a, b):
    return Vec3(a.x + b.x, a.y + b.y, a.z + b.z)


@kernel(inline=True)
def sub(a, b):
    return Vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@kernel(inline=True)
def scale(factor, a):
    return Vec3(factor * a.x, factor * a.y, factor * a.z)


@kernel(inline=True)
def neg(a):
    return Vec3(-a.x, -a.y, -a.z)


@kernel(inline=True)
def norm(a):
    """|a|. Squares of components below 2⁻⁵³⁷ vanish, above 2⁵¹¹ they overflow."""
    return math.sqrt(a.x * a.x + a.y * a.y + a.z * a.z)


@kernel(inline=True)
def norm1(a):
    """Sum of magnitudes of the components: what rounding errors of a dot product are measured by."""
    return abs(a.x) + abs(a.y) + abs(a.z)


@kernel(inline=True)
def component(a, axis):
    """Component 0, 1 or 2: kernels cannot index a tuple by a variable."""
    if axis == 0:
        return a.x
    return a.y if axis == 1 else a.z


@kernel(inline=True)
def divide(a, divisor):
    """a / divisor: each component is a quotient, rounded once."""
    return Vec3(a.x / divisor, a.y / divisor, a.z / divisor)


@kernel(inline=True)
def absolute(a):
    return Vec3(abs(a.x), abs(a.y), abs(a.z))


@kernel(inline=True)
def max_abs(a):
    """The largest magnitude of a component."""
    return max(abs(a.x), abs(a.y), abs(a.z))


@kernel(inline=True)
def vec3_at(values, at):
    """Three consecutive doubles."""
    return Vec3(values[at], values[at + 1], values[at + 2])


@kernel(inline=True)
def put_vec3(values, at, a):
    values[at] = a.x
    values[at + 1] = a.y
    values[at + 2] = a.z


@kernel(inline=True)
def equal_at(values, i, j):
    """Whether two vectors that stand at i and at j are equal."""
    return values[i] == values[j] and values[i + 1] == values[j + 1] and values[i + 2] == values[j + 2]


@kernel(inline=True)
def column_at(coords, n, k):
    """Point k of n, kept as all x, then all y, then all z."""
    return Vec3(coords[k], coords[n + k], coords[2 * n + k])


@kernel(inline=True)
def rotate(R, at, a):
    """R a, for a matrix that stands row by row."""
    return Vec3(
        R[at] * a.x + R[at + 1] * a.y + R[at + 2] * a.z,
        R[at + 3] * a.x + R[at + 4] * a.y + R[at + 5] * a.z,
        R[at + 6] * a.x + R[at + 7] * a.y + R[at + 8] * a.z,
    )


@kernel(inline=True)
def rotate_back(R, at, a):
    """Rᵀ a."""
    return Vec3(
        R[at] * a.x + R[at + 3] * a.y + R[at + 6] * a.z,
        R[at + 1] * a.x + R[at + 4] * a.y + R[at + 7] * a.z,
        R[at + 2] * a.x + R[at + 5] * a.y + R[at + 8] * a.z,
    )


@kernel
def unit_orthogonal(a):
    """A unit vector orthogonal to a ≠ 0, made from its two largest coordinates."""
    if abs(a.x) <= abs(a.y) and abs(a.x) <= abs(a.z):
        length = math.sqrt(a.y * a.y + a.z * a.z)
        return Vec3(0.0, -a.z / length, a.y / length)
    if abs(a.y) <= abs(a.z):
        length = math.sqrt(a.x * a.x + a.z * a.z)
        return Vec3(a.z / length, 0.0, -a.x / length)
    length = math.sqrt(a.x * a.x + a.y * a.y)
    return Vec3(-a.y / length, a.x / length, 0.0)
