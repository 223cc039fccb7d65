"""Rows of results as kernels write them: where the fields of `PAIR_DTYPE` stand, and how they are set."""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64, view_i32, view_u8
from collide.narrowphase.bounds import PROMISE_DEPTH, PROMISE_GAP, PROMISE_SUBNORMAL
from collide.results import PAIR_DTYPE, UNDECIDED


def _at(field: str, unit: int) -> int:
    assert PAIR_DTYPE.fields is not None
    return PAIR_DTYPE.fields[field][1] // unit


ROW = PAIR_DTYPE.itemsize
DISTANCE, LOWER, UPPER = _at("distance", 8), _at("lower", 8), _at("upper", 8)
NORMAL, POINT_A, POINT_B = _at("normal", 8), _at("point_a", 8), _at("point_b", 8)
BODY_B = _at("b", 4)
PART_A, PART_B = _at("part_a", 4), _at("part_b", 4)
VERTICES_A, VERTICES_B, ITERATIONS = _at("vertices_a", 4), _at("vertices_b", 4), _at("iterations", 4)
COUNT, HOW, EXACT_ROUNDS, HIT = _at("count", 1), _at("how", 1), _at("exact", 1), _at("hit", 1)
CERTIFIED, BEYOND = _at("certified", 1), _at("beyond", 1)


@kernel(inline=True)
def open_row(row_at):
    """`view_row`, and the row names no vertices."""
    row, words, marks = view_row(row_at)
    for k in range(4):
        words[VERTICES_A + k] = -1
        words[VERTICES_B + k] = -1
    return row, words, marks


@kernel(inline=True)
def view_row(row_at):
    """A row's doubles, words and bytes."""
    return view_f64(row_at, 12), view_i32(row_at, ROW // 4), view_u8(row_at, ROW)


@kernel(inline=True)
def write_vectors(row, nx, ny, nz, ax, ay, az, bx, by, bz, flip):
    """Normal and witness points of the pair as asked, from those of the pair as worked on."""
    sign = -1.0 if flip else 1.0
    row[NORMAL] = sign * nx + 0.0
    row[NORMAL + 1] = sign * ny + 0.0
    row[NORMAL + 2] = sign * nz + 0.0
    first = POINT_B if flip else POINT_A
    second = POINT_A if flip else POINT_B
    row[first] = ax
    row[first + 1] = ay
    row[first + 2] = az
    row[second] = bx
    row[second + 1] = by
    row[second + 2] = bz


@kernel(inline=True)
def write_vertices(words, marks, ids, n, flip):
    first = VERTICES_B if flip else VERTICES_A
    second = VERTICES_A if flip else VERTICES_B
    marks[COUNT] = n
    for k in range(n):
        words[first + k] = ids[2 * k]
        words[second + k] = ids[2 * k + 1]


@kernel(inline=True)
def write_decision(row, marks, distance, lower, upper, how, limit):
    """`write_verdict` where the sign is known and nothing more is promised."""
    row[LOWER] = lower
    row[UPPER] = upper if lower <= limit else math.inf
    row[DISTANCE] = (min(max(distance, lower), upper) if lower <= limit else lower) + 0.0
    marks[HOW] = how
    marks[HIT] = 0 if lower > 0.0 else 1
    marks[CERTIFIED] = 1
    marks[BEYOND] = 1 if lower > limit else 0


@kernel(inline=True)
def write_verdict(row, marks, distance, lower, upper, how, width, limit):
    """The numbers and flags of a row; rounding must not put the distance outside its own bracket.

    width : what is promised beyond the relative width of `bounds.py`, in metres.
    """
    row[LOWER] = lower
    row[UPPER] = upper
    distance = min(max(distance, lower), upper) + 0.0  # never −0.0
    row[DISTANCE] = distance
    width = max(width, PROMISE_GAP * distance if distance > 0.0 else -PROMISE_DEPTH * distance)
    if distance != 0.0:
        width = max(width, PROMISE_SUBNORMAL)
    decided = lower > 0.0 or upper <= 0.0
    marks[HOW] = how if decided else UNDECIDED
    marks[HIT] = 0 if lower > 0.0 else 1
    marks[CERTIFIED] = 1 if decided and upper - lower <= width else 0
    marks[BEYOND] = 1 if lower > limit else 0
    if lower > limit:
        row[DISTANCE] = lower
        row[UPPER] = math.inf
        marks[CERTIFIED] = 1
