"""Pairs of convex polygons that are hard to decide, seeded: (points of A, points of B, X_WA, X_WB)."""

from __future__ import annotations

import numpy as np


def pose_at(xy, angle=0.0) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, xy[0]], [s, c, xy[1]], [0.0, 0.0, 1.0]])


def _round(rng, n, squeeze=1.0, radius=1.0):
    angles = np.sort(rng.uniform(0, 2 * np.pi, n))
    return radius * np.c_[np.cos(angles), squeeze * np.sin(angles)]


def _sizes(rng):
    return rng.choice([1, 2, 3, 4, 5, 7, 12, 30], 2)


def lattice(rng):
    """Corners on a small lattice: parallel edges, corners on edges, points and segments."""
    size = int(rng.choice([1, 2, 4, 9]))
    n, m = _sizes(rng)
    A, B = (rng.integers(-size, size + 1, (k, 2)).astype(float) for k in (n, m))
    return A, B, pose_at((0, 0)), pose_at(rng.integers(-2 * size, 2 * size + 1, 2))


def parallel(rng):
    """A polygon and its mirror image, or two of the same, an edge on an edge or an ulp off."""
    n = int(rng.integers(3, 12))
    A = np.round(_round(rng, n) * 64) / 64
    B = A if rng.random() < 0.5 else -A
    edge = int(rng.integers(n))
    shift = A[edge] - B[rng.integers(n)] if rng.random() < 0.5 else 2 * A[edge]
    return A, B, pose_at((0, 0)), pose_at(_nudged(rng, shift))


def _nudged(rng, xy):
    xy = np.array(xy, dtype=float)
    axis = int(rng.integers(2))
    for _ in range(int(rng.integers(0, 3))):
        xy[axis] = np.nextafter(xy[axis], np.inf if rng.random() < 0.5 else -np.inf)
    return xy


def touching(rng):
    """Turned polygons, moved along a line until they touch in doubles, then by some ulps."""
    n, m = _sizes(rng)
    A, B = _round(rng, n), _round(rng, m, radius=float(rng.choice([1e-3, 0.3, 1.0])))
    X_WA, X_WB = pose_at((0, 0), rng.uniform(0, 7)), pose_at((0, 0), rng.uniform(0, 7))
    a, b = A @ X_WA[:2, :2].T, B @ X_WB[:2, :2].T
    angle = rng.uniform(0, 7)
    direction = np.array([np.cos(angle), np.sin(angle)])
    normals = [[-d[1], d[0]] for p in (a, b) for d in p - np.roll(p, 1, axis=0) if d.any()] or [[1.0, 0.0]]
    # Along each normal, how far B has to move for its near corner to be level with A's far one.
    both = [k for k in np.concatenate((normals, np.negative(normals))) if direction @ k > 1e-3]
    gaps = [((a @ k).max() - (b @ k).min()) / (direction @ k) for k in both]
    X_WB[:2, 2] = _nudged(rng, min(gaps) * direction if gaps else a[0] - b[0])
    return A, B, X_WA, X_WB


def nested(rng):
    """One inside the other, sometimes with a corner on its edge."""
    n, m = np.maximum(_sizes(rng), 3)
    A = _round(rng, n)
    B = A.mean(axis=0) + 0.2 * (_round(rng, m) if rng.random() < 0.5 else A - A.mean(axis=0))
    if rng.random() < 0.3:
        B[0] = (A[0] + A[1]) / 2
    X = pose_at(rng.normal(size=2), rng.uniform(0, 7))
    return (A, B, X, X) if rng.random() < 0.5 else (B, A, X, X)


def needles(rng):
    """A thousand to a billion times as long as wide, crossing or side by side."""
    n, m = np.maximum(_sizes(rng), 3)
    A, B = (_round(rng, k, squeeze=float(10.0 ** -rng.uniform(3, 9))) for k in (n, m))
    spread = float(rng.choice([1e-9, 1e-6, 1e-2]))
    X_WA = pose_at(rng.normal(size=2), rng.uniform(0, 7))
    turned = rng.uniform(0, 7) if rng.random() < 0.4 else spread * rng.normal()
    return A, B, X_WA, X_WA @ pose_at((rng.uniform(-2, 2), spread * rng.normal()), turned)


def near_and_far(rng):
    """Round polygons at any distance, of any size."""
    n, m = _sizes(rng) * int(rng.choice([1, 1, 1, 3]))
    A, B = _round(rng, n), _round(rng, m, radius=float(10.0 ** rng.uniform(-3, 0)))
    return A, B, pose_at((0, 0), rng.uniform(0, 7)), pose_at(rng.normal(size=2), rng.uniform(0, 7))


def magnitudes(rng):
    """Coordinates from 1e-48 to 1e48 m, side by side with tiny ones."""
    n, m = _sizes(rng)
    scale = float(10.0 ** rng.uniform(-48, 48))
    A, B = _round(rng, n, radius=scale), _round(rng, m, radius=scale)
    if rng.random() < 0.5 and n > 1:
        A[0] = 5e-324, -1e-310
    return A, B, pose_at((0, 0), rng.uniform(0, 7)), pose_at(scale * rng.normal(size=2), rng.uniform(0, 7))


FAMILIES = (lattice, parallel, touching, nested, needles, near_and_far, magnitudes)
