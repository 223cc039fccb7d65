"""Clouds in scene files, inline or in files of their own: read back as they were, refused where they lie."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest

import collide
from collide.errors import CollideError
from collide.scenes import load, save

POINTS = np.random.default_rng(0).normal(size=(50, 3))


def scene_of(folder, units="m", **cloud):
    body = {"name": "scan", "shape": {"cloud": cloud}, "static": True}
    (folder / "s.json").write_text(json.dumps({"collide": 1, "units": units, "bodies": [body]}))
    return load(folder / "s.json")


@pytest.mark.parametrize("radius", [0.0, 0.01, np.linspace(0.0, 1 / 3, 50)], ids=["points", "one", "each"])
def test_a_cloud_comes_back(radius, tmp_path):
    cloud = collide.PointCloud(POINTS, radius)
    world = collide.World()
    world.add(cloud, name="scan")
    world.add(collide.Sphere(0.2), name="ball")
    save(world, tmp_path / "scene.json")
    again = load(tmp_path / "scene.json")
    assert again.bodies[0].shape == cloud and np.ndim(again.bodies[0].shape.radius) == np.ndim(radius)
    rows = world.distances(max_distance=1.0).rows
    assert len(rows) == 1
    for kept in (again.world(), pickle.loads(pickle.dumps(world))):
        assert kept.distances(max_distance=1.0).rows.tobytes() == rows.tobytes()


def test_points_in_the_file_itself_are_in_its_units(tmp_path):
    one = scene_of(tmp_path, "mm", points=[[0, 0, 1000]], radius=250).bodies[0].shape
    assert one == collide.PointCloud([[0, 0, 1]], 0.25)
    each = scene_of(tmp_path, points=[[0, 0, 1], [1, 0, 0]], radius=[0.1, 0.2]).bodies[0].shape
    assert each == collide.PointCloud([[0, 0, 1], [1, 0, 0]], [0.1, 0.2])


@pytest.mark.parametrize("name", ["scan.npz", "scan.xyz", "scan.pcd", "scan.ply"])
def test_points_in_a_file_of_their_own(name, tmp_path):
    collide.PointCloud(POINTS, 0.02).save(tmp_path / name)
    cloud = scene_of(tmp_path, "mm", file=name).bodies[0].shape
    assert cloud == collide.PointCloud(POINTS, 0.02 if name == "scan.npz" else 0.0), "the file's own unit and radius"
    changed = scene_of(tmp_path, "mm", file=name, radius=5, scale=0.5).bodies[0].shape
    assert changed == collide.PointCloud(POINTS * 0.5, 0.005)


def test_points_that_are_not_finite_are_refused_or_counted(tmp_path):
    points = POINTS.copy()
    points[[3, 7]] = np.nan
    np.savetxt(tmp_path / "scan.xyz", points)
    with pytest.raises(CollideError, match=r"scan.xyz: .*finite"):
        scene_of(tmp_path, file="scan.xyz")
    scene = scene_of(tmp_path, file="scan.xyz", drop_invalid=True)
    assert len(scene.bodies[0].shape) == 48 and scene.notes == ["scan.xyz: 2 points that are not finite were left out"]
    assert scene.bodies[0].approximation is None


def test_what_is_no_cloud_is_refused_with_its_place(tmp_path):
    np.savez(tmp_path / "other.npz", vertices=POINTS)
    (tmp_path / "text.npz").write_text("0 0 0")
    (tmp_path / "words.xyz").write_text("a b c")
    (tmp_path / "a.stl").write_text("0 0 0")
    ends = [[0, 0, 0]]
    for cloud, complaint in (
        ({"file": "other.npz"}, "other.npz: .*another format"),
        ({"file": "text.npz"}, "text.npz: "),
        ({"file": "words.xyz"}, "words.xyz: "),
        ({"file": "a.stl"}, "unknown format of points"),
        ({"file": "gone.npz"}, r'bodies\[0\] "scan".shape.cloud.file: cannot find'),
        ({"points": ends, "file": "other.npz"}, "'points' stands in place of a file"),
        ({}, "either points, or a file"),
        ({"points": ends, "scale": 2}, "'scale' goes with a file"),
        ({"file": "other.npz", "scale": 0}, "must be above 0, got 0"),
        ({"points": ends, "radius": -1}, r'shape.cloud: PointCloud: radius must be'),
        ({"points": []}, "cloud"),
        ({"points": ends, "radius": [1, 2]}, "shape.cloud: PointCloud: radius"),
        ({"points": ends, "size": 1}, "unknown key"),
    ):
        with pytest.raises(CollideError, match=complaint):
            scene_of(tmp_path, **cloud)
    with pytest.raises(CollideError, match="Compound"):
        (tmp_path / "c.json").write_text(json.dumps(
            {"collide": 1, "bodies": [{"name": "a", "shape": {"compound": [{"shape": {"cloud": {"points": ends}}}]}}]}))
        load(tmp_path / "c.json")
