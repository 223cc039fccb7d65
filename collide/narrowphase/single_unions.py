"""Two bodies of several convex parts at one pair of poses: from array objects to the answer inside one kernel."""

from __future__ import annotations

import math

from collide._jit import entry, kernel, native_call, view_f64, view_i32, view_i64, view_u8
from collide.narrowphase.array_objects import OBJECT_WORDS, answered, data_at, matrix_at
from collide.narrowphase.closing import forget_depth
from collide.narrowphase.rows import BODY_B, DISTANCE, ROW
from collide.narrowphase.union_poses import DONE, HEADER, UNIONS_SIGNATURE

answer_unions_at = native_call(UNIONS_SIGNATURE)

# Header: array objects, the kernel, where a boolean goes, then the header of `union_poses.py`.
_KERNEL, _BYTE_AT, _HEADER = range(OBJECT_WORDS, OBJECT_WORDS + 3)
SINGLE_HEADER = _HEADER + HEADER


@kernel
def _single(header_at, A_object, B_object, boolean, depths, out_at):
    """Answer one pair of poses; False where more than doubles, or an error, is called for."""
    words = view_i64(header_at, SINGLE_HEADER)
    XA_at = matrix_at(A_object, words)
    XB_at = matrix_at(B_object, words)
    if XA_at == 0 or XB_at == 0:
        return False
    for k in range(_HEADER + DONE, SINGLE_HEADER):
        words[k] = 0
    said = answer_unions_at(
        words[_KERNEL],
        (
            header_at + 8 * _HEADER, 0, XA_at, 0, XB_at, 0, 1, boolean, depths, 0.0 if boolean else math.inf, True, False,
            out_at,
        ),
    )  # fmt: skip
    return said == 0


@entry("int64(int64, int64, int64)", nogil=False)
def collide_single_union(header_object, arguments_at, count):
    """`array_objects.built_in` of two poses: whether the pair meets, or None where the long way is to be taken.

    All threads share its workspace: it keeps Python's lock.
    """
    header_at = data_at(header_object)
    said = -1
    if count == 2:
        arguments = view_i64(arguments_at, 2)
        byte_at = view_i64(header_at, SINGLE_HEADER)[_BYTE_AT]
        if _single(header_at, arguments[0], arguments[1], True, False, byte_at):
            said = int(view_u8(byte_at, 1)[0])
    return answered(view_i64(header_at, OBJECT_WORDS), said)


@entry("int64(int64, int64, int64)", nogil=False)
def distance_single_union(header_object, arguments_at, count):
    """`array_objects.built_in` of two poses, an array of ROW zero bytes, which becomes their row, and, where gaps are all
    that is wanted, anything; returns as there. None, too, where the depth has no end.
    """
    header_at = data_at(header_object)
    said = -1
    if count >= 3:
        arguments = view_i64(arguments_at, 3)
        row_at = data_at(arguments[2])
        if _single(header_at, arguments[0], arguments[1], False, count == 3, row_at):
            row = view_f64(row_at, 12)
            view_i32(row_at, ROW // 4)[BODY_B] = 1
            if count > 3:
                forget_depth(row, view_u8(row_at, ROW))
            said = -1 if row[DISTANCE] == -math.inf else 0
    return answered(view_i64(header_at, OBJECT_WORDS), said)
