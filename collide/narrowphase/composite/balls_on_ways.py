"""Bodies, or their parts, that come near each other while the first moves straight: by balls, before a part is posed.

With d from the centre of the first ball to the centre of the second, and the first ball moved by t v, the contents of
the balls are farther apart than a margin while |d − t v| exceeds the sum of both radii and the margin. |d − t v| is
convex in t: where its least value in [0, limit], at d·v / v² or at the nearer end, exceeds the sum, so do all others.
Rounding of t moves |d − t v| by less than 2⁻⁴⁸ |d|, far less than the balls' margin of the size.
"""

from __future__ import annotations

from threading import local

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_u8
from collide.lowering.compound_table import BALL_IN_WORLD, Balls
from collide.lowering.place_parts import BALL_MARGIN, place_ball
from collide.lowering.shape_table import POSE, POSE_STRETCH
from collide.narrowphase.pose_batches import set_pose
from collide.numerics.vec3 import dot, norm, norm1, scale, sub, vec3_at
from collide.transforms import LARGEST

#: Doubles of a ball in a body's frame: centre, radius of what the body's pose stretches, radius of what it does not.
_BALL = 5
_WORK = 2 * POSE + 2 * BALL_IN_WORLD

#: Of directions as `cast_arguments.checked_directions` takes them: the largest component, and others as parts of it.
_MIN_SIZE, _MAX_SIZE, _MIN_RATIO = 1e-100, 1e100, 2.0**-499


@kernel(inline=True)
def _nearest_on_way(d, v, limit):
    """The shortest vector d − t v with t within 0 … limit."""
    return sub(d, scale(min(max(dot(d, v) / dot(v, v), 0.0), limit), v))


@kernel(inline=True)
def _beyond(d, reach, size):
    """Whether contents of two balls, d from centre to centre, are farther apart than the sum of radii and margin."""
    return norm(d) > reach * (1.0 + 2.0**-50) + BALL_MARGIN * size


@kernel(inline=True)
def is_direction(v):
    """Whether a single cast takes the vector as it is: others are for Python to look at."""
    size = max(abs(v.x), abs(v.y), abs(v.z))
    if not (size >= _MIN_SIZE and size <= _MAX_SIZE):
        return False
    least = _MIN_RATIO * size
    return (v.x == 0.0 or abs(v.x) >= least) and (v.y == 0.0 or abs(v.y) >= least) and (v.z == 0.0 or abs(v.z) >= least)


@kernel(inline=True)
def _size_of(ball, pose, poses):
    """How far the centre of a body's ball is from the body's origin, in components summed [m]."""
    return norm1(vec3_at(ball, 0)) * max(poses[pose + POSE_STRETCH], 1.0)


@entry("int64(int64, int64, int64, int64, int64, float64, int64)")
def body_misses(of_a_at, XA_at, of_b_at, XB_at, vector_at, limit, work_at):
    """1 where body A, moved by t v for t within 0 … limit, stays clear of body B by the balls around them; else 0, and
    where a matrix is no pose or the vector no direction.

    of_a, of_b : _BALL doubles.   work : _WORK doubles.
    """
    poses, balls = view_f64(work_at, 2 * POSE), view_f64(work_at + 16 * POSE, 2 * BALL_IN_WORLD)
    v = vec3_at(view_f64(vector_at, 3), 0)
    if not is_direction(v):
        return 0
    if not (set_pose(poses, 0, view_f64(XA_at, 16), True) and set_pose(poses, POSE, view_f64(XB_at, 16), True)):
        return 0
    size = _place_both(poses, view_f64(of_a_at, _BALL), view_f64(of_b_at, _BALL), balls)
    d = _nearest_on_way(sub(vec3_at(balls, BALL_IN_WORLD), vec3_at(balls, 0)), v, limit)
    return 1 if _beyond(d, balls[3] + balls[BALL_IN_WORLD + 3], size) else 0


@entry("int64(int64, int64, int64, int64, float64, int64)")
def ray_misses(of_b_at, XB_at, origin_at, vector_at, limit, work_at):
    """`body_misses` of a ray, a point in the place of body A: its origin within the largest lengths."""
    poses, balls = view_f64(work_at, 2 * POSE), view_f64(work_at + 16 * POSE, 2 * BALL_IN_WORLD)
    origin, v = vec3_at(view_f64(origin_at, 3), 0), vec3_at(view_f64(vector_at, 3), 0)
    if not (abs(origin.x) <= LARGEST and abs(origin.y) <= LARGEST and abs(origin.z) <= LARGEST):
        return 0
    if not (is_direction(v) and set_pose(poses, 0, view_f64(XB_at, 16), True)):
        return 0
    of_b = view_f64(of_b_at, _BALL)
    shift = sub(vec3_at(poses, 9), origin)
    place_ball(poses, 0, of_b, 0, shift.x, shift.y, shift.z, balls, 0)
    size = balls[3] + norm1(shift) + _size_of(of_b, 0, poses)
    return 1 if _beyond(_nearest_on_way(vec3_at(balls, 0), v, limit), balls[3], size) else 0


@kernel(inline=True)
def _place_both(poses, of_a, of_b, balls):
    """Place the balls of both bodies as seen from A's origin; returns how large the pair is [m]."""
    shift = sub(vec3_at(poses, POSE + 9), vec3_at(poses, 9))
    place_ball(poses, 0, of_a, 0, 0.0, 0.0, 0.0, balls, 0)
    place_ball(poses, POSE, of_b, 0, shift.x, shift.y, shift.z, balls, BALL_IN_WORLD)
    reach = balls[3] + balls[BALL_IN_WORLD + 3]
    return reach + norm1(shift) + _size_of(of_a, 0, poses) + _size_of(of_b, POSE, poses)


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
        size = _place_both(poses, of_a, of_b, balls)
        d = sub(vec3_at(balls, BALL_IN_WORLD), vec3_at(balls, 0))
        if vectors_at != 0:
            v = vec3_at(view_f64(vectors_at + 24 * k, 3), 0)
            d = _nearest_on_way(d, v, view_f64(limits_at + 8 * k, 1)[0])
        out[k] = 0 if _beyond(d, balls[3] + balls[BALL_IN_WORLD + 3] + margin, size) else 1
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


class SingleWay:
    """Single casts that miss by the balls around the bodies, found before anything else is done.

    balls : of body A, or ``None`` of rays, and of body B, (_BALL or more,) doubles each.
    """

    __slots__ = ("__weakref__", "_ball_a_at", "_ball_b_at", "_balls")

    def __init__(self, ball_a: np.ndarray | None, ball_b: np.ndarray):
        self._balls = ball_a, ball_b
        self._ball_a_at, self._ball_b_at = 0 if ball_a is None else address_of(ball_a), address_of(ball_b)

    def body_misses(self, X_WA, X_WB, direction_W, limit: float) -> bool:
        """Whether A, moved along the direction, stays clear of B; False of arrays that kernels do not read."""
        if not (is_array(X_WA, (4, 4)) and is_array(X_WB, (4, 4)) and is_array(direction_W, (3,))):
            return False
        return body_misses(
            self._ball_a_at, address_of(X_WA), self._ball_b_at, address_of(X_WB), address_of(direction_W), limit,
            _work.at,
        ) == 1

    def ray_misses(self, X_WB, origin_W, direction_W, limit: float) -> bool:
        """The same of a ray."""
        if not (is_array(X_WB, (4, 4)) and is_array(origin_W, (3,)) and is_array(direction_W, (3,))):
            return False
        at = address_of(X_WB), address_of(origin_W), address_of(direction_W)
        return ray_misses(self._ball_b_at, *at, limit, _work.at) == 1

    def single_contact(self, X_WA, X_WB, direction_W, limit: float) -> np.ndarray | None:
        """What A meets first: an empty row where the balls around the bodies tell that A meets nothing, else ``None``,
        for the caller to ask as of a batch."""
        return _NOTHING if self.body_misses(X_WA, X_WB, direction_W, limit) else None


class _Work(local):
    """Workspace of one thread."""

    def __init__(self) -> None:
        self.doubles = np.zeros(_WORK)
        self.at = address_of(self.doubles)


_work = _Work()
_NOTHING = np.empty(0)
_FLOAT64 = np.dtype(np.float64)


def is_array(X, shape: tuple[int, ...]) -> bool:
    """Whether X is laid out as kernels read a pose or a vector."""
    return X.__class__ is np.ndarray and X.dtype is _FLOAT64 and X.shape == shape and X.flags.carray
