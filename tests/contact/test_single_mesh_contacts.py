"""Single contacts of meshes inside kernels: the bytes of the long way, and what is left to it."""

from __future__ import annotations

import numpy as np
import pytest
from contact_scenes import table
from mesh_families import random_pose, soup
from mesh_shapes import block_ring, box

import collide
from collide.contact.contact_batches import contact_batch
from collide.narrowphase.prepared_pairs import prepared_pair, single_calls_are_safe

EYE = np.eye(4)
pytestmark = pytest.mark.skipif(not single_calls_are_safe(), reason="single calls go the long way here")


def bodies() -> list:
    return [
        collide.Mesh(*box()), collide.Mesh(*block_ring()), collide.Box((0.5, 0.6, 0.7)), collide.Sphere(0.3),
        collide.Capsule(0.2, 0.5), collide.ConvexHull(np.random.default_rng(2).normal(size=(20, 3)) * 0.3),
    ]


def test_single_calls_have_the_bytes_of_batches():
    rng = np.random.default_rng(12)
    by_kernel = hits = far = asked = 0
    for case in range(120):
        pool = bodies()
        A, B = pool[case % 2], pool[case % len(pool)]
        if case % 3 == 0:
            A, B = B, A
        for turn in range(4):
            X_WA = EYE if turn == 0 else random_pose(rng)
            X_WB = random_pose(rng)
            X_WB[:3, 3] = X_WA[:3, 3] + rng.normal(size=3) * (0.3, 0.8, 1.5, 4.0)[turn]
            margin, most = (0.0, 0.05, 0.4, 0.0)[turn], int(rng.integers(1, 9))
            rows, _ = contact_batch(A, B, X_WA[None], X_WB[None], 1, margin, most, check=True)
            single = collide.contacts(A, B, X_WA, X_WB, margin=margin, max_contacts=most).rows
            assert single.tobytes() == rows.tobytes(), (case, turn)
            by_kernel += prepared_pair(A, B).contacts(X_WA, X_WB, most, margin) is not None
            hits, far, asked = hits + (len(rows) > 0), far + (len(rows) == 0), asked + 1
    assert by_kernel > 0.6 * asked and hits > 100 and far > 100, (by_kernel, hits, far, asked)


@pytest.mark.many(3)
@pytest.mark.parametrize("part", range(6))
def test_single_calls_of_curved_shapes_have_the_bytes_of_the_long_way(part):
    """On meshes of several sizes, whose marks share memory; solid ones and surfaces; in batches and lists, too."""
    rng = np.random.default_rng([31, part])
    meshes = [
        collide.Mesh(*box()), collide.Mesh(*block_ring()), collide.Mesh(*table(12, seed=1)),
        collide.Mesh(*table(40, seed=2)), collide.Mesh(*soup(rng, 40, 1.0, 0.3), solid=False),
    ]
    shapes = [collide.Cylinder(0.3, 0.5), collide.Cone(0.05, 0.1), collide.Ellipsoid((0.3, 0.2, 0.1))]
    by_kernel = hits = far = asked = swallowed = 0
    for case in range(25 * part, 25 * part + 25):
        mesh, shape = meshes[case % 5], shapes[case % 3]
        A, B = (shape, mesh) if case % 4 == 0 else (mesh, shape)
        margin, most, X_WM = (0.0, 0.01, 0.1)[case % 7 % 3], int(rng.integers(1, 9)), random_pose(rng)
        X_WS = np.array([random_pose(rng) for _ in range(6)])
        X_WS[:, :3, 3] = mesh.vertices[rng.integers(len(mesh.vertices), size=6)] @ X_WM[:3, :3].T + X_WM[:3, 3]
        X_WS[:, :3, 3] += rng.normal(size=(6, 3)) * np.array([0.0, 0.05, 0.1, 0.2, 0.4, 1.0])[:, None]
        pieces = []
        for X in X_WS:
            X_WA, X_WB = (X, X_WM) if A is shape else (X_WM, X)
            rows, _ = contact_batch(A, B, X_WA[None], X_WB[None], 1, margin, most, check=True)
            single = collide.contacts(A, B, X_WA, X_WB, margin=margin, max_contacts=most).rows
            assert single.tobytes() == rows.tobytes(), (case, len(pieces))
            by_kernel += prepared_pair(A, B).contacts(X_WA, X_WB, most, margin) is not None
            hits, far, asked = hits + (len(rows) > 0), far + (len(rows) == 0), asked + 1
            swallowed += int((rows["kind"] == 2).any())
            pieces.append(rows)
        X_WA, X_WB = (X_WS, X_WM) if A is shape else (X_WM, X_WS)
        for asked_a, asked_b in ((A, B), ([A] * 6, [B] * 6)):
            batch = collide.contacts(asked_a, asked_b, X_WA, X_WB, margin=margin, max_contacts=most).rows
            assert batch.tobytes() == np.concatenate(pieces).tobytes(), case
    seen = by_kernel, hits, far, asked, swallowed
    assert by_kernel > 0.5 * asked and hits > 60 and far > 20 and swallowed > 1, seen


def test_rows_of_many_patches_are_whole():
    """More rows than a patch may have, where only so many were zeroed: none holds what an earlier call left there."""
    rng = np.random.default_rng(6)
    A, B = (collide.Mesh(*soup(rng, 12, 1.0, 0.3), solid=False) for _ in range(2))
    most = 0
    for turn in range(12):
        X_WA, X_WB = random_pose(rng), random_pose(rng)
        X_WB[:3, 3] = X_WA[:3, 3] + 0.2 * rng.normal(size=3)
        want, _ = contact_batch(A, B, X_WA[None], X_WB[None], 1, 0.3, 1 + turn % 3)
        got = collide.contacts(A, B, X_WA, X_WB, margin=0.3, max_contacts=1 + turn % 3).rows
        assert got.tobytes() == want.tobytes(), turn
        most = max(most, len(want) if prepared_pair(A, B).contacts(X_WA, X_WB, 1 + turn % 3, 0.3) is not None else 0)
    assert most > 8


def test_bodies_inside_each_other_bad_poses_and_the_brink_of_the_margin_go_the_long_way():
    A, B = collide.Mesh(*box()), collide.Sphere(0.01)
    assert collide.contacts(A, B, EYE, EYE).rows["kind"][0] == 2  # a translation
    assert prepared_pair(A, B).contacts(EYE, EYE, 8, 0.0) is None
    X_WB = collide.pose((5.0, 0.1, 0.2))
    gap = collide.distance(A, B, EYE, X_WB).distance
    for margin in (gap, gap * (1 - 2e-16), gap * (1 + 2e-16)):
        rows, _ = contact_batch(A, B, EYE[None], X_WB[None], 1, margin, 8)
        assert collide.contacts(A, B, EYE, X_WB, margin=margin).rows.tobytes() == rows.tobytes()
    assert prepared_pair(A, B).contacts(EYE, X_WB, 8, gap) is None
    for bad in (2.0 * EYE, np.diag((1.0, 1.0, -1.0, 1.0)), np.full((4, 4), np.nan)):
        with pytest.raises(collide.InvalidPose):
            collide.contacts(A, B, bad, X_WB)
