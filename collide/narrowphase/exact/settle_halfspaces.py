"""Half-spaces against swept hulls whose sign or last digits doubles leave open, settled in integers.

An entry point of its own, compiled when a scene first has such a pair.
"""

from __future__ import annotations

import math

from collide.kernels import entry, view_f64, view_i32, view_i64, view_u8
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import INTS, LOWEST, TERM_ROW
from collide.narrowphase.bounds import ERROR, EXACT_ERROR, SMALLEST_NORMAL, SUBNORMAL
from collide.narrowphase.exact.exact_gjk import SEPARATE, TOUCHING, UNDONE
from collide.narrowphase.exact.exact_halfspace import reach_plane_exactly
from collide.narrowphase.exact.settle_hulls import DIGITS
from collide.narrowphase.halfspace_convex import reach_of_plane
from collide.narrowphase.posed_pair import ordered_pair, radius_of, reach_of
from collide.narrowphase.rows import EXACT_ROUNDS, HIT, HOW, LOWER, ROW, UPPER, write_verdict, write_vertices
from collide.numerics.double_double import bracket
from collide.results import EXACT, PLANE, SWEPT, UNDECIDED


@entry("int64(int64, int64, int64, int64, int64, int64, boolean, float64, int64, int64, int64, int64)")
def decide_planes(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, limit, rows_at, terms_at, n_terms, digits_at
):
    """Settle the undecided rows of half-spaces against hulls, in place; returns how many. Arguments as in `decide_pairs`."""
    pairs = view_i64(pairs_at, 2 * n_pairs)
    terms = view_f64(terms_at, TERM_ROW * n_terms)
    digits = view_i64(digits_at, DIGITS)
    ids = view_i64(digits_at + 8 * DIGITS, 2)
    settled = 0
    for k in range(n_pairs):
        row = view_f64(rows_at + ROW * k, 12)
        words = view_i32(rows_at + ROW * k, ROW // 4)
        marks = view_u8(rows_at + ROW * k, ROW)
        if marks[HOW] != UNDECIDED:
            continue
        pair, ints, flip, size, slop, known = ordered_pair(
            ints_at, numbers_at, poses_at, shape_of_at, pairs[2 * k], pairs[2 * k + 1]
        )
        if not known or pair.A.kind != HALFSPACE or pair.B.kind != POINTS:
            continue
        _, skew = reach_of_plane(pair.numbers, pair.A.params_at, pair.poses, pair.A.pose_at)
        verdict, vertex, excess, excess_low = reach_plane_exactly(
            pair, terms, digits, ints[INTS * pair.B.shape + LOWEST], reach_of(pair, pair.B), radius_of(pair, pair.B), size,
            (ERROR * size + slop) * skew,
        )  # fmt: skip
        lower = row[LOWER]
        upper = row[UPPER]
        if verdict == UNDONE:
            if lower > 0.0 or upper <= 0.0:
                marks[HOW] = PLANE if lower > 0.0 else SWEPT
            continue
        # Relative errors do not hold among subnormal doubles; 0 is exact.
        slack = SUBNORMAL if 0.0 < abs(excess) < SMALLEST_NORMAL else 0.0
        low, distance, high = bracket(excess, excess_low, EXACT_ERROR * abs(excess) + slack)
        upper = min(upper, high)
        if verdict == TOUCHING:
            upper = min(upper, 0.0)
        write_verdict(row, marks, distance, max(lower, low), upper, EXACT, math.inf if boolean else 0.0, limit)
        if verdict == SEPARATE:  # also where the gap is smaller than the smallest double
            marks[HIT] = 0
            marks[HOW] = EXACT
        ids[0] = -1
        ids[1] = vertex
        write_vertices(words, marks, ids, 1, flip)
        marks[EXACT_ROUNDS] = 1
        settled += 1
    return settled
