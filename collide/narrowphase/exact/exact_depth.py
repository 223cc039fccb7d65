"""A step of the exact stage: depths of overlaps of small hulls that neither a closed surface nor nearest facets have
given."""

from __future__ import annotations

from collide.kernels import entry, kernel, view_i64, view_u8
from collide.lowering.packed_convex import POINTS
from collide.narrowphase.exact.all_planes import depth_by_all_planes
from collide.narrowphase.exact.settle_space import bracket_of_depth, settle_space
from collide.narrowphase.exact.witness_points import put_normal_and_points
from collide.narrowphase.posed_pair import ordered_pair, radius_of
from collide.narrowphase.rows import CERTIFIED, HIT, HOW, LOWER, ROW, UPPER, view_row, write_verdict
from collide.numerics.vec3 import neg
from collide.results import EXACT

#: How `exact_depth` is called.
SIGNATURE = "void(int64, int64, int64, int64, int64, int64, float64, int64, int64, int64, int64)"


@entry(SIGNATURE)
def exact_depth(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, limit, rows_at, terms_at, n_terms, digits_at
):
    """Find the depths of overlaps settled by `settle_hulls` without a depth.

    Arguments as in `settle_hulls`, flat for the same reason. Rows are left unchanged where the hulls are too large
    (`all_planes.py`).
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    space = settle_space(terms_at, n_terms, digits_at)
    for k in range(n_pairs):
        flags = view_u8(rows_at + ROW * k, ROW)
        if flags[HOW] != EXACT or flags[HIT] == 0 or flags[CERTIFIED] != 0:
            continue
        ordered = ordered_pair(ints_at, numbers_at, poses_at, shape_of_at, pairs[2 * k], pairs[2 * k + 1])
        if ordered.pair.A.kind == POINTS and ordered.pair.B.kind == POINTS:
            _write_depth(ordered, space, rows_at + ROW * k, limit)


@kernel(inline=True)
def _write_depth(ordered, space, row_at, limit):
    """Write the depth of a row, if it is found."""
    row = view_row(row_at)
    plane = depth_by_all_planes(ordered, space.terms, space.terms_at, space.digits, space.doubles_at, space.facet)
    if not plane.proven:
        return
    bracket = bracket_of_depth(
        plane.depth, radius_of(ordered.pair, ordered.pair.A), radius_of(ordered.pair, ordered.pair.B)
    )
    v = neg(plane.nhat)
    put_normal_and_points(row, ordered, space.terms_at, space.facet, 3, space.digits_at, v, bracket.nearest)
    lower, upper = max(row.doubles[LOWER], bracket.lower), min(row.doubles[UPPER], bracket.upper)
    write_verdict(row, bracket.nearest, lower, upper, EXACT, 0.0, limit)
