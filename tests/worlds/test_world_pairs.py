"""Pairs of a World answered in pieces and in groups of one margin each: none is lost, all are in order."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose

import collide

BALL = collide.Sphere(0.5)


def checkerboard(n: int, *others: np.ndarray, first: bool = True) -> collide.World:
    """Balls on the black squares: boxes of diagonal neighbours meet, balls do not; others before or behind them."""
    world = collide.World()
    black = [pose(t=(0.8 * i, 0.8 * j, 0)) for i in range(n) for j in range(n) if (i + j) % 2 == 0]
    for X_WB in [*others, *black] if first else [*black, *others]:
        world.add(BALL, X_WB)
    return world


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("first", [True, False])
def test_one_hit_is_found_among_thousands_of_pairs_whatever_its_place(threads, first):
    """Its boxes overlap least of all, so that it is not among the pairs asked first; and none where there is none."""
    apart, touching = ([pose(t=(0, y, 20.0)) for y in (0.0, far)] for far in (1.0 + 1e-6, 1.0 - 1e-6))
    world = checkerboard(52, *apart, first=first)
    assert len(world._pack().candidates(0.0)) > 2048
    assert not world.collides(threads=threads) and world.stats["narrowphase"] > 2048
    world = checkerboard(52, *touching, first=first)
    assert world.collides(threads=threads) and world.stats["hits"] == 1
    assert len(world.collisions(threads=threads)) == 1


@pytest.mark.parametrize("is_moved", [False, True])
def test_booleans_of_crowds_ask_a_few_pairs(is_moved):
    """The same few whatever was asked and moved before, and none that filters leave out: then the pairs behind them."""
    rng = np.random.default_rng(3)
    X = np.array([pose(t=t) for t in rng.uniform(0, 6, (400, 3))])
    world = collide.World()
    ids = world.add_many(BALL, rng.permutation(X) if is_moved else X)
    if is_moved:
        assert world.collides() and len(world.distances(0.2)) > 400
        world.set_poses(ids, X)
    assert world.collides() and world.stats["narrowphase"] <= 4 and world.stats["hits"] == 1
    assert "broadphase" not in world.stats["skipped"]
    n_asked = world.stats["narrowphase"]
    assert world.collides() and world.stats["narrowphase"] == n_asked
    world.sleep(ids[:300])
    of_sleepers = world.stats["narrowphase"]
    assert world.collides() and world.stats["narrowphase"] <= of_sleepers + 4
    world.sleep(ids)
    assert not world.collides() and world.stats["skipped"] == {"sleeping": 400 * 399 // 2, "broadphase": 0}
    world.wake(ids[[7]])
    rows = world.collisions().rows
    assert world.collides() and len(rows) and (rows["a"] == 7).any() | (rows["b"] == 7).any()
    for k in rows["a"].tolist() + rows["b"].tolist():
        if k != 7:
            world.allow(7, k)
    assert not world.collides() and not len(world.collisions())


def spaced(*margins: float, gap: float = 0.25) -> collide.World:
    world = collide.World()
    for k, margin in enumerate(margins):
        world.add(BALL, pose(t=((1.0 + gap) * k, 0, 0)), name=f"b{k}", margin=margin)
    return world


@pytest.mark.parametrize(("margins", "pairs"), [
    ((0.0, 0.0, 0.0, 0.0), []), ((0.25, 0.0, 0.0, 0.25), [(0, 1), (2, 3)]), ((0.125,) * 4, [(0, 1), (1, 2), (2, 3)]),
    ((0.5, 0.25, 0.0, 0.3), [(0, 1), (1, 2), (2, 3)]), ((0.0, 0.2, 0.06, 0.0), [(1, 2)]),
])
def test_margins_of_several_lengths(margins, pairs):
    """Each is a group of pairs that are asked together; what is exactly a margin away is a hit."""
    world = spaced(*margins)
    contacts = world.contacts()
    assert list(zip(contacts.rows["a"].tolist(), contacts.rows["b"].tolist())) == pairs
    hits = world.collisions().rows
    assert list(zip(hits["a"].tolist(), hits["b"].tolist())) == pairs and world.collides() == bool(pairs)
    every = world.distances(0.25).rows
    assert list(zip(every["a"].tolist(), every["b"].tolist())) == [(0, 1), (1, 2), (2, 3)]
    assert np.allclose(every["distance"], 0.25, atol=1e-12)


def test_a_margin_of_a_pair_is_told_first_and_may_be_taken_back():
    world = spaced(0.0, 0.0, 0.0)
    world.set_margin("b2", 0.25, partner="b1")
    assert [(int(row["a"]), int(row["b"])) for row in world.collisions().rows] == [(1, 2)]
    world.set_margin("b0", 0.5)
    world.set_margin("b0", 0.0, partner=1)  # instead of the sum of both
    assert [(int(row["a"]), int(row["b"])) for row in world.collisions().rows] == [(1, 2)]
    world.set_margin("b1", None, partner="b0")
    world.set_margin("b1", None, partner="b2")
    assert [(int(row["a"]), int(row["b"])) for row in world.collisions().rows] == [(0, 1)]
    with pytest.raises(collide.errors.InvalidArgument, match=r"margin of a body must be a number .* got None"):
        world.set_margin("b1", None)


def test_distances_tell_what_is_not_proven_farther_than_the_limit():
    world = spaced(0.0, 0.0)
    lower = float(world.distances().rows["lower"][0])
    assert len(world.distances(lower)) == len(world.distances()) == 1
    assert len(world.distances(0.2499)) == 0 and len(world.distances(0.0)) == 0


def test_a_world_of_one_body_has_no_pairs():
    world = spaced(0.5)
    assert not world.collides() and len(world.contacts()) == len(world.distances()) == len(world.collisions()) == 0
    assert world.stats["pairs"] == 0 and world.stats["bodies"] == 1
