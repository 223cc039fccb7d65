"""The convex hull of points in space, exactly, as a closed surface of triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.hull.first_simplex import APICES
from collide.hull.growing_hull import FACET, PLANE, STATE
from collide.hull.quickhull import quickhull
from collide.kernels import address_of
from collide.numerics.orientation import DIGITS, WORK


class Hull(NamedTuple):
    """The hull of a cloud, by rows of the points given.

    dimension : 3 solid, 2 flat, 1 a segment, 0 a point; exact.
    vertices : (h,) int32, sorted; no two are the same point. Their hull is exactly that of all
        points. Most of them are extreme; a few may lie on a facet or an edge.
    facets : (f, 3) int32, counter-clockwise seen from outside, none of zero area. Solid: a closed surface with
        2 h − 4 facets. Flat: the triangles of the polygon, then the same from the other side.
        Segment, point: none.
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
    count = len(points_given)
    capacity = count + APICES
    originals = np.empty((capacity, 3))
    originals[:count] = points_given
    doubles = np.empty(3 * capacity + WORK + 2 * PLANE * capacity)
    integers = np.empty(DIGITS + STATE, dtype=np.int64)
    ids = np.empty((2 * FACET + 16) * capacity, dtype=np.int32)

    work, digits, row = address_of(doubles), address_of(integers), 4 * capacity
    following = address_of(ids)
    scaled = work + 8 * WORK
    # In rows of one int32 a point: following, orphans, starting, owner, order, region (2), rim (2), fan,
    # surface (6), facets.
    dimension = quickhull(
        count, address_of(originals), scaled, work, digits, following + 16 * row, scaled + 24 * capacity,
        following, following + row, following + 2 * row, following + 3 * row, following + 4 * row,
        following + 5 * row, following + 7 * row, following + 9 * row, following + 10 * row, digits + 8 * DIGITS,
    )
    surface = ids[10 * capacity : 16 * capacity].reshape(-1, 3)
    if dimension < 0:
        raise AssertionError("quickhull: the rim of a visible region is no simple cycle")
    facets = surface[: integers[DIGITS]].copy()
    if dimension == 2:
        facets = np.concatenate([facets, facets[:, ::-1]])
    vertices = np.flatnonzero(ids[2 * capacity : 3 * capacity]).astype(np.int32)
    return Hull(int(dimension), vertices, facets)
