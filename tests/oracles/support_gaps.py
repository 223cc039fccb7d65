"""How far two unions of convex sets have to be moved apart, by support functions in numpy alone.

B moved by x meets a part of A with a part of B where n · x ≤ h(n) for all unit vectors n, with h(n) the greatest n · p
of A's part plus the greatest −n · q of B's. The pair is free of each other where n · x > h(n) for some n.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Convex(NamedTuple):
    """heights : unit vectors (k, 3) of the frame → (k,) the greatest products with points, ∞ where there is none.
    normals : (m, 3) of the flat faces.   R, t : pose in the world."""

    heights: Callable[[np.ndarray], np.ndarray]
    normals: np.ndarray
    R: np.ndarray
    t: np.ndarray

    def at(self, X: np.ndarray) -> Convex:
        return self._replace(R=X[:3, :3] @ self.R, t=X[:3, :3] @ self.t + X[:3, 3])

    def world_heights(self, N: np.ndarray) -> np.ndarray:
        return self.heights(N @ self.R) + N @ self.t

    @property
    def world_normals(self) -> np.ndarray:
        return self.normals @ self.R.T


_AXES = np.concatenate([np.eye(3), -np.eye(3)])


def _set(heights: Callable, normals=()) -> Convex:
    return Convex(heights, np.array(normals, dtype=float).reshape(-1, 3), np.eye(3), np.zeros(3))


def cuboid(half) -> Convex:
    return _set(lambda N: np.abs(N) @ np.asarray(half), _AXES)


def ball(radius: float) -> Convex:
    return _set(lambda N: np.full(len(N), radius))


def capsule(radius: float, length: float) -> Convex:
    return _set(lambda N: radius + np.abs(N[:, 2]) * length / 2)


def cylinder(radius: float, length: float) -> Convex:
    return _set(lambda N: radius * np.hypot(N[:, 0], N[:, 1]) + np.abs(N[:, 2]) * length / 2, _AXES[[2, 5]])


def cone(radius: float, height: float) -> Convex:
    """Base at −height / 2, apex at height / 2."""
    return _set(
        lambda N: np.maximum(N[:, 2] * height / 2, radius * np.hypot(N[:, 0], N[:, 1]) - N[:, 2] * height / 2),
        _AXES[[5]],
    )


def ellipsoid(radii) -> Convex:
    return _set(lambda N: np.sqrt(np.square(N * np.asarray(radii)).sum(axis=1)))


def halfspace(normal, offset: float) -> Convex:
    return _set(lambda N: np.where(N @ normal > 1 - 1e-12, offset, np.inf), [normal])


def hull(points, normals=()) -> Convex:
    return _set(lambda N: (N @ np.asarray(points).T).max(axis=1), normals)


def sphere_points(n: int) -> np.ndarray:
    """(n, 3) unit vectors in turns around the z axis, from pole to pole."""
    k = np.arange(n) + 0.5
    z, angle = 1 - 2 * k / n, k * np.pi * (3 - np.sqrt(5))
    return np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)


def _planes(a: Convex, b: Convex, N: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals, flat faces of both and what is across pairs of them included, and h of each; the infinite left out."""
    flat_a, flat_b = a.world_normals, -b.world_normals
    edges = np.cross(flat_a[:, None], flat_b[None]).reshape(-1, 3)
    edges = edges[np.linalg.norm(edges, axis=1) > 1e-9]
    N = np.concatenate([N, flat_a, flat_b, edges, -edges])
    N = N / np.linalg.norm(N, axis=1)[:, None]
    h = a.world_heights(N) + b.world_heights(-N)
    return N[np.isfinite(h)], h[np.isfinite(h)]


def first_gaps(A: list[Convex], B: list[Convex], U: np.ndarray, n_normals: int = 2000) -> np.ndarray:
    """(k,) how far along unit vectors (k, 3) B is at most moved before it first comes free of A [m]; 0 where B is
    free as it is."""
    spans = []
    for a in A:
        for b in B:
            N, h = _planes(a, b, sphere_points(n_normals))
            along = U @ N.T
            along[np.abs(along) < 1e-12] = 1e-12
            ends = h / along
            low, high = np.where(along < 0, ends, -np.inf), np.where(along > 0, ends, np.inf)
            spans.append((low.max(axis=1), high.min(axis=1)))
    low, high = np.array(spans).transpose(1, 0, 2)
    reached = np.zeros(len(U))
    for _ in range(len(low) + 1):
        bars = (low <= reached + 1e-12) & (low <= high)
        reached = np.maximum(reached, np.where(bars, high, 0.0).max(axis=0))
    return reached


def deepest_pair(A: list[Convex], B: list[Convex], x: np.ndarray, turns: int = 90) -> float:
    """How deep [m] B moved by x still is in A: of the deepest pair of parts the least h(n) − n · x found, from the best
    of many normals on by normals nearer and nearer; below 0 where all pairs are free."""
    deepest = -np.inf
    for a in A:
        for b in B:
            N, h = _planes(a, b, sphere_points(1000))
            depths = h - N @ x
            n, depth, beside = N[depths.argmin()], depths.min(), 0.1
            for _ in range(turns):
                N = n + beside * sphere_points(100) @ np.linalg.qr(N[:3].T)[0]
                N = N / np.linalg.norm(N, axis=1)[:, None]
                depths = a.world_heights(N) + b.world_heights(-N) - N @ x
                if depths.min() < depth:
                    n, depth = N[depths.argmin()], depths.min()
                else:
                    beside *= 0.75
            deepest = max(deepest, depth)
    return float(deepest)
