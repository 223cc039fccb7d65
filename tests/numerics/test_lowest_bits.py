"""The lowest set bit of doubles, row by row."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from naive import rng_of

from collide.numerics.lowest_bits import NO_BITS, lowest_exponents


def test_known_bits():
    for values, lowest in (
        ([0.0], NO_BITS),
        ([1.0, 0.0], 0),
        ([0.75, 8.0], -2),
        ([5e-324], -1074),
        ([2.0**1000, 3.0], 0),
    ):
        assert lowest_exponents(np.array(values)) == lowest


def test_rows_are_integers_of_their_grid_and_of_none_coarser():
    rng = rng_of("lowest bits")
    rows = rng.integers(-(2**20), 2**20, size=(200, 4)) * 2.0 ** rng.integers(-900, 900, size=(200, 1))
    rows[rng.random((200, 4)) < 0.3] = 0.0
    for row, lowest in zip(rows.tolist(), lowest_exponents(rows).tolist()):
        multiples = [Fraction(x) / Fraction(2) ** lowest for x in row]
        assert lowest == NO_BITS or all(x.denominator == 1 for x in multiples)
        assert any(x.numerator % 2 for x in multiples) == any(row)
