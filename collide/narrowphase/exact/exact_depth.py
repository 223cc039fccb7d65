"""Depths that no closed surface and no level planes have told, from all planes of small hulls.

An entry point of its own: one overlap in thousands needs it, and it takes seconds to compile.
"""

from __future__ import annotations

from collide.kernels import entry, view_f64, view_i64, view_u8
from collide.lowering.packed_convex import POINTS
from collide.lowering.shape_table import INTS, LOWEST, TERM_ROW
from collide.narrowphase.bounds import ERROR, EXACT_ERROR, SMALLEST_NORMAL, SUBNORMAL
from collide.narrowphase.exact.all_planes import depth_by_all_planes
from collide.narrowphase.exact.settle_hulls import DIGITS, set_normal
from collide.narrowphase.posed_pair import ordered_pair, radius_of, reach_of
from collide.narrowphase.rows import LOWER, ROW, UPPER, write_verdict
from collide.numerics.double_double import add, bracket
from collide.numerics.error_free import two_sum
from collide.results import EXACT


@entry("int64(int64, int64, int64, int64, int64, int64, int64, float64, int64, int64, int64, int64)")
def deepen_pairs(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, open_at, n_pairs, limit, rows_at, terms_at, n_terms, digits_at
):
    """Find the depths of overlaps that `decide_pairs` has settled without; returns how many it found.

    open : a byte a pair, whether its depth is wanted.   Other arguments as there. Rows are left as they are where the
    hulls are too large (`exact/all_planes.py`).
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    wanted = view_u8(open_at, n_pairs)
    terms = view_f64(terms_at, TERM_ROW * n_terms)
    digits = view_i64(digits_at, DIGITS)
    corners = view_i64(digits_at + 8 * (DIGITS + 16), 8)
    found = 0
    for k in range(n_pairs):
        if wanted[k] == 0:
            continue
        row = view_f64(rows_at + ROW * k, 12)
        marks = view_u8(rows_at + ROW * k, ROW)
        pair, ints, flip, size, slop, _ = ordered_pair(
            ints_at, numbers_at, poses_at, shape_of_at, pairs[2 * k], pairs[2 * k + 1]
        )
        if pair.A.kind != POINTS or pair.B.kind != POINTS:
            continue
        proven, depth, depth_low, vx, vy, vz = depth_by_all_planes(
            pair, terms, terms_at, digits, digits_at + 8 * (DIGITS + 24), corners, ints[INTS * pair.A.shape + LOWEST],
            ints[INTS * pair.B.shape + LOWEST], reach_of(pair, pair.A), reach_of(pair, pair.B), size, ERROR * size + slop,
        )  # fmt: skip
        if not proven:
            continue
        radius_a = radius_of(pair, pair.A)
        radius_b = radius_of(pair, pair.B)
        # Relative errors do not hold among subnormal doubles.
        slack = SUBNORMAL if 0.0 < depth < SMALLEST_NORMAL else 0.0
        swept, swept_low = two_sum(radius_a, radius_b)
        total, total_low = add(depth, depth_low, swept, swept_low)
        low, distance, high = bracket(-total, -total_low, EXACT_ERROR * total + slack)
        set_normal(
            row, pair, terms_at, corners, 3, digits_at, radius_a, radius_b, size, -vx, -vy, -vz, distance, flip
        )
        write_verdict(row, marks, distance, max(row[LOWER], low), min(row[UPPER], high), EXACT, 0.0, limit)
        found += 1
    return found
