"""A box-tree over bodies and the pairs of near bodies: kept between queries while few bodies have changed.

A leaf's box may be larger than its body's, so most steps of bodies change no leaf. The pairs whose leaves' boxes meet
are then the same as before, and a query compares the bodies' own boxes in these pairs alone.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from collide.broadphase.moved_leaves import forget_changes
from collide.broadphase.tree_in_memory import N_CHANGED
from collide.broadphase.tree_over_bodies import CachedPairs, TreeOverBodies
from collide.broadphase.walk_boxes import (
    STACK_OF_PAIRS,
    boxes_met,
    first_pairs,
    mended_pairs,
    pairs_among,
    pairs_of_all,
    pairs_of_keys,
    tested_pairs,
)
from collide.kernels import address_of

#: Pairs are kept from query to query where at most one body in so many has changed, and there are at most so many of
#: them a body. Of so many bodies or more they are mended, where at most one in so many has changed; else made anew.
_SHARE_OF_CACHED, _MAX_CACHED, _MIN_MENDED, _SHARE_OF_MENDED = 3, 16, 256, 4


class BoxTree(TreeOverBodies):
    """The tree, and questions about it; arguments as of `TreeOverBodies`."""

    def pairs(self, margin: float) -> np.ndarray:
        """(k, 2) bodies i < j, sorted, whose boxes come within ``margin`` along every axis, less filtered pairs and
        pairs of two fixed bodies.
        """
        cached = self._cached_pairs(margin)
        if cached is not None:
            pairs = self._tested(cached.keys, margin, True)
        else:
            keys = self._walk_if_few(margin, False, 1 << 60)
            assert keys is not None
            pairs = _pairs_of(keys)
        if len(self.unbounded):
            pairs = np.concatenate([pairs, self._tested(self._with_unbounded(), margin, False)])
            return _pairs_of(np.sort((pairs[:, 0] << 32) + pairs[:, 1]))
        return pairs

    def first_pairs(self, n: int, capacity: int) -> np.ndarray:
        """(k, 2), k ≤ capacity: the first pairs, in order, of the first n bodies with bounded ones behind them, as of
        ``pairs(0.0)``. O(log n) a body for bodies spread out: nothing is looked for beyond these.
        """
        keys = np.empty(capacity, dtype=np.int64)
        return _pairs_of(keys[: first_pairs(address_of(self.header()), n, address_of(keys), capacity)])

    def _cached_pairs(self, margin: float) -> CachedPairs | None:
        """The cached pairs, brought up to date where an update pays; None where a walk of the whole tree is cheaper."""
        header = self.header()
        n, n_changed = len(self.boxes), int(header[N_CHANGED])
        cached = self._cached
        if cached is not None and (cached.margin < margin or _SHARE_OF_CACHED * n_changed > n):
            cached = None
        if cached is not None and not n_changed:
            return cached
        if cached is not None and n >= _MIN_MENDED and _SHARE_OF_MENDED * n_changed <= n:
            cached = self._mended(cached)
        elif _SHARE_OF_CACHED * n_changed <= n and margin < self._too_wide:
            keys = self._walk_if_few(margin, True, _MAX_CACHED * n + 64)
            cached = None if keys is None else CachedPairs(margin, keys)
            self._too_wide = margin if keys is None else self._too_wide
        else:
            cached = None
        forget_changes(address_of(header))
        self._cached = cached
        return cached

    def _walk_if_few(self, margin: float, of_leaves: bool, limit: int) -> np.ndarray | None:
        """(k,) keys of all pairs (`pairs_of_all`), ascending; None where they are more than a limit."""
        stack = np.empty(2 * STACK_OF_PAIRS, dtype=np.int64)

        def walk(header_at: int, *target: int) -> int:
            return pairs_of_all(header_at, margin, of_leaves, address_of(stack), *target)

        return self._collected(walk, 64 + 4 * len(self.boxes), limit)

    def _mended(self, cached: CachedPairs) -> CachedPairs | None:
        """What is kept, with other pairs of the bodies that have changed."""

        def mend(header_at: int, *target: int) -> int:
            return mended_pairs(header_at, address_of(cached.keys), len(cached.keys), cached.margin, *target)

        keys = self._collected(mend, 64 + 2 * len(cached.keys), _MAX_CACHED * len(self.boxes) + 64)
        return None if keys is None else CachedPairs(cached.margin, keys)

    def pairs_among(self, begin: int, end: int, margin: float) -> np.ndarray:
        """(k, 2) bodies i < j, sorted, as of `pairs`: a body at a node begin … end − 1 with a body at a later node.
        Unbounded bodies are in no pair.
        """

        def walk(header_at: int, *target: int) -> int:
            return pairs_among(header_at, begin, end, margin, *target)

        keys = self._collected(walk, 64 + 4 * len(self.boxes), 1 << 60)
        assert keys is not None
        return _pairs_of(keys)

    def _collected(self, walk: Callable[..., int], capacity: int, limit: int) -> np.ndarray | None:
        """(k,) keys found by a walk, ascending; None for more keys than the limit.

        walk : takes the header's address, the address of the keys, and their capacity; returns the number of keys
            found.
        """
        header_at = address_of(self.header())
        while True:
            keys = np.empty(capacity, dtype=np.int64)
            count = walk(header_at, address_of(keys), capacity)
            if count > limit:
                return None
            if count <= capacity:
                keys = keys[:count]
                keys.sort(kind="stable")  # merges runs: of mended keys all but the last are in order, 1 ns a key
                return keys
            capacity = count

    def _tested(self, keys: np.ndarray, margin: float, are_filtered: bool) -> np.ndarray:
        """(k, 2) pairs of the keys whose bodies' boxes are within the margin, less filtered pairs."""
        pairs = np.empty((len(keys) + 1, 2), dtype=np.int64)
        count = tested_pairs(
            address_of(self.header()), address_of(keys), len(keys), margin, are_filtered, address_of(pairs)
        )
        return pairs[:count]

    def _with_unbounded(self) -> np.ndarray:
        """Keys of each body without end with every other."""
        others = np.flatnonzero(self._alive)
        i, j = np.repeat(self.unbounded, len(others)), np.tile(others, len(self.unbounded))
        is_unbounded = np.zeros(len(self.boxes), dtype=bool)
        is_unbounded[self.unbounded] = True
        keep = (i != j) & ~(is_unbounded[j] & (j < i))
        return ((np.minimum(i, j) << 32) + np.maximum(i, j))[keep]

    def touching(self, box: np.ndarray, margin: float) -> np.ndarray:
        """Bodies, sorted, whose boxes come within ``margin`` of one outside box (6,)."""
        return np.sort(self.boxes_met(box.reshape(1, 6), margin)[:, 1])

    def bounded_met(self, boxes: np.ndarray, margin: float) -> np.ndarray:
        """(k, 2) outside boxes (n, 6), by number, and bodies that have an end whose boxes come within ``margin``, in no
        order.
        """
        boxes = np.ascontiguousarray(boxes, dtype=np.float64)
        header_at, capacity = address_of(self.header()), 64 + 4 * len(self.boxes)
        while True:
            met = np.empty((capacity, 2), dtype=np.int64)
            count = boxes_met(header_at, address_of(boxes), len(boxes), margin, address_of(met), capacity)
            if count <= capacity:
                return met[:count]
            capacity = count

    def boxes_met(self, boxes: np.ndarray, margin: float) -> np.ndarray:
        """The same, with bodies without end, in no order."""
        met = self.bounded_met(boxes, margin)
        if not len(self.unbounded):
            return met
        n, m = len(boxes), len(self.unbounded)
        always = np.stack([np.repeat(np.arange(n), m), np.tile(self.unbounded, n)], axis=1)
        return np.concatenate([met, always])


def _pairs_of(keys: np.ndarray) -> np.ndarray:
    """(k, 2) bodies i < j of keys (k,)."""
    pairs = np.empty((len(keys), 2), dtype=np.int64)
    pairs_of_keys(address_of(keys), len(keys), address_of(pairs))
    return pairs
