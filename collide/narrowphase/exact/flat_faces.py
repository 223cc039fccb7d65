"""Flat faces of boxes, cylinders and cones against a convex set beyond them, exactly: what rests on a face, flush too.

Let F be the body with the face, in the half-space H of the face, B the other body, p its deepest point in H, and e the
signed distance of p from H. B is no nearer to F than e, since F lies in H, and no deeper in F than −e, since moving B
by as much takes B out of H. Both are equal where p is above the face, and where p is in F with the face as the nearest
part of F's surface: p has to leave F. So e is the signed distance, to all digits; where p is elsewhere, e > 0 still
says that the bodies are apart.

e is (s − √q) / |n| of `exact_halfspace.py`. p is taken in doubles: it has to be farther inside the face's edges, and F
deeper behind the face, than 2e-9 of the pair's size S while |e| is at most 1e-9 S; the rounding of p is at most 64u·S
(`bounds.py`). Other cases are for `exact_curved/`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.lowering.packed_convex import CONE, CYLINDER, ELLIPSOID, POINTS
from collide.narrowphase.exact.exact_gjk import SEPARATE, UNDONE
from collide.narrowphase.exact.exact_halfspace import (
    PlaneContact,
    posed_half_space,
    reach_of_curved,
    reach_of_vertex,
    rows_of_pose,
    side_of_tip,
    turned_back,
)
from collide.narrowphase.posed_pair import radius_of
from collide.numerics.double_double import DD
from collide.numerics.exact_numbers import (
    NumberVec3,
    are_worthless,
    begin_numbers,
    compacted,
    filled,
    inner,
    number_of,
    plus,
    ratio,
    sign_of,
    times,
)
from collide.numerics.vec3 import (
    Vec3,
    add,
    column_at,
    component,
    cross,
    divide,
    dot,
    neg,
    norm,
    rotate,
    rotate_back,
    scale,
    sub,
    vec3_at,
)
from collide.support.support_mapping import support

#: A common point counts this far inside a face, in units of S.
_MARGIN = 1e-9
#: Of vertices that touch a plane, so many are looked at.
_MAX_TIED = 8


class Face(NamedTuple):
    """A face of a box, or an end of a cylinder or cone: its axis in the frame, its side (±1), its height.

    gap : of the other body from the face's half-space, in doubles [m].   normal : outward, in W, not of unit length.
    """

    axis: int
    side: float
    height: float
    gap: float
    normal: Vec3


class FaceContact(NamedTuple):
    """What is proven of a face F and a body B.

    verdict : SEPARATE, TOUCHING or UNDONE.   excess : e [m], to EXACT_ERROR.   is_distance : e is the signed distance.
    point : p, seen from the origin of the ordered pair's A.   nhat : out of F.
    """

    verdict: int
    excess: DD
    is_distance: bool
    point: Vec3
    nhat: Vec3


@kernel
def contact_of_faces(pair, F, B, t_F, t_B, size, terms, digits):
    """The `FaceContact` of the face of a body F that is farthest from B, and a convex set B.

    t_F, t_B : origins of both frames.   size : S.   terms, digits : as in `exact_halfspace.py`.
    """
    face = _outermost_face(pair, F, B, t_F, t_B)
    nothing = FaceContact(UNDONE, DD(0.0, 0.0), False, t_F, face.normal)
    if not abs(face.gap) <= _MARGIN * size:
        return nothing
    begin_numbers(digits)
    pose_F, pose_B = rows_of_pose(pair, F, terms, digits), rows_of_pose(pair, B, terms, digits)
    zero, side = number_of(digits, 0.0), number_of(digits, face.side)
    m = NumberVec3(side if face.axis == 0 else zero, side if face.axis == 1 else zero, side if face.axis == 2 else zero)
    half_space = posed_half_space(pose_F, m, number_of(digits, face.height), digits)
    square = inner(digits, half_space.n, half_space.n)
    nhat = divide(face.normal, norm(face.normal))
    centre = add(t_F, rotate(pair.poses, F.pose_at, _on_axis(face)))
    if B.kind == POINTS:
        contact, point = _deepest_vertices(pair, B, half_space, square, pose_B, nhat, t_B, centre, size, digits)
    else:
        contact = reach_of_curved(pair, B, half_space, square, pose_B, digits)
        w = turned_back(pose_B, half_space.n, digits)
        side = side_of_tip(pair, B, w, digits) if B.kind == CONE else 0
        near = rotate_back(pair.poses, B.pose_at, sub(centre, t_B))
        u = _deepest_of_curved(pair, B, _rounded_opposite(w, digits), side, near)
        point = add(t_B, rotate(pair.poses, B.pose_at, u))
    if are_worthless(digits):
        return nothing
    is_distance = _is_within_face(pair, F, face, sub(point, t_F), 2.0 * _MARGIN * size)
    if contact.verdict != SEPARATE and not is_distance:
        return nothing
    return FaceContact(contact.verdict, contact.excess, is_distance, point, nhat)


@kernel(inline=True)
def has_flat_faces(pair, body):
    """Whether a body is a box, a cylinder or a cone."""
    if body.kind == POINTS:
        return pair.numbers[body.params_at] > 0.0 and radius_of(pair, body) == 0.0
    return body.kind == CYLINDER or body.kind == CONE


@kernel(inline=True)
def _on_axis(face):
    height = face.side * face.height
    return Vec3(
        height if face.axis == 0 else 0.0, height if face.axis == 1 else 0.0, height if face.axis == 2 else 0.0
    )


@kernel
def _outermost_face(pair, F, B, t_F, t_B):
    """The `Face` of F with the largest gap to B."""
    poses, at = pair.poses, F.pose_at
    r0, r1, r2 = vec3_at(poses, at), vec3_at(poses, at + 3), vec3_at(poses, at + 6)
    c0, c1, c2 = cross(r1, r2), cross(r2, r0), cross(r0, r1)
    det = dot(r0, c0)
    best = Face(0, 1.0, 0.0, -math.inf, Vec3(0.0, 0.0, 0.0))
    for k in range(0 if F.kind == POINTS else 4, 5 if F.kind == CONE else 6):
        axis = k // 2
        side = -1.0 if k % 2 == 0 else 1.0
        height = pair.numbers[F.params_at + (axis if F.kind == POINTS else 1)]
        normal = scale(side, Vec3(component(c0, axis), component(c1, axis), component(c2, axis)))
        length = norm(normal)
        g = neg(rotate_back(poses, B.pose_at, divide(normal, length)))
        _, corner, _ = support(B.kind, B.coords, B.padded, pair.numbers, B.params_at, B.tree, 0, -1, g)
        across = sub(add(t_B, rotate(poses, B.pose_at, corner)), t_F)
        gap = (dot(normal, across) - height * det) / length - radius_of(pair, B)
        if gap > best.gap:
            best = Face(axis, side, height, gap, normal)
    return best


@kernel
def _deepest_vertices(pair, B, half_space, square, pose_B, nhat, t_B, centre, size, digits):
    """(the `PlaneContact` of points swept by a ball, the deepest point): of several vertices equally deep, the point
    nearest the face's centre of the lines between two vertices."""
    lowest = math.inf
    for k in range(B.n):
        lowest = min(lowest, dot(nhat, _vertex(pair, B, k, t_B)))
    deepest = PlaneContact(SEPARATE, 0, DD(math.inf, 0.0))
    down = scale(-radius_of(pair, B), nhat)
    first = point = _vertex(pair, B, 0, t_B)
    n_tied = 0
    mark = filled(digits)
    for k in range(B.n):
        q = _vertex(pair, B, k, t_B)
        if dot(nhat, q) > lowest + _MARGIN * size:
            continue
        contact = reach_of_vertex(pair, B, half_space, square, pose_B, k, digits)
        compacted(digits, mark, number_of(digits, 0.0))
        excess, least = contact.excess, deepest.excess
        if excess.high < least.high or (excess.high == least.high and excess.low < least.low):
            deepest = contact
            first = point = q
            n_tied = 1
        elif excess.high == least.high and excess.low == least.low and n_tied < _MAX_TIED:
            n_tied += 1
            between = _nearest_of_segment(first, q, centre)
            if norm(sub(between, centre)) < norm(sub(point, centre)):
                point = between
    return deepest, add(point, down)


@kernel(inline=True)
def _vertex(pair, B, k, t_B):
    return add(t_B, rotate(pair.poses, B.pose_at, column_at(B.coords, B.padded, k)))


@kernel(inline=True)
def _nearest_of_segment(a, b, p):
    d = sub(b, a)
    square = dot(d, d)
    t = min(max(dot(sub(p, a), d) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return add(a, scale(t, d))


@kernel
def _rounded_opposite(w, digits):
    """−w, rounded, and scaled to a largest coordinate of 1: zeros stay zeros, and coordinates above 1e-300 of the
    largest do not become 0."""
    largest = w.x
    if _is_larger(w.y, largest, digits):
        largest = w.y
    if _is_larger(w.z, largest, digits):
        largest = w.z
    s = -1.0 * sign_of(digits, largest)
    return Vec3(
        s * ratio(digits, w.x, largest), s * ratio(digits, w.y, largest), s * ratio(digits, w.z, largest)
    )


@kernel
def _is_larger(a, b, digits):
    """Whether |a| > |b|."""
    return sign_of(digits, plus(digits, times(digits, a, a), times(digits, b, b), -1)) > 0


@kernel
def _deepest_of_curved(pair, B, g, side, near):
    """A point of a curved set farthest along g, in its frame; where an end or a side is flush, the one nearest a point.

    g : of `_rounded_opposite`: exact zeros tell what is flush.   side : of `side_of_tip`, for a cone.
    """
    numbers, at = pair.numbers, B.params_at
    if B.kind == ELLIPSOID:
        _, u, _ = support(B.kind, B.coords, B.padded, numbers, at, 0, 0, -1, g)
        return u
    radius, half = numbers[at], numbers[at + 1]
    if B.kind == CONE and side > 0:
        return Vec3(0.0, 0.0, half)
    largest = max(abs(g.x), abs(g.y))
    if largest == 0.0:  # an end
        aside = math.sqrt(near.x * near.x + near.y * near.y)
        share = min(1.0, radius / aside) if aside > 0.0 else 0.0
        return Vec3(share * near.x, share * near.y, math.copysign(half, g.z))
    x, y = g.x / largest, g.y / largest
    share = radius / math.sqrt(x * x + y * y)
    z = min(max(near.z, -half), half)
    if B.kind == CYLINDER:
        return Vec3(share * x, share * y, math.copysign(half, g.z) if g.z != 0.0 else z)
    if side < 0:
        z = -half
    share *= 0.5 * (half - z) / half
    return Vec3(share * x, share * y, z)


@kernel
def _is_within_face(pair, F, face, p, margin):
    """Whether a point about the plane of a face, seen from F's origin, is inside the face, and farther than a margin
    from the other faces and sides of F."""
    poses, at = pair.poses, F.pose_at
    r0, r1, r2 = vec3_at(poses, at), vec3_at(poses, at + 3), vec3_at(poses, at + 6)
    c0, c1, c2 = cross(r1, r2), cross(r2, r0), cross(r0, r1)
    det = dot(r0, c0)
    # R⁻¹ p by cofactors: the matrix need be no rotation.
    u = Vec3(
        (c0.x * p.x + c1.x * p.y + c2.x * p.z) / det, (c0.y * p.x + c1.y * p.y + c2.y * p.z) / det,
        (c0.z * p.x + c1.z * p.y + c2.z * p.z) / det
    )
    if not face.height > margin:
        return False
    if F.kind == POINTS:
        for k in range(3):
            if k != face.axis and not abs(component(u, k)) < pair.numbers[F.params_at + k] - margin:
                return False
        return True
    radius, height = pair.numbers[F.params_at], 2.0 * face.height
    inside = radius - math.sqrt(u.x * u.x + u.y * u.y)
    if F.kind == CONE:  # its side leans over the base
        inside *= height / math.sqrt(radius * radius + height * height)
    return inside > margin
