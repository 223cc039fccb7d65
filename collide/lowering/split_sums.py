"""Sums of lengths as two doubles, exactly."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from collide.kernels import address_of, entry, view_f64
from collide.numerics.error_free import two_sum

#: How `split_sum` ends: two doubles do not suffice, or that is not known; two do.
NOT_KNOWN, NOT_SPLIT, SPLIT = -1, 0, 1


@entry("int64(float64, float64, float64, int64)")
def split_sum(a, b, c, out_at):
    """Write the largest double no larger than a + b + c, of numbers ≥ 0, one of them above, and the rest.

    Returns SPLIT, NOT_SPLIT or NOT_KNOWN. With a + b = s + e and s + c = t + f exactly, the sum is t + (e + f); where
    e + f is a double g, t + g is h + r with |r| at most half an ulp of h, so h is the sum rounded, and the double
    before it the largest below where r < 0.
    """
    out = view_f64(out_at, 2)
    first = two_sum(a, b)
    second = two_sum(first.high, c)
    errors = two_sum(first.low, second.low)
    if errors.low != 0.0 or not second.high < math.inf:
        return NOT_KNOWN
    total = two_sum(second.high, errors.high)
    out[0], out[1] = total.high, total.low
    if total.low >= 0.0:
        return SPLIT
    mantissa, exponent = math.frexp(total.high)
    below = total.high - math.ldexp(1.0, int(exponent) - (54 if mantissa == 0.5 else 53))
    rest = two_sum(total.high - below, total.low)
    out[0], out[1] = below, rest.high
    return SPLIT if rest.low == 0.0 else NOT_SPLIT


def split_lengths(a: float, b: float, c: float) -> tuple[float, float] | None:
    """(the largest double no larger than a + b + c, the rest), exactly; ``None`` where the rest is no double.

    a, b, c : ≥ 0, a > 0 [m].
    """
    out = np.empty(2)
    status = split_sum(a, b, c, address_of(out))
    if status != NOT_KNOWN:
        return (float(out[0]), float(out[1])) if status == SPLIT else None
    total = Fraction(a) + Fraction(b) + Fraction(c)
    first = float(total)
    if first > total:
        first = math.nextafter(first, 0.0)
    rest = float(total - Fraction(first))
    return (first, rest) if total == Fraction(first) + Fraction(rest) else None
