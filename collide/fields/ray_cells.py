"""Cells of a grid that rays go through: J. Amanatides and A. Woo, "A fast voxel traversal algorithm" (1987)."""

from __future__ import annotations

import numpy as np

from collide.errors import InvalidShape
from collide.fields.ray_cells_kernel import walk_rays
from collide.kernels import address_of

#: Steps of all rays at most, before cells met twice are told.
_MAX_STEPS = 1 << 27


def cells_through(begins: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(m, 3) int64 cells, maybe some of them twice, that rays from places (n, 3) to places (n, 3) go through, in
    sides of a cell; the last cell of each is left out. O(cells met).

    Raises InvalidShape for rays through too many cells.
    """
    first, last = np.floor(begins), np.floor(ends)
    n = np.abs(last - first).sum(axis=1)
    if not n.sum() < _MAX_STEPS:
        raise InvalidShape(
            f"OcTree.from_rays: {len(n)} rays go through {n.sum():g} cells, and {_MAX_STEPS} are the most; take larger "
            "cells, a max_range, or fewer rays at once"
        )
    cells = np.empty((int(n.sum()), 3), dtype=np.int64)
    begins, ends = (np.ascontiguousarray(x, dtype=np.float64) for x in (begins, ends))
    walk_rays(address_of(begins), address_of(ends), len(begins), address_of(cells))
    return cells
