"""Rigid poses as kernels see them, beside the check that names what is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from collide.errors import InvalidPose
from collide.numerics.rigid_poses import are_rigid_matrices
from collide.transforms import LARGEST, SAFE_TOLERANCE, as_poses, pose


def is_accepted(X: np.ndarray) -> bool:
    return are_rigid_matrices(X, SAFE_TOLERANCE, LARGEST)


def is_pose(X: np.ndarray) -> bool:
    try:
        as_poses(X, "X")
    except InvalidPose:
        return False
    return True


def test_what_is_accepted_is_a_pose_and_rotations_are_accepted():
    """One entry of one of several poses is another number: where it is accepted, the slow check takes it as well."""
    rng, counts = np.random.default_rng(5), {(False, False): 0, (False, True): 0, (True, True): 0}
    for _ in range(3000):
        X = np.array([pose(rng.normal(size=3), quat_wxyz=rng.normal(size=4)) for _ in range(rng.integers(1, 4))])
        assert is_accepted(X)
        k, i, j = (int(rng.integers(limit)) for limit in (len(X), 4, 4))
        change = rng.choice([1e-17, 1e-9, 3e-5, 6e-5, 1e-3, 1.0])
        X[k, i, j] = rng.choice([X[k, i, j] + change, np.nan, np.inf, -X[k, i, j], 2.0 * LARGEST, LARGEST, 0.0])
        both = is_accepted(X), is_pose(X)
        assert both in counts, f"X={X.tolist()}"
        counts[both] += 1
    assert min(counts.values()) > 20, counts


@pytest.mark.parametrize("mirrored", [np.diag([-1.0, 1.0, 1.0, 1.0]), np.diag([-1.0, -1.0, -1.0, 1.0])])
def test_mirrors_are_not_accepted(mirrored):
    assert not is_accepted(mirrored[None].copy())


def test_what_is_no_array_of_matrices_is_not_accepted():
    X = np.tile(np.eye(4), (6, 1, 1))
    for other in (X[0], X[::2], X.astype(np.float32), X[:0], X.reshape(6, 2, 8), X.transpose(0, 2, 1)):
        assert not is_accepted(other), other.shape
