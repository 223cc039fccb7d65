"""Casts of two unions of convex parts at a single pair of poses: from matrices to the first contact inside a kernel.

A walk down the trees over both bodies' parts (`composite_poses.py`), the nodes soonest on the way first. With d from
the centre of A's ball to the centre of B's, R the sum of radii and A moved by t v, the contents of the balls are apart
while |d − t v| > R: before t = (d·d − R²) / (d·v + √((d·v)² − v·v (d·d − R²))). Pairs of nodes later than the upper
bound of a proven contact are left out.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.casts.cast_pairs import (
    CAST_ROW,
    LOWER,
    NORMAL,
    QUESTION,
    SIGNATURE,
    SIZE,
    STATUS,
    TOUCHING,
    UPPER,
    VALUE,
)
from collide.casts.portal import BEHIND, HIT, MISS, OPEN
from collide.kernels import entry, kernel, native_call, view_f64, view_i64
from collide.lowering.compound_table import BALL_IN_WORLD
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.place_parts import BALL_MARGIN
from collide.lowering.shape_table import INTS, KIND
from collide.narrowphase.bounds import PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.composite.balls_on_ways import is_direction
from collide.narrowphase.composite.composite_block import (
    AT_ONCE,
    CORE,
    DOUBLES_AT,
    INTEGERS_AT,
    INTS_AT,
    MAX_NEAR,
    N_ANSWERED,
    N_DONE,
    NUMBERS_AT,
    POSES_AT,
    SHAPE_OF_AT,
    STACK,
    TERMS_AT,
    lay_out,
    open_block,
    row_of_part,
)
from collide.narrowphase.composite.composite_block import HEADER as COMPOSITE_HEADER
from collide.narrowphase.composite.composite_poses import (
    answer_at,
    nodes_of,
    number_of_pair,
    opened_node,
    place_body_balls,
)
from collide.narrowphase.pose_batches import clear_rows
from collide.narrowphase.rows import HIT as IS_HIT
from collide.narrowphase.rows import POINT_B, ROW, is_undecided_or_refused, view_row
from collide.numerics.vec3 import Vec3, dot, put_vec3, sub, vec3_at

_cast_pairs_at = native_call(SIGNATURE)

# Header: the kernel of casts and its workspace; doubles to work in; then the header of `composite_block.py`.
KERNEL, CAST_DOUBLES_AT, CAST_INTEGERS_AT, WORK_AT, COMPOSITE = range(5)
UNION_HEADER = COMPOSITE + COMPOSITE_HEADER
# Words of the workspace: the question and row of a cast, when stacked nodes may touch at the earliest, a pair, its row.
_ROW_AT, _TIMES, _PAIR = QUESTION, QUESTION + CAST_ROW, QUESTION + CAST_ROW + STACK
_ANSWER = _PAIR + 2
UNION_WORK = _ANSWER + ROW // 8
# An answer, doubles: t, from below and from above; normal, point; the parts that touch, and whether they do at t = 0.
T, T_LOWER, T_UPPER, OUT_NORMAL, OUT_POINT, ITEM_A, ITEM_B, AT_START = 0, 1, 2, 3, 6, 9, 10, 11
UNION_ROW = 12

#: What rounding may take off a square or product of lengths, as a part of it: many ulps.
_ROUNDING = 2.0**-48


class _Cast(NamedTuple):
    """header, work : views.   v, limit : of A's motion, the vector's largest component at least ½.

    slack : by which balls are enlarged [m]: parts reach out of their balls, and out of their groups', by less.
    """

    header: Any
    work: Any
    v: Vec3
    limit: float
    slack: float


@entry("int64(int64, int64, int64, int64, float64, int64)", nogil=False)
def cast_single_union(header_at, XA_at, XB_at, vector_at, limit, out_at):
    """Cast A along a vector; 1 where A meets B within ``limit`` lengths of the vector, 0 where not, −1 where the caller
    has to ask as of a batch: pairs that doubles leave open, brackets too wide, matrices or vectors to be refused.

    header : UNION_HEADER integers.   out : UNION_ROW doubles. All threads share the workspace: the kernel keeps
    Python's lock.
    """
    header, vector = view_i64(header_at, UNION_HEADER), vec3_at(view_f64(vector_at, 3), 0)
    if not is_direction(vector):
        return -1
    for k in range(COMPOSITE + N_DONE, UNION_HEADER):
        header[k] = 0
    block = open_block(header_at + 8 * COMPOSITE)
    if not lay_out(block, 0, XA_at, 0, XB_at, 0, 1, True):
        return -1
    exponent = int(math.frexp(max(abs(vector.x), abs(vector.y), abs(vector.z)))[1])
    v = Vec3(math.ldexp(vector.x, -exponent), math.ldexp(vector.y, -exponent), math.ldexp(vector.z, -exponent))
    margin, out = BALL_MARGIN * place_body_balls(block, 0), view_f64(out_at, UNION_ROW)
    cast = _Cast(
        header, view_f64(header[WORK_AT], UNION_WORK), v, math.ldexp(limit, exponent), 2.0 * margin
    )
    out[T_UPPER] = out[T_LOWER] = math.inf
    if not _walk(block, cast, nodes_of(block, 0, margin, False), out):
        return -1
    if out[T_UPPER] == math.inf:
        return 0
    out[T] = min(max(out[T], out[T_LOWER]), out[T_UPPER])
    for k in range(T, T_UPPER + 1):
        out[k] = math.ldexp(out[k], -exponent)
    return 1


@kernel
def _walk(block, cast, nodes, out):
    """Cast pairs of parts, those soonest on the way first; False where a pair is left open."""
    stack, times = block.near, cast.work
    stack[MAX_NEAR] = nodes.A.n_parts + nodes.A.n_groups - 1
    stack[MAX_NEAR + 1] = nodes.B.n_parts + nodes.B.n_groups - 1
    times[_TIMES] = _earliest(block, cast, nodes, stack[MAX_NEAR], stack[MAX_NEAR + 1])
    top = 1
    while top > 0:
        top -= 1
        if _is_too_late(times[_TIMES + top], cast, out):
            continue
        a, b = stack[MAX_NEAR + 2 * top], stack[MAX_NEAR + 2 * top + 1]
        if a < nodes.A.n_parts and b < nodes.B.n_parts:
            if not _cast_parts(block, cast, number_of_pair(block, nodes, a, b), nodes.B.n_parts, out):
                return False
            continue
        of_a, begin, end = opened_node(block, nodes, a, b)
        bottom = top
        for member in range(begin, end):
            at_a, at_b = (member, b) if of_a else (a, member)
            t = _earliest(block, cast, nodes, at_a, at_b)
            if _is_too_late(t, cast, out):
                continue
            k = top
            while k > bottom and times[_TIMES + k - 1] < t:
                times[_TIMES + k] = times[_TIMES + k - 1]
                stack[MAX_NEAR + 2 * k] = stack[MAX_NEAR + 2 * k - 2]
                stack[MAX_NEAR + 2 * k + 1] = stack[MAX_NEAR + 2 * k - 1]
                k -= 1
            times[_TIMES + k] = t
            stack[MAX_NEAR + 2 * k] = at_a
            stack[MAX_NEAR + 2 * k + 1] = at_b
            top += 1
    return True


@kernel(inline=True)
def _is_too_late(t, cast, out):
    """Whether what touches at t at the earliest has no say: infinity stands for never."""
    return t > min(cast.limit, out[T_UPPER]) or t == math.inf


@kernel
def _earliest(block, cast, nodes, a, b):
    """t before which the contents of two nodes are apart, rounded down; infinite where they stay apart.

    With R enlarged, the square root's radicand rounded up, and d·d − R² down by more than rounding may take, the
    quotient is no larger than in exact numbers.
    """
    i, j = (nodes.a + a) * BALL_IN_WORLD, (nodes.b + b) * BALL_IN_WORLD
    reach = (block.balls[i + 3] + block.balls[j + 3]) * (1.0 + 2.0**-50) + cast.slack
    d = sub(vec3_at(block.balls, j), vec3_at(block.balls, i))
    square, along, pace = dot(d, d), dot(d, cast.v), dot(cast.v, cast.v)
    sizes = square + reach * reach
    outside = square - reach * reach - _ROUNDING * sizes
    if not outside > 0.0:
        return 0.0
    along += _ROUNDING * math.sqrt(square * pace)
    if along <= 0.0:
        return math.inf
    radicand = along * along - pace * outside + _ROUNDING * (along * along + pace * sizes)
    if radicand < 0.0:
        return math.inf
    return outside / (along + math.sqrt(radicand)) * (1.0 - 2.0**-50)


@kernel
def _cast_parts(block, cast, pair, n_parts_b, out):
    """Take a pair of parts into account; False where it is left open, or more are asked than a single call may."""
    of_block, work_at = block.header, cast.header[WORK_AT]
    of_block[N_ANSWERED] += 1
    if of_block[N_ANSWERED] > of_block[AT_ONCE]:
        return False
    item_a, item_b = pair // n_parts_b, pair % n_parts_b
    rows = view_i64(work_at + 8 * _PAIR, 2)
    rows[0] = row_of_part(block, 0, 0, item_a, True)
    rows[1] = row_of_part(block, 0, 1, item_b, True)
    put_vec3(cast.work, 0, cast.v)
    cast.work[3] = cast.limit
    _cast_pairs_at(
        cast.header[KERNEL],
        (
            of_block[INTS_AT], of_block[NUMBERS_AT], of_block[POSES_AT], of_block[SHAPE_OF_AT], work_at + 8 * _PAIR,
            work_at, 1, work_at + 8 * _ROW_AT, cast.header[CAST_DOUBLES_AT], cast.header[CAST_INTEGERS_AT],
        ),
    )
    row, is_at_start = view_f64(work_at + 8 * _ROW_AT, CAST_ROW), False
    is_met = row[STATUS] == HIT or row[STATUS] == OPEN
    if row[STATUS] == MISS or (is_met and row[LOWER] > out[T_UPPER]):  # of a later one nothing is told, however wide
        return True
    if row[STATUS] == BEHIND or (row[STATUS] == OPEN and row[LOWER] <= 0.0):
        if not _ask_start(block, work_at, True):
            return False
        answer = view_row(work_at + 8 * _ANSWER)
        if answer.flags[IS_HIT] == 0:
            return row[STATUS] == BEHIND and row[UPPER] <= 0.0
        if not _ask_start(block, work_at, False):
            return False
        for k in range(LOWER, TOUCHING):
            row[k] = 0.0
        put_vec3(row, TOUCHING, vec3_at(answer.doubles, POINT_B))
        is_at_start = True
    elif row[STATUS] != HIT or not row[UPPER] - row[LOWER] <= _promise_of(block, rows) * row[SIZE]:
        return False
    value = row[VALUE]
    is_first = value < out[T] or (
        value == out[T] and (item_a < out[ITEM_A] or (item_a == out[ITEM_A] and item_b < out[ITEM_B]))
    )
    if out[T_UPPER] == math.inf or is_first:
        out[T] = value
        out[ITEM_A] = item_a
        out[ITEM_B] = item_b
        out[AT_START] = 1.0 if is_at_start else 0.0
        put_vec3(out, OUT_NORMAL, vec3_at(row, NORMAL))
        put_vec3(out, OUT_POINT, vec3_at(row, TOUCHING))
    out[T_LOWER] = min(out[T_LOWER], row[LOWER])
    out[T_UPPER] = min(out[T_UPPER], row[UPPER])
    return True


@kernel
def _promise_of(block, rows):
    """How wide a bracket of two parts may be, in sizes of the pair."""
    for side in range(2):
        number = block.shape_of[rows[side]]
        kind = view_i64(block.header[INTS_AT] + 8 * INTS * number, INTS)[KIND]
        if kind != POINTS and kind != HALFSPACE:
            return PROMISE_CURVED
    return PROMISE_STORED


@kernel
def _ask_start(block, work_at, boolean):
    """Ask the narrowphase about the two parts in hand before they move; False where it leaves them undecided."""
    of_block, row_at = block.header, work_at + 8 * _ANSWER
    clear_rows(row_at, 1)
    answer_at(
        of_block[CORE],
        (
            of_block[INTS_AT], of_block[NUMBERS_AT], of_block[POSES_AT], of_block[TERMS_AT], of_block[SHAPE_OF_AT],
            work_at + 8 * _PAIR, 1, boolean, False, False, 0.0, row_at, of_block[DOUBLES_AT], of_block[INTEGERS_AT],
        ),
    )
    return not is_undecided_or_refused(view_row(row_at))
