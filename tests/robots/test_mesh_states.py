"""Robots of meshes: kernels ask about facets themselves, and verdicts are those of every pair asked alone."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from random_robots import random_configurations, random_link_shape, random_robot

import collide
from collide.robots import mesh_states as layout


def hollow(rng, size: float) -> collide.Shape:
    """A solid that is not its hull: a box with a notch, or an open surface of it."""
    x, y, z = size * rng.uniform(0.6, 1.4, 3)
    corners = np.array([(-x, -y), (x, -y), (x, 0), (0.1 * x, 0), (0.1 * x, y), (-x, y)])
    vertices = np.concatenate([np.column_stack([corners, np.full(6, h)]) for h in (-z, z)])
    cap = [(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)]
    sides = [t for k in range(6) for t in ((k, (k + 1) % 6, 6 + (k + 1) % 6), (k, 6 + (k + 1) % 6, 6 + k))]
    faces = [*(f[::-1] for f in cap), *(tuple(6 + i for i in f) for f in cap), *sides]
    if rng.random() < 0.3:
        return collide.Mesh(vertices, faces[:-3], solid=False)
    return collide.Mesh(vertices, faces)


def mesh_or_other(rng, size: float) -> collide.Shape:
    return hollow(rng, size) if rng.random() < 0.6 else random_link_shape(rng, size)


def obstacle(rng, k: int) -> collide.Shape:
    if k == 0:
        return collide.Halfspace(rng.normal(size=3), -1.2)
    if k == 1:
        return collide.PointCloud(rng.uniform(-0.3, 0.3, (40, 3)), 0.02)
    return hollow(rng, 0.2) if k % 2 else random_link_shape(rng, 0.25)


def a_scene(seed: int, **options) -> collide.RobotChecker:
    rng, world = rng_of("mesh robots", seed), collide.World()
    for k in range(7):
        world.add(obstacle(rng, k if k != 1 or seed % 2 else 3), random_pose(rng, 0.9), name=f"body{k}")
    return collide.RobotChecker(random_robot(rng, n_links=5, shape=mesh_or_other, size=0.1), world, **options)


def asked_alone(checker: collide.RobotChecker, q: np.ndarray) -> bool:
    setting, X_WLs = checker.setting, checker.link_poses(q)[0]
    at = [(body.shape, X_WLs[body.link]) for body in setting.bodies]
    own = any(collide.collide(at[a][0], at[b][0], at[a][1], at[b][1]) for a, b in setting.self_pairs.tolist())
    return own or any(
        collide.collide(at[a][0], B.shape, at[a][1], B.X_WB, security_margin=setting.bodies[a].padding)
        for a, b in np.argwhere(setting.allowed == 0).tolist() for B in [setting.surroundings.bodies[b]]
    )


def questions_of(checker: collide.RobotChecker) -> np.ndarray:
    space = checker._workspace(checker.setting)
    space.ask_meshes(checker.setting)
    return space._meshes.words[layout.QUESTIONS :: layout.QUESTION]


def test_verdicts_are_those_of_every_pair_asked_alone():
    n_hits, kinds = 0, []
    for seed in range(6):
        checker = a_scene(seed, padding=0.01 * (seed % 4 == 3))
        Q = random_configurations(rng_of("of mesh robots", seed), checker.robot, 40)
        expected = [asked_alone(checker, q) for q in Q]
        kinds += questions_of(checker).tolist()
        for _ in range(2):  # before kernels ask about meshes, and after
            wrong = np.flatnonzero(checker.collides(Q) != expected)
            assert not len(wrong), (seed, Q[wrong[0]].tolist(), expected[wrong[0]])
        checker._count(10**6)
        assert (checker.setting.spheres is None) == bool(seed % 2)  # none among clouds
        wrong = np.flatnonzero(checker.collides(Q) != expected)
        assert not len(wrong), ("spheres", seed, Q[wrong[0]].tolist(), expected[wrong[0]])
        n_hits += sum(expected)
    assert 30 < n_hits < 210, n_hits
    asked = (layout.FACETS, layout.FACETS_OF_BODY, layout.FACETS_OF_PARTNER, layout.HULLS)
    assert all(kinds.count(how) >= 3 for how in asked), [kinds.count(how) for how in asked]


@pytest.mark.parametrize("seed", range(4))
def test_motions_proven_free_have_no_sample_that_collides(seed):
    checker = a_scene(seed)
    rng = rng_of("motions of mesh robots", seed)
    q0 = random_configurations(rng, checker.robot, 16)
    q1 = q0 + rng.uniform(-0.5, 0.5, q0.shape)
    for spheres in (False, True):
        if spheres:
            checker._count(10**6)
        edges = checker.certify_edges(q0, q1, resolution=0.02)
        for k in range(len(q0)):
            if edges.free[k]:
                samples = q0[k] + np.linspace(0, 1, 12)[:, None] * (q1[k] - q0[k])
                assert not any(asked_alone(checker, q) for q in samples), (seed, k)
            elif edges.collides[k]:
                assert asked_alone(checker, q0[k] + edges.time[k] * (q1[k] - q0[k])), (seed, k)
        assert edges.is_open.mean() < 0.2


def test_a_mesh_around_a_body_is_no_hit_of_its_hull():
    """A ball within the notch, and within the solid: the surface is met by neither."""
    rng = rng_of("notch")
    notch = hollow(rng, 0.5)
    while not notch.solid:
        notch = hollow(rng, 0.5)
    world = collide.World()
    world.add(collide.Sphere(0.05), pose(t=(0.0, 0.0, 0.0)), name="ball")
    joint = collide.robots.kinematic_tree.Joint(
        "slide", "prismatic", "base", "cart", np.eye(4), (1.0, 1.0, 0.0), lower=-9.0, upper=9.0)
    element = collide.robots.robot.LinkShape(notch, np.eye(4), None, "test")
    checker = collide.RobotChecker(collide.Robot("cart", ["base", "cart"], [joint], {"cart": [element]}), world)
    Q = np.linspace(-1.5, 1.5, 61)[:, None]
    expected = [asked_alone(checker, q) for q in Q]
    assert 10 < sum(expected) < 50 and checker.collides(Q).tolist() == checker.collides(Q).tolist() == expected


@pytest.mark.slow
def test_margins_count_from_swept_surfaces():
    """Boxes of places around a body among a mesh: those proven free have no place that meets the mesh; far places of
    large boxes are told apart by the margin alone.
    """
    n_free = n_others = 0
    for seed in range(36):
        rng = rng_of("margins of meshes", seed)
        joints = [
            collide.robots.kinematic_tree.Joint(
                f"j{k}", "prismatic", f"l{k}", f"l{k + 1}", np.eye(4), np.eye(3)[k], lower=-9.0, upper=9.0)
            for k in range(3)
        ]
        shape = [collide.Sphere(0.2), collide.Capsule(0.1, 0.3), hollow(rng, 0.2), collide.Box((0.2, 0.3, 0.1)),
                 collide.Cylinder(0.1, 0.3), collide.ConvexHull(rng.uniform(-0.2, 0.2, (9, 3)), radius=0.1)][seed % 6]
        element = collide.robots.robot.LinkShape(shape, np.eye(4), None, "test")
        world = collide.World()
        world.add(hollow(rng, 0.6), random_pose(rng, 0.2), name="hollow")
        checker = collide.RobotChecker(
            collide.Robot("crane", ["l0", "l1", "l2", "l3"], joints, {"l3": [element]}), world)
        centres, half = rng.uniform(-1.2, 1.2, (30, 3)), rng.uniform(0.01, 0.4, (30, 1))
        result = checker.certify_boxes(centres - half, centres + half, resolution=0.05, max_cells=200)
        for k in range(30):
            steps = np.stack(np.meshgrid(*[(-1, 0, 1)] * 3), axis=-1).reshape(-1, 3)
            places = centres[k] + half[k] * steps
            hits = [asked_alone(checker, q) for q in places] if result.free[k] else []
            assert not any(hits), (seed, centres[k].tolist(), half[k])
        n_free, n_others = n_free + int(result.free.sum()), n_others + int((~result.free).sum())
    assert n_free > 100 and n_others > 100, (n_free, n_others)
