"""The workspace of the exact stage's entries, and brackets of what integers have found."""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.lowering.shape_table import TERM_ROW
from collide.narrowphase.bounds import EXACT_ERROR, SMALLEST_NORMAL, SUBNORMAL
from collide.narrowphase.exact.all_planes import DOUBLES as PLANES_DOUBLES
from collide.narrowphase.exact.exact_workspace import INTEGERS as _DIGITS
from collide.numerics import double_double as dd
from collide.numerics.error_free import two_sum

#: Behind the digits: integers for vertex pairs of a simplex and of a facet, and doubles for `all_planes.py`.
_SIMPLEX, _FACET = 16, 8
WORKSPACE = _DIGITS + _SIMPLEX + _FACET + PLANES_DOUBLES


class SettleSpace(NamedTuple):
    """terms : exact terms of poses (`PoseTable.terms`).   digits : workspace.   simplex, facet : vertex pairs.

    terms_at, digits_at, doubles_at : addresses of the first two, and of doubles for `all_planes.py`.
    """

    terms: Any
    digits: Any
    simplex: Any
    facet: Any
    terms_at: int
    digits_at: int
    doubles_at: int


@kernel(inline=True)
def settle_space(terms_at, n_terms, digits_at):
    """terms_at, n_terms : of the `PoseTable`.   digits_at : WORKSPACE integers."""
    ids_at = digits_at + 8 * _DIGITS
    return SettleSpace(
        view_f64(terms_at, TERM_ROW * n_terms), view_i64(digits_at, _DIGITS), view_i64(ids_at, _SIMPLEX),
        view_i64(ids_at + 8 * _SIMPLEX, _FACET), terms_at, digits_at, ids_at + 8 * (_SIMPLEX + _FACET),
    )


@kernel(inline=True)
def bracket_of_gap(excess):
    """The `dd.Bracket` of a distance [m] that is known to EXACT_ERROR; 0 is exact."""
    # Relative errors do not hold among subnormal doubles.
    slack = SUBNORMAL if 0.0 < abs(excess.high) < SMALLEST_NORMAL else 0.0
    return dd.bracket(excess, EXACT_ERROR * abs(excess.high) + slack)


@kernel(inline=True)
def bracket_of_depth(depth, radius_a, radius_b):
    """The `dd.Bracket` of the distance, negative, of bodies whose cores' depth [m] is known to EXACT_ERROR."""
    slack = SUBNORMAL if 0.0 < depth.high < SMALLEST_NORMAL else 0.0
    total = dd.add(depth, two_sum(radius_a, radius_b))
    return dd.bracket(dd.neg(total), EXACT_ERROR * total.high + slack)
