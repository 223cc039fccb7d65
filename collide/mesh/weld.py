"""Vertices with equal coordinates: files such as STL name each vertex once for every facet.

Coordinates are compared as numbers, exactly, without a tolerance: vertices kept apart by the file stay apart.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i32, view_i64
from collide.numerics.vec3 import equal_at

#: Hashes are of 31 bits, so that no product leaves 63: plain Python and machine code agree.
_MASK = (1 << 31) - 1
_MULTIPLIER = 0x2C1B3C6D


def weld(vertices: np.ndarray) -> np.ndarray:
    """(n,) int32: for every vertex the first row with the same coordinates, its own row without an earlier.

    vertices : (n, 3) finite; −0.0 and 0.0 are one number. O(n).
    """
    points = np.ascontiguousarray(vertices + 0.0)
    n = len(points)
    size = 1 << max(4, (2 * n - 1).bit_length())
    table = np.full(size, -1, dtype=np.int32)
    first = np.empty(n, dtype=np.int32)
    first_rows(address_of(points), n, address_of(table), size, address_of(first))
    return first


@kernel
def _mix(h, bits):
    """A hash with 62 bits of a double mixed in, the two highest together with the lower half."""
    h = ((h ^ (bits & _MASK) ^ ((bits >> 62) & 3)) * _MULTIPLIER) & _MASK
    h ^= h >> 15
    h = ((h ^ ((bits >> 31) & _MASK)) * _MULTIPLIER) & _MASK
    return h ^ (h >> 13)


@entry("void(int64, int64, int64, int64, int64)")
def first_rows(points_at, n, table_at, size, first_at):
    """For each of n points the first with the same coordinates. table : ``size`` int32, a power of two > n, all −1."""
    points = view_f64(points_at, 3 * n)
    bits = view_i64(points_at, 3 * n)
    table = view_i32(table_at, size)
    first = view_i32(first_at, n)
    for k in range(n):
        h = 0
        for axis in range(3):
            h = _mix(h, bits[3 * k + axis])
        slot = (h ^ (h << 7)) & (size - 1)
        row = table[slot]
        while row >= 0 and not equal_at(points, 3 * row, 3 * k):
            slot = (slot + 1) & (size - 1)
            row = table[slot]
        if row < 0:
            table[slot] = k
            row = k
        first[k] = row
