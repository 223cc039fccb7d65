"""Meshes as hulls of few vertices, by the option and in scene files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from naive import rng_of

import collide
from collide.scenes import load


@pytest.fixture()
def ball(tmp_path) -> Path:
    points = rng_of("few vertices").normal(size=(300, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    collide.Mesh(points, collide.ConvexHull(points).hull.facets).save(tmp_path / "ball.obj")
    return tmp_path / "ball.obj"


def test_hulls_have_as_many_vertices_as_asked_for_and_say_how_far_they_are_off(ball):
    whole, inner, outer = (load(ball, meshes=meshes).bodies[0] for meshes in ("hull", "hull:40", "hull+:40"))
    assert len(whole.shape.points) == 300 and len(inner.shape.points) == 40 and 30 < len(outer.shape.points) <= 40
    assert {*map(tuple, inner.shape.points)} < {*map(tuple, whole.shape.points)}
    assert "40 of its 300 corners" in inner.approximation and "corners around its 300" in outer.approximation
    both = collide.ConvexHull(np.concatenate([outer.shape.points, whole.shape.points]))
    assert both.hull.vertices.max() < len(outer.shape.points), "the mesh reaches out of its outer hull"
    told = float(outer.approximation.split("at most ")[1].split(" mm")[0]) / 1000
    assert 0.0 < told < 0.5 and np.linalg.norm(outer.shape.points, axis=1).max() - 1.0 <= told * 1.001


def test_a_mesh_of_few_vertices_is_its_hull(ball):
    whole, same = (load(ball, meshes=meshes).bodies[0] for meshes in ("hull", "hull+:300"))
    assert same.shape == whole.shape and same.approximation == whole.approximation


def test_a_scaled_mesh_is_within_its_outer_hull(ball):
    whole, outer = (load(ball, meshes=meshes, scale=0.3).bodies[0].shape for meshes in ("hull", "hull+:20"))
    both = collide.ConvexHull(np.concatenate([outer.points, whole.points]))
    assert both.hull.vertices.max() < len(outer.points) <= 20


def test_scene_files_take_the_same_words(ball):
    shapes = [{"mesh": {"file": "ball.obj", "as": taken}} for taken in ("hull:16", "hull+:16")]
    scene = {"collide": 1, "bodies": [{"name": f"b{k}", "shape": shape} for k, shape in enumerate(shapes)]}
    (ball.parent / "s.json").write_text(json.dumps(scene))
    assert [len(body.shape.points) for body in load(ball.parent / "s.json").bodies] == [16, 16]


@pytest.mark.parametrize(
    ("meshes", "said"),
    [("hull:7", "N from 8 on"), ("hull+:11", "N from 12 on"), ("hull:", "must be"), ("hull-:64", "must be")],
)
def test_words_that_are_none_are_refused(ball, meshes, said):
    with pytest.raises(collide.SceneError, match=said):
        load(ball, meshes=meshes)
