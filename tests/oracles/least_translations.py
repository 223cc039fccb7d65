"""How far two unions of balls and boxes have to be moved apart, by numpy alone: no bodies, only A ⊖ B of their parts.

A ball less a ball is a ball, a box less a box has faces along the faces of both and across their pairs of edges.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np


class Ball(NamedTuple):
    centre: np.ndarray
    radius: float


class Cuboid(NamedTuple):
    """R : (3, 3) axes as columns.   half : (3,) half sizes [m]."""

    R: np.ndarray
    centre: np.ndarray
    half: np.ndarray


def least_of_balls(A: list[Ball], B: list[Ball]) -> float:
    """The least length [m] of a translation of B out of A.

    The point nearest to 0 that no open ball holds lies on one, two or three spheres: on the line through 0 and a
    centre, on the circle of two at its nearest points, or where three meet. All these are looked at.
    """
    centres = np.array([a.centre - b.centre for a in A for b in B])
    radii = np.array([a.radius + b.radius for a in A for b in B])
    points = [np.zeros(3)]
    for c, r in zip(centres, radii):
        n = c / np.linalg.norm(c) if c.any() else np.array([1.0, 0.0, 0.0])
        points += [c - r * n, c + r * n]
    for i, j in combinations(range(len(radii)), 2):
        points += _circle_points(centres[i], radii[i], centres[j], radii[j])
        for k in range(j + 1, len(radii)):
            points += _corners(centres[[i, j, k]], radii[[i, j, k]])
    x = np.array(points)
    lengths = np.sqrt(np.square(x).sum(axis=1))
    order = np.argsort(lengths)
    for some in np.array_split(order, max(len(order) // 1000, 1)):
        away = np.sqrt(np.square(x[some][:, None] - centres).sum(axis=2)) - radii
        free = some[(away > -1e-9).all(axis=1)]
        if len(free):
            return float(lengths[free[0]])
    raise AssertionError("a union of balls has an outside")


def _circle_points(c, r, d, s) -> list[np.ndarray]:
    """The points nearest to and farthest from 0 on the circle in which two spheres meet."""
    axis = d - c
    length = np.linalg.norm(axis)
    if not abs(r - s) < length < r + s:
        return []
    n = axis / length
    along = 0.5 * (length + (r * r - s * s) / length)
    middle, radius = c + along * n, np.sqrt(max(r * r - along * along, 0.0))
    across = -middle + (middle @ n) * n
    if np.linalg.norm(across) < 1e-12:
        across = np.cross(n, np.eye(3)[np.abs(n).argmin()])
    across /= np.linalg.norm(across)
    return [middle + radius * across, middle - radius * across]


def _corners(centres, radii) -> list[np.ndarray]:
    """The points in which three spheres meet."""
    p, q = centres[1:] - centres[0]
    n = np.cross(p, q)
    square = n @ n
    if square < 1e-12:
        return []
    r = radii * radii
    u, v = 0.5 * (r[0] - r[1] + p @ p), 0.5 * (r[0] - r[2] + q @ q)
    x = (u * np.cross(q, n) + v * np.cross(n, p)) / square
    h = r[0] - x @ x
    return [centres[0] + x + s * np.sqrt(h / square) * n for s in (1, -1)] if h >= 0 else []


def first_gaps(A: list, B: list, U: np.ndarray) -> np.ndarray:
    """(n,) how far along unit vectors (n, 3) B is moved before it first comes free of A [m], balls with balls and boxes
    with boxes."""
    spans = np.array([_span(a, b, U) for a in A for b in B])
    reached = np.zeros(len(U))
    for _ in range(len(spans) + 1):
        bars = spans[:, 0] <= reached + 1e-12
        reached = np.maximum(reached, np.where(bars, spans[:, 1], 0.0).max(axis=0))
    return reached


def _span(a, b, U: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From where to where lines through 0 run within A ⊖ B of two parts; from ∞ where they miss it."""
    c = a.centre - b.centre
    if isinstance(a, Ball):
        along = U @ c
        square = along * along - c @ c + (a.radius + b.radius) ** 2
        half = np.sqrt(np.maximum(square, 0.0))
        return np.where(square > 0.0, along - half, np.inf), np.where(square > 0.0, along + half, -np.inf)
    normals = np.concatenate([a.R.T, b.R.T, [np.cross(e, f) for e in a.R.T for f in b.R.T]])
    lengths = np.sqrt(np.square(normals).sum(axis=1))
    normals = normals[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    heights = np.abs(normals @ a.R) @ a.half + np.abs(normals @ b.R) @ b.half
    slopes = U @ normals.T
    slopes[np.abs(slopes) < 1e-14] = 1e-14
    ends = np.sort(np.stack([(normals @ c - heights) / slopes, (normals @ c + heights) / slopes]), axis=0)
    low, high = ends[0].max(axis=1), ends[1].min(axis=1)
    return np.where(low < high, low, np.inf), np.where(low < high, high, -np.inf)
