"""Points at which facets come nearest along a direction: corners over facets, and edges that cross.

Seen along the unit vector n, the gap between two facets is linear over the polygon in which they overlap, so its
least and largest values stand at the corners of that polygon: corners of one over the other, and crossings of edges.
Places are (u, v) across n and the height h along it (`ContactAxes`), seen from A's origin.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.contact.contact_pairs import facing_a, facing_b
from collide.contact.manifold_points import GAP, HEIGHT, POINT, ManifoldPoints, V
from collide.contact.support_face import EDGE, FACE, VERTEX, seen_along
from collide.kernels import kernel
from collide.narrowphase.facets.facets_within import FACET_A, FACET_B, INTS_OF_PAIR
from collide.numerics.vec3 import put_vec3, vec3_at

#: A facet is looked at along n where its normal's cosine with it is above this.
LEAST_COSINE = 2.0**-10
#: Barycentric coordinates and edge parameters may be as far outside as rounding moves them, in so many errors of a
#: coordinate: no corner may be lost. Never farther than this share.
_ERRORS_OUTSIDE, _FARTHEST_OUTSIDE = 16.0, 2.0**-10
#: Edges whose sine, seen along n, is below this are parallel: their ends show it. Edges and heights of facets that are
#: shorter, seen so, than so many errors of a coordinate are none.
_PARALLEL, _MIN_ERRORS = 2.0**-30, 256.0


class PatchPoints(NamedTuple):
    """Points of pairs of facets.

    manifold : views of points and features.   errors : of each gap, a bound [m].   pairs : of which pair each is.
    seen : 18 doubles, corners of a pair of facets seen along the normal.
    """

    manifold: ManifoldPoints
    errors: Any
    pairs: Any
    seen: Any


class View(NamedTuple):
    """Along what, and within which gaps, points are looked for.

    axes : `ContactAxes`.   error : of a coordinate [m].   low, high : gaps [m], but for their errors.
    any_side : facets count whichever way they face.
    """

    axes: Any
    error: float
    low: float
    high: float
    any_side: bool


@kernel
def put_points(pairs, k, A, B, view, points, n):
    """Append the corners of the overlap of a pair's facets seen along a normal to n points; how many there are then.

    Facets that look the wrong way have none.
    """
    toward_b = facing_a(pairs, k, view.axes.nhat, A)
    toward_a = facing_b(pairs, k, view.axes.nhat, B)
    over_a, over_b = toward_b > LEAST_COSINE, toward_a > LEAST_COSINE
    if view.any_side:
        over_a = over_b = True
    elif toward_b < -LEAST_COSINE or toward_a < -LEAST_COSINE or not (over_a or over_b):
        return n
    least, largest = see_pair(pairs, k, view.axes, points.seen)
    if least > view.high + 32.0 * view.error or largest < view.low - 32.0 * view.error:
        return n
    if over_a:
        n = _corners_over(pairs, k, A, view, points, n, False)
    if over_b:
        n = _corners_over(pairs, k, B, view, points, n, True)
    return _crossings(pairs, k, A, B, view, points, n)


@kernel
def see_pair(pairs, k, axes, seen):
    """Put the corners of a pair as seen; bounds of the gap between any two points of both: (least, largest)."""
    high_a, low_b = -math.inf, math.inf
    low_a, high_b = math.inf, -math.inf
    for i in range(6):
        p = seen_along(axes, vec3_at(pairs.corners, 18 * k + 3 * i))
        put_vec3(seen, 3 * i, p)
        if i < 3:
            high_a, low_a = max(high_a, p.z), min(low_a, p.z)
        else:
            high_b, low_b = max(high_b, p.z), min(low_b, p.z)
    return low_b - high_a, high_b - low_a


@kernel(inline=True)
def _append(points, n, k, u, v, h_a, h_b, bound):
    manifold = points.manifold
    manifold.points[POINT * n] = u
    manifold.points[POINT * n + V] = v
    manifold.points[POINT * n + GAP] = h_b - h_a
    manifold.points[POINT * n + HEIGHT] = 0.5 * (h_a + h_b)
    points.errors[n] = bound
    points.pairs[n] = k


@kernel(inline=True)
def _within(view, gap, bound):
    return gap <= view.high + bound and gap >= view.low


@kernel
def _corners_over(pairs, k, body, view, points, n, exchanged):
    """Corners of one facet over the other, which is the body's: A's, or B's where ``exchanged``."""
    seen, error = points.seen, view.error
    face, corners = (9, 0) if exchanged else (0, 9)
    u0, v0, h0 = seen[face], seen[face + 1], seen[face + 2]
    eu, ev, eh = seen[face + 3] - u0, seen[face + 4] - v0, seen[face + 5] - h0
    fu, fv, fh = seen[face + 6] - u0, seen[face + 7] - v0, seen[face + 8] - h0
    area = eu * fv - ev * fu
    length_e, length_f = math.sqrt(eu * eu + ev * ev), math.sqrt(fu * fu + fv * fv)
    length_g = math.sqrt((fu - eu) * (fu - eu) + (fv - ev) * (fv - ev))
    longest = max(length_e, length_f, length_g)
    if not abs(area) > _MIN_ERRORS * error * longest:
        return n
    # Off an edge by an error, whatever the shape of the facet: no more of a needle's length than of its width.
    share = _ERRORS_OUTSIDE * error / abs(area)
    outside_e, outside_f = min(share * length_f, _FARTHEST_OUTSIDE), min(share * length_e, _FARTHEST_OUTSIDE)
    outside_p = min(share * length_g, _FARTHEST_OUTSIDE)
    spread = max(0.0, eh, fh) - min(0.0, eh, fh)
    bound = 32.0 * error + 64.0 * error * longest * spread / abs(area)
    for j in range(3):
        at = corners + 3 * j
        u, v, h = seen[at] - u0, seen[at + 1] - v0, seen[at + 2]
        of_e = (u * fv - v * fu) / area
        of_f = (eu * v - ev * u) / area
        if not (of_e >= -outside_e and of_f >= -outside_f and 1.0 - of_e - of_f >= -outside_p):
            continue
        height = h0 + of_e * eh + of_f * fh
        gap = height - h if exchanged else h - height
        if not _within(view, gap, bound):
            continue
        features = points.manifold.features
        if exchanged:
            _append(points, n, k, seen[at], seen[at + 1], h, height, bound)
            features[2 * n] = 4 * pairs.ids[6 * k + j] + VERTEX
            features[2 * n + 1] = 4 * pairs.facets[INTS_OF_PAIR * k + FACET_B] + FACE
        else:
            _append(points, n, k, seen[at], seen[at + 1], height, h, bound)
            features[2 * n] = 4 * pairs.facets[INTS_OF_PAIR * k + FACET_A] + FACE
            features[2 * n + 1] = 4 * pairs.ids[6 * k + 3 + j] + VERTEX
        n += 1
    return n


@kernel
def _crossings(pairs, k, A, B, view, points, n):
    """Where edges of A's facet cross edges of B's, seen along the normal."""
    seen, error = points.seen, view.error
    facet_a, facet_b = pairs.facets[INTS_OF_PAIR * k + FACET_A], pairs.facets[INTS_OF_PAIR * k + FACET_B]
    for i in range(3):
        p = 3 * i
        q = 3 * i + 3 if i < 2 else 0
        eu, ev, eh = seen[q] - seen[p], seen[q + 1] - seen[p + 1], seen[q + 2] - seen[p + 2]
        long_e = math.sqrt(eu * eu + ev * ev)
        for j in range(3):
            r = 9 + 3 * j
            s = r + 3 if j < 2 else 9
            fu, fv, fh = seen[s] - seen[r], seen[s + 1] - seen[r + 1], seen[s + 2] - seen[r + 2]
            wu, wv = seen[r] - seen[p], seen[r + 1] - seen[p + 1]
            span = eu * fv - ev * fu
            along_e, along_f = wu * fv - wv * fu, wu * ev - wv * eu
            # What is clearly outside is the rule: no roots and no quotients for it.
            size = abs(span) * (1.0 + _FARTHEST_OUTSIDE)
            if abs(along_e) > size or abs(along_f) > size:
                continue
            long_f = math.sqrt(fu * fu + fv * fv)
            if not abs(span) > _PARALLEL * long_e * long_f + _MIN_ERRORS * error * (long_e + long_f):
                continue
            of_e, of_f = along_e / span, along_f / span
            # Beyond the end of either edge by an error, across the other: no more of a long edge than of a short one.
            outside_e = min(_ERRORS_OUTSIDE * error * long_f / abs(span), _FARTHEST_OUTSIDE)
            outside_f = min(_ERRORS_OUTSIDE * error * long_e / abs(span), _FARTHEST_OUTSIDE)
            if of_e < -outside_e or of_e > 1.0 + outside_e or of_f < -outside_f or of_f > 1.0 + outside_f:
                continue
            # The place is on both edges: beyond an end of nearly parallel ones it were far along them.
            of_e, of_f = min(max(of_e, 0.0), 1.0), min(max(of_f, 0.0), 1.0)
            h_a, h_b = seen[p + 2] + of_e * eh, seen[r + 2] + of_f * fh
            slack = 64.0 * error * (long_e + long_f) / abs(span)
            bound = 32.0 * error + slack * (abs(eh) + abs(fh))
            if not _within(view, h_b - h_a, bound):
                continue
            _append(points, n, k, seen[p] + of_e * eu, seen[p + 1] + of_e * ev, h_a, h_b, bound)
            points.manifold.features[2 * n] = 4 * int(A.edges[3 * facet_a + i]) + EDGE
            points.manifold.features[2 * n + 1] = 4 * int(B.edges[3 * facet_b + j]) + EDGE
            n += 1
    return n


@kernel
def depth_along(pairs, k, A, B, view, points, enough):
    """How far B has to move along the normal for a pair's facets to come apart, but for rounding; 0 where they are.

    enough : what the slab between them shows to be no deeper is not measured: at most this is returned for it [m].
    points : of one pair.   view : of any side, without bounds.
    """
    least, _ = see_pair(pairs, k, view.axes, points.seen)
    if -least <= enough:
        return max(-least, 0.0)
    n = _corners_over(pairs, k, A, view, points, 0, False)
    n = _corners_over(pairs, k, B, view, points, n, True)
    n = _crossings(pairs, k, A, B, view, points, n)
    if n == 0:
        return max(-least, 0.0)
    gap = math.inf
    for i in range(n):
        gap = min(gap, points.manifold.points[POINT * i + GAP])
    return max(-gap, 0.0)


@kernel(inline=True)
def copy_of_points(points, source, target, k):
    """Copy a point to place k of other points."""
    for i in range(POINT):
        target.manifold.points[POINT * k + i] = points.manifold.points[POINT * source + i]
    target.manifold.features[2 * k] = points.manifold.features[2 * source]
    target.manifold.features[2 * k + 1] = points.manifold.features[2 * source + 1]
    target.errors[k] = points.errors[source]
    target.pairs[k] = points.pairs[source]
