"""Rows left open by a search of the narrowphase, to be settled by the other two.

A boolean, a gap and a depth have a search each, and where curved shapes or rounded corners are within rounding of
touching, each search proves some signs left open by the others (integers settle the signs of polytopes). A proven sign
stays proven: an open row goes to the other two searches, so that `collide` and `distance`, signed or not, never
contradict each other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, native_call
from collide.narrowphase.pair_kernel import SIGNATURE
from collide.narrowphase.pose_batches import clear_rows
from collide.narrowphase.rows import (
    BEYOND,
    CERTIFIED,
    DISTANCE,
    HIT,
    HOW,
    LOWER,
    NORMAL,
    POINT_A,
    POINT_B,
    ROW,
    UPPER,
    copy_row,
    is_undecided,
    view_row,
)
from collide.numerics.vec3 import add, norm1, put_vec3, scale, sub, vec3_at

_answer_pairs_at = native_call(SIGNATURE)

#: The searches of `answer_pairs`, in the order in which they are run: for the sign, for a depth, and for a gap.
_SEARCHES = 3
_SIGN, _DEPTH, _GAP = range(_SEARCHES)


class Core(NamedTuple):
    """Addresses of `answer_pairs`, of the tables read and of the workspace: as the arguments of `answer_pairs`."""

    code: int
    ints_at: int
    numbers_at: int
    poses_at: int
    terms_at: int
    shape_of_at: int
    doubles_at: int
    integers_at: int


@entry(
    "void(int64, int64, int64, int64, int64, int64, int64, int64, boolean, boolean, float64, int64, int64, int64,"
    " int64)"
)
def settle_by_other_searches(
    code, ints_at, numbers_at, poses_at, terms_at, shape_of_at, pairs_at, n_pairs, boolean, depths, limit, rows_at,
    doubles_at, integers_at, result_at,
):
    """Settle in place the open rows among n rows of `answer_pairs`.

    code : address of `answer_pairs`.   boolean, depths : the search already run.   result : memory of ROW bytes.
    Other arguments as in `answer_pairs`.
    """
    core = Core(code, ints_at, numbers_at, poses_at, terms_at, shape_of_at, doubles_at, integers_at)
    for k in range(n_pairs):
        settle_row_by_other_searches(core, pairs_at + 16 * k, boolean, depths, limit, rows_at + ROW * k, result_at)


@kernel
def settle_row_by_other_searches(core, pair_at, boolean, depths, limit, row_at, result_at):
    """`settle_by_other_searches` of a single pair and its row."""
    already_run = _SIGN if boolean else _DEPTH if depths else _GAP
    for search in range(_SEARCHES):
        if search != already_run and is_undecided(view_row(row_at)):
            clear_rows(result_at, 1)
            _answer_pairs_at(
                core.code,
                (
                    core.ints_at, core.numbers_at, core.poses_at, core.terms_at, core.shape_of_at, pair_at, 1,
                    search == _SIGN, search == _DEPTH, False, limit, result_at, core.doubles_at, core.integers_at,
                ),
            )
            take_proven(row_at, result_at, search == _SIGN, limit)


@kernel
def take_proven(row_at, result_at, sign, limit):
    """Take over what another search has proven of an open row.   sign : the search was for the sign alone."""
    result = view_row(result_at)
    if is_undecided(result):
        return
    if sign or result.flags[HIT] != 0:
        _take_sign(view_row(row_at), result, limit)
    else:  # a gap, with all that is known of one
        copy_row(result_at, row_at)


@kernel
def _take_sign(row, result, limit):
    """Take over whether the bodies meet, and what follows for the bracket; the points stay about their middle."""
    doubles, flags = row.doubles, row.flags
    flags[HOW] = result.flags[HOW]
    flags[HIT] = result.flags[HIT]
    if result.flags[HIT] != 0:
        doubles[UPPER] = min(doubles[UPPER], 0.0)
    else:
        doubles[LOWER] = max(doubles[LOWER], result.doubles[LOWER])
        n = vec3_at(result.doubles, NORMAL)
        if norm1(n) > 0.0:  # that of the plane between them: an overlap's leaned, though it was no more than rounding
            put_vec3(doubles, NORMAL, n)
        doubles[UPPER] = max(doubles[UPPER], doubles[LOWER])
    beyond = doubles[LOWER] > limit
    flags[BEYOND] = 1 if beyond else 0
    if beyond:
        flags[CERTIFIED] = 1
        doubles[DISTANCE] = doubles[LOWER] + 0.0
        doubles[UPPER] = math.inf
    else:
        doubles[DISTANCE] = min(max(doubles[DISTANCE], doubles[LOWER]), doubles[UPPER]) + 0.0
    lay_row_apart(row)


@kernel
def lay_row_apart(row):
    """Lay the points of a row as far apart along its normal as it says; they stay about their middle."""
    doubles = row.doubles
    p_a, p_b = vec3_at(doubles, POINT_A), vec3_at(doubles, POINT_B)
    gap = scale(doubles[DISTANCE], vec3_at(doubles, NORMAL))
    missing = scale(0.5, sub(gap, sub(p_b, p_a)))
    put_vec3(doubles, POINT_A, sub(p_a, missing))
    put_vec3(doubles, POINT_B, add(p_b, missing))


def lay_points_apart(rows: np.ndarray, moved: np.ndarray) -> None:
    """Lay the points of rows whose distance was moved, by their numbers, as far apart along the normal, in place.

    They stay about their middle; how far they move is how much the distance did.
    """
    gap = rows["distance"][moved, None] * rows["normal"][moved]
    missing = 0.5 * (gap - (rows["point_b"][moved] - rows["point_a"][moved]))
    rows["point_a"][moved] -= missing
    rows["point_b"][moved] += missing
