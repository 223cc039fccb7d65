"""Points of a convex set as kernels scan them: axis by axis, and what is measured on the way. Python and C call it."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64
from collide.numerics.digits import lowest_bit
from collide.numerics.vec3 import dot, vec3_at

#: A root of a sum of three squares is good to four units in the last place.
_UPWARDS = 1.0 + 1e-15


@entry("int64(int64, int64, int64, int64, int64)")
def lay_out_points(points_at, n, columns_at, padded, reach_at):
    """Write points (n, 3) as columns (3, padded), filled up with the first; returns `lowest_of` their coordinates.

    reach : a double, out: how far a point is from the origin at most, rounded upwards.   O(padded).
    """
    return put_points(points_at, n, columns_at, padded, reach_at)


@kernel
def put_points(points_at, n, columns_at, padded, reach_at):
    """`lay_out_points` for other kernels."""
    points, columns = view_f64(points_at, 3 * n), view_f64(columns_at, 3 * padded)
    largest = 0.0
    for k in range(n):
        p = vec3_at(points, 3 * k)
        columns[k] = p.x
        columns[padded + k] = p.y
        columns[2 * padded + k] = p.z
        largest = max(largest, dot(p, p))
    for k in range(n, padded):
        for axis in range(3):
            columns[axis * padded + k] = points[axis]
    view_f64(reach_at, 1)[0] = reach_of_square(largest)
    return lowest_of(points, 3 * n)


@kernel(inline=True)
def reach_of_square(largest):
    """How far points are from the origin at most, rounded upwards, by the largest square."""
    return math.sqrt(largest) * _UPWARDS


@kernel
def lowest_of(values, n):
    """Exponent of the lowest bit set among doubles; 2000 where no bit is."""
    lowest = 2000
    for k in range(n):
        lowest = min(lowest, lowest_bit(values[k]))
    return lowest
