"""Arrays of translations and rotations as arrays of poses.

Beside `transforms.py`, of which kernels import: `poses` is a word of theirs, and names alone tell what they depend on.
"""

from __future__ import annotations

import numpy as np

from collide.base import argument_checks as checks
from collide.base.foreign_arguments import foreign_arguments
from collide.errors import InvalidPose
from collide.transforms import (
    as_poses,
    refuse_degrees,
    rotation_from_degrees,
    rotation_from_rpy,
    rotation_from_unit,
)


@foreign_arguments
def poses(p, quat_wxyz=None, rpy=None, *, rpy_deg=None, quat_xyzw=None) -> np.ndarray:
    """Poses (N, 4, 4) from N translations and, where asked for, N rotations.

    Parameters
    ----------
    p : (N, 3) or (3,) array_like, float64
        Translations [m]. A single row goes with every row of the other argument, and the other way round.
    quat_wxyz : (N, 4) or (4,) array_like, optional
        Quaternions, scalar first, of any length but 0; normalised here, as `pose` does.
    rpy : (N, 3) or (3,) array_like, optional
        Roll, pitch, yaw [rad] about fixed x, y, z axes, as URDF has them; each at most a full turn.
    rpy_deg : (N, 3) or (3,) array_like, optional
        The same in degrees; multiples of 90 give entries of exactly 0 and ±1.
    quat_xyzw : (N, 4) or (4,) array_like, optional
        Quaternions, scalar last, as in ROS and scipy.

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
    O(N): about 0.3 µs a pose, 20 µs of degrees.
    """
    rotations = {"quat_wxyz": quat_wxyz, "quat_xyzw": quat_xyzw, "rpy": rpy, "rpy_deg": rpy_deg}
    described = [name for name, rows in rotations.items() if rows is not None]
    if len(described) > 1:
        raise InvalidPose(f"poses: give at most one of quat_wxyz, quat_xyzw, rpy and rpy_deg, got {described}")
    arguments = {"p": _finite_rows("p", p, 3)}
    for name in described:
        arguments[name] = _finite_rows(name, rotations[name], 4 if name.startswith("quat") else 3)
    n = max(map(len, arguments.values())) if min(map(len, arguments.values())) else 0
    if any(len(rows) not in (1, n) for rows in arguments.values()):
        lengths = ", ".join(f"{name} {rows.shape}" for name, rows in arguments.items())
        raise InvalidPose(f"poses: lengths do not match: {lengths}; give equally many rows, or a single one")
    X = np.zeros((n, 4, 4))
    X[:, [0, 1, 2, 3], [0, 1, 2, 3]] = 1.0
    X[:, :3, 3] = arguments["p"]
    if described:
        X[:, :3, :3] = _ROTATIONS[described[0]](arguments[described[0]])
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


def _rotations_from_rpy(rpy: np.ndarray) -> np.ndarray:
    """(n, 3, 3), from (n, 3) [rad]."""
    refuse_degrees("poses: rpy", rpy)
    return np.moveaxis(rotation_from_rpy(rpy.T), -1, 0)


def _rotations_from_quaternions(q: np.ndarray, name: str = "quat_wxyz") -> np.ndarray:
    """(n, 3, 3), from (n, 4) scalar first.   name : for messages."""
    largest = np.abs(q).max(axis=1, keepdims=True)
    if not largest.all():
        k = int(np.argmin(largest))
        raise InvalidPose(f"poses: {name}[{k}] is of length 0 and names no rotation, got {q[k].tolist()}")
    q = np.ldexp(q, -np.frexp(largest)[1])  # as of one quaternion
    return np.moveaxis(rotation_from_unit(*(q / np.linalg.norm(q, axis=1, keepdims=True)).T), -1, 0)


#: Rows of rotations (n, 3) or (n, 4) as matrices (n, 3, 3), by the name of the argument.
_ROTATIONS = {
    "quat_wxyz": _rotations_from_quaternions,
    "quat_xyzw": lambda q: _rotations_from_quaternions(q[:, [3, 0, 1, 2]], "quat_xyzw (scalar first here)"),
    "rpy": _rotations_from_rpy,
    "rpy_deg": lambda rows: np.array([rotation_from_degrees(row) for row in rows]).reshape(-1, 3, 3),
}
