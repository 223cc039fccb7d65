"""The hull of a body, and two questions about it, each a batch: its vertex farthest along a direction, and its point
nearest a point."""

from __future__ import annotations

import numpy as np

from collide.base.poses_at import poses_at
from collide.hull.exact_hull import convex_hull
from collide.pairs.query import distance
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.primitives import Halfspace

_HERE = np.eye(4)
_POINT = ConvexHull(np.zeros((1, 3)))
_BELOW = Halfspace([0.0, 0.0, 1.0], 0.0)


class BodyHull:
    """The hull of points.

    vertices : (h, 3).   dimension : 0 to 3.   n_facets : triangles of its surface; of a flat hull, of both sides.
    shape : the hull of the vertices alone.   size : the longest side of its box [m].
    """

    def __init__(self, points: np.ndarray):
        hull = convex_hull(points)
        self.dimension, self.n_facets = hull.dimension, len(hull.facets)
        self.vertices = np.ascontiguousarray(points[hull.vertices])
        self.shape = ConvexHull(self.vertices)
        self.size = float(np.ptp(self.vertices, axis=0).max())

    def farthest(self, normals: np.ndarray) -> np.ndarray:
        """(m,) rows of ``vertices``, farthest along unit vectors (m, 3): what is deepest in half-spaces that end at the
        frame's origin."""
        return distance(self.shape, _BELOW, _HERE, _turned_to(-normals), check_poses=False).rows["vertices_a"][:, 0]

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """Rows of `PAIR_DTYPE`, the hull beside each point (m, 3)."""
        return rows_beside(self.shape, points)


def rows_beside(hull: ConvexHull, points: np.ndarray) -> np.ndarray:
    """Rows of `PAIR_DTYPE`: a hull as A beside each point (m, 3) as B, in the hull's frame."""
    return distance(hull, _POINT, _HERE, poses_at(points), check_poses=False).rows


def _turned_to(z: np.ndarray) -> np.ndarray:
    """(m, 4, 4) poses at the origin with these third axes, unit vectors (m, 3)."""
    aside = np.eye(3)[np.abs(z).argmin(axis=1)]
    x = np.cross(z, aside)
    x /= np.linalg.norm(x, axis=1)[:, None]
    X = np.tile(_HERE, (len(z), 1, 1))
    X[:, :3, 0], X[:, :3, 1], X[:, :3, 2] = x, np.cross(z, x), z
    return X
