"""Motions of meshes that are not convex: proven by their own distances, not by those of hulls."""

from __future__ import annotations

import numpy as np
from naive import pose, rng_of
from random_robots import random_configurations, random_robot, ring

import collide
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot


def test_a_rod_is_proven_to_pass_through_a_ring():
    world = collide.World()
    world.add(ring(), name="ring", static=True)
    rod = [LinkShape(collide.Capsule(0.1, 0.4), np.eye(4), None, "test")]
    joints = [Joint("slide", "prismatic", "base", "rod", np.eye(4), (0, 0, 1.0), -2.0, 2.0),
              Joint("shift", "prismatic", "rod", "tip", np.eye(4), (1.0, 0, 0), -2.0, 2.0)]
    robot = Robot("rod", ["base", "rod", "tip"], joints, {"rod": rod})
    checker = collide.RobotChecker(robot, world)
    assert ring().solid and not collide.contains(ring(), np.eye(4), np.zeros((1, 3)))[0]
    edges = checker.certify_edges([[-1.0, 0.0], [-1.0, 0.0]], [[1.0, 0.0], [-0.05, 0.0]])
    assert edges.free.all() and len(edges.open) == 0
    robot = Robot("rod", ["base", "rod", "tip"], joints, {"tip": rod})
    edges = collide.RobotChecker(robot, world).certify_edges([[-0.9, 0.0], [-1.0, 0.39]], [[0.9, 0.8], [1.0, 0.39]])
    assert edges.collides[0] and edges.free[1]


def test_a_rod_just_above_the_hole_of_a_ring_is_proven_free():
    """The hull of the ring is 10 µm away all of the way, the ring itself 0.2 m: the interval is not left open."""
    world = collide.World()
    world.add(ring(), name="ring", static=True)
    joints = [Joint("slide", "prismatic", "base", "rod", np.eye(4), (0, 0, 1.0), -2.0, 2.0),
              Joint("shift", "prismatic", "rod", "tip", np.eye(4), (1.0, 0, 0), -2.0, 2.0)]
    rod = [LinkShape(collide.Capsule(0.1, 0.4), np.eye(4), None, "test")]
    checker = collide.RobotChecker(Robot("rod", ["base", "rod", "tip"], joints, {"tip": rod}), world)
    edges = checker.certify_edges([0.35001, -0.2], [0.35001, 0.2])
    assert edges.free.all() and len(edges.open) == 0


def test_motions_of_meshes_have_no_sample_that_collides():
    decided = total = 0
    for seed in range(4):
        rng = rng_of("meshes in motion", seed)
        dented = collide.Mesh(ring().vertices * 0.2, ring().faces)
        robot = random_robot(rng, n_links=4, shape=lambda rng, size, dented=dented: dented)
        world = collide.World()
        for k in range(6):
            world.add(dented, pose(t=rng.uniform(-0.6, 0.6, 3)), name=f"ring{k}")
        checker = collide.RobotChecker(robot, world)
        Q0 = random_configurations(rng, robot, 40)
        Q0 = Q0[~checker.collides(Q0)][:8]
        Q1 = Q0 + 0.3 * rng.normal(size=Q0.shape)
        edges = checker.certify_edges(Q0, Q1, resolution=0.01)
        for k in np.flatnonzero(edges.free):
            hits = checker.collides(Q0[k] + rng.random(100)[:, None] * (Q1[k] - Q0[k]))
            assert not hits.any(), f"seed {seed}, edge {k}: proven free, and {hits.sum()} samples hit"
        for k in np.flatnonzero(edges.collides):
            assert checker.collides(Q0[k] + edges.time[k] * (Q1[k] - Q0[k])), f"seed {seed}, edge {k}"
        decided, total = decided + (~edges.is_open).sum(), total + len(edges)
    assert total >= 20 and decided >= 0.8 * total
