"""Rows that one search of the narrowphase leaves open, and another one may settle.

A boolean, a gap and a depth are searched for differently, and where curved shapes or rounded corners are within
rounding of touching, each proves some signs that the others do not (integers settle those of polytopes). What is proven
is proven: an open row asks the other two searches, so that `collide` and `distance`, signed or not, never contradict
each other.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import address_of, entry, kernel, view_i64
from collide.narrowphase.pair_kernel import answer_pairs
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
    is_undecided,
    view_row,
)
from collide.numerics.vec3 import add, norm1, put_vec3, scale, sub, vec3_at
from collide.results import PAIR_DTYPE, UNDECIDED

#: (boolean, depths) of `answer_pairs`: the search for the sign, for a depth, and for a gap.
_SIGN, _DEPTH, _GAP = (True, False), (False, True), (False, False)


def settle_by_other_searches(
    rows: np.ndarray, pairs: np.ndarray, tables: tuple[int, int, int, int, int], workspace: tuple[int, int], *,
    boolean: bool,
    depths: bool, limit: float,
) -> None:
    """Settle in place what is still open; arguments as of `run_pairs`.

    tables : addresses of the shapes' integers and numbers, the poses' rows and terms, and which shape a part is.
    workspace : addresses of doubles and integers.
    """
    already_run = (boolean, depths and not boolean)
    for search in (_SIGN, _DEPTH, _GAP):  # `single_call.py` keeps this order
        open_rows = np.flatnonzero(rows["how"] == UNDECIDED)
        n = len(open_rows)
        if search == already_run or n == 0:
            continue
        results, asked = np.zeros(n, dtype=PAIR_DTYPE), np.ascontiguousarray(pairs[open_rows])
        answer_pairs(*tables, address_of(asked), n, *search, False, limit, address_of(results), *workspace)
        take_proven(address_of(rows), address_of(open_rows), address_of(results), n, search == _SIGN, limit)


@entry("int64(int64, int64, int64, int64, boolean, float64)")
def take_proven(rows_at, open_at, results_at, n, sign, limit):
    """Take over what another search has proven of n open rows; returns how many it has.

    open : int64, the numbers of the open rows.   results : rows of `answer_pairs`.
    sign : the search was for the sign alone.
    """
    open_rows = view_i64(open_at, n)
    n_proven = 0
    for k in range(n):
        if take_proven_row(rows_at + ROW * open_rows[k], results_at + ROW * k, sign, limit):
            n_proven += 1
    return n_proven


@kernel
def take_proven_row(row_at, result_at, sign, limit):
    """The same of one row; false where the search has proven nothing."""
    result = view_row(result_at)
    if is_undecided(result):
        return False
    if sign or result.flags[HIT] != 0:
        _take_sign(view_row(row_at), result, limit)
    else:  # a gap, with all that is known of one
        source, target = view_i64(result_at, ROW // 8), view_i64(row_at, ROW // 8)
        for i in range(ROW // 8):
            target[i] = source[i]
    return True


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
