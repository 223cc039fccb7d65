"""Whether a solid's facets are the surface of its own convex hull, decided exactly.

A facet with no vertex beyond its plane lies in the surface of the hull. A closed surface within the hull's surface
winds around all points inside the hull equally often, so a solid with all facets there is its hull: the same set.
Signs are those of doubles with an error bound (Shewchuk, "Adaptive precision floating-point arithmetic", 1997,
section 4.3), and of Python integers where these cannot tell.
"""

from __future__ import annotations

import numpy as np

from collide.numerics.exact_points import Point, integers
from collide.numerics.exact_vectors import cross, inner, minus

#: Facets times vertices looked at before it is left open; some 0.2 s.
MAX_SIGNS = 20_000_000
#: Signs worked out in integers before it is left open; some 0.2 s.
MAX_EXACT_SIGNS = 100_000
#: Signs worked out at once: few at first, which tell of most meshes that are not convex; then twice as many each time.
_FIRST_CHUNK, _CHUNK = 1 << 12, 1 << 16
#: Of the permanent; Shewchuk's (7 + 56 ε) ε, with room for the rounding of the permanent itself.
_ERROR = 1e-15


def is_own_hull(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """Whether every facet (m, 3) of a solid has all vertices (n, 3), finite, on its inner side or in its plane.

    Facets without area do not count. True is proven; False may also mean that the mesh is too large to decide
    (`MAX_SIGNS`, `MAX_EXACT_SIGNS`). O(m n), with an exit at the first vertex beyond a facet.
    """
    used, ids = np.unique(faces, return_inverse=True)
    points, facets = vertices[used], ids.reshape(-1, 3)
    if len(points) * len(facets) > MAX_SIGNS:
        return False
    # One power of two for all: the largest coordinate near 1, nothing rounded but what is far too small to matter.
    points = np.ldexp(points, -int(np.frexp(np.abs(points).max())[1]))
    exact = _Exact(vertices[used], facets)
    begin, step = 0, max(1, _FIRST_CHUNK // len(points))
    while begin < len(facets):
        det, bound = _beyond(points, facets[begin : begin + step])
        if (det > bound).any():
            return False
        open_signs = det >= -bound
        np.put_along_axis(open_signs, facets[begin : begin + step], False, axis=1)  # corners lie in their plane
        for f, v in np.argwhere(open_signs).tolist():
            if exact.is_beyond(begin + f, v):
                return False
        if exact.count > MAX_EXACT_SIGNS:
            return False
        begin, step = begin + step, min(2 * step, max(step, _CHUNK // len(points)))
    return True


def _beyond(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(heights, error bounds), (m, n) each, of all points over the planes of facets, positive outside."""
    a, b, c = (points[facets[:, k]][:, None] for k in range(3))
    u, v, w = b - a, c - a, points[None] - a
    det, permanent = np.zeros(w.shape[:2]), np.zeros(w.shape[:2])
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        p, q = u[..., i] * v[..., j], u[..., j] * v[..., i]
        det = det + (p - q) * w[..., k]
        permanent = permanent + (np.abs(p) + np.abs(q)) * np.abs(w[..., k])
    return det, permanent * _ERROR + 1e-290


class _Exact:
    """Points in integers of one grid, made when first asked for, and facets' planes likewise."""

    def __init__(self, points: np.ndarray, facets: np.ndarray):
        self._points, self._facets, self.count = points, facets, 0
        self._grid: list[Point] = []
        self._planes: dict[int, tuple[Point, int]] = {}

    def is_beyond(self, f: int, v: int) -> bool:
        self.count += 1
        if not self._grid:
            whole, _ = integers(self._points)
            self._grid = list(zip(whole[0::3], whole[1::3], whole[2::3]))
        if f not in self._planes:
            a, b, c = (self._grid[i] for i in self._facets[f].tolist())
            normal = cross(minus(b, a), minus(c, a))
            self._planes[f] = normal, inner(normal, a)
        normal, height = self._planes[f]
        return inner(normal, self._grid[v]) > height
