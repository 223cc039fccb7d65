"""How often a closed surface winds around the origin, in integers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from collide.numerics.exact_points import PlacedPoints, Point
from collide.numerics.exact_vectors import cross, inner, minus

#: Directions of the rays, tried in sequence up to the first ray past all edges and corners.
_DIRECTIONS: tuple[Point, ...] = (
    (7919, 104729, 1299709), (-15485863, 32452843, 49979687), (86028121, -3, 17), (5, 982451653, -373587883),
)


def winding_number_around(
    k: int, points: PlacedPoints, vertices: PlacedPoints, faces: np.ndarray
) -> int | None:
    """The winding number of closed facets with these vertices about point k of others, as of `winding_number`."""
    grid = min(points.grid, vertices.grid)
    return winding_number(vertices.on_grid(grid).minus(points.on_grid(grid)[k]), faces)


def winding_number(points: PlacedPoints, faces: np.ndarray) -> int | None:
    """Winding number of closed facets about the origin; 1 for an origin on a facet, ``None`` if every ray passes an
    edge.

    faces : (m, 3) numbers of points. Facets where the ray leaves count 1, facets where the ray enters −1. O(m) doubles,
    and integers for facets possibly met by the ray's line.
    """
    for direction in _DIRECTIONS:
        number = _along_ray(points, faces, direction)
        if number is not None:
            return number
    return None


def _along_ray(points: PlacedPoints, faces: np.ndarray, direction: Point) -> int | None:
    """The winding number by a single ray from the origin; ``None`` for a ray through an edge or a corner."""
    # Coordinates across the line: its facets have corners on both sides of two planes through it.
    u = -direction[1], direction[0], 0
    w = cross(direction, u)
    for axis in (u, w):
        signs = points.signs_along(axis)[faces]
        faces = faces[(signs[:, 0] == 0) | (signs != signs[:, :1]).any(axis=1)]
    total, passes_edge = 0, False
    for face in faces.tolist():
        corners = [points[k] for k in face]
        (pa, qa), (pb, qb), (pc, qc) = ((inner(u, p), inner(w, p)) for p in corners)
        if (pa > 0 and pb > 0 and pc > 0) or (pa < 0 and pb < 0 and pc < 0):
            continue
        if (qa > 0 and qb > 0 and qc > 0) or (qa < 0 and qb < 0 and qc < 0):
            continue
        sides = pa * qb - pb * qa, pb * qc - pc * qb, pc * qa - pa * qc
        low, high = min(sides), max(sides)
        if low < 0 < high:
            continue  # the line passes beside the facet
        n = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]))
        height = inner(n, corners[0])
        if height == 0 and any(n) and _holds_origin(corners, n):
            return 1
        if low == 0 or high == 0:
            passes_edge = True
            continue
        slope = inner(n, direction)
        if height * slope > 0:
            total += 1 if slope > 0 else -1
    return None if passes_edge else total


def _holds_origin(corners: Sequence[Point], n: Point) -> bool:
    """Whether a triangle in a plane with normal n through the origin holds it."""
    a, b, c = corners
    return all(inner(cross(p, q), n) >= 0 for p, q in ((a, b), (b, c), (c, a)))
