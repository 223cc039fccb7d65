"""Contacts of two unions of convex parts at a single pair of poses: from matrices to rows inside a kernel.

Pairs of parts whose balls come within the margin are listed as for distances (`composite_poses.py`), placed, and
answered as a batch of convex pairs (`contact_blocks.py`).
"""

from __future__ import annotations

from collide.contact.contact_blocks import (
    BEGIN,
    BLOCK_HEADER,
    DONE,
    ENDS_AT,
    IS_ANSWERED,
    LIMIT,
    OUT_AT,
    SLACK_AT,
    WHICH_AT,
    XA_AT,
    XB_AT,
)
from collide.contact.contact_rows import CONTACT_DTYPE
from collide.contact.convex_manifolds import FACES_AT, MARGIN, MAX_CONTACTS, PAIRS_DONE, ROWS_DONE
from collide.contact.near_the_margin import is_near_the_margin, leeway_of
from collide.kernels import entry, kernel, native_call, prepared, view_f64, view_i32, view_i64
from collide.lowering.compound_table import PART, TURNED
from collide.lowering.hull_faces import N_VERTICES
from collide.lowering.hull_polygons import FACE_INTS
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.place_parts import is_exact_product
from collide.lowering.shape_table import INTS, KIND, POSE, POSE_SLOP
from collide.narrowphase.composite.composite_block import HEADER as COMPOSITE_HEADER
from collide.narrowphase.composite.composite_block import INTS_AT, N_DONE, body_of, lay_out, open_block, part_view
from collide.narrowphase.composite.composite_poses import list_pairs_within
from collide.narrowphase.pose_batches import HEADER as HEADER_OF_POSES
from collide.results import field_at

_contacts_of_pairs_at = native_call("int64(int64, int64)")

# Header: the kernel of a batch; rows of the table whose faces the last call missed, how many, and where they go; how
# far both bodies reach, summed, bounded parts alone (a double) [m]. Then the header of `composite_block.py`, and that
# of `contact_blocks.py`, with space for LIST pairs.
KERNEL, N_WANTED, WANTED_AT, REACH_OF_BOTH, COMPOSITE = range(5)
BATCH = COMPOSITE + COMPOSITE_HEADER
COMPOUND_HEADER = BATCH + BLOCK_HEADER

_CONTACT = CONTACT_DTYPE.itemsize
_PART_A, _PART_B, _PATCH = (field_at(CONTACT_DTYPE, name, 4) for name in ("part_a", "part_b", "patch"))


@entry(prepared.CONTACTS, nogil=False)
def contacts_single_compound(header_at, XA_at, XB_at, out_at, max_contacts, margin):
    """The contacts of two unions at one pair of poses; how many, or −1 where the caller has to ask as of a batch, or,
    with N_WANTED rows, to make their faces and ask again.

    header : of COMPOUND_HEADER integers.   out : `CONTACT_DTYPE`, as many rows as the header's batch has space for. All
    threads share the workspace: the kernel keeps Python's lock.
    """
    header = view_i64(header_at, COMPOUND_HEADER)
    header[N_WANTED] = 0
    for k in range(COMPOSITE + N_DONE, BATCH):
        header[k] = 0
    block = open_block(header_at + 8 * COMPOSITE)
    if not lay_out(block, 0, XA_at, 0, XB_at, 0, 1, True):
        return -1
    n = list_pairs_within(block, margin)
    if n <= 0:
        return n
    slack = _pose_pairs(header, block, n)
    if not slack >= 0.0 or header[N_WANTED] > 0:
        return -1
    batch_at = header_at + 8 * BATCH
    manifold = BATCH + HEADER_OF_POSES
    header[BATCH + OUT_AT] = out_at
    header[manifold + PAIRS_DONE] = header[manifold + ROWS_DONE] = header[BATCH + BEGIN] = 0
    header[BATCH + IS_ANSWERED] = 0
    header[manifold + MAX_CONTACTS] = max_contacts
    view_f64(batch_at + 8 * (HEADER_OF_POSES + MARGIN), 1)[0] = margin
    reach = view_f64(header_at + 8 * REACH_OF_BOTH, 1)[0]
    view_f64(batch_at + 8 * LIMIT, 1)[0] = margin + max(leeway_of(reach, XA_at, XB_at), slack)
    if _contacts_of_pairs_at(header[KERNEL], (batch_at, n)) != DONE:
        return -1
    _name_parts(header, block, n, out_at)
    n_rows = header[manifold + ROWS_DONE]
    return -1 if is_near_the_margin(out_at, n_rows, margin, reach, XA_at, XB_at) else n_rows


@kernel
def _pose_pairs(header, block, n):
    """Write matrices, rows of the table and slacks of n pairs listed; the largest slack [m], −1 where a half-space
    stands at a pose of its own in its union: rounding moves a half-space by more, farther from its origin."""
    which, slacks = view_i64(header[BATCH + WHICH_AT], 2 * n), view_f64(header[BATCH + SLACK_AT], n)
    largest = 0.0
    for k in range(n):
        slacks[k] = 0.0
        for side in range(2):
            row = block.pairs[2 * k + side]
            which[2 * k + side] = block.shape_of[row]
            slop = _put_matrix(header, block, side, row, header[BATCH + (XA_AT if side == 0 else XB_AT)] + 128 * k)
            if slop < 0.0:
                return -1.0
            slacks[k] += slop
        largest = max(largest, slacks[k])
    return largest


@kernel
def _put_matrix(header, block, side, row, X_at):
    """Write the matrix of a placed part, as `composite_parts.CompoundParts.placed` has it; by how much rounding may
    have moved the part [m], or −1 of a half-space moved."""
    body, number = body_of(block, 0, side), block.shape_of[row]
    kind = view_i64(header[COMPOSITE + INTS_AT] + 8 * INTS * number, INTS)[KIND]
    faces = view_i64(header[BATCH + HEADER_OF_POSES + FACES_AT] + 8 * FACE_INTS * number, FACE_INTS)
    if kind == POINTS and faces[N_VERTICES] == 0:
        view_i64(header[WANTED_AT] + 8 * header[N_WANTED], 1)[0] = number
        header[N_WANTED] += 1
    X, p, parts = view_f64(X_at, 16), POSE * row, part_view(block, number + 1)
    is_turned = parts[PART * number + TURNED] != 0.0
    for i in range(3):
        for j in range(4):
            value = block.poses[p + (3 * i + j if j < 3 else 9 + i)]
            X[4 * i + j] = value + 0.0 if is_turned else value
        X[12 + i] = 0.0
    X[15] = 1.0
    slop = block.poses[p + POSE_SLOP]
    if slop == 0.0:
        return 0.0
    if kind == HALFSPACE:
        return -1.0
    return 0.0 if is_exact_product(block.poses, POSE * body.row, parts, PART * number) else slop


@kernel
def _name_parts(header, block, n, out_at):
    """Write the parts of each contact, and patches counted on from pair to pair."""
    ends = view_i64(header[BATCH + ENDS_AT], n)
    count_b = body_of(block, 0, 1).n_parts
    first, patch = 0, 0
    for k in range(n):
        pair = block.owners[2 * k + 1]
        for number in range(first, ends[k]):
            words = view_i32(out_at + _CONTACT * number, _CONTACT // 4)
            words[_PART_A] = pair // count_b
            words[_PART_B] = pair % count_b
            words[_PATCH] = patch
        patch += 1 if ends[k] > first else 0
        first = ends[k]
