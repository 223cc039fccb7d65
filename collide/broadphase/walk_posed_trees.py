"""Pairs of boxes of two `BoxTree`s, each in a frame of its own, near each other at given poses of the frames.

A tree over the parts of a body is made once; the boxes of its nodes move with the body. A box with the middle
c and the half lengths h lies, where R x + p puts it, within |R| h of R c + p along each axis of the world, whatever the
matrix R. So two posed boxes are farther apart along an axis than their middles are, less both |R| h.
"""

from __future__ import annotations

import numpy as np

from collide.broadphase.box_tree import BoxTree
from collide.broadphase.graded_boxes import BODY, LINK, SKIP
from collide.broadphase.tree_in_memory import tree_in_memory
from collide.broadphase.walk_boxes import STACK_OF_PAIRS
from collide.kernels import address_of, entry, kernel, view_f64, view_i64

# Doubles of two frames: both matrices row by row, from A's origin to B's, and how near along each axis is near.
_OF_B, _SHIFT, _NEAR = 9, 18, 21
#: More than what rounding takes from sums of so few products, relatively.
_ROUNDING = 2.0**-39


@kernel(inline=True)
def _are_near(tree_a, a, tree_b, b, frames):
    """Whether nodes a and b come near along all axes."""
    p, q = 6 * a, 6 * b
    for axis in range(3):
        between = frames[_SHIFT + axis]
        reach = frames[_NEAR + axis]
        for k in range(3):
            r, s = frames[3 * axis + k], frames[_OF_B + 3 * axis + k]
            between += s * (0.5 * (tree_b[q + k] + tree_b[q + 3 + k])) - r * (0.5 * (tree_a[p + k] + tree_a[p + 3 + k]))
            reach += abs(r) * (0.5 * (tree_a[p + 3 + k] - tree_a[p + k]))
            reach += abs(s) * (0.5 * (tree_b[q + 3 + k] - tree_b[q + k]))
        if abs(between) > reach:
            return False
    return True


@entry("int64(int64, int64, int64, int64, int64, int64)")
def posed_boxes_met(a_at, b_at, frames_at, stack_at, pairs_at, capacity):
    """Pairs (body of A, body of B) whose posed boxes come near, unfiltered; returns their number.

    a, b : trees of a single section, without changed bodies.   frames : 24 doubles, as the module says.
    stack : 2 · STACK_OF_PAIRS integers.   pairs : two integers each, of the first ``capacity``.
    """
    A, B = tree_in_memory(a_at), tree_in_memory(b_at)
    frames = view_f64(frames_at, 24)
    stack = view_i64(stack_at, 2 * STACK_OF_PAIRS)
    pairs = view_i64(pairs_at, 2 * capacity)
    count = top = 0
    if A.n_nodes > 0 and B.n_nodes > 0 and _are_near(A.nodes, 0, B.nodes, 0, frames):
        stack[0] = stack[1] = 0
        top = 1
    while top > 0:
        top -= 1
        a, b = stack[2 * top], stack[2 * top + 1]
        end_a, end_b = A.links[LINK * a + SKIP], B.links[LINK * b + SKIP]
        if end_a - a == 1 and end_b - b == 1:
            if count < capacity:
                pairs[2 * count] = A.links[LINK * a + BODY]
                pairs[2 * count + 1] = B.links[LINK * b + BODY]
            count += 1
            continue
        of_a = end_a - a >= end_b - b
        child, end = (a + 1, end_a) if of_a else (b + 1, end_b)
        while child < end:
            near_a, near_b = (child, b) if of_a else (a, child)
            if _are_near(A.nodes, near_a, B.nodes, near_b, frames):
                stack[2 * top] = near_a
                stack[2 * top + 1] = near_b
                top += 1
            child = A.links[LINK * child + SKIP] if of_a else B.links[LINK * child + SKIP]
    return count


class PosedTree:
    """A tree over the parts of a body, in the body's frame.

    boxes : (n, 6) of the parts: each holds the part's core with its ball swept.
    largest_radius : the largest radius of these balls, with the rounding of the boxes [m]; poses do not stretch balls.
    """

    def __init__(self, boxes: np.ndarray, largest_radius: float):
        self.tree, self._largest_radius, self.n = BoxTree(boxes), largest_radius, len(boxes)
        ends = self.tree.nodes[: min(self.tree.n_nodes, 1)]
        self._size = float(np.abs(ends).max(initial=0.0))

    def pairs_near(self, B: PosedTree, X_WA: np.ndarray, X_WB: np.ndarray, margin: float) -> np.ndarray:
        """(k, 2) parts of this body, A, and of B, ascending, at poses (4, 4): all whose boxes in the world come
        within a margin [m] along every axis, and some that are a little farther. Parts without end are with all others.
        """
        frames = np.empty(24)
        frames[:9], frames[_OF_B:_SHIFT] = X_WA[:3, :3].ravel(), X_WB[:3, :3].ravel()
        frames[_SHIFT:_NEAR] = X_WB[:3, 3] - X_WA[:3, 3]
        frames[_NEAR:] = margin * (1.0 + _ROUNDING) + self._beyond(X_WA) + B._beyond(X_WB)
        stack, capacity = np.empty(2 * STACK_OF_PAIRS, dtype=np.int64), 64 + 4 * (self.n + B.n)
        headers = address_of(self.tree.header()), address_of(B.tree.header())
        while True:
            pairs = np.empty((capacity, 2), dtype=np.int64)
            count = posed_boxes_met(*headers, address_of(frames), address_of(stack), address_of(pairs), capacity)
            if count <= capacity:
                break
            capacity = count
        pairs = pairs[:count]
        without_end = self.tree.unbounded, B.tree.unbounded
        if len(without_end[0]) or len(without_end[1]):
            bounded = np.setdiff1d(np.arange(self.n), without_end[0])
            of_a, of_b = _all_of(without_end[0], np.arange(B.n)), _all_of(bounded, without_end[1])
            pairs = np.concatenate([pairs, of_a, of_b])
        return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]

    def _beyond(self, X: np.ndarray) -> np.ndarray:
        """(3,) how far parts may reach out of their boxes |R| h in the world.

        A box holds a core and r around it. The matrix moves the core alone: where the sizes of a row of R add up to
        s < 1, |R| h has r (1 − s) less than the part. Rounding of a pose, and of the walk, is in proportion to what is
        summed.
        """
        row_sums = np.abs(X[:3, :3]).sum(axis=1)
        terms = row_sums.max() * self._size + float(np.abs(X[:3, 3]).max()) + self._largest_radius
        return self._largest_radius * np.maximum(1.0 - row_sums, 0.0) + _ROUNDING * terms


def _all_of(i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """(len(i) · len(j), 2) each with each."""
    return np.stack([np.repeat(i, len(j)), np.tile(j, len(i))], axis=1)
