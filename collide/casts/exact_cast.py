"""Where a cast of polytopes first touches, in exact numbers: a linear program of four rows, with no tolerance.

A + t d meets B for the least t ≥ 0 with Σ μ (a − b) + t d = 0, Σ μ = 1, μ ≥ 0, over all pairs of vertices (a, b). The
simplex method prices them by support mappings, so that a round costs a look at every vertex, not at every pair. Ties of
the ratio test are broken lexicographically (G. Dantzig, A. Orden and P. Wolfe, "The generalized simplex method", 1955):
no basis comes twice, and it ends. Artificial variables that begin the basis cost infinitely more than t.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from collide.numerics.exact_points import Point, inner, minus

_ARTIFICIAL, _T = -1, -2


class ExactCast(NamedTuple):
    """t : the least one, None where nothing is ever met.

    normal : an outward normal of A ⊖ B at the point of touching, exact and of any length; zeros where t is 0.
    weights : {(i, j): weight} of pairs of vertices that touch: Σ weight · a_i is where, before the motion.
    """

    t: Fraction | None
    normal: tuple[Fraction, Fraction, Fraction]
    weights: dict[tuple[int, int], Fraction]


def cast_exactly(A: Sequence[Point], B: Sequence[Point], d: Sequence[int]) -> ExactCast:
    """The first contact of the hull of A, moved along d, with the hull of B.

    A, B : integer points on one grid.   d : integers, in units of the same grid a unit of t; not 0.
    """
    basis: list = [_ARTIFICIAL] * 4
    inverse = [[Fraction(int(i == j)) for j in range(4)] for i in range(4)]
    x = [Fraction(0), Fraction(0), Fraction(0), Fraction(1)]
    while True:
        far, near = _prices(basis, inverse)
        column = _entering(A, B, d, far, near)
        if column is None:
            break
        name, entries = column
        pivot = [sum((row[k] * entries[k] for k in range(4)), Fraction(0)) for row in inverse]
        leaving = _leaving(x, inverse, pivot)
        _exchange(x, inverse, pivot, leaving)
        basis[leaving] = name
    if any(name == _ARTIFICIAL and value for name, value in zip(basis, x)):
        return ExactCast(None, (Fraction(0), Fraction(0), Fraction(0)), {})
    t = sum((value for name, value in zip(basis, x) if name == _T), Fraction(0))
    weights = {name: value for name, value in zip(basis, x) if isinstance(name, tuple) and value}
    # A pair w of vertices has near·(w, 1) ≤ 0 and d the price −1: w·n ≤ t times that of −d, where t is attained.
    return ExactCast(t, (near[0], near[1], near[2]) if t else (Fraction(0), Fraction(0), Fraction(0)), weights)


def _prices(basis: list, inverse: list[list[Fraction]]) -> tuple[list[Fraction], list[Fraction]]:
    """Prices of the four rows: for the sum of the artificial variables, and for t."""
    zero = Fraction(0)
    far = [sum((inverse[i][k] for i in range(4) if basis[i] == _ARTIFICIAL), zero) for k in range(4)]
    near = [sum((inverse[i][k] for i in range(4) if basis[i] == _T), zero) for k in range(4)]
    return far, near


def _entering(A, B, d, far, near):
    """(name, column) of a variable that makes the sums less, the artificial one first; None at the optimum."""
    artificial, direction = _whole(far), (far[0], far[1], far[2])
    i, value_a = _highest(A, artificial)
    j, value_b = _highest([(-b[0], -b[1], -b[2]) for b in B], artificial)
    gain = value_a[0] + value_b[0] + artificial[3]
    if gain > 0:
        return (i, j), (*minus(A[i], B[j]), 1)
    price_of_t = inner(direction, d)
    if price_of_t > 0 or (price_of_t == 0 and inner((near[0], near[1], near[2]), d) > 1):
        return _T, (*d, 0)
    if gain < 0:
        return None
    time = _whole(near)
    tied_a = [k for k, a in enumerate(A) if inner(artificial, a) == value_a[0]]
    tied_b = [k for k, b in enumerate(B) if -inner(artificial, b) == value_b[0]]
    i = max(tied_a, key=lambda k: inner(time, A[k]))
    j = min(tied_b, key=lambda k: inner(time, B[k]))
    if inner(time, minus(A[i], B[j])) + time[3] > 0:
        return (i, j), (*minus(A[i], B[j]), 1)
    return None


def _whole(prices: list[Fraction]) -> list[int]:
    """The same ratios in integers."""
    scale = 1
    for price in prices:
        scale = scale * price.denominator // _gcd(scale, price.denominator)
    return [int(price * scale) for price in prices]


def _gcd(a: int, b: int) -> int:
    while b:
        a, b = b, a % b
    return a


def _highest(points, direction) -> tuple[int, tuple[int]]:
    values = [inner(direction, p) for p in points]
    k = max(range(len(values)), key=values.__getitem__)
    return k, (values[k],)


def _leaving(x: list[Fraction], inverse: list[list[Fraction]], pivot: list[Fraction]) -> int:
    """The row that leaves: the lexicographically least of (x, inverse) over the pivot, where that is positive."""
    rows = [k for k in range(4) if pivot[k] > 0]
    return min(rows, key=lambda k: [x[k] / pivot[k], *(entry / pivot[k] for entry in inverse[k])])


def _exchange(x: list[Fraction], inverse: list[list[Fraction]], pivot: list[Fraction], leaving: int) -> None:
    x[leaving] /= pivot[leaving]
    inverse[leaving] = [entry / pivot[leaving] for entry in inverse[leaving]]
    for k in range(4):
        if k != leaving and pivot[k]:
            x[k] -= pivot[k] * x[leaving]
            inverse[k] = [entry - pivot[k] * of_leaving for entry, of_leaving in zip(inverse[k], inverse[leaving])]
