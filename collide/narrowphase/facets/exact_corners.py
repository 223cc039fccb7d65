"""Six corners of two posed triangles as exact integers, and the signs of polynomials in their coordinates.

A sign is computed in doubles first. A sign left open by the error bound is computed in `numerics/digits.py`, from
coordinates loaded once a pair: where B lies in A's frame without rounding (equal poses, or poses that rotate by right
angles) from doubles in A's frame, two or three digits each; otherwise from R v + t in the world, six to eight.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import kernel
from collide.mesh.triangle import put_triangle, triangle_at
from collide.narrowphase.facets.filtered_triangles import TINY, orientation, sign_error
from collide.narrowphase.facets.posed_surfaces import ERROR, PLAIN, SHIFT, M, sum_is_exact
from collide.numerics.digits import (
    LONGEST_FACTOR,
    add_double,
    add_number,
    add_product,
    carry,
    grid_of,
    lowest_bit,
    set_zero,
)
from collide.numerics.vec3 import equal_at, max_abs, sub, vec3_at

#: Digits of a coordinate at most: 2^2900 from the lowest bit to the highest. Coordinates below 1e50 that are
#: products of two doubles never take more.
LONGEST = 112
assert LONGEST <= LONGEST_FACTOR
#: Digits of an entry of a matrix at most.
_ENTRY = 48
#: Exponent that stands for the lowest bit of 0: above that of any double.
_NO_BITS = 2000

# Corners, doubles: three of A and three of B in A's frame (18); B's in its own frame; all six in the frame of the exact
# points (`ExactPair.state`), and the bound of the error of a coordinate there.
B_LOCAL_AT, EXACT_AT, EXACT_ERROR = 18, 27, 45
CORNERS = 46

# State, integers: whether the matrices are loaded, the frame of the exact points, whether they are loaded, their
# digits, the grid (exponent of the lowest digit) and the digits of both matrices, and how many signs were computed
# exactly.
_ROTATIONS_READY, _EXACT_FRAME, _POINTS_READY, _LENGTH, _GRID_RA, _GRID_RB, _SIGNS = 0, 1, 2, 3, 4, 6, 8
#: Frames of the exact points: none so far, A's, the world's.
_NO_FRAME, _IN_A, _IN_WORLD = range(3)
#: Signs of the pair: sides of B's corners (3) and of A's (3), edges of A and B (9); `UNKNOWN` until computed.
TABLE = 9
STATE = TABLE + 15
UNKNOWN = 2

# Digits: matrices, then the corners (18 numbers), then intermediate numbers.
_POINTS = 18 * _ENTRY
_VERTEX = _POINTS + 18 * LONGEST
_U, _V, _W = (_VERTEX + k * 3 * LONGEST for k in range(3))
_CROSS = _VERTEX + 9 * LONGEST
_DOT = _CROSS + 6 * LONGEST
DIGITS = _DOT + 3 * LONGEST


class ExactPair(NamedTuple):
    """Two triangles for the exact stage: views of corners, placing (`posed_surfaces.py`), digits and state; both poses.

    All signs of a pair are signs in the frame of the exact points.
    """

    corners: np.ndarray
    placing: np.ndarray
    digits: np.ndarray
    state: np.ndarray
    XA: np.ndarray
    XB: np.ndarray


class _Grid(NamedTuple):
    """Where numbers have digits: the exponent of the lowest digit, and the number of digits from the lowest on."""

    lowest: int
    length: int


@kernel
def invalidate_pose_cache(state):
    state[_ROTATIONS_READY] = 0
    invalidate_points(state)


@kernel
def invalidate_points(state):
    state[_EXACT_FRAME] = _NO_FRAME
    state[_POINTS_READY] = 0


@kernel
def sign3(pair, i, j, k, m):
    """Sign of (j − i) × (k − i) · (m − i) for corners 0 … 5."""
    corners, digits, state = pair.corners, pair.digits, pair.state
    value = orientation(corners, 3 * i, corners, 3 * j, corners, 3 * k, corners, 3 * m)
    limit = sign_error(_spread(corners, i, j, k, m), pair.placing[ERROR])
    if value > limit:
        return 1
    if value < -limit:
        return -1
    choose_exact_frame(pair)
    if state[_EXACT_FRAME] == _IN_A and (
        equal_at(corners, 3 * i, 3 * j) or equal_at(corners, 3 * i, 3 * k) or equal_at(corners, 3 * i, 3 * m)
        or equal_at(corners, 3 * j, 3 * k) or equal_at(corners, 3 * j, 3 * m) or equal_at(corners, 3 * k, 3 * m)
        or _share_a_coordinate(corners, i, j, k, m)
    ):
        return 0
    _load_points(pair)
    state[_SIGNS] += 1
    n = state[_LENGTH]
    _difference(digits, n, _U, j, i)
    _difference(digits, n, _V, k, i)
    _difference(digits, n, _W, m, i)
    set_zero(digits, _DOT, 3 * n)
    for axis in range(3):
        _component(digits, n, axis, _CROSS)
        add_product(digits, _DOT, _CROSS, 2 * n, _W + axis * n, n, 1)
    return carry(digits, _DOT, 3 * n)


@kernel(inline=True)
def _share_a_coordinate(corners, i, j, k, m):
    for axis in range(3):
        x = corners[3 * i + axis]
        if x == corners[3 * j + axis] and x == corners[3 * k + axis] and x == corners[3 * m + axis]:
            return True
    return False


@kernel
def shares_a_corner(pair):
    """Whether doubles without rounding show a corner of A to be one of B; False where the frame is the world's."""
    choose_exact_frame(pair)
    if pair.state[_EXACT_FRAME] != _IN_A:
        return False
    for i in range(3):
        for j in range(3, 6):
            if equal_at(pair.corners, 3 * i, 3 * j):
                return True
    return False


@kernel
def sign2(pair, axis, i, j, k):
    """Sign of the component along an axis of (j − i) × (k − i)."""
    corners, digits, state = pair.corners, pair.digits, pair.state
    choose_exact_frame(pair)
    y = EXACT_AT + (axis + 1) % 3
    z = EXACT_AT + (axis + 2) % 3
    yj = corners[3 * j + y] - corners[3 * i + y]
    zj = corners[3 * j + z] - corners[3 * i + z]
    yk = corners[3 * k + y] - corners[3 * i + y]
    zk = corners[3 * k + z] - corners[3 * i + z]
    spread = max(abs(yj), abs(zj), abs(yk), abs(zk))
    # Differences are off by f = 2E + 2uD and at most D: 4Df + 4f², and 4uD² by rounding.
    limit = spread * (16.0 * corners[EXACT_ERROR] + 2.0**-47 * spread) + TINY
    value = yj * zk - zj * yk
    if value > limit:
        return 1
    if value < -limit:
        return -1
    if corners[EXACT_ERROR] == 0.0 and (
        (yj == 0.0 and yk == 0.0) or (zj == 0.0 and zk == 0.0) or (yj == 0.0 and zj == 0.0)
        or (yk == 0.0 and zk == 0.0) or (yj == yk and zj == zk and equal_at(corners, 3 * j, 3 * k))
    ):
        return 0
    _load_points(pair)
    state[_SIGNS] += 1
    n = state[_LENGTH]
    _difference(digits, n, _U, j, i)
    _difference(digits, n, _V, k, i)
    return _component(digits, n, axis, _CROSS)


@kernel
def sign1(pair, axis, i, j):
    """Sign of coordinate j − coordinate i along an axis, in the frame of the exact points."""
    _load_points(pair)
    digits = pair.digits
    n = pair.state[_LENGTH]
    set_zero(digits, _U, n)
    add_number(digits, _U, _POINTS + (3 * j + axis) * n, n, 1)
    add_number(digits, _U, _POINTS + (3 * i + axis) * n, n, -1)
    return carry(digits, _U, n)


@kernel(inline=True)
def _spread(corners, i, j, k, m):
    """Largest distance of corners j, k, m from corner i along an axis."""
    first = vec3_at(corners, 3 * i)
    far_j = max_abs(sub(vec3_at(corners, 3 * j), first))
    far_k = max_abs(sub(vec3_at(corners, 3 * k), first))
    return max(far_j, far_k, max_abs(sub(vec3_at(corners, 3 * m), first)))


@kernel
def _difference(digits, n, out, j, i):
    """Three coordinates of corner j less corner i."""
    set_zero(digits, out, 3 * n)
    add_number(digits, out, _POINTS + 3 * j * n, 3 * n, 1)
    add_number(digits, out, _POINTS + 3 * i * n, 3 * n, -1)
    for axis in range(3):
        carry(digits, out + axis * n, n)


@kernel
def _component(digits, n, axis, out):
    """Component of U × V along an axis; returns its sign."""
    y = (axis + 1) % 3
    z = (axis + 2) % 3
    set_zero(digits, out, 2 * n)
    add_product(digits, out, _U + y * n, n, _V + z * n, n, 1)
    add_product(digits, out, _U + z * n, n, _V + y * n, n, -1)
    return carry(digits, out, 2 * n)


# --- loading ------------------------------------------------------------------------------------


@kernel
def choose_exact_frame(pair):
    """Choose the frame of the exact points, once a pair, and round the corners to doubles there."""
    corners, state = pair.corners, pair.state
    if state[_EXACT_FRAME] != _NO_FRAME:
        return
    if pair.placing[PLAIN] != 0.0 and _sums_are_exact(corners, pair.placing):
        state[_EXACT_FRAME] = _IN_A
        corners[EXACT_ERROR] = 0.0
        put_triangle(corners, EXACT_AT, triangle_at(corners, 0))
        put_triangle(corners, EXACT_AT + 9, triangle_at(corners, 9))
        return
    state[_EXACT_FRAME] = _IN_WORLD
    size_a = _round_to_world(corners, pair.XA, 0, EXACT_AT)
    size_b = _round_to_world(corners, pair.XB, B_LOCAL_AT, EXACT_AT + 9)
    corners[EXACT_ERROR] = max(size_a, size_b) * 2.0**-50 + TINY


@kernel
def _round_to_world(corners, X, at, to):
    """R v + t of three corners, rounded; returns the largest sum of the terms' magnitudes."""
    largest = 0.0
    for k in range(0, 9, 3):
        for i in range(3):
            value = 0.0
            size = abs(X[4 * i + 3])
            for j in range(3):
                term = X[4 * i + j] * corners[at + k + j]
                value += term
                size += abs(term)
            corners[to + k + i] = value + X[4 * i + 3]
            largest = max(largest, size)
    return largest


@kernel
def _load_points(pair):
    """The six corners as digits, once a pair."""
    digits, state = pair.digits, pair.state
    if state[_POINTS_READY] != 0:
        return
    state[_POINTS_READY] = 1
    choose_exact_frame(pair)
    if state[_EXACT_FRAME] == _IN_A:
        _load_doubles(pair.corners, digits, state)
    else:
        if state[_ROTATIONS_READY] == 0:
            state[_ROTATIONS_READY] = 1
            _load_matrix(digits, state, pair.XA, 0, _GRID_RA)
            _load_matrix(digits, state, pair.XB, 9, _GRID_RB)
        _load_world(pair)


@kernel
def _sums_are_exact(corners, placing):
    """Whether every coordinate of M w + m is that sum without rounding: M rotates by right angles, or not at all."""
    for k in range(3):
        for i in range(3):
            rotated = 0.0
            for j in range(3):
                rotated += placing[M + 3 * i + j] * corners[B_LOCAL_AT + 3 * k + j]
            if not sum_is_exact(rotated, placing[SHIFT + i]):
                return False
    return True


@kernel
def _range(numbers, at, count, step):
    """(exponent of the lowest bit, exponent above the highest) of some doubles; ±_NO_BITS where all are 0."""
    lowest = _NO_BITS
    highest = -_NO_BITS
    for k in range(count):
        x = numbers[at + k * step]
        if x != 0.0:
            lowest = min(lowest, lowest_bit(x))
            highest = max(highest, math.frexp(x)[1])
    return lowest, highest


@kernel
def _grid_of_coordinates(corners, at, count):
    """The grid of some coordinates; one digit where all are 0."""
    lowest, highest = _range(corners, at, count, 1)
    if highest < lowest:
        return _Grid(0, 1)
    return _Grid(grid_of(lowest), grid_of(highest) - grid_of(lowest) + 1)


@kernel
def _load_doubles(corners, digits, state):
    grid = _grid_of_coordinates(corners, 0, 18)
    n = grid.length
    state[_LENGTH] = n
    set_zero(digits, _POINTS, 18 * n)
    for k in range(18):
        add_double(digits, _POINTS + k * n, corners[k], grid.lowest)


@kernel
def _load_matrix(digits, state, X, at, which):
    """A rotation's entries as digits, from entry ``at`` on; state[which] and the next become their grid."""
    lowest = _NO_BITS
    highest = -_NO_BITS
    for i in range(3):
        low, high = _range(X, 4 * i, 3, 1)
        lowest = min(lowest, low)
        highest = max(highest, high)
    state[which] = grid_of(lowest)
    n = grid_of(highest) - grid_of(lowest) + 1
    state[which + 1] = n
    for i in range(3):
        for j in range(3):
            place = (at + 3 * i + j) * _ENTRY
            set_zero(digits, place, n)
            add_double(digits, place, X[4 * i + j], grid_of(lowest))
            carry(digits, place, n)


@kernel
def _load_world(pair):
    """R v + t of all six corners, on one grid."""
    corners, state = pair.corners, pair.state
    v = _grid_of_coordinates(corners, 0, 9)
    w = _grid_of_coordinates(corners, B_LOCAL_AT, 9)
    rotation_a = _Grid(state[_GRID_RA], state[_GRID_RA + 1])
    rotation_b = _Grid(state[_GRID_RB], state[_GRID_RB + 1])
    low_s, high_s = _range(pair.XA, 3, 3, 4)
    low_t, high_t = _range(pair.XB, 3, 3, 4)
    lowest = grid_of(min(low_s, low_t, 1000))
    lowest = min(lowest, rotation_a.lowest + v.lowest, rotation_b.lowest + w.lowest)
    top = max(grid_of(max(high_s, high_t)), lowest)
    top = max(top, rotation_a.lowest + rotation_a.length + v.lowest + v.length - 1)
    top = max(top, rotation_b.lowest + rotation_b.length + w.lowest + w.length - 1)
    grid = _Grid(lowest, top - lowest + 1)
    state[_LENGTH] = grid.length
    set_zero(pair.digits, _POINTS, 18 * grid.length)
    _load_posed(pair.digits, corners, 0, v, pair.XA, 0, rotation_a, 0, grid)
    _load_posed(pair.digits, corners, B_LOCAL_AT, w, pair.XB, 9, rotation_b, 9, grid)


@kernel
def _load_posed(digits, corners, at, coordinates, X, matrix, rotation, number, grid):
    """R v + t of the three corners at ``at``, as the exact points' numbers from ``number`` on.

    coordinates, rotation, grid : of the corners, of R, whose entries are numbers from ``matrix`` on, and of the points.
    """
    offset = rotation.lowest + coordinates.lowest - grid.lowest
    length = coordinates.length
    for k in range(0, 9, 3):
        set_zero(digits, _VERTEX, 3 * length)
        for j in range(3):
            add_double(digits, _VERTEX + j * length, corners[at + k + j], coordinates.lowest)
        for i in range(3):
            out = _POINTS + (number + k + i) * grid.length
            for j in range(3):
                entry = (matrix + 3 * i + j) * _ENTRY
                add_product(digits, out + offset, entry, rotation.length, _VERTEX + j * length, length, 1)
            add_double(digits, out, X[4 * i + 3], grid.lowest)
            carry(digits, out, grid.length)
