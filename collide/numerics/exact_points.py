"""Points under poses as Python integers on one grid, for the few questions that doubles leave open.

A double is a whole number times a power of two. So are the coordinates R v + t of a placed point, and all of a question
can be written as integers times one power of two: nothing is rounded.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction

import numpy as np

from collide.numerics.exact_vectors import cross, inner, minus

#: Integer coordinates.
Point = tuple[int, int, int]


def integers(values) -> tuple[list[int], int]:
    """(whole numbers, exponent e) with values = numbers · 2^e; e is 0 where all are 0."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    mantissas, exponents = np.frexp(flat)
    whole = np.ldexp(mantissas, 53).astype(np.int64).tolist()
    known = [e - 53 for m, e in zip(whole, exponents.tolist()) if m]
    if not known:
        return [0] * len(whole), 0
    low = min(known)
    return [m << (e - 53 - low) if m else 0 for m, e in zip(whole, exponents.tolist())], low


def placed(X: np.ndarray, points: np.ndarray) -> tuple[list[Point], int]:
    """(points (k, 3) placed by the pose X (4, 4) as integers, exponent of their grid), entries taken as exact."""
    local, grid = integers(points)
    return moved(X, zip(local[0::3], local[1::3], local[2::3]), grid)


def moved(X: np.ndarray, points: Iterable[Point], grid: int) -> tuple[list[Point], int]:
    """The same of points that are integers times 2^grid."""
    R, R_grid = integers(X[:3, :3])
    p, p_grid = integers(X[:3, 3])
    low = min(R_grid + grid, p_grid)
    R = [entry << (R_grid + grid - low) for entry in R]
    p = [entry << (p_grid - low) for entry in p]
    rows = [(*R[3 * i : 3 * i + 3], p[i]) for i in range(3)]
    return [tuple(a * x + b * y + c * z + t for a, b, c, t in rows) for x, y, z in points], low  # type: ignore[misc]


def on_one_grid(*groups: tuple[list[Point], int]) -> tuple[list[list[Point]], int]:
    """The groups of `placed` on the finest of their grids, and its exponent."""
    low = min(grid for _, grid in groups)
    return [[(x << g, y << g, z << g) for x, y, z in points] for points, grid in groups for g in (grid - low,)], low


def leading_digits(vector: Point) -> tuple[float, float, float]:
    """A vector along this one, components below 1 and rounded, the largest at least ½; zeros of a zero vector."""
    digits = max(abs(x).bit_length() for x in vector)
    scale = 1 << digits
    return vector[0] / scale, vector[1] / scale, vector[2] / scale


def rounded(value: Fraction, exponent: int = 0) -> tuple[float, float, float]:
    """(value · 2^exponent rounded to the nearest double, from below, from above); overflows to infinity."""
    exact = value * Fraction(2) ** exponent
    try:
        nearest = float(exact)
    except OverflowError:
        largest = math.nextafter(math.inf, 0.0)
        return (math.inf, largest, math.inf) if exact > 0 else (-math.inf, -math.inf, -largest)
    back = Fraction(nearest)
    return (
        nearest,
        nearest if back <= exact else math.nextafter(nearest, -math.inf),
        nearest if back >= exact else math.nextafter(nearest, math.inf),
    )


def enters(triangle: list[Point], origin: Point, direction: Point) -> Fraction:
    """The least t ≥ 0 with origin + t · direction in a closed triangle that the ray is known to meet."""
    v = [minus(p, origin) for p in triangle]
    across = cross(minus(triangle[1], triangle[0]), minus(triangle[2], triangle[0]))
    slope = inner(across, direction)
    if slope:
        return Fraction(inner(across, v[0]), slope)
    # The ray runs in the triangle's plane, or the triangle has no area: seen from `across` its corners lie left or
    # right of the ray, or on it, and it is entered at one of those or on a side from left to right.
    if across == (0, 0, 0):
        sides = (cross(direction, minus(triangle[j], triangle[i])) for i, j in ((0, 1), (1, 2), (2, 0)))
        across = next((side for side in sides if side != (0, 0, 0)), (0, 0, 0))
    square = inner(direction, direction)
    side = [inner(across, cross(direction, p)) for p in v]
    along = [inner(direction, p) for p in v]
    if across == (0, 0, 0):  # a point, or a segment along the ray
        side = [0 if cross(direction, p) == (0, 0, 0) else 1 for p in v]
    crossings = [Fraction(along[k], square) for k in range(3) if side[k] == 0]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        if side[i] * side[j] < 0:
            crossings.append(Fraction(side[j] * along[i] - side[i] * along[j], (side[j] - side[i]) * square))
    if not crossings or max(crossings) < 0:
        raise AssertionError("a ray that is known to meet a facet misses it")
    return max(min(crossings), Fraction(0))
