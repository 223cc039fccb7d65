"""Contacts, rays, casts and impacts of fields beside those of a Compound of the same items."""

from __future__ import annotations

import numpy as np
import pytest
from field_unions import as_union, random_grid
from mesh_shapes import box

import collide

EYE = np.eye(4)


def fields(seed: int, n: int, *, grids: bool = True):
    """(rng, field, the same as a union, its pose), n times: clouds, and every fourth a grid."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        points = rng.uniform(-1, 1, (int(rng.integers(1, 60 if k % 3 else 200)), 3))
        field = collide.PointCloud(points, rng.uniform(0.01, 0.2, len(points)) if k % 2 else 0.1)
        if grids and k % 4 == 3:
            field = random_grid(rng)
        yield rng, field, as_union(field), collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))


def others(rng) -> list:
    return [
        collide.Box((0.2, 0.1, 0.3)), collide.Sphere(0.1), collide.ConvexHull(0.1 * rng.normal(size=(20, 3))),
        collide.Cylinder(0.1, 0.2), collide.Mesh(*box()).scaled(0.3),
        collide.Compound([(collide.Box((0.1, 0.1, 0.1)), collide.pose((0.1, 0, 0))), (collide.Sphere(0.1), EYE)]),
    ]


def test_contacts_are_those_of_the_union():
    n_rows = 0
    for k, (rng, cloud, union, X) in enumerate(fields(1, 60, grids=False)):
        B = others(rng)[k % 6]
        Y = X @ collide.pose(rng.uniform(-0.7, 0.7, 3), rpy=rng.uniform(-3, 3, 3))
        for margin in (0.0, 0.05):
            for swapped in (False, True):
                mine, theirs = (
                    collide.contacts(B, S, Y, X, margin=margin).rows if swapped
                    else collide.contacts(S, B, X, Y, margin=margin).rows for S in (cloud, union)
                )
                mine, theirs = (np.sort(rows, order=["part_a", "part_b", "distance"]) for rows in (mine, theirs))
                assert len(mine) == len(theirs), k
                for field in ("distance", "normal", "point_a", "point_b"):
                    assert np.allclose(mine[field], theirs[field], atol=1e-9), (k, field)
                part = "part_b" if swapped else "part_a"
                assert np.array_equal(mine[part], theirs[part]), k
                n_rows += len(mine)
    assert n_rows > 150, n_rows


def test_rays_have_the_bits_of_the_union():
    hits = 0
    for rng, cloud, union, X in fields(2, 30, grids=False):  # grids: tests/casts/test_grid_rays.py
        origins = rng.uniform(-1.5, 1.5, (40, 3)) @ X[:3, :3].T + X[:3, 3]
        directions = rng.normal(size=(40, 3))
        for options in ({}, {"max_distance": 0.7}, {"all_hits": True}):
            mine, theirs = (collide.raycast(S, X, origins, directions, **options) for S in (cloud, union))
            for a, b in zip(mine, theirs):
                assert a is b is None or np.array_equal(a, b, equal_nan=True)
            hits += int(np.sum(mine.hit))
    assert hits > 200


@pytest.mark.parametrize("side", ["moves", "stands"])
def test_casts_are_those_of_the_union(side):
    hits = 0
    for k, (rng, cloud, union, X) in enumerate(fields(3, 72)):
        B, v = others(rng)[k % 6], rng.normal(size=3)
        Y = X @ collide.pose(rng.normal(size=3) * 1.2, rpy=rng.uniform(-3, 3, 3))
        limit = 0.5 if k % 3 == 0 else np.inf
        mine, theirs = (
            collide.shape_cast(S, X, v, B, Y, max_distance=limit) if side == "moves"
            else collide.shape_cast(B, Y, v, S, X, max_distance=limit) for S in (cloud, union)
        )
        assert mine.hit == theirs.hit and mine.at_start == theirs.at_start, k
        if mine.hit:
            assert mine.distance == pytest.approx(theirs.distance, abs=1e-9), k
            same = (mine.item_a, mine.item_b) == (theirs.item_a, theirs.item_b)  # grids have numbers of their own
            assert mine.at_start or isinstance(cloud, collide.VoxelGrid) or same, k
        hits += bool(mine.hit)
    assert 6 < hits < 66, hits


def test_impacts_are_those_of_the_union():
    hits = 0
    for k, (rng, cloud, union, X0) in enumerate(fields(4, 72)):
        B, X1 = others(rng)[k % 6], X0.copy()
        if k % 3 == 1:
            X1[:3, 3] += rng.normal(size=3)
        elif k % 3 == 2:
            X1 = X0 @ collide.pose((0.1, 0.2, 0.0), rpy=(0.1, 0.3, -0.2))
        Y0 = X0 @ collide.pose(rng.normal(size=3) * 1.2, rpy=rng.uniform(-3, 3, 3))
        Y1 = Y0 @ collide.pose(rng.normal(size=3), rpy=rng.uniform(-0.5, 0.5, 3))
        for motion in (((B, None), (Y0, Y1, X0, X1)), ((None, B), (X0, X1, Y0, Y1))):
            shapes, poses = motion
            mine, theirs = (
                collide.time_of_impact(*(S if shape is None else shape for shape in shapes), *poses)
                for S in (cloud, union)
            )
            assert mine.hit == theirs.hit and mine.time == pytest.approx(theirs.time, abs=1e-8), k
            if mine.hit and mine.time > 0.0 and isinstance(cloud, collide.PointCloud):
                assert (mine.part_a, mine.part_b) == (theirs.part_a, theirs.part_b), k
            hits += bool(mine.hit)
    assert 8 < hits < 120, hits


def test_worlds_cast_rays_and_shapes_at_clouds():
    rng, cloud, _, X = next(fields(5, 1))
    world = collide.World()
    body = world.add(cloud, X)
    origins = X[:3, 3] + 3.0 * rng.normal(size=(60, 3))
    directions = X[:3, 3] - origins + 0.3 * rng.normal(size=(60, 3))
    rows, alone = world.raycast(origins, directions).rows, collide.raycast(cloud, X, origins, directions)
    assert np.array_equal(rows["hit"], alone.hit) and alone.hit.any() and not alone.hit.all()
    assert np.array_equal(rows["distance"][alone.hit], alone.distance[alone.hit])
    assert (rows["body"][alone.hit] == body).all()
    assert len(world.contacts(margin=0.0).rows) == 0


@pytest.mark.parametrize("height", [-3.0, -0.98])
def test_a_floor_asks_the_lowest_items_alone(height):
    """A scan over a floor: none of its balls and cells is made a shape but those that may touch the floor."""
    cloud = collide.PointCloud(np.random.default_rng(8).uniform(-1, 1, (5000, 3)), 0.004)
    for field in (cloud, collide.VoxelGrid.from_points(cloud.points, 0.05)):
        for floor in (collide.Halfspace((0, 0, 1), height), collide.Plane((0, 0, 1), height)):
            rows = collide.contacts(field, floor, EYE, EYE).rows
            lowest = cloud.points[:, 2] - 0.004 if field is cloud else field.cells[:, 2] * 0.05
            assert (len(rows) > 0) == bool((lowest <= height).any())
            if isinstance(floor, collide.Halfspace) and field is cloud:
                assert len(rows) == np.count_nonzero(lowest <= height)
