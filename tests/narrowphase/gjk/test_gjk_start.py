"""How GJK begins: bounds that hold, planes that separate, a first simplex of points of A ⊖ B and its nearest point."""

from __future__ import annotations

import math
from collections import Counter

import naive
import numpy as np
import pytest
from exact_simplex import nearest_to_origin
from naive import Case, random_pose, reproducible, rng_of
from naive_triangles import world_points
from posed_bodies import PosedBodies

import collide
from collide.narrowphase.gjk import gjk_start as S
from collide.narrowphase.gjk.minkowski_difference import AXIS, NEAREST_POINT, POINT

pytestmark = pytest.mark.plain_kernels


def hull(rng, n: int) -> collide.ConvexHull:
    points = rng.normal(size=(n, 3))
    return collide.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None])


@pytest.mark.parametrize("boolean", [True, False])
@pytest.mark.parametrize("n", [6, 40, 80])
def test_begin_and_first_simplex(n, boolean):
    """Of few vertices, of many, and with coarse points: by balls, by the first plane, or with a first simplex."""
    rng = rng_of("gjk start", n, boolean)
    seen: Counter = Counter()
    for _ in range(50):
        case = Case(hull(rng, n), hull(rng, n), random_pose(rng), random_pose(rng))
        case = case.with_b_moved(rng.choice([0.0, 0.5, 1.2, 2.0, 4.0]) * naive.unit(rng.normal(size=3)))
        bodies = PosedBodies(*case)
        limit = 0.0 if boolean else float(rng.choice([0.5, math.inf]))
        points, ids, weights = [0.0] * (5 * POINT), [0] * 10, [0.0] * 10
        if rng.random() < 0.5:
            weights[AXIS:] = rng.normal(size=3).tolist()
        with reproducible(case):
            limits = S.Limits(boolean, bodies.radius, limit, bodies.error, 128)
            start = S.begin(bodies.pair, points, ids, weights, limits)
            # The signed gap along any direction is at most the distance of bodies apart.
            sense = -1.0 if bodies.ordered.flip else 1.0
            if start.status == S.APART:
                axis = np.array(weights[AXIS:])
                assert abs(np.linalg.norm(axis) - 1.0) <= 4e-16
                along = naive.clearance_along(case, -sense * axis)
                assert along >= start.lower - bodies.error > limit
                assert np.abs(weights[NEAREST_POINT:AXIS] - start.lower * axis).max() <= 1e-15 * (1 + start.lower)
                seen["balls" if start.n_points == 0 else "plane"] += 1
                continue
            if start.lower > -math.inf:
                along = naive.clearance_along(case, sense * np.array(start.d) / start.length)
                assert abs(along - start.lower) <= bodies.error and start.lower - bodies.error <= limit
            count, coarse = S.first_simplex(bodies.pair, points, ids, weights, 0, start)
            a, b = (
                world_points(shape.points[ids[which : 2 * count : 2]], X)
                for which, (shape, X) in enumerate(zip(bodies.shapes, bodies.X))
            )
            simplex = [[x - y for x, y in zip(p, q)] for p, q in zip(a, b)]
            for k, true in enumerate(simplex):
                assert all(abs(x - float(y)) <= bodies.error for x, y in zip(points[POINT * k :], true))
            square = nearest_to_origin(simplex).square
            v = np.array(weights[NEAREST_POINT:AXIS])
            assert abs(np.linalg.norm(v) - math.sqrt(float(square))) <= 1e-13
            assert abs(sum(weights[:count]) - 1.0) <= 1e-15 and min(weights[:count]) > 0.0
            assert not coarse or (n >= 64 and (boolean or start.began_coarse))
            seen["surrounded" if count > 1 else "one point"] += 1
            seen["coarse"] += bool(coarse)
    assert seen["one point"] >= 3 and (not boolean or (seen["balls"] >= 2 and seen["plane"] >= 1)), seen
    assert (seen["surrounded"] >= 1) == (n > 32) and (seen["coarse"] >= 3) == (n >= 64), seen
