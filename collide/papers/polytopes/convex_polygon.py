"""ConvexPolygon: a convex set in the plane by its corners, and where it stands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidPose, InvalidShape
from collide.papers.polytopes import planar_hull
from collide.shapes.shape import rows
from collide.transforms import SMALLEST, refuse_no_pose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class ConvexPolygon:
    """Exactly the convex hull of points in the plane; immutable, picklable, compared by value.

    Parameters
    ----------
    points : (n, 2) array_like, float64
        In any order, in the frame of the polygon [m]. Doubled points, inner points and points between others on an edge
        change nothing. All may lie on a line, or in a single place.

    Attributes
    ----------
    vertices : (m, 2) float64
        Corners, counter-clockwise, no three collinear [m]: the points as given, if already corners in order.
    ids : (m,) int64
        Index of each corner among the points.

    Raises
    ------
    InvalidShape
        Where points are missing, not finite or out of range.

    Notes
    -----
    The hull is exact (`planar_hull.py`) and takes O(n log n). Only the corners are kept: questions about two
    polygons are answered from them in O(log n + log m) (`polygons_meet`).
    """

    __slots__ = ("__weakref__", "ids", "vertices")
    vertices: np.ndarray
    ids: np.ndarray

    def __init__(self, points: ArrayLike):
        read = rows("ConvexPolygon", "points", points, (None, 2))
        largest = float(np.abs(read).max())
        if 0.0 < largest < SMALLEST:
            raise InvalidShape(
                f"ConvexPolygon: points: the largest coordinate is {largest!r}; it must be 0 or at least {SMALLEST:g}: "
                "scale the plane"
            )
        ids = planar_hull.hull_of_points(read)
        n = len(ids)
        if n == len(read):  # already counter-clockwise: keep the order
            first = int(np.argmin(ids))
            if (np.roll(ids, -first) == np.arange(n)).all():
                ids = np.arange(n)
        vertices = np.ascontiguousarray(read[ids]) + 0.0  # −0.0 and 0.0 are one number
        for array in (vertices, ids):
            array.flags.writeable = False
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "ids", ids)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"ConvexPolygon is immutable; make a new one instead of setting {name}")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"ConvexPolygon is immutable; {name} cannot be deleted")

    def __copy__(self) -> ConvexPolygon:
        return self  # nothing about it can change

    def __deepcopy__(self, memo: dict) -> ConvexPolygon:
        return self

    def __reduce__(self):
        return ConvexPolygon, (self.vertices,)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ConvexPolygon) and np.array_equal(self.vertices, other.vertices)

    def __hash__(self) -> int:
        return hash(("ConvexPolygon", self.vertices.tobytes()))

    def __repr__(self) -> str:
        return f"ConvexPolygon(<{len(self.vertices)} vertices>)"


def planar_pose(xy: ArrayLike = (0.0, 0.0), angle: float = 0.0) -> np.ndarray:
    """The pose of a frame in the plane.

    Parameters
    ----------
    xy : (2,) array_like, float64
        Its origin [m].
    angle : float
        By which its axes are turned, counter-clockwise [rad].

    Returns
    -------
    (3, 3) float64
        The homogeneous matrix, ``p_Wq = X_WA @ p_Aq`` with q as (x, y, 1).

    Raises
    ------
    InvalidPose
        Where numbers are missing, not finite or out of range.
    """
    position = checks.array("planar_pose: xy", xy, "(2,)", InvalidPose)
    radians = checks.number(angle)
    if position.shape != (2,) or radians is None or not np.isfinite(radians):
        raise InvalidPose(
            f"planar_pose: xy must be (2,) and angle a finite number, got {checks.brief(xy)} and "
            f"{checks.brief(angle)}"
        )
    c, s = np.cos(radians), np.sin(radians)
    X = np.array([[c, -s, position[0]], [s, c, position[1]], [0.0, 0.0, 1.0]])
    return planar_poses(X, "planar_pose")[0][0]


def planar_poses(X, name: str) -> tuple[np.ndarray, bool]:
    """(poses (n, 3, 3), whether a single one was given): used entry by entry as they stand.

    Raises InvalidPose where the shape is another, entries are not finite, or too far from a rotation.
    """
    read = checks.array(name, X, "(3, 3)", InvalidPose)
    if read.ndim not in (2, 3) or read.shape[-2:] != (3, 3):
        raise InvalidPose(f"{name} must have shape (3, 3) or (N, 3, 3), a pose in the plane, got {read.shape}")
    poses = np.ascontiguousarray(read.reshape(-1, 3, 3))
    refuse_no_pose(poses, name, skip="")
    return poses, read.ndim == 2
