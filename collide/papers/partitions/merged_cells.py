"""Cells merged with neighbours as long as unions are convex, exactly: fewer pieces that cover the same points.

Two convex cells on both sides of a plane make a convex union if each lies within all other planes of the other cell:
then the union is the intersection of these half-spaces. Corners are asked for their sides of planes, by doubles with a
bound, then exactly. A plane with members of a union on both sides runs through the union, and bounds it no more.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import gcd
from typing import NamedTuple

import numpy as np

from collide.papers.partitions.convex_cells import CellBlock, cells_within
from collide.papers.partitions.cut_polygons import edge_rows, joined
from collide.papers.partitions.finished_tree import FinishedTree
from collide.papers.partitions.planes import Planes
from collide.papers.partitions.portals import portals_of_block
from collide.papers.partitions.vertices import Vertices

#: Coefficients of a plane without a common divisor.
PlaneKey = tuple[int, ...]
#: Corners asked for their sides of planes at once.
_AT_ONCE = 1 << 20


class _Faces(NamedTuple):
    """Of all faces of cells: the cell, the plane, and the side of the plane with the cell; coplanar planes share a
    number.
    """

    cell: np.ndarray
    plane: np.ndarray
    side: np.ndarray


class _Pairs(NamedTuple):
    """Cells (k,) that touch, in a plane, with an area."""

    near: np.ndarray
    far: np.ndarray
    plane: np.ndarray
    area: np.ndarray


class _Rows(NamedTuple):
    """Columns sorted by group; those of group g are first[g] … first[g + 1] − 1."""

    first: np.ndarray
    columns: np.ndarray

    def of(self, groups: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(the first row, the number of rows) of groups (k,)."""
        return self.first[groups], self.first[groups + 1] - self.first[groups]


def merged_block(
    tree: FinishedTree, block: CellBlock, whole: np.ndarray, low, high, barred: set[PlaneKey]
) -> tuple[CellBlock, np.ndarray]:
    """(a block of fewer cells, (c,) rows in the new block of the cells of the old).

    low, high : the clipping box of the block.   barred : planes not to be merged across.
    A merged cell is named by its first leaf.
    """
    faces = block.faces
    if not len(block.leaf):
        return block, block.leaf
    near, far, plane, _, area = portals_of_block(tree, block, whole)
    row = np.full(tree.n_leaves, -1)
    row[block.leaf] = np.arange(len(block.leaf))
    held = (row[near] >= 0) & (row[far] >= 0)
    used, of_face = np.unique(faces.plane, return_inverse=True)
    number, against, is_barred = _numbered_once(block.vertices.planes, used, barred)
    bounds = _Faces(faces.cell, number[of_face], faces.side * against[of_face])
    plane = np.searchsorted(used, plane)
    held &= ~is_barred[plane]
    pairs = _Pairs(row[near[held]], row[far[held]], number[plane[held]], area[held])
    rows, owner = edge_rows(faces)
    group = _grouped(block.vertices, bounds, (faces.cell[owner], block.edges.vertex.rows[rows]), pairs, len(block.leaf))
    _, first, group = np.unique(group, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(first), dtype=np.int64)
    rank[order] = np.arange(len(first))
    return _rebuilt(block, bounds, block.leaf[first[order]], rank[group], low, high), rank[group]


def _keys(planes: Planes, used: np.ndarray) -> Iterator[tuple[PlaneKey, int]]:
    """(coefficients alike for coplanar planes, the sense of the normal, 1 or −1) of planes (k,)."""
    for plane in planes.coefficients(used).tolist():
        sense = 1 if next(x for x in plane if x) > 0 else -1
        common = sense * gcd(*plane)
        yield tuple(x // common for x in plane), sense


def two_faced(planes: Planes) -> set[PlaneKey]:
    """Planes with facets of both senses.

    Where no winding number is negative, a facet between two cells outside is covered by a facet of the opposite sense:
    a single facet, or several of the same sense, have a cell of a number above 0 behind.
    """
    keys = set(_keys(planes, np.arange(planes.n)))
    return {key for key, sense in keys if (key, -sense) in keys}


def _numbered_once(planes: Planes, used: np.ndarray, barred: set[PlaneKey]) -> tuple[np.ndarray, ...]:
    """((k,) the first of the planes (k,) coplanar with each, (k,) −1 where the normals are opposite, else 1, (k,)
    bool: barred); exact.
    """
    seen: dict[PlaneKey, tuple[int, int]] = {}
    number, against = np.empty(len(used), dtype=np.int64), np.empty(len(used), dtype=np.int64)
    is_barred = np.zeros(len(used), dtype=bool)
    for k, (key, sense) in enumerate(_keys(planes, used)):
        number[k], first_sense = seen.setdefault(key, (int(used[k]), sense))
        against[k], is_barred[k] = sense * first_sense, key in barred
    return number, against, is_barred


def _grouped(vertices: Vertices, faces: _Faces, corners, pairs: _Pairs, n: int) -> np.ndarray:
    """(n,) the group of each cell: pairs with a convex union are joined, those with the largest common faces first.

    corners : (cells (m,), vertices (m,)).
    """
    group, n_groups = np.arange(n), n
    refused = np.zeros(0, dtype=np.int64)
    while True:
        ends = np.sort(np.stack((group[pairs.near], group[pairs.far])), axis=0)
        keys, first, back = np.unique(ends[0] * 2 * n + ends[1], return_index=True, return_inverse=True)
        area = np.bincount(np.ravel(back), pairs.area, minlength=len(keys))
        asked = np.flatnonzero((ends[0, first] != ends[1, first]) & ~np.isin(keys, refused))
        two = ends[:, first[asked]]
        convex = _are_convex(vertices, faces, corners, group, two, pairs.plane[first[asked]])
        refused = np.append(refused, keys[asked[~convex]])
        if not convex.any():
            return group
        new = np.arange(n_groups)
        best = asked[convex][np.argsort(-area[asked[convex]], kind="stable")]
        for a, b in ends[:, first[best]].T.tolist():
            if new[a] == a and new[b] == b:
                new[a] = new[b] = n_groups
                n_groups += 1
        group = new[group]


def _are_convex(vertices: Vertices, faces: _Faces, corners, group: np.ndarray, two: np.ndarray, plane) -> np.ndarray:
    """(k,) bool: the unions of groups two (2, k), on both sides of planes (k,), are convex."""
    n = int(group.max()) + 1
    bounds, points = _bounds(faces, group, n), _grouped_rows(n, group[corners[0]], corners[1])
    convex = np.ones(len(plane), dtype=bool)
    for a, b in ((0, 1), (1, 0)):
        start, n_points = points.of(two[a])
        wall, n_walls = bounds.of(two[b])
        block = np.cumsum(n_points * n_walls) // _AT_ONCE
        for chunk in np.split(np.arange(len(plane)), np.flatnonzero(np.diff(block)) + 1):
            size = n_points[chunk] * n_walls[chunk]
            pair = np.repeat(chunk, size)
            at = np.arange(len(pair)) - np.repeat(np.cumsum(size) - size, size)
            walls, sides = bounds.columns[:, wall[pair] + at % n_walls[pair]]
            rows = np.flatnonzero((walls != plane[pair]) & convex[pair])
            vertex = points.columns[0, start[pair[rows]] + at[rows] // n_walls[pair[rows]]]
            _refuse_bulges(vertices, vertex, walls[rows], sides[rows], pair[rows], convex)
    return convex


def _refuse_bulges(vertices: Vertices, vertex, planes, sides, pair, convex: np.ndarray) -> None:
    """Set convex[pair] False where a vertex lies beyond a plane. Most do so clearly: integers are for what remains."""
    height, bound = vertices.planes.heights(vertices.xyz.rows[vertex], vertices.error.rows[vertex], planes)
    convex[pair[height * sides < -bound]] = False
    rows = np.flatnonzero((np.abs(height) <= bound) & convex[pair])
    sign = vertices.sides(vertex[rows], planes[rows]).sign
    convex[pair[rows[sign * sides[rows] < 0]]] = False


def _bounds(faces: _Faces, group: np.ndarray, n: int) -> _Rows:
    """The planes of groups, (plane, side): of planes with members on both sides none."""
    rows = np.unique(np.stack((group[faces.cell], faces.plane, faces.side)), axis=1)
    same = (rows[:2, 1:] == rows[:2, :-1]).all(axis=0)
    rows = rows[:, ~(np.append(same, False) | np.append(False, same))]
    return _Rows(np.searchsorted(rows[0], np.arange(n + 1)), rows[1:])


def _grouped_rows(n: int, group: np.ndarray, values: np.ndarray) -> _Rows:
    """The values of n groups, each once."""
    rows = np.unique(np.stack((group, values)), axis=1)
    return _Rows(np.searchsorted(rows[0], np.arange(n + 1)), rows[1:])


def _rebuilt(block: CellBlock, faces: _Faces, leaf: np.ndarray, group: np.ndarray, low, high) -> CellBlock:
    """The block of groups: cells alone in their group as they are, others from the planes around the group."""
    merged = np.bincount(group, minlength=len(leaf)) > 1
    alone = block.faces[~merged[group[block.faces.cell]]]
    rows = np.flatnonzero(merged)
    bounds = _bounds(faces, group, len(leaf))
    made = cells_within(block.vertices, block.edges, low, high, *bounds.of(rows), *bounds.columns)
    every = joined(replace(alone, cell=group[alone.cell]), replace(made, cell=rows[made.cell]))
    return block._replace(leaf=leaf, faces=every[np.argsort(every.cell, kind="stable")])
