"""Numbers of as many digits as they take, against fractions."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import numpy as np
import pytest
from digit_numbers import number_at
from reproduction import reproducing

from collide.numerics import exact_numbers as E
from collide.numerics.digits import BITS

pytestmark = pytest.mark.plain_kernels


def value_of(space, a) -> Fraction:
    return number_at(space, a.at, a.n) * Fraction(2) ** (BITS * a.grid)


def random_double(rng) -> float:
    x = rng.uniform(-1, 1)
    return rng.choice((0.0, 5e-324, -1.0, 1e50, x, x * 2.0 ** rng.randrange(-900, 160)))


def test_sums_and_products():
    rng = random.Random(11)
    n_zero = n_negative = 0
    for _ in range(400):
        space = np.zeros(4000, dtype=np.int64)
        E.begin_numbers(space)
        x = [random_double(rng) for _ in range(6)]
        if rng.random() < 0.2:
            x[3:] = x[:3]
        with reproducing("x = {x}  # sums and products of number_of", x=x):
            a, b, c, d, e, f = (E.number_of(space, v) for v in x)
            p, q, r, s, t, u = map(Fraction, x)
            mark = E.filled(space)
            found = {
                p * q: E.times(space, a, b), p + q: E.plus(space, a, b, 1), p - s: E.plus(space, a, d, -1),
                p * t - q * s: E.minor(space, a, e, b, d),
                p * s + q * t + r * u: E.inner(space, E.NumberVec3(a, b, c), E.NumberVec3(d, e, f)),
            }
            found |= dict(zip(
                (q * u - r * t, r * s - p * u, p * t - q * s),
                E.cross(space, E.NumberVec3(a, b, c), E.NumberVec3(d, e, f)),
            ))
            for true, number in found.items():
                assert value_of(space, number) == true
                assert E.sign_of(space, number) == (true > 0) - (true < 0)
                ends = space[number.at], space[number.at + number.n - 1]
                assert number.n == 1 or (ends[0] != 0 and ends[1] not in (0, -1))
                n_zero, n_negative = n_zero + (true == 0), n_negative + (true < 0)
            last = number
            before = E.filled(space)
            if true:
                assert E.ratio(space, a, last) == float_of(p / true)
            assert E.rounded(space, last) == float_of(true) and E.filled(space) == before
            shortened = E.compacted(space, mark, last)
            assert value_of(space, shortened) == true and E.filled(space) == mark + shortened.n
            assert not E.are_worthless(space)
    assert min(n_zero, n_negative) > 100


def float_of(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def test_what_does_not_fit_is_told():
    """And nothing is written behind the workspace."""
    memory = np.full(60, 77, dtype=np.int64)
    space = memory[:50]
    E.begin_numbers(space)
    a = E.number_of(space, 1.0 / 3.0)
    for _ in range(30):
        a = E.plus(space, a, E.number_of(space, 1.0 / 3.0), 1)
    assert E.are_worthless(space) and (memory[50:] == 77).all()
    E.begin_numbers(space)
    assert not E.are_worthless(space)
