"""Objects attached and put down, pairs allowed, while a checker is in use: answers are those of a checker made anew."""

from __future__ import annotations

import copy
import itertools
import pickle
import threading

import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from random_robots import random_configurations, random_link_shape, random_robot, scene_of_spheres, slider

import collide
from collide.errors import InvalidArgument
from collide.robots import checker_scene
from collide.robots.kinematic_tree import Joint
from collide.robots.map_layout import N_FIRST
from collide.robots.robot import LinkShape, Robot


def a_scene(seed: int) -> tuple[collide.Robot, collide.World, np.random.Generator]:
    rng, world = rng_of("attached", seed), collide.World()
    for k in range(6):
        world.add(random_link_shape(rng, 0.2), random_pose(rng, 0.9), name=f"body{k}")
    return random_robot(rng, n_links=5, size=0.08), world, rng


def told(checker: collide.RobotChecker, Q: np.ndarray) -> tuple:
    near = checker.distances(Q)
    return (
        checker.collides(Q).tolist(), near.distance.tobytes(), [frozenset(pair or ()) for pair in near.names],
        checker.edge_collides(Q[:-1], Q[1:], resolution=0.1).tolist(), checker.n_pairs, checker.skipped,
    )


def contradict(A: collide.RobotChecker, B: collide.RobotChecker, Q: np.ndarray) -> bool:
    """Whether motions are proven free by a checker and hit by another: spheres and maps prove other motions free."""
    first, second = (checker.certify_edges(Q[:-1], Q[1:], resolution=0.05) for checker in (A, B))
    assert first.free.any() or first.collides.any()
    return bool((first.free & second.collides).any() or (second.free & first.collides).any())


@pytest.mark.parametrize("seed", range(6))
def test_answers_are_those_of_a_checker_made_anew(seed):
    robot, world, rng = a_scene(seed)
    padding = 0.01 * (seed == 5)
    checker = collide.RobotChecker(robot, world, padding=padding)
    Q = random_configurations(rng, robot, 40)

    def anew(**options) -> collide.RobotChecker:
        made = collide.RobotChecker(robot, world, padding=padding, **options)
        made._count(10**6 * (seed % 2))
        return made

    checker._count(10**6 * (seed % 2))  # with spheres and maps
    before, links, held, n_changed = told(checker, Q), list(robot.geometry), [], 0
    for k in range(2):
        item = (f"held{k}", links[k], random_link_shape(rng, 0.15), random_pose(rng, 0.1), (f"body{k}",))
        checker.attach(*item[:4], touch=item[4])
        held.append(item)
        fresh = anew(attached=held)
        assert told(checker, Q) == told(fresh, Q), (seed, k)
        assert not contradict(checker, fresh, Q)
        n_changed += told(checker, Q)[1] != before[1]
    checker.allow("held0", "body5")
    checker.allow(links[0], links[-1])
    allowed = [("held0", "body5"), (links[0], links[-1])]
    fresh = anew(attached=held, allowed=allowed)
    assert told(checker, Q)[:5] == told(fresh, Q)[:5]
    world.set_pose("body2", random_pose(rng, 0.5))
    assert told(checker, Q)[:5] == told(fresh, Q)[:5]
    checker.detach("held0")
    checker.detach("held1")
    fresh = anew(allowed=allowed[1:])
    assert told(checker, Q)[:5] == told(fresh, Q)[:5]
    assert n_changed >= 1


def test_spheres_and_maps_are_taken_over():
    checker = scene_of_spheres(rng_of("spheres that hold", 1))
    checker._count(10**6)
    spheres, maps = checker.setting.spheres, checker._maps
    checker.attach("box", checker.bodies[0], collide.Box((0.1, 0.1, 0.1)))
    assert checker.setting.spheres is spheres and checker._maps is maps and checker.setting.maps.cells is maps.cells
    assert len(checker.setting.objects[0].spheres.rows) > 1
    checker.detach("box")
    assert checker.setting.spheres is spheres and checker.setting.objects == ()


@pytest.mark.parametrize("how", ["attached anew", "of another checker"])
def test_maps_of_an_object_are_not_those_of_the_next_by_its_name(how):
    """A small part is taken from the cart, then a long one, which reaches into the base: nothing is proven free."""
    block = [LinkShape(collide.Box((0.1, 0.1, 0.1)), np.eye(4), None, "test")]
    slide = Joint("slide", "prismatic", "base", "cart", pose(t=(0.5, 0, 0)), (1.0, 0, 0), -0.1, 0.1)
    robot = Robot("blocks", ["base", "cart"], [slide], {"base": block, "cart": block}, semantic_pairs=[])
    small, Q = ("part", "cart", collide.Box((0.1, 0.1, 0.1)), pose(t=(0, 0, 0.2))), np.zeros((8, 1))
    long = ("part", "cart", collide.Box((1.9, 0.1, 0.1)))
    checker = collide.RobotChecker(robot, attached=[small])
    checker._count(10**6)
    assert checker.setting.maps is not None and (checker.setting.maps.ints[:, N_FIRST] > 0).any()
    assert not checker.collides(Q).any()
    if how == "attached anew":
        checker.detach("part")
        checker.attach(*long)
    else:
        checker = collide.RobotChecker(robot, attached=[long])
        assert checker.setting.maps is not None
    assert checker.collides(Q).all() and checker.collides(Q[0])
    edges = checker.certify_edges(Q, Q + 0.01)
    assert edges.collides.all() and not edges.free.any()


@pytest.mark.parametrize("step", ["PairRules", "surroundings_of", "tables_among"])
def test_an_object_attached_while_another_question_makes_tables_is_not_lost(step, monkeypatch):
    """A question that sees a change of the World is amid its tables when an object is attached: it goes on without the
    object, questions behind it have the object.
    """
    world, made = collide.World(), getattr(checker_scene, step)
    checker = collide.RobotChecker(slider(), world)

    def attach_once(*arguments):
        monkeypatch.setattr(checker_scene, step, made)
        checker.attach("rod", "cart", collide.Box((1.0, 0.1, 0.1)))
        return made(*arguments)

    monkeypatch.setattr(checker_scene, step, attach_once)
    world.add(collide.Sphere(0.1), pose(t=(0.55, 0, 0)), name="ball")
    assert not checker.collides([0.0])
    assert checker.bodies == ["cart", "rod"] and checker.n_pairs == 2
    assert checker.collides(np.zeros((8, 1))).all() and checker.collides([0.0]) and not checker.collides([-0.5])


def test_threads_ask_while_objects_are_attached_and_bodies_move():
    robot, world, rng = a_scene(4)
    link, Q, wrong = robot.links[-1], random_configurations(rng, robot, 12), []
    rod, name = collide.Box((0.8, 0.1, 0.1)), world.names[world.ids[0]]
    places, known = [random_pose(rng, 0.6) for _ in range(2)], []
    for X_WB in places:
        world.set_pose(name, X_WB)
        for attached in ([], [("rod", link, rod)]):
            known.append(collide.RobotChecker(robot, world, attached=attached).collides(Q).tolist())
    checker, is_over = collide.RobotChecker(robot, world), threading.Event()

    def ask():
        while not is_over.is_set():
            told_now = checker.collides(Q).tolist()
            if told_now not in known:
                wrong.append(told_now)

    def move():
        for X_WB in itertools.cycle(places):
            if is_over.is_set():
                return
            world.set_pose(name, X_WB)

    threads = [threading.Thread(target=work) for work in (ask, ask, move)]
    for thread in threads:
        thread.start()
    for _ in range(40):
        checker.attach("rod", link, rod)
        checker.detach("rod")
    is_over.set()
    for thread in threads:
        thread.join()
    assert not wrong and len({tuple(verdicts) for verdicts in known}) > 1
    assert checker.collides(Q).tolist() == collide.RobotChecker(robot, world).collides(Q).tolist()


def test_what_several_threads_change_at_once_is_all_kept():
    robot, world, _ = a_scene(7)
    checker, ball = collide.RobotChecker(robot, world), collide.Sphere(0.01)

    def change(k: int):
        for j in range(20):
            checker.attach(f"{k}/{j}", robot.links[k], ball)
            checker.allow(f"{k}/{j}", f"body{j % 6}")
            if j % 2:
                checker.detach(f"{k}/{j}")

    threads = [threading.Thread(target=change, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    objects = [(name, item.link, ball) for name, item in checker._objects.items()]
    assert {name for name, *_ in objects} == {f"{k}/{j}" for k in range(4) for j in range(0, 20, 2)}
    allowed = [(name, f"body{int(name[2:]) % 6}") for name, *_ in objects]
    fresh = collide.RobotChecker(robot, world, attached=objects, allowed=allowed)
    assert (checker.n_pairs, checker.skipped, checker.bodies) == (fresh.n_pairs, fresh.skipped, fresh.bodies)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda robot: pickle.loads(pickle.dumps(robot))])
def test_a_copy_of_a_robot_makes_tables_of_its_own(copied):
    robot, world, rng = a_scene(9)
    checker, Q = collide.RobotChecker(robot, world), random_configurations(rng, robot, 30)
    twin = copied(robot)
    assert robot.link_tables is not None and twin.link_tables is None and not twin.link_shapes
    assert collide.RobotChecker(twin, world).collides(Q).tolist() == checker.collides(Q).tolist()
    again = collide.RobotChecker(robot, world)
    assert again._tables is checker._tables
    robot.geometry[next(iter(robot.geometry))] = [collide.robots.robot.LinkShape(
        collide.Sphere(0.5), np.eye(4), None, "test")]
    assert collide.RobotChecker(robot, world)._tables is not checker._tables


def test_errors_name_what_is_wrong_and_leave_the_checker():
    robot, world, rng = a_scene(3)
    checker, Q = collide.RobotChecker(robot, world), random_configurations(rng, robot, 10)
    checker.attach("cup", robot.links[1], collide.Sphere(0.05), pose(t=(0, 0, 0.1)))
    before = told(checker, Q)
    for call, message in (
        (lambda: checker.attach("cup", robot.links[1], collide.Sphere(0.1)), 'the name "cup" is used twice'),
        (lambda: checker.attach("jug", "elbow", collide.Sphere(0.1)), "has no link 'elbow'"),
        (lambda: checker.attach("jug", robot.links[1], 0.1), "not a shape but 0.1"),
        (lambda: checker.detach("jug"), "no attached object is called 'jug'; attached: cup"),
        (lambda: checker.allow("cup", "jug"), "no link, attached object or body is called 'jug'"),
    ):
        with pytest.raises(InvalidArgument, match=message):
            call()
    assert told(checker, Q) == before
