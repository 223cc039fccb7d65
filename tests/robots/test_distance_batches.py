"""Distances of a batch: near pairs, the nearest of links and robots, against every pair asked one by one.

Judges are `collide.distance` at the poses of the links, and the rows of all pairs for those of links and robots.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hollow_bodies import hollow_scene
from naive import pose, random_pose, rng_of
from random_robots import (
    asked_one_by_one,
    pairs_to_test,
    random_configurations,
    random_link_shape,
    random_robot,
    slider,
)

import collide
from collide.results import PAIR_DTYPE
from collide.robots import distance_batches
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.distance_batches import DistanceQuestion, _are_among, _put_nearer, _slots_of, measure_piece
from collide.robots.distance_gradients import WITNESS
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot
from collide.robots.robot_distances import NEAREST_DTYPE

#: A box without its lid, an open mesh: kernels leave it to others.
CLOSED = collide.tessellate(collide.Box((0.4, 0.4, 0.4)))
LIDLESS = collide.Mesh(CLOSED.vertices, CLOSED.faces[:-2])
BETWEEN = ("all", "world", "self")
#: Seeds of `hollow_scene` whose configurations collide with something.
HITTING = (0, 1, 3, 7)


def checker_of(*placed: tuple) -> collide.RobotChecker:
    world = collide.World()
    for k, (shape, x) in enumerate(placed):
        world.add(shape, pose(t=(x, 0, 0)), name=f"body{k}")
    return collide.RobotChecker(slider(), world)


# --- near pairs -----------------------------------------------------------------------------------


def convex_scene(seed: int):
    """(rng, robot, World) of convex links and unions among convex bodies, unions, and a half-space."""
    rng = rng_of("near pairs", seed)
    robot = random_robot(rng, n_links=5, size=0.2)
    world = collide.World()
    for k in range(8):
        world.add(random_link_shape(rng, 0.2), random_pose(rng, 1.2), name=f"body{k}")
    world.add(collide.Halfspace((0.1, 0.0, 1.0), -0.7), name="ground")
    return rng, robot, world


def carts(lid_at, wall_at: float | None = None) -> collide.RobotChecker:
    """base -slide(x)-> cart -turn(z)-> post -turn(z)-> lid, balls of 0.1 m: cart and lid, tested, and a wall."""
    joints = [
        Joint("slide", "prismatic", "base", "cart", np.eye(4), (1.0, 0, 0), -1.0, 1.0),
        Joint("turn", "revolute", "cart", "post", np.eye(4), (0, 0, 1.0), -1.0, 1.0),
        Joint("spin", "revolute", "post", "lid", pose(t=lid_at), (0, 0, 1.0), -1.0, 1.0),
    ]
    ball = [LinkShape(collide.Sphere(0.1), np.eye(4), None, "test")]
    robot = Robot("carts", ["base", "cart", "post", "lid"], joints, {"cart": ball, "lid": ball})
    world = collide.World()
    if wall_at is not None:
        world.add(collide.Box((0.2, 2.0, 2.0)), pose(t=(wall_at, 0, 0)), name="wall")
    return collide.RobotChecker(robot, world)


def asked(checker, Q, between: str) -> dict:
    """{(configuration, two names): result} of `collide.distance` for every pair to be tested."""
    out = {}
    for k, answers in enumerate(asked_one_by_one(checker, Q, collide.distance)):
        for (_, a, _, b, X_WB), answer in zip(pairs_to_test(checker), answers):
            if between == "all" or (between == "world") == (X_WB is not None):
                out[k, frozenset((a, b))] = answer
    return out


@pytest.mark.many(4)
@pytest.mark.parametrize(
    ("scene", "seed"), [*((hollow_scene, k) for k in HITTING), *((convex_scene, k) for k in range(6))]
)
def test_near_pairs_are_those_of_pairs_asked_one_by_one(scene, seed):
    rng, robot, world = scene(seed)
    checker = collide.RobotChecker(robot, world)
    Q = random_configurations(rng, robot, 12)
    counts: Counter = Counter()
    for between in BETWEEN:
        expected = asked(checker, Q, between)
        for limit in (0.0, 0.1, 0.4, np.inf):
            measured = checker.distances(Q, max_distance=limit, per="pair", between=between)
            keys = [(k, frozenset(names)) for k, names in zip(measured.configuration.tolist(), measured.names)]
            rows = dict(zip(keys, measured.rows))
            assert len(rows) == len(measured) and set(rows) <= set(expected)
            for key, answer in expected.items():
                row, q = rows.get(key), Q[key[0]].tolist()
                say = f"{scene.__name__}({seed}), {between}, {limit}: {key}, q = {q}"
                if row is None:
                    assert answer.upper > limit - 1e-9, say
                    counts["beyond"] += 1
                    continue
                assert answer.lower <= limit + 1e-9 and row["hit"] == answer.hit and not row["beyond"], say
                counts["hit" if answer.hit else "gap"] += 1
                if not answer.hit:  # of unions that overlap the deepest parts count, and these were asked as unions
                    assert abs(row["distance"] - answer.distance) <= 1e-9, say
                    assert row["lower"] <= answer.upper and answer.lower <= row["upper"], say
        assert np.isinf(limit) and len(measured) == len(expected), "without a limit every tested pair has a row"
    assert min(counts["gap"], counts["beyond"]) >= 100 and counts["hit"] >= 8, counts


def test_rows_of_a_configuration_are_sorted_and_named_by_starts():
    rng, robot, world = convex_scene(1)
    checker = collide.RobotChecker(robot, world)
    Q = random_configurations(rng, robot, 30)
    measured = checker.distances(Q, max_distance=0.2, per="pair")
    a, b = measured.a.tolist(), measured.b.tolist()
    n = len(checker.bodies)
    keys = list(zip(measured.configuration.tolist(), a, [other if other >= 0 else n - 1 - other for other in b]))
    assert keys == sorted(set(keys)) and len({key[0] for key in keys}) >= 25
    for k in range(len(Q)):
        rows = slice(measured.starts[k], measured.starts[k + 1])
        assert (measured.configuration[rows] == k).all()
        alone = checker.distances(Q[k], max_distance=0.2, per="pair")
        assert alone.rows.tobytes() == measured.rows[rows].tobytes()
        assert np.array_equal(alone.gradient, measured.gradient[rows], equal_nan=True)
    assert measured.starts[-1] == len(measured) and len(measured.starts) == len(Q) + 1


@pytest.mark.many(3)
@pytest.mark.parametrize("scene", [hollow_scene, convex_scene])
@pytest.mark.parametrize("between", BETWEEN)
def test_rows_of_links_and_robots_are_the_least_of_pairs(scene, between):
    counts: Counter = Counter()
    for seed in range(3):
        rng, robot, world = scene(seed)
        checker = collide.RobotChecker(robot, world, padding=0.01 * (seed % 2))
        Q, n = random_configurations(rng, robot, 12), len(checker.bodies)
        for limit in (0.05, 0.5, np.inf):
            pairs = checker.distances(Q, max_distance=limit, per="pair", between=between)
            links = checker.distances(Q, max_distance=limit, per="link", between=between)
            robots = checker.distances(Q, max_distance=limit, between=between)
            assert links.starts.tolist() == [n * k for k in range(len(Q) + 1)] and len(robots) == len(Q)
            for k in range(len(Q)):
                rows = pairs.rows[pairs.starts[k] : pairs.starts[k + 1]]
                say = f"{scene.__name__}({seed}), {limit}, q = {Q[k].tolist()}"
                compare(robots.rows[k], rows, say, counts)
                for body in range(n):
                    row = links.rows[links.starts[k] + body]
                    compare(row, rows[(rows["a"] == body) | (rows["b"] == body)], f"{say}, body {body}", counts)
                    assert row["beyond"] or row["a"] == body, say
    assert counts["near"] >= 50 and (between == "all" or counts["beyond"] >= 10), counts
    assert counts["hit"] >= 20 or (between == "self" and scene is hollow_scene), counts  # whose links are small


def compare(row, rows, say: str, counts: Counter) -> None:
    """Whether a row is the least of rows (k,), or beyond where there are none."""
    if not len(rows):
        assert row["beyond"] and row["a"] == -1 and np.isinf(row["distance"]), say
        counts["beyond"] += 1
        return
    least = rows[rows["distance"].argmin()]
    assert not row["beyond"] and abs(row["distance"] - least["distance"]) <= 1e-12, f"{say}: {row}, {least}"
    assert row["lower"] <= rows["lower"].min() + 1e-12 and row["hit"] == rows["hit"].any(), f"{say}: {row}, {least}"
    counts["hit" if row["hit"] else "near"] += 1


def test_rows_of_links_begin_with_the_link():
    """Normals point away from the link, points lie on it."""
    checker = carts(lid_at=(0.5, 0, 0))
    measured = checker.distances([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], per="link")
    cart, lid = checker.bodies.index("cart"), checker.bodies.index("lid")
    for k, x in ((0, 0.0), (2, 0.5)):
        row, other = measured.rows[k + cart], measured.rows[k + lid]
        assert measured.names[k + cart] == ("cart", "lid") and measured.names[k + lid] == ("lid", "cart")
        assert row["normal"].tolist() == [1.0, 0.0, 0.0] == (-other["normal"]).tolist()
        assert abs(row["point_a"][0] - (x + 0.1)) <= 1e-12 and abs(row["point_b"][0] - (x + 0.4)) <= 1e-12
        assert row["point_a"].tolist() == other["point_b"].tolist() and row["distance"] == other["distance"]
    assert np.abs(measured.gradient).max() <= 1e-12


def test_two_links_at_a_constant_distance_do_not_hide_the_world():
    """A lid 2 cm above a cart, which it never gets nearer to: the nearest pair has no gradient but 0."""
    checker = carts(lid_at=(0, 0, 0.22), wall_at=1.0)
    Q = [[0.0, 0.3, 0.0], [0.5, 0.0, 0.1]]
    measured = checker.distances(Q)
    assert [set(names) for names in measured.names] == [{"cart", "lid"}] * 2
    assert np.abs(measured.distance - 0.02).max() <= 1e-12 and np.abs(measured.gradient).max() <= 1e-12
    with_wall = checker.distances(Q, between="world")
    assert [names[1] for names in with_wall.names] == ["wall"] * 2
    assert np.abs(with_wall.distance - [0.8, 0.3]).max() <= 1e-12
    assert np.abs(with_wall.gradient - [-1.0, 0.0, 0.0]).max() <= 1e-12
    assert checker.distances(Q, between="self").names == measured.names
    assert checker.distances(Q, max_distance=0.1, between="world").beyond.all()
    assert len(checker.distances(Q, max_distance=0.1, between="world", per="pair")) == 0
    pairs = checker.distances(Q, max_distance=0.5, per="pair")
    assert pairs.starts.tolist() == [0, 1, 4] and pairs.configuration.tolist() == [0, 1, 1, 1]


def test_swollen_bodies_attached_objects_clouds_and_grids():
    """Rows of pairs say of these what rows of robots say, and gaps are those of the bodies less what swells them."""
    rng, counts = rng_of("swollen near pairs"), Counter()
    for seed in range(6):
        robot = random_robot(rng, n_links=4, size=0.08)
        world, margin, padding = collide.World(), 0.02 * (seed % 2), 0.015 * (seed % 3)
        world.add(collide.PointCloud(rng.uniform(-0.5, 0.5, (400, 3)), 0.02), name="cloud")
        world.add(collide.VoxelGrid(rng.random((5, 5, 5)) < 0.05, 0.2), pose(t=(-0.5, -0.5, -0.5)), name="grid")
        world.add(collide.Box((0.4, 0.5, 0.4)), random_pose(rng, 0.4), name="box", margin=margin)
        tool = collide.Capsule(0.03, 0.1)
        checker = collide.RobotChecker(robot, world, padding=padding, attached=[("tool", robot.links[0], tool)])
        Q = random_configurations(rng, robot, 15)
        pairs = checker.distances(Q, max_distance=0.3, per="pair", between="world")
        robots = checker.distances(Q, max_distance=0.3, between="world")
        X_WLs, number = robot.link_poses(Q), {link: k for k, link in enumerate(robot.links)}
        for k, (a, b), row in zip(pairs.configuration.tolist(), pairs.names, pairs.rows):
            body = world.body(b)
            shape = collide.Compound([(e.shape, e.X_LG) for e in robot.geometry[a]]) if a != "tool" else tool
            X_WL = X_WLs[k, number[a] if a != "tool" else 0]
            answer = collide.distance(shape, body.shape, X_WL, body.X_WB)
            swell = padding + (margin if b == "box" else 0.0)
            if answer.distance > 0.0:
                assert abs(row["distance"] - (answer.distance - swell)) <= 1e-9, (seed, k, a, b, row, answer)
            assert row["hit"] == (answer.lower <= swell) or abs(answer.distance - swell) <= 1e-9, (seed, k, a, b, row)
            counts[b, bool(row["hit"])] += 1
            counts["tool"] += a == "tool"
        for k in range(len(Q)):
            rows = pairs.rows[pairs.starts[k] : pairs.starts[k + 1]]
            compare(robots.rows[k], rows, f"seed {seed}, q = {Q[k].tolist()}", counts)
    kinds = [(name, hit) for name in ("cloud", "grid", "box") for hit in (False, True)]
    assert min(counts[kind] for kind in [*kinds, "tool"]) >= 5, counts


def test_slots_grow_and_a_batch_goes_on_where_these_were_full(monkeypatch):
    rng, robot, world = convex_scene(2)
    Q = random_configurations(rng, robot, 25)
    expected = collide.RobotChecker(robot, world).distances(Q, per="pair")
    most = int(np.diff(expected.starts).max())
    for n_slots in (2, 3, most, most + 1, most + 2, 3 * most):
        monkeypatch.setattr(distance_batches, "_PAIR_SLOTS", n_slots)
        measured = collide.RobotChecker(robot, world).distances(Q, per="pair")
        assert measured.rows.tobytes() == expected.rows.tobytes(), n_slots
        assert measured.starts.tolist() == expected.starts.tolist()
        assert measured.gradient.tobytes() == expected.gradient.tobytes()


@pytest.mark.many(3)
@pytest.mark.parametrize("per", ["robot", "link", "pair"])
def test_threads_and_empty_batches(per, monkeypatch):
    monkeypatch.setattr("collide.robots.checker_scene._LEAST_PIECE", 8)
    rng, robot, world = hollow_scene(1)
    checker, Q, calls = collide.RobotChecker(robot, world), random_configurations(rng, robot, 50), []
    alone = checker.distances(Q, per=per, max_distance=0.3)
    options = {"per": per, "max_distance": 0.3, "threads": 2, "progress": lambda done, n: calls.append((done, n))}
    shared = checker.distances(Q, **options)
    assert alone.rows.tobytes() == shared.rows.tobytes() and alone.starts.tolist() == shared.starts.tolist()
    assert np.array_equal(alone.gradient, shared.gradient, equal_nan=True)
    assert calls[-1] == (50, 50) and len(calls) > 2
    nothing = checker.distances(Q[:0], per=per)
    assert len(nothing) == 0 and nothing.starts.tolist() == [0] and nothing.gradient.shape == (0, robot.dof)
    assert nothing.names == [] and len(nothing.configuration) == 0


def test_a_body_without_tested_pairs_is_beyond_and_does_not_widen_the_search():
    world = collide.World()
    world.add(LIDLESS, pose(t=(0.6, 0, 0)), name="open box")
    base = [LinkShape(collide.Box((0.1, 0.1, 0.1)), pose(t=(0, 5.0, 0)), None, "test")]
    checker = collide.RobotChecker(slider(base=base), world, allowed=[("base", "open box"), ("base", "cart")])
    measured = checker.distances([[0.0], [-0.5]], per="link")
    base_row, cart = checker.bodies.index("base"), checker.bodies.index("cart")
    assert measured.beyond.reshape(2, 2)[:, base_row].all() and not measured.beyond.reshape(2, 2)[:, cart].any()
    assert measured.names[cart] == ("cart", "open box") and measured.names[base_row] is None
    robots = checker.distances([[0.0], [-0.5]])
    assert robots.distance.tolist() == measured.distance.reshape(2, 2)[:, cart].tolist()


# --- rows of several slots --------------------------------------------------------------------------


def test_a_pair_counts_for_both_of_its_bodies():
    pairs = np.array([(0, 1, 2, 0), (1, 0, -3, 0), (2, 2, 0, 0)])
    which, at = _slots_of(pairs, 3)
    assert sorted(zip(which.tolist(), at.tolist())) == [(0, 1), (0, 2), (1, 3), (2, 6), (2, 8)]
    which, at = _slots_of(pairs, 1)
    assert which.tolist() == [0, 1, 2] and at.tolist() == [0, 1, 2]


def test_of_several_rows_for_a_slot_the_nearest_stays():
    rows, measured = np.zeros(3, dtype=PAIR_DTYPE), np.zeros(4, dtype=PAIR_DTYPE)
    rows["a"], measured["a"] = [-1, 0, 0], [1, 2, 3, 4]
    for field in ("lower", "distance", "upper"):
        rows[field], measured[field] = [0.0, 2.0, 1.0], [4.0, 3.0, 5.0, 1.5]
    _put_nearer(rows, np.array([0, 0, 0, 1]), measured)
    assert rows["a"].tolist() == [2, 4, 0] and rows["distance"].tolist() == [3.0, 1.5, 1.0]


# --- the nearest pair, of a piece -------------------------------------------------------------------


def measured(checker, q, limit: float = np.inf):
    q = np.array(q, dtype=float)
    rows, gradient = np.zeros(len(q), dtype=NEAREST_DTYPE), np.zeros(q.shape)
    space = CheckWorkspace(checker.robot, checker.setting)
    measure_piece(checker, space, q, rows, gradient, np.empty((len(q), WITNESS)), DistanceQuestion(limit))
    return rows, gradient


def test_body_number_zero_may_be_the_nearest_and_none_is_beyond():
    rows, gradient = measured(checker_of((collide.Sphere(0.1), 0.5)), [[0.0], [-3.0]], 1.0)
    assert rows["a"].tolist() == [0, -1] and rows["b"].tolist()[0] == -1
    assert rows["beyond"].tolist() == [False, True] and rows["certified"].all()
    assert rows["distance"][1] == rows["upper"][1] == np.inf and rows["lower"][1] == 1.0
    assert abs(rows["distance"][0] - 0.3) <= 1e-15 and np.isnan(gradient[1, 0]) and abs(gradient[0, 0] + 1.0) <= 1e-12


def test_of_pairs_left_to_others_the_nearest_is_found_among_convex_ones():
    """Open boxes on both sides, a ball beyond one of them: which is nearest changes with q, and so do the names."""
    checker = checker_of((LIDLESS, 1.0), (LIDLESS, -1.0), (collide.Sphere(0.05), 0.5), (LIDLESS, 3.0))
    q = np.linspace(-0.6, 0.25, 18)[:, None]
    rows, _ = measured(checker, q)
    for row, (x,) in zip(rows, q.tolist()):
        shapes = ((LIDLESS, 1.0), (LIDLESS, -1.0), (collide.Sphere(0.05), 0.5), (LIDLESS, 3.0))
        gaps = [collide.distance(collide.Sphere(0.1), shape, pose(t=(x, 0, 0)), pose(t=(at, 0, 0))).distance
                for shape, at in shapes]
        assert abs(row["distance"] - min(gaps)) <= 1e-9 and -1 - row["b"] == int(np.argmin(gaps)), (x, row, gaps)
    assert set((-1 - rows["b"]).tolist()) == {1, 2}


@pytest.mark.parametrize("limit", [0.7, 0.71, np.inf])
def test_a_search_goes_on_beyond_a_pair_that_turns_out_to_be_far(limit):
    """The hull of the lidless box holds the ball, its walls are 0.1 m away; a tiny sphere is nearer."""
    checker = checker_of((LIDLESS, 0.0), (collide.Sphere(0.01), 0.15))
    rows, _ = measured(checker, [[0.0]], limit)
    near = collide.distance(collide.Sphere(0.1), LIDLESS, np.eye(4), np.eye(4)).distance
    assert abs(rows["distance"][0] - min(near, 0.04)) <= 1e-12 and rows["b"][0] == -2


def test_rows_among_others():
    pairs = np.array([(0, 1, -1), (0, 1, -2), (5, 5, 5), (0, 1, -1)])
    assert _are_among(pairs, np.zeros((0, 3), dtype=np.int64)).tolist() == [False] * 4
    assert _are_among(pairs, pairs[:1]).tolist() == [True, False, False, True]
    assert _are_among(pairs[:1], np.array([(0, 1, 0), (1, 0, -1)])).tolist() == [False]
    assert _are_among(pairs[:0], pairs).tolist() == []
    rng = rng_of("rows among others")
    some, others = rng.integers(-2, 2, (2, 60, 3))
    expected = [tuple(row) in set(map(tuple, others.tolist())) for row in some.tolist()]
    assert _are_among(some, others).tolist() == expected and 0 < sum(expected) < 60
