"""Booleans with a security margin: at most so far apart, decided as exactly as without one."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
import surfaces

import collide
from collide import (
    Box,
    Capsule,
    Compound,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    InvalidArgument,
    Mesh,
    ShapeSet,
    Sphere,
    World,
    pose,
)

EYE = np.eye(4)
SHAPES = [
    Box(1, 1, 1), Sphere(0.5), Capsule(0.3, 1.0), Cylinder(0.5, 1.0), Ellipsoid(0.5, 0.4, 0.3),
    ConvexHull(np.eye(3), radius=0.1),
    Mesh(*surfaces.box()), Compound([(Box(1, 1, 1), pose((1, 0, 0))), (Sphere(0.5), EYE)]),
]


def poses(n: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.array([pose(rng.uniform(-2, 2, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(n)])


@pytest.mark.parametrize(("a", "b"), list(itertools.combinations_with_replacement(range(len(SHAPES)), 2)))
def test_as_the_bracket_of_the_distance_says(a, b):
    A, B, X = SHAPES[a], SHAPES[b], poses(20)
    r = collide.distance(A, B, EYE, X)
    margin = float(np.sort(r.distance)[12]) * 1.01 + 1e-3
    told = collide.collide(A, B, EYE, X, security_margin=margin)
    assert told.dtype == bool and 8 < told.sum() < 20
    assert told[r.upper <= margin].all() and not told[r.lower > margin].any()
    assert (told == collide.collide(B, A, X, EYE, security_margin=margin)).all()
    assert told.tolist() == [collide.collide(A, B, EYE, X[k], security_margin=margin) for k in range(20)]
    assert (collide.collide(A, B, EYE, X, security_margin=0.0) == collide.collide(A, B, EYE, X)).all()
    for k in (3, 7):
        world = World()
        world.add(A, EYE)
        world.add(B, X[k])
        assert world.collides(security_margin=margin) is bool(told[k])
        assert world.collides(security_margin=0.0) is world.collides()


@pytest.mark.parametrize("gap", [0.1, 0.3, 1e-3, 2.0**-10, 1e-9])
def test_a_margin_of_exactly_the_gap(gap):
    """The last digit decides: the gap of two boxes along x is a difference of doubles, known as a fraction."""
    A, decided = Box(1, 1, 1), 0
    for B, near in ((Box(1, 1, 1), 0.5), (Sphere(0.5), 0.5), (Capsule(0.5, 1.0), 0.5), (ConvexHull([[0, 0, 0]]), 0.0)):
        x = 0.5 + near + gap
        truth = Fraction(x) - Fraction(0.5) - Fraction(near)
        for margin in (float(truth), np.nextafter(float(truth), 0), np.nextafter(float(truth), 1), gap):
            expected = truth <= Fraction(float(margin))
            for X in (pose((x, 0, 0)), pose((0, -x, 0), rpy=(0, 0, 0))):
                assert collide.collide(A, B, EYE, X, security_margin=float(margin)) is expected, (B, margin, truth)
                assert collide.collide(B, A, X, EYE, security_margin=float(margin)) is expected
                decided += expected
    assert 4 < decided < 32


def test_turned_boxes_at_a_margin_of_their_gap():
    """Where the gap is no double, margins on either side of its bracket and within it agree with integers on a grown
    box."""
    open_ones = 0
    for X in poses(60, seed=2):
        r = collide.distance(Box(1, 1, 1), Box(1, 1, 1), EYE, X)
        if r.hit:
            continue
        for margin in {r.lower, r.distance, r.upper}:
            grown = ConvexHull(
                [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)], radius=margin
            )
            expected = collide.collide(grown, Box(1, 1, 1), EYE, X)
            assert collide.collide(Box(1, 1, 1), Box(1, 1, 1), EYE, X, security_margin=margin) is expected
            open_ones += r.lower < r.upper
    assert open_ones > 20


def test_lists_picks_threads_and_half_spaces():
    X = poses(64, seed=3)
    library = ShapeSet(SHAPES[:6])
    pick = np.random.default_rng(4).integers(0, 6, size=(2, 64))
    A, B = library[pick[0]], library[pick[1]]
    told = collide.collide(A, B, EYE, X, security_margin=0.2)
    assert (told == collide.collide(list(A), list(B), EYE, X, security_margin=0.2, threads=2)).all()
    assert told.tolist() == [collide.collide(A[k], B[k], EYE, X[k], security_margin=0.2) for k in range(64)]
    floor = Halfspace((0, 0, 1), 0.0)
    assert collide.collide(floor, Sphere(0.5), EYE, pose((0, 0, 0.75)), security_margin=0.25) is True
    below = float(np.nextafter(0.25, 0))
    assert collide.collide(floor, Box(1, 1, 1), EYE, pose((0, 0, 0.75)), security_margin=below) is False
    for A, B in (
        (Sphere(0.5), Sphere(0.5)),
        (Capsule(0.25, 1), Sphere(0.75)),
    ):  # the radii and the margin have no sum in doubles
        assert collide.collide(A, B, EYE, pose((1.25, 0, 0)), security_margin=below) is False
        assert collide.collide(A, B, EYE, pose((1.25, 0, 0)), security_margin=0.25) is True
    assert collide.collide(floor, floor, EYE, pose(rpy=(0.1, 0, 0)), security_margin=0.1) is True


@pytest.mark.parametrize("margin", [-1.0, np.nan, np.inf, "0.1", None, 1e60, 1e-60, 10**400, [0.1], np.ones(2), 1j])
def test_margins_that_are_none(margin):
    world = World()
    for ask in (
        lambda: collide.collide(SHAPES[0], SHAPES[1], EYE, EYE, security_margin=margin),
        lambda: world.collides(security_margin=margin),
    ):
        with pytest.raises(InvalidArgument, match="security_margin"):
            ask()


def test_what_a_margin_does_not_go_with():
    for more in ({"axes": np.zeros((1, 3))}, {"algorithm": "barba-langerman"}):
        with pytest.raises(InvalidArgument, match="neither axes nor algorithm"):
            collide.collide(SHAPES[0], SHAPES[0], EYE, EYE, security_margin=0.1, **more)
    assert collide.collide(SHAPES[0], SHAPES[0], EYE, EYE, security_margin=0, axes=np.zeros((1, 3))) is True
