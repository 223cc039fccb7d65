"""Hyperplanes through points of integers: exactly, and as doubles with a bound on what they are off."""

from __future__ import annotations

from itertools import combinations

import numpy as np

#: Coordinates are integers of at most so many bits: doubles hold them and their differences exactly.
BITS = 48
_UNIT = 2.0**-53


def exact_planes(points: np.ndarray, facets: np.ndarray, within: np.ndarray) -> np.ndarray:
    """(f, d + 1) integers (a, b), a·x ≤ b, of the hyperplanes through d points each.

    Parameters
    ----------
    points : (n, d) float64
        Integers.
    facets : (f, d) integers
        Rows of points spanning a hyperplane.
    within : (d,) object
        d + 1 times a point strictly inside each half-space, integers.
    """
    d = points.shape[1]
    corners = whole_numbers(points[facets.ravel()]).reshape(len(facets), d, d)
    a = _normals(corners[:, 1:] - corners[:, :1])
    b = (a * corners[:, 0]).sum(axis=1)
    inward = (a * within).sum(axis=1) - (d + 1) * b
    flip = np.where(inward > 0, -1, 1).astype(object)
    return np.column_stack((a, b)) * flip[:, None]


def nearby_planes(points: np.ndarray, facets: np.ndarray, within: np.ndarray, reach: float):
    """The same in doubles: planes with max |a| = 1, error bounds of heights a·x − b, bool: planes with error 0.

    Parameters
    ----------
    points, facets, within
        As of `exact_planes`.
    reach : float
        max |x| over points and axes.

    Returns
    -------
    planes, errors, is_exact : (f, d + 1) float64, (f,) float64, (f,) bool
        Planes with an open side of ``within`` in doubles are replaced by the exact planes, rounded. For numbers so
        small that an error is less than half of the least height, heights within the error are 0.
    """
    d = points.shape[1]
    corners = points[facets]
    edges = corners[:, 1:] - corners[:, :1]  # exact: 49 bits
    a = _normals(edges)
    b = (a * corners[:, 0]).sum(axis=1)
    # The terms of all minors, without signs, sum to less than the product of the edges' 1-norms; a minor is off by
    # less than d²u of that, a height by those times 2·reach, and roundings.
    errors = (d + 2) ** 2 * 2.0 * _UNIT * np.abs(edges).sum(axis=2).prod(axis=1) * 2.0 * reach
    inward = a @ within.astype(np.float64) - (d + 1) * b
    a, b = np.where(inward[:, None] > 0.0, -a, a), np.where(inward > 0.0, -b, b)
    sizes = np.maximum(np.abs(a).max(axis=1), 1e-300)
    doubtful = np.flatnonzero(np.abs(inward) <= 2 * (d + 1) * errors)
    is_exact = errors < 0.25
    planes, errors = np.column_stack((a, b)) / sizes[:, None], np.where(is_exact, 0.5, errors) / sizes
    if len(doubtful):
        planes[doubtful] = rounded_planes(exact_planes(points, facets[doubtful], within))
        errors[doubtful], is_exact[doubtful] = rounding_errors(planes[doubtful], reach), False
    return planes, errors, is_exact


def rounding_errors(planes: np.ndarray, reach: float) -> np.ndarray:
    """What heights above `rounded_planes` may be off by in doubles, with the rounding of the planes themselves."""
    d = planes.shape[1] - 1
    return (d + 8) * _UNIT * (np.abs(planes[:, :d]).sum(axis=1) * reach + np.abs(planes[:, d]))


def _normals(edges: np.ndarray) -> np.ndarray:
    """The generalised cross product of d − 1 edges each, (f, d − 1, d) → (f, d)."""
    d = edges.shape[2]
    minors: dict[tuple[int, ...], np.ndarray] = {(k,): edges[:, 0, k] for k in range(d)}
    for row in range(1, d - 1):  # Laplace along rows; columns are kept by which of them a minor has
        larger: dict[tuple[int, ...], np.ndarray] = {}
        for columns in combinations(range(d), row + 1):
            total = edges[:, row, columns[0]] * minors[columns[1:]] * (1 if row % 2 == 0 else -1)
            for place, column in enumerate(columns[1:], 1):
                term = edges[:, row, column] * minors[columns[:place] + columns[place + 1 :]]
                total = total + term if (row + place) % 2 == 0 else total - term
            larger[columns] = total
        minors = larger
    every = tuple(range(d))
    return np.stack([minors[every[:k] + every[k + 1 :]] * (-1) ** k for k in range(d)], axis=1)


def rounded_planes(exact: np.ndarray) -> np.ndarray:
    """Planes of integers as doubles with max |a| = 1; each number off by at most two units in its last place."""
    d = exact.shape[1] - 1
    bits = max((int(number).bit_length() for number in exact.ravel()), default=0)
    if bits > 1000:
        exact = exact >> (bits - 1000) if bits - 1000 < 53 else exact // (1 << (bits - 1000))
    planes = exact.astype(np.float64)
    return planes / np.abs(planes[:, :d]).max(axis=1)[:, None]


def whole_numbers(points: np.ndarray) -> np.ndarray:
    """Doubles that are integers, as Python's."""
    return points.astype(np.int64).astype(object)
