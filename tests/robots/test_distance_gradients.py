"""Gradients of the nearest pair's distance against central differences: gaps, overlaps, hulls, meshes, swollen bodies.

A gradient is right, or NaN with a reason that is told; how many are of which kind is asserted, too.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from random_robots import DEMO, asked_one_by_one, random_configurations, random_link_shape, random_robot, slider

import collide
from collide.robots.robot_distances import NO_GRADIENT

STEP = 1e-6
ROBOTS = {"ur5": "ur_description/urdf/ur5_robot.urdf", "panda": "panda_description/urdf/panda.urdf",
          "xarm": "xarm_description/urdf/xarm7.urdf"}
needs_robots = pytest.mark.skipif(DEMO is None, reason="example-robot-data is not installed")


def differences(checker, q: np.ndarray, names) -> np.ndarray | None:
    """(dof,) central differences of the distance; None where another pair is the nearest a step away."""
    steps = STEP * np.eye(len(q))
    both = checker.distances(np.concatenate([q + steps, q - steps]))
    if set(both.names) != {names}:
        return None
    return (both.distance[: len(q)] - both.distance[len(q) :]) / (2 * STEP)


def judged(checker, Q, told: str, tolerance: float = 2e-4) -> Counter:
    """How many configurations are of which kind: "gap" and "overlap" where the gradient was found right, else the
    reason, "no gradient where …"; those next to a kink do not count."""
    measured, counts = checker.distances(Q), Counter()
    for k, reason in enumerate(measured.no_gradient):
        is_nan = np.isnan(measured.gradient[k])
        say = f"{told}, q = {Q[k].tolist()}: {measured.rows[k]}, {reason}, {measured.gradient[k]}"
        assert is_nan.all() if reason else not is_nan.any(), say
        if reason:
            counts[reason] += 1
            continue
        assert measured.certified[k], say
        expected = differences(checker, Q[k], measured.names[k])
        if expected is None:
            counts["kink"] += 1
            continue
        # Where a witness jumps between q − step and q + step, one side's difference is as good as the other's.
        assert np.abs(expected - measured.gradient[k]).max() <= tolerance * (1 + np.abs(expected).max()), say
        counts["overlap" if measured.hit[k] else "gap"] += 1
    return counts


def boxes_around(rng, n: int = 6) -> collide.World:
    world = collide.World()
    for k in range(n):
        world.add(collide.Box(rng.uniform(0.05, 0.3, 3)), random_pose(rng, 0.8), name=f"box{k}", static=True)
    return world


@needs_robots
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("meshes", ["hull", "mesh"])
def test_shipped_robots(name, meshes):
    rng = rng_of("gradients of shipped robots", name)
    robot = collide.Robot.load(DEMO / ROBOTS[name], meshes=meshes)
    checker = collide.RobotChecker(robot, boxes_around(rng))
    Q = random_configurations(rng, robot, 40)
    hits = checker.collides(Q)
    Q = np.concatenate([Q[~hits][:10], Q[hits][:8]])
    counts = judged(checker, Q, f"{name}, {meshes}")
    n_hits = min(int(hits.sum()), 8)
    assert counts["gap"] >= 8 and n_hits >= 3, counts
    if meshes == "hull":
        assert counts["overlap"] >= n_hits - 1, counts
    else:
        assert counts[NO_GRADIENT["depth"]] + counts["overlap"] >= n_hits - 1, counts


def test_random_robots_of_every_shape():
    """Curved links and unions, joints of every kind, meshes among what is around, padding and margins."""
    counts: Counter = Counter()
    for seed in range(10):
        rng = rng_of("gradients of random robots", seed)
        robot = random_robot(rng, n_links=5, size=0.2)
        world = boxes_around(rng, 2)
        dented = collide.Mesh(*collide.tessellate(collide.Sphere(0.2), size=0.15)[:2])
        corners = np.where(np.arange(len(dented.vertices))[:, None] % 3 == 0, 0.6, 1.0) * dented.vertices
        world.add(collide.Mesh(corners, dented.faces), random_pose(rng, 0.6), name="dented", margin=0.02 * (seed % 2))
        world.add(random_link_shape(rng, 0.3), random_pose(rng, 0.6), name="other")
        checker = collide.RobotChecker(robot, world, padding=0.01 * (seed % 3))
        counts += judged(checker, random_configurations(rng, robot, 12), f"seed {seed}")
    assert counts["gap"] >= 25 and counts["overlap"] >= 40 and 0 < counts[NO_GRADIENT["depth"]] < 30, counts
    assert counts[NO_GRADIENT["bracket"]] < 5, counts


def test_every_reason_is_told():
    notch = collide.Compound([(collide.Mesh(*collide.tessellate(collide.Box((0.2, 0.2, 0.2)))[:2]), pose(t=(x, 0, 0)))
                              for x in (0.0, 0.3)])
    world = collide.World()
    world.add(collide.Box((0.5, 0.5, 0.5)), pose(t=(1.0, 0, 0)), name="wall")
    ball = collide.RobotChecker(slider(collide.Sphere(0.25)), world)
    measured = ball.distances([[-1.0], [0.0], [0.5], [0.75]], max_distance=1.0)
    assert measured.no_gradient == [NO_GRADIENT["beyond"], None, NO_GRADIENT["touching"], None]
    assert measured.gradient[[1, 3], 0].tolist() == [-1.0, -1.0] and np.isnan(measured.gradient[[0, 2], 0]).all()
    two = collide.RobotChecker(slider(collide.Compound([(collide.Sphere(0.1), np.eye(4)), *notch.items])), world)
    assert two.distances([[0.0], [0.6]]).no_gradient == [None, None]  # meshes that are their hulls
    shell = collide.Mesh(*collide.tessellate(collide.Box((0.2, 0.2, 0.2)))[:2], solid=False)
    of_shell = collide.RobotChecker(slider(shell), world).distances([[0.0], [0.7]])
    assert of_shell.no_gradient == [None, NO_GRADIENT["depth"]] and not of_shell.certified[1]


def test_reasons_speak_of_the_pair_named():
    """A hull deep in a wall, and a mesh deeper in another: that the mesh's is named, and that its depth is a bound."""
    rng, n_named = rng_of("named pair"), 0
    for _ in range(10):
        shell = collide.Mesh(*collide.tessellate(collide.Box((0.4, 0.4, 0.4)))[:2], solid=False)
        world = collide.World()
        world.add(shell, random_pose(rng, 0.2), name="shell")
        world.add(collide.Box((0.3, 0.3, 0.3)), random_pose(rng, 0.2), name="box")
        checker = collide.RobotChecker(slider(collide.Box((0.3, 0.2, 0.1))), world)
        measured = checker.distances([[0.0]])
        (pairs,) = asked_one_by_one(checker, np.zeros((1, 1)), collide.distance)
        assert measured.lower[0] <= min(pair.lower for pair in pairs) + 1e-12
        is_mesh = measured.names[0] is not None and measured.names[0][1] == "shell"
        assert (measured.no_gradient[0] == NO_GRADIENT["depth"]) == (is_mesh and bool(measured.hit[0]))
        n_named += is_mesh
    assert 2 <= n_named <= 9, n_named
