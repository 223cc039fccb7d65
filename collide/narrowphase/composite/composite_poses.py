"""Two bodies of several convex parts at many pairs of poses: from matrices to answers inside kernels.

Most pairs of parts are far apart, and balls around them say so. The pair whose balls are nearest is asked first; then
those that may be nearer than its answer, or may overlap; of booleans, those whose balls overlap, and none after a hit,
nor where no depth is wanted.
What is asked of a pose depends on that pose alone, and so does its answer.

Pairs of parts are put on a list, which the narrowphase answers where it was compiled (`kernels.native_call`). A list goes
over many poses, since gaps are finished eight at a time. Where rows of it are left open, Python has the exact stage
settle them and calls again: the header holds how far things have come.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, native_call, view_f64, view_i32, view_i64, view_u8
from collide.lowering.compound_table import BALL_IN_WORLD, BODY, BODY_REACH, CENTRE, COUNT, FIRST, PART, TURNED
from collide.lowering.place_parts import BALL_MARGIN, gap_of_balls, place_ball, place_part, write_terms
from collide.lowering.shape_table import INTS, NUMBERS, POSE, POSE_STRETCH, POSE_TERMS, TERM_ROW
from collide.narrowphase.composite.composite_rows import (
    SCORE,
    add_row,
    begin_score,
    close_score,
    copy_row,
    find_way_out,
    first_upper_of,
)
from collide.narrowphase.convex_pairs import SIGNATURE
from collide.narrowphase.exact.depth_requests import ROWS_PER_BATCH
from collide.narrowphase.pose_batches import set_pose
from collide.narrowphase.rows import HIT, HOW, PART_A, PART_B, ROW
from collide.results import REFUSED, UNDECIDED

answer_at = native_call(SIGNATURE)

#: Poses that go through together, and pairs of parts on a list.
BLOCK = 64
LIST = ROWS_PER_BATCH

#: What `answer_unions` says besides 0: rows of the list are open, or a pose is no pose.
OPEN, BAD_POSE = range(1, 3)

# Header: the kernel, tables of shapes, parts and bodies; the workspace, and how many rows of parts it has room for; how far
# things have come, 0 to begin with, and how many pairs of parts were asked.
(
    CORE, INTS_AT, NUMBERS_AT, PARTS_AT, BODIES_AT, BODY_BALLS_AT,
    POSES_AT, TERMS_AT, SHAPE_OF_AT, PAIRS_AT, OWNERS_AT, ROWS_AT, SCORES_AT, SLOTS_AT, BALLS_AT, DOUBLES_AT, INTEGERS_AT, ROOM,
    DONE, POSES, STAGE, SLOT, PAIR, LISTED, ASKED,
) = range(25)  # fmt: skip
HEADER = 25

_LAY_OUT, _NEAREST, _OTHERS = range(3)

# Integers of a slot, which is a pose of the block: both bodies, rows of poses of theirs and where those of their parts
# begin, whether a boolean is a hit, and the pair of parts asked first, −1 where balls say that none meets.
_BODIES, _OWN, _PARTS_OF, _IS_HIT, _ASKED_FIRST = 0, 2, 4, 6, 7
_SLOT = 8
SLOTS = _SLOT * BLOCK

#: Pairs of parts whose balls are farther apart than the best so far by this much of the bodies' size are left out: far more
#: than brackets of curved parts are wide, so that they have no say in any number of the answer.
_BRACKET = 2.0**-20


@kernel
def _lay_out(header, which_at, XA_at, step_a, XB_at, step_b, n, check):
    """Fill the block with poses from DONE on, as many as have room; False where one is no pose."""
    poses = view_f64(header[POSES_AT], POSE * 2 * BLOCK)
    slots = view_i64(header[SLOTS_AT], SLOTS)
    shape_of = view_i64(header[SHAPE_OF_AT], 2 * BLOCK + header[ROOM])
    done = header[DONE]
    used = k = 0
    good = True
    while k < BLOCK and done + k < n:
        # A pose of one body that goes with all of the other's is laid out once.
        once_a = k > 0 and step_a == 0 and which_at == 0
        once_b = k > 0 and step_b == 0 and which_at == 0
        a = 0
        b = 1
        if which_at != 0:
            which = view_i64(which_at + 16 * (done + k), 2)
            a = which[0]
            b = which[1]
        bodies = view_i64(header[BODIES_AT], 2 * (max(a, b) + 1))
        wanted_a = 0 if once_a else bodies[2 * a + COUNT]
        wanted_b = 0 if once_b else bodies[2 * b + COUNT]
        if used + wanted_a + wanted_b > header[ROOM]:
            break
        slot = _SLOT * k
        slots[slot + _BODIES] = a
        slots[slot + _BODIES + 1] = b
        slots[slot + _OWN] = 0 if once_a else k
        slots[slot + _OWN + 1] = BLOCK + (0 if once_b else k)
        slots[slot + _PARTS_OF] = slots[_PARTS_OF] if once_a else 2 * BLOCK + used
        slots[slot + _PARTS_OF + 1] = slots[_PARTS_OF + 1] if once_b else 2 * BLOCK + used + wanted_a
        slots[slot + _IS_HIT] = 0
        used += wanted_a + wanted_b
        for body in range(2):
            first, count, _, own = _parts_of(header, slot, body)
            if count == 1 and view_f64(header[PARTS_AT], PART * (first + 1))[PART * first + TURNED] == 0.0:
                slots[slot + _PARTS_OF + body] = own  # the part stands where the body does
                shape_of[own] = first
        if not once_a:
            good = set_pose(poses, k * POSE, view_f64(XA_at + 8 * step_a * (done + k), 16), check) and good
        if not once_b:
            good = set_pose(poses, (BLOCK + k) * POSE, view_f64(XB_at + 8 * step_b * (done + k), 16), check) and good
        k += 1
    for row in range(2 * BLOCK, 2 * BLOCK + used):
        shape_of[row] = -1  # nobody has asked yet where that part stands
    header[POSES] = k
    return good


@kernel(inline=True)
def _parts_of(header, slot, body):
    """(first part, number of parts, rows of poses where they begin, row of the body's own) of body 0 or 1."""
    slots = view_i64(header[SLOTS_AT], SLOTS)
    number = slots[slot + _BODIES + body]
    bodies = view_i64(header[BODIES_AT], 2 * (number + 1))
    return bodies[2 * number + FIRST], bodies[2 * number + COUNT], slots[slot + _PARTS_OF + body], slots[slot + _OWN + body]


@kernel(inline=True)
def _pairs_of(header, slot):
    """How many pairs of parts two bodies make."""
    slots = view_i64(header[SLOTS_AT], SLOTS)
    a = slots[slot + _BODIES]
    b = slots[slot + _BODIES + 1]
    bodies = view_i64(header[BODIES_AT], 2 * (max(a, b) + 1))
    return bodies[2 * a + COUNT] * bodies[2 * b + COUNT]


@kernel
def _row_of_part(header, slot, body, k, exactly):
    """Row of poses of part k of a body, placed when first asked for; exactly: with low parts."""
    first, _, rows, own = _parts_of(header, slot, body)
    row = rows + k
    shape_of = view_i64(header[SHAPE_OF_AT], row + 1)
    if shape_of[row] < 0:
        shape_of[row] = first + k
        place_part(
            view_f64(header[POSES_AT], POSE * (row + 1)), POSE * row, POSE * own,
            view_f64(header[PARTS_AT], PART * (first + k + 1)), PART * (first + k), _terms_of(header, row) if exactly else 0,
        )  # fmt: skip
    return row


@kernel(inline=True)
def _terms_of(header, row):
    return header[TERMS_AT] + 8 * TERM_ROW * row


# --- balls --------------------------------------------------------------------------------------


@kernel
def _place_whole(header, slot):
    """Balls 0 and 1 become those of all of A and of all of B, as seen from A; returns how large the pair is."""
    slots = view_i64(header[SLOTS_AT], SLOTS)
    poses = view_f64(header[POSES_AT], POSE * 2 * BLOCK)
    balls = view_f64(header[BALLS_AT], 2 * BALL_IN_WORLD)
    p = POSE * slots[slot + _OWN]
    q = POSE * slots[slot + _OWN + 1]
    a = BODY * slots[slot + _BODIES]
    b = BODY * slots[slot + _BODIES + 1]
    numbers = view_f64(header[BODY_BALLS_AT], max(a, b) + BODY)
    x = poses[q + 9] - poses[p + 9]
    y = poses[q + 10] - poses[p + 10]
    z = poses[q + 11] - poses[p + 11]
    place_ball(poses, p, numbers, a, 0.0, 0.0, 0.0, balls, 0)
    place_ball(poses, q, numbers, b, x, y, z, balls, BALL_IN_WORLD)
    reach = numbers[a + BODY_REACH] * max(poses[p + POSE_STRETCH], 1.0) + numbers[b + BODY_REACH] * max(poses[q + POSE_STRETCH], 1.0)
    return reach + (abs(x) + abs(y) + abs(z))


@kernel
def _place_balls(header, slot):
    """Balls 2, 3, … become those of the parts of A, then of B."""
    poses = view_f64(header[POSES_AT], POSE * 2 * BLOCK)
    first_a, count_a, _, own_a = _parts_of(header, slot, 0)
    first_b, count_b, _, own_b = _parts_of(header, slot, 1)
    p = POSE * own_a
    q = POSE * own_b
    parts = view_f64(header[PARTS_AT], PART * max(first_a + count_a, first_b + count_b))
    balls = view_f64(header[BALLS_AT], (2 + count_a + count_b) * BALL_IN_WORLD)
    for k in range(count_a):
        place_ball(poses, p, parts, PART * (first_a + k) + CENTRE, 0.0, 0.0, 0.0, balls, (2 + k) * BALL_IN_WORLD)
    x = poses[q + 9] - poses[p + 9]
    y = poses[q + 10] - poses[p + 10]
    z = poses[q + 11] - poses[p + 11]
    for k in range(count_b):
        at = (2 + count_a + k) * BALL_IN_WORLD
        place_ball(poses, q, parts, PART * (first_b + k) + CENTRE, x, y, z, balls, at)


@kernel
def _nearest_pair(header, slot, boolean):
    """The pair of parts whose balls are nearest; −1 of booleans where no balls meet."""
    pairs = _pairs_of(header, slot)
    if pairs == 1 and not boolean:
        return 0
    margin = BALL_MARGIN * _place_whole(header, slot)
    balls = view_f64(header[BALLS_AT], (2 + header[ROOM]) * BALL_IN_WORLD)
    if boolean and gap_of_balls(balls, 0, BALL_IN_WORLD) > margin:
        return -1
    if pairs == 1:
        return 0
    _, count_a, _, _ = _parts_of(header, slot, 0)
    _, count_b, _, _ = _parts_of(header, slot, 1)
    _place_balls(header, slot)
    least = math.inf
    nearest = -1
    for i in range(count_a):
        of_a = (2 + i) * BALL_IN_WORLD
        if count_b > 1 and gap_of_balls(balls, of_a, BALL_IN_WORLD) - margin > least:
            continue
        for j in range(count_b):
            gap = gap_of_balls(balls, of_a, (2 + count_a + j) * BALL_IN_WORLD)
            if gap < least or nearest < 0:
                least = gap
                nearest = i * count_b + j
    return -1 if boolean and least > margin else nearest


# --- lists --------------------------------------------------------------------------------------


@kernel(inline=True)
def _put_down(header, slot_number, count_b, pair, boolean, listed):
    """Put a pair of parts of a pose on the list."""
    pairs = view_i64(header[PAIRS_AT], 2 * LIST)
    owners = view_i64(header[OWNERS_AT], 2 * LIST)
    slot = _SLOT * slot_number
    pairs[2 * listed] = _row_of_part(header, slot, 0, pair // count_b, not boolean)
    pairs[2 * listed + 1] = _row_of_part(header, slot, 1, pair % count_b, not boolean)
    owners[2 * listed] = slot_number
    owners[2 * listed + 1] = pair


@kernel
def _list_nearest(header, boolean, every):
    """List one pair of parts a pose; returns how many there are."""
    slots = view_i64(header[SLOTS_AT], SLOTS)
    listed = 0
    for k in range(header[POSES]):
        pair = 0 if every else _nearest_pair(header, _SLOT * k, boolean)
        slots[_SLOT * k + _ASKED_FIRST] = pair
        if pair >= 0:
            _, count_b, _, _ = _parts_of(header, _SLOT * k, 1)
            _put_down(header, k, count_b, pair, boolean, listed)
            listed += 1
    header[SLOT] = header[POSES]
    return listed


@kernel
def _list_others(header, boolean, depths, every):
    """List the other pairs of parts that have a say, from SLOT and PAIR on, until the list is full; returns how many."""
    slots = view_i64(header[SLOTS_AT], SLOTS)
    listed = 0
    scores = view_f64(header[SCORES_AT], SCORE * BLOCK)
    while header[SLOT] < header[POSES] and listed < LIST:
        k = header[SLOT]
        slot = _SLOT * k
        pairs = _pairs_of(header, slot)
        met = not boolean and not depths and first_upper_of(scores, SCORE * k) <= 0.0
        if pairs > 1 and not met and slots[slot + _ASKED_FIRST] >= 0 and slots[slot + _IS_HIT] == 0:
            listed = _list_others_of(header, k, boolean, every, listed)
        else:
            header[PAIR] = pairs
        if header[PAIR] == pairs:
            header[PAIR] = 0
            header[SLOT] = k + 1
    return listed


@kernel
def _list_others_of(header, k, boolean, every, listed):
    """The same of one pose, from PAIR on; PAIR becomes the one to go on with."""
    _, count_a, _, _ = _parts_of(header, _SLOT * k, 0)
    _, count_b, _, _ = _parts_of(header, _SLOT * k, 1)
    size = _place_whole(header, _SLOT * k)
    _place_balls(header, _SLOT * k)
    balls = view_f64(header[BALLS_AT], (2 + count_a + count_b) * BALL_IN_WORLD)
    within = BALL_MARGIN * size
    if every:
        within = math.inf
    elif not boolean:
        within += max(first_upper_of(view_f64(header[SCORES_AT], SCORE * BLOCK), SCORE * k), 0.0) + _BRACKET * size
    asked_first = view_i64(header[SLOTS_AT], SLOTS)[_SLOT * k + _ASKED_FIRST]
    start = header[PAIR]
    for i in range(start // count_b, count_a):
        of_a = (2 + i) * BALL_IN_WORLD
        if count_b > 1 and gap_of_balls(balls, of_a, BALL_IN_WORLD) > within:
            continue
        for j in range(start % count_b if i == start // count_b else 0, count_b):
            pair = i * count_b + j
            if pair == asked_first or gap_of_balls(balls, of_a, (2 + count_a + j) * BALL_IN_WORLD) > within:
                continue
            if listed == LIST:
                header[PAIR] = pair
                return listed
            _put_down(header, k, count_b, pair, boolean, listed)
            listed += 1
    header[PAIR] = count_a * count_b
    return listed


@kernel
def _answer_list(header, listed, boolean, depths, limit):
    """Answer the pairs on the list; whether rows are left open."""
    rows_at = header[ROWS_AT]
    rows = view_i64(rows_at, LIST * ROW // 8)
    for k in range(listed * ROW // 8):
        rows[k] = 0
    answer_at(
        header[CORE],
        (
            header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], header[TERMS_AT], header[SHAPE_OF_AT], header[PAIRS_AT],
            listed, boolean, depths, False, limit, rows_at, header[DOUBLES_AT], header[INTEGERS_AT],
        ),
    )  # fmt: skip
    left_open = False
    for k in range(listed):
        marks = view_u8(rows_at + ROW * k, ROW)
        left_open = left_open or marks[HOW] == UNDECIDED or marks[HOW] == REFUSED
    return left_open


@kernel
def _write_terms_of_list(header, listed):
    """Have the exact terms of all poses on the list, which nobody needs until integers are to decide."""
    pairs = view_i64(header[PAIRS_AT], 2 * LIST)
    owners = view_i64(header[OWNERS_AT], 2 * LIST)
    for k in range(2 * listed):
        slot = _SLOT * owners[k - k % 2]
        body = k % 2
        row = pairs[k]
        first, _, rows, own = _parts_of(header, slot, body)
        poses = view_f64(header[POSES_AT], POSE * (row + 1))
        if poses[POSE * row + POSE_TERMS] >= 0.0:
            part = first + row - rows
            write_terms(poses, POSE * own, view_f64(header[PARTS_AT], PART * (part + 1)), PART * part, _terms_of(header, row))


# --- answers ------------------------------------------------------------------------------------


@kernel
def _take_rows(header, boolean, out_at):
    """Have the rows of the list tell what they say of their poses."""
    slots = view_i64(header[SLOTS_AT], SLOTS)
    scores = view_f64(header[SCORES_AT], SCORE * BLOCK)
    owners = view_i64(header[OWNERS_AT], 2 * LIST)
    for listed in range(header[LISTED]):
        row_at = header[ROWS_AT] + ROW * listed
        k = owners[2 * listed]
        if boolean:
            if view_u8(row_at, ROW)[HIT] != 0:
                slots[_SLOT * k + _IS_HIT] = 1
            continue
        out = out_at + ROW * (header[DONE] + k)
        if _pairs_of(header, _SLOT * k) == 1:
            copy_row(row_at, out)
            continue
        _, count_b, _, _ = _parts_of(header, _SLOT * k, 1)
        pair = owners[2 * listed + 1]
        words = view_i32(row_at, ROW // 4)
        words[PART_A] = pair // count_b
        words[PART_B] = pair % count_b
        add_row(scores, SCORE * k, row_at, pair, out)
    header[LISTED] = 0


@kernel
def _close_block(header, boolean, depths, out_at):
    """Write what is left to write of the answers of the block."""
    slots = view_i64(header[SLOTS_AT], SLOTS)
    scores = view_f64(header[SCORES_AT], SCORE * BLOCK)
    for k in range(header[POSES]):
        if boolean:
            view_u8(out_at + header[DONE] + k, 1)[0] = slots[_SLOT * k + _IS_HIT]
            continue
        if _pairs_of(header, _SLOT * k) == 1:
            continue
        row_at = out_at + ROW * (header[DONE] + k)
        overlap = close_score(scores, SCORE * k, row_at)
        first_a, count_a, rows_a, _ = _parts_of(header, _SLOT * k, 0)
        first_b, count_b, rows_b, _ = _parts_of(header, _SLOT * k, 1)
        if not (overlap and depths):
            continue
        for part in range(count_a):
            _row_of_part(header, _SLOT * k, 0, part, False)
        for part in range(count_b):
            _row_of_part(header, _SLOT * k, 1, part, False)
        last = max(rows_a + count_a, rows_b + count_b)
        shapes = max(first_a + count_a, first_b + count_b)
        find_way_out(
            scores, SCORE * k, row_at, view_i64(header[INTS_AT], INTS * shapes), view_f64(header[NUMBERS_AT], NUMBERS * shapes),
            view_f64(header[POSES_AT], POSE * last), view_i64(header[SHAPE_OF_AT], last), rows_a, count_a, rows_b, count_b,
        )  # fmt: skip


#: How `answer_unions` is called.
UNIONS_SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, boolean, float64, boolean, boolean, int64)"
)


@entry(UNIONS_SIGNATURE)
def answer_unions(header_at, which_at, XA_at, step_a, XB_at, step_b, n, boolean, depths, limit, check, every, out_at):
    """Answer n pairs of poses of two bodies, or of n pairs of bodies; 0, OPEN or BAD_POSE.

    header : HEADER integers. Where it stops OPEN, the first [LISTED] rows and pairs of the list are for the exact stage, and
        the next call goes on.
    which : 0 for bodies 0 and 1, or two bodies a pose.   XA, XB : matrices; step 16 or, for a single pose, 0.
    depths : as in `answer_pairs`; without them bodies that overlap get the row of parts that do.
    limit : farther apart than this is not looked at.   check : refuse matrices that are no rotation.
    every : leave nothing to balls, and stop after every list: tests want the exact stage to have it all.
    out : booleans: a byte a pose; else a row of PAIR_DTYPE a pose, zeroed.
    """
    header = view_i64(header_at, HEADER)
    while True:
        if header[LISTED] > 0:
            _take_rows(header, boolean, out_at)
        if header[STAGE] == _LAY_OUT:
            if header[DONE] >= n:
                return 0
            if not _lay_out(header, which_at, XA_at, step_a, XB_at, step_b, n, check):
                return BAD_POSE
            for k in range(0 if boolean else header[POSES]):
                begin_score(view_f64(header[SCORES_AT], SCORE * BLOCK), SCORE * k)
            header[STAGE] = _NEAREST
            header[SLOT] = 0
            header[PAIR] = 0
        elif header[SLOT] == header[POSES]:
            header[SLOT] = 0
            header[STAGE] += 1
            if header[STAGE] > _OTHERS:
                _close_block(header, boolean, depths, out_at)
                header[DONE] += header[POSES]
                header[STAGE] = _LAY_OUT
                continue
        if header[STAGE] == _NEAREST:
            listed = _list_nearest(header, boolean, every)
        else:
            listed = _list_others(header, boolean, depths, every)
        header[LISTED] = listed
        header[ASKED] += listed
        if listed > 0 and (_answer_list(header, listed, boolean, depths, limit) or every):
            _write_terms_of_list(header, listed)
            return OPEN
