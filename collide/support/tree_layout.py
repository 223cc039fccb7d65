"""Header of a support tree, for kernels: see `support_tree.py`."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64
from collide.support.point_columns import lowest_of

#: Header entries: how many of what, then addresses.
(POINTS, DEPTH, NODES, ENTRIES, LINKS, AT_NODES, AT_ENTRIES, AT_LIST_COORDINATES, AT_RING_STARTS, AT_RING, AT_RANGE,
 FLAT, AT_POINTS, HEADER) = range(14)
#: Fewest entries of a list: a block of the scan.
FEWEST = 8


@kernel
def write_range(points, n, out):
    """[least, largest, target]: a direction whose components lie between them (or are 0) is settled exactly.

    Products of a component with differences of coordinates, and the rounding errors of these products, are then
    doubles. Other directions are first scaled so that their largest component is near target.
    """
    lowest = lowest_of(points, 3 * n)
    size = 0.0
    for k in range(3 * n):
        size = max(size, abs(points[k]))
    largest = min(900, 960 - math.frexp(size)[1])
    out[0] = math.ldexp(1.0, min(max(-1020, -1020 - lowest), 1020))
    out[1] = math.ldexp(1.0, largest)
    out[2] = float(largest - 1)


@entry("void(int64, int64, int64)")
def exact_range(points_at, n, out_at):
    """`write_range` of points (n, 3), for callers outside kernels.   out : (3,) doubles."""
    write_range(view_f64(points_at, 3 * n), n, view_f64(out_at, 3))
