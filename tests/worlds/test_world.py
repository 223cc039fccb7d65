"""A World answers what all pairs, asked one by one, answer: bit by bit, with every kind of filter."""

from __future__ import annotations

import math

import naive
import numpy as np
import pytest
from naive import pose, random_pose, rng_of

import collide

#: All but the effort: a World leaves out parts of compounds that are too far apart to matter.
FIELDS = [field for field in naive.ANSWER_FIELDS if field != "iterations"]


def random_world(seed: int, n: int = 24, spread: float = 1.6) -> collide.World:
    """Shapes of every kind with random filters; some allowed, moved, removed and added again."""
    rng = rng_of("world", seed)
    world = collide.World()
    kinds = [kind for kind in naive.KINDS if kind != "Halfspace"] * (1 + n // 9)
    for k in range(n):
        world.add(
            naive.one_of_each(rng)[kinds[k]], random_pose(rng, spread), name=f"{kinds[k]} {k}",
            static=bool(rng.random() < 0.25), group=int(rng.choice([1, 2, 3])), mask=int(rng.choice([1, 2, 3, 3, 3])),
        )
    for _ in range(2):
        normal = naive.unit(rng.normal(size=3))
        world.add(collide.Halfspace(normal, -1.2), random_pose(rng, 0.1), static=bool(rng.random() < 0.5), group=3)
    for _ in range(n // 4):
        a, b = rng.choice(world.ids, 2, replace=False)
        world.allow(int(a), int(b), reason=str(rng.choice(["adjacent", "never"])))
    return world


def change(world: collide.World, rng, spread: float = 1.6) -> None:
    """Move a third of the bodies, remove two, add one."""
    for identity in world.ids:
        if rng.random() < 0.3:
            world.set_pose(identity, random_pose(rng, spread))
    for identity in rng.choice(world.ids, 2, replace=False):
        world.remove(int(identity))
    world.add(naive.one_of_each(rng)["Compound"], random_pose(rng, spread))


def assert_same_rows(found, expected):
    assert [(int(row["a"]), int(row["b"])) for row in found] == [(a, b) for a, b, _ in expected]
    for row, (a, b, other) in zip(found, expected):
        if other is None:  # two half-spaces: no depth to compare
            assert row["hit"] and row["distance"] == -math.inf
        else:
            differing = naive.same_bits(row, other, FIELDS)
            assert not differing, f"bodies {a} and {b}: {differing} differ:\n{row}\n{other}"


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(6))
def test_world_equals_brute_force(seed):
    world, rng = random_world(seed), rng_of("changes", seed)
    hits = []
    for _ in range(3):
        for margin in (0.0, 0.05, 0.6):
            assert_same_rows(world.distances(max_distance=margin), naive.brute_force(world, margin))
        hitting = [entry for entry in naive.brute_force(world, 0.0) if entry[2] is None or entry[2]["hit"]]
        assert_same_rows(world.collisions(), hitting)
        assert world.collides() == bool(hitting)
        tested = len(naive.brute_force(world, math.inf))
        hits.append(len(hitting) / tested)
        change(world, rng)
    assert 0.02 < max(hits) < 0.7


def test_no_margin_means_every_pair():
    world = random_world(7, n=12)
    assert_same_rows(world.distances(), naive.brute_force(world, math.inf))


@pytest.mark.parametrize("seed", range(4))
def test_stats_add_up(seed):
    world = random_world(seed)
    for margin in (0.0, 0.3):
        rows = world.distances(max_distance=margin)
        stats = world.stats
        n = len(world)
        assert stats["bodies"] == n and stats["pairs"] == n * (n - 1) // 2
        assert stats["static"] == sum(world.body(i).static for i in world.ids)
        assert sum(stats["skipped"].values()) + stats["narrowphase"] == stats["pairs"]
        assert stats["hits"] == int(rows["hit"].sum())
        assert sum(stats["how"].values()) == stats["narrowphase"] <= stats["convex_pairs"]
        assert all(count >= 0 for count in stats["skipped"].values())
        assert set(stats["seconds"]) == {"pack", "broadphase", "narrowphase"}
        assert all(second >= 0 for second in stats["seconds"].values())
        expected = skipped_pairs(world)
        assert {why: k for why, k in stats["skipped"].items() if why != "broadphase"} == expected


def test_a_body_in_the_gap_of_a_compound_is_asked_and_counted():
    """The boxes of the bodies meet, no boxes of their parts do: a row all the same, and a pair that counts."""
    world = collide.World()
    ends = collide.Compound([(collide.Sphere(0.5), pose(t=(side * 5, 0, 0))) for side in (-1, 1)])
    world.add(ends, name="ends")
    world.add(collide.Sphere(0.5), name="middle")
    for margin in (0.0, 1.0):
        assert len(world.distances(max_distance=margin)) == 0 and not world.collides()
        world.distances(max_distance=margin)
        stats = world.stats
        assert stats["narrowphase"] == 1 and sum(stats["skipped"].values()) == 0 and stats["convex_pairs"] >= 1
    assert world.distances(max_distance=4.0)["distance"].tolist() == [4.0]
    assert len(world.query(collide.Sphere(0.5), np.eye(4), max_distance=1.0)) == 1  # the middle, not the ends


def skipped_pairs(world: collide.World) -> dict:
    """What the filters leave out, pair by pair, the first reason that applies."""
    counts: dict[str, int] = {}
    ids = world.ids
    for k, i in enumerate(ids):
        for j in ids[k + 1 :]:
            a, b = world.body(i), world.body(j)
            why = world.allowed.get((i, j))
            if not (a.group & b.mask and b.group & a.mask):
                why = "filtered by group and mask"
            if a.static and b.static:
                why = "static–static"
            if why:
                counts[why] = counts.get(why, 0) + 1
    return counts


@pytest.mark.parametrize("seed", range(4))
def test_query_equals_asking_every_body(seed):
    world, rng = random_world(seed), rng_of("query", seed)
    shapes = naive.one_of_each(rng)
    for kind, shape in shapes.items():
        X = random_pose(rng, 1.2)
        for margin in (0.0, 0.4):
            found = world.query(shape, X, max_distance=margin)
            expected = []
            for identity in world.ids:
                body = world.body(identity)
                try:
                    row = collide.distance(shape, body.shape, X, body.X_WB, max_distance=margin).rows[0]
                except collide.UnsupportedQuery:
                    expected.append((-1, identity, None))
                    continue
                if row["hit"] or row["distance"] <= margin:
                    expected.append((-1, identity, row))
            assert_same_rows(found, expected)
            assert all(pair == ("query", world.body(int(row["b"])).name) for pair, row in zip(found.names, found)), kind


def test_allowing_by_a_matrix():
    world = random_world(3, n=10)
    n = len(world)
    matrix = rng_of("matrix").random((n, n)) < 0.4
    matrix |= matrix.T
    world.allow(matrix, reason="matrix")
    ids = world.ids
    for i in range(n):
        for j in range(i + 1, n):
            assert not matrix[i, j] or (ids[i], ids[j]) in world.allowed
    assert_same_rows(world.distances(max_distance=0.5), naive.brute_force(world, 0.5))


def test_removing_forgets_what_was_allowed():
    world = collide.World()
    a, b = (world.add(collide.Sphere(1), name=name) for name in "ab")
    world.allow(a, b)
    assert not world.collides()
    world.remove("a")
    again = world.add(collide.Sphere(1), name="a")
    assert again not in (a, b) and world.collides()
    assert world.collisions().names == [("b", "a")]


def test_margin_finds_what_boxes_alone_would_miss():
    """Two spheres 0.2 apart along a diagonal, asked with 0.5; a margin on one box only would lose them."""
    for sign in (1, -1):
        world = collide.World()
        world.add(collide.Sphere(0.5), name="a")
        world.add(collide.Sphere(0.5), pose(t=sign * 1.2 * naive.unit((1, 1, 1))), name="b")
        world.add(collide.Sphere(0.5), pose(t=(9, 9, 9)), name="far")
        rows = world.distances(max_distance=0.5)
        assert rows.names == [("a", "b")]
        assert rows["distance"][0] == pytest.approx(0.2, rel=1e-12)
        assert not world.collides() and len(world.collisions()) == 0
        found = world.query(collide.Sphere(0.5), pose(t=sign * 2.4 * naive.unit((1, 1, 1))), max_distance=0.5)
        assert found.names == [("query", "b")]


def test_a_margin_is_inclusive():
    world = collide.World()
    for x in (0.0, 1.5):
        world.add(collide.Box((1, 1, 1)), pose(t=(x, 0, 0)))
    assert len(world.distances(max_distance=0.5)) == 1
    lower = world.distances(max_distance=0.5)["lower"][0]
    assert 0.5 - 2.0**-53 <= lower <= 0.5
    assert len(world.distances(max_distance=lower)) == 1  # not proven to be farther
    assert len(world.distances(max_distance=np.nextafter(lower, 0))) == 0


def test_order_of_adding_and_moving_there_and_back_change_nothing():
    rng = rng_of("there and back")
    world, other = random_world(11), collide.World()
    before = world.distances(max_distance=0.3)
    for identity in world.ids:
        body = world.body(identity)
        world.set_pose(identity, random_pose(rng))
        world.collides()
        world.set_pose(identity, body.X_WB)
    after = world.distances(max_distance=0.3)
    assert not naive.same_bits(before.rows, after.rows)
    for identity in reversed(world.ids):
        body = world.body(identity)
        other.add(body.shape, body.X_WB, name=body.name, static=body.static, group=body.group, mask=body.mask)
    for i, j in world.allowed:
        other.allow(world.body(i).name, world.body(j).name)
    reversed_rows = other.distances(max_distance=0.3)
    rows = {frozenset(pair): row for pair, row in zip(reversed_rows.names, reversed_rows)}
    assert len(rows) == len(after)
    for pair, row in zip(after.names, after):
        assert row["distance"].tobytes() == rows[frozenset(pair)]["distance"].tobytes()
        assert np.array_equal(row["normal"], -rows[frozenset(pair)]["normal"])


def test_set_poses_moves_all_at_once():
    world = random_world(5, n=10)
    rng = rng_of("poses")
    ids = world.ids[:6]
    poses = np.array([random_pose(rng) for _ in ids])
    world.set_poses(ids, poses)
    for identity, X in zip(ids, poses):
        assert np.array_equal(world.body(identity).X_WB, X)
    assert_same_rows(world.distances(max_distance=0.2), naive.brute_force(world, 0.2))


def test_empty_and_lonely_worlds():
    world = collide.World()
    assert not world.collides() and len(world.distances()) == 0 and len(world.collisions()) == 0
    assert world.stats["pairs"] == 0
    assert len(world.query(collide.Sphere(1), np.eye(4), max_distance=9.0)) == 0
    world.add(collide.Halfspace((0, 0, 1), 0.0))
    assert not world.collides() and len(world.distances()) == 0
    assert len(world.query(collide.Sphere(1), np.eye(4))) == 1


def test_many_flush_boxes_in_a_grid():
    """Every box touches its 26 neighbours exactly; none of them is lost or added."""
    world = collide.World()
    cells = [(x, y, z) for x in range(4) for y in range(4) for z in range(4)]
    for cell in cells:
        world.add(collide.Box((0.25, 0.25, 0.25)), pose(t=0.25 * np.array(cell)))
    rows = world.collisions()
    neighbours = {
        (i, j)
        for i, a in enumerate(cells)
        for j, b in enumerate(cells)
        if i < j and max(abs(x - y) for x, y in zip(a, b)) == 1
    }
    assert {(int(row["a"]), int(row["b"])) for row in rows} == neighbours
    assert (rows["distance"] == 0.0).all() and rows["certified"].all()
    assert world.stats["undecided"] == 0


def test_bodies_removed_before_the_first_query_are_gone():
    """A World's first tables are made of the bodies there are, not of rows of some that were removed."""
    world = collide.World()
    ids = [world.add(collide.Sphere(1.0), collide.pose((0.1 * k, 0, 0))) for k in range(4)]
    world.remove(ids[1])
    rows = world.distances()
    assert sorted(zip(rows["a"].tolist(), rows["b"].tolist())) == [(0, 2), (0, 3), (2, 3)]
    assert world.raycast((0.1, 0, 9), (0, 0, -1))["body"][0] != ids[1]
    assert sum(world.stats["skipped"].values()) + world.stats["narrowphase"] == world.stats["pairs"] == 3
    assert ids[1] not in world.query(collide.Sphere(0.1), np.eye(4))["b"].tolist()
