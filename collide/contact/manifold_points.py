"""Points of a convex manifold: corners of the overlap of two support faces, thinned out and put in order."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.contact.clip_polygons import Clipped, clip_polygons, clip_segment, corner_of_b
from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, vec3_at

#: Doubles of a point: place across the normal, gap along it, height of the middle between both bodies.
U, V, GAP, HEIGHT = range(4)
POINT = 4
#: Sines up to this are those of parallel sharp lines: where these overlap they touch along a line, and each end lies
#: off the other line by so much of its length at most.
_PARALLEL = 2.0**-36
#: Sharp lines farther beside each other than this part of the shorter do not touch along it.
_BESIDE = 2.0**-20
#: Sines up to this are those of lines along each other where a surface is round across one: it falls off from its line
#: with the square of how far the other is beside it, and that is worked out.
ALONG = 2.0**-10
#: A round line no farther beside a side of a face than this part of its radius is along that side.
_OFF_SIDE = 2.0**-14
#: Round surfaces are looked at down to 45°, as faces are: so far beside its line, in radii.
_ASIDE = math.sqrt(0.5)
#: Ends of what round bodies share are found in so many steps, each some thousand times shorter than the one before.
_STEPS_TO_END = 12
#: Nearest points nearer to a corner than this part of the manifold's size take its place: a rim is a little outside its
#: octagon, and two contacts so near would be one too many.
NEAR = 2.0**-8
#: The same of lines: a shorter line is another one. Of 60 lines over rims the nearest point was up to 1/1,175 off.
NEAR_END = 2.0**-10


class ManifoldPoints(NamedTuple):
    """Views of points (POINT doubles each) and of a feature of A and one of B for each; both have room for all."""

    points: Any
    features: Any


@kernel(inline=True)
def _put(manifold, k, u, v, h_a, h_b, feature_a, feature_b):
    manifold.points[POINT * k + U] = u
    manifold.points[POINT * k + V] = v
    manifold.points[POINT * k + GAP] = h_b - h_a
    manifold.points[POINT * k + HEIGHT] = 0.5 * (h_a + h_b)
    manifold.features[2 * k] = feature_a
    manifold.features[2 * k + 1] = feature_b


@kernel(inline=True)
def height_at(face, u, v):
    """Of the plane of a face over a place; of an edge, on its line."""
    if face.n == 2:
        u0, v0, h0 = face.corners[0], face.corners[1], face.corners[2]
        du, dv, dh = face.corners[3] - u0, face.corners[4] - v0, face.corners[5] - h0
        square = du * du + dv * dv
        t = 0.0 if square == 0.0 else min(max((du * (u - u0) + dv * (v - v0)) / square, 0.0), 1.0)
        return h0 + t * dh
    return face.h + face.slope_u * (u - face.u) + face.slope_v * (v - face.v)


class Line(NamedTuple):
    """An edge seen along the normal: its ends (u, v, h), and what is named there.

    round_p, round_q : as in `SupportFace`.
    """

    p: Vec3
    q: Vec3
    round_p: float
    round_q: float
    feature_p: int
    feature_q: int
    edge: int


class SharedSpan(NamedTuple):
    """What two edges share: low, high, parameters along A; begin, end, A's parameters at B's ends; nothing where low >
    high.

    off : largest distance between places on both, where both are sharp [m].
    """

    low: float
    high: float
    begin: float
    end: float
    off: float


@kernel(inline=True)
def line_of(edge):
    """The `Line` of a `SupportFace` of two corners."""
    return Line(
        vec3_at(edge.corners, 0), vec3_at(edge.corners, 3), edge.round_p, edge.round_q, edge.features[0],
        edge.features[1], edge.edges[0],
    )


@kernel(inline=True)
def side_of(face, side):
    """The `Line` of a side of a face."""
    following = side + 1 if side + 1 < face.n else 0
    return Line(
        vec3_at(face.corners, 3 * side), vec3_at(face.corners, 3 * following), 0.0, 0.0, face.features[side],
        face.features[following], face.edges[side],
    )


@kernel
def overlap_points(face_a, face_b, tolerance, max_gap, first, second, manifold):
    """Put the corners of the overlap of two support faces, counter-clockwise; (how many, error of gaps from the
    distance between places on both [m]). No corners where either face is a vertex.

    tolerance : corners so far outside count as inside [m].   max_gap : ends of a round line are looked for along the
    sides of a face where both are within this gap [m].   first, second : space for polygons (`clip_polygons`).
    """
    if face_a.n < 2 or face_b.n < 2:
        return 0, 0.0
    if face_a.n == 2 and face_b.n == 2:
        a, b = line_of(face_a), line_of(face_b)
        return _put_shared(a, b, shared_span(a, b, tolerance), manifold)
    if face_a.n == 2:
        return _edge_over_face(face_a, face_b, False, tolerance, max_gap, manifold), 0.0
    if face_b.n == 2:
        return _edge_over_face(face_b, face_a, True, tolerance, max_gap, manifold), 0.0
    n, in_second = clip_polygons(face_a, face_b, tolerance, first, second)
    polygon = Clipped(second.points if in_second else first.points, second.sides if in_second else first.sides)
    before = polygon.sides[n - 1] if n > 0 else 0
    for k in range(n):
        side = polygon.sides[k]
        u, v = polygon.points[2 * k], polygon.points[2 * k + 1]
        _put_corner(face_a, face_b, before, side, u, v, tolerance, manifold, k)
        before = side
    return n, 0.0


@kernel(inline=True)
def _is_over(face_b, u, v, tolerance):
    """Whether a place is over a face of B, or outside it by no more than the tolerance [m]."""
    for k in range(face_b.n):
        i, j = 3 * corner_of_b(face_b, k), 3 * corner_of_b(face_b, k + 1 if k + 1 < face_b.n else 0)
        du, dv = face_b.corners[j] - face_b.corners[i], face_b.corners[j + 1] - face_b.corners[i + 1]
        beside = du * (v - face_b.corners[i + 1]) - dv * (u - face_b.corners[i])
        if beside < -tolerance * math.sqrt(du * du + dv * dv):
            return False
    return True


@kernel
def _put_corner(face_a, face_b, before, side, u, v, tolerance, manifold, k):
    """Point k, between two sides of the overlap (`Clipped`), at (u, v) or at a corner of a face.

    Between two sides of A the point is A's corner, unless the sides, moved out by the tolerance, meet far from the
    corner, being nearly parallel, and the corner is not over B.
    """
    if before >= 0 and side >= 0:
        at = 3 * side
        off = max(abs(face_a.corners[at] - u), abs(face_a.corners[at + 1] - v))
        if off > 4.0 * tolerance and not _is_over(face_b, face_a.corners[at], face_a.corners[at + 1], tolerance):
            h_a, h_b = height_at(face_a, u, v), height_at(face_b, u, v)
            _put(manifold, k, u, v, h_a, h_b, face_a.edges[side], face_b.feature)
            return
        u, v = face_a.corners[at], face_a.corners[at + 1]
        _put(
            manifold, k, u, v, face_a.corners[at + 2], height_at(face_b, u, v), face_a.features[side], face_b.feature
        )
    elif before < 0 and side < 0:
        corner = corner_of_b(face_b, -1 - side)
        u, v = face_b.corners[3 * corner], face_b.corners[3 * corner + 1]
        _put(
            manifold, k, u, v, height_at(face_a, u, v), face_b.corners[3 * corner + 2], face_a.feature,
            face_b.features[corner],
        )
    else:
        of_a, of_b = (side, before) if side >= 0 else (before, side)
        corner = corner_of_b(face_b, -1 - of_b)
        edge = corner - 1 if corner > 0 else face_b.n - 1
        _put(
            manifold, k, u, v, height_at(face_a, u, v), height_at(face_b, u, v), face_a.edges[of_a],
            face_b.edges[edge],
        )


@kernel
def _edge_over_face(edge, face, is_edge_of_b, tolerance, max_gap, manifold):
    """The ends of what lies over a face of an edge, or, of a round one, along a side of the face; how many."""
    u0, v0 = edge.corners[0], edge.corners[1]
    u1, v1 = edge.corners[3], edge.corners[4]
    low, high, low_side, high_side = clip_segment(face, not is_edge_of_b, u0, v0, u1, v1, tolerance)
    n = 0 if low > high else 2
    for k in range(n):
        t, side = (low, low_side) if k == 0 else (high, high_side)
        u, v = u0 + t * (u1 - u0), v0 + t * (v1 - v0)
        h = edge.corners[2] + t * (edge.corners[5] - edge.corners[2])
        of_edge = edge.features[k] if side < 0 else edge.edges[0]
        of_face = face.feature if side < 0 else face.edges[side]
        if is_edge_of_b:
            _put(manifold, k, u, v, height_at(face, u, v), h, of_face, of_edge)
        else:
            _put(manifold, k, u, v, h, height_at(face, u, v), of_edge, of_face)
    if edge.round_p > 0.0:
        return _ends_beside(edge, face, is_edge_of_b, tolerance, max_gap, n, manifold)
    return n


@kernel
def _ends_beside(edge, face, is_edge_of_b, tolerance, max_gap, n, manifold):
    """Put the ends of a round edge's part shared with a side of a face, where longer than the part over the face within
    the gap; returns the number of points, n before.

    A capsule along an edge of a box, turned by a hair, lies over a face with one half, over another with the other.
    """
    line = line_of(edge)
    square = 0.0
    if n == 2 and max(manifold.points[GAP], manifold.points[POINT + GAP]) <= max_gap:
        square = _square(manifold.points, 0, 1)
    longest = math.sqrt(square) + tolerance
    best = -1
    for side in range(face.n):
        rim = side_of(face, side)
        a, b = (rim, line) if is_edge_of_b else (line, rim)
        shared = shared_span(a, b, tolerance)
        du, dv = a.q.x - a.p.x, a.q.y - a.p.y
        length = (shared.high - shared.low) * math.sqrt(du * du + dv * dv)
        # Along the side itself the line is over the face, or beside it, by as much as its normal is off: a cylinder's
        # is good to some 1e-5. Its ends are the side's each time.
        is_on_side = best < 0 and _beside(rim, line) <= _OFF_SIDE * max(edge.round_p, edge.round_q)
        if not length > (longest - 2.0 * tolerance - _BESIDE * longest if is_on_side else longest):
            continue
        farthest = max(place_between(a, b, shared, shared.low).gap, place_between(a, b, shared, shared.high).gap)
        if farthest <= max_gap:
            best, longest = side, length
    if best < 0:
        return n
    rim = side_of(face, best)
    a, b = (rim, line) if is_edge_of_b else (line, rim)
    n, _ = _put_shared(a, b, shared_span(a, b, tolerance), manifold)
    return n


@kernel(inline=True)
def _beside(a, b):
    """How far the ends of line b are beside line a, seen along the normal, at most; infinite where a has no length."""
    du, dv = a.q.x - a.p.x, a.q.y - a.p.y
    length = math.sqrt(du * du + dv * dv)
    if length == 0.0:
        return math.inf
    at_p = du * (b.p.y - a.p.y) - dv * (b.p.x - a.p.x)
    at_q = du * (b.q.y - a.p.y) - dv * (b.q.x - a.p.x)
    return max(abs(at_p), abs(at_q)) / length


@kernel(inline=True)
def runs_along(a, b):
    """Whether two lines, seen along the normal, have a length and run along each other."""
    eu, ev, fu, fv = a.q.x - a.p.x, a.q.y - a.p.y, b.q.x - b.p.x, b.q.y - b.p.y
    square = (eu * eu + ev * ev) * (fu * fu + fv * fv)
    span = eu * fv - ev * fu
    return square > 0.0 and span * span <= ALONG * ALONG * square


@kernel
def shared_span(a, b, tolerance):
    """The `SharedSpan` of two edges nearly parallel; crossing ones have their nearest points and no more."""
    none = SharedSpan(1.0, 0.0, 0.0, 1.0, 0.0)
    du, dv, eu, ev = a.q.x - a.p.x, a.q.y - a.p.y, b.q.x - b.p.x, b.q.y - b.p.y
    length_a, length_b = math.sqrt(du * du + dv * dv), math.sqrt(eu * eu + ev * ev)
    if length_a == 0.0 or length_b == 0.0:
        return none
    rounding = max(a.round_p, a.round_q) + max(b.round_p, b.round_q)
    across = abs(du * ev - dv * eu)
    if across > (ALONG if rounding > 0.0 else _PARALLEL) * length_a * length_b + tolerance * (length_a + length_b):
        return none
    square = length_a * length_a
    begin = ((b.p.x - a.p.x) * du + (b.p.y - a.p.y) * dv) / square
    end = ((b.q.x - a.p.x) * du + (b.q.y - a.p.y) * dv) / square
    if begin == end:
        return none
    low, high = max(0.0, min(begin, end)), min(1.0, max(begin, end))
    # How far the lines are beside each other at both ends of what they share: linear in between.
    beside_p = (du * (b.p.y - a.p.y) - dv * (b.p.x - a.p.x)) / length_a
    beside_q = (du * (b.q.y - a.p.y) - dv * (b.q.x - a.p.x)) / length_a
    at_low = beside_p + (low - begin) / (end - begin) * (beside_q - beside_p)
    at_high = beside_p + (high - begin) / (end - begin) * (beside_q - beside_p)
    off = max(abs(at_low), abs(at_high))
    if rounding > 0.0:
        # A place is beside A's line: square to it, and so beyond an end of B's by the sine of what is between.
        slip = across / (square * length_b)
        if min(begin, end) > 0.0:
            low += slip * abs(at_low)
        if max(begin, end) < 1.0:
            high -= slip * abs(at_high)
        shared = _not_far_aside(a, b, SharedSpan(low, high, begin, end, 0.0), at_low, at_high)
        return _within_ends(a, b, shared, 0.25 * tolerance)
    # The normal of curved bodies is good to 2⁻²⁶: seen along it, lines that touch may lie beside each other by as much.
    if off > _BESIDE * min(length_a, length_b) + tolerance:
        return none
    return SharedSpan(low, high, begin, end, off)


@kernel(inline=True)
def _not_far_aside(a, b, shared, at_low, at_high):
    """Part of a `SharedSpan` beside A's line by at_low … at_high [m], linear in between, and by at most _ASIDE times
    the radius, linear too for cones.
    """
    low, high = shared.low, shared.high
    limit_low, limit_high = _ASIDE * _radius_between(a, b, shared, low), _ASIDE * _radius_between(a, b, shared, high)
    for side in range(2):
        left_low = limit_low - at_low if side == 0 else limit_low + at_low
        left_high = limit_high - at_high if side == 0 else limit_high + at_high
        if left_low < 0.0 and left_high < 0.0:
            return SharedSpan(1.0, 0.0, shared.begin, shared.end, 0.0)
        if left_low < 0.0:
            low = max(low, shared.low + left_low / (left_low - left_high) * (shared.high - shared.low))
        elif left_high < 0.0:
            high = min(high, shared.high - left_high / (left_high - left_low) * (shared.high - shared.low))
    return SharedSpan(low, high, shared.begin, shared.end, 0.0)


@kernel(inline=True)
def _radius_of(line, s):
    """Across a line at parameter s."""
    return line.round_p + s * (line.round_q - line.round_p)


@kernel(inline=True)
def _parameter_of_b(shared, t):
    """Of B's line beside parameter t of A's."""
    return min(max((t - shared.begin) / (shared.end - shared.begin), 0.0), 1.0)


@kernel(inline=True)
def _radius_between(a, b, shared, t):
    return _radius_of(a, t) + _radius_of(b, _parameter_of_b(shared, t))


class PlaceBetween(NamedTuple):
    """A place (u, v) between two edges, with the heights of both surfaces and the gap there.

    beside_u, beside_v : from A's line to B's; A's share of this vector leads to the place.
    fall_a, fall_b : how much each surface has fallen off from its line at the place, ∞ where the surface does not reach
        the place [m].
    """

    u: float
    v: float
    h_a: float
    h_b: float
    gap: float
    beside_u: float
    beside_v: float
    share: float
    fall_a: float
    fall_b: float


@kernel(inline=True)
def place_between(a, b, shared, t):
    """The `PlaceBetween` at parameter t of A: of sharp edges on A, else between both, as their radii are."""
    du, dv, dh = a.q.x - a.p.x, a.q.y - a.p.y, a.q.z - a.p.z
    eu, ev, eh = b.q.x - b.p.x, b.q.y - b.p.y, b.q.z - b.p.z
    s = _parameter_of_b(shared, t)
    u, v = a.p.x + t * du, a.p.y + t * dv
    wu, wv = b.p.x + s * eu - u, b.p.y + s * ev - v
    h_a, h_b = a.p.z + t * dh, b.p.z + s * eh
    share, fall_a, fall_b = 0.0, 0.0, 0.0
    round_a, round_b = _radius_of(a, t), _radius_of(b, s)
    rounding = round_a + round_b
    if rounding > 0.0:
        share = round_a / rounding
        u += share * wu
        v += share * wv
        fall_a = _fall(round_a, a.round_q - a.round_p, share * wu, share * wv, du, dv, dh)
        # B seen from its other side, through the point on its line: the same surface, its line turned about.
        fall_b = _fall(round_b, b.round_p - b.round_q, (1.0 - share) * wu, (1.0 - share) * wv, eu, ev, eh)
        h_a -= fall_a
        h_b += fall_b
    return PlaceBetween(u, v, h_a, h_b, h_b - h_a, wu, wv, share, fall_a, fall_b)


@kernel(inline=True)
def _fall(radius, growth, wu, wv, du, dv, dh):
    """By how much a round surface falls off from its line at a place (wu, wv) beside it; (du, dv, dh) along the line.

    growth : of the radius along the line [m]; not 0 of cones (`_fall_of_cone`).
    With e the unit vector along the axis, w across nhat, and z the height over the axis, |w + z·nhat|² less the square
    of its product with e is the squared radius: a·z² − 2·(e·nhat)·(w·e)·z + w² − (w·e)² = r², where a = 1 − (e·nhat)².
    Of A w leads from its axis and z is above it, of B both are turned about.
    """
    if radius == 0.0:
        return 0.0
    square = du * du + dv * dv
    length = math.sqrt(square + dh * dh)
    if growth != 0.0:
        return _fall_of_cone(radius, growth / length, wu, wv, Vec3(du / length, dv / length, dh / length))
    along, rise = (wu * du + wv * dv) / length, dh / length
    a = square / (length * length)
    aside = a * (wu * wu + wv * wv) - along * along
    level = a * radius * radius
    return (aside / (math.sqrt(level) + math.sqrt(max(level - aside, 0.0))) - rise * along) / a


@kernel
def _fall_of_cone(radius, taper, wu, wv, e):
    """`_fall` of a cone with this radius of curvature across its line at the place, growing by ``taper`` along e.

    With x, y, z along e, across it and nhat, and out of the tangent plane, from the line, a cone of half angle α,
    taper = tan α, is z²·(taper² − 1) − 2·(radius + taper·x)·z = y². A place is at (e·w, y, −(e·nhat)·(e·w)/√a), where
    a = 1 − (e·nhat)² and y² = w² − (e·w)²/a; nhat at (e·nhat, 0, √a). ∞ where the cone has no point over the place.
    """
    if taper < 0.0:
        e, taper = Vec3(-e.x, -e.y, -e.z), -taper
    square = e.x * e.x + e.y * e.y
    root, along = math.sqrt(square), wu * e.x + wv * e.y
    z, aside = -e.z * along / root, max(wu * wu + wv * wv - along * along / square, 0.0)
    form, reach = taper * taper - 1.0, radius + taper * along
    # The height h over the place: quadratic · h² − 2 · linear · h + constant = 0.
    quadratic = square * form - 2.0 * taper * e.z * root
    linear = root * reach + taper * e.z * z - root * z * form
    constant = z * z * form - 2.0 * reach * z - aside
    under = linear * linear - quadratic * constant
    if not (linear > 0.0 and under >= 0.0):
        return math.inf
    return -constant / (linear + math.sqrt(under))


@kernel
def _within_ends(a, b, shared, tolerance):
    """A `SharedSpan` cut to places past no end of a round body by more than the tolerance [m].

    Empty where its ends are not found in _STEPS_TO_END steps, or where a surface does not reach them.
    """
    none = SharedSpan(1.0, 0.0, shared.begin, shared.end, 0.0)
    low, high = shared.low, shared.high
    du, dv = a.q.x - a.p.x, a.q.y - a.p.y
    length = math.sqrt(du * du + dv * dv)
    for end in range(2):
        past = math.inf
        for _ in range(_STEPS_TO_END):
            t = low if end == 0 else high
            at = place_between(a, b, shared, t)
            if not at.fall_a + at.fall_b < math.inf:
                return none
            rest = 1.0 - at.share
            past = max(
                _past_end(a, t, 1.0, at.share * at.beside_u, at.share * at.beside_v, at.fall_a),
                _past_end(b, _parameter_of_b(shared, t), -1.0, rest * at.beside_u, rest * at.beside_v, at.fall_b),
            )
            if past <= tolerance:
                break
            if end == 0:
                low += past / length
            else:
                high -= past / length
            if low > high:
                return none
        if past > tolerance:
            return none
    return SharedSpan(low, high, shared.begin, shared.end, 0.0)


@kernel
def _past_end(line, s, sign, wu, wv, fall):
    """How far past an end of its body a place (wu, wv) beside a round line and fallen off from the line is, along the
    line [m]; below 0 within both ends.

    Ends are square to the axis, off the line by the half angle α of a cone, tan α = taper. With e the unit
    vector along the line towards the end, z = e·nhat and a = 1 − z², a place w beside the line and fallen off is past
    the plane of the end by w·e · (1 + taper · z/√a) + fall · (taper · √a − z).
    sign : 1 for A, −1 for B, seen from its other side (`place_between`).
    """
    e = Vec3(line.q.x - line.p.x, line.q.y - line.p.y, line.q.z - line.p.z)
    length = math.sqrt(e.x * e.x + e.y * e.y + e.z * e.z)
    max_past = -math.inf
    for end in range(2):
        out = sign / length if end == 1 else -sign / length
        taper = (line.round_q - line.round_p) / length
        taper = taper if end == 1 else -taper
        if taper < 0.0 or max(line.round_p, line.round_q) == 0.0:
            continue  # an apex, or a sharp edge
        z, root = out * e.z, math.sqrt(e.x * e.x + e.y * e.y) / length
        along = out * (wu * e.x + wv * e.y)
        inside = (s if end == 0 else 1.0 - s) * length
        max_past = max(max_past, along * (1.0 + taper * z / root) + fall * (taper * root - z) - inside)
    return max_past


@kernel(inline=True)
def features_of_end(a, b, shared, k):
    """What of A and of B meets at end k of what two edges share: a corner of one, the edge of the other."""
    if k == 0:
        is_of_a = min(shared.begin, shared.end) <= 0.0
    else:
        is_of_a = max(shared.begin, shared.end) >= 1.0
    if is_of_a:
        return (a.feature_p if k == 0 else a.feature_q), b.edge
    return a.edge, (b.feature_q if (k == 0) == (shared.begin > shared.end) else b.feature_p)


@kernel
def _put_shared(a, b, shared, manifold):
    """Put the ends of what two edges share; (how many, how far gaps are off [m])."""
    if shared.low > shared.high:
        return 0, 0.0
    for k in range(2):
        at = place_between(a, b, shared, shared.low if k == 0 else shared.high)
        feature_a, feature_b = features_of_end(a, b, shared, k)
        _put(manifold, k, at.u, at.v, at.h_a, at.h_b, feature_a, feature_b)
    return 2, shared.off


@kernel
def put_line_ends(a, b, is_sharp_b, slopes, tolerance, manifold, n):
    """Append the ends of the part shared by a round line and a sharp edge of a surface; returns the new number of
    points.

    is_sharp_b : the edge is B's.   slopes : `EdgeSlopes` of the edge, towards the line.   tolerance : rounding of a gap
    [m].
    An end whose line runs over a facet beside the edge is moved to the facet where this is nearer: a line beside
    the edge by b meets a facet fallen off by slope · b.
    """
    shared = shared_span(a, b, tolerance)
    if shared.low > shared.high:
        return n
    edge = b if is_sharp_b else a
    eu, ev = edge.q.x - edge.p.x, edge.q.y - edge.p.y
    for k in range(2):
        at = place_between(a, b, shared, shared.low if k == 0 else shared.high)
        # edge × direction is (−ev, eu) for B, whose surface is seen from below, and for A its opposite; the line is
        # beside the edge by −(beside_u, beside_v) for B, by itself for A: the signs are the same.
        is_left = ev * at.beside_u - eu * at.beside_v > 0.0
        slope = slopes.left_slope if is_left else slopes.right_slope
        beside = math.sqrt(at.beside_u * at.beside_u + at.beside_v * at.beside_v)
        if at.fall_a + at.fall_b > slope * beside + tolerance:
            continue
        feature_a, feature_b = features_of_end(a, b, shared, k)
        _put(manifold, n, at.u, at.v, at.h_a, at.h_b, feature_a, feature_b)
        n += 1
    return n


@kernel(inline=True)
def copy_point(manifold, source, target):
    for k in range(POINT):
        manifold.points[POINT * target + k] = manifold.points[POINT * source + k]
    for k in range(2):
        manifold.features[2 * target + k] = manifold.features[2 * source + k]


@kernel
def keep_near(manifold, n, max_gap):
    """Keep the points whose gap is at most so much, in order; how many."""
    n_kept = 0
    for k in range(n):
        if manifold.points[POINT * k + GAP] <= max_gap:
            copy_point(manifold, k, n_kept)
            n_kept += 1
    return n_kept


@kernel
def least_gap(manifold, n):
    gap = math.inf
    for k in range(n):
        gap = min(gap, manifold.points[POINT * k + GAP])
    return gap


@kernel
def drop_repeated(manifold, n, error, tolerance):
    """Drop points nearer than the tolerance to the point before, or to the line between their neighbours; how many
    stay.

    Of points in the same place the deepest stays; a point deeper than both its neighbours by more than the error of
    gaps stays, too.
    """
    points = manifold.points
    n_kept = 0
    for k in range(n):
        last = n_kept - 1
        if n_kept > 0 and _square(points, last, k) <= tolerance * tolerance:
            if points[POINT * k + GAP] < points[POINT * last + GAP]:
                copy_point(manifold, k, last)
            continue
        copy_point(manifold, k, n_kept)
        n_kept += 1
    if n_kept > 1 and _square(points, 0, n_kept - 1) <= tolerance * tolerance:
        if points[POINT * (n_kept - 1) + GAP] < points[GAP]:
            copy_point(manifold, n_kept - 1, 0)
        n_kept -= 1
    k = 0
    while n_kept > 2 and k < n_kept:
        before, after = (k - 1 if k > 0 else n_kept - 1), (k + 1 if k + 1 < n_kept else 0)
        shallowest = min(points[POINT * before + GAP], points[POINT * after + GAP])
        if (
            _is_right_of(points, before, after, k, tolerance)
            or points[POINT * k + GAP] < shallowest - error
            or not _is_between(points, before, after, k)
        ):
            k += 1
            continue
        for j in range(k, n_kept - 1):
            copy_point(manifold, j + 1, j)
        n_kept -= 1
    return n_kept


@kernel(inline=True)
def _square(points, i, j):
    """Of the distance of two points."""
    du, dv = points[POINT * i] - points[POINT * j], points[POINT * i + V] - points[POINT * j + V]
    return du * du + dv * dv


@kernel(inline=True)
def _is_right_of(points, i, j, k, tolerance):
    """Whether point k is farther than the tolerance to the right of the line from i to j."""
    du, dv = points[POINT * j] - points[POINT * i], points[POINT * j + V] - points[POINT * i + V]
    wide = dv * (points[POINT * k] - points[POINT * i]) - du * (points[POINT * k + V] - points[POINT * i + V])
    return wide > 0.0 and wide * wide > tolerance * tolerance * (du * du + dv * dv)


@kernel(inline=True)
def _is_between(points, i, j, k):
    """Whether point k is not before i, and not behind j, along the way from i to j; nearest points may be either."""
    du, dv = points[POINT * j] - points[POINT * i], points[POINT * j + V] - points[POINT * i + V]
    behind_i = du * (points[POINT * k] - points[POINT * i]) + dv * (points[POINT * k + V] - points[POINT * i + V])
    return 0.0 <= behind_i <= du * du + dv * dv


@kernel
def deepest_point(manifold, n, error):
    """Number of the point to come first, of n: with the least (u, v) among points as deep as the deepest, but for the
    error."""
    points = manifold.points
    known = least_gap(manifold, n) + 2.0 * error
    best = -1
    for k in range(n):
        if points[POINT * k + GAP] > known:
            continue
        u, v = points[POINT * k], points[POINT * k + V]
        if best < 0 or u < points[POINT * best] or (u == points[POINT * best] and v < points[POINT * best + V]):
            best = k
    return best
