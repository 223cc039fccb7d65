"""The hull of integral points in R^d, point by point, exactly.

The facets strictly below a point are replaced by facets from the point to the rim of the hole. A facet whose
hyperplane goes through the point stays: the placing triangulation (De Loera, Rambau and Santos 2010, section
4.3). Planes are doubles with an error bound, and integers for points within the bound.
"""

from __future__ import annotations

import numpy as np

from collide.papers.polytopes.exact_planes import exact_planes, nearby_planes, whole_numbers


def bytes_a_slot(d: int) -> int:
    """Bytes of a simplex while a hull grows: plane, error, corners, integers; twice, since slots are doubled."""
    return 2 * (24 * d + 34)


class BoundaryTooLarge(Exception):
    """A hull stopped half-way.   n_facets : number of its facets.   n_points : number of points added."""

    def __init__(self, n_facets: int, n_points: int):
        super().__init__(n_facets, n_points)
        self.n_facets, self.n_points = n_facets, n_points


def grown_facets(points: np.ndarray, corners: np.ndarray, max_simplices: int | None = None) -> np.ndarray:
    """The simplices covering the boundary, (f, d) rows of points, ascending in each.

    Parameters
    ----------
    points : (n, d) float64
        Integers.
    corners : (d + 1,) integers
        Rows spanning R^d.
    max_simplices : int, optional
        Beyond so many simplices `BoundaryTooLarge` is raised.
    """
    growing = _Growing(points, corners)
    for k, row in enumerate(growing.order.tolist(), len(corners)):
        growing.insert(row)
        if max_simplices is not None and growing.size > max_simplices:
            raise BoundaryTooLarge(growing.size, k)
    return growing.facets[: growing.size][growing.facets[: growing.size, 0] >= 0]


class _Growing:
    """A hull under construction, point by point. Slots of removed facets are reused."""

    def __init__(self, points: np.ndarray, corners: np.ndarray):
        n, d = points.shape
        points = points / 2.0 ** _common_zeros(points)
        self.points, self.d = points, d
        self.within = whole_numbers(points[corners]).sum(axis=0)
        self.reach = float(np.abs(points).max(initial=1.0))
        self.integers = np.empty((64, d + 1), dtype=object)
        self.is_exact, self.has_integers = np.zeros(64, dtype=bool), np.zeros(64, dtype=bool)
        self.planes, self.errors = np.zeros((64, d + 1)), np.zeros(64)
        self.facets, self.size, self.free = np.zeros((64, d), dtype=np.int64), 0, np.empty(0, dtype=np.int64)
        self.powers = float(n) ** (d - 1) < 2.0**62
        self.sides = np.array([[i for i in range(d) if i != k] for k in range(d)])
        order = np.random.default_rng(0).permutation(n)
        self.order = order[~np.isin(order, corners)]
        self._add(np.sort(np.array([np.delete(corners, k) for k in range(d + 1)]), axis=1))

    def _add(self, facets: np.ndarray) -> None:
        n = len(facets)
        slots = self.free[:n]
        self.free = self.free[n:]
        if len(slots) < n:
            fresh = np.arange(self.size, self.size + n - len(slots))
            self.size += len(fresh)
            while self.size > len(self.facets):
                self._widen()
            slots = np.concatenate((slots, fresh))
        planes, errors, is_exact = nearby_planes(self.points, facets, self.within, self.reach)
        self.planes[slots], self.errors[slots], self.is_exact[slots] = planes, errors, is_exact
        self.facets[slots], self.has_integers[slots] = facets, False

    def _widen(self) -> None:
        n = len(self.facets)
        integers = np.empty((2 * n, self.d + 1), dtype=object)
        integers[:n] = self.integers
        self.integers = integers
        self.is_exact = np.concatenate((self.is_exact, np.zeros(n, dtype=bool)))
        self.has_integers = np.concatenate((self.has_integers, np.zeros(n, dtype=bool)))
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
            near = near[~self.is_exact[near] & (self.facets[near, 0] >= 0)]  # else a slot out of use
            above[near] = self._exactly_above(near, point)
        seen = np.flatnonzero(above)
        if not len(seen):
            return
        rim = self._rim(self.facets[seen])
        self.facets[seen] = -1
        self.planes[seen], self.errors[seen] = 0.0, 0.0
        self.planes[seen, d] = 1.0  # below it lies everything
        self.integers[seen] = None
        self.free = np.concatenate((seen, self.free))
        self._add(np.sort(np.column_stack((rim, np.full(len(rim), row))), axis=1))

    def _exactly_above(self, slots: np.ndarray, point: np.ndarray) -> np.ndarray:
        unknown = slots[~self.has_integers[slots]]
        if len(unknown):
            self.integers[unknown] = exact_planes(self.points, self.facets[unknown], self.within)
            self.has_integers[unknown] = True
        return (self.integers[slots] * np.append(whole_numbers(point), -1)).sum(axis=1) > 0

    def _rim(self, facets: np.ndarray) -> np.ndarray:
        """Ridges of exactly a single facet of the given facets."""
        d = self.d
        ridges = facets[:, self.sides].reshape(-1, d - 1)
        if self.powers:
            keys = ridges[:, 0]
            for k in range(1, d - 1):
                keys = keys * len(self.points) + ridges[:, k]
            _, first, counts = np.unique(keys, return_index=True, return_counts=True)
        else:
            _, first, counts = np.unique(ridges, axis=0, return_index=True, return_counts=True)
        return ridges[first[counts == 1]]


def _common_zeros(points: np.ndarray) -> int:
    """How often all coordinates can be halved."""
    bits = int(np.bitwise_or.reduce(np.abs(points).astype(np.int64), axis=None))
    return max((bits & -bits).bit_length() - 1, 0)
