"""Contacts of two convex sets at a single pair of poses: from matrices to rows inside a kernel."""

from __future__ import annotations

from collide.contact.box_box import put_box_row
from collide.contact.closed_form_rows import has_closed_form, put_closed_form
from collide.contact.convex_manifolds import HEADER as MANIFOLD_HEADER
from collide.contact.convex_manifolds import (
    INTS_AT,
    NUMBERS_AT,
    contacts_of_row,
)
from collide.contact.posed_box import has_box_row
from collide.kernels import entry, kernel, prepared, view_f64, view_i64
from collide.lowering.shape_table import POSE
from collide.narrowphase.pair_workspace import workspace_at
from collide.narrowphase.pose_batches import (
    BLOCK,
    DOUBLES_AT,
    HEADER,
    INTEGERS_AT,
    ROWS_AT,
    SHAPE_OF_AT,
    answer_block,
    block_of,
    clear_rows,
    set_pose,
)
from collide.narrowphase.pose_batches import INTS_AT as BLOCK_INTS_AT
from collide.narrowphase.pose_batches import NUMBERS_AT as BLOCK_NUMBERS_AT
from collide.narrowphase.pose_batches import POSES_AT as BLOCK_POSES_AT
from collide.narrowphase.posed_pair import ordered_pair
from collide.narrowphase.rows import LOWER, is_undecided_or_refused, view_row
from collide.narrowphase.single_call import settle_row

#: Integers of the header: that of `pose_batches.py`, then that of `convex_manifolds.py`.
SINGLE_HEADER = HEADER + MANIFOLD_HEADER


@entry(prepared.CONTACTS, nogil=False)
def contacts_single(header_at, XA_at, XB_at, out_at, max_contacts, margin):
    """The contacts of one pair of poses; how many, or −1 where the caller has to ask as of a batch.

    header : of SINGLE_HEADER integers.
    out : `CONTACT_DTYPE`, zeroed, space for as many rows as a manifold may have. All threads share the workspace: the
    kernel keeps Python's lock.
    """
    manifold_at = header_at + 8 * HEADER
    header = view_i64(manifold_at, MANIFOLD_HEADER)
    X_WA, X_WB = view_f64(XA_at, 16), view_f64(XB_at, 16)
    block = block_of(header_at)
    rows_at = block.header[ROWS_AT]
    row = view_row(rows_at)
    clear_rows(rows_at, 1)
    ints_at, numbers_at = header[INTS_AT], header[NUMBERS_AT]
    is_known = has_box_row(ints_at, numbers_at, 0, 1) and put_box_row(
        ints_at, numbers_at, 0, 1, X_WA, X_WB, margin, row
    )
    if not is_known:
        clear_rows(rows_at, 1)
        if not (set_pose(block.poses, 0, X_WA, True) and set_pose(block.poses, BLOCK * POSE, X_WB, True)):
            return -1
        is_known = has_closed_form(ints_at, 0, 1) and _put_closed_form(block.header, margin, row)
    if not is_known:
        clear_rows(rows_at, 1)
        answer_block(block.header, 1, False, True, margin, rows_at)
        if is_undecided_or_refused(row) and not settle_row(block.header, False, True, margin, rows_at):
            return -1
        # A half-space within another has no depth that ends.
        if not row.doubles[LOWER] > -1e300:
            return -1
    return contacts_of_row(manifold_at, X_WA, X_WB, row, margin, max_contacts, out_at)


@kernel
def _put_closed_form(header, margin, row):
    """`put_closed_form` of the pair that stands first in a block."""
    ordered = ordered_pair(
        header[BLOCK_INTS_AT], header[BLOCK_NUMBERS_AT], header[BLOCK_POSES_AT], header[SHAPE_OF_AT], 0, BLOCK
    )
    return put_closed_form(ordered, margin, workspace_at(header[DOUBLES_AT], header[INTEGERS_AT]), row)
