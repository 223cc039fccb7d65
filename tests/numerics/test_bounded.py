"""Double-doubles with a bound: within their bound of what Fractions say, and exact where nothing is rounded."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest

from collide.numerics import bounded
from collide.numerics.bounded import UNKNOWN, Bounded, BoundedVec3

pytestmark = pytest.mark.plain_kernels


def value(a: Bounded) -> Fraction:
    return Fraction(a.high) + Fraction(a.low)


def drawn(rng, kind: str) -> float:
    if kind == "few bits":
        return float(rng.integers(-64, 65)) / 8.0
    return float(rng.normal() * 2.0 ** int(rng.integers(-20, 20)))


def expression(rng, kind: str, degree: int) -> tuple[Bounded, Fraction]:
    """A random sum of products, of doubles at its leaves: as bounded, and exactly."""
    if degree == 0:
        x, y = drawn(rng, kind), drawn(rng, kind)
        return bounded.exact_difference(x, y), Fraction(x) - Fraction(y)
    a, exact_a = expression(rng, kind, degree - 1)
    b, exact_b = expression(rng, kind, degree - 1)
    if rng.random() < 0.5:
        return bounded.mul(a, b), exact_a * exact_b
    if rng.random() < 0.3:  # nearly all of it cancels
        return bounded.sub(bounded.add(a, b), a), exact_b
    return bounded.sub(a, b), exact_a - exact_b


@pytest.mark.parametrize("kind", ["few bits", "all bits"])
def test_errors_are_bounded_and_signs_are_proven(kind):
    rng = np.random.default_rng(5)
    seen = Counter()
    for _ in range(1500):
        a, exact = expression(rng, kind, int(rng.integers(1, 5)))
        case = f"{kind}: {a} of {float(exact)!r}"
        assert abs(value(a) - exact) <= Fraction(a.error), case
        assert abs(a.low) <= 2.0**-53 * abs(a.high) or a.high == a.low == 0.0, case
        side = bounded.sign(a)
        if side != UNKNOWN:
            assert side == (exact > 0) - (exact < 0), case
        seen["rounded" if a.error > 0.0 else "exact"] += 1
        seen["proven" if side != UNKNOWN else "unknown"] += 1
        seen["zero"] += side == 0
    assert seen["proven"] > 1400, seen
    # Without rounding there is no error: zeros are proven, which a bound known beforehand cannot do.
    assert seen["exact"] > (1300 if kind == "few bits" else 200), seen
    assert seen["zero"] > 20 or kind == "all bits", seen
    assert seen["rounded"] > 300 or kind == "few bits", seen


def test_a_bound_that_reaches_over_zero_proves_nothing():
    assert bounded.sign(Bounded(1.0, 0.0, 1.0)) == UNKNOWN
    assert bounded.sign(Bounded(0.0, 0.0, 5e-324)) == UNKNOWN
    assert bounded.sign(Bounded(1.0, 0.0, 0.5)) == 1
    assert bounded.sign(Bounded(-1.0, 0.0, 0.5)) == -1
    assert bounded.sign(Bounded(0.0, 0.0, 0.0)) == 0


def test_long_sums_of_products_keep_their_bound():
    rng = np.random.default_rng(6)
    inexact = 0
    for _ in range(300):
        total, exact = Bounded(0.0, 0.0, 0.0), Fraction(0)
        for _ in range(8):
            x, y = drawn(rng, "all bits"), drawn(rng, "all bits")
            total, exact = bounded.add_product(total, x, y), exact + Fraction(x) * Fraction(y)
        total = bounded.settled(total)
        assert abs(value(total) - exact) <= Fraction(total.error), (total, float(exact))
        assert total.error <= 2.0**-100 * 2.0**45
        inexact += total.error > 0.0
    assert inexact > 200


def test_a_sparse_product_is_the_whole_one():
    rng = np.random.default_rng(7)
    for _ in range(200):
        a, b = (
            BoundedVec3(*(bounded.exact_difference(drawn(rng, "all bits"), drawn(rng, "all bits")) for _ in range(3)))
            for _ in range(2)
        )
        a = BoundedVec3(*(x if rng.random() < 0.5 else Bounded(0.0, 0.0, 0.0) for x in a))
        exact = sum(value(x) * value(y) for x, y in zip(a, b))
        product = bounded.sparse_dot(a, b)
        assert abs(value(product) - exact) <= Fraction(product.error) <= Fraction(bounded.dot(a, b).error), (a, b)
