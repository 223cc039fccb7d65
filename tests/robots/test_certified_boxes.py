"""Boxes of configurations: what is said to be free has no configuration that collides, open cells hold the rest."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, rng_of
from random_robots import any_pair_hits, random_configurations, random_link_shape, random_robot

import collide
from collide.errors import InvalidArgument
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot


def setting_of(seed: int):
    rng = rng_of("boxes of configurations", seed)
    robot, world = random_robot(rng, n_links=4), collide.World()
    for k in range(12):
        world.add(random_link_shape(rng, 0.25), pose(t=rng.uniform(-0.6, 0.6, 3)), name=f"body{k}")
    checker = collide.RobotChecker(robot, world)
    Q = random_configurations(rng, robot, 60)
    Q = Q[~checker.collides(Q)][:8]
    widths = rng.uniform(0.0, 0.5, Q.shape) * (rng.random(Q.shape) < 0.7)
    return rng, checker, Q - widths, Q + widths


@pytest.mark.parametrize("seed", range(16))
def test_free_boxes_have_no_sample_that_collides_and_open_cells_hold_the_others(seed):
    rng, checker, lo, hi = setting_of(seed)
    result = checker.certify_boxes(lo, hi, max_cells=500)
    assert (result.free.astype(int) + result.collides + result.is_open == 1).all()
    assert ((0.0 <= result.share) & (result.share <= 1.0)).all() and (result.share[result.free] == 1.0).all()
    assert (result.share[result.collides] == 0.0).all() and len(result.open_names) == len(result.open_lo)
    for k in range(len(lo)):
        q = rng.uniform(lo[k], hi[k], (300, lo.shape[1]))
        q[:150] = np.where(rng.random((150, lo.shape[1])) < 0.5, lo[k], hi[k])
        hits = q[any_pair_hits(checker, q)] if not result.collides[k] else np.zeros((0, lo.shape[1]))
        cells = result.open_box == k
        for at in hits:
            is_inside = ((result.open_lo[cells] <= at) & (at <= result.open_hi[cells])).all(axis=1)
            assert is_inside.any(), f"seed {seed}, box {k}: proven free, and collides at {at.tolist()}"
        if result.collides[k]:
            at = result.configuration[k]
            assert (lo[k] <= at).all() and (at <= hi[k]).all() and any_pair_hits(checker, at[None])[0]
        else:
            assert np.isnan(result.configuration[k]).all()


def test_all_verdicts_come():
    verdicts = np.zeros(3, dtype=int)
    for seed in range(16):
        _, checker, lo, hi = setting_of(seed)
        result = checker.certify_boxes(lo, hi, max_cells=500)
        verdicts += result.free.sum(), result.collides.sum(), result.is_open.sum()
    assert verdicts.sum() >= 60 and verdicts[0] >= 20 and verdicts[1] >= 10 and verdicts[2] >= 2, verdicts


def arm(length: float = 0.5) -> Robot:
    """Two rods in the plane, turning about z; the second carries a third that turns about its own axis."""
    rod = [LinkShape(collide.Box((length, 0.02, 0.02)), pose(t=(length / 2, 0, 0)), None, "test")]
    joints = [Joint("first", "continuous", "base", "upper", np.eye(4), (0, 0, 1.0)),
              Joint("second", "continuous", "upper", "lower", pose(t=(length, 0, 0)), (0, 0, 1.0)),
              Joint("spin", "continuous", "lower", "hand", pose(t=(length, 0, 0)), (1.0, 0, 0))]
    tip = [LinkShape(collide.Sphere(0.02), np.eye(4), None, "test")]
    return Robot("arm", ["base", "upper", "lower", "hand"], joints, {"upper": rod, "lower": rod, "hand": tip})


def test_columns_that_do_not_move_the_pair_are_not_halved():
    world = collide.World()
    world.add(collide.Sphere(0.05), pose(t=(0.0, 0.72, 0)), name="post")
    checker = collide.RobotChecker(arm(), world)
    spinning = checker.certify_boxes([-0.3, -0.3, -3.0], [1.2, 0.3, 3.0])
    still = checker.certify_boxes([-0.3, -0.3, 0.0], [1.2, 0.3, 0.0])
    assert spinning.free[0] and still.free[0] and 5 <= still.n_checked <= spinning.n_checked <= 2 * still.n_checked


def test_a_box_around_a_speck_is_never_free():
    """A ball of a hundredth of a millimetre at the surface of the hand at a random configuration of the box."""
    for seed in range(30):
        rng = rng_of("specks in boxes", seed)
        q = rng.uniform(-1, 1, 3)
        tip = arm().link_poses(q)[0, 3, :3, 3]
        direction = rng.normal(size=3)
        world = collide.World()
        world.add(collide.Sphere(1e-5), pose(t=tip + 0.02 * direction / np.linalg.norm(direction)), name="speck")
        width = rng.uniform(0, 0.2, 3)
        shift = rng.uniform(-1, 1, 3) * width
        result = collide.RobotChecker(arm(), world).certify_boxes(q - width + shift, q + width + shift, max_cells=300)
        assert not result.free[0], f"seed {seed}"


def test_meshes_in_boxes_are_proven_by_their_own_distances():
    """A ball slides within an open crate, whose hull it is always within."""
    corners = np.array([(x, y, z) for z in (0, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], dtype=float)
    quads = [(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)] + [(0, 1, 2, 3)]
    crate = collide.Mesh(corners, [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])
    world = collide.World()
    world.add(crate, pose(t=(0, 0, -0.5)), name="crate")
    joints = [Joint("x", "prismatic", "base", "cart", np.eye(4), (1.0, 0, 0)),
              Joint("y", "prismatic", "cart", "ball", np.eye(4), (0, 1.0, 0))]
    ball = [LinkShape(collide.Sphere(0.2), np.eye(4), None, "test")]
    checker = collide.RobotChecker(Robot("ball", ["base", "cart", "ball"], joints, {"ball": ball}), world)
    lo, hi = [[-0.7, -0.7], [0.5, -0.1], [0.0, 0.0]], [[0.7, 0.7], [0.9, 0.1], [0.0, 0.0]]
    result = checker.certify_boxes(lo, hi)
    assert result.free.tolist() == [True, False, True] and result.collides.tolist() == [False, True, False]
    assert checker.collides(result.configuration[1])
    tight = checker.certify_boxes([-0.79, -0.79], [0.8 - 1e-9, 0.79], resolution=0.05, max_cells=300)
    assert tight.is_open[0] and 0.4 < tight.share[0] < 1.0 and set(tight.open_names) == {("ball", "crate")}


def test_limits_of_cells_leave_the_rest_open():
    world = collide.World()
    world.add(collide.Sphere(0.05), pose(t=(0.0, 0.56, 0)), name="post")
    checker = collide.RobotChecker(arm(), world)
    few, many = (checker.certify_boxes([-0.9, -0.9, 0.0], [0.9, 0.9, 0.0], max_cells=n) for n in (3, 12))
    assert few.n_checked <= 3 + 96 and few.is_open[0] and many.is_open[0] and few.share[0] < many.share[0] < 1.0
    assert checker.certify_boxes([-0.9, -0.9, 0.0], [0.9, 0.9, 0.0]).free[0]
    assert "1 boxes" in repr(few) and len(few) == 1


def test_threads_give_the_same():
    _, checker, lo, hi = setting_of(3)
    lo, hi = np.tile(lo, (200, 1)), np.tile(hi, (200, 1))
    one, two = (checker.certify_boxes(lo, hi, max_cells=20, threads=k) for k in (1, 2))
    for field in ("free", "configuration", "share", "open_box", "open_lo", "open_hi"):
        assert getattr(one, field).tobytes() == getattr(two, field).tobytes(), field


def test_bad_boxes_are_refused_by_name():
    checker = collide.RobotChecker(arm())
    for lo, hi, options, words in (
        ([0, 0, 1], [1, 1, 0], {}, "box 0, joint spin, goes from 1 to 0: lo must be at most hi"),
        ([0, 0, 0], [1, 1], {}, r"hi must have shape \(3,\)"),
        ([0, np.nan, 0], [1, 1, 1], {}, "lo.0., joint second, is nan"),
        ([0, 0, 0], [1, 1, 1e60], {}, "joint spin, goes from 0 to 1e"),
        ([0, 0, 0], [1, 1, 1], {"max_cells": 0}, "max_cells must be an integer ≥ 1"),
        ([0, 0, 0], [1, 1, 1], {"resolution": -1.0}, "certify_boxes: resolution must be a positive"),
        (np.zeros((2, 3)), np.ones((3, 3)), {}, "corners"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            checker.certify_boxes(lo, hi, **options)
