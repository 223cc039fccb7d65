"""Two shapes of a few numbers made ready for single calls by a single kernel, in a single block of memory."""

from __future__ import annotations

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.lower_numbers import COLUMNS, N_NUMBERS, TWO_WORDS, lower_two
from collide.lowering.packed_convex import BLOCK
from collide.lowering.shape_table import INTS, NUMBERS
from collide.narrowphase.pair_workspace import DOUBLES
from collide.narrowphase.pose_batches import DOUBLES_AT, HEADER, INTS_AT, NUMBERS_AT

#: Words of a block: a header of single calls, rows 0 and 1 of a `ShapeTable`, then their columns from a cache line on.
_COLUMNS_AT = HEADER + 2 * (INTS + NUMBERS)
PAIR_WORDS = _COLUMNS_AT + BLOCK - 1 + 2 * COLUMNS
_LINE = 8 * BLOCK
assert 2 * N_NUMBERS + TWO_WORDS <= DOUBLES, "two sets are worked out in the workspace of single calls"

_SIGNATURE = (
    "void(int64, int64, float64, float64, float64, float64, float64, float64, float64, float64, float64, float64, "
    "float64, float64, float64, float64, float64, float64)"
)


@entry(_SIGNATURE, nogil=False)
def lower_pair(
    block_at, header_at, kind_a, n_a, radius_a, reach_a, x_a, y_a, z_a, w_a, kind_b, n_b, radius_b, reach_b, x_b, y_b,
    z_b, w_b,
):
    """Fill a block of PAIR_WORDS with two sets of eight numbers each (`primitive_numbers.PrimitiveNumbers`).

    header : of `pose_batches.py`, copied, but for the addresses of the tables. All threads share its workspace: the
    kernel keeps Python's lock.
    """
    header, usual = view_i64(block_at, HEADER), view_i64(header_at, HEADER)
    for k in range(HEADER):
        header[k] = usual[k]
    ints_at = block_at + 8 * HEADER
    numbers_at = ints_at + 8 * 2 * INTS
    columns_at = (block_at + 8 * _COLUMNS_AT + _LINE - 1) // _LINE * _LINE
    header[INTS_AT] = ints_at
    header[NUMBERS_AT] = numbers_at
    sets_at = header[DOUBLES_AT]
    _put_set(sets_at, kind_a, n_a, radius_a, reach_a, x_a, y_a, z_a, w_a)
    _put_set(sets_at + 8 * N_NUMBERS, kind_b, n_b, radius_b, reach_b, x_b, y_b, z_b, w_b)
    lower_two(sets_at, ints_at, numbers_at, columns_at, sets_at + 8 * 2 * N_NUMBERS)


@kernel(inline=True)
def _put_set(set_at, kind, n, radius, reach, x, y, z, w):
    values = view_f64(set_at, N_NUMBERS)
    values[0] = kind
    values[1] = n
    values[2] = radius
    values[3] = reach
    values[4] = x
    values[5] = y
    values[6] = z
    values[7] = w
