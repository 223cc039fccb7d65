"""The corners of a union of balls: points of three spheres, inside no ball."""

from __future__ import annotations

import numpy as np

#: A corner deeper than this in another ball, in parts of the largest radius, is inside.
_INSIDE = 1e-9


def union_corners(centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """(k, 3) in doubles. O(n³) for n balls of which all meet."""
    corners = [np.zeros((0, 3))]
    for i in range(len(radii)):
        away = np.sqrt(np.square(centers[i + 1 :] - centers[i]).sum(axis=1))
        near = i + 1 + np.flatnonzero(away <= radii[i + 1 :] + radii[i])
        if len(near) < 2:
            continue
        first, second = np.triu_indices(len(near), 1)
        points = _points_of_three(i, near[first], near[second], centers, radii)
        # What holds a point of sphere i meets ball i.
        around = np.flatnonzero(np.square(centers - centers[i]).sum(axis=1) <= np.square(radii + radii[i]))
        corners.append(_off_balls(points, centers[around], radii[around], _INSIDE * float(radii.max())))
    return np.concatenate(corners)


def _points_of_three(i: int, j: np.ndarray, k: np.ndarray, centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """The points of sphere i and two others, up to two for each pair (j, k)."""
    a, b = centers[j] - centers[i], centers[k] - centers[i]
    n = np.cross(a, b)
    N = np.square(n).sum(axis=1)
    known = N > 1e-18 * np.square(a).sum(axis=1) * np.square(b).sum(axis=1)
    a, b, n, N, j, k = a[known], b[known], n[known], N[known], j[known], k[known]
    alpha = 0.5 * (np.square(a).sum(axis=1) + radii[i] ** 2 - radii[j] ** 2)
    beta = 0.5 * (np.square(b).sum(axis=1) + radii[i] ** 2 - radii[k] ** 2)
    foot = (alpha[:, None] * np.cross(b, n) + beta[:, None] * np.cross(n, a)) / N[:, None]
    square = (radii[i] ** 2 - np.square(foot).sum(axis=1)) / N
    meet = square >= -1e-12 * radii[i] ** 2 / N
    step = np.sqrt(np.maximum(square[meet], 0.0))[:, None] * n[meet]
    return centers[i] + np.concatenate([foot[meet] + step, foot[meet] - step])


def _off_balls(points: np.ndarray, centers: np.ndarray, radii: np.ndarray, slack: float) -> np.ndarray:
    """The points no deeper than a slack in any ball."""
    for c, r in zip(centers, radii):
        points = points[r - np.sqrt(np.square(points - c).sum(axis=1)) <= slack]
    return points
