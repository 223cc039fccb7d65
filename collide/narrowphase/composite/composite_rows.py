"""One row a pair of bodies from rows of their parts.

Apart, the distance of two unions is the least one of their parts. Overlapping, the smallest
separating translation has no such formula; what is reported is a translation that separates the
hulls of both bodies along the best of the parts' normals, which is a proven upper bound, beside
the proven lower bound that each overlapping pair of parts must come apart.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i32, view_i64, view_u8
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import (
    COUNT,
    INTS,
    KIND,
    NUMBERS,
    PADDED,
    PARAMS,
    POSE,
    POSE_SLOP,
    RADIUS,
    REACH,
    SLOP,
    TREE,
)
from collide.narrowphase.bounds import ERROR, PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.posed_pair import coordinates_of
from collide.narrowphase.rows import (
    CERTIFIED,
    DISTANCE,
    HIT,
    ITERATIONS,
    LOWER,
    NORMAL,
    PART_A,
    PART_B,
    POINT_A,
    POINT_B,
    ROW,
    UPPER,
)
from collide.support.support_mapping import support

#: Normals of overlapping parts that are tried as the way out of a union, deepest first.
NORMALS_TRIED = 8

# What is known of a pair of bodies while its rows come in: which row is nearest, ends of the bracket, the least lower end
# of a row that is not certified, rounds, whether a row is a hit, the upper end after the first row, and the deepest overlaps.
_LEAST, _NEAREST, _LOWER, _UPPER, _UNPROVEN, _GJK, _EPA, _HIT, _FIRST_UPPER, _OVERLAPS, _DEEPEST = range(11)
# Of an overlap: its distance, which row it is, its parts, its normal and both points.
_DEPTH, _PLACE, _OF_A, _OF_B, _VECTORS = range(5)
_OVERLAP = _VECTORS + 9
SCORE = _DEEPEST + NORMALS_TRIED * _OVERLAP


@kernel(inline=True)
def begin_score(score, at):
    score[at + _LEAST] = math.inf
    score[at + _NEAREST] = -1.0
    score[at + _LOWER] = math.inf
    score[at + _UPPER] = math.inf
    score[at + _UNPROVEN] = math.inf
    score[at + _GJK] = 0.0
    score[at + _EPA] = 0.0
    score[at + _HIT] = 0.0
    score[at + _FIRST_UPPER] = math.inf
    score[at + _OVERLAPS] = 0.0


@kernel(inline=True)
def first_upper_of(score, at):
    """What the distance of the bodies is at most, by the row that came first."""
    return score[at + _FIRST_UPPER]


@kernel(inline=True)
def copy_row(row_at, out_at):
    given = view_i64(row_at, ROW // 8)
    out = view_i64(out_at, ROW // 8)
    for k in range(ROW // 8):
        out[k] = given[k]


@kernel
def add_row(score, at, row_at, place, out_at):
    """Take a row of two parts into account; ``out`` becomes the nearest row so far, of equal ones that of the first place."""
    row = view_f64(row_at, 12)
    rounds = view_i32(row_at, ROW // 4)[ITERATIONS]
    marks = view_u8(row_at, ROW)
    distance = row[DISTANCE]
    lower = row[LOWER]
    upper = row[UPPER]
    nearest = score[at + _NEAREST]
    if nearest < 0.0 or distance < score[at + _LEAST] or (distance == score[at + _LEAST] and place < nearest):
        score[at + _LEAST] = distance
        score[at + _NEAREST] = float(place)
        copy_row(row_at, out_at)
    if nearest < 0.0:
        score[at + _FIRST_UPPER] = upper
    score[at + _LOWER] = min(score[at + _LOWER], lower)
    score[at + _UPPER] = min(score[at + _UPPER], upper)
    if marks[CERTIFIED] == 0:
        score[at + _UNPROVEN] = min(score[at + _UNPROVEN], lower)
    if marks[HIT] != 0:
        score[at + _HIT] = 1.0
    score[at + _GJK] += float(rounds & 0xFFFF)
    score[at + _EPA] += float(rounds >> 16)
    if upper < 0.0:
        _add_overlap(score, at, row_at, place)


@kernel
def _add_overlap(score, at, row_at, place):
    """Keep an overlap among the deepest, in their order."""
    row = view_f64(row_at, 12)
    words = view_i32(row_at, ROW // 4)
    depth = row[DISTANCE]
    kept = int(score[at + _OVERLAPS])
    first = at + _DEEPEST
    behind = 0
    while behind < kept:
        other = first + _OVERLAP * behind
        if depth < score[other + _DEPTH] or (depth == score[other + _DEPTH] and place < score[other + _PLACE]):
            break
        behind += 1
    if behind == NORMALS_TRIED:
        return
    kept = min(kept + 1, NORMALS_TRIED)
    for k in range(kept - 1, behind, -1):
        for j in range(_OVERLAP):
            score[first + _OVERLAP * k + j] = score[first + _OVERLAP * (k - 1) + j]
    to = first + _OVERLAP * behind
    score[to + _DEPTH] = depth
    score[to + _PLACE] = float(place)
    score[to + _OF_A] = float(words[PART_A])
    score[to + _OF_B] = float(words[PART_B])
    for k in range(9):
        score[to + _VECTORS + k] = row[NORMAL + k]
    score[at + _OVERLAPS] = float(kept)


@kernel
def close_score(score, at, out_at):
    """The nearest row, its bracket widened to hold for the bodies; whether they overlap for certain."""
    row = view_f64(out_at, 12)
    marks = view_u8(out_at, ROW)
    row[LOWER] = score[at + _LOWER]
    row[UPPER] = score[at + _UPPER]
    marks[HIT] = 1 if score[at + _HIT] != 0.0 else 0
    # Every row that may be the nearest is certified.
    marks[CERTIFIED] = 1 if score[at + _UNPROVEN] == math.inf or score[at + _UNPROVEN] > score[at + _UPPER] else 0
    gjk = min(int(score[at + _GJK]), 0xFFFF)
    epa = min(int(score[at + _EPA]), 0x7FFF)
    view_i32(out_at, ROW // 4)[ITERATIONS] = gjk | (epa << 16)
    return score[at + _UPPER] < 0.0


@kernel
def find_way_out(score, at, out_at, ints, numbers, poses, shape_of, first_a, parts_a, first_b, parts_b):
    """Replace distance, lower, normal and points by the best translation that separates both bodies.

    first, parts : each body's rows of ``poses`` and ``shape_of``.

    Against one half-space the deepest part already tells it: there is one way out for all.
    """
    if _is_halfspace(ints, shape_of, first_a, parts_a) or _is_halfspace(ints, shape_of, first_b, parts_b):
        return
    row = view_f64(out_at, 12)
    words = view_i32(out_at, ROW // 4)
    marks = view_u8(out_at, ROW)
    # Seen from between the bodies, whichever is A: where in the world the pair stands is no part of its size.
    p = POSE * first_a + 9
    q = POSE * first_b + 9
    ox = 0.5 * poses[p] + 0.5 * poses[q]
    oy = 0.5 * poses[p + 1] + 0.5 * poses[q + 1]
    oz = 0.5 * poses[p + 2] + 0.5 * poses[q + 2]
    size_a, slop_a, curved_a = _size_of(ints, numbers, poses, shape_of, first_a, parts_a, ox, oy, oz)
    size_b, slop_b, curved_b = _size_of(ints, numbers, poses, shape_of, first_b, parts_b, ox, oy, oz)
    size = size_a + size_b
    error = ERROR * size + (slop_a + slop_b)
    best = math.inf
    upper = row[UPPER]
    for k in range(int(score[at + _OVERLAPS])):
        tried = at + _DEEPEST + _OVERLAP * k
        nx = score[tried + _VECTORS]
        ny = score[tried + _VECTORS + 1]
        nz = score[tried + _VECTORS + 2]
        depth = _extent(ints, numbers, poses, shape_of, first_a, parts_a, ox, oy, oz, nx, ny, nz)
        depth += _extent(ints, numbers, poses, shape_of, first_b, parts_b, ox, oy, oz, -nx, -ny, -nz)
        if depth + error < best:
            best = depth + error
            for j in range(9):
                row[NORMAL + j] = score[tried + _VECTORS + j]
            words[PART_A] = int(score[tried + _OF_A])
            words[PART_B] = int(score[tried + _OF_B])
            row[DISTANCE] = min(-depth, upper)
            row[LOWER] = -depth - error
    if best == math.inf:
        row[DISTANCE] = -math.inf
        row[LOWER] = -math.inf
    else:
        # The points of the deepest parts fit that normal's own depth: keep their middle.
        for j in range(3):
            middle = 0.5 * (row[POINT_A + j] + row[POINT_B + j])
            half = 0.5 * row[DISTANCE] * row[NORMAL + j]
            row[POINT_A + j] = middle - half
            row[POINT_B + j] = middle + half
    promised = (PROMISE_CURVED if curved_a or curved_b else PROMISE_STORED) * size
    if not upper - row[LOWER] <= promised:
        marks[CERTIFIED] = 0


@kernel(inline=True)
def _is_halfspace(ints, shape_of, first, parts):
    return parts == 1 and ints[INTS * shape_of[first] + KIND] == HALFSPACE


@kernel
def _size_of(ints, numbers, poses, shape_of, first, parts, ox, oy, oz):
    """(size of a body seen from a point o of the world, how far its points may be off besides, whether a part is no polytope)."""
    size = 0.0
    slop = 0.0
    pose_slop = 0.0
    curved = False
    for part in range(first, first + parts):
        p = POSE * part
        at = NUMBERS * shape_of[part]
        away = abs(poses[p + 9] - ox) + abs(poses[p + 10] - oy) + abs(poses[p + 11] - oz)
        size = max(size, 2 * numbers[at + REACH] + numbers[at + RADIUS] + away)
        slop = max(slop, numbers[at + SLOP])
        pose_slop = max(pose_slop, poses[p + POSE_SLOP])
        curved = curved or ints[INTS * shape_of[part] + KIND] != POINTS
    return size, slop + pose_slop, curved


@kernel
def _extent(ints, numbers, poses, shape_of, first, parts, ox, oy, oz, nx, ny, nz):
    """How far a body reaches along n from a point o of the world."""
    farthest = -math.inf
    for part in range(first, first + parts):
        shape = shape_of[part]
        kind = ints[INTS * shape + KIND]
        if kind == HALFSPACE:
            return math.inf  # bounded in one direction only, which a rounded normal never is
        p = POSE * part
        gx = poses[p] * nx + poses[p + 3] * ny + poses[p + 6] * nz
        gy = poses[p + 1] * nx + poses[p + 4] * ny + poses[p + 7] * nz
        gz = poses[p + 2] * nx + poses[p + 5] * ny + poses[p + 8] * nz
        at, length = coordinates_of(ints, shape)
        params = NUMBERS * shape + PARAMS
        _, x, y, z, _ = support(
            kind, view_f64(at, length), ints[INTS * shape + COUNT], ints[INTS * shape + PADDED], numbers, params,
            ints[INTS * shape + TREE], 0, -1, gx, gy, gz,
        )  # fmt: skip
        core = x * gx + y * gy + z * gz
        shift = (poses[p + 9] - ox) * nx + (poses[p + 10] - oy) * ny + (poses[p + 11] - oz) * nz
        farthest = max(farthest, core + shift + numbers[NUMBERS * shape + RADIUS])
    return farthest


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def combine_rows(rows_at, starts_at, spans_at, n, ints_at, numbers_at, poses_at, shape_of_at, score_at, out_at):
    """Write one row for each of n pairs of bodies from rows of their parts.

    starts : n + 1 numbers of rows, where each pair's begin and end.   spans : first part and number of parts of A, and of B,
    pair by pair.   ints, numbers, poses, shape_of : as in `answer_pairs`.   score : SCORE doubles.   out : zeroed rows.
    """
    starts = view_i64(starts_at, n + 1)
    spans = view_i64(spans_at, 4 * n)
    score = view_f64(score_at, SCORE)
    for k in range(n):
        out = out_at + ROW * k
        begin_score(score, 0)
        for place in range(starts[k], starts[k + 1]):
            add_row(score, 0, rows_at + ROW * place, place, out)
        first_a = spans[4 * k]
        parts_a = spans[4 * k + 1]
        first_b = spans[4 * k + 2]
        parts_b = spans[4 * k + 3]
        if close_score(score, 0, out) and parts_a * parts_b > 1:
            last = max(first_a + parts_a, first_b + parts_b)
            shape_of = view_i64(shape_of_at, last)
            shapes = 0
            for part in range(parts_a + parts_b):
                own = first_a + part if part < parts_a else first_b + part - parts_a
                shapes = max(shapes, shape_of[own] + 1)
            find_way_out(
                score, 0, out, view_i64(ints_at, INTS * shapes), view_f64(numbers_at, NUMBERS * shapes),
                view_f64(poses_at, POSE * last), shape_of, first_a, parts_a, first_b, parts_b,
            )  # fmt: skip
    return 0
