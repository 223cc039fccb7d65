"""The cells of large terrain as items, each a column from the bottom to its surface; triangles of some at a time.

Items nearby become a closed mesh of the rectangle around them, whose walls stand within the terrain or are its own. So
whatever stays within the rectangle meets the mesh as it meets the terrain.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import cached_property
from typing import NamedTuple

import numpy as np

from collide.fields import terrain_kernel
from collide.fields.height_pyramid import BLOCK
from collide.fields.terrain_surface import surface_of
from collide.kernels import address_of
from collide.mesh.bvh import DEPTH, N_FACETS, NUMBERS_AT
from collide.narrowphase.facets.nearest_item_calls import PRISMS, Items
from collide.narrowphase.fields.field_items import BoxAround, FieldItems, NamedUnion
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.height_field import HeightField
from collide.shapes.mesh import Mesh

#: Rectangles of no more cells than so many times those asked about are taken whole, and of so few in any case.
_SPARE, _MAX_WHOLE = 4, 4096
#: Meshes kept: bodies move little between queries. Corners of rectangles are multiples of so many cells.
_MAX_MESHES, _STEP = 32, 8
#: Cells of a tile along each axis, for rays, and tiles kept.
_TILE, _MAX_TILES = 32, 1024
#: Of more cells as low as each other ends of rows are taken; how much of a normal points up at least.
_MAX_LEVEL, _UPRIGHT = 1024, 2.0**-30
#: How far next to a facet is, in sides of a cell: far above rounding.
_NEXT = 2.0**-10


class _Rectangle(NamedTuple):
    """Rows and columns of cells from the first to before the last."""

    row: int
    column: int
    last_row: int
    last_column: int


class _Prisms:
    """Terrain for kernels.   address : of the header of `fields/terrain_kernel.py`, valid as long as this lives."""

    depth = 1

    def __init__(self, field: HeightField):
        x, y = (np.ascontiguousarray(line) for line in field.grid_lines)
        heights, tops = np.ascontiguousarray(field.heights), np.ascontiguousarray(field.pyramid.highest)
        low, high = np.array([x[0], y[0], field.bottom]), np.array([x[-1], y[-1], field.pyramid.top])
        corner = np.maximum(np.abs(low), np.abs(high))
        radius = 0.5 * float(np.linalg.norm(high - low)) * (1.0 + 2.0**-50)
        numbers = np.concatenate([0.5 * low + 0.5 * high, corner, [radius, field.bottom]])
        self.reach = float(np.linalg.norm(corner)) * (1.0 + 2.0**-50)
        self._header, self._held = np.zeros(terrain_kernel.HEADER, dtype=np.int64), (x, y, heights, tops, numbers)
        self._header[[NUMBERS_AT, DEPTH, N_FACETS]] = address_of(numbers), self.depth, 2 * field.pyramid.n_cells
        rows, columns = heights.shape[0] - 1, heights.shape[1] - 1
        self._header[terrain_kernel.HEIGHTS_AT :] = (
            *map(address_of, (heights, x, y, tops)), rows, columns, tops.shape[1],
        )
        self.address = address_of(self._header)


class Columns(FieldItems):
    """The cells of a height field that are no holes, numbered row by row, holes counted in."""

    is_one_part = names_are_changed = True

    def __init__(self, field: HeightField):
        self._pyramid, self._heights, self._bottom = field.pyramid, field.heights, field.bottom
        self._x, self._y = field.grid_lines
        self._rows, self._columns = field.heights.shape[0] - 1, field.heights.shape[1] - 1
        self.low = np.array([self._x[0], self._y[0], self._bottom])
        self.high = np.array([self._x[-1], self._y[-1], self._pyramid.top])
        prisms = _Prisms(field)
        self.walked = Items(prisms, prisms.reach, False, are=PRISMS)
        self._mesh_cache: dict[_Rectangle, NamedUnion] = {}
        self._tile_cache: dict[_Rectangle, NamedUnion] = {}
        tops, n = field.pyramid.highest, _TILE // BLOCK
        padded = np.full((-(-tops.shape[0] // n) * n, -(-tops.shape[1] // n) * n), -math.inf)
        padded[: tops.shape[0], : tops.shape[1]] = tops
        highest = padded.reshape(padded.shape[0] // n, n, -1, n).max(axis=(1, 3))
        self._tiles = np.argwhere(highest > -math.inf)
        self._tile_tops = highest[tuple(self._tiles.T)]

    def every(self) -> np.ndarray:
        return self._in_rectangle(_Rectangle(0, 0, self._rows, self._columns), None, math.inf)

    def within(self, box: BoxAround, distance: float) -> np.ndarray:
        distance = box.reach(distance)
        low, high = box.low - distance, box.high + distance
        column, last_column = (int(k) for k in np.searchsorted(self._x, (low[0], high[0])))
        row, last_row = (int(k) for k in np.searchsorted(self._y, (low[1], high[1])))
        if low[0] > self._x[-1] or high[0] < self._x[0] or low[1] > self._y[-1] or high[1] < self._y[0]:
            return np.empty(0, dtype=np.int64)
        around = _Rectangle(
            max(row - 2, 0), max(column - 2, 0), min(last_row + 1, self._rows), min(last_column + 1, self._columns)
        )
        return self._in_rectangle(around, box, distance)

    def nearest(self, box: BoxAround) -> np.ndarray:
        """The column whose box is nearest to a box, by the block nearest to it."""
        least, low, high = self._blocks
        cells = self._cells_of_block(least[int(np.argmin(self._away(box, low, high)))])
        at = np.stack([cells // self._columns, cells % self._columns], axis=1)
        return cells[[int(np.argmin(self._away(box, *self._corners(at, 1, self._highest(at)))))]]

    @cached_property
    def _blocks(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(n, 2) the least row and column of every block with a cell, and the corners (n, 3) of its box."""
        blocks = np.argwhere(self._pyramid.highest > -math.inf)
        return blocks * BLOCK, *self._corners(blocks * BLOCK, BLOCK, self._pyramid.highest[tuple(blocks.T)])

    def _in_blocks(self, least: np.ndarray) -> np.ndarray:
        """(k, 2) rows and columns of the cells of blocks by their least rows and columns (n, 2), holes counted in."""
        inside = (least[:, None] + np.array(list(np.ndindex(BLOCK, BLOCK)))).reshape(-1, 2)
        return inside[(inside < (self._rows, self._columns)).all(axis=1)]

    def _cells_of_block(self, least: np.ndarray) -> np.ndarray:
        """The cells of a block by its least row and column, ascending."""
        row, column = least.tolist()
        around = _Rectangle(row, column, min(row + BLOCK, self._rows), min(column + BLOCK, self._columns))
        return self._in_rectangle(around, None, math.inf)

    def _in_rectangle(self, around: _Rectangle, box: BoxAround | None, distance: float) -> np.ndarray:
        """Cells of a rectangle whose columns come within a distance of a box [m], or all, ascending."""
        if around.row >= around.last_row or around.column >= around.last_column:
            return np.empty(0, dtype=np.int64)
        cells = []
        for begin in range(around.row // BLOCK * BLOCK, around.last_row, BLOCK):
            rows = slice(max(begin, around.row), min(begin + BLOCK, around.last_row))
            columns = slice(around.column, around.last_column)
            if box is not None:
                first, last = columns.start // BLOCK, (columns.stop - 1) // BLOCK + 1
                blocks = np.column_stack([np.full(last - first, begin), np.arange(first, last) * BLOCK])
                highest = self._pyramid.highest[begin // BLOCK, first:last]
                near = np.flatnonzero(self._away(box, *self._corners(blocks, BLOCK, highest)) <= distance)
                if not len(near):
                    continue
                columns = slice(
                    max((first + int(near[0])) * BLOCK, columns.start),
                    min((first + int(near[-1]) + 1) * BLOCK, columns.stop),
                )
            at = np.argwhere(self._pyramid.cell_heights(rows, columns) > -math.inf)
            at = np.add(at, (rows.start, columns.start))
            if box is not None:
                at = at[self._away(box, *self._corners(at, 1, self._highest(at))) <= distance]
            cells.append(at[:, 0] * self._columns + at[:, 1])
        return np.concatenate(cells) if cells else np.empty(0, dtype=np.int64)

    def _highest(self, at: np.ndarray) -> np.ndarray:
        """(n,) the highest corners of cells by row and column (n, 2) [m]."""
        row, column, heights = at[:, 0], at[:, 1], self._heights
        return np.maximum(
            np.maximum(heights[row, column], heights[row, column + 1]),
            np.maximum(heights[row + 1, column], heights[row + 1, column + 1]),
        )

    @staticmethod
    def _away(box: BoxAround, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """(n,) lower bounds of the distance of a box from boxes (n, 3) [m]."""
        gaps = np.maximum(np.maximum(low - box.high, box.low - high), 0.0)
        return np.sqrt(np.square(gaps).sum(axis=1)) * (1.0 - 2.0**-40)

    def on_way(self, way: np.ndarray, limit: float, extra: float, slack: float, first: bool):
        reach = extra + slack
        least, low, high = self._blocks
        least = least[_times(way, low - reach, high + reach, limit) < math.inf]
        inside = self._in_blocks(least)
        row, column, highest = inside[:, 0], inside[:, 1], self._highest(inside)
        low, high = self._corners(inside, 1, highest)
        times = np.where(np.isnan(highest), math.inf, _times(way, low - reach, high + reach, limit))
        met = times < math.inf
        cells, times = (row * self._columns + column)[met], times[met]
        order = np.lexsort((cells, times))
        return cells[order], times[order]

    def _corners(self, least: np.ndarray, size: int, highest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Corners (n, 3) of boxes around the columns of blocks of cells, from the least row and column (n, 2)."""
        last = np.minimum(least + size, (self._rows, self._columns))
        low = np.column_stack([self._x[least[:, 1]], self._y[least[:, 0]], np.full(len(least), self._bottom)])
        return low, np.column_stack([self._x[last[:, 1]], self._y[last[:, 0]], highest])

    def lowest(self, n: np.ndarray, slack: float) -> np.ndarray:
        blocks, low, high = self._blocks
        bounds = np.minimum(n * low, n * high).sum(axis=1)
        order, least, lowest, some = np.argsort(bounds, kind="stable"), math.inf, [], 1
        while len(order) and bounds[order[0]] <= least + slack:
            cells = self._in_blocks(blocks[order[:some]]) @ (self._columns, 1)
            heights = self._least_heights(cells, n)  # of holes NaN
            least = min(least, float(np.nanmin(heights)))
            lowest.append((cells, heights))
            order, some = order[some:], 4 * some
        cells, heights = (np.concatenate(part) for part in zip(*lowest))
        return np.sort(cells[heights <= least + slack])

    def extreme(self, n: np.ndarray, slack: float) -> np.ndarray:
        """As of the class: cells are left out whose corners lie between corners of other cells: of a bottom without
        holes all but those in its corners, of cells in a row of level ground all but the first and the last.
        """
        last = self._rows * self._columns - 1
        is_upright = n[2] > _UPRIGHT * np.abs(n).max()  # corners of the bottom are lower than those above
        if is_upright and self._pyramid.n_cells == last + 1:
            return np.unique([0, self._columns - 1, last - self._columns + 1, last])
        cells = self.lowest(n, slack)
        if len(cells) <= _MAX_LEVEL:
            return cells
        row, column = cells // self._columns, cells % self._columns
        is_inner = np.zeros(len(cells), dtype=bool)
        is_inner[1:-1] = (cells[2:] - cells[:-2] == 2) & (column[1:-1] > 0) & (column[1:-1] < self._columns - 1)
        if not is_upright:
            at = np.flatnonzero(is_inner)
            rows, columns = np.ix_(range(2), range(-1, 3))
            corners = self._heights[row[at, None, None] + rows, column[at, None, None] + columns]
            is_inner[at] = (corners == corners[:, :1, :1]).all(axis=(1, 2))
        return cells[~is_inner]

    def _least_heights(self, cells: np.ndarray, n: np.ndarray) -> np.ndarray:
        """(k,) of the corners of columns along a normal [m]."""
        row, column = cells // self._columns, cells % self._columns
        least = np.full(len(cells), math.inf)
        for i in (0, 1):
            for j in (0, 1):
                across = n[0] * self._x[column + j] + n[1] * self._y[row + i]
                z = n[2] * self._heights[row + i, column + j]
                least = np.minimum(least, across + np.minimum(z, n[2] * self._bottom))
        return least

    def least_height(self, number: int, n: np.ndarray) -> float:
        return float(self._least_heights(np.array([number]), n)[0])

    def hulls(self, some: np.ndarray) -> list[ConvexHull]:
        raise NotImplementedError("columns are no convex sets")

    def hidden(self, numbers: np.ndarray, p_F: np.ndarray, n_F: np.ndarray) -> np.ndarray:
        p = p_F + _NEXT * min(self._x[1] - self._x[0], self._y[1] - self._y[0]) * n_F
        column, row = np.searchsorted(self._x, p[:, 0]) - 1, np.searchsorted(self._y, p[:, 1]) - 1
        inside = (column >= 0) & (column < self._columns) & (row >= 0) & (row < self._rows) & (p[:, 2] > self._bottom)
        row, column, z = np.where(inside, row, 0), np.where(inside, column, 0), self._heights
        u = (p[:, 0] - self._x[column]) / (self._x[column + 1] - self._x[column])
        v = (p[:, 1] - self._y[row]) / (self._y[row + 1] - self._y[row])
        first, last = z[row, column], z[row + 1, column + 1]
        corner = np.where(u >= v, z[row, column + 1], z[row + 1, column])
        height = first + np.maximum(u, v) * (corner - first) + np.minimum(u, v) * (last - corner)
        return (numbers < 0) & inside & (p[:, 2] < height)  # NaN is no height

    def names_of_walked(self, rows: np.ndarray, X_WG: np.ndarray) -> np.ndarray:
        """Facets of the top are numbered without holes; −1 for walls and bottom, whose normals do not point up, and for
        the upper rim of walls along a level normal.
        """
        is_top = np.einsum("ni,ni->n", rows["normal"], X_WG[:, :3, 2]) > _UPRIGHT
        is_top |= rows["hit"]
        cell, triangle = np.divmod(rows["part_a"], 2)
        return np.where(is_top, 2 * self._pyramid.numbers_of(cell.astype(np.int64)) + triangle, -1)

    def some(self) -> np.ndarray:
        row, column = (np.argwhere(self._pyramid.highest > -math.inf)[0] * BLOCK).tolist()
        block = _Rectangle(row, column, min(row + BLOCK, self._rows), min(column + BLOCK, self._columns))
        return self._in_rectangle(block, None, math.inf)[:1]

    def union_of(self, some: np.ndarray) -> NamedUnion:
        """A mesh of the rectangle around some cells, or, where these are few among many, of the cells themselves."""
        around = self._around(some)
        n = (around.last_row - around.row) * (around.last_column - around.column)
        if n > max(_SPARE * len(some), _MAX_WHOLE):
            return self._mesh(around, some)
        union = self._mesh_cache.get(around)
        if union is None:
            union = self._mesh(around, None)
            _keep(self._mesh_cache, around, union, _MAX_MESHES)
        return union

    def tiles_on_rays(
        self, origins: np.ndarray, vectors: np.ndarray, limits: np.ndarray, slack: float
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """The tiles (k,) on the way of each ray, and when the ray enters each at the earliest (k,), by t.

        origins, vectors : (n, 3) in the terrain's frame.   limits : of t (n,).   slack : of places [m].
        """
        low, high = self._corners(self._tiles * _TILE, _TILE, self._tile_tops)
        tiles = []
        for origin, vector, limit in zip(origins, vectors, limits.tolist()):
            times = _times(np.concatenate([origin, vector]), low - slack, high + slack, limit)
            met = np.flatnonzero(times < math.inf)
            order = met[np.argsort(times[met], kind="stable")]
            tiles.append((order, times[order]))
        return tiles

    def tile(self, number: int) -> NamedUnion:
        """The surface of a tile, walls and bottom of the terrain included."""
        row, column = (self._tiles[number] * _TILE).tolist()
        around = _Rectangle(row, column, min(row + _TILE, self._rows), min(column + _TILE, self._columns))
        tile = self._tile_cache.get(around)
        if tile is None:
            tile = self._mesh(around, None, solid=False)
            _keep(self._tile_cache, around, tile, _MAX_TILES)
        return tile

    def _around(self, some: np.ndarray) -> _Rectangle:
        row, column = some // self._columns, some % self._columns
        return _Rectangle(
            int(row.min()) // _STEP * _STEP, int(column.min()) // _STEP * _STEP,
            min(-(-(int(row.max()) + 1) // _STEP) * _STEP, self._rows),
            min(-(-(int(column.max()) + 1) // _STEP) * _STEP, self._columns),
        )

    def _mesh(self, around: _Rectangle, some: np.ndarray | None, *, solid: bool = True) -> NamedUnion:
        row, column, last_row, last_column = around
        rows, columns = slice(row, last_row + 1), slice(column, last_column + 1)
        left_out = None
        if some is not None:
            left_out = np.ones((last_row - row, last_column - column), dtype=bool)
            left_out[some // self._columns - row, some % self._columns - column] = False
        surface = surface_of(
            self._heights[rows, columns], self._x[columns], self._y[rows], self._bottom, left_out,
            None if solid else self._cells_around(around),
        )
        local = surface.cells
        cells = (local // (last_column - column) + row) * self._columns + local % (last_column - column) + column
        numbers = np.full(len(surface.faces), -1, dtype=np.int64)
        tops = 2 * len(cells)
        numbers[:tops] = np.repeat(2 * self._pyramid.numbers_of(cells), 2) + np.tile([0, 1], len(cells))
        if solid:
            return NamedUnion(Mesh._known(surface.vertices, surface.faces, True), numbers, names_facets=True)
        return NamedUnion(Mesh(surface.vertices, surface.faces, solid=False), numbers, names_facets=True)

    def _cells_around(self, rectangle: _Rectangle) -> np.ndarray:
        """Whether cells of a rectangle, and of a row and a column more on each side, are the terrain's."""
        row, column, last_row, last_column = rectangle
        first = max(row - 1, 0), max(column - 1, 0)
        last = min(last_row + 1, self._rows), min(last_column + 1, self._columns)
        around = np.zeros((last_row - row + 2, last_column - column + 2), dtype=bool)
        at = first[0] - row + 1, first[1] - column + 1
        heights = self._pyramid.cell_heights(slice(first[0], last[0]), slice(first[1], last[1]))
        around[at[0] : at[0] + heights.shape[0], at[1] : at[1] + heights.shape[1]] = heights > -math.inf
        return around


def _keep(cache: dict, key, value, max_items: int) -> None:
    """The last few are kept; threads may keep the same twice."""
    while len(cache) >= max_items:
        with suppress(StopIteration, RuntimeError):
            cache.pop(next(iter(cache)), None)
    cache[key] = value


def _times(way: np.ndarray, low: np.ndarray, high: np.ndarray, limit: float) -> np.ndarray:
    """(n,) when a way from a place along a vector (6,) enters boxes (n, 3) at the earliest; ∞ where it does not."""
    begin, end = np.zeros(len(low)), np.full(len(low), limit)
    for axis in range(3):
        l, h, v = low[:, axis] - way[axis], high[:, axis] - way[axis], way[3 + axis]
        if v == 0.0:
            end[(l > 0.0) | (h < 0.0)] = -1.0
            continue
        a, b = l / v, h / v
        begin, end = np.maximum(begin, np.minimum(a, b)), np.minimum(end, np.maximum(a, b))
    return np.where(begin <= end * (1.0 + 2.0**-40), begin * (1.0 - 2.0**-40), math.inf)
