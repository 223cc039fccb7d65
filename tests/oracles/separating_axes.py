"""How deep two polytopes overlap, by trying every axis that can tell: the normals of both and all crossed edges.

Naive and in doubles; shares nothing with the engine.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull


class Polytope:
    """The hull of points (n, 3): its vertices, face normals and edge directions."""

    def __init__(self, points):
        hull = ConvexHull(np.asarray(points, dtype=float))
        self.points = hull.points[hull.vertices]
        self.normals = _distinct(hull.equations[:, :3])
        corners = hull.points[hull.simplices]
        edges = (corners - np.roll(corners, 1, axis=1)).reshape(-1, 3)
        self.edges = _distinct(edges / np.linalg.norm(edges, axis=1)[:, None])


def _distinct(directions: np.ndarray) -> np.ndarray:
    """Of unit vectors one for each line."""
    out: list[np.ndarray] = []
    for direction in directions:
        if not any(abs(abs(direction @ other) - 1.0) < 1e-12 for other in out):
            out.append(direction)
    return np.array(out)


def overlap_depth(A: Polytope, B: Polytope) -> float:
    """The least translation that parts them; minus the widest gap of any of these axes where they are apart."""
    crossed = np.cross(A.edges[:, None], B.edges[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crossed, axis=1)
    axes = np.concatenate([A.normals, B.normals, crossed[lengths > 1e-7] / lengths[lengths > 1e-7][:, None]])
    a, b = A.points @ axes.T, B.points @ axes.T
    return float(np.minimum(a.max(axis=0) - b.min(axis=0), b.max(axis=0) - a.min(axis=0)).min())
