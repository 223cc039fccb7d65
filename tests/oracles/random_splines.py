"""Seeded motions of every kind a Spline can be made of, and where they are, in fractions."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np

import collide

KINDS = ("bspline", "bezier", "polynomials", "hermite", "min_jerk", "straight")


def random_spline(rng, q0: np.ndarray, size: float = 0.5, kind: str | None = None) -> collide.Spline:
    """A motion that begins near q0 (columns,) and strays by some ``size``, over a span of time of any place."""
    kind = str(rng.choice(KINDS)) if kind is None else kind
    begin, length = float(rng.choice([0.0, -3.0, 100.0])), float(rng.choice([1.0, 0.01, 7.0]))
    if kind == "bspline":
        knots, coefficients, degree = random_bspline(rng, q0, size)
        return collide.Spline.bspline(begin + length * knots, coefficients, degree)
    if kind == "bezier":
        degree = int(rng.integers(1, 8))
        points = q0 + size * rng.normal(size=(degree + 1, len(q0))) * np.linspace(0, 1, degree + 1)[:, None]
        return collide.Spline.bezier(points, [begin, begin + length])
    times = begin + length * np.cumsum(rng.uniform(0.2, 1.0, 3))
    Q = q0 + size * rng.normal(size=(3, len(q0))) * np.arange(3)[:, None]
    if kind == "min_jerk":
        return collide.Spline.min_jerk(Q, times)
    if kind == "straight":
        return collide.Spline.straight(Q, times)
    V, A = size * rng.normal(size=(2, 3, len(q0))) / length
    if kind == "hermite":
        return collide.Spline.hermite(times, Q, V, A / length if rng.random() < 0.5 else None)
    degree = int(rng.integers(1, 8))
    coefficients = size * rng.normal(size=(degree + 1, 1, len(q0))) / length ** np.arange(degree, -1, -1)[:, None, None]
    coefficients[-1] = q0
    return collide.Spline.polynomials([begin, begin + length], coefficients)


def random_bspline(rng, q0: np.ndarray, size: float = 0.5) -> tuple[np.ndarray, np.ndarray, int]:
    """(knots, coefficients, degree), with knots that repeat and ends that are not clamped now and then."""
    degree = int(rng.integers(1, 8))
    n = degree + 1 + int(rng.integers(0, 5))
    coefficients = q0 + size * rng.normal(size=(n, len(q0))) * np.linspace(0, 1, n)[:, None]
    inner = np.sort(rng.uniform(0.05, 0.95, n - degree - 1))
    if len(inner) > 1 and degree > 1 and rng.random() < 0.4:
        inner[1] = inner[0]
    low, high = np.zeros(degree + 1), np.ones(degree + 1)
    if rng.random() < 0.4:
        low[:-1] -= np.sort(rng.uniform(0, 1, degree))[::-1]
        high[1:] += np.sort(rng.uniform(0, 1, degree))
    return np.concatenate([low, inner, high]), coefficients, degree


def exact_bspline(knots, coefficients, degree: int, t: Fraction) -> list[Fraction]:
    """A B-spline at a time by the recursion of its basis functions, in fractions."""
    knots = [Fraction(float(k)) for k in knots]
    n = len(coefficients)
    span = max(k for k in range(degree, n) if knots[k] <= t and knots[k] < knots[k + 1])

    def basis(k: int, p: int) -> Fraction:
        if p == 0:
            return Fraction(k == span)
        rising, falling = knots[k + p] - knots[k], knots[k + p + 1] - knots[k + 1]
        value = (t - knots[k]) / rising * basis(k, p - 1) if rising else Fraction(0)
        return value + ((knots[k + p + 1] - t) / falling * basis(k + 1, p - 1) if falling else Fraction(0))

    weights = [basis(k, degree) for k in range(n)]
    return [sum((w * Fraction(float(c)) for w, c in zip(weights, column)), Fraction(0)) for column in coefficients.T]


def exact_bezier(spline: collide.Spline, piece: int, t: Fraction) -> list[Fraction]:
    """A piece of a Spline at a time by de Casteljau's algorithm, in fractions."""
    begin, end = (Fraction(float(spline.breaks[piece + k])) for k in (0, 1))
    s = (t - begin) / (end - begin)
    out = []
    for column in spline.control_points[piece].T:
        points = [Fraction(float(v)) for v in column]
        while len(points) > 1:
            points = [a + s * (b - a) for a, b in itertools.pairwise(points)]
        out.append(points[0])
    return out
