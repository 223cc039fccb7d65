"""World: bodies with names and poses, filters between them, and queries over all pairs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.base.threads import check_threads
from collide.certificates.make_certificate import certify
from collide.errors import InvalidArgument
from collide.results import PAIR_DTYPE, WorldResult
from collide.shapes.shape import Shape, checked_shape
from collide.transforms import as_poses
from collide.worlds.bodies import Body
from collide.worlds.hits import WorldHits
from collide.worlds.outside import answer_outside, questions_of
from collide.worlds.packed_world import PackedWorld
from collide.worlds.pair_queries import WorldPairs

__all__ = ["Body", "World"]

#: Casts need what other questions about convex scenes do not.
casts = lazy_module("collide.worlds.casts")
cast_arguments = lazy_module("collide.casts.cast_arguments")
foreign_names = lazy_module("collide.base.foreign_names")


class World(WorldPairs):
    """Bodies that may touch, and questions about them.

    A pair of bodies is tested unless both are static or asleep, their groups and masks exclude each other
    (tested when ``(group_A & mask_B) and (group_B & mask_A)``), or `allow` names the pair.

        world = collide.World()
        world.add(collide.Box((2, 1, 0.04)), pose_of_table, name="table", static=True)
        world.add(collide.Sphere(0.1), pose_of_ball, name="ball")
        for row, (a, b) in zip(rows := world.distances(max_distance=0.05), rows.names): ...

    Packed arrays and the box-tree are made when a query first needs them, and brought up to date by the next query, at
    a cost in proportion to the bodies added, moved or removed, but for copies of a few bytes a body. The list of near
    pairs is kept from query to query while few bodies change. Any number of threads may ask and change a World at once:
    a query is answered as of before a change or as of after, and `changes` makes several changes one.
    """

    if not TYPE_CHECKING:  # checkers are to know the methods, and no others

        def __getattr__(self, name: str):
            known = [method for method in dir(type(self)) if not method.startswith("_")]
            advice = "" if name.startswith("_") else foreign_names.advice_on_method(name, known)
            raise AttributeError(f"'World' object has no attribute {name!r}{advice}")

    def query(
        self, shape: Shape | Sequence[Shape], X_WS, max_distance: float = 0.0, *, threads: int = 1
    ) -> WorldResult:
        """Outside shapes against every body: pairs at most ``max_distance`` apart.

        Parameters
        ----------
        shape : any shape, or N of them.
        X_WS : (4, 4) or (N, 4, 4) poses in the world W [m]. A single shape or pose goes with all of the others.
        max_distance : [m], ≥ 0.
        threads : at most so many answer; the answers are the same bits.

        Returns
        -------
        WorldResult : rows sorted by question and b, the body's id; a is −1 for the first question, −2 for the second
            and so on, and normals point from the outside shape to the body. Filters, margins and sleep do not apply,
            and `stats` still tells of the last query of the whole World. O(log n) a question for bodies spread out.

        Raises
        ------
        InvalidArgument, InvalidPose; UnsupportedQuery : for pairs that `collide.distance` does not answer.
        """
        limit, threads = checks.limit("World.query: max_distance", max_distance), check_threads(threads)
        shapes = [shape] if isinstance(shape, Shape) else list(shape) if isinstance(shape, (list, tuple)) else None
        if shapes is None or not all(isinstance(item, Shape) for item in shapes):
            raise InvalidArgument(
                f"World.query: shape must be a shape or a list of shapes, got {checks.brief(shape)}"
            )
        X_WS = as_poses(X_WS, "World.query: X_WS")
        n = len(X_WS)
        if not isinstance(shape, Shape):
            n = checks.matched_count("World.query", shape=len(shapes), X_WS=len(X_WS))
        X_WS = np.array(np.broadcast_to(X_WS, (n, 4, 4)))
        rows = np.zeros(0, dtype=PAIR_DTYPE)
        with self._pack() as packed:
            if n:
                rows = answer_outside(packed, questions_of(shapes, X_WS), limit, threads)
            rows = rows[~(rows["lower"] > limit)]
            asked = rows["a"].copy()
            rows["a"] = rows["b"]
            bodies = packed.to_ids(rows)
        rows["a"] = -1 - asked
        for k in np.unique(asked).tolist() if n != 1 else [0]:
            name = "query" if n == 1 else f"query {k}"
            bodies[-1 - k] = Body(-1 - k, name, shapes[k % len(shapes)], X_WS[k], False, 0, 0)
        return WorldResult(rows, bodies, certify)

    def boxes_near(self, low_W, high_W, margin: float = 0.0) -> list[int]:
        """Bodies whose axis-aligned bounding boxes come near a box: the broadphase alone.

        Parameters
        ----------
        low_W, high_W : (3,) corners of the box in W [m], low ≤ high; infinite where the box has no end.
        margin : [m], ≥ 0: along every axis.

        Returns
        -------
        Ids, ascending. Boxes are rounded outwards by a few units in the last place; boxes of half-spaces have no end,
        and are near everything. O(log n) for bodies spread out.

        Raises
        ------
        InvalidArgument
        """
        margin = checks.limit("World.boxes_near: margin", margin)
        corners = [
            checks.array(f"World.boxes_near: {name}", corner, "(3,)", InvalidArgument)
            for name, corner in (("low_W", low_W), ("high_W", high_W))
        ]
        if any(corner.shape != (3,) or np.isnan(corner).any() for corner in corners) or (corners[0] > corners[1]).any():
            raise InvalidArgument(
                f"World.boxes_near: low_W and high_W must be corners (3,) of a box, low ≤ high, got "
                f"{checks.brief(low_W)} and {checks.brief(high_W)}"
            )
        with self._pack() as packed:
            if packed.tree is None:
                return []
            low, high = corners
            near = packed.tree.touching(np.concatenate([low, high]), margin)
            boxes = packed.parts.body_boxes(near)  # those of the tree have room for margins
            meets = ((boxes[:, :3] - margin <= high) & (low - margin <= boxes[:, 3:])).all(axis=1)
            return packed.roster.ids[near[meets]].tolist()

    def bounding_boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """The axis-aligned bounding box of every body.

        Returns
        -------
        (ids, boxes) : (n,) int32 ascending, and (n, 6) float64, low x, y, z, high x, y, z in W [m], rounded outwards by
            a few units in the last place; infinite of half-spaces.
        """
        with self._pack() as packed:
            alive = np.flatnonzero(packed.roster.alive)
            return packed.roster.ids[alive], packed.parts.body_boxes(alive)

    def raycast(
        self, origins_W, directions_W, *, max_distance: float = math.inf, all_hits: bool = False,
        group: int | None = None, mask: int | None = None,
    ) -> WorldHits:
        """What rays meet first, or everything on their way.

        Parameters
        ----------
        origins_W : (3,) or (N, 3) where rays begin, in W [m].
        directions_W : (3,) or (N, 3) in W; they need not be unit vectors. A single origin or direction goes with all
            of the others.
        max_distance : [lengths of the direction], ≥ 0, as of `collide.raycast`.
        all_hits : every place where a ray meets the surface of a body, not only the first.
        group, mask : bit sets: bodies count with ``(group & mask_B) and (group_B & mask)``; ``None``: all of them.
            Static bodies and allowed pairs count like all others.

        Returns
        -------
        WorldHits : a row a ray, ``body`` the id of the first body met, −1 without a body; with ``all_hits`` a row for
            every place, by ray, distance and body, and ``starts``. What the rest means and promises:
            `collide.raycast`. `stats` stays unchanged.

        Raises
        ------
        InvalidArgument : as of `collide.raycast`.

        Notes
        -----
        Rays go through the box-tree, nearest box first: about O(log n) a ray for bodies spread out.
        """
        limit = checks.limit("World.raycast: max_distance", max_distance, "")
        origins, directions, _ = cast_arguments.checked_rays("World.raycast", origins_W, directions_W)
        which = casts.checked_filter("World.raycast", group, mask)
        all_hits = checks.true_or_false("World.raycast: all_hits", all_hits)
        with self._pack() as packed:
            rows, starts = casts.cast_rays(packed, origins, directions, limit, all_hits, which)
            return _hits(packed, rows, starts)

    def shape_cast(
        self, shape: Shape, X_WS, direction_W, *, max_distance: float = math.inf, start_normals: bool = False,
        group: int | None = None, mask: int | None = None,
    ) -> WorldHits:
        """The first body touched by an outside shape in motion along a direction.

        Parameters
        ----------
        shape : any shape but half-spaces.
        X_WS : (4, 4) or (N, 4, 4) its poses in the world W [m] before the motion.
        direction_W : (3,) or (N, 3) in W, of the motion; need not be a unit vector.
        max_distance : [lengths of the direction], ≥ 0, as of `collide.shape_cast`.
        start_normals : work out normals of bodies that touch at the start, as of `collide.shape_cast`.
        group, mask : as of `raycast`.

        Returns
        -------
        WorldHits : a row a cast, ``body`` the id of the first body touched, −1 without a body. Of several touched at
            the same place, the smallest id. What the rest means and promises: `collide.shape_cast`.

        Raises
        ------
        InvalidArgument, InvalidPose, UnsupportedQuery : as of `collide.shape_cast`.
        """
        limit = checks.limit("World.shape_cast: max_distance", max_distance, "")
        start_normals = checks.true_or_false("World.shape_cast: start_normals", start_normals)
        checked_shape("World.shape_cast: shape", shape)
        X_WS = as_poses(X_WS, "World.shape_cast: X_WS")
        directions, _ = cast_arguments.checked_directions("World.shape_cast", "direction_W", direction_W, "a cast")
        n = checks.matched_count("World.shape_cast", X_WS=len(X_WS), direction_W=len(directions.vectors))
        cast_arguments.refuse_unbounded("World.shape_cast: shape", shape)
        which = casts.checked_filter("World.shape_cast", group, mask)
        X_WS = np.ascontiguousarray(np.broadcast_to(X_WS, (n, 4, 4)))
        with self._pack() as packed:
            return _hits(
                packed, casts.cast_shape(packed, shape, X_WS, directions.repeated(n), limit, which, start_normals)
            )

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
        WorldHits : a row a point: ``body`` the id of the body with the least signed distance, −1 without a body,
            ``distance`` [m] to the body, below 0 for points inside, ``point`` its nearest point, ``normal`` from the
            point to the body. What these mean and promise: `collide.distance` of a point and a body.

        Raises
        ------
        InvalidArgument
        """
        limit = checks.limit("World.nearest: max_distance", max_distance)
        points = cast_arguments.checked_points("World.nearest", "points_W", points_W)
        which = casts.checked_filter("World.nearest", group, mask)
        with self._pack() as packed:
            return _hits(packed, casts.nearest_bodies(packed, points, limit, which))


def _hits(packed: PackedWorld, rows: np.ndarray, starts: np.ndarray | None = None) -> WorldHits:
    """Rows whose bodies are positions, −1 of none, with their ids."""
    ids = packed.roster.ids
    rows["body"] = np.append(ids, ids.dtype.type(-1))[rows["body"]]
    return WorldHits(rows, packed.roster, starts)
