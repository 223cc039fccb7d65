"""The tree of the occupied cells of a grid: a bit a cell, built in linear time.

A cell's *key* has six bits a level, two of each axis, the coarsest first: a box of 4^L cells is the key of its cells
without the lowest 6 L bits, and the node above it has the key without six bits more. Nodes are laid out as
`cell_tree_kernel.py` says.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.fields.cell_tree_kernel import (
    CELLS,
    HEADER,
    MAX_CELLS,
    SIDE,
    STACK,
    cells_in_range,
    cells_on_way,
    lowest_cells,
    merge_cells,
    pack_cells,
)
from collide.fields.listings import listed
from collide.kernels import address_of
from collide.mesh.bvh import DEPTH, N_FACETS, NUMBERS_AT

#: Bits of a key a level, and of a word's coordinate.
_KEY_BITS, _WORD_BITS = 6, 16
#: The children of a node.
_OFFSETS = np.array(list(np.ndindex(SIDE, SIDE, SIDE)), dtype=np.int64)
#: Cells of a grid at most, free or not, along an axis and in all: results hold their numbers in 31 bits.
MAX_ALONG, MAX_NUMBER = MAX_CELLS, (1 << 31) - 1


class Boxes(NamedTuple):
    """Occupied boxes of cells: least cells (n, 3), cells along each axis (n, 3), numbers of the least cells (n,)."""

    least: np.ndarray
    size: np.ndarray
    numbers: np.ndarray


class _Run(NamedTuple):
    """Nodes of a level by key, and the bits of their children, int64."""

    keys: np.ndarray
    bits: np.ndarray


class Grid(NamedTuple):
    """Cells along each axis (3), indices of the least cell (3,) int64, and of the cell of indices 0 the least corner
    and the sides (3,) [m]."""

    shape: tuple[int, int, int]
    least: np.ndarray
    origin: np.ndarray
    sides: np.ndarray


class CellTree:
    """A tree over occupied boxes of cells.

    shape : cells along each axis.   least : (3,) int64, indices of the least cell, which cells are numbered from.
    origin, sides : (3,) least corner of the cell of indices 0, and sides of a cell [m].   nodes : bits, solid bits,
    first children, as the kernel reads them.
    count : occupied cells.   low, high : (3,) corners of the whole grid [m].   address : of the header for kernels,
    valid as long as the tree lives.
    """

    def __init__(self, grid: Grid, nodes: list[np.ndarray]):
        self.grid, self.nodes = grid, nodes
        self.shape, self.least, self.origin, self.sides = grid
        bits, solid, _ = nodes
        self.low, self.high = self.corners(np.zeros(3, dtype=np.int64), np.array(self.shape))
        centre, corner = 0.5 * self.low + 0.5 * self.high, np.maximum(np.abs(self.low), np.abs(self.high))
        radius = float(np.sqrt(np.square(0.5 * (self.high - self.low)).sum())) * (1.0 + 2.0**-50)
        self._numbers = np.concatenate([centre, corner, [radius], self.origin, self.sides])
        self.levels = levels_of(self.shape)
        self._header = np.zeros(HEADER, dtype=np.int64)
        self._header[[NUMBERS_AT, DEPTH]] = address_of(self._numbers), self.levels
        self._header[CELLS - 6 :] = (
            *map(address_of, nodes), len(solid), len(bits), self.levels, *self.shape, *self.least,
        )
        self.address = address_of(self._header)
        self.count = self._count()
        self._header[N_FACETS] = self.count

    def __reduce__(self):
        return CellTree, (self.grid, self.nodes)

    @property
    def depth(self) -> int:
        return self.levels

    @property
    def nbytes(self) -> int:
        """Bytes of the tree."""
        return sum(part.nbytes for part in self.nodes)

    def first_number(self) -> int:
        """The number of an occupied box."""
        bits, solid, first = self.nodes
        node, least = 0, np.zeros(3, dtype=np.int64)
        for level in range(self.levels - 1, -1, -1):
            bit = (int(bits[node]) & -int(bits[node])).bit_length() - 1
            least += np.array([bit >> 4, bit >> 2 & 3, bit & 3]) << 2 * level
            if level == 0 or int(solid[node]) >> bit & 1:
                break
            node = int(first[node])
        return int(numbers_of(least, self.shape))

    def boxes_in(self, low: np.ndarray, high: np.ndarray) -> Boxes:
        """Occupied boxes with cells within a range of cells (3,), both ends included, by number."""
        limits = np.array([np.maximum(low, 0), np.minimum(high, np.array(self.shape) - 1)], dtype=np.int64)
        stack, corners = np.empty(STACK, dtype=np.int64), (address_of(limits[0]), address_of(limits[1]))
        (words,) = listed(lambda *out: cells_in_range(self.address, *corners, *out, address_of(stack)), np.int64)
        return self._sorted(words)

    def range_of(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The least and largest cell that a box may reach [m], a cell more for what rounds."""
        with np.errstate(over="ignore"):
            ends = (np.array([low, high]) - self.origin) / self.sides - self.least
        ends = np.floor(np.clip(ends, -2.0, np.array(self.shape) + 2.0)).astype(np.int64)
        return ends[0] - 1, ends[1] + 1

    def on_way(self, way: np.ndarray, slack: float, limit: float, first: bool) -> tuple[Boxes, np.ndarray]:
        """(boxes, earliest t) on a way (6,), by t; arguments as of `cells_on_way`."""
        stack = np.empty(STACK, dtype=np.int64)
        words, times = listed(
            lambda *out: cells_on_way(self.address, address_of(way), slack, limit, first, *out, address_of(stack)),
            np.int64, np.float64,
        )
        order = np.lexsort((words, times))
        return self._boxes(words[order]), times[order]

    def lowest(self, normal: np.ndarray, slack: float) -> Boxes:
        """Occupied boxes that are higher along a normal (3,) than the lowest by no more than a slack [m], by number."""
        stack, normal = np.empty(STACK, dtype=np.int64), np.array(normal, dtype=np.float64)
        words, heights = listed(
            lambda *out: lowest_cells(self.address, address_of(normal), slack, *out, address_of(stack)),
            np.int64, np.float64,
        )
        return self._sorted(words[heights <= heights.min() + slack])

    def coarse_boxes(self, max_boxes: int) -> tuple[np.ndarray, np.ndarray]:
        """Corners (n, 3) of boxes that hold all cells: of the deepest level of nodes with no more than
        ``max_boxes``.
        """
        bits, solid, first = self.nodes
        least, node = np.zeros((1, 3), dtype=np.int64), np.zeros(1, dtype=np.int64)
        size = 1 << 2 * self.levels
        for level in range(self.levels - 1, -1, -1):
            row, bit = np.nonzero(bits[node][:, None] >> np.arange(64) & 1)
            if len(row) > max_boxes or level == 0 or solid[node].any():
                break
            size >>= 2
            least, node = least[row] + _OFFSETS[bit] * size, first[node[0]] + np.arange(len(row))
        return self.corners(least, np.minimum(least + size, self.shape) - least)

    def boxes_at(self, cells: np.ndarray) -> Boxes:
        """The occupied boxes that occupied cells (n, 3) lie in."""
        size = self._sizes(cells)
        least = cells - cells % size[:, None]
        return Boxes(least, np.repeat(size[:, None], 3, axis=1), numbers_of(least, self.shape))

    def is_occupied(self, cells: np.ndarray) -> np.ndarray:
        """(n,) bool, of cells (n, 3) within the grid or not."""
        inside = np.all((cells >= 0) & (cells < np.array(self.shape)), axis=1)
        sizes = self._sizes(np.where(inside[:, None], cells, 0).astype(np.int64))
        return inside & (sizes > 0)

    def _sizes(self, cells: np.ndarray) -> np.ndarray:
        """(n,) cells along a side of the occupied boxes that cells (n, 3) lie in, 0 of free ones."""
        bits, solid, first = self.nodes
        size, node = np.zeros(len(cells), dtype=np.int64), np.zeros(len(cells), dtype=np.int64)
        is_open = np.ones(len(cells), dtype=bool)
        for level in range(self.levels - 1, -1, -1):
            x, y, z = (cells >> 2 * level & 3).T
            bit = x << 4 | y << 2 | z
            is_solid = is_open & ((solid[node] if level else bits[node]) >> bit & 1 != 0)
            size[is_solid] = 1 << 2 * level
            is_open &= ~is_solid & (bits[node] >> bit & 1 != 0)
            if level:
                before = bits[node] & ~solid[node] & (np.int64(1) << bit) - 1
                node = np.where(is_open, first[node] + np.bitwise_count(before.view(np.uint64)), 0)
        return size

    def corners(self, least: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest corners (n, 3) of boxes of cells [m]."""
        low = self.least + least
        return low * self.sides + self.origin, (low + size) * self.sides + self.origin

    def _sorted(self, words: np.ndarray) -> Boxes:
        boxes = self._boxes(words)
        order = np.argsort(boxes.numbers)
        return Boxes(*(part[order] for part in boxes))

    def _boxes(self, words: np.ndarray) -> Boxes:
        axis = (1 << _WORD_BITS) - 1
        least = np.stack([words >> 2 * _WORD_BITS & axis, words >> _WORD_BITS & axis, words & axis], axis=1)
        n = np.int64(1) << 2 * (words >> 3 * _WORD_BITS)
        return Boxes(least, np.repeat(n[:, None], 3, axis=1), numbers_of(least, self.shape))

    def _count(self) -> int:
        bits, solid, _ = self.nodes
        n_inner, count, first, size = len(solid), 0, 0, SIDE**(3 * (self.levels - 1))
        end = 1
        while first < n_inner:
            count += size * int(np.bitwise_count(solid[first:end].view(np.uint64)).sum())
            stored = int(np.bitwise_count((bits[first:end] & ~solid[first:end]).view(np.uint64)).sum())
            first, end, size = end, end + stored, size >> 6
        return count + int(np.bitwise_count(bits[first:end].view(np.uint64)).sum())


def levels_of(shape: tuple[int, ...]) -> int:
    """Levels of the nodes of a grid."""
    return max(1, (max(shape) - 1).bit_length() + 1 >> 1)


def numbers_of(cells: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """(…,) numbers of cells (…, 3), x slowest."""
    return (cells[..., 0] * shape[1] + cells[..., 1]) * shape[2] + cells[..., 2]


def tree_of_array(occupied: np.ndarray, grid: Grid) -> CellTree:
    """The tree of an array (nx, ny, nz), a byte a cell, C-contiguous."""
    shape = grid.shape
    levels, n_nodes = levels_of(shape), int(np.prod([-(-n // SIDE) for n in shape]))
    keys, bits = np.empty(n_nodes, dtype=np.int64), np.empty(n_nodes, dtype=np.int64)
    n = pack_cells(address_of(occupied), *shape, levels, address_of(keys), address_of(bits))
    return _tree_of([_Run(keys[:n], bits[:n])], grid)


def tree_of_cubes(least: np.ndarray, exponents: np.ndarray, grid: Grid) -> CellTree:
    """The tree of cubes of 2^exponent cells along each axis, whose least cells (n, 3), counted from the grid's least,
    are multiples of as many; no larger cube than a cell is equal to another, and none lies within another.
    """
    levels = levels_of(grid.shape)
    for k in np.flatnonzero(exponents >= 2 * levels).tolist():  # a cube that is the whole grid: its parts are solid
        parts = least[k] + (_OFFSETS << int(exponents[k]) - 2)
        least, exponents = np.delete(least, k, axis=0), np.delete(exponents, k)
        least = np.concatenate([least, parts])
        exponents = np.concatenate([exponents, np.full(len(parts), 2 * levels - 2)])
    runs = [_run_of(np.sort(keys)) for keys in _keys_by_level(least, exponents, levels)]
    return _tree_of(runs, grid)


def cube_within(least: np.ndarray, exponents: np.ndarray) -> bool:
    """Whether one of some cubes lies within another, or is another, of cubes as of `tree_of_cubes` with cells < 2²⁰."""
    levels = int(exponents.max()) // 2 + 1
    by_level = _keys_by_level(least, exponents, levels)
    first = np.concatenate([keys << _KEY_BITS * level for level, keys in enumerate(by_level)])
    end = np.concatenate([keys + 1 << _KEY_BITS * level for level, keys in enumerate(by_level)])
    order = np.argsort(first)
    return bool((first[order][1:] < end[order][:-1]).any())


def _keys_by_level(least: np.ndarray, exponents: np.ndarray, levels: int) -> list[np.ndarray]:
    """Keys of the boxes of 4^level cells along each axis that cubes are made of, level by level."""
    keys, exponents_met = [], set(np.unique(exponents).tolist())
    for level in range(levels):
        if not exponents_met & {2 * level, 2 * level + 1}:
            keys.append(np.zeros(0, dtype=np.int64))
            continue
        cells = least[exponents == 2 * level] >> 2 * level
        twice = least[exponents == 2 * level + 1] >> 2 * level
        eighths = (twice[:, None] + np.array(list(np.ndindex(2, 2, 2)))).reshape(-1, 3)
        keys.append(_keys_of(np.concatenate([cells, eighths])))
    return keys


def free_cubes(tree: CellTree, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(least cells (n, 3), exponents (n,)) of cubes that are free, of the cells from ``low`` to before ``high``
    (3,).
    """
    bits, solid, first = tree.nodes
    least, node = np.zeros((1, 3), dtype=np.int64), np.zeros(1, dtype=np.int64)
    cubes, exponents = [], []
    cut = np.zeros((0, 3), dtype=np.int64)  # free cubes of a level that reach out of the range
    for level in range(tree.levels - 1, -1, -1):
        side = 1 << 2 * level
        row, bit = np.nonzero(~bits[node][:, None] >> np.arange(64) & 1)
        free = np.concatenate([least[row] + _OFFSETS[bit] * side, (cut[:, None] + _OFFSETS * side).reshape(-1, 3)])
        free = free[((free < high) & (free + side > low)).all(axis=1)]
        inside = ((free >= low) & (free + side <= high)).all(axis=1)
        cubes.append(free[inside])
        exponents.append(np.full(len(cubes[-1]), 2 * level))
        cut = free[~inside]
        if level:
            stored = bits[node] & ~solid[node]
            row, bit = np.nonzero(stored[:, None] >> np.arange(64) & 1)
            counts = np.bitwise_count(stored.view(np.uint64)).astype(np.int64)
            place = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
            least, node = least[row] + _OFFSETS[bit] * side, first[node][row] + place
    return np.concatenate(cubes), np.concatenate(exponents).astype(np.int64)


def merged_boxes(cells: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(least cells, sizes) (m, 3) of fewer boxes with the same union as boxes (n, 3), by a block around all of them."""
    low = cells.min(axis=0)
    block = np.zeros((cells + sizes).max(axis=0) - low, dtype=np.uint8)
    ones = (sizes == 1).all(axis=1)
    block[tuple((cells[ones] - low).T)] = 1
    for (x, y, z), (dx, dy, dz) in zip(cells[~ones] - low, sizes[~ones]):
        block[x : x + dx, y : y + dy, z : z + dz] = 1
    boxes = np.empty((int(np.count_nonzero(block)), 6), dtype=np.int64)
    n = merge_cells(address_of(block), *block.shape, address_of(boxes))
    return boxes[:n, :3] + low, boxes[:n, 3:].copy()


def _keys_of(cells: np.ndarray) -> np.ndarray:
    """Keys of cells (n, 3)."""
    keys = np.zeros(len(cells), dtype=np.int64)
    x, y, z = (np.ascontiguousarray(column) for column in cells.T)
    for level in range(int(cells.max(initial=0)).bit_length() + 1 >> 1):
        digit = (x >> 2 * level & 3) << 4 | (y >> 2 * level & 3) << 2 | z >> 2 * level & 3
        keys |= digit << _KEY_BITS * level
    return keys


def _run_of(keys: np.ndarray) -> _Run:
    """The nodes above boxes whose keys are given, ascending, maybe some twice."""
    parents = keys >> _KEY_BITS
    starts = np.flatnonzero(np.diff(parents, prepend=-1))
    bits = np.uint64(1) << (keys & 63).astype(np.uint64)
    joined = np.bitwise_or.reduceat(bits, starts) if len(keys) else bits
    return _Run(parents[starts], joined.view(np.int64))


def _tree_of(runs: list[_Run], grid: Grid) -> CellTree:
    """The tree of the occupied boxes of each level, the finest first."""
    bits, solid, keys = [runs[0].bits], [], runs[0].keys
    for level in range(1, levels_of(grid.shape)):
        stored = _run_of(keys)
        run = runs[level] if level < len(runs) else _Run(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
        keys = np.union1d(stored.keys, run.keys) if len(run.keys) else stored.keys
        of_stored, of_solid = _bits_at(stored, keys), _bits_at(run, keys)
        bits.append(of_stored | of_solid)
        solid.append(of_solid)
    all_solid = np.concatenate([np.empty(0, dtype=np.int64), *solid[::-1]])
    all_bits = np.concatenate(bits[::-1])
    counts = np.bitwise_count((all_bits[: len(all_solid)] & ~all_solid).view(np.uint64)).astype(np.int64)
    first = 1 + np.cumsum(counts) - counts
    return CellTree(grid, [all_bits, all_solid, first])


def _bits_at(run: _Run, keys: np.ndarray) -> np.ndarray:
    """The bits of a run's nodes among others."""
    out = np.zeros(len(keys), dtype=np.int64)
    out[np.searchsorted(keys, run.keys)] = run.bits
    return out
