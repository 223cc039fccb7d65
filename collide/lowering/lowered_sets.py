"""Convex sets in the rows that kernels read: primitives by a single call of `lower_numbers.py`.

A Compound of a thousand boxes takes a single call; what Python reads of a set (`PackedConvex`) is made when asked for.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import accumulate, chain
from struct import pack

import numpy as np

from collide.kernels import address_of
from collide.lowering.lazy_structures import may_have_tree
from collide.lowering.lower_numbers import COLUMNS, CONTENT, LOWERING_WORDS, N_NUMBERS, lower_sets
from collide.lowering.packed_convex import BLOCK, NO_POINTS, PackedConvex, PreparedStructures, on_cache_lines
from collide.lowering.primitive_numbers import PrimitiveNumbers
from collide.lowering.set_rows import (
    ADDRESS,
    COUNT,
    INTS,
    KIND,
    LOWEST,
    NUMBERS,
    PADDED,
    PARAMS,
    RADIUS,
    REACH,
    SLOP,
    write_row,
)

#: Bytes of a digest.
_DIGEST = 8 * CONTENT


class LoweredSets(Sequence[PackedConvex]):
    """Convex sets in rows; a set is packed at the first access.

    ints, numbers : (n, INTS) and (n, NUMBERS), ranks left 0 (`set_rows.py`).
    by_numbers : (m,) places of the sets of eight numbers.   columns : (m, 3, BLOCK) core points of these sets,
    read-only, filled up with copies of the first point.
    contents : digests, 16 bytes a set.
    with_tree : places of sets with a support tree, made or not.
    """

    def __init__(self, sets: Sequence[PrimitiveNumbers | PackedConvex]):
        n = len(sets)
        self.ints, self.numbers = np.empty((n, INTS), dtype=np.int64), np.empty((n, NUMBERS))
        self._packed = {k: packed for k, packed in enumerate(sets) if packed.__class__ is PackedConvex}
        self.with_tree = [k for k, packed in self._packed.items() if may_have_tree(packed)]
        if not self._packed:
            self.by_numbers = np.arange(n)
            self.contents = self._lower(sets, self.ints, self.numbers)
            return
        self.by_numbers = np.array([k for k in range(n) if k not in self._packed], dtype=np.int64)
        m = len(self.by_numbers)
        ints, numbers = np.empty((m, INTS), dtype=np.int64), np.empty((m, NUMBERS))
        digests = np.empty((n, _DIGEST), dtype=np.uint8)
        lowered = self._lower([sets[k] for k in self.by_numbers.tolist()], ints, numbers)
        self.ints[self.by_numbers], self.numbers[self.by_numbers] = ints, numbers
        digests[self.by_numbers] = np.frombuffer(lowered, dtype=np.uint8).reshape(m, _DIGEST)
        for k, packed in self._packed.items():
            write_row(self.ints, self.numbers, k, packed, 0)
            digests[k] = np.frombuffer(packed.content, dtype=np.uint8)
        self.contents = digests.tobytes()

    def _lower(self, sets: Sequence, ints: np.ndarray, numbers: np.ndarray) -> bytes:
        """Rows of sets told by their numbers; returns their digests. O(n)."""
        n = len(sets)
        values = np.frombuffer(pack(f"={N_NUMBERS * n}d", *chain.from_iterable(sets)))
        columns = on_cache_lines(COLUMNS * n)
        contents, memory = np.empty(CONTENT * n, dtype=np.int64), np.empty(LOWERING_WORDS)
        lower_sets(
            address_of(values), n, address_of(ints), address_of(numbers), address_of(columns), address_of(contents),
            address_of(memory),
        )
        columns.setflags(write=False)
        self._block = columns
        self.columns = columns.reshape(n, 3, BLOCK)
        return contents.tobytes()

    def __len__(self) -> int:
        return len(self.ints)

    def __iter__(self) -> Iterator[PackedConvex]:
        return map(self.__getitem__, range(len(self.ints)))

    def __getitem__(self, k) -> PackedConvex:  # type: ignore[override]
        """Set k, packed; the same object whenever asked."""
        k = range(len(self.ints))[k]
        packed = self._packed.get(k)
        return self._packed.setdefault(k, self._alone(k)) if packed is None else packed

    def _alone(self, k: int) -> PackedConvex:
        row, numbers = self.ints[k].tolist(), self.numbers[k].tolist()
        points = NO_POINTS
        if row[COUNT]:
            at = k if len(self.columns) == len(self.ints) else int(np.searchsorted(self.by_numbers, k))
            points = np.ascontiguousarray(self.columns[at, :, : row[COUNT]].T)
            points.setflags(write=False)
        return PackedConvex(
            row[KIND], numbers[RADIUS], numbers[REACH], numbers[SLOP], tuple(numbers[PARAMS:]), points, self._block,
            row[ADDRESS], row[PADDED], PreparedStructures(False), row[LOWEST],
            self.contents[_DIGEST * k : _DIGEST * (k + 1)],
        )


class PlacedSets(Sequence[tuple[PackedConvex, np.ndarray]]):
    """Parts of a body: sets, and their poses (n, 4, 4) in the body's frame."""

    def __init__(self, sets: LoweredSets, X_BP: np.ndarray):
        self.sets, self.X_BP = sets, X_BP

    def __len__(self) -> int:
        return len(self.X_BP)

    def __getitem__(self, k) -> tuple[PackedConvex, np.ndarray]:  # type: ignore[override]
        return self.sets[k], self.X_BP[k]


class ChainedSets(Sequence[PackedConvex]):
    """Sets of several bodies, one behind the next."""

    def __init__(self, bodies: Sequence[Sequence[PackedConvex]]):
        self._bodies, self._ends = bodies, [*accumulate(map(len, bodies))]

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __getitem__(self, k) -> PackedConvex:  # type: ignore[override]
        k = range(len(self))[k]
        body = bisect_right(self._ends, k)
        return self._bodies[body][k - self._ends[body]]  # from the end of the body on backwards


def in_rows(parts: Sequence[tuple[PackedConvex, np.ndarray]]) -> PlacedSets:
    """Parts in rows, as they are where they have rows."""
    if isinstance(parts, PlacedSets):
        return parts
    return PlacedSets(LoweredSets([packed for packed, _ in parts]), np.array([X for _, X in parts]))


def ranks_of(contents: bytes) -> np.ndarray:
    """(n,) places of digests, one behind the next, in their order as bytes, the same of equal digests. O(n log n)."""
    words = np.frombuffer(contents, dtype=">u8").astype(np.uint64).reshape(-1, CONTENT)
    order = np.lexsort((words[:, 1], words[:, 0]))
    ordered, ranks = words[order], np.empty(len(words), dtype=np.int64)
    ranks[order[:1]] = 0
    ranks[order[1:]] = np.cumsum((ordered[1:] != ordered[:-1]).any(axis=1))
    return ranks
