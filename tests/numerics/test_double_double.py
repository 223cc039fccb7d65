"""Double-doubles against Fractions, and error-free products compiled against Dekker's."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from collide.kernels import address_of, entry, view_f64
from collide.numerics import double_double as dd
from collide.numerics.error_free import DD, dekker_product, two_product, two_sum
from collide.support.block_scan import (
    count_level,
    count_level_one_by_one,
    farthest,
    farthest_one_by_one,
    least,
    least_one_by_one,
)

pytestmark = pytest.mark.own_kernels


@entry("void(int64, int64, int64)")
def _operate(numbers_at, results_at, n):
    numbers = view_f64(numbers_at, 4 * n)
    out = view_f64(results_at, 14 * n)
    for k in range(n):
        a = numbers[4 * k]
        a_low = numbers[4 * k + 1]
        b = numbers[4 * k + 2]
        b_low = numbers[4 * k + 3]
        x = DD(a, a_low)
        y = DD(b, b_low)
        out[14 * k], out[14 * k + 1] = dd.add(x, y)
        out[14 * k + 2], out[14 * k + 3] = dd.sub(x, y)
        out[14 * k + 4], out[14 * k + 5] = dd.mul(x, y)
        out[14 * k + 6], out[14 * k + 7] = dd.div(x, y)
        out[14 * k + 8], out[14 * k + 9] = dd.sqrt(x if a > 0.0 else dd.neg(x))
        out[14 * k + 10], out[14 * k + 11] = two_product(a, b)
        out[14 * k + 12], out[14 * k + 13] = dekker_product(a, b)


def _numbers(rng, n):
    """Pairs of double-doubles: any, nearly opposite, short ones, of very unequal size."""
    a = rng.normal(size=(n, 2)) * 2.0 ** rng.integers(-60, 60, (n, 2))
    a[: n // 4, 1] = -a[: n // 4, 0] * (1 + rng.integers(-4, 5, n // 4) * 2.0**-52)
    a[n // 4 : n // 3] = np.round(a[n // 4 : n // 3])
    a[a == 0.0] = 1.0
    low = a * rng.uniform(-1, 1, (n, 2)) * 2.0**-54
    return np.ascontiguousarray(np.stack([a[:, 0], low[:, 0], a[:, 1], low[:, 1]], axis=1))


def test_operations_keep_their_bounds():
    n = 3000
    numbers = _numbers(np.random.default_rng(1), n)
    out = np.zeros((n, 14))
    _operate(address_of(numbers), address_of(out), n)
    cancelled = 0
    for (ah, al, bh, bl), row in zip(numbers.tolist(), out.tolist()):
        a, b = Fraction(ah) + Fraction(al), Fraction(bh) + Fraction(bl)
        found = [Fraction(row[k]) + Fraction(row[k + 1]) for k in range(0, 14, 2)]
        for value, exact in zip(found, (a + b, a - b, a * b, a / b)):
            assert abs(value - exact) <= abs(exact) * Fraction(dd.ROUNDING), (ah, al, bh, bl)
        assert abs(found[4] ** 2 - abs(a)) <= abs(a) * Fraction(2 * dd.ROUNDING)
        assert found[5] == found[6] == Fraction(ah) * Fraction(bh) and row[10] == row[12]
        cancelled += abs(a + b) < abs(a) * Fraction(2.0**-40)
    assert cancelled > n // 8


@entry("void(float64, float64, float64, int64)")
def _bracket(a, a_low, error, out_at):
    out = view_f64(out_at, 3)
    out[0], out[1], out[2] = dd.bracket(DD(a, a_low), error)


def test_brackets_are_outward_and_tight():
    rng = np.random.default_rng(2)
    out = np.zeros(3)
    for k in range(2000):
        a = float(rng.choice([1.0, -1.0, 1.5, rng.normal()])) * 2.0 ** int(rng.integers(-30, 30))
        a_low = a * float(rng.uniform(-1, 1)) * 2.0**-54 if k % 3 else 0.0
        error = abs(a) * 2.0 ** -float(rng.integers(60, 100)) if k % 2 else 0.0
        _bracket(a, a_low, error, address_of(out))
        value = Fraction(a) + Fraction(a_low)
        assert Fraction(out[0]) <= value - Fraction(error) and value + Fraction(error) <= Fraction(out[2])
        assert out[0] <= out[1] <= out[2] and out[2] - out[0] <= 2 * np.spacing(abs(a))
        if a_low == error == 0.0:
            assert out[0] == out[1] == out[2] == a


def test_scans_agree_with_their_plain_twins():
    rng = np.random.default_rng(3)
    for n in (8, 16, 24, 64, 136):
        for _ in range(40):
            points = rng.integers(-3, 4, (3, n)).astype(float)  # many ties
            g = rng.integers(-2, 3, 3).astype(float)
            _scan(address_of(points), n, *g, float(rng.integers(-6, 7)), address_of(out := np.zeros(8)))
            assert np.array_equal(out[:4], out[4:])


@entry("void(int64, int64, float64, float64, float64, float64, int64)")
def _scan(points_at, n, gx, gy, gz, limit, out_at):
    points = view_f64(points_at, 3 * n)
    out = view_f64(out_at, 8)
    index, value = farthest(points, 0, n, n, gx, gy, gz)
    out[0] = index
    out[1] = value
    out[2] = least(points, n)
    out[3] = count_level(points, n, n, gx, gy, gz, limit)
    index, value = farthest_one_by_one(points, 0, n, n, gx, gy, gz)
    out[4] = index
    out[5] = value
    out[6] = least_one_by_one(points, n)
    out[7] = count_level_one_by_one(points, n, n, gx, gy, gz, limit)


def test_sum_is_error_free():
    a, b = 1e16, 1.2345
    s, e = (float(x) for x in _sum(a, b))
    assert Fraction(s) + Fraction(e) == Fraction(a) + Fraction(b)


def _sum(a, b):
    out = np.zeros(2)
    _two_sum(a, b, address_of(out))
    return out


@entry("void(float64, float64, int64)")
def _two_sum(a, b, out_at):
    out = view_f64(out_at, 2)
    out[0], out[1] = two_sum(a, b)
