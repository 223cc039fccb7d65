"""Nearest points of two triangles in doubles: points of both, as near as exact arithmetic says; slabs are lower
bounds."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact_simplex import exact
from naive import rng_of, rotation
from naive_triangles import as_integers, squared_distance, triangles_meet
from reproduction import reproducing

from collide.narrowphase.facets import triangle_distance as D
from collide.numerics.vec3 import Vec3

pytestmark = pytest.mark.plain_kernels

SOURCE = "T = {T}  # tests/narrowphase/facets/test_triangle_distance.py"


def apart(rng, kind: str) -> np.ndarray:
    """(6, 3) corners of two triangles."""
    T = rng.normal(size=(6, 3))
    T[3:] += rng.normal(size=3) * 2.0
    if kind == "lattice":
        T = rng.integers(-3, 4, size=(6, 3)) * 0.5
    elif kind == "coplanar":
        T[:, 2] = 0.0
        T = T @ rotation(rng).T
    elif kind == "parallel faces":
        T[:3, 2], T[3:, 2] = 0.0, 0.25
        T = T @ rotation(rng).T
    elif kind == "slivers":
        for first in (0, 3):
            T[first + 2] = T[first] + rng.uniform(0, 1) * (T[first + 1] - T[first]) + 1e-8 * rng.normal(size=3)
    elif kind == "points and segments":
        T[1:3] = T[0]
        if rng.random() < 0.5:
            T[5] = T[4]
    elif kind == "unlike sizes":
        T[:3] *= 1e-6
    return T


KINDS = ("random", "lattice", "coplanar", "parallel faces", "slivers", "points and segments", "unlike sizes")


def true_square(T: np.ndarray) -> Fraction:
    points = exact(T)
    (whole,) = as_integers(points)
    scale = max(x.denominator for p in points for x in p)
    return squared_distance(whole[:3], whole[3:]) / scale**2


def meet(T: np.ndarray) -> bool:
    (whole,) = as_integers(exact(T))
    return triangles_meet(whole[:3], whole[3:])


def off_triangle(p, corners) -> float:
    """Distance of a point from a triangle."""
    T = np.concatenate([np.repeat([p], 3, axis=0), corners])
    return math.sqrt(float(true_square(T)))


@pytest.mark.parametrize("kind", KINDS)
def test_nearest_points(kind):
    rng = rng_of("nearest points of triangles", kind)
    tight = cases = 0
    while cases < 60:
        T = apart(rng, kind)
        if meet(T):
            continue
        cases += 1
        with reproducing(SOURCE, T=T):
            out = [0.0] * 6
            distance, width = D.nearest_points(T.ravel().tolist(), out)
            size, true = float(np.abs(T).max()), math.sqrt(float(true_square(T)))
            assert abs(distance - true) <= (1e-6 if kind == "slivers" else 1e-12) * size
            assert abs(math.dist(out[:3], out[3:]) - distance) <= 1e-14 * size
            assert off_triangle(out[:3], T[:3]) <= 1e-14 * size and off_triangle(out[3:], T[3:]) <= 1e-14 * size
            assert width <= true + 1e-14 * size
            tight += width >= distance * (1 - 1e-9)
    assert tight >= 30, f"of {cases} slabs {tight} are as wide as the points are apart"


@pytest.mark.parametrize("kind", KINDS)
def test_slabs_are_lower_bounds(kind):
    """The width of a slab across a unit vector is no more than the distance; the widest one reaches it."""
    rng = rng_of("slabs", kind)
    reached = 0
    for _ in range(60):
        T = apart(rng, kind)
        with reproducing(SOURCE, T=T):
            size, true = float(np.abs(T).max()), math.sqrt(float(true_square(T)))
            n = rng.normal(size=3)
            n /= np.linalg.norm(n)
            width = D.slab(T.ravel().tolist(), Vec3(*n.tolist()))
            assert abs(width - ((T[3:] @ n).min() - (T[:3] @ n).max())) <= 1e-14 * size and width <= true + 1e-14 * size
            widest, across = D.widest_slab(T.ravel().tolist())
            assert widest <= true + 1e-14 * size
            if widest > -math.inf:
                assert abs(math.hypot(*across) - 1.0) <= 1e-14
                reached += widest >= true * (1 - 1e-9) > 0.0
    assert reached >= (5 if kind in ("random", "parallel faces") else 0), reached


@pytest.mark.parametrize("kind", ["random", "lattice", "slivers", "unlike sizes"])
def test_quick_looks_never_lose_a_pair(kind):
    """What is said to be farther apart than a bound is."""
    rng = rng_of("separated by", kind)
    seen: Counter = Counter()
    for _ in range(150):
        T, bound = apart(rng, kind), float(rng.choice([0.0, 0.3, 1.0, 4.0]))
        with reproducing(SOURCE, T=T):
            separated = D.separated_by(T.ravel().tolist(), bound)
            assert not separated or true_square(T) > Fraction(bound) ** 2 * Fraction(999, 1000)
        seen[separated, bool(true_square(T) > Fraction(bound) ** 2)] += 1
    assert seen[True, True] > 30 and seen[False, False] > 10, seen


def test_common_points():
    """A point of both triangles where an edge of one goes through the other."""
    rng = rng_of("common points")
    through = 0
    for _ in range(200):
        T = rng.normal(size=(6, 3)) * 0.7
        if not meet(T):
            continue
        with reproducing(SOURCE, T=T):
            out = [0.0] * 6
            length, _ = D.nearest_points(T.ravel().tolist(), out)
            D.common_point(T.ravel().tolist(), length, out)
            assert off_triangle(out[:3], T[:3]) <= 1e-8 and off_triangle(out[3:], T[3:]) <= 1e-8
            assert math.dist(out[:3], out[3:]) <= 1e-8
        through += length > 1e-6
    assert through > 20, through


def test_nearest_points_of_segments():
    """Shares of two segments, against both ends and the perpendicular in Fractions."""
    rng = rng_of("nearest on segments")
    for case in range(300):
        e, f, w = rng.integers(-3, 4, size=(3, 3)) * 0.5 if case % 2 else rng.normal(size=(3, 3))
        products = (e @ e, f @ f, e @ f, e @ w, f @ w)
        with reproducing("e, f, w = {e}, {f}, {w}", e=e, f=f, w=w):
            s, t = D._nearest_on_segments(*map(float, products))
            assert 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0
            found = np.linalg.norm(w + s * e - t * f)
            square = true_square(np.array([w, w + e, w, np.zeros(3), f, np.zeros(3)]))
            assert abs(found - math.sqrt(float(square))) <= 1e-7
