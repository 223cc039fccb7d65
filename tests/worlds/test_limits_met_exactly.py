"""Worlds at their limits: rows exactly as far as asked, questions of which the first has no answer, pieces in any
order, margins that all change at once, tables that are just full."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide import Box, Compound, Halfspace, InvalidArgument, Sphere, World, pose
from collide.worlds import outside, posed_bodies
from collide.worlds.bodies import WorldBodies
from collide.worlds.world_parts import MIN_BY_TREE

#: Boxes of 0.5 m, one a metre along x: two such combs have just the pairs of parts that a tree over them is made for.
TEETH = 32
COMB = Compound([(Box((0.5, 0.5, 0.5)), pose((k, 0, 0))) for k in range(TEETH)])
assert TEETH**2 == MIN_BY_TREE


def world_of(*bodies, **options) -> World:
    world = World()
    for shape, place in bodies:
        world.add(shape, pose(place), **options)
    return world


def mesh_of(shape) -> collide.Mesh:
    return collide.Mesh(*collide.tessellate(shape, tolerance=1e-3)[:2])


# --- as far as asked ------------------------------------------------------------------------------


@pytest.mark.parametrize(("limit", "rows"), [(0.5, 1), (0.5 + 2.0**-40, 1), (0.5 - 2.0**-40, 0)])
def test_parts_exactly_as_far_apart_as_asked_have_a_row(limit, rows):
    """The last part of a comb and the first of another, 0.5 m apart: all other pairs are farther."""
    for first, second in ((COMB, COMB), (COMB, Box((0.5, 0.5, 0.5))), (Box((2 * TEETH - 1.5, 0.5, 0.5)), COMB)):
        world = world_of((first, (0, 0, 0)), (second, (TEETH, 0, 0)))
        found = world.distances(max_distance=limit)
        assert len(found) == rows
        for row in found:
            assert row["distance"] == 0.5 and (row["part_a"], row["part_b"]) == (TEETH - 1 if first is COMB else 0, 0)
    world = world_of((COMB, (TEETH, 0, 0)), (COMB, (TEETH, 40, 0)))
    asked = world.query(COMB, pose(), max_distance=limit)
    assert asked["distance"].tolist() == [0.5] * rows and asked["part_a"].tolist() == [TEETH - 1] * rows


@pytest.mark.parametrize(("limit", "body"), [(0.5, 7), (0.5 - 2.0**-50, -1), (0.5 + 2.0**-50, 7)])
def test_the_nearest_body_exactly_as_far_as_asked_counts(limit, body):
    world = World()
    for k in range(9):
        world.add(Box((1, 1, 1)), pose((0, 0, 0) if k == 7 else (50 + 3 * k, 0, 0)))
    assert world.nearest((1, 0, 0), max_distance=limit)["body"].tolist() == [body]
    lower = world.nearest((1, 0, 0))["lower"][0]
    assert world.nearest((1, 0, 0), max_distance=lower)["body"].tolist() == [7]
    assert world.nearest((1, 0, 0), max_distance=np.nextafter(lower, 0.0))["body"].tolist() == [-1]
    found = world.raycast((1, 0, 0), (-1, 0, 0), max_distance=limit)
    assert found["body"].tolist() == [body]


def test_boxes_near_a_box_that_just_touch_it_or_is_a_point():
    world = world_of((Box((1, 2, 4)), (3, 0, 0)), (Sphere(0.5), (-3, 0, 0)))
    _, boxes = world.bounding_boxes()
    low, high = boxes[0, :3], boxes[0, 3:]
    for axis in range(3):
        for corner, outwards in ((low, -np.inf), (high, np.inf)):
            point = 0.5 * (low + high)
            point[axis] = corner[axis]
            assert world.boxes_near(point, point) == [0]
            point[axis] = np.nextafter(corner[axis], outwards)
            assert world.boxes_near(point, point) == []
            point[axis] = corner[axis] + np.copysign(0.5, outwards)
            assert world.boxes_near(point, point, margin=0.5) == [0] == world.boxes_near(point, point, margin=0.75)
            assert world.boxes_near(point, point, margin=0.25) == []
    assert world.boxes_near((-np.inf,) * 3, (np.inf,) * 3) == [0, 1]
    with pytest.raises(InvalidArgument, match="low ≤ high"):
        world.boxes_near((0, 0, 0), (1, -1, 1))


# --- questions without an answer ------------------------------------------------------------------


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_questions_that_meet_nothing_stand_between_those_that_do(missing):
    """Of three the first, the middle or the last meets nothing; so does one asked alone, and all of them."""
    world = world_of((Box((1, 1, 1)), (0, 0, 0)), (Box((1, 1, 1)), (4, 0, 0)), (mesh_of(Box((1, 1, 1))), (0, 9, 0)))
    bodies = [0, 1, 2]
    bodies[missing] = -1
    x = np.array([(0.0, 0, 5), (4.0, 0, 5), (0.125, 9.25, 5)])
    x[missing] = (-7, -7, 5)
    down = (0, 0, -1)
    rays, every = world.raycast(x, down), world.raycast(x, down, all_hits=True)
    assert rays["body"].tolist() == bodies and rays["hit"].tolist() == [body >= 0 for body in bodies]
    assert every["body"].tolist() == [body for body in bodies if body >= 0 for _ in range(2)]
    assert np.diff(every.starts).tolist() == [2 * (body >= 0) for body in bodies]
    casts = world.shape_cast(Sphere(0.25), np.array([pose(p) for p in x]), down)
    assert casts["body"].tolist() == bodies
    near = world.nearest(x, max_distance=4.75)
    assert near["body"].tolist() == bodies and near["distance"][near["hit"]].tolist() == [4.5] * 2
    for found in (world.raycast(x[missing], down, all_hits=True), world.raycast((0, 0, 5), (0, 0, 1), all_hits=True)):
        assert len(found) == 0 and found.starts.tolist() == [0, 0]
    assert world.raycast(x[missing], down)["body"].tolist() == [-1]
    assert world.nearest(x[missing], max_distance=0.5)["body"].tolist() == [-1]
    assert world.shape_cast(Sphere(0.25), pose(x[missing]), down)["body"].tolist() == [-1]


def test_questions_name_their_shapes_and_poses():
    world = world_of((Box((1, 1, 1)), (0, 0, 0)))
    balls = [Sphere(1.0 + k) for k in range(3)]
    poses = np.array([pose((0.5 * k, 0, 0)) for k in range(3)])
    found = world.query(balls, poses, max_distance=1.0)
    assert found["a"].tolist() == [-1, -2, -3] or sorted(found["a"].tolist()) == [-3, -2, -1]
    for row, names in zip(found, found.names):
        k = -1 - int(row["a"])
        body = found._bodies[int(row["a"])]
        assert names == (f"query {k}", "body 0") and body.id == row["a"] == -1 - k
        assert body.shape is balls[k] and np.array_equal(body.X_WB, poses[k])
    assert world.query(balls[0], poses[0], max_distance=1.0).names == [("query", "body 0")]


@pytest.mark.parametrize("is_region_asked", [False, True])
def test_meshes_are_asked_about_regions_as_pairs_are(is_region_asked):
    region, mesh = collide.HPolytope(-np.eye(3), np.zeros(3), bounded=False), mesh_of(Box((1, 1, 1)))
    for x in (-2.0, 0.25):
        shapes = (region, mesh) if is_region_asked else (mesh, region)
        places = ((0, 0, 0), (x, x, x)) if is_region_asked else ((x, x, x), (0, 0, 0))
        world = world_of((shapes[1], places[1]))
        (row,) = world.query(shapes[0], pose(places[0]), max_distance=9.0)
        alone = collide.distance(shapes[0], shapes[1], pose(places[0]), pose(places[1]))
        assert row["hit"] == alone.hit == (x > 0) and row["lower"] <= alone.upper and alone.lower <= row["upper"]


def test_pairs_with_a_mesh_from_outside_are_asked_in_batches(monkeypatch):
    asked = []
    real = outside.mesh_batches.rows_within
    monkeypatch.setattr(outside.mesh_batches, "rows_within", lambda *args: asked.append(args) or real(*args))
    mesh, box = mesh_of(Box((1, 1, 1))), Box((1, 1, 1))
    for shapes, batches in (((mesh, mesh), 1), ((mesh, box), 1), ((box, mesh), 1), ((box, box), 0)):
        asked.clear()
        world = world_of(*[(shapes[1], (3.0 * k, 0, 0)) for k in range(3)])
        assert len(world.query(shapes[0], pose((0, 2, 0)), max_distance=99.0)) == 3 and len(asked) == batches


# --- pieces and batches ---------------------------------------------------------------------------


def test_pieces_behind_the_first_hit_are_left_out_in_any_order(monkeypatch):
    """Of eight pairs in pieces of two the third and fourth piece hit; threads may end in any order."""
    world = World()
    for k in range(8):
        for shift in (0.0, 0.5 if k >= 4 else 1.5):
            world.add(Box((1, 1, 1)), pose((10 * k + shift, 0, 0)))
    packed = world._pack()
    pairs = np.arange(16).reshape(8, 2)
    monkeypatch.setattr(posed_bodies, "_PAIRS_AT_ONCE", 2)
    shares = []

    def backwards(starts, work, threads):
        shares.append(threads)
        for start in reversed(starts):
            work(start)

    for share in (posed_bodies.share, backwards):
        monkeypatch.setattr(posed_bodies, "share", share)
        for threads in (1, 2):
            found = packed.answer(pairs, 0.0, boolean=True, stop_at_hit=True, threads=threads)
            assert found.rows["hit"].tolist() == [False] * 4 + [True] and found.body_pairs == 5
            whole = packed.answer(pairs, 0.0, boolean=False, stop_at_hit=False, threads=threads).rows
            assert whole["a"].tolist() == pairs[:, 0].tolist() and whole["hit"].sum() == 4
    assert shares == [1, 2, 2]


@pytest.mark.parametrize(("most", "first"), [(40, 1), (39, 32), (500, 1)])
def test_of_many_candidates_the_likeliest_are_asked_first(monkeypatch, most, first):
    """Forty pairs of which the last overlaps: asked alone where they are sorted before."""
    world = World()
    for k in range(40):
        for shift in (0.0, 0.5 if k == 39 else 1.0 + 2.0**-20):
            world.add(Box((1, 1, 1)), pose((10 * k + shift, 0, 0)))
    packed = world._pack()
    monkeypatch.setattr(posed_bodies, "_MIN_SORTED", most)
    pairs = np.arange(80).reshape(40, 2)
    sorted_first = []
    real = packed._likeliest
    monkeypatch.setattr(packed, "_likeliest", lambda candidates: sorted_first.append(1) or real(candidates))
    answer = packed.answer(pairs, 0.0, boolean=True, stop_at_hit=True)
    assert answer.rows["hit"].any() and bool(sorted_first) == (first == 32)
    assert answer.body_pairs == (32 if first == 32 else 40)


def test_booleans_of_meshes_stop_after_the_batch_with_a_hit(monkeypatch):
    """Batches of the same two shapes: balls, of which none is met, then boxes, of which one is."""
    mesh = mesh_of(Box((1, 1, 1)))
    world = world_of((mesh, (0, 0, 0)))
    for shape, place in ((Sphere(0.5), (0.9, 0.9, 0.9)), (Box((1, 1, 1)), (0.5, 0, 0)), (Sphere(0.4), (0.8, 0.8, 0.8))):
        world.add(shape, pose(place))
    packed = world._pack()
    asked = []
    real = packed._mesh_rows
    monkeypatch.setattr(packed, "_mesh_rows", lambda batch, *more: asked.append(batch.tolist()) or real(batch, *more))
    pairs = np.array([[0, 1], [0, 2], [0, 3]])
    assert packed.answer(pairs, 0.0, boolean=True, stop_at_hit=True).rows["hit"].tolist() == [False, True]
    assert asked == [[[0, 1]], [[0, 2]]]
    asked.clear()
    assert packed.answer(pairs, 0.0, boolean=True, stop_at_hit=False).rows["hit"].tolist() == [False, True, False]
    assert len(asked) == 3


def test_counts_of_a_query_are_those_of_all_margins():
    """Pairs with the same margin are asked together: three margins, and one of all."""
    world = world_of(*[(Sphere(0.5), (1.25 * k, 0, 0)) for k in range(4)])
    for partner, margin in ((0, 0.25), (2, 0.5)):
        world.set_margin(1, margin, partner=partner)
    assert world.collisions()["a"].tolist() == [0, 1] and world.collisions()["b"].tolist() == [1, 2]
    stats = world.stats
    assert stats["narrowphase"] == stats["convex_pairs"] == 2 + (stats["narrowphase"] == 3)
    assert sum(stats["how"].values()) == stats["narrowphase"] and stats["pairs"] == 6
    plain = world_of(*[(Sphere(0.5), (0.75 * k, 0, 0)) for k in range(4)])
    assert len(plain.collisions()) == 3 == plain.stats["hits"] == plain.stats["narrowphase"]


# --- changes --------------------------------------------------------------------------------------


@pytest.mark.parametrize("moved", [(0, 1), (0,), (1,)])
def test_margins_that_change_count_at_the_next_question(moved):
    """All bodies at once, or one of two."""
    world = world_of((Box((1, 1, 1)), (0, 0, 0)), (Box((1, 1, 1)), (1.25, 0, 0)))
    for _ in range(2):
        assert not world.collides() and not len(world.collisions())
        for body in moved:
            world.set_margin(body, 0.25 / len(moved))
        assert world.collides() and len(world.collisions()) == 1
        for body in moved:
            world.set_margin(body, 0.0)


def test_margins_of_new_bodies_are_read_where_they_are_numbers_of_any_kind():
    for margin in (0.25, np.float64(0.25), np.float32(0.25), 1):
        world = world_of((Box((1, 1, 1)), (0, 0, 0)))
        assert world.body(world.add(Box((1, 1, 1)), pose((1.25, 0, 0)), margin=margin)).margin == float(margin)
        assert world.collides()
    for none in (0, 0.0, np.float64(0.0), -0.0):
        assert world.body(world.add(Sphere(0.1), margin=none)).margin == 0.0
    for wrong in (-0.25, float("nan"), float("inf"), "far", 1e60, np.zeros(1)):
        with pytest.raises(InvalidArgument, match=r"World\.add: margin"):
            world.add(Sphere(0.1), margin=wrong)


@pytest.mark.parametrize("remaining", [0, 1, 5])
def test_rows_of_removed_bodies_stay_until_they_are_more_than_so_many(remaining):
    """64 and twice the number of the others."""
    for more, is_closed in ((0, False), (1, True)):
        bodies = WorldBodies()
        n = 64 + 2 * remaining + more
        for k in range(n):
            bodies.add(Sphere(1.0 + k), pose((k, 0, 0)), None, False, 1, 1)
        for identity in range(n - remaining):
            bodies.remove(identity)
        roster = bodies.roster()
        assert len(roster.ids) == len(bodies.poses()) == (remaining if is_closed else n)
        assert roster.ids[roster.alive].tolist() == list(range(n - remaining, n)) == bodies.ids
        assert bodies.poses()[roster.alive][:, 0, 3].tolist() == list(range(n - remaining, n))


def test_arrays_of_ids_of_another_form_are_refused():
    world = world_of(*[(Sphere(0.1), (k, 0, 0)) for k in range(4)])
    for _ in range(2):
        for wrong in (np.array([[0, 1], [2, 3]]), np.array(2), np.array([0.0, 1.0]), np.array([True, False])):
            with pytest.raises((InvalidArgument, collide.UnknownBody)):
                world.sleep(wrong)
        if len(world) == 4:
            world.remove(3)
    for removed in ([0, 3], np.array([3, 0])):
        with pytest.raises(collide.UnknownBody, match="no body has id 3"):
            world.sleep(removed)
    assert not any(world.body(k).sleeping for k in world.ids)
    world.sleep(np.array([0, 2], dtype=np.uint8))
    assert [world.body(k).sleeping for k in world.ids] == [True, False, True]


# --- the nearest pair -----------------------------------------------------------------------------


def test_half_spaces_that_overlap_without_end_are_the_nearest():
    """Boxes of half-spaces have no end: no gap between them is a number."""
    world = world_of((Sphere(0.5), (0, 0, 3)), (Sphere(0.5), (0.5, 0, 3)), (Halfspace((0, 0, 1), 0.0), (0, 0, 0)))
    assert world.minimum()["distance"].tolist() == [-0.5]
    world.add(Halfspace((0, 0.6, 0.8), 0.0))
    (row,) = world.minimum()
    assert row["distance"] == -np.inf and (row["a"], row["b"]) == (2, 3)


def test_of_pairs_that_are_as_near_the_first_is_the_nearest():
    for shape in (Box((1, 1, 1)), Sphere(0.5), COMB):
        world = world_of(*[(shape, (0, 2.0 * k, 0)) for k in range(12)])
        world.set_pose(0, pose((0, -5, 0)))
        (row,) = world.minimum()
        assert row["distance"] == {Box: 1.0, Sphere: 1.0, Compound: 1.5}[type(shape)] and (row["a"], row["b"]) == (1, 2)
        assert len(world.minimum(max_distance=row["distance"])) == 1
        assert len(world.minimum(max_distance=np.nextafter(row["distance"], 0.0))) == 0


def test_bodies_whose_boxes_just_touch_are_no_nearer_than_those_that_overlap():
    for pair, distance in (((1.0, 0.75), -0.25), ((1.0, 1.0), 0.0)):
        world = world_of(*[(Box((1, 1, 1)), (x, 0, 0)) for x in (0.0, pair[0], pair[0] + pair[1])])
        assert world.minimum()["distance"].tolist() == [distance]
        combs = world_of(*[(COMB, (0, 0.5 * y, 0)) for y in (0.0, pair[0], pair[0] + pair[1])])
        assert combs.minimum()["distance"][0] == pytest.approx(0.5 * distance, abs=1e-12)


# --- many parts, many pieces ----------------------------------------------------------------------


def test_a_comb_that_moves_is_asked_where_it_stands():
    """Trees over parts are fitted anew."""
    world = world_of((COMB, (0, 0, 0)), (COMB, (0, 2, 0)))
    assert world.distances(max_distance=1.75)["distance"].tolist() == [1.5]
    for z in (3.0, 1.0, 2.0):
        world.set_pose(1, pose((TEETH, 0, z)))
        (row,) = world.distances(max_distance=9.0)
        gap = np.hypot(0.5, z - 0.5)
        assert row["distance"] == pytest.approx(gap, abs=1e-12) and (row["part_a"], row["part_b"]) == (TEETH - 1, 0)
    world.set_pose(1, pose((0.5, 0, 0)))
    assert world.minimum()["distance"][0] == pytest.approx(0.0, abs=1e-12)


def test_unions_of_different_many_parts_have_the_parts_that_are_nearest():
    short = Compound([(Box((0.5, 0.5, 0.5)), pose((k, 0, 0))) for k in range(70)])
    for first, second, parts in ((COMB, short, (TEETH - 1, 0)), (short, COMB, (69, 0))):
        far = len(first.items)
        world = world_of((first, (0, 0, 0)), (second, (far, 0, 0)), (Sphere(0.5), (0, 50, 0)))
        for limit in (0.5, 0.75):
            (row,) = world.distances(max_distance=limit)
            assert (row["part_a"], row["part_b"]) == parts and row["distance"] == 0.5
            (row,) = world.query(second, pose((-len(second.items), 0, 0)), max_distance=limit)
            assert (row["a"], row["b"], row["part_a"], row["part_b"]) == (-1, 0, len(second.items) - 1, 0)


def test_shapes_from_outside_are_answered_whatever_stands_in_the_world():
    """Distinct shapes of questions and of bodies, of one part, of many, and meshes, all in one question."""
    mesh, wide = mesh_of(Box((1, 1, 1))), Box((1, 1, 1))
    kinds = [Sphere(0.5), COMB, mesh, wide]
    world = world_of(*[(shape, (0, 3.0 * k, 0)) for k, shape in enumerate(kinds)], (COMB, (0, -9, 0)))
    asked = [COMB, mesh, Sphere(0.25), COMB, wide]
    poses = np.array([pose((0.3 * k, 1.5 * k, 5.0)) for k in range(len(asked))])
    found = world.query(asked, poses, max_distance=99.0)
    assert sorted(zip(found["a"].tolist(), found["b"].tolist())) == [(-1 - k, b) for k in range(4, -1, -1)
                                                                     for b in range(5)]
    for row in found:
        k, b = -1 - int(row["a"]), int(row["b"])
        alone = collide.distance(asked[k], world.body(b).shape, poses[k], world.body(b).X_WB)
        assert row["lower"] <= alone.upper and alone.lower <= row["upper"]
    alone = world.query(asked[1], poses[1], max_distance=99.0)
    assert alone["distance"].tolist() == found["distance"][found["a"] == -2].tolist()


@pytest.mark.parametrize("bits", [0, 1, 2**32 - 1])
def test_groups_and_masks_of_all_and_of_no_bits(bits):
    world = World()
    for value in (bits, np.int64(bits), np.uint32(bits)):
        body = world.body(world.add(Sphere(0.5), group=value, mask=value))
        assert (body.group, body.mask) == (bits, bits) and type(body.group) is int
    assert world.collides() == bool(bits)
    assert [world.body(k).group for k in world.add_many(Sphere(0.5), [np.eye(4)] * 3, group=[bits, 1, bits])] == [
        bits, 1, bits,
    ]
    for wrong in (-1, 2**32, 1.0, "1"):
        with pytest.raises(InvalidArgument, match="integer of up to 32 bits"):
            world.add(Sphere(0.5), mask=wrong)
        with pytest.raises(InvalidArgument, match=r"mask\[1\] must be an integer of up to 32 bits"):
            world.add_many(Sphere(0.5), [np.eye(4)] * 2, mask=[1, wrong])


def test_a_cast_shape_has_no_facet():
    world = world_of((mesh_of(Box((1, 1, 1))), (0, 0, 0)), (Box((1, 1, 1)), (5, 0, 0)))
    found = world.shape_cast(Sphere(0.25), np.array([pose((x, 0, 5)) for x in (0, 5, 9)]), (0, 0, -1))
    assert found["facet"].tolist() == [-1, -1, -1] and found["hit"].tolist() == [True, True, False]


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_rows_of_many_pieces_are_those_of_one(monkeypatch, threads):
    """Distances in pieces of four pairs, of bodies of one part, of several, and of a mesh: sorted, the same bits."""
    rng = np.random.default_rng(8)
    kinds = [Sphere(0.5), Box((1, 0.5, 0.25)), Compound([(Sphere(0.25), pose((k, 0, 0))) for k in range(3)]),
             mesh_of(Box((1, 1, 1)))]
    for shapes in (kinds[:2], kinds[:3], kinds):
        world = World()
        for k in range(9):
            world.add(shapes[k % len(shapes)], pose(rng.uniform(-2, 2, 3)))
        whole = world.distances().rows
        assert whole[["a", "b"]].tolist() == [(a, b) for a in range(9) for b in range(a + 1, 9)]
        for size in (4, 18, 36):
            with monkeypatch.context() as patch:
                patch.setattr(posed_bodies, "_PAIRS_AT_ONCE", size)
                assert world.distances(threads=threads).rows.tobytes() == whole.tobytes()
                assert world.stats["narrowphase"] == 36
                assert world.collides(threads=threads) == bool(whole["hit"].any())


def test_a_body_that_is_new_and_moved_is_added_only():
    world = world_of((Sphere(0.5), (0, 0, 0)), (Sphere(0.5), (9, 0, 0)))
    assert not world.collides()
    world.set_pose(world.add(Sphere(0.5), pose((5, 0, 0))), pose((0.5, 0, 0)))
    world.set_pose(1, pose((8, 0, 0)))
    assert world.collides() and (world.stats["updates"]["added"], world.stats["updates"]["moved"]) == (1, 1)


def test_bodies_whose_boxes_meet_and_that_do_not_have_no_overlap():
    c = np.sqrt(0.5)
    turned = np.array([[c, -c, 0, 1.0], [c, c, 0, 1.0], [0, 0, 1, 0], [0, 0, 0, 1]])
    world = World()
    for X_WB in (pose(), turned):
        world.add(Box((1, 1, 1)), X_WB)
    assert world.boxes_near((0.4, 0.4, 0), (0.5, 0.5, 0)) == [0, 1] and not world.collides()
    assert len(world.overlaps()) == 0
    world.set_pose(1, pose((1, 0, 0)))
    assert world.overlaps()["volume"].tolist() == [0.0] and world.overlaps()["patch_area"].tolist() == [1.0]


def test_the_nearest_pair_within_a_limit_is_found_behind_many_that_are_beyond():
    """Balls beside each other at a diagonal: boxes overlap, and the balls are 0.77 m apart."""
    world = World()
    for k in range(24):
        for shift in (0.0, 1.6):
            world.add(Sphere(1.0), pose((20 * k + shift, shift, shift)))
    assert len(world.minimum(max_distance=0.5)) == 0
    pair = [world.add(Sphere(1.0), pose(place)) for place in ((0, 50, 0), (1.9, 51.3, 0))]
    (row,) = world.minimum(max_distance=0.5)
    assert [row["a"], row["b"]] == pair and row["distance"] == pytest.approx(np.hypot(1.9, 1.3) - 2.0)
    pair = [world.add(Box((1, 1, 1)), pose((x, 90, 0))) for x in (0.0, 1.125)]
    (row,) = world.minimum(max_distance=0.5)
    assert [row["a"], row["b"]] == pair and row["distance"] == 0.125


def test_of_bodies_that_are_touched_at_once_the_first_counts_whichever_is_asked_first():
    """A ball meets an edge beside its way and a face before it at the same time: 1.25² = 0.75² + 1²."""
    face, edge = (Box((2, 0.25, 9)), (-1.25, 0, 0)), (Box((2, 2, 9)), (-1.0, 1.75, 0))
    for bodies in ((face, edge), (edge, face)):
        found = world_of(*bodies).shape_cast(Sphere(1.25), pose((5, 0, 0)), (-1, 0, 0))
        assert found["body"].tolist() == [0] and found["distance"].tolist() == [4.0]
