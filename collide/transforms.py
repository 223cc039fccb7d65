"""Rigid transforms, and the notation every file of collide uses.

Frames stand in the names, as Drake writes them:

======== =========================================================================
X_WA     pose of frame A in the world W: a (4, 4) matrix, ``p_Wq = X_WA @ p_Aq``
R_WA     its rotation, (3, 3): the columns are A's axes in W
p_WA     its translation, (3,): A's origin in W
p_WAq    position from A's origin to the point q, in W's axes
nhat_AB_W unit vector from A towards B, in W's axes
X_WAs    a batch of poses, (N, 4, 4)
======== =========================================================================

Frames cancel from left to right: ``X_WC = X_WA @ X_AB @ X_BC``. Units are metres and radians.

The numbers given are the problem: a matrix is used as it stands, entry by entry, and is never
re-orthonormalised. `as_poses` refuses what is too far from a rotation to be one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from collide.base import argument_checks as checks
from collide.base.foreign_arguments import foreign_arguments
from collide.errors import InvalidPose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    class HasMatrix(Protocol):
        """What describes itself by a matrix (3, 3) or (4, 4), or many: scipy's Rotation and RigidTransform."""

        def as_matrix(self) -> np.ndarray: ...

    #: One pose, as `pose` gives it: (4, 4) float64.
    Pose = np.ndarray[tuple[int, int], np.dtype[np.float64]]
    #: What queries take for one pose or many: matrices, (R, t), rotations.
    PoseLike = ArrayLike | HasMatrix | tuple[ArrayLike | HasMatrix, ArrayLike]

#: How far ``R.T @ R`` may be from the identity, in its largest entry.
ROTATION_TOLERANCE = 1e-4
#: Coordinates beyond this are refused: products of six of them must stay finite.
LARGEST = 1e50
#: Angles in radians are refused beyond this, a turn and the rounding of one written down: they are degrees, mostly.
FULL_TURN = 2.0 * math.pi * (1.0 + 1e-4)
#: Positive sizes below this are refused, for the same reason at the other end.
SMALLEST = 1e-50


@foreign_arguments
def pose(xyz=(0.0, 0.0, 0.0), *, rpy=None, rpy_deg=None, quat_wxyz=None, quat_xyzw=None, R=None) -> Pose:
    """A (4, 4) pose from a translation and a rotation, described in any of five ways.

    Parameters
    ----------
    xyz : (3,) array_like, float64
        Translation [m].
    rpy : (3,) array_like, optional
        Roll, pitch, yaw [rad] about fixed x, y, z axes, as in URDF; each at most a full turn.
    rpy_deg : (3,) array_like, optional
        The same in degrees, of any size; multiples of 90 give entries of exactly 0 and ±1.
    quat_wxyz : (4,) array_like, optional
        Quaternion, scalar first, of any length but 0; normalised here, because a quaternion in a file carries rounded
        digits and means the rotation.
    quat_xyzw : (4,) array_like, optional
        The same, scalar last, as in ROS and scipy.
    R : (3, 3) array_like, optional
        Rotation, used as given; or an object with ``as_matrix()``, like scipy's Rotation.

    Returns
    -------
    (4, 4) float64
        The homogeneous matrix.

    Raises
    ------
    InvalidPose
        Where numbers have another shape, are not finite or make no rotation, an angle in radians exceeds a full turn,
        or two rotations are given.
    """
    if rpy is None and rpy_deg is None and quat_wxyz is None and quat_xyzw is None and R is None:
        shifted = _plain_shift(xyz)
        if shifted is not None:
            return shifted
    if sum(option is not None for option in (rpy, rpy_deg, quat_wxyz, quat_xyzw, R)) > 1:
        raise InvalidPose("pose: give at most one of rpy, rpy_deg, quat_wxyz, quat_xyzw and R")
    X = np.eye(4)
    if rpy is not None:
        angles = _finite("rpy", rpy, (3,))
        refuse_degrees("pose: rpy", angles[None])
        X[:3, :3] = rotation_from_rpy(angles)
    elif rpy_deg is not None:
        X[:3, :3] = rotation_from_degrees(_finite("rpy_deg", rpy_deg, (3,)))
    elif quat_wxyz is not None:
        X[:3, :3] = _rotation_from_quaternion(_finite("quat_wxyz", quat_wxyz, (4,)))
    elif quat_xyzw is not None:
        X[:3, :3] = _rotation_from_quaternion(np.roll(_finite("quat_xyzw", quat_xyzw, (4,)), 1))
    elif R is not None:
        X[:3, :3] = _finite("R", _matrix_of(R), (3, 3))
    X[:3, 3] = _finite("xyz", xyz, (3,))
    return as_pose(X, "pose")


def _plain_shift(xyz) -> Pose | None:
    """The pose of three plain numbers that pass every check; ``None`` for anything else, read by the long way."""
    if xyz.__class__ is np.ndarray and xyz.dtype is _FLOAT64:
        xyz = xyz.tolist()
    if (xyz.__class__ is not tuple and xyz.__class__ is not list) or len(xyz) != 3:
        return None
    for value in xyz:
        if (value.__class__ is not float and value.__class__ is not int) or not -LARGEST <= value <= LARGEST:
            return None
    X = _IDENTITY.copy()
    X[0, 3], X[1, 3], X[2, 3] = xyz
    return X


def _finite(name: str, values, shape) -> np.ndarray:
    array = checks.array(f"pose: {name}", values, str(shape), InvalidPose)
    if array.shape != shape or not np.isfinite(array).all():
        known = "; a matrix (4, 4) is a pose already" if name == "xyz" and array.shape == (4, 4) else ""
        raise InvalidPose(f"pose: {name} must be {shape} finite numbers, got {checks.brief(values)}{known}")
    return array


def _matrix_of(R):
    """The matrix of an object with ``as_matrix()``, anything else unchanged."""
    return R.as_matrix() if callable(getattr(R, "as_matrix", None)) else R


def rotation_from_rpy(rpy: np.ndarray) -> np.ndarray:
    """(3, 3) of three angles, (3, 3, n) of three rows of n."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rotation_from_degrees(rpy_deg: np.ndarray) -> np.ndarray:
    """(3, 3) rotation of roll, pitch, yaw [degrees]; multiples of 90° give exact 0 and ±1."""
    R = np.eye(3)
    for axis, angle in enumerate(rpy_deg):
        turns = angle / 90.0
        if turns == round(turns):
            c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(turns) % 4]
        else:
            c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        i, j = (axis + 1) % 3, (axis + 2) % 3
        R_axis = np.eye(3)
        R_axis[i, i], R_axis[i, j], R_axis[j, i], R_axis[j, j] = c, -s, s, c
        R = R_axis @ R
    return R


def refuse_degrees(name: str, rpy: np.ndarray) -> None:
    """Refuse angles (n, 3) [rad] beyond a full turn, which are degrees by all likelihood. Raises InvalidPose."""
    beyond = np.abs(rpy).max(axis=1, initial=0.0) > FULL_TURN
    if beyond.any():
        k = int(np.argmax(beyond))
        where = f"{name}[{k}]" if len(rpy) > 1 else name
        raise InvalidPose(
            f"{where} holds radians, and {rpy[k].tolist()} exceeds a full turn: are these degrees? Then write "
            "rpy_deg=; radians of several turns are numpy.remainder(rpy, 2 * numpy.pi)"
        )


def _rotation_from_quaternion(q: np.ndarray) -> np.ndarray:
    largest = np.abs(q).max()
    if largest == 0.0:
        raise InvalidPose(f"pose: a quaternion of length 0 names no rotation, got {q.tolist()}")
    q = np.ldexp(q, -np.frexp(largest)[1])  # squares neither overflow nor vanish; a power of two rounds nothing
    return rotation_from_unit(*(q / np.linalg.norm(q)))


def rotation_from_unit(w, x, y, z) -> np.ndarray:
    """(3, 3) of four numbers, (3, 3, n) of four columns."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def inverse_pose(X: np.ndarray) -> np.ndarray:
    """(4, 4) inverse of a pose, by its transpose."""
    inverted = np.eye(4)
    inverted[:3, :3] = X[:3, :3].T
    inverted[:3, 3] = -(X[:3, :3].T @ X[:3, 3])
    return inverted + 0.0


def as_poses(X: PoseLike, name: str = "X", *, check: bool = True) -> np.ndarray:
    """Poses as a C-contiguous float64 batch (N, 4, 4); a single pose gives N = 1.

    Parameters
    ----------
    X : (4, 4) or (N, 4, 4) homogeneous matrices, or their first three rows, (3, 4) or (N, 3, 4); a tuple ``(R, t)`` of
        a (3, 3) rotation and a (3,) translation (either with a leading N); or what gives rotations (3, 3) or poses
        (4, 4) by ``as_matrix()``, as scipy's Rotation and RigidTransform do, alone or as R.
    name : how error messages call the argument.
    check : refuse matrices with max|RᵀR − I| > 1e-4 or det ≤ 0. Finite numbers and the last row
        are always checked.

    Raises
    ------
    InvalidPose : names the argument, the entry of the batch and the offending value; of rows of 7 numbers, translation
        and quaternion, whose order is not told, how to call `pose_arrays.poses`.
    """
    return poses_as_given(X, name, check=check)[0]


def as_pose(X: PoseLike, name: str = "X", *, check: bool = True) -> np.ndarray:
    """A pose as a float64 matrix (4, 4), the caller's own array where already float64; checked as by `as_poses`.

    Raises InvalidPose. About 3 µs for a float64 array.
    """
    if type(X) is np.ndarray and X.shape == (4, 4) and X.dtype is _FLOAT64 and _is_surely_pose(*X.tolist()):
        return X
    batch = as_poses(X, name, check=check)
    if len(batch) != 1:
        raise InvalidPose(f"{name} must be one (4, 4) pose, got {batch.shape}: ask pose by pose")
    return batch[0]


def poses_as_given(X: PoseLike, name: str, *, check: bool = True) -> tuple[np.ndarray, bool]:
    """(poses as `as_poses` gives them, whether a single one was given)."""
    check = checks.true_or_false("check_poses: check", check)
    batch, single = unchecked_poses(X, name)
    if not (check and _are_surely_poses(batch)):
        refuse_no_pose(batch, name, check)
    return batch, single


def unchecked_poses(X: PoseLike, name: str) -> tuple[np.ndarray, bool]:
    """The same for kernels, which check entries themselves: the caller's own memory where the array holds doubles in C
    order, else a single copy.
    """
    if X is None:
        raise InvalidPose(f"{name} must be a pose (4, 4), got None: the identity is collide.pose()")
    full = _from_tuple(X, name) if isinstance(X, tuple) else _from_object(X, name)
    if full.ndim in (2, 3) and full.shape[-2:] == (3, 4):
        full = _from_tuple((full[..., :3], full[..., 3]), name)
    if full.ndim not in (2, 3) or full.shape[-2:] != (4, 4):
        raise InvalidPose(f"{name} must have shape (4, 4) or (N, 4, 4), got {full.shape}{_advice(full)}")
    return np.ascontiguousarray(full.reshape(-1, 4, 4)), full.ndim == 2


def _advice(values: np.ndarray) -> str:
    """How to hand in a position or a rotation alone, or a row of translation and quaternion, whose order the row does
    not tell.
    """
    if values.shape == (3,):
        return f": a position alone is collide.pose({tuple(values.tolist())})"
    if values.shape == (3, 3):
        return ": a rotation alone is collide.pose(R=rotation), three positions are collide.poses(positions)"
    if values.ndim == 2 and values.shape[1] == 3:
        return ": positions alone are collide.poses(positions)"
    if values.ndim not in (1, 2) or values.shape[-1] != 7:
        return ""
    return (
        ": the order of a quaternion within a row of 7 numbers differs from library to library; say which it is, "
        "collide.poses(rows[:, :3], quat_wxyz=rows[:, 3:]) where the scalar comes first, "
        "quat_wxyz=rows[:, [6, 3, 4, 5]] where it comes last"
    )


def refuse_no_pose(batch: np.ndarray, name: str, check: bool = True, skip: str = " (check_poses=False skips this)"):
    """Refuse batches with matrices other than poses of space, (N, 4, 4), or of the plane, (N, 3, 3).

    check : refuse matrices other than rotations.   skip : text on skipping the check.
    Raises InvalidPose naming the argument, the entry of the batch and the value.
    """
    d = batch.shape[-1] - 1
    last = (*(0,) * d, 1)
    _refuse(~np.isfinite(batch).all(axis=(1, 2)), batch, name, "has entries that are not finite")
    _refuse((batch[:, d] != last).any(axis=1), batch, name, f"must end in the row {last}")
    _refuse((np.abs(batch[:, :d]) > LARGEST).any(axis=(1, 2)), batch, name, f"exceeds {LARGEST:g}")
    if not check:
        return
    R = batch[:, :d, :d]
    off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(d)).max(axis=(1, 2))
    _refuse(
        off > ROTATION_TOLERANCE, batch, name, f"is not a rotation: |RᵀR − I| exceeds {ROTATION_TOLERANCE:g}{skip}"
    )
    _refuse(np.linalg.det(R) <= 0, batch, name, "mirrors (determinant ≤ 0): a rigid pose must not")


def _to_floats(X, name: str) -> np.ndarray:
    return checks.array(name, X, "(4, 4)", InvalidPose)


def _from_object(X, name: str) -> np.ndarray:
    matrix = _matrix_of(X)
    array = _to_floats(matrix, name)
    return array if matrix is X or array.shape[-2:] != (3, 3) else _from_tuple((array, np.zeros(3)), name)


def _from_tuple(X: tuple, name: str) -> np.ndarray:
    if len(X) != 2:
        numbers = [checks.number(value) for value in X]
        advice = "" if None in numbers else _advice(np.array(numbers))
        raise InvalidPose(f"{name}: a tuple must be (R, t), got {len(X)} items{advice}")
    R, t = _to_floats(_matrix_of(X[0]), name), _to_floats(X[1], name)
    if R.shape[-2:] != (3, 3) or t.shape[-1:] != (3,) or R.ndim > 3 or t.ndim > 2:
        raise InvalidPose(f"{name}: (R, t) must have shapes (3, 3) and (3,), got {R.shape} and {t.shape}")
    try:
        batch = np.broadcast_shapes(R.shape[:-2], t.shape[:-1])
    except ValueError:
        raise InvalidPose(f"{name}: batches of R {R.shape} and t {t.shape} do not match") from None
    full = np.zeros((*batch, 4, 4))
    full[..., :3, :3], full[..., :3, 3], full[..., 3, 3] = R, t, 1.0
    return full


#: So far from a rotation a matrix may be that is accepted without the check by `refuse_no_pose`, which rounds
#: otherwise.
SAFE_TOLERANCE = 0.5 * ROTATION_TOLERANCE
#: Poses checked together: their entries stay in the cache.
_TOGETHER = 1024
_FLOAT64 = np.dtype(np.float64)
_IDENTITY = np.eye(4)


def _is_surely_pose(row_x: list, row_y: list, row_z: list, last: list) -> bool:
    """Whether a matrix is a pose well within the tolerance; NaN is not."""
    (a, b, c, x), (d, e, f, y), (g, h, i, z) = row_x, row_y, row_z
    return (
        last == [0.0, 0.0, 0.0, 1.0]
        and -LARGEST <= x <= LARGEST and -LARGEST <= y <= LARGEST and -LARGEST <= z <= LARGEST
        and -SAFE_TOLERANCE <= a * a + d * d + g * g - 1.0 <= SAFE_TOLERANCE
        and -SAFE_TOLERANCE <= b * b + e * e + h * h - 1.0 <= SAFE_TOLERANCE
        and -SAFE_TOLERANCE <= c * c + f * f + i * i - 1.0 <= SAFE_TOLERANCE
        and -SAFE_TOLERANCE <= a * b + d * e + g * h <= SAFE_TOLERANCE
        and -SAFE_TOLERANCE <= a * c + d * f + g * i <= SAFE_TOLERANCE
        and -SAFE_TOLERANCE <= b * c + e * f + h * i <= SAFE_TOLERANCE
        and a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.5
    )


def _are_surely_poses(batch: np.ndarray) -> bool:
    """Whether all matrices (N, 4, 4) are; about 50 ns each."""
    if len(batch) == 1:
        return _is_surely_pose(*batch[0].tolist())
    with np.errstate(invalid="ignore", over="ignore"):
        return all(_is_surely_rigid(batch[k : k + _TOGETHER]) for k in range(0, len(batch), _TOGETHER))


def _is_surely_rigid(block: np.ndarray) -> bool:
    columns = np.ascontiguousarray(block.reshape(-1, 16).T)
    (a, b, c), (d, e, f), (g, h, i) = columns[0:3], columns[4:7], columns[8:11]
    worst = np.abs(a * a + d * d + g * g - 1.0)
    for length in (b * b + e * e + h * h - 1.0, c * c + f * f + i * i - 1.0):
        np.maximum(worst, np.abs(length), out=worst)  # NaN stays
    for product in (a * b + d * e + g * h, a * c + d * f + g * i, b * c + e * f + h * i):
        np.maximum(worst, np.abs(product), out=worst)
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return bool(
        worst.max() <= SAFE_TOLERANCE and determinant.min() > 0.5 and np.abs(columns[3:12:4]).max() <= LARGEST
        and not columns[12:15].any() and (columns[15] == 1.0).all()
    )


def _refuse(bad: np.ndarray, X: np.ndarray, name: str, complaint: str) -> None:
    if bad.any():
        k = int(np.argmax(bad))
        where = f"{name}[{k}]" if len(X) > 1 else name
        raise InvalidPose(f"{where} {complaint}, got {X[k].tolist()}")
