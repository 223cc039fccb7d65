"""The hierarchy of a flat polygon, a segment or a point, as P of the walk where P has no interior.

The walk needs Lemma 4.2 for P's levels: at most a single vertex of P_i lies beyond a plane with P_{i+1} on
a side, a neighbour of the vertex where the plane is tangent. A polygon loses every other vertex from level to level
and keeps the property, and a cone κ is an angle with two neighbours. So the walk of section 5 needs an interior of R
alone.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.hull.exact_hull import Hull

#: Polygons of so few corners are compared as they are.
_FEWEST = 4


class FlatHierarchy(NamedTuple):
    """The fields of `hierarchy.Hierarchy` that the walk reads."""

    points: np.ndarray
    birth: np.ndarray
    parent: np.ndarray
    row: np.ndarray
    neighbour_start: np.ndarray
    neighbours: np.ndarray
    removed_start: np.ndarray
    removed: np.ndarray
    level_start: np.ndarray
    level_vertices: np.ndarray


def flat_hierarchy(points: np.ndarray, hull: Hull) -> FlatHierarchy:
    """Levels of a hull of dimension 0, 1 or 2; O(n)."""
    cycles = [_corners(points, hull)]
    while len(cycles[-1]) > _FEWEST:
        cycle = cycles[-1]
        keep = np.ones(len(cycle), dtype=bool)
        keep[1 : len(cycle) - len(cycle) % 2 : 2] = False
        cycles.append(cycle[keep])
    return _from_cycles(np.ascontiguousarray(points, dtype=np.float64), cycles)


def _from_cycles(points: np.ndarray, cycles: list[np.ndarray]) -> FlatHierarchy:
    count = len(points)
    last = np.full(count, -1, dtype=np.int64)
    for level, cycle in enumerate(cycles):
        last[cycle] = level
    row = np.concatenate([[0], np.cumsum(last + 1)])[:-1].astype(np.int64)
    rows = int((last + 1).sum())
    ring, gone = np.full((rows, 2), -1, dtype=np.int64), np.full((rows, 2), -1, dtype=np.int64)
    for level, cycle in enumerate(cycles):
        beside = np.stack([np.roll(cycle, 1), np.roll(cycle, -1)], axis=1)
        ring[row[cycle] + level] = beside
        stays = last[cycle] > level
        lost = np.where(last[beside[stays]] == level, beside[stays], -1)
        gone[row[cycle[stays]] + level + 1] = lost
    if len(cycles[-1]) <= 2:  # a segment or a point
        ring[ring == np.repeat(np.arange(count), last + 1)[:, None]] = -1
        ring[:, 1] = -1
    birth = np.where(last >= 0, 0, -1).astype(np.int32)
    starts = np.concatenate([[0], np.cumsum([len(cycle) for cycle in cycles])]).astype(np.int64)
    return FlatHierarchy(
        points, birth, np.full(count, -1, dtype=np.int32), row, *_lists(ring), *_lists(gone), starts,
        np.concatenate(cycles).astype(np.int32),
    )


def _lists(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(starts, entries) of the entries ≥ 0, row by row."""
    there = table >= 0
    starts = np.concatenate([[0], np.cumsum(there.sum(axis=1))]).astype(np.int64)
    return starts, table[there].astype(np.int32)


def _corners(points: np.ndarray, hull: Hull) -> np.ndarray:
    """Strictly extreme vertices in the order of the border."""
    if hull.dimension < 2:
        return hull.vertices.astype(np.int64)
    half = hull.facets[: len(hull.facets) // 2].astype(np.int64)
    edges = np.concatenate([half[:, [0, 1]], half[:, [1, 2]], half[:, [2, 0]]])
    known = {(a, b) for a, b in edges.tolist()}
    following = {a: b for a, b in edges.tolist() if (b, a) not in known}
    cycle = [min(following)]
    while following[cycle[-1]] != cycle[0]:
        cycle.append(following[cycle[-1]])
    order = np.array(cycle)
    before, here, after = points[np.roll(order, 1)], points[order], points[np.roll(order, -1)]
    into, out = here - before, after - here
    bend = np.abs(np.cross(into, out)).max(axis=1)
    doubtful = ~(bend > 1e-10 * np.abs(into).max(axis=1) * np.abs(out).max(axis=1))
    for k in np.flatnonzero(doubtful).tolist():
        doubtful[k] = _in_line(before[k], here[k], after[k])
    return order[~doubtful]


def _in_line(a, b, c) -> bool:
    p, q, r = ([Fraction(v) for v in point.tolist()] for point in (a, b, c))
    e, f = [y - x for x, y in zip(p, q)], [y - x for x, y in zip(q, r)]
    return all(e[i] * f[j] == e[j] * f[i] for i, j in ((0, 1), (1, 2), (2, 0)))
