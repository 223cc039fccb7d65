"""Contacts of two bodies of facets: patches of facet pairs that meet, or come within the margin.

Pairs that meet are grouped by the shortest translations that separate them (`shallow_overlaps.py`); a pair that is
apart starts a patch where its nearest points are local minima of the distance (`internal_edges.py`). A patch grows over
pairs that are connected with it and face along its normal; its points are the corners of the polygons in which the
facets overlap, seen along that normal (`contact_points.py`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.contact.contact_facets import MAX_PAIRS, ContactFrame, Pairs, lengths_of, topology_of
from collide.contact.contact_points import Points, points_along
from collide.contact.internal_edges import FLAT, Links, aligned, local_minima, snapped
from collide.contact.shallow_overlaps import (
    STEP_ERRORS,
    SeparatingTranslation,
    clearing_length,
    separating_translations,
)
from collide.errors import UnsupportedQuery
from collide.narrowphase.facets.facet_kernel_calls import core_hits

#: A pair belongs to a patch where the normal of one of its facets is this near to the patch's, as a cosine.
_ALONG = 0.8
#: Pairs nearer than so many errors of a coordinate are treated as if they met: their direction is rounding.
_CLOSE = 2.0**12
#: Points deeper than so many times the separating translation belong to other parts of the bodies.
_DEEPEST = 2.5


class Patch(NamedTuple):
    """One patch of contacts, without radii.

    normal : (3,) unit vector from A to B.   points : seen from A's origin [m].   facets : (k, 2) of each point.
    meets : whether a pair of it meets.
    apart : [m], B moved so far along the normal clears A in all pairs of the patch, proven; 0 where they are apart.
    """

    normal: np.ndarray
    points: Points
    facets: np.ndarray
    meets: bool
    apart: float


def patches_of(frame: ContactFrame, margin: float) -> tuple[list[Patch], bool]:
    """Patches of two bodies within ``margin`` [m], and whether the overlap takes a row of `distance` besides.

    It does where an overlap is too deep for a patch, or where pairs within reach made none. Raises UnsupportedQuery.
    """
    A, B = frame.A, frame.B
    reach = margin + A.radius + B.radius
    pairs = frame.pairs(reach)
    if pairs is None:
        if reach > 0.0:
            raise UnsupportedQuery(
                f"contacts: more than {MAX_PAIRS} pairs of facets lie within {reach:g} m (margin and radii) of each "
                "other: ask with a smaller margin, or take coarser meshes"
            )
        return [], bool(core_hits(A, B, frame.X_WA[None], frame.X_WB[None]).core[0])
    close = pairs.near.meets | (pairs.near.length <= _CLOSE * frame.error)
    if not pairs.near.meets.any() and core_hits(A, B, frame.X_WA[None], frame.X_WB[None]).core[0]:
        return [], True
    if not len(pairs) or (reach == 0.0 and not pairs.near.meets.any()):
        return [], False  # apart, be it by less than rounding
    translations: list[SeparatingTranslation] = []
    deep = False
    if close.any():
        touching = pairs.take(close)
        translations, unparted = separating_translations(frame, touching)
        deep = bool((unparted & touching.near.meets).any())
        farthest = _DEEPEST * max((translation.length for translation in translations), default=0.0)
        if farthest > reach:
            wider = frame.pairs(farthest)
            if wider is None:
                return [], True
            pairs = wider
            close = pairs.near.meets | (pairs.near.length <= _CLOSE * frame.error)
    links = Links(pairs, topology_of(B).n_corners)
    covered = close.copy()
    overlapping: list[tuple[Patch, np.ndarray]] = []
    for translation in translations:
        grown, unexplained = _overlapping(frame, pairs, links, translation, touching, reach)
        deep = deep or unexplained
        overlapping += grown
        for _, members in grown:
            covered |= members
    gaps = _gaps(frame, pairs, links, covered, overlapping, reach)
    patches = [*(patch for patch, _ in overlapping), *gaps]
    return patches, deep or not patches


def _overlapping(
    frame: ContactFrame, pairs: Pairs, links: Links, translation: SeparatingTranslation, touching: Pairs, reach: float
) -> tuple[list[tuple[Patch, np.ndarray]], bool]:
    """Patches of a separating translation, each with its pairs (mask); and whether pairs that meet are in none of
    them.
    """
    n_facets_b = len(frame.B.tree.ids)
    keys, wanted = (
        facets[:, 0] * n_facets_b + facets[:, 1]
        for facets in (pairs.near.facets, touching.near.facets[translation.pairs])
    )
    seeds = np.isin(keys, wanted)
    deepest = _DEEPEST * translation.length + STEP_ERRORS * frame.error
    whole, points = _grow_patch(frame, pairs, links, translation.normal, seeds, reach, deepest)
    patches, unexplained = [], False
    while seeds.any():  # one patch for each connected group
        first = np.zeros(len(pairs), dtype=bool)
        first[np.argmax(seeds)] = True
        members = links.reached(first, whole)
        meets = bool(pairs.near.meets[seeds & members].any())
        seeds = seeds & ~members
        patch_points = points.take(members[points.pair])
        if not len(patch_points.gap):
            unexplained = unexplained or meets
            continue
        depth = float(-patch_points.gap.min()) + frame.A.radius + frame.B.radius
        apart = clearing_length(frame, pairs.take(members), translation.normal, depth)
        facets = pairs.near.facets[patch_points.pair]
        patches.append((Patch(translation.normal, patch_points, facets, meets, apart), members))
    return patches, unexplained


def _gaps(
    frame: ContactFrame, pairs: Pairs, links: Links, covered: np.ndarray, overlapping: list, reach: float
) -> list[Patch]:
    """Patches of pairs that are apart, the nearest first."""
    A, B = frame.A, frame.B
    has_direction = (pairs.near.point_a != pairs.near.point_b).any(axis=1)
    asked = np.flatnonzero(~covered & (pairs.near.lower <= reach) & has_direction)
    if not len(asked):
        return []
    u = np.zeros((len(pairs), 3))
    length = pairs.near.length[asked]
    across = (pairs.near.point_b - pairs.near.point_a)[asked]
    u[asked] = across / lengths_of(across)[:, None]
    slack = np.full(len(pairs), 1.0)
    slack[asked] = FLAT + 32.0 * frame.error / length
    poses = frame.X_WA[:3, :3], frame.X_WB[:3, :3], frame.X_WB[:3, 3] - frame.X_WA[:3, 3]
    least = local_minima(pairs.take(asked), u[asked], slack[asked], A, B, (topology_of(A), topology_of(B)), poses)
    starts = np.zeros(len(pairs), dtype=bool)
    starts[asked[least]] = True
    nearest = asked[int(np.argmin(length))]
    rounding = STEP_ERRORS * frame.error
    if not overlapping and pairs.near.lower[starts].min(initial=np.inf) > pairs.near.length[nearest] + rounding:
        starts[nearest] = True  # nothing is nearer, whatever rounding makes of its neighbours
    for patch, members in overlapping:  # gaps connected with an overlap, in its direction, are part of it
        same = starts & (lengths_of(u - patch.normal) <= slack + 2.0**-20)
        starts &= ~links.reached(members, same)
    patches: list[Patch] = []
    order = np.flatnonzero(starts)
    order = order[np.argsort(np.round(pairs.near.length[order] / max(frame.error, 1e-300)), kind="stable")]
    for k in order.tolist():
        if not starts[k]:
            continue
        n = snapped(pairs, k, u[k], float(slack[k]))
        seeds = np.zeros(len(pairs), dtype=bool)
        seeds[k] = True
        members, points = _grow_patch(frame, pairs, links, n, seeds, reach, 0.0)
        same = starts & (lengths_of(u - n) <= slack + 2.0**-20)
        starts &= ~(links.reached(members, same) | members)
        nearest = _nearest(frame, pairs, np.array([k]))
        # Where corners of the face are as near, the nearest points of its first pair add nothing.
        slackest = float(nearest.error[0]) + STEP_ERRORS * frame.error
        if not len(points.gap) or points.gap.min() > nearest.gap[0] + slackest:
            points = Points(*(np.concatenate(both) for both in zip(nearest, points)))
        depth = A.radius + B.radius - float(points.gap.min())
        meets = depth >= 0.0
        apart = clearing_length(frame, pairs.take(members), n, depth) if meets else 0.0
        patches.append(Patch(n, points, pairs.near.facets[points.pair], meets, apart))
    return patches


def _grow_patch(frame: ContactFrame, pairs: Pairs, links: Links, n, seeds: np.ndarray, reach: float, deepest: float):
    """(members of the patch that starts with the seeds, their points along n with −deepest ≤ gap ≤ reach)."""
    A, B = frame.A, frame.B
    along = seeds | aligned(pairs, n, A.solid, B.solid, _ALONG)
    which = np.flatnonzero(along)
    points = points_along(pairs.take(which), n, A.solid, B.solid, frame.error)
    points = points._replace(pair=which[points.pair])
    points = points.take((points.gap <= reach + points.error) & (points.gap >= -deepest - STEP_ERRORS * frame.error))
    holds = np.zeros(len(pairs), dtype=bool)
    holds[points.pair] = True
    members = links.reached(seeds, holds)
    return members, points.take(members[points.pair])


def _nearest(frame: ContactFrame, pairs: Pairs, which: np.ndarray) -> Points:
    """The nearest points of the nearest of these pairs."""
    k = which[int(np.argmin(pairs.near.length[which]))]
    near = pairs.near
    error = max(float(near.length[k] - near.lower[k]), 4.0 * frame.error)
    return Points(
        np.array([k]), near.point_a[k : k + 1], near.point_b[k : k + 1], near.length[k : k + 1], np.array([error])
    )
