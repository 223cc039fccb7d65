"""Boxes at their poses as the separating axis test sees them; spheres and capsules are boxes without width, swept by a
ball.
"""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.lowering.packed_convex import POINTS
from collide.lowering.shape_table import ADDRESS, COUNT, INTS, KIND, NUMBERS, PADDED, PARAMS, RADIUS, SLOP
from collide.numerics.vec3 import Vec3, column_at, cross, dot, norm1
from collide.transforms import LARGEST

_U = 2.0**-53


class PosedBox(NamedTuple):
    """Half sizes, axes in the world, and centre.   off : how far the axes are from a rotation, at most.

    radius : of the ball swept over the box [m].
    """

    radius: float
    half: Vec3
    x: Vec3
    y: Vec3
    z: Vec3
    p: Vec3
    off: float


@kernel(inline=True)
def _is_box(ints, numbers, shape):
    return ints[INTS * shape + KIND] == POINTS and numbers[NUMBERS * shape + PARAMS] > 0.0


@kernel(inline=True)
def _is_swept_segment(ints, numbers, shape):
    """Whether a shape is a ball swept along the z axis, as far up as down, or not at all."""
    at = INTS * shape
    n = ints[at + COUNT]
    if ints[at + KIND] != POINTS or n > 2 or not numbers[NUMBERS * shape + RADIUS] > 0.0:
        return False
    first, last = _core_point(ints, shape, 0), _core_point(ints, shape, n - 1)
    is_on_axis = first.x == 0.0 and first.y == 0.0 and last.x == 0.0 and last.y == 0.0
    return is_on_axis and first.z == -last.z and numbers[NUMBERS * shape + SLOP] == 0.0


@kernel(inline=True)
def _core_point(ints, shape, k):
    at = INTS * shape
    return column_at(view_f64(ints[at + ADDRESS], 3 * ints[at + PADDED]), ints[at + PADDED], k)


@kernel(inline=True)
def has_box_row(ints_at, numbers_at, sa, sb):
    """Whether `put_box_row` takes two rows of the `ShapeTable`: one is a box, the other a box, sphere or capsule."""
    n = max(sa, sb) + 1
    ints, numbers = view_i64(ints_at, INTS * n), view_f64(numbers_at, NUMBERS * n)
    if _is_box(ints, numbers, sa):
        return _is_box(ints, numbers, sb) or _is_swept_segment(ints, numbers, sb)
    return _is_box(ints, numbers, sb) and _is_swept_segment(ints, numbers, sa)


@kernel(inline=True)
def _half_of(ints, numbers, shape):
    """Half sizes of a box, or of the segment that a ball is swept along."""
    at = NUMBERS * shape + PARAMS
    if numbers[at] > 0.0:
        return Vec3(numbers[at], numbers[at + 1], numbers[at + 2])
    return Vec3(0.0, 0.0, abs(_core_point(ints, shape, 0).z))


@kernel(inline=True)
def box_at(ints, numbers, shape, X):
    """The `PosedBox` of a matrix; far off a rotation where the matrix is no pose."""
    x, y, z = Vec3(X[0], X[4], X[8]), Vec3(X[1], X[5], X[9]), Vec3(X[2], X[6], X[10])
    off = max(abs(dot(x, x) - 1.0), abs(dot(y, y) - 1.0), abs(dot(z, z) - 1.0))
    off = max(off, abs(dot(x, y)), abs(dot(y, z)), abs(dot(z, x)))
    p = Vec3(X[3], X[7], X[11])
    is_pose = X[12] == 0.0 and X[13] == 0.0 and X[14] == 0.0 and X[15] == 1.0 and dot(x, cross(y, z)) > 0.0
    if not (is_pose and norm1(p) <= LARGEST):
        off = 1.0
    return PosedBox(numbers[NUMBERS * shape + RADIUS], _half_of(ints, numbers, shape), x, y, z, p, off + 4.0 * _U)
