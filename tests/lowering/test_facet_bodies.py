"""Shapes as facets: what body each has, what holds it, and what has none is refused by name."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from mesh_shapes import block_ring, box
from naive import one_of_each, rng_of

import collide
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.lowering import facet_bodies as F
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import Kind
from collide.lowering.parts import convex_set_of

SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
HULLS = {
    "point": [(1, 2, 3)], "segment": [(0, 0, 0), (0, 0, 2), (0, 0, 1)], "flat": [*SQUARE, (0.5, 0.5, 0)],
    "solid": [*SQUARE, (0.5, 0.5, 1), (0.5, 0.5, 0.25)],
}


def triangles(body: F.Body) -> np.ndarray:
    return body.tree.triangles.reshape(-1, 3, 3)


@pytest.mark.parametrize("radius", [0.0, 0.25])
@pytest.mark.parametrize(("name", "n_facets"), [("point", 1), ("segment", 1), ("flat", 2), ("solid", 6)])
def test_hulls_have_the_facets_of_their_dimension(name, n_facets, radius):
    shape = collide.ConvexHull(HULLS[name], radius=radius)
    body = F.body_of(shape)
    assert F.body_of(shape) is body and body.shape is shape and F.hull_of(body) is shape
    assert len(triangles(body)) == n_facets and body.solid == (name == "solid") and body.radius == radius
    used = {tuple(p) for p in triangles(body).reshape(-1, 3).tolist()}
    assert used <= {tuple(map(float, p)) for p in HULLS[name]}
    if name == "segment":
        assert used == {(0.0, 0.0, 0.0), (0.0, 0.0, 2.0)}
    if name == "flat":
        assert np.linalg.norm(np.cross(*np.diff(triangles(body), axis=1).transpose(1, 0, 2)), axis=1).sum() == 2.0
    if name == "solid":
        a, b, c = triangles(body).transpose(1, 0, 2)
        assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(1 / 3)  # outward, closed
    assert len(body.points) == 1 and tuple(body.points[0].tolist()) in used


@pytest.mark.parametrize("kind", ["Sphere", "Capsule", "Box", "ConvexHull", "Mesh"])
def test_balls_hold_the_facets(kind):
    rng = rng_of("facet bodies", kind)
    shape = one_of_each(rng)[kind] if kind != "Mesh" else collide.Mesh(*block_ring())
    body = F.body_of(shape)
    points = triangles(body).reshape(-1, 3)
    away = np.linalg.norm(points - body.centre, axis=1)
    assert away.max() <= body.reach <= away.max() * (1 + 1e-9) + 1e-12
    own = convex_set_of(shape).points if kind != "Mesh" else shape.vertices
    assert np.linalg.norm(own, axis=1).max() + body.radius <= F.reach_of(body)
    assert F.reach_of(body) <= 2.0 * np.linalg.norm(np.abs(own).max(axis=0)) + body.radius + 1e-12
    assert body.key == (body.tree.content, body.radius, body.solid)


def test_meshes_have_a_point_of_every_part():
    a, b = box((-1, -1, -1), (1, 1, 1)), box((3, 0, 0), (4, 1, 1))
    vertices = np.vstack([a[0], b[0], [(9, 9, 9), (9, 9, 8)]])
    n = len(a[0])
    lonely = [[n + len(b[0]), n + len(b[0]) + 1, n + len(b[0])]]  # collapsed, of corners of its own
    mesh = collide.Mesh(vertices, np.vstack([a[1], np.asarray(b[1]) + n, lonely]))
    points = F.body_of(mesh).points
    assert sum((np.abs(p) <= 1).all() for p in points) == 1
    assert sum((p >= (3, 0, 0)).all() and (p <= (4, 1, 1)).all() for p in points) == 1
    assert any((p >= 8).all() for p in points)
    attached = collide.Mesh(a[0], np.vstack([a[1], [[0, 1, 0]]]))  # its corners are used by others
    assert len(F.body_of(attached).points) == 1


def test_hulls_of_meshes_stand_for_them():
    mesh = collide.Mesh(*block_ring())
    hull = F.hull_of(F.body_of(mesh))
    assert isinstance(hull, collide.ConvexHull) and hull is mesh.convex_hull
    np.testing.assert_allclose(np.abs(hull.points).max(axis=0), np.abs(mesh.vertices).max(axis=0))


def test_bodies_do_not_keep_their_shapes():
    shape = collide.Box((1, 1, 1))
    body = F.body_of(shape)
    del shape
    gc.collect()
    assert body.shape is None


@pytest.mark.parametrize("kind", [*one_of_each(rng_of("kinds")), "Mesh", "Region"])
def test_what_has_facets(kind):
    rng = rng_of("has facets", kind)
    each = one_of_each(rng)
    each["Mesh"], each["Region"] = collide.Mesh(*box()), collide.HPolytope([(0, 0, 1)], [0.0], bounded=False)
    shape = each[kind]
    expected = kind in ("Sphere", "Box", "Capsule", "ConvexHull", "Mesh")
    assert F.has_facets(shape) == expected and F.is_halfspace(shape) == (kind == "Halfspace")
    if kind in ("Box", "Mesh"):
        assert F.facet_body(shape, "f") is F.body_of(shape)
        return
    words = {
        "Halfspace": "Halfspace has no facets; a large Box", "Compound": "Compound is a union; ask for each",
        "Sphere": "Sphere is rounded", "Capsule": "Capsule is rounded", "ConvexHull": "ConvexHull is rounded",
        "Region": "HPolytope has no facets of doubles",
    }.get(kind, f"{kind} has no facets of doubles")
    with pytest.raises(UnsupportedQuery, match=f"locality: {words}"):
        F.facet_body(shape, "locality")
    with pytest.raises(InvalidArgument, match="locality must be a shape"):
        F.facet_body("box", "locality")


def test_kinds_of_all_shapes():
    """Points swept by a ball are told apart by their number, whatever class they come from."""
    rng = rng_of("kinds of shapes")
    each, X = one_of_each(rng), np.eye(4)
    mesh = collide.Mesh(*box())
    table = [
        (each["Sphere"], Kind.SPHERE), (collide.ConvexHull([(1, 2, 3)], radius=0.5), Kind.SPHERE),
        (collide.ConvexHull([(1, 2, 3)]), Kind.SPHERE), (each["Capsule"], Kind.CAPSULE),
        (collide.Capsule(0.5, 0.0), Kind.SPHERE), (collide.ConvexHull([(0, 0, 0), (1, 0, 0)]), Kind.CAPSULE),
        (each["Box"], Kind.POLYTOPE), (each["ConvexHull"], Kind.POLYTOPE), (each["HPolytope"], Kind.ROUNDED),
        (each["Cylinder"], Kind.CYLINDER), (each["Cone"], Kind.CONE), (each["Ellipsoid"], Kind.ELLIPSOID),
        (each["Halfspace"], Kind.HALFSPACE), (mesh, Kind.MESH), (each["Compound"], Kind.COMPOUND),
        (collide.Compound([(each["Sphere"], X)]), Kind.COMPOUND), (collide.Compound([(mesh, X)]), Kind.MESH_COMPOUND),
        (collide.Compound([(collide.Compound([(mesh, X)]), X), (each["Box"], X)]), Kind.MESH_COMPOUND),
        (collide.HPolytope([(0, 0, 1)], [0.0], bounded=False), Kind.REGION),
    ]
    for shape, kind in table:
        assert kind_of(shape) is kind, shape


def test_poses_with_slop_are_picked_together():
    poses = F.as_given(np.arange(48.0).reshape(3, 4, 4))
    assert poses.slop.tolist() == [0.0] * 3
    poses = poses._replace(slop=np.array([0.0, 1.0, 2.0]))
    for some in (np.array([2, 0]), np.array([True, False, True])):
        picked = poses.of(some)
        assert np.array_equal(picked.X, poses.X[some]) and np.array_equal(picked.slop, poses.slop[some])
