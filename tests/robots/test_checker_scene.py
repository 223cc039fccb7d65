"""What a checker asks about, prepared once and again when the World changes, and how work is cut into pieces."""

from __future__ import annotations

import copy
import pickle
from itertools import pairwise

import numpy as np
import pytest
from naive import pose
from random_robots import slider

import collide
from collide.errors import InvalidArgument, InvalidPose
from collide.robots.check_configurations import COLLIDES, IS_FREE, IS_OPEN
from collide.robots.checker_scene import CheckerScene
from collide.robots.robot import LinkShape


def scene(world=None, **arguments) -> CheckerScene:
    values = {"X_WR": None, "attached": (), "padding": 0.0, "allowed": (), "mobile": False, **arguments}
    return CheckerScene(values.pop("robot", None) or slider(), world, *values.values())


def walled() -> collide.World:
    world = collide.World()
    world.add(collide.Box((0.2, 0.2, 0.2)), pose(t=(1.0, 0, 0)), name="wall")
    world.add(collide.Sphere(0.1), pose(t=(0, 5.0, 0)), name="ball")
    return world


def test_names_of_bodies_by_their_numbers():
    base = [LinkShape(collide.Sphere(0.1), np.eye(4), None, "test")]
    checker = scene(walled(), robot=slider(base=base))
    assert checker.bodies == ["cart", "base"] and checker.around == ["wall", "ball"]
    assert checker.names_of(0, 1) == ("cart", "base") and checker.names_of(1, -1) == ("base", "wall")
    assert checker.names_of(0, -2) == ("cart", "ball") and checker.n_pairs == 4
    for a, b, words in ((2, 0, "names_of: a"), (0, 2, "names_of: b"), (0, -3, "b must be an integer, one of"),
                        (0, 0.5, "names_of: b")):
        with pytest.raises(InvalidArgument, match=words):
            checker.names_of(a, b)


@pytest.mark.parametrize(("arguments", "error", "words"), [
    ({"world": 3}, InvalidArgument, "world must be a collide.World, got 3"),
    ({"robot": "arm.urdf"}, InvalidArgument, "robot must be a collide.Robot, got 'arm.urdf'"),
    ({"X_WR": np.eye(3)}, InvalidPose, "RobotChecker: X_WR"),
    ({"attached": 3}, InvalidArgument, "attached"),
    ({"allowed": 3}, InvalidArgument, "allowed"),
    ({"mobile": "yes"}, InvalidArgument, "mobile"),
])
def test_arguments_of_another_kind_are_named(arguments, error, words):
    with pytest.raises(error, match=words):
        scene(**arguments)


def test_a_setting_stays_until_the_world_changes():
    world = walled()
    checker = scene(world)
    before = checker.setting
    checker.prepare()
    assert checker.setting is before
    world.set_pose("wall", pose(t=(1.0, 0, 0)))  # where it stands already
    now = checker.prepare()
    assert now.tables is before.tables and np.array_equal(now.seen.X_WBs, before.seen.X_WBs)
    changes = (
        lambda: world.set_pose("wall", pose(t=(2.0, 0, 0))), lambda: world.allow("wall", "ball", reason="known"),
        lambda: world.set_margin("ball", 0.5), lambda: world.add(collide.Sphere(1.0), name="cart"),
        lambda: world.sleep(["ball"]), lambda: world.remove("wall"),
    )
    for change in changes:
        before = checker.setting
        change()
        checker.prepare()
        assert checker.setting is not before
    assert checker.around == ["ball"] and checker.n_pairs == 1


def test_a_pose_of_the_base_that_the_caller_changes_later_is_not_changed():
    X_WR = pose(t=(3.0, 0, 0))
    checker = scene(walled(), X_WR=X_WR)
    X_WR[0, 3] = 7.0
    assert checker.link_poses([0.5])[0, 1, :3, 3].tolist() == [3.5, 0.0, 0.0]
    assert checker.setting.base.tolist() == [1, 0, 0, 0, 1, 0, 0, 0, 1, 3, 0, 0]


def pieces(n: int, threads: int, progress=None) -> list[slice]:
    handed: list[slice] = []
    scene(walled()).in_pieces(n, threads, progress, lambda space, piece: handed.append(piece))
    return sorted(handed, key=lambda piece: piece.start)


@pytest.mark.parametrize(("n", "threads"), [(1, 1), (5000, 1), (1, 2), (511, 2), (1024, 2), (5000, 2), (9999, 3)])
def test_pieces_are_all_of_it_once(n, threads):
    handed = pieces(n, threads)
    assert handed[0].start == 0 and handed[-1].stop == n
    assert all(before.stop == after.start for before, after in pairwise(handed))
    assert len(handed) == 1 if threads == 1 or n < 1024 else len(handed) >= threads
    assert all(piece.stop - piece.start >= 512 for piece in handed[:-1])


def test_nothing_is_handed_out_of_nothing():
    assert pieces(0, 1) == pieces(0, 2) == pieces(0, 1, lambda done, n: None) == []


@pytest.mark.parametrize("threads", [1, 2])
def test_progress_counts_up_to_all_of_it(threads):
    seen: list[tuple[int, int]] = []
    handed = pieces(6000, threads, lambda done, n: seen.append((done, n)))
    assert len(seen) == len(handed) >= 8 and {n for _, n in seen} == {6000}
    assert [done for done, _ in seen] == sorted({done for done, _ in seen}) and seen[-1][0] == 6000


def test_pieces_after_each_other_share_a_workspace():
    checker, spaces = scene(walled()), []
    for _ in range(2):
        checker.in_pieces(3000, 1, lambda done, n: None, lambda space, piece: spaces.append(space))
    assert len(spaces) > 2 and all(space is spaces[0] for space in spaces)
    checker.world.set_pose("wall", pose(t=(4.0, 0, 0)))
    checker.in_pieces(1, 1, None, lambda space, piece: spaces.append(space))
    assert spaces[-1] is spaces[0]  # where a body has moved, poses are brought up to date
    checker.world.replace("wall", collide.Sphere(0.1))
    checker.in_pieces(1, 1, None, lambda space, piece: spaces.append(space))
    assert spaces[-1] is not spaces[0]


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda checker: pickle.loads(pickle.dumps(checker))])
def test_a_copy_answers_as_what_it_was_made_of(copied):
    checker = collide.RobotChecker(slider(), walled(), padding=0.05, allowed=[("cart", "ball")])
    twin = copied(checker)
    assert twin.setting is not checker.setting and twin.skipped == checker.skipped and twin.n_pairs == 1
    q = [[0.7], [0.76]]
    assert twin.collides(q).tolist() == checker.collides(q).tolist() == [False, True]


def test_verdicts_of_kernels_are_three():
    assert sorted((IS_FREE, COLLIDES, IS_OPEN)) == [0, 1, 2]
