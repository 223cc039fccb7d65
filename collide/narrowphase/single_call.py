"""Two convex sets at one pair of poses: from matrices to the answer inside one kernel."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, prepared, view_f64, view_i64
from collide.lowering.shape_table import POSE
from collide.narrowphase.finalize_rows import forget_depth
from collide.narrowphase.pose_batches import BLOCK, HEADER, ROWS_AT, answer_block, block_of, set_pose
from collide.narrowphase.rows import BODY_B, DISTANCE, HIT, ROW, is_open, view_row


@kernel
def _answer(header_at, XA_at, XB_at, boolean, depths, row_at):
    """One pair at one pair of poses: 0 apart, 1 hit, −1 where it takes more than doubles, or an error has to be raised.

    header : of `pose_batches.py`.
    """
    block = block_of(header_at)
    good_a = set_pose(block.poses, 0, view_f64(XA_at, 16), True)
    good_b = set_pose(block.poses, BLOCK * POSE, view_f64(XB_at, 16), True)
    if not (good_a and good_b):
        return -1
    answer_block(block.header, 1, boolean, depths, 0.0 if boolean else math.inf, row_at)
    row = view_row(row_at)
    if is_open(row):
        return -1
    return int(row.flags[HIT])


@entry(prepared.BOOLEAN, nogil=False)
def collide_single(header_at, XA_at, XB_at):
    """Whether the pair meets, 0 or 1; −1 where the caller has to ask as of a batch.

    All threads share its workspace: it keeps Python's lock.
    """
    rows_at = view_i64(header_at, HEADER)[ROWS_AT]
    row = view_i64(rows_at, ROW // 8)
    for k in range(ROW // 8):
        row[k] = 0
    return _answer(header_at, XA_at, XB_at, True, False, rows_at)


@entry(prepared.ROW, nogil=False)
def distance_single(header_at, XA_at, XB_at, row_at, depths):
    """ROW zero bytes become the pair's row, without a depth unless those are wanted; returns as `collide_single`. −1,
    too, where the depth is infinite."""
    hit = _answer(header_at, XA_at, XB_at, False, depths, row_at)
    row = view_row(row_at)
    row.words[BODY_B] = 1
    if not depths and hit >= 0:
        forget_depth(row)
    return -1 if row.doubles[DISTANCE] == -math.inf else hit
