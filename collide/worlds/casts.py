"""Rays, moved shapes and points against all bodies of a World, by its box-tree."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.broadphase.bounding_boxes import boxes_of
from collide.broadphase.box_tree import BoxTree
from collide.broadphase.boxes_ahead import SWEEP, bodies_ahead
from collide.casts.cast_batches import cast_batch
from collide.casts.convex_casts import CastRows
from collide.casts.directions import Directions
from collide.casts.items_ahead import nearest_first
from collide.casts.posed_parts import posed_parts
from collide.casts.ray_hits import RayEvents, first_of_each, joined
from collide.casts.ray_parts import TreeOfParts, candidate_parts, parts_met
from collide.casts.raycast import surfaces_met
from collide.errors import InvalidArgument
from collide.lowering.parts import bounding_parts_of
from collide.narrowphase.convex_batches import Question
from collide.pairs.batches import answer_batch
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.shape import Shape
from collide.worlds.hits import WORLD_HIT_DTYPE, empty_hits
from collide.worlds.packed_world import PackedWorld

#: A point, as a body of no extent.
POINT = ConvexHull(np.zeros((1, 3)))


#: So much of the t of a proven hit later bodies are cast beyond it.
_BEYOND = 2.0**-20


class Filter(NamedTuple):
    """Bodies counted by a question: (group & mask_B) and (group_B & mask).   group, mask : ``None`` for all."""

    group: int | None
    mask: int | None

    def skipped(self, packed: PackedWorld) -> np.ndarray:
        """(n,) int64: 1 of bodies that are left out."""
        roster = packed.roster
        if self.group is None and self.mask is None:
            return np.zeros(len(roster.ids), dtype=np.int64)
        counts = np.ones(len(roster.ids), dtype=bool)
        if self.group is not None:
            counts &= (roster.mask & self.group) != 0
        if self.mask is not None:
            counts &= (roster.group & self.mask) != 0
        return (~counts).astype(np.int64)


def checked_filter(caller: str, group, mask) -> Filter:
    """Raises InvalidArgument."""
    for name, value in (("group", group), ("mask", mask)):
        if value is not None and (not checks.is_integer(value) or not 0 <= int(value) < 2**32):
            raise InvalidArgument(
                f"{caller}: {name} must be an integer of up to 32 bits, or None for all bodies, "
                f"got {checks.brief(value)}"
            )
    return Filter(None if group is None else int(group), None if mask is None else int(mask))


# --- rays ---------------------------------------------------------------------------------------


def cast_rays(
    packed: PackedWorld, origins: np.ndarray, directions: Directions, limit: float, every: bool, which: Filter
) -> tuple[np.ndarray, np.ndarray | None]:
    """(rows, starts) of n rays: the first wall of each, or every one.   limit : of t in lengths of the directions."""
    n = len(origins)
    if packed.tree is None or not n:
        return empty_hits(0 if every else n), np.zeros(n + 1, dtype=np.int64) if every else None
    rows = None if every else np.empty(n, dtype=WORLD_HIT_DTYPE)
    asked = candidate_parts(_tree_of(packed), which.skipped(packed), origins, directions, limit, rows)
    if rows is not None and not len(asked):
        return rows, None
    parts, body_of, first = packed.posed_parts()
    is_meshed = packed.meshed[body_of[asked[:, 1]]]
    any_meshed = bool(is_meshed.any())
    convex = np.ascontiguousarray(asked[~is_meshed]) if any_meshed else asked
    events = parts_met(parts, convex, origins, directions, limit, every)
    part = convex[events.item, 1]
    bodies = body_of[part]
    events = events._replace(item=part - first[bodies])
    if any_meshed:
        pairs = np.unique(np.stack([body_of[asked[is_meshed, 1]], asked[is_meshed, 0]], axis=1), axis=0)
        on_meshes = list(_on_meshes(packed, pairs, origins, directions, limit, every))
        events = joined([events, *(some for some, _ in on_meshes)])
        bodies = np.concatenate([bodies, *(of_some for _, of_some in on_meshes)])
    return _as_rows(events, bodies, origins, directions, rows)


def _tree_of(packed: PackedWorld) -> TreeOfParts:
    parts, tree = packed.parts, packed.tree
    assert tree is not None
    parts.table.build_trees(parts.row_of)
    return TreeOfParts(parts.table, parts.poses, parts.row_of, tree, parts.first, packed.meshed.astype(np.int64))


def _on_meshes(packed: PackedWorld, pairs: np.ndarray, origins, directions: Directions, limit: float, every: bool):
    """(events, body of each) of pairs (body, ray) of meshes and bodies with a mesh, a shape's pairs together."""
    shape_of = packed.shape_of[pairs[:, 0]]
    for number in np.unique(shape_of).tolist():
        some = pairs[shape_of == number]
        body, ray = some[:, 0], some[:, 1]
        of_some = Directions(directions.vectors[ray], directions.exponents[ray])
        shape = packed.shapes[number]
        events = surfaces_met(shape, packed.X_WBs[body], origins[ray], of_some, limit, every=every)
        yield events._replace(ray=ray[events.ray]), body[events.ray]


def _as_rows(events: RayEvents, bodies: np.ndarray, origins, directions: Directions, rows: np.ndarray | None):
    """(rows, starts) of events and the positions of the bodies they are of.   rows : of all rays, to be filled; None:
    a row for every event."""
    n = len(origins)
    # Along a ray by t, then body, item and facet.
    order = np.lexsort((events.facet, events.item, bodies, events.t[:, 0], events.ray))
    events, bodies = events.of(order), bodies[order]
    starts = None
    if rows is None:
        starts = np.concatenate([[0], np.cumsum(np.bincount(events.ray, minlength=n))])
        rows = np.zeros(len(events.ray), dtype=WORLD_HIT_DTYPE)
        at: np.ndarray | slice = slice(None)
    else:
        bodies = bodies[np.flatnonzero(np.diff(events.ray, prepend=-1))]
        events = first_of_each(events)
        at = events.ray
    step = np.ldexp(directions.vectors[events.ray], directions.exponents[events.ray, None])
    columns = {
        "distance": events.t[:, 0], "lower": events.t[:, 1], "upper": events.t[:, 2], "normal": events.normal,
        "point": origins[events.ray] + events.t[:, :1] * step, "ray": events.ray, "body": bodies, "item": events.item,
        "facet": events.facet, "hit": True, "certified": events.certified,
    }
    for name, values in columns.items():
        rows[name][at] = values
    return rows, starts


# --- moved shapes -------------------------------------------------------------------------------


def cast_shape(
    packed: PackedWorld, shape: Shape, X_WS: np.ndarray, directions: Directions, limit: float, which: Filter,
    start_normals: bool,
) -> np.ndarray:
    """Rows of n casts of a shape at poses (n, 4, 4): the first body reached by each cast.

    Limits of later bodies are a little beyond the t proven for earlier bodies: a contact at the same t then lies
    before the limit, where the limit does not leave the contact open.
    """
    n = len(directions.vectors)
    rows = empty_hits(n)
    if packed.tree is None or not n:
        return rows
    questions = np.empty((n, SWEEP))
    questions[:, :6], questions[:, 6:9], questions[:, 9] = (
        _boxes_around(shape, X_WS), directions.vectors, directions.limits(limit)
    )
    pairs, bounds = bodies_ahead(packed.tree, questions)
    counts = which.skipped(packed)[pairs[:, 1]] == 0
    pairs, bounds = pairs[counts], bounds[counts]

    def answer(some: np.ndarray) -> CastRows:
        cast, body = pairs[some].T
        of_some = Directions(directions.vectors[cast], directions.exponents[cast])
        shapes = [packed.shapes[k] for k in packed.shape_of[body].tolist()]
        limits = np.minimum(questions[cast, 9], beyond[cast])
        return cast_batch(shape, shapes, X_WS[cast], packed.X_WBs[body], of_some, limits, start_normals)

    best, beyond, answers = np.full(n, np.inf), np.full(n, np.inf), []
    for some in nearest_first(pairs[:, 0], bounds, best):
        got = answer(some)
        known = np.flatnonzero(got.hit & got.proven)
        cast, (_, lower, upper) = pairs[some[known], 0], got.t[known].T
        np.minimum.at(best, cast, upper)
        np.minimum.at(beyond, cast, upper * (1.0 + _BEYOND) + 8.0 * (upper - lower))
        answers.append((some, got))
    if answers:
        _take_first(rows, pairs, answers, directions)
    return rows


def _boxes_around(shape: Shape, X_WS: np.ndarray) -> np.ndarray:
    """(n, 6) boxes around a shape at poses (n, 4, 4)."""
    parts = posed_parts(list(bounding_parts_of(shape)), X_WS)
    boxes = boxes_of(parts.table, parts.poses.rows, parts.shape_of).reshape(len(X_WS), -1, 6)
    return np.hstack([boxes[:, :, :3].min(axis=1), boxes[:, :, 3:].max(axis=1)])


def _take_first(rows: np.ndarray, pairs: np.ndarray, answers, directions: Directions) -> None:
    """Write the nearest hit of each cast."""
    some = np.concatenate([numbers for numbers, _ in answers])
    got = CastRows._make(np.concatenate(columns) for columns in zip(*(answer for _, answer in answers)))
    hits = np.flatnonzero(got.hit)
    cast, body = pairs[some[hits]].T
    order = np.lexsort((body, got.t[hits, 0], cast))
    hits, cast, body = hits[order], cast[order], body[order]
    # Events are numbered in this order, so that of bodies touched at once the first has the least number.
    number = np.arange(len(hits))
    events = RayEvents(
        cast, got.t[hits], got.normal[hits], number, got.item_b[hits], got.proven[hits], got.certified[hits]
    )
    first, row = first_of_each(events), np.unique(cast)
    t = np.ldexp(first.t, -directions.exponents[row, None])
    columns = {
        "distance": t[:, 0], "lower": t[:, 1], "upper": t[:, 2], "normal": first.normal,
        "point": got.point[hits[first.facet]], "body": body[first.facet], "item": first.item, "facet": -1, "hit": True,
        "certified": first.certified, "at_start": got.at_start[hits[first.facet]],
    }
    for name, values in columns.items():
        rows[name][row] = values


# --- points -------------------------------------------------------------------------------------


def nearest_bodies(packed: PackedWorld, points: np.ndarray, limit: float, which: Filter) -> np.ndarray:
    """Rows of the nearest body of each of n points, by signed distance.   limit : [m]."""
    n = len(points)
    rows = empty_hits(n)
    if packed.tree is None or not n:
        return rows
    skipped = which.skipped(packed)
    questions = np.zeros((n, SWEEP))
    questions[:, :3], questions[:, 9] = points, limit
    pairs = _near_boxes(packed, questions, skipped)
    X_WP = np.tile(np.eye(4), (n, 1, 1))
    X_WP[:, :3, 3] = points
    point, body = pairs.T
    if not len(point):
        return rows
    shapes = [packed.shapes[k] for k in packed.shape_of[body].tolist()]
    got = answer_batch(
        [POINT] * len(point), shapes, X_WP[point], packed.X_WBs[body], Question(False, np.inf, True)
    )
    order = np.lexsort((body, got["distance"], point))
    at = order[np.flatnonzero(np.diff(point[order], prepend=-1))]
    # Another body may be nearer where brackets overlap: what is proven is the least of both ends.
    starts = np.flatnonzero(np.diff(point, prepend=-1))
    lower, upper = np.full(n, np.inf), np.full(n, np.inf)
    lower[point[starts]] = np.minimum.reduceat(got["lower"], starts)
    upper[point[starts]] = np.minimum.reduceat(got["upper"], starts)
    at = at[~(lower[point[at]] > limit)]
    row = point[at]
    for name in ("distance", "normal", "certified"):
        rows[name][row] = got[name][at]
    rows["lower"][row], rows["upper"][row], rows["point"][row] = lower[row], upper[row], got["point_b"][at]
    rows["body"][row], rows["item"][row], rows["hit"][row] = body[at], got["part_b"][at], True
    return rows


def _near_boxes(packed: PackedWorld, questions: np.ndarray, skipped: np.ndarray) -> np.ndarray:
    """(k, 2) points and bodies that may be nearest, by question."""
    assert packed.tree is not None
    if not (skipped.any() or packed.has_margins):
        return bodies_ahead(packed.tree, questions, of_points=True)[0]
    remaining = np.flatnonzero((skipped == 0) & packed.roster.alive)  # what is left out bounds nothing
    if not len(remaining):
        return np.empty((0, 2), dtype=np.int64)
    tree = BoxTree(packed.parts.body_boxes(remaining))
    pairs, _ = bodies_ahead(tree, questions, of_points=True)
    return np.stack([pairs[:, 0], remaining[pairs[:, 1]]], axis=1)
