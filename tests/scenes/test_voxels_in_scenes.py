"""Grids, octrees and terrain with holes in scene files: read back as they were, refused where they lie."""

from __future__ import annotations

import json

import numpy as np
import pytest

import collide
from collide.errors import CollideError
from collide.scenes import load, save


def scene_of(folder, **voxels):
    body = {"name": "map", "shape": {"voxels": voxels}, "static": True}
    (folder / "s.json").write_text(json.dumps({"collide": 1, "bodies": [body]}))
    return load(folder / "s.json").bodies[0].shape


def test_grids_come_back(tmp_path):
    rng, world = np.random.default_rng(1), collide.World()
    grids = [
        collide.VoxelGrid(rng.random((5, 4, 3)) < 0.5, 0.1), collide.VoxelGrid([(0, -7, 3)], (0.1, 0.2, 1 / 3)),
        collide.VoxelGrid([(1, 2, 3)], 0.5, collide.pose((1, 2, 3), rpy=(0.1, 0.2, 0.3))),
    ]
    for k, grid in enumerate(grids):
        world.add(grid, name=f"grid {k}")
    heights = rng.random((4, 5))
    heights[1, 2] = np.nan
    world.add(collide.HeightField(heights, 0.5), name="hills")
    save(world, tmp_path / "scene.json")
    again = load(tmp_path / "scene.json").bodies
    for body, grid in zip(again, grids):
        assert np.array_equal(body.shape.cells, grid.cells) and np.array_equal(body.shape.cell, grid.cell)
        assert np.array_equal(body.shape.X, grid.X)
    assert np.array_equal(again[3].shape.heights, heights, equal_nan=True)


def test_maps_in_files_of_their_own(tmp_path):
    tree = collide.OcTree(([[0, 0, 0], [2, 0, 0]], [1, 0], [3.5, -2.0]), 0.25)
    tree.save(tmp_path / "map.bt")
    read = scene_of(tmp_path, file="map.bt", threshold=0.7, pose={"xyz": [1, 0, 0]})
    assert np.array_equal(read.cells, tree.cells) and read.X[0, 3] == 1.0 and read.threshold == 0.7
    assert scene_of(tmp_path, file="map.bt", unknown="occupied").count > tree.count
    grid = collide.VoxelGrid([(0, 1, 2)], 0.25)
    grid.save(tmp_path / "grid.binvox")
    again = scene_of(tmp_path, file="grid.binvox")  # its cells are numbered from the least
    assert np.array_equal(again.cells * 0.25 + again.X[:3, 3], grid.cells * 0.25)


def test_what_is_no_map_is_refused_with_its_place(tmp_path):
    collide.VoxelGrid([(0, 1, 2)], 0.25).save(tmp_path / "grid.binvox")
    (tmp_path / "text.bt").write_text("no map")
    cells = [[0, 0, 0]]
    for voxels, match in (
        ({"cells": cells}, "'cell' is missing"), ({"cell": 0.1}, "'cells' is missing"),
        ({"cells": [[0.5, 0, 0]], "cell": 0.1}, "whole numbers"), ({"cells": cells, "cell": -1}, "cell must be > 0"),
        ({"cells": cells, "cell": 0.1, "threshold": 0.5}, "'threshold' goes with a file"),
        ({"file": "grid.binvox", "cell": 1}, "'cell' stands in place of a file"),
        ({"file": "grid.binvox", "threshold": 0.5}, "give the file alone"), ({"file": "text.bt"}, "text.bt"),
        ({"file": "none.bt"}, "cannot find"), ({"cells": cells, "cell": 0.1, "size": 2}, "unknown key"),
    ):
        with pytest.raises(CollideError, match=match):
            scene_of(tmp_path, **voxels)
