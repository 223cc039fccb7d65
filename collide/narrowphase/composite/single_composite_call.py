"""Two bodies of several convex parts at a pair of poses: from matrices to the answer inside a single kernel."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, native_call, prepared, view_f64, view_i64, view_u8
from collide.lowering.compound_table import BALL_IN_WORLD, BODY
from collide.lowering.place_parts import BALL_MARGIN, gap_of_balls
from collide.lowering.shape_table import POSE
from collide.narrowphase.composite.composite_block import HEADER, N_DONE
from collide.narrowphase.composite.composite_poses import COMPOUNDS_SIGNATURE, place_two_balls
from collide.narrowphase.finish_rows import forget_depth
from collide.narrowphase.pose_batches import clear_rows, set_pose
from collide.narrowphase.rows import BODY_B, DISTANCE, HIT, LOWER, UPPER, view_row

answer_compounds_at = native_call(COMPOUNDS_SIGNATURE)

# Header: the kernel, where a boolean goes and a row that nobody keeps, then the header of `composite_block.py`.
_KERNEL, _BYTE_AT, _ROW_AT, _HEADER = range(4)
SINGLE_HEADER = _HEADER + HEADER
# Header of `balls_beyond`: numbers of both bodies, and doubles to work in.
_BALL_OF_A, _BALL_OF_B, _WORK_AT = range(3)
BALLS_WORK = 2 * POSE + 2 * BALL_IN_WORLD


@kernel
def _answer(header_at, XA_at, XB_at, boolean, depths, limit, out_at):
    """Answer a pair of poses; false where doubles do not suffice, or an error has to be raised."""
    header = view_i64(header_at, SINGLE_HEADER)
    for k in range(_HEADER + N_DONE, SINGLE_HEADER):
        header[k] = 0
    status = answer_compounds_at(
        header[_KERNEL],
        (
            header_at + 8 * _HEADER, 0, XA_at, 0, XB_at, 0, 1, boolean, depths, limit, True, False, out_at,
        ),
    )
    return status == 0


@entry(prepared.BOOLEAN, nogil=False)
def collide_single_compound(header_at, XA_at, XB_at):
    """Whether the pair meets, 0 or 1; −1 where the caller has to ask as of a batch.

    All threads share its workspace: it keeps Python's lock.
    """
    byte_at = view_i64(header_at, SINGLE_HEADER)[_BYTE_AT]
    if not _answer(header_at, XA_at, XB_at, True, False, 0.0, byte_at):
        return -1
    return int(view_u8(byte_at, 1)[0])


@entry(prepared.ROW, nogil=False)
def distance_single_compound(header_at, XA_at, XB_at, row_at, depths, limit):
    """Write the pair's row over ROW zero bytes, without a depth unless depths are wanted; returns 0, or −1 where
    `_answer` is false or the depth is infinite.   limit : the query's max_distance [m]."""
    if not _answer(header_at, XA_at, XB_at, False, depths, limit, row_at):
        return -1
    row = view_row(row_at)
    row.words[BODY_B] = 1
    if not depths:
        forget_depth(row)
    return -1 if row.doubles[DISTANCE] == -math.inf else 0


@entry(prepared.WITHIN, nogil=False)
def within_single_compound(header_at, XA_at, XB_at, limit):
    """Whether the pair is at most so far apart, 0 or 1; −1 as there, and where the bracket is too wide."""
    row_at = view_i64(header_at, SINGLE_HEADER)[_ROW_AT]
    clear_rows(row_at, 1)
    if not _answer(header_at, XA_at, XB_at, False, False, limit, row_at):
        return -1
    row = view_row(row_at)
    if row.flags[HIT] != 0 or row.doubles[UPPER] <= limit:
        return 1
    return 0 if row.doubles[LOWER] > limit else -1


@entry(prepared.CONTACTS, nogil=False)
def balls_beyond(header_at, XA_at, XB_at, _out_at, _max_contacts, margin):
    """0 contacts where balls around two bodies are farther apart than a margin [m]; −1 elsewhere, or at invalid poses.

    No part reaches out of its body's ball by more than the balls' margin of the size, so no two parts are within the
    margin, whose product is rounded up.
    """
    header = view_i64(header_at, 3)
    poses, balls = view_f64(header[_WORK_AT], 2 * POSE), view_f64(header[_WORK_AT] + 16 * POSE, 2 * BALL_IN_WORLD)
    if not (set_pose(poses, 0, view_f64(XA_at, 16), True) and set_pose(poses, POSE, view_f64(XB_at, 16), True)):
        return -1
    ball_a, ball_b = view_f64(header[_BALL_OF_A], BODY), view_f64(header[_BALL_OF_B], BODY)
    size = place_two_balls(poses, 0, POSE, ball_a, 0, ball_b, 0, balls)
    gap = gap_of_balls(balls, 0, BALL_IN_WORLD) - BALL_MARGIN * size
    return 0 if gap > margin * (1.0 + 2.0**-50) else -1
