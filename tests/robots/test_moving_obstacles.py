"""Obstacles with a known motion: free times have no sample at which a robot among bodies put there collides."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from naive import pose, random_pose, rng_of, rotation
from random_robots import random_configurations, random_link_shape, random_robot, slider, turned
from random_splines import random_spline

import collide
from collide.errors import InvalidArgument


def pose_at(values: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(4, 4) of a body at x y z, or with roll pitch yaw, of one that stood at X_WB."""
    R = X_WB[:3, :3]
    if len(values) == 6:
        R = turned((0, 0, 1), values[5]) @ turned((0, 1, 0), values[4]) @ turned((1, 0, 0), values[3])
    return pose(R, values[:3])


class Setting:
    """A robot with an attached object, paddings and margins by the seed, among bodies of which two move."""

    def __init__(self, seed: int):
        rng = self.rng = rng_of("moving obstacles", seed)
        robot, world = random_robot(rng, n_links=4), collide.World()
        for k in range(4):
            X_WB = pose(rotation(rng), rng.uniform(-0.7, 0.7, 3))
            world.add(random_link_shape(rng, 0.2), X_WB, name=f"body{k}", static=bool(rng.integers(2)))
        if seed % 3 == 0:
            world.set_margin("body0", 0.03)
        padding = {link: float(rng.uniform(0, 0.05)) for link in robot.links} if seed % 2 else 0.0
        tool = ("tool", robot.links[1], collide.Box((0.05, 0.1, 0.2)), pose(t=(0, 0, 0.1)))
        self.options = {
            "X_WR": random_pose(rng, 0.2), "padding": padding, "attached": [tool] if seed % 4 == 1 else [],
            "mobile": True, "allowed": [(robot.links[0], "body1")],
        }
        self.checker = collide.RobotChecker(robot, world, **self.options)
        self.world, self.stands = copy.copy(world), collide.RobotChecker(robot, world, **self.options)
        Q = random_configurations(rng, robot, 60)
        self.Q = Q[~self.checker.collides(Q)][:4]
        self.X_WBs = {name: world.body(name).X_WB.copy() for name in ("body0", "body1")}

    def motions(self, q: np.ndarray) -> tuple[collide.Spline, dict[str, collide.Spline]]:
        rng = self.rng
        spline = random_spline(rng, q, 0.3)
        moving = {}
        for name, X in self.X_WBs.items():
            n = int(rng.choice([3, 6]))
            begin = np.concatenate([X[:3, 3], np.zeros(n - 3)])
            Q = begin + 0.6 * rng.normal(size=(4, n)) * np.arange(4)[:, None]
            low, length = spline.breaks[0], spline.breaks[-1] - spline.breaks[0]
            make = collide.Spline.min_jerk if rng.random() < 0.5 else collide.Spline.straight
            moving[name] = make(Q, low + length * np.array([-0.5, 0.3, 0.8, 1.1]))
        return spline, moving

    def hits(self, spline: collide.Spline, moving: dict[str, collide.Spline], t: float) -> bool:
        """Whether the robot collides with all where they are at a time."""
        for name, motion in moving.items():
            self.stands.world.set_pose(name, pose_at(motion(t), self.X_WBs[name]))
        return bool(self.stands.collides(spline(t)))


@pytest.mark.many(4)
@pytest.mark.parametrize("seed", range(16))
def test_free_times_have_no_sample_that_collides_and_told_times_do(seed):
    setting = Setting(seed)
    for q in setting.Q:
        spline, moving = setting.motions(q)
        setting.checker.world = setting.world
        result = setting.checker.certify_spline(spline, moving=moving)
        ends = np.where(result.collides, result.time, result.breaks[1:])
        for t in setting.rng.uniform(spline.breaks[0], spline.breaks[-1], 40).tolist():
            segment = min(int(np.searchsorted(result.breaks, t, "right")) - 1, len(result) - 1)
            is_open = bool(((result.open["begin"] <= t) & (t <= result.open["end"])).any())
            if t < ends[segment] and not is_open:
                assert not setting.hits(spline, moving, t), f"seed {seed}: proven free, and hits at {t}"
        for t in result.time[result.collides].tolist():
            near = np.clip(t + 1e-9 * np.array([-1.0, 0.0, 1.0]), spline.breaks[0], spline.breaks[-1]).tolist()
            assert any(setting.hits(spline, moving, time) for time in near), f"seed {seed}: told to collide at {t}"


def test_both_verdicts_come_and_most_are_decided():
    free = collides = total = by_motion = 0
    for seed in range(16):
        setting = Setting(seed)
        for q in setting.Q:
            spline, moving = setting.motions(q)
            result = setting.checker.certify_spline(spline, moving=moving)
            free, collides, total = free + result.is_free, collides + (result.first is not None), total + 1
            by_motion += result.is_free != setting.checker.certify_spline(spline).is_free
    assert total >= 40 and free >= 0.2 * total and collides >= 0.15 * total and free + collides >= 0.9 * total
    assert by_motion >= 0.1 * total, "motions of obstacles made no difference"


def test_a_ball_that_crosses_between_samples_is_met():
    """A ball of 2 cm crosses the robot's place within a hundredth of the time."""
    world = collide.World()
    world.add(collide.Sphere(0.01), pose(t=(0, 0, 9)), name="ball")
    checker = collide.RobotChecker(slider(), world)
    times, places = np.array([0.0, 0.4, 0.41, 1.0]), np.array([[0, 0, 5.0], [0, 0, 5.0], [0, 0, -5.0], [0, 0, -5.0]])
    ball = collide.Spline.straight(places, times)
    result = checker.certify_path([[0.0], [0.0]], [0.0, 1.0], moving={"ball": ball})
    contact = 0.4 + 0.01 * (5.0 - 0.11) / 10.0
    assert len(result) == 1 and result.first is not None and 0 <= result.first[1] - contact < 1e-5
    assert checker.certify_path([[0.0], [0.9], [0.9]], [0.0, 0.39, 1.0], moving={"ball": ball}).is_free
    aside = collide.Spline.straight(places + np.array([0.0, 0.1101, 0.0]), times)
    assert checker.certify_path([[0.0], [0.0]], [0.0, 1.0], moving={"ball": aside}, resolution=1e-5).is_free
    assert world.body("ball").X_WB[2, 3] == 9.0 and checker.around == ["ball"]


def test_paddings_and_margins_swell_pairs_with_what_moves():
    world = collide.World()
    world.add(collide.Sphere(0.1), pose(t=(0, 0.3, 0)), name="ball")
    passing = collide.Spline.straight([[-2.0, 0.3, 0.0], [2.0, 0.3, 0.0]])  # 0.1 m beside the cart of radius 0.1
    for padding, margin, is_free in ((0.0, 0.0, True), (0.09, 0.0, True), (0.11, 0.0, False), (0.05, 0.04, True),
                                     (0.05, 0.06, False), (0.0, 0.11, False)):
        world.set_margin("ball", margin)
        checker = collide.RobotChecker(slider(), world, padding=padding)
        result = checker.certify_path([[0.0], [0.0]], [0.0, 1.0], moving={"ball": passing}, resolution=1e-4)
        assert (result.is_free, result.first is None) == (is_free, is_free), (padding, margin)


def test_bodies_that_stand_are_asked_as_ever_and_obstacles_not_against_each_other():
    world = collide.World()
    for name, x in (("wall", 0.8), ("ball", 0.8), ("dot", 0.8)):
        world.add(collide.Sphere(0.1), pose(t=(x, 0, 0)), name=name)
    checker = collide.RobotChecker(slider(), world)
    away = collide.Spline.straight([[0.8, 0.0, 0.0], [0.8, 0.0, 0.0]])
    moving = {"ball": away, "dot": away}
    assert checker.certify_path([[0.0], [0.5]], [0.0, 1.0], moving=moving).is_free
    hit = checker.certify_path([[0.0], [0.7]], [0.0, 1.0], moving=moving)
    assert hit.first is not None and abs(hit.first[1] - 6 / 7) < 1e-2
    assert checker.certify_path([[0.0], [0.5]], [0.0, 1.0], moving={}).is_free


def test_meshes_may_move():
    square = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    tube = 0.3 * np.array([(x, y, z) for z in (-0.5, 0.5) for x, y in square])
    sides = [(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)]
    shell = collide.Mesh(tube, [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))])
    world = collide.World()
    world.add(shell, pose(t=(9, 0, 0)), name="tube")
    checker = collide.RobotChecker(slider(), world)
    through = collide.Spline.straight([[0.0, 0.0, -2.0], [0.0, 0.0, 2.0]])
    still = [[0.0], [0.0]]
    assert checker.certify_path(still, [0.0, 1.0], moving={"tube": through}).is_free, "the tube is open at both ends"
    across = collide.Spline.straight([[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    hit = checker.certify_path(still, [0.0, 1.0], moving={"tube": across})
    assert hit.first is not None and abs(hit.first[1] - (2.0 - 0.3 - 0.1) / 4.0) < 1e-2


def test_what_cannot_move_is_refused_by_name():
    world = collide.World()
    world.add(collide.Sphere(0.1), pose(t=(5, 0, 0)), name="ball")
    world.add(collide.PointCloud(np.full((3, 3), 7.0), 0.01), name="cloud")
    checker = collide.RobotChecker(slider(), world)
    good = collide.Spline.straight(np.zeros((2, 3)))
    for moving, words in (
        ({"bal": good}, "moving names 'bal', which is no body around the robot; there are ball, cloud"),
        ({"cart": good}, "moving names 'cart'"),
        ({"ball": collide.Spline.straight(np.zeros((2, 4)))}, "must have 3 columns, x y z, or 6.*got 4"),
        ({"ball": collide.Spline.straight(np.zeros((2, 3)), [0, 0.5])}, "from 0 to 0.5 and must last from 0 to 1"),
        ({"cloud": good}, "PointCloud.*stands still"),
        ({"ball": [1, 2]}, "must be a collide.Spline"),
        (["ball"], "moving must be a mapping"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            checker.certify_path([[0.0], [0.5]], [0.0, 1.0], moving=moving)
