"""World: bodies with names and poses, filters between them, and queries over all pairs."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Iterable

import numpy as np

from collide import argument_checks as checks
from collide.certificates.make_certificate import certify
from collide.contact.contact_rows import WorldContacts, no_rows
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.lazy_modules import lazy_module
from collide.log import log_duration
from collide.packed_world import PackedWorld, QueryRecord
from collide.results import WorldResult
from collide.security_margin import checked_margin, within
from collide.shapes.shape import Shape
from collide.transforms import as_pose
from collide.world_bodies import BodiesAsTheyStood, Body, WorldBodies

__all__ = ["Body", "World"]

#: Contacts need what meshes need, which other questions about convex scenes do not.
contact_query = lazy_module("collide.contact.contact_query")


class World:
    """Bodies that may touch, and the questions one asks of them.

    A pair of bodies is tested unless both are static, their groups and masks exclude each other
    (tested when ``(group_A & mask_B) and (group_B & mask_A)``), or `allow` names the pair.

        world = collide.World()
        world.add(collide.Box((2, 1, 0.04)), pose_of_table, name="table", static=True)
        world.add(collide.Sphere(0.1), pose_of_ball, name="ball")
        for row, (a, b) in zip(rows := world.distances(max_distance=0.05), rows.names): ...

    Packed arrays and the box-tree are made when a query first needs them, and again when bodies are added or removed,
    or pairs allowed: O(n log n) for n bodies. Moving k bodies refits the tree at the next query: O(n), of which what
    depends on the shapes O(k). A World is not safe to change from one thread while another asks.
    """

    def __init__(self) -> None:
        self._bodies = WorldBodies()
        self._allowed: dict[tuple[int, int], str] = {}
        self._packed: PackedWorld | None = None
        self._stats: dict = {}
        self._last_query: QueryRecord | None = None

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along: bodies, names and what is allowed. The rest is made again."""
        return {
            "_bodies": copy.copy(self._bodies), "_allowed": dict(self._allowed), "_packed": None,
            "_stats": copy.deepcopy(self.stats), "_last_query": None,
        }  # fmt: skip

    # --- bodies ---------------------------------------------------------------------------------

    def add(
        self, shape: Shape, X_WB=None, *, name: str | None = None, static: bool = False, group: int = 1,
        mask: int = 0xFFFF,
    ) -> int:  # fmt: skip
        """Add a body.

        Parameters
        ----------
        shape : any shape.
        X_WB : (4, 4) pose of the body in the world W [m], or what `collide.transforms.as_poses` takes for one; the
            identity if left out. It is copied.
        name : not empty, unique in this World; "body 7" and so on if left out.
        static : never tested against other static bodies.
        group, mask : bit sets of up to 32 bits: the groups it is in, and those it is tested against.

        Returns
        -------
        The body's id, an integer that is never used again. Ids ascend. About 3 µs.

        Raises
        ------
        InvalidArgument, InvalidPose : naming the argument and the value; nothing is added.
        """
        identity = self._bodies.add(shape, X_WB, name, static, group, mask)
        self._packed = None
        return identity

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
        if self._allowed:
            self._allowed = {pair: reason for pair, reason in self._allowed.items() if identity not in pair}
        self._packed = None

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
        """Move k bodies. About 0.1 µs a body, by ids.

        Parameters
        ----------
        bodies : (k,) ids, best as integers or an integer array, or names. Of a body named twice the last pose counts.
        X_WBs : (k, 4, 4) their new poses in the world W [m], in this order; they are copied.

        Raises
        ------
        UnknownBody, InvalidPose : then no body has moved.
        """
        self._bodies.move_many(bodies, X_WBs)

    def allow(self, a, b=None, *, reason: str = "allowed") -> None:
        """Never test a pair: ``allow("link3", "link4")``; or many, ``allow(matrix)``.

        Parameters
        ----------
        a, b : ids or names of two bodies; or a alone, a symmetric boolean matrix (n, n) over the n bodies in the order
            of `ids`, True for pairs that are not tested.
        reason : a few words; `stats` counts skipped pairs under it. A pair keeps its first.

        Raises
        ------
        UnknownBody; InvalidArgument : the same body twice, or a matrix of another form.
        """
        if b is None:
            matrix = checks.plain_array("World.allow: matrix", a, "(bodies, bodies)", InvalidArgument)
            self._allow_matrix(matrix, reason)
        else:
            i, j = self._bodies.id_of(a), self._bodies.id_of(b)
            if i == j:
                name = self._bodies.name_of(i)
                raise InvalidArgument(f'World.allow: "{name}" twice; a body is never tested against itself')
            self._allowed.setdefault((min(i, j), max(i, j)), str(reason))
        self._packed = None

    def _allow_matrix(self, matrix: np.ndarray, reason: str) -> None:
        n = len(self)
        if matrix.shape != (n, n) or matrix.dtype != bool or (matrix != matrix.T).any():
            raise InvalidArgument(
                f"World.allow: a matrix must be symmetric, boolean and ({n}, {n}) for the {n} bodies, "
                f"got {matrix.dtype} {matrix.shape}"
            )
        ids = self.ids
        for i, j in np.argwhere(np.triu(matrix, 1)).tolist():
            self._allowed.setdefault((ids[i], ids[j]), str(reason))

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
        """The body of this id or name, as it stands now.

        Parameters
        ----------
        body : its id or name.

        Returns
        -------
        Body : ``id``, ``name``, ``shape``, ``X_WB``, ``static``, ``group`` and ``mask``; later moves do not reach it.

        Raises
        ------
        UnknownBody
        """
        return self._bodies.body(self._bodies.id_of(body))

    # --- queries --------------------------------------------------------------------------------

    def collides(self, *, security_margin: float = 0.0) -> bool:
        """Whether any tested pair hits; stops at the first that does.

        Parameters
        ----------
        security_margin : [m], ≥ 0, finite: pairs at most so far apart are hits, too, decided as by `collide.collide`;
            which those are, `distances` says. Then every pair is asked.

        Returns
        -------
        bool. Pairs whose sign is open count as hits, as in `collide.collide`.

        Raises
        ------
        InvalidArgument; with a margin UnsupportedQuery for pairs that `collide.distance` does not answer.
        """
        margin = checked_margin("World.collides: security_margin", security_margin)
        if not margin:
            return bool(self._answer(0.0, boolean=True)["hit"].any())
        rows = self._answer(margin)
        packed = self._pack()
        shapes, X_WBs = packed.roster.shapes, packed.X_WBs

        def question(k: int):
            a, b = int(rows["a"][k]), int(rows["b"][k])
            return shapes[a], shapes[b], X_WBs[a], X_WBs[b]

        return bool(within(rows, margin, question).any())

    def collisions(self) -> WorldResult:
        """Every hitting pair with its depth.

        Returns
        -------
        WorldResult : rows of `collide.results.PAIR_DTYPE` sorted by (a, b), ids of the bodies.

        Raises
        ------
        UnsupportedQuery : for pairs that `collide.distance` does not answer; `unanswerable` names them.
        """
        rows = self._answer(0.0)
        return self._result(rows[rows["hit"]])

    def distances(self, max_distance: float = math.inf) -> WorldResult:
        """Every tested pair at most ``max_distance`` apart, hits included.

        Parameters
        ----------
        max_distance : [m], ≥ 0; infinity for all pairs.

        Returns
        -------
        WorldResult : rows of `collide.results.PAIR_DTYPE` sorted by (a, b), ids of the bodies. None is left out
            that is not proven farther apart: ``lower ≤ max_distance`` of all of them. Two half-spaces that meet have
            distance −inf.

        Raises
        ------
        InvalidArgument; UnsupportedQuery : for pairs that `collide.distance` does not answer; `unanswerable` names
        them.
        """
        limit = checks.limit("World.distances: max_distance", max_distance)
        rows = self._answer(limit)
        return self._result(rows[_within(rows, limit)])

    def contacts(self, margin: float = 0.0, *, max_contacts: int = 8) -> WorldContacts:
        """Contacts of every tested pair within a margin; `stats` stays as it is.

        Parameters
        ----------
        margin : [m], ≥ 0, finite: bodies up to so far apart are in contact, too.
        max_contacts : of each patch, ≥ 1.

        Returns
        -------
        WorldContacts : rows of `collide.contact.contact_rows.CONTACT_DTYPE`, one a contact, sorted by (a, b). What
            they say and promise: `collide.contacts`.

        Raises
        ------
        InvalidArgument; UnsupportedQuery : naming the bodies, where `collide.contacts` raises it.
        """
        margin = contact_query.check_margin("World.contacts", margin)
        max_contacts = contact_query.check_max_contacts("World.contacts", max_contacts)
        packed = self._pack()
        pairs = packed.candidates(margin)
        if not len(pairs):
            return WorldContacts(no_rows(), self._to_ids(no_rows()))
        try:
            rows, ends = contact_query.contact_batch(*packed.posed_shapes(pairs), len(pairs), margin, max_contacts)
        except UnsupportedQuery:
            self._name_refused(packed, pairs, margin, max_contacts)
            raise
        which = np.repeat(pairs, np.diff(ends, prepend=0), axis=0)
        rows["a"], rows["b"] = which[:, 0], which[:, 1]
        return WorldContacts(rows, self._to_ids(rows))

    def _name_refused(self, packed: PackedWorld, pairs: np.ndarray, margin: float, max_contacts: int) -> None:
        """Raise for the first pair (of positions) whose contacts are refused, with the bodies' names."""
        names = packed.roster.names
        for i, j in pairs.tolist():
            try:
                contact_query.contact_batch(*packed.posed_shapes(np.array([[i, j]])), 1, margin, max_contacts)
            except UnsupportedQuery as error:
                raise UnsupportedQuery(f'"{names[i]}" and "{names[j]}": {error}') from None

    def unanswerable(self, max_distance: float = math.inf) -> list[tuple[int, int, str]]:
        """Pairs for which `distances` raises UnsupportedQuery.

        Allow these pairs, and the rest of the World is answered.

        Parameters
        ----------
        max_distance : [m], ≥ 0, as in `distances`.

        Returns
        -------
        [(id, id, reason), …], sorted. Such are some shapes against a mesh.
        """
        limit = checks.limit("World.unanswerable: max_distance", max_distance)
        packed = self._pack()
        ids = packed.roster.ids.tolist()
        return [(ids[a], ids[b], reason) for a, b, reason in packed.refused(packed.candidates(limit), limit)]

    def query(self, shape: Shape, X_WS, max_distance: float = 0.0) -> WorldResult:
        """One outside shape S against every body: pairs at most ``max_distance`` apart.

        Parameters
        ----------
        shape : any shape.
        X_WS : (4, 4) its pose in the world W [m].
        max_distance : [m], ≥ 0.

        Returns
        -------
        WorldResult : rows sorted by b, the body's id; a is −1 for the outside shape, and normals point from it to the
            body. Filters do not apply, and `stats` stays that of the last query of the whole World. O(log n) for bodies
            that are spread out.

        Raises
        ------
        InvalidArgument, InvalidPose; UnsupportedQuery : for pairs that `collide.distance` does not answer.
        """
        limit = checks.limit("World.query: max_distance", max_distance)
        if not isinstance(shape, Shape):
            raise InvalidArgument(f"World.query: shape must be a shape, got {checks.describe(shape)}")
        X_WS = as_pose(X_WS, "World.query: X_WS").copy()
        rows = self._pack().against(shape, X_WS, limit)
        rows = rows[_within(rows, limit)]
        rows["a"] = rows["b"]
        bodies = self._to_ids(rows)
        rows["a"], bodies[-1] = -1, Body(-1, "query", shape, X_WS, False, 0, 0)
        return WorldResult(rows, bodies, certify)

    @property
    def allowed(self) -> dict[tuple[int, int], str]:
        """Pairs never tested: {(id, id): reason}, the smaller id first."""
        return dict(self._allowed)

    @property
    def stats(self) -> dict:
        """What the last `collides`, `collisions` or `distances` tested, culled, skipped, decided and took.

        bodies, static : numbers of bodies.   pairs : of all bodies, n(n − 1)/2.   skipped : {reason: pairs}.
        narrowphase : pairs of bodies answered.   convex_pairs : pairs of their convex parts answered.
        mesh_pairs : of the pairs of bodies, those of which one is a mesh or holds one.
        hits, undecided : pairs.   how : {argument: pairs}.   gjk_iterations, epa_iterations : sums.
        seconds : {pack, broadphase, narrowphase} [s].

        sum(skipped) + narrowphase = pairs, unless `collides` stopped at a hit.
        """
        if self._last_query is not None:
            self._stats, self._last_query = self._last_query.stats(), None
        return self._stats

    # --- how they are answered ------------------------------------------------------------------

    def _answer(self, limit: float, *, boolean: bool = False) -> np.ndarray:
        """Rows of all tested pairs within the limit [m], a and b positions; of a boolean rows up to the first hit."""
        started = time.perf_counter()
        packed = self._pack()
        ready = time.perf_counter()
        candidates = packed.candidates(limit)
        culled = time.perf_counter()
        answer = packed.answer(candidates, limit, boolean=boolean, stop_at_hit=boolean)
        ended = time.perf_counter()
        rows = answer.rows
        self._last_query = QueryRecord(
            packed, len(candidates), rows["hit"].copy(), rows["how"].copy(), rows["iterations"].copy(),
            answer.convex_pairs, answer.body_pairs, answer.mesh_pairs,
            {"pack": ready - started, "broadphase": culled - ready, "narrowphase": ended - culled},
        )  # fmt: skip
        return rows

    def _result(self, rows: np.ndarray) -> WorldResult:
        return WorldResult(rows, self._to_ids(rows), certify)

    def _to_ids(self, rows: np.ndarray) -> BodiesAsTheyStood:
        """The bodies at the positions that rows name; in the rows, in place, their ids."""
        packed = self._pack()
        is_named = np.zeros(len(packed.roster.ids), dtype=bool)
        is_named[rows["a"]] = is_named[rows["b"]] = True
        positions = np.flatnonzero(is_named)
        rows["a"], rows["b"] = packed.roster.ids[rows["a"]], packed.roster.ids[rows["b"]]
        return BodiesAsTheyStood(packed.roster, positions, packed.X_WBs[positions])

    def _pack(self) -> PackedWorld:
        moved = self._bodies.take_moved()
        if self._packed is None:
            with log_duration("tables and box-tree of a World of %d bodies made", len(self)):
                roster = self._bodies.roster()
                position = {identity: k for k, identity in enumerate(roster.ids.tolist())} if self._allowed else {}
                allowed = {(position[i], position[j]): reason for (i, j), reason in self._allowed.items()}
                self._packed = PackedWorld(roster, self._bodies.poses(), allowed)
        elif len(moved):
            self._packed.move(moved, self._bodies.poses()[moved])
        return self._packed


def _within(rows: np.ndarray, limit: float) -> np.ndarray:
    """(n,) bool: pairs that are not proven farther apart than the limit [m], also those whose bracket holds it."""
    return ~(rows["lower"] > limit)
