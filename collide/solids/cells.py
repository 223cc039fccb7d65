"""Cells of an arrangement: the sides of its sheets at the same part of space, and each body's winding number in the
part.

A sheet is a triangle without crossing sheets, part of a facet or of several. Around an edge sheets are put in order
by exact signs; neighbours in the order share a cell. From cell to neighbouring cell the winding numbers change by the
steps of the sheet between them, and a ray for each connected part finds their absolute values
(Q. Zhou, E. Grinspun, D. Zorin, A. Jacobson, "Mesh arrangements for solid geometry" (2016)).
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import numpy as np

from collide.errors import CollideError
from collide.solids.around_edges import Sheets, joined_sides
from collide.solids.cut_points import CutPoints
from collide.solids.joined_parts import components, uncut_parts
from collide.solids.rays import shoot

_OPEN_SHEETS = "the sheets of an arrangement of solids do not close; please report it"


class Cells(NamedTuple):
    """Of every sheet the cells before and behind it, (k, 2); and of every cell the winding numbers (c, r) int64."""

    sides: np.ndarray
    winding: np.ndarray


def merged_sheets(triangles: np.ndarray, facet: np.ndarray, body: np.ndarray, r: int) -> Sheets:
    """Sheets of triangles that may coincide: a sheet for each set of corners.   body : (k,) of the triangles' facets.

    The first of coinciding triangles gives the front.
    """
    if not len(triangles):
        return Sheets(triangles, facet, np.zeros((0, r), dtype=np.int8))
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
    """The cells between closed sheets.

    sheets : whole facets first.   is_cut : (F,) bool, facets in several sheets.
    crossings : (k, 2) clearly crossing facets, and ids : (k, 2) the ends of their common segment, along n_a × n_b.
    """
    facets = points.facets
    top = np.empty(len(is_cut), dtype=np.int64)
    for edges, start, end in zip(facets.edges, facets.first_facet.tolist(), facets.first_facet[1:].tolist()):
        top[start:end] = uncut_parts(edges.links, ~is_cut[start:end])
        top[start:end] += start
    whole = np.flatnonzero(~is_cut)
    top = top[whole]
    is_top = np.flatnonzero(top == whole)
    number = np.empty(len(is_cut), dtype=np.int64)
    number[top[is_top]] = np.arange(len(is_top))
    first_sheet = np.concatenate([is_top, np.arange(len(whole), len(sheets.triangles))])
    n = len(first_sheet)
    patch = np.concatenate([number[top], np.arange(len(is_top), n)])
    first, second = joined_sides(sheets, points, is_cut, crossings, ids)
    root = components(2 * n, 2 * patch[first // 2] + first % 2, 2 * patch[second // 2] + second % 2)
    cells, of_side = np.unique(root, return_inverse=True)
    of_patch = of_side.reshape(n, 2)
    return Cells(of_patch[patch], _windings(sheets, patch, first_sheet, of_patch, len(cells), points))


# --- winding numbers ----------------------------------------------------------------------------


def _windings(
    sheets: Sheets, patch: np.ndarray, first_sheet: np.ndarray, sides: np.ndarray, n_cells: int, points: CutPoints
) -> np.ndarray:
    """(cells, r) winding numbers.   patch : (k,) of each sheet.   first_sheet : (patches,).   sides : (patches, 2) the
    cells of a patch.
    """
    r = sheets.steps.shape[1]
    steps = sheets.steps[first_sheet]
    _, first, passage = np.unique(sides[:, 0] * n_cells + sides[:, 1], return_index=True, return_inverse=True)
    if (steps != steps[first][passage]).any():
        raise CollideError(_OPEN_SHEETS)
    beyond: dict[int, list[tuple[int, np.ndarray]]] = defaultdict(list)
    for (before, behind), step in zip(sides[first].tolist(), steps[first].astype(np.int64)):
        beyond[before].append((behind, step))
        beyond[behind].append((before, -step))
    winding = np.zeros((n_cells, r), dtype=np.int64)
    known = np.zeros(n_cells, dtype=bool)
    part = components(n_cells, *sides.T)[sides[:, 0]]
    some, of_part = np.unique(part, return_index=True)
    last_sheet = np.empty(n_cells, dtype=np.int64)
    last_sheet[part[patch]] = np.arange(len(patch))
    rows = np.stack([first_sheet[of_part], last_sheet[some]])
    stack = []
    for cell, absolute in shoot(sheets, points, rows, sides[patch[rows]]):
        winding[cell], known[cell] = absolute, True
        stack.append(cell)
    while stack:
        here = stack.pop()
        for there, step in beyond[here]:
            if known[there]:
                if (winding[there] != winding[here] + step).any():
                    raise CollideError(_OPEN_SHEETS)
            else:
                winding[there], known[there] = winding[here] + step, True
                stack.append(there)
    return winding
