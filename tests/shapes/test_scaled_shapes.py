"""Scaled shapes: points belong to the image where their originals belong to the shape; what is no shape is refused."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from mesh_shapes import block_ring
from naive import pose, random_pose, rng_of, rotation
from reproduction import reproducing

import collide
from collide import InvalidShape

EYE = np.eye(4)
#: Nothing is rounded by these: the image holds exactly the images of points.
POWERS = [s * 2.0**k for s in (-1, 1) for k in (-2, -1, 0, 1, 3)]
CUBE_ROWS = np.vstack([np.eye(3), -np.eye(3), [[0.5, 0.25, -1.0]]]), np.array([1, 0.5, 0.75, 0.5, 1, 0.25, 0.75])


def shapes_of(rng) -> dict[str, collide.Shape]:
    """Shapes that take any factors."""
    corners = rng.integers(-8, 9, (12, 3)) / 8.0
    heights = rng.integers(-4, 5, (4, 3)) / 8.0
    turned = np.roll(EYE, 1, axis=0)
    turned[:, 3], turned[3] = (0.25, -0.5, 0.75, 1.0), (0, 0, 0, 1)
    turned[:3, :3] = np.eye(3)[[1, 2, 0]]
    items = [
        (collide.Box((1, 0.5, 0.25)), turned), (collide.ConvexHull(corners), pose(t=(0.5, 0, 0))),
        (collide.Compound([(collide.Box((0.25, 0.75, 0.5)), turned)]), turned),
    ]
    return {
        "Sphere": collide.Sphere(0.75),
        "Box": collide.Box((1, 1.5, 0.25)),
        "flat Box": collide.Box((1, 1.5, 0)),
        "Ellipsoid": collide.Ellipsoid((1, 0.5, 0.75)),
        "Halfspace": collide.Halfspace((0.5, -0.25, 1.0), 0.125),
        "HPolytope": collide.HPolytope(*CUBE_ROWS),
        "region": collide.HPolytope(CUBE_ROWS[0][:4], CUBE_ROWS[1][:4], bounded=False),
        "Plane": collide.Plane((0.5, -0.25, 1.0), 0.125, 0.5),
        "ConvexHull": collide.ConvexHull(corners),
        "Mesh": collide.Mesh(*block_ring()),
        "HeightField": collide.HeightField(heights, 0.5),
        "PointCloud": collide.PointCloud(corners),
        "Compound": collide.Compound(items),
    }


#: Shapes that keep to factors of one magnitude, or of one along x and y; and such factors.
ROUND = {
    "Capsule": (collide.Capsule(0.5, 1.0), (2.0, -2.0, 2.0)),
    "Cylinder": (collide.Cylinder(0.5, 1.0), (-2.0, 2.0, 0.5)),
    "Cone": (collide.Cone(0.5, 1.0), (2.0, 2.0, 4.0)),
    "Cone turned over": (collide.Cone(0.75, 1.0), (2.0, 2.0, -4.0)),
    "swept hull": (collide.ConvexHull([(0, 0, 0), (1, 0, 0), (0, 1, 0.5)], radius=0.25), (-0.5, 0.5, 0.5)),
    "cloud of balls": (collide.PointCloud(np.eye(3), (0.25, 0.5, 0.125)), (-4.0, -4.0, -4.0)),
    "turned items": (
        collide.Compound([(collide.Capsule(0.25, 0.5), pose(rotation(rng_of("turned items")), (0.25, 0.5, 0)))]),
        (2.0, -2.0, 2.0),
    ),
    "items turned in the plane": (
        collide.Compound([(collide.Box((1, 0.5, 1)), collide.pose((0.25, 0, 0), rpy=(0, 0, 0.7)))]),
        (2.0, -2.0, -0.5),
    ),
}


def check_images(name: str, shape: collide.Shape, factors, rng) -> int:
    """How many of some 400 points are in; each is in the image where its original is in the shape."""
    image = shape.scaled(factors)
    points = rng.integers(-6, 7, (400, 3)) / 8.0 + rng.normal(size=(400, 3)) * 0.2 * (rng.random((400, 1)) < 0.5)
    points = np.concatenate([points, getattr(shape, "points", points[:0])])
    with reproducing("shape, factors = collide.{name}, {factors}", name=name, factors=factors):
        inside = collide.contains(shape, EYE, points)
        assert (collide.contains(image, EYE, points * factors) == inside).all(), name
    return int(inside.sum())


@pytest.mark.parametrize("name", shapes_of(rng_of("names")))
def test_the_image_holds_the_images_of_points(name):
    rng, hits = rng_of("scaled", name), 0
    for _ in range(6):
        hits += check_images(name, shapes_of(rng)[name], rng.choice(POWERS, 3), rng)
    assert hits >= (40 if name in ("flat Box", "PointCloud") else 100), hits


@pytest.mark.parametrize("name", ROUND)
def test_what_is_round_stays_round(name):
    shape, factors = ROUND[name]
    rng = rng_of("scaled", name)
    if "turned" not in name:
        assert check_images(name, shape, np.array(factors), rng) >= 5
    image, probe = shape.scaled(factors), collide.Sphere(0.125)
    one, scale = abs(factors[0]), np.array(factors)
    hits = 0
    for _ in range(60):
        p = rng.normal(size=3) * 0.5
        if len(set(np.abs(factors))) == 1:  # similar figures: all lengths by one factor
            r = collide.distance(shape, probe, EYE, pose(t=p))
            s = collide.distance(image, collide.Sphere(0.125 * one), EYE, pose(t=p * scale))
            assert abs(r.distance * one - s.distance) < 1e-9 and r.hit == s.hit, (name, p)
            hits += bool(r.hit)
        elif abs(collide.distance(shape, collide.Sphere(1e-9), EYE, pose(t=p)).distance) > 1e-8:
            inside = collide.contains(shape, EYE, p)
            assert inside == collide.contains(image, EYE, p * scale)
            hits += inside
    assert hits >= 3, hits


def test_kinds_and_numbers():
    assert collide.Sphere(0.5).scaled(-2) == collide.Sphere(1.0)
    assert collide.Sphere(0.5).scaled((2, 4, -2)) == collide.Ellipsoid((1, 2, 1))
    assert collide.Box((1, 2, 3)).scaled((3, -1, 0.5)) == collide.Box((3, 2, 1.5))
    assert collide.Cylinder(1, 2).scaled((-2, 2, -3)) == collide.Cylinder(2, 6)
    assert collide.Halfspace((0, 0.6, 0.8), 0.3).scaled(3) == collide.Halfspace((0, 0.6, 0.8), 0.3 * 3)
    assert collide.Halfspace((0, 0, 1), 0.3).scaled((2, 7, -3)) == collide.Halfspace((0, 0, -7 / 3), 0.3 * 7)
    assert collide.Plane((1, 0, 0), 0.5, 0.25).scaled(2) == collide.Plane((1, 0, 0), 1.0, 0.5)
    hull = collide.ConvexHull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    faced = collide.ConvexHull(hull.points, faces=hull.hull.facets)
    for factors in itertools.product((-3.0, 3.0), (0.1,), (-1.0, 7.0)):
        faced.scaled(factors).validate()
        assert np.array_equal(faced.scaled(factors).points, hull.points * factors)


def test_meshes_stay_what_they_are():
    mesh = collide.Mesh(*block_ring())
    rng, hits = rng_of("scaled meshes"), 0
    for factors in ((-1, 1, 1), (2, 3, -0.7), (-2, -2, -2), (0.3, 0.3, 0.4), (5, 5, 5)):
        image = mesh.scaled(factors)
        assert image.solid and np.array_equal(image.vertices, mesh.vertices * factors)
        assert image.report.volume == pytest.approx(mesh.report.volume * abs(np.prod(factors)), rel=1e-12)
        shares = len(set(factors)) == 1 and factors[0] > 0
        assert (image.base is mesh) == shares and (image.scale == factors[0]) == shares
        origins, goals = rng.normal(size=(60, 3)) * 4.0, rng.normal(size=(60, 3)) * 0.5
        r = collide.raycast(mesh, EYE, origins, goals - origins)
        s = collide.raycast(image, EYE, origins * factors, (goals - origins) * factors)
        assert (r.hit == s.hit).all() and (r.facet == s.facet).all()
        assert np.allclose(r.distance[r.hit], s.distance[r.hit], rtol=1e-9)
        hits += int(r.hit.sum())
    assert hits >= 100, hits
    surface = collide.Mesh(mesh.vertices, mesh.faces, solid=False)
    assert not surface.scaled((1, -1, 2)).solid and mesh.scaled(2).scaled((1, -1, 1)).report.volume > 0.0
    assert mesh.scaled((1, 1, 1)) is mesh and mesh.scaled(2).scaled((0.5, 0.5, 0.5)) is mesh


def test_poses_of_items_stay_rotations():
    rng = rng_of("scaled items")
    inner = collide.Compound([(collide.Sphere(0.5), random_pose(rng)), (collide.Capsule(0.1, 1), random_pose(rng))])
    outer = collide.Compound([(inner, random_pose(rng)), (collide.Cone(0.5, 1), random_pose(rng))])
    for factors in (3.0, (-3, 3, 3), (3, -3, -3), (-3, -3, -3)):
        image = outer.scaled(factors)
        for (_, X), (_, Y) in zip(outer.items, image.items):
            assert np.array_equal(np.abs(X[:3, :3]), np.abs(Y[:3, :3])) and np.linalg.det(Y[:3, :3]) > 0.0
            assert np.array_equal(Y[:3, 3], X[:3, 3] * factors)


@pytest.mark.parametrize(
    ("shape", "factors", "message"),
    [
        (collide.Box((1, 1, 1)), (1, 0, 1), r"Box\.scaled: factors must not be 0, got \(1, 0, 1\)"),
        (collide.Box((1, 1, 1)), 0, r"Box\.scaled: factors must not be 0, got 0"),
        (collide.Box((1, 1, 1)), (1, 2), r"Box\.scaled: factors must have shape \(3,\), got \(2,\)"),
        (collide.Sphere(1), (1, np.nan, 1), r"Sphere\.scaled: factors\[1\] is nan"),
        (collide.Sphere(1), "2", r"Sphere\.scaled: factors must be real numbers"),
        (collide.Sphere(1e40), 1e40, "Sphere: radius"),
        (collide.ConvexHull(np.eye(3) * 1e40), 1e40, "ConvexHull: points"),
        (collide.Capsule(1, 1), (1, 1, 2), r"Capsule\.scaled: factors \[1.0, 1.0, 2.0\]: they must be equal"),
        (collide.Cylinder(1, 1), (1, 2, 1), r"Cylinder\.scaled: factors \[1.0, 2.0, 1.0\]: those along x and y"),
        (collide.Cone(1, 1), (1, 2, 1), r"Cone\.scaled: .*ConvexHull or of a Mesh instead"),
        (collide.ConvexHull(np.eye(3), radius=0.1), (1, 2, 1), r"ConvexHull\.scaled: .*ball swept over it"),
        (collide.PointCloud(np.eye(3), 0.1), (1, 2, 1), r"PointCloud\.scaled: .*balls would be no balls"),
        (
            collide.Compound([(collide.Box((1, 1, 1)), collide.pose(rpy=(0, 0, 0.3)))]), (1, 2, 1),
            r"Compound\.scaled: .*: items\[0\] is turned by R\[0, 1\] = -0.29552 .*Scale the points of a",
        ),
        (collide.Mesh(*block_ring()), (1, 0, 1), r"Mesh\.scaled: factors must not be 0"),
        (collide.Mesh(*block_ring()), (1e50, 1, 1), "Mesh: vertices"),
    ],
)
def test_what_is_no_shape_is_refused_with_a_remedy(shape, factors, message):
    with pytest.raises(InvalidShape, match=message):
        shape.scaled(factors)
