"""Which vertices make up the nested subsets: some that are spread evenly over the directions they are extreme in.

A subset's candidate lists are as long as its normal cones are large, counted in cones of the finer subset. Random
subsets have cones of very different size: among lists of 46 on average were some of 100, and queries meet the long
ones oftener. Here the vertices are put in order along a Hilbert curve over the sphere of directions (Hilbert 1891, on
an octahedron unfolded to a square), and vertices at even distances along it are taken: lists as long on average, never
much longer.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.numerics.counting_sort import order_by_merging
from collide.numerics.vec3 import Vec3, divide, norm1, vec3_at

#: Cells of the curve along each axis, a power of two.
_CELLS = 1 << 16


@kernel
def nested_order(vertices, normals, late, n, sizes, first_size, n_sizes, places, scratch, ordered):
    """Put n vertices into ``ordered`` so that the first sizes[first_size + k] of ``ordered`` are subset k; sizes fall
    from n.

    normals : (n, 3), of any length: each vertex is extreme along its normal; 0 where not known.
    late : (n,) not 0: vertices to enter a subset when no others are left.   places, scratch : (n,) of workspace.
    O(n log n), always the same.
    """
    along = ordered
    free = 0
    for k in range(n):
        # Those that are late come behind the end of the curve.
        places[k] = _place_on_curve(vec3_at(normals, 3 * k)) + (0 if late[k] == 0 else _CELLS * _CELLS)
        free += 1 if late[k] == 0 else 0
    order_by_merging(places, n, along, scratch)
    n_remaining = n
    for level in range(1, n_sizes):
        size = sizes[first_size + level]
        step = float(max(free, size)) / float(size)
        n_taken = 0
        n_left = 0
        for k in range(n_remaining):
            if n_taken < size and k == int((float(n_taken) + 0.5) * step):
                scratch[n_taken] = along[k]
                n_taken += 1
            else:
                scratch[size + n_left] = along[k]
                n_left += 1
        # What is left stands between the subset and what the finer ones have left before.
        for k in range(n_remaining):
            along[k] = scratch[k]
        n_remaining = size
        free = size
    for k in range(n):
        ordered[k] = vertices[ordered[k]]


@kernel
def _place_on_curve(direction):
    """How far along the Hilbert curve a direction stands."""
    size = norm1(direction)
    d = divide(direction, size if size > 0.0 else 1.0)
    if d.z < 0.0:  # the lower half is folded out over the corners of the square
        d = Vec3(math.copysign(1.0 - abs(d.y), d.x), math.copysign(1.0 - abs(d.x), d.y), d.z)
    column, row = _cell_of(d.x), _cell_of(d.y)
    place = 0
    half = _CELLS >> 1
    while half > 0:
        right, upper = column & half > 0, row & half > 0
        place = 4 * place + ((2 if upper else 3) if right else (1 if upper else 0))
        if right and not upper:
            column = _CELLS - 1 - column
            row = _CELLS - 1 - row
        if not upper:
            column, row = row, column
        half >>= 1
    return place


@kernel
def _cell_of(w):
    return int(min(max((w + 1.0) * (0.5 * _CELLS), 0.0), _CELLS - 1.0))
