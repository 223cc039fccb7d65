"""Gaps that wait for their last digits, until eight of a kind are there or the list of pairs ends.

A row is answered in doubles first, then put down here: what `refine_gap.py` asks of it goes into one lane of the room of its
kind. When the room is full, or nothing else is left to do, all in it are worked on at once, and their rows are finished.
Those whose digits are not proven get what doubles say, and are left undecided: the exact stage settles them.

Lanes do not see each other, so that no answer depends on which rows share a room. Lanes without a row hold the numbers
of earlier ones, or zeros; what comes of them is not read.
"""

from __future__ import annotations

from collide.kernels import kernel, view_f64, view_i64, view_u8
from collide.kernels.lanes import LANES, view_lanes
from collide.lowering.shape_table import ADDRESS, COUNT, INTS, NUMBERS, PADDED, POSE, TREE
from collide.narrowphase.gap.precise_pair import (
    FINE,
    LARGEST_FINE,
    SMALLEST_FINE,
    is_composed,
    scale_of,
    write_low_parts,
)
from collide.narrowphase.gap.refine_gap import (
    ALONG_A,
    ALONG_B,
    ANSWER,
    CORE,
    CORNER_A,
    CORNER_B,
    EDGE,
    EDGES,
    ERROR,
    FEATURE,
    GAP,
    GAP_LOW,
    GAP_LOWER,
    GAP_NEAREST,
    GAP_UPPER,
    HEAD,
    LENGTH,
    LIMIT_A,
    LIMIT_B,
    LOW_A,
    OF_A,
    PARALLELOGRAM,
    PART,
    POINT_A,
    POINT_B,
    POSE_A,
    POSE_B,
    PROVEN,
    QUESTION,
    RADIUS_A,
    RADIUS_B,
    SCALE,
    SLOP,
    SPREAD,
    TAIL,
    UNIT,
    polish_gaps,
    unsure_of,
)
from collide.narrowphase.gap.tied_vertices import no_other_is_level, settle_level
from collide.narrowphase.posed_pair import coordinates_of, posed_pair, radius_of
from collide.narrowphase.rows import (
    BEYOND,
    CERTIFIED,
    DISTANCE,
    HOW,
    LOWER,
    NORMAL,
    ROW,
    UPPER,
    write_vectors,
    write_verdict,
)
from collide.numerics.double_double import bracket
from collide.numerics.exact_dot_sign import PRODUCT_TERMS
from collide.results import UNDECIDED

#: Kinds of gap: one to three points, edges of one part or of two, poses as given or composed.
KINDS = 12

#: Witness points may be off by this much of the pair's size, or of their largest coordinate.
_NEAR_MISS = 2.0**-47

# What is noted of a row that waits: its number, both shapes and poses as they are worked on, whether they are exchanged,
# how it was decided, its vertex pairs.
_ROW, _SHAPE_A, _POSE_A, _SHAPE_B, _POSE_B, _FLIP, _HOW, _IDS = range(8)
_NOTE = _IDS + 6

# Workspace in doubles: low parts and a direction for one row; then numbers for eight: the feature, its direction, the
# answer, the questions of each kind. In integers: how many wait of each kind, notes, vertex pairs, terms of a sum.
_LOWS, _ACROSS = 0, 24
_ALONE = _ACROSS + FINE
_ROOMS = FEATURE + FINE + ANSWER
WAITING_DOUBLES = _ALONE + LANES + LANES * (_ROOMS + KINDS * QUESTION)
_NOTES = KINDS
_FEATURE = _NOTES + KINDS * LANES * _NOTE
_TERMS = _FEATURE + 6
WAITING_INTEGERS = _TERMS + PRODUCT_TERMS


@kernel(inline=True)
def _lanes_at(doubles_at):
    """Where numbers for eight begin: at a multiple of their size, which is faster."""
    return (doubles_at + 8 * (_ALONE + LANES - 1)) // (8 * LANES) * (8 * LANES)


@kernel(inline=True)
def _question_at(doubles_at, kind):
    return _lanes_at(doubles_at) + 8 * LANES * (_ROOMS + QUESTION * kind)


@kernel(inline=True)
def can_wait(size):
    return SMALLEST_FINE < size < LARGEST_FINE


@kernel(inline=True)
def nobody_waits(integers_at):
    waiting = view_i64(integers_at, KINDS)
    for kind in range(KINDS):
        waiting[kind] = 0


@kernel(inline=True)
def put_down(
    pair, terms_at, ids, weights, n, flip, how, row_number, size, slop, error, doubles_at, integers_at
):  # fmt: skip
    """Note a row whose gap is to be polished; returns its kind.

    ids, weights : n vertex pairs; those with a weight are the feature, of four of two segments three corners.
    """
    composed = is_composed(pair.poses, pair.A.pose_at) or is_composed(pair.poses, pair.B.pose_at)
    feature = view_i64(integers_at + 8 * _FEATURE, 6)
    points = 0
    for k in range(n):
        if weights[k] > 0.0 and points < 3:
            feature[2 * points] = ids[2 * k]
            feature[2 * points + 1] = ids[2 * k + 1]
            points += 1
    # First the pair that has a vertex in common with each of the others; where there is none, edges have two parts.
    first = 0
    parts = 2
    for k in range(points):
        joined = True
        for j in range(points):
            joined = joined and (feature[2 * j] == feature[2 * k] or feature[2 * j + 1] == feature[2 * k + 1])
        if joined and parts == 2:
            first = k
            parts = 1
    kind = points - 1 + 3 * (parts - 1) + (6 if composed else 0)
    waiting = view_i64(integers_at, KINDS)
    lane = waiting[kind]
    waiting[kind] = lane + 1
    note = view_i64(integers_at + 8 * (_NOTES + _NOTE * (LANES * kind + lane)), _NOTE)
    note[_ROW] = row_number
    note[_SHAPE_A] = pair.A.shape
    note[_POSE_A] = pair.A.pose_at // POSE
    note[_SHAPE_B] = pair.B.shape
    note[_POSE_B] = pair.B.pose_at // POSE
    note[_FLIP] = 1 if flip else 0
    note[_HOW] = how
    for k in range(points):
        at = 2 * (first if k == 0 else (0 if k == first else k))
        note[_IDS + 2 * k] = feature[at]
        note[_IDS + 2 * k + 1] = feature[at + 1]
    question = view_f64(_question_at(doubles_at, kind) + 8 * lane, LANES * QUESTION - lane)
    _ask(pair, question, note, points, parts)
    if composed:
        low_at = doubles_at + 8 * _LOWS
        low = view_f64(low_at, write_low_parts(pair, terms_at, low_at))
        for k in range(24):
            question[LANES * (LOW_A + k)] = low[k]
    question[LANES * SCALE] = scale_of(size)
    question[LANES * SLOP] = slop
    question[LANES * ERROR] = error
    question[LANES * RADIUS_A] = radius_of(pair, pair.A)
    question[LANES * RADIUS_B] = radius_of(pair, pair.B)
    question[LANES * PARALLELOGRAM] = 1.0 if n == 4 else 0.0
    return kind


@kernel(inline=True)
def _ask(pair, question, note, points, parts):
    """Poses and vertices of a question, into one lane of it."""
    A, B, poses = pair.A, pair.B, pair.poses
    p, q = A.pose_at, B.pose_at
    for k in range(12):
        question[LANES * (POSE_A + k)] = poses[p + k]
        question[LANES * (POSE_B + k)] = poses[q + k]
    a = note[_IDS]
    b = note[_IDS + 1]
    for axis in range(3):
        question[LANES * (CORNER_A + axis)] = A.coords[A.padded * axis + a]
        question[LANES * (CORNER_B + axis)] = B.coords[B.padded * axis + b]
    for k in range(1, points):
        at = LANES * (EDGES + EDGE * (k - 1))
        i = note[_IDS + 2 * k]
        j = note[_IDS + 2 * k + 1]
        of_a = parts == 2 or i != a
        question[at + LANES * OF_A] = 1.0 if of_a else 0.0
        # One code for both bodies: which one it is could not be guessed.
        coordinates = A.coords if of_a else B.coords
        m = A.padded if of_a else B.padded
        head = i if of_a else b
        tail = a if of_a else j
        for axis in range(3):
            question[at + LANES * (HEAD + axis)] = coordinates[m * axis + head]
            question[at + LANES * (TAIL + axis)] = coordinates[m * axis + tail]
        if parts == 2:
            at += LANES * PART
            question[at + LANES * OF_A] = 0.0
            for axis in range(3):
                question[at + LANES * (HEAD + axis)] = B.coords[B.padded * axis + b]
                question[at + LANES * (TAIL + axis)] = B.coords[B.padded * axis + j]


@kernel
def polish_waiting(ints_at, numbers_at, poses_at, kind, depths, limit, rows_at, doubles_at, integers_at):
    """Work on all rows of a kind that wait, and write those anew that are proven."""
    waiting = view_i64(integers_at, KINDS)
    count = waiting[kind]
    waiting[kind] = 0
    n = kind % 3 + 1
    parts = 1 + (kind // 3) % 2
    composed = kind >= 6
    room_at = _lanes_at(doubles_at)
    across_at = room_at + 8 * LANES * FEATURE
    answer_at = across_at + 8 * LANES * FINE
    question_at = _question_at(doubles_at, kind)
    polish_gaps(
        view_lanes(question_at, QUESTION), n, parts, composed,
        view_lanes(room_at, FEATURE), view_lanes(across_at, FINE), view_lanes(answer_at, ANSWER),
    )  # fmt: skip
    for lane in range(count):
        answer = view_f64(answer_at + 8 * lane, LANES * ANSWER - lane)
        question = view_f64(question_at + 8 * lane, LANES * QUESTION - lane)
        note_at = integers_at + 8 * (_NOTES + _NOTE * (LANES * kind + lane))
        note = view_i64(note_at, _NOTE)
        proven = answer[LANES * PROVEN] != 0.0
        if proven and (parts == 2 or not _are_alone(ints_at, note, view_i64(note_at + 8 * _IDS, 6), n, question, answer)):
            proven = _level(
                ints_at, numbers_at, poses_at, note, view_i64(note_at + 8 * _IDS, 6), question, answer,
                across_at + 8 * lane, composed, doubles_at, integers_at,
            )  # fmt: skip
        row_at = rows_at + ROW * note[_ROW]
        _write(view_f64(row_at, 12), view_u8(row_at, ROW), question, answer, note, proven, depths, limit)


@kernel(inline=True)
def _are_alone(ints_at, note, ids, n, question, answer):
    """`level.are_alone`, of which the products are there."""
    own_a = 1
    for k in range(1, n):
        own_a += 1 if question[LANES * (EDGES + EDGE * (k - 1) + OF_A)] != 0.0 else 0
    return _is_alone(
        ints_at, note[_SHAPE_A], ids, n, 0, own_a,
        answer[LANES * ALONG_A], answer[LANES * (ALONG_A + 1)], answer[LANES * (ALONG_A + 2)], answer[LANES * LIMIT_A],
    ) and _is_alone(
        ints_at, note[_SHAPE_B], ids, n, 1, n + 1 - own_a,
        answer[LANES * ALONG_B], answer[LANES * (ALONG_B + 1)], answer[LANES * (ALONG_B + 2)], answer[LANES * LIMIT_B],
    )  # fmt: skip


@kernel(inline=True)
def _is_alone(ints_at, shape, ids, n, body, own, gx, gy, gz, limit):
    row = view_i64(ints_at + 8 * INTS * shape, INTS)
    m = row[PADDED]
    return no_other_is_level(view_f64(row[ADDRESS], 3 * m), row[COUNT], m, row[TREE], ids, n, body, own, gx, gy, gz, limit)


@kernel
def _level(
    ints_at, numbers_at, poses_at, note, ids, question, answer, across_at, composed, doubles_at, integers_at
):
    """Have what is level with the feature settled; whether the row is proven still. Its bracket is set anew."""
    sa = note[_SHAPE_A]
    sb = note[_SHAPE_B]
    pa = note[_POSE_A]
    pb = note[_POSE_B]
    ints = view_i64(ints_at, INTS * (max(sa, sb) + 1))
    numbers = view_f64(numbers_at, NUMBERS * (max(sa, sb) + 1))
    poses = view_f64(poses_at, POSE * (max(pa, pb) + 1))
    at_a, n_a = coordinates_of(ints, sa)
    at_b, n_b = coordinates_of(ints, sb)
    pair = posed_pair(ints, numbers, poses, view_f64(at_a, n_a), view_f64(at_b, n_b), sa, pa, sb, pb)
    low = view_f64(doubles_at + 8 * _LOWS, 24 if composed else 0)
    direction = view_f64(doubles_at + 8 * _ACROSS, FINE)
    across = view_f64(across_at, LANES * FINE)
    for k in range(FINE):
        direction[k] = across[LANES * k]
    if composed:
        for k in range(24):
            low[k] = question[LANES * (LOW_A + k)]
    scale = question[LANES * SCALE]
    excess, _, _, _ = settle_level(pair, low, ids, direction, integers_at + 8 * _TERMS, scale)
    unsure = unsure_of(answer[LANES * SPREAD], excess, answer[LANES * LENGTH], question[LANES * SLOP], scale)
    low_end, middle, high_end = bracket(answer[LANES * GAP], answer[LANES * GAP_LOW], unsure / scale)
    answer[LANES * GAP_LOWER] = low_end
    answer[LANES * GAP_NEAREST] = middle
    answer[LANES * GAP_UPPER] = high_end
    return unsure < 2.0**-54 * answer[LANES * CORE]


@kernel(inline=True)
def write_guess(row, distance, lower, upper, nx, ny, nz):
    """What doubles say of a row that is to wait, and `_write` reads: for the pair as worked on."""
    row[DISTANCE] = distance
    row[LOWER] = lower
    row[UPPER] = upper
    row[NORMAL] = nx
    row[NORMAL + 1] = ny
    row[NORMAL + 2] = nz


@kernel(inline=True)
def _write(row, marks, question, answer, note, proven, depths, limit):
    """Finish a row: with proven digits, or as doubles say, for the exact stage to settle."""
    radius_a = question[LANES * RADIUS_A]
    radius_b = question[LANES * RADIUS_B]
    distance = row[DISTANCE]
    lower = row[LOWER]
    upper = row[UPPER]
    nx = row[NORMAL]
    ny = row[NORMAL + 1]
    nz = row[NORMAL + 2]
    if proven:
        distance = answer[LANES * GAP_NEAREST]
        lower = max(lower, answer[LANES * GAP_LOWER])
        upper = min(upper, answer[LANES * GAP_UPPER])
        nx = -answer[LANES * UNIT]
        ny = -answer[LANES * (UNIT + 1)]
        nz = -answer[LANES * (UNIT + 2)]
    write_verdict(row, marks, distance, lower, upper, note[_HOW], 0.0, limit)
    decided = lower > 0.0 or upper <= 0.0
    unfinished = marks[CERTIFIED] == 0 and (depths or upper > 0.0)
    # Radii may prove an overlap of cores between which doubles see no clear direction.
    vague = not proven and radius_a + radius_b > 0.0
    # Shares of a triangle's edges say little if it is thin; the exact stage takes more care.
    reach = 1.0 / question[LANES * SCALE]
    miss = 0.0
    core = row[DISTANCE] + (radius_a + radius_b)
    for axis in range(3):
        a = answer[LANES * (POINT_A + axis)]
        b = answer[LANES * (POINT_B + axis)]
        n = nx if axis == 0 else (ny if axis == 1 else nz)
        reach = max(reach, abs(a), abs(b))
        miss = max(miss, abs((b - a) - core * n))
    missed = proven and miss > _NEAR_MISS * reach and marks[BEYOND] == 0
    if not decided or unfinished or vague or missed:
        marks[HOW] = UNDECIDED
    write_vectors(
        row, nx, ny, nz,
        answer[LANES * POINT_A] + radius_a * nx,
        answer[LANES * (POINT_A + 1)] + radius_a * ny,
        answer[LANES * (POINT_A + 2)] + radius_a * nz,
        answer[LANES * POINT_B] - radius_b * nx,
        answer[LANES * (POINT_B + 1)] - radius_b * ny,
        answer[LANES * (POINT_B + 2)] - radius_b * nz,
        note[_FLIP] == 1,
    )  # fmt: skip
