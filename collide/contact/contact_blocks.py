"""Contacts of many pairs of convex sets: from matrices to rows inside one kernel, a block of pairs at a time.

Between the narrowphase and the manifolds nothing leaves the cache: rows of `distance` are kept for a single block, and
Python is asked only where doubles leave a pair of the block open.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.contact.box_box import put_box_row
from collide.contact.closed_form_rows import has_closed_form, put_closed_form
from collide.contact.contact_rows import CONTACT_DTYPE
from collide.contact.convex_manifolds import (
    LARGEST,
    MARGIN,
    MAX_CONTACTS,
    PAIRS_DONE,
    ROWS_DONE,
    max_corners_of,
    put_manifold,
)
from collide.contact.posed_box import has_box_row
from collide.contact.single_contact_call import SINGLE_HEADER
from collide.kernels import entry, kernel, view_f64, view_i32, view_i64
from collide.lowering.shape_table import POSE, POSE_SLOP
from collide.narrowphase.pair_workspace import workspace_at
from collide.narrowphase.pose_batches import (
    BLOCK,
    DOUBLES_AT,
    HEADER,
    INTEGERS_AT,
    INTS_AT,
    NUMBERS_AT,
    POSES_AT,
    ROWS_AT,
    SHAPE_OF_AT,
    PoseBlock,
    answer_block,
    block_of,
    clear_rows,
    set_pose,
)
from collide.narrowphase.posed_pair import ordered_pair
from collide.narrowphase.rows import BEYOND, LOWER, ROW, is_undecided_or_refused, view_row
from collide.results import field_at

# Header: that of single calls, then what is asked: addresses of two rows of the `ShapeTable` a pair, or 0 for rows 0
# and 1 throughout; of both bodies' matrices, and how many doubles from one to the next (16, or 0 for one that goes with
# all); of two numbers of matrices a pair, or 0 for pair k's the k-th; of the id of the body at each of these, or 0; of
# a slack a pair, or 0 [m]; of space for rows, and for how many; of where the contacts of each pair end; the limit of
# distances (a double), whether matrices that are no rotation are refused. Then space for BLOCK numbers, and what a call
# has done: the first pair of the block at work, whether its rows are answered, how many of them by the narrowphase.
(
    WHICH_AT, XA_AT, STEP_A, XB_AT, STEP_B, OF_PAIR_AT, IDS_AT, SLACK_AT, OUT_AT, CAPACITY, ENDS_AT, LIMIT, CHECK,
    PLACES_AT, BEGIN, IS_ANSWERED, N_GENERAL,
) = range(SINGLE_HEADER, SINGLE_HEADER + 17)
BLOCK_HEADER = SINGLE_HEADER + 17
#: Why a call ended: all is done; rows of the block are open, for the exact stage; a matrix is no pose; no space for
#: rows; a pair whose depth has no end.
DONE, OPEN, BAD_POSE, ROWS_FULL, UNBOUNDED = range(5)

_CONTACT = CONTACT_DTYPE.itemsize
_A, _B = field_at(CONTACT_DTYPE, "a", 4), field_at(CONTACT_DTYPE, "b", 4)


class _Task(NamedTuple):
    """What a call works on.

    words : the header.   manifold_at, manifold : the header of `convex_manifolds.py` inside, its address and words.
    block : poses.   places : of each pair's row in the block, and of its poses: A's at the same place, B's BLOCK
        behind.
    """

    words: Any
    manifold_at: int
    manifold: Any
    block: PoseBlock
    places: Any


@entry("int64(int64, int64)")
def contacts_of_pairs(header_at, n):
    """Contacts of pairs from header[PAIRS_DONE] on, of n; returns why the kernel ended.

    header : of BLOCK_HEADER integers. After OPEN the first header[N_GENERAL] rows and poses of the block are to be
    settled, after ROWS_FULL more space is wanted: the next call goes on.
    """
    words = view_i64(header_at, BLOCK_HEADER)
    manifold_at = header_at + 8 * HEADER
    manifold = view_i64(manifold_at, SINGLE_HEADER - HEADER)
    task = _Task(words, manifold_at, manifold, block_of(header_at), view_i64(words[PLACES_AT], BLOCK))
    while words[BEGIN] < n:
        count = min(BLOCK, n - words[BEGIN])
        if words[IS_ANSWERED] == 0:
            status = _answer_rows(task, view_f64(header_at + 8 * LIMIT, 1)[0], count)
            if status == BAD_POSE:
                return BAD_POSE
            words[IS_ANSWERED] = 1
            if status == OPEN:
                return OPEN
        status = _put_contacts(task, count)
        if status != DONE:
            return status
        words[IS_ANSWERED] = 0
        words[BEGIN] += count
    return DONE


@kernel(inline=True)
def _numbers_of(words, k):
    """Numbers of both matrices of pair k of the batch."""
    if words[OF_PAIR_AT] == 0:
        return k, k
    numbers = view_i64(words[OF_PAIR_AT] + 16 * k, 2)
    return numbers[0], numbers[1]


@kernel(inline=True)
def _shapes_of(words, k):
    """Rows of the `ShapeTable` of pair k of the batch."""
    if words[WHICH_AT] == 0:
        return 0, 1
    which = view_i64(words[WHICH_AT] + 16 * k, 2)
    return which[0], which[1]


@kernel
def _answer_rows(task, limit, count):
    """Rows of `distance` of a block; DONE, OPEN or BAD_POSE.

    What takes no search stands last in the block; all others go to the narrowphase together.
    """
    words, block = task.words, task.block
    rows_at, check = words[ROWS_AT], words[CHECK] != 0
    work = workspace_at(words[DOUBLES_AT], words[INTEGERS_AT])
    clear_rows(rows_at, BLOCK)
    n_general, n_known, is_good = 0, 0, True
    for j in range(count):
        k = words[BEGIN] + j
        sa, sb = _shapes_of(words, k)
        a, b = _numbers_of(words, k)
        X_WA = view_f64(words[XA_AT] + 8 * words[STEP_A] * a, 16)
        X_WB = view_f64(words[XB_AT] + 8 * words[STEP_B] * b, 16)
        place = BLOCK - 1 - n_known
        is_posed, is_known = _put_known_row(block, work, sa, sb, X_WA, X_WB, limit, check, place, rows_at)
        if is_known:
            n_known += 1
        else:
            clear_rows(rows_at + ROW * place, 1)
            place = n_general
            n_general += 1
            block.shape_of[place] = sa
            block.shape_of[BLOCK + place] = sb
            is_posed = _pose_pair(block, place, X_WA, X_WB, check)
        is_good = is_posed and is_good
        task.places[j] = place
        block.pairs[2 * j] = j
        block.pairs[2 * j + 1] = BLOCK + j
    if not is_good:
        return BAD_POSE
    words[N_GENERAL] = n_general
    answer_block(block.header, n_general, False, True, limit, rows_at)
    for place in range(n_general):
        if is_undecided_or_refused(view_row(rows_at + ROW * place)):
            return OPEN
    return DONE


@kernel(inline=True)
def _pose_pair(block, place, X_WA, X_WB, check):
    """Set both poses at a place of the block; False where a matrix is none."""
    is_good = set_pose(block.poses, POSE * place, X_WA, check)
    return set_pose(block.poses, POSE * (BLOCK + place), X_WB, check) and is_good


@kernel(inline=True)
def _put_known_row(block, work, sa, sb, X_WA, X_WB, limit, check, place, rows_at):
    """(whether both matrices are poses, whether the row at a place is written): of pairs that take no search.

    Poses are set where the row is written and within the limit.
    """
    header = block.header
    row = view_row(rows_at + ROW * place)
    block.shape_of[place] = sa
    block.shape_of[BLOCK + place] = sb
    if has_box_row(header[INTS_AT], header[NUMBERS_AT], sa, sb):
        if not put_box_row(header[INTS_AT], header[NUMBERS_AT], sa, sb, X_WA, X_WB, limit, row):
            return True, False
        return not _is_within(row, limit) or _pose_pair(block, place, X_WA, X_WB, check), True
    if not has_closed_form(header[INTS_AT], sa, sb):
        return True, False
    if not _pose_pair(block, place, X_WA, X_WB, check):
        return False, False
    ordered = ordered_pair(
        header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], header[SHAPE_OF_AT], place, BLOCK + place
    )
    return True, put_closed_form(ordered, limit, work, row)


@kernel(inline=True)
def _is_within(row, margin):
    return row.flags[BEYOND] == 0 and row.doubles[LOWER] <= margin


@kernel
def _put_contacts(task, count):
    """Contacts of the pairs of a block that has its rows, from header[PAIRS_DONE] on; DONE, ROWS_FULL or UNBOUNDED."""
    words, manifold, poses = task.words, task.manifold, task.block.poses
    max_contacts = manifold[MAX_CONTACTS]
    max_rows = min(max_contacts, max_corners_of(manifold[LARGEST]))
    margin = view_f64(task.manifold_at + 8 * MARGIN, 1)[0]
    n_rows = manifold[ROWS_DONE]
    for k in range(manifold[PAIRS_DONE], words[BEGIN] + count):
        status = ROWS_FULL if words[CAPACITY] - n_rows < max_rows else DONE
        place = task.places[k - words[BEGIN]]
        row = view_row(words[ROWS_AT] + ROW * place)
        if not row.doubles[LOWER] > -1e300:  # a half-space within another
            status = UNBOUNDED
        if status != DONE:
            manifold[PAIRS_DONE] = k
            manifold[ROWS_DONE] = n_rows
            return status
        slack = view_f64(words[SLACK_AT] + 8 * k, 1)[0] if words[SLACK_AT] != 0 else 0.0
        if _is_within(row, margin + slack):
            poses[POSE * place + POSE_SLOP] = slack
            out_at = words[OUT_AT] + _CONTACT * n_rows
            n = put_manifold(task.manifold_at, place, BLOCK + place, row, margin + slack, max_contacts, out_at)
            if words[IDS_AT] != 0:
                _name_bodies(words, k, out_at, n)
            n_rows += n
        view_i64(words[ENDS_AT] + 8 * k, 1)[0] = n_rows
    manifold[PAIRS_DONE] = words[BEGIN] + count
    manifold[ROWS_DONE] = n_rows
    return DONE


@kernel(inline=True)
def _name_bodies(words, k, out_at, n):
    """Write the ids of pair k into its n contacts."""
    a, b = _numbers_of(words, k)
    id_a, id_b = view_i64(words[IDS_AT] + 8 * a, 1)[0], view_i64(words[IDS_AT] + 8 * b, 1)[0]
    for i in range(n):
        contact = view_i32(out_at + _CONTACT * i, _CONTACT // 4)
        contact[_A] = id_a
        contact[_B] = id_b
