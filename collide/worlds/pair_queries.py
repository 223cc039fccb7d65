"""What a World says about all pairs of its bodies: hits, distances, contacts, the nearest pair, and statistics."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.base.threads import check_threads
from collide.certificates.make_certificate import certify
from collide.contact.contact_rows import CONTACT_DTYPE, WorldContacts, no_rows
from collide.pairs.least_depths import DepthSearch, checked_depth, shorten_depths
from collide.pairs.security_margin import checked_margin, within
from collide.results import PAIR_DTYPE, WorldResult
from collide.worlds.minimum import nearest_pair
from collide.worlds.packed_world import PackedWorld
from collide.worlds.posed_bodies import Answer, PosedBodies, joined
from collide.worlds.record import QueryRecord
from collide.worlds.scene import WorldScene

if TYPE_CHECKING:
    from collide.worlds.overlaps import WorldOverlaps

#: Contacts need what meshes need, which other questions about convex scenes do not.
contact_query = lazy_module("collide.contact.contact_query")
world_contacts = lazy_module("collide.worlds.contacts")
world_overlaps = lazy_module("collide.worlds.overlaps")
#: Rows of `PAIR_DTYPE` without their fields.
_BYTES = np.dtype((np.void, PAIR_DTYPE.itemsize))
#: What statistics count of rows; rows up to this number are kept as they are.
_COUNTED = np.dtype([("hit", "?"), ("how", "<i4"), ("iterations", "i4")])
_MAX_ROWS = 256


class WorldPairs(WorldScene):
    """Questions about all pairs of bodies. `collide.World` adds those about shapes, rays and points from outside."""

    def __init__(self) -> None:
        super().__init__()
        self._stats: dict = {}
        self._last_query: QueryRecord | None = None

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along: the scene and `stats`."""
        return super().__getstate__() | {"_stats": copy.deepcopy(self.stats), "_last_query": None}

    def collides(self, *, security_margin: float = 0.0, threads: int = 1) -> bool:
        """Whether any tested pair hits; stops at the first hit.

        Parameters
        ----------
        security_margin : [m], ≥ 0, finite: pairs at most so far apart are hits, too, decided as by `collide.collide`;
            `distances` names the pairs. Added to the margins of bodies and pairs (`set_margin`). Pairs
            with a margin are all asked.
        threads : at most so many answer; the answers are the same bits.

        Returns
        -------
        bool. Pairs whose sign is open count as hits, as in `collide.collide`.

        Raises
        ------
        InvalidArgument; with a margin UnsupportedQuery for pairs that `collide.distance` does not answer.
        """
        margin = checked_margin("World.collides: security_margin", security_margin)
        started, threads = time.perf_counter(), check_threads(threads)
        with self._pack() as packed:
            return bool(np.count_nonzero(self._answer(packed, started, margin, threads, boolean=True)))

    def collisions(self, *, threads: int = 1, depth: DepthSearch = "quick") -> WorldResult:
        """Every hitting pair with its depth.

        Parameters
        ----------
        threads : at most so many answer; the answers are the same bits.
        depth : "least" to search the shortest translation of overlapping bodies, convex or not, as of
            `collide.distance`: one pair after another, 30 ms to 2 s each.

        Returns
        -------
        WorldResult : rows of `collide.results.PAIR_DTYPE` sorted by (a, b), ids of the bodies. Pairs within a margin of
            their own (`set_margin`) are among them, with ``hit`` False where they are apart.

        Raises
        ------
        UnsupportedQuery : for pairs that `collide.distance` does not answer; `unanswerable` names them.
        """
        started, threads, least = time.perf_counter(), check_threads(threads), checked_depth(depth)
        with self._pack() as packed:
            return _result(packed, self._answer(packed, started, 0.0, threads), least)

    def distances(
        self, max_distance: float = math.inf, *, threads: int = 1, depth: DepthSearch = "quick"
    ) -> WorldResult:
        """Every tested pair at most ``max_distance`` apart, hits included.

        Parameters
        ----------
        max_distance : [m], ≥ 0; infinity for all pairs. Margins of bodies and pairs have no say.
        threads : at most so many answer; the answers are the same bits.
        depth : as of `collisions`.

        Returns
        -------
        WorldResult : rows of `collide.results.PAIR_DTYPE` sorted by (a, b), ids of the bodies. Only pairs proven
            farther apart are left out: ``lower ≤ max_distance`` of all rows. Two half-spaces that meet have
            distance −inf.

        Raises
        ------
        InvalidArgument; UnsupportedQuery : for pairs that `collide.distance` does not answer; `unanswerable` names
        them.
        """
        limit = checks.limit("World.distances: max_distance", max_distance)
        started, threads, least = time.perf_counter(), check_threads(threads), checked_depth(depth)
        with self._pack() as packed:
            return _result(packed, self._answer(packed, started, limit, threads, margins=False), least)

    def minimum(self, max_distance: float = math.inf, *, threads: int = 1) -> WorldResult:
        """The tested pair of least signed distance, of several pairs with the least ids.

        Parameters
        ----------
        max_distance : [m], ≥ 0: pairs farther apart do not count. Margins of bodies and pairs have no say.
        threads : at most so many answer; the answers are the same bits.

        Returns
        -------
        WorldResult : a single row of `collide.results.PAIR_DTYPE`, or no row without a tested pair within
            ``max_distance``. Where brackets overlap, another pair may truly be nearer by less than their width. Found
            by branch and bound: pairs whose boxes cannot be as near are not asked. `stats` stays unchanged.

        Raises
        ------
        InvalidArgument; UnsupportedQuery : as of `distances`.
        """
        limit, threads = checks.limit("World.minimum: max_distance", max_distance), check_threads(threads)
        with self._pack() as packed:
            return _result(packed, nearest_pair(packed, limit, threads))

    def contacts(self, margin: float = 0.0, *, max_contacts: int = 8, threads: int = 1) -> WorldContacts:
        """Contacts of every tested pair within a margin; `stats` stays unchanged.

        Parameters
        ----------
        margin : [m], ≥ 0, finite: bodies up to so far apart are in contact, too. Added to the margins of bodies and
            pairs (`set_margin`).
        max_contacts : of each patch, ≥ 1.
        threads : at most so many answer; the answers are the same bits.

        Returns
        -------
        WorldContacts : rows of `collide.contact.contact_rows.CONTACT_DTYPE`, a row a contact, sorted by (a, b). What
            they say and promise: `collide.contacts`.

        Raises
        ------
        InvalidArgument; UnsupportedQuery : naming the bodies, where `collide.contacts` raises the error.
        """
        margin = contact_query.check_margin("World.contacts", margin)
        max_contacts = contact_query.check_max_contacts("World.contacts", max_contacts)
        threads = check_threads(threads)
        with self._pack() as packed:
            return _contacts(packed, margin, max_contacts, threads)

    def overlaps(self, *, threads: int = 1) -> WorldOverlaps:
        """How much bodies overlap: volume, centroid and areas of every tested pair that hits; `stats` stays unchanged.

        Parameters
        ----------
        threads : at most so many look for hits; volumes are added up in sequence.

        Returns
        -------
        WorldOverlaps : rows of `collide.worlds.overlaps.OVERLAP_DTYPE` sorted by (a, b), as `collide.overlap_volume`
            says. Hits without a volume to tell, of curved shapes, surfaces and unions, are listed in
            ``unanswered`` with the reason.

        Raises
        ------
        UnsupportedQuery : for pairs that `collide.collide` does not answer.

        Notes
        -----
        Milliseconds a pair, more with the number of facets in contact (docs/solids.md).
        """
        threads = check_threads(threads)
        with self._pack() as packed:
            return world_overlaps.overlaps_of(packed, threads)

    def unanswerable(self, max_distance: float = math.inf) -> list[tuple[int, int, str]]:
        """Pairs for which `distances` raises UnsupportedQuery.

        Allow these pairs, and the rest of the World is answered.

        Parameters
        ----------
        max_distance : [m], ≥ 0, as in `distances`.

        Returns
        -------
        [(id, id, reason), …], sorted; for instance some shapes against a mesh.
        """
        limit = checks.limit("World.unanswerable: max_distance", max_distance)
        with self._pack() as packed:
            ids = packed.roster.ids.tolist()
            return [(ids[a], ids[b], reason) for a, b, reason in packed.refused(packed.candidates(limit), limit)]

    @property
    def stats(self) -> dict:
        """What the last `collides`, `collisions` or `distances` tested, culled, skipped, decided and took.

        bodies, static, sleeping : numbers of bodies.   pairs : of all bodies, n(n − 1)/2.   skipped : {reason: pairs}.
        narrowphase : pairs of bodies answered.   convex_pairs : pairs of their convex parts answered.
        mesh_pairs : pairs of bodies with a mesh on either side, whole or as a part.
        hits, undecided : pairs.   how : {argument: pairs}.   gjk_iterations, epa_iterations : sums.
        updates : {what: number} brought up to date for the query: bodies added, removed, moved; leaves and nodes of the
            box-tree with new boxes, trees made anew.
        bytes_per_body : memory of tables and tree.   seconds : {pack, broadphase, narrowphase} [s].

        sum(skipped) + narrowphase = pairs, unless `collides` stopped at a hit; ``skipped["broadphase"]`` is missing
        where the hit came before all near pairs were looked for, of 256 bodies or more.
        """
        if (record := self._last_query) is not None:
            self._stats = record.stats()
            if self._last_query is record:
                self._last_query = None
        return self._stats

    # --- how they are answered ------------------------------------------------------------------

    def _answer(
        self, packed: PackedWorld, started: float, limit: float, threads: int, *, boolean: bool = False,
        margins: bool = True,
    ) -> np.ndarray:
        """Rows of all tested pairs within the limit [m], a and b positions.

        started : when the question was asked [s].   margins : add the margins of bodies and pairs.
        boolean : instead of rows a bool for each pair, up to a hit.
        """
        ready = time.perf_counter()
        answers: list[Answer] = []
        if boolean and not limit and len(first := packed.first_candidates()):
            culled = time.perf_counter()
            answers.append(packed.answer(first, 0.0, boolean=True, stop_at_hit=True))
            if np.count_nonzero(answers[0].rows["hit"]):  # an eighth of the time of `any`
                self._record(packed, answers[0], None, (started, ready, culled))
                return answers[0].rows["hit"]
        candidates = packed.candidates(limit)
        culled = time.perf_counter()
        rest = _without(candidates, first) if answers else candidates
        wanted: list[np.ndarray] = []
        for some, reach in by_margin(packed, rest, limit) if margins else [(slice(None), limit)]:
            is_boolean = boolean and not reach
            answer = packed.answer(rest[some], reach, boolean=is_boolean, stop_at_hit=is_boolean, threads=threads)
            answers.append(answer)
            wanted.append(wanted_rows(packed, answer.rows, reach, boolean, margins))
            if boolean and np.count_nonzero(wanted[-1]):
                break
        answer = answers[0] if len(answers) == 1 else joined(answers, boolean=True)
        self._record(packed, answer, len(candidates), (started, ready, culled))
        if len(wanted) == 1:
            return wanted[0]
        all_wanted = np.concatenate(wanted)
        return all_wanted if boolean else _sorted_by_pair(all_wanted, PAIR_DTYPE)

    def _record(
        self, packed: PackedWorld, answer: Answer, n_candidates: int | None, times: tuple[float, float, float]
    ) -> None:
        """What `stats` tells of a question that has just been answered.   times : started, packed, pairs known."""
        started, ready, culled = times
        rows, ended = answer.rows, time.perf_counter()
        if len(rows) > _MAX_ROWS:
            rows = rows[list(_COUNTED.names or ())].astype(_COUNTED)
        self._last_query = QueryRecord(
            packed, packed.roster, packed.filters, n_candidates, rows, answer.convex_pairs, answer.body_pairs,
            answer.mesh_pairs, packed.take_work(),
            {"pack": ready - started, "broadphase": culled - ready, "narrowphase": ended - culled},
        )


def _contacts(packed: PackedWorld, margin: float, max_contacts: int, threads: int) -> WorldContacts:
    """As `WorldPairs.contacts`."""
    pairs = packed.candidates(margin)
    if not len(pairs):
        return WorldContacts(no_rows(), packed.bodies_named(pairs))
    counts = np.zeros(len(pairs), dtype=np.int64)
    of_groups = []
    for some, limit in by_margin(packed, pairs, margin):
        rows, counts[some] = world_contacts.contacts_in_pieces(packed, pairs[some], limit, max_contacts, threads)
        of_groups.append(rows)
    rows = of_groups[0] if len(of_groups) == 1 else _sorted_by_pair(np.concatenate(of_groups), CONTACT_DTYPE)
    return WorldContacts(rows, packed.bodies_named(pairs[counts > 0]))


def _result(packed: PackedWorld, rows: np.ndarray, least: bool = False) -> WorldResult:
    """Of rows whose a and b are positions, in place.   least : search the least depths known."""
    if least:
        shorten_depths(rows, *packed.posed_shapes(np.stack((rows["a"], rows["b"]), axis=1)))
    return WorldResult(rows, packed.to_ids(rows), certify)


def _without(pairs: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Pairs (k, 2), sorted, less some of them."""
    keys, keys_of_some = ((of[:, 0] << 32) + of[:, 1] for of in (pairs, some))
    return np.delete(pairs, np.searchsorted(keys, keys_of_some), axis=0)


def by_margin(packed: PosedBodies, pairs: np.ndarray, margin: float) -> Iterator[tuple[np.ndarray | slice, float]]:
    """(rows of pairs with the same margin, this margin plus the margin given [m]); at least a single group."""
    if not packed.has_margins:
        yield slice(None), margin
        return
    limits, which = np.unique(margin + packed.margins_of(pairs), return_inverse=True)
    if not len(limits):
        yield slice(None), margin
    for k, limit in enumerate(limits.tolist()):
        yield np.flatnonzero(which.reshape(-1) == k), limit


def wanted_rows(packed: PosedBodies, rows: np.ndarray, limit: float, boolean: bool, margins: bool) -> np.ndarray:
    """The rows wanted by a question, or for booleans whether each row is a hit."""
    if not margins:
        not_farther = ~(rows["lower"] > limit)  # not proven to be, also where the bracket holds the limit
        return _picked(rows, not_farther)
    if not limit:
        return rows["hit"].copy() if boolean else _picked(rows, rows["hit"])
    shapes, shape_of, X_WBs = packed.shapes, packed.shape_of, packed.X_WBs

    def question(k: int):
        a, b = int(rows["a"][k]), int(rows["b"][k])
        return shapes[shape_of[a]], shapes[shape_of[b]], X_WBs[a], X_WBs[b]

    near = within(rows, limit, question)
    return near if boolean else _picked(rows, near)


def _picked(rows: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Rows (k,) picked by a mask (n,), byte by byte: field by field, a few rows take numpy 10 µs instead of 3."""
    return rows.view(_BYTES).compress(which).view(PAIR_DTYPE)


def _sorted_by_pair(rows: np.ndarray, dtype: np.dtype) -> np.ndarray:
    order = np.lexsort((np.arange(len(rows)), rows["b"], rows["a"]))
    return rows[order].astype(dtype, copy=False)
