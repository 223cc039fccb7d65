"""The order of points along a curve; trees over points are tested where clouds are."""

from __future__ import annotations

import numpy as np
import pytest
from naive import rng_of

from collide.fields.point_tree import numbers_along_curve


@pytest.mark.parametrize("scale, shift", [(1.0, 0.0), (1e-30, 0.0), (1e49, 0.0), (1.0, 1e9)])
def test_points_next_to_each_other_in_order_are_near(scale, shift):
    points = rng_of("curve", scale).uniform(-1.0, 1.0, (5000, 3)) * scale + shift
    order = numbers_along_curve(points)
    assert order.dtype == np.int32 and np.array_equal(np.sort(order), np.arange(5000))
    steps, shuffled = (np.linalg.norm(np.diff(some, axis=0) / scale, axis=1).mean() for some in (points[order], points))
    assert 8.0 * steps < shuffled, (steps, shuffled)


def test_points_without_an_order_keep_theirs():
    for points in (np.zeros((0, 3)), np.ones((4, 3)), np.array([[0.0, 0, 0], [5e-324, 0, 0], [0, 0, 0]])):
        assert numbers_along_curve(points).tolist() == list(range(len(points)))
