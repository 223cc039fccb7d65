"""Pairs of small hulls by portals, eight at a time, before GJK: booleans, and gaps where no depths are wanted.

Booleans are decided wherever a plane or a tetrahedron is clear of rounding: pairs of 8 vertices take less than half the
time GJK takes. Of gaps (`distance` with signed=False) overlaps are decided, with a common point; of bodies apart GJK
gets the portal to begin with, which is mostly the nearest face already: near touching one round is left of five. What
is open goes to GJK as if nothing had been tried.

No row depends on others; only whether the last one or two booleans of a list come here at all does. Hits are the
same either way.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.kernels.lanes import LANES, transpose_eight, view_lanes
from collide.lowering.packed_convex import POINTS
from collide.lowering.shape_table import ADDRESS, INTS, KIND, NUMBERS, PADDED, POSE, RADIUS
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.gjk import mpr
from collide.narrowphase.gjk.mpr import MAX_VERTICES, RUN, refine
from collide.narrowphase.posed_pair import in_order, size_and_slop, sum_of_reaches
from collide.narrowphase.rows import (
    COUNT,
    ITERATIONS,
    NORMAL,
    POINT_A,
    POINT_B,
    ROW,
    VERTICES_A,
    VERTICES_B,
    blank_row,
    write_decision,
)
from collide.numerics.vec3 import Vec3, add, divide, norm, norm1, put_vec3, scale, sub, vec3_at
from collide.results import PLANE, SIMPLEX

#: With fewer booleans than this GJK is as fast.
_MIN_BOOLEANS = 3
#: Bodies whose frames are farther apart than this share of their reaches rarely meet, and GJK is as fast.
_NEAR_RATIO = 0.85
#: Sizes of pairs whose numbers neither overflow nor vanish, multiplied six times.
_SMALLEST, _LARGEST = 1e-20, 1e20
#: How far the two points of a common one may lie apart, in units of the pair's error.
_ONE_POINT = 4.0

#: Doubles of the workspace: a block, and what brings it to a multiple of its elements' size.
DOUBLES = LANES * (mpr.BLOCK + 1)
# Integers: addresses of vertices and of poses, numbers of rows, whether bodies are exchanged.
_AT_VERTICES_A, _AT_VERTICES_B, _AT_POSE_A, _AT_POSE_B, _ROWS, _FLIP = (LANES * k for k in range(6))
TICKETS = 6 * LANES


class _Lanes(NamedTuple):
    """Eight pairs.   values : their block, as doubles; number k of lane j stands at LANES·k + j.   tickets : TICKETS
    integers.

    block_at, tickets_at : addresses of both.
    """

    values: Any
    tickets: Any
    block_at: int
    tickets_at: int


@kernel
def answer_small_hulls(tables, pairs_at, n_pairs, boolean, limit, rows_at, doubles_at, integers_at):
    """Answer rows of two small hulls, as far as depths are not needed, and leave the others open.

    An open row of a gap names three pairs of vertices to begin with, in the order worked on (`in_order`). Returns the
    number of rows tried.   tables : `Tables`; other arguments as in `answer_pairs`.   doubles, integers : workspace of
    DOUBLES doubles and TICKETS integers.
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    block_at = (doubles_at + 8 * (LANES - 1)) // (8 * LANES) * (8 * LANES)
    lanes = _Lanes(view_f64(block_at, LANES * mpr.BLOCK), view_i64(integers_at, TICKETS), block_at, integers_at)
    n_queued = n_padded = n_tried = 0
    for k in range(n_pairs):
        pa = pairs[2 * k]
        pb = pairs[2 * k + 1]
        shape_of = view_i64(tables.shape_of_at, max(pa, pb) + 1)
        sa = shape_of[pa]
        sb = shape_of[pb]
        ints = view_i64(tables.ints_at, INTS * (max(sa, sb) + 1))
        row_at = rows_at + ROW * k
        if not (_is_small(ints, sa) and _is_small(ints, sb)) or (boolean and _has_axis(row_at)):
            continue
        numbers = view_f64(tables.numbers_at, NUMBERS * (max(sa, sb) + 1))
        if numbers[NUMBERS * sa + RADIUS] + numbers[NUMBERS * sb + RADIUS] > 0.0:
            continue  # portals bound no distance: they cannot prove cores nearer than the radii
        poses = view_f64(tables.poses_at, POSE * (max(pa, pb) + 1))
        size, slop, _ = size_and_slop(numbers, poses, sa, pa, sb, pb)
        if not _SMALLEST < size < _LARGEST:
            continue
        error = ERROR * size + slop
        n_tried += 1
        if _are_far(numbers, poses, sa, pa, sb, pb, boolean, error, limit, row_at):
            continue
        flip = False
        if not boolean:
            sa, pa, sb, pb, flip = in_order(ints, poses, sa, pa, sb, pb)
        n_padded = max(n_padded, ints[INTS * sa + PADDED], ints[INTS * sb + PADDED])
        _put_body(lanes, n_queued, mpr.COUNT_A, _AT_VERTICES_A, _AT_POSE_A, ints, sa, tables.poses_at + 8 * POSE * pa)
        _put_body(lanes, n_queued, mpr.COUNT_B, _AT_VERTICES_B, _AT_POSE_B, ints, sb, tables.poses_at + 8 * POSE * pb)
        lanes.values[LANES * mpr.ERROR_OF + n_queued] = error
        lanes.tickets[_ROWS + n_queued] = k
        lanes.tickets[_FLIP + n_queued] = 1 if flip else 0
        n_queued += 1
        if n_queued == LANES:
            _answer_eight(lanes, LANES, n_padded, boolean, limit, rows_at)
            n_queued = n_padded = 0
    if n_queued >= (_MIN_BOOLEANS if boolean else 1):
        _fill_lanes(lanes, n_queued)
        _answer_eight(lanes, n_queued, n_padded, boolean, limit, rows_at)
    return n_tried


@kernel(inline=True)
def _put_body(lanes, lane, count, vertices, pose, ints, shape, pose_at):
    """Write the addresses of vertices and pose of a body, and its padded number of vertices, into a lane."""
    lanes.values[LANES * count + lane] = ints[INTS * shape + PADDED]
    lanes.tickets[vertices + lane] = ints[INTS * shape + ADDRESS]
    lanes.tickets[pose + lane] = pose_at


@kernel(inline=True)
def _fill_lanes(lanes, n_queued):
    """Lanes without a row do what the first does."""
    for lane in range(n_queued, LANES):
        for k in range(0, TICKETS, LANES):
            lanes.tickets[k + lane] = lanes.tickets[k]
        for k in range(mpr.COUNT_A, mpr.ERROR_OF + 1):
            lanes.values[LANES * k + lane] = lanes.values[LANES * k]


@kernel(inline=True)
def _is_small(ints, s):
    return ints[INTS * s + PADDED] <= MAX_VERTICES and ints[INTS * s + KIND] == POINTS


@kernel(inline=True)
def _has_axis(row_at):
    """Whether an axis is to be tried first, which is quicker still."""
    row = view_f64(row_at, NORMAL + 3)
    return row[NORMAL] != 0.0 or row[NORMAL + 1] != 0.0 or row[NORMAL + 2] != 0.0


@kernel(inline=True)
def _are_far(numbers, poses, sa, pa, sb, pb, boolean, error, limit, row_at):
    """Whether balls about the frames' origins separate the bodies, whose boolean is written then; of gaps, whether they
    nearly do."""
    p = POSE * pa
    q = POSE * pb
    t = sub(vec3_at(poses, q + 9), vec3_at(poses, p + 9))
    length = norm(t)
    reach = sum_of_reaches(numbers, NUMBERS * sa, NUMBERS * sb, poses, p, q)
    lower = length - reach - error
    if boolean and lower > limit:
        _write_miss(row_at, lower, divide(t, length), limit, 0)
    return lower > limit if boolean else length > _NEAR_RATIO * reach


@kernel(inline=True)
def _write_miss(row_at, lower, nhat, limit, iterations):
    """A boolean: apart by ``lower`` at least along nhat, for the pair as asked."""
    row = blank_row(row_at)
    row.words[ITERATIONS] = iterations
    write_decision(row, lower, lower, math.inf, PLANE, limit)
    put_vec3(row.doubles, NORMAL, nhat)


@kernel
def _answer_eight(lanes, count, n_padded, boolean, limit, rows_at):
    """Work on the pairs of all lanes, and write the rows of the first ``count`` as far as they are decided.

    n_padded : vertices of the largest of the bodies, with padding.
    """
    tickets = lanes.tickets
    _gather(lanes, _AT_VERTICES_A, mpr.COUNT_A, mpr.VERTICES, n_padded)
    _gather(lanes, _AT_VERTICES_B, mpr.COUNT_B, mpr.VERTICES + 3 * n_padded, n_padded)
    for half in range(2):
        transpose_eight(lanes.tickets_at + 8 * _AT_POSE_A, lanes.block_at + 8 * LANES * (mpr.POSE_A + 8 * half))
        transpose_eight(lanes.tickets_at + 8 * _AT_POSE_B, lanes.block_at + 8 * LANES * (mpr.POSE_B + 8 * half))
        for k in range(LANES):
            tickets[_AT_POSE_A + k] += 32
            tickets[_AT_POSE_B + k] += 32
    # Where gaps are wanted no plane is enough: portals go on to the last.
    refine(view_lanes(lanes.block_at, mpr.BLOCK), n_padded, limit if boolean else math.inf)
    for k in range(count):
        row_at = rows_at + ROW * tickets[_ROWS + k]
        error = _number(lanes, mpr.ERROR_OF, k)
        iterations = int(_number(lanes, mpr.ITERATIONS, k))
        lower = -_number(lanes, mpr.HEIGHT, k) - error
        clearance = _number(lanes, mpr.CLEARANCE, k)
        if lower > limit:
            _write_miss(row_at, lower, _vec3(lanes, mpr.ACROSS, k, 1), limit, iterations)
        elif boolean and clearance > error:
            row = blank_row(row_at)
            row.words[ITERATIONS] = iterations
            write_decision(row, -clearance, -math.inf, error - clearance, SIMPLEX, limit)
        elif not boolean:
            _write_portal(lanes, k, n_padded, clearance, row_at, limit)


@kernel(inline=True)
def _number(lanes, at, lane):
    return lanes.values[LANES * at + lane]


@kernel(inline=True)
def _vec3(lanes, at, lane, stride):
    """A vector of one lane, whose components stand ``stride`` apart."""
    return Vec3(_number(lanes, at, lane), _number(lanes, at + stride, lane), _number(lanes, at + 2 * stride, lane))


@kernel
def _write_portal(lanes, lane, n_padded, clearance, row_at, limit):
    """Write the row of a pair that meets, with a common point; or the portal alone, to begin with.

    clearance : of the origin in the tetrahedron of o and the portal, −1 unless the origin provably lies inside.
    """
    row = blank_row(row_at)
    words = row.words
    for n in range(3):
        name = int(_number(lanes, mpr.PORTAL + mpr.CORNER * n + mpr.NAME, lane))
        words[VERTICES_A + n] = name % MAX_VERTICES
        words[VERTICES_B + n] = name // MAX_VERTICES
    row.flags[COUNT] = 3
    error = _number(lanes, mpr.ERROR_OF, lane)
    if not clearance > error:
        return
    flip = lanes.tickets[_FLIP + lane] != 0
    mean = _vec3(lanes, mpr.MEAN_A, lane, 1)
    weight = _number(lanes, mpr.DEEP + mpr.WEIGHT, lane)
    a = scale(weight, mean)
    b = scale(weight, sub(mean, _vec3(lanes, mpr.DEEP, lane, 1)))
    for n in range(3):
        weight = _number(lanes, mpr.PORTAL + mpr.CORNER * n + mpr.WEIGHT, lane)
        vertex_a = _vec3(lanes, mpr.VERTICES + words[VERTICES_A + n], lane, n_padded)
        vertex_b = _vec3(lanes, mpr.VERTICES + 3 * n_padded + words[VERTICES_B + n], lane, n_padded)
        a = add(a, scale(weight, vertex_a))
        b = add(b, scale(weight, vertex_b))
    # both halves have been taken, and the address moved on
    pose = view_f64(lanes.tickets[_AT_POSE_A + lane] - 64, POSE)
    p_WA = vec3_at(pose, 9)
    put_vec3(row.doubles, POINT_B if flip else POINT_A, add(a, p_WA))
    put_vec3(row.doubles, POINT_A if flip else POINT_B, add(b, p_WA))
    if not norm1(sub(a, b)) <= _ONE_POINT * error:  # a tetrahedron nearly flat has weights good for nothing
        return
    words[ITERATIONS] = int(_number(lanes, mpr.ITERATIONS, lane))
    write_decision(row, -clearance, -math.inf, error - clearance, SIMPLEX, limit)
    row.doubles[NORMAL + 2] = 1.0
    if flip:
        for n in range(3):
            words[VERTICES_A + n], words[VERTICES_B + n] = words[VERTICES_B + n], words[VERTICES_A + n]


@kernel
def _gather(lanes, vertices, count, target, n_padded):
    """Put the vertices of eight bodies side by side; bodies with fewer vertices repeat their last."""
    for axis in range(3):
        for first in range(0, n_padded, RUN):
            transpose_eight(
                lanes.tickets_at + 8 * vertices, lanes.block_at + 8 * LANES * (target + n_padded * axis + first)
            )
            last = first + RUN == n_padded
            for k in range(LANES):
                has_more = first + RUN < lanes.values[LANES * count + k]
                lanes.tickets[vertices + k] += 8 * RUN if last or has_more else 0
