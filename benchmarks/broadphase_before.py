"""The box-tree over bodies that Worlds had before the graded one, to compare with: sorted by size class and Morton
code, then an implicit binary tree, all of it fitted whenever anything moves.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

#: Bits of a Morton code along each axis, and how far sides may grow before bodies are sorted anew.
_BITS, _GROWN = 16, 1.5


class ImplicitBoxTree:
    """Over finite boxes (n, 6). Leaf k is the k-th body of the order; node i has children 2i and 2i + 1."""

    def __init__(self, boxes: np.ndarray):
        self.boxes = boxes.copy()
        self.leaves = 1 << max(0, (len(boxes) - 1).bit_length())
        self.nodes = np.empty((2 * self.leaves, 6))
        self._sort()

    def refit(self, boxes: np.ndarray) -> None:
        self.boxes = boxes
        sides = fit_implicit(boxes, self.order, self.nodes, self.leaves)
        if sides > _GROWN * self._least:
            self._sort()
        self._least = min(self._least, sides)

    def _sort(self) -> None:
        self.order = sorted_order(self.boxes)
        self._least = fit_implicit(self.boxes, self.order, self.nodes, self.leaves)

    def pairs(self, margin: float) -> np.ndarray:
        n = len(self.boxes)
        pairs = np.empty((64 + 64 * n, 2), dtype=np.int64)
        count = walk_implicit(self.boxes, self.nodes, self.leaves, self.order, margin, pairs)
        keys = np.minimum(pairs[:count, 0], pairs[:count, 1]) * n + np.maximum(pairs[:count, 0], pairs[:count, 1])
        keys.sort()
        return np.stack(np.divmod(keys, n), axis=1)


def sorted_order(boxes: np.ndarray) -> np.ndarray:
    """Size class first, then the Z-curve through the centres."""
    centres = 0.5 * boxes[:, :3] + 0.5 * boxes[:, 3:]
    low = centres.min(axis=0)
    cells = ((centres - low) * ((2**_BITS - 1) / float((centres.max(axis=0) - low).max()))).astype(np.uint64)
    x, y, z = (_spread_bits(cells[:, axis]) for axis in range(3))
    size_class = np.frexp((boxes[:, 3:] - boxes[:, :3]).max(axis=1))[1]
    smaller = (int(size_class.max()) - size_class).astype(np.uint64)
    code = x | (y << np.uint64(1)) | (z << np.uint64(2))
    return np.argsort((smaller << np.uint64(3 * _BITS)) | code, kind="stable")


def _spread_bits(values: np.ndarray) -> np.ndarray:
    for shift, mask in ((32, 0xFFFF00000000FFFF), (16, 0x00FF0000FF0000FF), (8, 0xF00F00F00F00F00F),
                        (4, 0x30C30C30C30C30C3), (2, 0x9249249249249249)):  # fmt: skip
        values = (values | (values << np.uint64(shift))) & np.uint64(mask)
    return values


@njit
def fit_implicit(boxes, order, nodes, leaves):
    sides = 0.0
    for leaf in range(leaves):
        for axis in range(3):
            nodes[leaves + leaf, axis], nodes[leaves + leaf, 3 + axis] = math.inf, -math.inf
        if leaf < len(order):
            nodes[leaves + leaf] = boxes[order[leaf]]
    for node in range(leaves - 1, 0, -1):
        for axis in range(3):
            nodes[node, axis] = min(nodes[2 * node, axis], nodes[2 * node + 1, axis])
            nodes[node, 3 + axis] = max(nodes[2 * node, 3 + axis], nodes[2 * node + 1, 3 + axis])
            sides += max(nodes[node, 3 + axis] - nodes[node, axis], 0.0)
    return sides


@njit
def walk_implicit(boxes, nodes, leaves, order, margin, pairs):
    """Each leaf against those to its right: down to the left while boxes meet, else on to the next subtree."""
    count = 0
    for k in range(len(order)):
        i = order[k]
        low0, low1, low2 = boxes[i, 0] - margin, boxes[i, 1] - margin, boxes[i, 2] - margin
        high0, high1, high2 = boxes[i, 3] + margin, boxes[i, 4] + margin, boxes[i, 5] + margin
        node = leaves + k
        while node > 0:
            while node & 1:
                node >>= 1
            node = node + 1 if node > 0 else 0
            while node > 0 and (
                nodes[node, 0] <= high0 and nodes[node, 3] >= low0
                and nodes[node, 1] <= high1 and nodes[node, 4] >= low1
                and nodes[node, 2] <= high2 and nodes[node, 5] >= low2
            ):  # fmt: skip
                if node < leaves:
                    node = 2 * node
                    continue
                if node - leaves < len(order):
                    pairs[count, 0], pairs[count, 1] = i, order[node - leaves]
                    count += 1
                break
    return count
