"""A span of time of two pieces in motion: their poses at its middle, and how much nearer they may come.

Facets that may meet in the span are within μ h / 2 at its middle, h its length, μ of `speed_bound.py`.
"""

from __future__ import annotations

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.lowering.compound_table import PART
from collide.lowering.shape_table import POSE, POSE_SLOP
from collide.motion.moving_body import (
    BODY,
    DRIFT_REACH,
    OUTWARD,
    REACH_OF_CORE,
    place_body,
    set_body,
)
from collide.motion.moving_pair import origin_error
from collide.motion.speed_bound import speed_bound
from collide.motion.swept_balls import time_of_balls
from collide.numerics.vec3 import Vec3, add, norm, scale, sub

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
    describe(motion_at, begin, end, work_at, out_at)
    return 0


@entry("int64(int64, int64, int64, int64, int64, int64)")
def balls_meet_in_motion(motion_at, steps_at, n, work_at, header_at, met_at):
    """Write n bytes, 0 for motions where balls about both bodies' origins never meet; returns 0.

    motion : HEADER addresses, of the first motion.   steps : HEADER bytes from each motion to the next.
    work : WORKSPACE + OUT doubles.   header : room for HEADER addresses.
    """
    motion, steps, header = view_i64(motion_at, HEADER), view_i64(steps_at, HEADER), view_i64(header_at, HEADER)
    out_at = work_at + 8 * WORKSPACE
    out, met = view_f64(out_at, OUT), view_u8(met_at, n)
    for k in range(n):
        for i in range(HEADER):
            header[i] = motion[i] + k * steps[i]
        describe(header_at, 0.0, 1.0, work_at, out_at)
        met[k] = 0 if out[BEGIN] > out[END] else 1
    return 0


@kernel
def describe(motion_at, begin, end, work_at, out_at):
    """`describe_span` for kernels."""
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
