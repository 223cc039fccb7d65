"""Bodies added many at once, and shapes replaced: Worlds answer with the bytes of others made body by body."""

from __future__ import annotations

import copy
import pickle
import threading

import numpy as np
import pytest
from naive import one_of_each, random_pose, rng_of

import collide
from collide.errors import CollideError, InvalidArgument, InvalidPose, UnknownBody
from collide.worlds.packed_world import PackedWorld

EYE = np.eye(4)
BALL = collide.Sphere(0.3)
TRAITS = ("static", "group", "mask", "margin")


def shapes_of(rng, n: int) -> list[collide.Shape]:
    """Of every kind, a mesh among them, some of several bodies."""
    corners = np.array([[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]])
    mesh = collide.Mesh(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    kinds = [mesh, *one_of_each(rng).values()]
    return [kinds[int(k)] for k in rng.integers(0, len(kinds), n)]


def traits_of(rng, n: int) -> dict[str, list]:
    return {
        "static": (rng.random(n) < 0.3).tolist(), "group": rng.choice([1, 1, 3, 2], n).tolist(),
        "mask": rng.choice([3, 3, 1, 2], n).tolist(), "margin": rng.choice([0.0, 0.0, 0.1], n).tolist(),
    }


def answers(world: collide.World) -> dict[str, object]:
    """Everything that a World says of its bodies, as bytes."""

    def told(ask):
        try:
            return ask()
        except CollideError as error:  # two half-spaces that meet, say
            return str(error)

    rng = rng_of("questions")
    origins, directions = rng.uniform(-3, 3, (12, 3)), rng.normal(size=(12, 3))
    return {
        "ids": world.ids, "names": world.names, "allowed": world.allowed,
        "bodies": [
            (body.shape, body.X_WB.tobytes(), body.static, body.group, body.mask, body.margin, body.sleeping)
            for body in map(world.body, world.ids)
        ],
        "collides": told(world.collides),
        "collisions": told(lambda: world.collisions().rows.tobytes()),
        "distances": told(lambda: world.distances(0.4).rows.tobytes()),
        "minimum": told(lambda: world.minimum().rows.tobytes()),
        "contacts": told(lambda: world.contacts(0.05).rows.tobytes()),
        "rays": told(lambda: world.raycast(origins, directions).rows.tobytes()),
        "casts": told(lambda: world.shape_cast(BALL, EYE, directions[0]).rows.tobytes()),
        "nearest": told(lambda: world.nearest(origins).rows.tobytes()),
        "query": told(lambda: world.query(BALL, EYE, 0.5).rows.tobytes()),
        "boxes": [column.tobytes() for column in world.bounding_boxes()],
        "unanswerable": told(lambda: world.unanswerable(0.4)),
    }


def differing(one: collide.World, other: collide.World) -> list[str]:
    theirs = answers(other)
    return [name for name, answer in answers(one).items() if answer != theirs[name]]


# --- add_many -----------------------------------------------------------------------------------


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(4))
def test_added_at_once_or_one_by_one_answers_are_the_same_bytes(seed):
    """Into empty Worlds and into those that were asked and lost bodies, with traits as lists or as arrays."""
    rng = rng_of("add_many", seed)
    one, many, hits = collide.World(), collide.World(), 0
    for turn in range(3):
        n = int(rng.integers(1, 15))
        shapes, X_WBs, traits = shapes_of(rng, n), np.array([random_pose(rng) for _ in range(n)]), traits_of(rng, n)
        names = None if turn == 1 else [f"turn {turn}, {k}" if k % 3 else None for k in range(n)]
        for k in range(n):
            given = {trait: values[k] for trait, values in traits.items()}
            one.add(shapes[k], X_WBs[k], name=names and names[k], **given)
        as_arrays = {trait: np.array(values) for trait, values in traits.items()}
        ids = many.add_many(shapes, X_WBs, names=names, **(as_arrays if seed % 2 else traits))
        assert ids.dtype == np.int64 and ids.tolist() == one.ids[-n:]
        for world in (one, many):
            if turn == 1:
                world.remove(world.ids[0])
                world.allow(world.ids[0], world.ids[-1])
        assert not (wrong := differing(one, many)), f"seed {seed}, turn {turn}: {wrong}"
        hits += one.stats["hits"]
    assert hits > 5
    X_WBs = np.array([random_pose(rng) for _ in range(len(one))])
    for world in (one, many):
        world.set_poses(np.array(world.ids), X_WBs)
    assert not differing(one, many) and not differing(one, pickle.loads(pickle.dumps(many)))


def test_one_for_all_is_each_ones_own():
    X_WBs = np.array([random_pose(rng_of("one for all", k), 0.5) for k in range(20)])
    world, other = collide.World(), collide.World()
    shape = collide.Box((0.2, 0.3, 0.4))
    assert world.add_many(shape, X_WBs, group=2, mask=6, margin=0.05).tolist() == list(range(20))
    other.add_many([shape] * 20, list(X_WBs), group=[2] * 20, mask=(6,) * 20, margin=np.full(20, 0.05))
    assert not differing(world, other) and len(world.collisions()) > 5
    X_WBs[:] = EYE
    assert not differing(world, other) and not np.array_equal(world.body(3).X_WB, EYE), "poses are copied"
    for shapes, X_WB in (([shape] * 3, EYE), ((shape for _ in range(3)), (np.eye(3), np.zeros(3)))):
        at_origin = collide.World()
        assert at_origin.add_many(shapes, X_WB).tolist() == [0, 1, 2] and len(at_origin.collisions()) == 3
    assert world.add_many(shape, EYE).tolist() == [20]


def test_none_are_added_to_any_world():
    world = collide.World()
    assert world.add_many([], np.zeros((0, 4, 4))).shape == (0,) == world.add_many(BALL, np.zeros((0, 4, 4))).shape
    assert not len(world) and world.add(BALL) == 0


TWISTED = np.stack([EYE, EYE, 2 * EYE])
BAD = {
    "no shape": ({"shapes": [BALL, BALL, "ball"]}, InvalidArgument, r"shapes\[2\] must be a shape.*'ball'"),
    "no shapes": ({"shapes": 7}, InvalidArgument, "shapes must be a shape or a sequence of shapes, got 7"),
    "few shapes": ({"shapes": [BALL, BALL]}, InvalidArgument, "lengths do not match: shapes 2, X_WBs 3"),
    "bad pose": ({"X_WBs": TWISTED}, InvalidPose, r"World.add_many: X_WBs\[2\]"),
    "no poses": ({"X_WBs": None}, InvalidPose, "World.add_many: X_WBs"),
    "static": ({"static": [True, 2, False]}, InvalidArgument, r"static\[1\] must be True or False, got 2"),
    "static of all": ({"static": "yes"}, InvalidArgument, "static must be True or False, got 'yes'"),
    "group": ({"group": np.array([1, 2, 2**32])}, InvalidArgument, r"group\[2\] must be an integer of up to 32"),
    "group of floats": ({"group": np.ones(3)}, InvalidArgument, r"group\[0\] must be an integer.*1\.0"),
    "mask": ({"mask": [1, -1, 1]}, InvalidArgument, r"mask\[1\] must be an integer of up to 32 bits, got -1"),
    "mask of few": ({"mask": [1, 1]}, InvalidArgument, r"mask must be one for all bodies or 3.*\[1, 1\]"),
    "mask of rows": ({"mask": np.ones((3, 2), int)}, InvalidArgument, r"mask\[0\] must be an integer"),
    "margin": ({"margin": [0.0, 0.0, -1.0]}, InvalidArgument, r"margin\[2\] must be a number ≥ 0 \[m\].*-1\.0"),
    "margin of all": ({"margin": np.nan}, InvalidArgument, "World.add_many: margin must be a number ≥ 0"),
    "a name": ({"names": ["a", "", "c"]}, InvalidArgument, r"names\[1\] must be a non-empty string, got ''"),
    "one name": ({"names": "abc"}, InvalidArgument, "names must be a sequence of names, or None, got 'abc'"),
    "few names": ({"names": ["a"]}, InvalidArgument, r"names must be 3, one a body, got \['a'\]"),
    "name twice": ({"names": ["a", "b", "a"]}, InvalidArgument, r'names\[2\].* named "a" already \(id 1\)'),
    "name there": ({"names": ["a", "first", None]}, InvalidArgument, r'names\[1\].*"first" already \(id 0\)'),
    "name to be": ({"names": [None, "body 1", "c"]}, InvalidArgument, r'names\[1\].*"body 1" already \(id 1\)'),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_argument_is_named_by_its_place_and_none_are_added(case):
    bad, error, says = BAD[case]
    world = collide.World()
    world.add(BALL, name="first")
    before = answers(world)
    with pytest.raises(error, match=says):
        world.add_many(**({"shapes": BALL, "X_WBs": np.stack([EYE] * 3)} | bad))
    assert answers(world) == before
    assert world.add_many(BALL, np.stack([EYE] * 3)).tolist() == [1, 2, 3] and len(world.collisions()) == 6


# --- replace ------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_replaced_shapes_answer_as_if_they_had_been_added(seed):
    rng = rng_of("replace", seed)
    n = 12
    shapes, X_WBs, traits = shapes_of(rng, n), np.array([random_pose(rng) for _ in range(n)]), traits_of(rng, n)
    world = collide.World()
    world.add_many(shapes, X_WBs, names=[f"n{k}" for k in range(n)], **traits)
    world.allow(2, 5)
    world.set_margin(3, 0.2, partner=4)
    world.sleep([1, 6])
    world.remove(7)
    hits = 0
    for turn in range(4):
        for k in rng.choice([k for k in range(n) if k != 7], 1 + turn, replace=False).tolist():
            shapes[k] = shapes_of(rng, 1)[0]
            world.replace(f"n{k}" if turn % 2 else k, shapes[k])
        if turn == 2:
            X_WBs[4] = random_pose(rng)
            world.set_pose(4, X_WBs[4])
        other = collide.World()
        other.add_many(shapes, X_WBs, names=[f"n{k}" for k in range(n)], **traits)
        other.allow(2, 5)
        other.set_margin(3, 0.2, partner=4)
        other.sleep([1, 6])
        other.remove(7)
        assert not (wrong := differing(world, other)), f"seed {seed}, turn {turn}: {wrong}"
        assert not differing(copy.copy(world), other)
        hits += world.stats["hits"]
    assert hits > 5


def test_results_and_copies_keep_the_shapes_that_they_were_made_with():
    world = collide.World()
    world.add_many(BALL, np.stack([EYE, EYE]))
    before, copied = world.collisions(), copy.copy(world)
    world.add(BALL, collide.pose((9, 0, 0)))  # shapes are the same list, and no roster is of now
    world.replace(0, collide.Box((1, 1, 1)))
    result = before.pair(0)
    collide.verify(*result.question, result)
    assert result.question[0] is BALL
    assert copied.body(0).shape is BALL and copied.collisions().rows.tobytes() == before.rows.tobytes()
    assert isinstance(world.body(0).shape, collide.Box)
    assert before["distance"] == pytest.approx(-0.6) and world.collisions()["distance"] == pytest.approx(-0.8)


def test_a_bad_replacement_changes_nothing():
    world = collide.World()
    world.add_many(BALL, np.stack([EYE, EYE]), names=["a", "b"])
    before = answers(world)
    with pytest.raises(UnknownBody, match="no body is named 'c'"):
        world.replace("c", BALL)
    with pytest.raises(InvalidArgument, match=r"World.replace: shape must be a shape.*got 3"):
        world.replace("a", 3)
    assert answers(world) == before


def test_a_question_that_has_begun_is_answered_with_the_shape_that_it_began_with(monkeypatch):
    """Another thread replaces a shape and asks, while the first is between looking for pairs and answering them."""
    world, large = collide.World(), collide.Compound([(collide.Box((1, 1, 1)), EYE), (BALL, collide.pose((1, 0, 0)))])
    world.add_many([BALL, BALL, collide.Box((1, 2, 1))], np.stack([EYE, collide.pose((0.3, 0, 0)), EYE]))
    expected = world.collisions()
    answer, told = PackedWorld.answer, []

    def replace_and_ask():
        world.replace(0, large)
        told.append(world.collisions())

    def interrupted(packed, *args, **options):
        monkeypatch.setattr(PackedWorld, "answer", answer)
        other = threading.Thread(target=replace_and_ask)
        other.start()
        other.join()
        return answer(packed, *args, **options)

    monkeypatch.setattr(PackedWorld, "answer", interrupted)
    rows = world.collisions()
    assert rows.rows.tobytes() == expected.rows.tobytes() and rows.pair(0).question[0] is BALL
    after = collide.World()
    after.add_many([large, BALL, collide.Box((1, 2, 1))], np.stack([EYE, collide.pose((0.3, 0, 0)), EYE]))
    assert told[0].rows.tobytes() == after.collisions().rows.tobytes() == world.collisions().rows.tobytes()


def test_readers_in_other_threads_see_one_shape_or_the_other():
    shapes = [collide.Sphere(0.4), collide.ConvexHull(rng_of("readers").normal(size=(40, 3)))]
    X_WBs = np.array([random_pose(rng_of("readers", k), 1.5) for k in range(30)])
    expected, seen, wrong, ended = [], [0, 0], [], threading.Event()
    for shape in shapes:
        world = collide.World()
        world.add_many([shape, *[collide.Box((0.5, 0.6, 0.7))] * 29], X_WBs)
        expected.append(world.distances(0.3).rows.tobytes())
    assert expected[0] != expected[1]

    def read():
        while not ended.is_set():
            rows = world.distances(0.3).rows.tobytes()
            if rows in expected:
                seen[expected.index(rows)] += 1
            else:
                wrong.append(rows)

    readers = [threading.Thread(target=read) for _ in range(2)]
    for reader in readers:
        reader.start()
    for k in range(150):
        world.replace(0, shapes[k % 2])
        ended.wait(0.001)
    ended.set()
    for reader in readers:
        reader.join()
    assert not wrong and min(seen) > 3, (len(wrong), seen)
