"""Splines: Bézier pieces against the curves that were given, in fractions; and what is refused."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from naive import rng_of
from random_splines import KINDS, exact_bezier, exact_bspline, random_bspline, random_spline

import collide
from collide.errors import InvalidArgument
from collide.robots.motion_bounds import ROUNDING_SHARE

Spline = collide.Spline


def times_of(rng, spline: Spline, piece: int, n: int = 3) -> list[Fraction]:
    begin, end = (Fraction(float(spline.breaks[piece + k])) for k in (0, 1))
    return [begin, end, *(begin + (end - begin) * Fraction(int(k), 1000) for k in rng.integers(1, 1000, n))]


def assert_within(spline: Spline, piece: int, exact: list[Fraction], wanted: list[Fraction], about: str) -> float:
    """The largest share of the promised bound that was needed."""
    off = [abs(float(a - b)) for a, b in zip(exact, wanted)]
    assert (np.array(off) <= spline.errors[piece]).all(), f"{about}: {off} beyond {spline.errors[piece].tolist()}"
    return float(np.max(np.array(off) / np.maximum(spline.errors[piece], 1e-300)))


@pytest.mark.parametrize("seed", range(20))
def test_pieces_of_a_bspline_are_the_bspline(seed):
    rng = rng_of("bsplines", seed)
    knots, c, degree = random_bspline(rng, rng.normal(size=2) * 10.0 ** rng.integers(-3, 4))
    spline = Spline.bspline(knots, c, degree)
    assert spline.breaks[0] == knots[degree] and spline.breaks[-1] == knots[len(c)]
    for piece in range(len(spline)):
        for t in times_of(rng, spline, piece):
            span_end = t == Fraction(float(spline.breaks[piece + 1]))
            if span_end and piece + 1 == len(spline):
                continue  # of the recursion's half-open spans none has the last end
            share = assert_within(spline, piece, exact_bezier(spline, piece, t),
                                  exact_bspline(knots, c, degree, t), f"seed {seed}, t = {float(t)}")
            assert share < 0.05, "bounds are of many roundings, errors of few"


@pytest.mark.parametrize("seed", range(12))
def test_pieces_of_polynomials_are_the_polynomials(seed):
    rng = rng_of("polynomials", seed)
    degree = int(rng.integers(1, 8))
    breaks = np.array([float(rng.normal()) * 100.0, 0.0])
    breaks[1] = breaks[0] + float(rng.uniform(0.01, 5))
    c = rng.normal(size=(degree + 1, 1, 2)) * 10.0 ** rng.integers(-2, 3, (degree + 1, 1, 1))
    spline = Spline.polynomials(breaks, c)
    for t in times_of(rng, spline, 0):
        x = t - Fraction(float(breaks[0]))
        wanted = [sum(Fraction(float(c[degree - p, 0, j])) * x**p for p in range(degree + 1)) for j in range(2)]
        assert_within(spline, 0, exact_bezier(spline, 0, t), wanted, f"seed {seed}, t = {float(t)}")


def test_waypoints_are_met_with_velocities_and_at_rest():
    rng = rng_of("waypoints")
    times, Q, V, A = np.array([0.0, 0.5, 2.0]), *rng.normal(size=(3, 3, 2))
    e = 1e-4
    for spline, v, a in (
        (Spline.hermite(times, Q, V, A), V[1], A[1]), (Spline.hermite(times, Q, V), V[1], None),
        (Spline.min_jerk(Q, times), np.zeros(2), np.zeros(2)), (Spline.straight(Q, times), None, None),
    ):
        assert np.allclose(spline(times), Q, atol=1e-15)
        before, at, after = spline(0.5 + e * np.array([-1, 0, 1]))
        if v is not None:
            assert np.allclose((after - before) / (2 * e), v, atol=1e-3)
        if a is not None:
            assert np.allclose((after - 2 * at + before) / e**2, a, atol=0.1)
    half = Spline.min_jerk(Q, times)(0.25)
    assert half.shape == (2,) and np.allclose(half, 0.5 * (Q[0] + Q[1]))
    assert np.array_equal(Spline.min_jerk(Q, times).control_points[0], Q[[0, 0, 0, 1, 1, 1]])


def test_motions_of_scipy_are_read():
    interpolate = pytest.importorskip("scipy.interpolate")
    rng = rng_of("scipy")
    x, Q = np.arange(6.0), rng.normal(size=(6, 3))
    for motion in (
        interpolate.make_interp_spline(x, Q, k=5), interpolate.CubicSpline(x, Q), interpolate.PchipInterpolator(x, Q),
        interpolate.BPoly(rng.normal(size=(5, 1, 3)), [0.0, 5.0]),
    ):
        spline, t = Spline.of(motion), np.linspace(0, 5, 101)
        assert np.abs(spline(t) - motion(t)).max() < 1e-13, motion


@pytest.mark.parametrize("kind", KINDS)
def test_motions_side_by_side_are_both(kind):
    for seed in range(10):
        rng = rng_of("beside", kind, seed)
        one, two = random_spline(rng, np.zeros(2), kind=kind), random_spline(rng, np.ones(1))
        two = Spline(one.breaks[0] + (one.breaks[-1] - one.breaks[0]) * np.linspace(-0.3, 1.2, len(two) + 1),
                     two.control_points)
        both = one.beside(two)
        assert both.columns == 3 and both.breaks[[0, -1]].tolist() == one.breaks[[0, -1]].tolist()
        assert set(one.breaks) <= set(both.breaks) and both.degree == max(one.degree, two.degree)
        middles = 0.5 * (both.breaks[:-1] + both.breaks[1:])
        for piece, t in enumerate(middles.tolist()):
            for spline, columns in ((one, slice(0, 2)), (two, slice(2, 3))):
                k = int(np.searchsorted(spline.breaks, t, "right")) - 1
                wanted = exact_bezier(spline, k, Fraction(t))
                got = exact_bezier(both, piece, Fraction(t))[columns]
                off = np.abs([float(a - b) for a, b in zip(got, wanted)])
                assert (off <= both.errors[piece, columns]).all(), (kind, seed, piece)


def test_errors_grow_with_what_went_in():
    large = Spline.polynomials([0.0, 1.0], np.array([[[1e9]], [[-1e9]], [[0.0]]]))
    assert np.abs(large.control_points).max() <= 1e9 and large.errors[0, 0] == ROUNDING_SHARE * 2e9
    step = Spline([0.0, 1.0, 2.0], [[[0.0], [1.0]], [[1.0 + 1e-12], [2.0]]])
    assert (step.errors[:, 0] >= 1e-12).all()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Spline.bspline([0, 1, 2], np.zeros((3, 1)), 3), "3 coefficients are too few for degree 3: at least 4"),
        (lambda: Spline.bspline([0, 1, 2], np.zeros((4, 1)), 3), "knots must be 8.*got 3"),
        (lambda: Spline.bspline([0, 0, 0, 2, 1, 3, 3, 3], np.zeros((5, 1)), 2), "knots decrease from 2 to 1 at knot 4"),
        (lambda: Spline.bspline(np.zeros(6), np.zeros((3, 1)), 2), "no length in time"),
        (lambda: Spline.bspline(np.arange(40.0), np.zeros((20, 1)), 19), "degree must be at most 15, got 19"),
        (lambda: Spline.bspline(np.arange(6.0), [[0.0], [np.nan], [1.0]], 2), r"coefficients\[1, 0\] is nan"),
        (lambda: Spline.bspline([0, 1, 2, np.inf, 4, 5], np.zeros((3, 1)), 2), r"knots\[3\] is inf"),
        (lambda: Spline.straight([[0.0]], None), "two waypoints or more, got"),
        (lambda: Spline.straight(np.zeros((3, 1)), [0, 1]), "times must be 3, one for each waypoint of Q, got 2"),
        (lambda: Spline.min_jerk(np.zeros((3, 1)), [0, 1, 1]), "times must increase: entry 2 is 1, after 1"),
        (lambda: Spline.polynomials([0, 1], np.zeros((3, 2, 1))), r"\(degree \+ 1, 1, columns\), between the breaks"),
        (lambda: Spline.polynomials([0, 1, 2], np.array([[[1.0], [1.0]], [[0.0], [5.0]]])), "jumps by 4 at time 1"),
        (lambda: Spline.bezier(np.zeros((18, 1))), "degree 17 is too large: at most 15"),
        (lambda: Spline.bezier(np.zeros((1, 1))), "degree ≥ 1"),
        (lambda: Spline.hermite([0, 1], np.zeros((2, 1)), np.zeros((2, 2))), r"velocities, as Q, must be \(2, 1\)"),
        (lambda: Spline.of([1, 2, 3]), "must be a collide.Spline"),
        (lambda: Spline.straight([[0.0], [1.0]])(1.5), r"within \[0, 1\]"),
        (lambda: Spline.straight([[0.0], [1.0]]).beside(Spline.straight([[0.0], [1.0]], [0.5, 2.0])), "from 0 to 1"),
        (lambda: Spline.straight([["a"], [1.0]]), "Spline.straight: Q"),
    ],
)
def test_what_is_no_motion_is_refused_by_name(make, words):
    with pytest.raises(InvalidArgument, match=words):
        make()
