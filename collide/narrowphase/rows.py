"""Rows of results as kernels write them: where the fields of `PAIR_DTYPE` stand, and how they are set."""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i32, view_i64, view_u8
from collide.narrowphase.bounds import PROMISE_DEPTH, PROMISE_GAP, PROMISE_SUBNORMAL
from collide.numerics.vec3 import put_vec3
from collide.results import PAIR_DTYPE, REFUSED, UNDECIDED, field_at

_at = partial(field_at, PAIR_DTYPE)
ROW = PAIR_DTYPE.itemsize
DISTANCE, LOWER, UPPER = _at("distance", 8), _at("lower", 8), _at("upper", 8)
NORMAL, POINT_A, POINT_B = _at("normal", 8), _at("point_a", 8), _at("point_b", 8)
BODY_B = _at("b", 4)
PART_A, PART_B = _at("part_a", 4), _at("part_b", 4)
VERTICES_A, VERTICES_B, ITERATIONS = _at("vertices_a", 4), _at("vertices_b", 4), _at("iterations", 4)
COUNT, HOW, EXACT_ROUNDS, HIT = _at("count", 1), _at("how", 1), _at("exact", 1), _at("hit", 1)
CERTIFIED, BEYOND = _at("certified", 1), _at("beyond", 1)


class Row(NamedTuple):
    """Views of one row of `PAIR_DTYPE`.

    doubles : distance, bracket, normal, witness points.   words : 32-bit integers.
    flags : bytes: how, hit, certified, beyond.
    """

    doubles: Any
    words: Any
    flags: Any


@kernel(inline=True)
def view_row(row_at):
    return Row(view_f64(row_at, 12), view_i32(row_at, ROW // 4), view_u8(row_at, ROW))


@kernel(inline=True)
def is_undecided(row):
    return row.flags[HOW] == UNDECIDED


@kernel(inline=True)
def is_undecided_or_refused(row):
    """Whether the row is left to the exact stage, or refused."""
    return row.flags[HOW] == UNDECIDED or row.flags[HOW] == REFUSED


@kernel(inline=True)
def hit_unless_apart(lower):
    """1 unless bodies are proven to be apart, by a lower bound of their distance: closed sets that touch share a point,
    and an open sign counts as a hit. For facets `facets/mesh_collide_kernel.py` decides touching exactly."""
    return 0 if lower > 0.0 else 1


@kernel(inline=True)
def copy_row(row_at, out_at):
    """Write the bytes of a row to another place."""
    row, out = view_i64(row_at, ROW // 8), view_i64(out_at, ROW // 8)
    for k in range(ROW // 8):
        out[k] = row[k]


@kernel(inline=True)
def clear_vertices(row):
    """The row names no vertices."""
    for k in range(4):
        row.words[VERTICES_A + k] = -1
        row.words[VERTICES_B + k] = -1
    row.flags[COUNT] = 0


@kernel(inline=True)
def blank_row(row_at):
    """`view_row`, and the row names no vertices."""
    row = view_row(row_at)
    clear_vertices(row)
    return row


@kernel(inline=True)
def write_vectors(row, nhat, p_a, p_b, flip):
    """Normal and witness points of the pair as asked, from those of the pair as worked on (exchanged if ``flip``)."""
    sign = -1.0 if flip else 1.0
    row.doubles[NORMAL] = sign * nhat.x + 0.0
    row.doubles[NORMAL + 1] = sign * nhat.y + 0.0
    row.doubles[NORMAL + 2] = sign * nhat.z + 0.0
    put_vec3(row.doubles, POINT_B if flip else POINT_A, p_a)
    put_vec3(row.doubles, POINT_A if flip else POINT_B, p_b)


@kernel(inline=True)
def write_vertices(row, ids, n, flip):
    """Name n vertex pairs: ``ids`` holds a vertex of A and one of B a pair, as worked on."""
    at_a = VERTICES_B if flip else VERTICES_A
    at_b = VERTICES_A if flip else VERTICES_B
    row.flags[COUNT] = n
    for k in range(n):
        row.words[at_a + k] = ids[2 * k]
        row.words[at_b + k] = ids[2 * k + 1]


@kernel(inline=True)
def write_decision(row, distance, lower, upper, how, limit):
    """`write_verdict` where the sign is known and nothing more is promised."""
    row.doubles[LOWER] = lower
    row.doubles[UPPER] = upper if lower <= limit else math.inf
    row.doubles[DISTANCE] = (min(max(distance, lower), upper) if lower <= limit else lower) + 0.0
    row.flags[HOW] = how
    row.flags[HIT] = hit_unless_apart(lower)
    row.flags[CERTIFIED] = 1
    row.flags[BEYOND] = 1 if lower > limit else 0


@kernel(inline=True)
def write_verdict(row, distance, lower, upper, how, width, limit):
    """The numbers and flags of a row; rounding must not put the distance outside its own bracket.

    width : what is promised beyond the relative width of `bounds.py`, in metres.   limit : the query's max_distance.
    """
    row.doubles[LOWER] = lower
    row.doubles[UPPER] = upper
    distance = min(max(distance, lower), upper) + 0.0  # never −0.0
    row.doubles[DISTANCE] = distance
    width = max(width, PROMISE_GAP * distance if distance > 0.0 else -PROMISE_DEPTH * distance)
    if distance != 0.0:
        width = max(width, PROMISE_SUBNORMAL)
    decided = lower > 0.0 or upper <= 0.0
    row.flags[HOW] = how if decided else UNDECIDED
    row.flags[HIT] = hit_unless_apart(lower)
    row.flags[CERTIFIED] = 1 if decided and upper - lower <= width else 0
    row.flags[BEYOND] = 1 if lower > limit else 0
    if lower > limit:
        row.doubles[DISTANCE] = lower
        row.doubles[UPPER] = math.inf
        row.flags[CERTIFIED] = 1
