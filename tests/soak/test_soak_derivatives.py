"""Some pairs of the soak of derivatives, and that it notices wrong ones."""

from __future__ import annotations

import numpy as np
import pytest
import soak_derivatives

import collide


@pytest.mark.slow
def test_derivatives_of_all_families_are_right():
    told: list[str] = []
    tally = soak_derivatives.soak(6, range(600), say=told.append)
    assert not told, "\n".join(told)
    assert set(tally) == set(soak_derivatives.FAMILIES)
    assert all(count["slope"] >= 60 and 10 <= count["hits"] <= 110 for count in tally.values())
    assert sum(count["kink"] for count in tally.values()) >= 5


def test_a_wrong_derivative_is_noticed():
    family, A, B, X_WA, X_WB = soak_derivatives.pair_of(6, 0)
    r = collide.distance(A, B, X_WA, X_WB, derivatives=True)
    rng = lambda: np.random.default_rng(1)
    what, off = soak_derivatives.judge(rng(), A, B, X_WA, X_WB, r)
    assert family == "random" and r.unique and what == "slope" and off <= soak_derivatives.ENOUGH
    r._derived.numbers[0, 2] += 1e-4
    assert soak_derivatives.judge(rng(), A, B, X_WA, X_WB, r)[1] > soak_derivatives.ENOUGH
