"""Normals of curved parts that overlap or nearly touch: gradients against brackets in decimals of 80 digits."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from curved_oracle import bracket
from naive import pose, random_pose, rng_of
from random_robots import slider

import collide
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot
from collide.robots.robot_distances import NO_GRADIENT


def curved(rng) -> collide.Shape:
    r, kind = float(rng.uniform(0.08, 0.2)), int(rng.integers(3))
    if kind == 0:
        return collide.Cone(0.6 * r, 1.5 * r)
    return collide.Cylinder(0.5 * r, r) if kind == 1 else collide.Ellipsoid(r * rng.uniform(0.4, 1.0, 3))


def partner(rng) -> collide.Shape:
    kind = int(rng.integers(4))
    if kind == 0:
        return collide.Box(rng.uniform(0.1, 0.3, 3))
    return (collide.Capsule(0.05, 0.1), collide.Sphere(0.1), curved(rng))[kind - 1]


def floater(rng, A: collide.Shape, B: collide.Shape) -> collide.RobotChecker:
    """A on a floating joint, off its middle, and B."""
    element = LinkShape(A, random_pose(rng, 0.1), None, "test")
    joint = Joint("fly", "floating", "base", "body", np.eye(4), (1.0, 0, 0))
    world = collide.World()
    world.add(B, random_pose(rng, 0.1), name="other")
    return collide.RobotChecker(Robot("floater", ["base", "body"], [joint], {"body": [element]}), world)


def distance_in_decimals(checker, q):
    (element,) = checker.robot.geometry["body"]
    body = checker.world.body("other")
    return bracket(element.shape, body.shape, checker.link_poses(q)[0, 1] @ element.X_LG, body.X_WB)


@pytest.mark.many(2)
@pytest.mark.parametrize("wanted", [1e-2, 1e-3, 1e-5, 1e-6, -1e-5, -1e-3, -2e-2])
def test_gradients_of_small_gaps_and_overlaps(wanted):
    """Along random directions; where the slopes of both sides differ, the gradient is between them."""
    rng, counts = rng_of("settled normals", wanted), Counter()
    for case in range(16):
        checker = floater(rng, partner(rng), curved(rng))
        q = np.concatenate([rng.uniform(-0.5, 0.5, 3), rng.uniform(-1, 1, 3)])
        for _ in range(8):  # along the normal, up to the distance that is wanted
            near = checker.distances(q)
            q[:3] += (near.distance[0] - wanted) * near.normal[0]
        near = checker.distances(q)
        if abs(near.distance[0] - wanted) > 0.5 * abs(wanted):
            counts["elsewhere"] += 1
            continue
        if near.no_gradient[0] is not None:
            assert near.no_gradient[0] == NO_GRADIENT["normal"] and np.isnan(near.gradient).all()
            counts["unknown"] += 1
            continue
        step, way = min(1e-3 * abs(wanted), 1e-6), rng.normal(size=6)
        way /= np.linalg.norm(way)
        ends = [distance_in_decimals(checker, q + k * step * way) for k in (-1, 0, 1)]
        low, at, high = ((end.lower + end.upper) / 2 for end in ends)
        before, after = float(at - low) / step, float(high - at) / step
        slope = float(near.gradient[0] @ way)
        say = f"case {case}, {checker.robot.geometry['body'][0].shape}, q = {q.tolist()}: {before}, {slope}, {after}"
        assert max(float(end.upper - end.lower) for end in ends) <= 1e-8 * step, say
        if abs(after - before) > 4e-3:
            assert min(before, after) - 1e-3 <= slope <= max(before, after) + 1e-3, say
            counts["kink"] += 1
        else:
            assert abs(slope - 0.5 * (before + after)) <= 1e-6, say
            counts["smooth"] += 1
    assert counts["smooth"] >= 10 and counts["unknown"] <= 2 and counts["kink"] <= 4, counts


def test_at_flat_faces_normals_are_exact():
    """A cylinder's cap in a wall, and its side along the wall; a cone's base, swollen."""
    world = collide.World()
    world.add(collide.Box((0.5, 2.0, 2.0)), pose(t=(1.0, 0, 0)), name="wall")
    turned = pose([[0, 0, 1.0], [0, 1.0, 0], [-1.0, 0, 0]])
    for shape, X, half in ((collide.Cylinder(0.1, 0.4), turned, 0.2), (collide.Cylinder(0.1, 0.4), np.eye(4), 0.1)):
        robot = slider(collide.Compound([(shape, X)]))
        checker = collide.RobotChecker(robot, world, padding=0.0625)
        x = 0.75 - half - 0.0625
        measured = checker.distances([[x + 0.03125], [x + 1e-4], [x - 1e-5], [x - 0.25]])
        assert np.abs(measured.distance - np.array([-0.03125, -1e-4, 1e-5, 0.25])).max() <= 1e-12
        assert np.abs(measured.gradient[:, 0] + 1.0).max() <= 1e-15 and measured.no_gradient == [None] * 4


def test_items_of_fields_have_the_reason():
    """Kernels do not move items: a curved link in a ball of a cloud has no gradient, a box has."""
    world = collide.World()
    world.add(collide.PointCloud([(1.0, 0, 0)], 0.25), name="cloud")
    Q = [[0.0], [0.5], [0.75]]
    for shape, reasons in (
        (collide.Ellipsoid((0.3, 0.2, 0.1)), [None, NO_GRADIENT["normal"], NO_GRADIENT["normal"]]),
        (collide.Box((0.6, 0.4, 0.2)), [None, None, None]),
        (collide.Sphere(0.3), [None, None, None]),
    ):
        measured = collide.RobotChecker(slider(shape), world).distances(Q, per="pair")
        assert measured.no_gradient == reasons, shape
        known = [reason is None for reason in reasons]
        assert np.isnan(measured.gradient[:, 0]).tolist() == [not k for k in known]
        assert np.abs(measured.gradient[known, 0] + 1.0).max() <= 1e-12
