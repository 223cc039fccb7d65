"""Planes that cut space, by number: the facets' own, axis-parallel planes at doubles, and planes through edges of
facets.

A plane is exact, given by numbers of the mesh. Doubles with bounds of their
errors are kept, and the plane's coefficients in integers are worked out when a sign needs them.

    number f < n                  through the corners of facet f
    n + 3 f + e                   through edge e of facet f (corners e and e + 1) and parallel to an axis not parallel
    to
                                  facet f's plane: names the line of the edge in facet f; cuts nothing
    4 n + k                       the k-th axis-parallel plane
"""

from __future__ import annotations

import copy
from functools import cached_property

import numpy as np

from collide.numerics.growing_rows import GrowingRows
from collide.numerics.lowest_bits import NO_BITS, lowest_exponents

#: A sign of n · (p − a) from doubles: differences and products as in `numerics/orientation.py`, and as much again for
#: the difference of a rounded point.
_ERROR = 2.0**-49
#: Above all that underflow may take away from products of coordinates within 1e50.
_UNDERFLOW = 1e-200


class Planes:
    """The planes of a mesh's facets and of the axes.

    vertices : (v, 3) float64, within 1e50, no two rows equal.   faces : (n, 3) int64, facets with an area.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray):
        self.vertices, self.faces, self.n = vertices, faces, len(faces)
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        u, v = b - a, c - a
        self.origin = a
        self.normal = np.cross(u, v)
        u, v = np.abs(u), np.abs(v)
        self.permanent = u[:, [1, 2, 0]] * v[:, [2, 0, 1]] + u[:, [2, 0, 1]] * v[:, [1, 2, 0]]
        self.axis, self.value = GrowingRows.empty(np.int64), GrowingRows.empty(np.float64)
        low = int(lowest_exponents(vertices.reshape(1, -1))[0])
        #: Coordinates of the mesh are integers times 2^−grid.
        self.grid = 0 if low == NO_BITS else max(0, -low)
        self._facet_coefficients = np.zeros((self.n, 4), dtype=object)
        self._has_coefficients = np.zeros(self.n, dtype=bool)

    def add_axis_planes(self, axis: np.ndarray, value: np.ndarray) -> np.ndarray:
        """Numbers of new planes x[axis] = value."""
        self.axis.add(axis)
        return 4 * self.n + self.value.add(value)

    def with_own_axis_planes(self) -> Planes:
        """The same planes, with room for further axis-parallel planes of the copy alone."""
        twin = copy.copy(self)
        twin.axis, twin.value = GrowingRows.empty(np.int64), GrowingRows.empty(np.float64)
        twin.add_axis_planes(self.axis.rows, self.value.rows)
        return twin

    # --- doubles --------------------------------------------------------------------------------------------------

    def heights(self, points: np.ndarray, errors: np.ndarray, cut: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(heights, bounds of their errors) of points known to within errors, against a plane each; not scaled.

        points : (k, 3).   errors : (k,), of each coordinate.   cut : (k,) numbers of facets' or axis-parallel planes.
        """
        height, bound = np.empty(len(cut)), np.empty(len(cut))
        on_axis = cut >= 4 * self.n
        rows = np.flatnonzero(on_axis)
        k = cut[rows] - 4 * self.n
        height[rows] = points[rows, self.axis.rows[k]] - self.value.rows[k]
        bound[rows] = errors[rows]
        rows = np.flatnonzero(~on_axis)
        f = cut[rows]
        d = points[rows] - self.origin[f]
        normal, permanent, e = self.normal[f], self.permanent[f], errors[rows]
        height[rows] = np.einsum("ij,ij->i", normal, d)
        np.abs(d, out=d)
        d += e[:, None]
        bound[rows] = (
            _ERROR * np.einsum("ij,ij->i", permanent, d)
            + 1.01 * e * (np.abs(normal).sum(axis=1) + _ERROR * permanent.sum(axis=1))
            + _UNDERFLOW
        )
        return height, bound

    # --- integers -------------------------------------------------------------------------------------------------

    def integers_of(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Doubles (k, …) times 2^grid as fractions: Python integers (numerators, powers of two below them)."""
        flat = [float(v).as_integer_ratio() for v in np.ravel(values)]
        above = [p << self.grid for p, _ in flat]
        return _objects(above, np.shape(values)), _objects([q for _, q in flat], np.shape(values))

    def coefficients(self, cut: np.ndarray) -> np.ndarray:
        """(k, 4) Python integers a, b, c, d of each plane: a x + b y + c z + d, x, y, z in units of 2^−grid.

        Positive where a facet's normal points to, and where a coordinate is above an axis-parallel plane.
        """
        out = np.zeros((len(cut), 4), dtype=object)
        out[...] = 0
        rows = np.flatnonzero(cut >= 4 * self.n)
        if len(rows):
            k = cut[rows] - 4 * self.n
            above, below = self.integers_of(self.value.rows[k])
            out[rows, self.axis.rows[k]] = below
            out[rows, 3] = -above
        rows = np.flatnonzero(cut < self.n)
        if len(rows):
            out[rows] = self._of_facets(cut[rows])
        rows = np.flatnonzero((cut >= self.n) & (cut < 4 * self.n))
        if len(rows):
            out[rows] = self._of_edges(cut[rows] - self.n)
        return out

    def run_against(self, facets: np.ndarray, cut: np.ndarray) -> np.ndarray:
        """(k,) bool: facets, coplanar with a plane each, with the opposite normal; exact."""
        against = np.zeros(len(facets), dtype=bool)
        rows = np.flatnonzero(facets != cut)
        if len(rows):
            a, b = self.coefficients(facets[rows]), self.coefficients(cut[rows])
            against[rows] = ((a[:, :3] * b[:, :3]).sum(axis=1) < 0).astype(bool)
        return against

    @cached_property
    def largest(self) -> float:
        """The largest coordinate of the mesh."""
        return float(np.abs(self.vertices).max(initial=0.0))

    @cached_property
    def grid_vertices(self) -> np.ndarray:
        """(v, 3) Python integers: the mesh's vertices in units of 2^−grid."""
        above, below = self.integers_of(self.vertices)
        return above // below

    def _of_facets(self, facets: np.ndarray) -> np.ndarray:
        new = np.unique(facets[~self._has_coefficients[facets]])
        if len(new):
            a, b, c = (self.grid_vertices[self.faces[new, k]] for k in range(3))
            normal = _cross(b - a, c - a)
            self._facet_coefficients[new] = np.concatenate((normal, -_dot(normal, a)[:, None]), axis=1)
            self._has_coefficients[new] = True
        return self._facet_coefficients[facets]

    def _of_edges(self, edges: np.ndarray) -> np.ndarray:
        facet, side = np.divmod(edges, 3)
        begin = self.grid_vertices[self.faces[facet, side]]
        along = self.grid_vertices[self.faces[facet, (side + 1) % 3]] - begin
        axis = np.abs(self._of_facets(facet)[:, :3]).argmax(axis=1)
        normal, k = np.zeros_like(along), np.arange(len(edges))
        normal[k, (axis + 1) % 3], normal[k, (axis + 2) % 3] = along[k, (axis + 2) % 3], -along[k, (axis + 1) % 3]
        return np.concatenate((normal, -_dot(normal, begin)[:, None]), axis=1)


def meeting_points(planes: np.ndarray) -> np.ndarray:
    """(k, 4) Python integers x, y, z, w > 0, the points x / w, … in which three planes each meet.

    planes : (k, 3, 4).
    """
    n, d = planes[:, :, :3], planes[:, :, 3]
    pairs = [_cross(n[:, 1], n[:, 2]), _cross(n[:, 2], n[:, 0]), _cross(n[:, 0], n[:, 1])]
    w = _dot(n[:, 0], pairs[0])
    if not np.all(w != 0):
        raise AssertionError("planes named as a vertex meet in no single point: please report it")
    xyz = -sum(d[:, i, None] * pairs[i] for i in range(3))
    turned = np.where(w < 0, -1, 1).astype(object)
    return np.concatenate((xyz * turned[:, None], (w * turned)[:, None]), axis=1)


def signs_of(points: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """(k,) int8, the sides of planes (k, 4) on which points (k, 4) lie, both in Python integers."""
    value = (points * planes).sum(axis=1)
    return (value > 0).astype(np.int8) - (value < 0).astype(np.int8)


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[:, [1, 2, 0]] * v[:, [2, 0, 1]] - u[:, [2, 0, 1]] * v[:, [1, 2, 0]]


def _dot(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return (u * v).sum(axis=1)


def _objects(values: list, shape: tuple) -> np.ndarray:
    out = np.empty(len(values), dtype=object)
    out[:] = values
    return out.reshape(shape)
