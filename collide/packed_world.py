"""A World as the kernels see it: flat tables of shapes, posed parts, boxes, and a box-tree."""

from __future__ import annotations

import numpy as np

from collide.broadphase.bounding_boxes import boxes_of
from collide.broadphase.box_tree import BoxTree
from collide.errors import UnsupportedQuery
from collide.lowering.packed_convex import PackedConvex
from collide.lowering.parts import bounding_parts_of
from collide.lowering.shape_table import POSE_TERMS, ShapeTable, pose_table
from collide.narrowphase.composite.composite import combine
from collide.narrowphase.convex_queries import run_pairs
from collide.results import EXACT, PAIR_DTYPE, UNDECIDED


class PackedWorld:
    """Bodies by position (0 … n − 1), each a run of convex parts.

    ids : (n,) int32 of the bodies.   static, group, mask : (n,) int64.   allowed : {(i, j): reason}, i < j.
    """

    def __init__(self, bodies, allowed: dict):
        self.allowed = allowed
        self.ids = np.array([body.id for body in bodies], dtype=np.int32)
        self.static = np.array([body.static for body in bodies], dtype=np.int64)
        self.group = np.array([body.group for body in bodies], dtype=np.int64)
        self.mask = np.array([body.mask for body in bodies], dtype=np.int64)
        self._keys = np.sort(np.array([i * len(bodies) + j for i, j in allowed], dtype=np.int64))
        self._shapes = [body.shape for body in bodies]
        self._meshed = np.array([shape.meshed for shape in self._shapes], dtype=bool)
        self._any_meshed = bool(self._meshed.any())
        parts = [bounding_parts_of(shape) for shape in self._shapes]
        self._parts = [[packed for packed, _ in own] for own in parts]
        self._counts = counts = np.array([len(own) for own in parts], dtype=np.int64)
        self._all_of_one_part = bool((counts == 1).all())
        self._first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self._body_of = np.repeat(np.arange(len(bodies)), counts)
        self._X_BP = np.array([X for own in parts for _, X in own]).reshape(-1, 4, 4)
        flat = [packed for own in self._parts for packed in own]
        self._reach = np.array([packed.reach for packed in flat])
        self._shape_of, self._table = _distinct(flat)
        self._X_WBs = np.array([body.X_WB for body in bodies]).reshape(-1, 4, 4)
        self._poses = pose_table(self._X_WBs[self._body_of], self._X_BP, self._reach)
        self._part_boxes = boxes_of(self._table, self._poses.rows, self._shape_of)
        self._tree = BoxTree(self._body_boxes()) if len(bodies) else None

    def _body_boxes(self) -> np.ndarray:
        """(n, 6) boxes around the parts of each body."""
        if self._all_of_one_part:
            return self._part_boxes
        starts = self._first[:-1]
        low = np.minimum.reduceat(self._part_boxes[:, :3], starts)
        return np.hstack([low, np.maximum.reduceat(self._part_boxes[:, 3:], starts)])

    def move(self, bodies: np.ndarray, X_WBs: np.ndarray) -> None:
        """Take new poses (k, 4, 4) of bodies (k,), by their positions, and refit the tree. What stays is not looked at."""
        self._X_WBs[bodies] = X_WBs
        parts = bodies
        if not self._all_of_one_part:
            parts = np.concatenate([np.arange(self._first[b], self._first[b + 1]) for b in bodies.tolist()])
        moved = pose_table(self._X_WBs[self._body_of[parts]], self._X_BP[parts], self._reach[parts])
        before = self._poses.rows[parts, POSE_TERMS]
        own = before >= 0.0
        if np.array_equal(own, moved.rows[:, POSE_TERMS] >= 0.0):  # the exact terms of products keep their places
            if own.any():
                self._poses.terms[before[own].astype(np.int64)] = moved.terms
                moved.rows[own, POSE_TERMS] = before[own]
            self._poses.rows[parts] = moved.rows
        else:
            self._poses = pose_table(self._X_WBs[self._body_of], self._X_BP, self._reach)
        self._part_boxes[parts] = boxes_of(self._table, moved.rows, self._shape_of[parts])
        assert self._tree is not None
        self._tree.refit(self._body_boxes())

    def candidates(self, margin: float) -> np.ndarray:
        """(k, 2) positions of bodies that are to be tested, sorted: not filtered, boxes within margin."""
        if self._tree is None:
            return np.empty((0, 2), dtype=np.int64)
        pairs = self._tree.pairs(margin, self.static, self.group, self.mask)
        if not len(self._keys):
            return pairs
        keys = pairs[:, 0] * len(self.static) + pairs[:, 1]
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return pairs[self._keys[at] != keys]

    def answer(self, candidates: np.ndarray, limit: float, *, boolean: bool, stop_at_hit: bool):
        """(rows, convex pairs answered, body pairs answered, of them with a mesh); fields a and b are positions.

        boolean : rows tell no more than ``hit``, ``how`` and ``iterations``, in no order.
        """
        if not self._any_meshed:
            return *self._convex(candidates, limit, boolean=boolean, stop_at_hit=stop_at_hit), 0
        meshed = self._meshed[candidates].any(axis=1)
        rows, convex_pairs, answered = self._convex(candidates[~meshed], limit, boolean=boolean, stop_at_hit=stop_at_hit)
        found = []
        for a, b in candidates[meshed].tolist() if not (stop_at_hit and rows["hit"].any()) else ():
            found.append(self._mesh_row(a, b, limit, boolean))
            if stop_at_hit and found[-1]["hit"]:
                break
        rows = np.concatenate([rows, *found])
        return rows if boolean else rows[np.lexsort((rows["b"], rows["a"]))], convex_pairs, answered + len(found), len(found)

    def refused(self, candidates: np.ndarray, limit: float) -> list[tuple[int, int, str]]:
        """(position, position, reason) of candidates for which `answer` raises UnsupportedQuery: pairs with a mesh."""
        found = []
        for a, b in candidates[self._meshed[candidates].any(axis=1)].tolist():
            try:
                self._mesh_row(a, b, limit, False)
            except UnsupportedQuery as error:
                found.append((a, b, str(error)))
        return found

    def _mesh_row(self, a: int, b: int, limit: float, boolean: bool) -> np.ndarray:
        from collide.narrowphase.facets.mesh_pairs import pair_states, rows_within
        from collide.narrowphase.facets.surface_pairs import APART, OPEN

        A, B, X_WA, X_WB = self._shapes[a], self._shapes[b], self._X_WBs[a], self._X_WBs[b]
        if boolean:
            row = np.zeros(1, dtype=PAIR_DTYPE)
            state = pair_states(A, B, X_WA[None], X_WB[None])[0]
            row["hit"], row["how"] = state != APART, UNDECIDED if state == OPEN else EXACT
        else:
            row = rows_within(A, B, X_WA[None], X_WB[None], limit)
        row["a"], row["b"] = a, b
        return row

    def _convex(self, candidates: np.ndarray, limit: float, *, boolean: bool, stop_at_hit: bool):
        """(rows, convex pairs answered, body pairs answered) of bodies made of convex parts."""
        pairs, owner = self._part_pairs(candidates, limit)
        rows = run_pairs(
            self._table, self._poses, self._shape_of, pairs, boolean=boolean, limit=limit, stop_at_hit=stop_at_hit
        )
        pairs, owner = pairs[: len(rows)], owner[: len(rows)]
        if boolean:
            return rows, len(rows), int(np.count_nonzero(owner[1:] != owner[:-1])) + min(len(owner), 1)
        rows["a"], rows["b"] = candidates[owner, 0], candidates[owner, 1]
        rows["part_a"] = pairs[:, 0] - self._first[rows["a"]]
        rows["part_b"] = pairs[:, 1] - self._first[rows["b"]]
        starts = np.flatnonzero(np.diff(owner, prepend=-1))
        spans = np.hstack([self._spans(rows["a"][starts]), self._spans(rows["b"][starts])])
        return combine(rows, starts, spans, self._table, self._poses, self._shape_of), len(rows), len(starts)

    def _spans(self, bodies: np.ndarray) -> np.ndarray:
        """(k, 2): first part and number of parts of bodies."""
        return np.stack([self._first[bodies], self._counts[bodies]], axis=1)

    def _part_pairs(self, candidates: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of parts whose boxes come within margin, and the candidate each belongs to.

        A candidate keeps at least its first pair of parts, so that every pair asked has a row.
        """
        if self._all_of_one_part:
            return candidates, np.arange(len(candidates))
        counts = self._counts
        many = counts[candidates[:, 0]] * counts[candidates[:, 1]]
        owner = np.repeat(np.arange(len(candidates)), many)
        within = np.arange(len(owner)) - np.repeat(np.cumsum(many) - many, many)
        width = counts[candidates[owner, 1]]
        i = self._first[candidates[owner, 0]] + within // np.maximum(width, 1)
        j = self._first[candidates[owner, 1]] + within % np.maximum(width, 1)
        low, high = self._part_boxes[:, :3], self._part_boxes[:, 3:]
        near = ((low[i] - margin <= high[j]) & (low[j] - margin <= high[i])).all(axis=1)
        first_near = np.flatnonzero(np.diff(owner, prepend=-1))
        missed = np.ones(len(candidates), dtype=bool)
        missed[owner[near]] = False
        near[first_near[missed]] = True
        return np.stack([i[near], j[near]], axis=1), owner[near]

    def against(self, shape, X_WS: np.ndarray, limit: float) -> np.ndarray:
        """Rows of one outside shape against all bodies near it; b is a position, a is 0."""
        own = bounding_parts_of(shape)
        packed = [part for part, _ in own]
        reach = np.array([part.reach for part in packed])
        poses = pose_table(np.repeat(X_WS[None], len(own), axis=0), np.array([X for _, X in own]), reach)
        boxes = boxes_of(ShapeTable(packed), poses.rows, np.arange(len(own)))
        box = np.concatenate([boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)])
        bodies = self._tree.touching(box, limit) if self._tree is not None else np.empty(0, dtype=np.int64)
        meshed = np.full(len(bodies), True) if shape.meshed else self._meshed[bodies]
        if not meshed.any():
            return self._convex_against(packed, poses, bodies, limit)
        from collide.narrowphase.facets.mesh_pairs import rows_within

        rows = [self._convex_against(packed, poses, bodies[~meshed], limit)]
        for b in bodies[meshed].tolist():
            rows.append(rows_within(shape, self._shapes[b], X_WS[None], self._X_WBs[b][None], limit))
            rows[-1]["b"] = b
        found = np.concatenate(rows)
        return found[np.argsort(found["b"], kind="stable")]

    def _convex_against(self, packed: list[PackedConvex], poses, bodies: np.ndarray, limit: float) -> np.ndarray:
        """What `against` gives, of parts and bodies that are convex or made of convex parts."""
        if not len(bodies):
            return np.zeros(0, dtype=PAIR_DTYPE)
        own = packed
        others = np.concatenate([np.arange(self._first[b], self._first[b + 1]) for b in bodies])
        table = ShapeTable([*packed, *self._table.packed])
        shape_of = np.concatenate([np.arange(len(own)), self._shape_of + len(own)])
        pairs = np.stack(
            [np.tile(np.arange(len(own)), len(others)), np.repeat(others + len(own), len(own))], axis=1
        )
        poses = poses.followed_by(self._poses)
        rows = run_pairs(table, poses, shape_of, pairs, boolean=False, limit=limit)
        rows["b"] = self._body_of[pairs[:, 1] - len(own)]
        rows["part_a"] = pairs[:, 0]
        rows["part_b"] = pairs[:, 1] - len(own) - self._first[rows["b"]]
        starts = np.flatnonzero(np.diff(rows["b"], prepend=-1))
        theirs = self._spans(bodies)
        theirs[:, 0] += len(own)
        spans = np.hstack([np.tile([0, len(own)], (len(starts), 1)), theirs])
        return combine(rows, starts, spans, table, poses, shape_of)


def _distinct(flat: list[PackedConvex]) -> tuple[np.ndarray, ShapeTable]:
    """A table row for each distinct convex set, and the row of every part."""
    rows: dict[tuple[bytes, float], int] = {}
    kept: list[PackedConvex] = []
    shape_of = np.empty(len(flat), dtype=np.int64)
    for k, packed in enumerate(flat):
        key = packed.content, packed.slop
        if key not in rows:
            rows[key] = len(kept)
            kept.append(packed)
        shape_of[k] = rows[key]
    return shape_of, ShapeTable(kept)
