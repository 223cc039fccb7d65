"""Cells of an arrangement: which sides of its sheets look into the same part of space, and how often each body winds
around that part.

A sheet is a triangle that no other sheet crosses, whatever facets it is part of. Around an edge sheets are put in order
by exact signs; neighbours in that order look into one cell. From a cell to the next the winding numbers change by what
the sheet between them says, and one ray for each part that hangs together tells them absolutely
(Q. Zhou, E. Grinspun, D. Zorin, A. Jacobson, "Mesh arrangements for solid geometry" (2016)).
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import numpy as np

from collide.errors import CollideError
from collide.numerics.exact_points import inner
from collide.solids.around_edges import Sheets, joined_sides
from collide.solids.cut_points import CutPoints
from collide.solids.facet_edges import components, uncut_parts


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


def cells_of(sheets: Sheets, points: CutPoints, is_cut: np.ndarray, crossings: np.ndarray, ids: np.ndarray) -> Cells:
    """The cells of sheets that close.

    sheets : whole facets first.   is_cut : (F,) bool, which facets are not whole.
    crossings : (k, 2) facets that cross clearly, and ids : (k, 2) the ends of what they share, along n_a × n_b.
    """
    facets = points.facets
    parts = [
        uncut_parts(edges, ~is_cut[start:end]) + start
        for edges, start, end in zip(facets.edges, facets.first_facet.tolist(), facets.first_facet[1:].tolist())
    ]
    top = np.concatenate(parts)[~is_cut]
    tops = np.zeros(len(is_cut), dtype=bool)
    tops[top] = True
    number = np.cumsum(tops) - 1
    n_tops = int(tops.sum())
    n = n_tops + len(sheets.triangles) - len(top)
    patch = np.concatenate([number[top], np.arange(n_tops, n)])
    first, second = joined_sides(sheets, points, is_cut, crossings, ids)
    root = components(2 * n, 2 * patch[first // 2] + first % 2, 2 * patch[second // 2] + second % 2)
    cells, of_side = np.unique(root, return_inverse=True)
    of_patch = of_side.reshape(n, 2)
    first_sheet = np.empty(n, dtype=np.int64)
    first_sheet[patch[::-1]] = np.arange(len(patch))[::-1]
    return Cells(of_patch[patch], _windings(sheets, first_sheet, of_patch, len(cells), points))


# --- winding numbers ----------------------------------------------------------------------------


def _windings(
    sheets: Sheets, first_sheet: np.ndarray, sides: np.ndarray, n_cells: int, points: CutPoints
) -> np.ndarray:
    """(cells, r) winding numbers.   first_sheet : (patches,) one of each.   sides : (patches, 2) its cells."""
    r = sheets.steps.shape[1]
    passages, first = np.unique(np.column_stack([sides, sheets.steps[first_sheet]]), axis=0, return_index=True)
    beyond: dict[int, list[tuple[int, np.ndarray]]] = defaultdict(list)
    for row in passages:
        beyond[int(row[0])].append((int(row[1]), row[2:]))
        beyond[int(row[1])].append((int(row[0]), -row[2:]))
    winding = np.zeros((n_cells, r), dtype=np.int64)
    known = np.zeros(n_cells, dtype=bool)
    rays = _Rays(sheets, points)
    for patch in np.sort(first).tolist():
        if known[sides[patch, 0]]:
            continue
        cell, absolute = rays.shoot(int(first_sheet[patch]), sides[patch])
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
        self.near = np.concatenate([o.mesh.vertices @ o.X[:3, :3].T + o.X[:3, 3] for o in facets.operands])
        # Sums of three products and a shift are off by less than six units of the sum of their sizes.
        self.slack = 2.0**-48 * max(
            float(np.abs(o.X[:3, :3]).sum() * np.abs(o.mesh.vertices).max() + np.abs(o.X[:3, 3]).max())
            for o in facets.operands
        )

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
        # What a vertex lies beyond, as bits: facets are out of the way that have a bit of all their corners.
        beyond = (self.near[:, axis] < p[axis] - self.slack).astype(np.uint8)
        for bit, k in ((2, u), (8, v)):
            beyond |= (self.near[:, k] < p[k] - self.slack).astype(np.uint8) * np.uint8(bit)
            beyond |= (self.near[:, k] > p[k] + self.slack).astype(np.uint8) * np.uint8(2 * bit)
        a, b, c = (beyond[facets.corners[:, k]] for k in range(3))
        near = a & b & c == 0
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
