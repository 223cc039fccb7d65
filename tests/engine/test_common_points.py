"""Without depths, bodies that meet are told a point of both: it lies on both, however thin, swept or barely touching
they are."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from naive import pose, rng_of

import collide
from collide.scenes.families import generate

EYE = np.eye(4)
#: A body of one point.
POINT = collide.ConvexHull([(0.0, 0.0, 0.0)])


def off(shape, X_WS, point) -> float:
    """How far a point lies from a body [m]."""
    return collide.distance(shape, POINT, X_WS, pose(t=point), check_poses=False).distance


def test_points_of_swept_bodies_are_on_both():
    """Half the difference of the radii aside, a point of both cores was up to 0.72 m outside."""
    rng = rng_of("common points of swept bodies")
    hits = 0
    for _ in range(150):
        A, B = (
            collide.ConvexHull(
                rng.normal(size=(int(rng.integers(4, 80)), 3)), radius=float(rng.choice([0.0, 0.01, 0.5, 2.0]))
            )
            for _ in range(2)
        )
        X_WB = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3.0, 3.0, 3))
        r = collide.distance(A, B, EYE, X_WB, signed=False)
        hits += bool(r.hit)
        if r.hit:
            with naive.reproducible(naive.Case(A, B, EYE, X_WB)):
                assert max(off(A, EYE, r.point_a), off(B, X_WB, r.point_a)) < 1e-14
    assert hits > 100


@pytest.mark.slow
@pytest.mark.parametrize(
    "family, worst", (("needles", 1e-9), ("plates", 1e-12), ("tiny_vs_huge", 1e-12), ("rand_pen", 1e-12))
)
def test_points_of_thin_bodies_are_on_both(family, worst):
    """Weights in a tetrahedron as thin as rounding are worth nothing: one point lay 0.45 of the size outside."""
    hits = 0
    for seed in range(20):
        for case in generate(family, 10, seed):
            A, B = collide.ConvexHull(case.P), collide.ConvexHull(case.Q)
            X_WA, X_WB = pose(case.R1, case.t1), pose(case.R2, case.t2)
            r = collide.distance(A, B, X_WA, X_WB, signed=False, check_poses=False)
            if r.hit:
                hits += 1
                size = np.abs(case.P).max() + np.abs(case.Q).max() + np.abs(case.t1).max() + np.abs(case.t2).max()
                with naive.reproducible(naive.Case(A, B, X_WA, X_WB)):
                    assert np.array_equal(r.point_a, r.point_b)
                    assert max(off(A, X_WA, r.point_a), off(B, X_WB, r.point_a)) < worst * size
    assert hits > 40
