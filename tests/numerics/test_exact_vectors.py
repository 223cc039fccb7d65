"""Products and determinants of exact numbers are those of their definitions."""

from __future__ import annotations

from fractions import Fraction
from itertools import permutations
from math import prod

import numpy as np
import pytest

from collide.numerics.exact_vectors import cross, determinant, dot, inner, minus


def by_permutations(rows: list[list[int]]) -> int:
    """Leibniz: the signed sum of the products of all permutations."""
    total = 0
    for order in permutations(range(len(rows))):
        flips = sum(order[i] > order[j] for i in range(len(rows)) for j in range(i + 1, len(rows)))
        total += (-1) ** flips * prod(rows[i][k] for i, k in enumerate(order))
    return total


@pytest.mark.parametrize("n", range(7))
def test_determinants_are_the_sums_of_their_permutations(n):
    rng = np.random.default_rng(n)
    singular = 0
    for case in range(60):
        digits = int(rng.choice([1, 2, 40, 300]))
        rows = [[int(x) ** (1 if digits < 3 else digits) for x in row] for row in rng.integers(-3, 4, (n, n))]
        if case % 3 == 0 and n > 1:  # rows that depend on each other, and a zero where the pivot would be
            rows[-1] = [2 * x - y for x, y in zip(rows[0], rows[n // 2])]
            rows[0][0] = 0
        given, wanted = [list(row) for row in rows], by_permutations(rows)
        assert determinant(rows) == wanted, f"determinant({rows})"
        assert rows == given, "what was given is left as it is"
        singular += wanted == 0
    assert n < 2 or 3 <= singular < 57


@pytest.mark.parametrize("number", [int, lambda x: Fraction(int(x), 7)])
def test_products_of_vectors(number):
    rng = np.random.default_rng(3)
    for _ in range(200):
        a, b, c = (tuple(map(number, row)) for row in rng.integers(-(10**6), 10**6, (3, 3)))
        assert inner(a, b) == dot(a, b) == sum(a[k] * b[k] for k in range(3)) and dot(a, b, 2) == dot(a[:2], b[:2])
        assert minus(a, b) == tuple(a[k] - b[k] for k in range(3))
        n = cross(a, b)
        assert inner(n, a) == inner(n, b) == 0 and inner(n, n) == inner(a, a) * inner(b, b) - inner(a, b) ** 2
        rows = [[int(7 * x) for x in row] for row in (a, b, c)]
        assert 343 * inner(n, c) == determinant(rows), f"a, b, c = {a}, {b}, {c}"
