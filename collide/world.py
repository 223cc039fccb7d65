"""World: bodies with names and poses, filters between them, and queries over all pairs."""

from __future__ import annotations

import copy
import math
import time

import numpy as np

from collide import argument_checks as checks
from collide.certificates.make_certificate import certify
from collide.contact.contact_rows import WorldContacts, no_rows
from collide.errors import InvalidArgument
from collide.lazy_modules import lazy_module
from collide.packed_world import QueryRecord
from collide.results import WorldResult
from collide.security_margin import checked_margin, within
from collide.shapes.shape import Shape
from collide.transforms import as_pose, as_poses
from collide.world_bodies import Body
from collide.world_hits import WorldHits
from collide.world_scene import WorldScene

__all__ = ["Body", "World"]

#: Contacts need what meshes need, which other questions about convex scenes do not.
contact_query = lazy_module("collide.contact.contact_query")
#: And so do casts.
casts = lazy_module("collide.world_casts")
world_contacts = lazy_module("collide.world_contacts")
cast_arguments = lazy_module("collide.casts.cast_arguments")


class World(WorldScene):
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
        super().__init__()
        self._stats: dict = {}
        self._last_query: QueryRecord | None = None

    def __getstate__(self) -> dict:
        """What a copy or a pickle takes along: the scene and `stats`."""
        return super().__getstate__() | {"_stats": copy.deepcopy(self.stats), "_last_query": None}

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
            return WorldContacts(no_rows(), packed.bodies_named(pairs))
        rows, counts = world_contacts.contacts_of_bodies(packed, pairs, margin, max_contacts)
        return WorldContacts(rows, packed.bodies_named(pairs[counts > 0]))

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

    def raycast(
        self, origins_W, directions_W, *, max_distance: float = math.inf, all_hits: bool = False,
        group: int | None = None, mask: int | None = None,
    ) -> WorldHits:  # fmt: skip
        """What rays meet first, or everything that they meet.

        Parameters
        ----------
        origins_W : (3,) or (N, 3) where rays begin, in W [m].
        directions_W : (3,) or (N, 3) in W; they need not be unit vectors. A single origin or direction goes with every
            one of the others.
        max_distance : [lengths of the direction], ≥ 0, as of `collide.raycast`.
        all_hits : every place where a ray meets the surface of a body, not only the first.
        group, mask : bit sets: bodies count with ``(group & mask_B) and (group_B & mask)``; None: all of them. Whether
            bodies are static, and which pairs are allowed, has no say.

        Returns
        -------
        WorldHits : a row a ray, ``body`` the id of the first body it meets, −1 for none; with ``all_hits`` a row for
            every place, by ray, distance and body, and ``starts``. What the rest means and promises:
            `collide.raycast`. `stats` stays as it is.

        Raises
        ------
        InvalidArgument : as of `collide.raycast`.

        Notes
        -----
        Rays go through the box-tree, nearest box first: about O(log n) a ray for bodies that are spread out.
        """
        limit = checks.limit("World.raycast: max_distance", max_distance, "")
        origins, directions, _ = cast_arguments.checked_rays("World.raycast", origins_W, directions_W)
        which = casts.checked_filter("World.raycast", group, mask)
        rows, starts = casts.cast_rays(self._pack(), origins, directions, limit, all_hits, which)
        return self._hits(rows, starts)

    def shape_cast(
        self, shape: Shape, X_WS, direction_W, *, max_distance: float = math.inf, group: int | None = None,
        mask: int | None = None,
    ) -> WorldHits:  # fmt: skip
        """The first body that an outside shape touches when it is moved along a direction.

        Parameters
        ----------
        shape : any shape but half-spaces.
        X_WS : (4, 4) or (N, 4, 4) its poses in the world W [m] before it moves.
        direction_W : (3,) or (N, 3) in W, of the motion; it need not be a unit vector.
        max_distance : [lengths of the direction], ≥ 0, as of `collide.shape_cast`.
        group, mask : as of `raycast`.

        Returns
        -------
        WorldHits : a row a cast, ``body`` the id of the first body touched, −1 for none. Of several touched at the same
            place the one with the smallest id. What the rest means and promises: `collide.shape_cast`.

        Raises
        ------
        InvalidArgument, InvalidPose, UnsupportedQuery : as of `collide.shape_cast`.
        """
        limit = checks.limit("World.shape_cast: max_distance", max_distance, "")
        if not isinstance(shape, Shape):
            raise InvalidArgument(f"World.shape_cast: shape must be a shape, got {checks.describe(shape)}")
        X_WS = as_poses(X_WS, "World.shape_cast: X_WS")
        directions, _ = cast_arguments.checked_directions("World.shape_cast", "direction_W", direction_W, "a cast")
        n = checks.matched_count("World.shape_cast", X_WS=len(X_WS), direction_W=len(directions.vectors))
        cast_arguments.refuse_unbounded("World.shape_cast: shape", shape)
        which = casts.checked_filter("World.shape_cast", group, mask)
        X_WS = np.ascontiguousarray(np.broadcast_to(X_WS, (n, 4, 4)))
        return self._hits(casts.cast_shape(self._pack(), shape, X_WS, directions.repeated(n), limit, which))

    def nearest(
        self, points_W, *, max_distance: float = math.inf, group: int | None = None, mask: int | None = None
    ) -> WorldHits:
        """The body nearest to a point.

        Parameters
        ----------
        points_W : (3,) or (N, 3) in W [m], within 1e50.
        max_distance : [m], ≥ 0: bodies farther than this do not count.
        group, mask : as of `raycast`.

        Returns
        -------
        WorldHits : a row a point: ``body`` the id of the body with the least signed distance, −1 for none, ``distance``
            [m] to it, below 0 for points inside, ``point`` its nearest point, ``normal`` from the point to it.
            What these mean and promise: `collide.distance` of a point and a body.

        Raises
        ------
        InvalidArgument
        """
        limit = checks.limit("World.nearest: max_distance", max_distance)
        points = cast_arguments.checked_points("World.nearest", "points_W", points_W)
        which = casts.checked_filter("World.nearest", group, mask)
        return self._hits(casts.nearest_bodies(self._pack(), points, limit, which))

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

    def _hits(self, rows: np.ndarray, starts: np.ndarray | None = None) -> WorldHits:
        """Rows whose bodies are positions, with their ids."""
        roster = self._pack().roster
        named = np.unique(rows["body"][rows["body"] >= 0])
        met = rows["body"] >= 0
        rows["body"][met] = roster.ids[rows["body"][met]]
        return WorldHits(rows, {int(roster.ids[k]): roster.names[k] for k in named.tolist()}, starts)


def _within(rows: np.ndarray, limit: float) -> np.ndarray:
    """(n,) bool: pairs that are not proven farther apart than the limit [m], also those whose bracket holds it."""
    return ~(rows["lower"] > limit)
