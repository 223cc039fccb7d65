"""A slider on a rail, a post in its way, and things that never move: a scene whose answers are known by hand."""

from __future__ import annotations

import numpy as np

from collide import Box, Robot, Sphere, pose
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape
from collide.scenes import Scene, SceneBody

#: The slider is a cube of 0.2 m; it meets the post at 0.5 m.
MEETS = 0.5


def slider_scene() -> Scene:
    """Joints ``slide`` (prismatic, along x) and ``lift`` (prismatic, along z) carry the slider.

    At slide = s the gap to the post is 0.5 − s. A crate stands 0.1 m beside the way, in the floor by 1 mm.
    """
    carriage = Joint("slide", "prismatic", "base", "carriage", axis=np.array([1.0, 0, 0]), lower=-1.0, upper=2.0)
    slider = Joint("lift", "prismatic", "carriage", "slider", axis=np.array([0, 0, 1.0]), lower=-1.0, upper=2.0)
    robot = Robot(
        "rail", ["base", "carriage", "slider"], [carriage, slider],
        {"slider": [LinkShape(Box((0.2, 0.2, 0.2)), np.eye(4), None, "test")]},
        states={"home": {"slide": 0.0}, "hit": {"slide": 0.6}},
    )
    scene = Scene("rail", [
        SceneBody("floor", Box((4, 4, 0.1)), pose((0, 0, -0.35)), static=True),
        SceneBody("post", Box((0.2, 0.2, 1)), pose((0.7, 0, 0)), static=True),
        SceneBody("crate", Box((0.2, 0.2, 0.2)), pose((0.35, 0.3, -0.201))),
        SceneBody("lamp", Sphere(0.1), pose((0, 0, 3))),
    ])
    scene.place_robot(robot, np.eye(4))
    return scene
