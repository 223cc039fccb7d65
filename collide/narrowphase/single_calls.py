"""Two convex sets at one pair of poses: from array objects to the answer inside one kernel."""

from __future__ import annotations

import math

from collide._jit import entry, kernel, view_f64, view_i32, view_i64, view_u8
from collide.geometry.tables import POSE
from collide.narrowphase.array_objects import OBJECT_WORDS, answered, data_at, matrix_at
from collide.narrowphase.closing import forget_depth
from collide.narrowphase.poses import (
    BLOCK,
    CORE,
    DOUBLES_AT,
    HEADER,
    INTEGERS_AT,
    INTS_AT,
    NUMBERS_AT,
    PAIRS_AT,
    POSES_AT,
    ROWS_AT,
    SHAPE_OF_AT,
    answer_at,
    set_pose,
)
from collide.narrowphase.rows import BODY_B, DISTANCE, HIT, HOW, ROW
from collide.results import REFUSED, UNDECIDED

#: Where the header's words of `poses.py` begin.
_WORDS = OBJECT_WORDS
SINGLE_HEADER = OBJECT_WORDS + HEADER


@kernel
def _single(header_at, A_object, B_object, boolean, depths, row_at):
    """One pair at one pair of poses: 0 apart, 1 hit, −1 where more than doubles, or an error, is called for."""
    XA_at = matrix_at(A_object, view_i64(header_at, OBJECT_WORDS))
    XB_at = matrix_at(B_object, view_i64(header_at, OBJECT_WORDS))
    if XA_at == 0 or XB_at == 0:
        return -1
    header = view_i64(header_at + 8 * _WORDS, HEADER)
    poses = view_f64(header[POSES_AT], (BLOCK + 1) * POSE)
    good_a = set_pose(poses, 0, view_f64(XA_at, 16), True)
    good_b = set_pose(poses, BLOCK * POSE, view_f64(XB_at, 16), True)
    if not (good_a and good_b):
        return -1
    answer_at(
        header[CORE],
        (
            header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], 0, header[SHAPE_OF_AT], header[PAIRS_AT], 1, boolean,
            depths, False, 0.0 if boolean else math.inf, row_at, header[DOUBLES_AT], header[INTEGERS_AT],
        ),
    )  # fmt: skip
    marks = view_u8(row_at, ROW)
    if marks[HOW] == UNDECIDED or marks[HOW] == REFUSED:
        return -1
    return int(marks[HIT])


@entry("int64(int64, int64, int64)", nogil=False)
def collide_single(header_object, arguments_at, count):
    """`array_objects.built_in` of two poses: whether the pair meets, or None where the long way is to be taken.

    All threads share its workspace: it keeps Python's lock.
    """
    header_at = data_at(header_object)
    said = -1
    if count == 2:
        rows_at = view_i64(header_at, SINGLE_HEADER)[_WORDS + ROWS_AT]
        row = view_i64(rows_at, ROW // 8)
        for k in range(ROW // 8):
            row[k] = 0
        arguments = view_i64(arguments_at, 2)
        said = _single(header_at, arguments[0], arguments[1], True, False, rows_at)
    return answered(view_i64(header_at, OBJECT_WORDS), said)


@entry("int64(int64, int64, int64)", nogil=False)
def distance_single(header_object, arguments_at, count):
    """`array_objects.built_in` of two poses, an array of ROW zero bytes, which becomes their row, and, where gaps are all
    that is wanted, anything; returns as there. None, too, where the depth has no end.
    """
    header_at = data_at(header_object)
    said = -1
    if count >= 3:
        arguments = view_i64(arguments_at, 3)
        row_at = data_at(arguments[2])
        said = _single(header_at, arguments[0], arguments[1], False, count == 3, row_at)
        view_i32(row_at, ROW // 4)[BODY_B] = 1
        if count > 3 and said >= 0:
            forget_depth(view_f64(row_at, 12), view_u8(row_at, ROW))
        if view_f64(row_at, 1 + DISTANCE)[DISTANCE] == -math.inf:
            said = -1
    return answered(view_i64(header_at, OBJECT_WORDS), said)
