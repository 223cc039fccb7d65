"""Two bodies of several convex parts at many pairs of poses: from matrices to answers inside kernels.

Most pairs of parts are far apart, and balls around them say so. The pair with the nearest balls is answered first;
then the pairs that may be nearer than its answer, or may overlap; of booleans, pairs with overlapping balls. A hit
ends a boolean, and a query without depths.
The pairs answered at a pose depend on the pose alone, and so does the answer.

Pairs of parts are put on a list, answered by the narrowphase where it was compiled (`kernels.native_call`). A list
goes over many poses, since gaps are refined eight at a time. Where rows of a list are undecided, Python has the exact
stage settle them and calls again: the header holds the progress.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import entry, kernel, native_call, view_f64, view_i32, view_i64, view_u8
from collide.lowering.compound_table import BALL_IN_WORLD, BODY, BODY_REACH, CENTRE, GROUP, GROUP_BALL, PART
from collide.lowering.place_parts import BALL_MARGIN, gap_of_balls, place_ball, write_terms
from collide.lowering.shape_table import INTS, NUMBERS, POSE, POSE_STRETCH, POSE_TERMS
from collide.narrowphase.composite.composite_block import (
    BODY_BALLS_AT,
    BODY_NUMBERS,
    BODY_ROWS,
    BY_PLACE_AT,
    CAPACITY,
    CORE,
    DOUBLES_AT,
    FIRST_PAIR,
    GROUPS_AT,
    INTEGERS_AT,
    INTS_AT,
    IS_HIT,
    LIST,
    N_ANSWERED,
    N_DONE,
    N_LISTED,
    N_POSES,
    NUMBERS_AT,
    PAIR,
    PAIRS_AT,
    POSES_AT,
    ROWS_AT,
    SHAPE_OF_AT,
    SLOT,
    SLOT_SIZE,
    STAGE,
    TERMS_AT,
    Body,
    body_of,
    count_pairs,
    lay_out,
    open_block,
    part_view,
    row_of_part,
    terms_at,
)
from collide.narrowphase.composite.composite_rows import (
    SCORE,
    PosedParts,
    add_row,
    begin_score,
    close_score,
    copy_row,
    first_reach_of,
    separate_bodies,
)
from collide.narrowphase.pair_kernel import SIGNATURE
from collide.narrowphase.rows import HIT, HOW, PART_A, PART_B, ROW
from collide.numerics.vec3 import Vec3, norm1, sub, vec3_at
from collide.results import REFUSED, UNDECIDED

answer_at = native_call(SIGNATURE)

#: What `answer_compounds` returns besides 0: rows of the list are undecided, or a pose is no pose.
OPEN, BAD_POSE = range(1, 3)

_LAY_OUT, _NEAREST, _OTHERS = range(3)

#: Pairs of parts whose balls are farther apart than the best so far by this much of the bodies' size are left out: far
#: more than brackets of curved parts are wide, so that they have no say in any number of the answer.
_BRACKET = 2.0**-20


# --- balls --------------------------------------------------------------------------------------


@kernel(inline=True)
def _shift(block, p, q):
    """Origin of B's frame from that of A's, by where rows of poses begin."""
    return sub(vec3_at(block.poses, q + 9), vec3_at(block.poses, p + 9))


@kernel
def _place_body_balls(block, k):
    """Balls 0 and 1 become those of all of A and of all of B, as seen from A; returns how large the pair is [m]."""
    p = POSE * block.slots[SLOT_SIZE * k + BODY_ROWS]
    q = POSE * block.slots[SLOT_SIZE * k + BODY_ROWS + 1]
    a = BODY * block.slots[SLOT_SIZE * k + BODY_NUMBERS]
    b = BODY * block.slots[SLOT_SIZE * k + BODY_NUMBERS + 1]
    numbers = view_f64(block.header[BODY_BALLS_AT], max(a, b) + BODY)
    return place_two_balls(block.poses, p, q, numbers, a, numbers, b, block.balls)


@kernel
def place_two_balls(poses, p, q, of_a, a, of_b, b, balls):
    """Place the balls of two bodies as the first two, relative to the first body's origin; returns the pair's size [m].

    p, q : where the bodies' rows of poses begin.   of_a, of_b : numbers of bodies, from places a and b on.
    """
    shift = sub(vec3_at(poses, q + 9), vec3_at(poses, p + 9))
    place_ball(poses, p, of_a, a, 0.0, 0.0, 0.0, balls, 0)
    place_ball(poses, q, of_b, b, shift.x, shift.y, shift.z, balls, BALL_IN_WORLD)
    reach_a = of_a[a + BODY_REACH] * max(poses[p + POSE_STRETCH], 1.0)
    reach_b = of_b[b + BODY_REACH] * max(poses[q + POSE_STRETCH], 1.0)
    return reach_a + reach_b + norm1(shift)


class Groups(NamedTuple):
    """The groups of both bodies of a slot, and places of balls in the block: of A's groups from ``a`` on, of A's parts,
    by place, from ``parts_a`` on; of B's likewise.

    cut : groups farther apart hold no pair that counts [m].   margin : how much less the distance of two parts' balls
        may be than the distance of their groups' balls [m].
    """

    A: Body
    B: Body
    n_a: int
    n_b: int
    a: int
    b: int
    parts_a: int
    parts_b: int
    cut: float
    margin: float


@kernel
def _groups_of(block, k, cut, margin):
    """The groups of both bodies of slot k, whether placed or not."""
    A = body_of(block, k, 0)
    B = body_of(block, k, 1)
    n_a = (A.n_parts + GROUP - 1) // GROUP
    n_b = (B.n_parts + GROUP - 1) // GROUP
    parts_b = 2 + A.n_parts
    a = parts_b + B.n_parts
    return Groups(A, B, n_a, n_b, a, a + n_a, 2, parts_b, cut, margin)


@kernel
def _place_groups(block, k, cut, margin):
    """Place the balls of all groups; those of their parts are placed when they are first wanted."""
    groups = _groups_of(block, k, cut, margin)
    A, B = groups.A, groups.B
    _place_groups_of(block, A, groups.n_a, groups.a, groups.parts_a, Vec3(0.0, 0.0, 0.0))
    _place_groups_of(
        block, B, groups.n_b, groups.b, groups.parts_b, _shift(block, POSE * A.row, POSE * B.row)
    )
    return groups


@kernel(inline=True)
def _place_groups_of(block, body, n, first, parts, shift):
    groups = view_f64(block.header[GROUPS_AT], GROUP_BALL * (body.first_group + n))
    for k in range(n):
        numbers_at = GROUP_BALL * (body.first_group + k)
        ball_at = (first + k) * BALL_IN_WORLD
        place_ball(block.poses, POSE * body.row, groups, numbers_at, shift.x, shift.y, shift.z, block.balls, ball_at)
        block.balls[(parts + GROUP * k) * BALL_IN_WORLD + 3] = math.nan  # its parts are not placed yet


@kernel
def _open_group(block, body, group, first, shift):
    """Have the balls of a group's parts; ``first`` is that of the body's first by place."""
    start = GROUP * group
    if not math.isnan(block.balls[(first + start) * BALL_IN_WORLD + 3]):
        return
    parts = part_view(block, body.first + body.n_parts)
    by_place = view_i64(block.header[BY_PLACE_AT], body.first + body.n_parts)
    for place in range(start, min(start + GROUP, body.n_parts)):
        numbers_at = PART * (body.first + by_place[body.first + place]) + CENTRE
        ball_at = (first + place) * BALL_IN_WORLD
        place_ball(block.poses, POSE * body.row, parts, numbers_at, shift.x, shift.y, shift.z, block.balls, ball_at)


@kernel(inline=True)
def _gap(block, i, j):
    """The distance of balls i and j [m]."""
    return gap_of_balls(block.balls, i * BALL_IN_WORLD, j * BALL_IN_WORLD)


@kernel
def _nearest_of_groups(block, groups, a, b, least, nearest):
    """(least distance of balls, pair of parts) after the parts of groups a and b; of equals the first pair counts."""
    A, B = groups.A, groups.B
    _open_group(block, A, a, groups.parts_a, Vec3(0.0, 0.0, 0.0))
    _open_group(block, B, b, groups.parts_b, _shift(block, POSE * A.row, POSE * B.row))
    of_a = view_i64(block.header[BY_PLACE_AT], A.first + A.n_parts)
    of_b = view_i64(block.header[BY_PLACE_AT], B.first + B.n_parts)
    for i in range(GROUP * a, min(GROUP * (a + 1), A.n_parts)):
        if _gap(block, groups.parts_a + i, groups.b + b) - groups.margin > min(least, groups.cut):
            continue
        for j in range(GROUP * b, min(GROUP * (b + 1), B.n_parts)):
            gap = _gap(block, groups.parts_a + i, groups.parts_b + j)
            if gap <= least or nearest < 0:
                pair = of_a[A.first + i] * B.n_parts + of_b[B.first + j]
                if gap < least or nearest < 0 or pair < nearest:
                    least = gap
                    nearest = pair
    return least, nearest


@kernel
def _nearest_pair(block, k, boolean):
    """The pair of parts of slot k with the nearest balls; −1 of booleans where no balls meet.

    Groups of parts whose balls are farther apart than the nearest pair so far hold no nearer pair.
    """
    n_pairs = count_pairs(block, k)
    if n_pairs == 1 and not boolean:
        return 0
    margin = BALL_MARGIN * _place_body_balls(block, k)
    if boolean and _gap(block, 0, 1) > margin:
        return -1
    if n_pairs == 1:
        return 0
    groups = _place_groups(block, k, margin if boolean else math.inf, margin)
    least_of_groups = math.inf
    first_a = first_b = 0
    for a in range(groups.n_a):
        if _gap(block, groups.a + a, 1) > least_of_groups:
            continue
        for b in range(groups.n_b):
            gap = _gap(block, groups.a + a, groups.b + b)
            if gap < least_of_groups:
                least_of_groups = gap
                first_a = a
                first_b = b
    least, nearest = _nearest_of_groups(block, groups, first_a, first_b, math.inf, -1)
    for a in range(groups.n_a):
        if groups.n_b > 1 and _gap(block, groups.a + a, 1) - margin > min(least, groups.cut):
            continue
        for b in range(groups.n_b):
            is_first = a == first_a and b == first_b
            if not is_first and _gap(block, groups.a + a, groups.b + b) - margin <= min(least, groups.cut):
                least, nearest = _nearest_of_groups(block, groups, a, b, least, nearest)
    return -1 if boolean and least > margin else nearest


@kernel
def _gap_of_pair(block, groups, pair):
    """The distance of the balls of a pair of parts [m]."""
    A, B = groups.A, groups.B
    at = 2 + 2 * block.header[CAPACITY]
    of_a, of_b = A.first + pair // B.n_parts, B.first + pair % B.n_parts
    parts = part_view(block, max(of_a, of_b) + 1)
    shift = _shift(block, POSE * A.row, POSE * B.row)
    ball_a, ball_b = at * BALL_IN_WORLD, (at + 1) * BALL_IN_WORLD
    place_ball(block.poses, POSE * A.row, parts, PART * of_a + CENTRE, 0.0, 0.0, 0.0, block.balls, ball_a)
    place_ball(block.poses, POSE * B.row, parts, PART * of_b + CENTRE, shift.x, shift.y, shift.z, block.balls, ball_b)
    return _gap(block, at, at + 1)


@kernel
def _sort_near(near, first, n, half):
    """Sort n numbers of the list of near parts from ``first`` on, and with them their balls' places, ``half`` behind:
    Shell's sort with Knuth's gaps, O(n^1.5)."""
    gap = 1
    while gap < n:
        gap = 3 * gap + 1
    while gap > 1:
        gap //= 3
        for k in range(gap, n):
            number = near[first + k]
            place = near[half + first + k]
            j = k
            while j >= gap and near[first + j - gap] > number:
                near[first + j] = near[first + j - gap]
                near[half + first + j] = near[half + first + j - gap]
                j -= gap
            near[first + j] = number
            near[half + first + j] = place


@kernel
def _list_near_parts(block, groups, of_b, reach, first):
    """List the near parts of A, or of B: their numbers, ascending, from ``first`` on, and the places of their balls in
    the list's second half; returns how many they are.

    A part is left out where its group is farther than ``reach`` [m] from all groups of the other body, and where its
    ball is farther from the ball around the other body: all balls in the body's ball are as far away.
    """
    body = groups.B if of_b else groups.A
    n, at, n_others, others_at, parts = (
        (groups.n_b, groups.b, groups.n_a, groups.a, groups.parts_b) if of_b
        else (groups.n_a, groups.a, groups.n_b, groups.b, groups.parts_a)
    )
    shift = _shift(block, POSE * groups.A.row, POSE * groups.B.row) if of_b else Vec3(0.0, 0.0, 0.0)
    by_place = view_i64(block.header[BY_PLACE_AT], body.first + body.n_parts)
    half = block.header[CAPACITY]
    n_near = 0
    for group in range(n):
        is_near = False
        if _gap(block, at + group, 0 if of_b else 1) - groups.margin <= reach:
            for j in range(n_others):
                if _gap(block, at + group, others_at + j) - groups.margin <= reach:
                    is_near = True
                    break
        if not is_near:
            continue
        _open_group(block, body, group, parts, shift)
        for place in range(GROUP * group, min(GROUP * (group + 1), body.n_parts)):
            if _gap(block, parts + place, 0 if of_b else 1) - groups.margin <= reach:
                block.near[first + n_near] = by_place[body.first + place]
                block.near[half + first + n_near] = parts + place
                n_near += 1
    _sort_near(block.near, first, n_near, half)
    return n_near


# --- lists --------------------------------------------------------------------------------------


@kernel(inline=True)
def _list_pair(block, k, count_b, pair, exactly, n_listed):
    """Put a pair of parts of slot k on the list."""
    block.pairs[2 * n_listed] = row_of_part(block, k, 0, pair // count_b, exactly)
    block.pairs[2 * n_listed + 1] = row_of_part(block, k, 1, pair % count_b, exactly)
    block.owners[2 * n_listed] = k
    block.owners[2 * n_listed + 1] = pair


@kernel
def _list_nearest(block, boolean, every):
    """List a pair of parts a pose; returns the list's length."""
    n_listed = 0
    for k in range(block.header[N_POSES]):
        pair = 0 if every else _nearest_pair(block, k, boolean)
        block.slots[SLOT_SIZE * k + FIRST_PAIR] = pair
        if pair >= 0:
            _list_pair(block, k, body_of(block, k, 1).n_parts, pair, not boolean, n_listed)
            n_listed += 1
    block.header[SLOT] = block.header[N_POSES]
    return n_listed


@kernel
def _list_others(block, boolean, depths, every):
    """List the other pairs of parts that have a say, from SLOT and PAIR on, until the list is full; returns how
    many."""
    header, slots = block.header, block.slots
    n_listed = 0
    while header[SLOT] < header[N_POSES] and n_listed < LIST:
        k = header[SLOT]
        n_pairs = count_pairs(block, k)
        met = not boolean and not depths and first_reach_of(block.scores, SCORE * k) <= 0.0
        if n_pairs > 1 and not met and slots[SLOT_SIZE * k + FIRST_PAIR] >= 0 and slots[SLOT_SIZE * k + IS_HIT] == 0:
            n_listed = _list_others_of(block, k, boolean, every, n_listed)
        else:
            header[PAIR] = n_pairs
        if header[PAIR] == n_pairs:
            header[PAIR] = 0
            header[SLOT] = k + 1
    return n_listed


@kernel
def _list_others_of(block, k, boolean, every, n_listed):
    """List the other pairs of a pose, from PAIR on; PAIR becomes the pair to go on with. Returns the list's length."""
    header = block.header
    size = _place_body_balls(block, k)
    margin = BALL_MARGIN * size
    # The groups of a single pose stand where `_nearest_pair` has placed them just now.
    is_placed = header[N_POSES] == 1 and header[PAIR] == 0 and not every
    groups = _groups_of(block, k, math.inf, margin) if is_placed else _place_groups(block, k, math.inf, margin)
    first_pair = block.slots[SLOT_SIZE * k + FIRST_PAIR]
    reach = margin
    if every:
        reach = math.inf
    elif not boolean:
        # Others that are as near by their balls as the first: which of them came first has no say.
        reach += max(first_reach_of(block.scores, SCORE * k), _gap_of_pair(block, groups, first_pair), 0.0)
        reach += _BRACKET * size
    return _list_pairs(block, k, groups, reach, first_pair, not boolean, n_listed)


@kernel
def _list_pairs(block, k, groups, reach, but, exactly, n_listed):
    """List the pairs of parts of slot k whose balls come within ``reach`` [m], from PAIR on, ascending, without one;
    PAIR becomes the pair to go on with. Returns the list's length."""
    header = block.header
    count_a, count_b, balls = groups.A.n_parts, groups.B.n_parts, header[CAPACITY]
    n_near_a = _list_near_parts(block, groups, False, reach, 0)
    n_near_b = _list_near_parts(block, groups, True, reach, count_a)
    start = header[PAIR]
    for i in range(n_near_a):
        for j in range(count_a, count_a + n_near_b):
            pair = block.near[i] * count_b + block.near[j]
            gap = _gap(block, block.near[balls + i], block.near[balls + j])
            if pair < start or pair == but or gap > reach:
                continue
            if n_listed == LIST:
                header[PAIR] = pair
                return n_listed
            _list_pair(block, k, count_b, pair, exactly, n_listed)
            n_listed += 1
    header[PAIR] = count_a * count_b
    return n_listed


@kernel
def list_pairs_within(block, limit):
    """List the pairs of parts of slot 0 whose balls come within a limit [m], ascending, their rows of poses placed;
    returns how many, −1 of more than LIST.

    No part reaches out of its ball by more than the balls' margin of the size: parts of other pairs are farther apart
    than the limit.
    """
    margin = BALL_MARGIN * _place_body_balls(block, 0)
    reach = limit * (1.0 + 2.0**-50) + margin
    if _gap(block, 0, 1) > reach:
        return 0
    block.header[PAIR] = 0
    n = _list_pairs(block, 0, _place_groups(block, 0, math.inf, margin), reach, -1, False, 0)
    return n if block.header[PAIR] == count_pairs(block, 0) else -1


@kernel
def _answer_list(header, boolean, depths, limit):
    """Answer the pairs on the list; whether rows are undecided or refused."""
    rows_at = header[ROWS_AT]
    rows = view_i64(rows_at, LIST * ROW // 8)
    for k in range(header[N_LISTED] * ROW // 8):
        rows[k] = 0
    answer_at(
        header[CORE],
        (
            header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], header[TERMS_AT], header[SHAPE_OF_AT],
            header[PAIRS_AT],
            header[N_LISTED], boolean, depths, False, limit, rows_at, header[DOUBLES_AT], header[INTEGERS_AT],
        ),
    )
    is_open = False
    for k in range(header[N_LISTED]):
        marks = view_u8(rows_at + ROW * k, ROW)
        is_open = is_open or marks[HOW] == UNDECIDED or marks[HOW] == REFUSED
    return is_open


@kernel
def _write_terms_of_list(block):
    """Write the exact terms of all poses on the list, which only the exact stage reads."""
    for k in range(2 * block.header[N_LISTED]):
        body = body_of(block, block.owners[k - k % 2], k % 2)
        row = block.pairs[k]
        if block.poses[POSE * row + POSE_TERMS] >= 0.0:
            part = body.first + row - body.part_rows
            write_terms(block.poses, POSE * body.row, part_view(block, part + 1), PART * part, terms_at(block, row))


# --- answers ------------------------------------------------------------------------------------


@kernel
def _take_rows(block, boolean, out_at):
    """Take the rows of the list into account, each for its pose."""
    header = block.header
    for listed in range(header[N_LISTED]):
        row_at = header[ROWS_AT] + ROW * listed
        k = block.owners[2 * listed]
        if boolean:
            if view_u8(row_at, ROW)[HIT] != 0:
                block.slots[SLOT_SIZE * k + IS_HIT] = 1
            continue
        out = out_at + ROW * (header[N_DONE] + k)
        if count_pairs(block, k) == 1:
            copy_row(row_at, out)
            continue
        count_b = body_of(block, k, 1).n_parts
        pair = block.owners[2 * listed + 1]
        words = view_i32(row_at, ROW // 4)
        words[PART_A] = pair // count_b
        words[PART_B] = pair % count_b
        add_row(block.scores, SCORE * k, row_at, pair, out)
    header[N_LISTED] = 0


@kernel
def _close_block(block, boolean, depths, out_at):
    """Finish the answers of the block."""
    header = block.header
    for k in range(header[N_POSES]):
        if boolean:
            view_u8(out_at + header[N_DONE] + k, 1)[0] = block.slots[SLOT_SIZE * k + IS_HIT]
        elif count_pairs(block, k) > 1:
            row_at = out_at + ROW * (header[N_DONE] + k)
            if close_score(block.scores, SCORE * k, row_at) and depths:
                _separate_bodies_of(block, k, row_at)


@kernel
def _separate_bodies_of(block, k, row_at):
    """Have the depth of two bodies that overlap written, from all their parts."""
    A = body_of(block, k, 0)
    B = body_of(block, k, 1)
    for part in range(A.n_parts):
        row_of_part(block, k, 0, part, False)
    for part in range(B.n_parts):
        row_of_part(block, k, 1, part, False)
    last = max(A.part_rows + A.n_parts, B.part_rows + B.n_parts)
    n_shapes = max(A.first + A.n_parts, B.first + B.n_parts)
    parts = PosedParts(
        view_i64(block.header[INTS_AT], INTS * n_shapes), view_f64(block.header[NUMBERS_AT], NUMBERS * n_shapes),
        view_f64(block.header[POSES_AT], POSE * last), view_i64(block.header[SHAPE_OF_AT], last),
    )
    separate_bodies(
        block.scores, SCORE * k, row_at, parts, A.part_rows, A.n_parts, B.part_rows, B.n_parts,
        block.header[DOUBLES_AT],  # the narrowphase's workspace: its lists are answered
    )


#: How `answer_compounds` is called.
COMPOUNDS_SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, boolean, float64, boolean, boolean, int64)"
)


@entry(COMPOUNDS_SIGNATURE)
def answer_compounds(
    header_at, which_at, XA_at, step_a, XB_at, step_b, n, boolean, depths, limit, check, every, out_at
):
    """Answer n pairs of poses of two bodies, or of n pairs of bodies; 0, OPEN or BAD_POSE.

    header : HEADER integers. After OPEN, the first [N_LISTED] rows and pairs of the list are for the exact stage, and
        the next call goes on.
    which : 0 for bodies 0 and 1, or two bodies a pose.   XA, XB : matrices; step 16 or, for a single pose, 0.
    depths : as in `answer_pairs`; without depths overlapping bodies get the row of overlapping parts.
    limit : larger distances are not looked for [m].   check : refuse matrices that are no rotation.
    every : list all pairs whatever their balls, and stop after every list: tests of the exact stage.
    out : booleans: a byte a pose; else a row of PAIR_DTYPE a pose, zeroed.
    Arguments are flat: single calls come by address.
    """
    block = open_block(header_at)
    header = block.header
    while True:
        if header[N_LISTED] > 0:
            _take_rows(block, boolean, out_at)
        if header[STAGE] == _LAY_OUT:
            if header[N_DONE] >= n:
                return 0
            if not lay_out(block, which_at, XA_at, step_a, XB_at, step_b, n, check):
                return BAD_POSE
            for k in range(0 if boolean else header[N_POSES]):
                begin_score(block.scores, SCORE * k)
            header[STAGE] = _NEAREST
            header[SLOT] = 0
            header[PAIR] = 0
        elif header[SLOT] == header[N_POSES]:
            header[SLOT] = 0
            header[STAGE] += 1
            if header[STAGE] > _OTHERS:
                _close_block(block, boolean, depths, out_at)
                header[N_DONE] += header[N_POSES]
                header[STAGE] = _LAY_OUT
                continue
        if header[STAGE] == _NEAREST:
            header[N_LISTED] = _list_nearest(block, boolean, every)
        else:
            header[N_LISTED] = _list_others(block, boolean, depths, every)
        header[N_ANSWERED] += header[N_LISTED]
        if header[N_LISTED] > 0 and (_answer_list(header, boolean, depths, limit) or every):
            _write_terms_of_list(block)
            return OPEN
