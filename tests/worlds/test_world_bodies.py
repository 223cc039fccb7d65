"""The bodies of a World in columns: every way of naming and moving them, and what copies share."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from naive import random_pose, rng_of

import collide
from collide.errors import InvalidPose, UnknownBody
from collide.transforms import as_pose, as_poses
from collide.worlds.bodies import BodiesAsTheyStood, WorldBodies

EYE = np.eye(4)


def bodies_of(n: int) -> WorldBodies:
    bodies = WorldBodies()
    for k in range(n):
        bodies.add(collide.Sphere(1.0 + k), None, None if k % 2 else f"ball {k}", k % 3 == 0, 1, 1)
    return bodies


def poses_of(seed: object, n: int) -> np.ndarray:
    rng = rng_of("world bodies", seed)
    return np.array([random_pose(rng) for _ in range(n)])


@pytest.mark.parametrize("removed", [(), (0,), (3, 4, 19)])
def test_every_way_of_naming_bodies_moves_the_same_ones(removed):
    X = poses_of("naming", 5)
    ids = [1, 18, 7, 2, 5]
    mixed = [1, "ball 18", 7, "ball 2", np.int8(5)]
    named = [[1, 18, 7, 2, 5], np.array(ids), np.array(ids, dtype=np.uint16), tuple(ids), mixed]
    for names in named:
        bodies = bodies_of(20)
        for identity in removed:
            bodies.remove(identity)
        bodies.move_many(names, X)
        for identity, X_WB in zip(ids, X):
            assert np.array_equal(bodies.body(identity).X_WB, X_WB)
        assert np.array_equal(bodies.body(6).X_WB, EYE)
        moved = np.flatnonzero(bodies.is_moved)
        assert len(moved) == 5 and (removed or moved.tolist() == sorted(ids))
    bodies.move_many([7, 7], X[:2])
    assert np.array_equal(bodies.body(7).X_WB, X[1]), "the last pose counts"


@pytest.mark.parametrize(
    ("names", "error"),
    [
        ([1, 20], UnknownBody), ([1, -1], UnknownBody), ([1, True], UnknownBody), ([1, 1.0], UnknownBody),
        (np.array([1, 2**40]), UnknownBody), ([1, 10**30], UnknownBody),
        (np.array([1, 2**64 - 1], dtype=np.uint64), UnknownBody),
        ([1, "nobody"], UnknownBody), ([1], InvalidPose), ([], InvalidPose), ([1, 2, 3], InvalidPose),
    ],
)
@pytest.mark.parametrize("gap", [False, True])
def test_refused_moves_move_nothing(names, error, gap):
    bodies = bodies_of(20)
    if gap:
        bodies.remove(19)
    with pytest.raises(error):
        bodies.move_many(names, poses_of("refused", 2))
    assert all(np.array_equal(bodies.body(k).X_WB, EYE) for k in bodies.ids) and not bodies.is_moved.any()


def test_a_bad_pose_among_many_is_named():
    world = collide.World()
    ids = [world.add(collide.Sphere(1.0)) for _ in range(3000)]
    X = np.repeat(EYE[None], 3000, axis=0)
    X[2500, 0, 0] = 1.1
    with pytest.raises(InvalidPose, match=r"X_WBs\[2500\] is not a rotation"):
        world.set_poses(ids, X)


def test_rosters_and_results_stay_as_they_were():
    bodies = bodies_of(6)
    bodies.remove(2)
    roster, X_WBs = bodies.roster(), bodies.poses().copy()
    assert roster is bodies.roster() and roster.ids[roster.alive].tolist() == [0, 1, 3, 4, 5] == bodies.ids
    stood = BodiesAsTheyStood(roster, np.array([1, 5]), X_WBs[[1, 5]])
    bodies.move_many([1, 5], poses_of("rosters", 2))
    bodies.remove(0)
    bodies.add(collide.Box((1, 1, 1)), None, "new", False, 1, 1)
    bodies.set_sleeping([1], True)
    bodies.set_margin(5, 0.1)
    bodies.roster()
    assert roster.ids[roster.alive].tolist() == [0, 1, 3, 4, 5] and len(roster.ids) == 6
    for one in (stood, pickle.loads(pickle.dumps(stood)), copy.deepcopy(stood)):
        assert [one[k].name for k in (1, 5)] == ["body 1", "body 5"] and np.array_equal(one[5].X_WB, EYE)
        assert not one[1].sleeping and one[5].margin == 0.0
        assert one[1] is one[1] and not one[1].X_WB.flags.writeable


def test_columns_grow_and_shrink():
    bodies, X, most = WorldBodies(), poses_of("growing", 700), 0
    for k in range(700):
        assert bodies.add(collide.Sphere(1.0), X[k], None, False, 1, 1) == k
        if k >= 20 and k % 50:
            bodies.remove(k - 20)
        if k % 10 == 0:
            bodies.roster()
            most = max(most, len(bodies.poses()))
    roster = bodies.roster()
    remaining = bodies.ids
    assert 20 < len(remaining) < 50 and most < 300, "rows of removed bodies are closed up now and then"
    assert roster.ids[roster.alive].tolist() == remaining and roster.generation > 2
    assert np.array_equal(bodies.poses()[roster.alive], X[remaining])
    assert bodies.names == {k: f"body {k}" for k in remaining}


def test_quick_checks_of_poses_agree_with_the_slow_one():
    """Near the tolerance and far beyond it, single and in batches: the same matrices are refused."""
    rng = rng_of("poses at the tolerance")
    accepted = 0
    for k in range(400):
        X = random_pose(rng)
        X[:3, :3] += rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-6, -3)
        if k % 40 == 0:
            X[tuple(rng.integers(0, 4, 2))] = rng.choice([np.nan, np.inf, -1e51, 2.0])
        R = X[:3, :3]
        with np.errstate(all="ignore"):
            good = (
                np.isfinite(X).all() and (X[3] == (0, 0, 0, 1)).all() and np.abs(X).max() <= 1e50
                and np.abs(R.T @ R - np.eye(3)).max() <= 1e-4 and np.linalg.det(R) > 0
            )
        for ask in (lambda X=X: as_pose(X), lambda X=X: as_poses(np.array([EYE, X]))[1]):
            if good:
                assert np.array_equal(ask(), X)
            else:
                with pytest.raises(InvalidPose):
                    ask()
        accepted += good
    assert 100 < accepted < 350
