"""Clouds in a drawing: every point in its row, as near as is said, however many there are."""

from __future__ import annotations

import base64
import json
import re

import numpy as np
import pytest

from collide import Box, PointCloud, pose
from collide.pages import drawing, drawn_shapes
from collide.pages.drawn_shapes import ShapeTable
from collide.reports import report
from collide.scenes import Scene, SceneBody


def drawn(*bodies: SceneBody) -> dict:
    scene = Scene("test", list(bodies))
    data = drawing.of_scene(scene, report.make(scene))
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    return data


def balls(shape: dict) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 3) and radii (n,) as a page reads them."""
    points = shape["points"]
    steps = np.frombuffer(base64.b64decode(points["positions"]), "<u2").reshape(-1, 3)
    centres = np.array(points["low"]) + steps / 65535 * np.array(points["extent"])
    radii = np.full(len(steps), points["radius"]) if points["radii"] is None else np.frombuffer(
        base64.b64decode(points["radii"]), "<f4")
    assert len(centres) == len(radii) == points["count"]
    return centres, radii


@pytest.mark.parametrize("radius", [0.0, 0.25, np.linspace(0.0, 0.5, 1000)], ids=["points", "one", "each"])
def test_points_are_where_they_are_to_what_is_said(radius):
    cloud = PointCloud(np.random.default_rng(0).uniform((1e6, -4, 0), (1e6 + 10, 4, 2), (1000, 3)), radius)
    data = drawn(SceneBody("scan", cloud, pose((0, 0, 1))))
    (shape,) = data["shapes"]
    centres, radii = balls(shape)
    off = np.linalg.norm(centres - cloud.points, axis=1).max()
    assert 0.2 * shape["deviation"] < off <= shape["deviation"] * (1 + 1e-6) < 0.5 * np.linalg.norm((10, 8, 2)) / 65535
    assert np.allclose(radii, cloud.radii, rtol=1e-7) and shape["triangle_count"] == 0
    ends = cloud.points + cloud.radii[:, None], cloud.points - cloud.radii[:, None]
    assert data["size"] == pytest.approx(np.ptp(np.concatenate(ends), axis=0).max()), "balls count, not centres alone"
    assert data["bodies"][0]["kind"] == "PointCloud"
    assert re.fullmatch(r"1 cloud drawn, 1000 points, at most 9\d\.\d+ µm off", data["notes"][0])


@pytest.mark.parametrize(
    "points", [[(1, 2, 3)], [(1, 2, 3), (1, 2, 3)], [(1, 2, 3), (1, 9, 3)], [(1e45, 0, 0), (0, 0, 0)]]
)
def test_clouds_without_extent_and_without_end(points):
    (shape,) = drawn(SceneBody("scan", PointCloud(points), np.eye(4)))["shapes"]
    assert np.allclose(balls(shape)[0], np.clip(points, -1e30, 1e30), atol=1e-9, rtol=1e-12)


def test_clouds_that_bodies_share_stand_once():
    rng = np.random.default_rng(1)
    cloud, same, thicker = PointCloud(points := rng.normal(size=(9, 3))), PointCloud(points), PointCloud(points, 0.1)
    shapes = cloud, same, thicker, cloud
    bodies = [SceneBody(f"b{k}", shape, pose((20.0 * k, 0, 0))) for k, shape in enumerate(shapes)]
    data = drawn(*bodies, SceneBody("box", Box((1, 1, 1)), pose((0, 90, 0))))
    assert [body["shown"] for body in data["bodies"]] == [0, 0, 1, 0, 2]
    assert data["shapes"][2]["points"] is None and data["shapes"][2]["triangle_count"] == 12


def test_of_too_many_points_each_kth_is_drawn(monkeypatch):
    monkeypatch.setattr(drawn_shapes, "MAX_POINTS", 500)
    large, small = PointCloud(np.random.default_rng(2).normal(size=(1000, 3))), PointCloud(np.eye(3))
    data = drawn(SceneBody("large", large, np.eye(4)), SceneBody("small", small, pose((50, 0, 0))))
    first, second = data["shapes"]
    assert first["points"]["every"] == 3 and first["points"]["of"] == 1000 and second["points"]["every"] == 1
    assert np.abs(balls(first)[0] - large.points[::3]).max() < 1e-4
    assert data["notes"][0].startswith("2 clouds drawn, 337 of 1003 points")


def test_a_look_may_hold_clouds_beside_triangles():
    table = ShapeTable(1.0)
    X_BS = pose((1, 0, 0), rpy=(0, 0, np.pi / 2))
    row = table.row([(PointCloud([(1, 0, 0)], 0.5), X_BS), (Box((1, 1, 1)), np.eye(4))])
    (shape,) = table.written()
    assert np.allclose(balls(shape)[0], [(1, 1, 0)]) and shape["triangle_count"] == 12 and not table.is_empty(row)
    assert np.allclose(table.boxes()[0], [(-0.5, -0.5, -0.5), (1.5, 1.5, 0.5)])


def test_a_million_points_take_eight_bytes_each():
    cloud = PointCloud(np.random.default_rng(3).uniform(size=(1_000_000, 3)))
    table = ShapeTable(1.0)
    table.row([(cloud, np.eye(4))])
    (shape,) = table.written()
    assert shape["points"]["count"] == 1_000_000 and len(json.dumps(shape)) < 8_001_000
