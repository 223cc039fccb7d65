"""Worlds with meshes: everything a World promises, against all pairs one by one."""

from __future__ import annotations

import naive
import numpy as np
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import pose, random_pose, rng_of
from naive_triangles import world_points
from surfaces import torus

import collide
from collide.worlds.world_parts import WorldParts

EYE = np.eye(4)


def shapes(rng):
    """Every kind of body, meshes of every sort among them."""
    ring, ball = collide.Mesh(*block_ring()), collide.Mesh(*bumpy_sphere(120))
    half_open = collide.Mesh(box((-0.4,) * 3, (0.4,) * 3)[0], box()[1][2:])
    return [
        ring, ball, half_open, ball.scaled(0.5), *naive.one_of_each(rng).values(),
        collide.Compound([(ring, random_pose(rng, 0.5)), (collide.Cylinder(0.2, 0.9), random_pose(rng, 0.5))]),
        collide.Compound([(collide.Compound([(half_open, random_pose(rng, 0.5))]), random_pose(rng, 0.5))]),
    ]


def build(rng, n, spread):
    world, kinds = collide.World(), shapes(rng)
    for k in range(n):
        static, group = bool(rng.random() < 0.2), int(rng.integers(1, 4))
        world.add(
            kinds[k % len(kinds)], random_pose(rng, spread), static=static, group=group, mask=int(rng.integers(1, 8))
        )
    world.allow(0, 1, reason="bolted")
    return world


def check(world, limit):
    want = naive.brute_force(world, limit)
    found = world.distances(max_distance=limit)
    assert list(zip(found["a"].tolist(), found["b"].tolist())) == [(i, j) for i, j, _ in want]
    for row, (i, j, alone) in zip(found.rows, want):
        if alone is not None and (world.body(i).shape.meshed or world.body(j).shape.meshed):
            assert not naive.same_bits(row, alone), (world.body(i), world.body(j), row, alone)
    stats = world.stats
    assert sum(stats["skipped"].values()) + stats["narrowphase"] == stats["pairs"]
    assert sum(stats["how"].values()) == stats["narrowphase"] >= stats["mesh_pairs"] > 0
    assert stats["hits"] == sum(row is None or bool(row["hit"]) for _, _, row in want)
    hitting = [(i, j) for i, j, row in want if row is None or row["hit"]]
    found = world.collisions()
    assert list(zip(found["a"].tolist(), found["b"].tolist())) == hitting
    assert world.collides() == bool(hitting)
    return len(want), len(hitting)


def test_worlds_answer_as_all_pairs_do_while_bodies_move():
    rng = rng_of("mesh worlds")
    world = build(rng, 24, 1.6)
    near = hits = 0
    for _ in range(2):
        for limit in (0.0, 0.4):
            counted = check(world, limit)
            near, hits = near + counted[0], hits + counted[1]
        moved = rng.choice(world.ids, 8, replace=False).tolist()
        world.set_poses(moved, np.stack([random_pose(rng, 1.6) for _ in moved]))
        world.set_pose(world.ids[0], random_pose(rng, 1.0))
        world.remove(world.ids[-1])
    assert 40 < near and 20 < hits, (near, hits)
    for i, j, row in naive.brute_force(world, 0.0):
        if row is None or row["hit"]:
            world.allow(i, j, reason="settled")
    assert not world.collides() and len(world.collisions()) == 0
    assert world.stats["skipped"]["settled"] > 5


def test_queries_from_outside():
    rng = rng_of("mesh worlds", "queries")
    world = build(rng, 16, 2.0)
    found = 0
    for probe in shapes(rng):
        X = random_pose(rng, 1.0)
        rows = world.query(probe, X, max_distance=0.3)
        want = []
        for k in world.ids:
            body = world.body(k)
            try:
                r = collide.distance(probe, body.shape, X, body.X_WB, max_distance=0.3)
            except collide.UnsupportedQuery:
                want.append(k)
                continue
            if r.hit or r.distance <= 0.3:
                want.append(k)
                if probe.meshed or body.shape.meshed:
                    own = rows.rows[rows["b"] == k][0]
                    assert not naive.same_bits(own, r.rows[0]), (probe, body)
        assert rows["b"].tolist() == want and (rows["a"] == -1).all()
        found += len(want)
    assert found > 40


def test_an_open_sign_is_counted_as_such():
    world = collide.World()
    world.add(collide.Mesh(*box()), name="box")
    # Turned three times over, each by a rounded product: whether the innermost ball touches is beyond its numbers.
    turn = collide.pose((0, 0, 0), rpy=(0.1, 0.2, 0.3))
    ball = collide.Compound([(collide.Sphere(0.25), collide.pose((0.1, 0, 0))), (collide.Sphere(0.1), np.eye(4))])
    for _ in range(2):
        ball = collide.Compound([(ball, turn)])
    above = pose(t=(0.1, 0.2, 2.0))
    touching = above.copy()
    touching[2, 3] -= collide.distance(collide.Mesh(*box()), ball, np.eye(4), above).distance
    world.add(ball, touching, name="ball")
    world.add(collide.Cylinder(0.25, 0.5), pose(t=(-0.5, -0.5, 1.25)), name="can")
    assert world.collides() and len(world.collisions()) == 2
    assert world.stats["undecided"] == 1 and world.stats["mesh_pairs"] == 2
    world.allow("box", "can")
    assert world.collides() and world.stats["undecided"] == 1 and world.stats["how"]["undecided"] == 1
    touching[2, 3] += 1e-9
    world.set_pose("ball", touching)
    assert not world.collides() and world.stats["undecided"] == 0


def boxes_of(shape, *poses) -> np.ndarray:
    """(k, 6) boxes of its parts, pose after pose."""
    parts = WorldParts()
    parts.append([shape] * len(poses), np.array(poses))
    return parts.boxes


def test_boxes_of_posed_meshes_hold_them_and_are_tight():
    rng = rng_of("mesh boxes")
    scattered = rng.normal(size=(900, 3)) * (1.0, 1e-3, 100.0)
    for vertices, faces, most in (
        (*bumpy_sphere(5000), 1.6), (*torus(60, 20), 1.6), (*block_ring(), 1.0),
        (scattered, np.arange(900).reshape(-1, 3), 2.0),
        (np.vstack([bumpy_sphere(3000)[0], [[1e9, 0, 0]]]), bumpy_sphere(3000)[1], 1.6),
    ):
        mesh = collide.Mesh(vertices, faces)
        ratios = []
        for _ in range(8):
            X = random_pose(rng, 10.0)
            low, high = boxes_of(mesh, X)[0, :3], boxes_of(mesh, X)[0, 3:]
            used = vertices[np.unique(faces)]
            placed = used @ X[:3, :3].T + X[:3, 3]
            extreme = used[np.unique([*placed.argmin(axis=0), *placed.argmax(axis=0)])]
            exact = np.array(world_points(extreme, X))
            assert (exact.min(axis=0) >= low).all() and (exact.max(axis=0) <= high).all()
            ratios.append(np.prod((high - low) / np.ptp(placed, axis=0)))
        assert np.mean(ratios) <= most * (1 + 1e-9), np.mean(ratios)


def test_no_tree_is_built_for_meshes_that_are_never_near():
    world = collide.World()
    far = [collide.Mesh(*bumpy_sphere(2000, seed)) for seed in range(4)]
    union = collide.Compound([(far[2], pose(t=(0.0, 0, 0))), (collide.Box((1, 1, 1)), pose(t=(0, 30.0, 0)))])
    world.add(far[0])
    world.add(far[1], pose(t=(3.0, 0, 0)))
    world.add(union, pose(t=(0, 0, 9.0)))
    world.add(collide.Cylinder(0.5, 1.0), pose(t=(1.5, 2.0, 0.0)))
    # Balls turned by 45°: their boxes' corners would overlap, they do not.
    world.add(far[3], collide.pose((1.5, -2.5, 0.0), rpy=(0, 0, np.pi / 4)))
    world.add(collide.Box((0.5, 0.5, 0.5)), collide.pose((0, 30.2, 9.2)))  # meets the union's box, far from its mesh
    assert world.collides() and len(world.collisions()) == 1
    assert world.stats["skipped"]["broadphase"] == 14 and world.stats["mesh_pairs"] == 1
    assert not any(hasattr(mesh, "_tree") for mesh in far)
    assert len(world.distances(max_distance=1.2)) >= 2 and hasattr(far[0], "_tree")
