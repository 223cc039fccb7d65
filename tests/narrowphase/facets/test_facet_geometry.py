"""Corners by facet number, unit normals, and crossings of rays that add up to winding numbers."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import random_pose, rng_of
from naive_triangles import as_integers, minus, winding, world_points

from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_geometry import (
    RAY_DIRECTIONS,
    FacetCorners,
    exact_point,
    facet_normals,
    ray_crossing,
)
from collide.numerics.exact_points import placed


def test_corners_by_number():
    vertices, faces = bumpy_sphere(120)
    tree = build_mesh_tree(vertices, faces)
    corners = FacetCorners(tree)
    assert (tree.ids != np.arange(len(faces))).any(), "the tree keeps the order: nothing is tested"
    assert np.array_equal(corners[np.arange(len(faces))], vertices[faces])
    assert np.array_equal(corners[7], vertices[faces[7]]) and corners[np.array([], dtype=int)].shape == (0, 3, 3)


def test_normals_point_outwards_and_vanish_without_area():
    rng = rng_of("facet normals")
    for k in range(40):
        X = random_pose(rng)
        corners = rng.normal(size=(12, 3, 3)) * 10.0 ** rng.integers(-100, 100, (12, 1, 1))
        corners[3] = corners[3, :1] + np.outer([0.0, 1.0, 0.5], corners[3, 1])  # a segment, exactly or nearly
        corners[4, 2] = corners[4, 1]
        corners[5, 2] = corners[5, 0] + (corners[5, 1] - corners[5, 0]) * (1 + 1e-9 * rng.normal(size=3))  # a needle
        found = facet_normals(X[None] if k % 2 else np.broadcast_to(X, (12, 4, 4)), corners)
        for facet, n in zip(corners, found):
            (p, q, r), _ = placed(X, facet)
            u, v = minus(q, p), minus(r, p)
            true = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
            largest = max(map(abs, true))
            if largest == 0:
                assert not n.any(), (X.tolist(), facet.tolist())
                continue
            want = np.array([float(Fraction(x, largest)) for x in true])
            assert np.allclose(n, want / np.linalg.norm(want), rtol=0, atol=1e-6), (X.tolist(), facet.tolist())
        assert not found[4].any()


def test_crossings_add_up_to_winding_numbers():
    rng = rng_of("ray crossings")
    seen: Counter = Counter()
    for k in range(120):
        vertices, faces = (box(), block_ring(), bumpy_sphere(24))[k % 3]
        point = rng.integers(-6, 7, 3) / 4 if k % 2 else rng.uniform(-1.5, 1.5, 3)
        X = random_pose(rng) if k % 4 < 2 else np.eye(4)
        corners, (p,) = as_integers(world_points(vertices, X), world_points([point], X))
        triangles = [[corners[v] for v in face] for face in faces.tolist()]
        want = winding(triangles, p)
        if want is None:  # on the surface
            continue
        for direction in RAY_DIRECTIONS:
            crossings = [ray_crossing(direction, *(tuple(minus(c, p)) for c in T)) for T in triangles]
            if None in crossings:
                seen["edge"] += 1
                continue
            assert sum(crossings) == want, (vertices.tolist(), faces.tolist(), X.tolist(), point.tolist(), direction)
            seen[want] += 1
    assert seen[0] > 100 and seen[1] > 50, seen
    toward_an_edge = ray_crossing((1, 0, 0), (1, -1, 0), (1, 1, 0), (1, 0, 1))
    assert toward_an_edge is None and ray_crossing((0, 0, 1), (5, 5, 1), (6, 5, 1), (5, 6, 1)) == 0


def test_an_exact_point_is_the_point():
    for point in ([0.1, -2.5, 1e-30], [0.0, 0.0, 0.0], [1e40, 3.0, -0.0]):
        ((x,), grid) = exact_point(np.array(point))
        assert [Fraction(c) * Fraction(2) ** grid for c in x] == [Fraction(c) for c in point]
