"""Sums as two doubles, against fractions."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from collide.kernels import address_of
from collide.lowering.split_sums import NOT_KNOWN, NOT_SPLIT, SPLIT, split_sum


def split_by_fractions(a: float, b: float, c: float) -> tuple[float, float] | None:
    total = Fraction(a) + Fraction(b) + Fraction(c)
    first = float(total)
    if first > total:
        first = math.nextafter(first, 0.0)
    rest = float(total - Fraction(first))
    return (first, rest) if Fraction(first) + Fraction(rest) == total else None


def test_sums_are_split_as_fractions_are():
    rng, counts, out = np.random.default_rng(61), {SPLIT: 0, NOT_SPLIT: 0, NOT_KNOWN: 0}, np.empty(2)
    for number in range(4000):
        numbers = rng.uniform(0.5, 2.0, 3) * 10.0 ** (rng.uniform(-1, 1, 3) * rng.choice([1.0, 16.0, 45.0]))
        if number % 2:
            numbers = np.ldexp(np.round(np.ldexp(numbers, 6)) + 1.0, -6)
        if number % 5 == 0:  # parts of a digit of the first
            numbers[1:] = numbers[0] * 2.0**-53 * rng.uniform(0.1, 2.0, 2)
        numbers[rng.uniform(size=3) < 0.3] = 0.0
        numbers[0] = numbers[0] or 0.125
        a, b, c = numbers.tolist()
        status, wanted = split_sum(a, b, c, address_of(out)), split_by_fractions(a, b, c)
        counts[status] += 1
        if status == SPLIT:
            assert tuple(out.tolist()) == wanted, (a, b, c)
        elif status == NOT_SPLIT:
            assert wanted is None, (a, b, c)
    assert counts[SPLIT] >= 2000 and counts[NOT_KNOWN] <= 800, counts
    assert counts[NOT_SPLIT] >= 20, counts
