"""Points of an arrangement rounded to the nearest doubles: by kernels where these prove them, else in integers."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.solids.cut_points import CutPoints
from collide.solids.placed_facets import PlacedFacets
from collide.solids.point_kernels import round_crossings, round_piercings, round_vertices


def rounded_points(points: CutPoints, ids: np.ndarray) -> tuple[np.ndarray, float]:
    """((k, 3) points in W, each rounded once, the farthest a point was moved [m])."""
    facets = points.facets
    places, off, proven = np.empty((len(ids), 3)), np.zeros(len(ids)), np.zeros(len(ids), dtype=bool)
    kinds = points.kinds(ids)
    pierced = np.concatenate([points.pierced[:, :2], facets.corners[points.pierced[:, 2]]], axis=1)
    start, stop, facet = points.crossed.T
    crossed = [pierced[start - points.n_vertices], pierced[stop - points.n_vertices], facets.corners[facet]]
    bases = 0, points.n_vertices, points.n_vertices + len(pierced)
    kernels = round_vertices, round_piercings, round_crossings
    named = np.arange(points.n_vertices)[:, None], pierced, np.concatenate(crossed, axis=1)
    for is_kind, first, kernel, vertices in zip(kinds, bases, kernels, named):
        rows = np.flatnonzero(is_kind)
        places[rows], off[rows], proven[rows] = _rounded(facets, kernel, vertices[ids[rows] - first])
    remaining = np.flatnonzero(~proven)
    points.load(ids[remaining])
    for row, point in zip(remaining.tolist(), ids[remaining].tolist()):
        places[row] = points.in_world(point)
    off[remaining] = np.sqrt(np.square(0.5 * np.spacing(np.abs(places[remaining]))).sum(axis=1))
    return places + 0.0, float(off.max(initial=0.0))


def rounded_vertices(facets: PlacedFacets, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """((k, 3) vertices in W rounded to doubles, (k,) how far that is off at most, (k,) bool: proven nearest)."""
    return _rounded(facets, round_vertices, rows)


def _rounded(facets: PlacedFacets, kernel, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `rounded_vertices`, of the points that a kernel makes of vertices (k, …)."""
    vertices = np.ascontiguousarray(vertices, dtype=np.int64)
    k = len(vertices)
    places, off, proven = np.empty((k, 3)), np.empty(k), np.empty(k, dtype=np.uint8)
    kernel(
        address_of(facets.poses), len(facets.poses), address_of(facets.local), address_of(facets.body_of),
        len(facets.local), address_of(vertices), k, address_of(places), address_of(off), address_of(proven),
    )
    return places, off, proven.view(bool)
