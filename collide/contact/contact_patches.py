"""Contacts of two bodies of facets: patches of facet pairs that meet, or come within the margin.

Pairs that meet are grouped by the shortest translations that part them (`shallow_overlaps.py`); pairs apart start a patch
where their nearest points are local ones (`internal_edges.py`). A patch grows over pairs that hang together with it and face
along its normal; its points are the corners of what overlaps, seen along that normal (`contact_points.py`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.contact.contact_facets import MOST_PAIRS, Pairs, Posed, lengths_of, topology_of
from collide.contact.contact_points import Points, points_along
from collide.contact.internal_edges import FLAT, Links, aligned, local_minima, snapped
from collide.contact.shallow_overlaps import CLEAR, WayApart, translation_that_parts, ways_apart
from collide.errors import UnsupportedQuery
from collide.narrowphase.facets.body_pairs import core_hits

#: A pair belongs to a patch where the normal of one of its facets is this near to the patch's, as a cosine.
_ALONG = 0.8
#: Pairs nearer than so many errors of a coordinate are looked at as if they met: no direction can be told.
_CLOSE = 2.0**12
#: Points deeper than so many times the way out belong to other parts of the bodies.
_DEEPEST = 2.5


class Patch(NamedTuple):
    """One patch: unit normal, its points (cores, seen from A's origin), facets (k, 2) of each, and whether it meets.

    apart : a length along the normal by which B moved is proven to part the pairs of the patch; 0 where they are apart.
    """

    normal: np.ndarray
    points: Points
    facets: np.ndarray
    meets: bool
    apart: float


def patches_of(here: Posed, margin: float) -> tuple[list[Patch], bool]:
    """(patches, whether `distance` is to be asked: for an overlap that none tells, or where pairs within reach made none)."""
    A, B = here.A, here.B
    reach = margin + A.radius + B.radius
    pairs = here.pairs(reach)
    if pairs is None:
        if reach > 0.0:
            raise UnsupportedQuery(
                f"contacts: more than {MOST_PAIRS} pairs of facets lie within {reach:g} m (margin and radii) of each other: "
                "ask with a smaller margin, or take coarser meshes"
            )
        return [], bool(core_hits(A, B, here.X_WA[None], here.X_WB[None]).core[0])
    close = pairs.near.meets | (pairs.near.length <= _CLOSE * here.error)
    if not pairs.near.meets.any() and core_hits(A, B, here.X_WA[None], here.X_WB[None]).core[0]:
        return [], True
    if not len(pairs) or (reach == 0.0 and not pairs.near.meets.any()):
        return [], False  # apart, be it by less than rounding
    ways: list[WayApart] = []
    deep = False
    if close.any():
        touching = pairs.take(close)
        ways, left = ways_apart(here, touching)
        deep = bool((left & touching.near.meets).any())
        farthest = _DEEPEST * max((way.length for way in ways), default=0.0)
        if farthest > reach:
            wider = here.pairs(farthest)
            if wider is None:
                return [], True
            pairs = wider
            close = pairs.near.meets | (pairs.near.length <= _CLOSE * here.error)
    links = Links(pairs, topology_of(B).many)
    covered = close.copy()
    found: list[tuple[Patch, np.ndarray]] = []
    for way in ways:
        made, untold = _overlapping(here, pairs, links, way, touching, reach)
        deep = deep or untold
        found += made
        for _, members in made:
            covered |= members
    gaps = _gaps(here, pairs, links, covered, found, reach)
    told = [*(patch for patch, _ in found), *gaps]
    return told, deep or not told


def _overlapping(
    here: Posed, pairs: Pairs, links: Links, way: WayApart, touching: Pairs, reach: float
) -> tuple[list[tuple[Patch, np.ndarray]], bool]:
    """The patches that one way apart tells, each with its members; and whether pairs that meet are in none."""
    many = len(here.B.tree.ids)
    wanted = touching.near.facets[way.pairs]
    seeds = np.isin(pairs.near.facets[:, 0] * many + pairs.near.facets[:, 1], wanted[:, 0] * many + wanted[:, 1])
    deepest = _DEEPEST * way.length + CLEAR * here.error
    whole, points = _grown(here, pairs, links, way.normal, seeds, reach, deepest)
    made, untold = [], False
    while seeds.any():  # one patch for all that hangs together
        first = np.zeros(len(pairs), dtype=bool)
        first[np.argmax(seeds)] = True
        members = links.reached(first, whole)
        meets = bool(pairs.near.meets[seeds & members].any())
        seeds = seeds & ~members
        own = points.take(members[points.pair])
        if not len(own.gap):
            untold = untold or meets
            continue
        depth = float(-own.gap.min()) + here.A.radius + here.B.radius
        apart = translation_that_parts(here, pairs.take(members), way.normal, depth)
        made.append((Patch(way.normal, own, pairs.near.facets[own.pair], meets, apart), members))
    return made, untold


def _gaps(here: Posed, pairs: Pairs, links: Links, covered: np.ndarray, found: list, reach: float) -> list[Patch]:
    """Patches of pairs that are apart, the nearest first."""
    A, B = here.A, here.B
    asked = np.flatnonzero(~covered & (pairs.near.lower <= reach) & (pairs.near.point_a != pairs.near.point_b).any(axis=1))
    if not len(asked):
        return []
    u = np.zeros((len(pairs), 3))
    length = pairs.near.length[asked]
    across = (pairs.near.point_b - pairs.near.point_a)[asked]
    u[asked] = across / lengths_of(across)[:, None]
    slack = np.full(len(pairs), 1.0)
    slack[asked] = FLAT + 32.0 * here.error / length
    poses = here.X_WA[:3, :3], here.X_WB[:3, :3], here.X_WB[:3, 3] - here.X_WA[:3, 3]
    least = local_minima(pairs.take(asked), u[asked], slack[asked], A, B, (topology_of(A), topology_of(B)), poses)
    starts = np.zeros(len(pairs), dtype=bool)
    starts[asked[least]] = True
    nearest = asked[int(np.argmin(length))]
    if not found and pairs.near.lower[starts].min(initial=np.inf) > pairs.near.length[nearest] + CLEAR * here.error:
        starts[nearest] = True  # nothing is nearer, whatever rounding makes of its neighbours
    for patch, members in found:  # what hangs on to an overlap, the same way, is part of it
        same = starts & (lengths_of(u - patch.normal) <= slack + 2.0**-20)
        starts &= ~links.reached(members, same)
    made: list[Patch] = []
    order = np.flatnonzero(starts)
    order = order[np.argsort(np.round(pairs.near.length[order] / max(here.error, 1e-300)), kind="stable")]
    for k in order.tolist():
        if not starts[k]:
            continue
        n = snapped(pairs, k, u[k], float(slack[k]), A, B)
        seeds = np.zeros(len(pairs), dtype=bool)
        seeds[k] = True
        members, points = _grown(here, pairs, links, n, seeds, reach, 0.0)
        same = starts & (lengths_of(u - n) <= slack + 2.0**-20)
        starts &= ~(links.reached(members, same) | members)
        nearest = _nearest(here, pairs, np.array([k]))
        # Among corners of a face the nearest points of its first pair say nothing new.
        slackest = float(nearest.error[0]) + CLEAR * here.error
        if not len(points.gap) or points.gap.min() > nearest.gap[0] + slackest:
            points = Points(*(np.concatenate(both) for both in zip(nearest, points)))
        depth = A.radius + B.radius - float(points.gap.min())
        meets = depth >= 0.0
        apart = translation_that_parts(here, pairs.take(members), n, depth) if meets else 0.0
        made.append(Patch(n, points, pairs.near.facets[points.pair], meets, apart))
    return made


def _grown(here: Posed, pairs: Pairs, links: Links, n, seeds: np.ndarray, reach: float, deepest: float):
    """(members of the patch that starts with the seeds, their points along n with −deepest ≤ gap ≤ reach)."""
    A, B = here.A, here.B
    along = seeds | aligned(pairs, n, A.solid, B.solid, _ALONG)
    which = np.flatnonzero(along)
    points = points_along(pairs.take(which), n, A.solid, B.solid, here.error)
    points = points._replace(pair=which[points.pair])
    points = points.take((points.gap <= reach + points.error) & (points.gap >= -deepest - CLEAR * here.error))
    holds = np.zeros(len(pairs), dtype=bool)
    holds[points.pair] = True
    members = links.reached(seeds, holds)
    return members, points.take(members[points.pair])


def _nearest(here: Posed, pairs: Pairs, which: np.ndarray) -> Points:
    """The nearest points of the nearest of these pairs."""
    k = which[int(np.argmin(pairs.near.length[which]))]
    near = pairs.near
    error = max(float(near.length[k] - near.lower[k]), 4.0 * here.error)
    return Points(
        np.array([k]), near.point_a[k : k + 1], near.point_b[k : k + 1], near.length[k : k + 1], np.array([error])
    )
