"""Half-spaces against swept hulls an ulp or so from touching: decided exactly, with the gap to the last digits."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

import collide
from collide.results import EXACT


def _cofactors(R):
    return [
        [
            R[(i + 1) % 3][(j + 1) % 3] * R[(i + 2) % 3][(j + 2) % 3]
            - R[(i + 1) % 3][(j + 2) % 3] * R[(i + 2) % 3][(j + 1) % 3]
            for j in range(3)
        ]
        for i in range(3)
    ]


def _heights(normal, offset, X, points, Y):
    """(s of every vertex, |n|²) in Fractions: s = n·(x − p) − b·det R with n = cof(R) m."""
    R = [[Fraction(v) for v in row[:3]] for row in X[:3].tolist()]
    cofactor = _cofactors(R)
    n = [sum(c * Fraction(m) for c, m in zip(row, normal)) for row in cofactor]
    constant = Fraction(offset) * sum(a * b for a, b in zip(R[0], cofactor[0]))
    heights = []
    for point in points.tolist():
        x = [sum(Fraction(Y[i, j]) * Fraction(point[j]) for j in range(3)) + Fraction(Y[i, 3]) for i in range(3)]
        heights.append(sum(n[i] * (x[i] - Fraction(X[i, 3])) for i in range(3)) - constant)
    return heights, sum(c * c for c in n)


def _random_pose(rng):
    if rng.random() < 0.6:
        return collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))
    return collide.pose(np.round(rng.normal(size=3) * 4) / 4)


def test_half_spaces_are_decided_exactly():
    rng = np.random.default_rng(1)
    hits = 0
    for case in range(400):
        points = rng.normal(size=(int(rng.integers(1, 12)), 3))
        if rng.random() < 0.5:
            points = np.round(points * 4) / 4
        radius = float(rng.choice([0.0, 0.0, 0.5, rng.uniform(0.1, 1)]))
        normal = rng.normal(size=3) if rng.random() < 0.5 else np.array([0.0, 0.0, 1.0])
        offset = float(rng.choice([0.0, 0.5, rng.normal()]))
        X, Y = _random_pose(rng), _random_pose(rng)
        half, body = collide.Halfspace(normal, offset), collide.ConvexHull(points, radius=radius)
        first = collide.distance(half, body, X, Y)
        Y[:3, 3] -= first.distance * first.normal * rng.choice([1.0, 1.0, 1.0 + 1e-15])
        r = collide.distance(half, body, X, Y)
        heights, square = _heights(normal, offset, X, points, Y)
        hit = any(s <= 0 or s * s <= Fraction(radius) ** 2 * square for s in heights)
        snippet = (
            f"case {case}: collide.distance(collide.Halfspace({normal.tolist()}, {offset}), "
            f"collide.ConvexHull({points.tolist()}, radius={radius}), np.array({X.tolist()}), np.array({Y.tolist()}))"
        )
        assert r.hit == hit and r.how == EXACT, snippet
        assert collide.collide(half, body, X, Y) == hit, snippet
        if not hit:
            # distance + r = s/|n|, squared to stay rational.
            near, reach = min(heights) ** 2, Fraction(radius)
            low, high = Fraction(r.lower) + reach, Fraction(r.upper) + reach
            assert low**2 * square <= near <= high**2 * square, snippet
            assert r.upper - r.lower <= 1e-13 * r.distance, snippet
        collide.verify(half, body, X, Y, r)
        hits += hit
    assert 0.3 < hits / 400 < 0.7, hits
