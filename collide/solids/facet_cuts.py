"""Cuts of facets: for every facet that meets others, the common segments, with ends and crossings exact.

The common piece of two facets (a point, a segment, a polygon of a plane) is worked out once and drawn on both. Then
segments of a facet are split at their crossings and at points of others within, until nothing changes: a segment of
several facets is split in all of them alike, so that neighbours keep fitting together.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from collide.kernels import address_of
from collide.solids.cut_points import CutPoints, Rational, axis_of, reduced
from collide.solids.cut_segments import CutSegments
from collide.solids.limits import UNLIMITED, Limits
from collide.solids.placed_facets import PlacedFacets
from collide.solids.segment_kernels import points_on_segments
from collide.surface_queries.overlay import common_piece

Segment = tuple[int, int]


class FacetCuts:
    """The segments of cut facets.

    pairs : (k, 2) rows of meeting facets, each pair once, without neighbours that share corners and edges alone.
    segments : common segments of clearly crossing pairs, drawn on the facets to cut among them.
    rows : facets to cut; of pairs both.
    corners_of : ids of a facet's corners.   sides_of : the three segments of its border.
    segments_of, points_of : segments and points on a facet, its border among them.   splits : points within a segment.
    """

    def __init__(
        self, facets: PlacedFacets, points: CutPoints, pairs: np.ndarray, segments: CutSegments, rows: np.ndarray,
        limits: Limits = UNLIMITED,
    ):
        self.facets, self.points = facets, points
        self.corners_of: dict[int, tuple[int, int, int]] = {}
        self.segments_of: dict[int, set[Segment]] = {}
        self.points_of: dict[int, set[int]] = {}
        self.splits: dict[Segment, set[int]] = defaultdict(set)
        self._facets_of: dict[Segment, set[int]] = defaultdict(set)
        self._pieces: dict[int, dict[int, list[Segment]]] = defaultdict(dict)
        self._changed: set[int] = set()
        self._meets: dict[int, set[int]] = defaultdict(set)
        crossings, ids, triples = segments.on_facets(rows, len(facets.corners))
        of_rows = facets.corners[np.union1d(rows, crossings)]
        facets.load(np.unique(np.concatenate([of_rows.ravel(), facets.thin.ravel()])).tolist())
        for f in rows.tolist():
            self._start(f)
        for f, g, p, q in np.column_stack([crossings, ids]).tolist():
            self._put_piece(f, g, [points.place_of(p), points.place_of(q)])
        for f, g, h, p in triples.tolist():
            self._put_crossing((f, g, h), points.place_of(p))
        for f, g in limits.watched("drawing what facets share", pairs.tolist()):
            self._draw(f, g)
        for f in limits.watched("crossing segments", self._pieces):
            self._cross_segments(f)
        self._split_thin_edges()
        while self._changed:
            self._split_segments(self._changed.pop())

    def _start(self, f: int) -> None:
        a, b, c = (self.points.vertex(v) for v in self.facets.corners[f].tolist())
        self.corners_of[f] = a, b, c
        self.segments_of[f], self.points_of[f] = set(), {a, b, c}
        for p, q in ((a, b), (b, c), (c, a)):
            self._put_segment(f, segment(p, q))

    def _put_segment(self, f: int, s: Segment) -> None:
        self.segments_of[f].add(s)
        self.points_of[f].update(s)
        self.points_of[f].update(self.splits.get(s, ()))
        self._facets_of[s].add(f)
        self._changed.add(f)

    def _split(self, s: Segment, point: int) -> None:
        """Split a segment at a point; all facets with the segment are noted as changed."""
        if point not in self.splits[s]:
            self.splits[s].add(point)
            for f in self._facets_of[s]:
                self.points_of[f].add(point)
                self._changed.add(f)

    def _draw(self, f: int, g: int) -> None:
        """What two facets share, worked out in integers, on both."""
        piece = common_piece(self.facets.exact_corners(f), self.facets.exact_corners(g))
        self._put_piece(f, g, [self.points.add(p) for p in piece])

    def _put_piece(self, f: int, g: int, ids: list[int]) -> None:
        """Draw a point, the ends of a segment or the corners of a polygon on the facets to be cut among f and g."""
        ring = list(zip(ids, [*ids[1:], ids[0]])) if len(ids) > 2 else [(ids[0], ids[1])] if len(ids) == 2 else []
        segments = [segment(p, q) for p, q in ring]
        self._meets[f].add(g)
        self._meets[g].add(f)
        for a, b in ((f, g), (g, f)):
            if a not in self.corners_of:
                continue
            self._pieces[a][b] = segments
            self.points_of[a].update(ids)
            self._changed.add(a)
            for s in segments:
                self._put_segment(a, s)

    def _put_crossing(self, three: tuple[int, int, int], point: int) -> None:
        """Split the common segments of three facets, on those to be cut among them, at their common point."""
        for f in three:
            for g in three:
                for s in self._pieces[f].get(g, ()) if f in self.corners_of else ():
                    self._split(s, point)

    def _cross_segments(self, f: int) -> None:
        """Split crossing segments drawn by facets that meet each other: any other segments share ends, or are split
        where they cross.
        """
        pieces = self._pieces[f]
        _, u, v = axis_of(self.facets.normal(f))
        for g, drawn in pieces.items():
            for h in pieces.keys() & self._meets[g]:
                if h > g:
                    for s in drawn:
                        for t in pieces[h]:
                            self._cross(s, t, u, v)

    def _cross(self, s: Segment, t: Segment, u: int, v: int) -> None:
        if s[0] in t or s[1] in t:
            return
        side = self.points.side
        if side(*s, t[0], u, v) * side(*s, t[1], u, v) >= 0 or side(*t, s[0], u, v) * side(*t, s[1], u, v) >= 0:
            return
        point = self.points.add(self._crossing(s, t, u, v))
        self._split(s, point)
        self._split(t, point)

    def _crossing(self, s: Segment, t: Segment, u: int, v: int) -> Rational:
        """The crossing of two segments of a plane, not parallel."""
        a, b, c, d = (self.points.exact(p) for p in (*s, *t))
        line = _line(c, d, u, v)
        at_a, at_b = (line[0] * p[u] + line[1] * p[v] + line[2] * p[3] for p in (a, b))
        # Weights of homogeneous points: |at_b| and |at_a| meet on the line.
        x, y, z, w = (abs(at_b) * p + abs(at_a) * q for p, q in zip(a, b))
        return reduced(x, y, z, w)

    def _split_segments(self, f: int) -> None:
        """Split a facet's segments at the facet's points within them."""
        _, u, v = axis_of(self.facets.normal(f))
        for s, p in self._candidates(f, u, v):
            if self._lies_within(p, s, u, v):
                self._split(s, p)

    def _candidates(self, f: int, u: int, v: int) -> Iterable[tuple[Segment, int]]:
        """Segments and points of a facet that may lie within them, by doubles."""
        segments, points = list(self.segments_of[f]), list(self.points_of[f])
        near = np.array([self.points.near(p) for p in points])
        row = {p: k for k, p in enumerate(points)}
        ends = np.array([(row[p], row[q]) for p, q in segments])
        pairs = np.empty((len(segments) * len(points), 2), dtype=np.int64)
        count = points_on_segments(
            address_of(near), len(near), address_of(ends), len(ends), u, v, address_of(pairs), len(pairs)
        )
        for i, j in pairs[:count].tolist():
            if points[j] not in self.splits[segments[i]]:
                yield segments[i], points[j]

    def _lies_within(self, p: int, s: Segment, u: int, v: int) -> bool:
        """Whether a point of the facet's plane lies on a segment, other than its ends."""
        if self.points.side(*s, p, u, v) != 0:
            return False
        return self.points.before(s[0], p, u, v) * self.points.before(p, s[1], u, v) > 0

    def _split_thin_edges(self) -> None:
        """Corners of facets without area lie on edges of others: all edges of a line of such facets know them all."""
        lines: dict[int, set[Segment]] = {}
        for a, b, c in self.facets.thin.tolist():
            edges = {segment(a, b), segment(b, c), segment(c, a)}
            for line in {id(lines[v]): lines[v] for v in (a, b, c) if v in lines}.values():
                edges |= line
            for p, q in edges:
                lines[p] = lines[q] = edges
        for edges in {id(line): line for line in lines.values()}.values():
            self._split_line(edges)

    def _split_line(self, edges: set[Segment]) -> None:
        ids = {self.points.vertex(v) for edge in edges for v in edge}
        rows = np.flatnonzero(np.isin(self.facets.corners, np.unique(list(edges))).sum(axis=1) >= 2)
        for f in rows.tolist():
            a, b, c = self.facets.corners[f].tolist()
            if edges & {segment(a, b), segment(b, c), segment(c, a)}:
                if f not in self.corners_of:
                    self.facets.load((a, b, c))
                    self._start(f)
                self.points_of[f].update(ids)
                self._changed.add(f)


def segment(p: int, q: int) -> Segment:
    return (p, q) if p < q else (q, p)


def _line(p: Rational, q: Rational, u: int, v: int) -> tuple[int, int, int]:
    """(a, b, c) with a·x + b·y + c·w = 0 on the line of two points, seen along an axis."""
    return (
        p[v] * q[3] - p[3] * q[v],
        p[3] * q[u] - p[u] * q[3],
        p[u] * q[v] - p[v] * q[u],
    )
