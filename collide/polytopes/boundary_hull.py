"""The boundary of a hull of integral points in R^d as simplices that cover it, exactly, whatever their position.

Points are put in one after the other; the facets strictly below a point go, and those that join it to the rim of
what went come in their place. A facet whose hyperplane goes through the point stays: that is the placing
triangulation (De Loera, Rambau and Santos 2010, section 4.3), so that flat faces come out triangulated and no point
has to be moved. In the plane and in space the exact hulls of `planar_hull` and `collide.hull` do the same faster.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from collide.hull.exact_hull import convex_hull
from collide.polytopes.planar_hull import hull_of_points

#: Coordinates are integers of at most so many bits: doubles hold them and their differences exactly.
BITS = 48
_UNIT = 2.0**-53
#: From so many points on the kernels for the plane and space are taken.
_N_KERNEL = 400


class Boundary(NamedTuple):
    """Simplices that cover the boundary of a hull, and the half-spaces they span.

    facets : (f, d) int64, rows of points, ascending in each row.
    planes : (f, d + 1) float64, (a, b) with a·x ≤ b; each number is the exact one, times a positive factor of its row,
        rounded; max |a| = 1.
    """

    facets: np.ndarray
    planes: np.ndarray


def boundary_hull(points: np.ndarray, with_planes: bool = True) -> Boundary | None:
    """The boundary of the hull, or None where the points lie in one hyperplane.

    Parameters
    ----------
    points : (n, d) float64
        Integers of at most `BITS` bits, d ≥ 2; doubled, inner and coplanar ones are allowed.
    with_planes : bool
        Whether the half-spaces are wanted; else they may be missing.

    Returns
    -------
    Boundary
        In d > 3 O(n f) operations of doubles and O(n d) calls of numpy for f facets at the most.
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
        growing = _Growing(points, corners)
        for row in growing.order:
            growing.insert(int(row))
        return growing.boundary()
    if not with_planes:
        return Boundary(facets, np.empty((0, d + 1)))
    exact = exact_planes(points, facets, points[corners].astype(np.int64).astype(object).sum(axis=0))
    return Boundary(facets, rounded_planes(exact))


def first_simplex(points: np.ndarray) -> np.ndarray | None:
    """d + 1 rows that span R^d, each far from those before; None where there are none."""
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
    whole = _integers(points[rows])
    if determinant((whole[1:] - whole[0]).tolist()) == 0:
        return _exact_simplex(points)
    return np.array(rows)


def _exact_simplex(points: np.ndarray) -> np.ndarray | None:
    """The first d + 1 rows that span R^d, by elimination in integers."""
    basis: list[tuple[int, list[int]]] = []
    rows, whole = [0], _integers(np.unique(points, axis=0))
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


def determinant(rows: list[list[int]]) -> int:
    """By fraction-free elimination (Bareiss 1968)."""
    rows, sign, previous = [list(row) for row in rows], 1, 1
    for k in range(len(rows) - 1):
        pivot = next((i for i in range(k, len(rows)) if rows[i][k]), None)
        if pivot is None:
            return 0
        if pivot != k:
            rows[k], rows[pivot], sign = rows[pivot], rows[k], -sign
        for i in range(k + 1, len(rows)):
            rows[i] = [(x * rows[k][k] - y * rows[i][k]) // previous for x, y in zip(rows[i], rows[k])]
        previous = rows[k][k]
    return sign * rows[-1][-1]


def exact_planes(points: np.ndarray, facets: np.ndarray, within: np.ndarray) -> np.ndarray:
    """(f, d + 1) integers (a, b), a·x ≤ b, of the hyperplanes through d points each.

    Parameters
    ----------
    points : (n, d) float64
        Integers.
    facets : (f, d) integers
        Rows of points that span a hyperplane.
    within : (d,) object
        d + 1 times a point that is strictly inside each half-space, integers.
    """
    d = points.shape[1]
    corners = _integers(points[facets.ravel()]).reshape(len(facets), d, d)
    edges = corners[:, 1:] - corners[:, :1]
    minors: dict[tuple[int, ...], np.ndarray] = {(k,): edges[:, 0, k] for k in range(d)}
    for row in range(1, d - 1):  # Laplace along rows; columns are kept by which of them a minor has
        larger: dict[tuple[int, ...], np.ndarray] = {}
        for columns in combinations(range(d), row + 1):
            total = np.zeros(len(facets), dtype=object)
            for place, column in enumerate(columns):
                rest = columns[:place] + columns[place + 1 :]
                term = edges[:, row, column] * minors[rest]
                total = total + term if (row + place) % 2 == 0 else total - term
            larger[columns] = total
        minors = larger
    every = tuple(range(d))
    a = np.stack([minors[every[:k] + every[k + 1 :]] * (-1) ** k for k in range(d)], axis=1)
    b = (a * corners[:, 0]).sum(axis=1)
    inward = (a * within).sum(axis=1) - (d + 1) * b
    flip = np.where(inward > 0, -1, 1).astype(object)
    return np.column_stack((a, b)) * flip[:, None]


def rounded_planes(exact: np.ndarray) -> np.ndarray:
    """Planes of integers as doubles with max |a| = 1; each number off by at most two units in its last place."""
    d = exact.shape[1] - 1
    bits = max((int(number).bit_length() for number in exact.ravel()), default=0)
    if bits > 1000:
        exact = exact >> (bits - 1000) if bits - 1000 < 53 else exact // (1 << (bits - 1000))
    planes = exact.astype(np.float64)
    return planes / np.abs(planes[:, :d]).max(axis=1)[:, None]


def _integers(points: np.ndarray) -> np.ndarray:
    return points.astype(np.int64).astype(object)


class _Growing:
    """A hull to which points are added. Slots of facets that went are used again."""

    def __init__(self, points: np.ndarray, corners: np.ndarray):
        n, d = points.shape
        self.points, self.d = points, d
        self.within = _integers(points[corners]).sum(axis=0)
        self.reach = float(np.abs(points).max(initial=1.0))
        self.exact = np.empty((64, d + 1), dtype=object)
        self.planes, self.errors = np.zeros((64, d + 1)), np.zeros(64)
        self.facets, self.size, self.free = np.zeros((64, d), dtype=np.int64), 0, np.empty(0, dtype=np.int64)
        self.powers = float(n) ** (d - 1) < 2.0**62
        order = np.random.default_rng(0).permutation(n)
        self.order = order[~np.isin(order, corners)]
        faces = np.sort(np.array([np.delete(corners, k) for k in range(d + 1)]), axis=1)
        self._add(faces)

    def _add(self, facets: np.ndarray) -> None:
        exact = exact_planes(self.points, facets, self.within)
        n = len(facets)
        slots = self.free[:n]
        self.free = self.free[n:]
        if len(slots) < n:
            fresh = np.arange(self.size, self.size + n - len(slots))
            self.size += len(fresh)
            while self.size > len(self.facets):
                self._widen()
            slots = np.concatenate((slots, fresh))
        planes = rounded_planes(exact)
        self.facets[slots], self.exact[slots], self.planes[slots] = facets, exact, planes
        terms = np.abs(planes[:, : self.d]).sum(axis=1) * self.reach + np.abs(planes[:, self.d])
        self.errors[slots] = (self.d + 6) * _UNIT * terms

    def _widen(self) -> None:
        n = len(self.facets)
        exact = np.empty((2 * n, self.d + 1), dtype=object)
        exact[:n] = self.exact
        self.exact = exact
        self.planes = np.concatenate((self.planes, np.zeros_like(self.planes)))
        self.errors = np.concatenate((self.errors, np.zeros(n)))
        self.facets = np.concatenate((self.facets, np.zeros_like(self.facets)))

    def insert(self, row: int) -> None:
        """Add a point; nothing happens where it is in the hull."""
        d, point = self.d, self.points[row]
        heights = self.planes[: self.size, :d] @ point - self.planes[: self.size, d]
        above = heights > self.errors[: self.size]
        near = np.flatnonzero(np.abs(heights) <= self.errors[: self.size])
        if len(near):
            near = near[self.facets[near, 0] >= 0]  # a slot out of use
            whole = np.append(_integers(point), -1)
            above[near] = (self.exact[near] * whole).sum(axis=1) > 0
        seen = np.flatnonzero(above)
        if not len(seen):
            return
        rim = self._rim(self.facets[seen])
        self.facets[seen] = -1
        self.planes[seen], self.errors[seen] = 0.0, 0.0
        self.planes[seen, d] = 1.0  # below it lies everything
        self.free = np.concatenate((seen, self.free))
        self._add(np.sort(np.column_stack((rim, np.full(len(rim), row))), axis=1))

    def _rim(self, facets: np.ndarray) -> np.ndarray:
        """The ridges that one of the facets has, and no other."""
        d = self.d
        ridges = np.concatenate([np.delete(facets, k, axis=1) for k in range(d)])
        if self.powers:
            keys = ridges[:, 0]
            for k in range(1, d - 1):
                keys = keys * len(self.points) + ridges[:, k]
            _, first, counts = np.unique(keys, return_index=True, return_counts=True)
        else:
            _, first, counts = np.unique(ridges, axis=0, return_index=True, return_counts=True)
        return ridges[first[counts == 1]]

    def boundary(self) -> Boundary:
        """What is left."""
        live = self.facets[: self.size, 0] >= 0
        return Boundary(self.facets[: self.size][live], self.planes[: self.size][live])
