"""Depths of cylinders, cones and ellipsoids to the last digits: brackets of 1e-12 of the depth that hold the depth of
many digits, from a ball within a body or from EPA's surface and the bend of the bodies."""

from __future__ import annotations

import math
from decimal import Decimal

import numpy as np
import pytest
from curved_oracle import bracket
from touching_pairs import KINDS, OTHERS, TURNS, Pair, body, flattened, scaled

import collide


def overlapping_pair(rng, *, hard: bool) -> Pair:
    """Bodies that overlap, by 1e-6 to about their size, some parallel; hard: needles and coins, other scales, too."""
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
        if not r.hit:
            X_WB[:3, 3] -= r.normal * (r.distance + 10.0 ** rng.uniform(-6.0 if hard else -2.0, 0.3))
        pair = scaled(Pair(A, B, X_WA, X_WB, " ".join(kinds)), 2.0 ** int(rng.integers(-30, 31)) if hard else 1.0)
        if collide.distance(pair.A, pair.B, pair.X_WA, pair.X_WB).distance < 0.0:
            return pair


@pytest.mark.many(6)
@pytest.mark.parametrize(("seed", "hard"), [(seed, hard) for seed in range(6) for hard in (False, True)])
def test_brackets_hold_the_depth_and_are_narrow(seed, hard):
    rng = np.random.default_rng([46, seed, hard])
    n_narrow, n = 0, 60
    for _ in range(n):
        pair = overlapping_pair(rng, hard=hard)
        r = collide.distance(pair.A, pair.B, pair.X_WA, pair.X_WB)
        known = bracket(pair.A, pair.B, pair.X_WA, pair.X_WB)
        assert known.lower <= Decimal(r.upper) and Decimal(r.lower) <= known.upper, pair
        assert r.lower <= r.distance <= r.upper, pair
        is_narrow = r.upper - r.lower <= -1e-12 * r.distance
        if is_narrow:
            size = np.abs(pair.X_WB[:3, 3] - pair.X_WA[:3, 3]).max() + np.abs(r.point_a).max() - r.distance
            missed = r.point_b - r.point_a - r.distance * r.normal
            assert np.abs(missed).max() <= 1e-14 * size, pair
        n_narrow += is_narrow
    assert n_narrow >= (0.94 if hard else 0.97) * n, n_narrow


def test_depths_of_resting_cans_in_closed_form():
    """A can 1/16 deep in a box; crossed cans; an ellipsoid's tip in a face: known to the last digit."""
    can, box = collide.Cylinder(0.25, 1.0), collide.Box((4.0, 4.0, 1.0))
    r = collide.distance(box, can, np.eye(4), collide.pose((0.3, 0.1, 0.9375)))
    assert r.lower <= -0.0625 <= r.upper and r.upper - r.lower <= 2e-16 and np.array_equal(r.normal, (0, 0, 1))
    lying = collide.pose((0.0, 0.0, 0.4375), rpy=(math.pi / 2, 0, 0))
    r = collide.distance(can, can, collide.pose(rpy=(0, math.pi / 2, 0)), lying)
    assert r.lower <= -0.0625 <= r.upper and r.upper - r.lower <= 1e-15
    assert np.abs(r.normal - (0, 0, 1)).max() <= 1e-15
    r = collide.distance(box, collide.Ellipsoid((0.25, 0.5, 0.75)), np.eye(4), collide.pose((0.3, 0.1, 1.125)))
    assert r.lower <= -0.125 <= r.upper and r.upper - r.lower <= 4e-16


def test_a_depth_along_a_circle_of_directions_is_as_narrow():
    """A ball on the axis of a cone, as deep along each normal of the side: from a ball within."""
    cone = collide.Cone(0.75, 1.0)
    r = collide.distance(cone, collide.Sphere(0.125), np.eye(4), collide.pose((0.0, 0.0, -0.05)))
    depth = 0.55 * 0.6 + 0.125  # from a point on the axis to the side, sin of half the opening 3/5
    assert r.lower <= -depth <= r.upper and r.upper - r.lower <= 1e-15


@pytest.mark.parametrize("kind", KINDS)
def test_heights_over_a_half_space_are_known_to_the_last_digit(kind):
    """Gaps and depths, of needles and coins, too, with normals of any length."""
    rng = np.random.default_rng([48, KINDS.index(kind)])
    n = 60
    for _ in range(n):
        plane = collide.Halfspace(rng.normal(size=3) * 10.0 ** rng.uniform(-2, 2), rng.normal())
        B = flattened(body(kind, rng)[0], 2.0 ** int(rng.integers(-12, 13)))
        X_WA, X_WB = (collide.pose(rng.normal(size=3), quat_wxyz=rng.normal(size=4)) for _ in range(2))
        r = collide.distance(plane, B, X_WA, X_WB)
        X_WB[:3, 3] -= r.normal * (r.distance + rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-6, 0))
        r = collide.distance(plane, B, X_WA, X_WB)
        known = bracket(plane, B, X_WA, X_WB)
        assert known.lower <= Decimal(r.upper) and Decimal(r.lower) <= known.upper, (plane, B, X_WA, X_WB)
        assert r.upper - r.lower <= 2.0**-50 * abs(r.distance), (plane, B, X_WA, X_WB)


@pytest.mark.parametrize("radius", [1e-9, 1e-3, 0.3])
def test_radii_are_added_with_their_rounding(radius):
    """A bracket of neighbouring doubles has to hold the sum of the core's depth and of radii much smaller."""
    rng = np.random.default_rng(7)
    n_narrow = 0
    for _ in range(40):
        hull = collide.ConvexHull(rng.normal(size=(8, 3)), radius=radius)
        cone = collide.Cone(rng.uniform(0.5, 1.0), rng.uniform(0.5, 1.5))
        X_WA, X_WB = (collide.pose(0.3 * rng.normal(size=3), quat_wxyz=rng.normal(size=4)) for _ in range(2))
        r = collide.distance(hull, cone, X_WA, X_WB)
        known = bracket(hull, cone, X_WA, X_WB)
        assert known.lower <= Decimal(r.upper) and Decimal(r.lower) <= known.upper, (hull, cone, X_WA, X_WB)
        n_narrow += r.distance < 0.0 and r.upper - r.lower <= -1e-12 * r.distance
    assert n_narrow >= 36
