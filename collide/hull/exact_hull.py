"""The convex hull of points in space, exactly, as a closed surface of triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.hull.quickhull import HULL_EACH, HULL_FIXED, quickhull
from collide.kernels import address_of


class Hull(NamedTuple):
    """The hull of a cloud, by rows of the points given.

    dimension : 3 solid, 2 flat, 1 a segment, 0 a point; exact.
    vertices : (h,) int32, sorted; no two are the same point. Their hull is exactly the hull of all points. Most of them
    are extreme; a few may lie on a facet or an edge.
    facets : (f, 3) int32, counter-clockwise seen from outside, of positive area. Solid: a closed surface with 2 h − 4
    facets. Flat: the triangles of the polygon, then the same from the other side. Segment, point: f = 0.
    """

    dimension: int
    vertices: np.ndarray
    facets: np.ndarray


def convex_hull(points: np.ndarray) -> Hull:
    """The hull of points (n, 3), any finite doubles, repeated, collinear, coplanar or inside as they may be.

    The same points in the same order give the same rows. About O(n log n), see
    `quickhull`. Raises ValueError for anything but finite rows.
    """
    points_given = np.asarray(points, dtype=np.float64)
    if points_given.ndim != 2 or points_given.shape[1] != 3 or not len(points_given):
        raise ValueError(f"points must be (n, 3) with n ≥ 1, got {points_given.shape}")
    if len(points_given) >= 2**26:
        raise ValueError(f"at most {2**26 - 1} points, got {len(points_given)}")
    if not np.isfinite(points_given).all():
        raise ValueError(f"points[{int(np.argmin(np.isfinite(points_given).all(axis=1)))}] is not finite")
    points = np.ascontiguousarray(points_given)
    memory = np.empty(HULL_EACH * len(points) + HULL_FIXED, dtype=np.uint8)
    dimension = quickhull(address_of(points), len(points), address_of(memory))
    if dimension < 0:
        raise AssertionError("quickhull: the rim of a visible region is no simple cycle")
    n_facets, n_vertices, facets_at, vertices_at = memory[:32].view(np.int64).tolist()
    start = address_of(memory)
    facets = memory[facets_at - start :][: 12 * n_facets].view(np.int32).reshape(-1, 3)
    vertices = memory[vertices_at - start :][: 4 * n_vertices].view(np.int32)
    return Hull(int(dimension), vertices.copy(), facets.copy())
