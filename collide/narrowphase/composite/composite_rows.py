"""One row a pair of bodies from rows of their parts.

Apart, the distance of two unions is the least one of their parts. Overlapping, the smallest
separating translation has no such formula; what is reported is a translation that separates the
hulls of both bodies along the best of the parts' normals, which is a proven upper bound, beside
the proven lower bound that each overlapping pair of parts must come apart.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import INTS, KIND, NUMBERS, POSE, POSE_SLOP, RADIUS, REACH, SLOP
from collide.narrowphase.bounds import ERROR, PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.posed_pair import posed_body, radius_of
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
    view_row,
)
from collide.numerics.vec3 import add, dot, neg, norm1, put_vec3, rotate_back, scale, sub, vec3_at
from collide.support.support_mapping import support

#: Normals of overlapping parts that are tried for a separating translation, deepest first.
MAX_NORMALS = 8

# Doubles of a score, what is known of a pair of bodies from the rows so far: the least distance, the number of its row,
# ends of the bracket, the least lower end of a row that is not certified, rounds, whether a row is a hit, the upper end
# of the first row, the number of overlaps kept, and the deepest of them.
(
    _LEAST, _NEAREST, _LOWER, _UPPER, _UNCERTIFIED, _GJK, _EPA, _HIT, _FIRST_UPPER, _N_OVERLAPS, _DEEPEST,
) = range(11)  # fmt: skip
# Of an overlap: its distance, the number of its row, its parts, its normal and both points.
_DISTANCE, _NUMBER, _OF_A, _OF_B, _VECTORS = range(5)
_OVERLAP = _VECTORS + 9
SCORE = _DEEPEST + MAX_NORMALS * _OVERLAP


class PosedParts(NamedTuple):
    """Views of a `ShapeTable`'s integers and numbers, of poses of parts, and of which shape each part is."""

    ints: Any
    numbers: Any
    poses: Any
    shape_of: Any


class BodySize(NamedTuple):
    """Size of a body seen from a point of the world [m], how far its points may be off besides, whether it is
    curved."""

    size: float
    slop: float
    curved: bool


# --- scores ---------------------------------------------------------------------------------------


@kernel(inline=True)
def begin_score(score, at):
    for k in range(_DEEPEST):
        score[at + k] = 0.0
    score[at + _LEAST] = math.inf
    score[at + _NEAREST] = -1.0
    score[at + _LOWER] = math.inf
    score[at + _UPPER] = math.inf
    score[at + _UNCERTIFIED] = math.inf
    score[at + _FIRST_UPPER] = math.inf


@kernel(inline=True)
def first_upper_of(score, at):
    """An upper bound of the bodies' distance, by the row that came first."""
    return score[at + _FIRST_UPPER]


@kernel(inline=True)
def copy_row(row_at, out_at):
    row = view_i64(row_at, ROW // 8)
    out = view_i64(out_at, ROW // 8)
    for k in range(ROW // 8):
        out[k] = row[k]


@kernel
def add_row(score, at, row_at, number, out_at):
    """Take a row of two parts into account; ``out`` becomes the nearest row so far, of equal ones that of least
    number."""
    row = view_row(row_at)
    distance = row.doubles[DISTANCE]
    lower = row.doubles[LOWER]
    upper = row.doubles[UPPER]
    nearest = score[at + _NEAREST]
    if nearest < 0.0 or distance < score[at + _LEAST] or (distance == score[at + _LEAST] and number < nearest):
        score[at + _LEAST] = distance
        score[at + _NEAREST] = float(number)
        copy_row(row_at, out_at)
    if nearest < 0.0:
        score[at + _FIRST_UPPER] = upper
    score[at + _LOWER] = min(score[at + _LOWER], lower)
    score[at + _UPPER] = min(score[at + _UPPER], upper)
    if row.flags[CERTIFIED] == 0:
        score[at + _UNCERTIFIED] = min(score[at + _UNCERTIFIED], lower)
    if row.flags[HIT] != 0:
        score[at + _HIT] = 1.0
    rounds = row.words[ITERATIONS]
    score[at + _GJK] += float(rounds & 0xFFFF)
    score[at + _EPA] += float(rounds >> 16)
    if upper < 0.0:
        _add_overlap(score, at, row_at, number)


@kernel
def _add_overlap(score, at, row_at, number):
    """Insert an overlap among the deepest, in their order."""
    row = view_row(row_at)
    distance = row.doubles[DISTANCE]
    n = int(score[at + _N_OVERLAPS])
    first = at + _DEEPEST
    place = 0
    while place < n:
        overlap = first + _OVERLAP * place
        same = distance == score[overlap + _DISTANCE]
        if distance < score[overlap + _DISTANCE] or (same and number < score[overlap + _NUMBER]):
            break
        place += 1
    if place == MAX_NORMALS:
        return
    n = min(n + 1, MAX_NORMALS)
    for k in range(_OVERLAP * n - 1, _OVERLAP * (place + 1) - 1, -1):
        score[first + k] = score[first + k - _OVERLAP]
    overlap = first + _OVERLAP * place
    score[overlap + _DISTANCE] = distance
    score[overlap + _NUMBER] = float(number)
    score[overlap + _OF_A] = float(row.words[PART_A])
    score[overlap + _OF_B] = float(row.words[PART_B])
    for k in range(9):
        score[overlap + _VECTORS + k] = row.doubles[NORMAL + k]
    score[at + _N_OVERLAPS] = float(n)


@kernel
def close_score(score, at, out_at):
    """The nearest row, its bracket widened to hold for the bodies; whether they overlap for certain."""
    row = view_row(out_at)
    row.doubles[LOWER] = score[at + _LOWER]
    row.doubles[UPPER] = score[at + _UPPER]
    row.flags[HIT] = 1 if score[at + _HIT] != 0.0 else 0
    # Every row that may be the nearest is certified.
    all_certified = score[at + _UNCERTIFIED] == math.inf or score[at + _UNCERTIFIED] > score[at + _UPPER]
    row.flags[CERTIFIED] = 1 if all_certified else 0
    row.words[ITERATIONS] = min(int(score[at + _GJK]), 0xFFFF) | (min(int(score[at + _EPA]), 0x7FFF) << 16)
    return score[at + _UPPER] < 0.0


# --- overlaps -------------------------------------------------------------------------------------


@kernel
def separate_bodies(score, at, out_at, parts, first_a, n_a, first_b, n_b):
    """Replace distance, lower, normal and points by the best translation that separates both bodies.

    parts : `PosedParts`.   first, n : each body's parts there.

    Against one half-space the row of the deepest part is the answer: there is one translation for all.
    """
    if _is_halfspace(parts, first_a, n_a) or _is_halfspace(parts, first_b, n_b):
        return
    row = view_row(out_at)
    doubles = row.doubles
    # Seen from between the bodies, whichever is A: where in the world the pair stands is no part of its size.
    p_a = vec3_at(parts.poses, POSE * first_a + 9)
    p_b = vec3_at(parts.poses, POSE * first_b + 9)
    origin = add(scale(0.5, p_a), scale(0.5, p_b))
    size_a = _size_of(parts, first_a, n_a, origin)
    size_b = _size_of(parts, first_b, n_b, origin)
    size = size_a.size + size_b.size
    error = ERROR * size + (size_a.slop + size_b.slop)
    best = math.inf
    upper = doubles[UPPER]
    for k in range(int(score[at + _N_OVERLAPS])):
        overlap = at + _DEEPEST + _OVERLAP * k
        n = vec3_at(score, overlap + _VECTORS)
        depth = _extent(parts, first_a, n_a, origin, n) + _extent(parts, first_b, n_b, origin, neg(n))
        if depth + error < best:
            best = depth + error
            for j in range(9):
                doubles[NORMAL + j] = score[overlap + _VECTORS + j]
            row.words[PART_A] = int(score[overlap + _OF_A])
            row.words[PART_B] = int(score[overlap + _OF_B])
            doubles[DISTANCE] = min(-depth, upper)
            doubles[LOWER] = -depth - error
    if best == math.inf:
        doubles[DISTANCE] = -math.inf
        doubles[LOWER] = -math.inf
    else:
        # The points of the deepest parts fit that normal's own depth: their middle stays.
        middle = scale(0.5, add(vec3_at(doubles, POINT_A), vec3_at(doubles, POINT_B)))
        half = scale(0.5 * doubles[DISTANCE], vec3_at(doubles, NORMAL))
        put_vec3(doubles, POINT_A, sub(middle, half))
        put_vec3(doubles, POINT_B, add(middle, half))
    promised = (PROMISE_CURVED if size_a.curved or size_b.curved else PROMISE_STORED) * size
    if not upper - doubles[LOWER] <= promised:
        row.flags[CERTIFIED] = 0


@kernel(inline=True)
def _is_halfspace(parts, first, n):
    return n == 1 and parts.ints[INTS * parts.shape_of[first] + KIND] == HALFSPACE


@kernel
def _size_of(parts, first, n, origin):
    """The `BodySize` of n parts, seen from a point of the world."""
    size = 0.0
    slop = 0.0
    pose_slop = 0.0
    curved = False
    for part in range(first, first + n):
        p = POSE * part
        shape = parts.shape_of[part]
        at = NUMBERS * shape
        away = norm1(sub(vec3_at(parts.poses, p + 9), origin))
        size = max(size, 2 * parts.numbers[at + REACH] + parts.numbers[at + RADIUS] + away)
        slop = max(slop, parts.numbers[at + SLOP])
        pose_slop = max(pose_slop, parts.poses[p + POSE_SLOP])
        curved = curved or parts.ints[INTS * shape + KIND] != POINTS
    return BodySize(size, slop + pose_slop, curved)


@kernel
def _extent(parts, first, n_parts, origin, n):
    """How far a body reaches along n from a point of the world [m]."""
    farthest = -math.inf
    for part in range(first, first + n_parts):
        body = posed_body(parts.ints, parts.shape_of[part], part)
        if body.kind == HALFSPACE:
            return math.inf  # bounded in one direction only, which a rounded normal never is
        g = rotate_back(parts.poses, body.pose_at, n)
        farthest_point = support(
            body.kind, body.coords, body.padded, parts.numbers, body.params_at, body.tree, 0, -1, g
        ).point
        shift = dot(sub(vec3_at(parts.poses, body.pose_at + 9), origin), n)
        farthest = max(farthest, dot(farthest_point, g) + shift + radius_of(parts, body))
    return farthest


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def combine_rows(rows_at, starts_at, spans_at, n, ints_at, numbers_at, poses_at, shape_of_at, score_at, out_at):
    """Write one row for each of n pairs of bodies from rows of their parts.

    starts : n + 1 numbers of rows, where each pair's begin and end.
    spans : first part and number of parts of A, and of B,
    pair by pair.   ints, numbers, poses, shape_of : as in `answer_pairs`.   score : SCORE doubles.   out : zeroed rows.
    """
    starts = view_i64(starts_at, n + 1)
    spans = view_i64(spans_at, 4 * n)
    score = view_f64(score_at, SCORE)
    for k in range(n):
        out = out_at + ROW * k
        begin_score(score, 0)
        for number in range(starts[k], starts[k + 1]):
            add_row(score, 0, rows_at + ROW * number, number, out)
        first_a = spans[4 * k]
        n_a = spans[4 * k + 1]
        first_b = spans[4 * k + 2]
        n_b = spans[4 * k + 3]
        if close_score(score, 0, out) and n_a * n_b > 1:
            last = max(first_a + n_a, first_b + n_b)
            shape_of = view_i64(shape_of_at, last)
            n_shapes = 0
            for part in range(n_a + n_b):
                n_shapes = max(n_shapes, shape_of[first_a + part if part < n_a else first_b + part - n_a] + 1)
            parts = PosedParts(
                view_i64(ints_at, INTS * n_shapes), view_f64(numbers_at, NUMBERS * n_shapes),
                view_f64(poses_at, POSE * last), shape_of,
            )  # fmt: skip
            separate_bodies(score, 0, out, parts, first_a, n_a, first_b, n_b)
    return 0
