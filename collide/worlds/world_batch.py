"""The same bodies in N worlds that differ in poses: a single call answers for all N worlds.

Worlds are laid out side by side, as many at a time as stay in the cache, as the bodies of a single set of tables
(`PosedBodies`): poses and boxes are made in a kernel call each, near pairs of all worlds in a third call
(`pairs_in_worlds.py`), and pairs of all worlds are asked together. Rows are the rows of a `World`, byte for byte,
because no row depends on the rows asked in the same call.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from collide.base import argument_checks as checks
from collide.base.array_libraries import ToLibrary, library_of, to_library
from collide.base.threads import check_threads, share
from collide.broadphase.bounding_boxes import widened
from collide.broadphase.pairs_in_worlds import NearPairs
from collide.certificates.make_certificate import certify
from collide.errors import InvalidArgument
from collide.numerics.rigid_poses import are_rigid_matrices
from collide.pairs.security_margin import checked_margin
from collide.results import PAIR_DTYPE, WorldResult
from collide.transforms import LARGEST, SAFE_TOLERANCE, as_poses
from collide.worlds.bodies import BodiesAsTheyStood, Roster
from collide.worlds.minimum import lower_bounds
from collide.worlds.packed_world import PackedWorld
from collide.worlds.pair_queries import by_margin, wanted_rows
from collide.worlds.posed_bodies import PosedBodies
from collide.worlds.world import World

#: Worlds of together about so many bodies are laid out at a time: tables of so many stay in the cache.
_BODIES_AT_ONCE = 4096
#: Booleans ask so many pairs of each world at first, then eight times as many of the worlds without a hit.
_FIRST_PAIRS, _MORE = 4, 8
#: The least distance is looked for among so many pairs of a world at first: those of the nearest boxes.
_FIRST_NEAREST = 4
#: Relative: what a bound from boxes, or a distance within its bracket, may be off, as in `minimum.py`.
_ROUNDING = 2.0**-24


class WorldBatch:
    """Bodies of a `World` in N worlds that differ in poses, and questions about all of these worlds at once.

        batch = collide.WorldBatch(world, moving=["gripper", "cup"])
        hits = batch.collides(X_WBs)                      # X_WBs (N, 2, 4, 4) → (N,) bool
        rows = batch.distances(X_WBs, max_distance=0.05)  # rows[k]: the rows of world k

    Parameters
    ----------
    world : World
        Bodies, filters, margins and sleep as they are now; later changes of the World have no say.
    moving : sequence of m ids or names, optional
        The bodies with poses in the questions, in this order; others stand where they are in ``world``. All n bodies,
        in the order of ``world.ids``, if left out.

    Raises
    ------
    InvalidArgument, UnknownBody

    Notes
    -----
    Answers are those of N Worlds with these poses, byte for byte. A question takes O(n log n) a world for n bodies
    spread out along x, and O(k) for the k pairs whose boxes meet; docs/arrays.md says what was measured. Any number of
    threads may ask at once.
    """

    def __init__(self, world: World, moving=None):
        checks.instance("WorldBatch: world", world, World, "a collide.World")
        self._world = copy.copy(world)
        with self._world._pack() as packed:
            self._packed = packed
        self._moving = None if moving is None else self._positions_of(moving)
        self._free: list[_Worlds] = []

    def _positions_of(self, moving) -> np.ndarray:
        listed = checks.listed_entries("WorldBatch: moving", moving, "ids or names of bodies")
        ids = [self._world._bodies.id_of(body, f"WorldBatch: moving[{k}]") for k, body in enumerate(listed)]
        if len(set(ids)) < len(ids):
            raise InvalidArgument(f"WorldBatch: moving must name no body twice, got {checks.brief(moving)}")
        return np.searchsorted(self._packed.roster.ids, np.array(ids, dtype=np.int64))

    def __reduce__(self):
        return WorldBatch, (self._world, None if self._moving is None else self.ids)

    @property
    def ids(self) -> list[int]:
        """Ids of the bodies with poses in the questions, in this order."""
        ids = self._packed.roster.ids.tolist()
        return ids if self._moving is None else [ids[k] for k in self._moving]

    def collides(self, X_WBs, *, security_margin: float = 0.0, threads: int = 1, like: Any = None) -> Any:
        """Whether any tested pair hits, in each world.

        Parameters
        ----------
        X_WBs : (N, m, 4, 4) poses of the m moving bodies in the world W [m].
        security_margin : [m], as of `World.collides`.
        threads : at most so many answer; the answers are the same bits.
        like : "torch", "jax", "numpy" or an array of one of these libraries, as of `collide.to_library`.

        Returns
        -------
        (N,) bool. Pairs whose sign is open count as hits.

        Raises
        ------
        InvalidArgument, InvalidPose; with a margin UnsupportedQuery, as of `World.collides`.
        """
        margin = checked_margin("WorldBatch.collides: security_margin", security_margin)
        X_WBs, threads = self._poses("collides", X_WBs), check_threads(threads)
        library = "numpy" if like is None else library_of(like)
        hits = np.zeros(len(X_WBs), dtype=bool)

        def answer(worlds: _Worlds, piece: slice) -> None:
            hits[piece] = worlds.hits(margin)

        self._ask(X_WBs, answer, threads)
        return to_library(hits, library)

    def distances(self, X_WBs, max_distance: float = math.inf, *, threads: int = 1) -> WorldBatchResult:
        """Every tested pair at most ``max_distance`` apart, hits included, in each world.

        Parameters
        ----------
        X_WBs : (N, m, 4, 4) poses of the m moving bodies in the world W [m].
        max_distance : [m], ≥ 0; infinity for all pairs. Margins of bodies and pairs have no say.
        threads : at most so many answer; the answers are the same bits.

        Returns
        -------
        WorldBatchResult : rows as of `World.distances`, world after world.

        Raises
        ------
        InvalidArgument, InvalidPose, UnsupportedQuery : as of `World.distances`.
        """
        limit = checks.limit("WorldBatch.distances: max_distance", max_distance)
        return self._rows("distances", X_WBs, lambda worlds: worlds.rows_within(limit), threads)

    def minimum(self, X_WBs, max_distance: float = math.inf, *, threads: int = 1) -> WorldBatchResult:
        """The tested pair of least signed distance in each world, of several pairs with the least ids.

        Parameters
        ----------
        X_WBs : (N, m, 4, 4) poses of the m moving bodies in the world W [m].
        max_distance : [m], ≥ 0: pairs farther apart do not count.
        threads : at most so many answer; the answers are the same bits.

        Returns
        -------
        WorldBatchResult : as of `World.minimum` a row a world, or no row without a pair within ``max_distance``.

        Raises
        ------
        InvalidArgument, InvalidPose, UnsupportedQuery : as of `World.minimum`.

        Notes
        -----
        Pairs whose boxes cannot be as near as the nearest pair are not asked. O(p) a world for p tested pairs.
        """
        limit = checks.limit("WorldBatch.minimum: max_distance", max_distance)
        return self._rows("minimum", X_WBs, lambda worlds: worlds.nearest(limit), threads)

    # --- how they are answered ------------------------------------------------------------------

    def _poses(self, caller: str, X_WBs) -> np.ndarray:
        """(N, m, 4, 4) poses, checked. Raises InvalidArgument, InvalidPose."""
        what, m = f"WorldBatch.{caller}: X_WBs", len(self.ids)
        read = checks.array(what, X_WBs, f"(N, {m}, 4, 4)", InvalidArgument)
        if read.ndim != 4 or read.shape[1:] != (m, 4, 4):
            raise InvalidArgument(f"{what} must be (N, {m}, 4, 4), a pose for each moving body, got {read.shape}")
        read = np.ascontiguousarray(read)
        if read.size and not are_rigid_matrices(read.reshape(-1, 4, 4), SAFE_TOLERANCE, LARGEST):
            for k, X in enumerate(read):  # named by its world
                as_poses(X, f"{what}[{k}]")
        return read

    def _ask(self, X_WBs: np.ndarray, answer: Callable[[_Worlds, slice], None], threads: int) -> None:
        """Let ``answer`` answer for pieces of the worlds, laid out."""
        size = max(_BODIES_AT_ONCE // max(len(self._packed.roster.ids), 1), 1)

        def work(first: int) -> None:
            piece = slice(first, min(first + size, len(X_WBs)))
            try:
                worlds = self._free.pop()
            except IndexError:
                worlds = _Worlds(self._packed, size)
            worlds.place(X_WBs[piece], self._moving)
            answer(worlds, piece)
            self._free.append(worlds)

        if len(self._packed.roster.ids):
            share(range(0, len(X_WBs), size), work, threads)

    def _rows(self, caller: str, X_WBs, ask: Callable[[_Worlds], np.ndarray], threads: int) -> WorldBatchResult:
        X_WBs, threads = self._poses(caller, X_WBs), check_threads(threads)
        n, answers = len(self._packed.roster.ids), {}

        def answer(worlds: _Worlds, piece: slice) -> None:
            rows = ask(worlds)
            counts = np.bincount(rows["a"] // max(n, 1), minlength=piece.stop - piece.start)
            for side in ("a", "b"):
                rows[side] = self._packed.roster.ids[rows[side] % max(n, 1)]
            answers[piece.start] = rows, counts

        self._ask(X_WBs, answer, threads)
        parts = [answers[first] for first in sorted(answers)]
        rows = np.concatenate([np.zeros(0, dtype=PAIR_DTYPE), *(rows for rows, _ in parts)])
        counts = np.concatenate([counts for _, counts in parts]) if parts else np.zeros(len(X_WBs), dtype=np.int64)
        starts = np.concatenate([[0], np.cumsum(counts)])
        return WorldBatchResult(rows, starts, self._packed.roster, self._packed.X_WBs, self._moving, X_WBs.copy())


class WorldBatchResult(ToLibrary):
    """Rows of a question about N worlds, world after world, with the bodies as they stood.

    Parameters
    ----------
    rows : (k,) `collide.results.PAIR_DTYPE`, a and b the ids of bodies, sorted by world, a and b.
    starts : (N + 1,) int64, where the rows of each world begin, and their number.
    roster, X_WBs : the n bodies, and (n, 4, 4) their poses [m] in the World.
    moving, X_moving : (m,) positions of moving bodies, ``None`` for all; (N, m, 4, 4) their poses [m] in each world.

    Notes
    -----
    ``result[w]`` is the `WorldResult` of world w, ``result["distance"]`` a column of all rows, ``len(result)`` is N.
    """

    def __init__(
        self, rows: np.ndarray, starts: np.ndarray, roster: Roster, X_WBs: np.ndarray, moving: np.ndarray | None,
        X_moving: np.ndarray,
    ):
        self.rows, self.starts, self._roster, self._X_WBs = rows, starts, roster, X_WBs
        self._moving, self._X_moving = moving, X_moving

    @property
    def world(self) -> np.ndarray:
        """(k,) int64, the number of the world of each row."""
        return np.repeat(np.arange(len(self)), np.diff(self.starts))

    def __len__(self) -> int:
        return len(self.starts) - 1

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            return self.rows[key]
        w = checks.checked_index("WorldBatchResult: the number of a world", key, len(self))
        X_WBs = self._X_WBs.copy()
        X_WBs[slice(None) if self._moving is None else self._moving] = self._X_moving[w]
        bodies = BodiesAsTheyStood(self._roster, np.arange(len(X_WBs)), X_WBs)
        return WorldResult(self.rows[self.starts[w] : self.starts[w + 1]], bodies, certify)

    def __iter__(self) -> Iterator[WorldResult]:
        return (self[w] for w in range(len(self)))

    def __repr__(self) -> str:
        return f"WorldBatchResult({len(self)} worlds, {len(self.rows)} rows, {int(self.rows['hit'].sum())} hits)"


class _Worlds(PosedBodies):
    """Tables of several worlds side by side: body b of world w is at position w·n + b. A thread uses them at a time."""

    def __init__(self, packed: PackedWorld, size: int):
        super().__init__()
        n = len(packed.roster.ids)
        self._packed, self._n = packed, n
        self.X_WBs = np.tile(packed.X_WBs, (size, 1, 1))
        self.parts.append(packed.roster.shapes[:n] * size, self.X_WBs)
        self.parts.table.build_trees(self.parts.row_of)
        self.has_margins, self._any_meshed = packed.has_margins, bool(self.parts.meshed.any())
        self._count, self._is_moved = size, np.zeros(n * size, dtype=bool)
        assert packed.tree is not None
        self._near = NearPairs(packed.tree, n)

    def place(self, X_WBs: np.ndarray, moving: np.ndarray | None) -> None:
        """Take poses (k, m, 4, 4) of k worlds; ``moving`` as of `WorldBatch`."""
        self._count, n = len(X_WBs), self._n
        which = slice(None) if moving is None else moving
        self.X_WBs.reshape(-1, n, 4, 4)[: self._count, which] = X_WBs
        self._is_moved.reshape(-1, n)[: self._count, which] = True
        if self.parts.single is not None:
            self.parts.single.move(self._is_moved, self.X_WBs, None)
        else:
            moved = np.flatnonzero(self._is_moved)
            self.parts.move(moved, self.X_WBs)
            self._is_moved[moved] = False
        self._boxes = self.parts.body_boxes(np.arange(self._count * n))
        if self.has_margins:
            self._boxes = widened(self._boxes, np.tile(self._packed.inflation, self._count))

    def margins_of(self, pairs: np.ndarray) -> np.ndarray:
        """(k,) margins [m] of pairs, as of the World."""
        return self._packed.margins_of(pairs % self._n)

    def candidates(self, margin: float, worlds: np.ndarray | None = None) -> np.ndarray:
        """(k, 2) positions of bodies of the same world to be tested, sorted, as of `PackedWorld.candidates`.

        worlds : (k,) int64 numbers, ascending; all of them if left out.
        """
        return self._near.find(self._boxes, np.arange(self._count) if worlds is None else worlds, margin)

    def _answered(self, pairs: np.ndarray, limit: float, boolean: bool, margins: bool) -> np.ndarray:
        """Rows of pairs within the limit, and the margins of bodies and pairs; of booleans hits. Sorted by pair."""
        rows = []
        for some, reach in by_margin(self, pairs, limit) if margins else [(slice(None), limit)]:
            is_boolean = boolean and not reach
            answered = self.answer(pairs[some], reach, boolean=is_boolean, stop_at_hit=False).rows
            keep = wanted_rows(self, answered, reach, boolean, margins)
            rows.append(answered[keep] if boolean else keep)
        return rows[0] if len(rows) == 1 else np.concatenate(rows)

    def hits(self, margin: float) -> np.ndarray:
        """(k,) bool: whether any pair of the world hits, or comes within a margin [m]."""
        pairs = self.candidates(margin)
        world = pairs[:, 0] // self._n
        place = np.arange(len(pairs)) - np.searchsorted(world, np.arange(self._count))[world]
        hits, first, last = np.zeros(self._count, dtype=bool), 0, _FIRST_PAIRS
        while True:
            asked = (place >= first) & ~hits[world]
            if not asked.any():
                return hits
            near = self._answered(pairs[asked & (place < last)], margin, True, True)
            hits[near["a"] // self._n] = True
            first, last = last, last * _MORE

    def rows_within(self, limit: float) -> np.ndarray:
        """Rows of pairs at most ``limit`` [m] apart."""
        return self._answered(self.candidates(limit), limit, False, False)

    def nearest(self, limit: float) -> np.ndarray:
        """A row a world: its nearest pair, at most ``limit`` [m] apart, of several the first.

        Pairs whose boxes come within a margin are looked at; then, in the worlds whose nearest pair so far is farther
        apart than the margin, with a larger margin.
        """
        best, winner = np.full(self._count, np.inf), np.zeros(0, dtype=PAIR_DTYPE)
        worlds = np.arange(self._count)
        for margin in self._margins(limit):
            winner = self._nearest_within(margin, limit, worlds, best, winner)
            worlds = np.flatnonzero(best > margin)  # pairs farther apart than the margin have not all been compared
            if not len(worlds):
                break
        return winner

    def _margins(self, limit: float) -> Iterator[float]:
        """Margins to look within, in turn, as of `minimum.py`: 0, the extent over n, 4 times the last, ``limit``."""
        ends = self._boxes[np.isfinite(self._boxes).all(axis=1)]
        extent = float((ends[:, 3:].max(axis=0) - ends[:, :3].min(axis=0)).max()) if len(ends) else 0.0
        yield 0.0
        margin = extent / self._n
        while 0.0 < margin < min(limit, extent):
            yield margin
            margin *= 4.0
        if limit > 0.0:
            yield limit

    def _nearest_within(
        self, margin: float, limit: float, worlds: np.ndarray, best: np.ndarray, winner: np.ndarray
    ) -> np.ndarray:
        """The nearest pair of each world, from those so far and pairs of some worlds within a margin.

        Every pair has a lower bound by its boxes. Pairs of the least bounds are asked first; then all pairs whose bound
        does not exceed the least distance so far: no others can be as near.   best : (k,) distances so far, updated.
        """
        pairs = self.candidates(margin, worlds)
        bounds, world = lower_bounds(self, pairs), pairs[:, 0] // self._n
        remain = bounds <= limit
        first = _least_of_each(bounds, world, _FIRST_NEAREST)
        for asked in (first[remain[first]], None):
            if asked is None:
                with np.errstate(invalid="ignore"):  # of two half-spaces −∞
                    top = best + _ROUNDING * np.abs(best)
                asked = np.flatnonzero(remain & (bounds <= np.where(np.isfinite(top), top, best)[world]))
            remain[asked] = False
            rows = self.answer(pairs[asked], math.inf, boolean=False, stop_at_hit=False).rows
            rows = np.concatenate([winner, rows[rows["distance"] <= limit]])
            rows = rows[np.lexsort((rows["b"], rows["a"], rows["distance"], rows["a"] // self._n))]
            winner = rows[np.diff(rows["a"] // self._n, prepend=-1) != 0]
            best[winner["a"] // self._n] = winner["distance"]
        return winner


def _least_of_each(values: np.ndarray, group: np.ndarray, n: int) -> np.ndarray:
    """Places of the n least values of every group, fewer in small groups, ascending; groups stand in a row."""
    if not len(values):
        return np.zeros(0, dtype=np.int64)
    starts = np.flatnonzero(np.diff(group, prepend=-1))
    of_group = np.cumsum(np.diff(group, prepend=group[0]) != 0)
    remaining, places = values.copy(), []
    for _ in range(n):
        (equal,) = np.nonzero(remaining == np.minimum.reduceat(remaining, starts)[of_group])
        equal = equal[np.diff(of_group[equal], prepend=-1) != 0]  # the first of equal values
        equal = equal[remaining[equal] < np.inf]
        places.append(equal)
        remaining[equal] = np.inf
    return np.sort(np.concatenate(places))
