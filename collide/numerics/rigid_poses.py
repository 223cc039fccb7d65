"""Whether matrices are rigid poses, many at once, and how far a matrix is off a rotation."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64
from collide.numerics.vec3 import Vec3, dot

#: What rounding adds to a product of two columns: four units in the last place.
_ROUNDED = 2.0**-51


@kernel(inline=True)
def off_rotation(poses, at):
    """How far the matrix at a place, row by row, is off a rotation: the largest entry of RᵀR − I, and rounding."""
    x = Vec3(poses[at], poses[at + 3], poses[at + 6])
    y = Vec3(poses[at + 1], poses[at + 4], poses[at + 7])
    z = Vec3(poses[at + 2], poses[at + 5], poses[at + 8])
    off = max(max(abs(dot(x, x) - 1.0), abs(dot(y, y) - 1.0)), abs(dot(z, z) - 1.0))
    return max(max(off, abs(dot(x, y))), max(abs(dot(y, z)), abs(dot(z, x)))) + _ROUNDED


@entry("boolean(int64, int64, float64, float64)")
def are_rigid(X_at, n, tolerance, largest):
    """Whether n matrices of 16 doubles end in (0, 0, 0, 1), move by at most ``largest`` along each axis, do not mirror,
    and have columns whose products differ from a rotation's by at most ``tolerance``, about. A NaN fails. O(n), ten
    nanoseconds each.
    """
    X = view_f64(X_at, 16 * n)
    for k in range(n):
        at = 16 * k
        a, b, c = X[at], X[at + 1], X[at + 2]
        d, e, f = X[at + 4], X[at + 5], X[at + 6]
        g, h, i = X[at + 8], X[at + 9], X[at + 10]
        is_rigid = (
            (abs(a * a + d * d + g * g - 1.0) <= tolerance)
            & (abs(b * b + e * e + h * h - 1.0) <= tolerance)
            & (abs(c * c + f * f + i * i - 1.0) <= tolerance)
            & (abs(a * b + d * e + g * h) <= tolerance)
            & (abs(a * c + d * f + g * i) <= tolerance)
            & (abs(b * c + e * f + h * i) <= tolerance)
            & (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.5)
            & (abs(X[at + 3]) <= largest) & (abs(X[at + 7]) <= largest) & (abs(X[at + 11]) <= largest)
            & (X[at + 12] == 0.0) & (X[at + 13] == 0.0) & (X[at + 14] == 0.0) & (X[at + 15] == 1.0)
        )
        if not is_rigid:
            return False
    return True


def are_rigid_matrices(X: np.ndarray, tolerance: float, largest: float) -> bool:
    """`are_rigid` of an array (n, 4, 4); False of other shapes, of numbers that are no doubles or not side by side."""
    is_readable = X.ndim == 3 and X.shape[1:] == (4, 4) and X.dtype == np.float64 and X.flags.c_contiguous
    return bool(is_readable and len(X) and are_rigid(address_of(X), len(X), tolerance, largest))
