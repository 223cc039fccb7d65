"""A World as the kernels read worlds: flat tables of shapes, posed parts, boxes, and a box-tree, brought up to date on
changes.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from collide.base.fork_safe_lock import ForkSafeLock
from collide.base.lazy_modules import lazy_module
from collide.base.threads import share
from collide.broadphase.bounding_boxes import widened
from collide.broadphase.box_tree import BoxTree
from collide.casts.posed_parts import PosedParts
from collide.errors import UnsupportedQuery
from collide.lowering.shape_table import ShapeTable
from collide.narrowphase.composite.composite import combine, of_thread
from collide.narrowphase.convex_kernel_calls import run_pairs
from collide.narrowphase.dispatch_functions import rows_of_pair
from collide.results import EXACT, PAIR_DTYPE, UNDECIDED
from collide.shapes.shape import Shape
from collide.shapes.shape_set import Picked, ShapeSet
from collide.worlds.bodies import BodiesAsTheyStood, Roster
from collide.worlds.world_part_pairs import PartTrees
from collide.worlds.world_parts import WorldParts

#: Half of the engine, which scenes without meshes never load.
mesh_batches = lazy_module("collide.narrowphase.facets.mesh_batches")

#: Booleans about meshes that stop at the first hit ask so many pairs of the same two shapes at first, then twice as
#: many.
_FIRST_CHUNK = 8
#: Pairs of bodies that a thread takes at once; booleans that stop at a hit look whether there was one after so many.
_PAIRS_AT_ONCE = 2048
#: Booleans about so many bodies or more ask pairs of so many bodies first, so many at most, before all others are
#: looked for: where bodies are crowded, one of them hits.
_MIN_SCANNED, _SCANNED, _FIRST_PAIRS = 256, 64, 32
#: Of more candidates than this, booleans that stop at a hit ask first the so many whose boxes overlap most, of at most
#: so many, evenly taken: to look at all would take half as long as to ask them.
_MIN_SORTED, _LIKELIEST, _MAX_COMPARED = 512, 32, 2048
#: The version of tables that are being changed, or whose poses are.
STALE = -1
_NO_WORK = {"added": 0, "removed": 0, "moved": 0}
#: Poses of so many bodies are copied in the time that it takes to find out which are named.
_MAX_COPIED = 128


class Answer(NamedTuple):
    """Rows of a query, a and b positions of bodies.

    convex_pairs : pairs of convex parts answered.   body_pairs : of bodies.   mesh_pairs : of these, those with a mesh.
    """

    rows: np.ndarray
    convex_pairs: int
    body_pairs: int
    mesh_pairs: int


class PairFilters(NamedTuple):
    """What is said of pairs of bodies, by position; a new object after every change.

    allowed : (k, 2) pairs that are never tested, i < j.   reasons : why, of each.
    margin_keys, margins : (m,) i·2^32 + j of pairs with a margin of their own, i < j, ascending, and the margins [m].
    """

    allowed: np.ndarray
    reasons: list[str]
    margin_keys: np.ndarray
    margins: np.ndarray


class PackedWorld:
    """Bodies by position (0 … n − 1), each a run of convex parts. A question is a ``with`` block: `WorldScene._pack`.

    roster : the bodies.   X_WBs : (n, 4, 4) their poses.
    filters : of pairs.   parts : the parts.   tree : the box-tree over bodies; ``None`` before
    the first body.   has_margins : whether any body or pair has.
    readers : as long as the number of questions reading the tables.   version : number of changes of the World up to
    these tables; STALE while nobody may read the tables.   shares_poses : whether the World moves bodies in X_WBs.
    """

    def __init__(self, roster: Roster, X_WBs: np.ndarray, filters: PairFilters):
        self.roster, self.filters = roster, filters
        self.readers: list[None] = []
        self.version, self.shares_poses = STALE, True
        self.parts, self._lock = WorldParts(), ForkSafeLock()
        self.tree: BoxTree | None = None
        self._shape_set: ShapeSet | None = None
        self._part_trees = PartTrees(self.parts)
        self._inflation = np.zeros(0)
        self._work = _NO_WORK.copy()
        self.has_margins = self._any_meshed = False
        self._append(roster, X_WBs)
        self._remove(np.flatnonzero(~roster.alive))
        self._take_sleep(roster._replace(sleeping=np.zeros(len(roster.ids), dtype=bool)), roster)
        self.set_filters(filters)

    def __enter__(self) -> PackedWorld:  # noqa: PYI034 - typing.Self is of Python 3.11
        return self

    def __exit__(self, *_) -> None:
        self.readers.pop()

    # --- changes --------------------------------------------------------------------------------

    def copied(self) -> PackedWorld:
        """The same World, to be changed while readers go on with these tables; the tables here change no more."""
        made = copy.copy(self)
        made.readers, made.version, made._lock, made._work = [], STALE, ForkSafeLock(), _NO_WORK.copy()
        with self._lock.now:  # what the tree keeps of pairs
            made.parts, made.tree = self.parts.copied(), None if self.tree is None else self.tree.copied()
        made._part_trees = PartTrees(made.parts)
        return made

    def update(self, roster: Roster, X_WBs: np.ndarray, is_moved: np.ndarray) -> None:
        """Take what has changed since: bodies behind the others, removed ones, margins, sleep; poses of bodies with a
        flag in ``is_moved`` (n,), which is cleared.   X_WBs : (n, 4, 4), of all bodies, as of `_append`.
        """
        before, n = self.roster, len(self.roster.ids)
        self.X_WBs, self.shares_poses = X_WBs, True
        if roster is not before:
            self._append(roster, X_WBs)
            dead = np.flatnonzero(before.alive & ~roster.alive[:n])
            dead = np.append(dead, n + np.flatnonzero(~roster.alive[n:]))
            self._remove(dead)
            self._take_sleep(before, roster)
            if (before.margin != roster.margin[:n]).any() or roster.margin[n:].any():
                self._inflate()
            is_moved[n:] = False
        if self.tree is not None:
            self._work["moved"] += self._move(X_WBs, is_moved, self.tree)
            self.tree.header()  # made before it is read: of two readers that made it one would lose theirs

    def _move(self, X_WBs: np.ndarray, is_moved: np.ndarray, tree: BoxTree) -> int:
        """Take poses of bodies that moved, clear their flags, return their number."""
        if self.parts.single is not None:
            n, moved = self.parts.single.move(is_moved, X_WBs, None if self.has_margins else tree)
        else:
            (moved,) = is_moved.nonzero()
            is_moved[moved], n = False, len(moved)
            if n:
                self.parts.move(moved, X_WBs)
        if n and moved is not None:
            tree.move(moved, self._tree_boxes(moved))
        return n

    def _append(self, roster: Roster, X_WBs: np.ndarray) -> None:
        """X_WBs : (n, 4, 4) poses of all bodies; not copied, they are to hold the poses of the last update."""
        n = len(self.parts.shape_of)
        self.roster, self.X_WBs = roster, X_WBs
        new = np.arange(n, len(roster.ids))
        if not len(new):
            return
        self.parts.append(roster.shapes[n : len(roster.ids)], X_WBs[n:])
        self._inflation = np.append(self._inflation, np.zeros(len(new)))
        self._shape_set, self._any_meshed = None, bool(self.parts.meshed.any())
        boxes = self.parts.body_boxes(new)
        if self.tree is None:
            self.tree = BoxTree(boxes, roster.static != 0)
            self.tree.set_groups(new, roster.group, roster.mask)
        else:
            self.tree.append(boxes, roster.static[n:] != 0, roster.group[n:], roster.mask[n:])
        self._work["added"] += len(new)

    def _remove(self, dead: np.ndarray) -> None:
        """Take bodies (k,) out of the tree; their rows stay."""
        if len(dead):
            assert self.tree is not None
            self.tree.remove(dead)
            self._work["removed"] += len(dead)

    def _take_sleep(self, before: Roster, roster: Roster) -> None:
        if self.tree is None:
            return
        changed = np.append(before.sleeping, np.zeros(len(roster.ids) - len(before.ids), dtype=bool)) != roster.sleeping
        for asleep in (False, True):
            self.tree.set_asleep(np.flatnonzero(changed & (roster.sleeping == asleep)), asleep)

    def set_filters(self, filters: PairFilters) -> None:
        """Take other allowed pairs and margins of pairs."""
        self.filters = filters
        if self.tree is not None:
            self.tree.set_allowed(filters.allowed)
            self._inflate()
            self.tree.header()

    def _inflate(self) -> None:
        """Boxes in the tree have room for margins: two of them meet where the bodies' are within their margin."""
        inflation = self.roster.margin.copy()
        pairs = np.stack([self.filters.margin_keys >> 32, self.filters.margin_keys & 0xFFFFFFFF], axis=1)
        np.maximum.at(inflation, pairs, 0.5 * self.filters.margins[:, None])
        changed = np.flatnonzero((inflation != self._inflation) & self.roster.alive)
        self._inflation, self.has_margins = inflation, bool(inflation.any())
        if len(changed):
            assert self.tree is not None
            self.tree.move(changed, self._tree_boxes(changed))

    def _tree_boxes(self, bodies: np.ndarray) -> np.ndarray:
        """(k, 6) boxes of bodies (k,), ascending, with room for their margins, rounded outwards."""
        parts = self.parts
        is_whole = parts.all_of_one_part and len(bodies) == len(parts.boxes)
        boxes = parts.boxes if is_whole else parts.body_boxes(bodies)
        return widened(boxes, self._inflation[bodies]) if self.has_margins else boxes

    # --- what there is --------------------------------------------------------------------------

    @property
    def shapes(self) -> list[Shape]:
        """The distinct ones.   shape_of : (n,) which of them each body has."""
        return self.parts.shapes

    @property
    def shape_of(self) -> np.ndarray:
        return self.parts.shape_of

    @property
    def meshed(self) -> np.ndarray:
        """(n,) bool: bodies without convex parts: meshes, bodies with a mesh, regions."""
        return self.parts.meshed

    def take_work(self) -> dict:
        """{what: number} of what was brought up to date since this was last called."""
        work, self._work = self._work, _NO_WORK.copy()
        return work if self.tree is None else work | self.tree.take_work()

    @property
    def nbytes(self) -> int:
        """Memory of tables, boxes and tree [bytes], without that of shapes."""
        return self.parts.nbytes + (0 if self.tree is None else self.tree.nbytes)

    def posed_parts(self) -> tuple[PosedParts, np.ndarray, np.ndarray]:
        """(all parts, (parts,) the body of each, (n + 1,) the first part of each body and the number of all)."""
        parts = self.parts
        parts.table.build_trees(parts.row_of)
        all_parts = PosedParts(parts.table, parts.poses, parts.row_of, self.X_WBs[parts.body_of], parts.X_BP)
        return all_parts, parts.body_of, parts.first

    def candidates(self, margin: float) -> np.ndarray:
        """(k, 2) positions of bodies that are to be tested, sorted: not filtered, boxes within margin [m], and the
        margins of bodies and pairs.
        """
        with self._lock.now:  # what the tree keeps of pairs
            return np.empty((0, 2), dtype=np.int64) if self.tree is None else self.tree.pairs(margin)

    def first_candidates(self) -> np.ndarray:
        """(k, 2) the first candidates of margin 0, sorted; no pairs of Worlds of few bodies, whose candidates are known
        as soon, with margins, or with meshes, which are asked last.
        """
        if self.tree is None or self.has_margins or self._any_meshed or len(self.roster.ids) < _MIN_SCANNED:
            return np.empty((0, 2), dtype=np.int64)
        with self._lock.now:
            return self.tree.first_pairs(_SCANNED, _FIRST_PAIRS)

    def margins_of(self, pairs: np.ndarray) -> np.ndarray:
        """(k,) the margins [m] of pairs (k, 2), i < j: their own, or the sum of both bodies'."""
        margins = self.roster.margin[pairs].sum(axis=1)
        keys = self.filters.margin_keys
        if len(keys) and len(pairs):
            wanted = (pairs[:, 0] << 32) + pairs[:, 1]
            at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            margins = np.where(keys[at] == wanted, self.filters.margins[at], margins)
        return margins

    def posed_shapes(self, pairs: np.ndarray) -> tuple[Picked, Picked, np.ndarray, np.ndarray]:
        """(A, B, X_WA, X_WB) of pairs (k, 2) of positions, as batches of pair queries take them."""
        if self._shape_set is None:
            self._shape_set = ShapeSet(list(self.shapes))
        a, b = pairs.T
        X_WA, X_WB = self.X_WBs[a], self.X_WBs[b]
        return self._shape_set[self.shape_of[a]], self._shape_set[self.shape_of[b]], X_WA, X_WB

    def convex_sets_of(self, pairs: np.ndarray) -> tuple[ShapeTable, np.ndarray]:
        """(table, (k, 2) rows of the table) of pairs (k, 2) of positions of bodies, all single convex sets."""
        return self.parts.table, self.parts.row_of[self.parts.first[pairs]]

    def bodies_named(self, *positions: np.ndarray) -> BodiesAsTheyStood:
        """The bodies at positions that results name, with their poses now; all bodies of a few."""
        if len(self.X_WBs) <= _MAX_COPIED:
            return BodiesAsTheyStood(self.roster, np.arange(len(self.X_WBs)), self.X_WBs.copy())
        is_named = np.zeros(len(self.roster.ids), dtype=bool)
        for some in positions:
            is_named[some] = True
        (named,) = is_named.nonzero()
        return BodiesAsTheyStood(self.roster, named, self.X_WBs.take(named, axis=0))

    def to_ids(self, rows: np.ndarray) -> BodiesAsTheyStood:
        """The bodies at the positions that rows name; in the rows, in place, their ids."""
        a, b = rows["a"].astype(np.intp), rows["b"].astype(np.intp)  # what numpy would make of them at each use
        bodies = self.bodies_named(a, b)
        rows["a"], rows["b"] = self.roster.ids[a], self.roster.ids[b]
        return bodies

    def answer(
        self, candidates: np.ndarray, limit: float, *, boolean: bool, stop_at_hit: bool, threads: int = 1
    ) -> Answer:
        """Rows of candidates (k, 2).

        limit : [m], as of `collide.distance`.   stop_at_hit : rows after the first hit may be missing.
        boolean : rows tell no more than ``hit``, ``how`` and ``iterations``, in no order.
        threads : at most so many answer; the answers are the same bits, whatever is missing with ``stop_at_hit``, too.
        """
        if stop_at_hit and len(candidates) > _MIN_SORTED:
            first = self._likeliest(candidates)
            answer = self._answer_in_pieces(candidates[first], limit, boolean, True, 1)
            if answer.rows["hit"].any():
                return answer
            rest = self._answer_in_pieces(np.delete(candidates, first, axis=0), limit, boolean, True, threads)
            return joined([answer, rest], boolean)
        return self._answer_in_pieces(candidates, limit, boolean, stop_at_hit, threads)

    def _likeliest(self, candidates: np.ndarray) -> np.ndarray:
        """Numbers of the candidates whose boxes overlap most, in sides of the smaller one."""
        some = np.arange(0, len(candidates), -(-len(candidates) // _MAX_COMPARED))
        a, b = (self.parts.body_boxes(bodies) for bodies in candidates[some].T)
        with np.errstate(invalid="ignore", divide="ignore"):
            overlap = (np.minimum(a[:, 3:], b[:, 3:]) - np.maximum(a[:, :3], b[:, :3])).min(axis=1)
            sides = np.minimum((a[:, 3:] - a[:, :3]).max(axis=1), (b[:, 3:] - b[:, :3]).max(axis=1))
            overlap = np.nan_to_num(overlap / sides, nan=0.0)
        return np.sort(some[np.argpartition(-overlap, _LIKELIEST)[:_LIKELIEST]])

    def _answer_in_pieces(
        self, candidates: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool, threads: int
    ) -> Answer:
        """Pieces of the same sizes whatever the number of threads; after one with a hit, others are left out."""
        starts = range(0, len(candidates), _PAIRS_AT_ONCE)
        if len(starts) < 2 or (threads < 2 and not stop_at_hit):
            return self._answer_piece(candidates, limit, boolean, stop_at_hit)
        answers: dict[int, Answer] = {}
        first_hit = [len(candidates)]

        def work(start: int) -> None:
            if stop_at_hit and start > first_hit[0]:
                return
            piece = candidates[start : start + _PAIRS_AT_ONCE]
            answers[start] = self._answer_piece(piece, limit, boolean, stop_at_hit)
            if stop_at_hit and answers[start].rows["hit"].any():
                first_hit[0] = min(first_hit[0], start)

        share(starts, work, threads)
        return joined([answers[start] for start in starts if start in answers and start <= first_hit[0]], boolean)

    def _answer_piece(self, candidates: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> Answer:
        if not self._any_meshed:
            return self._answer_unions(candidates, limit, boolean, stop_at_hit)
        meshed = self.parts.meshed[candidates].any(axis=1)
        convex = self._answer_unions(candidates[~meshed], limit, boolean, stop_at_hit)
        if stop_at_hit and convex.rows["hit"].any():
            return convex
        of_meshes = self._answer_meshes(candidates[meshed], limit, boolean, stop_at_hit)
        return joined([convex, Answer(of_meshes, 0, len(of_meshes), len(of_meshes))], boolean)

    # --- pairs with a mesh ----------------------------------------------------------------------

    def _answer_meshes(self, pairs: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> np.ndarray:
        """Rows of pairs of bodies with a mesh: pairs of the same two shapes share a batch."""
        answered = [np.zeros(0, dtype=PAIR_DTYPE)]
        chunk = _FIRST_CHUNK if stop_at_hit else len(pairs)
        for batch in batches_of_shapes(pairs, self.shape_of, len(self.shapes), chunk):
            answered.append(self._mesh_rows(batch, limit, boolean))
            if stop_at_hit and answered[-1]["hit"].any():
                break
        return np.concatenate(answered)

    def _mesh_rows(self, pairs: np.ndarray, limit: float, boolean: bool) -> np.ndarray:
        """Rows of pairs (k, 2) of bodies of the same two shapes. Raises UnsupportedQuery."""
        a, b = pairs.T
        A, B = self.shapes[self.shape_of[a[0]]], self.shapes[self.shape_of[b[0]]]
        if any(shape.is_region or shape.is_field for shape in (A, B)):
            rows = rows_of_pair(A, B, self.X_WBs[a], self.X_WBs[b], limit, depths=not boolean)
        elif boolean:
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
        with_mesh = candidates[self.parts.meshed[candidates].any(axis=1)]
        for pairs in batches_of_shapes(with_mesh, self.shape_of, len(self.shapes)):
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

    def _answer_unions(self, candidates: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> Answer:
        """`_answer_convex`; but rows of two unions of many parts are those of the pair by itself, where the limit rules
        out few of their parts.
        """
        parts = self.parts
        if boolean or parts.all_of_one_part:
            return self._answer_convex(candidates, limit, boolean, stop_at_hit)
        whole = self._part_trees.are_mostly_near(candidates, limit)
        answers = [self._answer_convex(candidates[~whole], limit, boolean, stop_at_hit)]
        for batch in batches_of_shapes(candidates[whole], self.shape_of, len(self.shapes)):
            asked, (a, b) = of_thread.asked, batch.T
            A, B = self.shapes[self.shape_of[a[0]]], self.shapes[self.shape_of[b[0]]]
            rows = rows_of_pair(A, B, self.X_WBs[a], self.X_WBs[b], limit)
            rows["a"], rows["b"] = a, b
            answers.append(Answer(rows, of_thread.asked - asked, len(rows), 0))
        return answers[0] if len(answers) == 1 else joined(answers, boolean)

    def _answer_convex(self, candidates: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> Answer:
        parts = self.parts
        if parts.all_of_one_part:  # parts are bodies, and their rows those of bodies
            rows = self._rows_of_parts(candidates, limit, boolean, stop_at_hit)
            if not boolean:
                rows["a"], rows["b"] = candidates[:, 0], candidates[:, 1]
            return Answer(rows, len(rows), len(rows), 0)
        pairs, owner = self._part_trees.near(candidates, limit)
        rows = self._rows_of_parts(pairs, limit, boolean, stop_at_hit)
        pairs, owner = pairs[: len(rows)], owner[: len(rows)]
        starts = np.flatnonzero(np.diff(owner, prepend=-1))
        if boolean:
            return Answer(rows, len(rows), len(starts), 0)
        rows["a"], rows["b"] = candidates[owner, 0], candidates[owner, 1]
        rows["part_a"] = pairs[:, 0] - parts.first[rows["a"]]
        rows["part_b"] = pairs[:, 1] - parts.first[rows["b"]]
        spans = np.hstack([parts.spans(rows["a"][starts]), parts.spans(rows["b"][starts])])
        of_bodies = combine(rows, starts, spans, parts.table, parts.poses, parts.row_of)
        return Answer(of_bodies, len(rows), len(starts), 0)

    def _rows_of_parts(self, pairs: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> np.ndarray:
        parts = self.parts
        return run_pairs(
            parts.table, parts.poses, parts.row_of, pairs, boolean=boolean, limit=limit, stop_at_hit=stop_at_hit
        )


def joined(answers: list[Answer], boolean: bool) -> Answer:
    """One answer of several: rows by a and b, but of booleans."""
    rows = np.concatenate([np.zeros(0, dtype=PAIR_DTYPE), *(answer.rows for answer in answers)])
    if not boolean:
        rows = rows[np.lexsort((rows["b"], rows["a"]))]
    n_parts, n_bodies = sum(answer.convex_pairs for answer in answers), sum(answer.body_pairs for answer in answers)
    return Answer(rows, n_parts, n_bodies, sum(answer.mesh_pairs for answer in answers))


def batches_of_shapes(
    pairs: np.ndarray, shape_of: np.ndarray, n_shapes: int, chunk: int = 1 << 60
) -> Iterator[np.ndarray]:
    """Pairs (k, 2) of bodies in batches of the same two shapes; of each at most ``chunk`` first, then twice as many."""
    keys = shape_of[pairs[:, 0]] * n_shapes + shape_of[pairs[:, 1]]
    order = np.argsort(keys, kind="stable")
    for same in np.split(order, np.flatnonzero(np.diff(keys[order])) + 1):
        size = max(chunk, 1)
        while len(same):
            yield pairs[same[:size]]
            same, size = same[size:], 2 * size
