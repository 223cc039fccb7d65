"""`shape_cast` of and onto meshes: what all facets say one by one, exactly where these are polytopes."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import random_pose, rng_of

import collide

EYE = np.eye(4)


def facet_hulls(mesh: collide.Mesh) -> list[collide.ConvexHull]:
    return [collide.ConvexHull(mesh.vertices[face]) for face in mesh.faces]


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["Box", "Sphere", "Capsule", "Cylinder", "ConvexHull", "Mesh"])
def test_first_facet_of_all(kind):
    """The walk along the trees misses none: t is the least of all facets, and of all pairs of them."""
    rng = rng_of("mesh casts", kind)
    A = {
        "Box": collide.Box((0.3, 0.2, 0.4)), "Sphere": collide.Sphere(0.2), "Capsule": collide.Capsule(0.1, 0.5),
        "Cylinder": collide.Cylinder(0.2, 0.3), "ConvexHull": collide.ConvexHull(0.3 * rng.normal(size=(8, 3))),
        "Mesh": collide.Mesh(*box((-0.2, -0.1, -0.3), (0.1, 0.2, 0.2))),
    }[kind]
    mesh = collide.Mesh(*bumpy_sphere(60 if kind == "Mesh" else 160))
    X, Y = (np.array([random_pose(rng, s) for _ in range(10)]) for s in (3.0, 0.2))
    d = Y[:, :3, 3] - X[:, :3, 3] + 0.7 * rng.normal(size=(10, 3))
    r = collide.shape_cast(A, X, d, mesh, Y)
    movers = [A] if kind != "Mesh" else facet_hulls(A)
    t = np.array([collide.shape_cast(a, X, d, facet, Y).distance for a in movers for facet in facet_hulls(mesh)])
    ahead = ~r.at_start
    assert (r.hit == np.isfinite(t.min(axis=0)))[ahead].all() and 0.3 < r.hit.mean() and ahead.sum() > 5
    np.testing.assert_allclose(r.distance[ahead & r.hit], t.min(axis=0)[ahead & r.hit], rtol=0, atol=1e-9)
    met = ahead & r.hit
    assert (r.lower <= r.distance)[met].all() and (r.distance <= r.upper)[met].all() and r.certified[met].mean() > 0.8
    # and turned round: the mesh moves
    s = collide.shape_cast(mesh, Y, -d, A, X)
    assert (s.hit == r.hit).all()
    np.testing.assert_allclose(s.distance[met], r.distance[met], rtol=0, atol=1e-9)
    np.testing.assert_allclose(s.normal[met], -r.normal[met], rtol=0, atol=1e-6)
    np.testing.assert_allclose((s.point - s.distance[:, None] * -d)[met], r.point[met], rtol=0, atol=1e-6)


def test_boxes_of_facets_are_boxes():
    """Head on, along edges, grazing by an ulp: a box of facets is met where the box is, exactly."""
    A, B = collide.Box((1, 1, 1)), collide.Box((2, 2, 2))
    mesh = collide.Mesh(*box())
    ulp = np.nextafter(1.5, 2)
    for y, z in ((0, 0), (1.5, 0), (ulp, 0), (1.5, 1.5), (1.5, ulp), (0.3, -0.2), (np.nextafter(1.5, 1), 0)):
        X = collide.pose((-5, y, z))
        one, other, third = (
            collide.shape_cast(a, X, (2, 0, 0), b, EYE)
            for a, b in ((A, B), (A, mesh), (collide.Mesh(*box((-0.5,) * 3, (0.5,) * 3)), mesh))
        )
        assert one.hit == other.hit == third.hit == (max(y, z) <= 1.5)
        assert one.certified and other.certified and third.certified
        if one.hit:
            assert one.lower <= 1.75 <= one.upper and other.lower <= 1.75 <= other.upper
    resting = collide.shape_cast(A, collide.pose((0, 0, 1.5)), (1, 0, 0), mesh, EYE)
    assert resting.hit and resting.at_start and resting.distance == 0.0


def test_through_the_hole():
    """A ring is no hull: what fits goes through, and what is wholly within its body touches at the start."""
    ring = collide.Mesh(*block_ring())
    small, large = collide.Box((0.9, 0.9, 0.3)), collide.Box((1.1, 0.9, 0.3))
    above = collide.pose((0, 0, 5))
    assert not collide.shape_cast(small, above, (0, 0, -1), ring, EYE).hit
    caught = collide.shape_cast(large, above, (0, 0, -1), ring, EYE)
    assert caught.hit and abs(caught.distance - (5 - 0.5 - 0.15)) < 1e-12
    within = collide.shape_cast(collide.Sphere(0.1), collide.pose((1, 0, 0)), (0, 0, 1), ring, EYE)
    assert within.hit and within.at_start and within.distance == 0.0
    up = collide.shape_cast(collide.Sphere(0.1), EYE, (1, 0, 0), ring, EYE)
    assert up.hit and abs(up.distance - 0.4) < 1e-12


def test_compounds_with_meshes():
    ring = collide.Mesh(*block_ring())
    ball = collide.Sphere(0.4)
    A = collide.Compound([(ball, EYE), (collide.Box((0.2, 0.2, 0.2)), collide.pose((3, 0, 0)))])
    B = collide.Compound([(ring, collide.pose((0, 0, -2))), (ball, collide.pose((0, 0, -4)))])
    r = collide.shape_cast(A, collide.pose((0, 0, 3)), (0, 0, -1), B, EYE)
    assert r.hit and abs(r.distance - 6.2) < 1e-9 and (r.item_a, r.item_b) == (0, 1)
    s = collide.shape_cast(A, collide.pose((-2, 0, 3)), (0, 0, -1), B, EYE)
    assert s.hit and (s.item_a, s.item_b) == (1, 0) and abs(s.distance - (3 - 0.1 + 1.5)) < 1e-9
    X = np.array([collide.pose((0, 0, 3))] * 3)
    both = collide.shape_cast([A, ball, ball], X, (0, 0, -1), [B, ring, ball], EYE)
    assert both.hit.tolist() == [True, False, True] and abs(both.distance[0] - 6.2) < 1e-9


def test_onto_a_plane():
    rng = rng_of("meshes onto planes")
    mesh = collide.Mesh(*bumpy_sphere(60))
    X = np.array([random_pose(rng, 1.0) for _ in range(6)])
    X[:, 2, 3] += 5.0
    r = collide.shape_cast(mesh, X, (0.3, 0, -1), collide.Halfspace((0, 0, 1), 0.0), EYE)
    lowest = (mesh.vertices @ X[:, 2, :3].T + X[:, 2, 3]).min(axis=0)
    assert r.hit.all() and r.certified.all()
    np.testing.assert_allclose(r.distance, lowest, rtol=1e-12)
    assert not collide.shape_cast(mesh, X, (1, 0, 0), collide.Halfspace((0, 0, 1), 0.0), EYE).hit.any()
