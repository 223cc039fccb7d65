"""Two bodies of several convex parts at one pair of poses: from matrices to the answer inside one kernel."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, native_call, prepared, view_f64, view_i32, view_i64, view_u8
from collide.narrowphase.composite.composite_poses import DONE, HEADER, UNIONS_SIGNATURE
from collide.narrowphase.finalize_rows import forget_depth
from collide.narrowphase.rows import BODY_B, DISTANCE, ROW, view_row

answer_unions_at = native_call(UNIONS_SIGNATURE)

# Header: the kernel, where a boolean goes, then the header of `composite_poses.py`.
_KERNEL, _BYTE_AT, _HEADER = range(3)
SINGLE_HEADER = _HEADER + HEADER


@kernel
def _single(header_at, XA_at, XB_at, boolean, depths, out_at):
    """Answer one pair of poses; False where more than doubles, or an error, is called for."""
    words = view_i64(header_at, SINGLE_HEADER)
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


@entry(prepared.BOOLEAN, nogil=False)
def collide_single_union(header_at, XA_at, XB_at):
    """Whether the pair meets, 0 or 1; −1 where the long way is to be taken.

    All threads share its workspace: it keeps Python's lock.
    """
    byte_at = view_i64(header_at, SINGLE_HEADER)[_BYTE_AT]
    if not _single(header_at, XA_at, XB_at, True, False, byte_at):
        return -1
    return int(view_u8(byte_at, 1)[0])


@entry(prepared.ROW, nogil=False)
def distance_single_union(header_at, XA_at, XB_at, row_at, depths):
    """ROW zero bytes become the pair's row, without a depth unless those are wanted; −1 as there, else 0. −1, too, where
    the depth has no end."""
    if not _single(header_at, XA_at, XB_at, False, depths, row_at):
        return -1
    row = view_f64(row_at, 12)
    view_i32(row_at, ROW // 4)[BODY_B] = 1
    if not depths:
        forget_depth(view_row(row_at))
    return -1 if row[DISTANCE] == -math.inf else 0
