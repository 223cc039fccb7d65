"""What a World keeps between questions: tables of bodies that stay, statistics until somebody asks; and what copies
share."""

from __future__ import annotations

import copy
import pickle

import naive
import numpy as np
import pytest
from naive import pose, random_pose, rng_of

import collide
from collide.contact.contact_rows import CONTACT_DTYPE
from collide.errors import InvalidArgument, UnknownBody
from collide.results import PAIR_DTYPE
from collide.worlds import record as world_record
from collide.worlds import world_parts

EYE = np.eye(4)


def crowd(rng, n: int = 18) -> collide.World:
    """Shapes of every kind, meshes, unions and a half-space, some fixed, one pair allowed."""
    world = collide.World()
    hull = collide.ConvexHull(rng.normal(size=(12, 3)) * 0.3)
    mesh = collide.Mesh(hull.points, hull.hull.facets)
    union = collide.Compound([(collide.Box((0.3, 0.4, 0.5)), random_pose(rng, 0.3)), (collide.Sphere(0.2), EYE)])
    kinds = [*naive.one_of_each(rng).values(), mesh, union]
    for k in range(n):
        world.add(kinds[k % len(kinds)], random_pose(rng, 1.0), static=k % 4 == 0, group=1 + k % 2, mask=3)
    world.allow(1, 2, reason="glued")
    return world


def again(world: collide.World) -> collide.World:
    """The same bodies in a World that nothing was asked of."""
    fresh = collide.World()
    for identity in world.ids:
        body = world.body(identity)
        assert fresh.add(body.shape, body.X_WB, static=body.static, group=body.group, mask=body.mask) == identity
    for (a, b), reason in world.allowed.items():
        fresh.allow(a, b, reason=reason)
    return fresh


def answers(world: collide.World) -> list:
    """Everything asked: bytes of rows, booleans, statistics but for seconds."""
    found = []
    for ask in (world.collides, lambda: world.distances(0.4).rows.tobytes(), lambda: world.collisions().rows.tobytes()):
        of_history = "seconds", "updates", "bytes_per_body"
        found += [ask(), {key: value for key, value in world.stats.items() if key not in of_history}]
    return [*found, world.query(collide.Sphere(0.5), EYE, 0.3).rows.tobytes()]


def test_after_moves_of_a_few_all_answers_are_those_of_a_new_world():
    rng, at_rest = rng_of("a few moved"), 0
    world = crowd(rng)
    for turn in range(25):
        moved = rng.choice(world.ids, int(rng.integers(0, 5)), replace=False).tolist()
        for identity in moved:  # at the origin and unturned, products of poses are exact, or there are none
            X = [random_pose(rng, 1.0), EYE, pose(t=rng.integers(-2, 3, 3) / 2)][int(rng.integers(3))]
            world.set_pose(identity, X)
        at_rest += not moved
        assert answers(world) == answers(again(world)), (turn, moved)
    assert at_rest


def test_moving_one_body_looks_at_one(monkeypatch):
    """One thousand bodies, one of which moves: the others' boxes are not worked out again."""
    world, seen = collide.World(), []
    for k in range(1000):
        world.add(collide.Sphere(0.4), pose(t=(k, 0, 0)), static=k > 0)
    assert not world.collides()

    def watch(name: str, how_many) -> None:
        own = getattr(world_parts, name)
        monkeypatch.setattr(world_parts, name, lambda *given: seen.append((name, how_many(given))) or own(*given))

    watch("boxes_of", lambda given: len(given[-1]))
    watch("pose_table", lambda given: len(given[-1]))
    with world._pack() as packed:
        boxes = packed.parts.boxes
    boxes[1:] = 7.0  # nobody reads them but to write the tree's
    world.set_pose(0, pose(t=(7.5, 0, 0)))
    assert world.collides() and not seen and world.stats["updates"]["moved"] == 1
    assert abs(boxes[0, 0] - 7.1) < 1e-9 and (boxes[1:] == 7.0).all()
    posed = world.add(collide.Compound([(collide.Sphere(0.4), pose(t=(0, 0, 0.1)))]), pose(t=(0, 9, 0)))
    world.collides(), seen.clear()
    world.set_pose(posed, pose(t=(3.5, 0, 0)))
    assert world.collides() and sorted(seen) == [("boxes_of", 1), ("pose_table", 1)]
    seen.clear()
    assert world.collides() and not seen, "nothing moved"


def test_statistics_are_worked_out_when_asked_for_and_are_those_of_the_question(monkeypatch):
    counted, own = [], world_record.count_skipped
    monkeypatch.setattr(world_record, "count_skipped", lambda *given: counted.append(1) or own(*given))
    world = crowd(rng_of("statistics"))
    assert world.stats == {}
    rows = world.distances(0.3)
    bodies = len(world)
    world.collides(), world.collisions(), world.distances(0.3)
    assert not counted
    world.add(collide.Sphere(1.0))
    world.remove(0)
    rows.rows["hit"] = False  # of the one who asked
    stats = world.stats
    assert stats is world.stats and len(counted) == 1
    assert stats["bodies"] == bodies and stats["pairs"] == bodies * (bodies - 1) // 2
    assert stats["hits"] > 0 and sum(stats["skipped"].values()) + stats["narrowphase"] == stats["pairs"]


@pytest.mark.many(3)
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda world: pickle.loads(pickle.dumps(world))])
@pytest.mark.parametrize("asked", [False, True])
def test_copies_of_a_world_are_worlds_of_their_own(copied, asked):
    world = crowd(rng_of("copies"))
    if asked:
        world.collides()
    expected = answers(again(world))
    other = copied(world)
    assert other.stats == world.stats and other.ids == world.ids and other.allowed == world.allowed
    assert answers(other) == answers(world) == expected
    assert all(not other.body(k).X_WB.flags.writeable for k in other.ids)
    for one in (other, world):  # either may be changed, and the other stays
        left = other if one is world else world
        before, own = answers(left), answers(one)
        one.remove(0)
        one.set_pose(3, pose(t=(9, 9, 9)))
        one.allow(4, 5)
        one.add(collide.Sphere(5.0), name="new")
        assert answers(left) == before and answers(one) != own
    world, other = crowd(rng_of("copies")), None
    world.set_pose(2, EYE)
    assert answers(copied(world)) == answers(world)


def test_bodies_are_named_by_integers_or_names():
    world = collide.World()
    for k in range(3):
        world.add(collide.Sphere(1), pose(t=(k, 0, 0)), name=f"ball {k}")
    wrong = [
        1.9,
        1.0,
        float("inf"),
        float("nan"),
        np.float64(1.0),
        None,
        True,
        np.True_,
        (1,),
        np.ones(2),
        [1],
        10**400,
        b"ball 1",
    ]
    for body in wrong:
        for ask in (
            world.remove,
            world.body,
            lambda body: world.set_pose(body, EYE),
            lambda body: world.allow(body, 2),
        ):
            with pytest.raises(UnknownBody):
                ask(body)
    assert len(world) == 3
    assert world.body(np.int32(1)) is world.body(1) is world.body("ball 1")


@pytest.mark.parametrize("static", [np.ones(2), np.ones(1), "no", None, 2, 1.0, [True]])
def test_what_is_neither_true_nor_false_is_refused(static):
    world = collide.World()
    with pytest.raises(InvalidArgument, match=r"World\.add: static"):
        world.add(collide.Sphere(1), static=static)
    assert len(world) == 0
    assert [world.body(world.add(collide.Sphere(1), static=s)).static for s in (True, False, np.True_, 1, 0)] == [
        True, False, True, True, False,
    ]


@pytest.mark.parametrize("dtype", [PAIR_DTYPE, CONTACT_DTYPE], ids=["pairs", "contacts"])
def test_rows_have_no_bytes_that_are_no_field(dtype):
    """Numpy leaves padding as it finds it wherever rows are copied: equal answers had different bytes."""
    held = np.zeros(dtype.itemsize, dtype=int)
    for field, at, *_ in dtype.fields.values():
        held[at : at + field.itemsize] += 1
    assert (held == 1).all(), f"bytes {np.flatnonzero(held != 1)} of a row of {dtype.itemsize}"
    assert dtype.alignment == 8 and dtype.itemsize % 8 == 0


def test_equal_answers_are_equal_bytes_whatever_memory_held_before():
    def everything() -> list[bytes]:
        rng = rng_of("bytes")
        world = crowd(rng)
        shapes = [world.body(k).shape for k in world.ids]
        n = len(shapes)
        X_WA, X_WB = (np.array([random_pose(rng, 0.8) for _ in range(n)]) for _ in range(2))
        plain = [shape for shape in shapes if not isinstance(shape, (collide.Mesh, collide.Compound))]
        box, mesh = collide.Box((1, 1, 1)), next(shape for shape in shapes if isinstance(shape, collide.Mesh))
        union = next(shape for shape in shapes if isinstance(shape, collide.Compound))
        rows = [world.distances(0.5).rows, world.collisions().rows, world.query(box, EYE, 0.3).rows]
        rows += [rows[0][::2], rows[0][rows[0]["hit"]], np.concatenate(rows), rows[0][:3].copy(), rows[0][[0, 1]]]
        rows += [
            collide.distance(A, B, EYE, X_WB, signed=False).rows for A in (box, mesh, union) for B in (box, mesh, union)
        ]
        rows += [collide.distance(A, box, EYE, X_WB[1], max_distance=0.2).rows for A in (box, mesh, union)]
        lists = collide.distance(plain, plain[::-1], X_WA[: len(plain)], X_WB[: len(plain)], signed=False)
        rows += [lists.rows, lists[2:5].rows, lists[3].rows]
        rows += [collide.distance(shapes, box, X_WA, X_WB, signed=False, threads=2).rows]
        balls = collide.World()
        for k in range(4):
            balls.add(box, pose(t=(0.9 * k, 0, 0)))
        rows += [balls.contacts(0.1).rows, collide.contacts(mesh, box, EYE, EYE).rows, balls.distances()[1:3]]
        return [own.tobytes() for own in rows]

    def soil(byte: int) -> None:
        """Leaves memory of many sizes that is not zero to whoever asks next."""
        held = [np.full(size, byte, dtype=np.uint8) for size in range(16, 40_000, 80) for _ in range(3)]
        del held

    found = []
    for byte in (0x00, 0xFF, 0xA5):
        soil(byte)
        found.append(everything())
    assert len(found[0]) > 20 and min(map(len, found[0][:2])) > 0
    differing = [k for k, own in enumerate(zip(*found)) if len(set(own)) > 1]
    assert not differing, f"{differing} of {len(found[0])} answers"
