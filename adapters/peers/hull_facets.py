"""Triangles of a hull, for engines that want a hull's faces together with its points."""

from __future__ import annotations

import numpy as np

from collide.errors import MissingExtra, UnsupportedQuery

#: A hull thinner than this part of its length is called flat: its rounded corners hold no more.
FLAT = 1e-13


def triangulate(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (m, 3) and counterclockwise triangles (k, 3) of the hull of points (n, 3).

    The points are stretched to similar lengths along their principal axes first: a hull keeps its
    faces under a linear map, and Qhull, whose tolerances are absolute, refuses thin plates as given.

    Raises UnsupportedQuery for points, segments and planar sets.
    """
    try:
        from scipy.spatial import ConvexHull, QhullError
    except ImportError:
        raise MissingExtra("scipy", extra="peers", purpose="give other engines the faces of a hull") from None
    distinct = np.unique(points, axis=0)
    centred = distinct - distinct.mean(axis=0)
    _, lengths, axes = np.linalg.svd(centred, full_matrices=False)
    if len(distinct) < 4 or len(lengths) < 3 or lengths[2] <= FLAT * lengths[0]:
        raise UnsupportedQuery(f"a flat hull ({len(distinct)} distinct points) has no faces to give this engine")
    try:
        hull = ConvexHull(centred @ axes.T / lengths)
    except QhullError as error:
        raise UnsupportedQuery(f"no faces found for a hull: {str(error).splitlines()[0]}") from None
    new_id = np.full(len(distinct), -1)
    new_id[hull.vertices] = np.arange(len(hull.vertices))
    triangles = new_id[hull.simplices]
    return np.ascontiguousarray(distinct[hull.vertices]), _outwards(hull, triangles, np.linalg.det(axes))


def _outwards(hull, triangles: np.ndarray, handedness: float) -> np.ndarray:
    """Triangles turned counterclockwise as seen from outside; principal axes may mirror."""
    p, q, r = (hull.points[hull.simplices[:, k]] for k in range(3))
    turned = (np.cross(q - p, r - p) * hull.equations[:, :3]).sum(axis=1) * handedness < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return triangles
