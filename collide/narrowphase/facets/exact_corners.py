"""Six corners of two posed triangles as exact integers, and the signs of polynomials in their coordinates.

A sign is asked of doubles first. What they cannot tell is worked out in `geometry.digits`, from coordinates that
are loaded once a pair: where B lies in A's frame without rounding (equal poses, or poses that turn by right
angles) from doubles in A's frame, two or three digits each; else from R v + t in the world, six to eight.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.facets.filtered_triangles import TINY, orientation, sign_error
from collide.narrowphase.facets.posed_surfaces import ERROR, PLAIN, SHIFT, M
from collide.numerics.digits import (
    LONGEST_FACTOR,
    add_double,
    add_number,
    add_product,
    carry,
    clear,
    grid_of,
    lowest_bit,
)

#: Most digits of a coordinate: 2^2900 from the lowest bit to the highest. Coordinates below 1e50 that are
#: products of two doubles never take more.
LONGEST = 112
assert LONGEST <= LONGEST_FACTOR
#: Most digits of an entry of a matrix.
_ENTRY = 48

# Corners, doubles: three of A and three of B in A's frame, B's in its own, and all six in the frame of the exact
# points, each coordinate good to the last number.
OWN_AT, SEEN_AT, SEEN_ERROR = 18, 27, 45
CORNERS = 46

# State, integers.
ROTATIONS_READY, SEEN, POINTS_READY, LENGTH, GRID_RA, DIGITS_RA, GRID_RB, DIGITS_RB, SIGNS = range(9)
#: What SEEN says: not looked at yet, exact in A's frame, or in the world.
UNSEEN, IN_A, IN_WORLD = range(3)
#: Signs of the pair: sides of B's corners (3) and of A's (3), edges of A and B (9); `UNKNOWN` until asked for.
TABLE = 9
STATE = TABLE + 15
UNKNOWN = 2

# Digits: matrices, then the corners (18 numbers), then numbers made on the way.
_POINTS = 18 * _ENTRY
_VERTEX = _POINTS + 18 * LONGEST
_U, _V, _W = (_VERTEX + k * 3 * LONGEST for k in range(3))
_CROSS = _VERTEX + 9 * LONGEST
_DOT = _CROSS + 6 * LONGEST
DIGITS = _DOT + 3 * LONGEST


@kernel
def forget_poses(state):
    state[ROTATIONS_READY] = 0
    forget_points(state)


@kernel
def forget_points(state):
    state[SEEN] = UNSEEN
    state[POINTS_READY] = 0


# A context: corners, placing, digits, state, XA, XB. All signs of a pair are those in one frame.


@kernel
def sign3(context, i, j, k, m):
    """Sign of (j − i) × (k − i) · (m − i) for corners 0 … 5."""
    corners, placing, digits, state, _XA, _XB = context
    value = orientation(corners, 3 * i, corners, 3 * j, corners, 3 * k, corners, 3 * m)
    limit = sign_error(_spread(corners, 0, i, j, k, m), placing[ERROR])
    if value > limit:
        return 1
    if value < -limit:
        return -1
    see_points(context)
    if state[SEEN] == IN_A and (
        _same(corners, i, j) or _same(corners, i, k) or _same(corners, i, m) or _same(corners, j, k)
        or _same(corners, j, m) or _same(corners, k, m) or _level(corners, i, j, k, m)
    ):  # fmt: skip
        return 0
    load_points(context)
    state[SIGNS] += 1
    n = state[LENGTH]
    _difference(digits, n, _U, j, i)
    _difference(digits, n, _V, k, i)
    _difference(digits, n, _W, m, i)
    at = _DOT
    clear(digits, at, 3 * n)
    for axis in range(3):
        _component(digits, n, axis, _CROSS)
        add_product(digits, at, _CROSS, 2 * n, _W + axis * n, n, 1)
    return carry(digits, at, 3 * n)


@kernel(inline=True)
def _same(corners, i, j):
    """Whether two corners are one point, seen exactly."""
    return (
        corners[3 * i] == corners[3 * j]
        and corners[3 * i + 1] == corners[3 * j + 1]
        and corners[3 * i + 2] == corners[3 * j + 2]
    )


@kernel(inline=True)
def _level(corners, i, j, k, m):
    """Whether four corners share a coordinate."""
    for axis in range(3):
        x = corners[3 * i + axis]
        if x == corners[3 * j + axis] and x == corners[3 * k + axis] and x == corners[3 * m + axis]:
            return True
    return False


@kernel
def shares_a_corner(context):
    """Whether a corner of A is, without rounding, one of B; False where that is not seen at once."""
    corners = context[0]
    see_points(context)
    if context[3][SEEN] != IN_A:
        return False
    for i in range(3):
        for j in range(3, 6):
            if _same(corners, i, j):
                return True
    return False


@kernel
def sign2(context, axis, i, j, k):
    """Sign of the component along an axis of (j − i) × (k − i)."""
    corners, _placing, digits, state, _XA, _XB = context
    see_points(context)
    y = SEEN_AT + (axis + 1) % 3
    z = SEEN_AT + (axis + 2) % 3
    yj = corners[3 * j + y] - corners[3 * i + y]
    zj = corners[3 * j + z] - corners[3 * i + z]
    yk = corners[3 * k + y] - corners[3 * i + y]
    zk = corners[3 * k + z] - corners[3 * i + z]
    spread = max(abs(yj), abs(zj), abs(yk), abs(zk))
    # Differences are off by f = 2E + 2uD and at most D: 4Df + 4f², and 4uD² by rounding.
    limit = spread * (16.0 * corners[SEEN_ERROR] + 2.0**-47 * spread) + TINY
    value = yj * zk - zj * yk
    if value > limit:
        return 1
    if value < -limit:
        return -1
    if corners[SEEN_ERROR] == 0.0 and (
        (yj == 0.0 and yk == 0.0) or (zj == 0.0 and zk == 0.0) or (yj == 0.0 and zj == 0.0)
        or (yk == 0.0 and zk == 0.0) or (yj == yk and zj == zk and _same(corners, j, k))
    ):  # fmt: skip
        return 0
    load_points(context)
    state[SIGNS] += 1
    n = state[LENGTH]
    _difference(digits, n, _U, j, i)
    _difference(digits, n, _V, k, i)
    return _component(digits, n, axis, _CROSS)


@kernel
def sign1(context, axis, i, j):
    """Sign of coordinate j − coordinate i, in the frame of the exact points."""
    digits = context[2]
    state = context[3]
    load_points(context)
    n = state[LENGTH]
    clear(digits, _U, n)
    add_number(digits, _U, _POINTS + (3 * j + axis) * n, n, 1)
    add_number(digits, _U, _POINTS + (3 * i + axis) * n, n, -1)
    return carry(digits, _U, n)


@kernel(inline=True)
def _spread(corners, at, i, j, k, m):
    """How far corners j, k, m are from corner i along an axis, at most."""
    far = 0.0
    for axis in range(3):
        x = corners[at + 3 * i + axis]
        far = max(
            far, abs(corners[at + 3 * j + axis] - x), abs(corners[at + 3 * k + axis] - x),
            abs(corners[at + 3 * m + axis] - x),
        )  # fmt: skip
    return far


@kernel
def _difference(digits, n, out, j, i):
    """Three coordinates of corner j less corner i."""
    clear(digits, out, 3 * n)
    add_number(digits, out, _POINTS + 3 * j * n, 3 * n, 1)
    add_number(digits, out, _POINTS + 3 * i * n, 3 * n, -1)
    for axis in range(3):
        carry(digits, out + axis * n, n)


@kernel
def _component(digits, n, axis, out):
    """Component of U × V; returns its sign."""
    y = (axis + 1) % 3
    z = (axis + 2) % 3
    clear(digits, out, 2 * n)
    add_product(digits, out, _U + y * n, n, _V + z * n, n, 1)
    add_product(digits, out, _U + z * n, n, _V + y * n, n, -1)
    return carry(digits, out, 2 * n)


# --- loading ------------------------------------------------------------------------------------


@kernel
def see_points(context):
    """Choose the frame of the exact points, and see them there in doubles, once a pair."""
    corners, placing, _digits, state, XA, XB = context
    if state[SEEN] != UNSEEN:
        return
    if placing[PLAIN] != 0.0 and _sums_are_exact(corners, placing):
        state[SEEN] = IN_A
        corners[SEEN_ERROR] = 0.0
        for k in range(18):
            corners[SEEN_AT + k] = corners[k]
        return
    state[SEEN] = IN_WORLD
    error = 0.0
    for k in range(6):
        X = XA if k < 3 else XB
        own = 3 * k if k < 3 else OWN_AT + 3 * (k - 3)
        for i in range(3):
            value = 0.0
            size = abs(X[4 * i + 3])
            for j in range(3):
                term = X[4 * i + j] * corners[own + j]
                value += term
                size += abs(term)
            corners[SEEN_AT + 3 * k + i] = value + X[4 * i + 3]
            error = max(error, size)
    corners[SEEN_ERROR] = error * 2.0**-50 + TINY


@kernel
def load_points(context):
    """The six corners as digits, once a pair."""
    corners, _placing, digits, state, XA, XB = context
    if state[POINTS_READY] != 0:
        return
    state[POINTS_READY] = 1
    see_points(context)
    if state[SEEN] == IN_A:
        _load_doubles(corners, digits, state)
    else:
        if state[ROTATIONS_READY] == 0:
            state[ROTATIONS_READY] = 1
            _load_matrix(digits, state, XA, 0, GRID_RA)
            _load_matrix(digits, state, XB, 9, GRID_RB)
        _load_world(corners, digits, state, XA, XB)


@kernel
def _sums_are_exact(corners, placing):
    """Whether every coordinate of M w + m is that sum without rounding: M turns by right angles, or not at all."""
    for k in range(3):
        for i in range(3):
            turned = 0.0
            for j in range(3):
                turned += placing[M + 3 * i + j] * corners[OWN_AT + 3 * k + j]
            shift = placing[SHIFT + i]
            total = turned + shift
            other = total - turned
            if (turned - (total - other)) + (shift - other) != 0.0:
                return False
    return True


@kernel
def _range(numbers, at, count, step):
    """(exponent of the lowest bit, exponent above the highest) of some doubles; (2000, −2000) where all are 0."""
    lowest = 2000
    highest = -2000
    for k in range(count):
        x = numbers[at + k * step]
        if x != 0.0:
            lowest = min(lowest, lowest_bit(x))
            highest = max(highest, math.frexp(x)[1])
    return lowest, highest


@kernel
def _load_doubles(corners, digits, state):
    lowest, highest = _range(corners, 0, 18, 1)
    if highest < lowest:
        lowest = 0
        highest = 1
    grid = grid_of(lowest)
    n = grid_of(highest) - grid + 1
    state[LENGTH] = n
    clear(digits, _POINTS, 18 * n)
    for k in range(18):
        add_double(digits, _POINTS + k * n, corners[k], grid)


@kernel
def _load_matrix(digits, state, X, at, which):
    lowest = 2000
    highest = -2000
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
            clear(digits, place, n)
            add_double(digits, place, X[4 * i + j], grid_of(lowest))
            carry(digits, place, n)


@kernel
def _load_world(corners, digits, state, XA, XB):
    """R v + t of all six corners, on one grid."""
    low_a, high_a = _range(corners, 0, 9, 1)
    low_b, high_b = _range(corners, OWN_AT, 9, 1)
    low_s, high_s = _range(XA, 3, 3, 4)
    low_t, high_t = _range(XB, 3, 3, 4)
    grid_a = grid_of(low_a) if low_a < 2000 else 0
    grid_b = grid_of(low_b) if low_b < 2000 else 0
    digits_a = grid_of(high_a) - grid_a + 1 if low_a < 2000 else 1
    digits_b = grid_of(high_b) - grid_b + 1 if low_b < 2000 else 1
    grid = grid_of(min(low_s, low_t, 1000))
    grid = min(grid, state[GRID_RA] + grid_a, state[GRID_RB] + grid_b)
    top = max(grid_of(max(high_s, high_t)), grid)
    top = max(top, state[GRID_RA] + state[DIGITS_RA] + grid_a + digits_a - 1)
    top = max(top, state[GRID_RB] + state[DIGITS_RB] + grid_b + digits_b - 1)
    n = top - grid + 1
    state[LENGTH] = n
    clear(digits, _POINTS, 18 * n)
    for k in range(6):
        own = 3 * k if k < 3 else OWN_AT + 3 * (k - 3)
        first = 0 if k < 3 else 9
        core = grid_a if k < 3 else grid_b
        length = digits_a if k < 3 else digits_b
        turned = state[GRID_RA] if k < 3 else state[GRID_RB]
        entries = state[DIGITS_RA] if k < 3 else state[DIGITS_RB]
        offset = turned + core - grid
        clear(digits, _VERTEX, 3 * length)
        for j in range(3):
            add_double(digits, _VERTEX + j * length, corners[own + j], core)
        for i in range(3):
            out = _POINTS + (3 * k + i) * n
            for j in range(3):
                entry = (first + 3 * i + j) * _ENTRY
                add_product(digits, out + offset, entry, entries, _VERTEX + j * length, length, 1)
            shift = XA[4 * i + 3] if k < 3 else XB[4 * i + 3]
            add_double(digits, out, shift, grid)
            carry(digits, out, n)
