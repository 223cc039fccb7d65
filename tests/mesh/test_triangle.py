"""Triangles in buffers: what is put is read again, normals and heights are numpy's."""

from __future__ import annotations

import numpy as np
import pytest
from naive import rng_of

from collide.mesh.triangle import normal_of, put_triangle, range_along, sum_of_normals, triangle_at
from collide.numerics.vec3 import Vec3

pytestmark = pytest.mark.plain_kernels


def test_triangles_of_a_buffer():
    rng = rng_of("triangles")
    triangles = rng.normal(size=(9, 3, 3))
    flat, copy = triangles.ravel(), np.zeros(9 * 9 + 2)
    for k in range(9):
        triangle = triangle_at(flat, 9 * k)
        assert np.array_equal(np.array(triangle), triangles[k])
        put_triangle(copy, 9 * k + 1, triangle)
        p, q, r = triangles[k]
        assert np.allclose(normal_of(triangle), np.cross(q - p, r - p), rtol=0, atol=1e-14)
    assert np.array_equal(copy[1:-1], flat) and copy[0] == copy[-1] == 0.0
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    for first, last in ((0, 9), (2, 5), (4, 4)):
        assert np.allclose(sum_of_normals(flat, first, last), normals[first:last].sum(axis=0), rtol=0, atol=1e-13)


def test_heights_of_a_run():
    rng = rng_of("heights of triangles")
    for _ in range(20):
        triangles, n, origin = rng.normal(size=(7, 3, 3)), rng.normal(size=3), rng.normal(size=3)
        first = int(rng.integers(6))
        last = int(rng.integers(first + 1, 8))
        found = range_along(Vec3(*n), triangles.ravel(), first, last, Vec3(*origin))
        heights = (triangles[first:last].reshape(-1, 3) - origin) @ n
        assert np.allclose(found, (heights.min(), heights.max()), rtol=0, atol=1e-13)
    assert range_along(Vec3(*n), triangles.ravel(), 3, 3, Vec3(*origin)) == (np.inf, -np.inf)
