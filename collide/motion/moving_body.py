"""A body in motion, and its pose at a time: what its poses at both ends mean in between.

In unit time a body's origin moves on a line, and the body turns about the origin with constant angular velocity:

    p(τ) = p0 + τ (p1 − p0),
    R(τ) = Rot(τω) R0 + τ D,      D = R1 − Rot(ω) R0,      0 ≤ τ ≤ 1.

ω is the doubles of `rotation_between` or as given. D is the remainder left by rounding, and by matrices that are no
rotations to the last digit. With D the motion begins and ends at the very numbers given, so that these stay the
problem. Everything else is exact reals, and the poses computed here miss them by at most the slop written down:

    rotation      160 u (1 + |ω|) ρ + u·drift      (ρ: how far points of the core are from the body's origin)
    translation   16 u (|d0| + |d1|)               (d: from A's origin to B's; u = 2⁻⁵³)

Derivation: û is good to 4u, the angle to 3u·|ω|, sine and cosine to 2u; so an entry of Rot is good to 20u and 3u·|ω| of
its row's turn, its product with R0 to 3u more of the sums' terms; Frobenius' norm of all nine is at most 70u + 3u·|ω|.
D is off by as much at the end of the motion, in proportion before, and its sum with the rest by a rounding: 144u +
6u·|ω|. d0, d1, their difference, product with τ and sum round once each, coordinate by coordinate.

Positions are taken from A's moving origin, so that precision does not depend on where in the world the bodies are.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.lowering.compound_table import TURNED
from collide.lowering.shape_table import POSE_SLOP, POSE_STRETCH, POSE_TERMS
from collide.motion.rotations import rotation_about, rotation_between
from collide.narrowphase.posed_pair import stretch_of
from collide.numerics.matrix3 import Matrix3, apply
from collide.numerics.vec3 import Vec3, add, divide, norm, put_vec3, rotate, scale, vec3_at

# Doubles of a body: ω, û, |ω|; R0 and D of its core, row by row; where the core's frame is from the body's origin at
# the start, and what D adds to that; bounds of how far a point of the core is from the origin but for D, and of what D
# adds; slop of a pose; 1 where it does not turn at all.
OMEGA, AXIS, ANGLE, START, DRIFT, ARM, ARM_DRIFT, REACH_OF_CORE, DRIFT_REACH, POSE_ERROR, IS_STILL = (
    0, 3, 6, 7, 16, 25, 28, 31, 32, 33, 34,
)
BODY = 35

#: Bounds are rounded up by more than a dozen roundings.
OUTWARD = 1.0 + 2.0**-45
_UNIT = 2.0**-53
#: How far rounding turns a body, in radians, times 1 + |ω|.
TURN_ERROR = 160.0 * _UNIT


@kernel
def set_body(body, X0, X1, omega_given, has_omega, part, at, reach):
    """Write the BODY doubles of a moving part; returns how far D is from 0, in its largest entry.

    X0, X1 : views of 16 doubles, the body's poses at both ends.
    omega_given : view of three doubles, the angular velocity [rad in unit time, in W], read where ``has_omega``.
    part : view of rows of parts; the row from ``at`` on is the core's pose in the body.
    reach : greatest distance of a point of the core from its own frame's origin [m].
    """
    omega = vec3_at(omega_given, 0) if has_omega else rotation_between(X0, X1)
    angle = norm(omega)
    axis = divide(omega, angle) if angle > 0.0 else Vec3(0.0, 0.0, 0.0)
    put_vec3(body, OMEGA, omega)
    put_vec3(body, AXIS, axis)
    body[ANGLE] = angle
    rotation = rotation_about(axis, angle)
    off = 0.0
    for j in range(3):
        column = Vec3(X0[j], X0[4 + j], X0[8 + j])
        turned = apply(rotation, column)
        if angle == 0.0:
            turned = column
        drift = Vec3(X1[j] - turned.x, X1[4 + j] - turned.y, X1[8 + j] - turned.z)
        off = max(off, abs(drift.x), abs(drift.y), abs(drift.z))
        body[START + j], body[START + 3 + j], body[START + 6 + j] = column
        body[DRIFT + j], body[DRIFT + 3 + j], body[DRIFT + 6 + j] = drift
    arm = Vec3(0.0, 0.0, 0.0)
    arm_drift = arm
    is_part = part[at + TURNED] != 0.0
    if is_part:
        arm = rotate(body, START, vec3_at(part, at + 9))
        arm_drift = rotate(body, DRIFT, vec3_at(part, at + 9))
        _take_part(body, START, part, at)
        _take_part(body, DRIFT, part, at)
    put_vec3(body, ARM, arm)
    put_vec3(body, ARM_DRIFT, arm_drift)
    square = 0.0
    for k in range(9):
        square += body[DRIFT + k] * body[DRIFT + k]
    reach_of_core = (reach * _stretch(body) + norm(arm)) * OUTWARD
    drift_reach = (reach * math.sqrt(square) + norm(arm_drift)) * OUTWARD
    body[REACH_OF_CORE] = reach_of_core
    body[DRIFT_REACH] = drift_reach
    is_still = angle == 0.0 and off == 0.0 and not is_part
    body[IS_STILL] = 1.0 if is_still else 0.0
    body[POSE_ERROR] = 0.0 if is_still else TURN_ERROR * (1.0 + angle) * reach_of_core + _UNIT * drift_reach
    return off


@kernel(inline=True)
def _take_part(body, first, part, at):
    """The (3, 3) matrix at ``first`` becomes its product with the part's rotation."""
    for i in range(3):
        row = vec3_at(body, first + 3 * i)
        for j in range(3):
            body[first + 3 * i + j] = row.x * part[at + j] + row.y * part[at + 3 + j] + row.z * part[at + 6 + j]


@kernel(inline=True)
def _stretch(body):
    """A bound of |R0|."""
    x = Vec3(body[START], body[START + 3], body[START + 6])
    y = Vec3(body[START + 1], body[START + 4], body[START + 7])
    z = Vec3(body[START + 2], body[START + 5], body[START + 8])
    return stretch_of(
        x.x * x.x + x.y * x.y + x.z * x.z, y.x * y.x + y.y * y.y + y.z * y.z, z.x * z.x + z.y * z.y + z.z * z.z,
        x.x * y.x + x.y * y.y + x.z * y.z, y.x * z.x + y.y * z.y + y.z * z.z, z.x * x.x + z.y * x.y + z.z * x.z,
    )


@kernel(inline=True)
def rotation_at(body, time):
    """Rot(τω)."""
    return rotation_about(vec3_at(body, AXIS), time * body[ANGLE])


@kernel(inline=True)
def place_body(body, time, poses, at, origin, slop):
    """Pose row ``at`` becomes where the core is at a time, the body's own origin being at ``origin``.

    slop : of the origin, to be added to that of the rotation.
    """
    if body[IS_STILL] != 0.0:
        for k in range(9):
            poses[at + k] = body[START + k]
        put_vec3(poses, at + 9, origin)
        poses[at + POSE_SLOP] = slop
        poses[at + POSE_TERMS] = -1.0
        poses[at + POSE_STRETCH] = -1.0
        return
    if body[ANGLE] == 0.0:
        rotation = Matrix3(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))
    else:
        rotation = rotation_at(body, time)
    for j in range(3):
        column = apply(rotation, Vec3(body[START + j], body[START + 3 + j], body[START + 6 + j]))
        poses[at + j] = column.x + time * body[DRIFT + j]
        poses[at + 3 + j] = column.y + time * body[DRIFT + 3 + j]
        poses[at + 6 + j] = column.z + time * body[DRIFT + 6 + j]
    arm = add(apply(rotation, vec3_at(body, ARM)), scale(time, vec3_at(body, ARM_DRIFT)))
    put_vec3(poses, at + 9, add(origin, arm))
    poses[at + POSE_SLOP] = body[POSE_ERROR] + slop
    poses[at + POSE_TERMS] = -1.0
    poses[at + POSE_STRETCH] = -1.0
