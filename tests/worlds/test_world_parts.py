"""Parts of a World's bodies in columns: added, moved, measured; pairs of them that are near; outside shapes; names."""

from __future__ import annotations

import itertools
import time

import numpy as np
import pytest
from naive import pose, random_pose, rng_of

import collide
from collide.errors import InvalidArgument, UnknownBody
from collide.lowering.shape_table import POSE_TERMS
from collide.numerics.growing_rows import GrowingRows
from collide.worlds.outside import _some_poses, questions_of
from collide.worlds.world_part_pairs import PartTrees
from collide.worlds.world_parts import WorldParts, runs

BALL, BOX = collide.Sphere(0.25), collide.Box((0.5, 0.5, 0.5))
TURNED = collide.Compound([(BOX, random_pose(rng_of("turned part"), 0.5)), (BALL, pose(t=(0, 1.0, 0)))])


def chain(n: int) -> collide.Compound:
    """Balls in a row along x, half a metre from each other."""
    return collide.Compound([(BALL, pose(t=(0.75 * k, 0, 0))) for k in range(n)])


def parts_of(*placed) -> WorldParts:
    parts = WorldParts()
    for shape, X_WB in placed:
        parts.append([shape], X_WB[None])
    return parts


def test_runs_of_numbers():
    assert runs(np.array([5, 0, 9, 2]), np.array([2, 3, 0, 1])).tolist() == [5, 6, 0, 1, 2, 2]
    assert runs(np.array([7]), np.array([1])).tolist() == [7]
    assert runs(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)).tolist() == []


def test_columns_of_bodies_added_one_by_one_or_at_once():
    """Twins of one shape share its rows of the table."""
    X = np.array([random_pose(rng_of("columns", k)) for k in range(4)])
    shapes = [BALL, TURNED, BALL, TURNED]
    at_once, one_by_one = WorldParts(), parts_of(*zip(shapes, X))
    at_once.append(shapes, X)
    for parts in (at_once, one_by_one):
        assert parts.counts.tolist() == [1, 2, 1, 2] and parts.first.tolist() == [0, 1, 3, 4, 6]
        assert parts.body_of.tolist() == [0, 1, 1, 2, 3, 3] and parts.shape_of.tolist() == [0, 1, 0, 1]
        assert len(parts.table.packed) == 2 and parts.row_of.tolist() == [0, 1, 0, 0, 1, 0]
        assert not parts.all_of_one_part and parts.shapes == [BALL, TURNED]
        assert parts.parts_of(np.array([3, 0])).tolist() == [4, 5, 0]
        assert parts.spans(np.array([1, 2])).tolist() == [[1, 2], [3, 1]]
    assert at_once.poses.rows.tobytes() == one_by_one.poses.rows.tobytes()
    assert at_once.poses.terms.tobytes() == one_by_one.poses.terms.tobytes()
    assert parts_of((BALL, X[0]), (BOX, X[1])).all_of_one_part and WorldParts().all_of_one_part


@pytest.mark.parametrize("moved", [(0,), (1,), (2,), (0, 2), (0, 1, 2), ()])
@pytest.mark.parametrize("shapes", [(TURNED, BALL, TURNED), (TURNED,) * 3, (BALL, BOX, BALL), (BALL, chain(2), BOX)],
                         ids=["mixed", "turned", "single", "chain"])
def test_moved_bodies_are_as_if_added_there(shapes, moved):
    """Some of them, all, none: poses, what their products lost, and boxes, bit by bit."""
    before, after = (np.array([random_pose(rng_of(word, k)) for k in range(3)]) for word in ("before", "after"))
    parts, there = parts_of(*zip(shapes, before)), before.copy()
    there[list(moved)] = after[list(moved)]
    parts.move(np.array(moved, dtype=np.int64), there)
    expected = parts_of(*zip(shapes, there))
    assert parts.poses.rows.tobytes() == expected.poses.rows.tobytes()
    assert parts.poses.terms.tobytes() == expected.poses.terms.tobytes()
    assert parts.boxes.tobytes() == expected.boxes.tobytes()


def test_boxes_of_bodies_hold_all_their_parts():
    parts = parts_of((chain(3), np.eye(4)), (BALL, pose(t=(0, 5.0, 0))), (TURNED, pose(t=(9.0, 0, 0))))
    low, high = np.split(parts.body_boxes(np.array([1, 0])), 2, axis=1)
    assert np.allclose(low, [(-0.25, 4.75, -0.25), (-0.25, -0.25, -0.25)], atol=1e-12)
    assert np.allclose(high, [(0.25, 5.25, 0.25), (1.75, 0.25, 0.25)], atol=1e-12)
    (box,) = parts.body_boxes(np.array([2]))
    of_parts = parts.boxes[[4, 5]]
    assert box.tolist() == [*of_parts[:, :3].min(axis=0), *of_parts[:, 3:].max(axis=0)]


def test_memory_is_counted_with_that_of_tables_and_of_the_tree():
    parts = parts_of((TURNED, np.eye(4)), (BALL, np.eye(4)))
    held = [value for value in vars(parts).values() if isinstance(value, (list, GrowingRows))]
    columns = [column for value in held for column in (value if isinstance(value, list) else [value])]
    of_columns = sum(column.nbytes for column in columns if isinstance(column, GrowingRows))
    ints, numbers = parts.table.ints.nbytes, parts.table.numbers.nbytes
    assert parts.nbytes == of_columns + ints + numbers and min(of_columns, ints, numbers) > 0
    world = collide.World()
    without = world._pack()
    assert without.tree is None and without.nbytes == without.parts.nbytes
    world.add(BALL)
    packed = world._pack()
    assert packed.nbytes == packed.parts.nbytes + packed.tree.nbytes > packed.parts.nbytes


# --- pairs of parts -------------------------------------------------------------------------------


def near(parts: WorldParts, candidates, margin: float) -> list[tuple[int, int, int]]:
    pairs, owner = PartTrees(parts).near(np.array(candidates), margin)
    return [(int(k), int(a), int(b)) for k, (a, b) in zip(owner, pairs)]


@pytest.mark.parametrize("margin", [0.0, 0.3, 1.0, np.inf])
@pytest.mark.parametrize("sizes", [(3, 4), (40, 30), (30, 40), (32, 32), (31, 33), (1, 1100)])
def test_pairs_of_parts_whose_boxes_come_near(sizes, margin):
    """Of few parts and of many, where there is a tree; by every box against every other. Parts stand in a row, rows
    beside each other."""
    a, b = sizes
    parts = parts_of((chain(a), np.eye(4)), (chain(b), pose(t=(0.3, 0.75, 0))), (BALL, pose(t=(0, 0, 50.0))))
    found = near(parts, [(0, 1), (0, 2)], margin)
    low, high = parts.boxes[:, :3], parts.boxes[:, 3:]
    expected = []
    for k, (first, n) in enumerate(((a, b), (a + b, 1))):
        i, j = np.divmod(np.arange(a * n), n)
        j += first
        meets = ((low[i] - margin <= high[j]) & (low[j] - margin <= high[i])).all(axis=1)
        some = [(k, *pair) for pair in zip(i[meets].tolist(), j[meets].tolist())]
        expected += some or [(k, 0, first)]  # each keeps at least its first pair of parts
    assert found == expected


def test_trees_over_parts_follow_bodies_that_move():
    parts = parts_of((chain(40), np.eye(4)), (chain(40), pose(t=(0, 0.75, 0))))
    trees, candidates = PartTrees(parts), np.array([(0, 1)])
    before = trees.near(candidates, 0.3)[0]
    parts.move(np.array([1]), np.array([np.eye(4), pose(t=(0, 99.0, 0))]))
    assert trees.near(candidates, 0.3)[0].tolist() == [[0, 40]]
    parts.move(np.array([1]), np.array([np.eye(4), pose(t=(0, 0.75, 0))]))
    assert np.array_equal(trees.near(candidates, 0.3)[0], before) and len(before) >= 40


# --- outside shapes -------------------------------------------------------------------------------


def test_questions_of_shapes_that_repeat():
    X_WS = np.array([pose(t=(k, 0, 0)) for k in range(4)])
    made = questions_of([chain(2), BALL, TURNED, BALL], X_WS)
    assert made.shape_of.tolist() == [0, 1, 2, 1] and made.counts.tolist() == [2, 1, 2, 1]
    assert made.first.tolist() == [0, 2, 3, 5] and len(made.poses.rows) == 6
    assert np.allclose(made.boxes[0], (-0.25, -0.25, -0.25, 1.0, 0.25, 0.25))
    assert np.allclose(made.boxes[3], (2.75, -0.25, -0.25, 3.25, 0.25, 0.25))
    assert questions_of([BALL], X_WS).shape_of.tolist() == [0] * 4 and len(questions_of([BALL], X_WS[:0]).boxes) == 0


def test_poses_of_some_parts_keep_the_terms_of_their_products():
    """Also of the first part, whose terms are row 0."""
    made = parts_of((TURNED, random_pose(rng_of("terms"))), (BALL, np.eye(4)), (TURNED, random_pose(rng_of("more"))))
    column = made.poses.rows[:, POSE_TERMS]
    assert sorted(column[column >= 0].tolist()) == list(range(int((column >= 0).sum()))) and 0.0 in column
    for some in ([0], [3, 0], [2], [0, 1, 2, 3, 4], [4, 3]):
        poses = _some_poses(made.poses, np.array(some))
        for row, part in zip(poses.rows, some):
            was = made.poses.rows[part]
            assert row[:POSE_TERMS].tolist() == was[:POSE_TERMS].tolist()
            assert (row[POSE_TERMS] >= 0) == (was[POSE_TERMS] >= 0)
            if row[POSE_TERMS] >= 0:
                expected = made.poses.terms[int(was[POSE_TERMS])]
                assert poses.terms[int(row[POSE_TERMS])].tobytes() == expected.tobytes()


@pytest.mark.parametrize("shape", [BALL, TURNED, chain(3)], ids=["ball", "turned", "chain"])
def test_queries_from_outside_are_those_of_pairs(shape):
    rng, world, n = rng_of("outside"), collide.World(), 0
    for k in range(5):
        world.add((BALL, TURNED, chain(2), BOX, TURNED)[k], random_pose(rng, 1.2))
    X_WS = np.array([random_pose(rng, 1.2) for _ in range(6)])
    rows = world.query(shape, X_WS, max_distance=0.75).rows
    found = {(-1 - int(row["a"]), int(row["b"])): row for row in rows}
    for question, identity in itertools.product(range(6), range(5)):
        body = world.body(identity)
        alone = collide.distance(shape, body.shape, X_WS[question], body.X_WB)
        if alone.distance <= 0.75:
            row = found[question, identity]
            assert (row["distance"], row["lower"], row["upper"]) == (alone.distance, alone.lower, alone.upper)
            assert (row["part_a"], row["part_b"]) == (alone.part_a, alone.part_b)
            n += 1
        else:
            assert (question, identity) not in found
    order = [(-1 - a, b) for a, b in rows[["a", "b"]].tolist()]
    assert n >= 5 and order == sorted(order)


def test_bodies_are_told_by_name_number_and_none():
    world = collide.World()
    with pytest.raises(UnknownBody, match=r"no body is named 'cup'; there are: none$"):
        world.body("cup")
    for k in range(12):
        world.add(BALL, name=f"b{k:02}")
    with pytest.raises(UnknownBody, match=r'there are: b00, b01, .*, b11$'):
        world.body("cup")
    world.add(BALL, name="a")
    with pytest.raises(UnknownBody, match=r'there are: a, b00, .*, b10, …$'):
        world.body("cup")
    for value in (1.0, None, (1,)):
        with pytest.raises(UnknownBody, match="body must be the id or the name of a body, got"):
            world.body(value)
    with pytest.raises(InvalidArgument, match=r'there is a body named "a" already \(id 12\)'):
        world.add(BALL, name="a")
    for value in ("", 3):
        with pytest.raises(InvalidArgument, match="name must be a non-empty string"):
            world.add(BALL, name=value)


@pytest.mark.parametrize(("value", "is_static"), [
    (True, True), (False, False), (1, True), (0, False), (np.int8(1), True), (np.bool_(False), False),
])
def test_flags_may_be_numbers_that_are_0_or_1(value, is_static):
    world = collide.World()
    assert world.body(world.add(BALL, static=value)).static is is_static
    for wrong in (2, -1, 1.0, "yes", None, np.int8(2)):
        with pytest.raises(InvalidArgument, match=r"World.add: static must be True or False, got"):
            world.add(BALL, static=wrong)


@pytest.mark.parametrize("field", ["group", "mask"])
def test_groups_and_masks_have_bits_enough(field):
    world = collide.World()
    most = 2**32 - 1
    assert getattr(world.body(world.add(BALL, **{field: most})), field) == most
    assert getattr(world.body(world.add(BALL, **{field: 0})), field) == 0
    for wrong in (-1, 1.0, 2**32):
        with pytest.raises(InvalidArgument, match=f"World.add: {field} must be an integer of up to 32 bits"):
            world.add(BALL, **{field: wrong})


def test_matrices_of_allowed_pairs():
    world, allowed = collide.World(), np.zeros((3, 3), dtype=bool)
    for k in range(3):
        world.add(BALL, name=f"b{k}")
    allowed[0, 2] = allowed[2, 0] = True
    world.allow(allowed, reason="told")
    assert world.allowed == {(0, 2): "told"}
    skew = np.zeros((3, 3), dtype=bool)
    skew[0, 1] = True
    for wrong in (skew, allowed.astype(int), allowed[:2, :2], allowed[:2]):
        with pytest.raises(InvalidArgument, match=r"symmetric boolean matrix, \(3, 3\) for the 3 bodies, got"):
            world.allow(wrong)
    assert world.allowed == {(0, 2): "told"}
    with pytest.raises(InvalidArgument, match=r'a and b are the same body 1, "b1"; a body is never tested'):
        world.allow("b1", 1)


def test_seconds_of_a_query_add_up():
    world = collide.World()
    for k in range(3):
        world.add(BALL, pose(t=(0.1 * k, 0, 0)))
    begun = time.perf_counter()
    world.distances()
    passed = time.perf_counter() - begun
    seconds = world.stats["seconds"].values()
    assert len(seconds) == 3 and all(0.0 <= value <= passed for value in seconds) and sum(seconds) <= passed
