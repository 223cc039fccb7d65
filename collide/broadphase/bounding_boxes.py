"""Axis-aligned bounding boxes of posed convex sets, rounded outwards."""

from __future__ import annotations

import math

import numpy as np

from collide.curved.shape_kinds import POINTS
from collide.kernels import address_of, entry, kernel, view_f64, view_i64
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.shape_table import (
    ADDRESS,
    INTS,
    KIND,
    NUMBERS,
    PADDED,
    PARAMS,
    POSE,
    POSE_SLOP,
    RADIUS,
    REACH,
    SLOP,
    TREE,
    ShapeTable,
)
from collide.numerics.vec3 import column_at, dot, neg, vec3_at
from collide.support.support_mapping import settled_vertex, support

#: Each bound is moved outwards by this many units in the last place of the terms summed; the
#: derivation in `narrowphase/bounds.py` needs fewer.
_OUTWARD = 32 * 2.0**-53
#: Up to this number of points a linear pass is used: the box needs the largest coordinate, not its point.
_MAX_LISTED = 16


@kernel
def _farthest_point(kind, coordinates, m, params, at, tree, g):
    """The core point farthest in direction g (`support`); with a support tree, that of the proven vertex."""
    vertex, point, _ = support(kind, coordinates, m, params, at, tree, 0, -1, g)
    return point if tree == 0 else column_at(coordinates, m, settled_vertex(coordinates, m, tree, vertex, g))


@kernel(inline=True)
def _extent(coordinates, m, g):
    """(least, largest) product of m points with g."""
    low = math.inf
    high = -math.inf
    for k in range(m):
        along = dot(column_at(coordinates, m, k), g)
        low = min(low, along)
        high = max(high, along)
    return low, high


@kernel
def _bound(ints, numbers, poses, coordinates, s, p, axis):
    """(low, high) of shape s at pose row p along a world axis [m], rounded outwards."""
    at = NUMBERS * s
    row = vec3_at(poses, POSE * p + 3 * axis)  # of the rotation: the axis in the shape's frame
    t = poses[POSE * p + 9 + axis]
    kind = ints[INTS * s + KIND]
    m = ints[INTS * s + PADDED]
    tree = ints[INTS * s + TREE]
    if kind == POINTS and m <= _MAX_LISTED and tree == 0:
        low, high = _extent(coordinates, m, row)
    else:
        high = dot(_farthest_point(kind, coordinates, m, numbers, at + PARAMS, tree, row), row)
        low = dot(_farthest_point(kind, coordinates, m, numbers, at + PARAMS, tree, neg(row)), row)
    low += t
    high += t
    radius = numbers[at + RADIUS]
    out = radius + numbers[at + SLOP] + poses[POSE * p + POSE_SLOP]
    out += _OUTWARD * (math.sqrt(dot(row, row)) * numbers[at + REACH] + abs(t) + radius)
    return low - out, high + out


@kernel
def put_box(ints_at, numbers_at, s, poses, k, boxes):
    """Write the box of shape s at pose row k into row k of boxes; a half-space gets an infinite box."""
    ints = view_i64(ints_at, INTS * (s + 1))
    numbers = view_f64(numbers_at, NUMBERS * (s + 1))
    if ints[INTS * s + KIND] == HALFSPACE:
        for axis in range(3):
            boxes[6 * k + axis] = -math.inf
            boxes[6 * k + 3 + axis] = math.inf
        return
    coordinates = view_f64(ints[INTS * s + ADDRESS], 3 * ints[INTS * s + PADDED])
    for axis in range(3):
        low, high = _bound(ints, numbers, poses, coordinates, s, k, axis)
        boxes[6 * k + axis] = low
        boxes[6 * k + 3 + axis] = high


@entry("void(int64, int64, int64, int64, int64, int64)")
def bounding_boxes(ints_at, numbers_at, poses_at, shape_of_at, n, boxes_at):
    """World boxes of n parts: part k is shape ``shape_of[k]`` at pose row k.

    boxes : 6·n doubles out: low x, y, z, high x, y, z. A half-space gets an infinite box.
    """
    shape_of = view_i64(shape_of_at, n)
    poses = view_f64(poses_at, POSE * n)
    boxes = view_f64(boxes_at, 6 * n)
    for k in range(n):
        put_box(ints_at, numbers_at, shape_of[k], poses, k, boxes)


def boxes_of(table: ShapeTable, poses: np.ndarray, shape_of: np.ndarray) -> np.ndarray:
    """(n, 6) world boxes of n parts: part k is row ``shape_of[k]`` of the table at row k of ``poses`` (n, POSE)."""
    boxes = np.empty((len(poses), 6))
    bounding_boxes(
        address_of(table.ints), address_of(table.numbers), address_of(poses), address_of(shape_of), len(poses),
        address_of(boxes),
    )
    return boxes


def widened(boxes: np.ndarray, margins: np.ndarray) -> np.ndarray:
    """(n, 6) boxes with margins (n,) [m] ≥ 0 on every side, rounded outwards; a margin of 0 keeps a box's bits.

    Each bound b is moved by r = margin + (|b| + margin)·2⁻⁵⁰. Three sums round, by at most 2⁻⁵³ of |b| + 2·margin each,
    less than a half of the added term: fl(b − r) ≤ b − margin and fl(b + r) ≥ b + margin, and the new box
    holds every point within the margin of the old one. An infinite bound stays infinite: its own r is infinite and
    points outwards. (A single r from the largest |b| of a box would be infinite for all six bounds, and inf · 0, no
    number, without a margin.)
    """
    r = margins[:, None] + (np.abs(boxes) + margins[:, None]) * 2.0**-50
    r[margins == 0.0] = 0.0
    return np.hstack([boxes[:, :3] - r[:, :3], boxes[:, 3:] + r[:, 3:]])


@entry("void(int64, int64, int64, int64, float64, int64)")
def gap_bounds(boxes_at, n_boxes, pairs_at, n, rounding, bounds_at):
    """Lower bounds of signed distances [m] of n pairs of bodies from their boxes, two integers a pair.

    Boxes apart by gaps g_x, g_y, g_z ≥ 0 along the axes hold points at least |g| apart. Where boxes overlap along all
    axes, a shift by the least overlap parts both bodies, so the depth of convex bodies is at most this overlap. Bounds
    are lowered by ``rounding``, relative to the bound and to the coordinates of the first box; infinite bounds stay.
    """
    boxes, pairs, bounds = view_f64(boxes_at, 6 * n_boxes), view_i64(pairs_at, 2 * n), view_f64(bounds_at, n)
    for k in range(n):
        a, b = 6 * pairs[2 * k], 6 * pairs[2 * k + 1]
        square = 0.0
        deep = -math.inf
        largest = 0.0
        for axis in range(3):
            above, below = boxes[a + axis] - boxes[b + 3 + axis], boxes[b + axis] - boxes[a + 3 + axis]
            gap = max(above, below) if above + below == above + below else -math.inf  # NaN bounds nothing
            square += max(gap, 0.0) * max(gap, 0.0)
            deep = max(deep, gap)
            for end in (boxes[a + axis], boxes[a + 3 + axis]):
                largest = max(largest, abs(end)) if abs(end) < math.inf else largest
        bound = math.sqrt(square) if deep > 0.0 else deep
        bounds[k] = bound - rounding * max(abs(bound), largest) if abs(bound) < math.inf else bound


def least_distances(boxes: np.ndarray, pairs: np.ndarray, rounding: float) -> np.ndarray:
    """(k,) `gap_bounds` of pairs (k, 2) of rows of boxes (n, 6)."""
    boxes, pairs, bounds = np.ascontiguousarray(boxes), np.ascontiguousarray(pairs), np.empty(len(pairs))
    gap_bounds(address_of(boxes), len(boxes), address_of(pairs), len(pairs), rounding, address_of(bounds))
    return bounds
