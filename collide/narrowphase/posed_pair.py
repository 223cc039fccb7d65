"""A pair of posed convex sets as the methods take it: one tuple, the body of lower rank first.

Bodies are exchanged by the content of their shapes, and for equal shapes by the numbers of their
poses: whichever way a pair is asked, the same numbers are worked on, and the answer is flipped.
"""

from __future__ import annotations

import math

from collide._jit import kernel
from collide.geometry.packing import HALFSPACE
from collide.geometry.tables import (
    ADDRESS,
    COUNT,
    INTS,
    KIND,
    NUMBERS,
    PADDED,
    PARAMS,
    POSE,
    POSE_SLOP,
    POSE_TERMS,
    RADIUS,
    RANK,
    REACH,
    SLOP,
    TREE,
)


@kernel(inline=True)
def _longest_row(poses, p):
    longest = 0.0
    for k in range(3):
        x = poses[p + 3 * k]
        y = poses[p + 3 * k + 1]
        z = poses[p + 3 * k + 2]
        longest = max(longest, x * x + y * y + z * z)
    return math.sqrt(longest)


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
    """(S of `bounds.py`, how far stored points may be from those described, whether exact terms tell better).

    The last one says that the numbers the exact stage reads are those described: shapes stored as they
    are, and poses given or known as exact sums.
    """
    p = POSE * pa
    q = POSE * pb
    at_a = NUMBERS * sa
    at_b = NUMBERS * sb
    tx = poses[q + 9] - poses[p + 9]
    ty = poses[q + 10] - poses[p + 10]
    tz = poses[q + 11] - poses[p + 11]
    size = numbers[at_a + REACH] * _longest_row(poses, p) + numbers[at_b + REACH] * _longest_row(poses, q)
    # The largest coordinate too: squares of tiny ones vanish, and such a pair must be refused, not 0.
    size += max(math.sqrt(tx * tx + ty * ty + tz * tz), abs(tx), abs(ty), abs(tz)) + numbers[at_a + RADIUS] + numbers[at_b + RADIUS]
    shapes = numbers[at_a + SLOP] + numbers[at_b + SLOP]
    known = (poses[p + POSE_SLOP] == 0.0 or poses[p + POSE_TERMS] >= 0.0) and (
        poses[q + POSE_SLOP] == 0.0 or poses[q + POSE_TERMS] >= 0.0
    )
    return size, shapes + poses[p + POSE_SLOP] + poses[q + POSE_SLOP], known and shapes == 0.0


@kernel(inline=True)
def posed_pair(ints, numbers, poses, coords_a, coords_b, sa, pa, sb, pb):
    """(coordinates, n, m, kind, row of numbers, pose row) of A, the same of B, numbers, poses, p_WB − p_WA,
    support trees of A and B (addresses, or 0)."""
    p = POSE * pa
    q = POSE * pb
    return (
        coords_a, ints[INTS * sa + COUNT], ints[INTS * sa + PADDED], ints[INTS * sa + KIND], NUMBERS * sa + PARAMS, p,
        coords_b, ints[INTS * sb + COUNT], ints[INTS * sb + PADDED], ints[INTS * sb + KIND], NUMBERS * sb + PARAMS, q,
        numbers, poses,
        poses[q + 9] - poses[p + 9], poses[q + 10] - poses[p + 10], poses[q + 11] - poses[p + 11],
        ints[INTS * sa + TREE], ints[INTS * sb + TREE],
    )  # fmt: skip


@kernel(inline=True)
def coordinates_of(ints, s):
    """Address and length of a shape's coordinates."""
    return ints[INTS * s + ADDRESS], 3 * ints[INTS * s + PADDED]
