"""Batches of Worlds answer as Worlds do, one after another: the oracle is a World whose bodies are set to the poses."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

import collide
from collide.errors import InvalidArgument, InvalidPose, UnknownBody

ROOF = collide.Mesh([[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
ELL = collide.Compound(
    [(collide.Box((0.5, 0.1, 0.1)), np.eye(4)), (collide.Box((0.1, 0.4, 0.1)), collide.pose((0.2, 0.2, 0)))]
)


def world_of(kinds: str, n: int, seed: int) -> collide.World:
    rng, world = np.random.default_rng(seed), collide.World()
    convex = [
        collide.Box((0.3, 0.2, 0.4)), collide.Sphere(0.15), collide.Capsule(0.08, 0.3), collide.Cone(0.1, 0.3),
        collide.ConvexHull(rng.normal(size=(20, 3)) * 0.15), collide.Cylinder(0.1, 0.2),
    ]
    shapes = {
        "convex": convex, "boxes": [collide.Box((0.25, 0.25, 0.25))], "unions": [*convex[:3], ELL],
        "meshes": [*convex[:5], ROOF, ELL],
    }[kinds]
    for k in range(n):
        world.add(shapes[k % len(shapes)], name=f"b{k}")
    return world


def random_poses(seed: int, n_worlds: int, n: int, spread: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    p, q = rng.uniform(-spread, spread, (n_worlds * n, 3)), rng.normal(size=(n_worlds * n, 4))
    return collide.poses(p, quat_wxyz=q).reshape(n_worlds, n, 4, 4)


def one_by_one(world: collide.World, X_WBs: np.ndarray, ask) -> list:
    """What a World says, its bodies set to the poses of one world after another."""
    answers = []
    for X in X_WBs:
        world.set_poses(world.ids, X)
        answers.append(ask(world))
    return answers


def compare(world: collide.World, X_WBs: np.ndarray, limits=(0.0, 0.05, 0.4, math.inf), threads: int = 1) -> dict:
    """Shares of worlds with a hit and of pairs near, after all answers have been compared, byte for byte."""
    batch = collide.WorldBatch(world)
    hits = batch.collides(X_WBs, threads=threads)
    assert hits.dtype == bool and hits.tolist() == one_by_one(world, X_WBs, lambda w: w.collides())
    rows = 0
    for limit in limits:
        for ask in ("distances", "minimum"):
            found = getattr(batch, ask)(X_WBs, limit, threads=threads)
            expected = one_by_one(world, X_WBs, lambda w, ask=ask, limit=limit: getattr(w, ask)(limit))
            assert len(found) == len(X_WBs)
            for k, (mine, theirs) in enumerate(zip(found, expected)):
                assert mine.rows.tobytes() == theirs.rows.tobytes(), (ask, limit, k, mine.rows, theirs.rows)
                assert mine.names == theirs.names
            assert found.world.tolist() == [k for k, of in enumerate(expected) for _ in of]
            rows += len(found.rows)
    return {"hits": float(hits.mean()), "rows": rows}


@pytest.mark.parametrize(("kinds", "n", "spread"), [
    ("convex", 12, 0.9), ("convex", 70, 2.5), ("boxes", 9, 0.6), ("unions", 9, 0.7), ("meshes", 8, 0.8),
    ("convex", 2, 0.3),
])
def test_answers_are_those_of_worlds_one_by_one(kinds, n, spread):
    seen = compare(world_of(kinds, n, 1), random_poses(2, 12, n, spread))
    assert 0.0 < seen["hits"] <= 1.0 and seen["rows"] > 24


@pytest.mark.parametrize("threads", [2, 5])
def test_threads_and_pieces_change_nothing(threads):
    """More worlds than are laid out at a time: 4,096 bodies."""
    seen = compare(world_of("convex", 30, 3), random_poses(4, 300, 30, 2.2), limits=(0.1,), threads=threads)
    assert 0.1 < seen["hits"] < 1.0


def test_bodies_in_rows_that_are_all_as_near():
    """Gaps that are equal as numbers, and touching bodies: of several nearest pairs the one of the least ids counts."""
    X = np.tile(np.eye(4), (5, 27, 1, 1))
    grid = np.stack(np.meshgrid(*[range(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for k, step in enumerate((0.25, 0.5, 0.3125, 0.26, 0.75)):
        X[k, :, :3, 3] = step * grid
    assert compare(world_of("boxes", 27, 0), X)["hits"] == 0.2


def filtered_world() -> collide.World:
    world = world_of("convex", 18, 5)
    for k in range(4):
        world.remove(f"b{k}")
        world.add(collide.Box((0.4, 0.4, 0.4)), name=f"wall {k}", static=True)
    world.add(collide.Sphere(0.3), name="ghost", group=2, mask=1)
    world.add(collide.Sphere(0.3), name="twin", group=2, mask=1)
    world.allow("b5", "b6")
    world.sleep(["b7", "b8", "b9"])
    return world


def test_filters_hold_in_every_world():
    world = filtered_world()
    X = random_poses(6, 25, len(world.ids), 0.8)
    compare(world, X)
    before = len(collide.WorldBatch(world).distances(X).rows)
    world.wake(["b7", "b8", "b9"])
    assert len(collide.WorldBatch(world).distances(X).rows) > before


@pytest.mark.parametrize("margin", [0.0, 0.04])
def test_margins_of_bodies_and_pairs_count(margin):
    world = filtered_world()
    X = random_poses(7, 60, len(world.ids), 1.5)
    plain = collide.WorldBatch(world).collides(X)
    world.set_margin("b10", 0.15)
    world.set_margin("b11", 0.1, partner="b12")
    batch = collide.WorldBatch(world)
    found = batch.collides(X, security_margin=margin)
    assert found.tolist() == one_by_one(world, X, lambda w: w.collides(security_margin=margin))
    assert plain.sum() < found.sum() < len(X), "the margins would change nothing"
    compare(world, X[:5], limits=(0.1,))


def test_bodies_that_stand_still_need_no_poses():
    world = filtered_world()
    here = random_poses(8, 1, len(world.ids), 1.2)[0]
    world.set_poses(world.ids, here)
    X = random_poses(9, 20, 3, 1.0)
    batch = collide.WorldBatch(world, moving=["ghost", "b10", world.ids[2]])
    places = [world.ids.index(k) for k in batch.ids]
    whole = np.tile(here, (20, 1, 1, 1))
    whole[:, places] = X
    assert places != sorted(places)
    many = collide.WorldBatch(world)
    for few in (batch, pickle.loads(pickle.dumps(batch))):
        assert np.array_equal(few.collides(X), many.collides(whole))
        a, b = few.distances(X, 0.3), many.distances(whole, 0.3)
        assert a.rows.tobytes() == b.rows.tobytes() and len(a.rows) > 5
        pair, same = a[3].pair(0), b[3].pair(0)
        assert all(np.array_equal(*poses) for poses in zip(pair.question[2:], same.question[2:]))
        collide.verify(*pair.question, pair)


def test_a_batch_is_of_the_world_as_it_was():
    world = world_of("convex", 6, 1)
    X = random_poses(10, 10, 6, 0.5)
    batch = collide.WorldBatch(world)
    before = batch.distances(X).rows.tobytes()
    world.remove("b2")
    world.allow("b0", "b1")
    assert batch.distances(X).rows.tobytes() == before
    result = batch.distances(X)
    X[:] = np.eye(4)  # a result keeps the poses of its question
    assert result[9].pair(0).question[2][0].tolist() != np.eye(4).tolist()


def test_half_spaces_have_no_end():
    world = world_of("convex", 5, 1)
    world.add(collide.Halfspace((0, 0, 1), 0.0), name="floor")
    compare(world, random_poses(11, 15, 6, 0.6))
    world.add(collide.Halfspace((0, 0, -1), 0.0), name="roof")
    X = np.tile(np.eye(4), (2, 7, 1, 1))
    batch, single = collide.WorldBatch(world), one_by_one(world, X, lambda w: w.minimum().rows.tobytes())
    assert [row.rows.tobytes() for row in batch.minimum(X)] == single


@pytest.mark.parametrize("n_bodies", [0, 1, 3])
def test_no_worlds_no_bodies_and_no_pairs(n_bodies):
    batch = collide.WorldBatch(world_of("convex", n_bodies, 1))
    for n_worlds in (0, 2):
        X = np.tile(collide.pose((0.0, 0.0, 0.0)), (n_worlds, n_bodies, 1, 1))
        assert batch.collides(X).shape == (n_worlds,)
        found = batch.distances(X)
        assert len(found) == n_worlds and len(found.rows) == n_worlds * (3 if n_bodies == 3 else 0)
        assert [len(rows) for rows in batch.minimum(X)] == [int(n_bodies == 3)] * n_worlds
        assert found.starts.tolist() == [k * len(found.rows) // max(n_worlds, 1) for k in range(n_worlds + 1)]


def test_results_by_column_and_number():
    batch, X = collide.WorldBatch(world_of("convex", 6, 1)), random_poses(12, 8, 6, 0.5)
    found = batch.distances(X, 0.2)
    assert np.array_equal(found["distance"], found.rows["distance"])
    assert found[-1].rows.tobytes() == found[7].rows.tobytes()
    assert np.array_equal(np.bincount(found.world, minlength=8), np.diff(found.starts))
    assert repr(found).startswith("WorldBatchResult(8 worlds")
    with pytest.raises(InvalidArgument, match="0 … 7"):
        found[8]
    assert isinstance(found.to("numpy"), collide.WorldBatchResult)
    pytest.importorskip("torch", reason="torch is not installed: pip install 'collide-robotics[torch]'")
    import torch

    tensors = torch.from_numpy(X)
    assert type(batch.collides(tensors, like=tensors)) is torch.Tensor
    columns = batch.distances(tensors.float().double(), 0.2).to(tensors)
    assert type(columns["distance"]) is torch.Tensor and type(columns.world) is torch.Tensor


def test_bad_input_is_refused_by_name():
    world = world_of("convex", 4, 1)
    batch, X = collide.WorldBatch(world), random_poses(13, 5, 4, 0.5)
    with pytest.raises(InvalidArgument, match=r"WorldBatch: world must be a collide\.World"):
        collide.WorldBatch([])
    with pytest.raises(UnknownBody, match=r"moving\[1\]"):
        collide.WorldBatch(world, moving=["b0", "nobody"])
    with pytest.raises(InvalidArgument, match="no body twice"):
        collide.WorldBatch(world, moving=["b0", 0])
    with pytest.raises(InvalidArgument, match="ids or names"):
        collide.WorldBatch(world, moving="b0")
    for bad in (X[0], X[:, :3], X[..., :3], np.zeros((5, 4, 7)), "poses", None):
        with pytest.raises(InvalidArgument, match=r"WorldBatch.distances: X_WBs.*\(N, 4, 4, 4\)"):
            batch.distances(bad)
    for value in (math.nan, 3.0):
        bad = X.copy()
        bad[3, 2, 0, 0] = value
        with pytest.raises(InvalidPose, match=r"WorldBatch.collides: X_WBs\[3\]\[2\]"):
            batch.collides(bad)
    with pytest.raises(InvalidArgument, match="max_distance"):
        batch.minimum(X, -1.0)
    with pytest.raises(InvalidArgument, match="security_margin"):
        batch.collides(X, security_margin=-1.0)
    with pytest.raises(InvalidArgument, match="threads"):
        batch.collides(X, threads=0)
    with pytest.raises(InvalidArgument, match="like must be"):
        batch.collides(X, like="cupy")
