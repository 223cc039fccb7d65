"""Oracles of casts that share no code with the engine: facets by definition, exactly, and planes by the thousand."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import numpy as np


def exact_first_contact(A: list[tuple], B: list[tuple], d: tuple) -> Fraction | None:
    """Least t ≥ 0 with A + t d meeting B, of hulls of integer points whose difference is solid; None for never.

    Every plane through three points of B ⊖ A that has all others on one side bounds it; the ray is clipped by them all.
    """
    points = sorted({tuple(x - y for x, y in zip(b, a)) for a in A for b in B})
    first, last, planes = Fraction(0), None, 0
    for p, q, r in combinations(points, 3):
        n = _cross(_minus(q, p), _minus(r, p))
        if not any(n):
            continue
        heights = {(_dot(n, x) > _dot(n, p)) - (_dot(n, x) < _dot(n, p)) for x in points}
        if heights == {0}:
            raise ValueError("the difference is flat")
        if {-1, 1} <= heights:
            continue
        if 1 in heights:
            n = tuple(-c for c in n)
        planes += 1
        # n·(t d) ≤ n·p
        slope, offset = _dot(n, d), _dot(n, p)
        if slope == 0:
            if offset < 0:
                return None
        elif slope < 0:
            first = max(first, Fraction(offset, slope))
        else:
            out = Fraction(offset, slope)
            last = out if last is None else min(last, out)
    assert planes >= 4
    return None if last is not None and first > last else first


def _minus(a, b):
    return tuple(x - y for x, y in zip(a, b))


def _dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def support_heights(shape, X, n: np.ndarray) -> np.ndarray:
    """(k,) how far a shape at a pose reaches along unit directions n (k, 3), by the shape's own formula."""
    g = n @ X[:3, :3]
    name = type(shape).__name__
    across = np.hypot(g[:, 0], g[:, 1])
    if name == "Sphere":
        own = np.full(len(n), shape.radius)
    elif name == "Box":
        own = 0.5 * np.abs(g) @ np.asarray(shape.size)
    elif name == "Capsule":
        own = shape.radius + 0.5 * shape.length * np.abs(g[:, 2])
    elif name == "Cylinder":
        own = shape.radius * across + 0.5 * shape.length * np.abs(g[:, 2])
    elif name == "Cone":
        own = np.maximum(0.5 * shape.length * g[:, 2], shape.radius * across - 0.5 * shape.length * g[:, 2])
    elif name == "Ellipsoid":
        own = np.linalg.norm(g * np.asarray(shape.radii), axis=1)
    elif name == "ConvexHull":
        own = (g @ np.asarray(shape.points).T).max(axis=1) + shape.radius
    else:
        raise TypeError(name)
    return own + n @ X[:3, 3]


def cast_from_below(A, B, X_WA, X_WB, d, rng, rounds: int = 50) -> float:
    """The largest t that a plane proves free, of many planes and of ever more around the best; inf where one proves
    that nothing is ever met.

    With the unit normal n, A + t d stays before the plane while t n·d is less than the gap along n.
    """
    n = rng.normal(size=(4000, 3))
    best, width = None, 0.5
    for _ in range(rounds):
        n /= np.linalg.norm(n, axis=1)[:, None]
        gap = -support_heights(B, X_WB, -n) - support_heights(A, X_WA, n)
        pace = n @ d
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(pace > 0, gap / pace, np.where(gap > 1e-12, np.inf, -np.inf))
        k = int(np.argmax(t))
        if best is None or t[k] > best[0]:
            best = float(t[k]), n[k]
        if np.isinf(best[0]) and best[0] > 0:
            return np.inf
        n = best[1] + width * rng.normal(size=(300, 3))
        width *= 0.75
    return max(best[0], 0.0)


def holds(shape, X, point, strictly: bool = False) -> bool:
    """Whether a convex shape at a pose (4, 4) holds a point of fractions, by its definition, exactly.

    strictly : whether the point is inside, and not on the surface.
    """
    R = [[Fraction(v) for v in row[:3]] for row in X[:3].tolist()]
    x = [c - Fraction(v) for c, v in zip(point, X[:3, 3].tolist())]
    name = type(shape).__name__
    half = Fraction(float(getattr(shape, "length", 0.0))) / 2
    radius = Fraction(float(getattr(shape, "radius", 0.0)))
    if name in ("Sphere", "Capsule"):  # the ball is one in W
        axis = [row[2] for row in R]
        square = _dot(axis, axis)
        s = max(min(_dot(x, axis) / square, half), -half)
        beside = [c - s * v for c, v in zip(x, axis)]
        excess = _dot(beside, beside) - radius**2
    else:
        x, y, z = _solved(R, x)
        if name == "Cylinder":
            excess = max(x * x + y * y - radius**2, z * z - half**2)
        elif name == "Cone":
            width = radius * (half - z) / (2 * half)
            excess = max(x * x + y * y - width**2 if width >= 0 else Fraction(1), -half - z)
        elif name == "Ellipsoid":
            a, b, c = (Fraction(v) for v in np.asarray(shape.radii).tolist())
            excess = (x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2 - 1
        elif name == "Halfspace":
            n = [Fraction(v) for v in np.asarray(shape.normal).tolist()]
            excess = _dot(n, (x, y, z)) - Fraction(float(shape.offset))
        elif name == "Box":
            sides = [Fraction(v) / 2 for v in np.asarray(shape.size).tolist()]
            excess = max(abs(c) - side for c, side in zip((x, y, z), sides))
        else:
            raise TypeError(name)
    return excess < 0 if strictly else excess <= 0


def _solved(R, x):
    """R⁻¹ x, by Cramer's rule."""
    a, b, c = ([row[k] for row in R] for k in range(3))
    determinant = _dot(a, _cross(b, c))
    return _dot(x, _cross(b, c)) / determinant, _dot(a, _cross(x, c)) / determinant, _dot(a, _cross(b, x)) / determinant


def on_ray(origin, direction, t) -> list[Fraction]:
    """A point of a ray of doubles, exactly."""
    return [Fraction(float(o)) + Fraction(float(t)) * Fraction(float(d)) for o, d in zip(origin, direction)]
