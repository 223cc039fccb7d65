"""Directions in the kernels' units: what scaling does to t, in Fractions."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from naive import rng_of
from reproduction import reproducing

from collide.casts.directions import Directions

SOURCE = "exponents, t = {exponents}, {t}  # tests/casts/test_directions.py"


def drawn(n: int) -> Directions:
    rng = rng_of("directions", n)
    return Directions(rng.uniform(-0.99, 0.99, (n, 3)), rng.integers(-40, 41, n))


def test_t_goes_there_and_back():
    """A point at t along the vector given is at t · 2^exponent along the kernels' one, exactly."""
    directions, rng = drawn(50), rng_of("t of directions")
    for limit in (0.0, 1.0, float(rng.uniform(1, 9)), math.inf):
        found = directions.limits(limit)
        with reproducing(SOURCE, exponents=directions.exponents, t=limit):
            for e, value in zip(directions.exponents.tolist(), found.tolist()):
                assert value == limit if math.isinf(limit) else Fraction(value) == Fraction(limit) * Fraction(2) ** e
            assert np.array_equal(directions.t_of(found), np.full(50, limit))
    t = rng.uniform(0, 5, (50, 3))
    rows = directions.t_of(t)
    for e, before, after in zip(directions.exponents.tolist(), t.tolist(), rows.tolist()):
        assert [Fraction(v) for v in after] == [Fraction(v) / Fraction(2) ** e for v in before]
    assert np.array_equal(directions.t_of(t[:, 1]), rows[:, 1])


def test_what_is_out_of_range_is_infinite_or_nothing():
    directions = Directions(np.full((2, 3), 0.5), np.array([1100, -1100]))
    assert directions.limits(1.0).tolist() == [math.inf, 0.0]
    assert directions.t_of(np.ones(2)).tolist() == [0.0, math.inf]


def test_one_is_repeated_and_many_are_kept():
    one, many = drawn(1), drawn(4)
    repeated = one.repeated(3)
    assert repeated.vectors.shape == (3, 3) and (repeated.vectors == one.vectors).all()
    assert repeated.exponents.tolist() == one.exponents.tolist() * 3
    same = many.repeated(4)
    assert np.array_equal(same.vectors, many.vectors) and np.array_equal(same.exponents, many.exponents)
    for array in (*repeated, *same):  # kernels read them by address
        assert array.flags.c_contiguous
