"""A step of the exact stage: rows of half-spaces, and of curved sets on flat faces, that doubles leave open."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_i64, view_u8
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.narrowphase.exact.exact_gjk import SEPARATE, TOUCHING, UNDONE
from collide.narrowphase.exact.exact_halfspace import reach_plane_exactly
from collide.narrowphase.exact.opposite_halfspaces import settle_opposite
from collide.narrowphase.exact.settle_faces import settle_faces
from collide.narrowphase.exact.settle_hulls import keep_proven_sign
from collide.narrowphase.exact.settle_space import bracket_of_gap, settle_space
from collide.narrowphase.halfspace_convex import reach_of_plane
from collide.narrowphase.posed_pair import ordered_pair
from collide.narrowphase.rows import EXACT_ROUNDS, HIT, HOW, LOWER, ROW, UPPER, view_row, write_verdict, write_vertices
from collide.results import EXACT, UNDECIDED

#: How `settle_halfspaces` is called.
SIGNATURE = "void(int64, int64, int64, int64, int64, int64, boolean, float64, int64, int64, int64, int64)"


@entry(SIGNATURE)
def settle_halfspaces(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, limit, rows_at, terms_at, n_terms, digits_at
):
    """Settle the undecided rows of half-spaces, and of curved sets by flat faces, in place.

    Arguments as in `settle_hulls`, and flat as there.
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    space = settle_space(terms_at, n_terms, digits_at)
    for k in range(n_pairs):
        row_at = rows_at + ROW * k
        if view_u8(row_at, ROW)[HOW] != UNDECIDED:
            continue
        ordered = ordered_pair(ints_at, numbers_at, poses_at, shape_of_at, pairs[2 * k], pairs[2 * k + 1])
        pair = ordered.pair
        if not ordered.exact_numbers:
            continue
        if pair.A.kind == HALFSPACE and pair.B.kind == HALFSPACE:
            settle_opposite(ordered, space, view_row(row_at))
        elif pair.A.kind == HALFSPACE:
            _settle(ordered, space, row_at, boolean, limit)
        elif pair.A.kind != POINTS or pair.B.kind != POINTS:
            settle_faces(ordered, space, row_at, boolean, limit)


@kernel(inline=True)
def _settle(ordered, space, row_at, boolean, limit):
    """Settle a row of a half-space and another convex set."""
    row = view_row(row_at)
    pair = ordered.pair
    _, skew = reach_of_plane(pair, pair.A)
    contact = reach_plane_exactly(ordered, space.terms, space.digits, skew)
    if contact.verdict == UNDONE:
        keep_proven_sign(row)
        return
    bracket = bracket_of_gap(contact.excess)
    upper = min(row.doubles[UPPER], bracket.upper)
    if contact.verdict == TOUCHING:
        upper = min(upper, 0.0)
    lower = max(row.doubles[LOWER], bracket.lower)
    write_verdict(row, bracket.nearest, lower, upper, EXACT, math.inf if boolean else 0.0, limit)
    if contact.verdict == SEPARATE:  # also where the gap is smaller than the smallest double
        row.flags[HIT] = 0
        row.flags[HOW] = EXACT
    space.simplex[0] = -1
    space.simplex[1] = contact.vertex
    write_vertices(row, space.simplex, 1, ordered.flip)
    row.flags[EXACT_ROUNDS] = 1
