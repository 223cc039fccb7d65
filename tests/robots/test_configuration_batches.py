"""Pieces of a batch: what kernels answer and what they leave to others become a verdict a configuration."""

from __future__ import annotations

import numpy as np
from naive import pose
from random_robots import slider

import collide
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.configuration_batches import check_piece
from collide.robots.forward_kinematics import (
    COLUMN,
    COORDINATE,
    FIXED,
    FLOATING,
    KIND,
    MULTIPLIER,
    OFFSET,
    PLANAR,
    ROTATION,
    ROTATION_ABOUT_COORDINATE,
    TRANSLATION,
    joint_table,
)
from collide.robots.kinematic_tree import Joint, Mimic
from collide.robots.robot import LinkShape, Robot

#: A box without its lid, an open mesh: kernels leave it to others.
CLOSED = collide.tessellate(collide.Box((0.4, 0.4, 0.4)))
LIDLESS = collide.Mesh(CLOSED.vertices, CLOSED.faces[:-2])


def checker_of(*placed: tuple, robot: Robot | None = None) -> collide.RobotChecker:
    world = collide.World()
    for k, (shape, x) in enumerate(placed):
        world.add(shape, pose(t=(x, 0, 0)), name=f"body{k}")
    return collide.RobotChecker(robot or slider(), world)


def test_what_is_left_to_others_is_asked_of_its_own_configuration():
    """A small ball within a box without lid is free; at its walls it is not; verdicts of others stay as they are."""
    checker = checker_of((LIDLESS, 0.5), (collide.Sphere(0.1), -0.5))
    q = np.array([[0.5], [0.7], [-0.5], [0.0], [0.55], [0.19], [0.9]])
    out = np.ones(len(q), dtype=bool)
    check_piece(checker, CheckWorkspace(checker.robot, checker.setting), q, out)
    assert out[:3].tolist() == [False, True, True] and not out[6]
    X_WB = pose(t=(0.5, 0, 0))
    for value, hit in zip(q[:, 0].tolist(), out.tolist()):
        ball = pose(t=(value, 0, 0))
        expected = collide.collide(collide.Sphere(0.1), LIDLESS, ball, X_WB) or abs(value + 0.5) <= 0.2
        assert hit == bool(expected), value


def test_joints_as_kernels_read_them():
    joints = [
        Joint("turn", "revolute", "base", "a", axis=np.array([0, -1.0, 0])), Joint("weld", "fixed", "a", "b"),
        Joint("slide", "prismatic", "b", "c", axis=np.array([0.6, 0, 0.8])),
        Joint("drive", "planar", "c", "d", axis=np.array([0, 0, 1.0])), Joint("fly", "floating", "d", "e"),
        Joint("bend", "continuous", "e", "f", axis=np.array([0.6, 0, 0.8]), mimic=Mimic("slide", -2.0, 0.5)),
    ]
    ball = [LinkShape(collide.Sphere(0.1), np.eye(4), None, "test")]
    table = Robot("all", [*"fedcba", "base"], joints, {"a": ball}).joint_table
    assert table.ints[:, KIND].tolist() == [ROTATION_ABOUT_COORDINATE, FIXED, TRANSLATION, PLANAR, FLOATING, ROTATION]
    assert table.ints[:, COLUMN].tolist() == [0, 0, 1, 2, 5, 1] and table.ints[0, COORDINATE] == 1
    assert (table.root, table.n_links, table.dof) == (6, 7, 11)
    assert table.doubles[:, MULTIPLIER].tolist() == [1, 1, 1, 1, 1, -2] and table.doubles[5, OFFSET] == 0.5
    empty = joint_table([], {"base": 0}, {}, {}, "base", 0)
    assert len(empty.ints) == len(empty.doubles) == 0 and empty.root == 0 and empty.n_links == 1
