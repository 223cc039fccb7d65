"""Shallow overlaps with an ellipsoid, without a polytope: a ball rolling inside the ellipsoid, and a point of the other
body.

An ellipsoid is a smaller convex set, its core here, swept by a ball as large as its sharpest curvature (Blaschke's
rolling theorem): ρ = c²/a of its least and greatest radius. Bodies with an overlap of less than ρ are apart once the
ball is taken away, and their depth is ρ minus the distance of core and body: a gap, without local minima, and in no
need of a proof over all directions. A distance |x − c| of the core's point c and the other body's point x proves a
depth of ρ − |x − c| at least; the support along their line bounds the depth from above, as everywhere.

The search is Newton's on the direction: the nearest point x of the other body gives the direction, and the feature
under x says how the direction may turn. Deeper overlaps, and overlaps whose bracket does not close, are left to EPA.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.curved.curved_kinds import curved_support
from collide.kernels import kernel
from collide.lowering.packed_convex import CYLINDER, ELLIPSOID, POINTS
from collide.narrowphase.gjk.minkowski_difference import POINT_OF_A, POINT_OF_B, difference_point, height
from collide.numerics.vec3 import (
    Vec3,
    add,
    column_at,
    cross,
    dot,
    neg,
    norm,
    put_vec3,
    rotate,
    rotate_back,
    scale,
    sub,
    vec3_at,
)

#: Directions tried before the search is given up.
_ROUNDS = 16
#: An overlap along the line of the origins that is so many times as deep as the ball is large is not searched.
_DEEP = 16.0
#: What a step may turn the direction by, as a tangent.
_LARGEST_STEP = 0.5
#: A matrix whose RᵀR has no eigenvalue above this is left to EPA.
_LEAST_EIGENVALUE = 0.5
#: The ball is made smaller by its own roundings.
_ROUNDED = 1.0 - 2.0**-40

#: Where the nearest point of a body lies, which tells how it moves with the direction: within the body, where nothing
#: is told; on a face; on an edge or a line of a side; at a corner or on a rim.
_WITHIN, _FACE, _EDGE, _CORNER = range(4)


class ShallowDepth(NamedTuple):
    """is_proven : whether the bracket closed.

    depth : the support along nhat: an upper bound, before ``error``.
    proven : lower bound of the depth, before ``error``.   nhat : from A to B.   iterations : directions tried.
    """

    is_proven: bool
    depth: float
    proven: float
    nhat: Vec3
    iterations: int


#: Neither found nor refuted.
NOTHING = ShallowDepth(False, 0.0, 0.0, Vec3(0.0, 0.0, 1.0), 0)


class _Symmetric(NamedTuple):
    """A symmetric matrix."""

    xx: float
    yy: float
    zz: float
    xy: float
    yz: float
    zx: float


class _RollingBall(NamedTuple):
    """An ellipsoid in the world's axes.

    square : R D² Rᵀ, D its radii.   radius : of a ball rolling inside [m].
    """

    square: _Symmetric
    radius: float


class _Nearest(NamedTuple):
    """x : a point of the other body, from the ellipsoid's origin.   feature : the body's feature under x.

    e : unit vector along the edge, or the axis of the rim.   curvature : radius of the side or rim [m].
    """

    x: Vec3
    feature: int
    e: Vec3
    curvature: float


@kernel(inline=True)
def is_ellipsoid_pair(pair):
    """Whether `shallow_ellipsoids` takes the two cores of a pair."""
    A, B = pair.A, pair.B
    return (A.kind == ELLIPSOID and _is_known(pair, B)) or (B.kind == ELLIPSOID and _is_known(pair, A))


@kernel(inline=True)
def _is_known(pair, body):
    """Whether the nearest point of a body is known in closed form, or the body is an ellipsoid."""
    is_box = body.kind == POINTS and (body.n <= 2 or pair.numbers[body.params_at] > 0.0)
    return is_box or body.kind == ELLIPSOID or body.kind == CYLINDER


@kernel(inline=True)
def _times(M, v):
    return Vec3(
        M.xx * v.x + M.xy * v.y + M.zx * v.z, M.xy * v.x + M.yy * v.y + M.yz * v.z, M.zx * v.x + M.yz * v.y + M.zz * v.z
    )


@kernel(inline=True)
def _rolling_ball(pair, body):
    """The `_RollingBall` of an ellipsoid; radius 0 where its matrix is far off a rotation."""
    R, at = pair.poses, body.pose_at
    p0, p1, p2 = pair.numbers[body.params_at], pair.numbers[body.params_at + 1], pair.numbers[body.params_at + 2]
    x = Vec3(R[at], R[at + 3], R[at + 6])
    y = Vec3(R[at + 1], R[at + 4], R[at + 7])
    z = Vec3(R[at + 2], R[at + 5], R[at + 8])
    xx, yy, zz, xy, yz, zx = dot(x, x), dot(y, y), dot(z, z), abs(dot(x, y)), abs(dot(y, z)), abs(dot(z, x))
    least = min(min(xx - xy - zx, yy - xy - yz), zz - yz - zx)
    greatest = max(max(xx + xy + zx, yy + xy + yz), zz + yz + zx)
    x, y, z = scale(p0, x), scale(p1, y), scale(p2, z)
    square = _Symmetric(
        x.x * x.x + y.x * y.x + z.x * z.x, x.y * x.y + y.y * y.y + z.y * z.y, x.z * x.z + y.z * y.z + z.z * z.z,
        x.x * x.y + y.x * y.y + z.x * z.y, x.y * x.z + y.y * y.z + z.y * z.z, x.z * x.x + y.z * y.x + z.z * z.x,
    )
    smallest = min(min(p0, p1), p2)
    radius = smallest * (smallest / max(max(p0, p1), p2)) * least / math.sqrt(greatest)
    return _RollingBall(square, radius * _ROUNDED if least > _LEAST_EIGENVALUE else 0.0)


@kernel(inline=True)
def rolling_radius(pair, body):
    """Radius of a ball that rolls inside an ellipsoid [m]; 0 of other bodies."""
    return _rolling_ball(pair, body).radius if body.kind == ELLIPSOID else 0.0


@kernel(inline=True)
def _support_of(square, n):
    """(the ellipsoid's point farthest along n, its height): good enough to search with."""
    v = _times(square, n)
    height_of = math.sqrt(max(dot(n, v), 1e-300))
    return scale(1.0 / height_of, v), height_of


@kernel(inline=True)
def _nearest(pair, X, t, c):
    """The `_Nearest` of a box, point, segment or cylinder to a point c, both seen from the ellipsoid's origin.

    t : the body's origin from the ellipsoid's.
    """
    at = X.params_at
    p = rotate_back(pair.poses, X.pose_at, sub(c, t))
    along = Vec3(0.0, 0.0, 1.0)
    curvature = 0.0
    feature = _WITHIN
    if X.kind == CYLINDER:
        radius, half = pair.numbers[at], pair.numbers[at + 1]
        aside = math.sqrt(p.x * p.x + p.y * p.y)
        z = min(max(p.z, -half), half)
        if aside > radius:
            p = Vec3(p.x * (radius / aside), p.y * (radius / aside), z)
            feature = _EDGE if -half < z < half else _CORNER
            curvature = radius
        else:
            feature = _WITHIN if -half < z < half else _FACE
            p = Vec3(p.x, p.y, z)
    elif X.n <= 2:
        first, last = column_at(X.coords, X.padded, 0), column_at(X.coords, X.padded, X.n - 1)
        e = sub(last, first)
        square = dot(e, e)
        share = dot(sub(p, first), e) / square if square > 0.0 else 0.0
        feature = _EDGE if 0.0 < share < 1.0 else _CORNER
        share = min(max(share, 0.0), 1.0)
        p = add(first, scale(share, e))
        along = scale(1.0 / math.sqrt(square), e) if square > 0.0 else along
    else:
        h = Vec3(pair.numbers[at], pair.numbers[at + 1], pair.numbers[at + 2])
        free_x, free_y, free_z = abs(p.x) < h.x, abs(p.y) < h.y, abs(p.z) < h.z
        n_free = int(free_x) + int(free_y) + int(free_z)
        feature = _CORNER - n_free
        p = Vec3(min(max(p.x, -h.x), h.x), min(max(p.y, -h.y), h.y), min(max(p.z, -h.z), h.z))
        along = Vec3(1.0 if free_x else 0.0, 1.0 if free_y else 0.0, 1.0 if free_z else 0.0)
    return _Nearest(add(rotate(pair.poses, X.pose_at, p), t), feature, rotate(pair.poses, X.pose_at, along), curvature)


@kernel(inline=True)
def _newton_step(M, n, g, h):
    """Step of n, with M the curvature across n, g the slope and h the height; 0 where the Hessian is not positive
    definite."""
    mean = 0.5 * (M.xx + M.yy + M.zz)
    to_n = h + mean
    xx, yy, zz = M.xx - h + to_n * n.x * n.x, M.yy - h + to_n * n.y * n.y, M.zz - h + to_n * n.z * n.z
    xy, yz, zx = M.xy + to_n * n.x * n.y, M.yz + to_n * n.y * n.z, M.zx + to_n * n.z * n.x
    a, b, c = yy * zz - yz * yz, zx * yz - xy * zz, xy * yz - zx * yy
    d, e, f = xx * zz - zx * zx, xy * zx - xx * yz, xx * yy - xy * xy
    determinant = xx * a + xy * b + zx * c
    if not (determinant > 0.0 and mean > h):
        return Vec3(0.0, 0.0, 0.0)
    return scale(
        -1.0 / determinant, Vec3(a * g.x + b * g.y + c * g.z, b * g.x + d * g.y + e * g.z, c * g.x + e * g.y + f * g.z)
    )


@kernel(inline=True)
def _turned(n, step):
    """A unit vector after a step, shortened to _LARGEST_STEP if longer."""
    length = norm(step)
    if length > _LARGEST_STEP:
        step = scale(_LARGEST_STEP / length, step)
    n = add(n, step)
    return scale(1.0 / norm(n), n)


@kernel(inline=True)
def _curvature(square, s, height_of):
    """Second derivative of an ellipsoid's support function: (R D² Rᵀ − s sᵀ) / height."""
    over = 1.0 / height_of
    return _Symmetric(
        (square.xx - s.x * s.x) * over, (square.yy - s.y * s.y) * over, (square.zz - s.z * s.z) * over,
        (square.xy - s.x * s.y) * over, (square.yz - s.y * s.z) * over, (square.zx - s.z * s.x) * over,
    )


@kernel(inline=True)
def _sum_of(M, N):
    return _Symmetric(M.xx + N.xx, M.yy + N.yy, M.zz + N.zz, M.xy + N.xy, M.yz + N.yz, M.zx + N.zx)


@kernel(inline=True)
def _step_on_feature(nearest, M, n, g, h):
    """The direction after n, where the nearest point lies on a feature of a body that is no ellipsoid."""
    if nearest.feature == _FACE:
        return n
    if nearest.feature == _EDGE:
        across = cross(nearest.e, n)
        curved = dot(across, _times(M, across)) + nearest.curvature - h
        return _turned(n, scale(-dot(across, g) / curved, across)) if curved > 0.0 else n
    if nearest.curvature > 0.0:
        around = cross(nearest.e, n)
        square = dot(around, around)
        if square > 0.0:
            w = scale(math.sqrt(nearest.curvature / (square * math.sqrt(square))), around)
            M = _sum_of(M, _Symmetric(w.x * w.x, w.y * w.y, w.z * w.z, w.x * w.y, w.y * w.z, w.z * w.x))
    return _turned(n, _newton_step(M, n, g, h))


@kernel
def shallow_ellipsoids(pair, points, ids, weights, size, tolerance):
    """The `ShallowDepth` of two cores, at least one an ellipsoid, accepted by `is_ellipsoid_pair`.

    points, ids, weights : of the workspace; if the depth is found, point 0 holds the deepest points of both cores.
    size : of the pair.   tolerance : largest width of the bracket [m].
    """
    of_a = pair.A.kind == ELLIPSOID
    E = pair.A if of_a else pair.B
    X = pair.B if of_a else pair.A
    t = pair.t if of_a else neg(pair.t)
    both = X.kind == ELLIPSOID
    ball = _rolling_ball(pair, E)
    second_ball = _rolling_ball(pair, X) if both else _RollingBall(ball.square, 0.0)
    radius = ball.radius + second_ball.radius
    length = norm(t)
    if not length > 2.0**-20 * size or not ball.radius > 0.0 or (both and not second_ball.radius > 0.0):
        return NOTHING
    n = scale(1.0 / length, t)
    for step in range(1, _ROUNDS):
        s, _ = _support_of(ball.square, n)
        c = sub(s, scale(ball.radius, n))
        if both:
            s_x, height_x = _support_of(second_ball.square, n)
            nearest = _Nearest(sub(add(t, scale(second_ball.radius, n)), s_x), _CORNER, n, 0.0)
        else:
            nearest = _nearest(pair, X, t, c)
            if nearest.feature == _WITHIN:
                return NOTHING
        q = sub(nearest.x, c)
        length = norm(q)
        if not length > 0.0:
            return NOTHING
        direction = scale(1.0 / length, q)
        s, height_s = _support_of(ball.square, direction)
        x = nearest.x
        if both:
            s_x, height_x = _support_of(second_ball.square, direction)
            x = sub(t, s_x)
        w = sub(s, x)
        h = dot(w, direction)
        if not 0.0 < h < _DEEP * radius:
            return NOTHING
        if h + length - radius <= 0.5 * tolerance:
            return _accept(pair, points, ids, weights, E, X, of_a, t, n, nearest.x, ball, second_ball, step, tolerance)
        g = sub(w, scale(h, direction))
        M = _curvature(ball.square, s, height_s)
        if both:
            M = _sum_of(M, _curvature(second_ball.square, s_x, height_x))
            n = _turned(direction, _newton_step(M, direction, g, h))
        else:
            n = _step_on_feature(nearest, M, direction, g, h)
    return NOTHING


@kernel(inline=True)
def _accept(pair, points, ids, weights, E, X, of_a, t, n, x, ball, second_ball, step, tolerance):
    """The bracket along n from supports as exact as any; arguments as in `shallow_ellipsoids`.

    x : the other body's nearest point, where it is no ellipsoid.
    """
    radius = ball.radius + second_ball.radius
    s = _exact_support(pair, E, n)
    c = sub(s, scale(ball.radius, n))
    if X.kind == ELLIPSOID:
        x = add(add(_exact_support(pair, X, neg(n)), t), scale(second_ball.radius, n))
    q = sub(x, c)
    length = norm(q)
    direction = scale(1.0 / length, q)
    nhat = direction if of_a else neg(direction)
    difference_point(pair, points, ids, 0, nhat)
    depth = height(points, 0, nhat)
    proven = radius - length
    a = add(c, scale(ball.radius, direction))
    b = sub(sub(x, scale(second_ball.radius, direction)), t)
    put_vec3(points, POINT_OF_A, a if of_a else b)
    put_vec3(points, POINT_OF_B, b if of_a else a)
    put_vec3(points, 0, sub(sub(vec3_at(points, POINT_OF_A), vec3_at(points, POINT_OF_B)), pair.t))
    weights[0] = 1.0
    return ShallowDepth(0.0 < depth <= proven + tolerance, depth, proven, nhat, step)


@kernel(inline=True)
def _exact_support(pair, body, n):
    """An ellipsoid's point farthest along n, from its own origin in the world's axes."""
    g = rotate_back(pair.poses, body.pose_at, n)
    return rotate(pair.poses, body.pose_at, curved_support(body.kind, pair.numbers, body.params_at, g))
