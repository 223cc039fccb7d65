"""Points of an arrangement rounded to the nearest doubles: by kernels where these prove them, else in integers."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.solids.cut_points import CutPoints
from collide.solids.placed_facets import PlacedFacets
from collide.solids.point_kernels import round_piercings, round_vertices


def rounded_points(points: CutPoints, ids: np.ndarray) -> tuple[np.ndarray, float]:
    """((k, 3) points in W, each rounded once, the farthest a point was moved [m])."""
    facets = points.facets
    places, off, proven = np.empty((len(ids), 3)), np.zeros(len(ids)), np.zeros(len(ids), dtype=bool)
    is_vertex = ids < points.n_vertices
    rows = np.flatnonzero(is_vertex)
    places[rows], off[rows], proven[rows] = rounded_vertices(facets, ids[rows])
    rows = np.flatnonzero(~is_vertex & (ids < points.n_vertices + len(points.pierced)))
    places[rows], off[rows], proven[rows] = _rounded_piercings(facets, points.pierced[ids[rows] - points.n_vertices])
    remaining = np.flatnonzero(~proven)
    points.load(ids[remaining])
    for row, point in zip(remaining.tolist(), ids[remaining].tolist()):
        places[row] = points.in_world(point)
    off[remaining] = np.sqrt(np.square(0.5 * np.spacing(np.abs(places[remaining]))).sum(axis=1))
    return places + 0.0, float(off.max(initial=0.0))


def rounded_vertices(facets: PlacedFacets, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """((k, 3) vertices in W rounded to doubles, (k,) how far that is off at most, (k,) bool: proven nearest)."""
    rows = np.ascontiguousarray(rows, dtype=np.int64)
    answers = _answers(len(rows))
    round_vertices(*_bodies(facets), address_of(rows), len(rows), *map(address_of, answers))
    return *answers[:2], answers[2].view(bool)


def _rounded_piercings(facets: PlacedFacets, pierced: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of the points in which edges go through facets.   pierced : (k, 3), two vertices and the facet."""
    vertices = np.ascontiguousarray(np.concatenate([pierced[:, :2], facets.corners[pierced[:, 2]]], axis=1))
    answers = _answers(len(pierced))
    round_piercings(*_bodies(facets), address_of(vertices), len(pierced), *map(address_of, answers))
    return *answers[:2], answers[2].view(bool)


def _bodies(facets: PlacedFacets) -> tuple[int, ...]:
    return (
        address_of(facets.poses), len(facets.poses), address_of(facets.local), address_of(facets.body_of),
        len(facets.local),
    )


def _answers(k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.empty((k, 3)), np.empty(k), np.empty(k, dtype=np.uint8)
