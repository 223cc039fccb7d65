"""Points in closed meshes: parity against exact winding by brute force, where segments pass edges and corners too."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mesh_families import RIGHT_ANGLES, random_pose
from mesh_shapes import block_ring, box
from naive_triangles import as_integers, cross, inner, minus, world_points

import collide
from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_queries import points_in_solid


def where(corners, p) -> int:
    """0 outside, 1 on the surface, 2 inside: parity along a direction that meets no edge, in integers."""
    for a, b, c in corners:
        n = cross(minus(b, a), minus(c, a))
        if inner(n, minus(p, a)) == 0:
            sides = [inner(n, cross(minus(y, x), minus(p, x))) for x, y in ((a, b), (b, c), (c, a))]
            if min(sides) >= 0:
                return 1
    for direction in ([7919, 104729, 1299709], [-15485863, 32452843, 49979687], [86028121, -3, 17]):
        passed = 0
        for a, b, c in corners:
            w = [minus(x, p) for x in (a, b, c)]
            sides = [inner(cross(w[k], w[(k + 1) % 3]), direction) for k in range(3)]
            if min(sides) > 0 or max(sides) < 0:
                n = cross(minus(b, a), minus(c, a))
                ahead = inner(n, w[0]) * inner(n, direction)
                passed += ahead > 0
            elif min(sides) >= 0 or max(sides) <= 0:
                break
        else:
            return 2 * (passed % 2)
    raise AssertionError("choose other directions")


def cases(rng):
    """(vertices, faces, X_WA, points, X_WB): on grids, turned, far and small."""
    for kind in range(24):
        vertices, faces = (box(), block_ring())[kind % 2]
        points = np.concatenate([rng.integers(-3, 4, (12, 3)) / 2, rng.uniform(-2, 2, (12, 3)), vertices[:6]])
        if kind % 3 == 0:
            X, Y = (collide.pose(rng.choice([-0.5, 0.0, 0.5], 3), R=RIGHT_ANGLES[rng.integers(3)]) for _ in range(2))
        else:
            X = random_pose(rng, 0.3)
            Y = X.copy() if kind % 3 == 1 else random_pose(rng, 0.3)
        scale = 10.0 ** rng.integers(-9, 10) if kind % 4 == 3 else 1.0
        X[:3, 3] *= scale
        Y[:3, 3] *= scale
        yield vertices * scale, faces, X, points * scale, Y


def test_points_are_where_brute_force_says():
    rng = np.random.default_rng(11)
    said = []
    for vertices, faces, X, points, Y in cases(rng):
        tree = build_mesh_tree(vertices, faces)
        found = points_in_solid(tree, X, points, Y)
        a, b = as_integers(world_points(vertices, X), world_points(points, Y))
        want = [where([[a[v] for v in f] for f in faces.tolist()], p) for p in b]
        assert found.tolist() == want, (vertices.tolist(), faces.tolist(), X.tolist(), points.tolist(), Y.tolist())
        said += want
        one = points_in_solid(tree, X, points[5], Y)
        assert one.tolist() == [found[5]]
    counts = np.bincount(said, minlength=3)
    assert (counts > 40).all(), counts


def test_poses_in_a_batch():
    rng = np.random.default_rng(12)
    vertices, faces = block_ring()
    tree = build_mesh_tree(vertices, faces)
    Xs = np.stack([random_pose(rng, 0.5) for _ in range(40)])
    point = np.array([0.25, 0.5, 0.125])
    found = points_in_solid(tree, Xs, point, np.eye(4))
    assert len(np.unique(found)) > 1
    for k in range(40):
        assert points_in_solid(tree, Xs[k], point, np.eye(4))[0] == found[k]
    with pytest.raises(ValueError, match="points"):
        points_in_solid(tree, Xs, np.zeros((7, 3)), np.eye(4))
    with pytest.raises(collide.InvalidPose, match="singular"):
        points_in_solid(tree, np.diag([1.0, 0.0, 1.0, 1.0]), point, np.eye(4))


def test_fractions_are_needed():
    """A point an ulp off a face is on either side of it, and the answer knows."""
    vertices, faces = box()
    tree = build_mesh_tree(vertices, faces)
    x = float(vertices[:, 0].max())
    for point, want in ((np.nextafter(x, 9), 0), (x, 1), (np.nextafter(x, -9), 2)):
        assert points_in_solid(tree, np.eye(4), np.array([point, 0.1, 0.2]), np.eye(4)).tolist() == [want]
    assert Fraction(np.nextafter(x, 9)) > Fraction(x)
