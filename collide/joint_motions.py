"""Poses that joints make: (N, 4, 4) from joint values, every entry by the same operations in any batch."""

from __future__ import annotations

import math

import numpy as np


def product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """A @ B for (N, 4, 4) poses, every entry by the same three products and sums in any batch.

    A matrix product from a library may round differently by the size of the batch.
    """
    R = A[:, :3, 0:1] * B[:, 0:1, :] + A[:, :3, 1:2] * B[:, 1:2, :] + A[:, :3, 2:3] * B[:, 2:3, :]
    out = np.empty((R.shape[0], 4, 4))
    out[:, :3] = R
    out[:, :3, 3] += A[:, :3, 3]
    out[:, 3] = (0.0, 0.0, 0.0, 1.0)
    return out


def translation(p: np.ndarray) -> np.ndarray:
    X = np.zeros((len(p), 4, 4))
    X[:, (0, 1, 2, 3), (0, 1, 2, 3)] = 1.0
    X[:, :3, 3] = p
    return X


def rotation(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(N, 4, 4) rotations by ``angle`` (N,) about a unit ``axis`` (3,): Rodrigues' formula.

    The diagonal is a² + cos·(1 − a²), so that turning about a coordinate axis leaves exact 0 and 1.
    """
    x, y, z = axis
    s, c = np.sin(angle), np.cos(angle)
    t = 1.0 - c
    X = np.zeros((len(angle), 4, 4))
    X[:, 0, 0], X[:, 1, 1], X[:, 2, 2] = (a * a + c * (1.0 - a * a) for a in (x, y, z))
    X[:, 0, 1], X[:, 1, 0] = x * y * t - z * s, x * y * t + z * s
    X[:, 0, 2], X[:, 2, 0] = x * z * t + y * s, x * z * t - y * s
    X[:, 1, 2], X[:, 2, 1] = y * z * t - x * s, y * z * t + x * s
    X[:, 3, 3] = 1.0
    return X


def planar_motion(normal: np.ndarray, values: np.ndarray) -> np.ndarray:
    """A shift within the plane across ``normal``, then a turn about it."""
    # The first in-plane axis is the coordinate axis farthest from the normal, made orthogonal to
    # it: for normal z the two are x and y themselves.
    first = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = first - (first @ normal) * normal
    first /= math.sqrt(float(first @ first))
    second = np.cross(normal, first)
    X = rotation(normal, values[:, 2])
    X[:, :3, 3] = values[:, 0:1] * first + values[:, 1:2] * second
    return X


def floating_motion(values: np.ndarray) -> np.ndarray:
    """x, y, z, roll, pitch, yaw: the turns about fixed x, y, z axes, as URDF has them."""
    roll, pitch, yaw = (rotation(axis, values[:, 3 + k]) for k, axis in enumerate(np.eye(3)))
    X = product(yaw, product(pitch, roll))
    X[:, :3, 3] = values[:, :3]
    return X
