"""Rows that one search of the narrowphase leaves open, and another one may settle.

A boolean, a gap and a depth are searched for differently, and where curved shapes or rounded corners are within rounding of
touching, each proves some signs that the others do not (integers settle those of polytopes). What is proven is proven: an
open row asks the other two searches, so that `collide` and `distance`, signed or not, never contradict each other.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64, view_u8
from collide.narrowphase.convex_pairs import answer_pairs
from collide.narrowphase.rows import BEYOND, CERTIFIED, DISTANCE, HIT, HOW, LOWER, NORMAL, POINT_A, POINT_B, ROW, UPPER
from collide.results import PAIR_DTYPE, UNDECIDED

#: (boolean, depths) of `answer_pairs`: the search for the sign, for a depth, and for a gap.
_SIGN, _DEPTH, _GAP = (True, False), (False, True), (False, False)


def settle_by_other_searches(
    rows: np.ndarray, pairs: np.ndarray, tables: tuple[int, int, int, int, int], workspace: tuple[int, int], *, boolean: bool,
    depths: bool, limit: float,
) -> None:  # fmt: skip
    """Settle in place what is still open; arguments as of `run_pairs`.

    tables : addresses of the shapes' integers and numbers, the poses' rows and terms, and which shape a part is.
    workspace : addresses of doubles and integers.
    """
    own = (boolean, depths and not boolean)
    for search in (_SIGN, _DEPTH, _GAP):
        left = np.flatnonzero(rows["how"] == UNDECIDED)
        if search == own or not len(left):
            continue
        told, asked = np.zeros(len(left), dtype=PAIR_DTYPE), np.ascontiguousarray(pairs[left])
        answer_pairs(*tables, address_of(asked), len(asked), *search, False, limit, address_of(told), *workspace)
        take_told(address_of(rows), address_of(left), address_of(told), len(left), search == _SIGN, limit)


@entry("int64(int64, int64, int64, int64, boolean, float64)")
def take_told(rows_at, left_at, told_at, n, sign, limit):
    """Take over what another search has proven of n open rows; returns how many it has.

    left : int64, the numbers of the rows.   told : rows of `answer_pairs`.   sign : the search was for the sign alone.
    """
    left = view_i64(left_at, n)
    proven = 0
    for k in range(n):
        told = view_i64(told_at + ROW * k, ROW // 8)
        marks = view_u8(told_at + ROW * k, ROW)
        if marks[HOW] == UNDECIDED:
            continue
        proven += 1
        row_at = rows_at + ROW * left[k]
        if sign or marks[HIT] != 0:
            _take_sign(view_f64(row_at, 12), view_u8(row_at, ROW), view_f64(told_at + ROW * k, 12), marks, limit)
        else:  # a gap, with all that is known of one
            row = view_i64(row_at, ROW // 8)
            for i in range(ROW // 8):
                row[i] = told[i]
    return proven


@kernel
def _take_sign(row, marks, told, told_marks, limit):
    """Take over whether the bodies meet, and what follows for the bracket; the points stay about their middle."""
    hit = told_marks[HIT] != 0
    marks[HOW] = told_marks[HOW]
    marks[HIT] = told_marks[HIT]
    if hit:
        row[UPPER] = min(row[UPPER], 0.0)
    else:
        row[LOWER] = max(row[LOWER], told[LOWER])
        row[UPPER] = max(row[UPPER], row[LOWER])
    beyond = row[LOWER] > limit
    marks[BEYOND] = 1 if beyond else 0
    if beyond:
        marks[CERTIFIED] = 1
        row[DISTANCE] = row[LOWER] + 0.0
        row[UPPER] = math.inf
    else:
        row[DISTANCE] = min(max(row[DISTANCE], row[LOWER]), row[UPPER]) + 0.0
    for axis in range(3):
        gap = row[DISTANCE] * row[NORMAL + axis]
        missing = 0.5 * (gap - (row[POINT_B + axis] - row[POINT_A + axis]))
        row[POINT_A + axis] -= missing
        row[POINT_B + axis] += missing


def lay_points_apart(rows: np.ndarray, moved: np.ndarray) -> None:
    """Lay the points of rows whose distance was moved, by their numbers, as far apart along the normal, in place.

    They stay about their middle; how far they move is how much the distance did.
    """
    gap = rows["distance"][moved, None] * rows["normal"][moved]
    missing = 0.5 * (gap - (rows["point_b"][moved] - rows["point_a"][moved]))
    rows["point_a"][moved] -= missing
    rows["point_b"][moved] += missing
