"""The swept triangles of a mesh with thickness as items, and the inside of a solid as one more."""

from __future__ import annotations

import numpy as np

from collide.narrowphase.fields.cloud_balls import Balls
from collide.narrowphase.fields.field_items import ROUNDING, BoxAround, FieldItems
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import Shape
from collide.shapes.swept_mesh import SweptMesh


class SweptTriangles(FieldItems):
    """Triangles numbered as ``faces``, each in a ball; the inside of a solid has the number after the last."""

    def __init__(self, shape: SweptMesh):
        self._mesh, self._radius = shape.mesh, shape.radius
        corners = shape.mesh.vertices[shape.mesh.faces]
        centres = 0.5 * corners.min(axis=1) + 0.5 * corners.max(axis=1)
        away = np.sqrt(np.square(corners - centres[:, None]).sum(axis=2)).max(axis=1)
        radii = (away + shape.radius) * (1.0 + ROUNDING) + 2.0**-50 * float(np.abs(corners).max())
        self._around = Balls(PointCloud(centres, radii))
        self._inside = np.arange(len(corners), len(shape))
        self.low, self.high = self._around.low, self._around.high

    def every(self) -> np.ndarray:
        return np.arange(len(self._mesh.faces) + len(self._inside))

    def within(self, box: BoxAround, distance: float) -> np.ndarray:
        return np.concatenate([self._around.within(box, distance), self._inside])

    def on_way(self, way: np.ndarray, limit: float, extra: float, slack: float, first: bool):
        numbers, times = self._around.on_way(way, limit, extra, slack, False)  # items are smaller than their balls
        return np.concatenate([self._inside, numbers]), np.concatenate([np.zeros(len(self._inside)), times])

    def lowest(self, n: np.ndarray, slack: float) -> np.ndarray:
        heights = (self._mesh.vertices @ n)[self._mesh.faces].min(axis=1)
        return np.flatnonzero(heights <= heights.min() + slack)

    def least_height(self, number: int, n: np.ndarray) -> float:
        return float((self._mesh.vertices[self._mesh.faces[number]] @ n).min()) - self._radius

    def hulls(self, some: np.ndarray) -> list[Shape]:
        mesh, n = self._mesh, len(self._mesh.faces)
        return [
            mesh if k == n else ConvexHull(mesh.vertices[mesh.faces[k]], radius=self._radius) for k in some.tolist()
        ]
