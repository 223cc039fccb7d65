"""Vertices of an intersection of half-spaces, exactly, by the double description method.

The half-spaces {x : n·x ≤ b} become a cone {(x, w) : b·w − n·x ≥ 0, w ≥ 0} in four dimensions
(Motzkin, Raiffa, Thompson and Thrall 1953; Fukuda and Prodon 1996 for the adjacency test). Its
extreme rays with w > 0 are the vertices, those with w = 0 the directions in which the set never
ends. All numbers are Python integers: doubles are dyadic rationals, so nothing is rounded until
the vertices are handed back.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations
from math import gcd

import numpy as np

from collide.numerics.exact_vectors import cross, dot, inner

Row = tuple[int, int, int, int]


def halfspace_vertices(normals: np.ndarray, offsets: np.ndarray):
    """Vertices of {x : normals @ x ≤ offsets}.

    Parameters
    ----------
    normals : (m, 3) float64, no zero rows.   offsets : (m,) float64.

    Returns
    -------
    vertices : (v, 3) float64, each the rounding of an exact vertex; (0, 3) where the set is empty.
    slop : upper bound of the distance between a vertex and its rounding [m]; 0 where all are exact.
    unbounded : (3,) a direction in which the set is unbounded, or None.
    """
    rows = _distinct(
        [_integers((-n[0], -n[1], -n[2], b)) for n, b in zip(normals.tolist(), offsets.tolist())]
        + [(0, 0, 0, 1)]
    )
    start = _independent_rows(rows)
    if start is None:
        # Fewer than four independent rows: a direction is orthogonal to every normal, so the set
        # is empty or unbounded; both are told apart after bounding it by a unit cube's normals.
        direction = _common_kernel(rows)
        box = [tuple(s * (k == axis) for k in range(3)) for axis in range(3) for s in (1, -1)]
        bounded = halfspace_vertices(
            np.vstack([normals, np.array(box, dtype=float)]),
            np.concatenate([offsets, np.full(6, _beyond(rows))]),
        )
        return bounded[0], bounded[1], direction if len(bounded[0]) else None
    rays = _extreme_rays(rows, start)
    finite = [ray for ray in rays if ray[3] > 0]
    if not finite:
        return np.zeros((0, 3)), 0.0, None
    for x, y, z, w in rays:
        if w == 0:
            return np.zeros((0, 3)), 0.0, np.array([x, y, z], dtype=float) / max(abs(x), abs(y), abs(z))
    return *_rounded(finite), None


def _integers(row) -> Row:
    """The row scaled to coprime integers by a positive factor."""
    fractions = [Fraction(value) for value in row]
    scale = max(f.denominator for f in fractions)  # powers of two: the largest is common to all
    return _primitive([int(f * scale) for f in fractions])


def _primitive(values) -> Row:
    divisor = gcd(*values) or 1
    return tuple(value // divisor for value in values)  # type: ignore[return-value]


def _distinct(rows: list[Row]) -> list[Row]:
    return list(dict.fromkeys(row for row in rows if any(row)))


def _cross(a: Row, b: Row, c: Row) -> Row:
    """The vector orthogonal to three others in four dimensions."""
    minors = []
    for k in range(4):
        u, v, w = (row[:k] + row[k + 1 :] for row in (a, b, c))
        minors.append((-1) ** k * inner(u, cross(v, w)))
    return _primitive(minors)


def _independent_rows(rows: list[Row]) -> list[int] | None:
    """Ids of four linearly independent rows, greedily, or None."""
    rows_of_basis: list[int] = []
    basis: list[list[Fraction]] = []
    for k, row in enumerate(rows):
        rest = [Fraction(value) for value in row]
        for pivot_row in basis:
            pivot = next(i for i, value in enumerate(pivot_row) if value)
            factor = rest[pivot] / pivot_row[pivot]
            rest = [r - factor * p for r, p in zip(rest, pivot_row)]
        if any(rest):
            basis.append(rest)
            rows_of_basis.append(k)
            if len(rows_of_basis) == 4:
                return rows_of_basis
    return None


def _extreme_rays(rows: list[Row], start: list[int]) -> list[Row]:
    """Extreme rays of {r : row·r ≥ 0 for every row}, inserting one row after another."""
    # A ray carries the set of rows it is tight on, as the bits of an integer.
    rays: list[tuple[Row, int]] = []
    for apart in start:
        others = [k for k in start if k != apart]
        ray = _cross(*(rows[k] for k in others))
        if dot(rows[apart], ray) < 0:
            ray = tuple(-value for value in ray)  # type: ignore[assignment]
        rays.append((ray, sum(1 << k for k in others)))
    for k, row in enumerate(rows):
        if k not in start:
            rays = _cut(rays, row, 1 << k)
    return [ray for ray, _ in rays]


def _cut(rays: list[tuple[Row, int]], row: Row, bit: int) -> list[tuple[Row, int]]:
    on_plane, inside, outside = [], [], []
    for ray, tight in rays:
        side = inner(row, ray) + row[3] * ray[3]
        if side > 0:
            inside.append((ray, tight, side))
            on_plane.append((ray, tight))
        elif side == 0:
            on_plane.append((ray, tight | bit))
        else:
            outside.append((ray, tight, side))
    every = [tight for _, tight in rays]
    for ray_out, tight_out, side_out in outside:
        for ray_in, tight_in, side_in in inside:
            common = tight_out & tight_in
            if _adjacent(common, every):
                ray = _primitive([side_in * o - side_out * i for o, i in zip(ray_out, ray_in)])
                on_plane.append((ray, common | bit))
    return on_plane


def _adjacent(common: int, every: list[int]) -> bool:
    """Two extreme rays span a face of dimension two iff no third ray is tight on all they share."""
    if common.bit_count() < 2:
        return False
    return sum(tight & common == common for tight in every) == 2


def _rounded(rays: list[Row]) -> tuple[np.ndarray, float]:
    vertices = np.array([[float(Fraction(c, w)) for c in (x, y, z)] for x, y, z, w in rays])
    exact = all(
        Fraction(v) * w == c for row, ray in zip(vertices.tolist(), rays) for v, c, w in zip(row, ray, ray[3:] * 3)
    )
    if exact:
        return vertices, 0.0
    # Each coordinate is rounded to nearest: half an ulp, plus the smallest number there is.
    slop = float(np.sqrt(3) * np.spacing(np.abs(vertices).max()) / 2 * (1 + 1e-15))
    return vertices, slop


def _common_kernel(rows: list[Row]) -> np.ndarray:
    """A direction of space orthogonal to every normal, for rows of rank below four."""
    normals = [row[:3] for row in rows if any(row[:3])]
    for a, b in combinations(normals, 2):
        direction = cross(a, b)
        if any(direction):
            break
    else:
        a = normals[0]
        k = min(range(3), key=lambda i: abs(a[i]))
        unit = [int(i == k) for i in range(3)]
        direction = cross(a, unit)
    largest = max(abs(c) for c in direction)
    return np.array([float(Fraction(c, largest)) for c in direction])


def _beyond(rows: list[Row]) -> float:
    """An offset so large that a set which is not empty reaches into the cube of that size."""
    # Cramer's rule: a basic point's coordinates are quotients of 3 × 3 determinants of the rows.
    largest = max(abs(value) for row in rows for value in row)
    return float(min(6 * largest**3, 2**1000))
