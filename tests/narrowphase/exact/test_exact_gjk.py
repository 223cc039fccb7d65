"""GJK in integers: the same verdict as exact arithmetic on every pair, from whatever simplex it begins."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import naive
import numpy as np
import pytest
from naive import Case, pose, random_pose, rng_of
from posed_bodies import PosedBodies

import collide
from collide.narrowphase.bounds import EXACT_ERROR
from collide.narrowphase.exact.exact_gjk import SEPARATE, TOUCHING, touch_exactly
from collide.narrowphase.exact.exact_workspace import INTEGERS
from collide.narrowphase.posed_pair import radius_of

pytestmark = pytest.mark.plain_kernels


def lattice_case(rng) -> Case:
    """Small integer corners under rotations that keep them so: flush faces, edges and corners that meet."""
    A, B = (collide.ConvexHull(rng.integers(-2, 3, size=(int(rng.integers(1, 8)), 3)) * 0.5) for _ in range(2))
    turns = [naive.LATTICE_ROTATIONS[k] for k in rng.integers(0, 24, 2)]
    return Case(A, B, pose(turns[0]), pose(turns[1], rng.integers(-3, 4, 3) * 0.5))


def near_case(rng) -> Case:
    """An ulp or so from touching."""
    A, B = (collide.ConvexHull(naive.hull_points(rng, int(rng.integers(2, 8)))) for _ in range(2))
    case = naive.with_gap(Case(A, B, random_pose(rng), random_pose(rng)), 0.0)
    return case.with_b_moved(rng.integers(-2, 3, 3) * 2.0**-52)


def swept_case(rng) -> Case:
    """Balls about a point and a segment, as far apart as their radii but for an ulp."""
    A, B = collide.Sphere(3.0), collide.Capsule(2.0, 4.0)
    shift = np.array([3.0, 4.0, 0.0]) * np.nextafter(1.0, rng.choice([0.0, 1.0, 2.0]))
    return Case(A, B, pose(), pose(t=(shift[0], shift[1], rng.integers(-2, 3) * 0.5)))


def decided(case: Case, *, boolean: bool, rng):
    bodies = PosedBodies(*case)
    n = int(rng.integers(1, 4))
    ids = [0] * 12
    for k in range(n):  # any simplex to begin with
        ids[2 * k], ids[2 * k + 1] = int(rng.integers(bodies.pair.A.n)), int(rng.integers(bodies.pair.B.n))
    radii = radius_of(bodies.pair, bodies.pair.A), radius_of(bodies.pair, bodies.pair.B)
    digits = np.zeros(INTEGERS, dtype=np.int64)
    answer = touch_exactly(bodies.ordered, bodies.poses.terms.ravel(), digits, boolean, ids, n, *radii)
    return bodies, answer, ids


@pytest.mark.many(3)
@pytest.mark.parametrize("boolean", [True, False])
@pytest.mark.parametrize("draw", [lattice_case, near_case, swept_case])
def test_verdicts_are_exact(draw, boolean):
    rng = rng_of("exact gjk", draw.__name__, boolean)
    seen: Counter = Counter()
    for _ in range(50 if draw is near_case else 100):
        case = draw(rng)
        with naive.reproducible(case):
            bodies, answer, ids = decided(case, boolean=boolean, rng=rng)
            true = naive.exact_distance(case)
            assert (
                answer.verdict
                == (TOUCHING if true <= 0 else SEPARATE)
                == (TOUCHING if naive.exact_hit(case) else SEPARATE)
            )
            assert all(
                0 <= ids[2 * k] < bodies.pair.A.n and 0 <= ids[2 * k + 1] < bodies.pair.B.n for k in range(answer.n)
            )
            if answer.cores_apart:
                excess = Fraction(answer.excess.high) + Fraction(answer.excess.low)
                assert (excess <= 0) == (answer.verdict == TOUCHING)
                if true > 1e-300:
                    assert abs(excess - true) <= (Fraction(EXACT_ERROR) + Fraction(1, 10**20)) * abs(true)
                assert abs(math.hypot(*answer.v) - 1.0) <= 1e-15
                sign = -1.0 if bodies.ordered.flip else 1.0
                along = naive.clearance_along(case, -sign * np.array(answer.v))
                assert abs(along - float(true)) <= 1e-12
        seen[answer.verdict, answer.cores_apart] += 1
    assert sum(n for (verdict, _), n in seen.items() if verdict == TOUCHING) >= 5, seen
    assert sum(n for (verdict, _), n in seen.items() if verdict == SEPARATE) >= 5, seen


def test_magnitudes_that_span_too_much_are_left_undone():
    A = collide.ConvexHull([(1e49, 0.0, 0.0), (0.0, 1e-300, 0.0)])
    X_WA = pose()
    X_WA[0, 1] = 1e-250
    case = Case(A, collide.Box((1, 1, 1)), X_WA, pose())
    _, answer, _ = decided(case, boolean=True, rng=rng_of("undone"))
    assert answer.verdict not in (TOUCHING, SEPARATE) and not answer.cores_apart
