"""Convex pieces beside a body: how far points are from balls, and from any convex shapes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.base.poses_at import poses_at
from collide.pairs.query import distance
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh import Mesh
from collide.spheres.body_facets import BodyPart, is_same, placed, shells_of
from collide.surface_queries.facet_pairs import facet_pairs

_POINT = ConvexHull(np.zeros((1, 3)))


class Balls(NamedTuple):
    """Balls in the frame of a body.   centers, radii : (n, 3) and (n,) [m]; radii below 0 count as differences."""

    centers: np.ndarray
    radii: np.ndarray

    @property
    def slack(self) -> float:
        """How far outside facets count as inside [m]."""
        return 0.0

    @property
    def size(self) -> int:
        return len(self.radii)

    def away(self, corners: np.ndarray) -> np.ndarray:
        """(m, c, n) how far the corners (m, c, 3) of pieces are from each ball, negative inside [m], rounded."""
        return np.sqrt(np.square(corners[:, :, None] - self.centers).sum(axis=3)) - self.radii

    def off(self, corners: np.ndarray) -> np.ndarray:
        """(m,) whether triangles (m, 3, 3) are off all balls: their middles farther from balls than from corners."""
        middle = corners.mean(axis=1)
        reach = np.sqrt(np.square(corners - middle[:, None]).sum(axis=2)).max(axis=1)
        return self.nearest(middle) > reach * (1.0 + 1e-12)

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """(k,) how far points (k, 3) are from the union, negative inside a ball [m], rounded."""
        out = np.full(len(points), np.inf)
        for c, r in zip(self.centers, self.radii.tolist()):
            np.minimum(out, np.sqrt(np.square(points - c).sum(axis=1)) - r, out=out)
        return out


class ConvexPieces:
    """Convex shapes in the frame of a body.

    parts : as of `body_parts`, none a `Mesh`.   slack : what the rounding of placed points adds to a distance [m].
    """

    def __init__(self, parts: list[BodyPart], slack: float):
        self.parts, self.slack = parts, slack
        corners = [part.mesh.vertices for part in parts]
        self._low = np.array([points.min(axis=0) for points in corners])
        self._high = np.array([points.max(axis=0) for points in corners])

    @property
    def size(self) -> int:
        return len(self.parts)

    def away(self, corners: np.ndarray) -> np.ndarray:
        """(m, c, n) upper bounds of how far the corners (m, c, 3) of pieces are from each shape, negative inside [m];
        inf of a shape farther from all corners than another.
        """
        return self._bounds(corners)[1]

    def off(self, corners: np.ndarray) -> np.ndarray:
        """(m,) whether triangles (m, 3, 3) have no point in a shape: their middles lie outside, and they meet no facet
        around a shape.
        """
        out = self.nearest(corners.mean(axis=1)) > 0.0
        triangles = Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), solid=False)
        for part in self.parts:
            out[facet_pairs(triangles, part.mesh, np.eye(4), np.eye(4), check_poses=False).pairs[:, 0]] = False
        return out

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """(k,) lower bounds of how far points (k, 3) are from the union, negative inside [m]."""
        return self._bounds(points[:, None])[0].min(axis=(1, 2)) - self.slack

    def _bounds(self, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(m, c, n) lower and upper bounds. A shape is in its box: where the box is farther off than the shape with the
        nearest box, and the corner not inside, the shape is farther off as well.
        """
        box = np.empty((*corners.shape[:2], self.size))
        for k, (low, high) in enumerate(zip(self._low, self._high)):
            off = np.maximum(np.maximum(low - corners, corners - high), 0.0)
            box[:, :, k] = np.sqrt(np.square(off).sum(axis=2))
        lower, upper = np.full(box.shape, np.inf), np.full(box.shape, np.inf)
        first = (box.argmin(axis=2)[:, :, None] == np.arange(self.size)).any(axis=1)
        self._fill(corners, first, lower, upper)
        limit = np.maximum(upper.min(axis=2, keepdims=True), 0.0)
        self._fill(corners, (box <= limit + 2.0 * self.slack).any(axis=1) & ~first, lower, upper)
        return lower, upper

    def _fill(self, corners: np.ndarray, wanted: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
        for k, part in enumerate(self.parts):
            rows = np.flatnonzero(wanted[:, k])
            if len(rows):
                X = poses_at(corners[rows].reshape(-1, 3))
                away = distance(part.shape, _POINT, part.X, X, check_poses=False)
                lower[rows, :, k] = np.reshape(away.lower, (len(rows), -1))
                upper[rows, :, k] = np.reshape(away.upper, (len(rows), -1))

    def contain(self, part: BodyPart) -> bool:
        """Whether a part of a body lies in the pieces, proven shell by shell: each within a single piece.

        A solid winds around a point only if a shell does, and a shell winds around points of its hull alone.
        """
        if any(is_same(piece, part) for piece in self.parts):
            return True
        vertices, groups = _shells(part)
        inside = np.stack([self._holds(piece, part.X, vertices) for piece in self.parts], axis=1)
        within = np.ones((int(groups.max()) + 1, self.size), dtype=bool)
        np.logical_and.at(within, groups, inside)
        return bool(within.any(axis=1).all())

    def _holds(self, piece: BodyPart, X: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(k,) whether a piece holds points (k, 3) of the frame X, proven: exactly in the frame of the piece, with a
        margin for rounding in any other.
        """
        same = np.array_equal(piece.X, X)
        X_P, at = (np.eye(4), points) if same else (piece.X, placed(points, X))
        away = distance(piece.shape, _POINT, X_P, poses_at(at), check_poses=False)
        return np.asarray(away.upper) <= (0.0 if same else -self.slack)


def _shells(part: BodyPart) -> tuple[np.ndarray, np.ndarray]:
    """(points (k, 3) in the frame of a part, (k,) the number of the shell, or of the facet, that each belongs to)."""
    if not isinstance(part.shape, Mesh):
        assert part.vertices is not None
        return part.vertices, np.zeros(len(part.vertices), dtype=np.int64)
    mesh = part.shape
    return mesh.vertices[mesh.faces].reshape(-1, 3), np.repeat(shells_of(part), 3)
