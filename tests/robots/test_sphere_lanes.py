"""Robots of spheres, eight configurations at once: verdicts are those of every pair asked alone, also where bodies
touch to the last digits.
"""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, rng_of
from random_robots import random_configurations, random_robot, scene_of_spheres, some_spheres

import collide
from collide.kernels import address_of
from collide.robots.check_configurations import check_configurations
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot


def asked_alone(checker: collide.RobotChecker, q: np.ndarray) -> bool:
    """Every tested pair, as `collide.collide` answers."""
    setting, X_WLs = checker.setting, checker.link_poses(q)[0]
    shapes = [(body.shape, X_WLs[body.link]) for body in setting.bodies]
    for a, b in setting.self_pairs.tolist():
        if collide.collide(shapes[a][0], shapes[b][0], shapes[a][1], shapes[b][1]):
            return True
    for a, b in np.argwhere(setting.allowed == 0).tolist():
        other = setting.surroundings.bodies[b]
        by = setting.bodies[a].padding
        if collide.collide(shapes[a][0], other.shape, shapes[a][1], other.X_WB, security_margin=by):
            return True
    return False


def share_settled(checker: collide.RobotChecker, Q: np.ndarray) -> float:
    """Of configurations, by spheres alone."""
    space, verdicts = checker._workspace(checker.setting), np.zeros(8, dtype=np.uint8)
    assert space.stand(checker.setting) and checker.setting.spheres is not None
    q, n = np.ascontiguousarray(Q[:8]), 0
    for k in range(0, len(Q) - 7, 8):
        q = np.ascontiguousarray(Q[k : k + 8])
        check_configurations(space.address, address_of(q), q.shape[1], 0, 8, address_of(verdicts))
        n += int((space._spheres.verdicts[1] == 0.0).sum())
    return n / (len(Q) // 8 * 8)


@pytest.mark.slow
def test_verdicts_are_those_of_every_pair_asked_alone():
    n_hits, shares = [], []
    for seed in range(12):
        rng = rng_of("spheres of robots", seed)
        checker = scene_of_spheres(rng, padding=0.02 * (seed % 2))
        Q = random_configurations(rng, checker.robot, 61)
        expected = [asked_alone(checker, q) for q in Q]
        wrong = np.flatnonzero(checker.collides(Q) != expected)
        assert not len(wrong), (seed, Q[wrong[0]].tolist(), expected[wrong[0]])
        assert [checker.collides(q) for q in Q[:7]] == expected[:7]
        n_hits.append(sum(expected))
        shares.append(share_settled(checker, Q))
    assert 100 <= sum(n_hits) <= 600 and np.mean(shares) > 0.7, (n_hits, shares)


@pytest.mark.parametrize("seed", range(6))
def test_at_a_touch_verdicts_are_exact(seed):
    """An obstacle is put where a sphere's surface is, moved by a few units in the last place outwards and inwards."""
    rng, n_open, verdicts = rng_of("spheres that touch", seed), 0, set()
    robot = random_robot(rng, 3, shape=lambda rng, size: collide.Sphere(float(rng.uniform(0.05, 0.2))))
    Q = np.repeat(random_configurations(rng, robot, 1), 8, axis=0)
    link = max(robot.geometry, key=robot.links.index)
    element = robot.geometry[link][0]
    centre = (robot.link_poses(Q[0])[0][robot.links.index(link)] @ element.X_LG)[:3, 3]
    for kind in range(4):
        for by in (-8e-16, -1e-16, 0.0, 1e-16, 8e-16, -1e-9, 1e-9):
            world, half = collide.World(), rng.uniform(0.05, 0.2, 3)
            gap = element.shape.radius + by
            shape, way = (
                (collide.Box(2 * half), (1, 0, 0)), (collide.Sphere(half[0]), (0, 1, 0)),
                (collide.Cylinder(half[1], 2 * half[0]), (0, 0, 1)), (collide.Capsule(half[0], 0.3), (-1, 0, 0)),
            )[kind]
            world.add(shape, pose(t=centre + (gap + half[0]) * np.array(way)), name="near")
            checker = collide.RobotChecker(robot, world, allowed=[
                (a, b) for a in robot.geometry for b in [*robot.geometry, "near"] if a != b and link != a])
            expected = asked_alone(checker, Q[0])
            assert checker.collides(Q).tolist() == [expected] * 8, (seed, kind, by)
            n_open += share_settled(checker, Q) == 0.0
            verdicts.add(expected)
    assert verdicts == {True, False} and 8 <= n_open <= 20, n_open


def test_spheres_turned_in_their_links_do_not_meet_across_a_gap_of_roundings():
    """Two balls of 1 m, each at a pose of its own in its link, 2 m and 1e-12 m apart: proven to be apart."""
    turned = pose(t=(0.0, 0.0, 0.0))
    turned[:2, :2] = (0.0, -1.0), (1.0, 0.0)
    geometry = {name: [LinkShape(collide.Sphere(1.0), turned, None, "test")] for name in ("base", "cart")}
    verdicts = []
    for gap in (1e-12, 3e-13, 0.0, -1e-12):
        slide = Joint("slide", "prismatic", "base", "cart", pose(t=(2.0 + gap, 0, 0)), (1.0, 0, 0), -1.0, 1.0)
        checker = collide.RobotChecker(Robot("balls", ["base", "cart"], [slide], geometry, semantic_pairs=[]))
        expected, Q = asked_alone(checker, np.zeros(1)), np.zeros((8, 1))
        assert checker.setting.spheres is not None
        assert checker.collides(Q).tolist() == [expected] * 8, gap
        assert checker.certify_edges(Q, Q).collides.tolist() == [expected] * 8, gap
        verdicts.append(expected)
    assert verdicts == [False, False, True, True]


def test_links_in_lanes_have_the_bits_of_links_alone():
    for seed in range(12):
        rng = rng_of("links in lanes", seed)
        checker = scene_of_spheres(rng, n=1)
        Q = random_configurations(rng, checker.robot, 8)
        Q[1] *= 1e3
        Q[2] *= -1e7  # turned further than LARGEST_ANGLE
        space = checker._workspace(checker.setting)
        check_configurations(
            space.address, address_of(Q), Q.shape[1], 0, 8, address_of(np.zeros(8, dtype=np.uint8)))
        lanes = space._spheres.links.reshape(len(checker.robot.links), 12, 8)
        X_WLs = checker.link_poses(Q)
        for lane in range(8):
            assert lanes[:, :9, lane].tobytes() == X_WLs[lane, :, :3, :3].reshape(-1, 9).tobytes(), (seed, lane)
            assert lanes[:, 9:, lane].tobytes() == np.ascontiguousarray(X_WLs[lane, :, :3, 3]).tobytes(), (seed, lane)


def test_spheres_beside_other_bodies_and_attached_ones():
    rng = rng_of("attached to spheres", 2)
    checker = scene_of_spheres(rng)
    link = checker.bodies[0]
    held = collide.RobotChecker(checker.robot, checker.world, attached=[
        ("box", link, collide.Box((0.3, 0.4, 0.5)), pose(t=(0.3, 0, 0.2)))])
    Q = random_configurations(rng, checker.robot, 64)
    expected = [asked_alone(held, q) for q in Q]
    assert held.collides(Q).tolist() == expected and held.setting.spheres is not None
    assert sum(expected) > checker.collides(Q).sum()


def test_far_poses_and_numbers_that_overflow_are_not_free_by_mistake():
    """Columns so large that places are not numbers leave configurations to the narrowphase."""
    rng = rng_of("far spheres")
    robot = random_robot(rng, n_links=4, types=("prismatic",), shape=some_spheres)
    world = collide.World()
    world.add(collide.Sphere(0.1), name="ball")
    checker = collide.RobotChecker(robot, world)
    Q = np.full((8, robot.dof), 1e308)
    plain = collide.RobotChecker(robot, world)
    plain._spheres_among = lambda around: None
    plain._setting = None
    plain.prepare()
    assert plain.setting.spheres is None and checker.setting.spheres is not None
    assert checker.collides(Q).tolist() == plain.collides(Q).tolist()


def test_robots_of_other_bodies_have_none():
    rng = rng_of("no spheres")
    for shape in (collide.Box((0.1, 0.1, 0.1)), collide.Compound([(collide.Halfspace((0, 0, 1.0), 0.0), np.eye(4))])):
        robot = random_robot(rng, n_links=4, shape=lambda rng, size, shape=shape: shape)
        assert collide.RobotChecker(robot).setting.spheres is None
