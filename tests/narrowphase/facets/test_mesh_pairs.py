"""A mesh and another body by the method of their kinds: states and rows agree with `collide` and `distance`."""

from __future__ import annotations

from collections import Counter

import naive
import numpy as np
import pytest
from mesh_shapes import bumpy_sphere
from naive import random_pose, rng_of

import collide
from collide.narrowphase.facets.mesh_collide_kernel import APART, HIT
from collide.narrowphase.facets.mesh_pairs import checked_poses, hull_shape, mesh_rows, mesh_states
from collide.results import flipped

MESH = collide.Mesh(*bumpy_sphere(60))
KINDS = ("Sphere", "Box", "Capsule", "Cylinder", "Cone", "Ellipsoid", "Halfspace", "ConvexHull")


@pytest.mark.parametrize("kind", KINDS)
def test_states_and_rows_of_either_order(kind):
    rng = rng_of("mesh rows", kind)
    shape = naive.one_of_each(rng)[kind]
    X_WA, X_WB = (np.stack([random_pose(rng, 1.2) for _ in range(16)]) for _ in range(2))
    found, swapped = mesh_states(MESH, shape, X_WA, X_WB), mesh_states(shape, MESH, X_WB, X_WA)
    assert np.array_equal(found, swapped) and set(found.tolist()) <= {APART, HIT}
    assert np.array_equal(found == HIT, collide.collide(MESH, shape, X_WA, X_WB))
    rows = mesh_rows(MESH, shape, X_WA, X_WB, limit=np.inf, depths=False)
    back = mesh_rows(shape, MESH, X_WB, X_WA, limit=np.inf, depths=False)
    assert np.array_equal(rows["hit"], found == HIT)
    assert not naive.same_bits(flipped(rows), back)
    asked = collide.distance(MESH, shape, X_WA, X_WB, signed=False)
    apart = found == APART
    assert np.array_equal(rows["distance"][apart], asked.distance[apart])
    seen = Counter(found.tolist())
    assert min(seen[HIT], seen[APART]) >= 2, seen


def test_hulls_and_poses():
    box = collide.Box((1, 1, 1))
    assert hull_shape(box) is box and hull_shape(MESH) is MESH.convex_hull
    X, Y = checked_poses(np.eye(4)[None], np.stack([np.eye(4)] * 3), True)
    assert X.shape == Y.shape == (3, 4, 4) and X.flags.c_contiguous
    stretched = np.diag([2.0, 2.0, 2.0, 1.0])
    with pytest.raises(collide.InvalidPose, match="X_WB"):
        checked_poses(np.eye(4)[None], stretched[None], True)
    assert checked_poses(np.eye(4)[None], stretched[None], False)[1][0, 0, 0] == 2.0
