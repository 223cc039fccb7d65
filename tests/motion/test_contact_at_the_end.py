"""Motions whose only contact is their last pose: equal cubes that come to lie face to face were left open."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import collide
from collide.hull.exact_hull import convex_hull

CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
CUBE = collide.Mesh(CORNERS, convex_hull(CORNERS).facets)
EYE = np.eye(4)


@pytest.mark.parametrize(
    ("A", "B"),
    [
        (CUBE, CUBE), (CUBE, collide.Box((1, 1, 1))), (collide.ConvexHull(CORNERS), collide.Cylinder(0.5, 1.0)),
        (collide.Ellipsoid((0.5, 0.5, 0.5)), CUBE), (collide.Sphere(0.5), collide.Cone(0.5, 1.0)),
    ],
)
def test_contact_in_the_last_pose_alone_is_proven(A, B):
    last = np.array([0.0, 0.0, -1.0]) if isinstance(B, collide.Cone) else np.array([1.0, 0.0, 0.0])
    start = collide.pose(3.0 * last)
    r = collide.time_of_impact(A, B, EYE, EYE, start, collide.pose(last))
    assert r.hit and r.upper == 1.0 and 1.0 - 1e-8 <= r.lower <= 1.0 and r.certified
    assert not collide.time_of_impact(A, B, EYE, EYE, start, collide.pose(last * (1.0 + 1e-6))).hit
