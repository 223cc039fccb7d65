"""Volume, area, centroid and moments of what facets enclose, exact in integers and rounded once.

Of a tetrahedron between the origin and a facet a, b, c, with D = a · (b × c) and s = a + b + c: six times the volume is
D, the integral of x is D s / 24, and of x xᵀ it is D (s sᵀ + a aᵀ + b bᵀ + c cᵀ) / 120.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

#: Bits behind the point of square roots at first, and at most.
_BITS, _MAX_BITS = 96, 1 << 13


class Moments(NamedTuple):
    """Integrals over the points enclosed by facets, counted as often as the facets wind, exact.

    volume : [m³].   first : three, of x, y, z [m⁴].   second : of x xᵀ, three rows of three [m⁵].
    """

    volume: Fraction
    first: tuple[Fraction, ...]
    second: tuple[tuple[Fraction, ...], ...]


def moments(vertices: np.ndarray, corners: np.ndarray) -> Moments:
    """The moments of a closed surface.   vertices : (n, 3) [m].   corners : (f, 3). Some 10 µs a facet."""
    a, b, c, unit = _corners(vertices, corners)
    six = _determinants(a, b, c)
    s = a + b + c
    second = [[int((six * (s[:, i] * s[:, j] + a[:, i] * a[:, j] + b[:, i] * b[:, j] + c[:, i] * c[:, j])).sum())
               for j in range(3)] for i in range(3)]
    first = [int((six * s[:, i]).sum()) for i in range(3)]
    return Moments(
        int(six.sum()) * unit**3 / 6, tuple(x * unit**4 / 24 for x in first),
        tuple(tuple(x * unit**5 / 120 for x in row) for row in second),
    )


def volume(vertices: np.ndarray, corners: np.ndarray) -> float:
    """What facets enclose [m³], rounded once. Some microseconds a facet."""
    return rounded(exact_volume(vertices, corners))


def exact_volume(vertices: np.ndarray, corners: np.ndarray) -> Fraction:
    """What facets enclose [m³]."""
    a, b, c, unit = _corners(vertices, corners)
    return int(_determinants(a, b, c).sum()) * unit**3 / 6


def area(vertices: np.ndarray, corners: np.ndarray) -> float:
    """The sum of the areas of facets [m²], rounded once."""
    a, b, c, unit = _corners(vertices, corners)
    u, v = b - a, c - a
    n = [u[:, i - 2] * v[:, i - 1] - u[:, i - 1] * v[:, i - 2] for i in range(3)]
    squares = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).tolist()
    bits = _BITS
    while True:
        low, n_inexact = 0, 0
        for square in squares:
            root = math.isqrt(square << 2 * bits)
            low += root
            n_inexact += root * root != square << 2 * bits
        # Each root that is no integer is less than one unit higher.
        lower, upper = (rounded(x * unit**2 / (1 << bits + 1)) for x in (low, low + n_inexact))
        if lower == upper or bits > _MAX_BITS:
            return lower
        bits *= 2


def centroid(m: Moments) -> np.ndarray:
    """(3,) the mean of the points [m], each coordinate rounded once."""
    return np.array([rounded(x / m.volume) for x in m.first])


def inertia(m: Moments, density: float) -> np.ndarray:
    """(3, 3) about the centroid, along the axes of the frame [kg m²], each entry rounded once.   density : [kg/m³]."""
    C = [[m.second[i][j] - m.first[i] * m.first[j] / m.volume for j in range(3)] for i in range(3)]
    trace = C[0][0] + C[1][1] + C[2][2]
    rho = Fraction(density)
    return np.array([[rounded(rho * ((trace if i == j else 0) - C[i][j])) for j in range(3)] for i in range(3)])


def rounded(x: Fraction) -> float:
    """The nearest double; what is beyond all doubles is infinite."""
    try:
        return x.numerator / x.denominator
    except OverflowError:
        return math.inf if x > 0 else -math.inf


def _determinants(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """(f,) a · (b × c), in integers."""
    return (
        a[:, 0] * (b[:, 1] * c[:, 2] - b[:, 2] * c[:, 1]) + a[:, 1] * (b[:, 2] * c[:, 0] - b[:, 0] * c[:, 2])
        + a[:, 2] * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    )


def _corners(vertices: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, Fraction]:
    """(the three corners of facets, (f, 3) Python integers each, their unit)."""
    share, exponent = np.frexp(vertices)
    mantissa = (share * 2.0**53).astype(np.int64)
    lowest = int(exponent[mantissa != 0].min(initial=1 << 12))
    shifts = np.where(mantissa == 0, 0, exponent - lowest).astype(object)
    exact = mantissa.astype(object) << shifts
    a, b, c = (exact[corners[:, k]] for k in range(3))
    return a, b, c, Fraction(2) ** (lowest - 53)
