"""A step of the exact stage: rows with a cylinder, cone or ellipsoid that rest on a flat face of the other body."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_i64, view_u8
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.narrowphase.bounds import PROMISE_CURVED
from collide.narrowphase.exact.exact_gjk import TOUCHING, UNDONE
from collide.narrowphase.exact.flat_faces import contact_of_faces, has_flat_faces
from collide.narrowphase.exact.settle_space import bracket_of_gap, settle_space
from collide.narrowphase.fallback_searches import lay_row_apart
from collide.narrowphase.posed_pair import ordered_pair
from collide.narrowphase.rows import (
    DISTANCE,
    EXACT_ROUNDS,
    HIT,
    HOW,
    LOWER,
    NORMAL,
    ROW,
    UPPER,
    view_row,
    write_vectors,
    write_verdict,
)
from collide.numerics.vec3 import Vec3, add, neg, put_vec3, vec3_at
from collide.results import EXACT, UNDECIDED

#: How `settle_faces` is called.
SIGNATURE = "void(int64, int64, int64, int64, int64, int64, boolean, float64, int64, int64, int64, int64)"


@entry(SIGNATURE)
def settle_faces(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, limit, rows_at, terms_at, n_terms, digits_at
):
    """Settle the undecided rows of curved sets apart from the plane of a flat face, or touching the face, in place.

    Arguments as in `settle_hulls`, and flat as there.
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    space = settle_space(terms_at, n_terms, digits_at)
    for k in range(n_pairs):
        row_at = rows_at + ROW * k
        if view_u8(row_at, ROW)[HOW] != UNDECIDED:
            continue
        ordered = ordered_pair(ints_at, numbers_at, poses_at, shape_of_at, pairs[2 * k], pairs[2 * k + 1])
        A, B = ordered.pair.A, ordered.pair.B
        is_curved = A.kind != HALFSPACE and (A.kind != POINTS or B.kind != POINTS)
        if ordered.exact_numbers and is_curved:
            _settle(ordered, space, row_at, boolean, limit)


@kernel(inline=True)
def _settle(ordered, space, row_at, boolean, limit):
    """Settle a row by the faces of A, else by those of B."""
    pair = ordered.pair
    zero = Vec3(0.0, 0.0, 0.0)
    is_settled = False
    if has_flat_faces(pair, pair.A):
        contact = contact_of_faces(pair, pair.A, pair.B, zero, pair.t, ordered.size, space.terms, space.digits)
        is_settled = contact.verdict != UNDONE
        if is_settled:
            _write(ordered, contact, contact.nhat, row_at, boolean, limit)
    if not is_settled and has_flat_faces(pair, pair.B):
        contact = contact_of_faces(pair, pair.B, pair.A, pair.t, zero, ordered.size, space.terms, space.digits)
        if contact.verdict != UNDONE:
            _write(ordered, contact, neg(contact.nhat), row_at, boolean, limit)


@kernel
def _write(ordered, contact, nhat, row_at, boolean, limit):
    """Write what a face tells; nhat : from A to B, as worked on."""
    row = view_row(row_at)
    bracket = bracket_of_gap(contact.excess)
    if contact.is_distance:
        upper = min(bracket.upper, 0.0) if contact.verdict == TOUCHING else bracket.upper
        write_verdict(row, bracket.nearest, bracket.lower, upper, EXACT, math.inf if boolean else 0.0, limit)
        p = add(contact.point, vec3_at(ordered.pair.poses, ordered.pair.A.pose_at + 9))
        write_vectors(row, nhat, p, p, ordered.flip)
        if not boolean:
            lay_row_apart(row)
    else:
        lower = max(row.doubles[LOWER], bracket.lower)
        upper = max(row.doubles[UPPER], lower)
        width = math.inf if boolean else PROMISE_CURVED * ordered.size
        write_verdict(row, max(row.doubles[DISTANCE], lower), lower, upper, EXACT, width, limit)
        put_vec3(row.doubles, NORMAL, neg(nhat) if ordered.flip else nhat)
        if not boolean:
            lay_row_apart(row)
    if contact.verdict != TOUCHING:  # also where the gap is smaller than the smallest double
        row.flags[HIT] = 0
        row.flags[HOW] = EXACT
    row.flags[EXACT_ROUNDS] = 1
