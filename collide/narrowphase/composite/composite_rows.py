"""A row of a pair of bodies from the rows of their parts.

Apart, the distance of two unions is the least distance of their parts. Overlapping, the length of the smallest
separating translation has no formula; two bounds are proven. Each overlapping pair of parts must come apart, so the
length is at least the depth of the deepest pair. Along the normals of overlapping parts, and along and between axes of
the deepest, the unions are clear from a length on (`clearing_translation.py`). From the least of these lengths shorter
translations are descended to (`shorter_ways.py`); the last is reported.
Half-spaces among the parts may bar all these directions without end: for unions with half-spaces the ways out of all
half-spaces are tried, too (`ways_out.py`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import INTS, KIND, NUMBERS, POSE, RADIUS, REACH
from collide.narrowphase.bounds import PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.composite.clearing_translation import CLEARING, Length, barred_length, clearing_length, longer
from collide.narrowphase.composite.shorter_ways import SHORTER, shorter_way
from collide.narrowphase.composite.ways_out import MAX_PLANES, PLANE, gather_planes, is_halfspace, way_out
from collide.narrowphase.posed_pair import in_order
from collide.narrowphase.rows import (
    BEYOND,
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
    copy_row,
    view_row,
)
from collide.numerics.vec3 import Vec3, add, neg, norm, put_vec3, scale, sub, vec3_at

#: Normals of overlapping parts to be tried for a separating translation, deepest first; then axes of the deepest
#: overlap's first part, both ways, and a direction in each octant between the axes, with these coordinates.
MAX_NORMALS, _N_AXES, _N_BETWEEN = 4, 6, 8
_OFF_AXES = Vec3(0.8, 0.55, 0.25)

# Doubles of a score, what is known of a pair of bodies from the rows so far: the least distance, the number of its row,
# ends of the bracket, the least lower end of a row that is not certified, rounds, whether a row is a hit, how far other
# parts have a say by the first row, the number of overlaps kept, the first row's normal, and the deepest overlaps.
(
    _LEAST, _NEAREST, _LOWER, _UPPER, _UNCERTIFIED, _GJK, _EPA, _HIT, _SAY, _N_OVERLAPS, _NORMAL,
) = range(11)
_DEEPEST = _NORMAL + 3
# Of an overlap: its distance, the number of its row, its parts, its normal and both points.
_DISTANCE, _NUMBER, _OF_A, _OF_B, _VECTORS = range(5)
_OVERLAP = _VECTORS + 9
SCORE = _DEEPEST + MAX_NORMALS * _OVERLAP
#: Doubles that `separate_bodies` works in.
SEPARATING = CLEARING + MAX_PLANES * PLANE + SHORTER


class PosedParts(NamedTuple):
    """Views of a `ShapeTable`'s integers and numbers, of poses of parts, and of which shape each part is."""

    ints: Any
    numbers: Any
    poses: Any
    shape_of: Any


class _Bodies(NamedTuple):
    """The first part and the number of parts of both bodies."""

    first_a: int
    n_a: int
    first_b: int
    n_b: int


class PairSize(NamedTuple):
    """Size of two bodies [m], whether a part is curved, whether one is a half-space."""

    size: float
    curved: bool
    has_halfspace: bool


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
    score[at + _SAY] = math.inf


@kernel(inline=True)
def first_reach_of(score, at):
    """Distance [m] beyond which pairs of parts cannot change the answer, by the first row. The row's upper bound is an
    upper bound of the bodies' distance. A row beyond the limit has no upper bound, but a lower bound above the limit:
    pairs farther apart leave the bodies beyond the limit, and the least lower bound as before."""
    return score[at + _SAY]


@kernel(inline=True)
def first_normal_of(score, at):
    """The normal of the first row: whatever goes by it depends on the pair of bodies alone."""
    return vec3_at(score, at + _NORMAL)


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
        score[at + _SAY] = lower if row.flags[BEYOND] != 0 else upper
        put_vec3(score, at + _NORMAL, vec3_at(row.doubles, NORMAL))
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
    # Rows beyond the limit have no upper bound. Where another row has a finite bound, that row's lower bound may be
    # within the limit, however far apart the nearest row is by its distance.
    if score[at + _UPPER] < math.inf:
        row.flags[BEYOND] = 0
    # Every row that may be the nearest is certified.
    all_certified = score[at + _UNCERTIFIED] == math.inf or score[at + _UNCERTIFIED] > score[at + _UPPER]
    row.flags[CERTIFIED] = 1 if all_certified else 0
    row.words[ITERATIONS] = min(int(score[at + _GJK]), 0xFFFF) | (min(int(score[at + _EPA]), 0x7FFF) << 16)
    return score[at + _UPPER] < 0.0


# --- overlaps -------------------------------------------------------------------------------------


@kernel
def separate_bodies(score, at, out_at, parts, first_a, n_a, first_b, n_b, work_at):
    """Replace distance, lower, normal and points by the shortest translation found that separates both bodies.

    parts : `PosedParts`.   first, n : the first part and the number of parts of each body.   work : SEPARATING doubles
    of workspace.

    Against a single half-space the row of the deepest part is the answer: its translation clears all parts.
    """
    if _is_halfspace(parts, first_a, n_a) or _is_halfspace(parts, first_b, n_b):
        return
    row = view_row(out_at)
    doubles = row.doubles
    size = _size_of(parts, first_a, n_a, first_b, n_b)
    promised = (PROMISE_CURVED if size.curved else PROMISE_STORED) * size.size
    upper = doubles[UPPER]
    n_overlaps = int(score[at + _N_OVERLAPS])
    planes, n_planes = view_f64(work_at + 8 * CLEARING, PLANE * MAX_PLANES), 0
    if size.has_halfspace:
        n_planes = gather_planes(parts, first_a, n_a, first_b, n_b, planes)
    shortest = way_out(planes, n_planes, True)
    first_between = 0
    if n_planes < 0:
        n_directions = 0  # two half-spaces overlap without end
    else:
        first_between = n_overlaps + _N_AXES + (2 if n_planes > 0 else 0)
        n_directions = first_between + _N_BETWEEN
        upper = min(upper, -shortest.least)
        doubles[UPPER] = upper
    best, bodies = Length(math.inf, math.inf), _Bodies(first_a, n_a, first_b, n_b)
    overlap_number, is_new = 0, False
    nhat = vec3_at(doubles, NORMAL)
    deepest = score[at + _DEEPEST + _DISTANCE]
    for k in range(n_directions):
        tied = k < n_overlaps and score[at + _DEEPEST + _OVERLAP * k + _DISTANCE] == deepest
        if not tied and best.proven + upper <= promised:
            break  # no translation is shorter than −upper
        if k < n_overlaps:
            n = vec3_at(score, at + _DEEPEST + _OVERLAP * k + _VECTORS)
        elif k >= first_between:
            n = _between_axes(score, at, parts, first_a, first_b, k - first_between)
        elif k < n_overlaps + _N_AXES:
            n = _axis(score, at, parts, first_a, first_b, k - n_overlaps)
        else:
            n = shortest.x if k == n_overlaps + _N_AXES else way_out(planes, n_planes, False).x
            if not norm(n) > 0.0:
                continue
            n = scale(1.0 / norm(n), n)
        length = _length_along(score, at, parts, bodies, n, best.proven, work_at)
        if length.proven < best.proven:
            best, nhat, is_new = length, n, True
            overlap_number = k if k < n_overlaps else 0
        if is_new and not tied and best.proven + upper > promised:
            best, nhat = _shortened(score, at, parts, bodies, best, nhat, work_at)
            is_new = False
    doubles[DISTANCE] = min(-best.value, upper)
    doubles[LOWER] = -best.proven * (1 + 2.0**-50)  # the normal is a unit vector but for rounding
    if best.proven < math.inf:
        # The points of these parts fit their own depth: their middle stays.
        overlap = at + _DEEPEST + _OVERLAP * overlap_number
        row.words[PART_A] = int(score[overlap + _OF_A])
        row.words[PART_B] = int(score[overlap + _OF_B])
        middle = scale(0.5, add(vec3_at(score, overlap + _VECTORS + 3), vec3_at(score, overlap + _VECTORS + 6)))
        half = scale(0.5 * doubles[DISTANCE], nhat)
        put_vec3(doubles, NORMAL, add(nhat, Vec3(0.0, 0.0, 0.0)))  # never −0.0
        put_vec3(doubles, POINT_A, sub(middle, half))
        put_vec3(doubles, POINT_B, add(middle, half))
    if not upper - doubles[LOWER] <= promised:
        row.flags[CERTIFIED] = 0


@kernel
def _length_along(score, at, parts, bodies, n, limit, work_at):
    """The `Length` along n that clears the union; infinite if not less than the limit."""
    length = _way_past_overlaps(score, at, parts, bodies.first_a, bodies.first_b, n, limit, work_at)
    if not length.proven < limit:
        return Length(math.inf, math.inf)
    return clearing_length(
        parts, bodies.first_a, bodies.n_a, bodies.first_b, bodies.n_b, n, length, limit, work_at
    )


@kernel
def _shortened(score, at, parts, bodies, best, n, work_at):
    """(`Length`, direction) of a way out no longer than the way given, found from there on."""
    planes_at = work_at + 8 * (CLEARING + MAX_PLANES * PLANE)
    way = shorter_way(
        parts, bodies.first_a, bodies.n_a, bodies.first_b, bodies.n_b, n, best.proven, planes_at, work_at
    )
    length = _length_along(score, at, parts, bodies, way, best.proven, work_at)
    if length.proven < best.proven:
        return length, way
    return best, n


@kernel
def _way_past_overlaps(score, at, parts, first_a, first_b, n, limit, work_at):
    """The `Length` along n up to which the kept overlaps bar the way, or a single overlap does beyond the limit."""
    length = Length(0.0, 0.0)
    for k in range(int(score[at + _N_OVERLAPS])):
        overlap = at + _DEEPEST + _OVERLAP * k
        pa, pb = first_a + int(score[overlap + _OF_A]), first_b + int(score[overlap + _OF_B])
        length = longer(length, barred_length(parts, pa, pb, n, work_at))
        if not length.proven < limit:
            break
    return length


@kernel
def _axis(score, at, parts, first_a, first_b, k):
    """Direction k of _N_AXES: along the frame of the deepest overlap's first part, both ways; of swapped bodies the
    opposite direction."""
    pa = first_a + int(score[at + _DEEPEST + _OF_A])
    pb = first_b + int(score[at + _DEEPEST + _OF_B])
    _, pa, _, _, flip = in_order(parts.ints, parts.poses, parts.shape_of[pa], pa, parts.shape_of[pb], pb)
    at_pose = POSE * pa + k % 3
    axis = Vec3(parts.poses[at_pose], parts.poses[at_pose + 3], parts.poses[at_pose + 6])
    axis = scale(1.0 / norm(axis), axis)
    return neg(axis) if (k < 3) == flip else axis


@kernel
def _between_axes(score, at, parts, first_a, first_b, k):
    """Direction k of _N_BETWEEN, one in each octant of the first frame, off what may be planes of symmetry."""
    p = _axis(score, at, parts, first_a, first_b, 0)
    q = _axis(score, at, parts, first_a, first_b, 1)
    r = _axis(score, at, parts, first_a, first_b, 2)
    u, v, w = _OFF_AXES.x, _OFF_AXES.y, _OFF_AXES.z
    n = add(scale(u if k & 1 else -u, p), add(scale(v if k & 2 else -v, q), scale(w if k & 4 else -w, r)))
    return scale(1.0 / norm(n), n)


@kernel(inline=True)
def _is_halfspace(parts, first, n):
    return n == 1 and is_halfspace(parts, first)


@kernel
def _size_of(parts, first_a, n_a, first_b, n_b):
    """The `PairSize` of two bodies."""
    # Seen from between the bodies, whichever is A: where in the world the pair stands is no part of its size.
    p_a = vec3_at(parts.poses, POSE * first_a + 9)
    p_b = vec3_at(parts.poses, POSE * first_b + 9)
    origin = add(scale(0.5, p_a), scale(0.5, p_b))
    of_a = _size_of_body(parts, first_a, n_a, origin)
    of_b = _size_of_body(parts, first_b, n_b, origin)
    return PairSize(of_a.size + of_b.size, of_a.curved or of_b.curved, of_a.has_halfspace or of_b.has_halfspace)


@kernel
def _size_of_body(parts, first, n, origin):
    """The `PairSize` of n parts alone, seen from a point of the world."""
    size = 0.0
    curved = False
    has_halfspace = False
    for part in range(first, first + n):
        shape = parts.shape_of[part]
        at = NUMBERS * shape
        away = norm(sub(vec3_at(parts.poses, POSE * part + 9), origin))
        size = max(size, parts.numbers[at + REACH] + parts.numbers[at + RADIUS] + away)
        kind = parts.ints[INTS * shape + KIND]
        curved = curved or kind != POINTS
        has_halfspace = has_halfspace or kind == HALFSPACE
    return PairSize(size, curved, has_halfspace)


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def combine_rows(rows_at, starts_at, spans_at, n, ints_at, numbers_at, poses_at, shape_of_at, score_at, out_at):
    """Write one row for each of n pairs of bodies from rows of their parts.

    starts : n + 1 numbers of rows, where each pair's begin and end.
    spans : first part and number of parts of A, and of B,
    pair by pair.   ints, numbers, poses, shape_of : as in `answer_pairs`.   score : SCORE + SEPARATING doubles.
    out : zeroed rows.
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
            )
            separate_bodies(score, 0, out, parts, first_a, n_a, first_b, n_b, score_at + 8 * SCORE)
    return 0
