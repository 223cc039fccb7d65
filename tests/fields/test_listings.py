"""Lists of what matches, longer than the first arrays."""

import numpy as np
import pytest

import collide


@pytest.mark.parametrize("n", [255, 256, 257, 5000])
def test_points_and_cells_within_a_box_are_all_listed(n):
    places = np.column_stack([np.arange(n), np.zeros(n), np.zeros(n)])
    cloud, grid = collide.PointCloud(places, 0.1), collide.VoxelGrid.from_points(places, 1.0)
    low, high = np.array([-1.0, -1.0, -1.0]), np.array([n - 0.5, 1.0, 1.0])
    np.testing.assert_array_equal(cloud.tree.in_box(low, high), np.arange(n))
    boxes = grid.tree.boxes_in(*grid.tree.range_of(low, high))
    assert int(boxes.size.prod(axis=1).sum()) == n
    assert (np.diff(boxes.numbers) > 0).all()
