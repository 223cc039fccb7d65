"""`collide.tessellate`: closed, outward, within the tolerance said, for every shape."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

import collide
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
    InvalidArgument,
    Mesh,
    Sphere,
    UnsupportedQuery,
    pose,
)

RNG = np.random.default_rng(11)
CLOUD = RNG.normal(size=(40, 3))
#: name: (shape, exact volume or None)
CONVEX = {
    "box": (Box((0.3, 1, 2)), 0.6),
    "sphere": (Sphere(0.7), 4 / 3 * math.pi * 0.7**3),
    "capsule": (Capsule(0.2, 1.5), math.pi * 0.2**2 * 1.5 + 4 / 3 * math.pi * 0.2**3),
    "short capsule": (Capsule(0.2, 0.0), 4 / 3 * math.pi * 0.2**3),
    "cylinder": (Cylinder(0.4, 3), math.pi * 0.4**2 * 3),
    "cone": (Cone(0.4, 3), math.pi * 0.4**2),
    "ellipsoid": (Ellipsoid((0.1, 0.5, 2)), 4 / 3 * math.pi * 0.1),
    "hull": (ConvexHull(CLOUD), None),
    "swept hull": (ConvexHull(CLOUD, radius=0.3), None),
    "swept box": (ConvexHull(np.indices((2, 2, 2)).reshape(3, 8).T, radius=0.25),
                  1 + 6 * 0.25 + 12 * math.pi / 4 * 0.25**2 + 4 / 3 * math.pi * 0.25**3),
    "swept triangle": (ConvexHull([(0, 0, 0), (1, 0, 0), (0, 1, 0)], radius=0.1), None),
    "swept needle": (ConvexHull([(0, 0, 0), (1e-3, 0, 0), (100, 1, 1)], radius=0.01), None),
    "polytope": (HPolytope(np.vstack([np.eye(3), -np.eye(3)]), [1, 2, 3, 1, 2, 3]), 48.0),
}


def support(shape, u: np.ndarray) -> np.ndarray:
    """Support function of a shape in directions (n, 3), written apart from the code under test."""
    if isinstance(shape, Sphere):
        return np.full(len(u), shape.radius)
    if isinstance(shape, Capsule):
        return shape.radius + abs(u[:, 2]) * shape.length / 2
    if isinstance(shape, Box):
        return abs(u) @ shape.size / 2
    across = np.hypot(u[:, 0], u[:, 1])
    if isinstance(shape, Cylinder):
        return across * shape.radius + abs(u[:, 2]) * shape.length / 2
    if isinstance(shape, Cone):
        return np.maximum(u[:, 2] * shape.length / 2, across * shape.radius - u[:, 2] * shape.length / 2)
    if isinstance(shape, Ellipsoid):
        return np.linalg.norm(u * shape.radii, axis=1)
    points, radius = (shape.points, shape.radius) if isinstance(shape, ConvexHull) else (shape.vertices, 0.0)
    return (u @ points.T).max(axis=1) + radius


def edges_of(faces) -> dict[tuple[int, int], int]:
    runs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    pairs, counts = np.unique(runs, axis=0, return_counts=True)
    return {tuple(pair): int(n) for pair, n in zip(pairs.tolist(), counts)}


def assert_closed(vertices, faces):
    """Every edge is run along once each way, every vertex is used, and V − E + F = 2."""
    edges = edges_of(faces)
    assert set(edges.values()) == {1} and all((b, a) in edges for a, b in edges)
    assert len(np.unique(faces)) == len(vertices)
    assert len(vertices) - len(edges) // 2 + len(faces) == 2


def volume(vertices, faces) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@pytest.mark.many(2)
@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.parametrize("tolerance", [None, 0.02, 0.001])
def test_convex_shapes_are_closed_and_as_near_as_they_say(name, tolerance):
    shape, _ = CONVEX[name]
    found = collide.tessellate(shape, tolerance=tolerance)
    vertices, faces = found
    assert vertices.dtype == np.float64 and faces.dtype == np.int64 and faces.shape[1] == 3
    assert_closed(vertices, faces)
    assert volume(vertices, faces) > 0
    limit = found.deviation
    largest = max(getattr(shape, "radius", 0.0), max(getattr(shape, "radii", [0.0])))
    assert limit <= (0.01 * largest if tolerance is None else tolerance)
    u = np.random.default_rng(2).normal(size=(4000, 3))
    u /= np.linalg.norm(u, axis=1)[:, None]
    short = support(shape, u) - (u @ vertices.T).max(axis=1)
    rounding = 1e-14 * abs(vertices).max()
    assert short.min() > -rounding, "a vertex lies outside the shape"
    assert short.max() <= limit + rounding, (short.max(), limit)


@pytest.mark.parametrize("name", [name for name, (_, exact) in CONVEX.items() if exact is not None])
def test_volumes_converge_from_below(name):
    shape, exact = CONVEX[name]
    errors = [exact - volume(*collide.tessellate(shape, tolerance=t)) for t in (0.01, 0.0025, 0.000625)]
    if isinstance(shape, (Box, HPolytope)):
        assert np.allclose(errors, 0, atol=1e-13)
    else:
        # every factor of four in the tolerance is one in the error, cut into whole facets
        assert errors[0] > 1.5 * errors[1] > 2.25 * errors[2] > 0
        assert errors[2] < 0.03 * exact


def test_few_vertices_where_little_is_asked():
    """Swept hulls keep the corners that matter: a tessellation must not grow with the points times the directions."""
    assert len(collide.tessellate(Sphere(1.0)).vertices) <= 642
    swept = ConvexHull(np.random.default_rng(0).normal(size=(3000, 3)), radius=0.2)
    assert len(collide.tessellate(swept).vertices) < 20 * len(swept.hull.vertices)


def test_meshes_come_as_they_are():
    corners, sides = (
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [9, 9, 9]],
        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    )
    mesh = Mesh(corners, sides)
    found = collide.tessellate(mesh)
    assert np.array_equal(found.vertices, corners) and np.array_equal(found.faces, sides) and found.deviation == 0.0


def test_compounds_are_their_parts_where_they_stand():
    compound = Compound(
        [(Box((1, 1, 1)), pose((5, 0, 0))), (Compound([(Sphere(0.5), pose((0, 3, 0)))]), pose((0, 0, 1)))]
    )
    vertices, faces = collide.tessellate(compound)
    parts = [collide.tessellate(Box((1, 1, 1))), collide.tessellate(Sphere(0.5))]
    assert volume(vertices, faces) == pytest.approx(sum(volume(*part) for part in parts))
    assert np.allclose(vertices[8:].mean(axis=0), (0, 3, 1)) and np.allclose(vertices[:8].mean(axis=0), (5, 0, 0))
    assert collide.tessellate(compound).deviation == parts[1].deviation > 0


def test_flat_hulls_show_both_sides_and_thin_ones_nothing():
    square = collide.tessellate(ConvexHull([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]))
    edges = edges_of(square.faces)
    assert all((b, a) in edges for a, b in edges) and volume(*square) == 0.0 and len(square.faces) == 4
    for points in ([(0, 0, 0), (1, 1, 1)], [(2, 2, 2)]):
        found = collide.tessellate(ConvexHull(points))
        assert found.faces.shape == (0, 3) and len(found.vertices) == len(points)


def test_halfspaces_need_a_size():
    floor = Halfspace((0, 0, 2), 1.0)
    with pytest.raises(UnsupportedQuery, match="size"):
        collide.tessellate(floor)
    vertices, faces = collide.tessellate(floor, size=4.0)
    assert np.allclose(vertices[:, 2], 0.5) and np.allclose(np.ptp(vertices[:, :2], axis=0), 4.0)
    a, b, c = vertices[faces[0]]
    assert np.cross(b - a, c - a)[2] > 0
    assert len(collide.tessellate(Compound([(floor, pose())]), size=1.0).faces) == 2


@pytest.mark.parametrize(
    "arguments",
    [
        {"tolerance": 0.0},
        {"tolerance": -1},
        {"tolerance": math.nan},
        {"size": math.inf},
        {"tolerance": "fine"},
        {"tolerance": True},
    ],
)
def test_what_is_no_length_is_refused_by_name(arguments):
    with pytest.raises(InvalidArgument, match=next(iter(arguments))):
        collide.tessellate(Sphere(1.0), **arguments)


@pytest.mark.parametrize("shape", [Sphere(1e6), Cylinder(1e10, 1), Cone(1e10, 1), Ellipsoid((1, 1, 1e6))])
def test_too_many_vertices_are_refused_before_they_are_made(shape):
    with pytest.raises(InvalidArgument, match="larger one"):
        collide.tessellate(shape, tolerance=1e-6)


def test_what_is_no_shape_is_refused():
    with pytest.raises(InvalidArgument, match="must be a shape"):
        collide.tessellate([(0, 0, 0)])


def test_scale_and_pickling():
    small, large = (collide.tessellate(Capsule(r, 3 * r), tolerance=0.01 * r) for r in (2.0**-20, 2.0**20))
    assert np.array_equal(small.vertices * 2.0**40, large.vertices) and np.array_equal(small.faces, large.faces)
    again = pickle.loads(pickle.dumps(small))
    assert np.array_equal(again.vertices, small.vertices) and again.deviation == small.deviation
