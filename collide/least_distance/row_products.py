"""Products of homogeneous rows with a vector, in kernels: what is below a bound, and the least of all."""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i64

#: Words of a record, which tells kernels of some rows: addresses of the values and of the last numbers, the step of
#: these (0 where all rows have the same), how many rows there are, address of those to look at (0: all of them), how
#: many these are; and as doubles the largest magnitude of the values and of the last numbers.
RECORD = 8
_INTEGERS = 6
#: Products that are made at a time.
BLOCK = 128


class KernelRows(NamedTuple):
    """The rows of a record."""

    values: Any
    lasts: Any
    rows: Any
    step: int
    n: int
    d: int
    all_rows: bool
    magnitude: float
    largest_last: float


@kernel
def rows_of_record(record_at, d):
    """`KernelRows` of d coordinates and a last number."""
    words = view_i64(record_at, _INTEGERS)
    sizes = view_f64(record_at + 8 * _INTEGERS, RECORD - _INTEGERS)
    all_rows = words[4] == 0
    n = words[3] if all_rows else words[5]
    return KernelRows(
        view_f64(words[0], words[3] * d), view_f64(words[1], (words[3] - 1) * words[2] + 1),
        view_i64(words[4], 0 if all_rows else n), words[2], n, d, all_rows, sizes[0], sizes[1],
    )


class Function(NamedTuple):
    """A linear function of homogeneous rows: d numbers of ``vector`` from a place on, and the last.

    block, block_at : room for BLOCK products.
    """

    vector: Any
    at: int
    last: float
    block: Any
    block_at: int


@kernel
def size_of_products(rows, f):
    """The sum of the magnitudes of a product's terms is no more."""
    size = 0.0
    for axis in range(rows.d):
        size += abs(f.vector[f.at + axis])
    return rows.magnitude * size + rows.largest_last * abs(f.last)


@kernel(inline=True)
def _row(rows, k):
    return k if rows.all_rows else rows.rows[k]


@kernel(inline=True)
def _fill(rows, first, count, f, d):
    """`_fill_block` of all rows, last numbers left out. d is a literal in each call, so the compiler folds the
    branches; the vector is read once, since the compiler must assume that a write to the block may change the vector.
    """
    w = f.vector
    at = f.at
    w0 = w[at]
    w1 = w[at + 1] if d > 1 else 0.0
    w2 = w[at + 2] if d > 2 else 0.0
    w3 = w[at + 3] if d > 3 else 0.0
    w4 = w[at + 4] if d > 4 else 0.0
    w5 = w[at + 5] if d > 5 else 0.0
    w6 = w[at + 6] if d > 6 else 0.0
    w7 = w[at + 7] if d > 7 else 0.0
    v = rows.values
    for k in range(count):
        i = (first + k) * d
        total = v[i] * w0
        if d > 1:
            total += v[i + 1] * w1
        if d > 2:
            total += v[i + 2] * w2
        if d > 3:
            total += v[i + 3] * w3
        if d > 4:
            total += v[i + 4] * w4
        if d > 5:
            total += v[i + 5] * w5
        if d > 6:
            total += v[i + 6] * w6
        if d > 7:
            total += v[i + 7] * w7
        f.block[f.block_at + k] = total


@kernel
def _fill_block(rows, first, count, f):
    """The function at rows first … first + count − 1 of those to look at."""
    d = rows.d
    if not rows.all_rows or d < 2 or d > 8:
        for k in range(count):
            i = _row(rows, first + k) * d
            total = 0.0
            for axis in range(d):
                total += rows.values[i + axis] * f.vector[f.at + axis]
            f.block[f.block_at + k] = total
    elif d == 2:
        _fill(rows, first, count, f, 2)
    elif d == 3:
        _fill(rows, first, count, f, 3)
    elif d == 4:
        _fill(rows, first, count, f, 4)
    elif d == 5:
        _fill(rows, first, count, f, 5)
    elif d == 6:
        _fill(rows, first, count, f, 6)
    elif d == 7:
        _fill(rows, first, count, f, 7)
    else:
        _fill(rows, first, count, f, 8)
    block = f.block
    at = f.block_at
    if rows.step == 0:
        level = rows.lasts[0] * f.last
        for k in range(count):
            block[at + k] += level
    else:
        for k in range(count):
            block[at + k] += rows.lasts[_row(rows, first + k)] * f.last


@kernel
def least_product(rows, f, below):
    """The row with the least product, where that is below a bound; else −1."""
    least = below
    least_row = -1
    for first in range(0, rows.n, BLOCK):
        count = min(BLOCK, rows.n - first)
        _fill_block(rows, first, count, f)
        for k in range(count):
            value = f.block[f.block_at + k]
            if value < least:
                least = value
                least_row = _row(rows, first + k)
    return least_row


@entry("int64(int64, int64, int64, float64, int64, int64, int64)")
def products_below(record_at, d, vector_at, bound, rows_at, values_at, capacity):
    """How many rows have a product ≤ a bound; so many of them, and their products, are written.

    vector_at : address of d + 1 numbers.   rows_at, values_at : addresses of ``capacity`` rows and products, behind
    these room for BLOCK.
    """
    rows = rows_of_record(record_at, d)
    vector = view_f64(vector_at, d + 1)
    below = view_i64(rows_at, capacity)
    products = view_f64(values_at, capacity + BLOCK)
    f = Function(vector, 0, vector[d], products, capacity)
    n_below = 0
    for first in range(0, rows.n, BLOCK):
        count = min(BLOCK, rows.n - first)
        _fill_block(rows, first, count, f)
        for k in range(count):
            value = products[capacity + k]
            if value <= bound:
                if n_below < capacity:
                    below[n_below] = _row(rows, first + k)
                    products[n_below] = value
                n_below += 1
    return n_below
