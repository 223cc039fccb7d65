"""The exact stage: rows whose sign or last digits doubles leave open are settled in integers. No rounding decides
anything.

GJK with Johnson's subalgorithm (Gilbert, Johnson and Keerthi 1988) in integers: every quantity is a polynomial of the
doubles given (vertices, both poses, radii), exact in the integers of `numerics/digits.py`. The exact distance of the
simplex strictly decreases from round to round and the number of simplices is finite, so the search ends, and ends in a
decision. Doubles only propose: the first simplex, and the few vertices possibly extreme in a direction (all within an
error bound of the best vertex).

Degrees, with a coordinate of a difference point y = R_A a − R_B b − (p_WB − p_WA) of degree one: a Gram entry y_i·y_j
has two, Johnson's Δ has 0, 2, 4, 6 for 1 to 4 points, the direction Σ Δ_i y_i one more.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from collide.kernels import address_of, code_of, entry, native_call, view_i64, view_u8
from collide.lowering.shape_table import PoseTable, ShapeTable
from collide.narrowphase.exact import exact_depth, settle_halfspaces, settle_hulls
from collide.narrowphase.exact.settle_regions import settle_regions
from collide.narrowphase.rows import HOW, ROW
from collide.results import UNDECIDED

_settle_hulls_at = native_call(settle_hulls.SIGNATURE)
_settle_halfspaces_at = native_call(settle_halfspaces.SIGNATURE)
_exact_depth_at = native_call(exact_depth.SIGNATURE)
#: Addresses of the three in `settle_exactly`'s list.
_HULLS, _HALFSPACES, _DEPTH, _CODES = range(4)


#: How `settle_exactly` is called.
SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, boolean, float64, int64, int64, int64, int64,"
    " int64)"
)


@entry(SIGNATURE)
def settle_exactly(
    codes_at, ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, depths, limit, rows_at, terms_at,
    n_terms, requests_at, digits_at,
):
    """Settle the undecided rows of `answer_pairs`, in place; returns how many stay undecided.

    Steps, in this order, cheapest and most frequent first; a step sees the rows left open by the steps before:

    1. `settle_hulls`: two swept hulls. GJK in double-doubles with proven bounds (`filtered_gjk.py`), and in integers
       where a sign stays unproven, decides whether they share a point; integers then know the distance of disjoint
       cores to all digits, or double-doubles where rounding cannot tell (`face_height.py`). Depths below
       rounding come from the facets nearest the origin, as named by doubles (`depth_requests.py`, `plane_depth.py`).
    2. `settle_halfspaces`: a half-space against a convex set, the sign of a polynomial a vertex, or of a curved set's
       reach; two half-spaces with opposite normals (`opposite_halfspaces.py`); a curved set on a flat
       face of another set, the same sign for the face's plane (`settle_faces.py`). Only if step 1 met such a pair.
    3. `exact_depth`: overlaps settled by step 1 without a depth, where depths are wanted and hulls are small: the
       least extent over all candidate planes (`all_planes.py`).

    codes : addresses of the three.   Other arguments as of `settle_hulls`. The steps are called where they were
    compiled, so that they are compiled once.
    """
    codes = view_i64(codes_at, _CODES)
    depths = depths and not boolean
    n_remaining = _settle_hulls_at(
        codes[_HULLS],
        (
            ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, depths, limit, rows_at, terms_at,
            n_terms, requests_at, digits_at,
        ),
    )
    if n_remaining > 0:
        _settle_halfspaces_at(
            codes[_HALFSPACES],
            (
                ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, limit, rows_at, terms_at,
                n_terms, digits_at,
            ),
        )
    if depths:
        _exact_depth_at(
            codes[_DEPTH],
            (
                ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, limit, rows_at, terms_at, n_terms,
                digits_at,
            ),
        )
    n_open = 0
    for k in range(n_pairs):
        n_open += 1 if view_u8(rows_at + ROW * k, ROW)[HOW] == UNDECIDED else 0
    return n_open


@cache
def step_codes() -> np.ndarray:
    """What `settle_exactly` calls, once it is needed."""
    steps = settle_hulls.settle_hulls, settle_halfspaces.settle_halfspaces, exact_depth.exact_depth
    return np.array([code_of(step) for step in steps])


def settle_rows(
    rows: np.ndarray,
    pairs: np.ndarray,
    table: ShapeTable,
    poses: PoseTable,
    shape_of: np.ndarray,
    *,
    boolean: bool,
    depths: bool,
    limit: float,
    digits: np.ndarray,
    requests_at: int,
) -> None:
    """Settle in place the undecided rows of pairs of posed parts.

    `settle_exactly`, then `settle_regions`: a closed region, whose corners are rounded, against a swept hull, by its
    planes.

    What stays open: curved sets in other places (`exact_curved/`), shapes whose stored numbers are rounded, and
    magnitudes that span more than 1600 bits.

    Parameters
    ----------
    rows : PAIR_DTYPE, with the vertices to begin with.
    pairs : (k, 2) int64, parts: rows of ``poses`` and ``shape_of``, which says the part's row of ``table``.
    boolean : only signs are wanted.   depths : it is wanted how deep overlaps are.
    limit : larger distances are not [m].
    digits : int64 workspace of `settle_space.WORKSPACE`.   requests_at : address of what `answer_pairs` asks of depths.
    """
    if not (rows["how"] == UNDECIDED).any():
        return
    n_open = settle_exactly(
        address_of(step_codes()), *table.addresses, address_of(poses.rows), address_of(shape_of), address_of(pairs),
        len(rows), boolean, depths, limit, address_of(rows), address_of(poses.terms), len(poses.terms), requests_at,
        address_of(digits),
    )
    if n_open:
        settle_regions(rows, np.flatnonzero(rows["how"] == UNDECIDED), pairs, table, poses, shape_of)
