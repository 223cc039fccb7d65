"""Pairs of cylinders, cones and ellipsoids, for `accuracy.py`: random shapes in four kinds of pose, and their brackets.

A width is in units of S, the size of a pair in docs/conventions.md. Shapes are drawn anew for every pose, their lengths
within a factor of 20 of each other. Poses: "random"; "aligned", all frames' axes parallel or at right angles, no origin
on an axis of the other; "one axis", the two z axes on one line; "nearly", tilted and shifted off that line by 1e-12 to
0.1.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
from inputs import directions
from inputs import rotation as random_rotation

import collide

CURVED = ("cylinder", "cone", "ellipsoid")
OTHERS = ("sphere", "capsule", "box", "hull", "half-space")
#: Every pair with a curved body, once.
PAIRS = tuple(
    (a, b) for k, a in enumerate(CURVED) for b in (*OTHERS, *CURVED[k:])
)
POSES = ("random", "aligned", "one axis", "nearly")
#: Lengths of a pair differ by this factor at most.
SPREAD = 20.0


class Widths(NamedTuple):
    """Over one pair of kinds in one kind of pose: brackets (N,) in units of S, hits (N,), certified (N,), µs a pair."""

    widths: np.ndarray
    hits: np.ndarray
    certified: np.ndarray
    us: float


def length(random) -> float:
    """Log-uniform over the spread, at most 1."""
    return float(SPREAD ** -random.uniform())


def shape(kind: str, random):

    a, b, c = (length(random) for _ in range(3))
    if kind == "sphere":
        return collide.Sphere(a / 2)
    if kind == "capsule":
        return collide.Capsule(a / 2, b)
    if kind == "box":
        return collide.Box((a, b, c))
    if kind == "hull":
        return collide.ConvexHull(random.normal(size=(20, 3)) * (a / 4, b / 4, c / 4))
    if kind == "half-space":
        return collide.Halfspace(random.normal(size=3), 0.0)
    if kind == "cylinder":
        return collide.Cylinder(a / 2, b)
    return collide.Cone(a / 2, b) if kind == "cone" else collide.Ellipsoid((a / 2, b / 2, c / 2))


def reach(body) -> float:
    """Radii plus the largest distance of a point from the frame's origin: what a body adds to S [m]."""
    kind = type(body).__name__
    if kind == "Sphere":
        return body.radius
    if kind == "Capsule":
        return body.length / 2 + body.radius
    if kind == "Box":
        return float(np.sqrt(np.square(body.size).sum())) / 2
    if kind == "ConvexHull":
        return float(np.sqrt(np.square(body.points).sum(axis=1).max())) + body.radius
    if kind == "Ellipsoid":
        return float(body.radii.max())
    return 0.0 if kind == "Halfspace" else float(np.hypot(body.radius, body.length / 2))


def _turned(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues' rotation about a unit axis."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)


def poses(kind: str, both: float, random) -> tuple[np.ndarray, np.ndarray]:
    """(X_WA, X_WB) of two bodies whose reaches add up to ``both`` [m]; about half of them overlap."""
    X_WA, X_AB = np.eye(4), np.eye(4)
    X_WA[:3, :3], X_WA[:3, 3] = random_rotation(random), random.normal(size=3)
    step = random.uniform(0.0, 1.1) * both
    if kind == "random":
        X_AB[:3, :3] = random_rotation(random)
        X_AB[:3, 3] = directions(random, 1)[0] * step
    elif kind == "aligned":
        X_WA[:3, :3] = np.eye(3)
        X_AB[:3, :3] = np.eye(3)[random.permutation(3)] * random.choice([-1.0, 1.0], 3)
        X_AB[0, :3] *= np.sign(np.linalg.det(X_AB[:3, :3]))
        X_AB[:3, 3] = random.permutation([1.0, 1.0, random.integers(2)]) * random.choice([-1.0, 1.0], 3) * step
    else:
        X_AB[:3, :3] = np.diag([1.0, 1.0, 1.0] if random.random() < 0.5 else [1.0, -1.0, -1.0])
        X_AB[2, 3] = random.choice([-1.0, 1.0]) * step
        if kind == "nearly":
            off = 10.0 ** random.uniform(-12, -1, 2)
            around = random.uniform(0, 2 * np.pi, 2)
            X_AB[:3, :3] = _turned(np.array([np.cos(around[0]), np.sin(around[0]), 0.0]), off[0]) @ X_AB[:3, :3]
            X_AB[:3, 3] += off[1] * both * np.array([np.cos(around[1]), np.sin(around[1]), 0.0])
    return X_WA, X_WA @ X_AB


def widths(a: str, b: str, kind: str, count: int, seed: int) -> Widths:
    """Brackets of ``count`` random pairs of two kinds of shape, in one kind of pose."""

    random = np.random.default_rng([seed, *map(ord, a + b + kind)])
    A, B, X_WA, X_WB = [], [], np.empty((count, 4, 4)), np.empty((count, 4, 4))
    for k in range(count):
        A.append(shape(a, random))
        B.append(shape(b, random))
        if kind == "one axis" and b == "half-space":
            B[k] = collide.Halfspace((0.0, 0.0, 1.0), 0.0)
        X_WA[k], X_WB[k] = poses(kind, reach(A[k]) + reach(B[k]), random)
    started = time.perf_counter()
    rows = collide.distance(A, B, X_WA, X_WB).rows
    seconds = time.perf_counter() - started
    size = np.array([reach(A_k) + reach(B_k) for A_k, B_k in zip(A, B)])
    size += np.sqrt(np.square(X_WB[:, :3, 3] - X_WA[:, :3, 3]).sum(axis=1))
    return Widths((rows["upper"] - rows["lower"]) / size, rows["hit"], rows["certified"], seconds / count * 1e6)
