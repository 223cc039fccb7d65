"""Exact arrangements of directed segments in the plane: faces, and how often the segments wind around each.

Points are (x, y, w), integers, w > 0, without a common factor: x/w and y/w in units of a grid. Doubles sort out what is
clearly apart or clearly crosses, integers all else.
"""

from __future__ import annotations

import math
from collections import defaultdict
from fractions import Fraction
from functools import cmp_to_key
from itertools import pairwise

import numpy as np

from collide.errors import CollideError
from collide.solids.joined_parts import components
from collide.solids.limits import BYTES_PER_CROSSING, UNLIMITED, Limits

PlanePoint = tuple[int, int, int]
Vector = tuple[int, int]
#: As in `cut_points.py`.
_ERROR = 2.0**-48
#: Pairs of boxes looked at together.
_CHUNK = 1 << 21


class PlaneArrangement:
    """The faces between closed chains of directed segments.

    points : exact points by id, the given points first.   near : the same, rounded (n, 2).
    edges : (e, 2) ids of pieces of segments, each once, without crossings.   counts : (e,) number of segments
    along the piece, less segments back, never 0.   along : of every edge the direction of its segment, in integers.
    face : (2 e,) the face on the left of half-edges: 2 k runs along edge k, 2 k + 1 back.   onward : (2 e,) the
    next half-edge around the face.   winding : (faces,) int64. A face with holes has a number for each ring of its
    border.
    """

    def __init__(self, points: list[Vector], segments: np.ndarray, limits: Limits = UNLIMITED):
        self.points: list[PlanePoint] = [(x, y, 1) for x, y in points]
        self._ids = {p: k for k, p in enumerate(self.points)}
        self._near = [(float(x), float(y)) for x, y in points]
        self._splits: dict[int, set[int]] = defaultdict(set)
        self.segments = segments
        pairs = list(self._close_pairs())
        limits.check_memory(BYTES_PER_CROSSING * len(pairs), f"{len(pairs):,} pairs of segments to be crossed")
        for a, b in limits.watched("crossing segments", pairs):
            self._cross(a, b)
        self._join_pieces(limits)
        self.near = np.array(self._near).reshape(-1, 2)
        self._find_faces()
        self._wind()

    def side_of(self, p: PlanePoint, a: PlanePoint, b: PlanePoint) -> int:
        """Sign of how far p lies left of the line from a to b."""
        value = (b[0] * a[2] - a[0] * b[2]) * (p[1] * a[2] - a[1] * p[2])
        value -= (b[1] * a[2] - a[1] * b[2]) * (p[0] * a[2] - a[0] * p[2])
        return (value > 0) - (value < 0)

    # --- crossings --------------------------------------------------------------------------------------------------

    def _close_pairs(self):
        """Pairs of segments that cross, or may touch or overlap."""
        ends = np.array(self._near)[self.segments]
        for a, b in _box_pairs(ends.min(axis=1), ends.max(axis=1)):
            first, second = ends[a], ends[b]
            at_q = [_sides(first[:, 0], first[:, 1], second[:, k]) for k in range(2)]
            at_p = [_sides(second[:, 0], second[:, 1], first[:, k]) for k in range(2)]
            apart = (at_q[0] * at_q[1] > 0) | (at_p[0] * at_p[1] > 0)
            s, t = self.segments[a], self.segments[b]
            joined = (s[:, :, None] == t[:, None, :]).any(axis=(1, 2))
            apart |= joined & ((at_q[0] != 0) | (at_q[1] != 0)) & ((at_p[0] != 0) | (at_p[1] != 0))
            yield from np.stack([a, b], axis=1)[~apart].tolist()

    def _cross(self, a: int, b: int) -> None:
        s, t = self.segments[a].tolist(), self.segments[b].tolist()
        p, q, u, v = (self.points[k] for k in (*s, *t))
        at_u, at_v, at_p, at_q = (
            self.side_of(u, p, q), self.side_of(v, p, q), self.side_of(p, u, v),
            self.side_of(q, u, v),
        )
        for side, point, row, ends in ((at_u, t[0], a, s), (at_v, t[1], a, s), (at_p, s[0], b, t), (at_q, s[1], b, t)):
            if side == 0 and point not in ends and self._between(point, *ends):
                self._splits[row].add(point)
        if at_u * at_v < 0 and at_p * at_q < 0:
            d = (q[0] - p[0], q[1] - p[1])
            e = (v[0] - u[0], v[1] - u[1])
            slope = d[0] * e[1] - d[1] * e[0]
            share = (u[0] - p[0]) * e[1] - (u[1] - p[1]) * e[0]
            point = self._add(p[0] * slope + d[0] * share, p[1] * slope + d[1] * share, slope)
            self._splits[a].add(point)
            self._splits[b].add(point)

    def _add(self, x: int, y: int, w: int) -> int:
        common = math.gcd(x, y, w) * (1 if w > 0 else -1)
        point = x // common, y // common, w // common
        known = self._ids.setdefault(point, len(self.points))
        if known == len(self.points):
            self.points.append(point)
            self._near.append((point[0] / point[2], point[1] / point[2]))
        return known

    def _between(self, point: int, a: int, b: int) -> bool:
        """Whether a point of a segment's line lies within it."""
        p, q, r = self.points[a], self.points[point], self.points[b]
        k = 0 if p[0] * r[2] != r[0] * p[2] else 1
        return (q[k] * p[2] - p[k] * q[2]) * (r[k] * q[2] - q[k] * r[2]) > 0

    def _join_pieces(self, limits: Limits) -> None:
        counts: dict[tuple[int, int], int] = defaultdict(int)
        along: dict[tuple[int, int], Vector] = {}
        for s, (a, b) in enumerate(limits.watched("joining pieces", self.segments.tolist())):
            p, q = self.points[a], self.points[b]
            d = q[0] - p[0], q[1] - p[1]
            for i, j in pairwise([a, *self._in_order(s, d), b]):
                if i < j:
                    counts[i, j] += 1
                    along[i, j] = d
                else:
                    counts[j, i] -= 1
                    along[j, i] = (-d[0], -d[1])
        remaining = [edge for edge, count in counts.items() if count]
        self.edges = np.array(remaining, dtype=np.int64).reshape(-1, 2)
        self.counts = np.array([counts[edge] for edge in remaining], dtype=np.int64)
        self.along = [along[edge] for edge in remaining]

    def _in_order(self, s: int, d: Vector) -> list[int]:
        """The points that split a segment, in its direction."""
        some = list(self._splits.get(s, ()))
        k = 0 if abs(d[0]) >= abs(d[1]) else 1
        near = [self._near[p][k] for p in some]
        if len(set(near)) == len(near):  # rounding keeps the order
            some = [some[i] for i in np.argsort(near).tolist()]
        else:
            some.sort(key=lambda p: Fraction(self.points[p][k], self.points[p][2]))
        return some if d[k] > 0 else some[::-1]

    # --- faces ------------------------------------------------------------------------------------------------------

    def _find_faces(self) -> None:
        n = 2 * len(self.edges)
        out: dict[int, list[int]] = defaultdict(list)
        for h, start in enumerate(self.edges.ravel().tolist()):
            out[start].append(h)
        self.onward = np.empty(n, dtype=np.int64)
        for start, some in out.items():
            out[start] = some = self._around(some)
            for k, h in enumerate(some):
                self.onward[h ^ 1] = some[k - 1]
        self.out = out
        self.face = np.unique(components(n, np.arange(n), self.onward), return_inverse=True)[1]

    def direction(self, h: int) -> Vector:
        """The direction of a half-edge, in integers."""
        x, y = self.along[h // 2]
        return (x, y) if h % 2 == 0 else (-x, -y)

    def _around(self, some: list[int]) -> list[int]:
        """Half-edges from a point in counter-clockwise order of direction, the first after straight down."""
        vectors = {h: self.direction(h) for h in some}
        half = {h: 0 if x > 0 or (x == 0 and y > 0) else 1 for h, (x, y) in vectors.items()}

        def compare(g: int, h: int) -> int:
            if half[g] != half[h]:
                return half[g] - half[h]
            (a, b), (c, d) = vectors[g], vectors[h]
            value = a * d - b * c
            return (value < 0) - (value > 0)

        return sorted(some, key=cmp_to_key(compare))

    def _wind(self) -> None:
        n_faces = int(self.face.max(initial=-1)) + 1
        beyond: list[list[tuple[int, int]]] = [[] for _ in range(n_faces)]
        sides = self.face[0::2].tolist(), self.face[1::2].tolist()
        for a, b, count in zip(*sides, self.counts.tolist()):
            beyond[a].append((b, -count))
            beyond[b].append((a, count))
        part = components(n_faces, self.face[0::2], self.face[1::2])
        of_edge = part[self.face[0::2]]
        self.winding = np.zeros(n_faces, dtype=np.int64)
        known = np.zeros(n_faces, dtype=bool)
        for name in np.unique(part).tolist():
            points = np.unique(self.edges[of_edge == name]).tolist()
            lowest = min(self.near[points, 0])
            first = min(
                (p for p in points if self.near[p, 0] == lowest),
                key=lambda p: (
                    Fraction(self.points[p][0], self.points[p][2]),
                    Fraction(self.points[p][1], self.points[p][2]),
                ),
            )
            start = int(self.face[self.out[first][-1]])
            self.winding[start], known[start] = self.winding_at(self.points[first], of_edge != name), True
            stack = [start]
            while stack:
                here = stack.pop()
                for there, step in beyond[here]:
                    if not known[there]:
                        self.winding[there], known[there] = self.winding[here] + step, True
                        stack.append(there)
                    elif self.winding[there] != self.winding[here] + step:
                        raise CollideError("the segments of an arrangement do not close; please report it")

    def winding_at(self, p: PlanePoint, some: np.ndarray) -> int:
        """The winding number of edges, (e,) bool which, around a point off all edges."""
        y = p[1] / p[2]
        low, high = (self.near[self.edges[:, k], 1] for k in range(2))
        rows = np.flatnonzero(some & (np.minimum(low, high) <= y) & (np.maximum(low, high) >= y))
        total = 0
        for k in rows.tolist():
            a, b = (self.points[v] for v in self.edges[k].tolist())
            up_a, up_b = (q[1] * p[2] > p[1] * q[2] for q in (a, b))
            if up_a != up_b and self.side_of(p, a, b) == (1 if up_b else -1):
                total += int(self.counts[k]) * (1 if up_b else -1)
        return total

    def point_within(self, face: int) -> PlanePoint:
        """A point of a face: from the middle of an edge a little to its left."""
        rows = np.flatnonzero((self.face[0::2] == face) != (self.face[1::2] == face))
        ends = self.near[self.edges[rows]]
        k = int(rows[np.argmax(np.abs(ends[:, 1] - ends[:, 0]).max(axis=1))])
        p, q = (self.points[v] for v in self.edges[k].tolist())
        middle = p[0] * q[2] + q[0] * p[2], p[1] * q[2] + q[1] * p[2], 2 * p[2] * q[2]
        x, y = self.direction(2 * k if self.face[2 * k] == face else 2 * k + 1)
        size = int(np.abs(self.near[self.edges[k, 1]] - self.near[self.edges[k, 0]]).max()) + 1
        longest = max(abs(x), abs(y))
        for halvings in range(8, 1 << 14, 24):
            below = longest << halvings
            end = (
                middle[0] * below - size * y * middle[2],
                middle[1] * below + size * x * middle[2],
                middle[2] * below,
            )
            if not self._crossed(middle, end, k):
                return end
        raise CollideError("no point is found within a face of an arrangement; please report it")

    def _crossed(self, a: PlanePoint, b: PlanePoint, edge: int) -> bool:
        """Whether edges other than one meet a segment."""
        near = np.array([[p[0] / p[2], p[1] / p[2]] for p in (a, b)])
        slack = 2.0**-48 * np.abs(self.near).max()
        ends = self.near[self.edges]
        is_near = (ends.min(axis=1) <= near.max(axis=0) + slack) & (ends.max(axis=1) >= near.min(axis=0) - slack)
        for k in np.flatnonzero(is_near.all(axis=1)).tolist():
            p, q = (self.points[v] for v in self.edges[k].tolist())
            at_p, at_q = self.side_of(p, a, b), self.side_of(q, a, b)
            if k != edge and at_p * at_q <= 0 and self.side_of(a, p, q) * self.side_of(b, p, q) <= 0:
                return True
        return False


def _box_pairs(low: np.ndarray, high: np.ndarray):
    """Pairs (a, b) of boxes (n, 2) that meet, rounded ones as if a little larger, many at a time."""
    slack = 2.0**-50 * max(float(np.abs(low).max(initial=0.0)), float(np.abs(high).max(initial=0.0)))
    low, high = low - slack, high + slack
    order = np.argsort(low[:, 0], kind="stable")
    counts = np.searchsorted(low[order, 0], high[order, 0], side="right") - np.arange(len(order)) - 1
    start = 0
    while start < len(order):
        stop = start + max(int(np.searchsorted(np.cumsum(counts[start:]), _CHUNK)), 1)
        some = counts[start:stop]
        rows = np.repeat(np.arange(start, start + len(some)), some)
        within = np.arange(len(rows)) - np.repeat(np.cumsum(some) - some, some)
        a, b = order[rows], order[rows + 1 + within]
        meet = (low[a, 1] <= high[b, 1]) & (low[b, 1] <= high[a, 1])
        yield a[meet], b[meet]
        start = stop


def _sides(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
    """(k,) clear signs of the orientations of rounded points (k, 2), 0 where rounding leaves the sign open."""
    d, e = q - p, r - p
    value = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]
    size = np.maximum(np.abs(d).max(axis=1), np.abs(e).max(axis=1))
    limit = _ERROR * size * (np.abs(p).max(axis=1) + size)
    return np.where(np.abs(value) > limit, np.sign(value), 0.0).astype(np.int8)
