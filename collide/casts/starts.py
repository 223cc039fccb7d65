"""Which casts of bodies with meshes touch before they move, and where: booleans and a common point, no depths."""

from __future__ import annotations

import numpy as np

from collide.casts.cast_pairs import CAST_ROW, STATUS, TOUCHING
from collide.casts.convex_casts import Marks, PairRows, joined
from collide.casts.leaves import Leaf, leaves_of
from collide.casts.portal import HIT
from collide.narrowphase.convex_batches import Question
from collide.pairs.batches import answer_batch
from collide.results import UNDECIDED
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape

#: Pairs of parts of a cast that are asked one by one before the unions are asked as wholes.
_ASKED_ALONE = 6


class Starts:
    """Two shapes at the poses (n, 4, 4) of n casts, and what they come down to.

    are_apart : (n,) bool, of what was asked.
    """

    def __init__(self, A: Shape, B: Shape, leaves: tuple[list[Leaf], list[Leaf]], X_WA: np.ndarray, X_WB: np.ndarray):
        self.are_apart = np.zeros(len(X_WA), dtype=bool)
        self._shapes, self._leaves, self._poses = (A, B), leaves, (X_WA, X_WB)
        self._asked = np.zeros(len(X_WA), dtype=np.int64)

    def of_pairs(self, casts: np.ndarray, item_a: np.ndarray, item_b: np.ndarray) -> PairRows:
        """Rows of touching pairs of parts, of casts (k,); a single row of a cast with many pairs.

        The unions as wholes are asked once some pairs of a cast were apart: by then touching parts are not likely to be
        among the next few, and a question of two unions takes less than many questions of two parts.
        """
        unknown = ~self.are_apart[casts]
        np.add.at(self._asked, casts[unknown], 1)
        is_alone = unknown & (self._asked[casts] <= _ASKED_ALONE)
        rows = [self.of_casts(np.unique(casts[unknown & ~is_alone]))]
        for i, j in np.unique(np.stack([item_a, item_b], axis=1)[is_alone], axis=0).tolist():
            some = casts[is_alone & (item_a == i) & (item_b == j)]
            part_a, part_b = (
                Compound([leaves[k]]) if isinstance(shape, Compound) else shape
                for shape, leaves, k in zip(self._shapes, self._leaves, (i, j))
            )
            rows.append(self._touching(part_a, part_b, some, i, j))
        return joined(rows)

    def of_casts(self, casts: np.ndarray) -> PairRows:
        """Rows of casts in contact at the start, with their first touching parts; all others are marked as apart."""
        A, B = self._shapes
        hit = answer_batch(A, B, *self._poses_of(casts), Question(True))
        self.are_apart[casts[~hit]] = True
        return self._touching(A, B, casts[hit])

    def _touching(self, A: Shape, B: Shape, casts: np.ndarray, i: int | None = None, j: int | None = None) -> PairRows:
        """Rows of casts in which A and B touch, with parts i and j, or the parts the answer names."""
        hits = answer_batch(A, B, *self._poses_of(casts), Question(False, 0.0, False))
        casts, hits = casts[hits["hit"]], hits[hits["hit"]]
        rows = np.zeros((len(hits), CAST_ROW))
        rows[:, STATUS], rows[:, TOUCHING : TOUCHING + 3] = HIT, hits["point_b"]
        proven = hits["how"] != UNDECIDED
        marks = Marks(proven, proven.copy(), np.ones(len(hits), dtype=bool))
        # Of a shape that is no union its fields are numbers of facets.
        item_a, item_b = (
            np.full(len(hits), number) if number is not None
            else hits[field].astype(np.int64) * isinstance(shape, Compound)
            for number, field, shape in ((i, "part_a", A), (j, "part_b", B))
        )
        return PairRows(rows, marks, casts, item_a, item_b)

    def _poses_of(self, casts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        X_WA, X_WB = self._poses
        return np.ascontiguousarray(X_WA[casts]), np.ascontiguousarray(X_WB[casts])


def item_of(shape: Shape, item: int) -> Shape:
    """A part of a union by its number, at its pose in the union; other shapes as given."""
    if not isinstance(shape, Compound):
        return shape
    return Compound([leaves_of(shape)[item]])
