"""Shapes of a few numbers as kernels read them: from eight (`primitive_numbers.py`) to rows of the tables.

A pair of these shapes takes a single call and a single block of memory; the sets of a Compound take a single call. Bits
are the bits of `packed_convex.py`.
"""

from __future__ import annotations

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.lowering.packed_convex import BLOCK, POINTS
from collide.lowering.set_rows import (
    ADDRESS,
    COARSE_AT,
    COUNT,
    INTS,
    KIND,
    LOWEST,
    NUMBERS,
    PADDED,
    PARAMS,
    RADIUS,
    RANK,
    REACH,
    SLOP,
    TREE,
)
from collide.numerics.lowest_bits import NO_BITS
from collide.numerics.number_digest import DIGEST_WORDS, put_digest
from collide.numerics.vec3 import dot, vec3_at
from collide.support.point_columns import lowest_of, reach_of_square

#: Numbers that tell a set, and their places.
N_NUMBERS = 8
_KIND, _N, _RADIUS, _REACH, _FIRST = range(5)
#: Core points that a set has at most: corners of a box.
_CORNERS = 8
#: Doubles of a set's columns: whole cache lines.
COLUMNS = 3 * BLOCK
#: Words of a digest; of the numbers digested before the points; of memory that a set is worked out in.
CONTENT = 2
_HEAD = 6
LOWERING_WORDS = 3 * _CORNERS + _HEAD + DIGEST_WORDS


@entry("void(int64, int64, int64, int64, int64, int64, int64)")
def lower_sets(sets_at, n, ints_at, numbers_at, columns_at, contents_at, memory_at):
    """Write rows of n sets: INTS integers, their ranks 0, NUMBERS doubles, COLUMNS doubles, from a cache line on, and
    CONTENT words, of each.

    sets : (n, N_NUMBERS) doubles.   memory : LOWERING_WORDS.   O(n).
    """
    for k in range(n):
        _lower_set(
            sets_at + 8 * N_NUMBERS * k, ints_at + 8 * INTS * k, numbers_at + 8 * NUMBERS * k,
            columns_at + 8 * COLUMNS * k, contents_at + 8 * CONTENT * k, memory_at,
        )


@kernel
def _lower_set(set_at, ints_at, numbers_at, columns_at, content_at, memory_at):
    """The rows of a set, and columns of its core points."""
    values, ints, numbers = view_f64(set_at, N_NUMBERS), view_i64(ints_at, INTS), view_f64(numbers_at, NUMBERS)
    head = view_f64(memory_at, _HEAD)
    points_at = memory_at + 8 * _HEAD  # digested with the head as they are: no zero is −0.0
    kind, n = int(values[_KIND]), int(values[_N])
    ints[KIND] = kind
    ints[COUNT] = n
    ints[PADDED] = BLOCK if n > 0 else 0
    ints[ADDRESS] = columns_at
    ints[LOWEST] = NO_BITS
    ints[RANK] = ints[TREE] = ints[COARSE_AT] = 0
    numbers[RADIUS] = values[_RADIUS]
    numbers[REACH] = values[_REACH]
    numbers[SLOP] = 0.0
    has_numbers = kind != POINTS or n == _CORNERS
    for k in range(4):
        numbers[PARAMS + k] = values[_FIRST + k] if has_numbers else 0.0
        head[2 + k] = values[_FIRST + k] if kind != POINTS else 0.0
    head[0] = values[_KIND]
    head[1] = values[_RADIUS]
    if n > 0:
        _put_corners(values, n, points_at, columns_at)
        half_sizes = vec3_at(values, _FIRST)  # every corner is as far from the origin, and has the same bits
        numbers[REACH] = reach_of_square(dot(half_sizes, half_sizes))
        ints[LOWEST] = lowest_of(view_f64(set_at + 8 * _FIRST, 3), 3)
    put_digest(memory_at, _HEAD + 3 * n, 0, 0, 0, 0, memory_at + 8 * (_HEAD + 3 * _CORNERS), content_at)


@kernel(inline=True)
def _put_corners(values, n, points_at, columns_at):
    """`convex_sets.corners_of`: (n, 3) corners, signs by the bits of their numbers; columns (3, BLOCK), filled up with
    the first."""
    points, columns = view_f64(points_at, 3 * BLOCK), view_f64(columns_at, COLUMNS)
    for k in range(BLOCK):
        number = k if k < n else 0
        for axis in range(3):
            half = values[_FIRST + axis]
            coordinate = half if (number >> (2 - axis)) & 1 else 0.0 - half
            points[3 * k + axis] = coordinate
            columns[BLOCK * axis + k] = coordinate


@kernel(inline=True)
def _compared(content_a_at, content_b_at):
    """−1, 0 or 1, as two digests are in order: bytes."""
    a, b = view_u8(content_a_at, 8 * CONTENT), view_u8(content_b_at, 8 * CONTENT)
    for k in range(8 * CONTENT):
        if a[k] != b[k]:
            return -1 if a[k] < b[k] else 1
    return 0


@kernel
def lower_two(sets_at, ints_at, numbers_at, columns_at, memory_at):
    """Rows 0 and 1 of a table, ranked, of two sets, and their columns.   memory : TWO_WORDS."""
    contents_at = memory_at + 8 * LOWERING_WORDS
    for k in range(2):
        _lower_set(
            sets_at + 8 * N_NUMBERS * k, ints_at + 8 * INTS * k, numbers_at + 8 * NUMBERS * k,
            columns_at + 8 * COLUMNS * k, contents_at + 8 * CONTENT * k, memory_at,
        )
    order = _compared(contents_at, contents_at + 8 * CONTENT)
    ints = view_i64(ints_at, 2 * INTS)
    ints[RANK] = 1 if order > 0 else 0
    ints[INTS + RANK] = 1 if order < 0 else 0


#: Words that two sets are worked out in.
TWO_WORDS = LOWERING_WORDS + 2 * CONTENT
