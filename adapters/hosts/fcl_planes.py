"""A `Plane` with a mesh or an octree, which may have pieces on both sides of it: decided facet by facet, box by box.

A connected set meets a plane where it meets both of its half-spaces, and so does each facet. On which side a corner
lies is the sign of a polynomial of the numbers given: doubles where they are certain, fractions where they are not.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

import collide as engine
from collide.adapters.hosts.fcl_geometry import CollisionObject, Plane
from collide.adapters.hosts.fcl_requests import OBJECT_TYPE
from collide.shapes.shape import Shape

#: Sides in doubles are certain beyond this part of the sum of all terms: 30 roundings of 2⁻⁵³, and room.
_ERROR = 64 * 2.0**-53


class _Sides(NamedTuple):
    """heights : (cells, corners) over the plane, to a factor.   signs : the same, exactly.
    points : (cells, corners, 3) of the corners in the body's frame, rounded.
    """

    heights: np.ndarray
    signs: np.ndarray
    points: np.ndarray

    @property
    def crossing(self) -> np.ndarray:
        """Cells with corners on both sides, or on the plane."""
        return np.flatnonzero((self.signs.min(axis=1) <= 0) & (self.signs.max(axis=1) >= 0))


def is_plane_with_pieces(o1: CollisionObject, o2: CollisionObject) -> bool:
    """Whether one is a `Plane` and the other a mesh or an octree."""
    kinds = {o1._geometry._object_type, o2._geometry._object_type} - {OBJECT_TYPE.OT_GEOM}
    return bool(kinds) and (isinstance(o1._geometry, Plane) or isinstance(o2._geometry, Plane))


def plane_meets(o1: CollisionObject, o2: CollisionObject) -> bool:
    """Whether the plane meets a facet of the mesh, or a box of the octree; exactly."""
    return len(_sides(*_plane_first(o1, o2)).crossing) > 0


def plane_gap(o1: CollisionObject, o2: CollisionObject) -> tuple[bool, float, np.ndarray, np.ndarray, int]:
    """(whether they meet, gap or 0, nearest points (3,) of o1 and o2, the facet or box that it is of)."""
    plane, body = _plane_first(o1, o2)
    sides = _sides(plane, body)
    met = sides.crossing
    if len(met):
        cell = int(met[0])
        point = _in_world(body, _point_between(sides.heights[cell], sides.points[cell]))
        return True, 0.0, point, point, cell
    cell, corner = divmod(int(np.argmin(np.abs(sides.heights))), sides.heights.shape[1])
    side = plane._geometry._shapes[0 if sides.signs[cell, corner] > 0 else 1]
    r = engine.distance(side, engine.ConvexHull(sides.points[cell, corner][None]), plane._X, body._X)
    points = np.array(r.point_a), np.array(r.point_b)
    return False, float(r.distance), *(points if plane is o1 else points[::-1]), cell


def sides_to_move(o1: CollisionObject, o2: CollisionObject) -> list[tuple[Shape, Shape]]:
    """(A, B) whose first contact is that of a plane and a body that do not meet: what is above with the half-space
    below, and the other way round.
    """
    plane, body = _plane_first(o1, o2)
    sides = _sides(plane, body)
    above = sides.signs[:, 0] > 0
    pairs = []
    for half, cells in zip(plane._geometry._shapes, (np.flatnonzero(above), np.flatnonzero(~above))):
        if len(cells):
            part = body._geometry._shape if len(cells) == len(above) else body._geometry._of_cells(cells)
            pairs.append((half, part) if plane is o1 else (part, half))
    return pairs


def _plane_first(o1: CollisionObject, o2: CollisionObject) -> tuple[CollisionObject, CollisionObject]:
    return (o1, o2) if isinstance(o1._geometry, Plane) else (o2, o1)


def _in_world(body: CollisionObject, point: np.ndarray) -> np.ndarray:
    return body._X[:3, :3] @ point + body._X[:3, 3]


def _sides(plane: CollisionObject, body: CollisionObject) -> _Sides:
    """Heights are det R_WP times n · X_WP⁻¹ X_WB q − d: no division, and R need not be a rotation to the last bit."""
    middles, offsets = body._geometry._cells()
    n, d, X_WP, X_WB = plane._geometry._n, plane._geometry._d, plane._X, body._X
    m, size = _cofactors(X_WP[:3, :3]) @ n, _cofactors(np.abs(X_WP[:3, :3]), np.add) @ np.abs(n)
    offset, size_of_offset = _scaled_offset(X_WP[:3, :3], d)
    points = middles + offsets
    heights = (points @ X_WB[:3, :3].T + (X_WB[:3, 3] - X_WP[:3, 3])) @ m - offset
    lengths = (np.abs(middles) + np.abs(offsets)) @ np.abs(X_WB[:3, :3]).T + np.abs(X_WB[:3, 3]) + np.abs(X_WP[:3, 3])
    errors = _ERROR * (lengths @ size + size_of_offset)
    signs = np.where(heights > errors, 1, np.where(heights < -errors, -1, 0))
    for cell, corner in np.argwhere(np.abs(heights) <= errors).tolist():
        at = (cell, corner)
        signs[at] = _exact_side(n, d, X_WP, X_WB, middles[at], offsets[at])
    return _Sides(heights, signs, points)


def _cofactors(R: np.ndarray, take=np.subtract) -> np.ndarray:
    """The matrix C with R⁻ᵀ = C / det R; of numbers that are ≥ 0, with ``np.add``, what its terms are at most."""
    following, last = [1, 2, 0], [2, 0, 1]
    first = R[following][:, following] * R[last][:, last]
    return take(first, R[following][:, last] * R[last][:, following])


def _scaled_offset(R: np.ndarray, d: float) -> tuple[float, float]:
    """(d · det R, what its terms are at most)."""
    return d * float(R[0] @ _cofactors(R)[0]), abs(d) * float(np.abs(R[0]) @ _cofactors(np.abs(R), np.add)[0])


def _exact_side(n, d, X_WP, X_WB, middle, offset) -> int:
    """The sign of the height of one corner, in fractions."""
    n, R, t = ([Fraction(x) for x in v.ravel().tolist()] for v in (n, X_WP[:3, :3], X_WP[:3, 3]))
    q = [Fraction(a) + Fraction(b) for a, b in zip(middle.tolist(), offset.tolist())]
    rows = [[Fraction(x) for x in row] for row in X_WB[:3].tolist()]
    p = [sum(a * b for a, b in zip(row, q)) + row[3] - t[k] for k, row in enumerate(rows)]
    C = [[R[3 * ((i + 1) % 3) + (j + 1) % 3] * R[3 * ((i + 2) % 3) + (j + 2) % 3]
          - R[3 * ((i + 1) % 3) + (j + 2) % 3] * R[3 * ((i + 2) % 3) + (j + 1) % 3] for j in range(3)]
         for i in range(3)]
    det = sum(R[j] * C[0][j] for j in range(3))
    height = sum(p[i] * C[i][j] * n[j] for i in range(3) for j in range(3)) - Fraction(d) * det
    return (height > 0) - (height < 0)


def _point_between(heights: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A point of the cell on the plane, to rounding: on the way from its lowest to its highest corner."""
    low, high = int(np.argmin(heights)), int(np.argmax(heights))
    rise = heights[high] - heights[low]
    part = 0.0 if rise <= 0.0 else min(1.0, max(0.0, -heights[low] / rise))
    return points[low] + part * (points[high] - points[low])
