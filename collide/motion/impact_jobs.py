"""Many motions of convex parts in one kernel: a job for each pair of parts, a row for each motion."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i32, view_i64
from collide.lowering.compound_table import PART
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.shape_table import INTS, KIND, NUMBERS, POSE, RANK
from collide.motion.convex_impact import (
    CONTACT,
    FREE,
    INTS_AT,
    NUMBERS_AT,
    OPEN_START,
    POSES_AT,
    SHAPE_OF_AT,
    TOO_SMALL,
    Asking,
    search_contact,
)
from collide.motion.moving_body import BODY
from collide.motion.moving_pair import BodyMotion, moving_pair
from collide.narrowphase.pose_batches import set_pose
from collide.narrowphase.rows import NORMAL, POINT_A, POINT_B, view_row
from collide.numerics.vec3 import Vec3, add, put_vec3, scale, sub, vec3_at
from collide.transforms import ROTATION_TOLERANCE

# Header: what `convex_impact.Asking` reads; where bodies are worked on, and the two rows; rows of parts and how many;
# poses of A and B at the start and the end, with their steps, 16 or 0; angular velocities, or 0, with theirs, 3 or 0;
# how many shapes there are.
(
    BODIES_AT, ROW_AT, PROBE_AT, PARTS_AT, N_PARTS, XA0_AT, XA1_AT, XB0_AT, XB1_AT, XA0_STEP, XA1_STEP, XB0_STEP,
    XB1_STEP, OMEGA_A_AT, OMEGA_B_AT, OMEGA_A_STEP, OMEGA_B_STEP, N_SHAPES,
) = range(8, 26)
HEADER = 26

# A job: the motion's number, then shape row and part row of A, and of B.
MOTION, SHAPE_A, PART_A, SHAPE_B, PART_B = range(5)
JOB = 5

# A row of answers, `impact_rows.IMPACT_DTYPE`: 12 doubles, 4 integers.
LOWER, UPPER, IMPACT_NORMAL, IMPACT_POINT_A, IMPACT_POINT_B = 0, 1, 2, 5, 8
JOB_A, JOB_B, QUERIES, STATUS = range(4)
DOUBLES_OF_ROW, ANSWER = 11, 11 * 8 + 16

#: A status of a row besides those of a search: an angular velocity that does not lead to the pose at the end.
WRONG_TURN = TOO_SMALL + 1


class Motions(NamedTuple):
    """Views of the header, the parts, the tables' integers and numbers, and of two pose rows."""

    header: Any
    parts: Any
    ints: Any
    numbers: Any
    poses: Any


class Span(NamedTuple):
    """begin, end : the time looked at.   tolerance : of a bracket [unit time]."""

    begin: float
    end: float
    tolerance: float


@entry("int64(int64, int64, int64, float64, float64, float64, int64)")
def find_impacts(header_at, jobs_at, n, begin, end, tolerance, rows_at):
    """Do n jobs, jobs of the same motion side by side, for the time begin … end, with all known to be free before;
    returns 0.

    rows : one for each motion, as `clear_impacts` leaves them. A row keeps the earliest contact of its jobs; times
    proven no earlier than a proven contact are not searched.
    """
    header = view_i64(header_at, HEADER)
    motions = Motions(
        header, view_f64(header[PARTS_AT], PART * header[N_PARTS]), view_i64(header[INTS_AT], INTS * header[N_SHAPES]),
        view_f64(header[NUMBERS_AT], NUMBERS * header[N_SHAPES]), view_f64(header[POSES_AT], 2 * POSE),
    )
    asking = Asking(header, header[ROW_AT], header[PROBE_AT])
    for k in range(n):
        job = view_i64(jobs_at + 8 * JOB * k, JOB)
        _do_job(motions, asking, job, Span(begin, end, tolerance), rows_at + ANSWER * job[MOTION])
    return 0


@entry("int64(int64, int64, int64, int64, int64, int64)")
def begin_single(header_at, XA0_at, XA1_at, XB0_at, XB1_at, row_at):
    """Prepare a single motion: 0, or −1 where a matrix is no pose.

    header : for `find_impacts`; gets the addresses of the matrices.   row : of the answer.
    """
    header = view_i64(header_at, HEADER)
    poses = view_f64(header[POSES_AT], 2 * POSE)
    header[XA0_AT] = XA0_at
    header[XA1_AT] = XA1_at
    header[XB0_AT] = XB0_at
    header[XB1_AT] = XB1_at
    for k in range(4):
        if not set_pose(poses, 0, view_f64(header[XA0_AT + k], 16), True):
            return -1
    empty_rows(row_at, 1)
    return 0


@entry("int64(int64, int64)")
def clear_impacts(rows_at, n):
    """Rows of answers become those of motions without any contact; returns 0."""
    empty_rows(rows_at, n)
    return 0


@kernel
def empty_rows(rows_at, n):
    """`clear_impacts` for kernels."""
    for k in range(n):
        numbers = view_f64(rows_at + ANSWER * k, DOUBLES_OF_ROW)
        words = view_i32(rows_at + ANSWER * k + 8 * DOUBLES_OF_ROW, 4)
        for i in range(DOUBLES_OF_ROW):
            numbers[i] = 0.0
        numbers[LOWER] = numbers[UPPER] = math.inf
        words[JOB_A] = words[JOB_B] = words[QUERIES] = 0
        words[STATUS] = FREE


@kernel(inline=True)
def _body_motion(motions, job, is_b):
    """What is said of one body of a job: `moving_pair.BodyMotion`."""
    header = motions.header
    k = job[MOTION]
    at = 1 if is_b else 0
    X0 = view_f64(header[XA0_AT + 2 * at] + 8 * header[XA0_STEP + 2 * at] * k, 16)
    X1 = view_f64(header[XA1_AT + 2 * at] + 8 * header[XA1_STEP + 2 * at] * k, 16)
    omega_at = header[OMEGA_A_AT + at]
    has_omega = omega_at != 0
    omega = view_f64(omega_at + 8 * header[OMEGA_A_STEP + at] * k if has_omega else header[XA0_AT], 3)
    return BodyMotion(X0, X1, omega, has_omega, motions.parts, PART * job[PART_B if is_b else PART_A])


@kernel(inline=True)
def _exchange(motions, job):
    """Whether to work on (B, A): a half-space first, then by content of the shapes, then by the numbers of the
    motion."""
    ints = motions.ints
    sa, sb = job[SHAPE_A], job[SHAPE_B]
    is_plane_a, is_plane_b = ints[INTS * sa + KIND] == HALFSPACE, ints[INTS * sb + KIND] == HALFSPACE
    if is_plane_a != is_plane_b:
        return is_plane_b
    if ints[INTS * sa + RANK] != ints[INTS * sb + RANK]:
        return ints[INTS * sa + RANK] > ints[INTS * sb + RANK]
    a, b = _body_motion(motions, job, False), _body_motion(motions, job, True)
    order = compare_numbers(a.X0, 0, b.X0, 0, 12)
    if order == 0:
        order = compare_numbers(a.X1, 0, b.X1, 0, 12)
    if order == 0:
        order = compare_numbers(a.parts, a.part_at, b.parts, b.part_at, 12)
    if order == 0 and a.has_omega and b.has_omega:
        order = compare_numbers(a.omega, 0, b.omega, 0, 3)
    return order > 0


@kernel(inline=True)
def compare_numbers(a, at_a, b, at_b, n):
    """−1, 0 or 1: the order of n numbers of a and of b."""
    for k in range(n):
        if a[at_a + k] != b[at_b + k]:
            return 1 if a[at_a + k] > b[at_b + k] else -1
    return 0


@kernel(inline=True)
def _do_job(motions, asking, job, span, answer_at):
    numbers = view_f64(answer_at, DOUBLES_OF_ROW)
    words = view_i32(answer_at + 8 * DOUBLES_OF_ROW, 4)
    flip = _exchange(motions, job)
    a = view_f64(motions.header[BODIES_AT], BODY)
    b = view_f64(motions.header[BODIES_AT] + 8 * BODY, BODY)
    sa, sb = job[SHAPE_B if flip else SHAPE_A], job[SHAPE_A if flip else SHAPE_B]
    shape_of = view_i64(motions.header[SHAPE_OF_AT], 2)
    shape_of[0] = sa
    shape_of[1] = sb
    motion_a = _body_motion(motions, job, flip)
    motion = moving_pair(
        motions.ints, motions.numbers, motions.poses, sa, sb, motion_a, _body_motion(motions, job, not flip), a, b
    )
    if motion.off > 4.0 * ROTATION_TOLERANCE:
        words[STATUS] = WRONG_TURN
        return
    search = search_contact(motion, asking, span.begin, min(span.end, numbers[UPPER]), span.tolerance)
    words[QUERIES] = min(words[QUERIES] + search.n_queries, 2000000000)
    if search.status == FREE or words[STATUS] > OPEN_START:
        return
    if search.status == TOO_SMALL:
        words[STATUS] = TOO_SMALL
        return
    if search.lower < numbers[LOWER] or (search.status == CONTACT and search.upper < numbers[UPPER]
                                         and search.lower == numbers[LOWER]):
        words[JOB_A] = job[SHAPE_A]
        words[JOB_B] = job[SHAPE_B]
        words[STATUS] = search.status
        _write_touch(numbers, motion_a, search.lower, view_row(asking.row_at), flip)
    numbers[LOWER] = min(numbers[LOWER], search.lower)
    numbers[UPPER] = min(numbers[UPPER], search.upper)


@kernel(inline=True)
def _write_touch(numbers, motion_a, time, row, flip):
    """Normal and points of a row whose positions are from the origin of the first body worked on."""
    X0, X1 = motion_a.X0, motion_a.X1
    p0 = Vec3(X0[3], X0[7], X0[11])
    origin = add(p0, scale(time, sub(Vec3(X1[3], X1[7], X1[11]), p0)))
    sign = -1.0 if flip else 1.0
    for k in range(3):
        numbers[IMPACT_NORMAL + k] = sign * row.doubles[NORMAL + k] + 0.0
    put_vec3(numbers, IMPACT_POINT_B if flip else IMPACT_POINT_A, add(origin, vec3_at(row.doubles, POINT_A)))
    put_vec3(numbers, IMPACT_POINT_A if flip else IMPACT_POINT_B, add(origin, vec3_at(row.doubles, POINT_B)))
