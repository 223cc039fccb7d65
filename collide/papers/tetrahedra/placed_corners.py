"""Corners of two meshes in a common frame, as doubles in two parts, with bounds of the rounding of both parts.

Poses are taken as exact: a coordinate is a sum of three products and a shift. Two parts hold the sum exactly without a
rotation (lattices moved by a translation), and to 2⁻¹⁰¹ of the sum's terms otherwise.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.numerics.exact_vectors import cross, inner

#: Six errors of four terms, each below u of the terms' magnitudes, summed in doubles: 24 u² of these, u² = 2⁻¹⁰⁶.
_WIDE_ERROR = 2.0**-101
#: Where coordinates are at most 1: products of others are exact in two parts; rows of differences of others in kernels.
_SMALLEST_PRODUCT, _SMALLEST_PLAIN = 2.0**-900, 2.0**-280
#: Bounds are no smaller than this where anything might underflow.
_LEAST_ERROR = 2.0**-500
_SPLIT = 134217729.0  # 2²⁷ + 1


class PlacedCorners(NamedTuple):
    """The corners of A and of B in a common frame, divided by 2^exponent, so that the largest is about 1.

    A, B : (n, 6) leading and low parts.   plain : leading parts are the corners.   exact : both parts together are.
    error, wide_error : bounds, of leading parts and of both.   scale : six doubles' worth of the map's determinant to
        the world: its two parts and a bound; 1 for the world frame.   local : the frame is the meshes' own.
    """

    A: np.ndarray
    B: np.ndarray
    exponent: int
    plain: bool
    exact: bool
    error: float
    wide_error: float
    scale: tuple[float, float, float]
    local: bool


def place_corners(vertices_a: np.ndarray, vertices_b: np.ndarray, X_WA: np.ndarray, X_WB: np.ndarray) -> PlacedCorners:
    """Vertices (n, 3) and (m, 3) at poses (4, 4). Where these are the same bits, in the meshes' own frame."""
    local = bool((X_WA == X_WB).all())
    scale = (1.0, 0.0, 0.0)
    if local:
        determinant = abs(determinant_of(X_WA))
        high = float(determinant)
        low = float(determinant - Fraction(high))
        scale = (high, low, abs(low) * 2.0**-52)
        X_WA = X_WB = np.eye(4)
    largest = max(_reach(vertices_a, X_WA), _reach(vertices_b, X_WB))
    exponent = math.frexp(largest)[1] if largest else 0
    A, error_a = _in_two_parts(vertices_a, X_WA, exponent)
    B, error_b = _in_two_parts(vertices_b, X_WB, exponent)
    both = A, B
    exact = not error_a and not error_b
    plain = exact and not any(part[:, 3:].any() for part in both)
    plain = plain and not any(((part != 0) & (np.abs(part) < _SMALLEST_PLAIN)).any() for part in both)
    wide_error = max(error_a, error_b)
    error = max(float(np.abs(part[:, 3:]).max()) for part in both) * (1 + 2.0**-50) + wide_error
    if plain:
        error = wide_error = 0.0
    else:
        error, wide_error = max(error, _LEAST_ERROR), max(wide_error, _LEAST_ERROR)
    return PlacedCorners(A, B, exponent, plain, exact, error, wide_error, scale, local)


def determinant_of(X: np.ndarray) -> Fraction:
    """Of the upper left (3, 3) of a pose, exactly."""
    a, b, c = ([Fraction(x) for x in row] for row in X[:3, :3].tolist())
    return inner(a, cross(b, c))


def _reach(vertices: np.ndarray, X: np.ndarray) -> float:
    return float((np.abs(X[:3, :3]) @ np.abs(vertices).max(axis=0) + np.abs(X[:3, 3])).max())


def _in_two_parts(vertices: np.ndarray, X: np.ndarray, exponent: int) -> tuple[np.ndarray, float]:
    """((n, 6) two parts of every coordinate times 2^−exponent, bound of their error: 0 where they are exact)."""
    scaled, shift = np.ldexp(vertices, -exponent), np.ldexp(X[:3, 3], -exponent)
    is_exact = bool((np.ldexp(scaled, exponent) == vertices).all() and (np.ldexp(shift, exponent) == X[:3, 3]).all())
    parts = np.empty((len(vertices), 6))
    largest = 0.0
    for axis in range(3):
        total = np.full(len(vertices), shift[axis])
        low = np.zeros(len(vertices))
        size = np.abs(total)
        for k in range(3):
            factor = X[axis, k]
            product, rest = _product(scaled[:, k], factor)
            tiny = (product != 0) & (np.abs(product) < _SMALLEST_PRODUCT) & (abs(factor) != 1.0)
            is_exact = is_exact and not tiny.any() and not ((product == 0) & (scaled[:, k] != 0) & (factor != 0)).any()
            total, off = _sum(total, product)
            size += np.abs(product)
            for part in (off, rest):
                low, lost = _sum(low, part)
                is_exact = is_exact and not lost.any()
        parts[:, axis], parts[:, 3 + axis] = _sum(total, low)
        largest = max(largest, float(size.max()))
    return parts, 0.0 if is_exact else largest * _WIDE_ERROR


def _sum(a, b):
    """a + b as the rounded sum and its error."""
    total = a + b
    back = total - a
    return total, (a - (total - back)) + (b - back)


def _product(a: np.ndarray, b: float):
    """a b as the rounded product and its error (Dekker)."""
    product = a * b
    wide, wide_b = _SPLIT * a, _SPLIT * b
    high, high_b = wide - (wide - a), wide_b - (wide_b - b)
    low, low_b = a - high, b - high_b
    return product, low * low_b - (((product - high * high_b) - low * high_b) - high * low_b)


def map_between(X_WB: np.ndarray, X_WA: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(matrix (3, 3), shift (3,)) of A's frame in B's, each number exact before it is rounded; poses need no rotation.

    Raises ZeroDivisionError where the matrix of X_WB has no inverse.
    """
    b = [[Fraction(x) for x in row] for row in X_WB[:3].tolist()]
    determinant = determinant_of(X_WB)
    inverse = [
        [
            (b[(j + 1) % 3][(i + 1) % 3] * b[(j + 2) % 3][(i + 2) % 3]
             - b[(j + 1) % 3][(i + 2) % 3] * b[(j + 2) % 3][(i + 1) % 3]) / determinant
            for j in range(3)
        ]
        for i in range(3)
    ]
    a = [[Fraction(x) for x in row] for row in X_WA[:3].tolist()]
    shift = [a[k][3] - b[k][3] for k in range(3)]
    matrix = [[float(sum(inverse[i][k] * a[k][j] for k in range(3))) for j in range(3)] for i in range(3)]
    return np.array(matrix), np.array([float(sum(inverse[i][k] * shift[k] for k in range(3))) for i in range(3)])
