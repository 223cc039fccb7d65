"""Random configurations: the same rows however they are split, within the limits, evenly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plain_robots import joint, robot_of

from collide import Sphere
from collide.sweeps.random_configurations import random_configurations, sampled_limits, unlimited_lengths


@pytest.fixture(scope="module")
def robot():
    """One joint of every kind, some without limits, some far from 0."""
    links = [f"l{k}" for k in range(9)]
    inf = math.inf
    joints = [
        joint("narrow", "revolute", "l0", "l1", lower=-0.5, upper=1.5),
        joint("turn", "continuous", "l1", "l2", lower=-inf, upper=inf),
        joint("wide", "revolute", "l2", "l3", lower=-30.0, upper=30.0),
        joint("high", "revolute", "l3", "l4", lower=5.0, upper=50.0),
        joint("low", "revolute", "l4", "l5", lower=-50.0, upper=-5.0),
        joint("slide", "prismatic", "l5", "l6", lower=0.2, upper=0.3),
        joint("rail", "prismatic", "l6", "l7", lower=1.0, upper=inf),
        joint("base", "planar", "l7", "l8", lower=-inf, upper=inf),
    ]
    return robot_of(links, joints, {link: (Sphere(0.1), (0, 0, 0)) for link in links})


def test_limits(robot):
    lower, upper = sampled_limits(robot)
    pi = math.pi
    expected = {
        "narrow": (-0.5, 1.5), "turn": (-pi, pi), "wide": (-pi, pi), "high": (5, 5 + 2 * pi),
        "low": (-5 - 2 * pi, -5), "slide": (0.2, 0.3), "rail": (1, 1), "base/x": (0, 0), "base/y": (0, 0),
        "base/yaw": (-pi, pi),
    }
    for name, low, high in zip(robot.joint_names, lower, upper):
        assert (low, high) == pytest.approx(expected[name]), name
    assert unlimited_lengths(robot) == ["rail", "base/x", "base/y"]
    assert (lower >= robot.lower).all() and (upper <= robot.upper).all()


def test_any_split_gives_the_same_rows(robot):
    whole = random_configurations(robot, 0, 1000, 7)
    pieces = [random_configurations(robot, a, b, 7) for a, b in ((0, 1), (1, 400), (400, 401), (401, 1000))]
    assert np.array_equal(whole, np.vstack(pieces))
    assert np.array_equal(random_configurations(robot, 10**12, 10**12 + 3, 7)[1:],
                          random_configurations(robot, 10**12 + 1, 10**12 + 3, 7))
    assert not np.array_equal(whole, random_configurations(robot, 0, 1000, 8))


def test_rows_are_spread_evenly(robot):
    Q = random_configurations(robot, 0, 20_000, 1)
    lower, upper = sampled_limits(robot)
    assert (lower <= Q).all() and (upper >= Q).all()
    moving = upper > lower
    assert moving.sum() == 7
    share = (Q[:, moving] - lower[moving]) / (upper - lower)[moving]
    # 20 equal boxes of 1,000 expected rows each: 5 standard deviations are 154.
    for column in share.T:
        counts = np.histogram(column, 20, (0, 1))[0]
        assert np.abs(counts - 1000).max() < 160
    # Columns are independent: their correlations vanish like 1 / sqrt(n).
    assert np.abs(np.corrcoef(share.T) - np.eye(7)).max() < 5 / math.sqrt(20_000)


def test_robot_without_joints():
    assert random_configurations(robot_of(["a"], [], {}), 3, 8, 0).shape == (5, 0)
