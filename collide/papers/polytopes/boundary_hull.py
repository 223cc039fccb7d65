"""The boundary of a hull of integral points in R^d as simplices covering the boundary, exactly, for points in any
position.

In the plane and in space by the exact hulls of `planar_hull` and `collide.hull`, in higher dimensions by
`incremental_hull`. Flat faces come out triangulated, and no point has to be moved.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.hull.exact_hull import convex_hull
from collide.numerics.exact_vectors import determinant
from collide.papers.polytopes.exact_planes import exact_planes, rounded_planes, whole_numbers
from collide.papers.polytopes.incremental_hull import grown_facets
from collide.papers.polytopes.planar_hull import hull_of_points

#: From so many points on the kernels for the plane and space are taken.
_N_KERNEL = 400


class Boundary(NamedTuple):
    """Simplices covering the boundary of a hull, and their half-spaces.

    facets : (f, d) int64, rows of points, ascending in each row.
    planes : (f, d + 1) float64, (a, b) with a·x ≤ b; each number is the exact number, times a positive factor of its
        row, rounded; max |a| = 1.
    """

    facets: np.ndarray
    planes: np.ndarray


def boundary_hull(points: np.ndarray, with_planes: bool = True, max_simplices: int | None = None) -> Boundary | None:
    """The boundary of the hull, or ``None`` for points in a hyperplane.

    Parameters
    ----------
    points : (n, d) float64
        Integers of at most `BITS` bits, d ≥ 2; doubled, inner and coplanar points are allowed.
    with_planes : bool
        Whether to make the half-spaces; else they are missing.
    max_simplices : int, optional
        In d > 3, the most simplices at any time.

    Returns
    -------
    Boundary
        In d > 3 O(n f) operations of doubles and O(n d) calls of numpy for f facets at the most.

    Raises
    ------
    BoundaryTooLarge
        Beyond ``max_simplices``.
    """
    n, d = points.shape
    corners = first_simplex(points)
    if corners is None:
        return None
    if d == 2:
        ring = hull_of_points(points)
        facets = np.sort(np.column_stack((ring, np.roll(ring, -1))), axis=1)
    elif d == 3 and n >= _N_KERNEL:
        facets = np.sort(np.asarray(convex_hull(points).facets, dtype=np.int64), axis=1)
    else:
        facets = grown_facets(points, corners, max_simplices)
    if not with_planes:
        return Boundary(facets, np.empty((0, d + 1)))
    return Boundary(facets, rounded_planes(exact_planes(points, facets, whole_numbers(points[corners]).sum(axis=0))))


def first_simplex(points: np.ndarray) -> np.ndarray | None:
    """d + 1 rows spanning R^d, each far from the rows before; ``None`` for points in a hyperplane."""
    d = points.shape[1]
    rows = [int(np.lexsort(points.T[::-1])[0])]
    rest = points - points[rows[0]]
    for _ in range(d):
        sizes = (rest * rest).sum(axis=1)
        row = int(np.argmax(sizes))
        if sizes[row] == 0.0:
            return None
        rows.append(row)
        axis = rest[row] / np.sqrt(sizes[row])
        rest = rest - (rest @ axis)[:, None] * axis
    whole = whole_numbers(points[rows])
    if determinant((whole[1:] - whole[0]).tolist()) == 0:
        return _exact_simplex(points)
    return np.array(rows)


def _exact_simplex(points: np.ndarray) -> np.ndarray | None:
    """The first d + 1 rows that span R^d, by elimination in integers."""
    basis: list[tuple[int, list[int]]] = []
    rows, whole = [0], whole_numbers(np.unique(points, axis=0))
    first, places = whole[0], np.unique(points, axis=0, return_index=True)[1]
    rows[0] = int(places[0])
    for k, point in enumerate(whole[1:], 1):
        vector = (point - first).tolist()
        for axis, line in basis:
            vector = [x * line[axis] - y * vector[axis] for x, y in zip(vector, line)]
        if any(vector):
            axis = next(i for i, x in enumerate(vector) if x)
            basis.append((axis, vector))
            rows.append(int(places[k]))
            if len(basis) == points.shape[1]:
                return np.array(rows)
    return None
