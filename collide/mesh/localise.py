"""Meshes made local: long edges with near neighbours are cut until no local stretch exceeds a bound.

J. Erickson, "Local polyhedra and geometric graphs" (2005), section 8: any polyhedron can be localised by decomposing
each facet with a graded mesh. The paper leaves open how. Here, in rounds:

1. an edge is too long above the stretch times the distance from an end to the nearest other vertex of the mesh,
   whether of the same facet or not;
2. of these, every edge that is the longest of both its facets is cut, and the facets with the edge: no T-joints. The
   cut stands where the nearest vertex is farthest, in the middle part of the edge, so vertices of edges side by side
   alternate (figure 12 of the paper) and do not come too near each other;
3. edges within an old facet are flipped to be Delaunay's.

A cut leaves at least 5/16 of an edge longer than stretch · d, d the nearest distance at its end: with a stretch of 16/5
or more no cut brings a vertex nearer to the ends of its own edge than others are. Other edges, closely packed, can:
around them the rounds need not end, and `Crowded` tells where.
"""

from __future__ import annotations

import numpy as np

from collide.mesh.facet_pieces import Edges, Pieces
from collide.mesh.nearest_neighbours import PointTree

#: Shares of an edge at which it may be cut.
_SHARES = np.arange(5, 12) / 16
#: The least stretch that is taken, 1 over the least share.
LEAST_STRETCH = 16 / 5
#: A place whose nearest vertex is so far, in lengths of the longer part, is as good as any: take the middlemost.
_FAR_ENOUGH = 0.25
#: Choices of places in a round: those that came too near one another choose again.
_CHOICES = 3
#: Other new vertices that a new one is compared with.
_RIVALS = 4
#: Edges crowd where new vertices are nearer than this share of how far the corners of their facets were from others.
_CROWDED = 1 / 256


class Crowded(Exception):
    """Cutting was given up.

    vertex : the old vertex at a corner where stretches stay above the bound.   facet : the old facet.
    n_facets, stretch : how many facets had been made, and their local stretch.
    """

    def __init__(self, vertex: int, facet: int, n_facets: int, stretch: float):
        super().__init__(vertex, facet, n_facets, stretch)
        self.vertex, self.facet, self.n_facets, self.stretch = vertex, facet, n_facets, stretch


def localise(pieces: Pieces, distinct: np.ndarray, stretch: float, order: int, max_facets: int, progress) -> None:
    """Cut pieces until σ of the order is at most ``stretch``.

    distinct : old points that differ, by their rows; others do not count as neighbours.
    Raises Crowded where more than max_facets are needed, or vertices come ever nearer to each other.
    O(log n) rounds of O(k log k) for k pieces in the end, where edges do not crowd.
    """
    floor = None
    touched = np.zeros(len(pieces.corners), dtype=bool)
    while True:
        with progress(f"cutting edges: {len(pieces.faces)} facets"):
            rows = np.concatenate([distinct, np.arange(pieces.n_old, len(pieces.points))])
            nearest = _nearest(pieces, rows, order)
            if floor is None:
                floor = _CROWDED * nearest
            edges = pieces.edges()
            lengths = np.sqrt(np.square(np.diff(pieces.points[edges.ends], axis=1)[:, 0]).sum(axis=1))
            nearer = nearest[edges.ends].min(axis=1)
            long = (lengths > stretch * nearer) & (nearer > 0.0)
            if not long.any():
                return
            near = nearest[pieces.n_old :] < floor[pieces.hosts[pieces.n_old :]].min(axis=1)
            if near.any() or len(pieces.faces) > max_facets:
                _give_up(pieces, edges, lengths / nearer)
            cut_rows = _longest(edges, lengths, long)
            cut = _cut(pieces, rows, edges, cut_rows, lengths)
            if not len(cut):
                _give_up(pieces, edges, lengths / nearer)
            touched[:] = False
            touched[pieces.source[np.isin(edges.edge_of, cut).any(axis=1).nonzero()[0]]] = True
            pieces.flip(touched)


def _nearest(pieces: Pieces, rows: np.ndarray, order: int) -> np.ndarray:
    """(n,) the distance of every point to its ``order``-th nearest other; infinite where there are not as many."""
    exponent = 500 - int(np.frexp(np.abs(pieces.points).max())[1])
    out = np.full(len(pieces.points), np.inf)
    for places, squares in PointTree(np.ldexp(pieces.points[rows], exponent)).nearest(order):
        out[rows[places]] = np.ldexp(np.sqrt(squares[:, order - 1]), -exponent)
    return out


def _longest(edges: Edges, lengths: np.ndarray, long: np.ndarray) -> np.ndarray:
    """Too long edges, each the longest too long edge of all its pieces, the longest first."""
    order = np.lexsort((np.arange(len(lengths)), np.where(long, lengths, -1.0)))
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    beaten = np.zeros(len(lengths), dtype=bool)
    ranks = rank[edges.edge_of]
    beaten[edges.edge_of[ranks != ranks.max(axis=1, keepdims=True)]] = True
    cut_rows = np.flatnonzero(long & ~beaten)
    return cut_rows[np.argsort(-rank[cut_rows])]


def _cut(pieces: Pieces, rows: np.ndarray, edges: Edges, cut_rows: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Cut edges, save where their best places are too near each other; returns the rows of the edges cut."""
    exponent = 500 - int(np.frexp(np.abs(pieces.points).max())[1])
    ends = np.ldexp(pieces.points[edges.ends[cut_rows]], exponent)
    scaled = np.ldexp(lengths[cut_rows], exponent)
    known = np.ldexp(pieces.points[rows], exponent)
    open_rows, taken, shares = np.arange(len(cut_rows)), [], []
    for _ in range(_CHOICES):
        if not len(open_rows):
            break
        places, share, clearance = _best_places(PointTree(known), ends[open_rows], scaled[open_rows])
        free = (clearance > 0.0) & ~_has_rival(places, np.minimum(clearance, _FAR_ENOUGH * scaled[open_rows]))
        taken.append(open_rows[free])
        shares.append(share[free])
        known = np.concatenate([known, places[free]])
        open_rows = open_rows[~free]
    which = cut_rows[np.concatenate(taken)]
    possible = pieces.cut(edges, which, np.concatenate(shares))
    return which[possible]


def _best_places(tree: PointTree, ends: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """((c, 3) places on edges (c, 2, 3), (c,) their shares, (c,) how far vertices are there, over the longer part's
    share)."""
    places = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * _SHARES[None, :, None]
    squares, _ = tree.nearest_to(places.reshape(-1, 3), 1)
    clearance = np.sqrt(squares).reshape(places.shape[:2]) / np.maximum(_SHARES, 1.0 - _SHARES)
    good = clearance >= np.minimum(_FAR_ENOUGH * lengths, 0.999 * clearance.max(axis=1))[:, None]
    best = np.where(good, np.abs(_SHARES - 0.5), np.inf).argmin(axis=1)
    rows = np.arange(len(places))
    return places[rows, best], _SHARES[best], clearance[rows, best]


def _has_rival(places: np.ndarray, clearance: np.ndarray) -> np.ndarray:
    """Whether an earlier place is nearer to each than its clearance."""
    n = min(_RIVALS + 1, len(places))
    squares, ids = PointTree(places).nearest_to(places, n)
    near = np.sqrt(squares) < 0.99 * clearance[:, None]
    return (near & (ids >= 0) & (ids < np.arange(len(places))[:, None])).any(axis=1)


def _give_up(pieces: Pieces, edges: Edges, stretches: np.ndarray) -> None:
    stretches = np.where(np.isfinite(stretches), stretches, 0.0)
    worst = int(stretches.argmax())
    facet = int(pieces.source[edges.sides[worst, 0] // 3])
    corner = pieces.weights_in(edges.ends[worst, :1], np.array([facet]))[0].argmax()
    raise Crowded(int(pieces.corners[facet, corner]), facet, len(pieces.faces), float(stretches[worst]))
