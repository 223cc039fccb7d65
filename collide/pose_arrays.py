"""Arrays of translations and rotations as arrays of poses.

Beside `transforms.py`, of which kernels import: `poses` is a word of theirs, and names alone tell what they depend on.
"""

from __future__ import annotations

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidPose
from collide.transforms import as_poses, rotation_from_rpy, rotation_from_unit


def poses(p, quat_wxyz=None, rpy=None) -> np.ndarray:
    """Poses (N, 4, 4) from N translations and, where asked for, N rotations.

    Parameters
    ----------
    p : (N, 3) or (3,) array_like, float64
        Translations [m]. A single row goes with every row of the other argument, and the other way round.
    quat_wxyz : (N, 4) or (4,) array_like, optional
        Quaternions, scalar first, of any length but 0; normalised here, as `pose` does. Rows in the order of ROS and
        scipy, scalar last, are ``quat_xyzw[:, [3, 0, 1, 2]]``.
    rpy : (N, 3) or (3,) array_like, optional
        Roll, pitch, yaw [rad] about fixed x, y, z axes, as URDF has them. Goes with no quat_wxyz.

    Returns
    -------
    (N, 4, 4) float64
        Row k is ``pose(p[k], ...)`` within rounding; N = 1 where all are single rows.

    Raises
    ------
    InvalidPose
        Where numbers have another shape, lengths do not match, there are two rotations, or a row is not finite, too
        large, or a quaternion of length 0: the row is named.

    Notes
    -----
    O(N): about 0.3 µs a pose.
    """
    if quat_wxyz is not None and rpy is not None:
        raise InvalidPose("poses: give at most one of quat_wxyz and rpy")
    arguments = {"p": _finite_rows("p", p, 3)}
    if quat_wxyz is not None:
        arguments["quat_wxyz"] = _finite_rows("quat_wxyz", quat_wxyz, 4)
    if rpy is not None:
        arguments["rpy"] = _finite_rows("rpy", rpy, 3)
    n = max(map(len, arguments.values())) if min(map(len, arguments.values())) else 0
    if any(len(rows) not in (1, n) for rows in arguments.values()):
        lengths = ", ".join(f"{name} {rows.shape}" for name, rows in arguments.items())
        raise InvalidPose(f"poses: lengths do not match: {lengths}; give equally many rows, or a single one")
    X = np.zeros((n, 4, 4))
    X[:, [0, 1, 2, 3], [0, 1, 2, 3]] = 1.0
    X[:, :3, 3] = arguments["p"]
    if quat_wxyz is not None:
        X[:, :3, :3] = _rotations_from_quaternions(arguments["quat_wxyz"])
    elif rpy is not None:
        X[:, :3, :3] = np.moveaxis(rotation_from_rpy(arguments["rpy"].T), -1, 0)
    return as_poses(X, "poses")


def _finite_rows(name: str, values, width: int) -> np.ndarray:
    """(n, width) finite numbers, from rows or a single one."""
    array = checks.array(f"poses: {name}", values, f"(N, {width})", InvalidPose)
    if array.ndim not in (1, 2) or array.shape[-1] != width:
        raise InvalidPose(f"poses: {name} must have shape (N, {width}) or ({width},), got {array.shape}")
    rows = array.reshape(-1, width)
    bad = ~np.isfinite(rows).all(axis=1)
    if bad.any():
        k = int(np.argmax(bad))
        raise InvalidPose(f"poses: {name}[{k}] has entries that are not finite, got {rows[k].tolist()}")
    return rows


def _rotations_from_quaternions(q: np.ndarray) -> np.ndarray:
    """(n, 3, 3), from (n, 4) scalar first."""
    largest = np.abs(q).max(axis=1, keepdims=True)
    if not largest.all():
        k = int(np.argmin(largest))
        raise InvalidPose(f"poses: quat_wxyz[{k}] is of length 0 and names no rotation, got {q[k].tolist()}")
    q = np.ldexp(q, -np.frexp(largest)[1])  # as of one quaternion
    return np.moveaxis(rotation_from_unit(*(q / np.linalg.norm(q, axis=1, keepdims=True)).T), -1, 0)
