"""Vertices of cut polygons: corners of the mesh, or the point in which three planes meet; the sides they lie on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.numerics.growing_rows import GrowingRows
from collide.papers.partitions.planes import Planes, meeting_points, signs_of

#: Errors of vertices that are worked out in integers before they are shown, of the largest coordinate.
_BADLY_KNOWN = 2.0**-40


class Sides(NamedTuple):
    """Sides of vertices at planes, (k,) each.

    sign : int8, exact.   height, bound : in doubles, and the bound of its error: good for proportions alone.
    """

    sign: np.ndarray
    height: np.ndarray
    bound: np.ndarray


class Vertices:
    """All vertices of a partition under way. The first are the mesh's own; the others are named by three planes.

    xyz : (n, 3) doubles near the vertices.   error : (n,), no coordinate is off by more.   names : (n, 3) planes.
    n_exact : how many signs integers had to decide.
    """

    def __init__(self, planes: Planes):
        self.planes, self.n_exact = planes, 0
        self.xyz, self.names = GrowingRows.empty(float, 3), GrowingRows.empty(np.int64, 3)
        self.error = GrowingRows.empty(float)
        self._exact, self._is_known = np.empty((0, 4), dtype=object), np.zeros(0, dtype=bool)
        self.n_corners = len(planes.vertices)
        self.add(planes.vertices, np.zeros(self.n_corners), np.full((self.n_corners, 3), -1))

    def add(self, xyz: np.ndarray, error: np.ndarray, names: np.ndarray) -> np.ndarray:
        """Numbers of new vertices."""
        self.xyz.add(xyz)
        self.error.add(error)
        return self.names.add(names)

    def cut_back(self, n: int) -> None:
        """Forget all vertices from the n-th on."""
        for rows in (self.xyz, self.error, self.names):
            rows.cut_back(n)
        self._exact[n:], self._is_known[n:] = None, False

    def sides(self, vertex: np.ndarray, cut: np.ndarray) -> Sides:
        """Where vertices (k,) lie of planes (k,): doubles with a bound; by their names; in integers."""
        height, bound = self.planes.heights(self.xyz.rows[vertex], self.error.rows[vertex], cut)
        sign = (height > bound).astype(np.int8) - (height < -bound).astype(np.int8)
        remaining = np.flatnonzero(np.abs(height) <= bound)
        if len(remaining):
            remaining = remaining[~self._on_by_name(vertex[remaining], cut[remaining])]
        if len(remaining):
            sign[remaining] = self.exact_signs(vertex[remaining], cut[remaining])
        return Sides(sign, height, bound)

    def _on_by_name(self, vertex: np.ndarray, cut: np.ndarray) -> np.ndarray:
        """(k,) bool: vertices on a plane by name: named by the plane, or by a corner or an edge of the plane's
        facet.
        """
        planes, names = self.planes, self.names.rows[vertex]
        on = (names == cut[:, None]).any(axis=1)
        rows = np.flatnonzero(~on & (cut < planes.n))
        corners = planes.faces[cut[rows]]
        on[rows] = (corners == vertex[rows, None]).any(axis=1)
        for k in range(3):
            edge = names[rows, k] - planes.n
            of_edge = np.flatnonzero((edge >= 0) & (edge < 3 * planes.n))
            facet, side = np.divmod(edge[of_edge], 3)
            shared = np.ones(len(of_edge), dtype=bool)
            for end in (side, (side + 1) % 3):
                shared &= (corners[of_edge] == planes.faces[facet, end][:, None]).any(axis=1)
            on[rows[of_edge]] |= shared
        return on

    def exact_signs(self, vertex: np.ndarray, cut: np.ndarray) -> np.ndarray:
        """(k,) int8, where vertices lie of planes, those through edges of facets among them: in integers."""
        self.n_exact += len(vertex)
        pairs, back = np.unique(np.stack((vertex, cut), axis=1), axis=0, return_inverse=True)
        signs = signs_of(self.exact(pairs[:, 0]), self.planes.coefficients(pairs[:, 1]))
        return signs[np.ravel(back)]

    def exact(self, vertex: np.ndarray) -> np.ndarray:
        """(k, 4) Python integers x, y, z, w > 0: the vertices are x / w, … in units of 2^−grid; worked out once."""
        more = self.xyz.n - len(self._is_known)
        if more > 0:
            more = max(more, self.xyz.n // 2)
            self._exact = np.concatenate((self._exact, np.empty((more, 4), dtype=object)))
            self._is_known = np.append(self._is_known, np.zeros(more, dtype=bool))
        new = np.unique(vertex[~self._is_known[vertex]])
        if len(new):
            self._exact[new], self._is_known[new] = self._worked_out(new), True
        return self._exact[vertex]

    def _worked_out(self, vertex: np.ndarray) -> np.ndarray:
        out = np.empty((len(vertex), 4), dtype=object)
        corner = vertex < self.n_corners
        rows = np.flatnonzero(corner)
        if len(rows):
            out[rows, :3], out[rows, 3] = self.planes.grid_vertices[vertex[rows]], 1
        rows = np.flatnonzero(~corner)
        if len(rows):
            names = self.names.rows[vertex[rows]]
            out[rows] = meeting_points(self.planes.coefficients(names.ravel()).reshape(-1, 3, 4))
        return out

    def rounded(self, vertex: np.ndarray) -> tuple[np.ndarray, float]:
        """((k, 3) doubles, how far a coordinate may be off): vertices known badly are worked out and rounded once."""
        xyz, error = self.xyz.rows[vertex].copy(), self.error.rows[vertex].copy()
        largest = np.abs(xyz).max(initial=0.0)
        rows = np.flatnonzero(error > _BADLY_KNOWN * largest)
        if len(rows):
            exact = self.exact(vertex[rows])
            xyz[rows] = [[x / (w << self.planes.grid) for x in p] for *p, w in exact.tolist()]
            error[rows] = np.spacing(np.abs(xyz[rows]).max(axis=1))
        return xyz, float(error.max(initial=0.0))

    @property
    def n_bytes(self) -> int:
        return self.xyz.n_bytes + self.error.n_bytes + self.names.n_bytes + self.exact_bytes

    @property
    def exact_bytes(self) -> int:
        """Bytes of exact vertices: some 100 for each of four integers."""
        return self._exact.nbytes + 400 * int(np.count_nonzero(self._is_known))
