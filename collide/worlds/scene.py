"""The bodies of a World and what filters say of them, packed for queries when one needs them."""

from __future__ import annotations

import contextlib
import copy
import itertools
from collections.abc import Iterable, Iterator, Sequence
from threading import get_ident
from typing import Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.foreign_arguments import foreign_arguments
from collide.base.fork_safe_lock import ForkSafeLock
from collide.base.lazy_modules import lazy_module
from collide.base.log import log_duration
from collide.errors import InvalidArgument
from collide.pairs.security_margin import checked_margin
from collide.shapes.shape import Shape, checked_shape
from collide.worlds.bodies import Body, Roster, WorldBodies
from collide.worlds.packed_world import STALE, PackedWorld, PairFilters
from collide.worlds.ready_shapes import make_ready

#: With triangles, for notebooks alone.
shape_html = lazy_module("collide.shapes.shape_html")
#: Bodies that a repr names.
_NAMED = 4


class WorldReading(NamedTuple):
    """A World as of a question.   version : number of changes so far.   X_WBs : (n, 4, 4) poses by position, copied.
    roster, filters : of the bodies; the same objects as long as nothing about them has changed.
    """

    version: int
    roster: Roster
    filters: PairFilters
    X_WBs: np.ndarray


class WorldScene:
    """Bodies that may touch, and pairs of bodies never to test. `collide.World` adds the questions.

    A change writes bodies, filters and margins under the lock, and is counted. A question reads a `PackedWorld` with
    every change so far, and is among its readers until answered: the next question brings tables without readers up to
    date in place, and copies tables with readers first.
    """

    def __init__(self) -> None:
        self._bodies = WorldBodies()
        self._allowed: dict[tuple[int, int], str] = {}
        self._pair_margins: dict[tuple[int, int], float] = {}
        self._partners: dict[int, set[int]] = {}
        self._pairs_changed = False
        self._begin_unread()

    def _begin_unread(self) -> None:
        """As if nothing had been asked yet."""
        self._lock, self._n_changes = ForkSafeLock(), 0
        #: Held by a reader that counts itself and looks at a version, by a change that marks tables STALE and looks for
        #: readers. Without Python's lock either could see the other's memory from before.
        self._glance = ForkSafeLock()
        #: Tables of the bodies, made last; those that questions begin with: of before the changes of a `changes` block.
        self._packed: PackedWorld | None = None
        self._published: PackedWorld | None = None
        #: The lock and the thread in a `changes` block; the thread that asked first; whether another one has asked.
        self._changer: tuple[Any, int] | None = None
        self._first_asker: int | None = None
        self._is_shared = False
        #: How often what is said of pairs has changed; the roster and this number of which filters were read last.
        self._n_pair_changes = 0
        self._read_filters: tuple[Roster, int, PairFilters] | None = None

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along: bodies, names and what is said of pairs. The rest is made again."""
        with self._lock.now:
            return {
                "_bodies": copy.copy(self._bodies), "_allowed": dict(self._allowed),
                "_pair_margins": dict(self._pair_margins), "_partners": copy.deepcopy(self._partners),
                "_pairs_changed": False,
            }

    def __setstate__(self, state: dict) -> None:
        vars(self).update(state)
        self._begin_unread()

    @contextlib.contextmanager
    def changes(self) -> Iterator[None]:
        """Several changes as one: ``with world.changes(): ...``.

        Questions of other threads are answered as of before the block until the block ends, without a wait; later
        questions see all changes of the block. Questions within the block see the changes so far. Changes by other
        threads, and their reads of `body`, `ids`, `names` and `allowed`, wait for the end. Blocks may be nested. An
        error within ends the block: changes made before stay, and are seen as a whole.

        Notes
        -----
        Once another thread has asked, the changing thread makes the tables, beside the tables being read: O(n) bytes
        are copied for n bodies, 0.6 kB each. Before, a block copies nothing, and the first question of another thread
        waits for the end: a block that itself waits for such a thread waits for ever.
        """
        with self._lock.now:
            if self._is_in_block():
                yield
                return
            others_ask = self._is_shared or self._first_asker not in (None, get_ident())
            # Without tables to begin with, the first question of another thread waits for the lock.
            self._published = self._brought_up_to_date() if others_ask else None
            self._changer = self._lock.now, get_ident()
            try:
                yield
            finally:
                try:
                    if others_ask:
                        self._published = self._brought_up_to_date()
                finally:
                    self._changer = None

    @foreign_arguments
    def add(
        self, shape: Shape, X_WB=None, *, name: str | None = None, static: bool = False, group: int = 1,
        mask: int = 0xFFFF, margin: float = 0.0,
    ) -> int:
        """Add a body.

        Parameters
        ----------
        shape : any shape.
        X_WB : (4, 4) pose of the body in the world W [m], or what `collide.transforms.as_poses` takes for a pose; the
            identity if left out. Copied.
        name : not empty, unique in this World; "body 7" and so on if left out.
        static : never tested against other static bodies.
        group, mask : bit sets of up to 32 bits: the groups of the body, and the groups to test the body against.
        margin : [m], ≥ 0: as of `set_margin`.

        Returns
        -------
        The body's id, an integer never used again. Ids ascend. About 3 µs.

        Raises
        ------
        InvalidArgument, InvalidPose : naming the argument and the value; nothing is added.
        """
        if margin.__class__ is not float or margin != 0.0:
            margin = checked_margin("World.add: margin", margin)
        with self._lock.now:
            identity = self._bodies.add(shape, X_WB, name, static, group, mask, margin)
            self._n_changes += 1
            return identity

    def add_many(
        self, shapes: Shape | Sequence[Shape], X_WBs, *, names: Sequence[str | None] | None = None, static=False,
        group=1, mask=0xFFFF, margin=0.0,
    ) -> np.ndarray:
        """Add N bodies at once, as N calls of `add`.

        Parameters
        ----------
        shapes : any shape, of all, or N of them.
        X_WBs : (N, 4, 4) their poses in the world W [m], or (4, 4) of all. They are copied.
        names : (N,) as of `add`, ``None`` where a body is to be "body 7" and so on; or ``None`` for all.
        static, group, mask, margin : as of `add`: of all, or lists, tuples or arrays (N,).

        Returns
        -------
        (N,) int64 ids, ascending. About 0.5 µs a body, with names, bits and margins of their own 1 µs; the next query
        takes 2 µs a body for tables and tree, as after `add`.

        Raises
        ------
        InvalidArgument, InvalidPose : naming the argument, the place and the value; nothing is added.
        """
        with self._lock.now:
            ids = self._bodies.add_many(shapes, X_WBs, names, static, group, mask, margin)
            self._n_changes += 1
            return ids

    def replace(self, body: int | str, shape: Shape) -> None:
        """Give a body another shape: later questions are answered as if the body had been added with this shape.

        Its id, name, pose, margins, filters and sleep stay. The tree of a cloud or a mesh is made here, before anybody
        sees the shape. Tables and box-tree of the World are made anew, in about 2 µs a body: by the next question, or
        here once another thread has asked, so that questions of others do not wait. Results keep the shape of their
        time.

        Parameters
        ----------
        body : its id or name.
        shape : any shape.

        Raises
        ------
        UnknownBody, InvalidArgument
        """
        self._bodies.id_of(body)
        make_ready(checked_shape("World.replace: shape", shape))
        with self.changes():
            self._bodies.replace(self._bodies.id_of(body), shape)
            self._n_changes += 1

    def remove(self, body: int | str) -> None:
        """Take a body out, and what was allowed for it.

        Parameters
        ----------
        body : its id or name.

        Raises
        ------
        UnknownBody
        """
        with self._lock.now:
            identity = self._bodies.id_of(body)
            self._bodies.remove(identity)
            for partner in self._partners.pop(identity, ()):
                pair = min(identity, partner), max(identity, partner)
                self._allowed.pop(pair, None)
                self._pair_margins.pop(pair, None)
                self._partners[partner].discard(identity)
            self._n_changes += 1

    def set_pose(self, body: int | str, X_WB) -> None:
        """Move a body. About 2 µs.

        Parameters
        ----------
        body : its id or name.
        X_WB : (4, 4) its new pose in the world W [m]; it is copied.

        Raises
        ------
        UnknownBody, InvalidPose
        """
        with self._lock.now:
            identity = self._bodies.id_of(body)
            if self._packed is not None and self._packed.shares_poses:
                self._may_change(self._packed)
            self._bodies.move(identity, X_WB)
            self._n_changes += 1

    def set_poses(self, bodies: Iterable[int | str], X_WBs) -> None:
        """Move k bodies, as a single change: no question of another thread sees some moved. About 0.02 µs a body, by
        ids.

        Parameters
        ----------
        bodies : (k,) ids, best as integers or an integer array, or names. Of a body named twice the last pose counts.
        X_WBs : (k, 4, 4) their new poses in the world W [m], in this order; they are copied.

        Raises
        ------
        UnknownBody, InvalidPose : then no body has moved.
        """
        with self._lock.now:
            if self._packed is not None and self._packed.shares_poses:
                self._may_change(self._packed)
            self._bodies.move_many(bodies, X_WBs)
            self._n_changes += 1

    def sleep(self, bodies: Iterable[int | str]) -> None:
        """Put bodies to sleep: a pair of two bodies asleep or static is not tested until one of them is woken.

        Sleeping bodies count in all other questions, and may be moved without waking.

        Parameters
        ----------
        bodies : ids or names.

        Raises
        ------
        UnknownBody : then no body has been put to sleep.
        """
        self._set_sleeping(bodies, True)

    def wake(self, bodies: Iterable[int | str]) -> None:
        """Wake sleeping bodies; others stay as they are.

        Parameters
        ----------
        bodies : ids or names.

        Raises
        ------
        UnknownBody : then no body has been woken.
        """
        self._set_sleeping(bodies, False)

    def _set_sleeping(self, bodies: Iterable[int | str], asleep: bool) -> None:
        with self._lock.now:
            self._bodies.set_sleeping(bodies, asleep)
            self._n_changes += 1

    def set_margin(self, body: int | str, margin: float | None, *, partner: int | str | None = None) -> None:
        """Count a body as hit already at a distance.

        A pair hits in `collides` and `collisions`, and has contacts in `contacts`, at a distance of at most its
        margin: the sum of both bodies' margins, unless the pair has a margin of its own. Distances are told unchanged.

        Parameters
        ----------
        body : id or name.
        margin : [m], 0 or within 1e-50 … 1e50; ``None``, with ``partner``: the pair loses its own margin.
        partner : id or name of another body: the margin is for the pair.

        Raises
        ------
        UnknownBody, InvalidArgument
        """
        with self._lock.now:
            identity = self._bodies.id_of(body)
            if margin is not None:
                margin = checked_margin("World.set_margin: margin", margin)
            if partner is None:
                if margin is None:
                    raise InvalidArgument("World.set_margin: margin of a body must be a number [m], ≥ 0, got None")
                self._bodies.set_margin(identity, margin)
            else:
                self._set_pair_margin(self._pair("World.set_margin", body=body, partner=partner), margin)
            self._n_changes += 1

    def _set_pair_margin(self, pair: tuple[int, int], margin: float | None) -> None:
        if margin is None:
            self._pair_margins.pop(pair, None)
        else:
            self._pair_margins[pair] = margin
            self._note_partners(pair)
        self._pairs_changed = True
        self._n_pair_changes += 1

    def allow(self, a, b=None, *, reason: str = "allowed") -> None:
        """Never test a pair: ``allow("link3", "link4")``; or many, ``allow(matrix)``.

        Parameters
        ----------
        a, b : ids or names of two bodies; or a alone, a symmetric boolean matrix (n, n) over the n bodies in the order
            of `ids`, True for pairs that are not tested.
        reason : a few words; `stats` counts skipped pairs by reason. A pair keeps its first.

        Raises
        ------
        UnknownBody; InvalidArgument : the same body twice, or a matrix of another form.
        """
        checks.text("World.allow: reason", reason)
        with self._lock.now:
            if b is None:
                matrix = checks.plain_array("World.allow: a", a, "(bodies, bodies)", InvalidArgument)
                self._allow_matrix(matrix, reason)
            else:
                pair = self._pair("World.allow", a=a, b=b)
                self._allowed.setdefault(pair, reason)
                self._note_partners(pair)
            self._pairs_changed = True
            self._n_pair_changes += 1
            self._n_changes += 1

    def _pair(self, caller: str, **named: int | str) -> tuple[int, int]:
        """Ids of two bodies that arguments of these names give. Raises UnknownBody, InvalidArgument."""
        i, j = (self._bodies.id_of(body, f"{caller}: {name}") for name, body in named.items())
        if i == j:
            twice = f'{" and ".join(named)} are the same body {i}, "{self._bodies.name_of(i)}"'
            raise InvalidArgument(f"{caller}: {twice}; a body is never tested against itself")
        return min(i, j), max(i, j)

    def _note_partners(self, pair: tuple[int, int]) -> None:
        """Who is named together, so that removing a body looks at its own pairs alone."""
        for i, j in (pair, pair[::-1]):
            self._partners.setdefault(i, set()).add(j)

    def _allow_matrix(self, matrix: np.ndarray, reason: str) -> None:
        n = len(self)
        if matrix.shape != (n, n) or matrix.dtype != bool or (matrix != matrix.T).any():
            raise InvalidArgument(
                f"World.allow: a without b must be a symmetric boolean matrix, ({n}, {n}) for the {n} bodies, "
                f"got {matrix.dtype} {matrix.shape}"
            )
        ids = self.ids
        for i, j in np.argwhere(np.triu(matrix, 1)).tolist():
            self._allowed.setdefault((ids[i], ids[j]), reason)
            self._note_partners((ids[i], ids[j]))

    def __repr__(self) -> str:
        names = list(self.names.values())
        more = ", …" if len(names) > _NAMED else ""
        return f"World({len(names)} bodies{': ' if names else ''}{', '.join(names[:_NAMED])}{more})"

    def _repr_html_(self) -> str:
        with self._lock.now:
            ids = self._bodies.ids
            bodies = [self._bodies.body(identity) for identity in ids[: shape_html.MAX_DRAWN]]
        return shape_html.bodies_html(repr(self), bodies, len(ids))

    def __len__(self) -> int:
        return len(self._bodies)

    @property
    def ids(self) -> list[int]:
        """Ids of all bodies, ascending."""
        with self._lock.now:
            return self._bodies.ids

    @property
    def names(self) -> dict[int, str]:
        """Name of each body, by id."""
        with self._lock.now:
            return self._bodies.names

    def body(self, body: int | str) -> Body:
        """The body of this id or name, in its present state.

        Parameters
        ----------
        body : its id or name.

        Returns
        -------
        Body : ``id``, ``name``, ``shape``, ``X_WB``, ``static``, ``group`` and ``mask``; later moves do not reach them.

        Raises
        ------
        UnknownBody
        """
        with self._lock.now:
            return self._bodies.body(self._bodies.id_of(body))

    @property
    def allowed(self) -> dict[tuple[int, int], str]:
        """Pairs never tested: {(id, id): reason}, the smaller id first."""
        with self._lock.now:
            return dict(self._allowed)

    # --- as queries see them --------------------------------------------------------------------

    def _is_in_block(self) -> bool:
        """Whether a thread is in a `changes` block. A forked child has another lock, and not that thread: its tables
        may be half changed, and are made anew.
        """
        if self._changer is None or self._changer[0] is self._lock.now:
            return self._changer is not None
        self._changer = self._packed = self._published = None
        return False

    def _pack(self) -> PackedWorld:
        """What a question reads: ``with self._pack() as packed: ...``. No change reaches it within the block."""
        me, packed = get_ident(), self._published
        self._note_asker()
        while packed is not None:
            with self._glance.now:
                packed.readers.append(None)
                is_current = packed.version == self._n_changes
            if is_current:
                return packed
            is_in_block = self._is_in_block() and self._changer is not None and self._changer[1] != me
            if is_in_block and packed is self._published:
                return packed
            packed.readers.pop()
            packed = self._published if is_in_block else None
        with self._lock.now:
            packed = self._brought_up_to_date()
            packed.readers.append(None)
            return packed

    def _is_as_of(self, version: int) -> bool:
        """Whether nothing has changed since a reading of this version; a question that needs no tables asks so."""
        self._note_asker()
        return version == self._n_changes

    def _note_asker(self) -> None:
        me = get_ident()
        if me != self._first_asker:
            self._is_shared = self._first_asker is not None
            self._first_asker = self._first_asker or me

    def _read(self) -> WorldReading:
        """The World for a question that needs no tables, with every change so far; while another thread is within a
        `changes` block, of before the block.
        """
        self._note_asker()
        if self._lock.now.acquire(blocking=False):
            try:
                roster, filters = self._bodies.roster(), self._read_filters
                if filters is None or filters[0] is not roster or filters[1] != self._n_pair_changes:
                    filters = self._read_filters = roster, self._n_pair_changes, self._filters(roster)
                return WorldReading(self._n_changes, roster, filters[2], self._bodies.poses().copy())
            finally:
                self._lock.now.release()
        with self._pack() as packed:
            return WorldReading(packed.version, packed.roster, packed.filters, packed.X_WBs.copy())

    def _may_change(self, packed: PackedWorld) -> bool:
        """Whether nobody reads these tables, nor begins to: they are STALE until brought up to date. If not, they keep
        the poses that they have, and another copy is to be changed.
        """
        may_change = not self._is_in_block() or packed is not self._published
        if may_change:
            with self._glance.now:
                version, packed.version = packed.version, STALE
                if packed.readers:
                    may_change, packed.version = False, version
        if not may_change and packed.shares_poses:
            self._bodies.leave_poses()
        packed.shares_poses = False
        return may_change

    def _brought_up_to_date(self) -> PackedWorld:
        """The tables with all changes so far; the lock is held."""
        self._is_in_block()  # forgets tables of a block in the process before a fork
        packed = self._packed
        if packed is not None and packed.version == self._n_changes:
            return packed
        may_change = packed is not None and (packed.version == STALE or self._may_change(packed))
        self._packed = None  # an error leaves nothing half changed
        roster, X_WBs, is_moved = self._bodies.roster(), self._bodies.poses(), self._bodies.is_moved
        if packed is None or packed.roster.generation != roster.generation:
            with log_duration("tables and box-tree of a World of %d bodies made", len(self)):
                packed = PackedWorld(roster, X_WBs, self._filters(roster))
                is_moved[:] = False
        else:
            packed = packed if may_change else packed.copied()
            packed.update(roster, X_WBs, is_moved)
            if self._pairs_changed:
                packed.set_filters(self._filters(roster))
        self._pairs_changed = False
        packed.version, self._packed = self._n_changes, packed
        if not self._is_in_block():
            self._published = packed
        return packed

    def _filters(self, roster: Roster) -> PairFilters:
        """What is said of pairs, by position."""

        def positions(pairs: Iterable[tuple[int, int]]) -> np.ndarray:
            flat = np.fromiter(itertools.chain.from_iterable(pairs), dtype=np.int64)
            return np.searchsorted(roster.ids, flat).reshape(-1, 2)

        with_margin = positions(self._pair_margins)
        keys = (with_margin[:, 0] << 32) + with_margin[:, 1]
        order = np.argsort(keys)
        margins = np.fromiter(self._pair_margins.values(), dtype=np.float64)[order]
        return PairFilters(positions(self._allowed), list(self._allowed.values()), keys[order], margins)
