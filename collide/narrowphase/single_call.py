"""Two convex sets at a pair of poses: from matrices to the answer inside a single kernel."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, native_call, prepared, view_f64, view_i64
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import INTS, KIND, POSE
from collide.narrowphase.exact.exact_stage import SIGNATURE
from collide.narrowphase.fallback_searches import Core, settle_row_by_other_searches
from collide.narrowphase.finish_rows import forget_depth
from collide.narrowphase.pair_workspace import REQUESTS_AT
from collide.narrowphase.pose_batches import (
    BLOCK,
    CORE,
    DIGITS_AT,
    DOUBLES_AT,
    HEADER,
    INTEGERS_AT,
    INTS_AT,
    NUMBERS_AT,
    PAIRS_AT,
    POSES_AT,
    ROWS_AT,
    SETTLE,
    SHAPE_OF_AT,
    STEPS_AT,
    answer_block,
    block_of,
    clear_rows,
    set_pose,
)
from collide.narrowphase.rows import (
    BODY_B,
    CERTIFIED,
    DISTANCE,
    HIT,
    HOW,
    LOWER,
    ROW,
    UPPER,
    is_undecided_or_refused,
    view_row,
)
from collide.results import EXACT, REFUSED

_settle_exactly_at = native_call(SIGNATURE)


@kernel
def _answer(header_at, XA_at, XB_at, boolean, depths, limit, row_at):
    """A pair at a pair of poses: 0 apart, 1 hit, −1 where the general way is needed, or an error has to be raised.

    header : of `pose_batches.py`.   limit : larger gaps are known only to be larger [m].
    """
    block = block_of(header_at)
    good_a = set_pose(block.poses, 0, view_f64(XA_at, 16), True)
    good_b = set_pose(block.poses, BLOCK * POSE, view_f64(XB_at, 16), True)
    if not (good_a and good_b):
        return -1
    answer_block(block.header, 1, boolean, depths, limit, row_at)
    row = view_row(row_at)
    if is_undecided_or_refused(row) and not settle_row(block.header, boolean, depths, limit, row_at):
        return -1
    return int(row.flags[HIT])


@kernel
def settle_row(header, boolean, depths, limit, row_at):
    """Settle the row of the first pair of the block, left open by `answer_block`, as a batch would; false where the
    long way has to, or an error has to be raised.

    header : of `pose_batches.py`; the second row of the block is written over.   boolean, depths, limit : as asked.
    Boxes that touch, or a can at rest on a box, are settled by the exact stage; a depth left open there is for the long
    way. Other pairs with a curved core go on to the other searches (`fallback_searches.py`); what they leave open is
    for the long way, too (`exact_curved/`).
    """
    row = view_row(row_at)
    if row.flags[HOW] == REFUSED:
        return False
    is_open = _settle_exactly(header, boolean, depths, limit, row_at) > 0
    if is_open and _has_curved_core(header):
        core = Core(
            header[CORE], header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], 0, header[SHAPE_OF_AT],
            header[DOUBLES_AT], header[INTEGERS_AT],
        )
        result_at = header[ROWS_AT] + ROW
        settle_row_by_other_searches(core, header[PAIRS_AT], boolean, depths, limit, row_at, result_at)
        return not is_undecided_or_refused(row)
    is_without_depth = row.flags[HOW] == EXACT and row.flags[HIT] == 1 and row.flags[CERTIFIED] == 0
    return not (is_open or (depths and is_without_depth))


@kernel(inline=True)
def _has_curved_core(header):
    """Whether the first pair of the block has a cylinder, cone or ellipsoid, and no half-space."""
    shape_of = view_i64(header[SHAPE_OF_AT], BLOCK + 1)
    is_curved = False
    for k in range(2):
        kind = view_i64(header[INTS_AT] + 8 * INTS * shape_of[BLOCK * k], INTS)[KIND]
        if kind == HALFSPACE:
            return False
        is_curved = is_curved or kind != POINTS
    return is_curved


@kernel
def _settle_exactly(header, boolean, depths, limit, row_at):
    """`settle_exactly` of the first pair of the block; returns 1 where the row stays open."""
    requests_at = header[INTEGERS_AT] + 8 * REQUESTS_AT
    return _settle_exactly_at(
        header[SETTLE],
        (
            header[STEPS_AT], header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], header[SHAPE_OF_AT],
            header[PAIRS_AT], 1, boolean, depths, limit, row_at, 0, 0, requests_at, header[DIGITS_AT],
        ),
    )


@entry(prepared.BOOLEAN, nogil=False)
def collide_single(header_at, XA_at, XB_at):
    """Whether the pair meets, 0 or 1; −1 where the caller has to ask as of a batch.

    All threads share its workspace: it keeps Python's lock.
    """
    rows_at = view_i64(header_at, HEADER)[ROWS_AT]
    clear_rows(rows_at, 1)
    return _answer(header_at, XA_at, XB_at, True, False, 0.0, rows_at)


@entry(prepared.WITHIN, nogil=False)
def within_single(header_at, XA_at, XB_at, limit):
    """Whether the pair is at most so far apart, 0 or 1; −1 as `collide_single`, and where the bracket is too wide."""
    rows_at = view_i64(header_at, HEADER)[ROWS_AT]
    row = view_row(rows_at)
    clear_rows(rows_at, 1)
    hit = _answer(header_at, XA_at, XB_at, False, False, limit, rows_at)
    if hit != 0:
        return hit
    if row.doubles[LOWER] > limit:
        return 0
    return 1 if row.doubles[UPPER] <= limit else -1


@entry(prepared.ROW, nogil=False)
def distance_single(header_at, XA_at, XB_at, row_at, depths, limit):
    """ROW zero bytes become the pair's row, without a depth unless those are wanted; returns as `collide_single`. −1,
    too, where the depth is infinite.

    limit : the query's max_distance [m].
    """
    return write_distance(header_at, XA_at, XB_at, row_at, depths, limit)


@kernel
def write_distance(header_at, XA_at, XB_at, row_at, depths, limit):
    """`distance_single` for other kernels."""
    hit = _answer(header_at, XA_at, XB_at, False, depths, limit, row_at)
    row = view_row(row_at)
    row.words[BODY_B] = 1
    if not depths and hit >= 0:
        forget_depth(row)
    return -1 if row.doubles[DISTANCE] == -math.inf else hit
