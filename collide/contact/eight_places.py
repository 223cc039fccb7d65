"""Places and gaps of a patch's points in blocks of eight, for comparisons of a point with eight at once.

A block is three rows of eight doubles: places u, places v, gaps. Behind the last point of a block stands NaN, of which
no comparison is true.
"""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64
from collide.kernels.lanes import LANES

#: Doubles of a block; from a point's u to its v, and to its gap.
BLOCK = 3 * LANES
TO_V, TO_GAP = LANES, 2 * LANES


@kernel(inline=True)
def blocks_of(n):
    """How many blocks n points take."""
    return (n + LANES - 1) // LANES


@kernel(inline=True)
def place_in_columns(k):
    """Where u of point k stands."""
    return BLOCK * (k // LANES) + k % LANES


@kernel(inline=True)
def put_in_columns(columns, k, u, v, gap):
    at = place_in_columns(k)
    columns[at], columns[at + TO_V], columns[at + TO_GAP] = u, v, gap


@kernel
def fill_last_block(columns_at, n):
    """Put NaN behind n points, up to the end of their last block."""
    columns = view_f64(columns_at, BLOCK * blocks_of(n))
    for k in range(n, LANES * blocks_of(n)):
        put_in_columns(columns, k, math.nan, math.nan, math.nan)
