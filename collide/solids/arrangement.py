"""The arrangement of r posed solids: their facets cut where they meet, and the cells between, exactly.

J. Erickson, "Local polyhedra and geometric graphs" (2005), corollary 3.2 and section 6: any boolean function of the
bodies is a choice among its cells. Facets that meet none are cut by nothing and taken whole.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from collide.narrowphase.facets.facet_queries import all_hits, self_hits
from collide.shapes.shape import kept_with_shape
from collide.solids.cells import Cells, Sheets, cells_of, merged_sheets
from collide.solids.cut_points import CutPoints, axis_of
from collide.solids.facet_cuts import FacetCuts, segment
from collide.solids.placed_facets import Operand, PlacedFacets
from collide.solids.sweep_triangulation import triangulate

#: Of the winding numbers (c, r) of cells: which cells belong, (c,) bool.
Rule = Callable[[np.ndarray], np.ndarray]


class Arrangement(NamedTuple):
    """What r solids divide space into.

    facets : the bodies' facets.   points : exact points by id.   sheets : triangles between cells.
    cells : the cells on both sides of every sheet, and the bodies' winding numbers there; a body holds a cell around
        which it winds once or more.
    n_meeting, n_cut : pairs of facets that meet, and facets that are cut.
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
        triangles[turned] = triangles[turned][:, ::-1]
        return triangles, rows


def arrange(operands: list[Operand]) -> Arrangement:
    """The arrangement of one or more solids at their poses."""
    facets = PlacedFacets(operands)
    points = CutPoints(facets)
    pairs = meeting_pairs(facets)
    cuts = FacetCuts(facets, points, pairs)
    pieces, of = [], []
    for f in sorted(cuts.corners_of):
        triangles = _cut_facet(cuts, f)
        pieces += triangles
        of += [f] * len(triangles)
    whole = np.ones(len(facets.corners), dtype=bool)
    whole[list(cuts.corners_of)] = False
    rows = np.flatnonzero(whole)
    r = len(operands)
    of_cut = np.array(of, dtype=np.int64)
    cut = merged_sheets(np.array(pieces, dtype=np.int64).reshape(-1, 3), of_cut, facets.body[of_cut], r)
    steps = np.zeros((len(rows), r), dtype=np.int8)
    steps[np.arange(len(rows)), facets.body[rows]] = 1
    sheets = Sheets(
        np.concatenate([facets.corners[rows], cut.triangles]), np.concatenate([rows, cut.facet]),
        np.concatenate([steps, cut.steps]),
    )  # fmt: skip
    return Arrangement(facets, points, sheets, cells_of(sheets, points), len(pairs), len(cuts.corners_of))


def meeting_pairs(facets: PlacedFacets) -> np.ndarray:
    """(k, 2) rows of facets that meet: of two bodies, and of one where it crosses itself; without area left out."""
    rows = []
    for i, A in enumerate(facets.operands):
        hits = crossings_of(A.mesh)
        rows.append(np.stack([facets.rows_of(i, hits[:, k]) for k in range(2)], axis=1))
        for j, B in enumerate(facets.operands[i + 1 :], i + 1):
            hits = all_hits(A.body.tree, B.body.tree, A.X, B.X).pairs
            rows.append(np.stack([facets.rows_of(i, hits[:, 0]), facets.rows_of(j, hits[:, 1])], axis=1))
    pairs = np.concatenate(rows)
    return pairs[(pairs >= 0).all(axis=1)]


@kept_with_shape("_crossings")
def crossings_of(mesh) -> np.ndarray:
    """(k, 2) facets of a mesh that cross each other."""
    return self_hits(mesh.tree)[0]


def _cut_facet(cuts: FacetCuts, f: int) -> list[tuple[int, int, int]]:
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
