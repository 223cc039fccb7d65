"""One contact of a mesh through the doors of coal and python-fcl: that of facets that decide, each by itself."""

from __future__ import annotations

import numpy as np
import pytest
from curved_oracle import bracket
from samples import sizes
from unit_cube import CORNERS, FACETS

import collide
from collide.adapters.hosts import coal_api, fcl_api

BALL = collide.tessellate(collide.Sphere(0.5), tolerance=4e-3)
#: Two cubes of 0.2 m, two metres apart: the second one alone is in the solid.
TWO_CUBES = np.concatenate([CORNERS * 0.2, CORNERS * 0.2 + (2.0, 0.0, 0.0)]), np.concatenate([FACETS, FACETS + 8])


def coal_mesh(vertices, facets):
    model = coal_api.BVHModelOBBRSS()
    model.beginModel(len(facets), len(vertices))
    model.addVertices(np.asarray(vertices))
    model.addTriangles(np.asarray(facets))
    model.endModel()
    return model


def fcl_mesh(vertices, facets):
    model = fcl_api.BVHModel()
    model.beginModel(len(facets), len(vertices))
    model.addSubModel(np.asarray(vertices), np.asarray(facets))
    model.endModel()
    return model


def coal_contact(g1, X1, g2, X2):
    """(b1, b2, normal, signed distance, pos), and what `distance` says of the same: least distance, b1, b2."""
    T1, T2 = coal_api.Transform3s(X1), coal_api.Transform3s(X2)
    result, gap = coal_api.CollisionResult(), coal_api.DistanceResult()
    coal_api.distance(g1, T1, g2, T2, coal_api.DistanceRequest(), gap)
    if not coal_api.collide(g1, T1, g2, T2, coal_api.CollisionRequest(), result):
        return None
    c = result.getContact(0)
    np.testing.assert_allclose(c.pos, 0.5 * (c.nearest_points[0] + c.nearest_points[1]), atol=1e-15)
    np.testing.assert_allclose(
        c.nearest_points[1] - c.nearest_points[0], c.penetration_depth * c.normal, atol=1e-8
    )
    if coal_api.OBJECT_TYPE.OT_GEOM in (g1.getObjectType(), g2.getObjectType()):
        assert (gap.min_distance, gap.b1, gap.b2) == (c.penetration_depth, c.b1, c.b2)
        assert result.distance_lower_bound <= c.penetration_depth
    return c.b1, c.b2, c.normal, c.penetration_depth, c.pos


def fcl_contact(g1, X1, g2, X2):
    objects = [fcl_api.CollisionObject(g, fcl_api.Transform(X[:3, :3], X[:3, 3])) for g, X in ((g1, X1), (g2, X2))]
    result = fcl_api.CollisionResult()
    if not fcl_api.collide(*objects, fcl_api.CollisionRequest(1, True), result):
        return None
    (c,) = result.contacts
    return c.b1, c.b2, c.normal, -c.penetration_depth, c.pos


HOSTS = {
    "coal": (coal_api, coal_mesh, coal_contact, lambda s: coal_api.Box(*s)),
    "fcl": (fcl_api, fcl_mesh, fcl_contact, lambda s: fcl_api.Box(*s)),
}


def solid_of(module, k: int):
    """A solid of the host's, and its shape here."""
    return [
        (module.Box(0.7, 0.6, 0.5), collide.Box((0.7, 0.6, 0.5))), (module.Sphere(0.35), collide.Sphere(0.35)),
        (module.Capsule(0.2, 0.5), collide.Capsule(0.2, 0.5)), (module.Cylinder(0.3, 0.6), collide.Cylinder(0.3, 0.6)),
    ][k % 4]


@pytest.mark.parametrize("host", HOSTS)
@sizes(60, 1000)
def test_the_contact_is_that_of_the_facet_named(host, n):
    module, mesh_of, contact_of, _ = HOSTS[host]
    rng, mesh, surface, n_hits = np.random.default_rng(21), mesh_of(*BALL), collide.Mesh(*BALL, solid=False), 0
    for k in range(n):
        X, Y = (collide.pose(0.3 * rng.normal(size=3), rpy=rng.uniform(-3, 3, 3)) for _ in "12")
        solid, shape = solid_of(module, k)
        found = contact_of(mesh, X, solid, Y)
        case = f"call {k}: X_WA={X.tolist()}, X_WB={Y.tolist()}, {shape!r}"
        assert (found is not None) == collide.collide(surface, shape, X, Y), case
        if found is None:
            continue
        n_hits += 1
        b1, b2, _, depth, _ = found
        truth = bracket(collide.ConvexHull(surface.vertices[surface.faces[b1]]), shape, X, Y)
        assert b2 == -1 and float(truth.lower) - 1e-9 <= depth <= float(truth.upper) + 1e-9 <= 2e-9, case
    assert 0.5 * n < n_hits < n


@sizes(30, 300)
def test_two_meshes_and_swapped_ones(n):
    rng, n_hits = np.random.default_rng(22), 0
    mesh, cube, box = coal_mesh(*BALL), coal_mesh(CORNERS, FACETS), coal_api.Box(0.7, 0.6, 0.5)
    surface, boundary = collide.Mesh(*BALL, solid=False), collide.Mesh(CORNERS, FACETS, solid=False)
    for k in range(n):
        X, Y = (collide.pose(0.4 * rng.normal(size=3), rpy=rng.uniform(-3, 3, 3)) for _ in "12")
        for g1, g2 in ((mesh, cube), (cube, mesh)):
            found = coal_contact(g1, X, g2, Y)
            if found is not None:
                n_hits += 1
                sides = [surface if g is mesh else boundary for g in (g1, g2)]
                corners = [side.vertices[side.faces[b]] for side, b in zip(sides, found[:2])]
                r = collide.distance(*map(collide.ConvexHull, corners), X, Y)
                assert r.hit and abs(found[3] - r.distance) < 1e-12, f"call {k}: X_WA={X.tolist()}, X_WB={Y.tolist()}"
        there, back = coal_contact(mesh, X, box, Y), coal_contact(box, Y, mesh, X)
        assert (there is None) == (back is None)
        if there is not None:
            assert (there[0], there[3]) == (back[1], back[3])
            np.testing.assert_allclose(there[2], -back[2], atol=1e-12)
    assert n_hits > 0.4 * n


@pytest.mark.parametrize("host", HOSTS)
def test_a_part_that_lies_inside_a_solid_is_found(host):
    """Its facets cross nothing, and none is named by the boolean."""
    _, mesh_of, contact_of, box_of = HOSTS[host]
    b1, b2, _, depth, pos = contact_of(mesh_of(*TWO_CUBES), np.eye(4), box_of((1, 1, 1)), collide.pose((2.0, 0.1, 0.0)))
    assert 12 <= b1 < 24 and b2 == -1 and -0.7 <= depth <= -0.3
    assert np.abs(pos - (2.0, 0.1, 0.0)).max() <= 0.5


def test_swept_balls_add_to_the_depth():
    mesh, box = coal_mesh(*BALL), coal_api.Box(0.7, 0.6, 0.5)
    X = collide.pose((0.45, 0.1, 0.05))
    thin = coal_contact(mesh, np.eye(4), box, X)
    box.setSweptSphereRadius(0.02)
    thick = coal_contact(mesh, np.eye(4), box, X)
    assert thin[:2] == thick[:2] and thick[3] == pytest.approx(thin[3] - 0.02, abs=1e-12)
