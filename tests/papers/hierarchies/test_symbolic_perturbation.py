"""Sides of planes without ties, against points that are moved in earnest by ever smaller fractions."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from half_edge_surface import view_of
from naive import rng_of
from naive_triangles import cross, inner, minus

from collide.papers.hierarchies.symbolic_perturbation import CENTRES, exact_side, rank_of, side
from collide.papers.hierarchies.true_facets import Cloud

pytestmark = pytest.mark.plain_kernels


def moved(cloud: Cloud) -> list[list[Fraction]]:
    """Every point by e·(centre k − x) for every centre, the e as far apart as the rule says: squares are below all."""
    points = [[Fraction(x) for x in row] for row in cloud.originals.tolist()]
    centres = points[cloud.count : cloud.count + CENTRES]
    places = sorted(range(cloud.count), key=rank_of, reverse=True)
    size = CENTRES * cloud.count
    steps = {(k, i): size + k * cloud.count + place for k in range(CENTRES) for place, i in enumerate(places)}
    result = []
    for i in range(cloud.count):
        point = points[i]
        for k, centre in enumerate(centres):
            e = Fraction(1, 2 ** (40 * steps[k, i]))
            point = [x + e * (c - x0) for x, c, x0 in zip(point, centre, points[i])]
        result.append(point)
    return result


def sign_of(points, a, b, c, d) -> int:
    value = inner(cross(minus(points[b], points[a]), minus(points[c], points[a])), minus(points[d], points[a]))
    return (value > 0) - (value < 0)


def test_sides_are_those_of_points_moved_in_earnest():
    rng = rng_of("symbolic perturbation")
    seen: Counter = Counter()
    for _ in range(12):
        points = np.unique(rng.integers(0, 3, (9, 3)), axis=0).astype(float)
        cloud = Cloud(points)
        view, exact = view_of(cloud), [[Fraction(x) for x in p] for p in points.tolist()]
        perturbed = moved(cloud)
        for _ in range(40):
            a, b, c, d = rng.permutation(len(points))[:4].tolist()
            told = f"points = {points.tolist()}; {a, b, c, d}"
            assert exact_side(view, a, b, c, d) == sign_of(exact, a, b, c, d), told
            found = side(view, a, b, c, d)
            if found:
                assert found == sign_of(perturbed, a, b, c, d), told
            in_line = all(cross(minus(exact[b], exact[a]), minus(exact[x], exact[a])) == [0, 0, 0] for x in (c, d))
            assert (found == 0) == in_line, told
            seen["tie", found] += exact_side(view, a, b, c, d) == 0
    assert min(seen["tie", 1], seen["tie", -1]) > 20, seen


def test_swapping_two_points_swaps_the_side():
    rng = rng_of("antisymmetric sides")
    points = np.unique(rng.integers(0, 3, (14, 3)), axis=0).astype(float)
    view = view_of(Cloud(points))
    for _ in range(20):
        four = rng.permutation(len(points))[:4].tolist()
        first = side(view, *four)
        for order in permutations(range(4)):
            parity = round(np.linalg.det(np.eye(4)[list(order)]))
            assert side(view, *(four[k] for k in order)) == parity * first, (points.tolist(), four, order)


def test_ranks_are_distinct_and_mixed():
    ranks = [rank_of(i) for i in range(3000)]
    assert len(set(ranks)) == 3000 and max(ranks) < 2**60
    assert abs(np.corrcoef(ranks, range(3000))[0, 1]) < 0.1
