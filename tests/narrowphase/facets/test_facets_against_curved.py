"""Facets one by one against a convex set: the rows that hulls of three points get from `distance`."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from mesh_shapes import bumpy_sphere
from naive import random_pose, rng_of

import collide
from collide.lowering.facet_bodies import as_given
from collide.lowering.parts import convex_set_of
from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facets_against_curved import facet_rows


@pytest.mark.parametrize("kind", ["Cylinder", "Cone", "Ellipsoid", "Sphere", "Box"])
def test_rows_are_those_of_triangles_alone(kind):
    rng = rng_of("facets of convex sets", kind)
    shape = naive.one_of_each(rng)[kind]
    packed = convex_set_of(shape)
    tree = build_mesh_tree(*bumpy_sphere(40))
    X_WA, X_WB = (np.stack([random_pose(rng, 0.5) for _ in range(6)]) for _ in range(2))
    pose, place = rng.integers(0, 6, 150), rng.integers(0, len(tree.triangles), 150)
    rows = facet_rows(tree, packed, as_given(X_WA), as_given(X_WB), pose, place, boolean=False, limit=np.inf)
    near = facet_rows(tree, packed, as_given(X_WA), as_given(X_WB), pose, place, boolean=True, limit=0.0)
    hits = 0
    for row, boolean, k, facet in zip(rows, near, pose.tolist(), place.tolist()):
        case = naive.Case(collide.ConvexHull(tree.triangles[facet].reshape(3, 3)), shape, X_WA[k], X_WB[k])
        with naive.reproducible(case):
            alone = collide.distance(*case)
            assert row["hit"] == alone.hit == boolean["hit"]
            assert row["lower"] <= alone.upper and alone.lower <= row["upper"]
            assert abs(row["distance"] - alone.distance) <= 1e-9
            if alone.distance > 1e-6:
                assert np.allclose(row["normal"], alone.normal, atol=1e-6)
        hits += alone.hit
    assert 2 < hits < 148, hits


