"""Cylinders, cones and ellipsoids that touch, or miss by an ulp: the sign is decided, and it is right.

Pairs that touch exactly are made so (`touching_pairs.py`); of the others decimals of 80 digits tell the sign.
"""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from curved_oracle import bracket
from touching_pairs import Pair, exact_pair, near_pair

import collide

#: Seeds of the many cases of a function, and how many pairs each has.
SEEDS, EACH = range(12), 25


def answered(pair: Pair):
    """The row of a pair, after all ways in were found to agree."""
    r = collide.distance(pair.A, pair.B, pair.X_WA, pair.X_WB)
    assert r.how != 0, f"open:\n{pair}"
    assert collide.collide(pair.A, pair.B, pair.X_WA, pair.X_WB) == r.hit, pair
    swapped = collide.distance(pair.B, pair.A, pair.X_WB, pair.X_WA)
    assert (swapped.hit, swapped.distance, swapped.lower, swapped.upper) == (r.hit, r.distance, r.lower, r.upper), pair
    batch = collide.distance(pair.A, pair.B, np.stack([pair.X_WA] * 2), np.stack([pair.X_WB] * 2))
    assert batch.rows["lower"].tolist() == [r.lower] * 2 and batch.hit.tolist() == [r.hit] * 2, pair
    assert r.lower <= r.distance <= r.upper and r.certified, pair
    return r


@pytest.mark.many(4)
@pytest.mark.parametrize("seed", SEEDS)
def test_surfaces_that_share_a_point_touch(seed):
    rng = np.random.default_rng([46, seed])
    exact = 0
    for _ in range(EACH):
        scale = 2.0 ** int(rng.integers(-30, 31)) if rng.random() < 0.3 else 1.0
        pair = exact_pair(rng, scale, 1.0 + 2.0**-40 if rng.random() < 0.2 else 1.0)
        r = answered(pair)
        assert r.hit, f"touches, but apart by {r.lower}:\n{pair}"
        exact += r.lower == r.upper == 0.0
    assert exact >= 0.9 * EACH


@pytest.mark.many(12)
@pytest.mark.parametrize("seed", SEEDS)
def test_an_ulp_beside_a_touch_is_told(seed):
    rng = np.random.default_rng([47, seed])
    told = 0
    for k in range(EACH):
        if k % 2:
            pair = near_pair(rng, 2.0 ** int(rng.integers(-30, 31)) if rng.random() < 0.3 else 1.0)
        else:
            pair = exact_pair(rng)
            aside = np.where(rng.random(3) < 0.5, -np.inf, np.inf)
            pair.X_WB[:3, 3] = np.nextafter(pair.X_WB[:3, 3], aside)
        r = answered(pair)
        known = bracket(pair.A, pair.B, pair.X_WA, pair.X_WB, depths=False)
        assert known.hit in (None, r.hit), f"hit is {r.hit}, the distance {known.lower} to {known.upper}:\n{pair}"
        assert known.lower <= Decimal(r.upper) and Decimal(r.lower) <= known.upper, pair
        told += known.hit is not None
    assert told >= 0.6 * EACH


def test_a_rim_that_touches_beside_the_table_is_apart():
    """A can that leans by 2⁻⁴⁰: its middle is above the table, its lowest point above the table's plane, and beside."""
    lean = 2.0**-40
    R = np.array([[1.0, 0.0, lean], [0.0, 1.0, 0.0], [-lean, 0.0, 1.0]])
    X = np.eye(4)
    X[:3, :3] = R
    X[:3, 3] = 0.9375, 0.0, 1.5 + lean * 0.25  # the lowest point at z = 1 and x = 1.1875, the table ends at x = 1
    can, table = collide.Cylinder(0.25, 1.0), collide.Box((2.0, 2.0, 2.0))
    r = collide.distance(can, table, X, np.eye(4))
    known = bracket(can, table, X, np.eye(4), depths=False)
    assert known.hit is False and not r.hit and r.lower > 0.0 and r.how != 0
    assert float(known.lower) <= r.upper and r.lower <= float(known.upper)


def test_three_equal_contacts_along_a_curve_are_found():
    """A rim and a cone that touch to the fourth order: the pencil of both conics has a double line."""
    s = 1.0000000000009095
    X_WA = np.array([[-s, 0, 0, -1.25], [0, s, 0, 1.8125], [0, 0, -s, -0.0625], [0, 0, 0, 1]])
    X_WB = np.array(
        [[0, -s, 0, -1.25], [0, 0, -s, 2.4218750000005542], [s, 0, 0, -0.6875000000005684], [0, 0, 0, 1]]
    )
    r = collide.distance(collide.Cone(0.9375, 1.25), collide.Cylinder(0.3125, 0.75), X_WA, X_WB)
    assert r.hit and r.how == collide.results.EXACT and r.lower == r.upper == 0.0


def test_a_rim_an_ulp_from_the_tip_of_a_long_ellipsoid_is_settled():
    """The search gains a digit in ten supports here, and gave up after 160."""
    X_WA = np.array([[0, 1, 0, 1.0625], [0, 0, -1, 0.4375], [-1, 0, 0, -2.8125], [0, 0, 0, 1]])
    X_WB = np.array([[0, -1, 0, 2.046875], [0, 0, 1, 1.96875], [-1, 0, 0, -1.5], [0, 0, 0, 1]])
    X_WB[:3, 3] = np.nextafter(X_WB[:3, 3], (-np.inf, -np.inf, np.inf))
    pair = Pair(collide.Cone(1.640625, 2.1875), collide.Ellipsoid((0.078125, 0.15625, 0.4375)), X_WA, X_WB, "tip")
    assert answered(pair).hit


def test_a_tip_an_ulp_outside_a_corner_is_apart():
    """A point of a facet was beyond its edge by 2⁻⁵⁴ of it, and a depth of 5e-18 was proven by that point."""
    X_WA = np.array([[-1, 0, 0, -2.9375], [0, 1, 0, 1.9375], [0, 0, -1, 1.125], [0, 0, 0, 1]])
    X_WB = np.array([[0, 0, 1, -3.3125], [1, 0, 0, 1.0], [0, 1, 0, -0.0625], [0, 0, 0, 1]])
    X_WB[:3, 3] = np.nextafter(X_WB[:3, 3], (np.inf, -np.inf, np.inf))
    r = answered(Pair(collide.Cone(0.9375, 1.25), collide.Box((1.875, 1.125, 0.75)), X_WA, X_WB, "corner"))
    assert not r.hit and abs(r.lower - 8.465450562766818e-17) < 1e-25


RESTING = collide.Cylinder(0.25, 0.5), collide.Cone(0.25, 0.5), collide.Ellipsoid([0.5, 0.25, 0.25])


@pytest.mark.parametrize("shape", RESTING)
def test_what_rests_on_a_half_space_touches(shape):
    ground = collide.Halfspace((0, 0, 1), 0.0)
    for k, hit in ((0, True), (1, False), (-1, True)):
        height = 0.25
        for _ in range(abs(k)):
            height = np.nextafter(height, np.inf * k)
        r = collide.distance(shape, ground, collide.pose([0.1, 0.2, height]), np.eye(4))
        assert r.hit == hit and r.certified
        assert r.how in (collide.results.EXACT, collide.results.FORMULA)
        assert r.lower <= r.distance <= r.upper and abs(r.distance - (height - 0.25)) <= 1e-15 * abs(height - 0.25)
        assert r.upper - r.lower <= 2.0**-50 * abs(r.distance)


@pytest.mark.parametrize("seed", range(3))
def test_hulls_of_many_points_are_sorted_out_and_right(seed):
    """Of 300 points those near the other body are looked at in integers; the answer is that of all."""
    rng = np.random.default_rng([49, seed])
    told = 0
    for k in range(6):
        points = rng.normal(size=(300, 3))
        points = np.round(points / np.linalg.norm(points, axis=1)[:, None] * 2**16) / 2**16
        A = collide.ConvexHull(points, radius=0.125 * (k % 2))
        B = (collide.Cylinder(0.25, 0.5), collide.Cone(0.3, 0.6), collide.Ellipsoid((0.5, 0.5, 0.25)))[k % 3]
        X_WB = collide.pose(3.0 * rng.normal(size=3), quat_wxyz=rng.normal(size=4))
        r = collide.distance(A, B, np.eye(4), X_WB)
        X_WB[:3, 3] -= r.distance * r.normal
        pair = Pair(A, B, np.eye(4), X_WB, "many points")
        r, known = answered(pair), bracket(A, B, np.eye(4), X_WB, depths=False)
        assert known.hit in (None, r.hit), pair
        told += known.hit is not None
    assert told >= 4


def test_a_tiny_coordinate_beside_many_points_is_no_error():
    """With 5e-324 among the numbers units are 2^-1074: heights in such units are beyond doubles, and raised."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(60, 3))
    points = np.round(points / np.linalg.norm(points, axis=1)[:, None] * 2**16) / 2**16
    A, B = collide.ConvexHull(points), collide.Cylinder(0.25, 0.5)
    X_WA, X_WB = np.eye(4), collide.pose((3.0, 1.0, 0.5), quat_wxyz=rng.normal(size=4))
    r = collide.distance(A, B, X_WA, X_WB)
    X_WB[:3, 3] -= r.distance * r.normal
    X_WA[0, 3] = 5e-324
    pair = Pair(A, B, X_WA, X_WB, "tiny")
    known = bracket(A, B, X_WA, X_WB, depths=False)
    assert answered(pair).hit == known.hit
