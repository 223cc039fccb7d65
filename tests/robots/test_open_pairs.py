"""Pairs left to others: swelling and its brackets by fractions, the nearer of two rows, batches of the same bodies."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from naive import pose, rng_of

import collide
from collide.results import PAIR_DTYPE
from collide.robots.check_tables import BodyAround, RobotBody
from collide.robots.open_pairs import are_hits, distances, distances_of, nearer_of

BOX = collide.Box((0.5, 0.5, 0.5))


def rows(*values: tuple) -> np.ndarray:
    """(a, lower, distance, upper, certified) each."""
    out = np.zeros(len(values), dtype=PAIR_DTYPE)
    for row, (a, lower, distance, upper, certified) in zip(out, values):
        row["a"], row["lower"], row["distance"], row["upper"], row["certified"] = a, lower, distance, upper, certified
    return out


def nearer(mine: tuple, theirs: tuple) -> tuple:
    (row,) = nearer_of(rows(mine), rows(theirs))
    return int(row["a"]), float(row["lower"]), float(row["distance"]), float(row["upper"]), bool(row["certified"])


# --- the nearer of two ----------------------------------------------------------------------------


def test_no_pair_is_infinitely_far():
    assert distances_of(rows((0, 0, -1.0, 0, True), (-1, 0, -1.0, 0, True), (3, 0, 2.0, 0, True))).tolist() == [
        -1.0, np.inf, 2.0,
    ]
    some, none = (0, 1.0, 1.0, 1.0, True), (-1, 0.0, 0.0, 0.0, False)
    assert nearer(some, none) == nearer(none, some) == some
    assert nearer(none, none)[0] == -1


def test_rows_that_brackets_tell_apart_keep_theirs():
    near, far = (0, 1.0, 1.5, 2.0, True), (7, 2.5, 3.0, 3.5, False)
    assert nearer(near, far) == nearer(far, near) == near


@pytest.mark.parametrize("a", [0, 5])
@pytest.mark.parametrize("touching", [2.0, 1.75])
def test_a_rival_widens_the_bracket_and_both_must_be_certified(a, touching):
    """Also one whose lower bound is exactly the other's upper bound, and of body 0."""
    near, rival = (a, 1.0, 1.5, 2.0, True), (0, touching, 2.5, 3.0, False)
    assert nearer(near, rival) == nearer(rival, near) == (a, 1.0, 1.5, 2.0, False)
    deep = (a, 0.5, 2.5, 3.0, True)  # farther, and its bracket reaches lower
    assert nearer(near, deep)[1:] == nearer(deep, near)[1:] == (0.5, 1.5, 2.0, True)


def test_of_rows_as_near_the_first_stays():
    assert nearer((3, 1.0, 1.0, 1.0, True), (4, 1.0, 1.0, 1.0, True))[0] == 3


# --- swollen bodies -------------------------------------------------------------------------------


def asked(gap: float, padding: float, margin: float, limit: float = 10.0) -> np.void:
    """The row of two boxes whose faces are a gap apart, the first on a robot."""
    bodies = [RobotBody("link", 0, BOX, padding)]
    around = [BodyAround("other", BOX, pose(t=(9.0, 0, 0))), BodyAround("wall", BOX, pose(t=(0.5 + gap, 0, 0)), margin)]
    pairs = np.array([[0, 0, -2]])
    (row,) = distances(pairs, np.eye(4)[None, None], bodies, around, limit=limit)
    assert (int(row["a"]), int(row["b"])) == (0, -2)
    assert are_hits(pairs, np.eye(4)[None, None], bodies, around).tolist() == [bool(row["hit"])], row
    return row


@pytest.mark.parametrize(("padding", "margin"), [(0.0, 0.25), (0.25, 0.0), (0.125, 0.5), (0.5, 0.125), (0.25, 0.25)])
def test_a_limit_is_of_what_bodies_are_swollen_to(padding, margin):
    """Also where the margin is the larger, and where both are equal: their difference says nothing."""
    row = asked(1.0, padding, margin, limit=1.0 - padding - margin)
    assert not row["beyond"] and row["distance"] == 1.0 - padding - margin
    assert asked(1.0, padding, margin, limit=0.95 - padding - margin)["beyond"]


@pytest.mark.parametrize(("padding", "margin"), [(0.0, 0.0), (0.25, 0.0), (0.0, 0.25), (0.125, 0.5)])
def test_points_are_those_of_what_bodies_are_swollen_to(padding, margin):
    row = asked(1.0, padding, margin)
    assert row["point_a"][0] == 0.25 + padding and row["point_b"][0] == 1.25 - margin
    assert row["normal"].tolist() == [1.0, 0.0, 0.0] and row["certified"] and not row["hit"]


@pytest.mark.parametrize(("padding", "margin"), [(0.25, 0.0), (0.0, 0.25), (0.125, 0.125)])
def test_bodies_swollen_until_they_touch_are_hits_and_the_next_double_is_none(padding, margin):
    assert asked(0.25, padding, margin)["hit"]
    assert asked(float(np.nextafter(0.25, 0.0)), padding, margin)["hit"]
    apart = asked(0.25 + 2.0**-50, padding, margin)
    assert not apart["hit"] and apart["lower"] <= 2.0**-50 <= apart["upper"]


def test_bodies_that_touch_before_they_are_swollen_have_no_certified_distance():
    assert not asked(0.0, 0.0, 0.25)["certified"] and asked(0.0, 0.0, 0.25)["hit"]
    assert asked(0.125, 0.0, 0.25)["certified"]


def test_brackets_hold_sums_that_doubles_round():
    rng, n_rounded = rng_of("swelling by fractions"), 0
    for _ in range(60):
        padding, margin = rng.uniform(1e-3, 0.4, 2).tolist()
        gap = float(rng.integers(1, 64)) / 64
        row = asked(gap, padding, margin)
        truth = Fraction(gap) - Fraction(padding) - Fraction(margin)
        assert Fraction(float(row["lower"])) <= truth <= Fraction(float(row["upper"])), (gap, padding, margin, row)
        assert row["upper"] - row["lower"] <= 1e-14 and row["hit"] == (truth <= 0), (gap, padding, margin, row)
        n_rounded += Fraction(padding + margin) != Fraction(padding) + Fraction(margin)
    assert n_rounded > 10


# --- many pairs -----------------------------------------------------------------------------------


def test_every_pair_gets_the_answer_of_its_own_bodies_and_configuration():
    """Pairs in any order; every two bodies come several times, with numbers of bodies that lie next to each other."""
    rng = rng_of("batches of pairs")
    bodies = [RobotBody(f"link{k}", k, collide.Sphere(0.05 * (k + 1)), 0.01 * k) for k in range(3)]
    places = rng.uniform(-0.3, 0.3, (3, 3))
    around = [BodyAround(f"ball{k}", collide.Sphere(0.1), pose(t=p), 0.02 * k) for k, p in enumerate(places)]
    X_WLs = np.tile(np.eye(4), (4, 3, 1, 1))
    X_WLs[:, :, :3, 3] = rng.uniform(-0.2, 0.2, (4, 3, 3))
    every = [(k, a, b) for k in range(4) for a in range(3) for b in range(-3, 3) if a < b or b < 0]
    pairs = rng.permutation(every)
    measured = distances(pairs, X_WLs, bodies, around, limit=100.0)
    hits = are_hits(pairs, X_WLs, bodies, around)
    for (k, a, b), row, hit in zip(pairs.tolist(), measured, hits.tolist()):
        A, p_WA = bodies[a], X_WLs[k, a, :3, 3]
        if b >= 0:
            other, p_WB, swell = bodies[b].shape, X_WLs[k, b, :3, 3], 0.0
        else:
            B = around[-1 - b]
            other, p_WB, swell = B.shape, B.X_WB[:3, 3], A.padding + B.margin
        expected = float(np.linalg.norm(p_WB - p_WA)) - A.shape.radius - other.radius - swell
        assert abs(row["distance"] - expected) <= 1e-12 and (row["a"], row["b"]) == (a, b), (k, a, b)
        assert hit == row["hit"] == (expected <= 0.0), (k, a, b)
    assert 3 <= hits.sum() <= len(pairs) - 3
    assert len(distances(pairs[:0], X_WLs, bodies, around, limit=1.0)) == 0
    assert len(are_hits(pairs[:0], X_WLs, bodies, [])) == 0


def test_each_pair_may_have_a_limit_of_its_own():
    bodies, around = [RobotBody("link", 0, BOX, 0.0)], [BodyAround("wall", BOX, pose(t=(1.5, 0, 0)))]
    X_WLs = np.tile(np.eye(4), (2, 1, 1, 1))
    pairs = np.array([[0, 0, -1], [1, 0, -1]])
    measured = distances(pairs, X_WLs, bodies, around, limit=np.array([0.5, 2.0]))
    assert measured["distance"][1] == 1.0 and not measured["beyond"][1]
    assert distances(pairs, X_WLs, bodies, around, limit=np.array([0.5, 0.75]))["beyond"].all()


def test_the_deepest_parts_of_unions():
    """Two pegs of a union reach 1/16 m and 1/8 m into a wall: by parts it is the deeper one, apart it is the nearer."""
    short = collide.Compound([(collide.Box((1.0, 0.25, 0.25)), pose(t=(0.0625, 1.0, 0)))])
    union = collide.Compound([(short, np.eye(4)), (collide.Box((1.0, 0.25, 0.25)), pose(t=(0.125, -1.0, 0)))])
    for x, expected in ((1.5, -0.125), (2.0, 0.375)):
        bodies = [RobotBody("link", 0, union, 0.0)]
        around = [BodyAround("wall", collide.Box((2.0, 8.0, 8.0)), pose(t=(x, 0, 0)))]
        (row,) = distances(np.array([[0, 0, -1]]), np.eye(4)[None, None], bodies, around, limit=9.0, by_parts=True)
        assert row["distance"] == expected and row["lower"] <= expected <= row["upper"], row
