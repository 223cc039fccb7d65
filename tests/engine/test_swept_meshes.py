"""Meshes with thickness: beside distances of points from triangles, unions of swept triangles, and closed forms."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from mesh_shapes import block_ring
from naive import one_of_each, pose, random_pose, rng_of
from reproduction import reproducing

import collide
from collide import InvalidShape, SweptMesh

EYE, RADIUS = np.eye(4), 0.0625
_VERTICES, _FACES = collide.tessellate(collide.Sphere(0.5), tolerance=0.1)
MESHES = {
    "ring": collide.Mesh(block_ring()[0] * 0.25, block_ring()[1]), "open": collide.Mesh(_VERTICES, _FACES[::2]),
    "sheet": collide.Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0.25], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]),
}


def from_triangle(p: np.ndarray, corners: np.ndarray) -> float:
    """Distance of a point from a triangle: from its plane where the foot is in it, else from the nearest edge."""
    n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    sides = np.roll(corners, -1, axis=0) - corners
    if all(np.cross(side, p - corner) @ n >= 0.0 for side, corner in zip(sides, corners)):
        return abs(float((p - corners[0]) @ n)) / float(np.linalg.norm(n))
    along = np.clip(((p - corners) * sides).sum(axis=1) / np.square(sides).sum(axis=1), 0.0, 1.0)
    return float(np.linalg.norm(p - corners - along[:, None] * sides, axis=1).min())


def union_of(shape: SweptMesh) -> collide.Compound:
    """The same set of the library's other shapes."""
    mesh = shape.mesh
    items = [collide.ConvexHull(mesh.vertices[face], radius=shape.radius) for face in mesh.faces]
    return collide.Compound([(item, EYE) for item in (*items, mesh)[: len(shape)]])


@pytest.mark.parametrize("name", MESHES)
def test_balls_beside_distances_of_points_from_triangles(name):
    mesh, rng, hits = MESHES[name], rng_of("swept", name), 0
    shape, corners = SweptMesh(mesh, RADIUS), mesh.vertices[mesh.faces]
    points = rng.normal(size=(12, 3)) * 0.5
    for p in points:
        away = min(from_triangle(p, triangle) for triangle in corners)
        inside = mesh.solid and bool(collide.contains(mesh, EYE, p))
        for radius in (0.125, 0.5):
            gap = -1.0 if inside else away - RADIUS - radius
            with reproducing("mesh {name}, p = {p}, radius = {radius}", name=name, p=p, radius=radius):
                ball = collide.Sphere(radius), pose(t=p)
                for A, B, X, Y in ((shape, ball[0], EYE, ball[1]), (ball[0], shape, ball[1], EYE)):
                    r = collide.distance(A, B, X, Y)
                    assert r.hit == collide.collide(A, B, X, Y) == (gap <= 0.0)
                    assert r.hit or r.distance == pytest.approx(gap, abs=1e-12)
                    assert r.lower <= r.upper and (r.hit or r.lower - 1e-12 <= gap <= r.upper + 1e-12)
                near = collide.contacts(shape, ball[0], EYE, ball[1], margin=0.125)
                assert (len(near) > 0) == (gap <= 0.125)
            hits += gap <= 0.0
        assert collide.contains(shape, EYE, p) == (inside or away <= RADIUS)
    assert 3 <= hits <= 21, hits


@pytest.mark.many(4)
@pytest.mark.parametrize(
    "kind", [*one_of_each(rng_of("kinds")), "Mesh", "SweptMesh", "PointCloud", "Plane", "flat Box"]
)
def test_every_partner_beside_the_union_of_swept_triangles(kind):
    rng, hits, cases = rng_of("swept and", kind), 0, 0
    for name, mesh in MESHES.items():
        shape = SweptMesh(mesh, RADIUS)
        union = union_of(shape)
        more = {
            "Mesh": MESHES["open"], "SweptMesh": SweptMesh(MESHES["ring"], 0.03),
            "flat Box": collide.Box((0.5, 0, 0.4)),
            "PointCloud": collide.PointCloud(rng.normal(size=(20, 3)) * 0.5, 0.02),
            "Plane": collide.Plane((0, 0.6, 0.8), 0.1),
        }
        for _ in range(2):
            partner = (one_of_each(rng) | more)[kind]
            X, Y = random_pose(rng, 0.3), random_pose(rng, 0.6)
            with reproducing("{name}, B = {B}; X_WA, X_WB = {X}, {Y}", name=name, B=partner, X=X, Y=Y):
                r, known = (collide.distance(S, partner, X, Y, signed=False) for S in (shape, union))
                assert r.hit == known.hit == collide.collide(shape, partner, X, Y)
                assert r.distance == pytest.approx(known.distance, abs=1e-7)
                assert collide.collide(shape, partner, X, Y, security_margin=0.1) == (known.distance <= 0.1)
                c, of_union = (collide.contacts(S, partner, X, Y, margin=0.05) for S in (shape, union))
                assert (len(c) > 0) == (len(of_union) > 0)
                if r.hit and kind != "Halfspace":
                    deep = collide.distance(shape, partner, X, Y)
                    away = pose(Y[:3, :3], Y[:3, 3] + (-deep.distance * 1.000001 + 1e-9) * deep.normal)
                    assert deep.distance <= 0.0 and not collide.collide(shape, partner, X, away)
                if kind not in ("Halfspace", "Plane"):
                    way = rng.normal(size=3)
                    cast, by_union = (collide.shape_cast(S, X, way, partner, Y) for S in (shape, union))
                    assert cast.hit == by_union.hit
                    assert not cast.hit or cast.distance == pytest.approx(by_union.distance, abs=1e-6)
                world = collide.World()
                world.add(shape, X), world.add(partner, Y)
                assert world.collides() == r.hit and len(world.distances(0.1)) == (known.distance <= 0.1)
            hits, cases = hits + bool(r.hit), cases + 1
    assert 1 <= hits <= cases, (hits, cases)


@pytest.mark.parametrize("name", MESHES)
def test_rays_motions_and_worlds(name):
    rng, hits = rng_of("swept rays", name), 0
    shape = SweptMesh(MESHES[name], RADIUS)
    union = union_of(shape)
    origins, goals = rng.normal(size=(30, 3)) * 2.0, rng.normal(size=(30, 3)) * 0.3
    X = random_pose(rng, 0.2)
    r, known = (collide.raycast(S, X, origins, goals - origins) for S in (shape, union))
    assert (r.hit == known.hit).all() and np.allclose(r.distance[r.hit], known.distance[r.hit], atol=1e-11)
    assert np.allclose(r.normal[r.hit], known.normal[r.hit], atol=1e-9)
    world = collide.World()
    world.add(shape, X, name="swept")
    assert (world.raycast(origins, goals - origins)["hit"] == r.hit).all()
    ball = collide.Sphere(0.1)
    for origin, goal in zip(origins[:8], goals):
        assert world.shape_cast(ball, pose(t=origin), goal - origin)["hit"] == collide.shape_cast(
            ball, pose(t=origin), goal - origin, union, X
        ).hit
        start, end = pose(t=origin), pose(t=goal)
        t, by_union = (collide.time_of_impact(ball, S, start, end, X, X) for S in (shape, union))
        assert t.hit == by_union.hit and t.time == pytest.approx(by_union.time, abs=1e-6)
        hits += bool(t.hit)
    assert r.hit.sum() >= 3 and hits >= 1, (r.hit.sum(), hits)


def test_depths_of_a_padded_cube():
    cube = collide.Mesh(*collide.tessellate(collide.Box((1, 1, 1)))[:2])
    padded, ball = SweptMesh(cube, 0.125), collide.Sphere(0.25)
    for t in ((0.25, 0, 0), (0, -0.375, 0.125), (0.5, 0.0625, 0), (0.0, 0.0, 0.75)):
        r = collide.distance(padded, ball, EYE, pose(t=t))
        assert r.hit and r.distance == pytest.approx(-(0.875 - np.abs(t).max()), abs=1e-9), t
        r = collide.distance(padded, collide.Cylinder(0.25, 0.5), EYE, pose(t=t))
        assert r.hit and r.lower <= -(0.875 - np.abs(t).max()) + 1e-6, t
    assert collide.collide(padded, collide.Sphere(0.01), EYE, EYE)  # within the solid, far from all triangles


def test_values_and_what_is_refused():
    mesh = MESHES["ring"]
    shape = SweptMesh(mesh, RADIUS)
    assert shape == pickle.loads(pickle.dumps(shape)) != SweptMesh(mesh, 0.1) and len(shape) == len(mesh.faces) + 1
    assert shape.scaled(-2) == SweptMesh(mesh.scaled(-2), 2 * RADIUS)
    made = collide.tessellate(shape)
    assert made.deviation == RADIUS and len(made.faces) == len(mesh.faces)
    for make, words in (
        (lambda: SweptMesh(mesh, 0.0), "SweptMesh: radius must be > 0"),
        (lambda: SweptMesh(mesh, -1), "radius must be > 0"),
        (lambda: SweptMesh(collide.Box((1, 1, 1)), 0.1), r"SweptMesh: mesh must be a collide\.Mesh, got"),
        (lambda: shape.scaled((1, 2, 1)), "they must be equal but for signs"),
        (lambda: collide.Compound([(shape, EYE)]), r"items\[0\] is a SweptMesh; make it a body of its own"),
    ):
        with pytest.raises(InvalidShape, match=words):
            make()
    with pytest.raises(collide.InvalidArgument, match="a SweptMesh is drawn by the triangles"):
        collide.tessellate(shape, tolerance=0.01)
    box = collide.Box((1, 1, 1))
    for query in (
        lambda: collide.boolean(shape, box, EYE, EYE, "union"), lambda: collide.overlap_volume(shape, box, EYE, EYE),
        lambda: collide.facet_pairs(shape, mesh, EYE, EYE), lambda: collide.overlay(shape, mesh, EYE, EYE),
        lambda: collide.self_collisions(shape), lambda: collide.configuration_obstacle(box, shape),
        lambda: collide.SpacePartition(shape), lambda: collide.walk(shape, box, EYE, EYE),
        lambda: collide.scenes.save(_world_of(shape), "unused.json"),
    ):
        with pytest.raises(collide.CollideError, match="SweptMesh"):
            query()
    r = collide.distance(shape, box, EYE, EYE)
    assert r.hit and r.certificate[0].kind == "together"
    collide.verify(shape, box, EYE, EYE, r)
    between = collide.distance(shape, mesh, EYE, EYE)
    assert between.hit and between.certificate[0].kind == "point"
    collide.verify(shape, mesh, EYE, EYE, between)


def _world_of(shape) -> collide.World:
    world = collide.World()
    world.add(shape, name="a")
    return world
