"""What other searches have proven is taken over, and nothing else: rows stay within their brackets, their points as far
apart as they say."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from naive import rng_of, same_bits

from collide.kernels import address_of
from collide.narrowphase.fallback_searches import lay_points_apart, take_proven
from collide.results import EXACT, FORMULA, PAIR_DTYPE, PLANE, SWEPT, UNDECIDED


def unit_rows(rng, n: int) -> np.ndarray:
    """Rows whose points lie as far apart along the normal as their distance, about 0."""
    rows = np.zeros(n, dtype=PAIR_DTYPE)
    normals = rng.normal(size=(n, 3))
    rows["normal"] = normals / np.linalg.norm(normals, axis=1)[:, None]
    rows["distance"] = rng.normal(size=n)
    rows["lower"], rows["upper"] = rows["distance"] - rng.random(n), rows["distance"] + rng.random(n)
    rows["point_a"] = rng.normal(size=(n, 3))
    rows["point_b"] = rows["point_a"] + rows["distance"][:, None] * rows["normal"]
    rows["iterations"] = rng.integers(0, 100, n)
    return rows


def proven_rows(rng, n: int) -> np.ndarray:
    rows = unit_rows(rng, n)
    rows["how"] = rng.choice([UNDECIDED, PLANE, SWEPT, FORMULA], n)
    gap = rng.random(n) < 0.5
    shift = np.where(gap, 1e-6 - rows["lower"], -rows["upper"] - 1e-6)  # brackets that leave out 0
    for field in ("distance", "lower", "upper"):
        rows[field] += shift
    rows["hit"] = ~gap
    return rows


def expected(row, result, sign: bool, limit: float):
    """The row in Python: (lower, distance, upper, beyond)."""
    lower, upper = float(row["lower"]), float(row["upper"])
    if result["hit"]:
        upper = min(upper, 0.0)
    else:
        lower = max(lower, float(result["lower"]))
        upper = max(upper, lower)
    if lower > limit:
        return lower, lower, np.inf, True
    return lower, min(max(float(row["distance"]), lower), upper), upper, False


@pytest.mark.plain_kernels
@pytest.mark.parametrize("sign", [True, False])
@pytest.mark.parametrize("limit", [0.0, np.inf])
def test_what_is_proven_is_taken(sign, limit):
    rng = rng_of("take proven", sign, limit)
    rows = unit_rows(rng, 400)
    rows["lower"], rows["upper"] = np.minimum(rows["lower"], -1e-9), np.maximum(rows["upper"], 1e-9)
    rows["how"][::3] = EXACT
    before = rows.copy()
    open_rows = np.flatnonzero(rows["how"] == UNDECIDED)
    results = proven_rows(rng, len(open_rows))
    for k, row in enumerate(open_rows.tolist()):
        take_proven(address_of(rows[row : row + 1]), address_of(results[k : k + 1]), sign, limit)
    assert not same_bits(rows[::3], before[::3]), "rows that were decided"
    seen: Counter = Counter()
    for k, result in zip(open_rows.tolist(), results):
        row = rows[k]
        if result["how"] == UNDECIDED:
            assert row == before[k]
            seen["open"] += 1
        elif not sign and not result["hit"]:
            assert row == result, "a gap, with all that is known of one"
            seen["gap"] += 1
        else:
            lower, distance, upper, beyond = expected(before[k], result, sign, limit)
            assert (row["lower"], row["distance"], row["upper"], row["beyond"]) == (lower, distance, upper, beyond)
            assert (row["how"], row["hit"]) == (result["how"], result["hit"])
            assert np.abs(row["point_b"] - row["point_a"] - distance * row["normal"]).max() <= 1e-14
            middles = [r["point_a"] + r["point_b"] for r in (row, before[k])]
            assert np.abs(middles[0] - middles[1]).max() <= 1e-14
            seen["hit" if row["hit"] else "miss"] += 1
    assert seen["open"] >= 20 and seen["hit"] >= 20 and seen["miss" if sign else "gap"] >= 20, seen


def test_points_are_laid_apart():
    """About their middle, only of the rows that are named."""
    rng = rng_of("lay points apart")
    rows = unit_rows(rng, 60)
    before = rows.copy()
    rows["distance"] += rng.normal(size=60)
    moved = np.arange(0, 60, 2)
    lay_points_apart(rows, moved)
    assert not same_bits(rows[1::2], before[1::2], ("point_a", "point_b"))
    apart = rows["point_b"] - rows["point_a"] - rows["distance"][:, None] * rows["normal"]
    assert np.abs(apart[moved]).max() <= 1e-14 < np.abs(apart[1::2]).max()
    middle = rows["point_a"] + rows["point_b"] - before["point_a"] - before["point_b"]
    assert np.abs(middle).max() <= 1e-14
