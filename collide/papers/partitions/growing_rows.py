"""Arrays that rows are added to."""

from __future__ import annotations

import numpy as np


class GrowingRows:
    """An array that grows at its end; room is doubled where it runs out.

    rows : (n, …), a view of what is there: rows written through it stay.
    """

    def __init__(self, dtype, *shape: int):
        self._storage = np.zeros((1024, *shape), dtype=dtype)
        self.n = 0

    @property
    def rows(self) -> np.ndarray:
        return self._storage[: self.n]

    @property
    def n_bytes(self) -> int:
        """Bytes of the rows there are."""
        return self.rows.nbytes

    def add(self, rows: np.ndarray) -> np.ndarray:
        """Add rows; returns their numbers."""
        end = self.n + len(rows)
        if end > len(self._storage):
            storage = np.zeros((max(end, 2 * len(self._storage)), *self._storage.shape[1:]), dtype=self._storage.dtype)
            storage[: self.n] = self.rows
            self._storage = storage
        self._storage[self.n : end] = rows
        begin, self.n = self.n, end
        return np.arange(begin, end)

    def cut_back(self, n: int) -> None:
        """Forget all rows from the n-th on."""
        self.n = n
