"""The dimension of clouds, exactly, and four corners that a hull can begin with."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact_simplex import determinant, exact
from naive import rng_of
from reproduction import reproducing

from collide.hull.first_simplex import APICES, first_simplex
from collide.numerics import orientation as O

pytestmark = pytest.mark.plain_kernels


def begun(points: np.ndarray) -> tuple[int, list[int], list[float]]:
    """(dimension, corners, the points with the apices behind them)."""
    n = len(points)
    originals = [*points.ravel().tolist(), *[0.0] * (3 * APICES)]
    scaled, work, digits, corners = [0.0] * len(originals), [0.0] * O.WORK, [0] * O.DIGITS, [0] * 4
    cloud = O.CloudView(scaled, originals, work, digits, 0, O.survey(originals, scaled, n, work))
    return first_simplex(cloud, n, corners), corners, originals


def rank(points) -> int:
    """Of the differences from the first point, by elimination in Fractions."""
    rows = [[x - y for x, y in zip(p, exact(points)[0])] for p in exact(points)[1:]]
    found = 0
    for column in range(3):
        pivot = next((row for row in rows if row[column]), None)
        if pivot is not None:
            rows = [
                [x - row[column] / pivot[column] * y for x, y in zip(row, pivot)] for row in rows if row is not pivot
            ]
            found += 1
    return found


def cloud(rng, kind: str) -> np.ndarray:
    n = int(rng.integers(1, 12))
    if kind == "lattice":
        return rng.integers(-1, 2, size=(n, 3)) * 1.0
    if kind == "repeated":
        return np.repeat(rng.normal(size=(1, 3)), n, axis=0)
    if kind == "line":
        return np.outer(rng.integers(-4, 5, n), rng.integers(-3, 4, 3)) * 0.1 * 8
    if kind == "line but for an ulp":
        points = np.outer(rng.integers(-4, 5, n) * 1.0, [1.0, 2.0, -1.0])
        points[-1, 1] = np.nextafter(points[-1, 1], 9.0)
        return points
    if kind == "plane but for the least double":
        points = rng.normal(size=(n, 3)) * (1.0, 1.0, 0.0)
        points[-1, 2] = 5e-324
        return points
    return rng.normal(size=(n, 3)) * 10.0 ** rng.integers(-200, 200)


@pytest.mark.parametrize(
    "kind", ["lattice", "repeated", "line", "line but for an ulp", "plane but for the least double", "random"]
)
def test_dimensions(kind):
    rng = rng_of("first simplex", kind)
    seen: Counter = Counter()
    for _ in range(60):
        points = cloud(rng, kind)
        with reproducing("points = {points}  # tests/hull/test_first_simplex.py: begun(points)", points=points):
            dimension, corners, originals = begun(points)
            assert dimension == rank(points)
            used = corners[: dimension + 1]
            assert len(set(used)) == dimension + 1 or dimension == 0
            assert max(used) < len(points) and rank(points[used]) == dimension
            if dimension >= 2:  # the fourth lies below: one of the cloud, or of the points behind a flat one
                assert (corners[3] >= len(points)) == (dimension == 2)
                a, b, c, d = ([Fraction(x) for x in originals[3 * k : 3 * k + 3]] for k in corners)
                assert determinant(*([x - y for x, y in zip(p, a)] for p in (d, b, c))) < 0
        seen[dimension] += 1
    wanted = {
        "lattice": 3,
        "repeated": 0,
        "line": 1,
        "line but for an ulp": 2,
        "plane but for the least double": 3,
        "random": 3,
    }
    assert seen[wanted[kind]] >= 10, seen
