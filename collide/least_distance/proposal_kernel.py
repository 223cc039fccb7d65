"""The nearest pair of points and half-spaces in doubles, in a kernel: a working set grows until no row violates it.

The linear complementarity problem of a working set of points pᵢ and half-spaces a_j·x ≤ b_j (see `nearest_pair.py`),
with the weight of point 0 replaced by 1 less the others' sum: variables are the weights of points 1 …, the multiplier
of the constraint "point 0 has weight ≥ 0", and the multipliers of the half-spaces.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.least_distance.pivoting_kernel import UNCLEAR, begin_dictionary, pivot_to_solution
from collide.least_distance.row_products import BLOCK, Function, least_product, rows_of_record, size_of_products

#: Doubles no longer tell a violation from rounding below this, relative to the size of the products.
NOISE = 1e-14
#: Rounds before integers take over.
_MAX_ROUNDS = 200
#: How a search ended: nothing is violated; doubles cannot tell; working sets are full; too much was read.
SETTLED, LOST, FULL, STOPPED = 0, 1, 2, 3
#: Coordinates of points at most: one more than questions have, for `interior_point.py`.
MAX_D = 9
#: The state of a search: integers at these places, then four lists of ``capacity`` rows each: working points, working
#: half-spaces, points of the basis, half-spaces of the basis.
N_POINTS, N_HALFSPACES, ROUNDS, PIVOTS, POINTS_READ, HALFSPACES_READ = 0, 1, 2, 3, 4, 5
N_BASIC_POINTS, N_BASIC_HALFSPACES, LISTS = 6, 7, 8
#: Its doubles: y, u, −x, a block of products; then p₀ and the edges from it, the values of the basic variables, and
#: the dictionary.
Y, U, MINUS_X, PRODUCTS = 0, MAX_D, 2 * MAX_D, 3 * MAX_D
MATRICES = PRODUCTS + BLOCK


def n_doubles(capacity: int) -> int:
    """Doubles of the state of a search with room for so many rows of either kind."""
    return MATRICES + (MAX_D + 2) * capacity + 2 * capacity * (2 * capacity + 2)


def n_integers(capacity: int) -> int:
    """Integers of the state of a search, and behind them those of the dictionary."""
    return LISTS + 8 * capacity + 1


class Search(NamedTuple):
    """The state of a search."""

    doubles: Any
    integers: Any
    basic: Any
    nonbasic: Any
    table: Any
    capacity: int


@kernel
def _write_program(search, points, halfspaces, s, t):
    """The dictionary of s working points and t half-spaces; p₀ and the edges from it are left in the doubles."""
    d = points.d
    doubles = search.doubles
    table = search.table
    working = search.integers
    size = s + t
    width = size + 2
    for i in range(s):
        row = working[LISTS + i]
        last = points.lasts[row * points.step]
        for axis in range(d):
            doubles[MATRICES + d * i + axis] = points.values[row * d + axis] / last
    for i in range(1, s):
        for axis in range(d):
            doubles[MATRICES + d * i + axis] -= doubles[MATRICES + axis]
    begin_dictionary(table, search.basic, search.nonbasic, size)
    for i in range(s):
        for k in range(s):
            table[i * width + k] = 0.0
        table[i * width + size + 1] = 0.0
    for i in range(s - 1):
        table[i * width + s - 1] = -1.0
        table[(s - 1) * width + i] = 1.0
    table[(s - 1) * width + size + 1] = 1.0
    for j in range(t):
        row = working[LISTS + search.capacity + j]
        line = (s + j) * width
        for i in range(1, s):
            cross = 0.0
            for axis in range(d):
                cross += doubles[MATRICES + d * i + axis] * halfspaces.values[row * d + axis]
            table[(i - 1) * width + s + j] = -cross
            table[line + i - 1] = cross
        table[(s - 1) * width + s + j] = 0.0
        table[line + s - 1] = 0.0
        for k in range(j + 1):
            beside = working[LISTS + search.capacity + k]
            gram = 0.0
            for axis in range(d):
                gram += halfspaces.values[row * d + axis] * halfspaces.values[beside * d + axis]
            table[line + s + k] = -gram
            table[(s + k) * width + s + j] = -gram
        offset = halfspaces.lasts[row * halfspaces.step]
        for axis in range(d):
            offset -= halfspaces.values[row * d + axis] * doubles[MATRICES + axis]
        table[line + size + 1] = offset


@kernel
def _read_solution(search, halfspaces, d, s, t):
    """y and u = y − x of a solved dictionary, and its basis, into the state."""
    doubles = search.doubles
    integers = search.integers
    size = s + t
    values = MATRICES + MAX_D * search.capacity
    for k in range(size):
        doubles[values + k] = -1.0  # not in the basis
    basic_points = LISTS + 2 * search.capacity
    n_basic = 0
    for i in range(size):
        variable = search.basic[i]
        if size <= variable < 2 * size:
            doubles[values + variable - size] = max(search.table[i * (size + 2) + size + 1], 0.0)
        elif variable == s - 1:  # 1 minus all other weights
            integers[basic_points] = integers[LISTS]
            n_basic = 1
    total = 1.0
    for k in range(s - 1):
        total -= max(doubles[values + k], 0.0)
    scale = 1.0 / (1.0 - total) if total < 0.0 else 1.0
    for axis in range(d):
        doubles[Y + axis] = doubles[MATRICES + axis]
        doubles[U + axis] = 0.0
    for k in range(1, s):
        weight = doubles[values + k - 1]
        if weight >= 0.0:
            integers[basic_points + n_basic] = integers[LISTS + k]
            n_basic += 1
            for axis in range(d):
                doubles[Y + axis] += weight * scale * doubles[MATRICES + d * k + axis]
    integers[N_BASIC_POINTS] = n_basic
    n_basic = 0
    for j in range(t):
        multiplier = doubles[values + s + j]
        if multiplier >= 0.0:
            row = integers[LISTS + search.capacity + j]
            integers[basic_points + search.capacity + n_basic] = row
            n_basic += 1
            for axis in range(d):
                doubles[U + axis] += multiplier * halfspaces.values[row * d + axis]
    integers[N_BASIC_HALFSPACES] = n_basic


@kernel
def _is_new(integers, first, n, row):
    for k in range(n):
        if integers[first + k] == row:
            return False
    return True


@kernel
def _grow(search, points, halfspaces, s, t):
    """Add, of either kind, the row most violated by the solution; False where no row is added."""
    doubles = search.doubles
    integers = search.integers
    d = points.d
    for axis in range(d):
        doubles[MINUS_X + axis] = doubles[U + axis] - doubles[Y + axis]
    f = Function(doubles, MINUS_X, 1.0, doubles, PRODUCTS)
    row = least_product(halfspaces, f, -NOISE * size_of_products(halfspaces, f))
    integers[HALFSPACES_READ] += halfspaces.n
    grown = row >= 0 and _is_new(integers, LISTS + search.capacity, t, row)
    if grown:
        integers[LISTS + search.capacity + t] = row
        integers[N_HALFSPACES] = t + 1
    length = 0.0
    for axis in range(d):
        length = max(length, abs(doubles[U + axis]))
    if length > NOISE * points.magnitude:
        level = math.inf
        for i in range(s):
            along = 0.0
            for axis in range(d):
                corner = doubles[MATRICES + axis] + (doubles[MATRICES + d * i + axis] if i > 0 else 0.0)
                along += corner * doubles[U + axis]
            level = min(level, along)
        f = Function(doubles, U, -level, doubles, PRODUCTS)
        row = least_product(points, f, -NOISE * size_of_products(points, f))
        integers[POINTS_READ] += points.n
        if row >= 0 and _is_new(integers, LISTS, s, row):
            integers[LISTS + s] = row
            integers[N_POINTS] = s + 1
            grown = True
    return grown


@entry("int64(int64, int64, int64, int64, int64, int64, int64)")
def propose_rows(d, points_at, halfspaces_at, doubles_at, integers_at, capacity, max_read):
    """How the search ended. The state has the working sets at first, at the end also a basis, y and u.

    d : at most MAX_D.   points_at, halfspaces_at : addresses of records (`row_products.py`).   doubles_at,
    integers_at, capacity : the state, of `n_doubles` and `n_integers`.   max_read : rows it may read, or a negative
    number.
    """
    points = rows_of_record(points_at, d)
    halfspaces = rows_of_record(halfspaces_at, d)
    n_before = MATRICES + (MAX_D + 2) * capacity
    n_lists = LISTS + 4 * capacity
    basic_at = integers_at + 8 * n_lists
    integers = view_i64(integers_at, n_lists)
    search = Search(
        view_f64(doubles_at, n_before), integers, view_i64(basic_at, 2 * capacity),
        view_i64(basic_at + 16 * capacity, 2 * capacity + 1),
        view_f64(doubles_at + 8 * n_before, 2 * capacity * (2 * capacity + 2)), capacity,
    )
    for _ in range(_MAX_ROUNDS):
        s = integers[N_POINTS]
        t = integers[N_HALFSPACES]
        if s >= capacity or t >= capacity:
            return FULL
        integers[ROUNDS] += 1
        _write_program(search, points, halfspaces, s, t)
        n_pivots = pivot_to_solution(search.table, search.basic, search.nonbasic, s + t, 20 * (s + t) + 50)
        if n_pivots == UNCLEAR:
            return LOST
        integers[PIVOTS] += n_pivots
        _read_solution(search, halfspaces, d, s, t)
        grown = _grow(search, points, halfspaces, s, t)
        if max_read >= 0 and integers[POINTS_READ] + integers[HALFSPACES_READ] > max_read:
            return STOPPED
        if not grown:
            return SETTLED
    return LOST
