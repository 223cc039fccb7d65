"""Points at which facets come nearest along a direction: corners over facets, and crossing edges.

Seen along the unit vector n, the gap between two facets is linear over the polygon of their overlap, so its least and
largest values stand at the polygon's corners: corners of a facet over the other, and crossings of edges. Places are (u,
v) across n and the height h along it (`ContactAxes`), seen from A's origin.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.contact.contact_pairs import facing_a, facing_b
from collide.contact.internal_edges import edge_slopes, fan_allows
from collide.contact.manifold_points import (
    GAP,
    HEIGHT,
    POINT,
    Line,
    ManifoldPoints,
    V,
    copy_point,
    put_line_ends,
    runs_along,
)
from collide.contact.support_face import ACROSS, EDGE, FACE, KNOWN, VERTEX, seen_along
from collide.kernels import kernel
from collide.narrowphase.facets.facets_within import BETWEEN_SHADOWS, FACET_A, FACET_B, INTS_OF_PAIR
from collide.numerics.vec3 import Vec3, add, neg, norm, put_vec3, scale, sub, vec3_at

#: A facet is looked at along n where its normal's cosine with it is above this.
LEAST_COSINE = 2.0**-10
#: Barycentric coordinates and edge parameters may be as far outside as rounding moves them, in so many errors of a
#: coordinate: no corner may be lost. Never farther than this share.
_ERRORS_OUTSIDE, _FARTHEST_OUTSIDE = 16.0, 2.0**-10
#: Edges whose sine, seen along n, is below this are parallel: their ends show it. Edges and heights of facets that are
#: shorter, seen so, than so many errors of a coordinate are none.
_PARALLEL, _MIN_ERRORS = 2.0**-30, 256.0
#: Of a radius: by so much a face or an edge within 45° of the normal is nearer along it than what supports the normal.
_LEAN = 1.0 / ACROSS - 1.0
#: Sines up to this are rounding of what supports a direction.
_SUPPORTING = 2.0**-26
#: Edges whose sine, seen along n, is below this cross at a place that is read from one of them.
_NEARLY_PARALLEL = 2.0**-10


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
    any_side : facets count whichever way they face.   on_surface : points of swept bodies are on their surface; else on
    the core, moved along the normal.
    """

    axes: Any
    error: float
    low: float
    high: float
    any_side: bool
    on_surface: bool


@kernel
def put_points(pairs, k, A, B, view, points, n):
    """Append the corners of the overlap of a pair's facets seen along a normal to n points; returns the new number.

    Facets facing the wrong way have no corners.
    """
    over_a, over_b = may_share_points(pairs, k, A, B, view, points.seen)
    if not (over_a or over_b):
        if A.radius + B.radius == 0.0 or _faces_away(pairs, k, A, B, view):
            return n
        return put_ends_along(pairs, k, A, B, view, points, n)
    if not view.on_surface or A.radius + B.radius == 0.0:
        return _put_overlap(pairs, k, A, B, 0.0, 0.0, view, over_a, over_b, points, n)
    # Gaps stay those of the cores, less what their surfaces are nearer.
    round_a, off_a = _sweep(pairs, k, 0, A, view, points.seen)
    round_b, off_b = _sweep(pairs, k, 1, B, view, points.seen)
    low = view.low - _LEAN * (A.radius + B.radius)
    outer = View(view.axes, view.error, low, view.high, view.any_side, True)
    n_after = _put_overlap(pairs, k, A, B, round_a, round_b, outer, over_a, over_b, points, n)
    for i in range(n, n_after):
        points.errors[i] += 2.0 * (off_a + off_b)
    return n_after


@kernel
def may_share_points(pairs, k, A, B, view, seen):
    """(whether corners over A's facet, over B's are wanted), neither where a pair has no points in a view; else sets
    the pair's corners as seen.

    Points lie in both shadows, or off them by `_FARTHEST_OUTSIDE` and rounding: of lengths above 256 errors rounding is
    below 2⁻⁸ of a facet for each of its three coordinates.
    """
    over_a = view.any_side or facing_a(pairs, k, view.axes.nhat, A) > LEAST_COSINE
    over_b = view.any_side or facing_b(pairs, k, view.axes.nhat, B) > LEAST_COSINE
    if not (over_a or over_b) or (not view.any_side and _faces_away(pairs, k, A, B, view)):
        return False, False
    if not within_gaps(pairs, k, view, seen):
        return False, False
    if A.radius + B.radius == 0.0 and (_shadows_apart(seen, 0) or _shadows_apart(seen, 1)):
        return False, False
    return over_a, over_b


@kernel(inline=True)
def _faces_away(pairs, k, A, B, view):
    """Whether a facet of a pair faces away from the other body."""
    nhat = view.axes.nhat
    return min(facing_a(pairs, k, nhat, A), facing_b(pairs, k, nhat, B)) < -LEAST_COSINE


@kernel(inline=True)
def within_gaps(pairs, k, view, seen):
    """Whether a pair, seen along a normal from here on, may have points within the gaps of a view."""
    least, largest = see_pair(pairs, k, view.axes, seen)
    return least <= view.high + 32.0 * view.error and largest >= view.low - 32.0 * view.error


@kernel(inline=True)
def _shadows_apart(seen, axis):
    """Whether the shadows of two facets are apart along an axis, by more than points may lie outside them."""
    a, b, c = seen[axis], seen[axis + 3], seen[axis + 6]
    p, q, r = seen[axis + 9], seen[axis + 12], seen[axis + 15]
    low_a, high_a, low_b, high_b = min(a, b, c), max(a, b, c), min(p, q, r), max(p, q, r)
    return max(low_b - high_a, low_a - high_b) > BETWEEN_SHADOWS * (high_a - low_a + high_b - low_b)


@kernel
def _put_overlap(pairs, k, A, B, round_a, round_b, view, over_a, over_b, points, n):
    """Append the corners of the overlap of a pair, as seen in ``points.seen``.

    round_a, round_b : radii across the edges shown by the bodies, 0 of sharp edges and of faces [m].
    """
    if over_a:
        n = _corners_over(pairs, k, view, points, n, False)
    if over_b:
        n = _corners_over(pairs, k, view, points, n, True)
    return _crossings(pairs, k, A, B, round_a, round_b, view, points, n)


@kernel
def _sweep(pairs, k, side, body, view, seen):
    """Move the corners of a body's facet, seen along the normal, onto the surface of the body swept by its ball: as
    `swept_face` does; (radius across the shown edge, else 0; how far the surface may be off the moved corners [m]).

    They are moved by the radius along the facet's own normal, less the radius along nhat, so that gaps stay the cores'
    gaps. A steep facet shows its least steep edge, a steep edge the corner in front: corners not shown become NaN:
    comparisons with NaN are false, so nothing is over them.
    """
    radius = body.radius
    if radius == 0.0:
        return 0.0, 0.0
    sign = 1.0 if side == 0 else -1.0
    at = 9 * side
    p, q, r = vec3_at(seen, at), vec3_at(seen, at + 3), vec3_at(seen, at + 6)
    normal = scale(sign, seen_along(view.axes, vec3_at(pairs.normals, 6 * k + 3 * side)))
    if normal.z < 0.0 and not body.solid:
        normal = Vec3(-normal.x, -normal.y, -normal.z)
    if normal.z >= ACROSS:
        e, f = sub(q, p), sub(r, p)
        area = abs(e.x * f.y - e.y * f.x)
        longest = max(norm(e), norm(f), norm(sub(f, e)))
        unknown = 4.0 * view.error * longest / area if area > 0.0 else 1.0
        if unknown <= KNOWN:
            step = scale(sign * radius, Vec3(normal.x, normal.y, normal.z - 1.0))
            for i in range(3):
                put_vec3(seen, at + 3 * i, add(vec3_at(seen, at + 3 * i), step))
            return 0.0, unknown * radius
    return _sweep_edge(pairs, k, side, body, view, seen)


@kernel
def _sweep_edge(pairs, k, side, body, view, seen):
    """`_sweep` where no face is across the normal: by the least steep edge supporting the normal's part across it, not
    the diagonal of a face, or by the corner in front.
    """
    sign = 1.0 if side == 0 else -1.0
    ids, at = 6 * k + 3 * side, 9 * side
    least, best, front = ACROSS, -1, 0
    shift = Vec3(0.0, 0.0, 0.0)
    unknown = 0.0
    for i in range(3):
        j = (i + 1) % 3
        p, q = vec3_at(seen, at + 3 * i), vec3_at(seen, at + 3 * j)
        if sign * p.z > sign * seen[at + 3 * front + 2]:
            front = i
        e = sub(q, p)
        length = norm(e)
        if not (length > _MIN_ERRORS * view.error and 2.0 * view.error <= KNOWN * length):
            continue
        if not abs(e.z) < least * length:
            continue
        across = sub(Vec3(0.0, 0.0, sign), scale(sign * e.z / (length * length), e))
        across = scale(1.0 / norm(across), across)
        if _supports(pairs, k, side, body, view, i, pairs.ids[ids + j], across):
            least, best, unknown, shift = abs(e.z) / length, i, 2.0 * view.error / length, across
    end = (best + 1) % 3
    if best < 0:
        best = front
        end = front
        shift = Vec3(0.0, 0.0, sign)
        if not _supports(pairs, k, side, body, view, front, -1, shift):
            best, end = -1, -1
    step = scale(body.radius, Vec3(shift.x, shift.y, shift.z - sign))
    for i in range(3):
        if i == best or i == end:
            put_vec3(seen, at + 3 * i, add(vec3_at(seen, at + 3 * i), step))
        else:
            put_vec3(seen, at + 3 * i, Vec3(math.nan, math.nan, math.nan))
    return (body.radius if end != best else 0.0), unknown * body.radius


@kernel(inline=True)
def _supports(pairs, k, side, body, view, first, end, direction):
    """Whether a body lies behind corner ``first`` of its facet, or the edge from there to corner ``end`` of the body,
    in a direction as seen.
    """
    axes = view.axes
    u = add(add(scale(direction.x, axes.e), scale(direction.y, axes.f)), scale(direction.z, axes.nhat))
    point = vec3_at(pairs.corners, 18 * k + 9 * side + 3 * first)
    return fan_allows(body, pairs.ids[6 * k + 3 * side + first], end, point, u, _SUPPORTING)


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
def _corners_over(pairs, k, view, points, n, exchanged):
    """Append corners of the other facet over a facet: A's, or B's where ``exchanged``."""
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
def _crossings(pairs, k, A, B, round_a, round_b, view, points, n):
    """Append crossings of edges of A's facet with edges of B's, seen along the normal; for a round edge along a sharp
    edge, even a surface's rim, the ends of their shared part.
    """
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
            if round_a + round_b > 0.0:
                is_along, n = _put_ends(pairs, k, i, j, A, B, round_a, round_b, view, points, n)
                if is_along:
                    continue
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
            if abs(span) < _NEARLY_PARALLEL * long_e * long_f:
                of_e, of_f = _beside(of_e, eu, ev, fu, fv, wu, wv)
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


@kernel(inline=True)
def _beside(of_e, eu, ev, fu, fv, wu, wv):
    """Parameters of the places on edges e and f nearest to the place at ``of_e``: e and f seen along the normal, w from
    the begin of e to the begin of f.

    Quotients by a small sine are off by error / sine, each differently: places from two quotients would be as far apart
    along the edges. The place beside a given place is off by no more than the error, wherever along the edge.
    """
    of_e = min(max(of_e, 0.0), 1.0)
    of_f = ((of_e * eu - wu) * fu + (of_e * ev - wv) * fv) / (fu * fu + fv * fv)
    if 0.0 <= of_f <= 1.0:
        return of_e, of_f
    of_f = min(max(of_f, 0.0), 1.0)
    of_e = ((wu + of_f * fu) * eu + (wv + of_f * fv) * ev) / (eu * eu + ev * ev)
    return min(max(of_e, 0.0), 1.0), of_f


@kernel
def _line_seen(pairs, k, side, i, body, rounding, seen):
    """The `Line` of edge i of A's or B's facet."""
    facet = pairs.facets[INTS_OF_PAIR * k + FACET_A + side]
    j = (i + 1) % 3
    ids, at = 6 * k + 3 * side, 9 * side
    return Line(
        vec3_at(seen, at + 3 * i), vec3_at(seen, at + 3 * j), rounding, rounding, 4 * pairs.ids[ids + i] + VERTEX,
        4 * pairs.ids[ids + j] + VERTEX, 4 * int(body.edges[3 * facet + i]) + EDGE,
    )


@kernel
def _slopes_at(pairs, k, side, i, body, axes):
    """The `EdgeSlopes` of edge i of a body's facet, towards the other body."""
    j = (i + 1) % 3
    ids, at = 6 * k + 3 * side, 18 * k + 9 * side
    return edge_slopes(
        body, pairs.ids[ids + i], pairs.ids[ids + j], vec3_at(pairs.corners, at + 3 * i),
        vec3_at(pairs.corners, at + 3 * j), axes.nhat if side == 0 else neg(axes.nhat), _SUPPORTING,
    )


@kernel
def _put_ends(pairs, k, i, j, A, B, round_a, round_b, view, points, n):
    """Append the ends of the shared part of edges i of A and j of B, a round edge along a sharp edge; (whether they run
    along each other, the new number of points).
    """
    a = _line_seen(pairs, k, 0, i, A, round_a, points.seen)
    b = _line_seen(pairs, k, 1, j, B, round_b, points.seen)
    if not runs_along(a, b):
        return False, n
    is_sharp_b = round_a > 0.0
    if is_sharp_b:
        slopes = _slopes_at(pairs, k, 1, j, B, view.axes)
    else:
        slopes = _slopes_at(pairs, k, 0, i, A, view.axes)
    if not slopes.supports or max(slopes.left_slope, slopes.right_slope) <= _SUPPORTING:
        return False, n
    n_before, n_after, bound = n, n, 32.0 * view.error
    n = put_line_ends(a, b, is_sharp_b, slopes, 16.0 * view.error, points.manifold, n)
    for i_end in range(n_before, n):
        if _within(view, points.manifold.points[POINT * i_end + GAP], bound):
            if i_end != n_after:
                copy_point(points.manifold, i_end, n_after)
            points.errors[n_after] = bound
            points.pairs[n_after] = k
            n_after += 1
    return True, n_after


@kernel
def put_ends_along(pairs, k, A, B, view, points, n):
    """Append the ends of round edges of a swept body along sharp edges of a pair's other facet, and no other points, to
    n; returns the new number: so lines go on beside facets too steep to count.
    """
    if not view.on_surface or A.radius + B.radius == 0.0:
        return n
    if not within_gaps(pairs, k, view, points.seen):
        return n
    round_a, off_a = _sweep(pairs, k, 0, A, view, points.seen)
    round_b, off_b = _sweep(pairs, k, 1, B, view, points.seen)
    if round_a + round_b == 0.0:
        return n
    n_before = n
    outer = View(view.axes, view.error, view.low - _LEAN * (A.radius + B.radius), view.high, view.any_side, True)
    for i in range(3):
        for j in range(3):
            _, n = _put_ends(pairs, k, i, j, A, B, round_a, round_b, outer, points, n)
    for i in range(n_before, n):
        points.errors[i] += 2.0 * (off_a + off_b)
    return n


@kernel
def depth_along(pairs, k, A, B, view, points, enough):
    """How far B has to move along the normal for a pair's facets to come apart, but for rounding; 0 where apart.

    enough : a pair whose slab proves a depth ≤ ``enough`` is not measured: the slab's depth is returned [m].
    points : of one pair.   view : of any side, without bounds.
    """
    least, _ = see_pair(pairs, k, view.axes, points.seen)
    if -least <= enough:
        return max(-least, 0.0)
    n = _corners_over(pairs, k, view, points, 0, False)
    n = _corners_over(pairs, k, view, points, n, True)
    n = _crossings(pairs, k, A, B, 0.0, 0.0, view, points, n)
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
