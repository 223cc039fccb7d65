"""Poses of positions and quaternions x, y, z, w, as hosts keep them."""

from __future__ import annotations

import numpy as np

from collide.adapters.hosts.host_numbers import shaped


def pose_of(position, quaternion) -> np.ndarray:
    """(4, 4) pose of a position and a quaternion x, y, z, w."""
    return poses_of(np.append(shaped("position", position, (3,)), shaped("orientation", quaternion, (4,)))[None])[0]


def poses_of(coordinates: np.ndarray) -> np.ndarray:
    """(n, 4, 4) poses of rows (n, 7): position, then a quaternion x, y, z, w of any length but 0."""
    q = coordinates[:, 3:].T
    x, y, z, w = q * np.sqrt(2.0 / (q * q).sum(axis=0))
    X = np.empty((len(coordinates), 4, 4))
    X[:, 0, 0], X[:, 0, 1], X[:, 0, 2] = 1.0 - (y * y + z * z), x * y - z * w, x * z + y * w
    X[:, 1, 0], X[:, 1, 1], X[:, 1, 2] = x * y + z * w, 1.0 - (x * x + z * z), y * z - x * w
    X[:, 2, 0], X[:, 2, 1], X[:, 2, 2] = x * z - y * w, y * z + x * w, 1.0 - (x * x + y * y)
    X[:, :3, 3] = coordinates[:, :3]
    X[:, 3] = (0.0, 0.0, 0.0, 1.0)
    return X
