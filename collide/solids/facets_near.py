"""Facets whose boxes come near those of facets asked about: by a grid of cells, in a kernel."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i32, view_u8
from collide.numerics.vec3 import Vec3, max_abs, sub, vec3_at

#: Cells of the grid, for each facet asked, and cells that facets fill, at most; cells of a facet that is taken unseen.
CELLS, _FILLED, _MAX_SEEN = 128, 256, 512


class _Grid(NamedTuple):
    """A box from ``low`` on in cells of one size: ``per_unit`` cells a unit of length, (x, y, z) of them."""

    low: Vec3
    high: Vec3
    per_unit: float
    x: int
    y: int
    z: int


@kernel
def _grid_of(low, high, size):
    """Cells of a size over a box."""
    d = sub(high, low)
    per_unit = 1.0 / size
    return _Grid(low, high, per_unit, int(d.x * per_unit) + 1, int(d.y * per_unit) + 1, int(d.z * per_unit) + 1)


@kernel
def _box(vertices, faces, t):
    """(lower, upper corner) of the box around a facet."""
    a, b = vec3_at(vertices, 3 * faces[3 * t]), vec3_at(vertices, 3 * faces[3 * t + 1])
    c = vec3_at(vertices, 3 * faces[3 * t + 2])
    low = Vec3(min(a.x, b.x, c.x), min(a.y, b.y, c.y), min(a.z, b.z, c.z))
    return low, Vec3(max(a.x, b.x, c.x), max(a.y, b.y, c.y), max(a.z, b.z, c.z))


@kernel
def _cell(x, low, per_unit, n):
    """The cell of a coordinate: rounding keeps the order, so meeting boxes share a cell."""
    return int(min(max((x - low) * per_unit, 0.0), n - 1.0))


@kernel
def _span(grid, low, high):
    """The cells that a box reaches from, three, and to, three."""
    return (
        _cell(low.x, grid.low.x, grid.per_unit, grid.x), _cell(low.y, grid.low.y, grid.per_unit, grid.y),
        _cell(low.z, grid.low.z, grid.per_unit, grid.z), _cell(high.x, grid.low.x, grid.per_unit, grid.x),
        _cell(high.y, grid.low.y, grid.per_unit, grid.y), _cell(high.z, grid.low.z, grid.per_unit, grid.z),
    )


@kernel
def _around(vertices, faces, taken, n_faces):
    """(lower, upper corner of the box around all facets asked, the sum of their largest extents)."""
    low = Vec3(math.inf, math.inf, math.inf)
    high = Vec3(-math.inf, -math.inf, -math.inf)
    total = 0.0
    for t in range(n_faces):
        if taken[t] != 0:
            a, b = _box(vertices, faces, t)
            low = Vec3(min(low.x, a.x), min(low.y, a.y), min(low.z, a.z))
            high = Vec3(max(high.x, b.x), max(high.y, b.y), max(high.z, b.z))
            total += max_abs(sub(b, a))
    return low, high, total


@kernel
def _fill(grid, vertices, faces, taken, n_faces, cells, budget):
    """Mark the cells of all facets asked; False where these are more than the budget, each facet's counted."""
    for k in range(grid.x * grid.y * grid.z):
        cells[k] = 0
    for t in range(n_faces):
        if taken[t] != 0:
            a, b = _box(vertices, faces, t)
            x, y, z, u, v, w = _span(grid, a, b)
            budget -= (u + 1 - x) * (v + 1 - y) * (w + 1 - z)
            if budget < 0:
                return False
            for i in range(x, u + 1):
                for j in range(y, v + 1):
                    for k in range(z, w + 1):
                        cells[(i * grid.y + j) * grid.z + k] = 1
    return True


@kernel
def _comes_near(grid, cells, low, high):
    """Whether a box reaches a marked cell, or more than `_MAX_SEEN` cells."""
    if low.x > grid.high.x or low.y > grid.high.y or low.z > grid.high.z:
        return False
    if high.x < grid.low.x or high.y < grid.low.y or high.z < grid.low.z:
        return False
    x, y, z, u, v, w = _span(grid, low, high)
    if (u + 1 - x) * (v + 1 - y) * (w + 1 - z) > _MAX_SEEN:
        return True
    for i in range(x, u + 1):
        for j in range(y, v + 1):
            for k in range(z, w + 1):
                if cells[(i * grid.y + j) * grid.z + k] != 0:
                    return True
    return False


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64)")
def take_near(vertices_at, n_vertices, faces_at, n_faces, taken_at, n_asked, cells_at, n_cells):
    """Mark facets whose boxes might meet the boxes of marked facets, n of them, as 2.

    faces : (m, 3) int32.   taken : (m,) uint8, 1 for facets asked.   cells : workspace. O(m), a grid of cells as large
    as the facets asked are on average, or larger where these fill too many.
    """
    vertices, faces = view_f64(vertices_at, 3 * n_vertices), view_i32(faces_at, 3 * n_faces)
    taken, cells = view_u8(taken_at, n_faces), view_u8(cells_at, n_cells)
    low, high, total = _around(vertices, faces, taken, n_faces)
    extent = max_abs(sub(high, low))
    size = max(total / n_asked, 2.0**-9 * extent, 1e-250)
    grid = _grid_of(low, high, size)
    while grid.x * grid.y * grid.z > n_cells or not _fill(
        grid, vertices, faces, taken, n_faces, cells, _FILLED * n_asked
    ):
        size *= 1.5
        grid = _grid_of(low, high, size)
    for t in range(n_faces):
        if taken[t] == 0:
            a, b = _box(vertices, faces, t)
            taken[t] = 2 if _comes_near(grid, cells, a, b) else 0
