"""Sleep, margins of bodies and pairs, boxes near a box, batches of outside shapes, the nearest pair, threads."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from naive import one_of_each, pose, random_pose, rng_of

import collide
from collide.errors import InvalidArgument, UnknownBody
from collide.worlds import outside as world_outside
from collide.worlds.world_part_pairs import PartTrees
from collide.worlds.world_parts import WorldParts

EYE = np.eye(4)


def row_of_balls(gap: float, n: int = 3) -> collide.World:
    world = collide.World()
    for k in range(n):
        world.add(collide.Sphere(0.5), pose(t=((1 + gap) * k, 0, 0)), name=f"ball {k}")
    return world


def many(n: int, seed: str = "many") -> collide.World:
    """Boxes, balls and hulls, a third of them hitting something, and a floor."""
    rng, world = rng_of(seed), collide.World()
    kinds = list(one_of_each(rng).items())
    kinds = [shape for kind, shape in kinds if kind in ("Box", "Sphere", "Capsule", "ConvexHull", "Compound")]
    side = 0.5 * n ** (1 / 3)
    for k in range(n):
        world.add(kinds[k % len(kinds)], random_pose(rng, side), static=k % 5 == 0)
    world.add(collide.Halfspace((0, 0, 1), -side), static=True, name="floor")
    return world


def test_a_pair_is_skipped_while_both_sleep():
    world = row_of_balls(-0.1)
    world.sleep(["ball 0", "ball 1"])
    assert world.collisions().names == [("ball 1", "ball 2")]
    assert world.stats["skipped"]["sleeping"] == 1 and world.stats["sleeping"] == 2
    world.sleep([2])
    assert not world.collides() and world.stats["skipped"] == {"sleeping": 3, "broadphase": 0}
    assert world.body(2).sleeping and len(world.query(collide.Sphere(0.5), EYE)) == 2
    assert world.raycast((-5, 0, 0), (1, 0, 0)).names == ["ball 0"]
    world.set_pose(2, pose(t=(0.9, 0, 0)))
    assert not world.collides(), "moving wakes nobody"
    world.wake(world.ids)
    assert len(world.collisions()) == 3 and not world.body(2).sleeping


def test_what_sleeps_on_something_static_is_skipped():
    world = collide.World()
    world.add(collide.Box((9, 9, 1)), static=True)
    crate = world.add(collide.Box((1, 1, 1)), pose(t=(0, 0, 1)))
    other = world.add(collide.Box((1, 1, 1)), pose(t=(0, 0, 2)))
    assert len(world.collisions()) == 2
    world.sleep([crate])
    assert world.collisions().names == [(f"body {crate}", f"body {other}")]
    assert world.stats["skipped"] == {"sleeping": 1, "broadphase": 1}


def test_unknown_bodies_put_nobody_to_sleep():
    world = row_of_balls(-0.1)
    for bodies in ([0, 7], ["ball 0", "nobody"], [0, 1.5]):
        with pytest.raises(UnknownBody):
            world.sleep(bodies)
    assert len(world.collisions()) == 2 and world.stats["sleeping"] == 0


def test_margins_of_bodies_add_up_and_those_of_pairs_replace_them():
    world = row_of_balls(0.25)
    assert not world.collides()
    world.set_margin("ball 0", 0.125)
    assert not world.collides() and world.body(0).margin == 0.125
    world.set_margin("ball 1", 0.125)
    rows = world.collisions()
    assert rows.names == [("ball 0", "ball 1")] and not rows["hit"][0] and rows["distance"][0] == 0.25
    assert world.collides() and len(world.contacts()) == 1 and world.contacts()["distance"][0] == 0.25
    assert len(world.distances(0.125)) == 0, "distances are what they are"
    world.set_margin("ball 0", 0.0, partner="ball 1")
    assert not world.collides() and not len(world.contacts())
    world.set_margin(0, None, partner=1)
    assert world.collides()
    world.set_margin(2, 0.3, partner=1)
    assert world.collisions().names == [("ball 0", "ball 1"), ("ball 1", "ball 2")]
    world.remove(1)
    world.add(collide.Sphere(0.5), pose(t=(1.25, 0, 0)), margin=0.125, name="again")
    assert world.collisions().names == [("ball 0", "again")], "a margin of a pair goes with its bodies"
    assert world.collides(security_margin=0.2)


def test_a_margin_is_inclusive_to_the_last_digit():
    for margin, hits in ((0.25, True), (np.nextafter(0.25, 0), False)):
        world = row_of_balls(0.25, n=2)
        world.set_margin(0, margin)
        assert world.collides() == hits == bool(len(world.collisions()))


def test_margins_that_are_none_are_refused():
    world = row_of_balls(0.1)
    for margin in (-0.1, np.nan, np.inf, "1", 1e-60):
        with pytest.raises(InvalidArgument, match=r"World\.set_margin: margin"):
            world.set_margin(0, margin)
        with pytest.raises(InvalidArgument, match=r"World\.add: margin"):
            world.add(collide.Sphere(1), margin=margin)
    with pytest.raises(InvalidArgument, match="None"):
        world.set_margin(0, None)
    with pytest.raises(InvalidArgument, match="the same body"):
        world.set_margin(0, 0.1, partner=0)
    with pytest.raises(UnknownBody):
        world.set_margin(0, 0.1, partner=9)
    assert len(world) == 3 and not world.collides()


def test_copies_take_sleep_and_margins_along():
    world = row_of_balls(-0.1)
    world.sleep([0, 1])
    world.set_margin(2, 0.5)
    world.set_margin(0, 2.0, partner=2)
    wanted = world.collisions().rows.tobytes()
    for other in (copy.deepcopy(world), pickle.loads(pickle.dumps(world))):
        assert other.collisions().rows.tobytes() == wanted and other.body(0).sleeping
        other.wake([0])
        other.remove(2)
        assert len(other.collisions()) == 1 and world.collisions().rows.tobytes() == wanted


# --- boxes near ---------------------------------------------------------------------------------


def test_boxes_near_a_box_are_those_whose_boxes_are():
    world, rng = many(60), rng_of("boxes near")
    world.set_margin(3, 0.7)
    ids, boxes = world.bounding_boxes()
    assert ids.tolist() == world.ids and np.isinf(boxes[ids == world.ids[-1]]).all()
    n_near = 0
    for _ in range(60):
        low = rng.uniform(-4, 4, 3)
        high, margin = low + rng.uniform(0, 2, 3), float(rng.choice([0.0, 0.3]))
        near = ((boxes[:, :3] - margin <= high) & (low - margin <= boxes[:, 3:])).all(axis=1)
        assert world.boxes_near(low, high, margin) == ids[near].tolist()
        n_near += int(near.sum())
    assert 60 < n_near < 0.9 * 60 * len(world)
    assert world.boxes_near((-np.inf,) * 3, (np.inf,) * 3) == world.ids
    assert collide.World().boxes_near((0, 0, 0), (1, 1, 1)) == []
    for low, high in (((0, 0), (1, 1, 1)), ((1, 0, 0), (0, 1, 1)), ((0, np.nan, 0), (1, 1, 1))):
        with pytest.raises(InvalidArgument, match="boxes_near"):
            world.boxes_near(low, high)


# --- outside shapes -----------------------------------------------------------------------------


def test_a_batch_of_outside_shapes_is_each_of_them():
    world, rng = many(50), rng_of("outside")
    kinds = [shape for kind, shape in one_of_each(rng).items() if kind != "Halfspace"]
    shapes = [kinds[k % len(kinds)] for k in range(30)]
    X = np.array([random_pose(rng, 1.5) for _ in shapes])
    rows = world.query(shapes, X, 0.2)
    assert len(rows) > 60 and (np.diff(-rows["a"]) >= 0).all()
    for k, (shape, X_WS) in enumerate(zip(shapes, X)):
        one = world.query(shape, X_WS, 0.2)
        own = rows.rows[rows["a"] == -1 - k].copy()
        own["a"] = -1
        assert own.tobytes() == one.rows.tobytes(), k
    assert {name for name, _ in rows.names} <= {f"query {k}" for k in range(30)}
    assert world.query(shapes[0], X, 0.2).rows.tobytes() == world.query([shapes[0]] * 30, X, 0.2).rows.tobytes()
    assert len(world.query(shapes[:3], EYE)) == sum(len(world.query(shape, EYE)) for shape in shapes[:3])
    assert len(world.query([], np.empty((0, 4, 4)))) == 0
    pair = rows.pair(0)
    assert pair.distance == rows["distance"][0]
    for wrong in (3, [collide.Sphere(1), None], "box"):
        with pytest.raises(InvalidArgument, match=r"World\.query"):
            world.query(wrong, EYE)
    with pytest.raises(InvalidArgument, match=r"World\.query"):
        world.query(shapes[:3], X[:2])


def test_an_outside_mesh_and_bodies_that_are_meshes():
    world, rng = many(12), rng_of("outside mesh")
    hull = collide.ConvexHull(rng.normal(size=(20, 3)) * 0.5)
    mesh = collide.Mesh(hull.points, hull.hull.facets)
    world.add(mesh, pose(t=(0.5, 0, 0)))
    box, X = collide.Box((1, 1, 1)), np.array([random_pose(rng, 1.0) for _ in range(4)])
    rows = world.query([box, mesh, box, mesh], X, 0.3)
    for k, shape in enumerate([box, mesh, box, mesh]):
        own = rows.rows[rows["a"] == -1 - k].copy()
        own["a"] = -1
        assert own.tobytes() == world.query(shape, X[k], 0.3).rows.tobytes()
    assert len(rows) > 4


# --- the nearest pair ---------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [-0.5, 0.0, 0.2, 4.0])
@pytest.mark.parametrize("n", [2, 3, 40])
def test_the_nearest_pair_is_the_least_of_all_distances(gap, n):
    """Overlapping, touching, near and far, unions among them; of equal ones the least ids."""
    rng, world = rng_of("minimum", gap, n), collide.World()
    side = int(np.ceil(n ** (1 / 3)))
    cells = [(x, y, z) for x in range(side) for y in range(side) for z in range(side)]
    for k in range(n):
        shape = [collide.Sphere(0.5), collide.Box((1, 1, 1)), collide.Compound([(collide.Sphere(0.5), EYE)] * 2)][k % 3]
        jitter = rng.uniform(-0.05, 0.05, 3) * (k % 4 == 0)
        world.add(shape, pose(t=(1 + gap) * np.array(cells[k]) + jitter), static=k % 7 == 3)
    rows = world.distances()
    least = rows.rows[np.lexsort((rows["b"], rows["a"], rows["distance"]))[:1]]
    found = world.minimum()
    assert found.rows.tobytes() == least.tobytes() and len(found) == 1
    assert len(world.minimum(max_distance=max(float(least["distance"][0]) - 1e-9, 0.0))) == (least["distance"][0] <= 0)


def test_the_nearest_pair_asks_few():
    world = many(400)
    world.minimum()
    n_asked = []
    own = type(world._pack()).answer

    def counted(self, candidates, *arguments, **options):
        n_asked.append(len(candidates))
        return own(self, candidates, *arguments, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(type(world._pack()), "answer", counted)
        world.minimum()
    world.distances(0.0)
    assert 0 < sum(n_asked) <= world.stats["narrowphase"] + 400 < 0.1 * world.stats["pairs"]


def test_worlds_without_a_pair_have_no_nearest():
    world = collide.World()
    assert len(world.minimum()) == 0
    world.add(collide.Sphere(1), static=True)
    world.add(collide.Sphere(1), static=True)
    assert len(world.minimum()) == 0
    world.add(collide.Sphere(1), pose(t=(1e6, 0, 0)), name="far")
    assert world.minimum().names == [("body 0", "far")]
    planes = collide.World()
    for k in range(2):
        planes.add(collide.Halfspace((0, k, 1), 0.0))
    assert planes.minimum()["distance"].tolist() == [-np.inf]


# --- threads ------------------------------------------------------------------------------------


def test_threads_give_the_same_bits():
    world = many(3000, "threads")
    rng = rng_of("threads")
    X = np.array([random_pose(rng, 8.0) for _ in range(1500)])
    asked = {
        "collides": lambda threads: world.collides(threads=threads),
        "stats": lambda threads: {k: v for k, v in world.stats.items() if k not in ("seconds", "updates")},
        "collisions": lambda threads: world.collisions(threads=threads).rows.tobytes(),
        "distances": lambda threads: world.distances(0.3, threads=threads).rows.tobytes(),
        "contacts": lambda threads: world.contacts(0.05, threads=threads).rows.tobytes(),
        "minimum": lambda threads: world.minimum(threads=threads).rows.tobytes(),
        "query": lambda threads: world.query(collide.Box((2, 2, 2)), X, 0.2, threads=threads).rows.tobytes(),
    }
    for name, ask in asked.items():
        assert ask(1) == ask(3), name
    assert len(world.distances(0.3)) > 4096, "more than two pieces"
    for threads in (0, 1.5, "2"):
        with pytest.raises(InvalidArgument, match="threads"):
            world.collides(threads=threads)


def test_threads_of_the_caller_may_ask_one_world_at_once():
    """Moved, then asked by four threads: what is brought up to date is so once, and kept pairs are whole."""
    world, rng = many(400, "callers"), rng_of("callers")
    for _ in range(12):
        moved = rng.choice(world.ids[:-1], 20, replace=False).tolist()
        world.set_poses(moved, np.array([random_pose(rng, 3.0) for _ in moved]))
        with ThreadPoolExecutor(4) as pool:
            answers = list(pool.map(lambda _: world.distances(0.1).rows.tobytes(), range(8)))
        fresh = pickle.loads(pickle.dumps(world))
        assert set(answers) == {fresh.distances(0.1).rows.tobytes()}


def test_a_boolean_looks_first_where_boxes_overlap_most():
    """One pair deep in another among a thousand whose boxes alone meet: few are asked."""
    world = collide.World()
    tilted = collide.pose((0, 0, 0), quat_wxyz=(1, 0.3, 0.2, 0.1))
    thin = collide.Box((1, 1e-3, 1e-3))
    for k in range(1200):
        for side in (0.0, 0.1):
            X = tilted.copy()
            X[:3, 3] = (3.0 * k, side, 0)
            world.add(thin, X)
    assert not world.collides() and world.stats["narrowphase"] >= 1000
    world.add(collide.Sphere(0.5), pose(t=(3000.0, 9, 0)))
    world.add(collide.Sphere(0.5), pose(t=(3000.0, 9.1, 0)))
    assert world.collides() and world.stats["narrowphase"] <= 64, "the first pairs of all, and the likeliest"


# --- parts of unions ----------------------------------------------------------------------------


def test_parts_by_trees_are_those_of_all_parts(monkeypatch):
    rng = rng_of("part trees")
    for seed in range(6):
        shapes = []
        for m in (90, 40, 1, 25):
            parts = [(collide.Sphere(float(rng.uniform(0.02, 0.6))), random_pose(rng, 2.0)) for _ in range(m)]
            shapes.append(collide.Compound(parts))
        poses = np.array([random_pose(rng, 1.0) for _ in shapes])
        if seed == 0:
            poses[0, :3, :3] *= 1 + 4e-5  # still a pose; its inverse is no transpose
        parts = WorldParts()
        parts.append(shapes, poses)
        candidates = np.array([(i, j) for i in range(4) for j in range(i + 1, 4)])
        for margin in (0.0, 0.2):
            answers = []
            for n_least in (0, 1 << 60):
                monkeypatch.setattr("collide.worlds.world_part_pairs.MIN_BY_TREE", n_least)
                answers.append([found.tolist() for found in PartTrees(parts).near(candidates, margin)])
            assert answers[0] == answers[1], (seed, margin)
            assert 50 < len(answers[0][0]) < 4000


def test_large_unions_ask_few_of_their_parts():
    """Two rods of beads side by side: each bead has few neighbours among two hundred."""
    beads = collide.Compound([(collide.Sphere(0.1), pose(t=(0.25 * k, 0, 0))) for k in range(200)])
    world = collide.World()
    for side in (0.0, 0.19):
        world.add(beads, pose(t=(0, side, 0)))
    assert world.collides()
    assert len(world.collisions()) == 1 and world.stats["convex_pairs"] <= 400


@pytest.mark.parametrize("seed", range(3))
def test_distances_of_large_unions_ask_few_of_their_parts(seed, monkeypatch):
    """Two scattered unions of 200 and 150 parts, of 30,000 pairs of which a hundredth is asked without a limit: the row
    is that of the pair, and outside shapes ask no pair of parts beside it.
    """
    rng, asked = rng_of("large unions apart", seed), []
    A, B = (
        collide.Compound([(collide.Box(rng.uniform(0.02, 0.1, 3)), random_pose(rng, 1.0)) for _ in range(n)])
        for n in (200, 150)
    )
    X_WA, X_WB = pose(), random_pose(rng, 0.3)
    X_WB[:3, 3] += 3.0

    def without_names(rows: np.ndarray) -> bytes:
        rows = rows.copy()
        rows["a"] = rows["b"] = rows["iterations"] = 0
        return rows.tobytes()

    expected = collide.distance(A, B, X_WA, X_WB).rows
    world, of_B = collide.World(), collide.World()
    world.add(A, X_WA)
    for each in (world, of_B):
        each.add(B, X_WB)
    run_pairs = world_outside.run_pairs

    def counted(table, poses, shape_of, pairs, **named):
        asked.append(len(pairs))
        return run_pairs(table, poses, shape_of, pairs, **named)

    monkeypatch.setattr(world_outside, "run_pairs", counted)
    limit = 1.01 * float(expected["distance"][0])
    told = [world.distances(), world.distances(limit)]
    assert world.stats["convex_pairs"] <= 300 and world.stats["narrowphase"] == 1
    for rows in (*told, world.minimum(), of_B.query(A, X_WA, np.inf)):
        assert without_names(rows.rows) == without_names(expected), f"seed {seed}"
    assert not sum(asked)
