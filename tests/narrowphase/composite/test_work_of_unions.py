"""How much work questions about unions with meshes are: parts that are posed, booleans that are asked; no time is
measured."""

from __future__ import annotations

import numpy as np
import pytest
from naive import random_pose, rng_of

import collide
from collide.narrowphase.composite import composite_mesh_pairs, composite_meshes, composite_parts


def meshes(n: int, size: float, long: float = 1.0) -> collide.Compound:
    """So many small closed meshes in a ball of a metre, so many times as long as wide."""
    rng = rng_of(f"meshes {n}")
    faces = collide.tessellate(collide.Box((1.0, 1.0, 1.0))).faces
    corners = collide.tessellate(collide.Box((size, size, long * size))).vertices
    places = rng.normal(size=(n, 3))
    places *= (0.5 * rng.uniform(0, 1, n) ** (1 / 3) / np.linalg.norm(places, axis=1))[:, None]
    return collide.Compound(
        [(collide.Mesh(corners, faces), collide.pose(p, rpy=r)) for p, r in zip(places, rng.uniform(-3, 3, (n, 3)))]
    )


def counted(monkeypatch, module, name: str, of) -> list[int]:
    counts, function = [], getattr(module, name)

    def recorded(*args, **options):
        counts.append(of(*args))
        return function(*args, **options)

    monkeypatch.setattr(module, name, recorded)
    return counts


def test_trial_booleans_of_a_depth_pose_few_parts(monkeypatch):
    """A depth asks about hundreds of poses; most are decided by the parts that overlap the most, and parts of the body
    that stands still are placed once."""
    union, box = meshes(200, 0.05), collide.Box((1.0, 0.8, 0.6))
    X_WB = collide.pose((0.6, 0.1, 0.2), rpy=(-0.4, 0.7, 0.1))
    counts = counted(monkeypatch, composite_parts, "boxes_of", lambda table, rows, which: len(which))
    tried = counted(monkeypatch, composite_meshes, "_states", lambda A, B, X, Y, *_: len(X))
    row = collide.distance(union, box, np.eye(4), X_WB)
    assert row.hit and row.distance < 0.0 and sum(tried) > 200
    assert sum(counts) < 0.4 * len(union.items) * sum(tried), (sum(counts), sum(tried))


def test_most_trial_poses_of_curved_parts_are_decided_by_polytopes(monkeypatch):
    """Facets of a mesh are gone through one by one only where a polytope around the curved part meets and one inside
    does not."""
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, 21)] * 2)
    terrain = collide.HeightField(0.05 * np.sin(9 * x) * np.cos(7 * y), (0.05, 0.05), bottom=-0.3)
    cans = collide.Compound(
        [(collide.Cylinder(0.1, 0.3), collide.pose((0.2 * k, 0.0, 0.0), rpy=(0.3 * k, 0.2, 0.1))) for k in range(3)]
    )
    asked = counted(monkeypatch, composite_mesh_pairs, "loose_states", lambda A, B, PA, PB: len(PA.X))
    settled = counted(monkeypatch, composite_mesh_pairs, "settle_curved", lambda A, E, PA, PB: len(PA.X))
    row = collide.distance(cans, terrain, collide.pose((0.1, 0.1, 0.0)), collide.pose(rpy=(0.1, 0.2, 0.3)))
    assert row.hit and row.distance < 0.0
    assert sum(asked) > 40 and sum(settled) < 0.2 * sum(asked), (sum(settled), sum(asked))


def large_slab(size: float) -> collide.Mesh:
    corners, faces = collide.tessellate(collide.Box((size, size, 0.1 * size)))[:2]
    return collide.Mesh(corners, faces)


def test_parts_before_a_large_face_are_told_apart_along_its_normal(monkeypatch):
    """The world's boxes of a large, turned body tell none of a small union's parts from the others."""
    union, slab = meshes(200, 0.05), large_slab(1e4)
    X_WB = collide.pose(5e3 * np.array([0.6, 0.48, 0.64]), rpy=(-0.4, 0.7, 0.1))
    asked = counted(monkeypatch, composite_meshes, "part_rows", lambda A, B, X, Y, limit: len(X.X))
    row = collide.distance(union, slab, np.eye(4), X_WB)
    assert not row.hit and row.certified and row.distance > 0.0
    assert 0 < sum(asked) < 40, sum(asked)


def test_parts_before_a_large_face_are_proven_apart_by_the_sets_around_them(monkeypatch):
    """A boolean of a union whose parts' boxes all overlap a large, turned body's box asks about the facets of few."""
    union, slab = meshes(200, 0.05), large_slab(1e4)
    asked = counted(monkeypatch, composite_meshes, "part_states", lambda A, B, X, Y: len(X.X))
    apart = collide.pose(5e3 * np.array([0.6, 0.48, 0.64]), rpy=(-0.4, 0.7, 0.1))
    assert not collide.collide(union, slab, np.eye(4), apart)
    assert not collide.collide(union, slab, np.stack([np.eye(4)] * 2), apart).any()
    assert 0 < sum(asked) < 30, sum(asked)


def test_states_of_parts_are_those_of_each(monkeypatch):
    """A boolean that leaves parts out by their sets says what the parts say one by one: sticks, around which balls tell
    little."""
    rng, hits = rng_of("states of parts"), []
    left_out = counted(monkeypatch, composite_meshes, "_set_gaps", lambda A, B, i, *_: len(i))
    for seed in range(8):
        union, slab = meshes(40, 0.01 + 0.001 * seed, 40.0), large_slab(30.0)
        X_WA, X_WB = random_pose(rng, 1.0), random_pose(rng, 1.0)
        X_WB[:3, 3] = X_WA[:3, 3] + rng.uniform(2.0, 2.2) * X_WB[:3, 2]
        each = [collide.collide(collide.Compound([item]), slab, X_WA, X_WB) for item in union.items]
        hits.append(collide.collide(union, slab, X_WA, X_WB))
        assert hits[-1] == any(each), (seed, X_WA.tolist(), X_WB.tolist())
    assert 1 <= sum(hits) <= 7 and sum(left_out) >= 10, (hits, sum(left_out))


@pytest.mark.many(2)
@pytest.mark.parametrize("size", [0.3, 3.0, 1e3, 1e6])
def test_parts_left_out_along_a_normal_are_no_nearer(size):
    """The distance of a union is the least one of its parts asked one by one; with a limit, too."""
    rng = rng_of(f"parts along a normal {size}")
    limited = 0
    for seed in range(6):
        union, slab = meshes(30, 0.05 + 0.01 * seed), large_slab(size)
        X_WA, X_WB = random_pose(rng, 1.0), random_pose(rng, 1.0)
        n = rng.normal(size=3)
        X_WB[:3, 3] = X_WA[:3, 3] + (2.0 + size) * n / np.linalg.norm(n)
        each = [collide.distance(collide.Compound([item]), slab, X_WA, X_WB) for item in union.items]
        least = min(row.distance for row in each)
        row = collide.distance(union, slab, X_WA, X_WB)
        assert row.distance == least and row.certified and not row.hit
        assert row.lower == min(part.lower for part in each) and row.upper == min(part.upper for part in each)
        for limit in (0.999 * least, 1.001 * least):
            within = collide.distance(union, slab, X_WA, X_WB, max_distance=limit)
            assert within.beyond == (limit < least) and (within.beyond or within.distance == least)
            limited += within.beyond
    assert limited == 6


def test_a_world_that_only_asks_whether_bodies_meet_searches_no_depth(monkeypatch):
    union = meshes(20, 0.1)
    region = collide.HPolytope(((1, 0, 0), (0, 1, 0), (0, 0, 1.0)), (0.3, 0.3, 0.3), bounded=False)
    depths = counted(monkeypatch, composite_meshes, "shortened", lambda *args: 1)
    world = collide.World()
    world.add(union)
    world.add(region, collide.pose((0.0, 0.0, 0.2), rpy=(0.1, 0.2, 0.3)))
    assert world.collides() and not depths
    assert len(world.collisions()) == 1 and depths


@pytest.mark.parametrize("n", [1, 3])
def test_parts_placed_at_once_stand_where_each_is_placed(n):
    """Bit by bit, slops too; a part without a pose of its own among them."""
    rng = rng_of("parts placed at once")
    union = collide.Compound([*meshes(5, 0.1).items, (collide.Sphere(0.1), np.eye(4))])
    parts = composite_parts.compound_parts(union)
    X_WB = np.array([collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3)) for _ in range(n)])
    moved = 0
    for part, placed in zip(parts.parts, parts.placed_all(X_WB), strict=True):
        one = part.at(X_WB, np.zeros(n))
        assert (one.X == placed.X).all() and (one.slop == placed.slop).all()
        moved += int((placed.slop > 0.0).sum())
    assert moved >= 4 * n


def terrain(n: int) -> collide.HeightField:
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, n + 1)] * 2)
    return collide.HeightField(0.05 * np.sin(9 * x) * np.cos(7 * y), (1 / n, 1 / n), bottom=-0.3)


def cans(n: int, width: float, across: float = 1.0) -> collide.Compound:
    rng, can = rng_of(f"cans {n}"), collide.Cylinder(0.5 * width, width)
    return collide.Compound(
        [(can, collide.pose(across * rng.uniform(-0.5, 0.5, 3), rpy=rng.uniform(-3, 3, 3))) for _ in range(n)]
    )


def rough_sheet(size: float) -> collide.Mesh:
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, 13)] * 2)
    vertices = size * np.stack([x, y, 0.05 * np.sin(9 * x) * np.cos(7 * y)], axis=-1).reshape(-1, 3)
    at = (np.arange(12)[:, None] * 13 + np.arange(12)).ravel()
    faces = [np.stack([at, at + 1, at + 14], axis=1), np.stack([at, at + 14, at + 13], axis=1)]
    return collide.Mesh(vertices, np.concatenate(faces), solid=False)


@pytest.mark.parametrize("exchanged", [False, True])
def test_groups_decide_for_their_parts_before_a_large_mesh(monkeypatch, exchanged):
    """Boxes and hull of a large rough sheet hold all of a union; most trial poses are decided by balls around groups,
    and sets around parts are asked about only where neither balls nor a hit tell."""
    union, sheet = meshes(300, 0.05), rough_sheet(1e5)
    balls = counted(monkeypatch, composite_meshes, "_ball_gaps", lambda M, balls, X, Y, mesh, others, *_: len(others))
    sets = counted(monkeypatch, composite_meshes, "_set_gaps", lambda A, B, i, *_: len(i))
    tried = counted(monkeypatch, composite_meshes, "_states", lambda A, B, X, Y, *_: len(X))
    X_WA, X_WB = collide.pose(rpy=(0.3, -0.2, 0.5)), collide.pose((0.006, 0.0048, 0.0064), rpy=(-0.4, 0.7, 0.1))
    row = collide.distance(*((sheet, union, X_WB, X_WA) if exchanged else (union, sheet, X_WA, X_WB)))
    assert row.hit and -1.0 < row.distance < 0.0 and sum(tried) > 150
    assert sum(balls) < 0.25 * 300 * sum(tried), (sum(balls), sum(tried))
    assert sum(sets) < 5 * sum(tried), (sum(sets), sum(tried))


def test_groups_hold_their_parts():
    """Balls around parts, and around groups, hold every corner of their parts, at poses that stretch, too."""
    rng, checked = rng_of("groups hold parts"), 0
    for n in (33, 100, 1100):
        union = meshes(n, 0.05 + 1.0 / n)
        parts = composite_parts.compound_parts(union)
        X_WB = random_pose(rng, 10.0)
        X_WB[:3, :3] *= 1.3
        corners = [shape.vertices @ X[:3, :3].T + X[:3, 3] for shape, X in union.items]
        assert len(parts.groups) == (2 if n < 1024 else 3)
        for balls in (*parts.groups, parts.balls):
            k = len(balls.radii)
            centres, radii = balls.at(np.arange(k), np.repeat(X_WB[None], k, axis=0))
            for part, points in enumerate(corners):
                of = balls.of[part]
                away = points @ X_WB[:3, :3].T + X_WB[:3, 3] - centres[of]
                assert np.sqrt(np.square(away).sum(axis=1)).max() <= radii[of], (n, part)
                checked += 1
            sizes = np.bincount(balls.of, minlength=k)
            assert sizes.min() >= 1 and sizes.sum() == n
        # Groups are of neighbours: they are smaller than the union.
        assert n < 1000 or np.median(parts.groups[-1].radii) < 0.5 * parts.groups[0].radii[0]
    assert checked > 3000


@pytest.mark.many(3)
@pytest.mark.parametrize("limit", [0.05, 3e3, np.inf])
@pytest.mark.parametrize("swapped", [False, True])
def test_parts_of_a_union_before_a_large_convex_body_are_told_apart_by_sets(monkeypatch, limit, swapped):
    """No row beyond a limit has a normal, and boxes of the large body hold all of the union."""
    rng, union = rng_of("before a large convex body"), meshes(120, 0.05)
    normals = rng.normal(size=(60, 3))
    body = collide.HPolytope(normals / np.linalg.norm(normals, axis=1)[:, None], np.full(60, 1e4))
    X_WA, X_WB = collide.pose(rpy=(0.3, -0.2, 0.5)), collide.pose(rpy=(-0.4, 0.7, 0.1))
    n = X_WB[:3, :3] @ (normals[0] / np.linalg.norm(normals[0]))
    X_WA[:3, 3] = (1e4 + 1.5) * n
    asked = counted(monkeypatch, composite_meshes, "part_rows", lambda A, B, X, Y, limit: len(X.X))
    options = {"max_distance": limit}
    row = collide.distance(*((body, union, X_WB, X_WA) if swapped else (union, body, X_WA, X_WB)), **options)
    assert not row.hit and row.certified and row.beyond == (limit < 0.1)
    assert 0 < sum(asked) < 20, sum(asked)
    if not row.beyond:
        each = [collide.distance(collide.Compound([item]), body, X_WA, X_WB) for item in union.items]
        assert all(getattr(row, of) == min(getattr(r, of) for r in each) for of in ("lower", "distance", "upper"))


def test_balls_decide_most_of_many_parts_at_one_mesh(monkeypatch):
    """A pose that clears a union is proven by all parts; few of them come near the surface, or are asked one by one.
    Parts are placed in blocks."""
    ground, union = terrain(20), cans(400, 0.04)
    asked = counted(monkeypatch, composite_meshes, "part_states", lambda A, B, X, Y: len(X.X))
    placed = counted(monkeypatch, composite_parts, "moved_pose", lambda X, *_: len(X))
    tried = counted(monkeypatch, composite_meshes, "_states", lambda A, B, X, Y, *_: len(X))
    row = collide.distance(ground, union, collide.pose(rpy=(0.3, -0.2, 0.5)), collide.pose((0.01, 0.0, 0.0)))
    assert row.hit and row.distance < 0.0 and sum(tried) > 100
    assert 0 < sum(asked) < 2 * sum(tried) and len(asked) < 60, (sum(asked), len(asked), sum(tried))
    assert len(placed) < 150, len(placed)


def test_parts_told_by_balls_meet_as_each_does_alone():
    """Parts within a solid, outside of it, in its hole, at its surface, and within an open mesh, which has no inside;
    of all kinds, at poses that are rounded, and stretched ones."""
    rng, told = rng_of("parts told by balls"), {"inside": 0, "outside": 0, "open": 0}
    inner, outer = (collide.tessellate(collide.Sphere(r)) for r in (0.5, 1.0))
    hollow = collide.Mesh(
        np.concatenate([outer.vertices, inner.vertices]),
        np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)]),
    )
    meshes_of = {"hollow": hollow, "open": collide.Mesh(outer.vertices, outer.faces[1:])}
    for case in range(40):
        name = "open" if case % 4 == 0 else "hollow"
        size, far = 10.0 ** rng.uniform(-3, -0.7), rng.uniform(0.2, 1.6)
        shapes = (
            collide.Box((size, 2 * size, size)), collide.Sphere(size), collide.Cylinder(size, size),
            collide.Capsule(size, size), collide.ConvexHull(size * rng.normal(size=(6, 3)) + size, radius=0.1 * size),
            collide.Mesh(size * inner.vertices, inner.faces),
        )
        directions = rng.normal(size=(len(shapes), 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        items = [(s, collide.pose(far * d, rpy=rng.uniform(-3, 3, 3))) for s, d in zip(shapes, directions)]
        union = collide.Compound([(collide.Compound(items[:3]), collide.pose(rpy=(0.1, 0.2, 0.3))), *items[3:]])
        flat = [(s, collide.pose(rpy=(0.1, 0.2, 0.3)) @ X) for s, X in items[:3]] + items[3:]
        X_WA, X_WB = random_pose(rng, 1e3), np.eye(4)
        X_WB[:, :] = X_WA @ collide.pose(0.01 * rng.normal(size=3))
        if case % 5 == 0:
            X_WB[:3, :3] *= 1.5
        mesh = meshes_of[name]
        want = [collide.collide(mesh, s, X_WA, X_WB @ X, check_poses=False) for s, X in flat]
        for poses in ((X_WA, X_WB), (np.repeat(X_WA[None], 3, axis=0), np.repeat(X_WB[None], 3, axis=0))):
            hit = np.atleast_1d(collide.collide(mesh, union, *poses, check_poses=False))
            assert (hit == any(want)).all(), (case, size, far, want)
            alone = [collide.collide(mesh, collide.Compound([item]), *poses, check_poses=False) for item in flat]
            assert (np.any(alone, axis=0) == hit).all(), (case, size, far, want)
        told["open" if name == "open" and not any(want) else "inside" if all(want) else "outside"] += 1
    assert min(told.values()) >= 4, told


@pytest.mark.parametrize("limit", [np.inf, 0.26])
def test_parts_of_a_small_union_beside_a_rough_mesh_are_told_apart_by_balls(monkeypatch, limit):
    """Boxes of the terrain, and its extent along any normal, hold all of the union: in its valley none is nearer."""
    ground, union = terrain(40), cans(200, 5e-4, 0.01)
    X_WA, X_WB = collide.pose(rpy=(0.3, -0.2, 0.5)), collide.pose((0.4, 0.32, 0.43))
    asked = counted(monkeypatch, composite_meshes, "part_rows", lambda A, B, X, Y, limit: len(X.X))
    row = collide.distance(ground, union, X_WA, X_WB, max_distance=limit)
    assert not row.hit and row.certified and row.beyond == (limit < row.lower)
    assert 0 < sum(asked) < 12, sum(asked)
    if limit == np.inf:
        each = [collide.distance(ground, collide.Compound([item]), X_WA, X_WB) for item in union.items]
        assert all(getattr(row, of) == min(getattr(r, of) for r in each) for of in ("lower", "distance", "upper"))


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(6))
def test_parts_left_out_by_balls_are_no_nearer(seed):
    """Around, within and partly within a hollow solid, before an open mesh, and of several meshes; in batches of poses
    each of which has its own nearest pair; swapped, and with a limit."""
    rng, apart = rng_of(f"parts left out by balls {seed}"), 0
    outer, inner = (collide.tessellate(collide.Sphere(r)) for r in (1.0, 0.6))
    hollow = collide.Mesh(
        np.concatenate([outer.vertices, inner.vertices]),
        np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)]),
    )
    box, mesh = collide.Box((0.02, 0.01, 0.03)), collide.Mesh(0.01 * outer.vertices, outer.faces)
    items = [
        (shape, collide.pose(rng.normal(scale=0.05, size=3), rpy=rng.uniform(-3, 3, 3)))
        for shape in 8 * (box, collide.Cylinder(0.01, 0.02), mesh)
    ]
    union = collide.Compound(items)
    grounds = (hollow, collide.Mesh(outer.vertices, outer.faces[2:]), terrain(6),
               collide.Compound([(hollow, np.eye(4)), (terrain(4), collide.pose((1.5, 0.0, 0.0)))]))
    ground = grounds[seed % 4]
    directions = rng.normal(size=(6, 3))
    directions *= (np.array([0.0, 0.3, 0.8, 1.0, 1.3, 2.0]) / np.linalg.norm(directions, axis=1))[:, None]
    X_WA = random_pose(rng, 1.0)
    X_WB = np.array([X_WA @ collide.pose(p, rpy=rng.uniform(-3, 3, 3)) for p in directions])
    each = [collide.distance(ground, collide.Compound([item]), X_WA, X_WB, signed=False) for item in items]
    rows = collide.distance(ground, union, X_WA, X_WB, signed=False)
    turned = collide.distance(union, ground, X_WB, X_WA, signed=False)
    for k in range(len(X_WB)):
        hit = any(part.hit[k] for part in each)
        least = min(part.distance[k] for part in each)
        assert rows.hit[k] == hit == turned.hit[k], (seed, k)
        if hit:
            continue
        apart += 1
        assert rows.distance[k] == least == turned.distance[k], (seed, k)
        assert rows.lower[k] == min(part.lower[k] for part in each), (seed, k)
        alone = collide.distance(ground, union, X_WA, X_WB[k], signed=False)
        assert (alone.distance, alone.lower, alone.upper) == (rows.distance[k], rows.lower[k], rows.upper[k])
        for limit in (0.999 * least, 1.001 * least):
            within = collide.distance(ground, union, X_WA, X_WB[k], max_distance=limit, signed=False)
            assert within.beyond == (limit < least) and (within.beyond or within.distance == least), (seed, k, limit)
    assert apart >= 3, (seed, apart)
