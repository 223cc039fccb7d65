"""Where a cast of polytopes first touches, in exact numbers: a linear program of four rows, with no tolerance.

A + t d first meets B at the least t ≥ 0 with Σ μ (a − b) + t d = 0, Σ μ = 1, μ ≥ 0, over all pairs of vertices (a, b).
The simplex method prices the pairs by support mappings: a round costs a look at every vertex, not at every pair.
Ties of the ratio test are broken lexicographically (G. Dantzig, A. Orden and P. Wolfe, "The generalized simplex
method", 1955): no basis comes twice, so the method ends. Artificial variables of the first basis cost infinitely more
than t.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from collide.numerics.exact_points import PlacedPoints, Point, opposite
from collide.numerics.exact_vectors import inner, minus

_ARTIFICIAL, _T = -1, -2
#: Of so many vertices doubles choose those of which exact numbers are made; all are made of fewer.
_MIN_BY_DOUBLES = 64


class ExactCast(NamedTuple):
    """t : of the first contact, None where A never meets B.

    normal : an outward normal of A ⊖ B at the point of touching, exact and of any length; zeros where t is 0.
    weights : {(i, j): weight} of pairs of vertices: Σ weight · a_i is A's point of contact, before the motion.
    """

    t: Fraction | None
    normal: tuple[Fraction, Fraction, Fraction]
    weights: dict[tuple[int, int], Fraction]


def corners_of(points: Sequence[Point]) -> Sequence[Point]:
    """Points in the form quickest for `cast_exactly`: few as integers; many as given, made into integers when asked
    for."""
    return points if len(points) >= _MIN_BY_DOUBLES else list(points)


class _Basis(NamedTuple):
    """A basis of the program: all entries are integers over ``denominator[0]``, which is positive.

    names : of the four basic variables: _ARTIFICIAL, _T, or a pair of vertices.
    rows : four of five, the inverse of the basis and the value of the variable.
    """

    names: list
    rows: list[list[int]]
    denominator: list[int]


def cast_exactly(A: Sequence[Point], B: Sequence[Point], d: Sequence[int]) -> ExactCast:
    """The first contact of the hull of A, moved along d, with the hull of B.

    A, B : integer points on one grid; of `PlacedPoints` doubles rule out most.   d : integers, in units of the same
        grid a unit of t; not 0.
    """
    basis = _Basis([_ARTIFICIAL] * 4, [[int(i == j) for j in range(4)] + [int(i == 3)] for i in range(4)], [1])
    while True:
        far, near = _prices(basis, _ARTIFICIAL), _prices(basis, _T)
        column = _entering(A, B, d, far, near, basis.denominator[0])
        if column is None:
            break
        name, entries = column
        pivots = [sum(row[k] * entries[k] for k in range(4)) for row in basis.rows]
        _exchange(basis, pivots, _leaving(basis.rows, pivots), name)
    values = [Fraction(row[4], basis.denominator[0]) for row in basis.rows]
    zero = Fraction(0), Fraction(0), Fraction(0)
    if any(name == _ARTIFICIAL and value for name, value in zip(basis.names, values)):
        return ExactCast(None, zero, {})
    t = sum((value for name, value in zip(basis.names, values) if name == _T), Fraction(0))
    weights = {name: value for name, value in zip(basis.names, values) if isinstance(name, tuple) and value}
    return ExactCast(t, _outward(A, B, far, near) if t else zero, weights)


def _outward(A, B, far: list[int], near: list[int]) -> tuple[Fraction, Fraction, Fraction]:
    """A normal of a plane through the point of touching with all of A ⊖ B behind.

    The optimum has n · (a − b) + n₃ ≤ 0 of all pairs for the prices n = M far + near, M beyond all numbers; where the
    cast grazes, an artificial variable stays in the basis at 0, far is not 0, and near alone bounds nothing. A power of
    two is large enough for M: pairs with far · (a − b) + far₃ = 0 have it of near, all others have it from some M on.
    """
    factor = int(any(far))
    while True:
        *n, shift = (factor * x + y for x, y in zip(far, near))
        direction = n[0], n[1], n[2]
        if shift <= _lowest(A, opposite(direction))[0] + _lowest(B, direction)[0]:
            return Fraction(n[0]), Fraction(n[1]), Fraction(n[2])
        factor *= 2


def _prices(basis: _Basis, name: int) -> list[int]:
    """Prices of the four rows where the variables of a name cost 1, and no others."""
    return [sum(row[k] for of, row in zip(basis.names, basis.rows) if of == name) for k in range(4)]


def _entering(A, B, d, far: list[int], near: list[int], unit: int):
    """(name, column) of a variable to lower the cost, Σ of artificial variables before t; None at the optimum."""
    n = far[0], far[1], far[2]
    (least_a, lowest_a), (least_b, lowest_b) = _lowest(A, opposite(n)), _lowest(B, n)
    gain = far[3] - least_a - least_b
    if gain > 0:
        i, j = lowest_a[0], lowest_b[0]
        return (i, j), (*minus(A[i], B[j]), 1)
    time = near[0], near[1], near[2]
    price_of_t = inner(n, d)
    if price_of_t > 0 or (price_of_t == 0 and inner(time, d) > unit):
        return _T, (*d, 0)
    if gain < 0:
        return None
    i, j = _lowest(A, opposite(time), lowest_a)[1][0], _lowest(B, time, lowest_b)[1][0]
    if inner(time, minus(A[i], B[j])) + near[3] > 0:
        return (i, j), (*minus(A[i], B[j]), 1)
    return None


def _lowest(points: Sequence[Point], n: Point, some: Sequence[int] | None = None) -> tuple[int, Sequence[int]]:
    """(least product with n of points, or of some of them; the numbers of all points of this product, ascending)."""
    if not any(n):
        return 0, range(len(points)) if some is None else some
    if isinstance(points, PlacedPoints) and (some is None or len(some) == len(points)):
        some = points.lowest_along(n)
    numbers = range(len(points)) if some is None else some
    heights = [inner(n, points[k]) for k in numbers]
    least = min(heights)
    return least, [k for k, height in zip(numbers, heights) if height == least]


def _leaving(rows: list[list[int]], pivots: list[int]) -> int:
    """Row to leave the basis: the lexicographically least (value, inverse) / pivot among positive pivots."""
    best = -1
    for k in range(4):
        if pivots[k] > 0 and (best < 0 or _is_before(rows[k], pivots[k], rows[best], pivots[best])):
            best = k
    return best


def _is_before(row: list[int], pivot: int, best: list[int], pivot_of_best: int) -> bool:
    for column in (4, 0, 1, 2, 3):
        difference = row[column] * pivot_of_best - best[column] * pivot
        if difference:
            return difference < 0
    return False


def _exchange(basis: _Basis, pivots: list[int], leaving: int, name) -> None:
    """A pivot in integers, without a gcd: E. H. Bareiss 1968; J. Edmonds 1967."""
    rows, pivot, before = basis.rows, pivots[leaving], basis.denominator[0]
    for k in range(4):
        if k != leaving:
            rows[k] = [(x * pivot - pivots[k] * y) // before for x, y in zip(rows[k], rows[leaving])]
    basis.denominator[0] = pivot
    basis.names[leaving] = name
