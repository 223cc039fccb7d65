"""Items of fields as hulls of a few points swept by balls, for proofs: balls, cells, triangles, prisms below terrain.

Terrain lists boxes around blocks of cells, each opened into smaller boxes and at last into prisms: a box beyond a plane
has all of its prisms beyond the plane. The boxes are taken from the heights here, and from nothing a query uses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from collide.certificates.exact_parts import IDENTITY, ExactPart
from collide.lowering.convex_sets import POINTS
from collide.shapes.height_field import HeightField
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import Shape
from collide.shapes.swept_mesh import SweptMesh
from collide.shapes.voxel_grid import VoxelGrid

#: Blocks of terrain along each axis within the next larger block.
_BLOCK = 16
_IN_BLOCK = np.array(list(np.ndindex(_BLOCK, _BLOCK)))
_CORNERS = np.array(list(np.ndindex(2, 2, 2)), dtype=bool)
#: The two triangles of a cell, whose corners run around: cut from the first corner to the third.
_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


class SweptHulls(NamedTuple):
    """Items, or boxes around blocks of items, in a field's frame G.

    points : (n, k, 3) vertices [m], or (n, 2, 3) the least and the greatest corner of boxes.
    radii : (n,) of the balls [m].   numbers : (n,) of the items or blocks.   poses : (X_FG, X_WF), (4, 4).
    opened : ``None`` for items; for blocks, what makes the hulls within blocks of given numbers (m,).
    """

    points: np.ndarray
    radii: np.ndarray
    numbers: np.ndarray
    poses: tuple[np.ndarray, np.ndarray]
    are_boxes: bool = False
    opened: Callable[[np.ndarray], SweptHulls] | None = None

    def picked(self, rows) -> SweptHulls:
        return self._replace(points=self.points[rows], radii=self.radii[rows], numbers=self.numbers[rows])

    def facing(self, n: np.ndarray) -> np.ndarray:
        """(n, k, 3) vertices, among them the vertex of each item least far along a normal (3,)."""
        if not self.are_boxes:
            return self.points
        return np.where(n > 0.0, self.points[:, 0], self.points[:, 1])[:, None]

    def vertices(self, row: int) -> np.ndarray:
        """(k, 3) the vertices of an item."""
        points = self.points[row]
        return np.where(_CORNERS, points[1], points[0]) if self.are_boxes else points

    @property
    def corners(self) -> np.ndarray:
        """(n, k, 3) the vertices of all items."""
        return np.where(_CORNERS, self.points[:, 1:], self.points[:, :1]) if self.are_boxes else self.points

    def part(self, row: int) -> ExactPart:
        """An item; its vertices are distinct and sorted."""
        X_FG, X_WF = self.poses
        return ExactPart(POINTS, np.unique(self.vertices(row), axis=0), float(self.radii[row]), None, X_WF, X_FG)


def hulls_of(field: Shape, X_WF: np.ndarray) -> SweptHulls:
    """All items of a field at a pose (4, 4), or the coarsest blocks of terrain; of a solid its triangles alone."""
    if isinstance(field, HeightField):
        return _Terrain(field, X_WF).coarsest()
    if isinstance(field, VoxelGrid):
        return _cells(field, X_WF, field.tree.boxes_in(np.zeros(3), np.array(field.tree.shape)))
    n = len(field.mesh.faces) if isinstance(field, SweptMesh) else len(field)  # type: ignore[arg-type]
    return _rows(field, X_WF, np.arange(n))


def hull_numbered(field: Shape, X_WF: np.ndarray, number: int) -> ExactPart | None:
    """The item of a number; ``None`` for a number without an item. Terrain: the prism below a facet of its top."""
    if isinstance(field, HeightField):
        if not 0 <= number < 2 * field.pyramid.n_cells:
            return None
        row, column, triangle = field.cells_of(number)
        return _Terrain(field, X_WF).prisms(np.array([[row, column]])).part(triangle)
    if isinstance(field, VoxelGrid):
        tree = field.tree
        cell = np.array([np.unravel_index(number, tree.shape)]) if 0 <= number < math.prod(tree.shape) else None
        if cell is None or not tree.is_occupied(cell)[0]:
            return None
        return _cells(field, X_WF, tree.boxes_at(cell)).part(0)
    n = len(field.mesh.faces) if isinstance(field, SweptMesh) else len(field)  # type: ignore[arg-type]
    return _rows(field, X_WF, np.array([number])).part(0) if 0 <= number < n else None


def _rows(field: Shape, X_WF: np.ndarray, rows: np.ndarray) -> SweptHulls:
    """Balls of a cloud or swept triangles, by row."""
    if isinstance(field, SweptMesh):
        points, radii = field.mesh.vertices[field.mesh.faces[rows]], np.full(len(rows), field.radius)
    else:
        assert isinstance(field, PointCloud)
        points, radii = field.points[rows, None], field.radii[rows]
    return SweptHulls(points, radii, rows, (IDENTITY, X_WF))


def _cells(grid: VoxelGrid, X_WF: np.ndarray, boxes) -> SweptHulls:
    points = np.stack(grid.tree.corners(boxes.least, boxes.size), axis=1)
    return SweptHulls(points, np.zeros(len(points)), boxes.numbers, (grid.X_FG, X_WF), are_boxes=True)


class _Terrain:
    """Terrain by levels: two prisms a cell at level 0, boxes around 16ᵏ × 16ᵏ cells at level k."""

    def __init__(self, field: HeightField, X_WF: np.ndarray):
        self._field, self._poses = field, (IDENTITY, X_WF)
        self._x, self._y = field.grid_lines
        self._shapes = [(len(self._y) - 1, len(self._x) - 1)]
        while max(self._shapes[-1]) > 1:
            rows, columns = self._shapes[-1]
            self._shapes.append((-(-rows // _BLOCK), -(-columns // _BLOCK)))

    @cached_property
    def _tops(self) -> list[np.ndarray]:
        """Of the levels from 1 on: the highest height of the grid points of each block, NaN in holes [m].

        No surface of cells is higher than its grid points.
        """
        top = self._field.heights
        for axis in (0, 1):
            starts = np.arange(0, top.shape[axis] - 1, _BLOCK)
            last = np.minimum(starts + _BLOCK, top.shape[axis] - 1)  # grid points that two blocks share
            top = np.fmax(np.fmax.reduceat(top, starts, axis=axis), np.take(top, last, axis=axis))
        tops = [top]
        for _ in self._shapes[2:]:
            for axis in (0, 1):
                top = np.fmax.reduceat(top, np.arange(0, top.shape[axis], _BLOCK), axis=axis)
            tops.append(top)
        return tops

    def coarsest(self) -> SweptHulls:
        """One block around all."""
        return self._at(len(self._shapes) - 1, np.zeros((1, 2), dtype=np.int64))

    def _at(self, level: int, at: np.ndarray) -> SweptHulls:
        """Blocks of a level by row and column (n, 2), but for blocks without heights; at level 0 prisms."""
        if level == 0:
            return self.prisms(at)
        top = self._tops[level - 1][tuple(at.T)]
        at, top = at[~np.isnan(top)], top[~np.isnan(top)]
        least = at * _BLOCK**level
        last = np.minimum(least + _BLOCK**level, self._shapes[0])
        bottom = np.full(len(at), self._field.bottom)
        low = np.column_stack([self._x[least[:, 1]], self._y[least[:, 0]], bottom])
        points = np.stack([low, np.column_stack([self._x[last[:, 1]], self._y[last[:, 0]], top])], axis=1)
        numbers = at[:, 0] * self._shapes[level][1] + at[:, 1]
        opened = partial(self._opened, level)
        return SweptHulls(points, np.zeros(len(at)), numbers, self._poses, are_boxes=True, opened=opened)

    def _opened(self, level: int, numbers: np.ndarray) -> SweptHulls:
        at = np.stack(np.divmod(numbers, self._shapes[level][1]), axis=1)
        at = (_BLOCK * at[:, None] + _IN_BLOCK).reshape(-1, 2)
        return self._at(level - 1, at[(at < self._shapes[level - 1]).all(axis=1)])

    def prisms(self, at: np.ndarray) -> SweptHulls:
        """(2 n) what lies between the two triangles of cells (n, 2) and the bottom; nothing of holes."""
        row, column = at[:, :1] + np.array([0, 0, 1, 1]), at[:, 1:] + np.array([0, 1, 1, 0])
        heights = self._field.heights[row, column]
        some = ~np.isnan(heights).any(axis=1)
        tops = np.stack([self._x[column], self._y[row], heights], axis=2)[some][:, _TRIANGLES]
        bottoms = tops.copy()
        bottoms[..., 2] = self._field.bottom
        points = np.concatenate([tops, bottoms], axis=2).reshape(-1, 6, 3)
        cells = at[some, 0] * self._shapes[0][1] + at[some, 1]
        numbers = (2 * self._field.pyramid.numbers_of(cells)[:, None] + np.array([0, 1])).ravel()
        return SweptHulls(points, np.zeros(len(points)), numbers, self._poses)
