"""Winding numbers by rays along an axis, from points within sheets: exact, all rays of an arrangement at once."""

from __future__ import annotations

import numpy as np

from collide.errors import CollideError
from collide.numerics.exact_vectors import inner
from collide.solids.around_edges import Sheets
from collide.solids.cut_points import CutPoints, Rational
from collide.solids.placed_facets import PlacedFacets
from collide.solids.ray_passages import count_passages

_MAX_TRIES = 64


def shoot(sheets: Sheets, points: CutPoints, rows: np.ndarray, sides: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """For every sheet of rows (k,) the cell on a side, and each body's winding number in the cell, (r,) int64.

    sides : (k, 2) the cells before and behind each sheet.
    """
    facets = points.facets
    points.load(np.unique(sheets.triangles[rows]).tolist())
    facets.load(np.unique(facets.corners[sheets.facet[rows]]).tolist())
    normals = [facets.normal(f) for f in sheets.facet[rows].tolist()]
    axes = np.array([_largest(n) for n in normals], dtype=np.int64)
    upwards = np.array([n[axis] > 0 for n, axis in zip(normals, axes.tolist())])
    winding = np.zeros((len(rows), len(facets.operands)), dtype=np.int64)
    waiting = np.arange(len(rows))
    for attempt in range(_MAX_TRIES):
        if not len(waiting):
            break
        weights = np.random.default_rng(attempt).integers(1, 1 << 10, (len(waiting), 3))
        starts = [
            _within([points.exact(p) for p in triangle], w)
            for triangle, w in zip(sheets.triangles[rows[waiting]].tolist(), weights.tolist())
        ]
        winding[waiting], is_unclear = _windings(facets, starts, axes[waiting])
        waiting = waiting[is_unclear]
    if len(waiting):
        raise CollideError("every ray of an arrangement of solids passes an edge; please report it")
    return list(zip(np.where(upwards, sides[:, 0], sides[:, 1]).tolist(), winding))


def _largest(normal) -> int:
    sizes = [abs(x) for x in normal]
    return sizes.index(max(sizes))


def _within(corners: list[Rational], weights: list[int]) -> Rational:
    """A point within a triangle."""
    w = corners[0][3] * corners[1][3] * corners[2][3]
    shares = [weight * (w // c[3]) for weight, c in zip(weights, corners)]
    x, y, z = (sum(s * c[k] for s, c in zip(shares, corners)) for k in range(3))
    return x, y, z, sum(weights) * w


def _windings(facets: PlacedFacets, starts: list[Rational], axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((k, r) how often bodies wind around points a little further along the axes, (k,) bool: an edge is passed)."""
    places = np.array([facets.in_world(p) for p in starts])
    winding = np.zeros((len(starts), len(facets.operands)), dtype=np.int64)
    is_unclear = np.zeros(len(starts), dtype=bool)
    for k, operand in enumerate(facets.operands):
        winding[:, k], remaining = count_passages(facets.tree_of(k), operand.X, places, axes, facets.slack)
        remaining_rows = facets.rows_of(k, remaining[:, 1])
        for ray, f in zip(remaining[remaining_rows >= 0, 0].tolist(), remaining_rows[remaining_rows >= 0].tolist()):
            passage = _passage(facets, f, starts[ray], int(axes[ray]))
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
