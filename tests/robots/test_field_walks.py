"""Robots among point clouds and grids: verdicts of kernels beside pairs asked one by one, proofs beside samples."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from random_robots import random_robot
from reproduction import reproducing

import collide
from collide.pairs import query
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot

_SNIPPET = """
# robots/test_field_walks.py: robot and field of seed {seed}, configuration {q}
"""


def field(rng, kind: str) -> collide.Shape:
    places = rng.uniform(-0.8, 0.8, (400, 3))
    if kind == "grid":
        cells = np.unique(rng.integers(0, 24, (70, 3)), axis=0)
        return collide.VoxelGrid(cells, (0.05, 0.06, 0.07), pose(t=(-0.6, -0.7, -0.8)))
    return collide.PointCloud(places, {"balls": 0.01, "points": 0.0, "each": rng.uniform(0.0, 0.03, 400)}[kind])


def arm_in_field(seed: int, kind: str, margin: float = 0.0, **options):
    """(checker, X_WF, field) of an arm of every kind of shape, or of spheres for seeds above 2, and one field."""
    rng = rng_of("fields around robots", kind, seed)
    balls = (lambda rng, size: collide.Sphere(size * float(rng.uniform(0.5, 1.0)))) if seed > 2 else None
    robot, shape, X_WF = random_robot(rng, types=("revolute", "prismatic"), shape=balls), field(rng, kind), np.eye(4)
    X_WF[:] = random_pose(rng, 0.2)
    world = collide.World()
    world.add(shape, X_WF, name="field", margin=margin)
    return collide.RobotChecker(robot, world, **options), X_WF, shape


def configurations(checker, n: int) -> np.ndarray:
    robot = checker.robot
    return rng_of("configurations in fields", n).uniform(robot.lower, robot.upper, (n, robot.dof))


@pytest.mark.parametrize("kind", ["balls", "points", "each", "grid"])
def test_verdicts_are_those_of_pairs(kind):
    """Of arms with padding and fields with margins as well."""
    hits, n = 0, 0
    for seed, (padding, margin) in enumerate([(0.0, 0.0), (0.01, 0.0), (0.0, 0.02), (0.0, 0.0), (0.02, 0.0)]):
        checker, X_WF, shape = arm_in_field(seed, kind, margin, padding=padding)
        robot, Q = checker.robot, configurations(checker, 40)
        alone = collide.RobotChecker(robot, padding=padding).collides(Q)
        verdicts, poses = checker.collides(Q), robot.link_poses(Q)
        for k in np.flatnonzero(~alone).tolist():
            with reproducing(_SNIPPET, seed=seed, q=Q[k]):
                assert bool(verdicts[k]) == any(
                    collide.collide(e.shape, shape, poses[k, robot.links.index(link)] @ e.X_LG, X_WF,
                                    security_margin=padding + margin)
                    for link, elements in robot.geometry.items() for e in elements
                )
            hits, n = hits + bool(verdicts[k]), n + 1
    assert 0.15 * n < hits < 0.85 * n and n > 40, (hits, n)


@pytest.mark.parametrize("kind", ["balls", "each", "grid"])
def test_proven_motions_have_no_sample_that_collides(kind):
    """And of those that collide the time is of a collision; nearly all are decided by kernels."""
    free = met = still_open = 0
    for seed in range(5):
        checker, _, _ = arm_in_field(seed, kind)
        Q = configurations(checker, 60)
        ends = Q + 0.2 * rng_of("ways in fields", kind, seed).normal(size=Q.shape)
        proven = checker.certify_edges(Q, ends)
        for k in np.flatnonzero(proven.free).tolist():
            t = np.linspace(0.0, 1.0, 60)[:, None]
            with reproducing(_SNIPPET, seed=seed, q=Q[k]):
                assert not checker.collides(Q[k] + t * (ends[k] - Q[k])).any()
        for k in np.flatnonzero(proven.collides).tolist():
            assert checker.collides(Q[k] + proven.time[k] * (ends[k] - Q[k]))
        free, met = free + int(proven.free.sum()), met + int(proven.collides.sum())
        still_open += int(proven.is_open.sum())
    assert free > 20 and met > 20 and still_open < 0.05 * (free + met), (free, met, still_open)


@pytest.mark.parametrize("kind", ["balls", "each", "grid"])
def test_distances_are_those_of_pairs(kind):
    """Of free configurations: the least of all gaps lies in the bracket, and points lie on both bodies of the pair."""
    n = 0
    for seed in range(5):
        checker, X_WF, shape = arm_in_field(seed, kind, padding=0.01 * (seed == 1))
        robot, padding, Q = checker.robot, 0.01 * (seed == 1), configurations(checker, 40)
        Q = Q[~checker.collides(Q)]
        near, alone, poses = checker.distances(Q), collide.RobotChecker(robot).distances(Q), robot.link_poses(Q)
        for k, row in enumerate(near.rows):
            with reproducing(_SNIPPET, seed=seed, q=Q[k]):
                gaps = [
                    (collide.distance(e.shape, shape, poses[k, robot.links.index(link)] @ e.X_LG, X_WF).distance, link)
                    for link, elements in robot.geometry.items() for e in elements
                ]
                gap, link = min(gaps)
                least = min(gap - padding, float(alone.distance[k]))
                assert row["certified"] and abs(row["distance"] - least) <= 1e-9 and row["lower"] <= least + 1e-12
                away = row["point_b"] - row["point_a"]
                assert abs(np.linalg.norm(away) - row["distance"]) <= 1e-9
                assert np.linalg.norm(away - row["distance"] * row["normal"]) <= 1e-6
                if row["b"] < 0:
                    assert checker.names_of(int(row["a"]), int(row["b"])) == (link, "field")
                    n += 1
    assert n > 30, n


@pytest.mark.parametrize("kind", ["balls", "grid"])
def test_a_limit_within_a_bracket_is_no_upper_bound(kind):
    """A ball slides along x towards a point, or a cell: the gap is a difference of doubles."""
    joint = Joint("slide", "prismatic", "base", "ball", np.eye(4), np.array([1.0, 0.0, 0.0]), -2.0, 2.0, None)
    shape = LinkShape(collide.Sphere(0.1), np.eye(4), None, "test")
    robot = Robot("slider", ["base", "ball"], [joint], {"ball": [shape]})
    world, n = collide.World(), 0
    edge = 0.0 if kind == "balls" else 0.125
    field = collide.PointCloud([(0.0, 0.0, 0.0)], 0.0)
    if kind == "grid":
        field = collide.VoxelGrid([(0, 0, 0)], 0.25, pose(t=(-0.125, -0.125, -0.125)))
    world.add(field, name="field")
    checker, rng = collide.RobotChecker(robot, world), rng_of("limits within brackets", kind)
    for q in rng.uniform(0.3, 2.0, 200):
        gap = Fraction(q) - Fraction(0.1) - Fraction(edge)
        row = checker.distances([[q]]).rows[0]
        lower, upper = float(row["lower"]), float(row["upper"])
        for limit in (lower, np.nextafter(lower, 0.0), float(row["distance"]), upper):
            within = checker.distances([[q]], max_distance=limit).rows[0]
            assert Fraction(float(within["lower"])) <= gap
            assert within["beyond"] or gap <= Fraction(float(within["upper"]))
            n += bool(not within["beyond"] and gap > Fraction(limit))
    assert n > 0 or kind == "balls", n


def test_links_without_end_are_told_by_what_is_around_the_field():
    world, ground = collide.World(), LinkShape(collide.Halfspace((0.0, 0.0, 1.0), -1.0), np.eye(4), None, "test")
    world.add(collide.PointCloud(rng_of("over ground").uniform(-0.5, 0.5, (2000, 3)), 0.01), name="cloud")
    joint = Joint("lift", "prismatic", "base", "plate", np.eye(4), np.array([0.0, 0.0, 1.0]), -2.0, 2.0, None)
    robot = Robot("lift", ["base", "plate"], [joint], {"plate": [ground]})
    checker = collide.RobotChecker(robot, world)
    asked = []
    collides = query.collide
    try:
        query.collide = lambda *args, **options: asked.append(args) or collides(*args, **options)
        assert checker.collides([[0.0], [0.3], [0.9]]).tolist() == [False, False, True]
    finally:
        query.collide = collides
    assert len(asked) == 1 and len(asked[0][2]) == 1


def test_a_field_that_moves_is_asked_where_it_stands():
    checker, _, shape = arm_in_field(0, "balls")
    Q = configurations(checker, 60)
    before = checker.collides(Q)
    checker.world.set_pose("field", pose(t=(50.0, 0.0, 0.0)))
    assert np.array_equal(checker.collides(Q), collide.RobotChecker(checker.robot).collides(Q))
    X = pose(t=(0.1, -0.1, 0.05))
    checker.world.set_pose("field", X)
    world = collide.World()
    world.add(shape, X, name="field")
    assert np.array_equal(checker.collides(Q), collide.RobotChecker(checker.robot, world).collides(Q))
    assert before.any() and not before.all()
