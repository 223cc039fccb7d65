"""The narrowphase over a list of pairs of convex sets: dispatch, bracket, witness points, a row per pair.

A single entry for booleans, distances and batches, because every further entry compiles the whole narrowphase again.
The half of the pair matrix below the diagonal is answered by exchanging the bodies and flipping the row.

Each kind of pair is answered in the file of its name: `halfspace_halfspace.py`, `halfspace_convex.py`,
`sphere_sphere.py`, `sphere_capsule.py`, `capsule_capsule.py`, `convex_convex.py`; pairs of small hulls go through
`gjk/mpr_batch.py` first, booleans of a box and a sphere through `box_sphere.py`.
"""

from __future__ import annotations

from collide.kernels import entry, kernel, view_i64, view_u8
from collide.kernels.lanes import LANES
from collide.narrowphase.box_sphere import decide_box_sphere, is_box_and_sphere
from collide.narrowphase.convex_convex import convex_convex
from collide.narrowphase.gap.gap_queue import KINDS, clear_queue, refine_queued
from collide.narrowphase.gjk.mpr_batch import answer_small_hulls
from collide.narrowphase.halfspace_convex import halfspace_convex
from collide.narrowphase.halfspace_halfspace import halfspace_halfspace
from collide.narrowphase.kernel_dispatch import HALFSPACE_CONVEX, HALFSPACES, method
from collide.narrowphase.pair_workspace import DOUBLES, INTEGERS, REQUESTS_AT, Query, workspace_at
from collide.narrowphase.posed_pair import Tables, ordered_pair
from collide.narrowphase.rows import COUNT, HIT, HOW, ROW, VERTICES_A, VERTICES_B, clear_vertices, view_row
from collide.results import REFUSED, UNDECIDED
from collide.transforms import SMALLEST

__all__ = ["DOUBLES", "INTEGERS", "REQUESTS_AT", "SIGNATURE", "answer_pairs"]

#: How `answer_pairs` is called.
SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, boolean, boolean, float64, int64, int64, int64)"
)


@entry(SIGNATURE)
def answer_pairs(
    ints_at, numbers_at, poses_at, terms_at, shape_of_at, pairs_at, n_pairs, boolean, depths, stop_at_hit, limit,
    rows_at, doubles_at, integers_at,
):
    """Answer pairs of posed convex sets, a row each; returns the number of pairs answered.

    ints, numbers : a `ShapeTable`.   poses : POSE doubles a part.   terms : of a `PoseTable`.
    shape_of : a shape row a part.
    pairs : two part numbers a pair.
    boolean : only hit and how are wanted; a decided row has little else but the normal of a miss. A
        normal given in the row is the axis to try first.
    stop_at_hit : stop after the first hit; where rows are wanted, begin with the normal and the vertices named in the
        rows, from the same pairs at poses before.   limit : gaps larger than this [m] are not measured.
    rows : PAIR_DTYPE, otherwise zeroed.   doubles, integers : workspace of DOUBLES doubles and INTEGERS integers.

    Fourteen arguments because the entry is called by address, with integers, doubles and booleans alone.
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    query = Query(boolean, depths, limit, terms_at, stop_at_hit and not boolean)
    work = workspace_at(doubles_at, integers_at)
    work.requests[0] = 0
    n_queued = view_i64(work.queue_integers_at, KINDS)
    # A kind of gap is refined when eight of it are queued; what is queued after the last pair, kind by kind.
    n_together = 1 if stop_at_hit else LANES
    has_portals = False
    if not depths and not stop_at_hit:
        tables = Tables(ints_at, numbers_at, poses_at, shape_of_at)
        n_small = answer_small_hulls(
            tables, pairs_at, n_pairs, boolean, limit, rows_at, work.queue_at, work.queue_integers_at
        )
        has_portals = n_small > 0
    clear_queue(work.queue_integers_at)
    for step in range(n_pairs if boolean else n_pairs + KINDS):
        kind = step - n_pairs
        if has_portals and step < n_pairs and view_u8(rows_at + ROW * step, ROW)[HOW] != UNDECIDED:
            continue
        if step < n_pairs:
            ordered = ordered_pair(ints_at, numbers_at, poses_at, shape_of_at, pairs[2 * step], pairs[2 * step + 1])
            kind = _answer(ordered, query, view_row(rows_at + ROW * step), step, has_portals, work)
        if kind >= 0 and n_queued[kind] >= (n_together if step < n_pairs else 1):
            refine_queued(
                ints_at, numbers_at, poses_at, kind, depths, limit, rows_at, work.queue_at, work.queue_integers_at
            )
        if stop_at_hit and step < n_pairs and view_u8(rows_at + ROW * step, ROW)[HIT] == 1:
            return step + 1
    return n_pairs


@kernel(inline=True)
def _answer(ordered, query, row, row_number, has_portals, work):
    """Answer one pair; returns the kind of gap if the row is queued for its last digits, else −1."""
    A, B = ordered.pair.A, ordered.pair.B
    n_start = _take_portal(row, work.ids) if has_portals else 0
    if query.resumes:
        n_start = _take_vertices(row, work.ids, ordered)
    clear_vertices(row)
    if 0.0 < ordered.size < SMALLEST:
        row.flags[HOW] = REFUSED
        return -1
    how = method(A.kind, A.n, B.kind, B.n)
    if how == HALFSPACES:
        halfspace_halfspace(ordered.pair, ordered.flip, row)
        return -1
    if how == HALFSPACE_CONVEX:
        halfspace_convex(ordered, query, row, work)
        return -1
    if query.boolean and is_box_and_sphere(ordered.pair) and decide_box_sphere(ordered, query.limit, row):
        return -1
    return convex_convex(ordered, how, query, row, row_number, n_start, work)


@kernel(inline=True)
def _take_portal(row, ids):
    """Copy the vertices named by a row to begin with, if any, to the last three ids; returns the number of pairs.

    To look costs 1 to 2 % of a gap: rows are rarely in the cache.
    """
    n_start = int(row.flags[COUNT])
    for k in range(3 if n_start > 0 else 0):
        ids[2 * k + 4] = row.words[VERTICES_A + k]
        ids[2 * k + 5] = row.words[VERTICES_B + k]
    return n_start


@kernel(inline=True)
def _take_vertices(row, ids, ordered):
    """As `_take_portal`, for a row naming three pairs or more of cores that are scanned."""
    A, B = ordered.pair.A, ordered.pair.B
    is_scanned = A.tree == 0 and B.tree == 0 and A.coarse_at == 0 and B.coarse_at == 0
    if row.flags[COUNT] < 3 or not is_scanned:
        return 0
    at_a = VERTICES_B if ordered.flip else VERTICES_A
    at_b = VERTICES_A if ordered.flip else VERTICES_B
    for k in range(3):
        if row.words[at_a + k] < 0 or row.words[at_b + k] < 0:  # a curved core has none
            return 0
        ids[2 * k + 4] = row.words[at_a + k]
        ids[2 * k + 5] = row.words[at_b + k]
    return 3
