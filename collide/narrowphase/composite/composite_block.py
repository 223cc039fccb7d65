"""A block of poses of two bodies of several parts: its header, its slots, and rows of poses for bodies and parts."""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.lowering.compound_table import (
    BALL_IN_WORLD,
    BODY_INTS,
    COUNT,
    FIRST,
    FIRST_GROUP,
    N_GROUPS,
    PART,
    TURNED,
)
from collide.lowering.place_parts import place_part
from collide.lowering.shape_table import POSE, TERM_ROW
from collide.narrowphase.composite.composite_rows import SCORE
from collide.narrowphase.exact.depth_requests import ROWS_PER_BATCH
from collide.narrowphase.pose_batches import set_pose

#: Poses that go through together, and pairs of parts on a list.
BLOCK = 64
LIST = ROWS_PER_BATCH
#: Numbers of pairs of parts that are near, before the least of them are listed; then pairs of nodes of both bodies,
#: still to be looked at: each step down takes one and puts four, and there are no more than 32 steps.
MAX_NEAR, STACK = 2 * LIST, 128
NEAR = MAX_NEAR + 2 * STACK

# Header: the kernel, tables of shapes, parts, bodies and groups; workspace, and how many rows of parts it has room for;
# how many pairs of parts a single call answers before all is for the long way, 0 of batches; then how far things have
# come, 0 to begin with: poses answered, poses of the block, stage, slot and pair of parts to go on with, pairs on the
# list, and how many pairs of parts were answered in all.
(
    CORE, INTS_AT, NUMBERS_AT, PARTS_AT, BODIES_AT, BODY_BALLS_AT, BY_PLACE_AT, GROUPS_AT,
    POSES_AT, TERMS_AT, SHAPE_OF_AT, PAIRS_AT, OWNERS_AT, ROWS_AT, SCORES_AT, SLOTS_AT, BALLS_AT, NEAR_AT, DOUBLES_AT,
    INTEGERS_AT,
    CAPACITY, AT_ONCE,
    N_DONE, N_POSES, STAGE, SLOT, PAIR, N_LISTED, N_ANSWERED,
) = range(29)
HEADER = 29

# Integers of a slot, which is a pose of the block: both bodies, rows of poses of theirs and where those of their parts
# begin, whether a boolean is a hit, and the pair of parts answered first, −1 where balls say that none meets.
BODY_NUMBERS, BODY_ROWS, PART_ROWS, IS_HIT, FIRST_PAIR = 0, 2, 4, 6, 7
SLOT_SIZE = 8
SLOTS = SLOT_SIZE * BLOCK


class Block(NamedTuple):
    """Views of a header, and of the workspace at the addresses in the header."""

    header: Any
    poses: Any
    shape_of: Any
    pairs: Any
    owners: Any
    scores: Any
    slots: Any
    balls: Any
    near: Any


class Body(NamedTuple):
    """One body of a slot: its parts in the table, and rows of poses: of its first part, and of its own; its groups in
    the table."""

    first: int
    n_parts: int
    part_rows: int
    row: int
    first_group: int
    n_groups: int


@kernel(inline=True)
def open_block(header_at):
    header = view_i64(header_at, HEADER)
    rows = 2 * BLOCK + header[CAPACITY]
    return Block(
        header, view_f64(header[POSES_AT], POSE * rows), view_i64(header[SHAPE_OF_AT], rows),
        view_i64(header[PAIRS_AT], 2 * LIST),
        view_i64(header[OWNERS_AT], 2 * LIST), view_f64(header[SCORES_AT], SCORE * BLOCK),
        view_i64(header[SLOTS_AT], SLOTS),
        view_f64(header[BALLS_AT], (4 + 2 * header[CAPACITY]) * BALL_IN_WORLD),
        view_i64(header[NEAR_AT], NEAR),
    )


@kernel(inline=True)
def body_of(block, k, which):
    """Body A (0) or B (1) of slot k."""
    slot = SLOT_SIZE * k + which
    number = block.slots[slot + BODY_NUMBERS]
    bodies = view_i64(block.header[BODIES_AT], BODY_INTS * (number + 1))
    at = BODY_INTS * number
    return Body(
        bodies[at + FIRST], bodies[at + COUNT], block.slots[slot + PART_ROWS], block.slots[slot + BODY_ROWS],
        bodies[at + FIRST_GROUP], bodies[at + N_GROUPS],
    )


@kernel(inline=True)
def count_pairs(block, k):
    """How many pairs of parts the bodies of slot k make."""
    return body_of(block, k, 0).n_parts * body_of(block, k, 1).n_parts


@kernel(inline=True)
def part_view(block, last):
    """Rows of all parts before part ``last``."""
    return view_f64(block.header[PARTS_AT], PART * last)


# --- poses --------------------------------------------------------------------------------------


@kernel
def lay_out(block, which_at, XA_at, step_a, XB_at, step_b, n, check):
    """Fill the block with poses from N_DONE on, as many as have room; False where one is no pose."""
    header, slots = block.header, block.slots
    done = header[N_DONE]
    n_rows = k = 0
    good = True
    while k < BLOCK and done + k < n:
        # A pose of one body that goes with all of the other's is laid out once.
        once_a = k > 0 and step_a == 0 and which_at == 0
        once_b = k > 0 and step_b == 0 and which_at == 0
        slot = SLOT_SIZE * k
        slots[slot + BODY_NUMBERS] = 0
        slots[slot + BODY_NUMBERS + 1] = 1
        if which_at != 0:
            which = view_i64(which_at + 16 * (done + k), 2)
            slots[slot + BODY_NUMBERS] = which[0]
            slots[slot + BODY_NUMBERS + 1] = which[1]
        rows_a = 0 if once_a else body_of(block, k, 0).n_parts
        rows_b = 0 if once_b else body_of(block, k, 1).n_parts
        if n_rows + rows_a + rows_b > header[CAPACITY]:
            break
        slots[slot + BODY_ROWS] = 0 if once_a else k
        slots[slot + BODY_ROWS + 1] = BLOCK + (0 if once_b else k)
        slots[slot + PART_ROWS] = slots[PART_ROWS] if once_a else 2 * BLOCK + n_rows
        slots[slot + PART_ROWS + 1] = slots[PART_ROWS + 1] if once_b else 2 * BLOCK + n_rows + rows_a
        slots[slot + IS_HIT] = 0
        n_rows += rows_a + rows_b
        for which in range(2):
            body = body_of(block, k, which)
            if body.n_parts == 1 and part_view(block, body.first + 1)[PART * body.first + TURNED] == 0.0:
                slots[slot + PART_ROWS + which] = body.row  # the part stands where the body does
                block.shape_of[body.row] = body.first
        if not once_a:
            good = set_pose(block.poses, k * POSE, view_f64(XA_at + 8 * step_a * (done + k), 16), check) and good
        if not once_b:
            good = (
                set_pose(block.poses, (BLOCK + k) * POSE, view_f64(XB_at + 8 * step_b * (done + k), 16), check) and good
            )
        k += 1
    for row in range(2 * BLOCK, 2 * BLOCK + n_rows):
        block.shape_of[row] = -1  # not placed yet
    header[N_POSES] = k
    return good


@kernel
def row_of_part(block, k, which, part, exactly):
    """Row of poses of a part of a body of slot k, placed when first wanted; exactly: with low parts."""
    body = body_of(block, k, which)
    row = body.part_rows + part
    if block.shape_of[row] < 0:
        number = body.first + part
        block.shape_of[row] = number
        place_part(
            block.poses, POSE * row, POSE * body.row, part_view(block, number + 1), PART * number,
            terms_at(block, row) if exactly else 0,
        )
    return row


@kernel(inline=True)
def terms_at(block, row):
    return block.header[TERMS_AT] + 8 * TERM_ROW * row
