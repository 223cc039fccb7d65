"""Bodies, or their parts, that come near each other while the first moves straight: by balls, before a part is posed.

With d from the centre of the first ball to the centre of the second, and the first ball moved by t v, the contents of
the balls are farther apart than a margin while |d − t v| exceeds the sum of both radii and the margin. |d − t v| is
convex in t: where its least value in [0, limit], at d·v / v² or at the nearer end, exceeds the sum, so do all others.
Rounding of t moves |d − t v| by less than 2⁻⁴⁸ |d|, far less than the balls' margin of the size.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, view_f64, view_u8
from collide.lowering.compound_table import BALL_IN_WORLD, Balls
from collide.lowering.place_parts import BALL_MARGIN, place_ball
from collide.lowering.shape_table import POSE, POSE_STRETCH
from collide.narrowphase.pose_batches import set_pose
from collide.numerics.vec3 import dot, norm, norm1, scale, sub, vec3_at

#: Doubles of a ball in a body's frame: centre, radius of what the body's pose stretches, radius of what it does not.
_BALL = 5
_WORK = 2 * POSE + 2 * BALL_IN_WORLD


@entry(
    "int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, float64, boolean, int64, int64)"
)
def balls_on_ways(
    of_a_at, stride_a, XA_at, step_a, of_b_at, stride_b, XB_at, step_b, n, vectors_at, limits_at, margin, check,
    work_at, out_at,
):
    """Write n bytes, 0 where two balls stay farther apart than a margin [m]; returns −1 at an invalid pose, else 0.

    of_a, of_b : balls in their bodies' frames, a stride of doubles from each ball to the next; 0 for a single ball.
    XA, XB : matrices; step 16 or, for a single pose, 0.   vectors, limits : 0, or three doubles and a double a row.
    check : refuse matrices that are no rotation.   work : 2 · POSE + 2 · BALL_IN_WORLD doubles.
    """
    poses, balls = view_f64(work_at, 2 * POSE), view_f64(work_at + 16 * POSE, 2 * BALL_IN_WORLD)
    out = view_u8(out_at, n)
    for k in range(n):
        new_a, new_b = k == 0 or step_a != 0, k == 0 or step_b != 0
        if new_a and not set_pose(poses, 0, view_f64(XA_at + 8 * step_a * k, 16), check):
            return -1
        if new_b and not set_pose(poses, POSE, view_f64(XB_at + 8 * step_b * k, 16), check):
            return -1
        of_a, of_b = view_f64(of_a_at + 8 * stride_a * k, _BALL), view_f64(of_b_at + 8 * stride_b * k, _BALL)
        shift = sub(vec3_at(poses, POSE + 9), vec3_at(poses, 9))
        place_ball(poses, 0, of_a, 0, 0.0, 0.0, 0.0, balls, 0)
        place_ball(poses, POSE, of_b, 0, shift.x, shift.y, shift.z, balls, BALL_IN_WORLD)
        reach = balls[3] + balls[BALL_IN_WORLD + 3]
        size = reach + norm1(shift)
        size += norm1(vec3_at(of_a, 0)) * max(poses[POSE_STRETCH], 1.0)
        size += norm1(vec3_at(of_b, 0)) * max(poses[POSE + POSE_STRETCH], 1.0)
        d = sub(vec3_at(balls, BALL_IN_WORLD), vec3_at(balls, 0))
        if vectors_at != 0:
            v = vec3_at(view_f64(vectors_at + 24 * k, 3), 0)
            limit = view_f64(limits_at + 8 * k, 1)[0]
            d = sub(d, scale(min(max(dot(d, v) / dot(v, v), 0.0), limit), v))
        out[k] = 0 if norm(d) > (reach + margin) * (1.0 + 2.0**-50) + BALL_MARGIN * size else 1
    return 0


def near_on_ways(
    a: Balls, b: Balls, X_WA: np.ndarray, X_WB: np.ndarray, n: int, *, margin: float = 0.0,
    vectors: np.ndarray | None = None, limits: np.ndarray | None = None, check: bool = False,
) -> np.ndarray | None:
    """(n,) bool: which of n pairs of balls may come within a margin [m]; ``None`` where a matrix is no pose.

    a, b : a single ball for all, or n.   X_WA, X_WB : C-contiguous float64 (n, 4, 4), or (1, 4, 4) for all.
    vectors : (n, 3) translations of A at t = 1, their largest component at least ½, as `Directions` has them.
    limits : (n,) of t.   check : refuse matrices that are no rotation.   About 0.05 µs a pair.
    """
    out, work = np.empty(n, dtype=bool), np.empty(_WORK)
    ways = (0, 0)
    if vectors is not None and limits is not None:
        vectors, limits = np.ascontiguousarray(vectors), np.ascontiguousarray(limits)
        ways = address_of(vectors), address_of(limits)
    status = balls_on_ways(
        a.at, a.stride, address_of(X_WA), 16 * (len(X_WA) > 1), b.at, b.stride, address_of(X_WB), 16 * (len(X_WB) > 1),
        n, *ways, margin, check, address_of(work), address_of(out),
    )
    return None if status else out
