"""Pieces of a batch: what kernels answer and what they leave to others become one answer a configuration."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, rng_of
from random_robots import slider

import collide
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.configuration_batches import _are_among, check_piece, measure_piece
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
from collide.robots.robot_distances import NEAREST_DTYPE

#: A box without its lid, an open mesh: kernels leave it to others.
CLOSED = collide.tessellate(collide.Box((0.4, 0.4, 0.4)))
LIDLESS = collide.Mesh(CLOSED.vertices, CLOSED.faces[:-2])


def checker_of(*placed: tuple, robot: Robot | None = None) -> collide.RobotChecker:
    world = collide.World()
    for k, (shape, x) in enumerate(placed):
        world.add(shape, pose(t=(x, 0, 0)), name=f"body{k}")
    return collide.RobotChecker(robot or slider(), world)


def measured(checker, q, limit: float = np.inf):
    q = np.array(q, dtype=float)
    rows, gradient = np.zeros(len(q), dtype=NEAREST_DTYPE), np.zeros(q.shape)
    measure_piece(checker, CheckWorkspace(checker.robot, checker.setting), q, rows, gradient, limit)
    return rows, gradient


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


def test_body_number_zero_may_be_the_nearest_and_none_is_beyond():
    rows, gradient = measured(checker_of((collide.Sphere(0.1), 0.5)), [[0.0], [-3.0]], 1.0)
    assert rows["a"].tolist() == [0, -1] and rows["b"].tolist()[0] == -1
    assert rows["beyond"].tolist() == [False, True] and rows["certified"].all()
    assert rows["distance"][1] == rows["upper"][1] == np.inf and rows["lower"][1] == 1.0
    assert abs(rows["distance"][0] - 0.3) <= 1e-15 and np.isnan(gradient[1, 0]) and abs(gradient[0, 0] + 1.0) <= 1e-12


def test_of_pairs_left_to_others_the_nearest_is_found_among_convex_ones():
    """Open boxes on both sides, a ball beyond one of them: which is nearest changes with q, and so do the names."""
    checker = checker_of((LIDLESS, 1.0), (LIDLESS, -1.0), (collide.Sphere(0.05), 0.5), (LIDLESS, 3.0))
    q = np.linspace(-0.6, 0.25, 18)[:, None]
    rows, _ = measured(checker, q)
    for row, (x,) in zip(rows, q.tolist()):
        shapes = ((LIDLESS, 1.0), (LIDLESS, -1.0), (collide.Sphere(0.05), 0.5), (LIDLESS, 3.0))
        gaps = [collide.distance(collide.Sphere(0.1), shape, pose(t=(x, 0, 0)), pose(t=(at, 0, 0))).distance
                for shape, at in shapes]
        assert abs(row["distance"] - min(gaps)) <= 1e-9 and -1 - row["b"] == int(np.argmin(gaps)), (x, row, gaps)
    assert set((-1 - rows["b"]).tolist()) == {1, 2}


@pytest.mark.parametrize("limit", [0.7, 0.71, np.inf])
def test_a_search_goes_on_beyond_a_pair_that_turns_out_to_be_far(limit):
    """The hull of the lidless box holds the ball, its walls are 0.1 m away; a tiny sphere is nearer."""
    checker = checker_of((LIDLESS, 0.0), (collide.Sphere(0.01), 0.15))
    rows, _ = measured(checker, [[0.0]], limit)
    near = collide.distance(collide.Sphere(0.1), LIDLESS, np.eye(4), np.eye(4)).distance
    assert abs(rows["distance"][0] - min(near, 0.04)) <= 1e-12 and rows["b"][0] == -2


def test_rows_among_others():
    pairs = np.array([(0, 1, -1), (0, 1, -2), (5, 5, 5), (0, 1, -1)])
    assert _are_among(pairs, np.zeros((0, 3), dtype=np.int64)).tolist() == [False] * 4
    assert _are_among(pairs, pairs[:1]).tolist() == [True, False, False, True]
    assert _are_among(pairs[:1], np.array([(0, 1, 0), (1, 0, -1)])).tolist() == [False]
    assert _are_among(pairs[:0], pairs).tolist() == []
    rng = rng_of("rows among others")
    some, others = rng.integers(-2, 2, (2, 60, 3))
    expected = [tuple(row) in set(map(tuple, others.tolist())) for row in some.tolist()]
    assert _are_among(some, others).tolist() == expected and 0 < sum(expected) < 60


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
