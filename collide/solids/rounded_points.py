"""Points of an arrangement rounded to the nearest doubles: by kernels where these prove them, else in integers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.solids.cut_points import CutPoints
from collide.solids.placed_facets import PlacedFacets
from collide.solids.point_kernels import round_crossings, round_piercings, round_vertices


class NearPoints(NamedTuple):
    """All points of an arrangement by id, as kernels round them.

    place : (n, 3) in W [m].   off : (n,) how far that is off at most [m], where proven.
    proven : (n,) bool: the nearest doubles.
    """

    place: np.ndarray
    off: np.ndarray
    proven: np.ndarray


def near_points(points: CutPoints) -> NearPoints:
    """Vertices, piercing points and crossings rounded by kernels; all other points are open. Worked out once, O(n)."""
    if points.rounded is None or len(points.rounded.place) < len(points):
        facets, n = points.facets, len(points)
        near = NearPoints(np.zeros((n, 3)), np.zeros(n), np.zeros(n, dtype=bool))
        pierced = np.concatenate([points.pierced[:, :2], facets.corners[points.pierced[:, 2]]], axis=1)
        start, stop, facet = points.crossed.T
        ends = [pierced[start - points.n_vertices], pierced[stop - points.n_vertices], facets.corners[facet]]
        kernels = round_vertices, round_piercings, round_crossings
        first = 0
        for kernel, named in zip(kernels, (np.arange(points.n_vertices), pierced, np.concatenate(ends, axis=1))):
            _round(facets, kernel, named, NearPoints(*(part[first : first + len(named)] for part in near)))
            first += len(named)
        points.rounded = near
    return points.rounded


def rounded_points(points: CutPoints, ids: np.ndarray) -> tuple[np.ndarray, float]:
    """((k, 3) points in W, each rounded once, the farthest a point was moved [m])."""
    places, off, proven = (part[ids] for part in near_points(points))
    remaining = np.flatnonzero(~proven)
    if len(remaining):
        points.load(ids[remaining])
        for row, point in zip(remaining.tolist(), ids[remaining].tolist()):
            places[row] = points.in_world(point)
        off[remaining] = np.sqrt(np.square(0.5 * np.spacing(np.abs(places[remaining]))).sum(axis=1))
    return places + 0.0, float(off.max(initial=0.0))


def _round(facets: PlacedFacets, kernel, vertices: np.ndarray, near: NearPoints) -> None:
    """Write the points that a kernel makes of vertices (k, …)."""
    if len(vertices):
        kernel(
            address_of(facets.poses), len(facets.poses), address_of(facets.local), address_of(facets.body_of),
            len(facets.local), address_of(vertices), len(vertices), *map(address_of, near[:2]),
            address_of(near.proven.view(np.uint8)),
        )
