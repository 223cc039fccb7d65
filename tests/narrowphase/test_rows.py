"""Rows as kernels write them: every field where numpy reads it, and verdicts that promise what bounds.py says."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from naive import rng_of
from reproduction import reproducing

from collide.kernels import address_of
from collide.narrowphase import rows as R
from collide.narrowphase.bounds import PROMISE_DEPTH, PROMISE_GAP
from collide.numerics.vec3 import Vec3
from collide.results import HOW, PAIR_DTYPE, REFUSED, UNDECIDED

pytestmark = pytest.mark.plain_kernels


def empty() -> tuple[np.ndarray, R.Row]:
    rows = np.zeros(1, dtype=PAIR_DTYPE)
    rows.view(np.uint8)[:] = 0xA5  # whatever stood there
    return rows, R.view_row(address_of(rows))


def test_places_of_fields():
    for name, at in {"distance": R.DISTANCE, "lower": R.LOWER, "upper": R.UPPER, "normal": R.NORMAL,
                     "point_a": R.POINT_A, "point_b": R.POINT_B}.items():
        rows, row = empty()
        row.doubles[at] = 0.25
        assert np.ravel(rows[name])[0] == 0.25
    for name, at in {"b": R.BODY_B, "part_a": R.PART_A, "part_b": R.PART_B, "vertices_a": R.VERTICES_A,
                     "vertices_b": R.VERTICES_B, "iterations": R.ITERATIONS}.items():
        rows, row = empty()
        row.words[at] = -7
        assert np.ravel(rows[name])[0] == -7
    for name, at in {"count": R.COUNT, "how": R.HOW, "exact": R.EXACT_ROUNDS, "hit": R.HIT,
                     "certified": R.CERTIFIED, "beyond": R.BEYOND}.items():
        rows = np.zeros(1, dtype=PAIR_DTYPE)
        R.view_row(address_of(rows)).flags[at] = 1
        assert rows[name][0] == 1 and rows.tobytes().count(1) == 1


@pytest.mark.parametrize("flip", [False, True])
def test_vectors_and_vertices(flip):
    """Of the bodies as asked: exchanged ones get their own, and a normal from A to B that is never −0."""
    rows, row = empty()
    row = R.blank_row(address_of(rows))
    assert (rows["vertices_a"] == -1).all() and (rows["vertices_b"] == -1).all() and row.flags[R.COUNT] == 0
    R.write_vectors(row, Vec3(0.0, -0.6, 0.8), Vec3(1.0, 2.0, 3.0), Vec3(4.0, 5.0, 6.0), flip)
    R.write_vertices(row, [10, 20, 11, 21, 12, 22, 13, 23], 3, flip)
    first, second = ("b", "a") if flip else ("a", "b")
    assert rows["normal"][0].tolist() == ([0.0, 0.6, -0.8] if flip else [0.0, -0.6, 0.8])
    assert not np.signbit(rows["normal"][0][0])
    assert rows[f"point_{first}"].tolist() == [[1, 2, 3]] and rows[f"point_{second}"].tolist() == [[4, 5, 6]]
    assert rows[f"vertices_{first}"].tolist() == [[10, 11, 12, -1]]
    assert rows[f"vertices_{second}"].tolist() == [[20, 21, 22, -1]] and row.flags[R.COUNT] == 3


def test_verdicts():
    """A distance within its bracket, a hit unless a gap is proven, a promise only where the bracket is as narrow."""
    rng = rng_of("verdicts")
    seen: Counter = Counter()
    for _ in range(1000):
        distance = float(rng.choice([0.0, 5e-324, 1e-9, 1.0, 1e6]) * rng.choice([-1, 1]))
        wide = float(rng.choice([0.0, 2.0**-52, 2.0**-51, 1e-13, 1e-6, 2.0])) * abs(distance)
        lower, upper = distance - wide * rng.random(), distance + wide * rng.random()
        distance += float(rng.choice([0.0, 2.0**-52])) * distance
        limit, width = float(rng.choice([0.0, 1e-3, math.inf])), float(rng.choice([0.0, 1e-3, math.inf]))
        values = distance, lower, upper, 3, width, limit
        with reproducing("write_verdict(row, *{values})", values=values):
            rows, row = empty()
            rows["how"] = 0
            R.write_verdict(row, *values)
            r = rows[0]
            beyond, decided = lower > limit, lower > 0.0 or upper <= 0.0
            assert r["beyond"] == beyond and r["hit"] == (not lower > 0.0)
            assert r["how"] == (3 if decided else UNDECIDED) and R.is_undecided(row) == (not decided)
            assert R.is_undecided_or_refused(row) == (not decided)
            assert r["lower"] == lower and r["upper"] == (math.inf if beyond else upper)
            assert r["lower"] <= r["distance"] <= r["upper"] and (not beyond or r["distance"] == lower)
            assert not (r["distance"] == 0.0 and np.signbit(r["distance"]))
            held = min(max(distance, lower), upper)
            promise = max(width, (PROMISE_GAP if held > 0 else PROMISE_DEPTH) * abs(held), 2e-323 * (held != 0))
            assert r["certified"] == (beyond or (decided and upper - lower <= promise))
            R.write_decision(row, distance, lower, upper, 4, limit)
            assert r["certified"] and r["how"] == 4 and r["beyond"] == beyond and r["hit"] == (not lower > 0.0)
            assert (r["lower"], r["upper"]) == (lower, math.inf if beyond else upper)
            assert r["lower"] <= r["distance"] <= r["upper"]
        seen[beyond, decided] += 1
    assert min(seen[True, True], seen[False, True], seen[False, False]) >= 40, seen
    row.flags[R.HOW] = REFUSED
    assert R.is_undecided_or_refused(row) and not R.is_undecided(row) and len(HOW) < REFUSED
