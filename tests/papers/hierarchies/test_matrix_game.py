"""Two small polyhedra by the value of a game: witnesses of either outcome hold, values are scipy's."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from naive import rng_of
from scipy.optimize import linprog

from collide.papers.hierarchies.matrix_game import APART, DEEP, LABELS, MEET, TABLEAU, solve_game

pytestmark = pytest.mark.plain_kernels


def value_of(P, Q) -> float:
    """min over the hull of P of the largest product with a point of Q."""
    n, m = len(P), len(Q)
    program = linprog(
        [*np.zeros(n), 1.0],
        A_ub=np.c_[Q @ P.T, -np.ones(m)],
        b_ub=np.zeros(m),
        A_eq=[[*np.ones(n), 0.0]],
        b_eq=[1.0],
        bounds=[(0, None)] * n + [(None, None)],
    )
    assert program.success
    return program.fun


def play(P, Q):
    table, labels = np.zeros(TABLEAU), np.zeros(LABELS, dtype=np.int64)
    x, z = np.zeros(len(P)), np.zeros(len(Q))
    outcome, _, tests = solve_game(P.ravel(), len(P), Q.ravel(), len(Q), table, labels, x, z)
    assert tests == len(P) * len(Q)
    return outcome, x, z


def test_outcomes_and_witnesses():
    rng = rng_of("matrix game")
    seen: Counter = Counter()
    for k in range(150):
        P = rng.normal(size=(rng.integers(1, 14), 3)) * 0.5 + rng.normal(size=3) * rng.choice([0.3, 1.0, 2.0])
        Q = rng.normal(size=(rng.integers(4, 14), 3)) + rng.normal(size=3) * 0.3
        if k % 3 == 0:  # ties
            P, Q = np.rint(2 * P) / 2, np.rint(2 * Q) / 2
        outcome, x, z = play(P, Q)
        value = value_of(P, Q)
        told = f"P, Q = {P.tolist()}, {Q.tolist()}: value {value}"
        assert outcome in (MEET, APART), told
        assert outcome == (MEET if value <= 1 else APART) or abs(value - 1) < 1e-9, told
        weights = x if outcome == MEET else z
        assert weights.min() >= 0.0 and weights.sum() == pytest.approx(1.0, abs=1e-12), told
        if outcome == MEET:
            reached = (Q @ (x @ P)).max()
            assert reached <= max(DEEP, value) + 1e-9, told
            seen["pivoted"] += value > DEEP
        else:
            assert (P @ (z @ Q)).min() == pytest.approx(value, abs=1e-9), told
        seen[outcome] += 1
    assert min(seen[MEET], seen[APART]) > 30 and seen["pivoted"] > 10, seen
