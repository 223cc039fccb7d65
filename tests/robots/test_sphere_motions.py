"""Motions of robots of spheres, eight intervals at once: free ones have no collision, times collide, and verdicts are
those of the narrowphase.
"""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from random_robots import random_configurations, random_robot, scene_of_spheres, some_spheres

import collide
from collide.robots.check_workspace import CheckWorkspace


def without_spheres(checker: collide.RobotChecker) -> collide.RobotChecker:
    """The same, asked of the narrowphase alone."""
    plain = collide.RobotChecker(checker.robot, checker.world)
    plain._spheres_among = lambda around: None
    plain._setting = None
    plain.prepare()
    assert plain.setting.spheres is None and checker.setting.spheres is not None
    return plain


def edges_of(checker: collide.RobotChecker, seed: int, n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    rng = rng_of("edges of spheres", seed)
    q0 = random_configurations(rng, checker.robot, n)
    return q0, q0 + rng.uniform(-0.7, 0.7, q0.shape) * rng.choice([0.05, 1.0], (n, 1))


def test_free_motions_have_no_sample_that_collides_and_verdicts_are_those_of_the_narrowphase():
    n_free = n_hits = n_lanes = 0
    for seed in range(10):
        checker = scene_of_spheres(rng_of("motions of spheres", seed))
        plain = without_spheres(checker)
        q0, q1 = edges_of(checker, seed)
        edges, known = checker.certify_edges(q0, q1, resolution=0.01), plain.certify_edges(q0, q1, resolution=0.01)
        for k in range(len(q0)):
            if edges.free[k]:
                samples = q0[k] + np.linspace(0, 1, 200)[:, None] * (q1[k] - q0[k])
                assert not plain.collides(samples).any(), (seed, k, q0[k].tolist(), q1[k].tolist())
                assert not known.collides[k], (seed, k)
            elif edges.collides[k]:
                assert plain.collides(q0[k] + edges.time[k] * (q1[k] - q0[k])), (seed, k)
                assert not known.free[k], (seed, k)
        assert (edges.is_open <= ~known.free).all() and edges.is_open.mean() < 0.1
        sampled = checker.edge_collides(q0, q1, resolution=0.02)
        assert (sampled == plain.edge_collides(q0, q1, resolution=0.02)).all() and not (sampled & edges.free).any()
        n_free, n_hits = n_free + int(edges.free.sum()), n_hits + int(edges.collides.sum())
        n_lanes += edges.n_checked % 8 == 0
    assert n_free > 60 and n_hits > 60, (n_free, n_hits)
    assert n_lanes >= 2, n_lanes  # in some worlds no interval went on to the narrowphase


def test_motions_that_graze_are_decided_by_the_narrowphase():
    """A ball on an arm passes another at a gap, or an overlap, of a nanometre, in the middle of the way."""
    joint = collide.robots.kinematic_tree.Joint(
        "turn", "revolute", "base", "arm", np.eye(4), (0, 0, 1.0), lower=-3.0, upper=3.0)
    ball = collide.robots.robot.LinkShape(collide.Sphere(0.1), pose(t=(1.0, 0, 0)), None, "test")
    robot = collide.Robot("arm", ["base", "arm"], [joint], {"arm": [ball]})
    for gap, free in ((1e-9, False), (-1e-9, False), (1e-4, True), (-1e-4, False)):
        world = collide.World()
        world.add(collide.Sphere(0.2), pose(t=(1.3 + gap, 0, 0)))
        edges = collide.RobotChecker(robot, world).certify_edges([[-0.5003]], [[0.5]], resolution=1e-6)
        assert edges.free.tolist() == [free], gap
        assert edges.collides.tolist() == [gap == -1e-4] if abs(gap) == 1e-4 else not edges.collides[0] or gap < 0.0


@pytest.mark.parametrize("types", [("planar",), ("floating",), ("prismatic",), ("revolute", "continuous")])
def test_bounds_in_lanes_are_those_of_the_kernel_alone(types):
    """A motion through free space: intervals that spheres prove free are free by dense samples of balls' distances."""
    for seed in range(6):
        rng = rng_of("bounds in lanes", *types, seed)
        robot = random_robot(rng, n_links=4, types=types, shape=some_spheres, size=0.08)
        world = collide.World()
        for k in range(4):
            world.add(collide.Box(rng.uniform(0.1, 0.3, 3)), random_pose(rng, 1.2), name=f"box{k}")
        checker = collide.RobotChecker(robot, world)
        plain = without_spheres(checker)
        q0 = random_configurations(rng, robot, 20)
        q1 = q0 + rng.uniform(-1.0, 1.0, q0.shape)
        edges = checker.certify_edges(q0, q1, resolution=0.05)
        for k in np.flatnonzero(edges.free):
            samples = q0[k] + np.linspace(0, 1, 400)[:, None] * (q1[k] - q0[k])
            assert not plain.collides(samples).any(), (types, seed, k)


def test_workspaces_hold_the_intervals_of_long_motions():
    """A motion of a thousand radians, some of it past an obstacle, leaves no interval out."""
    checker = scene_of_spheres(rng_of("long motions", 3))
    plain = without_spheres(checker)
    q0 = random_configurations(rng_of("long", 1), checker.robot, 6)
    q1 = q0 + 1000.0
    edges, known = checker.certify_edges(q0, q1, resolution=1.0), plain.certify_edges(q0, q1, resolution=1.0)
    assert not (edges.free & known.collides).any() and not (known.free & edges.collides).any()
    assert isinstance(checker._workspace(checker.setting), CheckWorkspace)
