"""Points in shapes, decided exactly: against winding numbers in integers for meshes, definitions in fractions
elsewhere."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mesh_families import random_pose, right_angle_pose
from mesh_shapes import block_ring, box, bumpy_sphere
from naive_triangles import as_integers, triangles_meet, winding, world_points

import collide
from collide.errors import InvalidArgument
from collide.surface_queries.contains import winds_around


def in_solid(vertices, faces, X, point) -> bool:
    """By winding in integers; points on facets, thin ones too, count."""
    placed, at = as_integers(world_points(vertices, X), world_points(np.array([point]), np.eye(4)))
    corners = [[placed[v] for v in face] for face in faces.tolist()]
    if any(triangles_meet(T, [at[0]] * 3) for T in corners):
        return True
    return (winding(corners, at[0]) or 0) >= 1


def some_points(rng, vertices, faces, X, n):
    """At random, on corners, edges and facets, and an ulp off."""
    corners = vertices[faces] @ X[:3, :3].T + X[:3, 3]
    points = [rng.uniform(corners.min(axis=(0, 1)), corners.max(axis=(0, 1))) for _ in range(n)]
    for _ in range(n):
        a, b, c = corners[rng.integers(len(corners))]
        aim = [a, (a + b) / 2, a / 2 + b / 4 + c / 4][rng.integers(3)]
        points.append(aim * (1.0 + rng.choice([0.0, 0.0, 2.0**-52, -(2.0**-52)])))
    return np.array(points)


def test_solids_by_winding():
    rng = np.random.default_rng(21)
    inside = total = 0
    nested = [box(), box((-0.5,) * 3, (0.5,) * 3)]
    hollow = np.concatenate([v for v, _ in nested]), np.concatenate([nested[0][1], nested[1][1][:, ::-1] + 8])
    twice = np.concatenate([box()[0], box()[0] + [0.5, 0.25, 0.75]]), np.concatenate([box()[1], box()[1] + 8])
    for vertices, faces in (box(), block_ring(), hollow, twice, bumpy_sphere(60)):
        mesh = collide.Mesh(vertices, faces, solid=True)
        for X in (np.eye(4), right_angle_pose(rng), random_pose(rng)):
            points = some_points(rng, vertices, faces, X, 12)
            got = collide.contains(mesh, X, points)
            for k, point in enumerate(points):
                want = in_solid(vertices, faces, X, point)
                assert got[k] == want == collide.contains(mesh, X, point), (
                    vertices.tolist(),
                    faces.tolist(),
                    X.tolist(),
                    point.tolist(),
                )
                if collide.contains(collide.Mesh(vertices, faces, solid=False), X, point):
                    assert want
                else:
                    assert winds_around(mesh, X, point) == want
                inside += want
                total += 1
    assert 0.3 < inside / total < 0.8


def test_surfaces_and_facets_without_area():
    """A surface holds its facets only; a spike without area belongs to the solid it sticks out of."""
    vertices, faces = box()
    surface = collide.Mesh(vertices, faces, solid=False)
    points = [(0, 0, 0), (1, 0.3, 0.2), (1, 1, 1), (np.nextafter(1, 2), 0, 0)]
    assert collide.contains(surface, np.eye(4), points).tolist() == [False, True, True, False]
    spiked = collide.Mesh(np.concatenate([vertices, [[3.0, 1, 1]]]), np.concatenate([faces, [[7, 8, 7]]]))
    assert spiked.solid
    got = collide.contains(spiked, np.eye(4), [(2, 1, 1), (3, 1, 1), (3.5, 1, 1), (2, 1 + 2**-52, 1), (0, 0, 0)])
    assert got.tolist() == [True, True, False, False, True]


CURVED = {
    "sphere": (collide.Sphere(1.25), lambda x, y, z: x * x + y * y + z * z <= Fraction(25, 16)),
    "cylinder": (collide.Cylinder(1.25, 2.0), lambda x, y, z: x * x + y * y <= Fraction(25, 16) and abs(z) <= 1),
    "cone": (collide.Cone(1.0, 2.0), lambda x, y, z: abs(z) <= 1 and x * x + y * y <= ((1 - z) / 2) ** 2),
    "ellipsoid": (collide.Ellipsoid((0.5, 1, 2)), lambda x, y, z: 4 * x * x + y * y + z * z / 4 <= 1),
    "box": (collide.Box((1, 2, 3)), lambda x, y, z: 2 * abs(x) <= 1 and abs(y) <= 1 and 2 * abs(z) <= 3),
    "capsule": (
        collide.Capsule(1.25, 2.0), lambda x, y, z: x * x + y * y + max(abs(z) - 1, 0) ** 2 <= Fraction(25, 16),
    ),
    "corridor": (
        collide.HPolytope([[3, 1, 0], [-3, 0, 1], [0, 7, 1], [0, -1, 0], [1, 0, 3], [0, 0, -1]], [1, 1, 1, 1, 1, 1]),
        lambda x, y, z: 3 * x + y <= 1 and z - 3 * x <= 1 and 7 * y + z <= 1 and -y <= 1 and x + 3 * z <= 1 and -z <= 1,
    ),
}


@pytest.mark.parametrize("name", CURVED)
def test_other_shapes_by_their_definition(name):
    shape, holds = CURVED[name]
    rng = np.random.default_rng(list(CURVED).index(name))
    points = rng.uniform(-1.3, 1.3, (60, 3))
    # On and next to the surface: Pythagoras, and points pulled onto it.
    exact = np.array(
        [
            [0.75, 1, 0],
            [1, 0.75, 0.5],
            [1.25, 0, 0],
            [0, 0, 1.25],
            [0.5, 0, 0],
            [0, 0, 2],
            [0.25, 0.5, 0.5],
            [0, 0, 1],
            [0.3, 0.4, 0],
        ]
    )
    points = np.concatenate([points, exact, exact * (1 + 2.0**-52), exact * (1 - 2.0**-52), -exact])
    got = collide.contains(shape, np.eye(4), points)
    want = [holds(*[Fraction(v) for v in p]) for p in points.tolist()]
    assert got.tolist() == want, [p.tolist() for p, g, w in zip(points, got, want) if g != w]
    assert 0.04 < np.mean(want) < 0.96
    X = collide.pose((3, 1, -2), R=[[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    grid = np.round(points * 64) / 64
    moved = np.stack([3 - grid[:, 1], 1 + grid[:, 0], grid[:, 2] - 2], axis=1)
    assert collide.contains(shape, X, moved).tolist() == [holds(*[Fraction(v) for v in p]) for p in grid.tolist()]


def test_unions_and_batches():
    union = collide.Compound([(collide.Cylinder(1.25, 2.0), np.eye(4)), (collide.Sphere(1.0), collide.pose((0, 0, 1)))])
    points = np.array([(0.75, 1, 0), (0.75, 1, 1.01), (0, 0, 2), (0, 0, np.nextafter(2, 3)), (0, 1, 1)])
    assert collide.contains(union, np.eye(4), points).tolist() == [True, False, True, False, True]
    rng = np.random.default_rng(2)
    poses = np.array([random_pose(rng) for _ in range(30)])
    mesh = collide.Mesh(*block_ring())
    together = collide.contains(mesh, poses, points[0])
    assert 0 < together.sum() < 30
    assert [collide.contains(mesh, X, points[0]) for X in poses] == together.tolist()
    assert collide.contains(mesh, np.eye(4), np.zeros((0, 3))).shape == (0,)


def test_what_is_refused():
    mesh = collide.Mesh(*box())
    for points, words in (
        ((0, np.nan, 0), "not finite"),
        ((1e51, 0, 0), "exceeds"),
        ((0, 0), r"\(3,\)"),
        (["x"] * 3, "numbers"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            collide.contains(mesh, np.eye(4), points)
    with pytest.raises(InvalidArgument, match="must be a shape"):
        collide.contains(None, np.eye(4), (0, 0, 0))
    with pytest.raises(InvalidArgument, match="lengths do not match"):
        collide.contains(mesh, np.tile(np.eye(4), (2, 1, 1)), np.zeros((3, 3)))


def test_meshes_in_a_compound():
    two = collide.Compound([(collide.Mesh(*box()), np.eye(4)), (collide.Sphere(0.5), collide.pose((3, 0, 0)))])
    points = [(0, 0, 0), (1, 1, 1), (1, 1, 1 + 1e-15), (3, 0.5, 0), (2.4, 0, 0)]
    edge = np.abs(box()[0]).max()
    points[1:3] = [(edge, edge, edge), (edge, edge, edge * (1 + 1e-15))]
    assert collide.contains(two, np.eye(4), points).tolist() == [True, True, False, True, False]
