"""Forward kinematics against a plain computation of matrix products, and one by one against batches."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive import random_pose, rng_of
from random_robots import TYPES, plain_link_poses, random_configurations, random_robot

from collide.robots.kinematic_tree import Joint
from collide.robots.robot import Robot


@pytest.mark.parametrize("seed", range(20))
def test_equal_to_a_plain_computation(seed):
    rng = rng_of("forward kinematics", seed)
    robot = random_robot(rng, n_links=int(rng.integers(2, 12)))
    Q = random_configurations(rng, robot, 10)
    X_WLs = robot.link_poses(Q)
    for q, X_WL in zip(Q, X_WLs):
        expected = plain_link_poses(robot, q)
        for k, link in enumerate(robot.links):
            error = np.abs(X_WL[k] - expected[link]).max()
            assert error <= 1e-12, f"seed {seed}, q = {q.tolist()}: {link} is off by {error:.2e}"


def test_every_kind_of_joint_comes_up():
    kinds = {joint.type for seed in range(20) for joint in random_robot(rng_of("forward kinematics", seed)).joints}
    mimics = [j for seed in range(20) for j in random_robot(rng_of("forward kinematics", seed)).joints if j.mimic]
    assert kinds == set(TYPES) and len(mimics) >= 5


def test_one_row_gives_the_same_bits_as_in_a_batch():
    rng = rng_of("rows of a batch")
    robot, X_WR = random_robot(rng, n_links=9), random_pose(rng)
    Q = random_configurations(rng, robot, 50)
    together = robot.link_poses(Q, X_WR)
    for k, q in enumerate(Q):
        assert robot.link_poses(q, X_WR).tobytes() == together[k].tobytes()


@pytest.mark.parametrize("axis", [*np.eye(3), *-np.eye(3)])
def test_turning_about_a_coordinate_axis_leaves_exact_zeros_and_ones(axis):
    robot = Robot("turn", ["base", "link"], [Joint("joint", "continuous", "base", "link", np.eye(4), axis)])
    for angle in (0.0, 1e-9, 0.3, -2.0, math.pi, 7.0, 1e5):
        X = robot.link_poses([angle])[0, 1]
        k = int(np.argmax(np.abs(axis)))
        assert X[k, k] == 1.0 and not X[k, [i for i in range(3) if i != k]].any() and not X[:3, 3].any()
        u, v = (k + 1) % 3, (k + 2) % 3
        assert abs(X[u, u] - math.cos(angle)) <= 3e-16 and abs(X[v, u] - axis[k] * math.sin(angle)) <= 3e-16


@pytest.mark.parametrize("angle", [1e6, 1e7, -3e9, 1e15, 1e300])
def test_angles_of_many_turns_still_give_rotations(angle):
    robot = Robot("turn", ["base", "link"], [Joint("joint", "continuous", "base", "link", np.eye(4), (0.6, 0.0, 0.8))])
    R = robot.link_poses([angle])[0, 1, :3, :3]
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-14) and np.linalg.det(R) > 0
    if abs(angle) <= 1e7:
        assert abs((np.trace(R) - 1) / 2 - math.cos(angle)) <= 1e-8
