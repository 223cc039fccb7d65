"""Integers of many digits inside kernels, against Python's own."""

from __future__ import annotations

import math
import os
import random
from collections import Counter
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


def _quotient_case(rng) -> tuple[int, int, int]:
    """(a, b, e) of a·2^e / b: any, halfway between doubles or nearly so, among the smallest, about the largest."""
    b = rng.getrandbits(rng.randrange(1, 900)) | 1
    kind = rng.randrange(5)
    if kind == 0:
        a, e = rng.getrandbits(rng.randrange(1, 900)), rng.randrange(-1200, 1100)
    elif kind == 1:  # an odd number of 54 bits
        a, e = (2 * (rng.getrandbits(52) | 1 << 52) + 1) * b + rng.choice((-1, 0, 0, 1)), rng.randrange(-1150, 1000)
    elif kind == 2:
        a, e = rng.getrandbits(rng.randrange(1, 55)) * b + rng.choice((-1, 0, 1)), rng.randrange(-1150, -1050)
    elif kind == 3:
        a, e = (2**54 - 1 - rng.randrange(3)) * b + rng.choice((-1, 0, 1)), 970 + rng.randrange(-2, 3)
    else:
        a, e = b * rng.getrandbits(60), rng.randrange(-80, 80)
    return max(a, 0) * rng.choice((-1, 1)), b * rng.choice((-1, 1)), e


@pytest.mark.many(3)
@pytest.mark.parametrize("seed", range(int(os.environ.get("COLLIDE_QUOTIENTS", "3000")) // 1000))
def test_quotients_are_those_of_fractions(seed):
    """To nearest, ties to even, and whether nothing was rounded; digits behind the workspace stay as they are."""
    rng = random.Random(f"quotients {seed}")
    seen: Counter = Counter()
    for _ in range(1000):
        a, b, e = _quotient_case(rng)
        na, nb = (abs(x).bit_length() // D.BITS + rng.randrange(1, 4) for x in (a, b))
        work = na + nb
        digits = np.full(work + 2 * max(na, nb) + D.QUOTIENT_WORKSPACE + 4, 77, dtype=np.int64)
        put_number(digits, 0, na, a)
        put_number(digits, na, nb, b)
        with reproducing("a, b, e = {a}, {b}, {e}  # a·2^e / b by quotient", a=a, b=b, e=e):
            found, is_exact = D.quotient(digits, 0, na, na, nb, e, work)
            true = Fraction(a, b) * Fraction(2) ** e
            try:
                nearest = float(true)  # rounds to nearest
            except OverflowError:
                nearest = math.inf if true > 0 else -math.inf
            assert found == nearest and (digits[-4:] == 77).all()
            assert is_exact == (math.isfinite(nearest) and Fraction(nearest) == true)
            assert number_at(digits, 0, na) == a and number_at(digits, na, nb) == b
        above = Fraction(math.nextafter(abs(nearest), math.inf)) if abs(nearest) < 1e308 else 0
        below = Fraction(math.nextafter(abs(nearest), 0.0)) if math.isfinite(nearest) else 0
        seen["tie"] += 2 * abs(true) in (abs(Fraction(nearest)) + above, abs(Fraction(nearest)) + below) if above else 0
        seen["exact"] += is_exact
        seen["infinite" if math.isinf(nearest) else "subnormal" if abs(nearest) < 2.0**-1022 else "normal"] += 1
    assert min(seen[what] for what in ("tie", "exact", "infinite", "subnormal", "normal")) >= 15, seen
