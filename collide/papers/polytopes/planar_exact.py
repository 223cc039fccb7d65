"""The signs of `planar_predicates.py` in integers, where open in doubles.

A vertex of P lies at R_WP p + p_WP, entries taken as exact: integers times a power of two, of two factors each. A
side is a product of two differences of these vertices, a minor a product of two sides. Numbers are signed digits in
base 2²⁶ (`numerics/digits.py`), all coordinates of a sign on a common grid. Nothing overflows within the range of
coordinates.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.numerics.digits import BITS, add_double, add_product, carry, grid_of, lowest_bit, set_zero
from collide.papers.polytopes.planar_layout import (
    BODY,
    COORDINATE_AT,
    LONGEST,
    MINOR_AT,
    ROTATION,
    ROTATIONS_AT,
    SIDES_AT,
    SLOT,
    SLOTS,
    SURVEY_AT,
    SURVEYED,
    TRANSLATION,
    VECTORS_AT,
)

#: Stands for the lowest bit of 0.
_FAR_BIT = 1000


class PlanarGrid(NamedTuple):
    """One grid for all numbers of a sign.

    vertex, rotation, coordinate : grids of vertices' coordinates, of rotations, of posed coordinates; and
    n_vertex, n_rotation, n : their digits.
    """

    vertex: int
    n_vertex: int
    rotation: int
    n_rotation: int
    coordinate: int
    n: int


@kernel
def _digits_above(grid, exponent):
    """Digits on a grid of numbers below 2^exponent."""
    return max((exponent - 1 - BITS * grid) // BITS + 1, 1)


@kernel
def _exponent(x):
    """The least e with |x| < 2^e; −2000 of 0."""
    return math.frexp(x)[1] if x != 0.0 else -2000


@kernel
def _coordinates_of(doubles, slot, lowest, highest):
    at = SLOTS + SLOT * slot
    for k in range(at, at + 2):
        lowest = min(lowest, lowest_bit(doubles[k]))
        highest = max(highest, _exponent(doubles[k]))
    return lowest, highest


@kernel
def _survey_poses(doubles, integers):
    """Grids and exponents of both poses, and the rotations' digits: made for the first sign of a pair, then kept."""
    if doubles[SURVEYED] != 0.0:
        return
    low_R, high_R = _FAR_BIT, -_FAR_BIT
    for k in range(ROTATION, ROTATION + 8):
        low_R = min(low_R, lowest_bit(doubles[k]))
        high_R = max(high_R, _exponent(doubles[k]))
    low_t, high_t = _FAR_BIT, -_FAR_BIT
    for k in range(TRANSLATION, TRANSLATION + 4):
        low_t = min(low_t, lowest_bit(doubles[k]))
        high_t = max(high_t, _exponent(doubles[k]))
    grid = grid_of(low_R)
    n = _digits_above(grid, high_R)
    for k in range(8):
        at = ROTATIONS_AT + k * LONGEST
        set_zero(integers, at, n)
        add_double(integers, at, doubles[ROTATION + k], grid)
    integers[SURVEY_AT] = grid
    integers[SURVEY_AT + 1] = n
    integers[SURVEY_AT + 2] = high_R
    integers[SURVEY_AT + 3] = grid_of(low_t)
    integers[SURVEY_AT + 4] = high_t
    doubles[SURVEYED] = 1.0


@kernel
def _coordinates_of_line(doubles, line, lowest, highest):
    lowest, highest = _coordinates_of(doubles, line.start, lowest, highest)
    lowest, highest = _coordinates_of(doubles, line.end, lowest, highest)
    if line.through != line.start and line.through != line.end:
        lowest, highest = _coordinates_of(doubles, line.through, lowest, highest)
    return lowest, highest


@kernel
def _grid_of_range(doubles, integers, lowest, highest):
    """The `PlanarGrid` of vertices whose coordinates have such exponents."""
    _survey_poses(doubles, integers)
    vertex, rotation = grid_of(lowest), integers[SURVEY_AT]
    n_vertex, n_rotation = _digits_above(vertex, highest), integers[SURVEY_AT + 1]
    coordinate = min(vertex + rotation, integers[SURVEY_AT + 3])
    # A difference of two vertices has four products and two translations; three bits are kept for its sign.
    largest = max(highest + integers[SURVEY_AT + 2], integers[SURVEY_AT + 4])
    n = max(_digits_above(coordinate, largest + 6), vertex + rotation - coordinate + n_vertex + n_rotation)
    return PlanarGrid(vertex, n_vertex, rotation, n_rotation, coordinate, n)


@kernel
def _add_vertex(doubles, integers, grid, slot, out, sign, translated):
    """Add sign · (the posed vertex in a slot) to two coordinates at out and out + n."""
    at = SLOTS + SLOT * slot
    body = int(doubles[at + BODY])
    offset = grid.vertex + grid.rotation - grid.coordinate
    for column in range(2):
        set_zero(integers, COORDINATE_AT, grid.n_vertex)
        add_double(integers, COORDINATE_AT, doubles[at + column], grid.vertex)
        for row in range(2):
            entry = ROTATIONS_AT + (4 * body + 2 * row + column) * LONGEST
            add_product(
                integers, out + row * grid.n + offset, entry, grid.n_rotation, COORDINATE_AT, grid.n_vertex, sign
            )
    if translated:
        for row in range(2):
            add_double(integers, out + row * grid.n, sign * doubles[TRANSLATION + 2 * body + row], grid.coordinate)


@kernel
def _write_vector(doubles, integers, grid, i, j, out):
    """Write the vector from slot i to slot j, carried, and whether it is not 0."""
    set_zero(integers, out, 2 * grid.n)
    translated = doubles[SLOTS + SLOT * i + BODY] != doubles[SLOTS + SLOT * j + BODY]
    _add_vertex(doubles, integers, grid, j, out, 1, translated)
    _add_vertex(doubles, integers, grid, i, out, -1, translated)
    x = carry(integers, out, grid.n)
    y = carry(integers, out + grid.n, grid.n)
    return x != 0 or y != 0


@kernel
def _write_side(doubles, integers, grid, line, slot, out):
    """Write direction × (vertex − a point of the line), 2 n digits, carried; returns its sign."""
    n = grid.n
    d = VECTORS_AT
    e = VECTORS_AT + 2 * LONGEST
    _write_vector(doubles, integers, grid, line.start, line.end, d)
    _write_vector(doubles, integers, grid, line.through, slot, e)
    set_zero(integers, out, 2 * n)
    if line.turned:
        add_product(integers, out, d, n, e, n, -1)
        add_product(integers, out, d + n, n, e + n, n, -1)
    else:
        add_product(integers, out, d, n, e + n, n, 1)
        add_product(integers, out, d + n, n, e, n, -1)
    return carry(integers, out, 2 * n)


@kernel(cold=True)
def exact_side(doubles, integers, line, slot):
    """1 where the vertex in a slot lies to the left of the line, −1 to the right, 0 on it."""
    lowest, highest = _coordinates_of_line(doubles, line, _FAR_BIT, -_FAR_BIT)
    lowest, highest = _coordinates_of(doubles, slot, lowest, highest)
    grid = _grid_of_range(doubles, integers, lowest, highest)
    return _write_side(doubles, integers, grid, line, slot, SIDES_AT)


@kernel(cold=True)
def exact_minor(doubles, integers, line, second, i, j):
    """Sign of F(line, i)·F(second, j) − F(line, j)·F(second, i), F what `_write_side` writes."""
    lowest, highest = _coordinates_of_line(doubles, line, _FAR_BIT, -_FAR_BIT)
    lowest, highest = _coordinates_of_line(doubles, second, lowest, highest)
    lowest, highest = _coordinates_of(doubles, i, lowest, highest)
    lowest, highest = _coordinates_of(doubles, j, lowest, highest)
    grid = _grid_of_range(doubles, integers, lowest, highest)
    n = 2 * grid.n
    a, b = SIDES_AT, SIDES_AT + 2 * LONGEST
    c, d = SIDES_AT + 4 * LONGEST, SIDES_AT + 6 * LONGEST
    _write_side(doubles, integers, grid, line, i, a)
    _write_side(doubles, integers, grid, second, j, b)
    _write_side(doubles, integers, grid, line, j, c)
    _write_side(doubles, integers, grid, second, i, d)
    set_zero(integers, MINOR_AT, 2 * n)
    add_product(integers, MINOR_AT, a, n, b, n, 1)
    add_product(integers, MINOR_AT, c, n, d, n, -1)
    return carry(integers, MINOR_AT, 2 * n)


@kernel(cold=True)
def exact_vector(doubles, integers, i, j):
    """Whether the vertices in two slots are one point of W."""
    lowest, highest = _coordinates_of(doubles, i, _FAR_BIT, -_FAR_BIT)
    lowest, highest = _coordinates_of(doubles, j, lowest, highest)
    grid = _grid_of_range(doubles, integers, lowest, highest)
    return not _write_vector(doubles, integers, grid, i, j, VECTORS_AT)
