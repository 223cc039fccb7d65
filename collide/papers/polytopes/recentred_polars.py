"""Points and half-spaces seen from a point inside all half-spaces, and their polars: the two spaces of ACIT.

With the origin o inside FH and outside CH, the polar of a half-space a·x ≤ b is the point a/b (b > 0), that of a point
p the half-space p·y ≥ 1 (Barba and Mulzer 2019, section 3.1). Which side a polar lies on is written into the row, so
that nothing has to be asked of subsets of rows, bounded or not: for avoiding points and o inside FH, FH may be
unbounded (CH of the polar points then does not hold o), since y·p ≥ 1 stays true when y grows.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers
from collide.least_distance.nearest_pair import MEETING, NearestPair
from collide.numerics.exact_vectors import dot

_UNIT = 2.0**-53
#: Offsets from a centre below this, relative to what they are a difference of, are computed in integers.
_CANCELLED = 2.0**-40


class Space(NamedTuple):
    """Points and half-spaces of one of the two spaces."""

    points: HomogeneousRows
    halfspaces: HomogeneousRows


class Centre(NamedTuple):
    """A point as integers over one denominator."""

    numerators: list[int]
    denominator: int


def recentred_spaces(
    points: HomogeneousRows, halfspaces: HomogeneousRows, centre: np.ndarray
) -> tuple[Space, Space, Centre] | None:
    """(primal, polar, centre) seen from a point, or ``None`` for a point not inside every half-space.

    The points of the polar have the rows of the half-spaces, and vice versa.

    Parameters
    ----------
    points, halfspaces : HomogeneousRows
        n points, m half-spaces.
    centre : (d,) float64
        Taken as exact.
    """
    exact = Centre(*as_integers(centre.tolist()))
    points.n_read += len(points)
    halfspaces.n_read += len(halfspaces)

    def point(row: int) -> list[int]:
        *v, v0 = points.integers(row)
        return [x * exact.denominator - c * v0 for x, c in zip(v, exact.numerators)] + [v0 * exact.denominator]

    def halfspace(row: int) -> list[int]:
        *a, b = halfspaces.integers(row)
        return [x * exact.denominator for x in a] + [b * exact.denominator - dot(a, exact.numerators)]

    offsets = _offsets(halfspaces, centre, halfspace)
    if offsets is None:
        return None
    values = points.values - centre
    primal = Space(
        HomogeneousRows(values, 1.0, point, 2 * _UNIT),
        HomogeneousRows(halfspaces.values, offsets, halfspace, 4 * _UNIT),
    )
    polar_points = HomogeneousRows(halfspaces.values / offsets[:, None], 1.0, halfspace, 8 * _UNIT)
    polar_halfspaces = HomogeneousRows(-values, -1.0, lambda row: [-number for number in point(row)], 2 * _UNIT)
    return primal, Space(polar_points, polar_halfspaces), exact


def _offsets(halfspaces: HomogeneousRows, centre: np.ndarray, exact_row) -> np.ndarray | None:
    """b − a·centre > 0 to two units in the last place, in double-doubles; ``None`` where any value is not > 0."""
    a, b = halfspaces.values, np.broadcast_to(halfspaces.last, len(halfspaces))
    high, low = b.copy(), np.zeros(len(b))
    size = np.abs(b)
    for k, c in enumerate(centre.tolist()):
        product, product_low = _two_product(a[:, k], -c)
        total = high + product
        part = total - high
        low += ((high - (total - part)) + (product - part)) + product_low
        high = total
        size = size + np.abs(product)
    offsets = high + low
    for row in np.flatnonzero(offsets <= _CANCELLED * size).tolist():
        *numbers, offset = exact_row(row)
        if offset <= 0:
            return None
        axis = int(np.argmax(np.abs(a[row])))  # the row's integers carry a factor
        offsets[row] = float(Fraction(offset, numbers[axis]) * Fraction(float(a[row, axis])))
    return offsets


def _two_product(a: np.ndarray, b: float) -> tuple[np.ndarray, np.ndarray]:
    """a·b as the unevaluated sum of two doubles (Dekker 1971)."""
    product = a * b
    split = 134217729.0
    a_high = a * split - (a * split - a)
    b_high = b * split - (b * split - b)
    a_low, b_low = a - a_high, b - b_high
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def pair_in_input(pair: NearestPair, centre: Centre) -> NearestPair:
    """A pair of the primal space, seen from the origin of the input."""
    c, unit = centre
    y, x, u = ([number * unit for number in vector] for vector in (pair.y, pair.x, pair.u))
    shift = [number * pair.denominator for number in c]
    return pair._replace(
        weights=[number * unit for number in pair.weights],
        multipliers=[number * unit * unit for number in pair.multipliers],
        y=[p + q for p, q in zip(y, shift)], x=[p + q for p, q in zip(x, shift)], u=u,
        plane=[*(number * unit for number in pair.plane[:-1]), pair.plane[-1] * unit - dot(pair.plane, c)],
        denominator=pair.denominator * unit,
    )


def common_point(points: HomogeneousRows, rows: list[int], weights: list[Fraction]) -> NearestPair:
    """Σ weights·points as the pair of two sets that meet; weights ≥ 0 of any sum > 0."""
    total = sum(weights)
    terms = [(row, weight / total) for row, weight in zip(rows, weights) if weight]
    vectors = [points.integers(row) for row, _ in terms]
    d = points.dimension
    place = [
        sum((weight * Fraction(v[k], v[d]) for (_, weight), v in zip(terms, vectors)), Fraction(0)) for k in range(d)
    ]
    denominator = math.lcm(*(number.denominator for number in (*place, *(weight for _, weight in terms))))
    y = [int(number * denominator) for number in place]
    return NearestPair(
        MEETING, [row for row, _ in terms], [int(weight * denominator) for _, weight in terms], [], [], y, list(y),
        [0] * d, [0] * (d + 1), denominator,
    )


def common_point_of_polar(pair: NearestPair, points: HomogeneousRows, polar: Space) -> NearestPair:
    """The point of CH in FH from the separation of the polars (theorem 3.6).

    u = Σ μᵢ (−pᵢ), so that Σ μᵢ pᵢ / Σ μᵢ is in CH; by y·u > x·u every half-space holds the point.
    """
    d = polar.halfspaces.dimension
    weights = [
        Fraction(multiplier * -polar.halfspaces.integers(row)[d])
        for row, multiplier in zip(pair.halfspaces, pair.multipliers)
    ]
    return common_point(points, pair.halfspaces, weights)
