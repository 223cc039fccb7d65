"""The judge of resting pairs, judged."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("scipy", reason="Qhull finds planes of hulls")
from resting_pairs import hull_points, off_surface

import collide


def test_surfaces_are_those_of_the_hull_asked_about():
    """Corners of hulls lie on them, of hulls made and dropped in turn as by tests that each make pairs of their own."""
    rng = np.random.default_rng(0)
    for k in range(100):
        hull = collide.ConvexHull(hull_points(rng, 2 * k))  # frusta: every point is a corner
        off = off_surface(hull, np.eye(4), hull.points)
        assert (off < 1e-12).all(), (k, off.max())
