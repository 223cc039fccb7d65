"""`nearest_points` has the numbers of `distance`, whatever is asked."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.adapters.hosts.nearest_points import nearest_points

RING = collide.Mesh(*collide.tessellate(collide.Sphere(0.5), tolerance=1e-2))
SHAPES = [
    collide.Box((1, 2, 3)), collide.Sphere(0.7), collide.Cylinder(0.4, 1.0), RING, collide.Halfspace((0, 0, 1), 0.1),
    collide.Compound([(collide.Sphere(0.3), np.eye(4)), (collide.Box((1, 1, 1)), collide.pose((1, 0, 0)))]),
]


@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize("A", SHAPES, ids=lambda shape: type(shape).__name__)
def test_the_fields_are_those_of_distance(A, signed):
    rng, n_hits = np.random.default_rng(3), 0
    for B in SHAPES[:4]:
        for X_WB in (collide.pose(1.3 * rng.normal(size=3), rpy=rng.normal(size=3)) for _ in range(12)):
            r = collide.distance(A, B, np.eye(4), X_WB, signed=signed)
            middle = 0.5 * r.point_a + 0.5 * r.point_b
            expected = r.distance, r.normal, r.point_a, r.point_b, middle, r.part_a, r.part_b, r.hit
            found = nearest_points(A, B, np.eye(4), X_WB, signed)
            assert [np.asarray(value).tolist() for value in found] == [np.asarray(value).tolist() for value in expected]
            assert all(value.flags.writeable and value.flags.owndata for value in found[1:5])
            n_hits += r.hit
    assert 4 < n_hits < 44


def test_what_is_no_pose_is_told():
    with pytest.raises(collide.InvalidPose):
        nearest_points(SHAPES[0], SHAPES[1], np.eye(4), np.full((4, 4), np.nan))
    with pytest.raises(collide.InvalidPose):
        nearest_points(SHAPES[0], SHAPES[1], np.eye(4), 3.0)
