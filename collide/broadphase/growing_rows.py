"""An array that rows are added to: memory for more is taken by doubling, so that a row costs the same however many."""

from __future__ import annotations

import numpy as np


class GrowingRows:
    """``rows``: a contiguous view of those that there are; another one after `extend`, on the same memory or on new."""

    def __init__(self, rows: np.ndarray):
        self._memory = self.rows = np.ascontiguousarray(rows)

    def extend(self, rows: np.ndarray) -> np.ndarray:
        """All rows, these added."""
        n, k = len(self.rows), len(rows)
        if n + k > len(self._memory):
            self._memory = np.empty((n + max(n, k, 16), *self.rows.shape[1:]), dtype=self.rows.dtype)
            self._memory[:n] = self.rows
        self._memory[n : n + k] = rows
        self.rows = self._memory[: n + k]
        return self.rows

    @property
    def nbytes(self) -> int:
        """Memory that is held [bytes]."""
        return self._memory.nbytes
