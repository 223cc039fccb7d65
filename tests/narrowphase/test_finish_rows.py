"""The last touch to rows of a pair query, against the same in numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive import rng_of

from collide.kernels import address_of
from collide.narrowphase.finish_rows import finish_rows
from collide.results import HOW, PAIR_DTYPE, UNDECIDED


def random_rows(rng, n: int, unbounded: bool) -> np.ndarray:
    rows = np.zeros(n, dtype=PAIR_DTYPE)
    for field in ("distance", "lower", "upper", "normal", "point_a", "point_b"):
        rows[field] = rng.normal(size=rows[field].shape)
    rows["hit"] = rng.random(n) < 0.5
    rows["how"] = rng.integers(0, len(HOW), n)
    rows["certified"] = rng.random(n) < 0.5
    if unbounded:
        rows["distance"][rng.integers(n)] = -math.inf
    return rows


def closed(rows: np.ndarray, depths: bool) -> tuple[np.ndarray, bool]:
    """Overlaps become distance 0 at a common point, unless depths are wanted; an open sign keeps its upper bound."""
    rows = rows.copy()
    rows["b"] = 1
    if not depths:
        rows["lower"] = np.maximum(rows["lower"], 0.0)
        hit, open_sign = rows["hit"] != 0, rows["how"] == UNDECIDED
        rows["distance"][hit], rows["normal"][hit] = 0.0, 0.0
        rows["point_a"][hit] = rows["point_b"][hit] = 0.5 * (rows["point_a"][hit] + rows["point_b"][hit])
        rows["upper"][hit & ~open_sign], rows["certified"][hit & ~open_sign] = 0.0, True
        rows["certified"][hit & open_sign] = False
    return rows, bool((rows["distance"] == -math.inf).any())


@pytest.mark.parametrize("depths", [True, False])
@pytest.mark.parametrize("unbounded", [True, False])
def test_rows_are_closed(depths, unbounded):
    rng = rng_of("close rows", depths, unbounded)
    for n in (1, 2, 9, 100):
        rows = random_rows(rng, n, unbounded)
        wanted, without_end = closed(rows, depths)
        found = rows.copy()
        assert bool(finish_rows(address_of(found), n, depths)) == without_end
        assert found.tobytes() == wanted.tobytes(), rows


def test_no_rows_are_fine():
    rows = np.zeros(1, dtype=PAIR_DTYPE)
    assert not finish_rows(address_of(rows), 0, False) and rows["b"][0] == 0
