"""Convex sets of a few numbers in the rows that kernels read: all at once, by `lower_numbers.py`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from struct import pack
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.convex_sets import SetNumbers
from collide.lowering.lower_numbers import COLUMNS, CONTENT, N_NUMBERS, LOWERING_WORDS, lower_sets
from collide.lowering.packed_convex import BLOCK, NO_POINTS, PackedConvex, PreparedStructures, on_cache_lines
from collide.lowering.shape_table import ADDRESS, COUNT, INTS, KIND, LOWEST, NUMBERS, PADDED, PARAMS, RADIUS, REACH, SLOP


class LoweredSets(NamedTuple):
    """Rows of n sets.

    ints, numbers : (n, INTS) and (n, NUMBERS), as of a `ShapeTable`, not ranked.
    columns : memory of the core points, read-only.   contents : digests, 16 bytes each, one behind the other.
    """

    ints: np.ndarray
    numbers: np.ndarray
    columns: np.ndarray
    contents: bytes

    def packed(self, k: int) -> PackedConvex:
        """Set k, alone."""
        row, numbers = self.ints[k].tolist(), self.numbers[k].tolist()
        points = NO_POINTS
        if row[COUNT]:
            columns = self.columns[COLUMNS * k : COLUMNS * (k + 1)].reshape(3, BLOCK)
            points = np.ascontiguousarray(columns[:, : row[COUNT]].T)
            points.setflags(write=False)
        return PackedConvex(
            row[KIND], numbers[RADIUS], numbers[REACH], numbers[SLOP], tuple(numbers[PARAMS:]), points, self.columns, row[ADDRESS],
            row[PADDED], PreparedStructures(False), row[LOWEST], self.contents[16 * k : 16 * k + 16],
        )


def lower_numbers(sets: Sequence[SetNumbers]) -> LoweredSets:
    """Rows of sets. O(n)."""
    n = len(sets)
    values = pack(f"={N_NUMBERS * n}d", *chain.from_iterable(sets))
    ints, numbers, columns = np.empty((n, INTS), dtype=np.int64), np.empty((n, NUMBERS)), on_cache_lines(COLUMNS * n)
    contents, memory = np.empty(CONTENT * n, dtype=np.int64), np.empty(LOWERING_WORDS)
    lower_sets(
        address_of(np.frombuffer(values)), n, address_of(ints), address_of(numbers), address_of(columns),
        address_of(contents), address_of(memory),
    )
    columns.setflags(write=False)
    return LoweredSets(ints, numbers, columns, contents.tobytes())
