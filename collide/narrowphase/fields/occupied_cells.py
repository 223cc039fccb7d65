"""The occupied cells of a grid as items: single cells, or the boxes that leaves of an octree are made of."""

from __future__ import annotations

import math

import numpy as np

from collide.fields.cell_tree import Boxes, merged_boxes, numbers_of
from collide.narrowphase.facets.nearest_item_calls import CELLS, Items
from collide.narrowphase.fields.field_items import BoxAround, FieldItems, NamedUnion, as_union
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.voxel_grid import VoxelGrid

#: How far next to a face is, in sides of a cell: far above rounding, and within the cell there.
_NEXT = 2.0**-10
_CORNERS = np.array(list(np.ndindex(2, 2, 2)), dtype=bool)


class Cells(FieldItems):
    """Occupied boxes of a grid, by the number of their least cell."""

    def __init__(self, grid: VoxelGrid):
        tree = grid.tree
        self._tree, self.X_FG = tree, grid.X_FG
        self.low, self.high = tree.low, tree.high
        reach = math.sqrt(float(np.square(np.maximum(np.abs(tree.low), np.abs(tree.high))).sum())) * (1.0 + 2.0**-50)
        self.walked = Items(tree, reach, False, are=CELLS)

    def every(self) -> np.ndarray:
        return self._tree.boxes_in(np.zeros(3), np.array(self._tree.shape)).numbers

    def within(self, box: BoxAround, distance: float) -> np.ndarray:
        distance = box.reach(distance)
        return self._tree.boxes_in(*self._tree.range_of(box.low - distance, box.high + distance)).numbers

    def on_way(self, way: np.ndarray, limit: float, extra: float, slack: float, first: bool):
        # With a ball boxes are larger by its radius along each axis, and one that is entered need not be met.
        boxes, times = self._tree.on_way(way, extra + slack, limit, first and extra == 0.0)
        return boxes.numbers, times

    def lowest(self, n: np.ndarray, slack: float) -> np.ndarray:
        return self._tree.lowest(n, slack).numbers

    def least_height(self, number: int, n: np.ndarray) -> float:
        low, high = self.corners_of(number)
        return float(np.minimum(n * low, n * high).sum())

    def hulls(self, some: np.ndarray) -> list[ConvexHull]:
        boxes = self._boxes(some)
        return self._hulls(boxes.least, boxes.size)

    def some(self) -> np.ndarray:
        return np.array([self._tree.first_number()])

    def hidden(self, numbers: np.ndarray, p_F: np.ndarray, n_F: np.ndarray) -> np.ndarray:
        tree, X = self._tree, self.X_FG
        p = (p_F - X[:3, 3]) @ X[:3, :3] + _NEXT * tree.sides.min() * (n_F @ X[:3, :3])
        return tree.is_occupied(self.cells_at(p))

    def cells_at(self, p_G: np.ndarray) -> np.ndarray:
        """Cells (n, 3), occupied or not, around places (n, 3) of the items' frame; cut two cells beyond the grid."""
        cells = np.floor((p_G - self._tree.origin) / self._tree.sides) - self._tree.least
        return np.clip(cells, -2.0, np.array(self._tree.shape) + 2.0).astype(np.int64)

    def are_occupied(self, cells: np.ndarray) -> np.ndarray:
        """(n,) bool, of cells (n, 3) within the grid or not."""
        return self._tree.is_occupied(cells)

    def corners_of(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """The least and the largest corner (3,) of an item, in the items' frame."""
        boxes = self._boxes(np.array([number]))
        low, high = self._tree.corners(boxes.least, boxes.size)
        return low[0], high[0]

    def plane(self, axis: int, cell: int) -> float:
        """Where the cells of an index along an axis begin, in the items' frame [m]."""
        return float(self._tree.corners(np.full((1, 3), cell), np.zeros((1, 3), dtype=np.int64))[0][0, axis])

    def merged(self, some: np.ndarray) -> NamedUnion:
        boxes = self._boxes(some)
        least, size = merged_boxes(boxes.least, boxes.size)
        return NamedUnion(as_union(self._hulls(least, size), self.X_FG), numbers_of(least, self._tree.shape), size)

    def name(self, union: NamedUnion, part: np.ndarray, p_F: np.ndarray) -> np.ndarray:
        if union.sizes is None:
            return union.numbers[part]
        X, tree = self.X_FG, self._tree
        p = (p_F - X[:3, 3]) @ X[:3, :3]
        least = np.stack(np.unravel_index(union.numbers[part], tree.shape), axis=1)
        cells = np.floor((p - tree.origin) / tree.sides) - tree.least
        cells = np.clip(cells.astype(np.int64), least, least + union.sizes[part] - 1)
        return tree.boxes_at(cells).numbers

    def _boxes(self, some: np.ndarray) -> Boxes:
        return self._tree.boxes_at(np.stack(np.unravel_index(some, self._tree.shape), axis=1))

    def _hulls(self, least: np.ndarray, size: np.ndarray) -> list[ConvexHull]:
        low, high = self._tree.corners(least, size)
        return [ConvexHull(np.where(_CORNERS, h, l)) for l, h in zip(low, high)]
