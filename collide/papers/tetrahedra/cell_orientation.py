"""Which way round tetrahedra run, exactly for any finite doubles."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, view_f64, view_i32, view_i64
from collide.numerics.orientation import DIGITS, WORK, CloudView, orientation, survey


def signs(vertices: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(m,) int32: 1 where corner 3 of a cell sees corners 0, 1, 2 counter-clockwise, 0 where it has no volume, else −1.

    vertices (n, 3) float64 and cells (m, 4) int32, both C-contiguous.
    """
    result = np.empty(len(cells), dtype=np.int32)
    scaled, work, digits = np.empty_like(vertices), np.zeros(WORK), np.empty(DIGITS, dtype=np.int64)
    orient_cells(
        address_of(vertices), address_of(scaled), len(vertices), address_of(cells), len(cells), address_of(work),
        address_of(digits), address_of(result),
    )
    return result


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64)")
def orient_cells(vertices_at, scaled_at, n, cells_at, m, work_at, digits_at, signs_at):
    """Signs of the cells' volumes."""
    vertices = view_f64(vertices_at, 3 * n)
    scaled = view_f64(scaled_at, 3 * n)
    cells = view_i32(cells_at, 4 * m)
    work = view_f64(work_at, WORK)
    result = view_i32(signs_at, m)
    exponent = survey(vertices, scaled, n, work)
    cloud = CloudView(scaled, vertices, work, view_i64(digits_at, DIGITS), 0, exponent)
    for cell in range(m):
        k = 4 * cell
        result[cell] = orientation(cloud, int(cells[k]), int(cells[k + 1]), int(cells[k + 2]), int(cells[k + 3]), -1)
