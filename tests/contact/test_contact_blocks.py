"""Contacts of batches longer than a block: the same bytes as of each pair by itself, in Worlds, in threads, and where
rows run out or doubles leave pairs open."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.narrowphase.pose_batches import BLOCK

EYE = np.eye(4)


def stack_of_bodies(rng, n: int):
    """(shapes, poses): boxes, hulls and round shapes on a narrow grid: neighbours touch, some of them exactly."""
    some = [
        collide.Box((0.5, 0.5, 0.5)), collide.Box((0.6, 0.4, 0.5)), collide.ConvexHull(rng.normal(size=(12, 3)) * 0.3),
        collide.Sphere(0.3), collide.Cylinder(0.25, 0.5), collide.Capsule(0.2, 0.3),
    ]
    side = int(np.ceil(n ** (1 / 3)))
    shapes, poses = [], []
    for k in range(n):
        place = 0.5 * np.array([k % side, k // side % side, k // side**2], dtype=float)
        is_turned = rng.integers(3) > 0
        turn = rng.uniform(-3, 3, 3) if is_turned else (0, 0, 0)
        shapes.append(some[rng.integers(len(some)) if is_turned else 0])
        poses.append(collide.pose(place + is_turned * rng.uniform(-0.02, 0.02, 3), rpy=turn))
    return shapes, np.array(poses)


@pytest.fixture(scope="module")
def asked():
    """(shapes a, shapes b, X_WA, X_WB, pairs, bodies' shapes, bodies' poses)."""
    rng = np.random.default_rng(3)
    shapes, X = stack_of_bodies(rng, 64)
    pairs = np.array([(i, j) for i in range(64) for j in range(i + 1, 64) if np.abs(X[i] - X[j])[:3, 3].max() < 1.1])
    a, b = pairs.T
    assert len(pairs) > 5 * BLOCK
    return [shapes[i] for i in a], [shapes[j] for j in b], X[a], X[b], pairs, shapes, X


def one_by_one(A, B, X_WA, X_WB, **options) -> list[np.ndarray]:
    """Rows of every pair asked by itself, in lists of one: nothing is prepared for it."""
    return [
        collide.contacts([a], [b], x[None], y[None], **options).rows.copy() for a, b, x, y in zip(A, B, X_WA, X_WB)
    ]


@pytest.mark.parametrize("options", [{}, {"margin": 0.01}, {"margin": 0.05, "max_contacts": 3}])
def test_a_batch_has_the_bytes_of_its_pairs(asked, options):
    A, B, X_WA, X_WB, pairs, *_ = asked
    whole = collide.contacts(A, B, X_WA, X_WB, **options)
    wanted = one_by_one(A, B, X_WA, X_WB, **options)
    assert len(whole.rows) > len(pairs) // 4
    for k, rows in enumerate(wanted):
        got = whole.rows[whole.starts[k] : whole.starts[k + 1]]
        assert got.tobytes() == rows.tobytes(), f"pair {k}: {A[k]}, {B[k]}, {X_WA[k]}, {X_WB[k]}"
    for threads in (2, 3):
        assert collide.contacts(A, B, X_WA, X_WB, threads=threads, **options).rows.tobytes() == whole.rows.tobytes()


def test_more_contacts_than_there_is_space_for_at_first():
    box, below = collide.Box((0.4, 0.4, 0.4)), EYE
    above = np.array([collide.pose((0, 0, 0.399), rpy=(0, 0, angle)) for angle in np.linspace(0.1, 1.4, 3 * BLOCK)])
    whole = collide.contacts(box, box, below, above)
    assert (np.diff(whole.starts) == 8).all()
    for k in range(0, len(above), 17):
        alone = collide.contacts([box], [box], below[None], above[k][None]).rows
        assert whole.rows[8 * k : 8 * k + 8].tobytes() == alone.tobytes(), above[k]


@pytest.mark.parametrize("with_mesh", [False, True])
def test_a_world_has_the_bytes_of_its_pairs(asked, with_mesh):
    A, B, X_WA, X_WB, pairs, shapes, X = asked
    world = collide.World()
    gone = world.add(shapes[0], X[0])  # ids are no positions
    ids = [world.add(shape, pose) for shape, pose in zip(shapes, X)]
    world.remove(gone)
    if with_mesh:
        corners = np.array([[-9.0, -9, -0.24], [9, -9, -0.24], [0, 9, -0.24]])
        mesh = world.add(collide.Mesh(corners, [[0, 1, 2]], solid=False), EYE)
    found = world.contacts(0.01).rows
    of_mesh = np.zeros(len(found), dtype=bool)
    if with_mesh:
        of_mesh = (found["a"] == mesh) | (found["b"] == mesh)
        assert of_mesh.sum() > 16 and (np.diff(found["a"].astype(np.int64) * 1000 + found["b"]) >= 0).all()
        k = int(np.argmax(found["b"] == mesh))
        body = found["a"][k] - 1
        own = collide.contacts(shapes[body], world.body(mesh).shape, X[body], EYE, margin=0.01)
        assert np.array_equal(found["point_a"][k : k + len(own)], own.point_a)
    wanted = one_by_one(A, B, X_WA, X_WB, margin=0.01)
    for rows, (i, j) in zip(wanted, pairs):
        rows["a"], rows["b"] = ids[i], ids[j]
    assert found[~of_mesh].tobytes() == np.concatenate(wanted).tobytes()


def test_matrices_that_are_no_pose_are_named(asked):
    A, B, X_WA, X_WB, *_ = asked
    bad = X_WA.copy()
    bad[BLOCK + 5, :3, :3] *= 1.01
    with pytest.raises(collide.InvalidPose, match=rf"X_WA\[{BLOCK + 5}\]"):
        collide.contacts(A, B, bad, X_WB)
    with pytest.raises(collide.InvalidPose, match=rf"X_WA\[{BLOCK + 5}\]"):
        collide.contacts(A, B, bad, X_WB, threads=2)
    bad[BLOCK + 5, 0, 0] = np.nan
    with pytest.raises(collide.InvalidPose, match=rf"X_WA\[{BLOCK + 5}"):
        collide.contacts(A, B, bad, X_WB, check_poses=False)


def test_half_spaces_that_overlap_are_refused_in_a_batch(asked):
    A, B, X_WA, X_WB, *_ = asked
    ground = collide.Halfspace((0, 0, 1), 0.0)
    A, B = list(A), list(B)
    A[BLOCK + 1] = B[BLOCK + 1] = ground
    with pytest.raises(collide.UnsupportedQuery, match="no end"):
        collide.contacts(A, B, X_WA, X_WB)
