"""Simple polygons on facets as triangles, many at once: ears are clipped that doubles prove to be ears."""

from __future__ import annotations

import numpy as np

from collide.solids.placed_facets import PlacedFacets
from collide.surface_queries.overlay import posed_corners

_U = 2.0**-53


def clip_ears(
    polygons: list[np.ndarray], rows: list[np.ndarray], facets: PlacedFacets, place: np.ndarray, error: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(triangles (t, 3) of point ids, their facets (t,), facets of polygons with no proven ear).

    polygons : point ids (k, m), counter-clockwise seen from the front, one array a length.   rows : their facets (k,).
    place, error : of the points that are no vertices, in W.
    """
    triangles, owners, failed = [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)], []
    waiting = {p.shape[1]: _Polygons(p, *_seen(p, f, facets, place, error), f) for p, f in zip(polygons, rows)}
    for m in range(max(waiting, default=3), 2, -1):
        if m not in waiting:
            continue
        group = waiting.pop(m)
        ears, ear = group.clip()
        failed.append(group.facet[~ears])
        group, ear = group.some(ears), ear[ears]
        k, before, after = np.arange(len(ear)), (ear - 1) % m, (ear + 1) % m
        triangles.append(np.stack([group.ids[k, before], group.ids[k, ear], group.ids[k, after]], axis=1))
        owners.append(group.facet)
        if m > 3:
            waiting[m - 1] = group.without(ear).joined(waiting.get(m - 1))
    return np.concatenate(triangles), np.concatenate(owners), np.concatenate([np.zeros(0, dtype=np.int64), *failed])


def _seen(ids: np.ndarray, rows: np.ndarray, facets: PlacedFacets, place, error) -> tuple[np.ndarray, np.ndarray]:
    """((k, m, 2) the polygons seen along an axis, turned the right way, (k,) bounds of the errors of coordinates)."""
    corners, corner_error = posed_corners(facets.local[facets.corners[rows]], facets.poses[facets.body[rows]])
    n_vertices = len(facets.local)
    is_vertex = ids < n_vertices
    points = np.empty((*ids.shape, 3))
    of_vertex = ids[is_vertex]
    points[~is_vertex] = place[ids[~is_vertex] - n_vertices]
    bound = np.where(is_vertex, corner_error[:, None], 0.0)
    bound[~is_vertex] = error[ids[~is_vertex] - n_vertices]
    of_polygon = np.broadcast_to(rows[:, None], ids.shape)[is_vertex]
    slot = np.argmax(facets.corners[of_polygon] == of_vertex[:, None], axis=1)
    polygon = np.broadcast_to(np.arange(len(rows))[:, None], ids.shape)[is_vertex]
    points[is_vertex] = corners[polygon, slot]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    axis = np.argmax(np.abs(n), axis=1)
    k = np.arange(len(rows))
    u, v = np.where(n[k, axis] > 0, (axis + 1) % 3, (axis + 2) % 3), np.where(n[k, axis] > 0, axis + 2, axis + 1) % 3
    relative = points - corners[:, :1]
    seen = np.stack([relative[k, :, u], relative[k, :, v]], axis=2)
    return seen, bound.max(axis=1) + corner_error + _U * np.abs(seen).max(axis=(1, 2))


class _Polygons:
    """k polygons of m corners: ids (k, m), coordinates (k, m, 2), bounds of their errors (k,), facets (k,)."""

    def __init__(self, ids: np.ndarray, seen: np.ndarray, error: np.ndarray, facet: np.ndarray):
        self.ids, self.seen, self.error, self.facet = ids, seen, error, facet

    def some(self, rows: np.ndarray) -> _Polygons:
        return _Polygons(self.ids[rows], self.seen[rows], self.error[rows], self.facet[rows])

    def without(self, corner: np.ndarray) -> _Polygons:
        """Each polygon without one of its corners."""
        k, m = self.ids.shape
        remaining = np.arange(m)[None] != corner[:, None]
        seen = self.seen[remaining].reshape(k, m - 1, 2)
        return _Polygons(self.ids[remaining].reshape(k, m - 1), seen, self.error, self.facet)

    def joined(self, more: _Polygons | None) -> _Polygons:
        if more is None:
            return self
        return _Polygons(*(np.concatenate(pair) for pair in zip(vars(self).values(), vars(more).values())))

    def clip(self) -> tuple[np.ndarray, np.ndarray]:
        """((k,) bool: whether an ear is proven, (k,) which corner is it: the roundest)."""
        p, m = self.seen, self.ids.shape[1]
        before, after = np.roll(p, 1, axis=1), np.roll(p, -1, axis=1)
        size = np.abs(p - p[:, :1]).max(axis=(1, 2))
        # Differences are off by 2E + 2u of themselves: determinants by 4 D (2 E + 2 u D) and 4 u D².
        limit = 16.0 * size * (self.error + 2.0 * _U * size) + 1e-300
        area = _area(before, p, after)
        is_ear = area > limit[:, None]
        if m > 3:
            corners = (before, p, after)
            outside = np.zeros((*self.ids.shape, m), dtype=bool)
            for k in range(3):
                a, b = corners[k][:, :, None], corners[(k + 1) % 3][:, :, None]
                outside |= _area(a, b, p[:, None]) < -limit[:, None, None]
            numbers = np.arange(m)
            for step in (-1, 0, 1):
                outside[:, numbers, (numbers + step) % m] = True
            is_ear &= outside.all(axis=2)
        longest = np.square(after - before).sum(axis=2) + np.square(p - before).sum(axis=2)
        roundness = np.where(is_ear, area / (longest + np.square(after - p).sum(axis=2)), -1.0)
        ear = np.argmax(roundness, axis=1)
        return is_ear.any(axis=1), ear


def _area(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    e, f = b - a, c - a
    return e[..., 0] * f[..., 1] - e[..., 1] * f[..., 0]
