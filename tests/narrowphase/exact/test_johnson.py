"""Johnson's subalgorithm in integers, against the nearest point of every subset in Fractions."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction
from itertools import permutations
from types import SimpleNamespace

import numpy as np
import pytest
from digit_numbers import number_at, put_number
from exact_simplex import nearest_to_origin
from naive import rng_of
from reproduction import reproducing

from collide.narrowphase.bounds import EXACT_ERROR
from collide.narrowphase.exact import johnson as J
from collide.narrowphase.exact.exact_workspace import INTEGERS, delta_at, direction_at, gram_at, point_at
from collide.numerics.digits import BITS

pytestmark = pytest.mark.plain_kernels

SOURCE = "points = {points}  # tests/narrowphase/exact/test_johnson.py: Simplex(points)"
#: Digits of a coordinate, and the grid of digit 0.
D, GRID = 3, -2


class Simplex:
    """Integer points in the workspace of the exact stage, their products set."""

    def __init__(self, points):
        self.points = [tuple(map(int, p)) for p in points]
        self.exact = SimpleNamespace(digits=np.zeros(INTEGERS, dtype=np.int64), d=D, grid=GRID)
        for k, point in enumerate(self.points):
            for axis, x in enumerate(point):
                put_number(self.exact.digits, point_at(D, k, axis), D, x)
        for k in range(len(self.points)):
            J.set_gram(self.exact, k)

    def delta(self, mask: int, i: int) -> int:
        return number_at(self.exact.digits, delta_at(D, mask, i), J.length_of(D, mask))


def johnson(points, mask: int, j: int) -> int:
    """Δ_j of a subset, by its definition."""
    rest = [i for i in members(mask) if i != j]
    if not rest:
        return 1
    k = rest[0]
    return sum(
        johnson(points, mask & ~(1 << j), i) * sum(x * (y - z) for x, y, z in zip(points[i], points[k], points[j]))
        for i in rest
    )


def members(mask: int) -> list[int]:
    return [k for k in range(4) if mask >> k & 1]


def random_points(rng, kind: str, n: int) -> np.ndarray:
    if kind == "lattice":
        return rng.integers(-2, 3, size=(n, 3))
    points = rng.integers(-(2**50), 2**50, size=(n, 3))
    if kind == "around the origin":
        points -= points.mean(axis=0).astype(np.int64)
    if kind == "flat":
        points[:, 2] = points[:, 0] - points[:, 1]
    return points


KINDS = ("lattice", "random", "around the origin", "flat")


@pytest.mark.parametrize("kind", KINDS)
def test_products_of_points(kind):
    rng = rng_of("gram", kind)
    for _ in range(20):
        simplex = Simplex(random_points(rng, kind, 4))
        for i in range(4):
            for j in range(4):
                true = sum(x * y for x, y in zip(simplex.points[i], simplex.points[j]))
                assert number_at(simplex.exact.digits, gram_at(D, i, j), 2 * D) == true, simplex.points


@pytest.mark.many(2)
@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize("kind", KINDS)
def test_nearest_subset(kind, n):
    """The subset holds the nearest point strictly inside, at Δ as weights; the direction points to it."""
    rng = rng_of("johnson", kind, n)
    sizes: Counter = Counter()
    for _ in range(60):
        points = random_points(rng, kind, n)
        with reproducing(SOURCE, points=points):
            simplex, true = Simplex(points), nearest_to_origin(points)
            mask = J.nearest_subset(simplex.exact, n, -1)
            chosen = members(mask)
            weights = [simplex.delta(mask, i) for i in chosen]
            total = sum(weights)
            assert chosen and max(chosen) < n and min(weights) > 0
            point = [
                sum(Fraction(w * simplex.points[i][axis], total) for w, i in zip(weights, chosen)) for axis in range(3)
            ]
            assert tuple(point) == true.point
            assert weights == [johnson(simplex.points, mask, i) for i in chosen]
            if mask < 8:
                check_direction(simplex, mask, true)
        sizes[len(chosen)] += 1
    assert len(sizes) >= (min(n, 2) if kind in ("lattice", "random") else 1), sizes


def check_direction(simplex: Simplex, mask: int, true) -> None:
    """`set_direction` reads points 0, 1, 2 where there are three, else the members of the subset."""
    length, zero = J.set_direction(simplex.exact, mask)
    assert zero == (true.square == 0)
    if not zero:
        v = [number_at(simplex.exact.digits, direction_at(D, axis), length) for axis in range(3)]
        ratios = {Fraction(x) / y for x, y in zip(v, true.point) if y}
        assert len(ratios) == 1 and min(ratios) > 0 and all((x == 0) == (y == 0) for x, y in zip(v, true.point))


def test_the_newest_point_is_part_of_the_answer_where_it_helps():
    rng = rng_of("newest")
    helped = 0
    for _ in range(100):
        points = random_points(rng, "random", 3)
        before = nearest_to_origin(points)
        newest = random_points(rng, "random", 1)
        after = nearest_to_origin(np.vstack([points, newest]))
        if after.square < before.square:
            mask = J.nearest_subset(Simplex(np.vstack([points, newest])).exact, 4, 3)
            assert mask & 8 and all((after.weights[k] > 0) == bool(mask >> k & 1) for k in range(4)), points.tolist()
            helped += 1
    assert helped > 20


@pytest.mark.parametrize("kind", KINDS)
def test_reduced_simplices_are_those_made_afresh(kind):
    """Points, products and Δ of what remains are what they would be without the points that were dropped."""
    rng = rng_of("reduce", kind)
    for mask in (3, 5, 6, 9, 12, 7, 11, 14, 15, 8):
        points = random_points(rng, kind, 4)
        simplex, ids = Simplex(points), [10 * k + body for k in range(4) for body in range(2)]
        J.nearest_subset(simplex.exact, 4, -1)
        n = J.reduce_simplex(simplex.exact, ids, mask, 4)
        chosen = members(mask)
        assert n == len(chosen) and ids[: 2 * n] == [10 * k + body for k in chosen for body in range(2)]
        kept = [simplex.points[k] for k in chosen]
        for i in range(n):
            for axis in range(3):
                assert number_at(simplex.exact.digits, point_at(D, i, axis), D) == kept[i][axis]
            for j in range(n):
                true = sum(x * y for x, y in zip(kept[i], kept[j]))
                assert number_at(simplex.exact.digits, gram_at(D, i, j), 2 * D) == true
        if mask != 15:
            for subset in range(1, 1 << n):
                for i in members(subset):
                    assert simplex.delta(subset, i) == johnson(kept, subset, i), (points.tolist(), mask, subset, i)


@pytest.mark.parametrize("kind", ["lattice", "random"])
def test_within_a_radius(kind):
    """|v| ≤ r exactly, and |v| − r to double-double precision, also where it is a rounding away from 0."""
    rng = rng_of("within radius", kind)
    seen: Counter = Counter()
    unit = Fraction(2) ** (BITS * GRID)
    for _ in range(80):
        points = random_points(rng, kind, 3) * (2**45 if kind == "lattice" else 1)
        simplex, true = Simplex(points), nearest_to_origin(points)
        mask = J.nearest_subset(simplex.exact, 3, -1)
        whole = math.isqrt(int(true.square))
        radius = float(int(rng.choice([0, whole // 2, whole, whole + 1])) * unit)  # a number on the grid
        found = J.within_radius(simplex.exact, mask, radius, 0.0)
        with reproducing(SOURCE + "; radius = {radius}", points=points, radius=radius):
            square, r = true.square * unit**2, Fraction(radius)
            assert found.within == (square <= r**2)
            excess = Fraction(found.excess.high) + Fraction(found.excess.low)
            assert (excess <= 0) == found.within
            # (|v| − r)(1 + δ) = excess, put into (|v| − r)(|v| + r) = |v|² − r²
            off = abs((excess + r) ** 2 - square)
            assert off <= 2 * Fraction(EXACT_ERROR) * abs(excess) * (2 * r + abs(excess))
        seen[found.within, radius > 0.0] += 1
    assert min(seen[True, True], seen[False, True]) > 10, seen


def test_orders_of_points_do_not_matter():
    rng = rng_of("orders")
    for _ in range(5):
        points = random_points(rng, "around the origin", 4)
        true = nearest_to_origin(points)
        for order in permutations(range(4)):
            mask = J.nearest_subset(Simplex(points[list(order)]).exact, 4, -1)
            assert {order[k] for k in members(mask)} == {k for k in range(4) if true.weights[k] > 0}
