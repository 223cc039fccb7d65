"""Bodies of several convex parts as the kernels read them: a row for each part, a row for each body.

Rows of parts hold the part's pose in its body, and a ball around the part: most pairs of parts are far apart, and
balls say so before any further work.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64
from collide.lowering.lowered_sets import LoweredSets, in_rows
from collide.lowering.packed_convex import HALFSPACE, POINTS, PackedConvex
from collide.lowering.set_rows import ADDRESS, INTS, KIND, NUMBERS, PADDED, RADIUS, REACH, SLOP
from collide.lowering.set_rows import COUNT as COUNT_OF_POINTS
from collide.lowering.shape_table import ShapeTable
from collide.mesh.nearest_neighbours import fit_box, longest_axis, split_at
from collide.numerics.vec3 import Vec3, add, column_at, dot, norm, put_vec3, scale, sub, vec3_at

# Doubles of a part: its pose in the body (R row by row, then t), 1 where that is more than the identity, the farthest
# its core's points and its shift reach, summed; a ball in the body's frame that holds its core, and the radius swept
# over it.
TURNED, MEASURE, CENTRE, BALL, SWEPT_RADIUS = 12, 13, 14, 17, 18
PART = 19
# Doubles of a body: such a ball for all of it, the largest radius swept, and how far its bounded parts reach.
BODY_CENTRE, BODY_BALL, BODY_SWEPT, BODY_REACH = 0, 3, 4, 5
BODY = 6
# Doubles of a ball in the world: its centre, from where body A stands, its radius, and how far what is in the ball
# reaches along a direction.
BALL_IN_WORLD = 5
# Integers of a body: its first part, how many there are, its first group of parts, and how many groups there are.
FIRST, COUNT, FIRST_GROUP, N_GROUPS = 0, 1, 2, 3
BODY_INTS = 4
#: Parts that are near each other stand in groups of so many, these in groups of as many, and so on up to a single one;
#: the last group of each size has what is left.
GROUP = 4
# Doubles of a group: such a ball for all of its parts, the largest radius swept, its members from … to, by the numbers
# of a body's nodes (parts by place, then all groups, small ones first), half sizes of the box around its parts'
# centres, in the middle of which the ball stands, and the largest radius of their balls.
MEMBERS, MEMBERS_END, HALF_SIZES, LARGEST_BALL = 5, 6, 7, 10
GROUP_BALL = 11

#: Radii of balls are rounded up by more than a dozen roundings.
_OUTWARD = 1 + 2.0**-45


class Balls(NamedTuple):
    """Balls in the frame of a shape, ``stride`` doubles apart, from an address on; stride 0, a single ball for all."""

    at: int
    stride: int
    n: int


class LaidOut(NamedTuple):
    """A body: its convex parts, (parts, PART) doubles, (BODY,) doubles; its parts by their places (parts,) int64, each
    GROUP in turn of parts near each other, and (groups, GROUP_BALL) doubles."""

    packed: LoweredSets
    parts: np.ndarray
    ball: np.ndarray
    by_place: np.ndarray
    groups: np.ndarray


def lay_out(parts: Sequence[tuple[PackedConvex, np.ndarray]]) -> LaidOut:
    """A body, by its convex parts and their poses (4, 4) in it. O(n log n)."""
    placed, n, size, n_groups = in_rows(parts), len(parts), len(parts), 0
    while size > 1 or n_groups == 0:
        size = -(-size // GROUP)
        n_groups += size
    rows, ball, by_place = np.empty((n, PART)), np.empty(BODY), np.empty(n, dtype=np.int64)
    groups, points, X = np.empty((n_groups, GROUP_BALL)), np.empty((n + 2, 3)), np.ascontiguousarray(placed.X_BP)
    lay_out_parts(
        *map(address_of, (placed.sets.ints, placed.sets.numbers, X)), n,
        *map(address_of, (rows, ball, by_place, groups, points)),
    )
    return LaidOut(placed.sets, rows, ball, by_place, groups)


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def lay_out_parts(ints_at, numbers_at, X_at, n, rows_at, ball_at, by_place_at, groups_at, points_at):
    """Write what `LaidOut` has of n convex sets in rows, at matrices in their body; returns 0.

    points : 3 · (n + 2) doubles to work in.
    """
    rows, ball, by_place = view_f64(rows_at, PART * n), view_f64(ball_at, BODY), view_i64(by_place_at, n)
    points = view_f64(points_at, 3 * n)
    for k in range(n):
        ints, numbers = view_i64(ints_at + 8 * INTS * k, INTS), view_f64(numbers_at + 8 * NUMBERS * k, NUMBERS)
        _put_part(ints, numbers, view_f64(X_at + 128 * k, 16), rows, PART * k)
        by_place[k] = k
        for axis in range(3):
            points[3 * k + axis] = rows[PART * k + CENTRE + axis]
    _put_ball(rows, by_place, 0, n, ball, 0)
    reach = 0.0
    for k in range(n):
        at = PART * k
        reach_of_part = norm(vec3_at(rows, at + CENTRE)) + rows[at + BALL] + rows[at + SWEPT_RADIUS]
        if reach_of_part < math.inf:
            reach = max(reach, reach_of_part)
    ball[BODY_REACH] = reach
    _order_by_place(points, by_place, n, view_f64(points_at + 24 * n, 6))
    span, first, number, count = 1, 0, n, n
    while span == 1 or count > 1:
        span *= GROUP
        end = first + count
        for start in range(0, n, span):
            groups = view_f64(groups_at + 8 * GROUP_BALL * (number - n), GROUP_BALL)
            _put_ball(rows, by_place, start, min(start + span, n), groups, 0)
            _put_box(rows, by_place, start, min(start + span, n), groups)
            groups[MEMBERS] = float(first)
            first = min(first + GROUP, end)
            groups[MEMBERS_END] = float(first)
            number += 1
        count = number - end
    return 0


@kernel(inline=True)
def _put_part(ints, numbers, X, rows, at):
    """Row of a part, by its set's rows and its matrix in the body."""
    turned = 0.0
    for i in range(3):
        for j in range(3):
            rows[at + 3 * i + j] = X[4 * i + j]
            turned = 1.0 if X[4 * i + j] != (1.0 if i == j else 0.0) else turned
        rows[at + 9 + i] = X[4 * i + 3]
        turned = 1.0 if X[4 * i + 3] != 0.0 else turned
    rows[at + TURNED] = turned
    t = Vec3(X[3], X[7], X[11])
    rows[at + MEASURE] = numbers[REACH] + (abs(t.x) + abs(t.y) + abs(t.z))
    rows[at + SWEPT_RADIUS] = numbers[RADIUS]
    centre, radius = _ball_of(ints, numbers)
    for i in range(3):
        rows[at + CENTRE + i] = dot(vec3_at(X, 4 * i), centre) + X[4 * i + 3]
    # A matrix that passes for a rotation may lengthen a little.
    rows[at + BALL] = radius * max(1.0, _stretch(X)) * _OUTWARD


@kernel(inline=True)
def _stretch(X):
    """By how much a matrix lengthens a vector at most: the root of the largest sum of a row of |RᵀR|."""
    x, y, z = Vec3(X[0], X[4], X[8]), Vec3(X[1], X[5], X[9]), Vec3(X[2], X[6], X[10])
    xy, yz, zx = abs(dot(x, y)), abs(dot(y, z)), abs(dot(z, x))
    return math.sqrt(max(dot(x, x) + xy + zx, dot(y, y) + yz + xy, dot(z, z) + zx + yz))


@kernel(inline=True)
def _ball_of(ints, numbers):
    """(centre, radius) of a ball that holds the core of a convex set, as stored and as described."""
    origin = Vec3(0.0, 0.0, 0.0)
    if ints[KIND] == HALFSPACE:
        return origin, math.inf
    if ints[KIND] != POINTS:
        return origin, numbers[REACH] + numbers[SLOP]
    n, padded = ints[COUNT_OF_POINTS], ints[PADDED]
    columns = view_f64(ints[ADDRESS], 3 * padded)
    low = high = column_at(columns, padded, 0)
    for k in range(1, n):
        p = column_at(columns, padded, k)
        low = Vec3(min(low.x, p.x), min(low.y, p.y), min(low.z, p.z))
        high = Vec3(max(high.x, p.x), max(high.y, p.y), max(high.z, p.z))
    centre, square = scale(0.5, add(low, high)), 0.0
    for k in range(n):
        out = sub(column_at(columns, padded, k), centre)
        square = max(square, dot(out, out))
    return centre, math.sqrt(square) + numbers[SLOP]


@kernel
def _put_ball(rows, by_place, first, end, ball, at):
    """A ball around the balls of the parts at some places, and the largest radius swept: what is in a part's ball is
    within its radius and the way between both centres."""
    low = high = vec3_at(rows, PART * by_place[first] + CENTRE)
    for place in range(first + 1, end):
        c = vec3_at(rows, PART * by_place[place] + CENTRE)
        low = Vec3(min(low.x, c.x), min(low.y, c.y), min(low.z, c.z))
        high = Vec3(max(high.x, c.x), max(high.y, c.y), max(high.z, c.z))
    middle, radius, largest = scale(0.5, add(low, high)), 0.0, 0.0
    for place in range(first, end):
        part = PART * by_place[place]
        radius = max(radius, norm(sub(vec3_at(rows, part + CENTRE), middle)) + rows[part + BALL])
        largest = max(largest, rows[part + SWEPT_RADIUS])
    put_vec3(ball, at, middle)
    ball[at + 3] = radius * _OUTWARD
    ball[at + 4] = largest


@kernel
def _put_box(rows, by_place, first, end, group):
    """Half sizes of the box around the centres of the parts at some places, and the largest radius of their balls."""
    size, largest = Vec3(0.0, 0.0, 0.0), 0.0
    for place in range(first, end):
        part = PART * by_place[place]
        out = sub(vec3_at(rows, part + CENTRE), vec3_at(group, 0))
        size = Vec3(max(size.x, abs(out.x)), max(size.y, abs(out.y)), max(size.z, abs(out.z)))
        largest = max(largest, rows[part + BALL])
    put_vec3(group, HALF_SIZES, size)
    group[LARGEST_BALL] = largest


@kernel
def _order_by_place(points, by_place, n, box):
    """Order parts by halving at the longest axis of their centres again and again, whole groups to the front half."""
    span = GROUP
    while 2 * span < n:
        span *= 2
    while span >= GROUP:
        for start in range(0, n - span, 2 * span):
            end = min(start + 2 * span, n)
            fit_box(points, start, end, box, 0)
            axis = longest_axis(box, 0)
            if box[3 + axis] > box[axis]:
                split_at(points, by_place, start, end, start + span, axis)
        span //= 2


class CompoundTable:
    """Bodies of convex parts in the tables that kernels read, with everything these point to kept alive."""

    def __init__(self, bodies: Sequence[LaidOut]):
        self.counts = np.array([len(body.packed) for body in bodies], dtype=np.int64)
        self.first = np.cumsum(self.counts) - self.counts
        self.table = ShapeTable.of_bodies([body.packed for body in bodies])
        self._parts = np.concatenate([body.parts for body in bodies])
        n_groups = np.array([len(body.groups) for body in bodies])
        of_bodies = self.first, self.counts, np.cumsum(n_groups) - n_groups, n_groups
        self._bodies = np.ascontiguousarray(np.stack(of_bodies, axis=1))
        self._by_place = np.concatenate([body.by_place for body in bodies])
        self._groups = np.concatenate([body.groups for body in bodies])
        self._balls = np.array([body.ball for body in bodies])
        #: Rows of parts that any two of these bodies take at most.
        self.max_parts = 2 * int(self.counts.max())
        tables = self._parts, self._bodies, self._balls, self._by_place, self._groups
        self.addresses = *self.table.addresses, *map(address_of, tables)

    def build_trees(self, which: np.ndarray | None) -> None:
        """Have the support trees of these bodies; of bodies 0 and 1 without."""
        if self.table.is_built:
            return
        used = [0, 1] if which is None else np.unique(which).tolist()
        self.table.build_trees(np.concatenate([np.arange(self.first[k], self.first[k] + self.counts[k]) for k in used]))
