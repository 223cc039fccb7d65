"""Reduction of a ring of points, against greedy selection written out and against all selections."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from collide.contact.manifold_points import POINT, ManifoldPoints, deepest_point, drop_repeated
from collide.contact.reduce_points import select_points

pytestmark = pytest.mark.plain_kernels


def ring(rng, n: int) -> np.ndarray:
    """(n, 2) corners of a convex polygon, counter-clockwise."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, n))
    return np.stack([np.cos(angles), 0.6 * np.sin(angles)], axis=1)


def manifold(places: np.ndarray, gaps: np.ndarray) -> ManifoldPoints:
    points = np.zeros((len(places), POINT))
    points[:, :2], points[:, 2] = places, gaps
    return ManifoldPoints(points.ravel(), np.arange(2 * len(places)))


def area(p) -> float:
    x, y = p.T
    return 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("max_points", [1, 2, 3, 4, 6, 50])
def test_selection(seed, max_points):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 14))
    places = ring(rng, n)
    first = int(rng.integers(n))
    order = np.zeros(n, dtype=np.int64)
    count = select_points(manifold(places, np.zeros(n)), n, first, max_points, order)
    selected = order[:count].tolist()
    assert count == min(n, max_points) and selected[0] == first and len(set(selected)) == count
    around = [(k - first) % n for k in selected]
    assert around == sorted(around)
    if 2 <= count < n:
        far = max(range(n), key=lambda k: float(np.square(places[k] - places[first]).sum()))
        assert far in selected
    if 3 <= count < n:
        best = max(area(places[list(some)]) for some in itertools.combinations(range(n), count) if first in some)
        assert area(places[selected]) > 0.6 * best


def test_repeated_and_collinear_points_go():
    square = np.array([(0.0, 0), (0.5, 0), (1, 0), (1, 1), (1, 1 + 1e-9), (0, 1), (1e-9, 0)])
    gaps = np.array([0.0, 0, 0, 0, -1e-3, 0, 0])
    points = manifold(square, gaps)
    n = drop_repeated(points, 7, 1e-12, 1e-6)
    kept = points.points.reshape(-1, POINT)[:n]
    assert n == 4 and kept[:, 2].min() == -1e-3  # of two in one place the deeper
    points = manifold(square[:5], np.array([0.0, -1e-3, 0, 0, 0]))
    assert drop_repeated(points, 5, 1e-12, 1e-6) == 4  # a deeper one between two stays


def test_the_deepest_comes_first_and_ties_go_by_place():
    places = np.array([(1.0, 0), (0, 1), (-1, 0), (0, -1)])
    assert deepest_point(manifold(places, np.array([0, -1.0, 0, 0])), 4, 1e-12) == 1
    assert deepest_point(manifold(places, np.zeros(4)), 4, 1e-12) == 2
    assert deepest_point(manifold(places, np.array([0, 0, 1e-13, 0])), 4, 1e-12) == 2
