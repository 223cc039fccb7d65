"""python-fcl's `Transform`: a rotation and a translation; quaternions are w, x, y, z."""

from __future__ import annotations

import numpy as np

from collide.adapters.hosts.host_numbers import real, shaped
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument


class Transform:
    """A rigid transform, kept as one pose (4, 4).

    ``Transform()``, ``Transform(X)`` with another Transform, a rotation (3, 3), a quaternion (4,) w, x, y, z or a
    translation (3,) [m], ``Transform(rotation or quaternion, translation)``. Quaternions are brought to length 1.
    Rotations are checked when a query uses them. Raises ValueError for anything else.
    """

    __slots__ = ("_X",)

    def __init__(self, *args):
        X = self._X = np.eye(4)
        if len(args) > 2:
            raise ValueError("Too many arguments to Transform().")
        if len(args) == 1 and isinstance(args[0], Transform):
            X[:] = args[0]._X
            return
        if len(args) == 2:
            translation = checks.array("translation", args[1], "(3,)", InvalidArgument)
            X[:3, 3] = shaped("translation", translation.squeeze(), (3,))
        if args:
            data = checks.array("the first argument of Transform", args[0], "(3, 3), (4,) or (3,)", InvalidArgument)
            if data.shape == (3, 3):
                X[:3, :3] = data
            elif data.shape == (4,):
                X[:3, :3] = rotation_of(data)
            elif data.shape == (3,) and len(args) == 1:
                X[:3, 3] = data
            else:
                raise InvalidArgument(f"Transform takes (3, 3), (4,) or (3,) numbers, got shape {data.shape}")

    def getRotation(self):
        """The rotation, a copy (3, 3)."""
        return self._X[:3, :3].copy()

    def getTranslation(self):
        """The translation, a copy (3,) [m]."""
        return self._X[:3, 3].copy()

    def getQuatRotation(self):
        """The rotation as a quaternion (4,) w, x, y, z."""
        return quaternion_of(self._X[:3, :3])

    def setRotation(self, R):
        """R : (3, 3)."""
        self._X[:3, :3] = shaped("R", R, (3, 3))

    def setTranslation(self, T):
        """T : (3,) [m]."""
        self._X[:3, 3] = shaped("T", T, (3,))

    def setQuatRotation(self, q):
        """q : (4,) w, x, y, z."""
        self._X[:3, :3] = rotation_of(shaped("q", q, (4,)))


def rotation_of(q) -> np.ndarray:
    """The rotation (3, 3) of a quaternion (4,) w, x, y, z of any length but 0."""
    w, x, y, z = (real("a quaternion", value) for value in q)
    square = w * w + x * x + y * y + z * z
    if not 0.0 < square < np.inf:
        raise InvalidArgument(f"a quaternion w, x, y, z must be finite and not 0, got {[w, x, y, z]}")
    s = 2.0 / square
    return np.array([
        [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
        [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
        [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
    ])


def quaternion_of(R: np.ndarray) -> np.ndarray:
    """The quaternion (4,) w, x, y, z of a rotation; w, or else the largest component, is positive."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace > 0.0:
        t = np.sqrt(trace + 1.0)
        f = 0.5 / t
        return np.array([0.5 * t, (R[2, 1] - R[1, 2]) * f, (R[0, 2] - R[2, 0]) * f, (R[1, 0] - R[0, 1]) * f])
    i = int(np.argmax(np.diag(R)))
    j, k = (i + 1) % 3, (i + 2) % 3
    t = np.sqrt(R[i, i] - R[j, j] - R[k, k] + 1.0)
    f = 0.5 / t
    q = np.empty(4)
    q[0], q[1 + i] = (R[k, j] - R[j, k]) * f, 0.5 * t
    q[1 + j], q[1 + k] = (R[j, i] + R[i, j]) * f, (R[k, i] + R[i, k]) * f
    return q
