"""The hull of a box's corners, known without a search: facets 2k and 2k + 1 are face k: −x, +x, −y, +y, −z, +z."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import collide
from collide.hull.exact_hull import convex_hull
from collide.hull.validate_hull import validate_hull
from collide.lowering.hull_faces import hull_faces

SIGNS = np.array(list(itertools.product((0, 1), repeat=3)))
OUTWARD = np.concatenate([[-axis, axis] for axis in np.eye(3)])


def corners(low, high) -> np.ndarray:
    return np.where(SIGNS, high, low)


@pytest.mark.parametrize("seed", range(12))
def test_facets_are_those_of_the_faces_in_order(seed):
    rng = np.random.default_rng(seed)
    low = rng.uniform(-1, 1, 3) * 10.0 ** rng.integers(-300, 15)
    high = low + np.maximum(np.abs(low) * 2.0**-50, rng.uniform(0, 1, 3) * 10.0 ** rng.integers(-300, 15))
    points = corners(low, high)
    hull = convex_hull(points)
    assert hull.dimension == 3 and hull.vertices.tolist() == list(range(8)) and len(hull.facets) == 12
    validate_hull(points, hull)
    for k, facet in enumerate(hull.facets):
        face = k // 2
        axis, side = face // 2, (low, high)[face % 2]
        assert (points[facet, axis] == side[axis]).all()


def test_faces_of_a_box_are_numbered_by_axis_and_side():
    faces = hull_faces(corners((-1.0, -2.0, -3.0), (1.0, 2.0, 3.0)))
    assert np.array_equal(faces.normals, OUTWARD) and faces.triangles.tolist() == [0, 2, 4, 6, 8, 10]
    for face, (i, j) in enumerate(itertools.pairwise(faces.starts)):
        assert (SIGNS[faces.corners[i:j], face // 2] == face % 2).all() and j - i == 4


def test_other_clouds_of_eight_points_are_searched():
    """Corners in another order, one of them moved, two alike, or flat."""
    rng = np.random.default_rng(3)
    box = corners((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
    flat, moved, double = box * (1, 1, 0), box.copy(), box.copy()
    moved[5] += (0.25, 0.0, 0.0)
    double[3] = double[4]
    for points, dimension in ((box[rng.permutation(8)], 3), (flat, 2), (moved, 3), (double, 3)):
        hull = convex_hull(points)
        assert hull.dimension == dimension
        validate_hull(points, hull)


@pytest.mark.parametrize("face", range(6))
def test_a_contact_names_the_face_of_a_box(face):
    """Of a pair of boxes, and of a box and a mesh."""
    A, B = collide.Box(0.3, 0.4, 0.5), collide.Box(0.1, 0.12, 0.14)
    X_WB = collide.pose(OUTWARD[face] * (np.array([0.2, 0.26, 0.32]) - 1e-3) + 1e-3 * (1 - abs(OUTWARD[face])))
    half = np.array([0.05, 0.06, 0.07])
    mesh = collide.Mesh(corners(-half, half), convex_hull(1.0 * SIGNS).facets)
    for other in (B, mesh):
        rows = collide.contacts(A, other, np.eye(4), X_WB).rows
        assert len(rows) == 4 and (rows["facet_a"] // 2 == face).all() and (rows["facet_b"] // 2 == (face ^ 1)).all()
