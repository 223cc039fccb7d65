"""Exact oracle for pairs with a triangle mesh: every facet against every facet, boxes only to leave pairs out.

A mesh is its triangles, each a convex set of three points; a convex body is one set of all its points. Whether two
such sets meet, and how far apart they are, is `exact.gjk` on integers. Where no sets meet, bodies of one lie wholly
in or out of a closed mesh: one vertex of every connected part is looked for inside, by how often the surface winds
around it. A solid is its facets and all points around which they wind once or more.

It shares no code with the engine. Boxes are those of coordinates rounded to doubles, grown by far more than that
rounding; all else is integers and Fractions. How deep meshes overlap is not worked out: no formula says it.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction

import numpy as np

from collide.adapters.peers.exact import cross, dot, gjk, minus, world_points

#: Boxes are grown by this part of the largest coordinate of a body.
_MARGIN = 1e-12
#: Pairs of cells in a leaf of the search, looked at together.
_LEAF = 1024
#: Pairs of cells looked at in one go, after the first few.
_FIRST_CHUNK, _CHUNK = 64, 4096
_DIGITS = 40
#: Directions of rays, changed where a facet is grazed.
_RAYS = ((7919, 104729, 1299709), (-15485863, 32452843, 49979687), (86028121, -3, 17), (1, -982451653, 57885161))


class Cells:
    """A body in the world: convex cells of points, integers times a power of two, worked out when first asked for.

    points : (n, 3) in the body's frame.   X_WB : (4, 4), its entries taken as they are.
    faces : (m, k) ids of points, cell by cell.   solid : closed triangles with an inside.
    radius : of a ball swept over it.   boxes : (m, 6) low and high of every cell, rounded outwards, without the radius.
    """

    def __init__(self, points, faces, solid: bool, radius: float, X_WB):
        self.points = np.asarray(points, dtype=np.float64)
        self.X_WB = np.asarray(X_WB, dtype=np.float64)
        self.faces, self.solid, self.radius = np.asarray(faces), solid, radius
        placed = self.placed = (self.X_WB[None, :3, :3] * self.points[:, None]).sum(axis=2) + self.X_WB[:3, 3]
        size = (np.abs(self.X_WB[None, :3, :3]) * np.abs(self.points[:, None])).sum(axis=2).max(axis=0)
        self.size = float(size.max()) + float(np.abs(self.X_WB[:3, 3]).max())
        margin = _MARGIN * (size + np.abs(self.X_WB[:3, 3])) + 5e-324
        corners = placed[self.faces]
        self.boxes = np.hstack([corners.min(axis=1) - margin, corners.max(axis=1) + margin])
        self._exact: dict[int, tuple[list, int]] = {}

    def cell(self, k: int) -> tuple[list[tuple[int, int, int]], int]:
        """Corners of cell k as integers, and their exponent."""
        if k not in self._exact:
            self._exact[k] = self._world(self.points[self.faces[k]])
        return self._exact[k]

    def point(self, k: int) -> tuple[tuple[int, int, int], int]:
        """Point k, and its exponent."""
        (point,), exponent = self._world(self.points[k : k + 1])
        return point, exponent

    def _world(self, points):
        return world_points(points.tolist(), self.X_WB[:3, :3].tolist(), self.X_WB[:3, 3].tolist())


@dataclass(frozen=True)
class Verdict:
    """hit : the closed sets share a point.   surfaces : their cells do, radii included; else one lies inside the other.

    distance : of bodies apart, rounded once; None where they meet.
    """

    hit: bool
    surfaces: bool
    distance: float | None


def mesh_cells(vertices, faces, solid: bool, X_WB) -> Cells:
    """A mesh (n, 3), (m, 3) at a pose (4, 4)."""
    return Cells(vertices, faces, solid, 0.0, X_WB)


def convex_cells(points, radius: float, X_WB) -> Cells:
    """The hull of points (n, 3) swept by a ball, at a pose (4, 4)."""
    return Cells(points, np.arange(len(points))[None], False, radius, X_WB)


def judge(A: Cells, B: Cells, *, distances: bool = True) -> Verdict:
    """Whether two bodies meet, and how far apart they are where they do not.

    distances : False leaves the distance out.
    """
    reach = Fraction(A.radius) + Fraction(B.radius)
    if _cells_meet(A, B, reach):
        return Verdict(True, True, None)
    if (A.solid and _has_part_inside(A, B)) or (B.solid and _has_part_inside(B, A)):
        return Verdict(True, False, None)
    return Verdict(False, False, _gap(A, B, reach) if distances else None)


# --- facets -----------------------------------------------------------------------------------------


def facet_pairs(A: Cells, B: Cells) -> list[tuple[int, int]]:
    """All pairs of cells that share a point, sorted; radii are left out."""
    return sorted((i, j) for i, j in _candidates(A, B, 0.0) if not _squared(A, B, i, j, True))


def _cells_meet(A: Cells, B: Cells, reach: Fraction) -> bool:
    within = float(reach) * (1 + 1e-9)
    return any(_squared(A, B, i, j, not reach) <= reach**2 for i, j in _candidates(A, B, within))


def _candidates(A: Cells, B: Cells, within: float) -> Iterator[tuple[int, int]]:
    """Pairs of cells that may come within a length of each other."""
    boxes, size = _near_cells(A, B, within), _FIRST_CHUNK
    while batch := list(itertools.islice(boxes, size)):
        yield from _not_parted(A, B, batch, within)
        size = _CHUNK


def _not_parted(
    A: Cells, B: Cells, pairs: list[tuple[int, int]] | np.ndarray, within: float
) -> list[tuple[int, int]]:
    """Pairs of cells that no guessed axis parts by more than a length and far more than what doubles may be off."""
    remaining = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    slack = within + 1e-9 * max(A.size, B.size)
    open_ = np.ones(len(remaining), dtype=bool)
    for axis in _guesses(A, B, remaining):
        lengths = np.sqrt((axis**2).sum(axis=1))
        axis = axis / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        p, q = (
            (body.placed[body.faces[ids]] * axis[:, None]).sum(axis=2)
            for body, ids in ((A, remaining[:, 0]), (B, remaining[:, 1]))
        )
        apart = np.maximum(q.min(axis=1) - p.max(axis=1), p.min(axis=1) - q.max(axis=1))
        open_ &= ~((apart > slack) & (lengths > 0.0))
    remaining = remaining[open_]
    return [(i, j) for i, j in remaining.tolist()]


def _guesses(A: Cells, B: Cells, pairs: np.ndarray) -> list[np.ndarray]:
    """Axes (k, 3) for pairs of cells: between their middles, normals of triangles, products of their edges."""
    p, q = A.placed[A.faces[pairs[:, 0]]], B.placed[B.faces[pairs[:, 1]]]
    edges = [np.roll(corners, -1, axis=1) - corners if corners.shape[1] == 3 else None for corners in (p, q)]
    axes = [q.mean(axis=1) - p.mean(axis=1)]
    axes += [np.cross(e[:, 0], e[:, 1]) for e in edges if e is not None]
    if edges[0] is not None and edges[1] is not None:
        axes += [np.cross(edges[0][:, i], edges[1][:, j]) for i in range(3) for j in range(3)]
    elif edges[0] is not None or edges[1] is not None:
        body = B if edges[0] is not None else A
        axes += [np.tile(body.X_WB[:3, k], (len(pairs), 1)) for k in range(3)]
    return axes


def _squared(A: Cells, B: Cells, i: int, j: int, boolean: bool) -> Fraction:
    """Of the distance of two cells; with ``boolean`` any positive number stands for it where they are apart."""
    (P, e), (Q, f) = A.cell(i), B.cell(j)
    exponent = min(e, f)
    nearest = gjk(_finer(P, e - exponent), _finer(Q, f - exponent), boolean=boolean)
    return Fraction(dot(nearest.v, nearest.v), nearest.total**2) * Fraction(4) ** exponent


def _near_cells(A: Cells, B: Cells, within: float) -> Iterator[tuple[int, int]]:
    """Pairs of cells whose boxes come within a length of each other."""
    todo = [(np.arange(len(A.faces)), np.arange(len(B.faces)))]
    while todo:
        some, others = todo.pop()
        if _between(_around(A, some), _around(B, others)) > within:
            continue
        if len(some) * len(others) <= _LEAF:
            yield from map(tuple, _pairs_within(A, B, some, others, within).tolist())
        elif len(some) >= len(others):
            todo += [(half, others) for half in _split(A, some)]
        else:
            todo += [(some, half) for half in _split(B, others)]


def _around(body: Cells, cells: np.ndarray) -> list[float]:
    boxes = body.boxes[cells]
    return boxes[:, :3].min(axis=0).tolist() + boxes[:, 3:].max(axis=0).tolist()


def _finer(points, shift: int) -> list[tuple[int, ...]]:
    """Integer points in a unit that is smaller by 2**shift."""
    return [tuple(x << shift for x in point) for point in points]


def _pairs_within(A: Cells, B: Cells, some: np.ndarray, others: np.ndarray, within: float) -> np.ndarray:
    """(k, 2) pairs of cells whose boxes come within a length of each other: of all others `_between` says more."""
    p, q = A.boxes[some][:, None], B.boxes[others]
    steps = np.maximum(np.maximum(p[..., :3] - q[:, 3:], q[:, :3] - p[..., 3:]), 0.0)
    i, j = np.nonzero(np.sqrt((steps**2).sum(axis=2)) * (1 - 1e-12) <= within)
    return np.stack([some[i], others[j]], axis=1)


def _between(low: list[float], high: list[float]) -> float:
    """A lower bound of the distance of two boxes."""
    steps = [max(low[k] - high[k + 3], high[k] - low[k + 3], 0.0) for k in range(3)]
    return math.sqrt(steps[0] ** 2 + steps[1] ** 2 + steps[2] ** 2) * (1 - 1e-12)


def _split(body: Cells, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    centres = body.boxes[cells, :3] + body.boxes[cells, 3:]
    axis = int(np.argmax(np.ptp(centres, axis=0)))
    order = cells[np.argsort(centres[:, axis], kind="stable")]
    return order[: len(order) // 2], order[len(order) // 2 :]


def _gap(A: Cells, B: Cells, reach: Fraction) -> float:
    """The least distance over all pairs of cells, nearest boxes first."""
    best: Fraction | None = None
    axis = np.zeros(3)
    limit, count = math.inf, 0
    queue = [(0.0, count, np.arange(len(A.faces)), np.arange(len(B.faces)))]
    while queue and queue[0][0] <= limit:
        _, _, some, others = heapq.heappop(queue)
        if len(some) * len(others) <= _LEAF:
            pairs = _by_middles(A, B, _pairs_within(A, B, some, others, limit))
            if best is not None:
                pairs = _not_beyond(A, B, pairs, axis, limit)
            while len(pairs):
                (i, j), pairs = pairs[0].tolist(), pairs[1:]
                squared = _squared(A, B, i, j, False)
                if best is None or squared < best:
                    best, axis = squared, _towards(A, B, i, j)
                    limit = float(_root(squared)) * (1 + 1e-9)
                    pairs = _not_beyond(A, B, pairs, axis, limit)
            continue
        if len(some) >= len(others):
            parts = [(half, others) for half in _split(A, some)]
        else:
            parts = [(some, half) for half in _split(B, others)]
        for part_a, part_b in parts:
            count += 1
            heapq.heappush(queue, (max(0.0, _between(_around(A, part_a), _around(B, part_b))), count, part_a, part_b))
    assert best is not None
    if not reach:
        return float(_root(best))
    r = Context(prec=_DIGITS).divide(Decimal(reach.numerator), Decimal(reach.denominator))
    excess = best - reach**2  # s − r = (s² − r²) / (s + r): nothing left to cancel
    exact = Context(prec=_DIGITS).divide(Decimal(excess.numerator), Decimal(excess.denominator))
    return float(exact / (_root(best) + r))


def _towards(A: Cells, B: Cells, i: int, j: int) -> np.ndarray:
    """About the direction from cell i to cell j, between the points nearest each other; of length 1."""
    (P, e), (Q, f) = A.cell(i), B.cell(j)
    unit = min(e, f)
    v = gjk(_finer(P, e - unit), _finer(Q, f - unit)).v
    largest = max(map(abs, v)) or 1
    n = -np.array([float(Fraction(x, largest)) for x in v])
    return n / (np.sqrt((n**2).sum()) or 1.0)


def _by_middles(A: Cells, B: Cells, pairs: np.ndarray) -> np.ndarray:
    """Pairs of cells (k, 2) whose boxes' middles are nearest first: an early short distance rules out more."""
    p, q = (body.boxes[ids, :3] + body.boxes[ids, 3:] for body, ids in ((A, pairs[:, 0]), (B, pairs[:, 1])))
    return pairs[np.argsort(((p - q) ** 2).sum(axis=1), kind="stable")]


def _not_beyond(A: Cells, B: Cells, pairs: np.ndarray, axis: np.ndarray, limit: float) -> np.ndarray:
    """Pairs of cells (k, 2) that are not clearly farther apart than a length, along an axis or a guessed one: two sets
    are no nearer each other than their projections on a line are."""
    slack = 1e-11 * max(A.size, B.size, np.abs(A.placed).max(), np.abs(B.placed).max())
    low = (B.placed[B.faces[pairs[:, 1]]] * axis).sum(axis=2).min(axis=1)
    high = (A.placed[A.faces[pairs[:, 0]]] * axis).sum(axis=2).max(axis=1)
    pairs = pairs[(low - high) * (1 - 1e-12) - slack <= limit]
    return np.array(_not_parted(A, B, pairs, limit), dtype=np.int64).reshape(-1, 2)


def _root(squared: Fraction) -> Decimal:
    context = Context(prec=_DIGITS)
    return context.sqrt(context.divide(Decimal(squared.numerator), Decimal(squared.denominator)))


# --- insides ----------------------------------------------------------------------------------------


def _has_part_inside(solid: Cells, body: Cells) -> bool:
    """Whether a connected part of the other body has its vertices in a solid; the surfaces do not meet."""
    return any((winding(solid, *body.point(k)) or 0) >= 1 for k in _one_of_each_part(body))


def _one_of_each_part(body: Cells) -> list[int]:
    """A point of every part that hangs together, equal points being one."""
    same = np.unique(body.points + 0.0, axis=0, return_inverse=True)[1].ravel()
    faces, labels = same[body.faces], np.arange(len(body.points))
    while True:
        before = labels.copy()
        np.minimum.at(labels, faces, labels[faces].min(axis=1)[:, None])
        labels = labels[labels]
        if np.array_equal(labels, before):
            break
    of_cells = labels[faces[:, 0]]
    return body.faces[np.unique(of_cells, return_index=True)[1], 0].tolist()


def winding(body: Cells, point: tuple[int, int, int], exponent: int) -> int | None:
    """How often closed triangles wind around a point, integers times 2**exponent; None where it is on them."""
    for direction in _RAYS:
        turns = _crossings(body, point, exponent, direction)
        if turns is not _GRAZED:
            return turns
    raise AssertionError("every ray grazed an edge: choose other directions")


_GRAZED = -(10**9)


def _crossings(body: Cells, point, exponent: int, direction) -> int | None:
    passed, grazed = 0, False
    at = np.array([float(Fraction(x) * Fraction(2) ** exponent) for x in point])
    for k in _along(body, at, np.array(direction, dtype=float)):
        corners, e = body.cell(k)
        unit = min(e, exponent)
        (p,) = _finer([point], exponent - unit)
        a, b, c = (minus(corner, p) for corner in _finer(corners, e - unit))
        normal = cross(minus(b, a), minus(c, a))
        if not any(normal):
            continue  # neighbours close over what has no area
        edges = ((a, b), (b, c), (c, a))
        height, slope = dot(normal, a), dot(normal, direction)
        if height == 0 and all(dot(normal, cross(x, minus(y, x))) >= 0 for x, y in edges):
            return None
        sides = [dot(direction, cross(x, y)) for x, y in edges]
        if min(sides) > 0 or max(sides) < 0:
            if height * slope > 0:
                passed += 1 if slope > 0 else -1
        elif min(sides) >= 0 or max(sides) <= 0:
            grazed = grazed or height * slope >= 0
    return _GRAZED if grazed else passed


def _along(body: Cells, point: np.ndarray, direction: np.ndarray) -> list[int]:
    """Cells whose boxes a ray may meet, for a point that was rounded: the boxes are grown by much more than that."""
    slack = 1e-9 * (np.abs(body.boxes).max() + np.abs(point).max())
    with np.errstate(over="ignore"):
        ends = (np.stack([body.boxes[:, :3] - slack, body.boxes[:, 3:] + slack]) - point) / direction
    enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    return np.flatnonzero((enter <= leave) & (leave >= 0)).tolist()
