"""Rotation vectors and matrices against scipy's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from collide.motion.rotations import rotation_about, rotation_between
from collide.numerics.matrix3 import apply
from collide.numerics.vec3 import Vec3

#: Kernels are called as the Python they are written in.
pytestmark = pytest.mark.plain_kernels


def flat(R) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = R
    return X.ravel()


def matrix(M) -> np.ndarray:
    return np.array([list(row) for row in M])


@pytest.mark.parametrize("largest", [1e-12, 1e-6, 0.1, math.pi, math.pi * 0.999999])
def test_the_shortest_turn_is_found(largest):
    rng = np.random.default_rng(3)
    for _ in range(60):
        R0 = Rotation.random(random_state=rng)
        axis = rng.normal(size=3)
        omega = axis / np.linalg.norm(axis) * largest * rng.uniform(0.5, 0.9999)
        R1 = Rotation.from_rotvec(omega) * R0
        mine = rotation_between(flat(R0.as_matrix()), flat(R1.as_matrix()))
        assert np.abs(np.array(mine) - omega).max() <= 1e-14


def test_equal_orientations_are_no_turn_at_all():
    rng = np.random.default_rng(4)
    for _ in range(50):
        X = flat(Rotation.random(random_state=rng).as_matrix() * (1.0 + 1e-6 * rng.normal()))
        assert tuple(rotation_between(X, X)) == (0.0, 0.0, 0.0)


def test_half_a_turn_goes_about_the_positive_axis():
    for axis in np.eye(3):
        for sign in (1.0, -1.0):
            turned = Rotation.from_rotvec(sign * math.pi * axis).as_matrix().round()
            mine = rotation_between(flat(np.eye(3)), flat(turned))
            assert np.array(mine) == pytest.approx(math.pi * axis, abs=1e-15)


def test_matrices_turn_as_rodrigues_says():
    rng = np.random.default_rng(5)
    for _ in range(100):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        angle = float(rng.uniform(-40, 40))
        M = rotation_about(Vec3(*axis), angle)
        truth = Rotation.from_rotvec(angle * axis).as_matrix()
        assert np.abs(matrix(M) - truth).max() <= 1e-14
        v = rng.normal(size=3)
        assert np.array(apply(M, Vec3(*v))) == pytest.approx(truth @ v, abs=1e-13)
