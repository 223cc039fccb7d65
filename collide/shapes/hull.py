"""ConvexHull: the hull of any points, swept by a ball."""

from __future__ import annotations

import numpy as np

from collide.errors import InvalidShape
from collide.geometry.packing import pack_points
from collide.shapes.base import Shape, alone, positive, rows
from collide.transforms import SMALLEST


class ConvexHull(Shape):
    """Exactly the convex hull of the points given, swept by a ball.

    points : (n, 3) in any order [m]: a solid, a flat or a straight set, one point; points that
        are doubled, collinear, coplanar or inside are fine and change nothing.
    faces : (m, 3) vertex ids, optional; checked for shape and range. The set does not depend on
        them.
    radius : of the ball swept over the hull [m], ≥ 0.

    Ids in results are rows of ``points`` as given.
    """

    __slots__ = ("faces", "points", "radius")
    _fields = ("points", "faces", "radius")
    points: np.ndarray
    faces: np.ndarray | None
    radius: float

    def __init__(self, points, *, faces=None, radius: float = 0.0):
        points = rows("ConvexHull", "points", points, (None, 3))
        largest = float(np.abs(points).max())
        if 0.0 < largest < SMALLEST:
            raise InvalidShape(
                f"ConvexHull: points: the largest coordinate is {largest!r}; it must be 0 or at least {SMALLEST:g}: "
                "scale the scene"
            )
        self._store(
            points=points,
            faces=None if faces is None else _check_faces(faces, len(points)),
            radius=positive("ConvexHull", "radius", radius, zero=True),
        )

    @classmethod
    def _from_fields(cls, points, faces, radius):
        return cls(points, faces=faces, radius=radius)

    def _pack(self):
        return alone(pack_points(self.points, self.radius))

    def without_repeats(self) -> ConvexHull:
        """The same set with every point once, in the order of first appearance.

        Files repeat vertices (an STL names each about six times); a support query is a scan.
        Faces are dropped, since they name the old ids.
        """
        distinct, first = np.unique(self.points + 0.0, axis=0, return_index=True)
        if len(distinct) == len(self.points):
            return self
        return ConvexHull(self.points[np.sort(first)], radius=self.radius)


def _check_faces(faces, n: int) -> np.ndarray:
    try:
        array = np.array(faces)
    except ValueError:
        raise InvalidShape("ConvexHull: faces must be (m, 3) vertex ids, got rows of different lengths") from None
    if array.ndim != 2 or array.shape[1] != 3 or not np.issubdtype(array.dtype, np.integer):
        raise InvalidShape(f"ConvexHull: faces must be (m, 3) integers, got {array.shape} {array.dtype}")
    if array.size and (array.min() < 0 or array.max() >= n):
        row = int(np.argmax(((array < 0) | (array >= n)).any(axis=1)))
        raise InvalidShape(f"ConvexHull: faces[{row}] is {array[row].tolist()}, but there are {n} points")
    array = np.ascontiguousarray(array, dtype=np.int64)
    array.flags.writeable = False
    return array
