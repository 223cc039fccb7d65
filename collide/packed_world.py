"""A World as the kernels see it: flat tables of shapes, posed parts, boxes, and a box-tree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from collide.broadphase.bounding_boxes import boxes_of
from collide.broadphase.box_tree import BoxTree
from collide.broadphase.filters import CULLED, count_skipped
from collide.casts.posed_parts import PosedParts
from collide.errors import UnsupportedQuery
from collide.lazy_modules import lazy_module
from collide.lowering.packed_convex import PackedConvex
from collide.lowering.parts import bounding_parts_of, is_single_convex
from collide.lowering.shape_table import POSE_TERMS, PoseTable, ShapeTable, has_own_pose, pose_table
from collide.narrowphase.composite.composite import combine
from collide.narrowphase.convex_kernel_calls import run_pairs
from collide.results import EXACT, HOW, PAIR_DTYPE, UNDECIDED
from collide.shapes.shape import Shape
from collide.shapes.shape_set import Picked, ShapeSet
from collide.world_bodies import BodiesAsTheyStood, Roster

#: Half of the engine, which scenes without meshes never load.
mesh_batches = lazy_module("collide.narrowphase.facets.mesh_batches")

#: Booleans about meshes that stop at the first hit ask so many pairs of the same two shapes at first, then twice as
#: many.
_FIRST_CHUNK = 8


class Answer(NamedTuple):
    """Rows of a query, a and b positions of bodies.

    convex_pairs : pairs of convex parts answered.   body_pairs : of bodies.   mesh_pairs : of these, those with a mesh.
    """

    rows: np.ndarray
    convex_pairs: int
    body_pairs: int
    mesh_pairs: int


class PackedWorld:
    """Bodies by position (0 … n − 1), each a run of convex parts.

    roster : the bodies.   X_WBs : (n, 4, 4) their poses, copied.   allowed : {(i, j): reason}, i < j, positions.
    single_convex : (n,) bool: bodies that are one convex set in their own frame.
    """

    def __init__(self, roster: Roster, X_WBs: np.ndarray, allowed: dict[tuple[int, int], str]):
        self.roster, self.X_WBs, self.allowed = roster, X_WBs.copy(), allowed
        n = len(roster.ids)
        self._allowed_keys = np.sort(np.array([i * n + j for i, j in allowed], dtype=np.int64))
        self._shape_of, self._shapes = _distinct_shapes(roster.shapes)
        is_meshed = np.array([shape.meshed for shape in self._shapes], dtype=bool)
        self._meshed = is_meshed[self._shape_of]
        self._any_meshed = bool(is_meshed.any())
        self.single_convex = np.array([is_single_convex(shape) for shape in self._shapes], dtype=bool)[self._shape_of]
        self._shape_set: ShapeSet | None = None
        self._lay_out_parts()
        self._poses = pose_table(self.X_WBs[self._body_of], self._X_BP, self._reach, self._has_pose)
        self._part_boxes = boxes_of(self._table, self._poses.rows, self._row_of)
        self._tree = BoxTree(self._body_boxes()) if n else None

    def _lay_out_parts(self) -> None:
        """Parts of all bodies, one body after another: those of its shape."""
        parts = [bounding_parts_of(shape) for shape in self._shapes]
        row_of, self._table = _table_of([packed for of_shape in parts for packed, _ in of_shape])
        X_SP = np.array([X for of_shape in parts for _, X in of_shape]).reshape(-1, 4, 4)
        reach = np.array([packed.reach for of_shape in parts for packed, _ in of_shape])
        n_parts = np.array([len(of_shape) for of_shape in parts], dtype=np.int64)
        first = np.cumsum(n_parts) - n_parts
        self._counts = counts = n_parts[self._shape_of]
        self._all_of_one_part = bool((counts == 1).all())
        self._first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self._body_of = np.repeat(np.arange(len(counts)), counts)
        which = _runs(first[self._shape_of], counts)
        self._row_of, self._X_BP, self._reach = row_of[which], X_SP[which], reach[which]
        self._has_pose = has_own_pose(X_SP)[which]

    def _body_boxes(self) -> np.ndarray:
        """(n, 6) boxes around the parts of each body."""
        if self._all_of_one_part:
            return self._part_boxes
        starts = self._first[:-1]
        low = np.minimum.reduceat(self._part_boxes[:, :3], starts)
        return np.hstack([low, np.maximum.reduceat(self._part_boxes[:, 3:], starts)])

    def move(self, bodies: np.ndarray, X_WBs: np.ndarray) -> None:
        """Take new poses (k, 4, 4) of bodies (k,), by position, and refit the tree. Others' boxes are not made
        again.
        """
        self.X_WBs[bodies] = X_WBs
        parts: np.ndarray | slice = bodies if self._all_of_one_part else self._parts_of(bodies)
        if len(bodies) == len(self.roster.ids):
            parts = slice(None)  # all of them: nothing is gathered
        X_WB = X_WBs if self._all_of_one_part else self.X_WBs[self._body_of[parts]]
        moved = pose_table(X_WB, self._X_BP[parts], self._reach[parts], self._has_pose[parts])
        before = self._poses.rows[parts, POSE_TERMS].copy()
        has_terms = before >= 0.0
        if np.array_equal(has_terms, moved.rows[:, POSE_TERMS] >= 0.0):  # exact terms of products keep their places
            if has_terms.any():
                self._poses.terms[before[has_terms].astype(np.int64)] = moved.terms
                moved.rows[has_terms, POSE_TERMS] = before[has_terms]
            self._poses.rows[parts] = moved.rows
        else:
            self._poses = pose_table(self.X_WBs[self._body_of], self._X_BP, self._reach, self._has_pose)
        self._part_boxes[parts] = boxes_of(self._table, moved.rows, self._row_of[parts])
        assert self._tree is not None
        self._tree.refit(self._body_boxes())

    def _parts_of(self, bodies: np.ndarray) -> np.ndarray:
        """Parts of bodies, one body after another."""
        return _runs(self._first[bodies], self._counts[bodies])

    def candidates(self, margin: float) -> np.ndarray:
        """(k, 2) positions of bodies that are to be tested, sorted: not filtered, boxes within margin [m]."""
        if self._tree is None:
            return np.empty((0, 2), dtype=np.int64)
        pairs = self._tree.pairs(margin, self.roster.static, self.roster.group, self.roster.mask)
        allowed = self._allowed_keys
        if not len(allowed):
            return pairs
        keys = pairs[:, 0] * len(self.roster.ids) + pairs[:, 1]
        at = np.minimum(np.searchsorted(allowed, keys), len(allowed) - 1)
        return pairs[allowed[at] != keys]

    def posed_shapes(self, pairs: np.ndarray) -> tuple[Picked, Picked, np.ndarray, np.ndarray]:
        """(A, B, X_WA, X_WB) of pairs (k, 2) of positions, as batches of pair queries take them."""
        if self._shape_set is None:
            self._shape_set = ShapeSet(self._shapes)
        a, b = pairs.T
        X_WA, X_WB = self.X_WBs[a], self.X_WBs[b]
        return self._shape_set[self._shape_of[a]], self._shape_set[self._shape_of[b]], X_WA, X_WB

    def convex_sets_of(self, pairs: np.ndarray) -> tuple[ShapeTable, np.ndarray]:
        """(table, (k, 2) rows of it) of pairs (k, 2) of positions of bodies that are single convex sets."""
        return self._table, self._row_of[self._first[pairs]]

    def bodies_named(self, *positions: np.ndarray) -> BodiesAsTheyStood:
        """The bodies at positions that results name, with their poses now."""
        is_named = np.zeros(len(self.roster.ids), dtype=bool)
        for some in positions:
            is_named[some] = True
        named = np.flatnonzero(is_named)
        return BodiesAsTheyStood(self.roster, named, self.X_WBs[named])

    def answer(self, candidates: np.ndarray, limit: float, *, boolean: bool, stop_at_hit: bool) -> Answer:
        """Rows of candidates (k, 2).

        limit : [m], as of `collide.distance`.   stop_at_hit : rows after the first hit may be missing.
        boolean : rows tell no more than ``hit``, ``how`` and ``iterations``, in no order.
        """
        if not self._any_meshed:
            return self._answer_convex(candidates, limit, boolean=boolean, stop_at_hit=stop_at_hit)
        meshed = self._meshed[candidates].any(axis=1)
        convex = self._answer_convex(candidates[~meshed], limit, boolean=boolean, stop_at_hit=stop_at_hit)
        if stop_at_hit and convex.rows["hit"].any():
            return convex
        of_meshes = self._answer_meshes(candidates[meshed], limit, boolean, stop_at_hit)
        rows = np.concatenate([convex.rows, of_meshes])
        if not boolean:
            rows = rows[np.lexsort((rows["b"], rows["a"]))]
        return Answer(rows, convex.convex_pairs, convex.body_pairs + len(of_meshes), len(of_meshes))

    # --- pairs with a mesh ----------------------------------------------------------------------

    def _answer_meshes(self, pairs: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> np.ndarray:
        """Rows of pairs of bodies with a mesh: those of the same two shapes are one batch."""
        answered = [np.zeros(0, dtype=PAIR_DTYPE)]
        for batch in _batches(pairs, self._shape_of, len(self._shapes), _FIRST_CHUNK if stop_at_hit else len(pairs)):
            answered.append(self._mesh_rows(batch, limit, boolean))
            if stop_at_hit and answered[-1]["hit"].any():
                break
        return np.concatenate(answered)

    def _mesh_rows(self, pairs: np.ndarray, limit: float, boolean: bool) -> np.ndarray:
        """Rows of pairs (k, 2) of bodies of the same two shapes. Raises UnsupportedQuery."""
        a, b = pairs.T
        A, B = self._shapes[self._shape_of[a[0]]], self._shapes[self._shape_of[b[0]]]
        if boolean:
            rows = np.zeros(len(pairs), dtype=PAIR_DTYPE)
            states = mesh_batches.pair_states(A, B, self.X_WBs[a], self.X_WBs[b])
            rows["hit"] = states != mesh_batches.APART
            rows["how"] = np.where(states == mesh_batches.OPEN, UNDECIDED, EXACT)
        else:
            rows = mesh_batches.rows_within(A, B, self.X_WBs[a], self.X_WBs[b], limit)
        rows["a"], rows["b"] = a, b
        return rows

    def refused(self, candidates: np.ndarray, limit: float) -> list[tuple[int, int, str]]:
        """(position, position, reason) of candidates for which `answer` raises UnsupportedQuery: pairs with a mesh."""
        refused = []
        for pairs in _batches(candidates[self._meshed[candidates].any(axis=1)], self._shape_of, len(self._shapes)):
            try:
                self._mesh_rows(pairs, limit, False)
            except UnsupportedQuery:
                refused += self._refused_of_batch(pairs, limit)
        return sorted(refused)

    def _refused_of_batch(self, pairs: np.ndarray, limit: float) -> list[tuple[int, int, str]]:
        refused = []
        for pair in pairs:
            try:
                self._mesh_rows(pair[None], limit, False)
            except UnsupportedQuery as error:
                refused.append((int(pair[0]), int(pair[1]), str(error)))
        return refused

    # --- convex bodies and unions of convex parts -----------------------------------------------

    def _answer_convex(self, candidates: np.ndarray, limit: float, *, boolean: bool, stop_at_hit: bool) -> Answer:
        pairs, owner = self._part_pairs(candidates, limit)
        rows = run_pairs(
            self._table, self._poses, self._row_of, pairs, boolean=boolean, limit=limit, stop_at_hit=stop_at_hit
        )
        pairs, owner = pairs[: len(rows)], owner[: len(rows)]
        starts = np.flatnonzero(np.diff(owner, prepend=-1))
        if boolean:
            return Answer(rows, len(rows), len(starts), 0)
        rows["a"], rows["b"] = candidates[owner, 0], candidates[owner, 1]
        rows["part_a"] = pairs[:, 0] - self._first[rows["a"]]
        rows["part_b"] = pairs[:, 1] - self._first[rows["b"]]
        spans = np.hstack([self._spans(rows["a"][starts]), self._spans(rows["b"][starts])])
        of_bodies = combine(rows, starts, spans, self._table, self._poses, self._row_of)
        return Answer(of_bodies, len(rows), len(starts), 0)

    def _spans(self, bodies: np.ndarray) -> np.ndarray:
        """(k, 2): first part and number of parts of bodies."""
        return np.stack([self._first[bodies], self._counts[bodies]], axis=1)

    def _part_pairs(self, candidates: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of parts whose boxes come within margin, and the candidate each belongs to.

        A candidate keeps at least its first pair of parts, so that every pair asked has a row.
        """
        if self._all_of_one_part:
            return candidates, np.arange(len(candidates))
        a, b = candidates.T
        n_pairs = self._counts[a] * self._counts[b]
        owner = np.repeat(np.arange(len(candidates)), n_pairs)
        within = _runs(np.zeros_like(n_pairs), n_pairs)
        width = self._counts[b[owner]]
        i = self._first[a[owner]] + within // np.maximum(width, 1)
        j = self._first[b[owner]] + within % np.maximum(width, 1)
        low, high = self._part_boxes[:, :3], self._part_boxes[:, 3:]
        near = ((low[i] - margin <= high[j]) & (low[j] - margin <= high[i])).all(axis=1)
        first_of_each = np.flatnonzero(np.diff(owner, prepend=-1))
        is_empty = np.ones(len(candidates), dtype=bool)
        is_empty[owner[near]] = False
        near[first_of_each[is_empty]] = True
        return np.stack([i[near], j[near]], axis=1), owner[near]

    # --- casts ----------------------------------------------------------------------------------

    @property
    def tree(self) -> BoxTree | None:
        """The box-tree over bodies; None of a World without any."""
        return self._tree

    @property
    def shapes(self) -> list[Shape]:
        """The distinct shapes.   shape_of : (n,) which of them each body has.   meshed : (n,) bool."""
        return self._shapes

    @property
    def shape_of(self) -> np.ndarray:
        return self._shape_of

    @property
    def meshed(self) -> np.ndarray:
        return self._meshed

    def posed_parts(self) -> tuple[PosedParts, np.ndarray, np.ndarray]:
        """(all parts, (parts,) the body of each, (n + 1,) the first part of each body and the number of all)."""
        self._table.build_trees(self._row_of)
        parts = PosedParts(self._table, self._poses, self._row_of, self.X_WBs[self._body_of], self._X_BP)
        return parts, self._body_of, self._first

    # --- an outside shape -----------------------------------------------------------------------

    def against(self, shape: Shape, X_WS: np.ndarray, limit: float) -> np.ndarray:
        """Rows of one outside shape at a pose (4, 4) against all bodies near it; b is a position, a is 0."""
        parts = bounding_parts_of(shape)
        packed = [part for part, _ in parts]
        reach = np.array([part.reach for part in packed])
        poses = pose_table(np.repeat(X_WS[None], len(parts), axis=0), np.array([X for _, X in parts]), reach)
        boxes = boxes_of(ShapeTable(packed), poses.rows, np.arange(len(parts)))
        box = np.concatenate([boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)])
        bodies = self._tree.touching(box, limit) if self._tree is not None else np.empty(0, dtype=np.int64)
        meshed = np.full(len(bodies), True) if shape.meshed else self._meshed[bodies]
        if not meshed.any():
            return self._convex_against(packed, poses, bodies, limit)
        rows = [self._convex_against(packed, poses, bodies[~meshed], limit)]
        pairs = np.repeat(bodies[meshed][:, None], 2, axis=1)
        for batch in _batches(pairs, self._shape_of, len(self._shapes)):
            b = batch[:, 0]
            B = self._shapes[self._shape_of[b[0]]]
            rows.append(mesh_batches.rows_within(shape, B, X_WS[None], self.X_WBs[b], limit))
            rows[-1]["a"], rows[-1]["b"] = 0, b
        answered = np.concatenate(rows)
        return answered[np.argsort(answered["b"], kind="stable")]

    def _convex_against(
        self, packed: list[PackedConvex], poses: PoseTable, bodies: np.ndarray, limit: float
    ) -> np.ndarray:
        """What `against` gives, of parts and bodies that are convex or made of convex parts."""
        if not len(bodies):
            return np.zeros(0, dtype=PAIR_DTYPE)
        n_own = len(packed)
        body_parts = self._parts_of(bodies)
        table = ShapeTable([*packed, *self._table.packed])
        row_of = np.concatenate([np.arange(n_own), self._row_of + n_own])
        pairs = np.stack(
            [np.tile(np.arange(n_own), len(body_parts)), np.repeat(body_parts + n_own, n_own)], axis=1
        )
        poses = poses.followed_by(self._poses)
        rows = run_pairs(table, poses, row_of, pairs, boolean=False, limit=limit)
        rows["b"] = self._body_of[pairs[:, 1] - n_own]
        rows["part_a"] = pairs[:, 0]
        rows["part_b"] = pairs[:, 1] - n_own - self._first[rows["b"]]
        starts = np.flatnonzero(np.diff(rows["b"], prepend=-1))
        spans = self._spans(bodies)
        spans[:, 0] += n_own
        spans = np.hstack([np.tile([0, n_own], (len(starts), 1)), spans])
        return combine(rows, starts, spans, table, poses, row_of)


@dataclass(frozen=True)
class QueryRecord:
    """What `World.stats` of a query are made of, when they are asked for."""

    packed: PackedWorld
    n_candidates: int
    hit: np.ndarray
    how: np.ndarray
    iterations: np.ndarray
    convex_pairs: int
    body_pairs: int
    mesh_pairs: int
    seconds: dict

    def stats(self) -> dict:
        """As `World.stats` says."""
        roster = self.packed.roster
        n = len(roster.ids)
        skipped = count_skipped(roster.static, roster.group, roster.mask, self.packed.allowed)
        pairs = n * (n - 1) // 2
        skipped[CULLED] = pairs - sum(skipped.values()) - self.n_candidates
        return {
            "bodies": n, "static": int(roster.static.sum()), "pairs": pairs, "skipped": skipped,
            "narrowphase": self.body_pairs, "convex_pairs": self.convex_pairs, "mesh_pairs": self.mesh_pairs,
            "hits": int(self.hit.sum()), "undecided": int((self.how == UNDECIDED).sum()),
            "how": dict(Counter(HOW[how] for how in self.how)),
            "gjk_iterations": int((self.iterations & 0xFFFF).sum()),
            "epa_iterations": int((self.iterations >> 16).sum()), "seconds": self.seconds,
        }  # fmt: skip


def _distinct_shapes(shapes: Sequence[Shape]) -> tuple[np.ndarray, list[Shape]]:
    """((n,) number of each body's shape among the distinct ones, these by first appearance)."""
    distinct = {id(shape): shape for shape in shapes}
    number_of = {key: number for number, key in enumerate(distinct)}
    numbers = np.fromiter((number_of[id(shape)] for shape in shapes), dtype=np.int64, count=len(shapes))
    return numbers, list(distinct.values())


def _table_of(packed: list[PackedConvex]) -> tuple[np.ndarray, ShapeTable]:
    """The table row of every convex set, and the table: a row for each distinct one."""
    rows: dict[tuple[bytes, float], int] = {}
    distinct: list[PackedConvex] = []
    row_of = np.empty(len(packed), dtype=np.int64)
    for k, part in enumerate(packed):
        key = part.content, part.slop
        if key not in rows:
            rows[key] = len(distinct)
            distinct.append(part)
        row_of[k] = rows[key]
    return row_of, ShapeTable(distinct)


def _runs(starts: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Numbers starts[k], …, starts[k] + counts[k] − 1, one run after another."""
    return np.repeat(starts - (np.cumsum(counts) - counts), counts) + np.arange(counts.sum())


def _batches(pairs: np.ndarray, shape_of: np.ndarray, n_shapes: int, chunk: int = 1 << 60) -> Iterator[np.ndarray]:
    """Pairs (k, 2) of bodies in batches of the same two shapes; of each at most ``chunk`` first, then twice as many."""
    keys = shape_of[pairs[:, 0]] * n_shapes + shape_of[pairs[:, 1]]
    order = np.argsort(keys, kind="stable")
    for same in np.split(order, np.flatnonzero(np.diff(keys[order])) + 1):
        size = max(chunk, 1)
        while len(same):
            yield pairs[same[:size]]
            same, size = same[size:], 2 * size
