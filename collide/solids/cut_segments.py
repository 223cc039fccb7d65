"""Common segments of clearly crossing facets, cut where segments of different bodies cross on a facet.

A segment ends where an edge pierces a facet; edge and facet name the point. Two segments on a facet f, common with
facets g and h of different bodies, cross in the point of the three planes: (f, g, h) names it, and on g and h the same
point is a crossing too. All signs and orders are proven in doubles; facets with an open sign are left to
`facet_cuts.py`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.solids.crossing_pairs import CrossingPairs
from collide.solids.cut_points import CutPoints
from collide.solids.placed_facets import PlacedFacets
from collide.solids.segment_kernels import MAX_SEGMENTS, cross_segments


class CutSegments(NamedTuple):
    """Pieces of the common segments of facets (a, b), of each segment in order along n_a × n_b.

    pairs : (m, 2) rows of facets.   ids : (m, 2) points at both ends.
    edge, pierced : (m, 2) the piercing edge and the pierced facet at an end; −1 at crossings of segments.
    place, error : (p, 3), (p,) points after the vertices in W [m], and a bound of their errors.
    turns : (t, 4) int64 of crossings on facets: the facet, the pieces before the crossing of both segments, of which
        the next follows, and 1 where the second crosses the first from right to left, −1 from left to right.
    triples : (q, 4) int64: three facets and the id of their common point.
    is_ordered : (m,) bool: the order of both ends is proven.
    """

    pairs: np.ndarray
    ids: np.ndarray
    edge: np.ndarray
    pierced: np.ndarray
    place: np.ndarray
    error: np.ndarray
    turns: np.ndarray
    triples: np.ndarray
    is_ordered: np.ndarray

    def ordered(self) -> tuple[np.ndarray, np.ndarray]:
        """(facets (k, 2), ends (k, 2)) of pieces with a proven order of their ends."""
        return self.pairs[self.is_ordered], self.ids[self.is_ordered]

    def on_facets(self, rows: np.ndarray, n_facets: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(pairs (k, 2) of uncut segments on some facets, their ends (k, 2), ``triples`` on some of the facets)."""
        wanted = np.zeros(n_facets, dtype=bool)
        wanted[rows] = True
        is_first, is_last = (self.edge >= 0).T
        pairs, ends = self.pairs[is_first], np.column_stack([self.ids[is_first, 0], self.ids[is_last, 1]])
        drawn = wanted[pairs].any(axis=1)
        return pairs[drawn], ends[drawn], self.triples[wanted[self.triples[:, :3]].any(axis=1)]


_NO_PAIRS, _NO_ROWS = np.zeros((0, 2), dtype=np.int64), np.zeros((0, 4), dtype=np.int64)
#: Without clear crossings.
NO_SEGMENTS = CutSegments(
    _NO_PAIRS, _NO_PAIRS, _NO_PAIRS, _NO_PAIRS, np.zeros((0, 3)), np.zeros(0), _NO_ROWS, _NO_ROWS, np.zeros(0, bool)
)


def cut_segments(
    facets: PlacedFacets, points: CutPoints, crossings: CrossingPairs, failed: np.ndarray
) -> CutSegments:
    """The pieces of clear crossings, with new points for their ends.   failed : (F,) bool, set for facets with an
    open sign.
    """
    if not len(crossings.pairs):
        return NO_SEGMENTS
    ends, place, error = _add_piercings(facets, points, crossings)
    meeting, where = _crossings_on_facets(facets, crossings, failed)
    others = crossings.pairs[meeting[:, 1:3]].sum(axis=2) - meeting[:, :1]
    names, best, which = _named(np.sort(np.column_stack([meeting[:, 0], others]), axis=1), where[:, 3])
    ids = points.add_crossings(np.column_stack([ends[meeting[best, 1]], others[best, 1]]))
    place, error = np.concatenate([place, where[best, :3]]), np.concatenate([error, where[best, 3]])
    # Of every crossing an entry in the chains of its segments, each once.
    n = len(names)
    keys, entry = np.unique((meeting[:, 1:3] * n + which[:, None]).ravel(), return_inverse=True)
    segment, point = (keys // n, ids[keys % n]) if n else (keys, keys)
    k = np.arange(len(ends))
    chain = np.concatenate([k, segment, k])
    start, stop = crossings.place[segment].swapaxes(0, 1)
    rows = point - points.n_vertices
    height = ((place[rows] - start) * (stop - start)).sum(axis=1)
    slack = 16.0 * (error[rows] + crossings.error[segment]) * np.abs(stop - start).sum(axis=1)
    infinite, zero, none = np.full(len(ends), np.inf), np.zeros(len(ends)), np.full(len(segment), -1)
    height, slack = np.concatenate([-infinite, height, infinite]), np.concatenate([zero, slack, zero])
    order = np.lexsort((height, chain))
    ordered = chain[order]
    is_piece = ordered[1:] == ordered[:-1]
    height, slack = height[order], slack[order]
    tight = is_piece & ~(height[1:] > height[:-1] + slack[1:] + slack[:-1])
    failed[crossings.pairs[ordered[1:][tight]]] = True
    at = np.empty(len(order), dtype=np.int64)
    at[order] = np.arange(len(order))
    before = (at[len(ends) : len(ends) + len(segment)] - 1 - segment)[entry].reshape(-1, 2)

    def of_pieces(first: np.ndarray, inner: np.ndarray, last: np.ndarray) -> np.ndarray:
        along = np.concatenate([first, inner, last])[order]
        return np.column_stack([along[:-1][is_piece], along[1:][is_piece]])

    return CutSegments(
        crossings.pairs[ordered[1:][is_piece]], of_pieces(ends[:, 0], point, ends[:, 1]),
        of_pieces(crossings.edge[:, 0], none, crossings.edge[:, 1]),
        of_pieces(crossings.facet[:, 0], none, crossings.facet[:, 1]), place, error,
        np.column_stack([meeting[:, 0], before, meeting[:, 3]]), np.column_stack([names, ids]), ~tight[is_piece],
    )


def _add_piercings(
    facets: PlacedFacets, points: CutPoints, crossings: CrossingPairs
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(ids (k, 2) of the ends of crossings, places (p, 3) of the points, bounds (p,) of their errors).

    Two ends are a single point if the same edge pierces the same facet.
    """
    _, first, ends = np.unique(
        crossings.edge * len(facets.corners) + crossings.facet, return_index=True, return_inverse=True
    )
    pair, end = first // 2, first % 2
    facet, edge = crossings.facet[pair, end], crossings.edge[pair, end]
    owner = crossings.pairs[pair].sum(axis=1) - facet
    slot = np.argmax(facets.edge[owner] == edge[:, None], axis=1)
    corners = facets.corners[owner]
    k = np.arange(len(owner))
    ids = points.add_piercings(np.stack([corners[k, slot], corners[k, (slot + 1) % 3]], axis=1), facet)
    ends = ends.reshape(-1, 2)
    place, error = np.zeros((len(first), 3)), np.zeros(len(first))
    place[ends] = crossings.place
    np.maximum.at(error, ends.ravel(), np.repeat(crossings.error, 2))
    return ids[ends] if len(ids) else ends, place, error


def _crossings_on_facets(
    facets: PlacedFacets, crossings: CrossingPairs, failed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """((t, 4) as ``meeting`` of `cross_segments`, (t, 4) as its ``where``)."""
    n = len(crossings.pairs)
    if len(facets.operands) < 3 or not n:
        return np.zeros((0, 4), dtype=np.int64), np.zeros((0, 4))
    facet, number = crossings.pairs.T.ravel(), np.tile(np.arange(n), 2)
    met = facets.body[crossings.pairs[:, ::-1].T.ravel()]
    order = np.lexsort((met, facet))
    facet, number, met = facet[order], number[order], met[order]
    first = np.flatnonzero(np.append(True, facet[1:] != facet[:-1]))
    last = np.append(first[1:], len(facet))
    several = met[first] != met[last - 1]
    failed[facet[first[several & (last - first > MAX_SEGMENTS)]]] = True
    wanted = np.flatnonzero(several & (last - first <= MAX_SEGMENTS))
    count = (last - first)[wanted]
    rows, starts = np.ascontiguousarray(facet[first[wanted]]), np.append(0, np.cumsum(count))
    segments = np.ascontiguousarray(number[np.repeat(several & (last - first <= MAX_SEGMENTS), last - first)])
    capacity = int((count * (count - 1) // 2).sum())
    meeting, where = np.empty((capacity, 4), dtype=np.int64), np.empty((capacity, 4))
    made = cross_segments(
        address_of(facets.poses), len(facets.poses), address_of(facets.local), len(facets.local),
        address_of(facets.corners), address_of(facets.body), len(facets.corners), address_of(rows), address_of(starts),
        len(rows), address_of(segments), len(segments), address_of(crossings.pairs), address_of(crossings.place),
        address_of(crossings.error), n, address_of(failed.view(np.uint8)), address_of(meeting), address_of(where),
        capacity,
    )
    return meeting[:made], where[:made]


def _named(triples: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(distinct triples (q, 3), of each the row with the least error, (t,) the number of every row's triple)."""
    order = np.lexsort((error, *triples.T[::-1]))
    ordered = triples[order]
    new = np.append(True, (ordered[1:] != ordered[:-1]).any(axis=1))[: len(ordered)]
    which = np.empty(len(order), dtype=np.int64)
    which[order] = np.cumsum(new) - 1
    return ordered[new], order[new], which
