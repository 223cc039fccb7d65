"""Worlds changed by one thread while others ask: every answer is that of before a change or of after, as a whole."""

from __future__ import annotations

import copy
import itertools
import sys
import threading
import time

import numpy as np
import pytest
from naive import random_pose, rng_of

import collide
from collide.errors import UnknownBody
from collide.worlds.packed_world import PackedWorld

EYE = np.eye(4)
N = 14


def cloud_of(k: int) -> collide.PointCloud:
    return collide.PointCloud(rng_of("points of a cloud", k).uniform(-1.5, 1.5, (8, 3)), 0.1)


def bodies() -> list[collide.Shape]:
    """Boxes, hulls, unions, a mesh, and a cloud, which is body 0."""
    rng = rng_of("bodies of live worlds")
    corners = np.array([[0, 0, 0], [0.9, 0, 0], [0, 0.9, 0], [0, 0, 0.9]])
    mesh = collide.Mesh(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    union = collide.Compound([(collide.Box((0.5, 0.2, 0.2)), EYE), (collide.Sphere(0.2), collide.pose((0.4, 0, 0)))])
    hulls = [collide.ConvexHull(rng.normal(size=(20, 3)) * 0.4) for _ in range(5)]
    return [cloud_of(0), mesh, union, *hulls, *(collide.Box(rng.uniform(0.2, 0.8, 3)) for _ in range(N - 8))]


def poses_of(k: int) -> np.ndarray:
    return np.array([EYE, *(random_pose(rng_of("poses of live worlds", k, i), 1.6) for i in range(N - 1))])


def world_of(k: int = 0) -> collide.World:
    world = collide.World()
    world.add_many(bodies(), poses_of(k), names=[f"b{i}" for i in range(N)])
    return world


def as_told(result, fields) -> list:
    """Rows with names in the place of ids, which no other World need have."""
    return sorted(
        (names or "", *(row[field].tobytes() for field in fields)) for names, row in zip(result.names, result.rows)
    )


ROWS = ("distance", "lower", "upper", "point_a", "point_b", "hit")
RAYS = rng_of("rays of live worlds").normal(size=(2, 8, 3))
QUESTIONS = {
    "collides": lambda world: world.collides(),
    "collisions": lambda world: as_told(world.collisions(), ROWS),
    "distances": lambda world: as_told(world.distances(0.2), ROWS),
    "minimum": lambda world: as_told(world.minimum(), ROWS),
    "contacts": lambda world: as_told(world.contacts(0.01), ("point_a", "distance", "normal")),
    "raycast": lambda world: as_told(world.raycast(2.0 * RAYS[0], -RAYS[0]), ("distance", "normal")),
    "nearest": lambda world: as_told(world.nearest(RAYS[1]), ("distance", "point")),
    "query": lambda world: as_told(world.query(collide.Sphere(0.3), EYE, 0.1), ROWS[:3]),
    "bounding_boxes": lambda world: np.sort(world.bounding_boxes()[1], axis=0).tobytes(),
}


def answers(world: collide.World) -> dict[str, object]:
    return {name: ask(world) for name, ask in QUESTIONS.items()}


def change_a_shape(world: collide.World, k: int) -> None:
    world.replace("b0", cloud_of(k))


def move_several(world: collide.World, k: int) -> None:
    world.set_poses(np.arange(1, N), poses_of(k)[1:])


def come_and_go(world: collide.World, k: int) -> None:
    """Three bodies of state 0 or two of state 1."""
    with world.changes():
        for name in [name for name in world.names.values() if name.startswith("new")]:
            world.remove(name)
        for i in range(3 - k):
            world.add(collide.Box((0.8, 0.9, 1.0)), poses_of(7)[i + 1], name=f"new {k} {i}")


def change_all(world: collide.World, k: int) -> None:
    """Shape, poses, margin and sleep, in calls of their own."""
    with world.changes():
        world.replace("b0", cloud_of(k))
        for i, X in enumerate(poses_of(k)[1:9]):
            world.set_pose(f"b{i + 1}", X)
        world.set_margin("b3", 0.05 * k)
        (world.sleep if k else world.wake)(["b4", "b5", "b6", "b7", "b8", "b9"])


CHANGES = [change_a_shape, move_several, come_and_go, change_all]


@pytest.fixture
def quick_switches():
    """Threads take turns a hundred times as often."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(5e-5)
    yield
    sys.setswitchinterval(before)


@pytest.mark.many(2)
@pytest.mark.parametrize("change", CHANGES)
def test_four_readers_see_one_state_or_the_other(change, quick_switches):
    world = world_of()
    change(world, 1), change(world, 0)
    expected = []
    for k in range(2):
        change(world, k)
        expected.append(answers(collide_anew(world)))
    asked = [name for name in QUESTIONS if expected[0][name] != expected[1][name]]
    assert len(asked) > 3, asked
    seen, wrong, ended = {(name, k): 0 for name in asked for k in (0, 1)}, [], threading.Event()
    begun = time.monotonic()

    def read(number: int) -> None:
        for name in itertools.islice(itertools.cycle(asked), number, None):
            if ended.is_set():
                return
            answer = QUESTIONS[name](world)
            which = [k for k in (0, 1) if answer == expected[k][name]]
            if which:
                seen[name, which[0]] += 1
            else:
                wrong.append((name, answer))
                return

    readers = [threading.Thread(target=read, args=(k,)) for k in range(4)]
    for reader in readers:
        reader.start()
    n_changes = 0
    while time.monotonic() < begun + 20.0 and not wrong:
        change(world, n_changes % 2)
        n_changes += 1
        if time.monotonic() > begun + 0.4 and min(seen.values()) and sum(seen.values()) > 40 and n_changes > 20:
            break
        ended.wait(0.001)
    ended.set()
    for reader in readers:
        reader.join()
    assert not wrong, (change.__name__, wrong[0][0])
    assert n_changes > 20 and min(seen.values()) and sum(seen.values()) > 40, (n_changes, seen)


def collide_anew(world: collide.World) -> collide.World:
    """The same bodies in a World that has never been changed."""
    return copy.deepcopy(world)


def in_another_thread(work) -> list:
    """What it returns, or the error."""
    told = []

    def run() -> None:
        try:
            told.append(work())
        except Exception as error:  # noqa: BLE001 - told to the thread of the test
            told.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join(30)
    assert told, "another thread waits"
    return told[0]


def remove_and_add(world: collide.World, k: int) -> None:
    world.remove("b3")
    world.add(collide.Sphere(0.5), poses_of(k)[3], name="b3 again", margin=0.02)


def filter_pairs(world: collide.World, k: int) -> None:
    world.allow("b0", "b1")
    world.set_margin("b2", 0.1, partner="b4")
    world.sleep([f"b{i}" for i in range(5, 12)])


def move_one_by_one(world: collide.World, k: int) -> None:
    for i, X in enumerate(poses_of(k)):
        world.set_pose(i, X)
        world.collides()


@pytest.mark.many(4)
@pytest.mark.parametrize("change", [*CHANGES, remove_and_add, filter_pairs, move_one_by_one])
@pytest.mark.parametrize("question", ["collisions", "distances", "contacts", "raycast", "query"])
def test_a_question_that_has_begun_ends_with_the_bodies_that_it_began_with(change, question, monkeypatch):
    """Another thread changes and asks, while the first has its tables in its hands; then once more."""
    world, ask = world_of(), QUESTIONS[question]
    world.collides()
    for turn in (1, 0):
        expected, told, own = ask(collide_anew(world)), [], {}

        def change_and_ask():
            change(world, turn)  # noqa: B023 - called in this turn
            return ask(world), ask(collide_anew(world))

        def watched(name: str) -> None:
            own[name] = getattr(PackedWorld, name)  # noqa: B023

            def interrupted(packed, *args):
                for each, method in own.items():  # noqa: B023
                    monkeypatch.setattr(PackedWorld, each, method)
                told.append(in_another_thread(change_and_ask))  # noqa: B023
                return own[name](packed, *args)  # noqa: B023

            monkeypatch.setattr(PackedWorld, name, interrupted)

        for name in ("candidates", "posed_parts", "to_ids"):
            watched(name)
        assert ask(world) == expected, turn
        (after, anew), = told
        assert after == anew == ask(world) and (after != expected or question in ("raycast", "query")), turn
        if change in (remove_and_add, filter_pairs):
            break


def test_within_a_block_others_see_what_was_before_and_the_changer_what_it_has_done():
    world = collide.World()
    world.add(collide.Sphere(1.0), name="ball")
    world.add(collide.Sphere(1.0), collide.pose((5, 0, 0)), name="other")
    assert not world.collides() and in_another_thread(world.collides) is False
    with world.changes():
        world.set_pose("other", collide.pose((1, 0, 0)))
        assert in_another_thread(world.collides) is False
        assert world.collides() and in_another_thread(world.collides) is False
        with world.changes():
            world.add(collide.Sphere(1.0), collide.pose((0, 1, 0)), name="third")
        assert len(world.collisions()) == 3 and len(in_another_thread(world.collisions)) == 0
        assert len(in_another_thread(lambda: world.nearest((5, 0, 0))["distance"])) == 1
        world.remove("third")
        assert world.body("other").X_WB[0, 3] == 1.0
    assert world.collides() and in_another_thread(world.collides) and len(in_another_thread(world.collisions)) == 1


@pytest.mark.parametrize("is_shared", [True, False])
def test_an_error_in_a_block_leaves_what_came_before_it(is_shared):
    world = world_of()
    world.collides()
    if is_shared:
        in_another_thread(world.collides)
    with pytest.raises(UnknownBody), world.changes():
        world.set_poses(np.arange(N), poses_of(1))
        world.remove("nobody")
    moved = world_of(1)
    assert answers(world) == answers(moved) == in_another_thread(lambda: answers(world))
    world.set_poses(np.arange(N), poses_of(2))  # and the next change is seen, too
    assert in_another_thread(lambda: answers(world)) == answers(world_of(2))


def test_who_changes_or_reads_bodies_waits_for_a_block_of_another_thread():
    world, order = world_of(), []
    world.collides(), in_another_thread(world.collides)

    def change():
        world.set_pose("b1", EYE)
        order.append("moved")

    def look():
        world.body("b2")
        order.append("looked")

    others = [threading.Thread(target=work) for work in (change, look)]
    with world.changes():
        for thread in others:
            thread.start()
        time.sleep(0.05)
        world.set_pose("b1", poses_of(1)[2])
        order.append("block")
    for thread in others:
        thread.join()
    assert order[0] == "block" and set(order) == {"block", "moved", "looked"}
    assert (world.body("b1").X_WB == EYE).all()


def test_two_threads_that_change_lose_nothing(quick_switches):
    world, n = collide.World(), 150

    def work(number: int) -> None:
        for k in range(n):
            mine = world.add(collide.Sphere(0.1), collide.pose((number, k, 0)), name=f"{number} {k}")
            world.set_pose(mine, collide.pose((number, k, 5)))
            if k % 3 == 0:
                world.remove(mine)
            if k % 10 == 0:
                world.collides()

    threads = [threading.Thread(target=work, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    left = {f"{number} {k}" for number in range(3) for k in range(n) if k % 3}
    assert set(world.names.values()) == left and world.ids == sorted(world.ids)
    rows = world.nearest([(number, k, 5) for number in range(3) for k in range(n) if k % 3])
    assert (np.abs(rows["distance"] + 0.1) < 1e-12).all()
    assert sorted(rows.names) == sorted(left)


def test_the_tree_of_a_cloud_is_made_by_who_replaces(monkeypatch):
    world, made = world_of(), []
    own = collide.fields.point_tree.PointTree.__init__

    def noted(tree, points):
        made.append(threading.get_ident())
        own(tree, points)

    world.collisions(), in_another_thread(world.collisions)
    monkeypatch.setattr(collide.fields.point_tree.PointTree, "__init__", noted)
    world.replace("b0", cloud_of(5))
    in_another_thread(world.collisions)
    assert made == [threading.get_ident()]


def test_tables_that_nobody_reads_are_changed_where_they_are():
    """One thread alone copies nothing: neither poses nor boxes nor the tree."""
    world = world_of()
    world.collisions()
    packed, poses = world._packed, world._bodies._X_WBs
    for k in range(3):
        world.set_poses(np.arange(N), poses_of(k))
        with world.changes():
            world.set_pose(3, poses_of(k)[1])
        world.sleep([2]), world.collisions(), world.contacts()
        assert world._packed is packed is world._published and not packed.readers
        assert world._bodies._X_WBs is poses and np.shares_memory(packed.X_WBs, poses)


def test_the_first_question_of_another_thread_sees_all_of_a_block_or_nothing():
    """Nobody else has asked before the block, in which the changer asks: its half-changed tables are its own."""
    world = collide.World()
    world.add(collide.Sphere(1.0), name="a")
    world.add(collide.Sphere(1.0), collide.pose((1, 0, 0)), name="b")
    assert world.collides()
    seen, begun = [], threading.Event()

    def ask() -> None:
        begun.set()
        seen.append(world.collides())

    stranger = threading.Thread(target=ask)
    with world.changes():
        world.set_pose("a", collide.pose((50, 0, 0)))
        assert not world.collides()
        stranger.start()
        begun.wait(5.0)
        stranger.join(0.05)
        world.set_pose("b", collide.pose((51, 0, 0)))
        assert world.collides()
    stranger.join(5.0)
    assert seen == [True]


def test_a_child_forked_within_a_block_of_another_thread_goes_on():
    """As of `os.fork`: the lock is another one, and the thread in the block is not there."""
    world = collide.World()
    world.add(collide.Sphere(1.0), name="a")
    world.add(collide.Sphere(1.0), collide.pose((1, 0, 0)), name="b")
    assert world.collides() and in_another_thread(world.collides)
    inside, ended = threading.Event(), threading.Event()

    def change() -> None:
        with world.changes():
            world.set_pose("a", collide.pose((50, 0, 0)))
            inside.set()
            ended.wait(5.0)

    changer = threading.Thread(target=change)
    changer.start()
    assert inside.wait(5.0)
    world._lock.renew()
    assert not world.collides()
    world.set_pose("a", collide.pose((0, 1, 0)))
    assert world.collides()
    with world.changes():
        world.set_pose("b", collide.pose((90, 0, 0)))
        assert not world.collides()
    assert not world.collides() and not in_another_thread(world.collides)
    ended.set()
    changer.join(5.0)
