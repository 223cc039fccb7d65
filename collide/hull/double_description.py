"""Vertices of an intersection of half-spaces, exactly, by the double description method.

The half-spaces {x : n·x ≤ b} become a cone {(x, w) : b·w − n·x ≥ 0, w ≥ 0} in four dimensions (Motzkin, Raiffa,
Thompson and Thrall 1953; Fukuda and Prodon 1996). Its extreme rays with w > 0 are the vertices, rays with w = 0
directions in which the set is unbounded.

A ray is written as the 3 × 3 minors of three rows orthogonal to the ray, in integers: doubles are integers times powers
of two, so nothing is rounded until the vertices are handed back, and no number has more than three times the digits of
a row. Two extreme rays span a face of dimension two iff two independent rows hold both (Fukuda and Prodon 1996,
proposition 7); these and a row between the rays, positive on the first and negative on the second, give the new ray. C
calls the same two entries (`native/capi_shapes.c`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64
from collide.numerics.digits import (
    QUOTIENT_WORKSPACE,
    add_determinant,
    add_double,
    add_product,
    carry,
    grid_of,
    lowest_bit,
    negate,
    quotient,
    set_zero,
)

#: What `find_corners` says, besides how many corners there are.
UNBOUNDED, TOO_FEW_RAYS = -1, -2
#: Rows besides the half-spaces': w ≥ 0, and both sides of the planes x = 0, y = 0, z = 0.
_MORE_ROWS = 7
#: Columns of a row, the first three once more behind the four: any three that follow each other stand side by side.
_COLUMNS = 7
#: Rows whose bits are in one word.
_WORD = 62


class _Cone(NamedTuple):
    """Rows, and rays so far: views and places.

    digits : all numbers.   n_rows, n_digits, n_minor, words : number of rows, digits of a row's number, digits of a
    ray's, words of a set of rows.   rows, rays, work : where they begin.   tight : by ray, the set of rows orthogonal
    to the ray.
    side : by ray, the sign of its product with the cutting row.   order, after : rays in order, before and after a cut.
    free : unused rays.   start : four independent rows.
    """

    digits: Any
    n_rows: int
    n_digits: int
    n_minor: int
    words: int
    rows: int
    rays: int
    work: int
    tight: Any
    side: Any
    order: Any
    after: Any
    free: Any
    start: Any


@kernel
def _cone(memory_at, m, n_digits, capacity):
    """(the `_Cone` of m half-spaces whose rows have so many digits, with so many rays, where it ends)."""
    n_rows, n_minor = m + _MORE_ROWS, 3 * n_digits + 1
    words = n_rows // _WORD + 1
    rows = _COLUMNS * n_digits * n_rows
    rays = 4 * n_minor * capacity
    work = 8 * n_minor + QUOTIENT_WORKSPACE + words
    at = memory_at + 8 * (rows + rays + work)
    cone = _Cone(
        view_i64(memory_at, rows + rays + work), n_rows, n_digits, n_minor, words, 0, rows, rows + rays,
        view_i64(at, words * capacity), view_i64(at + 8 * words * capacity, capacity),
        view_i64(at + 8 * (words + 1) * capacity, capacity), view_i64(at + 8 * (words + 2) * capacity, capacity),
        view_i64(at + 8 * (words + 3) * capacity, capacity), view_i64(at + 8 * (words + 4) * capacity, 4),
    )
    return cone, at + 8 * ((words + 4) * capacity + 4)


@kernel
def _value(normals, offsets, m, row, column):
    """Of (−n, b) of a half-space, of w ≥ 0 behind them, of x ≥ 0, x ≤ 0, y ≥ 0, ... behind that."""
    if row < m:
        return -normals[3 * row + column] if column < 3 else offsets[row]
    if row == m:
        return 1.0 if column == 3 else 0.0
    axis, side = (row - m - 1) // 2, (row - m - 1) % 2
    return 0.0 if column != axis else 1.0 if side == 0 else -1.0


@kernel
def _span(normals, offsets, m, row):
    """(grid, digits) of a row."""
    lowest, highest = 2000, -2000
    for column in range(4):
        x = _value(normals, offsets, m, row, column)
        if x != 0.0:
            lowest = min(lowest, lowest_bit(x))
            highest = max(highest, math.frexp(x)[1])
    return grid_of(lowest), grid_of(highest - 1) - grid_of(lowest) + 1


@kernel
def _longest_row(normals_at, offsets_at, m):
    normals, offsets, n_digits = view_f64(normals_at, 3 * m), view_f64(offsets_at, m), 1
    for row in range(m):
        n_digits = max(n_digits, _span(normals, offsets, m, row)[1])
    return n_digits


@entry("int64(int64, int64, int64, int64)")
def corners_memory(normals_at, offsets_at, m, capacity):
    """Bytes that `find_corners` works in with so many rays."""
    return _cone(0, m, _longest_row(normals_at, offsets_at, m), capacity)[1]


@entry("int64(int64, int64, int64, int64, int64, int64, int64)")
def find_corners(normals_at, offsets_at, m, memory_at, capacity, corners_at, slop_at):
    """Find the vertices of {x : normals @ x ≤ offsets}; returns their number, 0 for an empty set.

    normals, offsets : (m, 3), (m,) doubles, no normal zero.   memory : as many bytes as `corners_memory` says.
    capacity : most rays held at a time; a cone of k rows has at most 2k, and twice as many while being cut.
    corners : out, (capacity, 3) doubles, each vertex rounded to nearest.   slop : out, a bound of their rounding error.

    UNBOUNDED : the set is not empty, and unbounded.   TOO_FEW_RAYS : capacity is too small.
    """
    normals, offsets = view_f64(normals_at, 3 * m), view_f64(offsets_at, m)
    cone, _ = _cone(memory_at, m, _longest_row(normals_at, offsets_at, m), capacity)
    for row in range(cone.n_rows):
        _put_row(cone, normals, offsets, m, row)
    has_line = _choose_start(cone) > m
    _begin(cone, capacity)
    n = 4
    for row in range(cone.n_rows):
        is_start = _is_start(cone, row)
        # Where no four rows of the set are independent, it is empty or holds lines: planes that these cross are added,
        # of which the set that they leave is empty just when the whole is.
        if not is_start and (row <= m or ((row - m) % 2 == 0 and _is_start(cone, row - 1))):
            n = _cut(cone, row, n, capacity)
            if n < 0:
                return TOO_FEW_RAYS
    return _write_corners(cone, n, has_line, view_f64(corners_at, 3 * capacity), view_f64(slop_at, 1))


@kernel
def _number(cone, row, column):
    """Where a number of a row stands."""
    return cone.rows + (_COLUMNS * row + column) * cone.n_digits


@kernel
def _coordinate(cone, ray, column):
    """Where a coordinate of a ray stands."""
    return cone.rays + (4 * ray + column) * cone.n_minor


@kernel
def _put_row(cone, normals, offsets, m, row):
    grid, _ = _span(normals, offsets, m, row)
    for column in range(_COLUMNS):
        at = _number(cone, row, column)
        set_zero(cone.digits, at, cone.n_digits)
        add_double(cone.digits, at, _value(normals, offsets, m, row, column % 4), grid)
        carry(cone.digits, at, cone.n_digits)


# --- rays -----------------------------------------------------------------------------------------


@kernel
def _put_ray(cone, ray, a, b, c):
    """Write the vector orthogonal to three rows; False where the vector is 0, the rows being dependent."""
    digits, is_ray = cone.digits, False
    for column in range(4):
        at = _coordinate(cone, ray, column)
        set_zero(digits, at, cone.n_minor)
        add_determinant(
            digits, _number(cone, a, column + 1) if column < 3 else _number(cone, a, 4),
            _number(cone, b, column + 1) if column < 3 else _number(cone, b, 4),
            _number(cone, c, column + 1) if column < 3 else _number(cone, c, 4), cone.n_digits, cone.work, at,
        )
        sign = carry(digits, at, cone.n_minor)
        is_ray = is_ray or sign != 0
        if column % 2 == 1:
            negate(digits, at, cone.n_minor)
    return is_ray


@kernel
def _side(cone, row, ray):
    """Sign of the product of a row and a ray."""
    n = cone.n_digits + cone.n_minor + 1
    set_zero(cone.digits, cone.work, n)
    for column in range(4):
        add_product(
            cone.digits, cone.work, _coordinate(cone, ray, column), cone.n_minor, _number(cone, row, column),
            cone.n_digits, 1,
        )
    return carry(cone.digits, cone.work, n)


@kernel
def _orient(cone, ray, row):
    """Negate a ray where its product with a row, not 0, is below 0."""
    if _side(cone, row, ray) < 0:
        for column in range(4):
            negate(cone.digits, _coordinate(cone, ray, column), cone.n_minor)


@kernel
def _choose_start(cone):
    """Choose the first four independent rows; returns the last of them."""
    start, n, w = cone.start, 0, cone.n_rows - _MORE_ROWS
    for row in range(cone.n_rows):
        is_new = n == 0
        if n == 1:  # two rows are independent iff they are with one of four that span all
            for k in (w, w + 1, w + 3, w + 5):
                is_new = is_new or _put_ray(cone, 0, start[0], row, k)
        elif n == 2:
            is_new = _put_ray(cone, 0, start[0], start[1], row)
        elif n == 3:
            is_new = _side(cone, row, 0) != 0
        if is_new:
            start[n] = row
            n += 1
        if n == 4:
            return row
    return cone.n_rows  # never: the last seven rows have four


@kernel
def _is_start(cone, row):
    return row == cone.start[0] or row == cone.start[1] or row == cone.start[2] or row == cone.start[3]


@kernel
def _mark(cone, ray, row):
    """A ray lies on a row."""
    cone.tight[cone.words * ray + row // _WORD] |= 1 << (row % _WORD)


@kernel
def _begin(cone, capacity):
    """The rays of the four first rows' cone."""
    start = cone.start
    for k in range(capacity):
        cone.free[k] = capacity - 1 - k
    for apart in range(4):
        set_zero(cone.tight, cone.words * apart, cone.words)
        cone.order[apart] = apart
        a, b, c = start[1 if apart < 1 else 0], start[2 if apart < 2 else 1], start[3 if apart < 3 else 2]
        _put_ray(cone, apart, a, b, c)
        _orient(cone, apart, start[apart])
        for k in range(4):
            if k != apart:
                _mark(cone, apart, start[k])


# --- a cut ----------------------------------------------------------------------------------------


@kernel
def _cut(cone, row, n, capacity):
    """Intersect the cone of n rays with a row's half-space; returns the number of rays then, −1 where capacity is
    short.

    Rays kept come first, in order, then new rays, each between a ray outside and a ray inside, by the order of the rays
    outside.
    """
    side, order, after = cone.side, cone.order, cone.after
    n_found = 0
    for k in range(n):
        ray = order[k]
        side[ray] = _side(cone, row, ray)
        if side[ray] == 0:
            _mark(cone, ray, row)
        if side[ray] >= 0:
            after[n_found] = ray
            n_found += 1
    n_free = capacity - n
    for i in range(n):
        for j in range(n if side[order[i]] < 0 else 0):
            if side[order[j]] > 0 and _shared(cone, order[i], order[j]) > 1:
                if n_free == 0 or n_found == capacity:
                    return -1
                if _put_between(cone, cone.free[n_free - 1], row):
                    n_free -= 1
                    after[n_found] = cone.free[n_free]
                    n_found += 1
    for k in range(n):
        if side[order[k]] < 0:
            cone.free[n_free] = order[k]
            n_free += 1
    for k in range(n_found):
        order[k] = after[k]
    return n_found


@kernel
def _shared(cone, ray_a, ray_b):
    """Write the set of rows orthogonal to both rays to the workspace's end; returns its size, 2 for two or more."""
    at, n = len(cone.digits) - cone.words, 0
    for w in range(cone.words):
        both = cone.tight[cone.words * ray_a + w] & cone.tight[cone.words * ray_b + w]
        cone.digits[at + w] = both
        if both != 0:
            n += 1 if both & (both - 1) == 0 else 2
    return min(n, 2)


@kernel
def _put_between(cone, ray, row):
    """Write the ray orthogonal to a row and to the rows shared by two rays, as `_shared` left them; False where no two
    shared rows are independent."""
    at, first = len(cone.digits) - cone.words, -1
    for w in range(cone.words):
        remaining = cone.digits[at + w]
        while remaining != 0:
            second = _WORD * w + math.frexp(float(remaining & -remaining))[1] - 1
            remaining &= remaining - 1
            if first < 0:
                first = second
            elif _put_ray(cone, ray, first, second, row):
                _orient_between(cone, ray)
                for k in range(cone.words):
                    cone.tight[cone.words * ray + k] = cone.digits[at + k]
                _mark(cone, ray, row)
                return True
    return False


@kernel
def _orient_between(cone, ray):
    """Orient a ray like the two rays beside: positive on a row of the start not shared by both."""
    at = len(cone.digits) - cone.words
    for k in range(4):
        row = cone.start[k]
        if cone.digits[at + row // _WORD] >> (row % _WORD) & 1 == 0:
            _orient(cone, ray, row)
            return


# --- corners --------------------------------------------------------------------------------------


@kernel
def _write_corners(cone, n, has_line, corners, slop):
    """Round the rays' vertices; returns how many, or UNBOUNDED."""
    digits, n_corners, n_unbounded = cone.digits, 0, 0
    is_exact, largest = True, 0.0
    for k in range(n):
        w = _coordinate(cone, cone.order[k], 3)
        if _is_zero(digits, w, cone.n_minor):
            n_unbounded += 1
            continue
        for axis in range(3):
            x, is_it = quotient(
                digits, _coordinate(cone, cone.order[k], axis), cone.n_minor, w, cone.n_minor, 0, cone.work
            )
            corners[3 * n_corners + axis] = x
            is_exact = is_exact and is_it
            largest = max(largest, abs(x))
        n_corners += 1
    # Each coordinate is rounded to nearest: half an ulp, plus the smallest number there is.
    ulp = math.ldexp(1.0, max(math.frexp(largest)[1] - 53, -1074)) if largest < math.inf else math.inf
    slop[0] = 0.0 if is_exact else math.sqrt(3.0) * ulp / 2.0 * (1.0 + 1e-15)
    return UNBOUNDED if n_corners > 0 and (n_unbounded > 0 or has_line) else n_corners


@kernel
def _is_zero(digits, at, n):
    for k in range(n):
        if digits[at + k] != 0:
            return False
    return True


# --- from Python ----------------------------------------------------------------------------------


def halfspace_vertices(normals: np.ndarray, offsets: np.ndarray):
    """Vertices of {x : normals @ x ≤ offsets}.

    Parameters
    ----------
    normals : (m, 3) float64, no zero rows.   offsets : (m,) float64.

    Returns
    -------
    vertices : (v, 3) float64, each the rounding of an exact vertex; (0, 3) where the set is empty or unbounded.
    slop : upper bound of the distance between a vertex and its rounding [m]; 0 where all are exact.
    unbounded : (3,) a direction of the recession cone of an unbounded set, else None.
    """
    normals, offsets = (np.ascontiguousarray(array, dtype=np.float64) for array in (normals, offsets))
    planes, slop = (address_of(normals), address_of(offsets), len(normals)), np.zeros(1)
    n, capacity = TOO_FEW_RAYS, 128
    while n == TOO_FEW_RAYS:
        capacity *= 2
        memory, corners = np.empty(corners_memory(*planes, capacity) // 8, dtype=np.int64), np.empty((capacity, 3))
        n = find_corners(*planes, address_of(memory), capacity, address_of(corners), address_of(slop))
    if n == UNBOUNDED:
        # Of the directions that no half-space ends, those in a cube: the largest have a coordinate of 1.
        sides = np.concatenate([np.eye(3), -np.eye(3)])
        zeros_and_ones = np.repeat([0.0, 1.0], [len(normals), 6])
        ways, _, _ = halfspace_vertices(np.concatenate([normals, sides]), zeros_and_ones)
        return corners[:0], 0.0, ways[np.abs(ways).max(axis=1).argmax()]
    return corners[:n].copy(), float(slop[0]), None
