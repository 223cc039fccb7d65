"""The first contact of two unions of convex parts in a motion, span by span, inside one kernel.

In a span of length h points of the two unions come nearer each other by at most μ h / 2 from the middle of the span on
(`span_bounds.py`, for the unions as a whole). Parts whose balls are farther apart at the middle do not meet in the
span. The others are searched, in the whole motion up to the first contact so far (`impact_jobs.py`), before any later
span; spans with too many of them are cut in half.
"""

from __future__ import annotations

from collide.kernels import entry, kernel, native_call, view_f64, view_i64
from collide.lowering.shape_table import POSE
from collide.motion.impact_jobs import (
    DOUBLES_OF_ROW,
    JOB,
    MOTION,
    OMEGA_A_AT,
    OMEGA_B_AT,
    SHAPE_A,
    SHAPE_B,
    UPPER,
    XA0_AT,
    compare_numbers,
    empty_rows,
)
from collide.motion.impact_jobs import HEADER as IMPACT_HEADER
from collide.motion.impact_jobs import PART_A as JOB_PART_A
from collide.motion.impact_jobs import PART_B as JOB_PART_B
from collide.motion.span_bounds import BEGIN, END, OUT, REACH, WORKSPACE, X_A, X_B, describe
from collide.motion.span_bounds import HEADER as SPAN_HEADER
from collide.narrowphase.composite.composite_block import HEADER as COMPOSITE_HEADER
from collide.narrowphase.composite.composite_block import LIST, N_DONE, body_of, count_pairs, lay_out, open_block
from collide.narrowphase.composite.composite_poses import list_pairs_within, sort_numbers
from collide.narrowphase.pose_batches import set_pose

_find_impacts_at = native_call("int64(int64, int64, int64, float64, float64, float64, int64)")

# Header: the kernel of jobs; rows of both bodies' first parts in its tables; which body's content is the larger, A's
# (1), B's (−1) or none (0); whether unions whose balls meet are searched; where the doubles and integers are that it
# works in. Then the headers of `impact_jobs.py`,
# `span_bounds.py` and `composite_block.py`, whose motion is the one asked about.
KERNEL, FIRST_A, FIRST_B, LARGER, IS_SEARCHED, DOUBLES_AT, INTEGERS_AT, IMPACT = range(8)
SPAN = IMPACT + IMPACT_HEADER
COMPOSITE = SPAN + SPAN_HEADER
UNION_HEADER = COMPOSITE + COMPOSITE_HEADER
# Doubles: how far both unions reach, summed, and the smaller one [m]; what spans are described in; spans to be looked
# at. Integers: numbers of pairs searched, of pairs of a span, and its jobs.
SIZE, SMALLER, _SPAN_WORK = 0, 1, 2
_SPANS = _SPAN_WORK + WORKSPACE + OUT
MAX_SPANS, MAX_SEARCHED = 64, 4096
_NEW, _JOBS = MAX_SEARCHED, MAX_SEARCHED + LIST
UNION_DOUBLES, UNION_INTEGERS = _SPANS + 2 * MAX_SPANS, _JOBS + JOB * LIST
#: Spans are cut until bodies move by so much of the smaller one's reach in half of them, or are so short.
LEAST_MOVED, SHORTEST = 2.0**-6, 2.0**-46


@entry("int64(int64, int64, int64, int64, int64, int64, int64, boolean, float64, int64)")
def first_impact_of_unions(header_at, XA0_at, XA1_at, XB0_at, XB1_at, omega_a_at, omega_b_at, check, tolerance, row_at):
    """Write the row of a motion, as `find_impacts` does; 0, or −1 where a matrix is no pose, or too many pairs of parts
    come near together.

    header : of UNION_HEADER integers.   omega_a, omega_b : addresses of angular velocities, or 0.
    check : refuse matrices that are no rotation.
    """
    header = view_i64(header_at, UNION_HEADER)
    doubles = view_f64(header[DOUBLES_AT], UNION_DOUBLES)
    _put_motion(header, XA0_at, XA1_at, XB0_at, XB1_at, omega_a_at, omega_b_at)
    poses = view_f64(header[DOUBLES_AT] + 8 * _SPAN_WORK, POSE)
    for k in range(4 if check else 0):
        if not set_pose(poses, 0, view_f64(header[SPAN + k], 16), True):
            return -1
    empty_rows(row_at, 1)
    out = _described(header_at, 0.0, 1.0)
    if out[BEGIN] <= out[END] and header[IS_SEARCHED] == 0:
        return -1
    doubles[_SPANS], doubles[_SPANS + 1] = out[BEGIN], out[END]
    numbers = view_f64(row_at, DOUBLES_OF_ROW)
    least, top, n_searched = LEAST_MOVED * doubles[SMALLER], 1, 0
    while top > 0:
        top -= 1
        begin, end = doubles[_SPANS + 2 * top], min(doubles[_SPANS + 2 * top + 1], numbers[UPPER])
        if begin > end:
            continue
        reach = _described(header_at, begin, end)[REACH]
        n = _list_near(header_at, reach, doubles[SIZE])
        if n < 0:
            if not (end - begin > SHORTEST and reach > least and top + 2 <= MAX_SPANS):
                return -1
            middle = 0.5 * (begin + end)
            doubles[_SPANS + 2 * top], doubles[_SPANS + 2 * top + 1] = middle, end
            doubles[_SPANS + 2 * top + 2], doubles[_SPANS + 2 * top + 3] = begin, middle
            top += 2
            continue
        n_new, n_searched = _merge_new(header_at, n, n_searched)
        if n_searched > MAX_SEARCHED:
            return -1
        _put_jobs(header_at, n_new)
        _find_impacts_at(
            header[KERNEL],
            (
                header_at + 8 * IMPACT, header[INTEGERS_AT] + 8 * _JOBS, n_new, 0.0, 1.0, tolerance, row_at,
            ),
        )
    return 0


@kernel(inline=True)
def _put_motion(header, XA0_at, XA1_at, XB0_at, XB1_at, omega_a_at, omega_b_at):
    header[SPAN] = header[IMPACT + XA0_AT] = XA0_at
    header[SPAN + 1] = header[IMPACT + XA0_AT + 1] = XA1_at
    header[SPAN + 2] = header[IMPACT + XA0_AT + 2] = XB0_at
    header[SPAN + 3] = header[IMPACT + XA0_AT + 3] = XB1_at
    header[SPAN + 4] = header[IMPACT + OMEGA_A_AT] = omega_a_at
    header[SPAN + 5] = header[IMPACT + OMEGA_B_AT] = omega_b_at


@kernel
def _described(header_at, begin, end):
    """What `describe` writes of a span."""
    work_at = view_i64(header_at, UNION_HEADER)[DOUBLES_AT] + 8 * _SPAN_WORK
    out_at = work_at + 8 * WORKSPACE
    describe(header_at + 8 * SPAN, begin, end, work_at, out_at)
    return view_f64(out_at, OUT)


@kernel
def _list_near(header_at, reach, size):
    """List the pairs of parts whose balls come within a reach at the poses described last; how many, −1 of too many.

    While balls of this size meet, parts that are spread over them are near in about the third power of the reach.
    """
    header = view_i64(header_at, UNION_HEADER)
    block = open_block(header_at + 8 * COMPOSITE)
    for k in range(COMPOSITE + N_DONE, UNION_HEADER):
        header[k] = 0
    out_at = header[DOUBLES_AT] + 8 * (_SPAN_WORK + WORKSPACE)
    lay_out(block, 0, out_at + 8 * X_A, 0, out_at + 8 * X_B, 0, 1, False)
    share = reach / size
    if share * share * share * count_pairs(block, 0) > LIST:
        return -1
    return list_pairs_within(block, reach)


@kernel
def _merge_new(header_at, n, n_searched):
    """(how many of n pairs listed were not searched, how many are with them): the former become the numbers of a span,
    both ascending."""
    header = view_i64(header_at, UNION_HEADER)
    owners = open_block(header_at + 8 * COMPOSITE).owners
    integers = view_i64(header[INTEGERS_AT], UNION_INTEGERS)
    n_new = at = 0
    for k in range(n):
        pair = owners[2 * k + 1]
        while at < n_searched and integers[at] < pair:
            at += 1
        if at == n_searched or integers[at] != pair:
            integers[_NEW + n_new] = pair
            n_new += 1
    total = n_searched + n_new
    if total > MAX_SEARCHED:
        return n_new, total
    before, k = n_searched - 1, n_new - 1
    for to in range(total - 1, -1, -1):
        if k >= 0 and (before < 0 or integers[_NEW + k] > integers[before]):
            integers[to] = integers[_NEW + k]
            k -= 1
        else:
            integers[to] = integers[before]
            before -= 1
    return n_new, total


@kernel
def _put_jobs(header_at, n):
    """Write the jobs of a span's pairs, in an order independent of the bodies' roles as A and B."""
    header = view_i64(header_at, UNION_HEADER)
    block = open_block(header_at + 8 * COMPOSITE)
    count_a, count_b = body_of(block, 0, 0).n_parts, body_of(block, 0, 1).n_parts
    pairs = view_i64(header[INTEGERS_AT] + 8 * _NEW, LIST)
    flip = header[LARGER] > 0 or (header[LARGER] == 0 and _are_poses_larger(header))
    if flip:
        for k in range(n):
            pairs[k] = pairs[k] % count_b * count_a + pairs[k] // count_b
        sort_numbers(pairs, n)
    for k in range(n):
        job = view_i64(header[INTEGERS_AT] + 8 * (_JOBS + JOB * k), JOB)
        of_a = pairs[k] % count_a if flip else pairs[k] // count_b
        of_b = pairs[k] // count_a if flip else pairs[k] % count_b
        job[MOTION] = 0
        job[SHAPE_A] = job[JOB_PART_A] = header[FIRST_A] + of_a
        job[SHAPE_B] = job[JOB_PART_B] = header[FIRST_B] + of_b


@kernel
def _are_poses_larger(header):
    """Whether the numbers of A's poses are the larger, as `Motions.exchanged` tells."""
    for k in range(2):
        order = compare_numbers(view_f64(header[SPAN + k], 16), 0, view_f64(header[SPAN + 2 + k], 16), 0, 16)
        if order != 0:
            return order > 0
    return False
