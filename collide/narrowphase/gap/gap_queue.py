"""A queue of gaps to refine: rows without their last digits, until eight of a kind are queued or the list of pairs
ends.

A row is answered in doubles first, then enqueued: its question to `refine_gap.py` goes into a lane of the block of its
kind. When the block is full, or nothing else is left to do, all gaps of the block are refined at once, and their rows
are finished. Rows whose digits are not proven get the answer in doubles, and are left undecided: the exact stage
settles them.

Lanes do not see each other, so no answer depends on the other rows of its block. Lanes without a row hold numbers of
earlier rows, or zeros; their results are not read.
"""

from __future__ import annotations

from collide.kernels import kernel, view_f64, view_i64
from collide.kernels.lanes import LANES, view_lanes
from collide.lowering.shape_table import INTS, NUMBERS, POSE
from collide.narrowphase.gap import gap_layout as at
from collide.narrowphase.gap.gap_layout import get, get_vec3, lane_of, put, put_vec3
from collide.narrowphase.gap.precise_pair import LOW_PARTS_OF_PAIR, is_composed, put_low_parts, unit_scale
from collide.narrowphase.gap.refine_gap import core_error, refine_gaps
from collide.narrowphase.gap.tied_vertices import lowest_pair, no_other_is_tied, vertices_of
from collide.narrowphase.posed_pair import posed_body, posed_pair, radius_of
from collide.narrowphase.rows import (
    BEYOND,
    CERTIFIED,
    DISTANCE,
    HOW,
    LOWER,
    NORMAL,
    ROW,
    UPPER,
    view_row,
    write_vectors,
    write_verdict,
)
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD
from collide.numerics.exact_dot_sign import PRODUCT_TERMS
from collide.numerics.vec3 import add, column_at, max_abs, neg, scale, sub, vec3_at
from collide.numerics.vec3 import put_vec3 as put_vec3_at
from collide.results import UNDECIDED

#: Kinds of gap: one to three points, edges of one part or of two, poses as given or composed.
KINDS = 12
#: Witness points may be off by this much of the pair's size, or of their largest coordinate.
_NEAR_MISS = 2.0**-47

# A ticket says what is needed to finish a row: its number, both shapes and poses as they are worked on, whether they
# are exchanged, how it was decided, its vertex pairs.
_ROW, _SHAPE_A, _POSE_A, _SHAPE_B, _POSE_B, _FLIP, _HOW, _IDS = range(8)
_TICKET = _IDS + 6

# Workspace in doubles: low parts and a direction for one row; then lane blocks: the feature, its direction, the answer,
# the questions of each kind. In integers: how many are queued of each kind, tickets, vertex pairs, terms of a sum.
_LOWS, _DIRECTION = 0, LOW_PARTS_OF_PAIR
_BLOCKS = _DIRECTION + dd.STRIDE
_QUESTIONS = at.FEATURE + dd.STRIDE + at.ANSWER
QUEUE_DOUBLES = _BLOCKS + LANES + LANES * (_QUESTIONS + KINDS * at.QUESTION)
_TICKETS = KINDS
_FEATURE_IDS = _TICKETS + KINDS * LANES * _TICKET
_TERMS = _FEATURE_IDS + 6
QUEUE_INTEGERS = _TERMS + PRODUCT_TERMS


@kernel(inline=True)
def _blocks_at(doubles_at):
    """Where lane blocks begin: at a multiple of their elements' size, which is faster."""
    return (doubles_at + 8 * (_BLOCKS + LANES - 1)) // (8 * LANES) * (8 * LANES)


@kernel(inline=True)
def _question_at(doubles_at, kind):
    return _blocks_at(doubles_at) + 8 * LANES * (_QUESTIONS + at.QUESTION * kind)


@kernel(inline=True)
def _ticket_of(integers_at, kind, lane):
    return view_i64(integers_at + 8 * (_TICKETS + _TICKET * (LANES * kind + lane)), _TICKET)


@kernel(inline=True)
def _ids_of(integers_at, kind, lane):
    return view_i64(integers_at + 8 * (_TICKETS + _TICKET * (LANES * kind + lane) + _IDS), 6)


@kernel(inline=True)
def clear_queue(integers_at):
    n_queued = view_i64(integers_at, KINDS)
    for kind in range(KINDS):
        n_queued[kind] = 0


# --- in -------------------------------------------------------------------------------------------


@kernel(inline=True)
def enqueue(ordered, query, work, n, how, row_number, error):
    """Put a row into the queue to have its gap refined; returns its kind.

    ordered, query, work : `OrderedPair`, `Query` and `Workspace` of `pair_workspace.py`.
    n : vertex pairs of the workspace. Pairs with a weight are the feature; of four, where two segments cross, three are
        taken.
    how : the row's method if its digits are proven.   error : of a bound in doubles [m].
    """
    pair = ordered.pair
    doubles_at, integers_at = work.queue_at, work.queue_integers_at
    feature = view_i64(integers_at + 8 * _FEATURE_IDS, 6)
    n_points = 0
    for k in range(n):
        if work.weights[k] > 0.0 and n_points < 3:
            feature[2 * n_points] = work.ids[2 * k]
            feature[2 * n_points + 1] = work.ids[2 * k + 1]
            n_points += 1
    first, parts = _common_corner(feature, n_points)
    composed = is_composed(pair.poses, pair.A.pose_at) or is_composed(pair.poses, pair.B.pose_at)
    kind = n_points - 1 + 3 * (parts - 1) + (6 if composed else 0)
    n_queued = view_i64(integers_at, KINDS)
    lane = n_queued[kind]
    n_queued[kind] = lane + 1
    ticket = _ticket_of(integers_at, kind, lane)
    ticket[_ROW] = row_number
    ticket[_SHAPE_A] = pair.A.shape
    ticket[_POSE_A] = pair.A.pose_at // POSE
    ticket[_SHAPE_B] = pair.B.shape
    ticket[_POSE_B] = pair.B.pose_at // POSE
    ticket[_FLIP] = 1 if ordered.flip else 0
    ticket[_HOW] = how
    for k in range(n_points):
        source = 2 * (first if k == 0 else (0 if k == first else k))
        ticket[_IDS + 2 * k] = feature[source]
        ticket[_IDS + 2 * k + 1] = feature[source + 1]
    question = lane_of(_question_at(doubles_at, kind), at.QUESTION, lane)
    _put_geometry(pair, question, ticket, n_points, parts)
    if composed:
        low_at = doubles_at + 8 * _LOWS
        low = view_f64(low_at, put_low_parts(pair, query.terms_at, low_at))
        for k in range(LOW_PARTS_OF_PAIR):
            put(question, at.LOW_A + k, low[k])
    put(question, at.SCALE, unit_scale(ordered.size))
    put(question, at.SLOP, ordered.slop)
    put(question, at.ERROR, error)
    put(question, at.RADIUS_A, radius_of(pair, pair.A))
    put(question, at.RADIUS_B, radius_of(pair, pair.B))
    put(question, at.PARALLELOGRAM, 1.0 if n == 4 else 0.0)
    return kind


@kernel(inline=True)
def _common_corner(feature, n_points):
    """(first, parts): the vertex pair with a vertex in common with each other pair, and 1 part per edge; if missing, 0
    and 2 parts."""
    first = 0
    parts = 2
    for k in range(n_points):
        joined = True
        for j in range(n_points):
            joined = joined and (feature[2 * j] == feature[2 * k] or feature[2 * j + 1] == feature[2 * k + 1])
        if joined and parts == 2:
            first = k
            parts = 1
    return first, parts


@kernel(inline=True)
def _put_geometry(pair, question, ticket, n_points, parts):
    """Write poses and vertices of a question into a lane of its block."""
    A, B, poses = pair.A, pair.B, pair.poses
    for k in range(12):
        put(question, at.POSE_A + k, poses[A.pose_at + k])
        put(question, at.POSE_B + k, poses[B.pose_at + k])
    a = ticket[_IDS]
    b = ticket[_IDS + 1]
    put_vec3(question, at.CORNER_A, column_at(A.coords, A.padded, a))
    put_vec3(question, at.CORNER_B, column_at(B.coords, B.padded, b))
    for k in range(1, n_points):
        edge_at = at.EDGES + at.EDGE * (k - 1)
        i = ticket[_IDS + 2 * k]
        j = ticket[_IDS + 2 * k + 1]
        of_a = parts == 2 or i != a
        put(question, edge_at + at.OF_A, 1.0 if of_a else 0.0)
        # One code for both bodies: which one it is could not be guessed.
        coords = A.coords if of_a else B.coords
        padded = A.padded if of_a else B.padded
        put_vec3(question, edge_at + at.HEAD, column_at(coords, padded, i if of_a else b))
        put_vec3(question, edge_at + at.TAIL, column_at(coords, padded, a if of_a else j))
        if parts == 2:
            edge_at += at.PART
            put(question, edge_at + at.OF_A, 0.0)
            put_vec3(question, edge_at + at.HEAD, column_at(B.coords, B.padded, b))
            put_vec3(question, edge_at + at.TAIL, column_at(B.coords, B.padded, j))


@kernel(inline=True)
def write_guess(row, distance, lower, upper, nhat):
    """What doubles say of a row that is enqueued, and `_finish_row` reads: for the pair as worked on."""
    row.doubles[DISTANCE] = distance
    row.doubles[LOWER] = lower
    row.doubles[UPPER] = upper
    put_vec3_at(row.doubles, NORMAL, nhat)


# --- out ------------------------------------------------------------------------------------------


@kernel
def refine_queued(ints_at, numbers_at, poses_at, kind, depths, limit, rows_at, doubles_at, integers_at):
    """Refine all queued gaps of a kind, and write their rows: proven, or undecided.

    Addresses as in `answer_pairs`; doubles, integers : the queue's workspace.
    """
    n_queued = view_i64(integers_at, KINDS)
    count = n_queued[kind]
    n_queued[kind] = 0
    n = kind % 3 + 1
    parts = 1 + (kind // 3) % 2
    composed = kind >= 6
    feature_at = _blocks_at(doubles_at)
    direction_at = feature_at + 8 * LANES * at.FEATURE
    answer_at = direction_at + 8 * LANES * dd.STRIDE
    question_at = _question_at(doubles_at, kind)
    refine_gaps(
        view_lanes(question_at, at.QUESTION), n, parts, composed,
        view_lanes(feature_at, at.FEATURE), view_lanes(direction_at, dd.STRIDE), view_lanes(answer_at, at.ANSWER),
    )
    for lane in range(count):
        answer = lane_of(answer_at, at.ANSWER, lane)
        question = lane_of(question_at, at.QUESTION, lane)
        ticket = _ticket_of(integers_at, kind, lane)
        ids = _ids_of(integers_at, kind, lane)
        proven = get(answer, at.PROVEN) != 0.0
        if proven and (parts == 2 or not _is_unique_minimiser(ints_at, ticket, ids, n, question, answer)):
            direction = lane_of(direction_at, dd.STRIDE, lane)
            pair = _pair_of(ints_at, numbers_at, poses_at, ticket)
            proven = _widen_by_ties(pair, ids, question, answer, direction, composed, doubles_at, integers_at)
        _finish_row(rows_at + ROW * ticket[_ROW], question, answer, ticket, proven, depths, limit)


@kernel(inline=True)
def _is_unique_minimiser(ints_at, ticket, ids, n, question, answer):
    """`tied_vertices.is_unique_minimiser`, whose products the answer holds."""
    n_of_a = 1
    for k in range(1, n):
        n_of_a += 1 if get(question, at.EDGES + at.EDGE * (k - 1) + at.OF_A) != 0.0 else 0
    along_a = get_vec3(answer, at.ALONG_A)
    along_b = get_vec3(answer, at.ALONG_B)
    return no_other_is_tied(
        _vertices(ints_at, ticket[_SHAPE_A]), ids, n, 0, n_of_a, along_a, get(answer, at.LIMIT_A)
    ) and no_other_is_tied(
        _vertices(ints_at, ticket[_SHAPE_B]), ids, n, 1, n + 1 - n_of_a, along_b, get(answer, at.LIMIT_B)
    )


@kernel(inline=True)
def _vertices(ints_at, shape):
    return vertices_of(posed_body(view_i64(ints_at, INTS * (shape + 1)), shape, 0))


@kernel(inline=True)
def _pair_of(ints_at, numbers_at, poses_at, ticket):
    """The `PosedPair` of a ticket."""
    sa, pa, sb, pb = ticket[_SHAPE_A], ticket[_POSE_A], ticket[_SHAPE_B], ticket[_POSE_B]
    ints = view_i64(ints_at, INTS * (max(sa, sb) + 1))
    numbers = view_f64(numbers_at, NUMBERS * (max(sa, sb) + 1))
    poses = view_f64(poses_at, POSE * (max(pa, pb) + 1))
    return posed_pair(ints, numbers, poses, sa, pa, sb, pb)


@kernel
def _widen_by_ties(pair, ids, question, answer, direction_lane, composed, doubles_at, integers_at):
    """Set the bracket anew by the lowest vertices of both bodies; whether the bracket is still proven to the last
    digits."""
    low = view_f64(doubles_at + 8 * _LOWS, LOW_PARTS_OF_PAIR if composed else 0)
    direction = view_f64(doubles_at + 8 * _DIRECTION, dd.STRIDE)
    for k in range(dd.STRIDE):
        direction[k] = get(direction_lane, k)
    if composed:
        for k in range(LOW_PARTS_OF_PAIR):
            low[k] = get(question, at.LOW_A + k)
    unit = get(question, at.SCALE)
    excess = lowest_pair(pair, low, ids, direction, integers_at + 8 * _TERMS, unit).excess.high
    error = core_error(get(answer, at.SPREAD), excess, get(answer, at.LENGTH), get(question, at.SLOP), unit)
    bracket = dd.bracket(DD(get(answer, at.GAP), get(answer, at.GAP_LOW)), error / unit)
    put(answer, at.GAP_LOWER, bracket.lower)
    put(answer, at.GAP_NEAREST, bracket.nearest)
    put(answer, at.GAP_UPPER, bracket.upper)
    return error < 2.0**-54 * get(answer, at.CORE)


@kernel(inline=True)
def _finish_row(row_at, question, answer, ticket, proven, depths, limit):
    """Finish a row: with proven digits, or as doubles say, for the exact stage to settle."""
    row = view_row(row_at)
    radius_a = get(question, at.RADIUS_A)
    radius_b = get(question, at.RADIUS_B)
    distance = row.doubles[DISTANCE]
    lower = row.doubles[LOWER]
    upper = row.doubles[UPPER]
    nhat = vec3_at(row.doubles, NORMAL)
    if proven:
        distance = get(answer, at.GAP_NEAREST)
        lower = max(lower, get(answer, at.GAP_LOWER))
        upper = min(upper, get(answer, at.GAP_UPPER))
        nhat = neg(get_vec3(answer, at.UNIT))
    write_verdict(row, distance, lower, upper, ticket[_HOW], 0.0, limit)
    decided = lower > 0.0 or upper <= 0.0
    unfinished = row.flags[CERTIFIED] == 0 and (depths or upper > 0.0)
    # Radii may prove an overlap of cores between which doubles see no clear direction.
    ambiguous = not proven and radius_a + radius_b > 0.0
    # Shares of a triangle's edges say little if it is thin; the exact stage takes more care.
    a = get_vec3(answer, at.POINT_A)
    b = get_vec3(answer, at.POINT_B)
    reach = max(1.0 / get(question, at.SCALE), max_abs(a), max_abs(b))
    miss = max_abs(sub(sub(b, a), scale(row.doubles[DISTANCE] + (radius_a + radius_b), nhat)))
    missed = proven and miss > _NEAR_MISS * reach and row.flags[BEYOND] == 0
    if not decided or unfinished or ambiguous or missed:
        row.flags[HOW] = UNDECIDED
    write_vectors(row, nhat, add(a, scale(radius_a, nhat)), sub(b, scale(radius_b, nhat)), ticket[_FLIP] == 1)
