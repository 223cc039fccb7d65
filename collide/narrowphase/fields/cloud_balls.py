"""The balls of a point cloud as items."""

from __future__ import annotations

import math

import numpy as np

from collide.narrowphase.facets.nearest_item_calls import BALLS, Items
from collide.narrowphase.fields.field_items import BoxAround, FieldItems
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.point_cloud import PointCloud


class Balls(FieldItems):
    """The balls of a cloud, numbered as ``points``."""

    def __init__(self, cloud: PointCloud):
        tree, radius = cloud.tree, float(np.max(cloud.radius))
        self._tree, self._points, self._radius, self._radii = tree, cloud.points, cloud.radius, cloud.radii
        self.low, self.high = tree.low - radius, tree.high + radius
        reach = math.sqrt(float(np.square(np.maximum(np.abs(tree.low), np.abs(tree.high))).sum())) * (1.0 + 2.0**-50)
        radii = cloud.radius if np.ndim(cloud.radius) else None
        self.walked = Items(tree, reach + radius, False, radius, radii, BALLS)

    def every(self) -> np.ndarray:
        return np.arange(len(self._points))

    def within(self, box: BoxAround, distance: float) -> np.ndarray:
        reach = box.reach(distance + float(np.max(self._radius)))
        some = self._tree.in_box(box.low - reach, box.high + reach)
        if np.ndim(self._radius) == 0:
            return some
        reaches, points = box.reach(self._radii[some, None] + distance), self._points[some]
        return some[((points >= box.low - reaches) & (points <= box.high + reaches)).all(axis=1)]

    def on_way(self, way: np.ndarray, limit: float, extra: float, slack: float, first: bool):
        return self._tree.on_way(self._radius, way, limit, extra, slack, first)

    def lowest(self, n: np.ndarray, slack: float) -> np.ndarray:
        heights = self._points @ n - self._radii
        return np.flatnonzero(heights <= heights.min() + slack)

    def least_height(self, number: int, n: np.ndarray) -> float:
        return float(self._points[number] @ n - self._radii[number])

    def hulls(self, some: np.ndarray) -> list[ConvexHull]:
        return [ConvexHull(self._points[k : k + 1], radius=float(self._radii[k])) for k in some.tolist()]
