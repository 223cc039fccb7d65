"""Casts against a World say what all bodies, asked one by one, say: rays, moved shapes, nearest bodies, filters."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from mesh_shapes import block_ring, box
from naive import random_pose, rng_of

import collide
from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery


def mixed_world(rng, n: int = 40, spread: float = 2.5, halfspace: bool = True) -> collide.World:
    """Shapes of every kind, compounds, meshes, compounds of meshes and a half-space, in groups."""
    world = collide.World()
    ring = collide.Mesh(0.3 * block_ring()[0], block_ring()[1])
    block = collide.Box((0.3, 0.2, 0.4))
    pair = collide.Compound([(collide.Sphere(0.2), naive.pose(t=(0.3, 0, 0))), (block, np.eye(4))])
    hung = collide.Compound([(ring, naive.pose(t=(0, 0, 0.5))), (collide.Capsule(0.1, 0.4), np.eye(4))])
    kinds = [kind for kind in naive.KINDS if kind not in ("Halfspace", "Mesh", "Compound")]
    for k in range(n):
        own = {0: ring, 1: pair, 2: hung}.get(k % 9)
        shape = naive.one_of_each(rng)[kinds[k % len(kinds)]] if own is None else own
        world.add(shape, random_pose(rng, spread), name=f"body {k} of {n}", group=int(rng.choice([1, 2])))
    if halfspace:
        world.add(collide.Halfspace((0, 0.1, 1), -6.0), name="floor", group=2)
    return world


def test_rays_are_those_of_all_bodies():
    rng = rng_of("world rays")
    world = mixed_world(rng)
    origins = rng.normal(size=(60, 3)) * 4
    directions = rng.normal(size=(60, 3)) - 0.4 * origins
    of_bodies = {
        i: collide.raycast(world.body(i).shape, world.body(i).X_WB, origins, directions) for i in world.ids
    }
    for group in (None, 2):
        counts = [i for i in world.ids if group is None or world.body(i).group & 2]
        rows = world.raycast(origins, directions, mask=group)
        t = np.array([of_bodies[i].distance for i in counts])
        assert (rows["hit"] == np.isfinite(t.min(axis=0))).all() and 0.3 < rows["hit"].mean()
        for k in np.flatnonzero(rows["hit"]).tolist():
            row, own = rows[k], of_bodies[int(rows["body"][k])]
            assert row["ray"] == k and rows.names[k] == world.names[int(row["body"])]
            assert abs(row["distance"] - t[:, k].min()) <= 1e-9 * (1 + row["distance"])
            assert row["lower"] <= own.upper[k] and own.lower[k] <= row["upper"]
            assert np.allclose(row["normal"], own.normal[k], atol=1e-9) and np.allclose(row["point"], own.point[k])
            assert row["item"] == own.item[k]
            if world.body(int(row["body"])).shape.meshed:
                assert row["facet"] == own.facet[k]
        missed = ~rows["hit"]
        assert (rows["body"][missed] == -1).all() and np.isinf(rows["distance"][missed]).all()
    assert len({int(b) for b in rows["body"]}) > 5


def test_all_hits_are_those_of_all_bodies():
    rng = rng_of("world rays, all")
    world = mixed_world(rng, 30)
    origins = rng.normal(size=(40, 3)) * 5
    directions = rng.normal(size=(40, 3)) - origins
    rows = world.raycast(origins, directions, all_hits=True, max_distance=2.0)
    n_met = 0
    for k in range(40):
        own = rows[slice(*rows.starts[k : k + 2])]
        assert (own["ray"] == k).all() and (np.diff(own["distance"]) >= 0).all() and (own["distance"] <= 2.0).all()
        want = []
        for i in world.ids:
            body = world.body(i)
            r = collide.raycast(body.shape, body.X_WB, origins[k], directions[k], all_hits=True, max_distance=2.0)
            # A polytope in a World is one convex set: where a ray passes an edge of its triangles, one place.
            want += [(i, t) for t in np.unique(np.round(r.distance, 9))]
        got = {(int(row["body"]), float(t)) for row, t in zip(own, np.round(own["distance"], 9))}
        assert len(got ^ {(i, float(t)) for i, t in want}) == 0, k
        n_met += len(own)
    assert n_met > 40


def test_moved_shapes_are_those_of_all_bodies():
    rng = rng_of("world casts")
    world = mixed_world(rng, 24)
    for shape in (collide.Box((0.3, 0.4, 0.2)), collide.Sphere(0.15), collide.Mesh(*box((-0.2,) * 3, (0.2,) * 3))):
        X = np.array([random_pose(rng, 4.0) for _ in range(12)])
        d = rng.normal(size=(12, 3)) - 0.4 * X[:, :3, 3]
        of_bodies = {i: collide.shape_cast(shape, X, d, world.body(i).shape, world.body(i).X_WB) for i in world.ids}
        t = np.array([of_bodies[i].distance for i in world.ids])
        rows = world.shape_cast(shape, X, d)
        assert (rows["hit"] == np.isfinite(t.min(axis=0))).all() and rows["hit"].mean() > 0.2
        for k in np.flatnonzero(rows["hit"]).tolist():
            own = of_bodies[int(rows["body"][k])]
            assert abs(rows["distance"][k] - t[:, k].min()) < 1e-7 and rows["at_start"][k] == own.at_start[k]
            assert np.allclose(rows["point"][k], own.point[k]) and np.allclose(rows["normal"][k], own.normal[k])
        short = world.shape_cast(shape, X, d, max_distance=0.5 * float(np.median(t.min(axis=0))))
        assert (short["distance"][short["hit"]] == rows["distance"][short["hit"]]).all()
    none = world.shape_cast(shape, X, d, group=4)
    assert not none["hit"].any() or (none["body"] >= 0).sum() == none["hit"].sum()


def test_nearest_bodies_are_those_of_all_bodies():
    rng = rng_of("nearest bodies")
    world = mixed_world(rng, 40)
    points = np.concatenate([rng.normal(size=(40, 3)) * 4, [world.body(i).X_WB[:3, 3] for i in world.ids[:10]]])
    point = collide.ConvexHull([(0, 0, 0)])
    X = np.array([naive.pose(t=p) for p in points])
    d = np.array([collide.distance(point, world.body(i).shape, X, world.body(i).X_WB).distance for i in world.ids])
    rows = world.nearest(points)
    np.testing.assert_allclose(rows["distance"], d.min(axis=0), rtol=0, atol=1e-9)
    assert (rows["lower"] <= rows["distance"]).all() and (rows["distance"] <= rows["upper"]).all()
    assert (rows["distance"] < 0).sum() > 3 and (rows["distance"] > 0).sum() > 20
    for k, row in enumerate(rows):
        assert abs(d[world.ids.index(int(row["body"])), k] - row["distance"]) < 1e-9
        if row["distance"] > 0:
            assert np.allclose(points[k] + row["distance"] * row["normal"], row["point"], atol=1e-6)
    near = world.nearest(points, max_distance=0.3)
    assert (near["hit"] == (rows["distance"] <= 0.3)).all() and 0 < near["hit"].mean() < 1
    some = world.nearest(points, mask=1)
    counts = np.array([bool(world.body(i).group & 1) for i in world.ids])
    np.testing.assert_allclose(some["distance"], d[counts].min(axis=0), rtol=0, atol=1e-9)
    single = world.nearest(points[0])
    assert len(single) == 1 and single.rows.tobytes() == rows.rows[:1].tobytes()


def test_of_several_first_the_smallest_id():
    world = collide.World()
    ids = [world.add(collide.Box((1, 1, 1)), collide.pose((0, y, 0))) for y in (0, 5, 0)]
    assert world.raycast((-3, 0, 0), (1, 0, 0))["body"][0] == ids[0]
    assert world.shape_cast(collide.Sphere(0.1), collide.pose((-3, 0, 0)), (1, 0, 0))["body"][0] == ids[0]
    assert world.nearest((-3, 0, 0))["body"][0] == ids[0]
    world.remove(ids[0])
    assert world.raycast((-3, 0, 0), (1, 0, 0))["body"][0] == ids[2]
    world.set_pose(ids[2], collide.pose((0, 9, 0)))
    assert not world.raycast((-3, 0, 0), (1, 0, 0))["hit"][0]
    assert world.raycast((-3, 5, 0), (1, 0, 0)).names == ["body 1"]


def test_empty_worlds_and_endless_bodies():
    world = collide.World()
    for rows in (
        world.raycast([(0, 0, 0)] * 2, (1, 0, 0)), world.shape_cast(collide.Sphere(1), np.eye(4), [(1, 0, 0)] * 2),
        world.nearest([(0, 0, 0)] * 2),
    ):
        assert len(rows) == 2 and not rows["hit"].any() and rows.names == [None, None]
    assert world.raycast((0, 0, 0), (1, 0, 0), all_hits=True).starts.tolist() == [0, 0]
    floor = world.add(collide.Halfspace((0, 0, 1), 0.0))
    assert world.raycast((0, 0, 3), (0, 0, -1))["distance"][0] == 3.0
    assert world.shape_cast(collide.Sphere(1), collide.pose((0, 0, 3)), (0, 0, -1))["body"][0] == floor
    assert world.nearest((0, 0, 3))["distance"][0] == 3.0
    assert not world.raycast((0, 0, 3), (1, 0, 0))["hit"][0]


def test_stats_stay():
    world = collide.World()
    world.add(collide.Sphere(1.0))
    world.collides()
    before = dict(world.stats)
    world.raycast((3, 0, 0), (-1, 0, 0))
    world.nearest((3, 0, 0))
    assert world.stats == before


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda w: w.raycast((0, 0, 0), (0, 0, 0)), "length 0"), (lambda w: w.raycast((0, 0), (0, 0, 1)), r"\(3,\)"),
        (lambda w: w.raycast([(0, 0, 0)] * 2, [(1, 0, 0)] * 3), "lengths do not match"),
        (lambda w: w.raycast((0, 0, 0), (1, 0, 0), max_distance=-1), "World.raycast: max_distance"),
        (lambda w: w.raycast((0, 0, 0), (1, 0, 0), group=-1), "group must be an integer"),
        (lambda w: w.nearest((0, np.nan, 0)), "not finite"), (lambda w: w.nearest((0, 1e60, 0)), "exceeds"),
        (lambda w: w.nearest((0, 0, 0), mask="all"), "mask must be an integer"),
        (lambda w: w.shape_cast("box", np.eye(4), (1, 0, 0)), "must be a shape"),
        (lambda w: w.shape_cast(collide.Sphere(1), np.eye(4), (0, 0, 0)), "World.shape_cast: direction_W"),
    ],
)
def test_what_is_refused(ask, words):
    world = collide.World()
    world.add(collide.Sphere(1.0))
    with pytest.raises(InvalidArgument, match=words):
        ask(world)


def test_poses_and_shapes_that_are_refused():
    world = collide.World()
    with pytest.raises(InvalidPose):
        world.shape_cast(collide.Sphere(1), -np.eye(4), (1, 0, 0))
    with pytest.raises(UnsupportedQuery, match="shape: Halfspace has no end"):
        world.shape_cast(collide.Halfspace((0, 0, 1), 0), np.eye(4), (1, 0, 0))


def test_a_flat_part_is_one_wall_of_all_that_a_ray_meets():
    """In a World as asked alone: the chord of a polygon has one end, not two that rounding sets apart."""
    rng, hits = rng_of("walls of polygons"), 0
    for k in range(60):
        points = rng.normal(size=(int(rng.integers(3, 8)), 3))
        points[:, 2] *= k % 3 == 0
        polygon = collide.ConvexHull(points if len(points) > 3 else points * (1, 1, 0))
        X_WB = random_pose(rng, 1.0) if k % 2 else np.eye(4)
        origins = rng.normal(size=(20, 3)) * 3
        directions = X_WB[:3, 3] + X_WB[:3, :3] @ np.append(rng.normal(size=2) * 0.3, 0.0) - origins
        alone = collide.raycast(polygon, X_WB, origins, directions, all_hits=True)
        world = collide.World()
        world.add(polygon, X_WB)
        rows = world.raycast(origins, directions, all_hits=True)
        assert np.diff(rows.starts).tolist() == np.diff(alone.starts).tolist(), (k, points.tolist(), X_WB.tolist())
        assert np.allclose(rows["distance"], alone.distance, rtol=1e-12, atol=0)
        hits += len(rows)
    assert hits > 500
