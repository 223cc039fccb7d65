"""A pair of posed convex sets as the kernels of the narrowphase take it, the body of lower rank first.

Bodies are exchanged by the content of their shapes, and for equal shapes by the numbers of their
poses: whichever way a pair is asked, the same numbers are worked on, and the answer is flipped.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.shape_table import (
    ADDRESS,
    COARSE_AT,
    COUNT,
    INTS,
    KIND,
    NUMBERS,
    PADDED,
    PARAMS,
    POSE,
    POSE_SLOP,
    POSE_STRETCH,
    POSE_TERMS,
    RADIUS,
    RANK,
    REACH,
    SLOP,
    TREE,
)
from collide.numerics.vec3 import Vec3

#: A matrix is said to stretch by the root of this at least, 3e-151.
LEAST_SQUARE = 2.0**-1000


@kernel(inline=True)
def _exchange(ints, poses, sa, pa, sb, pb):
    """Whether to work on (B, A): by content of the shapes, then by the numbers of the poses."""
    rank_a = ints[INTS * sa + RANK]
    rank_b = ints[INTS * sb + RANK]
    if rank_a != rank_b:
        return rank_a > rank_b
    for k in range(12):
        if poses[POSE * pa + k] != poses[POSE * pb + k]:
            return poses[POSE * pa + k] > poses[POSE * pb + k]
    return False


@kernel(inline=True)
def in_order(ints, poses, sa, pa, sb, pb):
    """(shape of A, part A, shape of B, part B, exchanged): a half-space first, else as the module says."""
    flip = _exchange(ints, poses, sa, pa, sb, pb)
    if ints[INTS * sb + KIND] == HALFSPACE and ints[INTS * sa + KIND] != HALFSPACE:
        flip = True
    elif ints[INTS * sa + KIND] == HALFSPACE and ints[INTS * sb + KIND] != HALFSPACE:
        flip = False
    if flip:
        return sb, pb, sa, pa, True
    return sa, pa, sb, pb, False


@kernel(inline=True)
def size_and_slop(numbers, poses, sa, pa, sb, pb):
    """(S of `bounds.py`, distance bound between stored and described points, whether exact terms tell better).

    The last is True where the exact stage reads the described numbers: shapes stored as they are, and poses given or
    known as exact sums.
    """
    p = POSE * pa
    q = POSE * pb
    at_a = NUMBERS * sa
    at_b = NUMBERS * sb
    tx = poses[q + 9] - poses[p + 9]
    ty = poses[q + 10] - poses[p + 10]
    tz = poses[q + 11] - poses[p + 11]
    size = numbers[at_a + REACH] * _stretch(poses, p) + numbers[at_b + REACH] * _stretch(poses, q)
    # The largest coordinate too: squares of tiny ones vanish, and such a pair must be refused, not 0.
    size += (
        max(math.sqrt(tx * tx + ty * ty + tz * tz), abs(tx), abs(ty), abs(tz))
        + numbers[at_a + RADIUS]
        + numbers[at_b + RADIUS]
    )
    shapes = numbers[at_a + SLOP] + numbers[at_b + SLOP]
    known = (poses[p + POSE_SLOP] == 0.0 or poses[p + POSE_TERMS] >= 0.0) and (
        poses[q + POSE_SLOP] == 0.0 or poses[q + POSE_TERMS] >= 0.0
    )
    return size, shapes + poses[p + POSE_SLOP] + poses[q + POSE_SLOP], known and shapes == 0.0


class Tables(NamedTuple):
    """Addresses of a `ShapeTable`'s integers and numbers, of the rows of a `PoseTable`, and of the shape row of each
    part."""

    ints_at: int
    numbers_at: int
    poses_at: int
    shape_of_at: int


class PosedBody(NamedTuple):
    """One body of a pair.

    coords : view of its points, all x, then all y, then all z.   n : points.
    padded : length of each of the three runs.
    kind : of `packed_convex.py`.   shape : its row of the `ShapeTable`.
    params_at : its parameters in the table's numbers.
    pose_at : where its row of the poses begins.
    tree, coarse_at : addresses of its support tree and coarse points, or 0.
    """

    coords: Any
    n: int
    padded: int
    kind: int
    shape: int
    params_at: int
    pose_at: int
    tree: int
    coarse_at: int


class PosedPair(NamedTuple):
    """Two posed convex sets, in the order worked on.   numbers, poses : views of both tables.   t : p_WB − p_WA."""

    A: PosedBody
    B: PosedBody
    numbers: Any
    poses: Any
    t: Vec3


class OrderedPair(NamedTuple):
    """A pair with what the tables say of it.

    ints : view of the `ShapeTable`.   flip : whether A and B were exchanged.
    size, slop, exact_numbers : of `size_and_slop`.
    """

    pair: PosedPair
    ints: Any
    flip: bool
    size: float
    slop: float
    exact_numbers: bool


@kernel(inline=True)
def posed_body(ints, shape, part):
    """The `PosedBody` of a row of the `ShapeTable` at the pose of a part."""
    at = INTS * shape
    return PosedBody(
        view_f64(ints[at + ADDRESS], 3 * ints[at + PADDED]), ints[at + COUNT], ints[at + PADDED], ints[at + KIND],
        shape, NUMBERS * shape + PARAMS, POSE * part,
        ints[at + TREE], ints[at + COARSE_AT],
    )


@kernel(inline=True)
def posed_pair(ints, numbers, poses, sa, pa, sb, pb):
    """The `PosedPair` of shapes sa and sb at the poses of parts pa and pb."""
    p = POSE * pa
    q = POSE * pb
    t = Vec3(poses[q + 9] - poses[p + 9], poses[q + 10] - poses[p + 10], poses[q + 11] - poses[p + 11])
    return PosedPair(posed_body(ints, sa, pa), posed_body(ints, sb, pb), numbers, poses, t)


@kernel(inline=True)
def ordered_pair(ints_at, numbers_at, poses_at, shape_of_at, pa, pb):
    """The `OrderedPair` of two parts, by their numbers. Addresses as in `answer_pairs`."""
    shape_of = view_i64(shape_of_at, max(pa, pb) + 1)
    sa = shape_of[pa]
    sb = shape_of[pb]
    ints = view_i64(ints_at, INTS * (max(sa, sb) + 1))
    numbers = view_f64(numbers_at, NUMBERS * (max(sa, sb) + 1))
    poses = view_f64(poses_at, POSE * (max(pa, pb) + 1))
    sa, pa, sb, pb, flip = in_order(ints, poses, sa, pa, sb, pb)
    pair = posed_pair(ints, numbers, poses, sa, pa, sb, pb)
    size, slop, exact_numbers = size_and_slop(numbers, poses, sa, pa, sb, pb)
    return OrderedPair(pair, ints, flip, size, slop, exact_numbers)


@kernel(inline=True)
def radius_of(pair, body):
    """By how much a body's core is swept."""
    return pair.numbers[NUMBERS * body.shape + RADIUS]


@kernel(inline=True)
def reach_of(pair, body):
    """Greatest distance of a point of a body's core from its frame's origin."""
    return pair.numbers[NUMBERS * body.shape + REACH]


@kernel(inline=True)
def reach_of_both(pair):
    """How far from 0 a point of A ⊖ B + t can be: both balls about the frames' origins, stretched as R does.

    Of a pair whose size is known (`size_and_slop`).
    """
    at_a, at_b = NUMBERS * pair.A.shape, NUMBERS * pair.B.shape
    return sum_of_reaches(pair.numbers, at_a, at_b, pair.poses, pair.A.pose_at, pair.B.pose_at)


@kernel(inline=True)
def sum_of_reaches(numbers, at_a, at_b, poses, p, q):
    """The same by where both shapes' numbers and both poses begin."""
    return numbers[at_a + REACH] * poses[p + POSE_STRETCH] + numbers[at_b + REACH] * poses[q + POSE_STRETCH]


@kernel(inline=True)
def _stretch(R, p):
    """No vector gets longer by more than this factor; worked out once a pose."""
    if R[p + POSE_STRETCH] < 0.0:
        R[p + POSE_STRETCH] = stretch_of_pose(R, p)
    return R[p + POSE_STRETCH]


@kernel(inline=True)
def stretch_of(xx, yy, zz, xy, yz, zx):
    """A bound of |R| from the entries of RᵀR: its square is at most the largest row sum of |RᵀR|.

    The square of a tiny one vanishes: a bound of 0 would make pairs of size 0 of what must be refused as too small.
    """
    xy = abs(xy)
    yz = abs(yz)
    zx = abs(zx)
    return math.sqrt(max(xx + xy + zx, yy + xy + yz, zz + yz + zx, LEAST_SQUARE))


@kernel(inline=True)
def stretch_of_pose(R, p):
    """`stretch_of` the matrix at p of a row of poses, without writing to the row: other threads may read the row."""
    return stretch_of(
        R[p] * R[p] + R[p + 3] * R[p + 3] + R[p + 6] * R[p + 6],
        R[p + 1] * R[p + 1] + R[p + 4] * R[p + 4] + R[p + 7] * R[p + 7],
        R[p + 2] * R[p + 2] + R[p + 5] * R[p + 5] + R[p + 8] * R[p + 8],
        R[p] * R[p + 1] + R[p + 3] * R[p + 4] + R[p + 6] * R[p + 7],
        R[p + 1] * R[p + 2] + R[p + 4] * R[p + 5] + R[p + 7] * R[p + 8],
        R[p + 2] * R[p] + R[p + 5] * R[p + 3] + R[p + 8] * R[p + 6],
    )
