"""Near pairs in many worlds with the same bodies at other poses: a sweep along x in each, filters of a single box-tree.

A box-tree pays where kept from step to step; worlds of a batch are asked once. Bodies are sorted by where their
boxes begin (insertion sort: the order of the world before is nearly right where worlds are alike), and every body is
compared with the bodies whose boxes begin before the body's own box ends.
"""

from __future__ import annotations

import numpy as np

from collide.broadphase.box_tree import BoxTree
from collide.broadphase.tree_in_memory import STILL_BIT, tree_in_memory
from collide.broadphase.walk_boxes import are_near, are_tested, pairs_of_keys, raised
from collide.kernels import address_of, entry, kernel, view_f64, view_i64


@kernel(inline=True)
def _sort_by_low(order, n, boxes, first):
    """Numbers of the n bodies behind ``first`` in the order of their boxes' least x."""
    for k in range(1, n):
        body = order[k]
        low = boxes[6 * (first + body)]
        at = k
        while at > 0 and boxes[6 * (first + order[at - 1])] > low:
            order[at] = order[at - 1]
            at -= 1
        order[at] = body


@entry("int64(int64, int64, int64, int64, int64, float64, int64, int64, int64)")
def pairs_in_worlds(tree_at, boxes_at, n, worlds_at, n_worlds, margin, order_at, keys_at, capacity):
    """Keys of pairs of n bodies, in each of n_worlds worlds, whose boxes come within a margin, less filtered pairs.

    tree : of the bodies, for what its filters say of pairs; its boxes are not read.
    boxes : 6 doubles a body, world after world.   worlds : numbers of the worlds to look at, ascending.
    order : n integers, 0 … n − 1 in any order.   keys : i·2^32 + j, where body b of world w counts as w·n + b.

    Returns the number of keys; the first ``capacity`` are stored, in no order within a world.
    """
    tree = tree_in_memory(tree_at)
    worlds, order, keys = view_i64(worlds_at, n_worlds), view_i64(order_at, n), view_i64(keys_at, capacity)
    boxes = view_f64(boxes_at, 6 * n * (worlds[n_worlds - 1] + 1) if n_worlds else 0)
    count = 0
    for number in range(n_worlds):
        first = worlds[number] * n
        _sort_by_low(order, n, boxes, first)
        for k in range(n):
            end = raised(boxes[6 * (first + order[k]) + 3], margin)
            later = k + 1
            # low − margin ≤ high of `are_near` implies low ≤ `raised(high, margin)`: no near pair is left out.
            while later < n and boxes[6 * (first + order[later])] <= end:
                i, j = min(order[k], order[later]), max(order[k], order[later])
                if are_near(boxes, first + i, first + j, margin) and are_tested(tree, i, j, STILL_BIT):
                    if count < capacity:
                        keys[count] = ((first + i) << 32) + first + j
                    count += 1
                later += 1
    return count


class NearPairs:
    """Near pairs in worlds of the n bodies of a tree; keeps the order of bodies, and memory, from call to call."""

    def __init__(self, tree: BoxTree, n: int):
        self._tree, self._n = tree, n
        self._order, self._keys = np.arange(n), np.empty(64 + 8 * n, dtype=np.int64)

    def find(self, boxes: np.ndarray, worlds: np.ndarray, margin: float) -> np.ndarray:
        """(k, 2) positions of bodies of the same world, sorted: not filtered, boxes within a margin [m].

        boxes : (m·n, 6), of body b of world w at w·n + b.   worlds : (k,) int64 numbers below m, ascending.
        """
        while True:
            count = pairs_in_worlds(
                address_of(self._tree.header()), address_of(boxes), self._n, address_of(worlds), len(worlds), margin,
                address_of(self._order), address_of(self._keys), len(self._keys),
            )
            if count <= len(self._keys):
                break
            self._keys = np.empty(count + count // 4, dtype=np.int64)
        keys, pairs = np.sort(self._keys[:count]), np.empty((count, 2), dtype=np.int64)
        pairs_of_keys(address_of(keys), count, address_of(pairs))
        return pairs
