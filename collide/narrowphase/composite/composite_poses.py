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
from collide.lowering.compound_table import (
    BALL_IN_WORLD,
    BODY,
    BODY_REACH,
    CENTRE,
    GROUP_BALL,
    HALF_SIZES,
    LARGEST_BALL,
    MEMBERS,
    MEMBERS_END,
    PART,
)
from collide.lowering.packed_convex import POINTS
from collide.lowering.place_parts import BALL_MARGIN, gap_of_balls, place_ball, write_terms
from collide.lowering.shape_table import (
    ADDRESS,
    INTS,
    KIND,
    NUMBERS,
    PADDED,
    POSE,
    POSE_STRETCH,
    POSE_TERMS,
    RADIUS,
    SLOP,
)
from collide.narrowphase.composite.composite_block import (
    AT_ONCE,
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
    MAX_NEAR,
    N_ANSWERED,
    N_DONE,
    N_LISTED,
    N_POSES,
    NUMBERS_AT,
    PAIR,
    PAIRS_AT,
    PARTS_AT,
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
    first_normal_of,
    first_reach_of,
    separate_bodies,
)
from collide.narrowphase.pair_kernel import SIGNATURE
from collide.narrowphase.rows import HIT, HOW, PART_A, PART_B, ROW
from collide.numerics.vec3 import (
    Vec3,
    add,
    column_at,
    dot,
    neg,
    norm,
    norm1,
    rotate,
    rotate_back,
    scale,
    sub,
    vec3_at,
)
from collide.results import REFUSED, UNDECIDED

answer_at = native_call(SIGNATURE)

#: What `answer_compounds` returns besides 0: rows of the list are undecided, or a pose is no pose.
OPEN, BAD_POSE = range(1, 3)

_LAY_OUT, _NEAREST, _OTHERS = range(3)

#: Pairs of parts whose balls are farther apart than the best so far by this much of the bodies' size are left out: far
#: more than brackets of curved parts are wide, so that they have no say in any number of the answer.
_BRACKET = 2.0**-20
#: Of a ball in the world: how far its contents reach along a direction.
ALONG = 4
#: Parts of more points are left to the narrowphase.
_MAX_LISTED = 16
#: Centres nearer than this give no direction [m].
_LEAST_LENGTH = 1e-100


# --- balls --------------------------------------------------------------------------------------


@kernel(inline=True)
def _shift(block, p, q):
    """Origin of B's frame from that of A's, by where rows of poses begin."""
    return sub(vec3_at(block.poses, q + 9), vec3_at(block.poses, p + 9))


@kernel
def place_body_balls(block, k):
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


class Nodes(NamedTuple):
    """The nodes of both bodies of a slot, parts by place and groups; balls of A stand in the block from ``a`` on,
    balls of B from ``b`` on; members of a group are placed when the group is first opened.

    u : unit vector from the ball around all of A to the ball around all of B, or 0; with each ball stands how far its
    contents reach along u, of B's how near: their difference is a lower bound of the distance, of flat groups a better
    one than the balls'.   u_A, u_B : the same in the bodies' frames.   shift : from A's origin to B's.
    margin : how much less the distance of two parts' balls may be than these bounds of their groups [m].
    """

    A: Body
    B: Body
    a: int
    b: int
    shift: Vec3
    u: Vec3
    u_A: Vec3
    u_B: Vec3
    margin: float


@kernel
def nodes_of(block, k, margin, is_placed):
    """The nodes of both bodies of slot k, whose balls stand first; with the balls of the largest groups, as they are
    where placed."""
    A = body_of(block, k, 0)
    B = body_of(block, k, 1)
    shift = _shift(block, POSE * A.row, POSE * B.row)
    u = sub(vec3_at(block.balls, BALL_IN_WORLD), vec3_at(block.balls, 0))
    length = norm(u)
    u = scale(1.0 / length if length > _LEAST_LENGTH else 0.0, u)
    u_A, u_B = rotate_back(block.poses, POSE * A.row, u), rotate_back(block.poses, POSE * B.row, u)
    nodes = Nodes(A, B, 2, 2 + A.n_parts + A.n_groups, shift, u, u_A, u_B, margin)
    if not is_placed:
        _place_node(block, nodes, True, A.n_parts + A.n_groups - 1)
        _place_node(block, nodes, False, B.n_parts + B.n_groups - 1)
    return nodes


@kernel(inline=True)
def _place_node(block, nodes, of_a, node):
    """Place the ball of a node of A or B; the members of a group are not placed yet."""
    body, first = (nodes.A, nodes.a) if of_a else (nodes.B, nodes.b)
    shift = Vec3(0.0, 0.0, 0.0) if of_a else nodes.shift
    pose, ball_at = POSE * body.row, (first + node) * BALL_IN_WORLD
    if node < body.n_parts:
        number = body.first + view_i64(block.header[BY_PLACE_AT] + 8 * (body.first + node), 1)[0]
        part = view_f64(block.header[PARTS_AT] + 8 * (PART * number + CENTRE), PART - CENTRE)
        place_ball(block.poses, pose, part, 0, shift.x, shift.y, shift.z, block.balls, ball_at)
        reach = block.balls[ball_at + 3]
        block.balls[ball_at + ALONG] = dot(nodes.u, vec3_at(block.balls, ball_at)) + (reach if of_a else -reach)
        return
    group = _group_of(block, body, node)
    place_ball(block.poses, pose, group, 0, shift.x, shift.y, shift.z, block.balls, ball_at)
    u = nodes.u_A if of_a else nodes.u_B
    reach = abs(u.x) * group[HALF_SIZES] + abs(u.y) * group[HALF_SIZES + 1] + abs(u.z) * group[HALF_SIZES + 2]
    reach += group[LARGEST_BALL] * block.poses[pose + POSE_STRETCH] + group[4]
    block.balls[ball_at + ALONG] = dot(nodes.u, vec3_at(block.balls, ball_at)) + (reach if of_a else -reach)
    block.balls[(first + int(group[MEMBERS])) * BALL_IN_WORLD + 3] = math.nan


@kernel(inline=True)
def _group_of(block, body, node):
    """View of a group, by its number among the body's nodes."""
    return view_f64(block.header[GROUPS_AT] + 8 * GROUP_BALL * (body.first_group + node - body.n_parts), GROUP_BALL)


@kernel(inline=True)
def _members_of(block, nodes, of_a, node):
    """(first member, end) of a group, the members placed."""
    body, first = (nodes.A, nodes.a) if of_a else (nodes.B, nodes.b)
    group = _group_of(block, body, node)
    begin, end = int(group[MEMBERS]), int(group[MEMBERS_END])
    if math.isnan(block.balls[(first + begin) * BALL_IN_WORLD + 3]):
        for member in range(begin, end):
            _place_node(block, nodes, of_a, member)
    return begin, end


@kernel(inline=True)
def opened_node(block, nodes, a, b):
    """(whether A's node is opened rather than B's, its first member, end): the larger ball, if a group's; no members
    where both are parts."""
    A, B = nodes.A, nodes.B
    of_a = a >= A.n_parts
    if of_a and b >= B.n_parts:
        of_a = block.balls[(nodes.a + a) * BALL_IN_WORLD + 3] >= block.balls[(nodes.b + b) * BALL_IN_WORLD + 3]
    if of_a:
        begin, end = _members_of(block, nodes, True, a)
        return True, begin, end
    if b >= B.n_parts:
        begin, end = _members_of(block, nodes, False, b)
        return False, begin, end
    return False, 0, 0


@kernel(inline=True)
def _gap_of_nodes(block, nodes, a, b):
    """The distance of two nodes' balls [m]."""
    return _gap(block, nodes.a + a, nodes.b + b)


@kernel(inline=True)
def _are_beyond(block, nodes, a, b, reach):
    """Whether contents of two nodes are farther apart along u than ``reach`` [m]: for less work than their balls."""
    along_a = block.balls[(nodes.a + a) * BALL_IN_WORLD + ALONG]
    return block.balls[(nodes.b + b) * BALL_IN_WORLD + ALONG] - along_a - nodes.margin > reach


@kernel(inline=True)
def number_of_pair(block, nodes, a, b):
    """The number of a pair of parts, by their places."""
    of_a = view_i64(block.header[BY_PLACE_AT] + 8 * (nodes.A.first + a), 1)[0]
    return of_a * nodes.B.n_parts + view_i64(block.header[BY_PLACE_AT] + 8 * (nodes.B.first + b), 1)[0]


@kernel(inline=True)
def _gap(block, i, j):
    """The distance of balls i and j [m]."""
    return gap_of_balls(block.balls, i * BALL_IN_WORLD, j * BALL_IN_WORLD)


@kernel
def _nearest_pair(block, k, boolean):
    """The pair of parts of slot k with the nearest balls, of equals the first; −1 of booleans where no balls meet.

    Groups of parts whose balls are farther apart than the nearest pair so far hold no nearer pair.
    """
    n_pairs = count_pairs(block, k)
    if n_pairs == 1 and not boolean:
        return 0
    margin = BALL_MARGIN * place_body_balls(block, k)
    if boolean and _gap(block, 0, 1) > margin:
        return -1
    if n_pairs == 1:
        return 0
    nodes = nodes_of(block, k, margin, False)
    a, b = nodes.A.n_parts + nodes.A.n_groups - 1, nodes.B.n_parts + nodes.B.n_groups - 1
    stack, top = MAX_NEAR, 1
    block.near[stack] = a
    block.near[stack + 1] = b
    while a >= nodes.A.n_parts or b >= nodes.B.n_parts:  # down to a near pair, which leaves out most of the others
        of_a, begin, end = opened_node(block, nodes, a, b)
        least, best = math.inf, begin
        for member in range(begin, end):
            gap = _gap_of_nodes(block, nodes, member if of_a else a, b if of_a else member)
            if gap < least:
                least = gap
                best = member
        a, b = (best, b) if of_a else (a, best)
    least, nearest = _gap_of_nodes(block, nodes, a, b), number_of_pair(block, nodes, a, b)
    while top > 0:
        top -= 1
        a, b = block.near[stack + 2 * top], block.near[stack + 2 * top + 1]
        of_a, begin, end = opened_node(block, nodes, a, b)
        for member in range(begin, end):
            at_a, at_b = (member, b) if of_a else (a, member)
            if _are_beyond(block, nodes, at_a, at_b, least):
                continue
            gap = _gap_of_nodes(block, nodes, at_a, at_b)
            if at_a < nodes.A.n_parts and at_b < nodes.B.n_parts:
                if gap <= least:
                    pair = number_of_pair(block, nodes, at_a, at_b)
                    if gap < least or pair < nearest:
                        least = gap
                        nearest = pair
            elif gap - margin <= (min(least, margin) if boolean else least):
                block.near[stack + 2 * top] = at_a
                block.near[stack + 2 * top + 1] = at_b
                top += 1
    return -1 if boolean and least > margin else nearest


@kernel
def _gap_of_pair(block, nodes, pair):
    """The distance of the balls of a pair of parts [m]."""
    A, B = nodes.A, nodes.B
    at = 2 + 2 * block.header[CAPACITY]
    of_a, of_b = A.first + pair // B.n_parts, B.first + pair % B.n_parts
    parts = part_view(block, max(of_a, of_b) + 1)
    shift = _shift(block, POSE * A.row, POSE * B.row)
    ball_a, ball_b = at * BALL_IN_WORLD, (at + 1) * BALL_IN_WORLD
    place_ball(block.poses, POSE * A.row, parts, PART * of_a + CENTRE, 0.0, 0.0, 0.0, block.balls, ball_a)
    place_ball(block.poses, POSE * B.row, parts, PART * of_b + CENTRE, shift.x, shift.y, shift.z, block.balls, ball_b)
    return _gap(block, at, at + 1)


@kernel
def sort_numbers(numbers, n):
    """Sort the first n numbers: Shell's sort with Knuth's gaps, O(n^1.5)."""
    gap = 1
    while gap < n:
        gap = 3 * gap + 1
    while gap > 1:
        gap //= 3
        for k in range(gap, n):
            number = numbers[k]
            j = k
            while j >= gap and numbers[j - gap] > number:
                numbers[j] = numbers[j - gap]
                j -= gap
            numbers[j] = number


@kernel
def _find_near(block, nodes, reach, start, but):
    """Find pairs of parts whose balls come within ``reach`` [m], by numbers from ``start`` on, without ``but``: all, or
    the least LIST + 1; ascending in the list of numbers. Returns how many.

    Groups of parts whose balls are farther apart hold no such pair.
    """
    near, n_near, end_of_near = block.near, 0, nodes.A.n_parts * nodes.B.n_parts
    near[MAX_NEAR] = nodes.A.n_parts + nodes.A.n_groups - 1
    near[MAX_NEAR + 1] = nodes.B.n_parts + nodes.B.n_groups - 1
    top = 1
    while top > 0:
        top -= 1
        a, b = near[MAX_NEAR + 2 * top], near[MAX_NEAR + 2 * top + 1]
        of_a, begin, end = opened_node(block, nodes, a, b)
        for member in range(begin, end):
            at_a, at_b = (member, b) if of_a else (a, member)
            if _are_beyond(block, nodes, at_a, at_b, reach):
                continue
            gap = _gap_of_nodes(block, nodes, at_a, at_b)
            if at_a < nodes.A.n_parts and at_b < nodes.B.n_parts:
                if gap > reach:
                    continue
                pair = number_of_pair(block, nodes, at_a, at_b)
                if start <= pair < end_of_near and pair != but:
                    near[n_near] = pair
                    n_near += 1
                    if n_near == MAX_NEAR:
                        sort_numbers(near, n_near)
                        n_near = LIST + 1
                        end_of_near = near[LIST]
            elif gap - nodes.margin <= reach:
                near[MAX_NEAR + 2 * top] = at_a
                near[MAX_NEAR + 2 * top + 1] = at_b
                top += 1
    sort_numbers(near, n_near)
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
    size = place_body_balls(block, k)
    margin = BALL_MARGIN * size
    # The nodes of a single pose stand where `_nearest_pair` has placed them just now.
    nodes = nodes_of(block, k, margin, header[N_POSES] == 1 and header[PAIR] == 0 and not every)
    first_pair = block.slots[SLOT_SIZE * k + FIRST_PAIR]
    reach = margin
    if every:
        reach = math.inf
    elif not boolean:
        # Others that are as near by their balls as the first: which of them came first has no say.
        reach += max(first_reach_of(block.scores, SCORE * k), _gap_of_pair(block, nodes, first_pair), 0.0)
        reach += _BRACKET * size
    nhat = Vec3(0.0, 0.0, 0.0) if boolean else first_normal_of(block.scores, SCORE * k)
    return _list_pairs(block, k, nodes, reach, first_pair, nhat, not boolean, n_listed)


@kernel
def _list_pairs(block, k, nodes, reach, but, nhat, exactly, n_listed):
    """List the pairs of parts of slot k whose balls come within ``reach`` [m], from PAIR on, ascending, without one;
    PAIR becomes the pair to go on with. Returns the list's length.

    exactly : leave out what is farther apart along ``nhat``, or along the way between the balls' centres, and have the
    exact terms of poses.
    """
    header, n_near = block.header, LIST + 1
    while n_near > LIST:  # of so many there may be more, with larger numbers
        n_near = _find_near(block, nodes, reach, header[PAIR], but)
        for k_near in range(n_near):
            pair = block.near[k_near]
            if exactly and _are_apart(block, nodes, pair, nhat, reach):
                continue
            if n_listed == LIST:
                header[PAIR] = pair
                return n_listed
            _list_pair(block, k, nodes.B.n_parts, pair, exactly, n_listed)
            n_listed += 1
        if n_near > 0:
            header[PAIR] = block.near[n_near - 1] + 1
    header[PAIR] = nodes.A.n_parts * nodes.B.n_parts
    return n_listed


@kernel
def _are_apart(block, nodes, pair, nhat, reach):
    """Whether a pair of parts is proven farther apart than ``reach`` [m]: with heights h over planes across a unit
    vector n, no point of B is nearer than n·t − h_B(−n) − h_A(n), t from A's origin to B's. Rounding takes less than
    the balls' margin of the size."""
    of_a, of_b = nodes.A.first + pair // nodes.B.n_parts, nodes.B.first + pair % nodes.B.n_parts
    p, q = POSE * nodes.A.row, POSE * nodes.B.row
    for of_centres in range(2):
        n = nhat
        if of_centres == 1:
            parts = part_view(block, max(of_a, of_b) + 1)
            from_a = rotate(block.poses, p, vec3_at(parts, PART * of_a + CENTRE))
            n = sub(add(rotate(block.poses, q, vec3_at(parts, PART * of_b + CENTRE)), nodes.shift), from_a)
            length = norm(n)
            n = scale(1.0 / length if length > _LEAST_LENGTH else 0.0, n)
        height_a = _height(block, of_a, rotate_back(block.poses, p, n))
        height_b = _height(block, of_b, neg(rotate_back(block.poses, q, n)))
        if dot(n, nodes.shift) - height_a - height_b - nodes.margin > reach:
            return True
    return False


@kernel(inline=True)
def _height(block, number, v):
    """How far a part reaches along a vector of its body's frame of length 1 at most [m]; infinity of all but few
    points."""
    ints = view_i64(block.header[INTS_AT] + 8 * INTS * number, INTS)
    if ints[KIND] != POINTS or ints[PADDED] > _MAX_LISTED:
        return math.inf
    numbers = view_f64(block.header[NUMBERS_AT] + 8 * NUMBERS * number, NUMBERS)
    part = view_f64(block.header[PARTS_AT] + 8 * PART * number, PART)
    columns, g, height = view_f64(ints[ADDRESS], 3 * ints[PADDED]), rotate_back(part, 0, v), -math.inf
    for k in range(ints[PADDED]):
        height = max(height, dot(column_at(columns, ints[PADDED], k), g))
    return height + dot(vec3_at(part, 9), v) + numbers[RADIUS] + numbers[SLOP]


@kernel
def list_pairs_within(block, limit):
    """List the pairs of parts of slot 0 whose balls come within a limit [m], ascending, their rows of poses placed;
    returns how many, −1 of more than LIST.

    No part reaches out of its ball by more than the balls' margin of the size: parts of other pairs are farther apart
    than the limit.
    """
    margin = BALL_MARGIN * place_body_balls(block, 0)
    reach = limit * (1.0 + 2.0**-50) + margin
    if _gap(block, 0, 1) > reach:
        return 0
    block.header[PAIR] = 0
    n = _list_pairs(block, 0, nodes_of(block, 0, margin, False), reach, -1, Vec3(0.0, 0.0, 0.0), False, 0)
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
    """Finish the answers of the block; False where a single call leaves the depth of many parts to the long way."""
    header = block.header
    for k in range(header[N_POSES]):
        if boolean:
            view_u8(out_at + header[N_DONE] + k, 1)[0] = block.slots[SLOT_SIZE * k + IS_HIT]
        elif count_pairs(block, k) > 1:
            row_at = out_at + ROW * (header[N_DONE] + k)
            if close_score(block.scores, SCORE * k, row_at) and depths:
                if 0 < header[AT_ONCE] < count_pairs(block, k):
                    return False
                _separate_bodies_of(block, k, row_at)
    return True


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
                if not _close_block(block, boolean, depths, out_at):
                    return OPEN
                header[N_DONE] += header[N_POSES]
                header[STAGE] = _LAY_OUT
                continue
        if header[STAGE] == _NEAREST:
            header[N_LISTED] = _list_nearest(block, boolean, every)
        else:
            header[N_LISTED] = _list_others(block, boolean, depths, every)
        header[N_ANSWERED] += header[N_LISTED]
        if 0 < header[AT_ONCE] < header[N_ANSWERED]:
            return OPEN
        if header[N_LISTED] > 0 and (_answer_list(header, boolean, depths, limit) or every):
            _write_terms_of_list(block)
            return OPEN
