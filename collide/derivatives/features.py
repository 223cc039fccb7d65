"""Features of a convex set: the vertex, edge, face, rim, side or smooth surface that a witness point moves on.

A feature is a smooth surface patch of 0, 1 or 2 parameters. At a direction g, of unit length in the set's frame, the
patch has a point p, orthonormal tangents t1 and t2, and second derivatives of p along the tangents, of which only the
parts along g count. Points of flat features are kept; points of curved features follow from g.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.curved.curved_kinds import curved_support
from collide.kernels import kernel, view_f64, view_i64
from collide.lowering.packed_convex import CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS
from collide.lowering.set_rows import ADDRESS, COUNT, INTS, KIND, NUMBERS, PADDED, PARAMS, RADIUS, REACH
from collide.numerics.vec3 import (
    Vec3,
    add,
    column_at,
    cross,
    divide,
    dot,
    neg,
    norm,
    put_vec3,
    scale,
    sub,
    unit_orthogonal,
    vec3_at,
)

#: Codes of features. RIM: of a cylinder or a cone's base. FLAT: a face, an end of a cylinder, a base, a plane.
VERTEX, EDGE, FLAT, RIM, CYLINDER_SIDE, CONE_SIDE, SMOOTH = range(7)
#: Doubles that keep a feature's place: p, t1, t2, and the place along a line of the side.
PLACE = 10
_POINT, _TANGENT_1, _TANGENT_2, _ALONG = 0, 3, 6, 9
#: Support heights that differ by less than this part of a set's reach are equal; directions too.
LEVEL = 2.0**-40
_NO_VECTOR = Vec3(0.0, 0.0, 0.0)
_X, _Y, _Z = Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0)


class ConvexBody(NamedTuple):
    """A convex set as kernels read rows of `set_rows.py`.

    coordinates : all x, all y, all z, ``padded`` of each.   numbers : radius, reach, slop, four parameters.
    """

    kind: Any
    count: Any
    padded: Any
    coordinates: Any
    numbers: Any


class Patch(NamedTuple):
    """A feature at a direction g, in the set's frame.

    p : the point.   t1, t2 : orthonormal tangents; the first ``size`` count.
    c11, c12, c22 : second derivatives of p along the tangents, times g [1/m].
    """

    p: Any
    t1: Any
    t2: Any
    c11: Any
    c12: Any
    c22: Any


class SupportSet(NamedTuple):
    """All points of a set farthest along a direction, within a level.

    dimension : 0 a point, 1 a segment, 2 an area.   i, j, k : vertices that span the points; −1 of curved sets.
    """

    dimension: Any
    i: Any
    j: Any
    k: Any


@kernel(inline=True)
def convex_body_at(ints_at, numbers_at, row):
    """The set of a row of both tables."""
    ints = view_i64(ints_at + 8 * INTS * row, INTS)
    padded = ints[PADDED]
    return ConvexBody(
        ints[KIND], ints[COUNT], padded, view_f64(ints[ADDRESS], 3 * padded),
        view_f64(numbers_at + 8 * NUMBERS * row, NUMBERS),
    )


@kernel(inline=True)
def radius_of(body):
    """Of the ball swept over the core [m]."""
    return body.numbers[RADIUS]


@kernel(inline=True)
def reach_of(body):
    """The farthest core point from the frame's origin, or an upper bound [m]; 0 of half-spaces."""
    return body.numbers[REACH]


@kernel(inline=True)
def vertex_of(body, k):
    return column_at(body.coordinates, body.padded, k)


@kernel
def support_height(body, g):
    """How far the core reaches along g, |g| = 1 [m]; of half-spaces, along their own normal."""
    if body.kind == POINTS:
        highest = -math.inf
        for k in range(body.count):
            highest = max(highest, dot(g, vertex_of(body, k)))
        return highest
    if body.kind == HALFSPACE:
        normal = vec3_at(body.numbers, PARAMS)
        return body.numbers[PARAMS + 3] / norm(normal)
    return dot(g, curved_support(body.kind, body.numbers, PARAMS, g))


@kernel
def support_set(body, g, level):
    """The `SupportSet` of a core along g, |g| = 1: of heights and directions equal within a part of the reach.
    O(vertices)."""
    if body.kind == POINTS:
        return _highest_vertices(body, g, level)
    if body.kind == HALFSPACE:
        return SupportSet(2, -1, -1, -1)
    return SupportSet(_curved_dimension(body, g, level), -1, -1, -1)


@kernel
def _highest_vertices(body, g, level):
    """Of points: the first vertex, the vertex farthest from the first, the vertex farthest from their line."""
    least = support_height(body, g) - level * reach_of(body)
    first, second, third = -1, -1, -1
    for k in range(body.count):
        if dot(g, vertex_of(body, k)) >= least:
            first = k
            break
    widest = LEVEL * reach_of(body)
    for k in range(first + 1, body.count):
        width = norm(sub(vertex_of(body, k), vertex_of(body, first)))
        if width > widest and dot(g, vertex_of(body, k)) >= least:
            widest, second = width, k
    if second < 0:
        return SupportSet(0, first, -1, -1)
    along = divide(sub(vertex_of(body, second), vertex_of(body, first)), widest)
    widest = LEVEL * reach_of(body)
    for k in range(first + 1, body.count):
        if k == second or dot(g, vertex_of(body, k)) < least:
            continue
        width = norm(cross(along, sub(vertex_of(body, k), vertex_of(body, first))))
        if width > widest:
            widest, third = width, k
    return SupportSet(1 if third < 0 else 2, first, second, third)


@kernel(inline=True)
def _curved_dimension(body, g, level):
    """Of cylinders an end faces g, or a line of the side; of cones the base, or a line from the tip."""
    if body.kind == ELLIPSOID:
        return 0
    radius, half = body.numbers[PARAMS], body.numbers[PARAMS + 1]
    across = math.sqrt(g.x * g.x + g.y * g.y)
    level *= reach_of(body)
    if radius * across <= level:
        return 2 if body.kind == CYLINDER or g.z < 0.0 else 0
    if body.kind == CYLINDER:
        return 1 if half * abs(g.z) <= level else 0
    return 1 if abs(2.0 * half * g.z - radius * across) <= level else 0


@kernel(inline=True)
def size_of(code):
    """How many parameters a feature has."""
    if code == VERTEX:
        return 0
    return 1 if code == EDGE or code == RIM else 2


@kernel(inline=True)
def flat_size(code):
    """The dimension of the set of support points at a point within the feature."""
    if code == EDGE or code == CYLINDER_SIDE or code == CONE_SIDE:
        return 1
    return 2 if code == FLAT else 0


@kernel
def put_feature(body, code, ids, p, place, at):
    """Keep a feature's place next to a point p of the core.

    ids : a `SupportSet`; of vertices and of ends of cylinders, i is the vertex, or −1 or 1 by the end.
    place : from ``at`` on PLACE doubles.
    """
    t1, t2, along = _NO_VECTOR, _NO_VECTOR, 0.0
    half = body.numbers[PARAMS + 1]
    if code == VERTEX:
        p = vertex_of(body, ids.i) if body.kind == POINTS else Vec3(0.0, 0.0, half)
    elif code == EDGE or (code == FLAT and body.kind == POINTS):
        first = vertex_of(body, ids.i)
        t1 = sub(vertex_of(body, ids.j), first)
        t1 = divide(t1, norm(t1))
        offset = sub(p, first)
        if code == FLAT:
            across = sub(vertex_of(body, ids.k), first)
            across = sub(across, scale(dot(across, t1), t1))
            t2 = divide(across, norm(across))
        p = add(first, add(scale(dot(offset, t1), t1), scale(dot(offset, t2), t2)))
    elif code == FLAT and body.kind == HALFSPACE:
        normal = vec3_at(body.numbers, PARAMS)
        length = norm(normal)
        normal = divide(normal, length)
        p = add(p, scale(body.numbers[PARAMS + 3] / length - dot(p, normal), normal))
        t1 = unit_orthogonal(normal)
        t2 = cross(normal, t1)
    elif code == FLAT:
        p, t1, t2 = Vec3(p.x, p.y, ids.i * half), _X, _Y
    elif code == RIM:
        along = ids.i * half
    elif code == CYLINDER_SIDE:
        along = p.z
    elif code == CONE_SIDE:
        along = norm(sub(p, Vec3(0.0, 0.0, half)))
    put_vec3(place, at + _POINT, p)
    put_vec3(place, at + _TANGENT_1, t1)
    put_vec3(place, at + _TANGENT_2, t2)
    place[at + _ALONG] = along


@kernel(inline=True)
def move_place(code, place, at, by1, by2):
    """Move a flat feature's point along both tangents, or the place along a line of a side."""
    if code == EDGE or code == FLAT:
        t1, t2 = vec3_at(place, at + _TANGENT_1), vec3_at(place, at + _TANGENT_2)
        put_vec3(place, at + _POINT, add(vec3_at(place, at + _POINT), add(scale(by1, t1), scale(by2, t2))))
    elif code == CYLINDER_SIDE or code == CONE_SIDE:
        place[at + _ALONG] += by2


@kernel
def patch_at(body, code, place, at, g):
    """The `Patch` of a feature at the direction g, |g| = 1."""
    if code == VERTEX or code == EDGE or code == FLAT:
        t1, t2 = vec3_at(place, at + _TANGENT_1), vec3_at(place, at + _TANGENT_2)
        return Patch(vec3_at(place, at + _POINT), t1, t2, 0.0, 0.0, 0.0)
    if code == SMOOTH:
        return _ellipsoid_patch(body, g)
    radius, half, along = body.numbers[PARAMS], body.numbers[PARAMS + 1], place[at + _ALONG]
    across = math.sqrt(g.x * g.x + g.y * g.y)
    radial = Vec3(g.x / across, g.y / across, 0.0) if across > 0.0 else _X
    t1 = Vec3(-radial.y, radial.x, 0.0)
    if code == CONE_SIDE:
        slant = math.sqrt(radius * radius + 4.0 * half * half)
        line = Vec3(radius / slant * radial.x, radius / slant * radial.y, -2.0 * half / slant)
        p = add(Vec3(0.0, 0.0, half), scale(along, line))
        return Patch(p, t1, line, -across * slant / (along * radius), 0.0, 0.0)
    p = Vec3(radius * radial.x, radius * radial.y, along)
    return Patch(p, t1, _Z if code == CYLINDER_SIDE else _NO_VECTOR, -across / radius, 0.0, 0.0)


@kernel
def _ellipsoid_patch(body, g):
    """Of {x : Σ (x / r)² ≤ 1}: the normal g = |D g| D⁻² p, D the radii, turns by |D g| D⁻² along tangents."""
    radii = vec3_at(body.numbers, PARAMS)
    scaled = norm(Vec3(radii.x * g.x, radii.y * g.y, radii.z * g.z))
    p = curved_support(body.kind, body.numbers, PARAMS, g)
    t1 = unit_orthogonal(g)
    t2 = cross(g, t1)
    u1 = Vec3(t1.x / radii.x, t1.y / radii.y, t1.z / radii.z)
    u2 = Vec3(t2.x / radii.x, t2.y / radii.y, t2.z / radii.z)
    return Patch(p, t1, t2, -scaled * dot(u1, u1), -scaled * dot(u1, u2), -scaled * dot(u2, u2))


@kernel
def list_features(body, g, p, near, codes, at):
    """Features that a point p of the core near a support point along g may move on; how many.

    near : how far p may be off, as a part of the reach.   codes : from ``at`` on four integers a feature, its code and
    the ids of its `SupportSet`.
    The last digits of g and p are not known: the caller tries the features in turn.
    """
    if body.kind == POINTS:
        return _polytope_features(body, g, p, near, codes, at)
    if body.kind == HALFSPACE:
        return _put_code(codes, at, 0, FLAT, 0, 0, 0)
    if body.kind == ELLIPSOID:
        return _put_code(codes, at, 0, SMOOTH, 0, 0, 0)
    radius, half, off = body.numbers[PARAMS], body.numbers[PARAMS + 1], near * reach_of(body)
    across = math.sqrt(p.x * p.x + p.y * p.y)
    n = 0
    if body.kind == CONE:
        if half - p.z <= off:
            n = _put_code(codes, at, n, VERTEX, 0, 0, 0)
        if half - p.z > 0.0 and across > 0.0:
            n = _put_code(codes, at, n, CONE_SIDE, 0, 0, 0)
    elif radius - across <= off:
        n = _put_code(codes, at, n, CYLINDER_SIDE, 0, 0, 0)
    end = -1 if body.kind == CONE or p.z < 0.0 else 1
    if half - end * p.z <= off:
        if radius - across <= off:
            n = _put_code(codes, at, n, RIM, end, 0, 0)
        n = _put_code(codes, at, n, FLAT, end, 0, 0)
    return n


#: So many features are tried at most, and so many vertices looked at.
MAX_FEATURES, _MAX_VERTICES = 24, 16


@kernel
def _polytope_features(body, g, p, near, codes, at):
    """Of points: the face about p, edges that pass p, vertices near p."""
    off = near * reach_of(body)
    least = support_height(body, g) - off
    spanned = _highest_vertices(body, g, LEVEL)
    if body.count == 1:
        return _put_code(codes, at, 0, VERTEX, 0, 0, 0)
    if body.count == 2:
        n = _put_code(codes, at, 0, EDGE, 0, 1, 0)
        n = _put_code(codes, at, n, VERTEX, 0, 0, 0)
        return _put_code(codes, at, n, VERTEX, 1, 0, 0)
    n, first, second = 0, -1, -1
    for k in range(body.count):
        if dot(g, vertex_of(body, k)) < least:
            continue
        if first < 0:
            first = k
        elif second < 0:
            second = k
        elif n == 0 and _area(vertex_of(body, first), vertex_of(body, second), vertex_of(body, k)) > off * off:
            n = _put_code(codes, at, n, FLAT, first, second, k)
    if spanned.dimension == 2 and n == 0:
        n = _put_code(codes, at, n, FLAT, spanned.i, spanned.j, spanned.k)
    for i in range(body.count):
        v = vertex_of(body, i)
        if dot(g, v) < least:
            continue
        for j in range(i + 1, body.count):
            w = vertex_of(body, j)
            if n < MAX_FEATURES - 8 and dot(g, w) >= least and _passes(v, w, p, off):
                n = _put_code(codes, at, n, EDGE, i, j, 0)
    for i in range(body.count):
        v = vertex_of(body, i)
        if n < MAX_FEATURES and dot(g, v) >= least and norm(sub(v, p)) <= 2.0 * off:
            n = _put_code(codes, at, n, VERTEX, i, 0, 0)
    return n


@kernel(inline=True)
def _area(a, b, c):
    return norm(cross(sub(b, a), sub(c, a)))


@kernel(inline=True)
def _passes(v, w, p, off):
    """Whether the segment from v to w passes a point p."""
    along = sub(w, v)
    length = norm(along)
    if not length > 0.0:
        return False
    along = divide(along, length)
    offset = sub(p, v)
    t = dot(offset, along)
    return norm(cross(offset, along)) <= 2.0 * off and -off <= t <= length + off


@kernel(inline=True)
def _put_code(codes, at, n, code, i, j, k):
    """Write feature n; how many there are."""
    codes[at + 4 * n] = code
    codes[at + 4 * n + 1] = i
    codes[at + 4 * n + 2] = j
    codes[at + 4 * n + 3] = k
    return n + 1


@kernel
def holds_place(body, code, ids, place, at, g, slack):
    """Whether a settled point of a feature is the set's support point along g: high enough, and within the feature.

    slack : by how much the point may be off the feature [m]. The normal of a gap d turns by slack / d where it is.
    """
    if code == SMOOTH or body.kind == HALFSPACE:
        return True
    level = 4.0 * LEVEL * reach_of(body)
    is_side = code == CYLINDER_SIDE or code == CONE_SIDE
    if not is_side and dot(g, patch_at(body, code, place, at, g).p) < support_height(body, g) - level:
        return False
    return _clearance(body, code, ids, place, at, g, -slack) >= -slack


@kernel(inline=True)
def is_inside(body, code, ids, place, at, g):
    """Whether a settled point lies inside its feature, off the border."""
    least = 4.0 * LEVEL * reach_of(body)
    return body.kind == HALFSPACE or _clearance(body, code, ids, place, at, g, least) > least


@kernel
def _clearance(body, code, ids, place, at, g, least):
    """How far a settled point of a feature is from the feature's border [m], less than 0 outside; of faces of points
    infinitely far, where by more than ``least``, or infinitely far outside.
    """
    radius, half, along = body.numbers[PARAMS], body.numbers[PARAMS + 1], place[at + _ALONG]
    p = vec3_at(place, at + _POINT)
    if code == EDGE:
        v, w = vertex_of(body, ids.i), vertex_of(body, ids.j)
        t = dot(sub(p, v), vec3_at(place, at + _TANGENT_1))
        return min(t, norm(sub(w, v)) - t)
    if code == CYLINDER_SIDE:
        return half - abs(along)
    if code == CONE_SIDE:
        return min(along, math.sqrt(radius * radius + 4.0 * half * half) - along)
    if code == FLAT and body.kind == POINTS:
        return math.inf if _is_among(body, p, g, least) else -math.inf
    if code == FLAT:
        return radius - math.sqrt(p.x * p.x + p.y * p.y)
    return math.inf


@kernel
def _is_among(body, p, g, least):
    """Whether a point lies among the highest vertices along g, off their outline by more than ``least`` [m]: a point
    outside sees all of them to a side of one."""
    lowest = support_height(body, g) - 4.0 * LEVEL * reach_of(body)
    for i in range(body.count):
        v = vertex_of(body, i)
        offset = sub(v, p)
        if dot(g, v) < lowest:
            continue
        if not norm(offset) > 0.0:
            return least <= 0.0
        to_side = cross(g, offset)
        has_right = False
        for j in range(body.count):
            w = vertex_of(body, j)
            if dot(g, w) >= lowest and dot(to_side, sub(w, p)) < -least * norm(offset):
                has_right = True
                break
        if not has_right:
            return False
    return True


@kernel(inline=True)
def outward(n, sign):
    """The outward direction of a body: n of A, −n of B."""
    return n if sign > 0.0 else neg(n)
