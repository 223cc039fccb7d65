"""Rows of the exact stage with a cylinder, cone or ellipsoid on a flat face of the other body."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.bounds import PROMISE_CURVED
from collide.narrowphase.exact.exact_gjk import TOUCHING, UNDONE
from collide.narrowphase.exact.flat_faces import contact_of_faces, has_flat_faces
from collide.narrowphase.exact.settle_space import bracket_of_gap
from collide.narrowphase.fallback_searches import lay_row_apart
from collide.narrowphase.rows import (
    DISTANCE,
    EXACT_ROUNDS,
    HIT,
    HOW,
    LOWER,
    NORMAL,
    UPPER,
    view_row,
    write_vectors,
    write_verdict,
)
from collide.numerics.vec3 import Vec3, add, neg, put_vec3, vec3_at
from collide.results import EXACT


@kernel(inline=True)
def settle_faces(ordered, space, row_at, boolean, limit):
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
