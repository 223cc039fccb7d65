"""Facets cut into pieces: points in facets and on edges by weights of corners, cut edges, flipped edges.

A new vertex is a point of an old facet, given by three weights of its corners. On an edge of the old facet the
third weight is 0, so pieces on both sides share the vertex and lie on the edge. Pieces tile the old facet exactly
in these weights; places in space are rounded once from the old corners.

A part of an old facet's edge is fixed: cut at most, never flipped.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.numerics.error_free_arrays import array_product, array_sum

#: A determinant of three rows of weights in [0, 1 + ε] is off by less than this share of its terms.
_DETERMINANT_ERROR = 2.0**-49
#: Flip only where the sum of cotangents is clearly negative: equal diagonals stay as they are.
_FLIP_BELOW = -1e-9
#: Rounds of flips before the next cut at most.
_MAX_FLIPS = 60


class Edges(NamedTuple):
    """Edges of e pieces: ends (e, 2), edge_of (k, 3) of every side of k pieces, fixed (e,) bool,
    sides (e, 2): the two half-edges along each edge, the same half-edge twice at a border."""

    ends: np.ndarray
    edge_of: np.ndarray
    fixed: np.ndarray
    sides: np.ndarray


class Pieces:
    """Pieces of m facets over n points, which grow.

    corners : (m, 3) of the facets, distinct.   n_old : number of points given.
    points : (n, 3).   hosts, weights : (n, 3) old vertices and their weights in the point; an old vertex hosts itself.
    faces : (k, 3) points of the pieces.   source : (k,) rows of ``corners``.
    """

    def __init__(self, vertices: np.ndarray, corners: np.ndarray):
        n = len(vertices)
        self.corners, self.n_old = corners, n
        self.points = np.array(vertices, dtype=np.float64)
        self.hosts = np.repeat(np.arange(n), 3).reshape(n, 3)
        self.weights = np.tile([1.0, 0.0, 0.0], (n, 1))
        self.faces, self.source = corners.copy(), np.arange(len(corners))

    def edges(self) -> Edges:
        """All edges; O(k log k)."""
        return edges_of(self.faces, self.source)

    def weights_in(self, points: np.ndarray, facets: np.ndarray) -> np.ndarray:
        """(…, 3) weights of points (…,) that lie in old facets (…,), by the corners of these."""
        same = self.hosts[points][..., None, :] == self.corners[facets][..., :, None]
        return (same * self.weights[points][..., None, :]).sum(axis=-1)

    def place(self, facets: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(c, 3) points with weights (c, 3) in old facets (c,), a few units in the last place off."""
        corners = self.points[self.corners[facets]]
        rows, heaviest = np.arange(len(facets)), weights.argmax(axis=1)
        base = corners[rows, heaviest]
        shares = weights / weights.sum(axis=1, keepdims=True)
        return base + (shares[:, :, None] * (corners - base[:, None])).sum(axis=1)

    def moved(self) -> float:
        """Upper bound of the distances of new vertices from their exact points in the facets; 0 where all are exact."""
        new = slice(self.n_old, None)
        weights, hosts = self.weights[new], self.hosts[new]
        if not len(hosts):
            return 0.0
        total, tail = np.zeros((len(hosts), 3)), np.zeros((len(hosts), 3))
        size = np.zeros((len(hosts), 3))
        for j in range(3):
            away, low = array_sum(self.points[hosts[:, j]], -self.points[new])
            product, error = array_product(weights[:, j : j + 1] + np.zeros(3), away)
            total, rest = array_sum(total, product)
            tail += rest + (error + weights[:, j : j + 1] * low)
            size += np.abs(product)
        off = np.abs(total + tail) + 2.0**-98 * size * (total + tail != 0.0)
        off /= weights.sum(axis=1, keepdims=True)
        return float(np.sqrt(np.square(off).sum(axis=1).max()) * (1 + 2.0**-40))

    def cut(self, edges: Edges, cut_rows: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Cut edges at shares of their length, at most an edge a piece; returns a mask of the ``cut_rows`` cut.

        An edge is left where rounding of the weights would turn a piece over: within facets alone, of thin pieces.
        """
        side = edges.sides[cut_rows]
        facet = self.source[side[:, 0] // 3]
        ends = self.weights_in(edges.ends[cut_rows], facet[:, None])
        weights = (1.0 - shares)[:, None] * ends[:, 0] + shares[:, None] * ends[:, 1]
        possible = edges.fixed[cut_rows].copy()
        within = np.flatnonzero(~possible)
        upright = np.ones(len(within), dtype=bool)
        for k in range(2):
            piece = self.weights_in(self.faces[side[within, k] // 3], facet[within, None])
            at = side[within, k] % 3
            for replaced in (at, (at + 1) % 3):
                half = piece.copy()
                half[np.arange(len(within)), replaced] = weights[within]
                upright &= _is_upright(half)
        possible[within] = upright
        self._add(edges, cut_rows[possible], facet[possible], weights[possible])
        return possible

    def _add(self, edges: Edges, cut_rows: np.ndarray, facet: np.ndarray, weights: np.ndarray) -> None:
        names = np.full(len(edges.ends), -1)
        names[cut_rows] = np.arange(len(cut_rows)) + len(self.points)
        places = self.place(facet, weights)
        self.points = np.concatenate([self.points, places])
        self.hosts = np.concatenate([self.hosts, self.corners[facet]])
        self.weights = np.concatenate([self.weights, weights])
        rows, at = np.nonzero(names[edges.edge_of] >= 0)
        middle, old = names[edges.edge_of[rows, at]], self.faces[rows]
        a, b, c = (old[np.arange(len(rows)), (at + k) % 3] for k in range(3))
        self.faces[rows] = np.stack([a, middle, c], axis=1)
        self.faces = np.concatenate([self.faces, np.stack([middle, b, c], axis=1)])
        self.source = np.concatenate([self.source, self.source[rows]])

    def flip(self, touched: np.ndarray) -> None:
        """Flip edges within old facets until they are Delaunay's (Lawson 1977). touched : (m,) bool, which facets."""
        rows = np.flatnonzero(touched[self.source])
        faces, source = self.faces[rows], self.source[rows]
        for _ in range(_MAX_FLIPS):
            edges = edges_of(faces, source)
            side = edges.sides[~edges.fixed]
            flipped, new = self._to_flip(faces, source, side)
            if not len(flipped):
                break
            faces[side[flipped] // 3] = new
        self.faces[rows] = faces

    def _to_flip(self, faces: np.ndarray, source: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(rows of side (e, 2) to flip, no piece twice; (c, 2, 3) the pieces in place of theirs)."""
        pieces, at = side // 3, side % 3
        a, b, c = (faces[pieces[:, 0], (at[:, 0] + k) % 3] for k in range(3))
        d = faces[pieces[:, 1], (at[:, 1] + 2) % 3]
        gain = _cotangent(self.points, c, a, b) + _cotangent(self.points, d, a, b)
        rows = np.flatnonzero(gain < _FLIP_BELOW)
        new = np.stack([np.stack([c, a, d], axis=1), np.stack([d, b, c], axis=1)], axis=1)[rows]
        upright = _is_upright(self.weights_in(new, source[pieces[rows, 0], None, None])).all(axis=1)
        rows, new = rows[upright], new[upright]
        order = np.argsort(gain[rows], kind="stable")
        best = np.full(len(faces), len(rows))
        np.minimum.at(best, pieces[rows[order]], np.arange(len(rows))[:, None])
        first = (best[pieces[rows[order]]] == np.arange(len(rows))[:, None]).all(axis=1)
        return rows[order[first]], new[order[first]]


def edges_of(faces: np.ndarray, source: np.ndarray) -> Edges:
    """The edges of pieces (k, 3) of facets ``source`` (k,)."""
    start, end = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    key = (np.minimum(start, end) << 31) | np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    count = np.diff(first, append=len(order))
    edge_of = np.empty(len(key), dtype=np.int64)
    edge_of[order] = np.repeat(np.arange(len(first)), count)
    low = key[order[first]]
    sides = np.stack([order[first], order[first + np.minimum(count, 2) - 1]], axis=1)
    fixed = (count != 2) | (source[sides[:, 0] // 3] != source[sides[:, 1] // 3])
    ends = np.stack([low >> 31, low & (2**31 - 1)], axis=1)
    return Edges(ends, edge_of.reshape(-1, 3), fixed, sides)


def _is_upright(rows: np.ndarray) -> np.ndarray:
    """Whether determinants of rows (…, 3, 3) of weights are proven to be positive."""
    a, b, c = rows[..., 0, :], rows[..., 1, :], rows[..., 2, :]
    value = (a * np.cross(b, c)).sum(axis=-1)
    size = np.abs(a) * (np.abs(_rolled(b, 1) * _rolled(c, 2)) + np.abs(_rolled(b, 2) * _rolled(c, 1)))
    return value > _DETERMINANT_ERROR * size.sum(axis=-1)


def _rolled(rows: np.ndarray, by: int) -> np.ndarray:
    return np.roll(rows, -by, axis=-1)


def _cotangent(points: np.ndarray, at: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of the angles at points between a and b; −∞ … ∞, and 0 where there is no angle."""
    u, v = points[a] - points[at], points[b] - points[at]
    area = np.sqrt(np.square(np.cross(u, v)).sum(axis=1))
    return np.divide((u * v).sum(axis=1), area, out=np.zeros(len(area)), where=area > 0.0)
