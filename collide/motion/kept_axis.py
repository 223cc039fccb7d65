"""A separating axis kept over a span of time: what two gaps along the axis prove about the time between.

Let n(τ) be a unit vector turning with a constant angular velocity Ω: with the world (Ω = 0), with A or with B. For
points a of A and b of B let f(τ) = n(τ)·(x_b(τ) − x_a(τ)), and F(τ) the least of all f(τ) less the radii: the gap along
n, a lower bound of the distance. If f″ ≤ K for all points, f lies above its chord by no less than −K/2 (τ − t0)(t1 −
τ), and so does F. With s0 = F(t0) > 0 and s1 = F(t1) > 0 therefore

    F > 0 on the whole of [t0, t1]   if   K (t1 − t0)² / 2  <  (√s0 + √s1)².

Proof: (1 − x) s0 + x s1 − c x (1 − x), c the left side, has its minimum s0 − (s0 + c − s1)² / 4c, if at all within 0 <
x < 1; the minimum is positive where s0 + c − s1 < 2 √(c s0), equivalently (√c − √s0)² < s1. Steps are as long as the
root of the gap, where motion bounds of first order (Mirtich 1996; Zhang et al. 2006, C2A: Tang, Kim and Manocha 2009)
allow steps in proportion to the gap; for translations K = 0, and an axis with gaps at both ends proves the whole
motion. While the nearest features stay the same, one axis serves up to the contact (Catto, "Continuous collision",
2013: axes of points and of faces), here by a proven chord instead of samples.

Bound of f″, with x = x_b − x_a, r_a and r_b from the bodies' own origins, v the relative velocity of these, d from A's
to B's (`curvature`): differentiating twice,

    f″ = n·(x″ − 2 Ω × x′ + Ω × (Ω × x)),    x″ = ω_B × (ω_B × r_b) − ω_A × (ω_A × r_a),

the factor of r_b is (ω_B − Ω) × ((ω_B − Ω) × r_b) + (ω_B × Ω) × r_b by Jacobi's identity, likewise for r_a, and the
rest is −2 Ω × v + Ω × (Ω × d). D of `moving_body.py` adds τ n·Dr: at most (2|Ω| + |Ω|²)|D r|.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.motion.moving_body import ANGLE, AXIS, DRIFT_REACH, REACH_OF_CORE, TURN_ERROR
from collide.motion.moving_pair import omega_of, origin_of_b
from collide.motion.rotations import rotation_about
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.halfspace_convex import plane_in_world, reach_of_plane
from collide.numerics.matrix3 import apply
from collide.numerics.vec3 import (
    Vec3,
    add,
    column_at,
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
from collide.support.support_mapping import settled_vertex, support

#: Sums of a dozen rounded terms, rounded up.
_OUTWARD = 1.0 + 2.0**-40


class TurningAxis(NamedTuple):
    """A unit vector n from A to B at some time, turning with constant angular velocity Ω.

    speed : |Ω|.   about : Ω / |Ω|, or 0.
    """

    n: Vec3
    turning: Vec3
    speed: float
    about: Vec3


class AxisGap(NamedTuple):
    """gap : proven lower bound of F at a time [m].   rate : of change of n·x for the support points at the time, the
    turn of n included [m / unit time].   axis : the `TurningAxis`."""

    gap: float
    rate: float
    axis: TurningAxis


@kernel(inline=True)
def axis_turning(n, turning):
    speed = norm(turning)
    about = divide(turning, speed) if speed > 0.0 else Vec3(0.0, 0.0, 0.0)
    return TurningAxis(n, turning, speed, about)


@kernel(inline=True)
def axis_with(n, body):
    """The axis that turns with a body."""
    return TurningAxis(n, omega_of(body), body[ANGLE], vec3_at(body, AXIS))


@kernel(inline=True)
def turned_axis(axis, passed):
    """The axis after so much time."""
    if axis.speed == 0.0:
        return axis
    n = apply(rotation_about(axis.about, passed * axis.speed), axis.n)
    # its length would drift away from 1, turn by turn
    return TurningAxis(divide(n, norm(n)), axis.turning, axis.speed, axis.about)


@kernel
def gap_along(motion, time, axis):
    """The `AxisGap` of a pair at its poses of ``time``, along an axis of the same time.

    A half-space has a single axis: its normal, turning with the body.
    """
    if motion.is_plane:
        return _gap_of_plane(motion, time)
    pair = motion.pair
    A, B, poses = pair.A, pair.B, pair.poses
    x_a = add(_extreme(pair, A, rotate_back(poses, A.pose_at, axis.n)), vec3_at(poses, A.pose_at + 9))
    x_b = add(_extreme(pair, B, rotate_back(poses, B.pose_at, neg(axis.n))), vec3_at(poses, B.pose_at + 9))
    error = motion.error
    if axis.speed != 0.0:
        error += TURN_ERROR * (1.0 + axis.speed) * motion.size
    gap = dot(sub(x_b, x_a), axis.n) - motion.radius - error
    return AxisGap(gap, _rate(motion, time, axis, x_a, x_b), axis)


@kernel
def _gap_of_plane(motion, time):
    """The same of a half-space A, as `halfspace_convex.py` has it."""
    pair = motion.pair
    A, B, poses = pair.A, pair.B, pair.poses
    plane = plane_in_world(pair, A)
    n = divide(plane.normal, plane.length)
    offset, skew = reach_of_plane(pair, A)
    x_b = add(_extreme(pair, B, rotate_back(poses, B.pose_at, neg(n))), vec3_at(poses, B.pose_at + 9))
    height = dot(sub(x_b, vec3_at(poses, A.pose_at + 9)), n) - plane.offset / plane.length
    # by how much the axis as computed, and D of the plane's own matrix, miss one that turns evenly
    turned = TURN_ERROR * (1.0 + motion.a[ANGLE]) + 16.0 * motion.off
    size = motion.size + offset
    gap = height - motion.radius - (motion.error + (ERROR * skew + turned) * size)
    axis = axis_with(n, motion.a)
    return AxisGap(gap, _rate(motion, time, axis, sub(x_b, scale(height, n)), x_b), axis)


@kernel(inline=True)
def _rate(motion, time, axis, x_a, x_b):
    """n·(x′ − Ω × x) of two points that move with their bodies."""
    moved = add(motion.v, cross(omega_of(motion.b), sub(x_b, origin_of_b(motion, time))))
    moved = sub(moved, cross(omega_of(motion.a), x_a))
    return dot(axis.n, sub(moved, cross(axis.turning, sub(x_b, x_a))))


@kernel
def _extreme(pair, body, g):
    """The point of a core farthest in a direction of its own frame, in W's axes from the core's origin."""
    k, corner, _ = support(body.kind, body.coords, body.padded, pair.numbers, body.params_at, body.tree, 0, -1, g)
    if body.tree != 0:
        k = settled_vertex(body.coords, body.padded, body.tree, k, g)
        corner = column_at(body.coords, body.padded, k)
    return rotate(pair.poses, body.pose_at, corner)


@kernel
def curvature(motion, axis):
    """K, a bound of f″ along an axis [m in unit time squared]."""
    omega_a, omega_b = omega_of(motion.a), omega_of(motion.b)
    reach_a, reach_b = motion.a[REACH_OF_CORE], motion.b[REACH_OF_CORE]
    square_a, square_b = dot(omega_a, omega_a), dot(omega_b, omega_b)
    if axis.speed == 0.0:  # n·(ω × (ω × r)) = −(ω × n)·(ω × r)
        bend_a = norm(cross(axis.n, omega_a)) * motion.a[ANGLE] * reach_a
        bend_b = norm(cross(axis.n, omega_b)) * motion.b[ANGLE] * reach_b
        # products of nearly parallel vectors cancel: their rounding is measured by the factors
        return (bend_a + bend_b) * _OUTWARD + 1e-14 * (square_a * reach_a + square_b * reach_b)
    turning, square = axis.turning, axis.speed * axis.speed
    bend = _bend(omega_a, turning) * reach_a + _bend(omega_b, turning) * reach_b
    drift = (2.0 * axis.speed + square) * (motion.a[DRIFT_REACH] + motion.b[DRIFT_REACH])
    total = bend + 2.0 * norm(cross(turning, motion.v)) + square * motion.farthest + drift
    rounding = 1e-14 * ((square + square_a + square_b) * (reach_a + reach_b) + axis.speed * norm(motion.v))
    return total * _OUTWARD + rounding


@kernel(inline=True)
def _bend(omega, turning):
    difference = sub(omega, turning)
    return dot(difference, difference) + norm(cross(omega, turning))


@kernel(inline=True)
def is_free_between(gap0, gap1, bound, passed):
    """Whether gaps along a kept axis at both ends of a span prove all of it free.

    bound : K.   passed : t1 − t0.
    """
    if not (gap0 > 0.0 and gap1 > 0.0):
        return False
    return 0.5 * bound * passed * passed * _OUTWARD < gap0 + gap1 + 2.0 * math.sqrt(gap0) * math.sqrt(gap1)
