"""Gaps of cylinders, cones and ellipsoids to the last digits: brackets of 2⁻⁵⁰ of the gap that hold the gap of many
digits."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from curved_oracle import bracket
from touching_pairs import KINDS, OTHERS, TURNS, Pair, body, flattened, scaled

import collide


def pair_apart(rng, *, hard: bool) -> Pair:
    """Bodies apart, some parallel; hard: brought near, needles and coins, other scales, too."""
    while True:
        kinds = [KINDS[rng.integers(3)], (*KINDS, *OTHERS)[rng.integers(10)]]
        rng.shuffle(kinds)
        A, B = (body(kind, rng)[0] for kind in kinds)
        if hard and rng.random() < 0.3:
            A = flattened(A, 2.0 ** int(rng.integers(-12, 13)))
        X_WA, X_WB = (collide.pose(k * rng.normal(size=3), quat_wxyz=rng.normal(size=4)) for k in (1.0, 3.0))
        if rng.random() < 0.3:
            X_WB[:3, :3] = X_WA[:3, :3] @ TURNS[rng.integers(24)]
        r = collide.distance(A, B, X_WA, X_WB)
        if r.hit:
            continue
        if hard:
            X_WB[:3, 3] -= r.distance * r.normal * (1.0 - 10.0 ** -rng.integers(0, 7))
        pair = Pair(A, B, X_WA, X_WB, " ".join(kinds))
        return scaled(pair, 2.0 ** int(rng.integers(-30, 31)) if hard else 1.0)


@pytest.mark.many(3)
@pytest.mark.parametrize(("seed", "hard"), [(seed, hard) for seed in range(6) for hard in (False, True)])
def test_brackets_hold_the_gap_and_are_four_units_wide(seed, hard):
    rng = np.random.default_rng([48, seed, hard])
    n_tight, n = 0, 40
    for _ in range(n):
        pair = pair_apart(rng, hard=hard)
        r = collide.distance(pair.A, pair.B, pair.X_WA, pair.X_WB)
        known = bracket(pair.A, pair.B, pair.X_WA, pair.X_WB, depths=False)
        assert known.lower <= Decimal(r.upper) and Decimal(r.lower) <= known.upper, pair
        assert r.lower <= r.distance <= r.upper and r.certified, pair
        size = max(np.abs(pair.X_WB[:3, 3] - pair.X_WA[:3, 3]).max(), r.distance)
        gap = r.point_b - r.point_a
        assert np.abs(gap - r.distance * r.normal).max() <= 1e-14 * (size + np.abs(r.point_a).max()), pair
        n_tight += r.upper - r.lower <= 2.0**-50 * r.distance
    assert n_tight >= (0.9 if hard else 0.97) * n, n_tight


def test_nearest_points_are_on_the_bodies():
    """A ball over the middle of a cone's side, and over the side of a lying cylinder: points in closed form."""
    cone, ball = collide.Cone(0.75, 1.0), collide.Sphere(0.25)
    normal = np.array([0.8, 0.0, 0.6])
    middle = np.array([0.375, 0.0, 0.0])
    r = collide.distance(cone, ball, np.eye(4), collide.pose(middle + 1.25 * normal))
    assert np.abs(r.normal - normal).max() <= 1e-15 and abs(r.distance - 1.0) <= 4e-16
    assert np.abs(r.point_a - middle).max() <= 1e-15
    can = collide.Cylinder(0.5, 2.0)
    r = collide.distance(can, ball, np.eye(4), collide.pose((3.0, 0.0, 0.625)))
    assert r.lower <= 2.25 <= r.upper and np.abs(r.point_a - (0.5, 0.0, 0.625)).max() <= 1e-15
