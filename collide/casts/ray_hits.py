"""What rays meet, row by row, and the answers made of these rows."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.base.lazy_modules import lazy_module
from collide.casts.directions import Directions
from collide.kernels import address_of
from collide.results import only_value

#: Knows of facets, which worlds of convex bodies do not load.
ray_ends = lazy_module("collide.casts.ray_ends")

#: Rows of a World's hits, of kernels too; `collide.worlds.hits` says what the fields are.
WORLD_HIT_DTYPE = np.dtype(
    [
        ("distance", "f8"), ("lower", "f8"), ("upper", "f8"), ("normal", "f8", 3), ("point", "f8", 3),
        ("ray", "i4"), ("body", "i4"), ("item", "i4"), ("facet", "i4"),
        ("hit", "?"), ("certified", "?"), ("at_start", "?"),
    ],
    align=True,
)


class RayHits(NamedTuple):
    """Where rays first meet a body, or, with ``all_hits``, every place where they meet its surface.

    hit : (N,) bool. Of meshes, polytopes and half-spaces decided exactly; for other shapes, where rounding leaves hit
        or miss open, True.
    distance : t of the point origin + t · direction: lengths in units of the direction's, metres for unit directions.
        ``inf`` where nothing is met.
    lower, upper : lower ≤ truth ≤ upper is proven where ``certified``; then no wider apart than 2⁻³⁶ of t of the body's
        far side.
    point : in W [m], origin + distance · direction, rounded; zeros where nothing is met.
    normal : outward unit normal of the surface in W: of a facet that from which its corners run counter-clockwise.
        Zeros for a facet without area, and where nothing is met.
    facet : number of the facet of a `Mesh`, `Box`, `ConvexHull` or `HPolytope`, of one with bounded=False the row of
        its half-space; of several met at the same point the least. Of cylinders and cones 0 round about, 1 below and 2
        above, of capsules 1 and 2 on the balls at their ends; 0 of balls, ellipsoids and half-spaces. −1 where nothing
        is met, and for polytopes within a `Compound`, or swept by a ball.
    starts : (N + 1,) with ``all_hits``, where the places of each ray begin and end: then the fields above and below,
        but for ``hit``, have a row for every place, by distance, then item and facet. None otherwise.
    certified : that hit or miss is proven, and the bracket is as narrow as said. Rays that touch a curved surface, or
        begin on one, within rounding are not.
    item : number of the part of a `Compound` that is met, 0 of other shapes; −1 where nothing is met.

    Single rays at single poses give scalars and (3,), unless ``all_hits``.
    """

    hit: np.ndarray
    distance: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    facet: np.ndarray
    starts: np.ndarray | None = None
    certified: np.ndarray | None = None
    item: np.ndarray | None = None


class RayEvents(NamedTuple):
    """Places where rays meet a surface.

    ray : (k,) numbers of the rays.   t : (k, 3) value, from below, from above, in units of the directions given.
    normal : (k, 3) in W.   facet, item : (k,).
    proven : (k,) bool, the meeting is proven, with t within the bracket.
    certified : (k,) bool, the bracket is narrow, too.
    """

    ray: np.ndarray
    t: np.ndarray
    normal: np.ndarray
    facet: np.ndarray
    item: np.ndarray
    proven: np.ndarray
    certified: np.ndarray

    def of(self, rows: np.ndarray) -> RayEvents:
        return RayEvents._make(column[rows] for column in self)


def joined(events: list[RayEvents]) -> RayEvents:
    if not events:  # of no rays
        none, numbers, flags = np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
        return RayEvents(numbers, none, none, numbers, numbers, flags, flags)
    return RayEvents._make(np.concatenate(columns) for columns in zip(*events))


def in_order(events: RayEvents) -> RayEvents:
    """Ray by ray, along each by t, then item and facet."""
    return events.of(np.lexsort((events.facet, events.item, events.t[:, 0], events.ray)))


def first_of_each(events: RayEvents) -> RayEvents:
    """Of events in order the first of each ray, its bracket and what is certain of it with regard to the others."""
    n = len(events.ray)
    t, flags = np.ascontiguousarray(events.t).copy(), np.stack([events.proven, events.certified], axis=1)
    columns, first = np.stack([events.ray, events.facet, events.item], axis=1), np.empty(n, dtype=np.int64)
    count = ray_ends.first_places(address_of(t), address_of(columns), address_of(flags), n, address_of(first))
    rows = first[:count]
    return events.of(rows)._replace(t=t[rows], proven=flags[rows, 0], certified=flags[rows, 1])


def as_hits(events: RayEvents, origins: np.ndarray, directions: Directions, *, every: bool, single: bool) -> RayHits:
    """The answer to n rays: of events in order, every one of them or the first of each ray."""
    n = len(origins)
    if not every:
        events = first_of_each(events)
    ray, t = events.ray, events.t
    points, held = np.empty((len(ray), 3)), [np.ascontiguousarray(values) for values in (origins, *directions, ray, t)]
    ray_ends.write_places(*map(address_of, held), len(ray), address_of(points))
    columns = (
        np.ones(len(ray), dtype=bool), t[:, 0], t[:, 1], t[:, 2], points, events.normal,
        events.facet, None, events.certified, events.item,
    )
    if every:
        starts = np.concatenate([[0], np.cumsum(np.bincount(ray, minlength=n))])
        return RayHits(np.diff(starts) > 0, *columns[1:7], starts, *columns[8:])
    full = _nothing(n)
    for into, values in zip(full, columns):
        if into is not None:
            into[ray] = values
    return RayHits._make(None if values is None else only_value(values) for values in full) if single else full


def no_hit() -> RayHits:
    """Of a single ray that meets nothing."""
    inf, nothing = math.inf, np.zeros((2, 3))
    return RayHits(False, inf, inf, inf, nothing[0], nothing[1], -1, None, True, -1)  # type: ignore[arg-type]


def _nothing(n: int) -> RayHits:
    """Of rays that meet nothing."""
    hit, (t, lower, upper), none = np.zeros(n, dtype=bool), np.full((3, n), np.inf), np.full(n, -1, dtype=np.int64)
    zeros = np.zeros((2, n, 3))
    return RayHits(hit, t, lower, upper, zeros[0], zeros[1], none, None, np.ones(n, dtype=bool), none.copy())
