"""Terrain as kernels see it: heights over a grid, the highest heights of blocks of cells, and prisms below triangles.

A prism has the number 2 · (row · columns + column) + triangle: its cell is cut from the first corner to the opposite
corner, the first triangle towards +x.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.fields.height_pyramid import BLOCK
from collide.kernels import kernel, view_f64, view_i64
from collide.mesh.bvh import INTS, NUMBERS, NUMBERS_AT, Box
from collide.numerics.vec3 import Vec3, add, scale, sub

#: Cells of a block along each axis.
ALONG = BLOCK
# Header behind the words of `mesh/bvh.py`: addresses of heights, of x and y of grid points, of highest heights of
# blocks; cells along y and x, blocks along x. A number behind those: the bottom [m].
HEIGHTS_AT, X_AT, Y_AT, TOPS_AT, ROWS, COLUMNS, N_ACROSS = range(INTS, INTS + 7)
HEADER = N_ACROSS + 1
BOTTOM = NUMBERS
N_NUMBERS = NUMBERS + 1


class TerrainView(NamedTuple):
    """heights : (rows + 1, columns + 1).   x, y : of grid points.   tops : of blocks, −∞ of holes.   n_across : blocks
    along x."""

    heights: Any
    x: Any
    y: Any
    tops: Any
    rows: int
    columns: int
    n_across: int
    bottom: float


class BlockRange(NamedTuple):
    """Blocks from the first to the last row and column, both included."""

    row: int
    column: int
    last_row: int
    last_column: int


@kernel(inline=True)
def open_terrain(header_at):
    """The terrain whose header stands at an address."""
    header = view_i64(header_at, HEADER)
    rows, columns, n_across = header[ROWS], header[COLUMNS], header[N_ACROSS]
    n_blocks = n_across * ((rows + ALONG - 1) // ALONG)
    return TerrainView(
        view_f64(header[HEIGHTS_AT], (rows + 1) * (columns + 1)), view_f64(header[X_AT], columns + 1),
        view_f64(header[Y_AT], rows + 1), view_f64(header[TOPS_AT], n_blocks), rows, columns, n_across,
        view_f64(header[NUMBERS_AT], N_NUMBERS)[BOTTOM],
    )


@kernel(inline=True)
def _height(terrain, row, column):
    return terrain.heights[row * (terrain.columns + 1) + column]


@kernel
def top_of_cell(terrain, row, column):
    """The highest corner of a cell; −∞ of a hole [m]."""
    a, b = _height(terrain, row, column), _height(terrain, row, column + 1)
    c, d = _height(terrain, row + 1, column), _height(terrain, row + 1, column + 1)
    if math.isnan(a) or math.isnan(b) or math.isnan(c) or math.isnan(d):
        return -math.inf
    return max(max(a, b), max(c, d))


@kernel
def box_of_cells(terrain, row, column, n, top):
    """The box around the columns of n × n cells from a row and a column on, up to a height; of holes half a side of
    −∞. Rounding of the middle is less than that of gaps.
    """
    last_row, last_column = min(row + n, terrain.rows), min(column + n, terrain.columns)
    low = Vec3(terrain.x[column], terrain.y[row], terrain.bottom)
    high = Vec3(terrain.x[last_column], terrain.y[last_row], top)
    return Box(scale(0.5, add(low, high)), scale(0.5, sub(high, low)))


@kernel
def corner_of_prism(terrain, number, k):
    """Corner 0 to 2 of the triangle of a prism; 3 to 5 are those below [m]."""
    cell, corner = number // 2, k % 3
    row, column = cell // terrain.columns, cell % terrain.columns
    if corner == 1:
        row, column = (row, column + 1) if number % 2 == 0 else (row + 1, column + 1)
    elif corner == 2:
        row, column = (row + 1, column + 1) if number % 2 == 0 else (row + 1, column)
    return Vec3(terrain.x[column], terrain.y[row], _height(terrain, row, column) if k < 3 else terrain.bottom)


@kernel
def _blocks_along(lines, n, low, high):
    """(first, last) block of an axis of n cells in reach of an interval; the nearest block of an interval outside."""
    step = (lines[n] - lines[0]) / n
    begin, end = max(low, lines[0]), min(high, lines[n])
    first = int(min(max((begin - lines[0]) / step - 1.0, 0.0), n - 1.0))
    last = int(min(max((end - lines[0]) / step + 1.0, 0.0), n - 1.0))
    return first // ALONG, max(last, first) // ALONG


@kernel
def blocks_within(terrain, low, high, distance):
    """The `BlockRange` with all blocks that come within a distance of a box of corners low, high, sideways [m]; a cell
    more on each side for what rounds.
    """
    row, last_row = _blocks_along(terrain.y, terrain.rows, low.y - distance, high.y + distance)
    column, last_column = _blocks_along(terrain.x, terrain.columns, low.x - distance, high.x + distance)
    return BlockRange(row, column, last_row, last_column)
