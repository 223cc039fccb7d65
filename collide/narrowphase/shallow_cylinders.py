"""Shallow overlaps of cylinders with each other and with boxes, without a polytope: a few normals, and a deep point.

A point of a body lying d deep within the other body proves a depth of d at least: the ball around the point is in A ⊖
B. The support along any normal bounds the depth from above. Where a corner, a rim or a line of a body has sunk into a
flat face or into the side of a cylinder, both bounds are equal, along the normal of the face, or along the line from
the axis to the point. The face normal, or the normal across the cylinder and a line, with the least overlap is tried
first, then the lines from both axes. Two rims, or a rim and an edge, have no such point: they are left to EPA.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.lowering.packed_convex import CYLINDER, POINTS
from collide.narrowphase.gjk.minkowski_difference import POINT_OF_A, POINT_OF_B, difference_point, height
from collide.narrowphase.posed_pair import reach_of
from collide.narrowphase.shallow_ellipsoids import NOTHING, ShallowDepth
from collide.numerics.rigid_poses import off_rotation
from collide.numerics.vec3 import Vec3, add, cross, dot, neg, norm, put_vec3, rotate, rotate_back, scale, sub, vec3_at

#: Directions tried around a cylinder, for the point of a rim or for a corner; after so many, a point beyond the
#: cylinder's end ends the search.
_STEPS, _STEPS_OF_CORNERS, _MIN_STEPS = 20, 5, 3
#: Axes whose sine is below this are parallel.
_PARALLEL = 2.0**-20
#: A face or a line counts as level with another one up to this sine: it may have been meant to be.
_LEVEL = 2.0**-10
#: A matrix farther off a rotation is left to EPA.
_FAR_OFF = 2.0**-40

#: What a normal belongs to: a flat face of A or B, or the side of a cylinder, which the last two do.
_FACE_OF_A, _FACE_OF_B, _SIDE = range(3)


class _Normal(NamedTuple):
    """n : from A to B, of unit length.   depth : overlap of the bodies along n, an upper bound of their depth.   source
    : feature of the normal.   axis : of the box's edge or face, 2 of a cylinder."""

    n: Vec3
    depth: float
    source: int
    axis: int


@kernel(inline=True)
def is_cylinder_pair(pair):
    """Whether `shallow_cylinders` takes two cores: cylinders and boxes, and not two boxes."""
    if pair.A.kind == CYLINDER:
        return pair.B.kind == CYLINDER or _is_box(pair, pair.B)
    return pair.B.kind == CYLINDER and _is_box(pair, pair.A)


@kernel(inline=True)
def _is_box(pair, body):
    return body.kind == POINTS and pair.numbers[body.params_at] > 0.0


@kernel(inline=True)
def _column(pair, body, axis):
    R, at = pair.poses, body.pose_at + axis
    return Vec3(R[at], R[at + 3], R[at + 6])


@kernel(inline=True)
def _half(pair, body, axis):
    """Half the height of a cylinder, or half a side of a box."""
    return pair.numbers[body.params_at + (1 if body.kind == CYLINDER else axis)]


@kernel(inline=True)
def _height_of(pair, body, n):
    """How far a body reaches along n from its own origin: good enough to choose by."""
    g = rotate_back(pair.poses, body.pose_at, n)
    at = body.params_at
    p0, p1 = pair.numbers[at], pair.numbers[at + 1]
    if body.kind == CYLINDER:
        return p0 * math.sqrt(g.x * g.x + g.y * g.y) + p1 * abs(g.z)
    return p0 * abs(g.x) + p1 * abs(g.y) + pair.numbers[at + 2] * abs(g.z)


@kernel(inline=True)
def _least_face(pair, body, partner, towards_b, best):
    """``best``, or a flat face of a body along which the overlap is less."""
    for axis in range(2 if body.kind == CYLINDER else 0, 3):
        n = _column(pair, body, axis)
        along = dot(n, pair.t)
        n = scale(1.0 if along > 0.0 else -1.0, n)
        depth = _half(pair, body, axis) + _height_of(pair, partner, n) - abs(along)
        if depth < best.depth:
            best = _Normal(n, depth, _FACE_OF_A if towards_b else _FACE_OF_B, axis)
    return best


@kernel(inline=True)
def _least_side(pair, best):
    """``best``, or a normal across a cylinder and a line of the other body along which the overlap is less."""
    A, B = pair.A, pair.B
    u = _column(pair, A if A.kind == CYLINDER else B, 2)
    partner = B if A.kind == CYLINDER else A
    for axis in range(2 if partner.kind == CYLINDER else 0, 3):
        n = cross(u, _column(pair, partner, axis))
        length = norm(n)
        if length > _PARALLEL:
            along = dot(n, pair.t)
            n = scale((1.0 if along > 0.0 else -1.0) / length, n)
            depth = _height_of(pair, A, n) + _height_of(pair, B, n) - abs(along) / length
            if depth < best.depth:
                best = _Normal(n, depth, _SIDE, axis)
    return best


@kernel
def shallow_cylinders(pair, points, ids, weights, size, tolerance):
    """The `ShallowDepth` of two cores that `is_cylinder_pair` tells of; arguments as of `shallow_ellipsoids`."""
    A, B = pair.A, pair.B
    best = _least_face(pair, A, B, True, _Normal(pair.t, math.inf, _FACE_OF_A, 0))
    best = _least_face(pair, B, A, False, best)
    best = _least_side(pair, best)
    if not best.depth > 0.0 or not norm(pair.t) > 2.0**-20 * size:
        return NOTHING
    nearest = ShallowDepth(False, 0.0, 0.0, best.n, 1)
    if best.source == _SIDE:
        of_a = A.kind == CYLINDER
        b = _on_line(pair, A if of_a else B, B if of_a else A, pair.t if of_a else neg(pair.t), best, of_a)
        nearest = _proven(pair, points, ids, weights, of_a, best.n, b, tolerance)
    else:
        of_a = best.source == _FACE_OF_A
        nearest = _on_face(pair, points, ids, weights, of_a, best.n, tolerance)
    for side in range(2):
        of_a = side == 0
        owner = A if of_a else B
        if not nearest.is_proven and owner.kind == CYLINDER:
            nearest = _on_side(pair, points, ids, weights, of_a, tolerance)
    return nearest


@kernel(inline=True)
def _on_face(pair, points, ids, weights, of_a, nhat, tolerance):
    """What a flat face of A (or of B) proves with the other body's lowest point.

    Where that lies beyond the face: with what of the body is level with the face, and nearest to its middle.
    """
    difference_point(pair, points, ids, 0, nhat)
    n = nhat if of_a else neg(nhat)
    Q = pair.B if of_a else pair.A
    t = pair.t if of_a else neg(pair.t)
    b = add(vec3_at(points, POINT_OF_B if of_a else POINT_OF_A), t)
    shallow = _proven(pair, points, ids, weights, of_a, nhat, b, tolerance)
    if shallow.is_proven:
        return shallow
    g = rotate_back(pair.poses, Q.pose_at, n)
    to_o = rotate_back(pair.poses, Q.pose_at, neg(t))
    at = Q.params_at
    r = pair.numbers[at]
    if Q.kind == CYLINDER:
        half = pair.numbers[at + 1]
        aside = math.sqrt(g.x * g.x + g.y * g.y)
        if aside < _LEVEL:
            length = math.sqrt(to_o.x * to_o.x + to_o.y * to_o.y)
            share = min(r, length) / length if length > 0.0 else 0.0
            p = Vec3(share * to_o.x, share * to_o.y, -half if g.z > 0.0 else half)
        elif abs(g.z) < _LEVEL:
            p = Vec3(-r * g.x / aside, -r * g.y / aside, min(max(to_o.z, -half), half))
        else:
            return shallow
    else:
        hy, hz = pair.numbers[at + 1], pair.numbers[at + 2]
        p = Vec3(
            _lowest(g.x, r, to_o.x), _lowest(g.y, hy, to_o.y), _lowest(g.z, hz, to_o.z)
        )
    b = add(rotate(pair.poses, Q.pose_at, p), t)
    return _proven(pair, points, ids, weights, of_a, nhat, b, tolerance)


@kernel(inline=True)
def _lowest(slope, half, wanted):
    """The coordinate of a box's lowest point; along a level axis the coordinate nearest to ``wanted``."""
    if abs(slope) < _LEVEL:
        return min(max(wanted, -half), half)
    return -half if slope > 0.0 else half


@kernel(inline=True)
def _on_line(pair, owner, Q, t, best, of_a):
    """The point of a line of Q (an edge of a box, a line on a cylinder's side) lying deepest within a cylinder.

    Relative to the cylinder's origin, as t is: from the cylinder's origin to Q's.
    """
    n = best.n if of_a else neg(best.n)
    u = _column(pair, owner, 2)
    e = _column(pair, Q, best.axis)
    g = rotate_back(pair.poses, Q.pose_at, n)
    at = Q.params_at
    if Q.kind == CYLINDER:
        aside = math.sqrt(g.x * g.x + g.y * g.y)
        r = pair.numbers[at]
        middle = Vec3(-r * g.x / aside, -r * g.y / aside, 0.0)
    else:
        middle = Vec3(
            0.0 if best.axis == 0 else (-1.0 if g.x > 0.0 else 1.0) * pair.numbers[at],
            0.0 if best.axis == 1 else (-1.0 if g.y > 0.0 else 1.0) * pair.numbers[at + 1],
            0.0 if best.axis == 2 else (-1.0 if g.z > 0.0 else 1.0) * pair.numbers[at + 2],
        )
    b = add(rotate(pair.poses, Q.pose_at, middle), t)
    across = cross(u, n)
    half = _half(pair, Q, best.axis)
    slope = dot(e, across)
    share = -dot(b, across) / slope if slope != 0.0 else 0.0
    return add(b, scale(min(max(share, -half), half), e))


@kernel(inline=True)
def _on_side(pair, points, ids, weights, of_a, tolerance):
    """The depth proven by the side of cylinder A (or B) with a corner of the other body, or a point of its rim or side.

    By Newton's method on the angle around the axis, within a bracket of the root: a nearly level rim has its lowest
    point on either side.
    """
    owner = pair.A if of_a else pair.B
    Q = pair.B if of_a else pair.A
    t = pair.t if of_a else neg(pair.t)
    u, u_q = _column(pair, owner, 2), _column(pair, Q, 2)
    n = t
    n = sub(n, scale(dot(n, u), u))
    length = norm(n)
    if not length > 0.0:
        return NOTHING
    n = scale(1.0 / length, n)
    curvature = pair.numbers[Q.params_at] if Q.kind == CYLINDER else 0.0
    is_parallel = Q.kind == CYLINDER and norm(cross(u, u_q)) < _LEVEL
    first, aside = n, cross(u, n)
    turned, low, high = 0.0, -math.inf, math.inf  # tangents of angles
    last = math.inf
    n_steps = _STEPS if Q.kind == CYLINDER else _STEPS_OF_CORNERS
    for k in range(n_steps):
        difference_point(pair, points, ids, 0, n if of_a else neg(n))
        b = add(vec3_at(points, POINT_OF_B if of_a else POINT_OF_A), t)
        if is_parallel:
            b = _beside(pair, owner, Q, t, n, u)
        across = cross(u, n)
        miss, depth = dot(b, across), dot(b, n)
        if not depth > 0.0 or (k >= _MIN_STEPS and abs(dot(b, u)) > _half(pair, owner, 2)):
            return NOTHING
        if abs(miss) <= 2.0**-26 * depth or k == n_steps - 1:
            break
        low, high = (turned, high) if miss > 0.0 else (low, turned)
        step = (1.0 + turned * turned) * miss / (depth + _curvature_around(u_q, n, across, curvature))
        middle = 0.5 * (low + high)
        is_slow = abs(miss) > 0.5 * last and abs(middle) < math.inf
        turned = middle if is_slow or not low < turned + step < high else turned + step
        last = abs(miss)
        n = add(first, scale(turned, aside))
        n = scale(1.0 / norm(n), n)
    # The line from the axis to the point: where a corner is the lowest point, it does not turn with the normal.
    radial = sub(b, scale(dot(b, u), u))
    n = scale(1.0 / norm(radial), radial)
    return _proven(pair, points, ids, weights, of_a, n if of_a else neg(n), b, tolerance)


@kernel(inline=True)
def _curvature_around(u, n, across, radius):
    """How far the lowest point of a rim moves as n turns, a metre a radian.   u : its axis.   radius : 0 of a box."""
    m = cross(u, n)
    square = dot(m, m)
    along = dot(across, m)
    return radius * along * along / (square * math.sqrt(square)) if square > 0.0 else 0.0


@kernel(inline=True)
def _beside(pair, owner, Q, t, n, u):
    """The point lowest along n of the side of cylinder Q, beside the middle of cylinder owner, whose axis is parallel.

    n, t : seen from owner.
    """
    half, half_q = _half(pair, owner, 2), _half(pair, Q, 2)
    middle = dot(t, u)
    wanted = 0.5 * (max(-half, middle - half_q) + min(half, middle + half_q)) - middle
    g = rotate_back(pair.poses, Q.pose_at, n)
    share = pair.numbers[Q.params_at] / math.sqrt(g.x * g.x + g.y * g.y)
    z = wanted if dot(_column(pair, Q, 2), u) > 0.0 else -wanted
    p = Vec3(-share * g.x, -share * g.y, min(max(z, -half_q), half_q))
    return add(rotate(pair.poses, Q.pose_at, p), t)


@kernel(inline=True)
def _depth_within(insets):
    """Depth of a point within orthogonal planes, from its depth inside each; minus its distance if outside.

    Beyond two planes at once, as beside a rim, the point is farther from the body than from either plane.
    """
    x, y, z = min(insets.x, 0.0), min(insets.y, 0.0), min(insets.z, 0.0)
    least = min(min(x, y), z)
    if least < 0.0 and x + y + z < least:
        return -math.sqrt(x * x + y * y + z * z)
    return min(min(insets.x, insets.y), insets.z)


@kernel(inline=True)
def _proven(pair, points, ids, weights, of_a, nhat, b, tolerance):
    """The `ShallowDepth` of a normal and of a point of a body within the other body, A if ``of_a``, seen from the
    latter's origin.

    The point's depth is measured in the latter's own coordinates. A matrix off a rotation by δ stretches by less than
    2δ, and moves points mapped back by its transpose by δ of the reach.
    """
    owner = pair.A if of_a else pair.B
    off = 3.0 * off_rotation(pair.poses, owner.pose_at)
    p = rotate_back(pair.poses, owner.pose_at, b)
    at = owner.params_at
    p0, p1 = pair.numbers[at], pair.numbers[at + 1]
    if owner.kind == CYLINDER:
        inner = _depth_within(Vec3(p0 - math.sqrt(p.x * p.x + p.y * p.y), p1 - abs(p.z), math.inf))
    else:
        inner = _depth_within(Vec3(p0 - abs(p.x), p1 - abs(p.y), pair.numbers[at + 2] - abs(p.z)))
    proven = inner - 4.0 * off * reach_of(pair, owner)
    difference_point(pair, points, ids, 0, nhat)
    depth = height(points, 0, nhat)
    if not (off < _FAR_OFF and 0.0 < depth <= proven + tolerance):
        return NOTHING
    surface = add(b, scale(inner, nhat if of_a else neg(nhat)))
    beneath = sub(b, pair.t if of_a else neg(pair.t))
    put_vec3(points, POINT_OF_A, surface if of_a else beneath)
    put_vec3(points, POINT_OF_B, beneath if of_a else surface)
    put_vec3(points, 0, sub(sub(vec3_at(points, POINT_OF_A), vec3_at(points, POINT_OF_B)), pair.t))
    weights[0] = 1.0
    return ShallowDepth(True, depth, proven, nhat, 1)
