"""Facets that meet, as users ask for them: all pairs in fractions, batches, first ones, and one mesh with itself."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_families import soup
from mesh_shapes import box
from naive import random_pose, rng_of
from naive_triangles import facet_pairs as all_pairs

import collide


def test_pairs_are_those_of_brute_force():
    rng = rng_of("facet pairs")
    found = 0
    for _ in range(12):
        (va, fa), (vb, fb) = soup(rng, 10, 0.6), soup(rng, 8, 0.6)
        A, B = (collide.Mesh(v, f, solid=False) for v, f in ((va, fa), (vb, fb)))
        X_WA, X_WB = random_pose(rng, 0.3), np.stack([random_pose(rng, 0.3) for _ in range(3)])
        r = collide.facet_pairs(A, B, X_WA, X_WB)
        first = collide.facet_pairs(A, B, X_WA, X_WB, first=True)
        back = collide.facet_pairs(B, A, X_WB, X_WA)
        assert r.starts[0] == 0 and r.starts[-1] == len(r.pairs) and len(r.starts) == 4 and r.counters.shape == (3, 3)
        for k in range(3):
            want = all_pairs(va, fa, X_WA, vb, fb, X_WB[k])
            told = f"{va.tolist()}, {vb.tolist()}, {X_WA.tolist()}, {X_WB[k].tolist()}"
            mine, one, swapped = (
                [tuple(p) for p in s.pairs[s.starts[k] : s.starts[k + 1]].tolist()] for s in (r, first, back)
            )
            assert mine == want, told
            assert len(one) == min(len(want), 1) and set(one) <= set(want), told
            assert sorted((b, a) for a, b in swapped) == want, told
            found += len(want)
    assert found > 60


def test_convex_shapes_take_part_and_others_are_named():
    mesh, cube = collide.Mesh(*box()), collide.Box((1, 1, 1))
    r = collide.facet_pairs(mesh, cube, np.eye(4), collide.pose((1.0, 0.25, 0.25)))
    assert len(r.pairs) and r.pairs[:, 1].max() < 12
    assert not len(collide.facet_pairs(mesh, cube, np.eye(4), np.eye(4)).pairs), "wholly inside"
    with pytest.raises(collide.UnsupportedQuery, match="Sphere"):
        collide.facet_pairs(mesh, collide.Sphere(1), np.eye(4), np.eye(4))
    with pytest.raises(collide.InvalidArgument, match="at least must be a Mesh"):
        collide.facet_pairs(cube, cube, np.eye(4), np.eye(4))


def test_one_mesh_with_itself():
    clean = collide.self_collisions(collide.Mesh(*box()))
    assert not clean.hit and not len(clean.facets) and clean.pairs.shape == (0, 2) and clean.counters.shape == (3,)
    vertices, faces = box()
    stab = np.array([[0.0, 0.1, 0.2], [3.0, 0.0, 0.3], [3.0, 0.4, 0.1]])
    crossed = collide.Mesh(np.concatenate([vertices, stab]), np.concatenate([faces, [[8, 9, 10]]]), solid=False)
    r = collide.self_collisions(crossed)
    meeting = all_pairs(vertices, faces, np.eye(4), stab, np.array([[0, 1, 2]]), np.eye(4))
    assert r.hit and r.pairs.tolist() == [[a, 12] for a, _ in meeting] and len(meeting) >= 1
    assert r.facets.tolist() == sorted({a for a, _ in meeting} | {12})
    with pytest.raises(collide.InvalidArgument, match="mesh must be a Mesh, got Box"):
        collide.self_collisions(collide.Box((1, 1, 1)))
