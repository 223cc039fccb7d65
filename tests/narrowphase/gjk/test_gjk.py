"""GJK alone: what it says of two cores holds, judged exactly; and it comes to an end wherever bodies are."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import naive
import numpy as np
import pytest
from naive import Case, random_pose, rng_of
from naive_triangles import world_points
from posed_bodies import PosedBodies

import collide
from collide.narrowphase.gjk.gjk import APART, ENCLOSED, MEETING, NEAREST, gjk
from collide.narrowphase.gjk.minkowski_difference import AXIS, NEAREST_POINT, POINT, difference_point, place_vertices
from collide.numerics.vec3 import Vec3

pytestmark = pytest.mark.plain_kernels

MAX_ITERATIONS = 128


def small_hull(rng) -> collide.ConvexHull:
    return collide.ConvexHull(naive.hull_points(rng, int(rng.integers(1, 10))))


def run(bodies: PosedBodies, *, boolean=False, limit=math.inf, axis=(0.0, 0.0, 0.0)):
    """(result, nearest point, unit axis) of the pair's cores."""
    weights = [0.0] * 10
    weights[AXIS:] = axis
    result = gjk(
        bodies.pair,
        [0.0] * (5 * POINT),
        [0] * 10,
        weights,
        0,
        boolean,
        math.inf,
        bodies.radius,
        limit,
        bodies.error,
        MAX_ITERATIONS,
    )
    return result, np.array(weights[NEAREST_POINT:AXIS]), np.array(weights[AXIS:])


def cases(rng, spread: float):
    A, B = small_hull(rng), small_hull(rng)
    case = Case(A, B, random_pose(rng, spread), random_pose(rng, spread))
    if rng.random() < 0.3:
        case = naive.with_gap(case, float(rng.choice([0.0, 1e-15, 1e-9, -1e-9, 1e-3])))
    return case


@pytest.mark.parametrize("spread", [0.3, 1.5])
def test_what_is_said_holds(spread):
    rng = rng_of("gjk", spread)
    seen: Counter = Counter()
    for _ in range(120):
        case = cases(rng, spread)
        bodies = PosedBodies(*case)
        with naive.reproducible(case):
            result, v, axis = run(bodies)
            true = float(naive.exact_distance(case))
            assert result.iterations <= MAX_ITERATIONS
            assert (
                result.lower - bodies.error <= max(true, 0.0) <= np.linalg.norm(v) + bodies.error
                or result.status == ENCLOSED
            )
            if result.status == NEAREST:
                assert true > 0.0 and np.linalg.norm(v) - true <= 1e-10
                sign = -1.0 if bodies.ordered.flip else 1.0
                assert abs(naive.clearance_along(case, -sign * axis) - true) <= 1e-9
            if result.status == ENCLOSED:
                assert true < 0.0 and result.clearance <= -true + bodies.error
            if result.status == MEETING:
                assert true <= 1e-12
        seen[result.status] += 1
    assert seen[NEAREST] >= 20 and seen[ENCLOSED] >= (20 if spread < 1 else 5), seen


def test_booleans_and_limits_stop_early_and_stay_right():
    rng = rng_of("gjk stops early")
    seen: Counter = Counter()
    saved = 0
    for _ in range(120):
        case = cases(rng, 1.0)
        bodies = PosedBodies(*case)
        with naive.reproducible(case):
            true = float(naive.exact_distance(case))
            whole, _, _ = run(bodies)
            decided, _, axis = run(bodies, boolean=True, limit=0.0)
            saved += decided.iterations < whole.iterations
            assert decided.iterations <= whole.iterations
            assert (decided.status != APART or true > 0.0) and (decided.status != ENCLOSED or true < 0.0)
            if decided.status == APART:  # begun with its own axis, it ends at once
                assert run(bodies, boolean=True, limit=0.0, axis=tuple(-axis))[0].iterations <= decided.iterations
            limit = abs(true) / 2
            if true > 1e-6:
                assert run(bodies, limit=limit)[0].status == APART
        seen[decided.status] += 1
    assert seen[APART] > 20 and seen[ENCLOSED] > 20 and saved > 20, (seen, saved)


def heights_along(d, points) -> list[Fraction]:
    return [sum(x * Fraction(y) for x, y in zip(p, d.tolist())) for p in points]


def test_points_of_the_difference_are_farthest():
    """Among all pairs of vertices none is higher along the direction, exactly, by more than rounding."""
    rng = rng_of("difference points")
    for _ in range(60):
        case = cases(rng, 1.0)
        bodies, d = PosedBodies(*case), rng.normal(size=3)
        points, ids = [0.0] * (2 * POINT), [0] * 4
        difference_point(bodies.pair, points, ids, 1, Vec3(*d.tolist()))
        first, second = (case.B, case.A) if bodies.ordered.flip else (case.A, case.B)
        X, Y = (case.X_WB, case.X_WA) if bodies.ordered.flip else (case.X_WA, case.X_WB)
        a, b = world_points(naive.corners(first)[0], X), world_points(naive.corners(second)[0], Y)
        heights_a, heights_b = heights_along(d, a), heights_along(d, b)
        best = max(heights_a) - min(heights_b)
        found = heights_a[ids[2]] - heights_b[ids[3]]
        with naive.reproducible(case):
            assert best - found <= Fraction(bodies.error) * Fraction(float(np.linalg.norm(d)))
            w = [x - y for x, y in zip(a[ids[2]], b[ids[3]])]
            assert all(abs(Fraction(x) - y) <= Fraction(bodies.error) for x, y in zip(points[POINT : POINT + 3], w))
        again = [0.0] * POINT
        place_vertices(bodies.pair, again, [0, 0], 0, ids[2], ids[3])
        assert again == points[POINT:]
