"""A step of the exact stage: two half-spaces whose normals are opposite within rounding.

Only exactly opposite ones can miss each other: the slightest tilt lets them meet, however far away.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.exact.exact_halfspace import exact_half_space
from collide.narrowphase.rows import (
    CERTIFIED,
    DISTANCE,
    EXACT_ROUNDS,
    HIT,
    HOW,
    LOWER,
    UPPER,
    write_vectors,
)
from collide.numerics.exact_numbers import (
    are_worthless,
    begin_numbers,
    cross,
    inner,
    minor,
    plus,
    ratio,
    rounded,
    sign_of,
)
from collide.numerics.vec3 import Vec3, add, divide, scale
from collide.results import EXACT


@kernel
def settle_opposite(ordered, space, row):
    """Settle the row of an `OrderedPair` of half-spaces, in place; where their numbers have no room it is left open."""
    pair, digits = ordered.pair, space.digits
    begin_numbers(digits)
    A = exact_half_space(pair, pair.A, space.terms, digits)
    B = exact_half_space(pair, pair.B, space.terms, digits)
    across, along = cross(digits, A.n, B.n), inner(digits, A.n, B.n)
    is_tilted = sign_of(digits, across.x) != 0 or sign_of(digits, across.y) != 0 or sign_of(digits, across.z) != 0
    if are_worthless(digits):
        return
    row.flags[HIT] = 1
    if not is_tilted and sign_of(digits, along) < 0 and not _write_gap(A, B, along, digits, row, ordered.flip):
        return
    row.flags[HOW] = EXACT  # of others that meet, whose overlap has no end, the rest is as the kernel left it
    row.flags[CERTIFIED] = 1
    row.flags[EXACT_ROUNDS] = 1


@kernel
def _write_gap(A, B, along, digits, row, flip):
    """How far opposite half-spaces are apart; whether there was room.   along : A.n·B.n < 0."""
    square = inner(digits, A.n, A.n)
    # B.n = along/square A.n, so that B is {x : A.n·x ≥ B.offset·square/along}.
    gap = minor(digits, B.offset, square, A.offset, along)  # times `along`
    behind = plus(digits, inner(digits, A.n, A.p), A.offset, -1)
    length = math.sqrt(rounded(digits, square))
    distance = ratio(digits, gap, along) / length
    nhat = divide(Vec3(rounded(digits, A.n.x), rounded(digits, A.n.y), rounded(digits, A.n.z)), length)
    p = Vec3(
        ratio(digits, minor(digits, A.p.x, square, behind, A.n.x), square),
        ratio(digits, minor(digits, A.p.y, square, behind, A.n.y), square),
        ratio(digits, minor(digits, A.p.z, square, behind, A.n.z), square),
    )
    if are_worthless(digits):
        return False
    slack = 4.0 * 2.0**-53 * abs(distance)
    row.flags[HIT] = 1 if sign_of(digits, gap) >= 0 else 0
    row.doubles[DISTANCE] = distance
    row.doubles[LOWER] = distance - slack
    row.doubles[UPPER] = distance + slack
    write_vectors(row, nhat, p, add(p, scale(distance, nhat)), flip)
    return True
