"""Contacts of two convex sets at one pair of poses: from matrices to rows inside one kernel."""

from __future__ import annotations

from collide.contact.convex_manifolds import HEADER as MANIFOLD_HEADER
from collide.contact.convex_manifolds import MARGIN, MAX_CONTACTS, POSES_AT, ROWS_DONE, put_manifold
from collide.kernels import entry, prepared, view_f64, view_i64
from collide.lowering.shape_table import POSE, POSE_SLOP
from collide.narrowphase.pose_batches import BLOCK, HEADER, ROWS_AT, answer_block, block_of, set_pose
from collide.narrowphase.rows import BEYOND, LOWER, ROW, is_undecided_or_refused, view_row

#: Integers of the header: that of `pose_batches.py`, then that of `convex_manifolds.py`.
SINGLE_HEADER = HEADER + MANIFOLD_HEADER


@entry(prepared.ROW, nogil=False)
def contacts_single(header_at, XA_at, XB_at, out_at, _unused):
    """The contacts of one pair of poses; 0, or −1 where the caller has to ask as of a batch.

    header : of SINGLE_HEADER integers; how many contacts there are is left at its ROWS_DONE.
    out : `CONTACT_DTYPE`, zeroed, room for as many rows as a manifold may have. All threads share the workspace: the
    kernel keeps Python's lock.
    """
    block = block_of(header_at)
    poses = block.poses
    good_a = set_pose(poses, 0, view_f64(XA_at, 16), True)
    good_b = set_pose(poses, BLOCK * POSE, view_f64(XB_at, 16), True)
    if not (good_a and good_b):
        return -1
    rows_at = block.header[ROWS_AT]
    words = view_i64(rows_at, ROW // 8)
    for k in range(ROW // 8):
        words[k] = 0
    manifold_at = header_at + 8 * HEADER
    margin = view_f64(manifold_at + 8 * MARGIN, 1)[0]
    answer_block(block.header, 1, False, True, margin, rows_at)
    row = view_row(rows_at)
    # A half-space within another has no depth that ends.
    if is_undecided_or_refused(row) or not row.doubles[LOWER] > -1e300:
        return -1
    header = view_i64(manifold_at, MANIFOLD_HEADER)
    header[ROWS_DONE] = 0
    if row.flags[BEYOND] == 0 and row.doubles[LOWER] <= margin:
        pair_poses = view_f64(header[POSES_AT], 2 * POSE)
        for k in range(POSE):
            pair_poses[k] = poses[k]
            pair_poses[POSE + k] = poses[BLOCK * POSE + k]
        pair_poses[POSE_SLOP] = 0.0
        header[ROWS_DONE] = put_manifold(header, row, margin, header[MAX_CONTACTS], out_at)
    return 0
