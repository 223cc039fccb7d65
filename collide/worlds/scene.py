"""The bodies of a World and what filters say of them, packed for queries when one needs them."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from collide.base import argument_checks as checks
from collide.base.log import log_duration
from collide.errors import InvalidArgument
from collide.pairs.security_margin import checked_margin
from collide.shapes.shape import Shape, checked_shape
from collide.worlds.bodies import Body, Roster, WorldBodies
from collide.worlds.packed_world import PackedWorld, PairFilters
from collide.worlds.world_part_pairs import updating


class WorldScene:
    """Bodies that may touch, and pairs of bodies never to test. `collide.World` adds the questions."""

    def __init__(self) -> None:
        self._bodies = WorldBodies()
        self._allowed: dict[tuple[int, int], str] = {}
        self._pair_margins: dict[tuple[int, int], float] = {}
        self._partners: dict[int, set[int]] = {}
        self._packed: PackedWorld | None = None
        self._pairs_changed = False

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along: bodies, names and what is said of pairs. The rest is made again."""
        return {
            "_bodies": copy.copy(self._bodies), "_allowed": dict(self._allowed),
            "_pair_margins": dict(self._pair_margins), "_partners": copy.deepcopy(self._partners), "_packed": None,
            "_pairs_changed": False,
        }

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
        return self._bodies.add(shape, X_WB, name, static, group, mask, margin)

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
        return self._bodies.add_many(shapes, X_WBs, names, static, group, mask, margin)

    def replace(self, body: int | str, shape: Shape) -> None:
        """Give a body another shape: later questions are answered as if the body had been added with this shape.

        Its id, name, pose, margins, filters and sleep stay. Tables and box-tree are made anew by the next question, in
        about 2 µs a body of the World. A question of another thread in progress is answered to the end with the former
        shape: no question sees half of a change. Results keep the shape of their time.

        Parameters
        ----------
        body : its id or name.
        shape : any shape.

        Raises
        ------
        UnknownBody, InvalidArgument
        """
        identity = self._bodies.id_of(body)
        checked_shape("World.replace: shape", shape)
        with updating():
            self._bodies.replace(identity, shape)

    def remove(self, body: int | str) -> None:
        """Take a body out, and what was allowed for it.

        Parameters
        ----------
        body : its id or name.

        Raises
        ------
        UnknownBody
        """
        identity = self._bodies.id_of(body)
        self._bodies.remove(identity)
        for partner in self._partners.pop(identity, ()):
            pair = min(identity, partner), max(identity, partner)
            self._allowed.pop(pair, None)
            self._pair_margins.pop(pair, None)
            self._partners[partner].discard(identity)

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
        self._bodies.move(self._bodies.id_of(body), X_WB)

    def set_poses(self, bodies: Iterable[int | str], X_WBs) -> None:
        """Move k bodies. About 0.02 µs a body, by ids.

        Parameters
        ----------
        bodies : (k,) ids, best as integers or an integer array, or names. Of a body named twice the last pose counts.
        X_WBs : (k, 4, 4) their new poses in the world W [m], in this order; they are copied.

        Raises
        ------
        UnknownBody, InvalidPose : then no body has moved.
        """
        self._bodies.move_many(bodies, X_WBs)

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
        self._bodies.set_sleeping(bodies, True)

    def wake(self, bodies: Iterable[int | str]) -> None:
        """Wake sleeping bodies; others stay as they are.

        Parameters
        ----------
        bodies : ids or names.

        Raises
        ------
        UnknownBody : then no body has been woken.
        """
        self._bodies.set_sleeping(bodies, False)

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
        identity = self._bodies.id_of(body)
        if margin is not None:
            margin = checked_margin("World.set_margin: margin", margin)
        if partner is None:
            if margin is None:
                raise InvalidArgument("World.set_margin: margin of a body must be a number [m], ≥ 0, got None")
            self._bodies.set_margin(identity, margin)
            return
        pair = self._pair("World.set_margin", body=body, partner=partner)
        if margin is None:
            self._pair_margins.pop(pair, None)
        else:
            self._pair_margins[pair] = margin
            self._note_partners(pair)
        self._pairs_changed = True

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
        if b is None:
            matrix = checks.plain_array("World.allow: a", a, "(bodies, bodies)", InvalidArgument)
            self._allow_matrix(matrix, reason)
        else:
            pair = self._pair("World.allow", a=a, b=b)
            self._allowed.setdefault(pair, reason)
            self._note_partners(pair)
        self._pairs_changed = True

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

    def __len__(self) -> int:
        return len(self._bodies)

    @property
    def ids(self) -> list[int]:
        """Ids of all bodies, ascending."""
        return self._bodies.ids

    @property
    def names(self) -> dict[int, str]:
        """Name of each body, by id."""
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
        return self._bodies.body(self._bodies.id_of(body))

    @property
    def allowed(self) -> dict[tuple[int, int], str]:
        """Pairs never tested: {(id, id): reason}, the smaller id first."""
        return dict(self._allowed)

    # --- as queries see them --------------------------------------------------------------------

    def _pack(self) -> PackedWorld:
        with updating():
            return self._brought_up_to_date()

    def _brought_up_to_date(self) -> PackedWorld:
        roster, X_WBs, is_moved = self._bodies.roster(), self._bodies.poses(), self._bodies.is_moved
        packed = self._packed
        if packed is None or packed.roster.generation != roster.generation:
            with log_duration("tables and box-tree of a World of %d bodies made", len(self)):
                packed = self._packed = PackedWorld(roster, X_WBs, self._filters(roster))
                is_moved[:] = False
        else:
            packed.update(roster, X_WBs, is_moved)
            if self._pairs_changed:
                packed.set_filters(self._filters(roster))
        self._pairs_changed = False
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
