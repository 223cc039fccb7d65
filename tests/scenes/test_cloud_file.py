"""Clouds in scene files, inline or in files of their own: read back as they were, refused where they lie."""

from __future__ import annotations

import json
import pickle
import zipfile

import numpy as np
import pytest

import collide
from collide.errors import CollideError
from collide.scenes import load, save
from collide.scenes.loaders import cloud_file

HEADER = b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (9, 3), }"
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


@pytest.mark.parametrize("write", [np.savez, np.savez_compressed])
def test_points_in_a_file_of_their_own(write, tmp_path):
    write(tmp_path / "scan.npz", points=POINTS.astype(np.float32), radius=0.02, colour=np.zeros(50))
    cloud = scene_of(tmp_path, "mm", file="scan.npz").bodies[0].shape
    assert cloud == collide.PointCloud(POINTS.astype(np.float32), 0.02), "the file's own unit"
    other = scene_of(tmp_path, "mm", file="scan.npz", radius=5, scale=0.5).bodies[0].shape
    assert other == collide.PointCloud(POINTS.astype(np.float32).astype(float) * 0.5, 0.005)


def test_points_that_are_not_finite_are_refused_or_counted(tmp_path):
    points = POINTS.copy()
    points[[3, 7]] = np.nan
    np.savez(tmp_path / "scan.npz", points=points)
    with pytest.raises(CollideError, match=r"scan.npz: .*finite"):
        scene_of(tmp_path, file="scan.npz")
    scene = scene_of(tmp_path, file="scan.npz", drop_invalid=True)
    assert len(scene.bodies[0].shape) == 48 and scene.notes == ["scan.npz: 2 points that are not finite were left out"]
    assert scene.bodies[0].approximation is None


def test_what_is_no_cloud_is_refused_with_its_place(tmp_path):
    np.savez(tmp_path / "other.npz", vertices=POINTS)
    np.savez(tmp_path / "flat.npz", points=POINTS[:, :2])
    np.savez(tmp_path / "words.npz", points=np.array(["a"]))
    np.savez(tmp_path / "pickled.npz", points=np.array([{}], dtype=object))
    (tmp_path / "text.npz").write_text("0 0 0")
    (tmp_path / "a.xyz").write_text("0 0 0")
    with zipfile.ZipFile(tmp_path / "cut.npz", "w") as members:
        members.writestr("points.npy", HEADER)
    ends = [[0, 0, 0]]
    for cloud, complaint in (
        ({"file": "other.npz"}, r'other.npz: has no array "points"'),
        ({"file": "flat.npz"}, "flat.npz: PointCloud: points"),
        ({"file": "words.npz"}, "words.npz: .*no real numbers"),
        ({"file": "pickled.npz"}, "pickled.npz: is no file of arrays"),
        ({"file": "text.npz"}, "text.npz: is no file of arrays"),
        ({"file": "cut.npz"}, "cut.npz: is no file of arrays"),
        ({"file": "a.xyz"}, "unknown format of points"),
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


def test_a_file_that_unpacks_to_too_much_is_refused_unread(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "scan.npz", points=np.zeros((10_000, 3)))
    monkeypatch.setattr(cloud_file, "LARGEST_MESH", 200_000)
    with pytest.raises(CollideError, match="unpacks to more than"):
        scene_of(tmp_path, file="scan.npz")
