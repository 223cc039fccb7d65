"""Pairs of small hulls by portals, eight at a time, before GJK: booleans, and gaps where no depths are wanted.

Booleans are decided wherever a plane or a tetrahedron is clear of rounding: pairs of 8 vertices take less than half the
time GJK takes. Of gaps (`distance` with signed=False) overlaps are decided, with a common point; of bodies apart GJK gets the
portal to begin with, which is mostly the nearest face already: near touching one round is left of five. What is
open goes to GJK as if nothing had been tried.

No row depends on others; only whether the last one or two booleans of a list come here at all does. Hits are the
same either way.
"""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64, view_i64
from collide.kernels.lanes import LANES, transpose_eight, view_lanes
from collide.lowering.packed_convex import POINTS
from collide.lowering.shape_table import ADDRESS, INTS, KIND, NUMBERS, PADDED, POSE, RADIUS
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.gjk.mpr import (
    ACROSS,
    BLOCK,
    CLEARANCE,
    CORNER,
    COUNT_A,
    COUNT_B,
    DEEP,
    ERROR_OF,
    HEIGHT,
    MEAN_A,
    MOST,
    NAME,
    PORTAL,
    POSE_A,
    POSE_B,
    ROOM,
    USED,
    VERTICES,
    WEIGHT,
    refine,
)
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
    open_row,
    write_decision,
)
from collide.numerics.vec3 import Vec3, divide, norm, put_vec3, sub, vec3_at
from collide.results import PLANE, SIMPLEX

#: With fewer booleans than this GJK is as fast.
_FEWEST = 3
#: Bodies whose frames are farther apart than this share of their reaches seldom meet, and GJK is as fast.
_NEAR = 0.85
#: Sizes of pairs whose numbers neither overflow nor vanish, multiplied six times.
_SMALLEST, _LARGEST = 1e-20, 1e20
#: How far the two points of a common one may lie apart, in units of the pair's error.
_ONE_POINT = 4.0

#: Doubles of the workspace: a room.
DOUBLES = LANES * (ROOM + 1)
# Integers: addresses of vertices and of poses, numbers of rows, whether bodies are exchanged.
_AT_VERTICES_A, _AT_VERTICES_B, _AT_POSE_A, _AT_POSE_B, _ROWS, _FLIP = (LANES * k for k in range(6))
NOTES = 6 * LANES


@kernel
def answer_small_hulls(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, limit, rows_at, doubles_at, integers_at
):
    """Answer rows of two small hulls, as far as that goes without depths, and leave the others open.

    A gap's row that is left open names three pairs of vertices to begin with, in the order worked on (`in_order`).
    Returns how many rows were looked at.   Arguments as in `answer_pairs`.   doubles, integers : workspace, DOUBLES and NOTES of it.
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    room_at = (doubles_at + 8 * (LANES - 1)) // (8 * LANES) * (8 * LANES)
    found = view_f64(room_at, LANES * ROOM)
    notes = view_i64(integers_at, NOTES)
    waiting = corners = looked_at = 0
    for turn in range(n_pairs):
        pa = pairs[2 * turn]
        pb = pairs[2 * turn + 1]
        shape_of = view_i64(shape_of_at, max(pa, pb) + 1)
        sa = shape_of[pa]
        sb = shape_of[pb]
        ints = view_i64(ints_at, INTS * (max(sa, sb) + 1))
        row_at = rows_at + ROW * turn
        if not (_is_small(ints, sa) and _is_small(ints, sb)) or (boolean and _has_axis(row_at)):
            continue
        numbers = view_f64(numbers_at, NUMBERS * (max(sa, sb) + 1))
        if numbers[NUMBERS * sa + RADIUS] + numbers[NUMBERS * sb + RADIUS] > 0.0:
            continue  # nothing here says that cores are near
        poses = view_f64(poses_at, POSE * (max(pa, pb) + 1))
        size, slop, _ = size_and_slop(numbers, poses, sa, pa, sb, pb)
        if not _SMALLEST < size < _LARGEST:
            continue
        error = ERROR * size + slop
        looked_at += 1
        if _are_far(numbers, poses, sa, pa, sb, pb, boolean, error, limit, row_at):
            continue
        flip = False
        if not boolean:
            sa, pa, sb, pb, flip = in_order(ints, poses, sa, pa, sb, pb)
        corners = max(corners, ints[INTS * sa + PADDED], ints[INTS * sb + PADDED])
        found[LANES * COUNT_A + waiting] = ints[INTS * sa + PADDED]
        found[LANES * COUNT_B + waiting] = ints[INTS * sb + PADDED]
        found[LANES * ERROR_OF + waiting] = error
        notes[_AT_VERTICES_A + waiting] = ints[INTS * sa + ADDRESS]
        notes[_AT_VERTICES_B + waiting] = ints[INTS * sb + ADDRESS]
        notes[_AT_POSE_A + waiting] = poses_at + 8 * POSE * pa
        notes[_AT_POSE_B + waiting] = poses_at + 8 * POSE * pb
        notes[_ROWS + waiting] = turn
        notes[_FLIP + waiting] = 1 if flip else 0
        waiting += 1
        if waiting == LANES:
            _answer_eight(room_at, integers_at, LANES, corners, boolean, limit, rows_at)
            waiting = corners = 0
    if waiting >= (_FEWEST if boolean else 1):
        for lane in range(waiting, LANES):  # lanes without a row do what the first does
            for k in range(0, NOTES, LANES):
                notes[k + lane] = notes[k]
            for k in range(COUNT_A, ERROR_OF + 1):
                found[LANES * k + lane] = found[LANES * k]
        _answer_eight(room_at, integers_at, waiting, corners, boolean, limit, rows_at)
    return looked_at


@kernel(inline=True)
def _is_small(ints, s):
    return ints[INTS * s + PADDED] <= MOST and ints[INTS * s + KIND] == POINTS


@kernel(inline=True)
def _has_axis(row_at):
    """Whether an axis is to be tried first, which is quicker still."""
    row = view_f64(row_at, NORMAL + 3)
    return row[NORMAL] != 0.0 or row[NORMAL + 1] != 0.0 or row[NORMAL + 2] != 0.0


@kernel(inline=True)
def _are_far(numbers, poses, sa, pa, sb, pb, boolean, error, limit, row_at):
    """Whether balls about the frames' origins part the bodies, whose boolean is written then; of gaps, whether they nearly do."""
    p = POSE * pa
    q = POSE * pb
    t = sub(vec3_at(poses, q + 9), vec3_at(poses, p + 9))
    length = norm(t)
    reach = sum_of_reaches(numbers, NUMBERS * sa, NUMBERS * sb, poses, p, q)
    lower = length - reach - error
    if boolean and lower > limit:
        _write_miss(row_at, lower, divide(t, length), limit, 0)
    return lower > limit if boolean else length > _NEAR * reach


@kernel(inline=True)
def _write_miss(row_at, lower, nhat, limit, iterations):
    """A boolean: apart by ``lower`` at least along nhat, for the pair as asked."""
    row = open_row(row_at)
    row.words[ITERATIONS] = iterations
    write_decision(row, lower, lower, math.inf, PLANE, limit)
    put_vec3(row.doubles, NORMAL, nhat)


@kernel
def _answer_eight(room_at, notes_at, count, corners, boolean, limit, rows_at):
    """Work on the pairs that are noted, and write their rows as far as they are decided.

    corners : vertices of the largest of the bodies, filled up.
    """
    notes = view_i64(notes_at, NOTES)
    found = view_f64(room_at, LANES * ROOM)
    _gather(room_at, notes_at, _AT_VERTICES_A, COUNT_A, VERTICES, corners)
    _gather(room_at, notes_at, _AT_VERTICES_B, COUNT_B, VERTICES + 3 * corners, corners)
    for half in range(2):
        transpose_eight(notes_at + 8 * _AT_POSE_A, room_at + 8 * LANES * (POSE_A + 8 * half))
        transpose_eight(notes_at + 8 * _AT_POSE_B, room_at + 8 * LANES * (POSE_B + 8 * half))
        for k in range(LANES):
            notes[_AT_POSE_A + k] += 32
            notes[_AT_POSE_B + k] += 32
    # Where gaps are wanted no plane is enough: portals go on to the last.
    refine(view_lanes(room_at, ROOM), corners, limit if boolean else math.inf)
    for k in range(count):
        row_at = rows_at + ROW * notes[_ROWS + k]
        error = found[LANES * ERROR_OF + k]
        iterations = int(found[LANES * USED + k])
        lower = -found[LANES * HEIGHT + k] - error
        clearance = found[LANES * CLEARANCE + k]
        if lower > limit:
            at = LANES * ACROSS + k
            nhat = Vec3(found[at], found[at + LANES], found[at + 2 * LANES])
            _write_miss(row_at, lower, nhat, limit, iterations)
        elif boolean and clearance > error:
            row = open_row(row_at)
            row.words[ITERATIONS] = iterations
            write_decision(row, -clearance, -math.inf, error - clearance, SIMPLEX, limit)
        elif not boolean:
            _write_portal(found, notes, k, corners, clearance, row_at, limit)


@kernel
def _write_portal(found, notes, k, corners, clearance, row_at, limit):
    """The row of a pair that meets, with a common point; or the portal alone, to begin with.

    clearance : of the origin in the tetrahedron of o and the portal, −1 where it is not proven to lie in it.
    """
    row = open_row(row_at)
    words = row.words
    for n in range(3):
        name = int(found[LANES * (PORTAL + CORNER * n + NAME) + k])
        words[VERTICES_A + n] = name % MOST
        words[VERTICES_B + n] = name // MOST
    row.flags[COUNT] = 3
    error = found[LANES * ERROR_OF + k]
    if not clearance > error:
        return
    flip = notes[_FLIP + k] != 0
    at_a = POINT_B if flip else POINT_A
    at_b = POINT_A if flip else POINT_B
    pose = view_f64(notes[_AT_POSE_A + k] - 64, POSE)  # both halves have been taken, and the address moved on
    apart = 0.0
    for axis in range(3):
        mean = found[LANES * (MEAN_A + axis) + k]
        weight = found[LANES * (DEEP + WEIGHT) + k]
        a = weight * mean
        b = weight * (mean - found[LANES * (DEEP + axis) + k])
        for n in range(3):
            weight = found[LANES * (PORTAL + CORNER * n + WEIGHT) + k]
            a += weight * found[LANES * (VERTICES + corners * axis + words[VERTICES_A + n]) + k]
            b += weight * found[LANES * (VERTICES + corners * (3 + axis) + words[VERTICES_B + n]) + k]
        apart += abs(a - b)
        row.doubles[at_a + axis] = a + pose[9 + axis]
        row.doubles[at_b + axis] = b + pose[9 + axis]
    if not apart <= _ONE_POINT * error:  # a tetrahedron nearly flat has weights good for nothing
        return
    words[ITERATIONS] = int(found[LANES * USED + k])
    write_decision(row, -clearance, -math.inf, error - clearance, SIMPLEX, limit)
    row.doubles[NORMAL + 2] = 1.0
    if flip:
        for n in range(3):
            words[VERTICES_A + n], words[VERTICES_B + n] = words[VERTICES_B + n], words[VERTICES_A + n]


@kernel
def _gather(room_at, notes_at, vertices, count, target, corners):
    """Have the vertices of eight bodies side by side; of those that have fewer, their last ones again."""
    addresses = view_i64(notes_at + 8 * vertices, LANES)
    counts = view_f64(room_at + 8 * LANES * count, LANES)
    for axis in range(3):
        for first in range(0, corners, BLOCK):
            transpose_eight(notes_at + 8 * vertices, room_at + 8 * LANES * (target + corners * axis + first))
            last = first + BLOCK == corners
            for k in range(LANES):
                addresses[k] += 8 * BLOCK if last or first + BLOCK < counts[k] else 0
