"""Highest heights over blocks of cells: a body above the highest height of a block meets no cell of the block."""

from __future__ import annotations

import numpy as np

#: Cells of a block along each axis.
BLOCK = 16


class HeightPyramid:
    """The cells of heights (r, c) without a corner of NaN.

    n_cells : how many cells there are.   highest : (⌈(r − 1)/16⌉, ⌈(c − 1)/16⌉) float64, the highest height of each
    block of 16 × 16 cells, −∞ of blocks of holes [m].   top : of all [m].
    """

    def __init__(self, heights: np.ndarray):
        self._heights, self._shape = heights, (heights.shape[0] - 1, heights.shape[1] - 1)
        rows, columns = self._shape
        self.highest = np.empty((-(-rows // BLOCK), -(-columns // BLOCK)))
        starts, counts = np.arange(0, columns, BLOCK), np.empty(rows, dtype=np.int64)
        for k in range(len(self.highest)):
            begin, end = BLOCK * k, min(BLOCK * (k + 1), rows)
            highest = self.cell_heights(slice(begin, end), slice(0, columns))
            counts[begin:end] = np.count_nonzero(highest > -np.inf, axis=1)
            self.highest[k] = np.maximum.reduceat(highest.max(axis=0), starts)
        self._before = np.concatenate([[0], np.cumsum(counts)])
        self.n_cells = int(self._before[-1])
        self.top = float(self.highest.max())

    def cell_heights(self, rows: slice, columns: slice) -> np.ndarray:
        """The highest corner of each cell of a rectangle, −∞ of holes [m]."""
        heights = self._heights[rows.start : rows.stop + 1, columns.start : columns.stop + 1]
        along = np.maximum(heights[:, :-1], heights[:, 1:])  # NaN wins
        highest = np.maximum(along[:-1], along[1:])
        return np.where(np.isnan(highest), -np.inf, highest)

    def numbers_of(self, cells: np.ndarray) -> np.ndarray:
        """(n,) numbers among the cells that are no holes, of cells numbered row by row, ascending."""
        rows, columns = self._shape
        if self.n_cells == rows * columns:
            return cells
        row, numbers = cells // columns, np.empty(len(cells), dtype=np.int64)
        for i in np.unique(row).tolist():
            of_row, some = self._of_row(i), row == i
            numbers[some] = self._before[i] + np.searchsorted(of_row, cells[some] - i * columns)
        return numbers

    def cells_of(self, numbers: np.ndarray) -> np.ndarray:
        """The inverse of `numbers_of`, of numbers (…,) in any order."""
        rows, columns = self._shape
        if self.n_cells == rows * columns:
            return numbers
        row, cells = np.searchsorted(self._before, numbers, side="right") - 1, np.empty_like(numbers)
        for i in np.unique(row).tolist():
            some = row == i
            cells[some] = i * columns + self._of_row(i)[numbers[some] - self._before[i]]
        return cells

    def _of_row(self, i: int) -> np.ndarray:
        """Columns of the cells of a row that are no holes."""
        return np.flatnonzero(self.cell_heights(slice(i, i + 1), slice(0, self._shape[1]))[0] > -np.inf)
