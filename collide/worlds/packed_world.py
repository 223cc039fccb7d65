"""A World as the kernels read worlds: flat tables of shapes, posed parts, boxes, and a box-tree, brought up to date on
changes.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import numpy as np

from collide.base.fork_safe_lock import ForkSafeLock
from collide.broadphase.bounding_boxes import widened
from collide.broadphase.box_tree import BoxTree
from collide.casts.posed_parts import PosedParts
from collide.lowering.shape_table import ShapeTable
from collide.shapes.shape_set import Picked, ShapeSet
from collide.worlds.bodies import BodiesAsTheyStood, Roster
from collide.worlds.posed_bodies import PosedBodies
from collide.worlds.world_part_pairs import PartTrees

#: Booleans about so many bodies or more ask pairs of so many bodies first, so many at most, before all others are
#: looked for: where bodies are crowded, one of them hits.
_MIN_SCANNED, _SCANNED, _FIRST_PAIRS = 256, 64, 32
#: The version of tables that are being changed, or whose poses are.
STALE = -1
_NO_WORK = {"added": 0, "removed": 0, "moved": 0}
#: Poses of so many bodies are copied in the time that it takes to find out which are named.
_MAX_COPIED = 128


class PairFilters(NamedTuple):
    """What is said of pairs of bodies, by position; a new object after every change.

    allowed : (k, 2) pairs that are never tested, i < j.   reasons : why, of each.
    margin_keys, margins : (m,) i·2^32 + j of pairs with a margin of their own, i < j, ascending, and the margins [m].
    """

    allowed: np.ndarray
    reasons: list[str]
    margin_keys: np.ndarray
    margins: np.ndarray


class PackedWorld(PosedBodies):
    """Bodies by position (0 … n − 1), each a run of convex parts. A question is a ``with`` block: `WorldScene._pack`.

    roster : the bodies.   X_WBs : (n, 4, 4) their poses.
    filters : of pairs.   parts : the parts.   tree : the box-tree over bodies; ``None`` before
    the first body.   has_margins : whether any body or pair has.   inflation : (n,) [m] by which boxes in the tree are
    larger, for margins.
    readers : as long as the number of questions reading the tables.   version : number of changes of the World up to
    these tables; STALE while nobody may read the tables.   shares_poses : whether the World moves bodies in X_WBs.
    """

    def __init__(self, roster: Roster, X_WBs: np.ndarray, filters: PairFilters):
        self.roster, self.filters = roster, filters
        self.readers: list[None] = []
        self.version, self.shares_poses = STALE, True
        super().__init__()
        self._lock = ForkSafeLock()
        self.tree: BoxTree | None = None
        self._shape_set: ShapeSet | None = None
        self.inflation = np.zeros(0)
        self._work = _NO_WORK.copy()
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
        self.inflation = np.append(self.inflation, np.zeros(len(new)))
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
        changed = np.flatnonzero((inflation != self.inflation) & self.roster.alive)
        self.inflation, self.has_margins = inflation, bool(inflation.any())
        if len(changed):
            assert self.tree is not None
            self.tree.move(changed, self._tree_boxes(changed))

    def _tree_boxes(self, bodies: np.ndarray) -> np.ndarray:
        """(k, 6) boxes of bodies (k,), ascending, with room for their margins, rounded outwards."""
        parts = self.parts
        is_whole = parts.all_of_one_part and len(bodies) == len(parts.boxes)
        boxes = parts.boxes if is_whole else parts.body_boxes(bodies)
        return widened(boxes, self.inflation[bodies]) if self.has_margins else boxes

    # --- what there is --------------------------------------------------------------------------

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
