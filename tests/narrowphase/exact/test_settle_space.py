"""Brackets of what integers have found, in Fractions; parts of the workspace do not overlap."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from naive import rng_of
from reproduction import reproducing

from collide.kernels import address_of
from collide.narrowphase.bounds import EXACT_ERROR
from collide.narrowphase.exact import settle_space as S
from collide.numerics.double_double import DD

pytestmark = pytest.mark.plain_kernels


def drawn(rng) -> tuple[DD, Fraction]:
    """A double-double, and a value that it is right about."""
    high = float(rng.normal() * 2.0 ** int(rng.choice([0, 1, 60, -60, -900, -1000, -1060, -1074])))
    low = high * float(rng.uniform(-1, 1)) * 2.0**-54
    value = Fraction(high) + Fraction(low)
    return DD(high, low), value * (1 + Fraction(float(rng.uniform(-1, 1))) * Fraction(EXACT_ERROR))


def test_brackets():
    """They hold the value, are a few ulps wide, and do not contain 0 where it is not 0."""
    rng = rng_of("brackets of integers")
    for _ in range(600):
        found, true = drawn(rng)
        with reproducing("found = {found}", found=tuple(found)):
            bracket = S.bracket_of_gap(found)
            assert Fraction(bracket.lower) <= true <= Fraction(bracket.upper)
            assert bracket.lower <= bracket.nearest <= bracket.upper
            assert bracket.upper - bracket.lower <= 4 * np.spacing(abs(bracket.nearest)) + 3e-323
            if abs(found.high) > 1e-320:
                assert (bracket.lower > 0) == (true > 0) == (bracket.upper > 0)
            depth = found if found.high > 0 else DD(-found.high, -found.low)
            radii = [float(r) for r in rng.choice([0.0, 0.1, 1e-200], 2)]
            bracket = S.bracket_of_depth(depth, *radii)
            total = -(abs(true) + Fraction(radii[0]) + Fraction(radii[1]))
            assert Fraction(bracket.lower) <= total <= Fraction(bracket.upper)
            assert bracket.upper - bracket.lower <= 4 * np.spacing(abs(bracket.nearest)) + 3e-323
    assert tuple(S.bracket_of_gap(DD(0.0, 0.0))) == (0.0, 0.0, 0.0) == tuple(S.bracket_of_depth(DD(0.0, 0.0), 0.0, 0.0))


def test_parts_of_the_workspace():
    digits, terms = np.zeros(S.WORKSPACE, dtype=np.int64), np.arange(192.0)
    space = S.settle_space(address_of(terms), 2, address_of(digits))
    assert space.terms.tolist() == terms.tolist()
    for k, view in enumerate((space.digits, space.simplex, space.facet), start=1):
        assert not view.any() and len(view) >= 6
        view[:] = k
    first = (space.doubles_at - address_of(digits)) // 8
    assert not digits[first:].any() and digits[:first].all()
    assert len(digits) - first == S.PLANES_DOUBLES
