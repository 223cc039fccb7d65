"""The exact stage: rows whose sign or last digits doubles leave open are settled in integers. No rounding decides
anything.

GJK with Johnson's subalgorithm (Gilbert, Johnson and Keerthi 1988) in integers: every quantity is a
polynomial of the doubles given (vertices, both poses, radii), which `numerics/digits.py` holds exactly.
The exact distance of the simplex strictly decreases from round to round and there are finitely many
simplices, so it ends, and it ends in a decision. Doubles only propose: which simplex to begin with,
and which few vertices can be extreme in a direction (all within an error bound of the best one).

Degrees, with one coordinate of a difference point y = R_A a − R_B b − (p_WB − p_WA) as one: a Gram
entry y_i·y_j has two, Johnson's Δ has 0, 2, 4, 6 for 1 to 4 points, the direction Σ Δ_i y_i one more.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.lowering.shape_table import PoseTable, ShapeTable
from collide.narrowphase.exact.exact_depth import exact_depth
from collide.narrowphase.exact.opposite_halfspaces import settle_opposite_halfspaces
from collide.narrowphase.exact.settle_halfspaces import settle_halfspaces
from collide.narrowphase.exact.settle_hulls import settle_hulls
from collide.narrowphase.exact.settle_regions import settle_regions
from collide.results import EXACT, UNDECIDED


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

    What is asked, in this order, cheapest and most frequent first; a step sees what those before it have left open:

    1. `settle_hulls`: two swept hulls. GJK in integers says whether they share a point; the distance of cores that are
       apart is then known to all digits. Depths below rounding come from the facets nearest the origin that doubles
       have named (`depth_requests.py`, `plane_depth.py`).
    2. `settle_halfspaces`: a half-space against a swept hull, the sign of a polynomial a vertex. Only if 1 met such
       rows.
    3. `exact_depth`: overlaps that 1 has settled without a depth, where depths are wanted and hulls are small: the
       least extent over all planes there are (`all_planes.py`). After 1, which says that they are overlaps.
    4. `settle_opposite_halfspaces`: two half-spaces with opposite normals, in fractions.
    5. `settle_regions`: a closed region, whose corners are rounded, against a swept hull, by its planes.

    What stays open: curved cores, other shapes whose stored numbers are rounded, and magnitudes that span more than
    1600 bits.

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
    tables = *table.addresses, address_of(poses.rows), address_of(shape_of), address_of(pairs)
    terms, digits_at = (address_of(poses.terms), len(poses.terms)), address_of(digits)
    rows_at, n = address_of(rows), len(rows)
    n_halfspaces = settle_hulls(*tables, n, boolean, depths, limit, rows_at, *terms, requests_at, digits_at)
    if n_halfspaces:
        settle_halfspaces(*tables, n, boolean, limit, rows_at, *terms, digits_at)
    if depths and not boolean:
        shallow = (rows["how"] == EXACT) & rows["hit"] & ~rows["certified"]
        if shallow.any():
            exact_depth(*tables, address_of(shallow), n, limit, rows_at, *terms, digits_at)
    settle_opposite_halfspaces(rows, np.flatnonzero(rows["how"] == UNDECIDED), pairs, table, poses, shape_of)
    settle_regions(rows, np.flatnonzero(rows["how"] == UNDECIDED), pairs, table, poses, shape_of)
