"""What is a pose inside kernels is what is one in Python: matrices on the brink and of every kind of damage."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, pose, random_pose, rng_of
from reproduction import reproducing

from collide.errors import InvalidPose
from collide.lowering.shape_table import POSE, POSE_SLOP, POSE_STRETCH, POSE_TERMS
from collide.narrowphase.pose_batches import set_pose
from collide.transforms import LARGEST, ROTATION_TOLERANCE, as_poses

pytestmark = pytest.mark.plain_kernels


def in_python(X: np.ndarray) -> bool:
    try:
        as_poses(X, "X_WB")
    except InvalidPose:
        return False
    return True


def in_kernels(X: np.ndarray, check: bool = True) -> tuple[bool, list[float]]:
    row = [np.nan] * POSE
    with np.errstate(all="ignore"):
        return bool(set_pose(row, 0, np.ravel(X), check)), row


def damaged(rng) -> tuple[str, np.ndarray]:
    X = (
        random_pose(rng, 3.0)
        if rng.random() < 0.7
        else pose(LATTICE_ROTATIONS[int(rng.integers(24))], rng.integers(-3, 4, 3))
    )
    kind = str(rng.choice(["none", "on the brink", "scaled", "mirror", "last row", "no number", "too far", "sheared"]))
    i, j = rng.integers(0, 3, 2)
    if kind == "on the brink":
        X[i, j] += ROTATION_TOLERANCE * rng.uniform(-3, 3)
    elif kind == "scaled":
        X[:3, :3] *= 1 + ROTATION_TOLERANCE * rng.uniform(-2, 2)
    elif kind == "mirror":
        X[:3, i] *= -1
    elif kind == "last row":
        X[3, rng.integers(4)] += rng.choice([1e-300, 1.0, np.nan])
    elif kind == "no number":
        X[i, rng.integers(4)] = rng.choice([np.nan, np.inf, -np.inf])
    elif kind == "too far":
        X[i, 3] = LARGEST * rng.choice([0.5, 1.0, -1.0, 1 + 2**-52, 4.0])
    elif kind == "sheared":
        X[:3, :3] = X[:3, :3] @ np.array([[1.0, rng.uniform(-1, 1), 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    return kind, X


def test_kernels_and_python_agree_on_what_a_pose_is():
    rng = rng_of("pose batches")
    seen: Counter = Counter()
    for _ in range(1500):
        kind, X = damaged(rng)
        with reproducing("X = {X}  # tests/narrowphase/test_pose_batches.py", X=X):
            assert in_kernels(X)[0] == in_python(X)
        seen[kind, in_python(X)] += 1
    assert all(seen[kind, True] > 10 for kind in ("none", "on the brink", "scaled", "too far")), seen
    assert all(
        seen[kind, False] > 10
        for kind in ("on the brink", "scaled", "mirror", "last row", "no number", "too far", "sheared")
    ), seen


def test_rows_of_poses():
    """R row by row, then t; nothing is rounded, and the stretch bounds what the matrix does to any vector."""
    rng = rng_of("rows of poses")
    for _ in range(100):
        kind, X = damaged(rng)
        accepted, row = in_kernels(X, check=False)
        if not accepted:
            assert kind in ("last row", "no number", "too far"), (
                "of a matrix that need be no rotation only the size is asked"
            )
            continue
        assert row[:9] == X[:3, :3].ravel().tolist() and row[9:12] == X[:3, 3].tolist()
        assert (row[POSE_SLOP], row[POSE_TERMS]) == (0.0, -1.0)
        assert np.linalg.norm(X[:3, :3], 2) <= row[POSE_STRETCH] * (1 + 1e-14) <= 2.0 * np.linalg.norm(X[:3, :3], 2)
