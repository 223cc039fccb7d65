"""Which vertices make up the nested subsets: some that are spread evenly over the directions they are extreme in.

A subset's candidate lists are as long as its normal cones are large, counted in cones of the finer subset. Random
subsets have cones of very different size: among lists of 46 on average were some of 100, and queries meet the long
ones oftener. Here the vertices are put in order along a Hilbert curve over the sphere of directions (Hilbert 1891, on
an octahedron unfolded to a square), and vertices at even distances along it are taken: lists as long on average, never
much longer.
"""

from __future__ import annotations

import numpy as np

#: Cells of the curve along each axis, as a power of two.
_BITS = 16


def nested_order(vertices: np.ndarray, normals: np.ndarray, late: np.ndarray, sizes: list[int]) -> np.ndarray:
    """The vertices so ordered that the first ``sizes[k]`` of them are subset k; sizes fall, the first is of all.

    normals : (h, 3), a direction in which each vertex is extreme; of any length, 0 where there is none.
    late : (h,) bool: vertices that only enter a subset when no others are left.
    O(h log h), always the same.
    """
    along = np.argsort(_place_on_curve(normals), kind="stable")
    along = np.concatenate([along[~late[along]], along[late[along]]])
    ordered: list[np.ndarray] = []
    free = len(vertices) - int(late.sum())
    for size in sizes[1:]:
        places = ((np.arange(size) + 0.5) * (max(free, size) / size)).astype(np.int64)
        ordered.insert(0, np.delete(along, places))
        along, free = along[places], size
    return vertices[np.concatenate([along, *ordered])]


def _place_on_curve(directions: np.ndarray) -> np.ndarray:
    """(n,) int64: how far along the Hilbert curve each direction stands."""
    size = np.abs(directions).sum(axis=1)
    x, y, z = (directions / np.where(size > 0, size, 1.0)[:, None]).T
    outer = z < 0  # the lower half is folded out over the corners of the square
    u = np.where(outer, np.copysign(1 - np.abs(y), x), x)
    v = np.where(outer, np.copysign(1 - np.abs(x), y), y)
    cells = 1 << _BITS
    column, row = (np.clip((w + 1) * (0.5 * cells), 0, cells - 1).astype(np.int64) for w in (u, v))
    place = np.zeros(len(directions), dtype=np.int64)
    half = cells >> 1
    while half > 0:
        right, upper = (column & half) > 0, (row & half) > 0
        place = 4 * place + np.where(right, np.where(upper, 2, 3), upper)
        mirrored = right & ~upper
        column, row = (np.where(mirrored, cells - 1 - w, w) for w in (column, row))
        column, row = np.where(upper, column, row), np.where(upper, row, column)
        half >>= 1
    return place
