"""`contains` of unions on their surfaces: decided, never refused, and as exact fractions say.

Points are put exactly on parts' surfaces where poses allow it (quarter turns, shifts that are sums of powers of two),
and as near as rounding gets elsewhere, so that nested poses leave the engine's own proof open.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import surfaces
from naive import random_pose

from collide import (
    Box,
    Capsule,
    Compound,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    HPolytope,
    Mesh,
    Sphere,
    contains,
    pose,
)
from collide.surface_queries.inside_by_definition import _seen_from, _winds_around, holds

EYE = np.eye(4)
CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
#: Each shape with a point on its surface, and a factor beyond which a point is outside.
SHAPES = {
    "sphere": (Sphere(0.5), (0.3, 0.4, 0.0)), "box": (Box(1, 2, 3), (0.5, 0.25, 0.125)),
    "capsule": (Capsule(0.5, 1.0), (0.3, 0.4, 0.25)), "cylinder": (Cylinder(0.5, 1.0), (0.3, 0.4, 0.25)),
    "cone": (Cone(1.0, 2.0), (0.3, 0.4, 0.0)), "ellipsoid": (Ellipsoid(0.5, 0.5, 2.0), (0.3, 0.4, 0.0)),
    "half-space": (Halfspace((0, 0, 1), 0.5), (7.0, 1.0, 0.5)), "hull": (ConvexHull(CUBE), (0.5, 0.25, 0.125)),
    "rounded hull": (ConvexHull(CUBE, radius=0.25), (0.75, 0.25, 0.125)),
    "flat hull": (ConvexHull([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), (0.25, 0.25, 0.0)),
    "segment": (ConvexHull([[0, 0, 0], [1, 0, 0]]), (0.25, 0.0, 0.0)),
    "half-spaces": (HPolytope([*np.eye(3), *-np.eye(3)], np.full(6, 0.5)), (0.5, 0.25, 0.125)),
    "solid mesh": (Mesh(*surfaces.box()), None), "open mesh": (Mesh(surfaces.box()[0], surfaces.box()[1][:-1]), None),
}


def on_surface(name: str) -> np.ndarray:
    shape, point = SHAPES[name]
    if point is None:  # on a facet
        a, b, c = shape.vertices[shape.faces[0]]
        point = 0.5 * a + 0.25 * b + 0.25 * c
    return np.array(point)


@pytest.mark.many(7)
@pytest.mark.parametrize("name", SHAPES)
def test_points_on_the_surface_of_a_part(name):
    """In unions, and unions of unions: the answer is that of exact fractions, and points moved well in or out
    follow."""
    shape, (rng, point) = SHAPES[name][0], (np.random.default_rng(sorted(SHAPES).index(name)), on_surface(name))
    inside = asked = 0
    for _ in range(12):
        X, Y, Z = random_pose(rng, 2.0), random_pose(rng, 2.0), random_pose(rng, 2.0)
        far = (Sphere(0.01), pose((50, 50, 50)))
        for union, poses in (
            (Compound([(shape, Y), far]), [X, Y]),
            (Compound([(Compound([(shape, Z)]), Y), far]), [X, Y, Z]),
        ):
            world = point
            for P in reversed(poses):
                world = P[:3, :3] @ world + P[:3, 3]
            for moved in (world, np.nextafter(world, np.inf), np.nextafter(world, -np.inf)):
                told = contains(union, X, moved)
                assert told is holds(shape, poses, moved), (name, moved.tolist())
                assert told is contains(union, np.array([X, X]), moved)[1].item()
                inside, asked = inside + told, asked + 1
    assert asked == 72 and (name in ("flat hull", "segment", "open mesh") or 5 < inside < 67), inside


@pytest.mark.parametrize("name", SHAPES)
def test_exactly_on_the_surface(name):
    """Quarter turns and short numbers: nothing is rounded, and what is on the surface belongs."""
    shape, point = SHAPES[name][0], on_surface(name)
    if name in ("sphere", "capsule", "cylinder", "cone", "ellipsoid"):
        point = point * 0 + {"cone": (0.5, 0, 0)}.get(name, (0.5, 0, 0))
    Y, Z = (
        pose((1, 2, 0.25), R=[[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
        pose((0.5, 0, 8), R=[[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    )
    union = Compound([(Compound([(shape, Z), (Sphere(0.01), pose((99, 0, 0)))]), Y)])
    world = Y[:3, :3] @ (Z[:3, :3] @ point + Z[:3, 3]) + Y[:3, 3]
    assert contains(union, EYE, world) is True
    assert holds(shape, [Y, Z], world) is True


def test_between_two_parts():
    """On the common face of two boxes: in the union, from whichever side."""
    union = Compound([(Box(1, 1, 1), pose((-0.5, 0, 0))), (Cylinder(0.5, 1), pose((0.5, 0, 0)))])
    points = np.array([[0, y, z] for y in (-0.25, 0, 0.25) for z in (-0.5, 0, 0.5)])
    assert contains(union, EYE, points).all()
    assert not contains(union, EYE, points + np.array([0, 0, 1.5])).any()


def test_winding_by_fractions_is_that_of_the_engine():
    rng = np.random.default_rng(9)
    for vertices, faces in (surfaces.torus(), surfaces.ball()):
        mesh = Mesh(vertices, faces)
        size = np.abs(vertices).max()
        points = rng.uniform(-size, size, (60, 3))
        expected = contains(mesh, EYE, points)
        found = [_winds_around(vertices[faces], tuple(map(Fraction, p.tolist()))) for p in points]
        assert found == expected.tolist() and 3 < expected.sum() < 57
    assert _seen_from((Fraction(1), Fraction(2), Fraction(3)), [pose((1, 2, 3))]) == (0, 0, 0)
