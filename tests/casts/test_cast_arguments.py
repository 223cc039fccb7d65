"""Arguments of casts: directions are scaled without rounding, what cannot be cast is refused by name."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from naive import rng_of
from reproduction import reproducing

import collide
from collide.casts.cast_arguments import checked_directions, checked_points, checked_rays, refuse_unbounded
from collide.errors import InvalidArgument, UnsupportedQuery


def test_directions_are_scaled_exactly():
    """The largest component comes to [½, 1); vector · 2^exponent is what was given, to the last bit."""
    rng = rng_of("checked directions")
    given = rng.normal(size=(60, 3)) * 10.0 ** rng.integers(-90, 91, (60, 1))
    given[::7, 1] = 0.0
    given[3], given[4] = (1.0, 0.0, 0.0), (0.0, -8.0, 2.0**-400)
    with reproducing("collide.shape_cast(..., direction_W={given})", given=given):
        (vectors, exponents), single = checked_directions("f", "d", given, "a ray")
        largest = np.abs(vectors).max(axis=1)
        assert not single and (0.5 <= largest).all() and (largest < 1.0).all()
        for v, e, g in zip(vectors.tolist(), exponents.tolist(), given.tolist()):
            assert [Fraction(x) * Fraction(2) ** e for x in v] == [Fraction(x) for x in g]
    assert exponents.dtype == np.int64
    (vectors, _), single = checked_directions("f", "d", (0, 0, -3), "a ray")
    assert single and vectors.tolist() == [[0.0, 0.0, -0.75]]


@pytest.mark.parametrize(
    ("direction", "words"),
    [
        ((0, 0, 0), "length 0: a cast needs a direction"), ((1e-101, 0, 0), "no component within"),
        ((0, 1.01e100, 0), "no component within"), ((1, 2.0**-502, 0), "differ by more than 2^500"),
        ((np.nan, 0, 0), "direction_W"), ((1, np.inf, 0), "direction_W"), ((1, 2), "direction_W"),
        ("up", "direction_W"),
    ],
)
def test_bad_directions_are_named(direction, words):
    with pytest.raises(InvalidArgument) as caught:
        checked_directions("shape_cast", "direction_W", direction, "a cast")
    assert words in str(caught.value) and "shape_cast" in str(caught.value) and "direction_W" in str(caught.value)


def test_extreme_directions_are_taken():
    for direction in ((1e-100, 0, 0), (0, 1e100, 0), (1, 2.0**-499, 0)):
        (vectors, exponents), _ = checked_directions("f", "d", direction, "a ray")
        assert np.ldexp(vectors[0], exponents[0]).tolist() == list(direction)


def test_the_row_that_is_wrong_is_named():
    rows = np.ones((5, 3))
    rows[3] = 0.0
    with pytest.raises(InvalidArgument, match="3"):
        checked_directions("f", "d", rows, "a ray")


def test_rays_go_together():
    """Single origins and directions go with every one of the others; other lengths are refused."""
    one, five = np.arange(3.0), np.arange(15.0).reshape(5, 3)
    for origins, directions, single in ((one, one + 1, True), (one, five + 1, False), (five, one + 1, False)):
        read, scaled, is_single = checked_rays("raycast", origins, directions)
        n = 1 if single else 5
        assert read.shape == scaled.vectors.shape == (n, 3) and scaled.exponents.shape == (n,) and is_single == single
        assert np.array_equal(read, np.broadcast_to(np.atleast_2d(origins), (n, 3)))
        back = np.ldexp(scaled.vectors, scaled.exponents[:, None])
        assert np.array_equal(back, np.broadcast_to(np.atleast_2d(directions), (n, 3)))
        assert read.flags.c_contiguous and scaled.vectors.flags.c_contiguous
    assert len(checked_rays("raycast", one, one + 1, X_WA=4)[0]) == 4
    assert len(checked_rays("raycast", np.zeros((0, 3)), one + 1)[0]) == 0
    for arguments in ((five, five[:4] + 1), (five[:2], five + 1)):
        with pytest.raises(InvalidArgument, match="origins_W"):
            checked_rays("raycast", *arguments)
    with pytest.raises(InvalidArgument, match="X_WA"):
        checked_rays("raycast", five, one + 1, X_WA=3)


@pytest.mark.parametrize("far", [1.1e50, -1.1e50])
def test_what_is_too_far_is_refused(far):
    with pytest.raises(InvalidArgument, match="exceeds 1e"):
        checked_points("contains", "points_W", [(0, 0, 0), (0, far, 0)])
    with pytest.raises(InvalidArgument, match="origins_W"):
        checked_rays("raycast", (0, 0, far), (1, 0, 0))
    near = checked_points("contains", "points_W", [(0, 0, 0), (0, far / 1.1, 0)])
    assert near.shape == (2, 3) and checked_points("contains", "points_W", (1, 2, 3)).tolist() == [[1, 2, 3]]


def test_what_has_no_end_is_not_moved():
    half = collide.Halfspace((0, 0, 1), 0.0)
    box, region = collide.Box((1, 1, 1)), collide.HPolytope([(0, 0, 1)], [0.0], bounded=False)
    refuse_unbounded("shape_cast: A", box)
    refuse_unbounded("shape_cast: A", [box, collide.Compound([(box, np.eye(4))]), box])
    within = collide.Compound([(box, np.eye(4)), (half, np.eye(4))])
    for shape, name in ((half, "Halfspace"), (region, "HPolytope"), (within, "Compound"), ([box, half], "Halfspace")):
        with pytest.raises(UnsupportedQuery, match=f"shape_cast: A: {name} has no end"):
            refuse_unbounded("shape_cast: A", shape)
