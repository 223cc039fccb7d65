"""Cells of an arrangement: which sides of its sheets look into the same part of space, and how often each body winds
around that part.

A sheet is a triangle that no other sheet crosses, whatever facets it is part of. Around an edge sheets are put in order
by exact signs; neighbours in that order look into one cell. From a cell to the next the winding numbers change by what
the sheet between them says, and one ray for each part that hangs together tells them absolutely
(Q. Zhou, E. Grinspun, D. Zorin, A. Jacobson, "Mesh arrangements for solid geometry" (2016)).
"""

from __future__ import annotations

from collections import defaultdict
from functools import cmp_to_key
from typing import NamedTuple

import numpy as np

from collide.errors import CollideError
from collide.numerics.exact_points import Point, cross, inner
from collide.solids.cut_points import CutPoints


class Sheets(NamedTuple):
    """Triangles that cross no others, each once.

    triangles : (k, 3) ids of points, counter-clockwise seen from the front.
    facet : (k,) row of a facet it is part of, which has the same front; of several the first.
    steps : (k, r) int8: by how much each body's winding number is greater behind the sheet than before it.
    """

    triangles: np.ndarray
    facet: np.ndarray
    steps: np.ndarray


class Cells(NamedTuple):
    """Of every sheet the cells before and behind it, (k, 2); and of every cell the winding numbers (c, r) int64."""

    sides: np.ndarray
    winding: np.ndarray


def merged_sheets(triangles: np.ndarray, facet: np.ndarray, body: np.ndarray, r: int) -> Sheets:
    """Sheets of triangles that may coincide: one for each set of corners.   body : (k,) whose facets they are part of.

    The first of those that coincide gives the front.
    """
    order = np.sort(triangles, axis=1)
    _, first, group = np.unique(order, axis=0, return_index=True, return_inverse=True)
    sense = _turns(triangles) * _turns(triangles[first])[group.ravel()]
    steps = np.zeros((len(first), r), dtype=np.int8)
    np.add.at(steps, (group.ravel(), body), sense)
    return Sheets(triangles[first], facet[first], steps)


def _turns(triangles: np.ndarray) -> np.ndarray:
    """(k,) int8: 1 where a triangle's ids run upwards around it, −1 where they run downwards."""
    a, b, c = triangles.T
    return np.where((a < b).astype(np.int8) + (b < c) + (c < a) == 2, 1, -1).astype(np.int8)


def cells_of(sheets: Sheets, points: CutPoints) -> Cells:
    """The cells of sheets that close."""
    n = len(sheets.triangles)
    first, second = _joined_sides(sheets, points)
    root = components(2 * n, first, second)
    cells, sides = np.unique(root, return_inverse=True)
    sides = sides.reshape(n, 2)
    return Cells(sides, _windings(sheets, sides, len(cells), points))


def components(n: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) the least number of each component of a graph with edges a[k] – b[k]; O((n + k) log n)."""
    root = np.arange(n)
    while True:
        ra, rb = root[a], root[b]
        low, high = np.minimum(ra, rb), np.maximum(ra, rb)
        open_edges = low != high
        if not open_edges.any():
            return root
        a, b = a[open_edges], b[open_edges]
        np.minimum.at(root, high[open_edges], low[open_edges])
        while True:
            shorter = root[root]
            if (shorter == root).all():
                break
            root = shorter


# --- around edges -------------------------------------------------------------------------------


def _joined_sides(sheets: Sheets, points: CutPoints) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of sides that look into one cell; side 2 i is the front of sheet i, 2 i + 1 its back."""
    T = sheets.triangles
    starts, ends = T.ravel(), np.roll(T, -1, axis=1).ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    order = np.lexsort((high, low))
    low, high = low[order], high[order]
    sheet, upward = order // 3, (starts < ends)[order]
    new = np.flatnonzero(np.concatenate([[True], (low[1:] != low[:-1]) | (high[1:] != high[:-1])]))
    counts = np.diff(np.append(new, len(low)))
    # Turning counter-clockwise about an edge, from its lower end to its higher, one leaves a sheet on its front where
    # the edge runs upward in it, and enters it on its other side.
    leaves = 2 * sheet + ~upward
    enters = leaves ^ 1
    pairs = new[counts == 2]
    first = [leaves[pairs], leaves[pairs + 1]]
    second = [enters[pairs + 1], enters[pairs]]
    for at, count in zip(new[counts != 2].tolist(), counts[counts != 2].tolist()):
        rows = np.arange(at, at + count)
        turned = rows[_around(sheets, points, int(low[at]), int(high[at]), sheet[rows], upward[rows])]
        first.append(leaves[turned])
        second.append(enters[np.roll(turned, -1)])
    return np.concatenate(first), np.concatenate(second)


def _around(sheets: Sheets, points: CutPoints, low: int, high: int, sheet: np.ndarray, upward: np.ndarray) -> list[int]:
    """The order in which sheets stand around an edge, counter-clockwise seen against its direction."""
    p, q = points.exact(low), points.exact(high)
    d: Point = tuple(y * p[3] - x * q[3] for x, y in zip(p[:3], q[:3]))  # type: ignore[assignment]
    normals = []
    for k, up in zip(sheet.tolist(), upward.tolist()):
        n = points.facets.normal(int(sheets.facet[k]))
        normals.append(n if up else (-n[0], -n[1], -n[2]))
    # A sheet lies in the direction n × d from the edge; such directions make the angles that their n make.
    reference = normals[0]

    def half_turn(n: Point) -> int:
        sign = inner(d, cross(reference, n))
        return 0 if sign > 0 or (sign == 0 and inner(reference, n) > 0) else 1

    sector = [half_turn(n) for n in normals]

    def compare(i: int, j: int) -> int:
        if sector[i] != sector[j]:
            return sector[i] - sector[j]
        sign = inner(d, cross(normals[i], normals[j]))
        if sign == 0 and i != j:
            raise CollideError("an arrangement of solids has two sheets in one place; please report it")
        return -1 if sign > 0 else 1

    return sorted(range(len(normals)), key=cmp_to_key(compare))


# --- winding numbers ----------------------------------------------------------------------------


def _windings(sheets: Sheets, sides: np.ndarray, n_cells: int, points: CutPoints) -> np.ndarray:
    """(cells, r) winding numbers."""
    r = sheets.steps.shape[1]
    passages, first = np.unique(np.column_stack([sides, sheets.steps]), axis=0, return_index=True)
    beyond: dict[int, list[tuple[int, np.ndarray]]] = defaultdict(list)
    for row in passages:
        beyond[int(row[0])].append((int(row[1]), row[2:]))
        beyond[int(row[1])].append((int(row[0]), -row[2:]))
    winding = np.zeros((n_cells, r), dtype=np.int64)
    known = np.zeros(n_cells, dtype=bool)
    rays = _Rays(sheets, points)
    for row in np.sort(first).tolist():
        if known[sides[row, 0]]:
            continue
        cell, absolute = rays.shoot(row, sides[row])
        winding[cell], known[cell] = absolute, True
        stack = [cell]
        while stack:
            here = stack.pop()
            for there, step in beyond[here]:
                if known[there]:
                    if (winding[there] != winding[here] + step).any():
                        raise CollideError("the sheets of an arrangement of solids do not close; please report it")
                else:
                    winding[there], known[there] = winding[here] + step, True
                    stack.append(there)
    return winding


class _Rays:
    """Rays along an axis, from points within sheets, against all facets."""

    def __init__(self, sheets: Sheets, points: CutPoints):
        self.sheets, self.points, facets = sheets, points, points.facets
        rows = [v @ o.X[:3, :3].T + o.X[:3, 3] for o in facets.operands for v in (o.mesh.vertices,)]
        near = np.concatenate(rows)[facets.corners]
        size = np.concatenate([np.abs(o.mesh.vertices) @ np.abs(o.X[:3, :3]).T + np.abs(o.X[:3, 3])
                               for o in facets.operands])  # fmt: skip
        self.slack = 2.0**-46 * float(size.max())
        self.low, self.high = near.min(axis=1), near.max(axis=1)

    def shoot(self, row: int, sides: np.ndarray) -> tuple[int, np.ndarray]:
        """(the cell on that side of a sheet towards which an axis points, its winding numbers)."""
        n = self.points.facets.normal(int(self.sheets.facet[row]))
        sizes = [abs(x) for x in n]
        axis = sizes.index(max(sizes))
        corners = [self.points.exact(p) for p in self.sheets.triangles[row].tolist()]
        random = np.random.default_rng(row)
        for _ in range(64):
            weights = [int(x) for x in random.integers(1, 1 << 10, 3)]
            w = corners[0][3] * corners[1][3] * corners[2][3]
            shares = [weight * (w // c[3]) for weight, c in zip(weights, corners)]
            point = tuple(sum(s * c[k] for s, c in zip(shares, corners)) for k in range(3))
            absolute = self._winding((*point, sum(weights) * w), axis)  # type: ignore[arg-type]
            if absolute is not None:
                return int(sides[0 if n[axis] > 0 else 1]), absolute
        raise CollideError("every ray of an arrangement of solids passes an edge; please report it")

    def _winding(self, point: tuple[int, int, int, int], axis: int) -> np.ndarray | None:
        facets = self.points.facets
        grid, origin = facets.grid, facets.origin
        p = np.array([_double(x + o * point[3], point[3], grid) for x, o in zip(point[:3], origin)])
        u, v = (axis + 1) % 3, (axis + 2) % 3
        near = self.high[:, axis] >= p[axis] - self.slack
        for k in (u, v):
            near &= (self.low[:, k] <= p[k] + self.slack) & (self.high[:, k] >= p[k] - self.slack)
        total = np.zeros(self.sheets.steps.shape[1], dtype=np.int64)
        for f in np.flatnonzero(near).tolist():
            passage = self._passage(f, point, axis, u, v)
            if passage is None:
                return None
            total[facets.body[f]] += passage
        return total

    def _passage(self, f: int, p: tuple[int, int, int, int], axis: int, u: int, v: int) -> int | None:
        """1 where a ray leaves through a facet, −1 where it enters, 0 where it does not pass; None along an edge."""
        facets = self.points.facets
        c = facets.exact_corners(f)
        n = facets.normal(f)
        x, y, w = p[u], p[v], p[3]
        sides = [
            (b[u] - a[u]) * (y - a[v] * w) - (b[v] - a[v]) * (x - a[u] * w) for a, b in ((c[0], c[1]), (c[1], c[2]),
                                                                                         (c[2], c[0]))
        ]  # fmt: skip
        if min(sides) < 0 < max(sides):
            return 0
        if n[axis] == 0:
            outside = any(
                max(q[k] for q in c) * w < p[k] or min(q[k] for q in c) * w > p[k] for k in (u, v)
            )  # fmt: skip
            return 0 if any(sides) or outside else None
        height = inner(n, c[0]) * w - inner(n, p[:3])
        if height == 0:
            return 0  # the sheet itself
        ahead = (height > 0) == (n[axis] > 0)
        if 0 in sides:
            return None if ahead else 0
        return (1 if n[axis] > 0 else -1) if ahead else 0


def _double(numerator: int, denominator: int, grid: int) -> float:
    if grid >= 0:
        return (numerator << grid) / denominator
    return numerator / (denominator << -grid)
