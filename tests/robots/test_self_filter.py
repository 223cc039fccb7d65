"""Points of a cloud that are the robot itself, beside distances of single points, one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive import random_pose, rng_of
from random_robots import random_configurations, random_robot, slider

import collide
from collide.errors import InvalidArgument, InvalidPose, InvalidShape
from collide.scenes import load

POINT = collide.ConvexHull(np.zeros((1, 3)))


def oracle(checker, p_W, q, padding: dict[str, float], radii) -> tuple[np.ndarray, np.ndarray]:
    """(surely belongs, surely does not): every point against every body, by brackets of single distances."""
    X_WLs = checker.link_poses(q)[0]
    inside, outside = np.zeros(len(p_W), dtype=bool), np.ones(len(p_W), dtype=bool)
    for body in checker._bodies:
        for k, (p, radius) in enumerate(zip(p_W, np.broadcast_to(radii, len(p_W)).tolist())):
            r = collide.distance(body.shape, POINT, X_WLs[body.link], collide.pose(p))
            reach = padding.get(body.name, 0.0) + radius
            inside[k] |= r.upper <= reach or (r.distance < 0.0 and r.upper < reach)
            outside[k] &= r.lower > reach
    return inside, outside


def near_points(checker, q, rng, n: int, spread: float) -> np.ndarray:
    """Points around the surfaces of the bodies, and others farther away."""
    X_WLs, some = checker.link_poses(q)[0], []
    for body in checker._bodies:
        vertices = collide.tessellate(body.shape, tolerance=0.02).vertices
        w = rng.dirichlet(np.ones(3), n)
        p_L = (vertices[rng.integers(0, len(vertices), (n, 3))] * w[:, :, None]).sum(axis=1)
        some.append(p_L @ X_WLs[body.link][:3, :3].T + X_WLs[body.link][:3, 3] + rng.normal(0, spread, (n, 3)))
    return np.concatenate([*some, rng.uniform(-2, 2, (n, 3))])


@pytest.mark.parametrize("seed", range(12))
def test_beside_distances_of_single_points(seed):
    rng = rng_of("self filter", seed)
    robot = random_robot(rng, 4)
    attached = [("part", robot.links[-1], collide.Cylinder(0.05, 0.2), random_pose(rng, 0.1))] if seed % 2 else ()
    checker = collide.RobotChecker(robot, attached=attached, padding=0.3)  # which does not count
    q = random_configurations(rng, robot, 1)[0]
    p_W = near_points(checker, q, rng, 25, 0.05)
    padding = [0.0, 0.04, {checker.bodies[0]: 0.1, checker.bodies[-1]: 0.02}][seed % 3]
    by_name = padding if isinstance(padding, dict) else dict.fromkeys(checker.bodies, padding)
    radii = [0.0, 0.01, rng.uniform(0, 0.05, len(p_W))][seed // 3 % 3]
    inside, outside = oracle(checker, p_W, q, by_name, radii)
    assert inside.sum() > 8 and outside.sum() > 8 and (inside ^ outside).all(), (seed, inside.sum(), outside.sum())
    cloud = collide.PointCloud(p_W, radii)
    left = checker.self_filter(cloud, q, padding=padding)
    assert left.dropped == inside.sum() and left.points.tobytes() == p_W[outside].tobytes(), seed
    assert np.shape(left.radius) == np.shape(radii[outside] if np.ndim(radii) else radii)
    if not np.any(radii):
        mask = checker.self_filter(p_W, q, padding=padding)
        assert mask.dtype == bool and (mask == inside).all(), (seed, np.flatnonzero(mask != inside))
    X_WC = random_pose(rng, 1.0)
    p_C = (p_W - X_WC[:3, 3]) @ X_WC[:3, :3]
    seen = checker.self_filter(collide.PointCloud(p_C, radii), q, padding=padding, X_WC=X_WC)
    assert seen.dropped == inside.sum(), seed


@pytest.mark.parametrize("padding", [0.0, 0.25, 1e-9])
def test_a_point_exactly_on_the_padded_surface_belongs(padding):
    checker = collide.RobotChecker(slider(collide.Box((1.0, 1.0, 1.0))))  # its cart at q along x
    edge = 0.5 + padding
    assert edge - 0.5 == padding or padding == 1e-9
    if edge - 0.5 > padding:
        edge = math.nextafter(edge, 0.0)
    inside = [(2.0 + edge, 0, 0), (2.0, edge, 0.25), (2.0, 0, -edge), (2, 0, 0)] if padding != 1e-9 else [(2, edge, 0)]
    beyond = [(2.0, math.nextafter(0.5 + padding, 2.0), 0), (2, 0.1, -math.nextafter(0.5 + padding, 2.0)), (9, 9, 9)]
    assert checker.self_filter(inside, [2.0], padding=padding).all()
    assert not checker.self_filter(beyond, [2.0], padding=padding).any()
    ball = collide.PointCloud([(2.0, edge + 0.125, 0), (2.0, edge + 0.1251, 0)], 0.125)
    if padding != 1e-9:
        assert checker.self_filter(ball, [2.0], padding=padding).points[:, 1].tolist() == [edge + 0.1251]


def test_many_configurations_and_threads():
    checker = collide.RobotChecker(slider(collide.Sphere(0.5)))
    points = np.stack([np.linspace(-3, 3, 61), np.zeros(61), np.zeros(61)], axis=1)
    Q = [[-1.0], [0.0], [2.0]]
    masks = checker.self_filter(points, Q)
    assert masks.shape == (3, 61)
    for q, mask in zip(Q, masks):
        assert (mask == (np.abs(points[:, 0] - q[0]) <= 0.5)).all()
        assert (checker.self_filter(points, q, threads=2) == mask).all()
    left = checker.self_filter(collide.PointCloud(points), Q)
    assert left.dropped == masks.any(axis=0).sum() and len(left) + left.dropped == 61
    assert checker.self_filter(np.zeros((0, 3)), [0.0]).shape == (0,)
    assert checker.self_filter(points, np.zeros((0, 1))).shape == (0, 61)


def test_the_arm_of_the_demo_no_longer_meets_what_it_has_left_of_a_scan():
    checker = collide.RobotChecker.from_scene(load("panda_workbench", meshes="hull"))
    rng = rng_of("panda sees itself")
    for turn in range(1):
        q = random_configurations(rng, checker.robot, 1)[0]
        scan = collide.PointCloud(near_points(checker, q, rng, 30, 0.01), 0.005)
        checker.world.add(scan, name=f"scan {turn}")
        assert any(f"scan {turn}" in (pair.a, pair.b) for pair in checker.explain(q).collisions)
        left = checker.self_filter(scan, q)
        assert 0.3 * len(scan) < left.dropped < len(scan) - 50
        checker.world.replace(f"scan {turn}", left)
        assert not any(f"scan {turn}" in (pair.a, pair.b) for pair in checker.explain(q).collisions)
        checker.world.remove(f"scan {turn}")


@pytest.mark.parametrize(("arguments", "error", "words"), [
    ({"points": np.zeros((3, 2))}, InvalidArgument, r"points must be \(n, 3\)"),
    ({"points": [(0, 0, np.nan)]}, InvalidArgument, "points"),
    ({"points": "cloud"}, InvalidArgument, "points"),
    ({"Q": [0.0, 1.0]}, InvalidArgument, "Q"),
    ({"padding": -0.1}, InvalidArgument, "padding"),
    ({"padding": {"wheel": 0.1}}, InvalidArgument, "padding: no link or attached object"),
    ({"X_WC": np.eye(3)}, InvalidPose, "X_WC"),
    ({"threads": 0}, InvalidArgument, "threads"),
    ({"points": collide.PointCloud([(0, 0, 0)])}, InvalidShape, "self_filter: no point of 1 is left"),
])
def test_bad_arguments_are_named(arguments, error, words):
    checker = collide.RobotChecker(slider(collide.Box((1.0, 1.0, 1.0))))
    values = {"points": [(0, 0, 0)], "Q": [0.0], **arguments}
    with pytest.raises(error, match=words):
        checker.self_filter(values.pop("points"), values.pop("Q"), **values)
