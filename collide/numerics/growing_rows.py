"""An array with rows added at its end: its memory is doubled when full, so that a row costs the same however many."""

from __future__ import annotations

import numpy as np


class GrowingRows:
    """``rows``: a contiguous view of the rows so far; every change makes a new view, on the same memory or on new.
    Rows written through the view stay.
    """

    def __init__(self, rows: np.ndarray):
        self._memory = self.rows = np.ascontiguousarray(rows)

    @classmethod
    def empty(cls, dtype, *shape: int) -> GrowingRows:
        """No rows yet, each to be of a shape."""
        return cls(np.empty((0, *shape), dtype))

    @property
    def n(self) -> int:
        return len(self.rows)

    @property
    def n_bytes(self) -> int:
        """Bytes of the rows there are."""
        return self.rows.nbytes

    @property
    def nbytes(self) -> int:
        """Memory that is held [bytes]."""
        return self._memory.nbytes

    def extend(self, rows: np.ndarray) -> np.ndarray:
        """All rows, these added."""
        n, k = len(self.rows), len(rows)
        if n + k > len(self._memory):
            self._memory = np.empty((n + max(n, k, 16), *self.rows.shape[1:]), dtype=self.rows.dtype)
            self._memory[:n] = self.rows
        self._memory[n : n + k] = rows
        self.rows = self._memory[: n + k]
        return self.rows

    def add(self, rows: np.ndarray) -> np.ndarray:
        """Add rows; returns their numbers."""
        n = self.n
        return np.arange(n, len(self.extend(rows)))

    def cut_back(self, n: int) -> None:
        """Forget all rows from the n-th on."""
        self.rows = self.rows[:n]
