"""Integers of many digits inside kernels, against Python's own."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest
from digit_numbers import number_at, put_number
from reproduction import reproducing

from collide.numerics import digits as D

pytestmark = pytest.mark.plain_kernels


def random_double(rng) -> float:
    kind = rng.random()
    if kind < 0.1:
        return 0.0
    if kind < 0.3:
        return rng.choice((-1, 1)) * rng.randrange(1, 64) * 2.0 ** rng.randrange(-40, 40)
    return rng.uniform(-1, 1) * 2.0 ** rng.randrange(-60, 40)


def sign(x) -> int:
    return (x > 0) - (x < 0)


def test_lowest_bits():
    rng = random.Random(3)
    assert D.lowest_bit(0.0) == 2000
    for x in (1.0, -1.0, 5e-324, 2.0**1023, 0.1, 3.0, *(random_double(rng) for _ in range(200))):
        if x:
            odd = Fraction(x) / Fraction(2) ** D.lowest_bit(x)
            assert odd.denominator == 1 and odd.numerator % 2 == 1, x
    assert [D.grid_of(e) for e in (-27, -26, -1, 0, 25, 26)] == [-2, -1, -1, 0, 0, 1]


def test_sums_of_doubles():
    """Sums, their signs, and what they round to: to nearest, and as two doubles to a relative 2⁻⁸⁰."""
    rng = random.Random(7)
    signs = {-1: 0, 0: 0, 1: 0}
    for _ in range(400):
        terms = [random_double(rng) for _ in range(rng.randrange(1, 5))]
        if rng.random() < 0.2:
            terms += [-t for t in terms]
        digits = np.zeros(64, dtype=np.int64)
        grid = min([D.grid_of(D.lowest_bit(t)) for t in terms if t] or [0])
        with reproducing("terms = {terms}  # summed by add_double and carry", terms=terms):
            for t in terms:
                D.add_double(digits, 0, t, grid)
            found = D.carry(digits, 0, 12)
            exact = sum(map(Fraction, terms), Fraction(0)) / Fraction(2) ** (D.BITS * grid)
            assert number_at(digits, 0, 12) == exact and found == sign(exact)
            assert all(0 <= digits[k] < 2**D.BITS for k in range(11))
            value, exponent = D.as_double(digits, 0, 12)
            assert value == float(exact / Fraction(2) ** exponent)  # Fraction → float rounds to nearest
            (value, low), exponent = D.as_double_double(digits, 0, 12)
            both = (Fraction(value) + Fraction(low)) * Fraction(2) ** exponent
            assert abs(both - exact) <= abs(exact) / 2**80
        signs[found] += 1
    assert min(signs.values()) > 20, signs


def test_products_and_sums_of_numbers():
    rng = random.Random(8)
    signs = {-1: 0, 0: 0, 1: 0}
    for _ in range(300):
        a, b = (rng.randrange(-(2**100), 2**100) for _ in range(2))
        if rng.random() < 0.1:
            b = a
        digits = np.zeros(80, dtype=np.int64)
        put_number(digits, 0, 10, a)
        put_number(digits, 10, 10, b)
        with reproducing("a, b = {a}, {b}  # a·b − b·b by add_product; a − b by add_number", a=a, b=b):
            D.add_product(digits, 20, 0, 10, 10, 10, 1)
            D.add_product(digits, 20, 10, 10, 10, 10, -1)
            found = D.carry(digits, 20, 20)
            assert number_at(digits, 20, 20) == a * b - b * b and found == sign(a * b - b * b)
            D.add_number(digits, 40, 0, 10, 1)
            D.add_number(digits, 40, 10, 10, -1)
            assert D.carry(digits, 40, 10) == sign(a - b) and number_at(digits, 40, 10) == a - b
        signs[found] += 1
        D.set_zero(digits, 20, 20)
        assert not digits[20:40].any() and number_at(digits, 0, 10) == a
    assert min(signs.values()) > 20, signs


def test_the_longest_sums_do_not_overflow():
    """Eight products of the longest factors with all bits set stay below 2⁶³: the room that the module promises."""
    n = D.LONGEST_FACTOR
    digits = np.zeros(4 * n + 2, dtype=np.int64)
    digits[: 2 * n] = 2**D.BITS - 1
    for _ in range(8):
        D.add_product(digits, 2 * n, 0, n, n, n, 1)
    most = int(digits[2 * n :].max())
    assert 2**59 < most < 2**63  # nothing wrapped: the largest is the middle one
    assert D.carry(digits, 2 * n, 2 * n + 2) == 1
    assert number_at(digits, 2 * n, 2 * n + 2) == 8 * (2 ** (D.BITS * n) - 1) ** 2
