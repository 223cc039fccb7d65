"""Two bodies of several convex parts at one pair of poses: from matrices to the answer inside one kernel."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, native_call, prepared, view_i64, view_u8
from collide.narrowphase.composite.composite_block import HEADER, N_DONE
from collide.narrowphase.composite.composite_poses import COMPOUNDS_SIGNATURE
from collide.narrowphase.finish_rows import forget_depth
from collide.narrowphase.rows import BODY_B, DISTANCE, view_row

answer_compounds_at = native_call(COMPOUNDS_SIGNATURE)

# Header: the kernel, where a boolean goes, then the header of `composite_block.py`.
_KERNEL, _BYTE_AT, _HEADER = range(3)
SINGLE_HEADER = _HEADER + HEADER


@kernel
def _answer(header_at, XA_at, XB_at, boolean, depths, limit, out_at):
    """Answer one pair of poses; false where it takes more than doubles, or an error has to be raised."""
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
    """ROW zero bytes become the pair's row, without a depth unless those are wanted; −1 as there, else 0. −1, too,
    where the depth is infinite.   limit : the query's max_distance [m]."""
    if not _answer(header_at, XA_at, XB_at, False, depths, limit, row_at):
        return -1
    row = view_row(row_at)
    row.words[BODY_B] = 1
    if not depths:
        forget_depth(row)
    return -1 if row.doubles[DISTANCE] == -math.inf else 0
