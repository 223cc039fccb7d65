"""Patches of facet pairs in contact, or within the margin.

Meeting pairs are grouped by short separating translations (`shallow_overlaps.py`); a pair apart starts a patch where
its nearest points are local minima of the distance (`internal_edges.py`). A patch grows over linked pairs facing along
its normal; its points are the corners of the polygons in which the facets overlap, seen along the normal
(`contact_points.py`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.contact.contact_facets import PosedFacets
from collide.contact.contact_pairs import (
    COVERED,
    JUDGED,
    LEAST,
    N_REACHED,
    REACHED,
    SEARCH,
    TOUCHING,
    WANTED,
    ContactPairs,
    begin_search,
    facing_a,
    facing_b,
    pair_meets,
)
from collide.contact.contact_points import (
    LEAST_COSINE,
    PatchPoints,
    View,
    copy_of_points,
    may_share_points,
    put_ends_along,
    put_points,
    within_gaps,
)
from collide.contact.internal_edges import FLAT, is_local_minimum, snapped
from collide.contact.manifold_points import GAP, HEIGHT, NEAR, POINT, V
from collide.contact.shallow_overlaps import STEP_ERRORS
from collide.contact.support_face import FACE, axes_across, seen_along
from collide.kernels import kernel
from collide.narrowphase.facets.facets_within import (
    ANYWAY,
    BESIDE,
    FACES,
    FACES_ALONG,
    FACET_A,
    FACET_B,
    INTS_OF_PAIR,
    LARGEST_GAP,
    LEAST_GAP,
    LENGTH,
    LOWER,
    NUMBERS_OF_PAIR,
    POINT_A,
    POINT_B,
)
from collide.numerics.vec3 import divide, norm, put_vec3, sub, vec3_at

#: A pair belongs to a patch where the normal of one of its facets is this near to the patch's, as a cosine.
_ALONG = 0.8
#: Pairs nearer than so many errors of a coordinate are treated as if they met: their direction is rounding.
_CLOSE = 2.0**12
#: Points deeper than so many times the separating translation belong to other parts of the bodies.
DEEPEST = 2.5
#: What rounding of a cosine may be between two kernels.
_COSINES = 2.0**-40
#: Directions that differ by less than this and their rounding are the same.
_SAME = 2.0**-20


class ContactFrame(NamedTuple):
    """Pairs of facets of two bodies, and what patches are made of.

    error : of a coordinate [m].   reach : margin and radii, within which contacts are listed [m].
    """

    pairs: ContactPairs
    A: PosedFacets
    B: PosedFacets
    error: float
    reach: float
    points: PatchPoints


class Patch(NamedTuple):
    """A patch, its pairs REACHED.

    axes : `ContactAxes`.   n : of points.   meets : whether any pair meets.
    """

    axes: Any
    n: int
    meets: bool


@kernel
def mark_touching(frame):
    """Mark pairs that meet, or nearly, and are within the reach; how many, and how many of them meet."""
    pairs = frame.pairs
    n_touching, n_meeting = 0, 0
    for k in range(pairs.n):
        if pair_meets(pairs, k):
            n_meeting += 1
        elif not _is_close(frame, k) or pairs.near[NUMBERS_OF_PAIR * k + LOWER] > frame.reach:
            continue
        pairs.states[k] |= TOUCHING
        n_touching += 1
    return n_touching, n_meeting


@kernel(inline=True)
def _is_close(frame, k):
    pairs = frame.pairs
    return pair_meets(pairs, k) or pairs.near[NUMBERS_OF_PAIR * k + LENGTH] <= _CLOSE * frame.error


@kernel
def cover_close(frame):
    """Pairs too close to have a direction start no patches."""
    for k in range(frame.pairs.n):
        if _is_close(frame, k):
            frame.pairs.states[k] |= COVERED


# --- growing ------------------------------------------------------------------------------------


@kernel
def grow_patch(frame, first, axes, deepest, on_surface):
    """Mark as REACHED the pairs linked with ``first`` and with points along a normal, −deepest ≤ gap ≤ reach, and all
    WANTED pairs; how many points.   on_surface : as in `View`.
    """
    pairs, A, B = frame.pairs, frame.A, frame.B
    view = _overlap_view(frame, axes, deepest, on_surface)
    number = begin_search(pairs)
    n = put_points(pairs, first, A, B, view, frame.points, 0)
    pairs.states[first] |= REACHED
    pairs.tried[first] = number
    pairs.queue[0] = first
    begin, end = 0, 1
    while begin < end:
        k = pairs.queue[begin]
        begin += 1
        for i in range(9 * k, 9 * k + 9):
            key = pairs.keys[i]
            if pairs.seen_keys[key] == number:
                continue
            pairs.seen_keys[key] = number
            for at in range(pairs.key_starts[key], pairs.key_starts[key + 1]):
                linked = pairs.by_key[at]
                if pairs.tried[linked] == number:
                    continue
                pairs.tried[linked] = number
                is_seed = pairs.states[linked] & WANTED != 0
                n_before = n
                if is_seed or _is_along(frame, linked, axes.nhat):
                    n = put_points(pairs, linked, A, B, view, frame.points, n)
                else:
                    n = put_ends_along(pairs, linked, A, B, view, frame.points, n)
                if is_seed or n > n_before:
                    pairs.states[linked] |= REACHED
                    pairs.queue[end] = linked
                    end += 1
    pairs.search[N_REACHED] = end
    return n


@kernel
def may_be_reached(frame, k, axes, length):
    """Whether a pair that starts no patch may be in the patch of a translation along ``axes`` by ``length`` [m]."""
    view = _overlap_view(frame, axes, DEEPEST * length, True)
    if frame.A.radius + frame.B.radius > 0.0:  # ends of round edges stand on steep facets, too
        return within_gaps(frame.pairs, k, view, frame.points.seen)
    if not _is_along(frame, k, axes.nhat):
        return False
    over_a, over_b = may_share_points(frame.pairs, k, frame.A, frame.B, view, frame.points.seen)
    return over_a or over_b


@kernel
def put_view(frame, axes, length, views, at):
    """Write what `list_near_pairs` takes of a translation along ``axes`` by ``length`` [m]: of all pairs that
    `may_be_reached`, or are within the reach, no pair is refused.

    Both kernels round: heights and places are off by at most 8 errors each, and limits are wider by 128.
    """
    view, slack = _overlap_view(frame, axes, DEEPEST * length, True), 128.0 * frame.error
    put_vec3(views, at, axes.e)
    put_vec3(views, at + 3, axes.f)
    put_vec3(views, at + 6, axes.nhat)
    views[at + LEAST_GAP], views[at + LARGEST_GAP] = view.low - slack, view.high + slack
    is_sharp = frame.A.radius + frame.B.radius == 0.0
    views[at + BESIDE] = frame.reach + slack if is_sharp else math.inf
    views[at + FACES_ALONG] = _ALONG - _COSINES if is_sharp else -math.inf
    views[at + FACES] = -LEAST_COSINE - _COSINES if is_sharp else -math.inf
    views[at + ANYWAY] = frame.reach


@kernel(inline=True)
def _overlap_view(frame, axes, deepest, on_surface):
    """Gaps from −deepest to the reach, seen along ``axes``."""
    return View(axes, frame.error, -deepest - STEP_ERRORS * frame.error, frame.reach, False, on_surface)


@kernel(inline=True)
def _is_along(frame, k, nhat):
    """Whether one facet of a pair at least faces along a normal."""
    pairs = frame.pairs
    return facing_a(pairs, k, nhat, frame.A) >= _ALONG or facing_b(pairs, k, nhat, frame.B) >= _ALONG


@kernel
def least_gap_of(points, n):
    """The least gap of n points [m]."""
    gap = math.inf
    for i in range(n):
        gap = min(gap, points.manifold.points[POINT * i + GAP])
    return gap


class NearestPoint(NamedTuple):
    """Where a patch is nearest along its normal, with the pair; as a point of `PatchPoints`."""

    u: float
    v: float
    gap: float
    height: float
    error: float
    pair: int
    feature_a: int
    feature_b: int


@kernel
def _least_point(points, n):
    """The `NearestPoint` among n; gap ∞ for n = 0."""
    p, least = points.manifold.points, 0
    if n == 0:
        return NearestPoint(0.0, 0.0, math.inf, 0.0, 0.0, 0, 0, 0)
    for i in range(1, n):
        if p[POINT * i + GAP] < p[POINT * least + GAP]:
            least = i
    at, features = POINT * least, points.manifold.features
    return NearestPoint(
        p[at], p[at + V], p[at + GAP], p[at + HEIGHT], points.errors[least], points.pairs[least], features[2 * least],
        features[2 * least + 1],
    )


@kernel
def put_nearest(points, n, nearest, radius):
    """Put the nearest point in front of n points, all farther, or, for bodies with a radius, into the place of a point
    beside it, with the old features; returns the new number of points.
    """
    p, features = points.manifold.points, points.manifold.features
    k = _point_beside(points, n, nearest) if radius > 0.0 else -1
    if k < 0:
        for i in range(n):
            copy_of_points(points, n - 1 - i, points, n - i)
        k, n = 0, n + 1
        features[0], features[1] = nearest.feature_a, nearest.feature_b
        points.pairs[0] = nearest.pair
    p[POINT * k], p[POINT * k + V] = nearest.u, nearest.v
    p[POINT * k + GAP], p[POINT * k + HEIGHT] = nearest.gap, nearest.height
    points.errors[k] = nearest.error
    return n


@kernel
def _point_beside(points, n, nearest):
    """Number of the point, of n, in the nearest point's own pair and within NEAR times the points' extent: both are
    the same contact; −1 without.
    """
    p = points.manifold.points
    best, square, farthest = -1, math.inf, 0.0
    for i in range(n):
        du, dv = p[POINT * i] - nearest.u, p[POINT * i + V] - nearest.v
        away = du * du + dv * dv
        farthest = max(farthest, away)
        if away < square and points.pairs[i] == nearest.pair:
            best, square = i, away
    return best if square <= NEAR * NEAR * farthest else -1


# --- overlaps -----------------------------------------------------------------------------------


@kernel
def seed_group(frame, number):
    """Make the pairs of one translation the WANTED pairs."""
    pairs = frame.pairs
    for k in range(pairs.n):
        pairs.states[k] &= ~WANTED
        if pairs.groups[k] == number:
            pairs.states[k] |= WANTED


@kernel
def next_seed(frame, first):
    """The next WANTED pair from ``first`` on; −1 where none is left."""
    for k in range(first, frame.pairs.n):
        if frame.pairs.states[k] & WANTED:
            return k
    return -1


@kernel
def grow_overlap(frame, first, axes, length):
    """The patch around a WANTED pair, for a translation along ``axes`` of that length [m]."""
    pairs = frame.pairs
    least = NearestPoint(0.0, 0.0, math.inf, 0.0, 0.0, 0, 0, 0)
    if frame.A.radius + frame.B.radius > 0.0:
        least = _least_point(frame.points, grow_patch(frame, first, axes, DEEPEST * length, False))
    n = grow_patch(frame, first, axes, DEEPEST * length, True)
    if least.gap < math.inf and least_gap_of(frame.points, n) > least.gap + least.error + STEP_ERRORS * frame.error:
        n = put_nearest(frame.points, n, least, frame.A.radius + frame.B.radius)
    meets = False
    for i in range(pairs.search[N_REACHED]):
        k = pairs.queue[i]
        if pairs.states[k] & WANTED:
            meets = meets or pair_meets(pairs, k)
            pairs.states[k] &= ~WANTED
    return Patch(axes, n, meets)


@kernel
def cover_patch(frame, nhat):
    """The pairs of the patch, and local minima that are linked with them in the same direction, start no patches."""
    pairs = frame.pairs
    end = pairs.search[N_REACHED]
    pairs.search[SEARCH] += 1
    number = pairs.search[SEARCH]
    begin = 0
    while begin < end:
        k = pairs.queue[begin]
        begin += 1
        pairs.states[k] |= COVERED
        for i in range(9 * k, 9 * k + 9):
            key = pairs.keys[i]
            if pairs.seen_keys[key] == number:
                continue
            pairs.seen_keys[key] = number
            for at in range(pairs.key_starts[key], pairs.key_starts[key + 1]):
                linked = pairs.by_key[at]
                if pairs.tried[linked] == number or pairs.states[linked] & (COVERED | REACHED):
                    continue
                pairs.tried[linked] = number
                if _is_same_minimum(frame, linked, nhat):
                    pairs.states[linked] |= REACHED
                    pairs.queue[end] = linked
                    end += 1
    pairs.search[N_REACHED] = end


@kernel
def _is_same_minimum(frame, k, nhat):
    """Whether a pair's nearest points are local minima in a direction."""
    pairs = frame.pairs
    if not pairs.gaps[k] < math.inf:
        return False
    off = norm(sub(vec3_at(pairs.directions, 3 * k), nhat))
    return off <= pairs.slacks[k] + _SAME and _is_minimum(frame, k)


# --- gaps ---------------------------------------------------------------------------------------


@kernel
def set_directions(frame):
    """Set gaps and directions of the pairs within the reach that are not covered: local minima are among them."""
    pairs, error = frame.pairs, frame.error
    n = 0
    for k in range(pairs.n):
        near = NUMBERS_OF_PAIR * k
        length = pairs.near[near + LENGTH]
        pairs.gaps[k] = math.inf
        if pairs.states[k] & COVERED or pairs.near[near + LOWER] > frame.reach:
            continue
        across = sub(vec3_at(pairs.near, near + POINT_B), vec3_at(pairs.near, near + POINT_A))
        size = norm(across)
        if not size > 0.0:
            continue
        put_vec3(pairs.directions, 3 * k, divide(across, size))
        pairs.slacks[k] = FLAT + 32.0 * error / length if length > 0.0 else math.inf
        pairs.gaps[k] = float(math.floor(length / error + 0.5)) if length < 2.0**52 * error else length / error
        pairs.order[n] = k
        n += 1
    return n


@kernel
def _is_minimum(frame, k):
    """Whether a pair's nearest points are local minima; looked at when first asked."""
    pairs = frame.pairs
    if not pairs.states[k] & JUDGED:
        pairs.states[k] |= JUDGED
        if is_local_minimum(pairs, k, frame.A, frame.B):
            pairs.states[k] |= LEAST
    return pairs.states[k] & LEAST != 0


@kernel
def sort_by_gap(frame, n):
    """Sort the first n of ``order`` that are not covered by gap; how many (heapsort: J. W. J. Williams, 1964)."""
    pairs = frame.pairs
    n_left = 0
    for i in range(n):
        if not pairs.states[pairs.order[i]] & COVERED:
            pairs.order[n_left] = pairs.order[i]
            n_left += 1
    for root in range(n_left // 2 - 1, -1, -1):
        _sift(pairs, root, n_left)
    for end in range(n_left - 1, 0, -1):
        first = pairs.order[0]
        pairs.order[0] = pairs.order[end]
        pairs.order[end] = first
        _sift(pairs, 0, end)
    return n_left


@kernel
def _sift(pairs, root, end):
    order = pairs.order
    k = order[root]
    while 2 * root + 1 < end:
        child = 2 * root + 1
        if child + 1 < end and _is_nearer(pairs, order[child], order[child + 1]):
            child += 1
        if not _is_nearer(pairs, k, order[child]):
            break
        order[root] = order[child]
        root = child
    order[root] = k


@kernel(inline=True)
def _is_nearer(pairs, i, j):
    return pairs.gaps[i] < pairs.gaps[j] or (pairs.gaps[i] == pairs.gaps[j] and i < j)


@kernel
def need_nearest(frame, n):
    """The first pair in order is a minimum where none as near is: nothing is nearer, whatever rounding makes of its
    neighbours.
    """
    pairs = frame.pairs
    if n == 0:
        return
    nearest = pairs.order[0]
    limit = pairs.near[NUMBERS_OF_PAIR * nearest + LENGTH] + STEP_ERRORS * frame.error
    for i in range(n):
        k = pairs.order[i]
        if pairs.gaps[k] > pairs.gaps[nearest] + 2.0 * STEP_ERRORS:
            break
        if pairs.near[NUMBERS_OF_PAIR * k + LOWER] <= limit and _is_minimum(frame, k):
            return
    pairs.states[nearest] |= LEAST


@kernel
def next_minimum(frame, first, n):
    """Place in the order, from ``first`` on, of the next local minimum in no patch; n without."""
    for i in range(first, n):
        k = frame.pairs.order[i]
        if not frame.pairs.states[k] & COVERED and _is_minimum(frame, k):
            return i
    return n


@kernel
def grow_gap(frame, first):
    """The patch around a local minimum."""
    pairs, points = frame.pairs, frame.points
    axes = axes_across(snapped(pairs, first))
    n = grow_patch(frame, first, axes, 0.0, True)
    near = NUMBERS_OF_PAIR * first
    length = pairs.near[near + LENGTH]
    bound = max(length - pairs.near[near + LOWER], 4.0 * frame.error)
    # Where corners of the face are as near, the nearest points of its first pair add nothing.
    if least_gap_of(points, n) > length + bound + STEP_ERRORS * frame.error:
        a = seen_along(axes, vec3_at(pairs.near, near + POINT_A))
        b = seen_along(axes, vec3_at(pairs.near, near + POINT_B))
        feature_a = 4 * pairs.facets[INTS_OF_PAIR * first + FACET_A] + FACE
        feature_b = 4 * pairs.facets[INTS_OF_PAIR * first + FACET_B] + FACE
        nearest = NearestPoint(b.x, b.y, length, 0.5 * (a.z + b.z), bound, first, feature_a, feature_b)
        n = put_nearest(points, n, nearest, frame.A.radius + frame.B.radius)
    return Patch(axes, n, False)
