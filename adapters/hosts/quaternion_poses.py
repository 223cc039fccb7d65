"""Poses of positions and quaternions x, y, z, w, as hosts keep them."""

from __future__ import annotations

import math

import numpy as np

from collide.adapters.hosts.host_numbers import shaped


def pose_of(position, quaternion) -> np.ndarray:
    """(4, 4) pose of a position and a quaternion x, y, z, w."""
    (p_x, p_y, p_z), q = shaped("position", position, (3,)).tolist(), shaped("orientation", quaternion, (4,)).tolist()
    length = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    scale = math.sqrt(2.0 / length) if length else math.nan
    x, y, z, w = q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale
    return np.array([
        (1.0 - (y * y + z * z), x * y - z * w, x * z + y * w, p_x),
        (x * y + z * w, 1.0 - (x * x + z * z), y * z - x * w, p_y),
        (x * z - y * w, y * z + x * w, 1.0 - (x * x + y * y), p_z), (0.0, 0.0, 0.0, 1.0),
    ])


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
