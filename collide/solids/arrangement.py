"""The arrangement of r posed solids: their facets cut where they meet, and the cells between, exactly.

J. Erickson, "Local polyhedra and geometric graphs" (2005), corollary 3.2 and section 6: any boolean function of the
bodies is a choice among its cells. Facets without meeting facets are taken whole.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from collide.narrowphase.facets.facet_queries import all_hits, steady_facets
from collide.shapes.shape import kept_with_shape
from collide.solids.around_edges import Sheets
from collide.solids.cells import Cells, cells_of, merged_sheets
from collide.solids.crossing_pairs import NO_CROSSINGS, crossing_pairs
from collide.solids.cut_points import CutPoints, axis_of
from collide.solids.cut_segments import cut_segments
from collide.solids.facet_cuts import FacetCuts, segment
from collide.solids.limits import BYTES_PER_PAIR, UNLIMITED, Limits
from collide.solids.placed_facets import Operand, PlacedFacets
from collide.solids.split_facets import split_facets
from collide.solids.sweep_triangulation import triangulate

#: The margin of steady facets, in units of a mesh's tree: rounding moves vertices by less, but for meshes far away.
_STEADY = 2.0**-48


class Arrangement(NamedTuple):
    """The cells of space between the surfaces of r solids.

    facets : the bodies' facets.   points : exact points by id.   sheets : triangles between cells.
    cells : the cells on both sides of every sheet, and the bodies' winding numbers there; a body holds a cell
        of winding number 1 or more.
    n_meeting, n_cut : number of meeting pairs of facets, and of cut facets.
    """

    facets: PlacedFacets
    points: CutPoints
    sheets: Sheets
    cells: Cells
    n_meeting: int
    n_cut: int

    def holds(self) -> np.ndarray:
        """(c, r) bool: which bodies hold each cell."""
        return self.cells.winding >= 1

    def boundary(self, keep: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(triangles (k, 3) with the cells to keep behind them, their sheets (k,)).   keep : (c,) bool."""
        before, behind = keep[self.cells.sides].T
        rows = np.flatnonzero(before != behind)
        triangles = self.sheets.triangles[rows]
        turned = before[rows]
        triangles[turned] = triangles[turned, ::-1]
        return triangles, rows


def arrange(operands: list[Operand], limits: Limits = UNLIMITED) -> Arrangement:
    """The arrangement of one or more solids at their poses."""
    limits.stage("finding facets that meet")
    facets = PlacedFacets(operands)
    points = CutPoints(facets)
    pairs = meeting_pairs(facets)
    crossings, is_clear, exactly = _clear_crossings(facets, pairs)
    segments = cut_segments(facets, points, crossings, exactly)
    by_paths = np.zeros(len(facets.corners), dtype=bool)
    by_paths[crossings.pairs] = True
    by_paths &= ~exactly
    triangles, of_triangle, rest = split_facets(facets, segments, np.flatnonzero(by_paths))
    exactly[rest] = True
    unclear = pairs[~is_clear]
    n_exact = len(unclear) + int(exactly[crossings.pairs].any(axis=1).sum())
    limits.check_memory(BYTES_PER_PAIR * n_exact, f"{n_exact:,} pairs of facets to be cut exactly")
    pieces: list[tuple[int, int, int]] = []
    of: list[int] = []
    is_cut = by_paths
    if exactly.any() or len(facets.thin):
        cuts = FacetCuts(facets, points, unclear, segments, np.flatnonzero(exactly), limits)
        for f in limits.watched("cutting facets", sorted(cuts.corners_of)):
            made = cut_facet(cuts, f)
            pieces += made
            of += [f] * len(made)
        is_cut[list(cuts.corners_of)] = True
    of_piece = np.array(of, dtype=np.int64)
    body = facets.body[of_piece]
    merged = merged_sheets(np.array(pieces, dtype=np.int64).reshape(-1, 3), of_piece, body, len(operands))
    sheets = _all_sheets(facets, np.flatnonzero(~is_cut), triangles, of_triangle, merged)
    limits.stage("telling cells apart")
    cells = cells_of(sheets, points, is_cut, *segments.ordered())
    return Arrangement(facets, points, sheets, cells, len(pairs), int(is_cut.sum()))


def _clear_crossings(facets: PlacedFacets, pairs: np.ndarray):
    """(clear crossings of two bodies, (k,) bool: pairs with a clear crossing, (F,) bool: facets to be cut exactly).

    Facets crossing their own body's, and their neighbours in such crossings, are cut exactly.
    """
    exactly = np.zeros(len(facets.corners), dtype=bool)
    if not len(pairs):
        return NO_CROSSINGS, np.zeros(0, dtype=bool), exactly
    of_one = facets.body[pairs[:, 0]] == facets.body[pairs[:, 1]]
    crossings, proven = crossing_pairs(facets, pairs[~of_one])
    exactly[pairs[of_one]] = True
    exactly[pairs[exactly[pairs].any(axis=1)]] = True
    exactly[pairs[~of_one][~proven]] = True
    rows = np.unique(crossings.pairs)
    two_sided = facets.beside(facets.edge[rows].ravel())[:, 0].reshape(-1, 3) >= 0
    exactly[rows[~two_sided.all(axis=1)]] = True
    is_clear = ~of_one
    is_clear[is_clear] = proven
    return crossings, is_clear, exactly


def _all_sheets(
    facets: PlacedFacets, whole: np.ndarray, triangles: np.ndarray, of: np.ndarray, merged: Sheets
) -> Sheets:
    """Whole facets first, then those split by paths, then merged ones."""
    rows = np.concatenate([whole, of, merged.facet])
    n = len(whole) + len(of)
    steps = np.zeros((len(rows), len(facets.operands)), dtype=np.int8)
    for k in range(len(facets.operands)):
        steps[:n, k] = facets.body[rows[:n]] == k
    steps[n:] = merged.steps
    corners = np.empty((len(rows), 3), dtype=np.int64)
    np.take(facets.corners, whole, axis=0, out=corners[: len(whole)], mode="clip")
    corners[len(whole) : n], corners[n:] = triangles, merged.triangles
    return Sheets(corners, rows, steps)


def meeting_pairs(facets: PlacedFacets) -> np.ndarray:
    """(k, 2) rows of meeting facets: of two bodies, and of a body crossing itself; facets of zero area are left out."""
    rows = []
    for i, A in enumerate(facets.operands):
        hits = crossings_of(A.mesh)
        rows.append(np.stack([facets.rows_of(i, hits[:, k]) for k in range(2)], axis=1))
        for j, B in enumerate(facets.operands[i + 1 :], i + 1):
            hits = all_hits(A.body.tree, B.body.tree, A.X, B.X).pairs
            rows.append(np.stack([facets.rows_of(i, hits[:, 0]), facets.rows_of(j, hits[:, 1])], axis=1))
    pairs = np.concatenate(rows)
    return pairs[(pairs >= 0).all(axis=1)]


class Steadiness(NamedTuple):
    """Crossings of a mesh's facets, with vertices in place and with vertices moved a little.

    crossings : (k, 2) pairs of crossing facets.
    is_steady : (n,) bool, facets of which no two cross either where vertices are moved by the margin along each axis.
    margin : [m], in the frame of the mesh.
    """

    crossings: np.ndarray
    is_steady: np.ndarray
    margin: float


@kept_with_shape("_crossings")
def steadiness_of(mesh) -> Steadiness:
    """The crossings of a mesh, and its steady facets: in the time of the crossings."""
    margin = _STEADY * math.ldexp(1.0, mesh.tree.exponent)
    return Steadiness(*steady_facets(mesh.tree, margin), margin)


def crossings_of(mesh) -> np.ndarray:
    """(k, 2) facets of a mesh that cross each other."""
    return steadiness_of(mesh).crossings


def cut_facet(cuts: FacetCuts, f: int) -> list[tuple[int, int, int]]:
    """Triangles, with the facet's front, between the segments on it."""
    points = cuts.points
    normal = cuts.facets.normal(f)
    axis, u, v = axis_of(normal)
    pieces: set[tuple[int, int]] = set()
    for s in cuts.segments_of[f]:
        chain = [*s, *cuts.splits.get(s, ())]
        if len(chain) > 2:
            chain = points.in_order(chain, u, v)
        pieces.update(segment(p, q) for p, q in pairwise(chain))
    order = points.in_order({p for piece in pieces for p in piece}, u, v)
    rank = {p: k for k, p in enumerate(order)}
    ranked = [(i, j) if i < j else (j, i) for i, j in ((rank[p], rank[q]) for p, q in pieces)]
    triangles = triangulate(len(order), ranked, lambda i, j, k: points.side(order[i], order[j], order[k], u, v))
    if normal[axis] > 0:
        return [(order[i], order[j], order[k]) for i, j, k in triangles]
    return [(order[i], order[k], order[j]) for i, j, k in triangles]
