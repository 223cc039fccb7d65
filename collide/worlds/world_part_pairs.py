"""Pairs of parts of two bodies whose boxes come near: every part against every other where they are few, through a
box-tree over the parts of a body where they are many.

A tree is made when first needed, and fitted anew when the parts have moved.
"""

from __future__ import annotations

import numpy as np

from collide.base.fork_safe_lock import ForkSafeLock
from collide.broadphase.box_tree import BoxTree
from collide.worlds.world_parts import MIN_BY_TREE, WorldParts, runs

#: Bodies that are together at most so many times as wide as the margin are asked as a pair by itself, which goes
#: through parts from the nearest on. Of two places in a unit, drawn evenly, a share of 1 − (1 − 1/4)² is at most 1/4
#: apart: boxes would leave a twelfth of all pairs or more, and each be asked.
_TIMES_AS_WIDE = 4.0
#: Relative: far more than what a sum of a coordinate and a margin is off.
_ROUNDING = 2.0**-40


class PartTrees:
    """Box-trees over the parts of bodies, by position."""

    def __init__(self, parts: WorldParts):
        self._parts, self._lock = parts, ForkSafeLock()  # held while a tree is made or fitted: threads may ask at once
        self._trees: dict[int, BoxTree] = {}

    def are_mostly_near(self, candidates: np.ndarray, margin: float) -> np.ndarray:
        """(k,) bool: candidates (k, 2) of many parts, of which boxes would rule few pairs out."""
        parts = self._parts
        are_near = parts.counts[candidates].prod(axis=1) >= MIN_BY_TREE
        a, b = (parts.body_boxes(bodies) for bodies in candidates[are_near].T)
        widths = np.maximum(a[:, 3:], b[:, 3:]) - np.minimum(a[:, :3], b[:, :3])
        are_near[are_near] = (widths <= _TIMES_AS_WIDE * margin).all(axis=1)
        return are_near

    def near(self, candidates: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
        """((m, 2) pairs of parts whose boxes come within margin [m], (m,) the candidate each belongs to), by candidate.

        candidates : (k, 2) positions of bodies. Each keeps at least its first pair of parts, so that every pair asked
            has a row.
        """
        parts = self._parts
        if parts.all_of_one_part:
            return candidates, np.arange(len(candidates))
        n_pairs = parts.counts[candidates].prod(axis=1)
        by_tree = np.flatnonzero(n_pairs >= MIN_BY_TREE)
        by_part = np.flatnonzero(n_pairs < MIN_BY_TREE)
        all_pairs, owners = self._all_pairs(candidates[by_part])
        pairs_found, owner = [all_pairs], [by_part[owners]]
        for k in by_tree.tolist():
            pairs_found.append(self._by_tree(int(candidates[k, 0]), int(candidates[k, 1]), margin))
            owner.append(np.full(len(pairs_found[-1]), k))
        pairs, owners = np.concatenate(pairs_found), np.concatenate(owner)
        near = self._are_near(pairs, margin)
        pairs, owners = pairs[near], owners[near]
        has_pair = np.zeros(len(candidates), dtype=bool)
        has_pair[owners] = True
        empty = np.flatnonzero(~has_pair)
        pairs = np.concatenate([pairs, parts.first[candidates[empty]]])
        owners = np.concatenate([owners, empty])
        order = np.lexsort((pairs[:, 1], pairs[:, 0], owners))
        return pairs[order], owners[order]

    def _all_pairs(self, candidates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        parts = self._parts
        a, b = candidates.T
        n_pairs = parts.counts[a] * parts.counts[b]
        owner = np.repeat(np.arange(len(candidates)), n_pairs)
        within = runs(np.zeros_like(n_pairs), n_pairs)
        width = np.maximum(parts.counts[b[owner]], 1)
        i, j = parts.first[a[owner]] + within // width, parts.first[b[owner]] + within % width
        return np.stack([i, j], axis=1), owner

    def _are_near(self, pairs: np.ndarray, margin: float) -> np.ndarray:
        i, j = pairs.T
        low, high = self._parts.boxes[:, :3], self._parts.boxes[:, 3:]
        return ((low[i] - margin <= high[j]) & (low[j] - margin <= high[i])).all(axis=1)

    def _by_tree(self, a: int, b: int, margin: float) -> np.ndarray:
        """(m, 2) pairs of parts of two bodies, perhaps within margin: parts of a body in the tree of the other body."""
        parts = self._parts
        is_flipped = bool(parts.counts[a] > parts.counts[b])
        if is_flipped:
            a, b = b, a
        parts_a = np.arange(parts.first[a], parts.first[a + 1])
        around = parts.body_boxes(np.array([b]))[0]
        boxes = parts.boxes[parts_a]
        meets = (boxes[:, :3] - margin <= around[3:]) & (around[:3] - margin <= boxes[:, 3:])
        parts_a, boxes = parts_a[meets.all(axis=1)], boxes[meets.all(axis=1)]
        outwards = margin + _ROUNDING * (margin + float(np.abs(around).max())) if 0.0 < margin < np.inf else margin
        met = self._tree_of(b).boxes_met(boxes, outwards)
        pairs = np.stack([parts_a[met[:, 0]], parts.first[b] + met[:, 1]], axis=1)
        return pairs[:, ::-1] if is_flipped else pairs

    def _tree_of(self, body: int) -> BoxTree:
        """The tree over the parts of a body, where they are now."""
        boxes = self._parts.boxes[self._parts.first[body] : self._parts.first[body + 1]]
        with self._lock.now:
            tree = self._trees.get(body)
            if tree is None:
                tree = self._trees[body] = BoxTree(boxes)
            elif not np.array_equal(tree.boxes, boxes):
                tree.refit(boxes)
            return tree
