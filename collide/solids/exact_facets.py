"""Facets whose corners are exact rational points, and their arrangement.

As `placed_facets.py` and `arrangement.py` for posed meshes; all facets are of a single body here, are cut exactly, and
may coincide.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np

from collide.numerics.exact_points import Point
from collide.shapes.mesh import Mesh
from collide.solids.arrangement import Arrangement, cut_facet
from collide.solids.cells import cells_of, merged_sheets
from collide.solids.cut_points import CutPoints
from collide.solids.cut_segments import NO_SEGMENTS
from collide.solids.facet_cuts import FacetCuts
from collide.solids.facet_edges import FacetEdges
from collide.solids.limits import BYTES_PER_PAIR, UNLIMITED, Limits
from collide.solids.placed_facets import Operand, PlacedFacets
from collide.surface_queries.overlay import common_piece

#: Pairs of boxes looked at together.
_CHUNK = 1 << 21


class ExactFacets(PlacedFacets):
    """Facets (F, 3) of ids of distinct points, integers times 2^grid; none without area.

    The points rounded to doubles stand for the vertices of a body without a pose.
    """

    def __init__(self, points: list[Point], faces: np.ndarray, grid: int):
        rounded = np.array([[_double(x, grid) for x in p] for p in points]).reshape(-1, 3)
        mesh = Mesh(rounded, faces, solid=False)
        body = SimpleNamespace(mesh=mesh, body=SimpleNamespace(tree=mesh.tree), X=np.eye(4))
        n = len(faces)
        none = np.full((1, 2), -1, dtype=np.int64)
        edges = FacetEdges(
            np.arange(n),
            np.arange(n),
            faces,
            np.zeros((n, 3), dtype=np.int64),
            none,
            np.zeros((2, 0), dtype=np.int32),
            np.zeros(0, dtype=np.int64),
            np.zeros((0, 3), dtype=np.int64),
            grid,
        )
        self.operands = [cast(Operand, body)]
        self.poses = np.eye(4)[None]
        self.edges = [edges]
        self.first_vertex, self.first_facet = np.array([0, len(points)]), np.array([0, n])
        self.first_edge = np.array([0, 1])
        self.corners, self.edge = faces, edges.edge
        self.body, self.number = np.zeros(n, dtype=np.int64), np.arange(n)
        self.local, self.body_of = rounded, np.zeros(len(points), dtype=np.int64)
        self.thin = np.zeros((0, 3), dtype=np.int64)
        self.grid, self.origin = grid, (0, 0, 0)
        self._exact = dict(enumerate(points))
        self._normals: dict[int, Point] = {}


class _Cuts(FacetCuts):
    """Facets may lie on one another or share corners: what neighbours share is on their borders already."""

    def _draw(self, f: int, g: int) -> None:
        piece = common_piece(self.facets.exact_corners(f), self.facets.exact_corners(g))
        ids = [self.points.add(p) for p in piece]
        if not set(ids) <= set(self.corners_of[f]) & set(self.corners_of[g]):
            self._put_piece(f, g, ids)


def arrangement_of_facets(facets: ExactFacets, limits: Limits = UNLIMITED) -> Arrangement:
    """The arrangement of closed facets, one winding number a cell."""
    points = CutPoints(facets)
    limits.stage("finding facets that meet")
    pairs = close_pairs(facets)
    limits.check_memory(BYTES_PER_PAIR * len(pairs), f"{len(pairs):,} pairs of facets to be cut exactly")
    rows = np.arange(len(facets.corners))
    cuts = _Cuts(facets, points, pairs, NO_SEGMENTS, rows, limits)
    pieces, of = [], []
    for f in limits.watched("cutting facets", rows.tolist()):
        made = cut_facet(cuts, f)
        pieces += made
        of += [f] * len(made)
    of_piece = np.array(of, dtype=np.int64)
    sheets = merged_sheets(np.array(pieces, dtype=np.int64), of_piece, np.zeros_like(of_piece), 1)
    limits.stage("telling cells apart")
    is_cut = np.ones(len(rows), dtype=bool)
    cells = cells_of(sheets, points, is_cut, *NO_SEGMENTS.ordered())
    return Arrangement(facets, points, sheets, cells, len(pairs), len(rows))


def close_pairs(facets: ExactFacets) -> np.ndarray:
    """(k, 2) rows of facets that may meet: boxes meet, and no plane of either clearly separates them."""
    corners = facets.local[facets.corners]
    slack = 2.0**-50 * np.abs(facets.local).max(initial=0.0)
    low, high = corners.min(axis=1) - slack, corners.max(axis=1) + slack
    order = np.argsort(low[:, 0], kind="stable")
    last = np.searchsorted(low[order, 0], high[order, 0], side="right")
    counts = last - np.arange(len(order)) - 1
    pairs = []
    start = 0
    while start < len(order):
        stop = start + max(int(np.searchsorted(np.cumsum(counts[start:]), _CHUNK)), 1)
        rows = np.repeat(np.arange(start, min(stop, len(order))), counts[start:stop])
        within = np.arange(len(rows)) - np.repeat(
            np.cumsum(counts[start:stop]) - counts[start:stop], counts[start:stop]
        )
        a, b = order[rows], order[rows + 1 + within]
        meet = ((low[a, 1:] <= high[b, 1:]) & (low[b, 1:] <= high[a, 1:])).all(axis=1)
        a, b = a[meet], b[meet]
        pairs.append(np.stack([a, b], axis=1)[~_apart(corners[a], corners[b], slack)])
        start = stop
    return np.concatenate(pairs) if pairs else np.zeros((0, 2), dtype=np.int64)


def _apart(A: np.ndarray, B: np.ndarray, slack: float) -> np.ndarray:
    """(k,) bool: all corners of A's triangle clearly on a side of the plane of B's."""
    error = np.full(len(A), slack)
    apart = np.zeros(len(A), dtype=bool)
    with np.errstate(all="ignore"):
        for T, other_corners in ((A, B), (B, A)):
            _, sides, limit = _sides_of_planes(T, other_corners, error)
            apart |= (sides > limit[:, None]).all(axis=1) | (sides < -limit[:, None]).all(axis=1)
    return apart


def _sides_of_planes(T: np.ndarray, points: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(normals of T, heights of points (k, 3, 3) over T's plane times the normal's length, bounds of their errors).

    As in `narrowphase/facets/filtered_triangles.py`, all corners off by E: edges by f = 2E + 2uL, components of normals
    by 4Lf + 2f² + 3uL², heights by 3 D times that, 3·(2L² + …)·(2E + 2uD), and 4u of the terms: below 40 L D f' with
    the larger of both f.
    """
    u, v = T[:, 1] - T[:, 0], T[:, 2] - T[:, 0]
    n = np.cross(u, v)
    w = points - T[:, :1]
    edge = np.maximum(np.abs(u), np.abs(v)).max(axis=1)
    far = np.maximum(np.abs(w).max(axis=(1, 2)), edge)
    f = 2.0 * error + 4.0 * 2.0**-53 * far
    limit = 40.0 * edge * far * f + 12.0 * far * f * f + 60.0 * 2.0**-53 * edge * edge * far + 1e-260
    return n, (w * n[:, None]).sum(axis=2), limit


def _double(x: int, grid: int) -> float:
    return float(x << grid) if grid >= 0 else x / (1 << -grid)
