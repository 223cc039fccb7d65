"""Checkers whose World changes: the robot is kept, answers are those of a checker made anew, also while others ask."""

from __future__ import annotations

import copy
import itertools
import threading
import time

import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from random_robots import random_robot, slider

import collide


def cloud_of(k: int) -> collide.PointCloud:
    return collide.PointCloud(rng_of("cloud of a live checker", k).uniform(-1.5, 1.5, (10, 3)), 0.1)


def arm_and_world(seed: int) -> tuple[collide.Robot, collide.World]:
    rng = rng_of("live checkers", seed)
    world = collide.World()
    world.add(cloud_of(seed), name="scan")
    shapes = [collide.Box((0.3, 0.2, 0.2)), collide.Sphere(0.1), collide.Cylinder(0.1, 0.4)]
    union = collide.Compound([(collide.Sphere(0.1), np.eye(4)), (collide.Box((0.2, 0.1, 0.1)), pose(t=(0.2, 0, 0)))])
    for k, shape in enumerate([*shapes, union]):
        world.add(shape, random_pose(rng, 1.5), name=f"b{k}", margin=0.02 * (k == seed % 3))
    return random_robot(rng), world


def told(checker: collide.RobotChecker, Q: np.ndarray) -> tuple:
    near = checker.distances(Q)
    edges = checker.certify_edges(Q[:1], Q[1:2], resolution=0.5)
    return (
        checker.collides(Q).tobytes(), near.rows.tobytes(), near.gradient.tobytes(), checker.around,
        checker.n_pairs, checker.skipped, edges.free.tobytes(), edges.time.tobytes(), edges.open.tobytes(),
        str(checker.explain(Q[0])),
    )


CHANGES = {
    "a cloud updated": lambda world, k: world.replace("scan", world.body("scan").shape.updated(
        added=rng_of("added", k).uniform(-1, 1, (4, 3)), removed=np.arange(3))),
    "a new cloud": lambda world, k: world.replace("scan", cloud_of(100 + k)),
    "a body moved": lambda world, k: world.set_pose("b1", random_pose(rng_of("moved", k), 1.0)),
    "several moved": lambda world, k: world.set_poses(
        ["b0", "b2", "b3"], np.array([random_pose(rng_of("several", k, i), 1.0) for i in range(3)])),
    "another shape": lambda world, k: world.replace("b0", collide.Capsule(0.1, 0.5)),
    "a union": lambda world, k: world.replace("b1", collide.Compound([(collide.Sphere(0.3), pose(t=(0, 0, 0.3)))] * 2)),
    "a margin": lambda world, k: world.set_margin("b3", 0.05),
    "asleep": lambda world, k: world.sleep(["b0", "b1"]),
    "one more": lambda world, k: world.add(collide.Sphere(0.2), random_pose(rng_of("more", k), 1.0), name=f"more {k}"),
    "one less": lambda world, k: world.remove("b2"),
}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", CHANGES)
def test_after_a_change_answers_are_those_of_a_checker_made_anew(name, seed):
    """And after another change."""
    robot, world = arm_and_world(seed)
    checker = collide.RobotChecker(robot, world, padding=0.01 * seed)
    Q = rng_of("Q", seed).uniform(np.maximum(robot.lower, -3), np.minimum(robot.upper, 3), (8, robot.dof))
    kept, names = checker._tables, list(CHANGES)
    for k in (names.index(name), (names.index(name) + 1 + seed) % len(names)):
        CHANGES[names[k]](world, k)
        assert told(checker, Q) == told(collide.RobotChecker(robot, world, padding=0.01 * seed), Q), (seed, names[k])
        assert checker._tables is kept


@pytest.mark.parametrize("is_later", [False, True])
def test_a_body_of_an_allowed_pair_may_leave_the_world_and_come_back(is_later):
    """Questions go on without the body, copies' too; its pair is allowed again once a body has its name."""
    world, robot = collide.World(), slider()
    world.add(collide.Sphere(0.1), name="ball")
    checker = collide.RobotChecker(robot, world, allowed=[] if is_later else [("cart", "ball")])
    assert checker.collides([0.0]) == is_later
    if is_later:
        checker.allow("ball", "cart")
    assert not checker.collides([0.0])
    world.remove("ball")
    world.add(collide.Sphere(0.1), pose(t=(0.5, 0, 0)), name="other")
    straight = collide.Spline.straight([[0.0], [0.2]])
    for asked in (checker, copy.copy(checker)):
        assert asked.collides([0.5]) and not asked.collides([0.0])
        moved = asked.certify_spline(straight, moving={"other": collide.Spline.straight([[0.5, 0, 0], [0.1, 0, 0]])})
        assert moved.collides.all()
    world.add(collide.Sphere(0.1), name="ball")
    assert not checker.collides([0.0]) and checker.collides([0.5])
    with pytest.raises(collide.InvalidArgument, match="ghost"):
        collide.RobotChecker(robot, world, allowed=[("cart", "ghost")])


def test_the_changes_of_these_tests_change_answers():
    """Most of them: a test of answers that stay the same could not fail."""
    robot, world = arm_and_world(0)
    checker, n = collide.RobotChecker(robot, world), 0
    Q = rng_of("Q", 0).uniform(np.maximum(robot.lower, -3), np.minimum(robot.upper, 3), (4, robot.dof))
    before = told(checker, Q)
    for k, change in enumerate(CHANGES.values()):
        change(world, k)
        now = told(checker, Q)
        before, n = now, n + (now != before)
    assert n >= 7, n


def test_what_has_not_changed_is_taken_over():
    robot, world = arm_and_world(3)
    world.set_margin("b0", 0.0)
    checker = collide.RobotChecker(robot, world)
    before = checker.setting
    world.set_pose("b1", np.eye(4))
    moved = checker.prepare()
    assert moved.tables is before.tables and moved.allowed is before.allowed and moved.spare is before.spare
    assert (moved.surroundings.bodies[2].X_WB == np.eye(4)).all()
    sheared = np.eye(4)
    sheared[0, 1] = 1e-10
    world.set_pose("b1", sheared)  # boxes of bodies that are not quite turned have other slack
    skewed = checker.prepare()
    assert skewed.tables.slack > moved.tables.slack and skewed.tables.table is moved.tables.table
    world.replace("scan", cloud_of(9))
    replaced = checker.prepare()
    assert replaced.tables.table is not moved.tables.table and replaced.allowed is before.allowed
    assert checker._tables.table.packed[0] is replaced.tables.table.packed[0]
    world.allow("b0", "b1")
    assert checker.prepare().allowed is not before.allowed


@pytest.mark.many(3)
@pytest.mark.parametrize("seed", range(12))
def test_workspaces_follow_bodies_that_move(seed):
    """Without margins nothing is made anew; each of three moves, a cloud's and a turned union's as well, is answered as
    by a checker made anew, by workspaces that were made before and after.
    """
    rng = rng_of("moves", seed)
    robot, world = arm_and_world(seed)
    for k in range(4):
        world.set_margin(f"b{k}", 0.0)
    for k in range(12):
        world.add(collide.Box(rng.uniform(0.05, 0.3, 3)), random_pose(rng, 1.5), name=f"more {k}")
    checker = collide.RobotChecker(robot, world, padding=0.01 * (seed % 2))
    Q = rng.uniform(np.maximum(robot.lower, -3), np.minimum(robot.upper, 3), (40, robot.dof))
    tables, before = checker.setting.tables, told(checker, Q)
    other, n_changed = checker._workspace(checker.setting), 0  # of another thread, three moves behind
    names = list(world.names.values())
    for move in range(3):
        moved = rng.choice(names, size=(1, 3, len(names))[move], replace=False).tolist()
        world.set_poses(moved, np.array([random_pose(rng, 1.2) for _ in moved]))
        if move == 1:
            world.set_pose(moved[0], np.eye(4))
        now = told(checker, Q)
        assert now == told(collide.RobotChecker(robot, world, padding=0.01 * (seed % 2)), Q), (seed, move)
        assert checker.setting.tables is tables
        n_changed, before = n_changed + (now != before), now
    checker.setting.spare[:] = [other]
    assert told(checker, Q) == before
    assert n_changed >= 1, n_changed


@pytest.mark.parametrize("how", ["moved", "replaced", "both"])
def test_readers_in_other_threads_see_one_world_or_the_other(how):
    """Distances name bodies, so that each answer tells of which World it is."""
    robot, world = arm_and_world(2)
    checker = collide.RobotChecker(robot, world)
    Q = rng_of("Q of readers").uniform(np.maximum(robot.lower, -3), np.minimum(robot.upper, 3), (5, robot.dof))
    poses = [np.array([random_pose(rng_of("of readers", k, i), 0.8) for i in range(4)]) for k in range(2)]

    def change(k: int) -> None:
        with world.changes():
            if how != "replaced":
                world.set_poses(["b0", "b1", "b2", "b3"], poses[k])
            if how != "moved":
                world.replace("scan", cloud_of(50 + k))

    questions = {
        "distances": lambda checker: checker.distances(Q).rows.tobytes(),
        "collides": lambda checker: checker.collides(Q).tobytes(),
        "certify_edges": lambda checker: checker.certify_edges(Q[:1], Q[1:2], resolution=0.5).open.tobytes(),
        "explain": lambda checker: str(checker.explain(Q[0])),
    }
    expected = []
    for k in range(2):
        change(k)
        expected.append({name: ask(collide.RobotChecker(robot, world)) for name, ask in questions.items()})
    asked = [name for name in questions if expected[0][name] != expected[1][name]]
    assert "distances" in asked, asked
    seen, wrong, ended, begun = {0: 0, 1: 0}, [], threading.Event(), time.monotonic()

    def read() -> None:
        for name in itertools.cycle(asked):
            if ended.is_set():
                return
            answer = questions[name](checker)
            which = [k for k in (0, 1) if answer == expected[k][name]]
            if which:
                seen[which[0]] += 1
            else:
                wrong.append(name)
                return

    readers = [threading.Thread(target=read) for _ in range(4)]
    for reader in readers:
        reader.start()
    n_changes = 0
    while time.monotonic() < begun + 20.0 and not wrong:
        change(n_changes % 2)
        n_changes += 1
        if time.monotonic() > begun + 0.3 and min(seen.values()) > 2 and n_changes > 10:
            break
        ended.wait(0.002)
    ended.set()
    for reader in readers:
        reader.join()
    assert not wrong and min(seen.values()) > 2 and n_changes > 10, (wrong, seen, n_changes)


def test_a_question_of_before_is_answered_as_of_before_where_a_matrix_is_no_rotation():
    """A ball stands sheared in front of the cart, then is moved away: workspaces cannot be moved back, and others are
    made for a question that began before.
    """
    world, robot = collide.World(), slider()
    sheared = pose(t=(0.5, 0, 0))
    sheared[0, 1] = 1e-10
    world.add(collide.Sphere(0.1), sheared, name="ball")
    checker = collide.RobotChecker(robot, world)
    before = checker._as_of_now()
    world.set_pose("ball", pose(t=(-0.5, 0, 0)))
    Q = np.array([[0.5], [-0.5], [0.0]])
    assert checker.collides(Q).tolist() == [False, True, False]
    assert before.setting.spare is checker.setting.spare and len(before.setting.spare) == 1
    assert before.collides(Q).tolist() == [True, False, False] and before.collides(Q[0])
    assert checker.collides(Q).tolist() == [False, True, False]
