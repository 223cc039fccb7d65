"""Sums and products of doubles in kernels, exactly: each number has as many digits as its value takes.

A number is a run of digits (`digits.py`) in a workspace filled from its beginning: integer 0 holds the number of
integers filled, integer 1 whether a number did not fit, after which all numbers computed are worthless. A caller of
several steps keeps the result and gives back the rest: `compacted`. In `digits.py` places and lengths are the caller's:
faster, and longer to write.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.numerics.digits import (
    BITS,
    QUOTIENT_WORKSPACE,
    add_double,
    add_number,
    add_product,
    as_double_double,
    carry,
    copy,
    grid_of,
    lowest_bit,
    quotient,
    set_zero,
)
from collide.numerics.double_double import ScaledDD

_FILLED, _OVERFULL, _FIRST = range(3)


class Number(NamedTuple):
    """n carried digits at a place of the workspace, times 2^(BITS·grid); no digit at either end is 0 but that of 0."""

    at: int
    n: int
    grid: int


class NumberVec3(NamedTuple):
    x: Number
    y: Number
    z: Number


@kernel
def begin_numbers(space):
    """Empty the workspace."""
    space[_FILLED] = _FIRST
    space[_OVERFULL] = 0


@kernel
def are_worthless(space):
    """Whether something did not fit."""
    return space[_OVERFULL] != 0


@kernel
def _taken(space, n):
    """Place of n more digits, which are 0."""
    at = space[_FILLED]
    if at + n > len(space):
        space[_OVERFULL] = 1
        at = _FIRST  # somewhere within: no number is as long as the workspace
    space[_FILLED] = at + n
    set_zero(space, at, n)
    return at


@kernel
def _carried(space, at, n, grid):
    """The `Number` of digits, once they are carried."""
    carry(space, at, n)
    while n > 1 and (space[at + n - 1] == 0 or space[at + n - 1] == -1):  # −1 joins the digit below
        n -= 1
        space[at + n - 1] += space[at + n] << BITS
    while n > 1 and space[at] == 0:
        at += 1
        n -= 1
        grid += 1
    return Number(at, n, grid)


@kernel
def number_of(space, x):
    """The number that a double is."""
    if x == 0.0:
        return Number(_taken(space, 1), 1, 0)
    grid = grid_of(lowest_bit(x))
    n = grid_of(math.frexp(x)[1] - 1) - grid + 1
    at = _taken(space, n)
    add_double(space, at, x, grid)
    return _carried(space, at, n, grid)


@kernel
def vector_of(space, values, at, stride):
    """The `NumberVec3` that three doubles are, ``stride`` apart."""
    x, y, z = values[at], values[at + stride], values[at + 2 * stride]
    return NumberVec3(number_of(space, x), number_of(space, y), number_of(space, z))


@kernel
def times(space, a, b):
    """a·b; the shorter one of up to 1024 digits."""
    at = _taken(space, a.n + b.n)
    add_product(space, at, a.at, a.n, b.at, b.n, 1)
    return _carried(space, at, a.n + b.n, a.grid + b.grid)


@kernel
def plus(space, a, b, sign):
    """a + sign·b."""
    grid = min(a.grid, b.grid)
    n = max(a.grid + a.n, b.grid + b.n) - grid + 1
    at = _taken(space, n)
    add_number(space, at + a.grid - grid, a.at, a.n, 1)
    add_number(space, at + b.grid - grid, b.at, b.n, sign)
    return _carried(space, at, n, grid)


@kernel
def compacted(space, mark, a):
    """The number at the place that was filled up to ``mark``; what was made since is given back."""
    copy(space, mark, a.at, a.n)
    space[_FILLED] = mark + a.n
    return Number(mark, a.n, a.grid)


@kernel
def filled(space):
    """How far the workspace is filled."""
    return space[_FILLED]


@kernel
def minor(space, a, b, c, d):
    """a·b − c·d."""
    mark = space[_FILLED]
    return compacted(space, mark, plus(space, times(space, a, b), times(space, c, d), -1))


@kernel
def inner(space, a, b):
    """The inner product of two `NumberVec3`."""
    mark = space[_FILLED]
    sum_ = plus(space, times(space, a.x, b.x), times(space, a.y, b.y), 1)
    return compacted(space, mark, plus(space, sum_, times(space, a.z, b.z), 1))


@kernel
def cross(space, a, b):
    """The cross product of two `NumberVec3`."""
    return NumberVec3(
        minor(space, a.y, b.z, a.z, b.y), minor(space, a.z, b.x, a.x, b.z), minor(space, a.x, b.y, a.y, b.x)
    )


@kernel
def sign_of(space, a):
    """−1, 0 or 1."""
    highest = space[a.at + a.n - 1]
    return 1 if highest > 0 else -1 if highest < 0 else 0


@kernel
def scaled_dd(space, a):
    """A number as a `ScaledDD`, to a relative 2⁻⁸⁰."""
    rounded_to_two = as_double_double(space, a.at, a.n)
    return ScaledDD(rounded_to_two.value, rounded_to_two.exponent + BITS * a.grid)


@kernel
def ratio(space, a, b):
    """The double nearest to a / b, ties to even; b is not 0."""
    mark = space[_FILLED]
    work = _taken(space, 2 * max(a.n, b.n) + QUOTIENT_WORKSPACE)
    value, _ = quotient(space, a.at, a.n, b.at, b.n, BITS * (a.grid - b.grid), work)
    space[_FILLED] = mark
    return value


@kernel
def rounded(space, a):
    """The double nearest to a number, ties to even."""
    mark = space[_FILLED]
    value = ratio(space, a, number_of(space, 1.0))
    space[_FILLED] = mark
    return value
