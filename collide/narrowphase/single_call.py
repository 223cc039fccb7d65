"""Two convex sets at a pair of poses: from matrices to the answer inside a single kernel."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, native_call, prepared, view_f64, view_i64
from collide.lowering.shape_table import POSE
from collide.narrowphase.exact.settle_hulls import SIGNATURE
from collide.narrowphase.finish_rows import forget_depth
from collide.narrowphase.pair_workspace import REQUESTS_AT
from collide.narrowphase.pose_batches import (
    BLOCK,
    DIGITS_AT,
    HEADER,
    INTEGERS_AT,
    INTS_AT,
    NUMBERS_AT,
    PAIRS_AT,
    POSES_AT,
    ROWS_AT,
    SETTLE,
    SHAPE_OF_AT,
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
    UPPER,
    is_undecided,
    is_undecided_or_refused,
    view_row,
)
from collide.results import EXACT

_settle_hulls_at = native_call(SIGNATURE)


@kernel
def _answer(header_at, XA_at, XB_at, boolean, depths, limit, row_at):
    """A pair at a pair of poses: 0 apart, 1 hit, −1 where the general way is needed, or an error has to be raised.

    header : of `pose_batches.py`.   limit : gaps beyond this [m] are not measured.
    Rows of two hulls left open by doubles, touching boxes for example, are settled here, as `exact_stage.settle_rows`
    does first; a depth left without a certificate goes to the general way.
    """
    block = block_of(header_at)
    good_a = set_pose(block.poses, 0, view_f64(XA_at, 16), True)
    good_b = set_pose(block.poses, BLOCK * POSE, view_f64(XB_at, 16), True)
    if not (good_a and good_b):
        return -1
    answer_block(block.header, 1, boolean, depths, limit, row_at)
    row = view_row(row_at)
    if is_undecided(row):
        _settle(block.header, boolean, depths, limit, row_at)
        if depths and row.flags[HOW] == EXACT and row.flags[HIT] == 1 and row.flags[CERTIFIED] == 0:
            return -1
    return -1 if is_undecided_or_refused(row) else int(row.flags[HIT])


@kernel
def _settle(header, boolean, depths, limit, row_at):
    """`settle_hulls` of the first pair of the block."""
    requests_at = header[INTEGERS_AT] + 8 * REQUESTS_AT
    _settle_hulls_at(
        header[SETTLE],
        (
            header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], header[SHAPE_OF_AT], header[PAIRS_AT], 1, boolean,
            depths, limit, row_at, 0, 0, requests_at, header[DIGITS_AT],
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


@entry(prepared.ROW, nogil=False)
def within_single(header_at, XA_at, XB_at, _unused_at, _unused, limit):
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
    hit = _answer(header_at, XA_at, XB_at, False, depths, limit, row_at)
    row = view_row(row_at)
    row.words[BODY_B] = 1
    if not depths and hit >= 0:
        forget_depth(row)
    return -1 if row.doubles[DISTANCE] == -math.inf else hit
