"""Poses that joints make, against their definitions, and one by one against batches."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive import rng_of, rotation, unit

from collide import joint_motions as motions

ANGLES = np.array([0.0, 1e-9, 0.3, -2.0, math.pi / 2, math.pi, 7.0])


def poses(rng, n: int) -> np.ndarray:
    X = np.tile(np.eye(4), (n, 1, 1))
    X[:, :3, :3] = [rotation(rng) for _ in range(n)]
    X[:, :3, 3] = rng.normal(size=(n, 3))
    return X


def test_products_are_matrix_products_with_the_same_bits_in_any_batch():
    rng = rng_of("products of poses")
    A, B = poses(rng, 50), poses(rng, 50)
    found = motions.product(A, B)
    assert np.allclose(found, A @ B, rtol=0, atol=1e-14)
    assert (found[:, 3] == (0.0, 0.0, 0.0, 1.0)).all()
    for k in range(50):
        assert motions.product(A[k : k + 1], B[k : k + 1]).tobytes() == found[k].tobytes()


def test_rotations_turn_by_their_angle_about_their_axis():
    rng = rng_of("rotations of joints")
    for axis in (*np.eye(3), -np.eye(3)[1], *(unit(rng.normal(size=3)) for _ in range(5))):
        X = motions.rotation(axis, ANGLES)
        across = unit(np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]))
        for angle, R in zip(ANGLES, X[:, :3, :3]):
            told = f"axis = {axis.tolist()}; angle = {angle}"
            assert np.allclose(R.T @ R, np.eye(3), rtol=0, atol=1e-14) and np.linalg.det(R) > 0, told
            assert np.allclose(R @ axis, axis, rtol=0, atol=1e-14), told
            want = math.cos(angle) * across + math.sin(angle) * np.cross(axis, across)
            assert np.allclose(R @ across, want, rtol=0, atol=1e-14), told
        assert not X[:, :3, 3].any() and (X[:, 3] == (0, 0, 0, 1)).all()
    about_z = motions.rotation(np.array([0.0, 0.0, 1.0]), ANGLES)
    assert (about_z[:, 2, :3] == (0, 0, 1)).all() and (about_z[:, :2, 2] == 0).all(), "exact zeros and ones"


def test_translations():
    p = rng_of("translations").normal(size=(5, 3))
    X = motions.translation(p)
    assert (X[:, :3, :3] == np.eye(3)).all() and (X[:, :3, 3] == p).all() and (X[:, 3] == (0, 0, 0, 1)).all()


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.6, 0.0, 0.8), (0.0, -1.0, 0.0)])
def test_planar_motions_stay_in_their_plane(normal):
    normal = np.array(normal)
    values = rng_of("planar", *normal).normal(size=(20, 3))
    X = motions.planar_motion(normal, values)
    assert np.allclose(X[:, :3, :3], motions.rotation(normal, values[:, 2])[:, :3, :3])
    assert np.allclose(X[:, :3, 3] @ normal, 0.0, atol=1e-15)
    assert np.allclose(np.linalg.norm(X[:, :3, 3], axis=1), np.hypot(values[:, 0], values[:, 1]))
    if normal[2] == 1.0:
        assert np.array_equal(X[:, :2, 3], values[:, :2])


def test_floating_motions_are_roll_pitch_yaw_about_fixed_axes():
    values = rng_of("floating").normal(size=(20, 6))
    X = motions.floating_motion(values)
    for row, found in zip(values, X):
        cos, sin = np.cos(row[3:]), np.sin(row[3:])
        roll = np.array([[1, 0, 0], [0, cos[0], -sin[0]], [0, sin[0], cos[0]]])
        pitch = np.array([[cos[1], 0, sin[1]], [0, 1, 0], [-sin[1], 0, cos[1]]])
        yaw = np.array([[cos[2], -sin[2], 0], [sin[2], cos[2], 0], [0, 0, 1]])
        assert np.allclose(found[:3, :3], yaw @ pitch @ roll, rtol=0, atol=1e-14), row.tolist()
        assert np.array_equal(found[:3, 3], row[:3])
