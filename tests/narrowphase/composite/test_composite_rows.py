"""Rows of parts made one row of bodies: nearest, bracket, certificate and deepest overlaps, by sorting."""

from __future__ import annotations

import math
from collections import Counter

import naive
import numpy as np
import pytest
from naive import random_pose, rng_of

import collide
from collide.kernels import address_of
from collide.narrowphase.composite.composite_rows import (
    MAX_NORMALS,
    SCORE,
    add_row,
    begin_score,
    close_score,
    first_reach_of,
)
from collide.results import PAIR_DTYPE

pytestmark = pytest.mark.plain_kernels


def random_rows(rng, n: int, overlaps: float) -> np.ndarray:
    """Rows as pairs of parts may have them; many distances are the same."""
    rows = np.zeros(n, dtype=PAIR_DTYPE)
    distance = rng.integers(-4, 5, n) / 4 if overlaps else rng.integers(1, 5, n) / 4
    rows["distance"] = distance
    rows["lower"], rows["upper"] = distance - rng.choice([0, 0.125], n), distance + rng.choice([0, 0.125], n)
    rows["hit"], rows["certified"] = distance < 0, rng.random(n) < 0.8
    rows["part_a"], rows["part_b"] = rng.integers(0, 9, (2, n))
    rows["normal"], rows["iterations"] = rng.normal(size=(n, 3)), rng.integers(0, 40, n) | rng.integers(0, 9, n) << 16
    return rows


def combined(rows: np.ndarray, numbers) -> tuple[np.ndarray, np.ndarray, bool]:
    """(row, score, whether the bodies overlap for certain), the rows being added in the order of the numbers."""
    score, out = np.zeros(SCORE + 5), np.zeros(1, dtype=PAIR_DTYPE)
    score[:] = np.nan
    begin_score(score, 5)
    assert first_reach_of(score, 5) == math.inf
    for number in numbers:
        add_row(score, 5, address_of(rows[number : number + 1]), number, address_of(out))
    first = rows[numbers[0]]
    assert first_reach_of(score, 5) == first["lower" if first["beyond"] else "upper"]
    overlap = close_score(score, 5, address_of(out))
    return out[0], score[5:], overlap


@pytest.mark.parametrize("overlaps", [0.0, 1.0])
def test_one_row_of_many(overlaps):
    rng = rng_of("composite rows", overlaps)
    seen: Counter = Counter()
    for _ in range(150):
        rows = random_rows(rng, int(rng.integers(1, 25)), overlaps)
        row, score, overlap = combined(rows, rng.permutation(len(rows)).tolist())
        told = repr(rows.tolist())
        nearest = min(range(len(rows)), key=lambda k: (rows["distance"][k], k))
        for field in ("distance", "normal", "part_a", "part_b", "point_a", "vertices_a", "how"):
            assert np.array_equal(row[field], rows[field][nearest]), (field, told)
        assert row["lower"] == rows["lower"].min() and row["upper"] == rows["upper"].min(), told
        assert row["hit"] == rows["hit"].any() and overlap == (rows["upper"].min() < 0), told
        decisive = rows[rows["lower"] <= row["upper"]]
        assert row["certified"] == decisive["certified"].all(), told
        rounds = rows["iterations"].astype(int)
        assert row["iterations"] == (rounds & 0xFFFF).sum() | (rounds >> 16).sum() << 16, told
        deep = sorted((rows["distance"][k], k) for k in np.flatnonzero(rows["upper"] < 0).tolist())[:MAX_NORMALS]
        kept = score[13:].reshape(MAX_NORMALS, -1)[: len(deep)]
        assert [(d, int(k)) for d, k in kept[:, :2].tolist()] == deep, told
        for overlap_kept, (_, k) in zip(kept, deep):
            assert np.array_equal(overlap_kept[4:7], rows["normal"][k]), told
            assert overlap_kept[2:4].tolist() == [rows["part_a"][k], rows["part_b"][k]], told
        seen["certified", bool(row["certified"])] += 1
        seen["full"] += len(deep) == MAX_NORMALS
    assert min(seen["certified", True], seen["certified", False]) > 20 and seen["full"] >= 20 * overlaps, seen


@pytest.mark.parametrize("numbers", [(0, 1), (1, 0)])
@pytest.mark.parametrize("is_open", [False, True])
def test_bodies_are_beyond_a_limit_where_all_parts_are(numbers, is_open):
    """A pair of huge parts has an open sign, and a distance greater than that of a pair proven to be beyond."""
    rows = np.zeros(2, dtype=PAIR_DTYPE)
    rows["distance"] = rows["lower"] = 5.0, 7.0
    rows["upper"], rows["beyond"], rows["certified"] = math.inf, True, True
    if is_open:
        rows[1]["lower"], rows[1]["upper"] = -1e16, 1e16
        rows[1]["hit"], rows[1]["beyond"], rows[1]["certified"] = True, False, False
    row, _, overlap = combined(rows, numbers)
    assert bool(row["beyond"]) is not is_open and bool(row["hit"]) is is_open and bool(row["certified"]) is not is_open
    assert row["lower"] <= row["distance"] == 5.0 <= row["upper"] and not overlap
    assert (row["upper"] == math.inf) is not is_open


def test_rows_of_bodies_are_those_of_their_pairs_of_parts_asked_alone():
    """Apart, the least of all pairs of parts at their exact poses; together, where any two are."""
    rng = rng_of("pairs of parts")
    seen: Counter = Counter()
    for k in range(60):
        shapes = [[naive.one_of_each(rng)[kind] for kind in rng.choice(KINDS, int(rng.integers(1, 4)))] for _ in "AB"]
        X_WA, X_WB = random_pose(rng, 1.2), random_pose(rng, 1.2)
        items = [[(shape, naive.pose(t=rng.integers(-4, 5, 3) / 4)) for shape in side] for side in shapes]
        if k % 2:  # exact products
            X_WA, X_WB = (naive.pose(t=rng.integers(-9, 10, 3) / 8) for _ in "AB")
        A, B = map(collide.Compound, items)
        with naive.reproducible(naive.Case(A, B, X_WA, X_WB)):
            r = collide.distance(A, B, X_WA, X_WB)
            alone = [collide.distance(a, b, X_WA @ X, X_WB @ Y) for a, X in items[0] for b, Y in items[1]]
            if r.hit:
                assert min(one.lower for one in alone) <= 1e-9 and collide.collide(A, B, X_WA, X_WB)
                # A translation that separates all parts is as long as that of any two.
                assert r.lower <= min(one.upper for one in alone) + 1e-9
            else:
                least = min(alone, key=lambda one: one.distance)
                assert not any(one.hit for one in alone if one.lower < -1e-9)
                assert abs(r.distance - least.distance) <= 1e-9 * (1 + least.distance)
                numbers = [(i, j) for i in range(len(items[0])) for j in range(len(items[1]))]
                assert numbers[alone.index(least)] == (r.part_a, r.part_b)
        seen[r.hit] += 1
    assert min(seen[True], seen[False]) >= 10, seen


KINDS = ("Sphere", "Box", "Capsule", "Cylinder", "Cone", "Ellipsoid", "ConvexHull")
