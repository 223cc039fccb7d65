"""Winding numbers by rays along an axis, from points within sheets: exact, all rays of an arrangement at once."""

from __future__ import annotations

import numpy as np

from collide.errors import CollideError
from collide.kernels import address_of
from collide.numerics.exact_vectors import inner
from collide.solids.around_edges import Sheets
from collide.solids.cut_points import CutPoints, Rational
from collide.solids.placed_facets import PlacedFacets
from collide.solids.ray_passages import AIM, aim_rays, count_passages
from collide.solids.rounded_points import near_points, rounded_points

_MAX_TRIES = 64


def shoot(sheets: Sheets, points: CutPoints, rows: np.ndarray, sides: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """For k parts of an arrangement a cell beside a sheet, and each body's winding number in the cell, (r,) int64.

    rows : (m, k) sheets of each part, to be tried in this order.   sides : (m, k, 2) the cells before and behind them.

    Doubles try all sheets; what they leave open is answered exactly, from the first sheets.
    """
    k = rows.shape[1]
    cells, winding = np.empty(k, dtype=np.int64), np.zeros((k, len(points.facets.operands)), dtype=np.int64)
    waiting = np.arange(k)
    for attempt in range(len(rows) + _MAX_TRIES):
        if not len(waiting):
            break
        exactly = attempt >= len(rows)
        row = 0 if exactly else attempt
        some = rows[row, waiting]
        starts = _Starts(sheets, points, some, attempt)
        cells[waiting] = np.where(starts.upwards, *sides[row, waiting].T)
        winding[waiting], is_unclear = _windings(points.facets, starts, exactly)
        waiting = waiting[is_unclear]
    if len(waiting):
        raise CollideError("every ray of an arrangement of solids passes an edge; please report it")
    return list(zip(cells.tolist(), winding))


class _Starts:
    """Points within sheets (k,), in doubles and on demand exact, and axes of rays from the points.

    place : (k, 3) in W [m].   facet : (k,) rows.   axes : (k,) along which the facets are seen nearly largest.
    upwards : (k,) bool, facets whose fronts look up the axis.
    """

    def __init__(self, sheets: Sheets, points: CutPoints, rows: np.ndarray, attempt: int):
        self._points, self._triangles, self.facet = points, sheets.triangles[rows], sheets.facet[rows]
        facets, k = points.facets, len(rows)
        self.place, aims = np.empty((k, 3)), np.empty((k, AIM), dtype=np.int64)
        places, corners = near_points(points).place, rounded_points(points, self._triangles.ravel())[0]
        aim_rays(
            address_of(places), len(places), address_of(facets.corners), len(facets.corners), address_of(self.facet),
            address_of(corners), k, attempt, address_of(self.place), address_of(aims),
        )
        self.axes, self.upwards, self._weights = aims[:, 0].copy(), aims[:, 1] > 0, aims[:, 2:]
        for row in np.flatnonzero(aims[:, 1] == 0).tolist():
            normal = facets.normal(int(self.facet[row]))
            self.axes[row] = _largest(normal)
            self.upwards[row] = normal[self.axes[row]] > 0

    def exact(self, k: int) -> Rational:
        """Point number k."""
        corners = self._triangles[k].tolist()
        self._points.load(corners)
        return _within([self._points.exact(p) for p in corners], self._weights[k].tolist())


def _largest(normal) -> int:
    sizes = [abs(x) for x in normal]
    return sizes.index(max(sizes))


def _within(corners: list[Rational], weights: list[int]) -> Rational:
    """A point within a triangle."""
    w = corners[0][3] * corners[1][3] * corners[2][3]
    shares = [weight * (w // c[3]) for weight, c in zip(weights, corners)]
    x, y, z = (sum(s * c[k] for s, c in zip(shares, corners)) for k in range(3))
    return x, y, z, sum(weights) * w


def _windings(facets: PlacedFacets, starts: _Starts, exactly: bool) -> tuple[np.ndarray, np.ndarray]:
    """((k, r) how often bodies wind around points a little further along the axes, (k,) bool: doubles leave facets open
    or, asked exactly, an edge is passed).
    """
    axes = starts.axes
    winding = np.zeros((len(axes), len(facets.operands)), dtype=np.int64)
    is_unclear = np.zeros(len(axes), dtype=bool)
    for k, operand in enumerate(facets.operands):
        # The facet of a start is not ahead of the ray.
        skipped = np.where(facets.body[starts.facet] == k, facets.number[starts.facet], -1)
        winding[:, k], remaining = count_passages(
            facets.tree_of(k), operand.X, starts.place, axes, skipped, facets.slack
        )
        if not exactly:
            is_unclear[remaining[:, 0]] = True
            continue
        for ray, f in zip(remaining[:, 0].tolist(), facets.rows_of(k, remaining[:, 1]).tolist()):
            passage = _passage(facets, f, starts.exact(ray), int(axes[ray])) if f >= 0 else 0
            if passage is None:
                is_unclear[ray] = True
            else:
                winding[ray, k] += passage
    return winding, is_unclear


def _passage(facets: PlacedFacets, f: int, p: Rational, axis: int) -> int | None:
    """1 where a ray leaves through a facet, −1 where the ray enters, 0 where the ray misses; ``None`` along an edge."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    c = facets.exact_corners(f)
    n = facets.normal(f)
    x, y, w = p[u], p[v], p[3]
    sides = [
        (b[u] - a[u]) * (y - a[v] * w) - (b[v] - a[v]) * (x - a[u] * w) for a, b in zip(c, (c[1], c[2], c[0]))
    ]
    if min(sides) < 0 < max(sides):
        return 0
    if n[axis] == 0:
        outside = any(max(q[k] for q in c) * w < p[k] or min(q[k] for q in c) * w > p[k] for k in (u, v))
        return 0 if any(sides) or outside else None
    height = inner(n, c[0]) * w - inner(n, p[:3])
    if height == 0:
        return 0  # the sheet itself
    ahead = (height > 0) == (n[axis] > 0)
    if 0 in sides:
        return None if ahead else 0
    return (1 if n[axis] > 0 else -1) if ahead else 0
