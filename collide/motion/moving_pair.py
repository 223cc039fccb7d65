"""Two convex sets in motion, and where both are at a time."""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.shape_table import NUMBERS, POSE, RADIUS, REACH, SLOP
from collide.motion.moving_body import (
    ANGLE,
    DRIFT_REACH,
    IS_STILL,
    OMEGA,
    OUTWARD,
    POSE_ERROR,
    REACH_OF_CORE,
    TURN_ERROR,
    place_body,
    set_body,
)
from collide.narrowphase.bounds import ERROR, SMALLEST_NORMAL
from collide.narrowphase.posed_pair import PosedPair, posed_pair
from collide.numerics.vec3 import Vec3, add, norm, scale, sub, vec3_at

_UNIT = 2.0**-53


class BodyMotion(NamedTuple):
    """A body's motion as given: views of X0 and X1 (16 doubles each), ω (3) and whether ω counts; a view of rows of
    parts, and where the row of its part begins."""

    X0: Any
    X1: Any
    omega: Any
    has_omega: bool
    parts: Any
    part_at: int


class MovingPair(NamedTuple):
    """Two convex sets in motion, A and B in the order worked on; a half-space is A.

    a, b : views of BODY doubles (`moving_body.py`).
    pair : the `PosedPair` whose poses `place_pair` writes.
    d0, v : from A's origin to B's at the start, and how that changes in unit time.
    farthest : bound of the distance of both origins at any time.
    radius : sum of the swept radii.   is_plane : whether A is a half-space.
    size : S of `bounds.py` at most, but for the offset of a half-space.
    error : of a gap along an axis, whatever the time: rounding, slop of poses and of stored points.
    off : by how much a matrix misses the motion, in its largest entry (`set_body`).
    """

    a: Any
    b: Any
    pair: PosedPair
    d0: Vec3
    v: Vec3
    farthest: float
    radius: float
    is_plane: bool
    size: float
    error: float
    off: float


@kernel(inline=True)
def moving_pair(ints, numbers, poses, sa, sb, motion_a, motion_b, a, b):
    """The `MovingPair` of two shapes, rows of the `ShapeTable`; a and b, views of BODY doubles, are written.

    poses : view of two pose rows.
    """
    pair = posed_pair(ints, numbers, poses, sa, 0, sb, 1)
    off_a = set_body(
        a, motion_a.X0, motion_a.X1, motion_a.omega, motion_a.has_omega, motion_a.parts, motion_a.part_at,
        numbers[NUMBERS * sa + REACH],
    )
    off_b = set_body(
        b, motion_b.X0, motion_b.X1, motion_b.omega, motion_b.has_omega, motion_b.parts, motion_b.part_at,
        numbers[NUMBERS * sb + REACH],
    )
    d0 = sub(_translation(motion_b.X0), _translation(motion_a.X0))
    d1 = sub(_translation(motion_b.X1), _translation(motion_a.X1))
    farthest = max(norm(d0), norm(d1)) * OUTWARD
    radius = numbers[NUMBERS * sa + RADIUS] + numbers[NUMBERS * sb + RADIUS]
    size = (
        a[REACH_OF_CORE] + b[REACH_OF_CORE] + a[DRIFT_REACH] + b[DRIFT_REACH] + farthest + radius
    ) * OUTWARD
    is_plane = pair.A.kind == HALFSPACE
    if is_plane and a[IS_STILL] == 0.0:  # a turned plane is wrong by as much as B is far
        a[POSE_ERROR] = TURN_ERROR * (1.0 + a[ANGLE]) * size
    # never 0: the numbers of a pose in between are not those of the problem
    slop = numbers[NUMBERS * sa + SLOP] + numbers[NUMBERS * sb + SLOP]
    error = ERROR * size + a[POSE_ERROR] + b[POSE_ERROR] + slop + origin_error(farthest)
    return MovingPair(a, b, pair, d0, sub(d1, d0), farthest, radius, is_plane, size, error, max(off_a, off_b))


@kernel(inline=True)
def _translation(X):
    return Vec3(X[3], X[7], X[11])


@kernel(inline=True)
def origin_error(farthest):
    """How far rounding moves B's origin from A's."""
    return 32.0 * _UNIT * farthest + SMALLEST_NORMAL


@kernel(inline=True)
def origin_of_b(motion, time):
    """From A's origin to B's."""
    return add(motion.d0, scale(time, motion.v))


@kernel
def place_pair(motion, time):
    """Set the pair's poses to the poses at a time, from A's origin then."""
    poses = motion.pair.poses
    place_body(motion.a, time, poses, 0, Vec3(0.0, 0.0, 0.0), 0.0)
    place_body(motion.b, time, poses, POSE, origin_of_b(motion, time), origin_error(motion.farthest))


@kernel(inline=True)
def omega_of(body):
    return vec3_at(body, OMEGA)
