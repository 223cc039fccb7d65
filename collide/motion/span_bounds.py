"""A span of time of two pieces in motion: where they are at its middle, and how near that lets them come.

In a span of length h around its middle no point of one piece moves more than μ h / 2 against the other, μ a bound of its
speed: Mirtich's motion bound ("Impulse-based dynamic simulation of rigid body systems", 1996), the least of three, as
seen from the world, from A and from B. From A, whose origin is where positions are taken from, a point r of B's, at d
from there, moves by

    v + ω_B × r − ω_A × (d + r)  =  (v − ω_A × d) + (ω_B − ω_A) × r :

bodies that turn together stand still.
"""

from __future__ import annotations

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.compound_table import PART
from collide.lowering.shape_table import POSE, POSE_SLOP
from collide.motion.moving_body import (
    ANGLE,
    BODY,
    DRIFT_REACH,
    OUTWARD,
    REACH_OF_CORE,
    place_body,
    set_body,
)
from collide.motion.moving_pair import omega_of, origin_error
from collide.motion.swept_balls import time_of_balls
from collide.numerics.vec3 import Vec3, add, cross, norm, scale, sub

# Addresses of a motion: poses of A and B at both ends, angular velocities or 0; two rows of parts, and three doubles:
# how far points of each piece are from the piece's own origin, and what is added to what they reach [m].
XA0_AT, XA1_AT, XB0_AT, XB1_AT, OMEGA_A_AT, OMEGA_B_AT, PARTS_AT, REACHES_AT = range(8)
HEADER = 8

# What comes out: both matrices, from A's origin; how near facets are at the middle that may meet in the span [m]; the
# time in which balls about both origins meet.
X_A, X_B, REACH, BEGIN, END = 0, 16, 32, 33, 34
OUT = 35
WORKSPACE = 2 * BODY + 2 * POSE


@entry("int64(int64, float64, float64, int64, int64)")
def describe_span(motion_at, begin, end, work_at, out_at):
    """Describe the span begin … end of a motion; returns 0.

    motion : HEADER addresses.   work : WORKSPACE doubles.   out : OUT doubles.
    """
    motion = view_i64(motion_at, HEADER)
    reaches = view_f64(motion[REACHES_AT], 3)
    a, b = view_f64(work_at, BODY), view_f64(work_at + 8 * BODY, BODY)
    poses = view_f64(work_at + 16 * BODY, 2 * POSE)
    out = view_f64(out_at, OUT)
    _set(a, motion, XA0_AT, OMEGA_A_AT, 0, reaches[0])
    _set(b, motion, XB0_AT, OMEGA_B_AT, PART, reaches[1])
    d0 = sub(_translation(motion[XB0_AT]), _translation(motion[XA0_AT]))
    v = sub(sub(_translation(motion[XB1_AT]), _translation(motion[XA1_AT])), d0)
    farthest = (norm(d0) + norm(v)) * OUTWARD
    middle = 0.5 * (begin + end)
    origin = add(d0, scale(middle, v))
    place_body(a, middle, poses, 0, Vec3(0.0, 0.0, 0.0), 0.0)
    place_body(b, middle, poses, POSE, origin, origin_error(farthest))
    _put_matrix(poses, 0, out, X_A)
    _put_matrix(poses, POSE, out, X_B)
    slop = poses[POSE_SLOP] + poses[POSE + POSE_SLOP] + reaches[2]
    half = 0.5 * (end - begin) * OUTWARD + 2.0**-52
    out[REACH] = (speed_bound(a, b, v, add(d0, scale(begin, v)), add(d0, scale(end, v))) * half + slop) * OUTWARD
    near = a[REACH_OF_CORE] + b[REACH_OF_CORE] + a[DRIFT_REACH] + b[DRIFT_REACH] + slop
    out[BEGIN], out[END] = time_of_balls(d0, v, farthest, near, begin, end)
    return 0


@kernel(inline=True)
def _set(body, motion, X_at, omega_at, part, reach):
    has_omega = motion[omega_at] != 0
    omega = view_f64(motion[omega_at] if has_omega else motion[X_at], 3)
    parts = view_f64(motion[PARTS_AT], 2 * PART)
    set_body(body, view_f64(motion[X_at], 16), view_f64(motion[X_at + 1], 16), omega, has_omega, parts, part, reach)


@kernel(inline=True)
def _translation(X_at):
    X = view_f64(X_at, 16)
    return Vec3(X[3], X[7], X[11])


@kernel(inline=True)
def _put_matrix(poses, at, out, to):
    for i in range(3):
        for j in range(3):
            out[to + 4 * i + j] = poses[at + 3 * i + j]
        out[to + 4 * i + 3] = poses[at + 9 + i]
        out[to + 12 + i] = 0.0
    out[to + 15] = 1.0


@kernel
def speed_bound(a, b, v, d_begin, d_end):
    """μ of two moving bodies whose origins are from d_begin to d_end apart, in a straight line [m in unit time]."""
    omega_a, omega_b = omega_of(a), omega_of(b)
    reach_a, reach_b = a[REACH_OF_CORE], b[REACH_OF_CORE]
    turning = norm(sub(omega_b, omega_a))
    from_world = norm(v) + a[ANGLE] * reach_a + b[ANGLE] * reach_b
    # what is linear in time is largest at one of the ends
    moved_a = max(norm(sub(v, cross(omega_a, d_begin))), norm(sub(v, cross(omega_a, d_end))))
    moved_b = max(norm(sub(v, cross(omega_b, d_begin))), norm(sub(v, cross(omega_b, d_end))))
    from_a, from_b = moved_a + turning * reach_b, moved_b + turning * reach_a
    drift = (1.0 + a[ANGLE] + b[ANGLE]) * (a[DRIFT_REACH] + b[DRIFT_REACH])
    size = norm(v) + (a[ANGLE] + b[ANGLE]) * (reach_a + reach_b + norm(d_begin) + norm(d_end))
    return min(from_world, from_a, from_b) * OUTWARD + drift + 2.0**-46 * size
