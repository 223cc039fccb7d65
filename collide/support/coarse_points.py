"""Coarse points: points of a cloud farthest in directions spread over the sphere, the cloud stretched to a cube.

A kernel, since Python and C are to choose the same points: numpy's sines and cosines differ from platform to platform.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64

#: So many points stand for the whole cloud in a first query.
COARSE = 32
#: Cosine and sine of the golden angle, π·(3 − √5): what the spiral of directions turns by from each to the next.
_COSINE, _SINE = -0.7373688780783197, 0.6754902942615238


@entry("int64(int64, int64, int64)")
def choose_coarse(points_at, n, block_at):
    """Fill a block of 4·COARSE doubles: x, y, z of COARSE points of n ≥ 1 (n, 3), and their ids as int64 bits.

    Returns how many different points are named: these come first, the rest of the block repeats them.
    """
    points = view_f64(points_at, 3 * n)
    block = view_f64(block_at, 3 * COARSE)
    ids = view_i64(block_at + 24 * COARSE, COARSE)
    farthest_ids = view_i64(block_at, COARSE)
    x_middle, x_extent = _middle_and_extent(points, n, 0)
    y_middle, y_extent = _middle_and_extent(points, n, 1)
    z_middle, z_extent = _middle_and_extent(points, n, 2)
    along = 1.0
    across = 0.0
    for d in range(COARSE):
        height = float(2 * d + 1) / COARSE - 1.0
        radius = math.sqrt(1.0 - height * height)
        best = 0
        farthest = -math.inf
        for i in range(n):
            x = (points[3 * i] - x_middle) / x_extent
            y = (points[3 * i + 1] - y_middle) / y_extent
            z = (points[3 * i + 2] - z_middle) / z_extent
            value = radius * along * x + radius * across * y + height * z
            if value > farthest:
                farthest = value
                best = i
        farthest_ids[d] = best
        rotated = along * _COSINE - across * _SINE
        across = along * _SINE + across * _COSINE
        along = rotated
    different = 0
    for d in range(COARSE):
        known = False
        for k in range(different):
            known = known or ids[k] == farthest_ids[d]
        if not known:
            ids[different] = farthest_ids[d]
            different += 1
    for k in range(COARSE - different):
        ids[different + k] = farthest_ids[k]
    for k in range(COARSE):
        for axis in range(3):
            block[COARSE * axis + k] = points[3 * ids[k] + axis]
    return different


@kernel
def _middle_and_extent(points, n, axis):
    """Of a coordinate; the extent 1 where all are the same."""
    low = points[axis]
    high = low
    for i in range(n):
        low = min(low, points[3 * i + axis])
        high = max(high, points[3 * i + axis])
    return 0.5 * (low + high), high - low if high > low else 1.0
