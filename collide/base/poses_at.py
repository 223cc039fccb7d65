"""Poses of bodies that stand at points and are not turned."""

from __future__ import annotations

import numpy as np


def poses_at(points: np.ndarray) -> np.ndarray:
    """(n, 4, 4) poses without a turn, whose origins are the points (n, 3)."""
    X = np.tile(np.eye(4), (len(points), 1, 1))
    X[:, :3, 3] = points
    return X
