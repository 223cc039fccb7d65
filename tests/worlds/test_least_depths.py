"""``depth="least"`` of Worlds and reports: rows of `collide.distance`, pair by pair."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.reports import report
from collide.scenes.description import Scene, SceneBody

#: An L of two boxes, with its inner corner up: 2 m to push a ball down and through, 0.15 m to lift the ball.
L = collide.Compound(
    [(collide.Box((2.0, 1.0, 2.0)), collide.pose()), (collide.Box((1.0, 1.0, 1.0)), collide.pose((1.5, 0.0, -0.5)))]
)
BALL = collide.Compound([(collide.Sphere(0.1), collide.pose()), (collide.Box((0.1, 0.1, 0.1)), collide.pose())])
PLACES = {"l": (L, (0.0, 0.0, 0.0)), "ball": (BALL, (0.2, 0.1, 0.95)), "away": (BALL, (5.0, 0.0, 0.0))}


def test_rows_of_a_world_are_those_of_distance():
    world = collide.World()
    ids = {name: world.add(shape, collide.pose(p), name=name) for name, (shape, p) in PLACES.items()}
    expected = collide.distance(L, BALL, np.eye(4), collide.pose(PLACES["ball"][1]), depth="least")
    for rows in (world.collisions(depth="least").rows, world.distances(max_distance=1.0, depth="least").rows):
        assert len(rows) == 1 and (rows[0]["a"], rows[0]["b"]) == (ids["l"], ids["ball"])
        for name in ("distance", "lower", "upper"):
            assert rows[0][name] == getattr(expected, name)
    assert -0.16 < expected.lower <= expected.upper <= -0.14
    quick = world.collisions().rows[0]
    assert quick["lower"] <= expected.lower and quick["upper"] <= expected.upper
    with pytest.raises(collide.InvalidArgument, match="depth"):
        world.collisions(depth="deepest")


def test_a_report_tells_how_depths_were_asked():
    scene = Scene("l and ball", [SceneBody(name, shape, collide.pose(p)) for name, (shape, p) in PLACES.items()])
    asked = {depth: report.make(scene, depth=depth).to_dict() for depth in ("quick", "least")}
    for depth, data in asked.items():
        assert data["query"]["depth"] == depth and len(data["colliding"]) == 1
    least = asked["least"]["colliding"][0]
    assert -0.16 < least["lower"] <= least["upper"] <= -0.14
