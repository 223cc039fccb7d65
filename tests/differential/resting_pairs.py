"""Resting pairs for `test_contacts.py`, and what is true of two convex bodies along a line: numpy, no engine.

Supports, intervals of lines and distances to surfaces are those of the closed forms of a box, sphere, capsule and
cylinder, and of the half-spaces of a hull (Qhull's).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull as Qhull

import collide

BOTTOMS = ("box", "hull", "cylinder")
TOPS = ("box", "hull", "cylinder", "cylinder lying", "capsule lying", "sphere")
#: How many different shapes of a kind there are.
SHAPES = 40


class Pair(NamedTuple):
    """B rests on A. X_WA, X_WB : (4, 4)."""

    kind: tuple[str, str]
    A: collide.Shape
    B: collide.Shape
    X_WA: np.ndarray
    X_WB: np.ndarray


def hull_points(rng: np.random.Generator, k: int) -> np.ndarray:
    """Every other one a frustum with polygons at its ends, the others points on a ball; centred, 0.1 to 0.4 m."""
    if k % 2:
        points = rng.normal(size=(rng.integers(8, 49), 3))
        points *= 0.15 / np.linalg.norm(points, axis=1)[:, None] * rng.uniform(0.7, 1.3, 3)
    else:
        n = int(rng.integers(3, 13))
        angles = (np.arange(n) + rng.uniform(-0.3, 0.3, n)) * 2 * np.pi / n
        ring = rng.uniform(0.1, 0.2) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        height = rng.uniform(0.05, 0.15)
        ends = (1.0, -height), (rng.uniform(0.6, 1), height)
        points = np.concatenate([np.column_stack([scale * ring, np.full(n, z)]) for scale, z in ends])
    return points - points.mean(axis=0)


def shape_of(kind: str, rng: np.random.Generator, k: int) -> collide.Shape:
    name = kind.split()[0]
    if name == "box":
        return collide.Box(rng.uniform(0.1, 0.4, 3))
    if name == "hull":
        return collide.ConvexHull(hull_points(rng, k))
    if name == "sphere":
        return collide.Sphere(rng.uniform(0.05, 0.2))
    made = collide.Cylinder if name == "cylinder" else collide.Capsule
    return made(rng.uniform(0.05, 0.2), rng.uniform(0.1, 0.4))


def planes(shape: collide.Shape) -> np.ndarray:
    """(m, 4): n · x + c ≤ 0 inside a box or a hull."""
    if isinstance(shape, collide.Box):
        return np.array([[*(s * np.eye(3)[k]), -0.5 * shape.size[k]] for k in range(3) for s in (-1.0, 1.0)])
    return _planes_of_hull(shape)


@cache  # by the hull's value, and it is held: by its id() a hull made later, where a dropped one stood, had its planes
def _planes_of_hull(hull: collide.ConvexHull) -> np.ndarray:
    return Qhull(hull.points).equations


def face_down(kind: str, shape: collide.Shape, rng: np.random.Generator) -> np.ndarray:
    """(3, 3) rotation with a face, or the side it lies on, downwards; of hulls one that it stands on."""
    down = np.array([0.0, 0.0, -1.0])
    if kind.endswith("lying"):
        down = np.array([1.0, 0.0, 0.0])
    elif kind in ("box", "hull"):
        faces = planes(shape)
        if kind == "hull":  # those whose plane lies nearest to the middle are stood on
            faces = faces[np.argsort(-faces[:, 3])[: max(1, len(faces) // 4)]]
        down = faces[rng.integers(len(faces)), :3]
    across = np.cross(down, np.eye(3)[np.abs(down).argmin()])
    across /= np.linalg.norm(across)
    yaw = collide.pose((0, 0, 0), rpy=(0, 0, rng.uniform(-np.pi, np.pi)))[:3, :3]
    return yaw @ np.array([across, np.cross(across, down), -down])


def resting_pairs(n: int, seed: int) -> list[Pair]:
    """n pairs, every kind on every other in turn: a third exactly level, the others tilted by 1e-7 to 1e-2; a quarter
    level with the surface, half sunk by 1e-6 to 1e-3 m, a quarter as much above; then turned and shifted together."""
    rng = np.random.default_rng(seed)
    kinds = [(top, bottom) for top in TOPS for bottom in BOTTOMS]
    shapes = {kind: [shape_of(kind, rng, k) for k in range(SHAPES)] for kind in sorted({*TOPS, *BOTTOMS})}
    pairs = []
    for k in range(n):
        top, bottom = kinds[k % len(kinds)]
        A, B = shapes[bottom][rng.integers(SHAPES)], shapes[top][rng.integers(SHAPES)]
        X, Y = np.eye(4), np.eye(4)
        X[:3, :3] = collide.pose((0, 0, 0), rpy=(np.pi, 0, 0))[:3, :3] @ face_down(bottom, A, rng)
        X[2, 3] = -support(A, X[:3, :3], np.array([0.0, 0.0, 1.0]))
        angles = 10 ** rng.uniform(-7, -2) * rng.normal(size=2) * (k % 3 > 0)
        tilt = collide.pose((0, 0, 0), rpy=(*angles, 0))
        Y[:3, :3] = tilt[:3, :3] @ face_down(top, B, rng)
        gap = (0.0, -1.0, -1.0, 1.0)[rng.integers(4)] * 10 ** rng.uniform(-6, -3)
        Y[2, 3] = support(B, Y[:3, :3], np.array([0.0, 0.0, -1.0])) + gap
        Y[:2, 3] = rng.uniform(-0.02, 0.02, 2)
        W = collide.pose(rng.uniform(-1, 1, 3), quat_wxyz=rng.normal(size=4))
        pairs.append(Pair((top, bottom), A, B, W @ X, W @ Y))
    return pairs


def support(shape: collide.Shape, R: np.ndarray, n: np.ndarray) -> float:
    """How far the body, turned by R, reaches along n from its origin."""
    d = R.T @ n
    if isinstance(shape, collide.Box):
        return float(0.5 * shape.size @ np.abs(d))
    if isinstance(shape, collide.ConvexHull):
        return float((shape.points @ d).max())
    length = float(np.linalg.norm(d))
    if isinstance(shape, collide.Sphere):
        return shape.radius * length
    if isinstance(shape, collide.Capsule):
        return shape.radius * length + 0.5 * shape.length * abs(d[2])
    return shape.radius * float(np.hypot(d[0], d[1])) + 0.5 * shape.length * abs(d[2])


def separation(pair: Pair, n: np.ndarray) -> float:
    """How far the bodies are apart along a direction from A to B; no direction gives more than their signed
    distance."""
    n = n / np.linalg.norm(n)
    between = (pair.X_WB[:3, 3] - pair.X_WA[:3, 3]) @ n
    return float(between - support(pair.A, pair.X_WA[:3, :3], n) - support(pair.B, pair.X_WB[:3, :3], -n))


def off_surface(shape: collide.Shape, X: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(k,) how far points are from the body's surface [m]; of points outside a hull at least so far."""
    p = (points - X[:3, 3]) @ X[:3, :3]
    if isinstance(shape, collide.Sphere):
        return np.abs(np.linalg.norm(p, axis=1) - shape.radius)
    if isinstance(shape, collide.Capsule):
        along = np.clip(p[:, 2], -0.5 * shape.length, 0.5 * shape.length)
        return np.abs(np.linalg.norm(p - along[:, None] * (0, 0, 1), axis=1) - shape.radius)
    if isinstance(shape, collide.Cylinder):
        aside, over = np.hypot(p[:, 0], p[:, 1]) - shape.radius, np.abs(p[:, 2]) - 0.5 * shape.length
        outside = np.hypot(np.maximum(aside, 0), np.maximum(over, 0))
        return np.abs(outside + np.minimum(np.maximum(aside, over), 0))
    faces = planes(shape)
    return np.abs((p @ faces[:, :3].T + faces[:, 3]).max(axis=1))


def interval(shape: collide.Shape, X: np.ndarray, origins: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k,), (k,): where lines from the origins along n enter and leave the body; inf, −inf where they miss it."""
    o, d = (origins - X[:3, 3]) @ X[:3, :3], n @ X[:3, :3]
    if isinstance(shape, collide.Sphere):
        return _within(o @ d, (o**2).sum(axis=1) - shape.radius**2, 1.0)
    if isinstance(shape, collide.Box | collide.ConvexHull):
        return _between(planes(shape), o, d)
    ends = np.array([[0, 0, s, -0.5 * shape.length] for s in (-1.0, 1.0)])
    square = d[0] ** 2 + d[1] ** 2
    side = _within(o[:, :2] @ d[:2], (o[:, :2] ** 2).sum(axis=1) - shape.radius**2, square)
    slab = _between(ends, o, d)
    low, high = np.maximum(side[0], slab[0]), np.minimum(side[1], slab[1])
    misses = low > high
    low, high = np.where(misses, np.inf, low), np.where(misses, -np.inf, high)
    if isinstance(shape, collide.Capsule):
        for end in (-1.0, 1.0):
            q = o - (0, 0, 0.5 * end * shape.length)
            ball = _within(q @ d, (q**2).sum(axis=1) - shape.radius**2, 1.0)
            low, high = np.minimum(low, ball[0]), np.maximum(high, ball[1])
    return low, high


def _within(b: np.ndarray, c: np.ndarray, a: float) -> tuple[np.ndarray, np.ndarray]:
    """Where a t² + 2 b t + c ≤ 0."""
    if a < 1e-30:
        inside = c <= 0
        return np.where(inside, -np.inf, np.inf), np.where(inside, np.inf, -np.inf)
    root = np.sqrt(np.maximum(b * b - a * c, 0))
    meets = b * b - a * c >= 0
    return np.where(meets, (-b - root) / a, np.inf), np.where(meets, (root - b) / a, -np.inf)


def _between(faces: np.ndarray, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    slope, height = faces[:, :3] @ d, o @ faces[:, :3].T + faces[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -height / slope
    low = np.where(slope < 0, t, -np.inf).max(axis=1)
    high = np.where(slope > 0, t, np.inf).min(axis=1)
    misses = (low > high) | ((slope == 0) & (height > 0)).any(axis=1)
    return np.where(misses, np.inf, low), np.where(misses, -np.inf, high)
