"""Points under poses as Python integers on a common grid, for the few questions left open by doubles.

A double is a whole number times a power of two. So are the coordinates R v + t of a placed point, and all of a question
can be written as integers times one power of two: nothing is rounded.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator, Sequence
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
    rows, low = _rows_of(X, grid)
    return [tuple(a * x + b * y + c * z + t for a, b, c, t in rows) for x, y, z in points], low  # type: ignore[misc]


def _rows_of(X: np.ndarray, grid: int) -> tuple[list[tuple[int, int, int, int]], int]:
    """(rows of a pose (4, 4) that take integers times 2^grid to integers on another grid, the exponent of this)."""
    R, R_grid = integers(X[:3, :3])
    p, p_grid = integers(X[:3, 3])
    low = min(R_grid + grid, p_grid)
    R = [entry << (R_grid + grid - low) for entry in R]
    p = [entry << (p_grid - low) for entry in p]
    return [(R[3 * i], R[3 * i + 1], R[3 * i + 2], p[i]) for i in range(3)], low


class PlacedPoints(Sequence[Point]):
    """Points (k, 3) moved by poses (4, 4), one pose after the other, as integers on a common grid, each point computed
    when asked for: entries are taken as exact.

    grid : exponent: a point is its integers times 2^grid.
    """

    def __init__(self, points: np.ndarray, poses: Sequence[np.ndarray]):
        self._points, self._columns = points, np.ascontiguousarray(points.T)
        self._largest = np.abs(self._columns).max(axis=1)
        mantissas, exponents = np.frexp(self._columns)
        lowest = int(exponents.min(where=mantissas != 0.0, initial=2000)) - 53
        self._own_grid = self.grid = lowest if points.any() else 0
        # Rows (R | t) of what all poses do to integers on the points' own grid, to integers on this one.
        self._rows: list[tuple[int, ...]] = [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0)]
        for X in poses:
            rows, self.grid = _rows_of(X, self.grid)
            columns = list(zip(*self._rows))
            self._rows = [(*(inner(row, c) for c in columns[:3]), inner(row, columns[3]) + row[3]) for row in rows]

    def on_grid(self, grid: int) -> PlacedPoints:
        """The same on a grid that is no coarser."""
        finer = copy.copy(self)
        finer.grid = grid
        finer._rows = [tuple(entry << (self.grid - grid) for entry in row) for row in self._rows]
        return finer

    def minus(self, point: Point, w: int = 1) -> PlacedPoints:
        """The same times w > 0, seen from another point of their grid: w (p − point/w)."""
        seen = copy.copy(self)
        seen._rows = [(w * a, w * b, w * c, w * t - x) for (a, b, c, t), x in zip(self._rows, point)]
        return seen

    def __len__(self) -> int:
        return len(self._points)

    def __getitem__(self, k):
        return next(self._made(self._points[k].tolist()))

    def __iter__(self) -> Iterator[Point]:
        return self._made(self._points.ravel().tolist())

    def signs_along(self, v: Point) -> np.ndarray:
        """(k,) int8 signs of the products with v, 0 where doubles leave them open."""
        values, error, _ = self._products(v, sum(a * row[3] for a, row in zip(v, self._rows)))
        return (values > error).astype(np.int8) - (values < -error)

    def _products(self, v: Point, shift: int) -> tuple[np.ndarray, float, np.ndarray]:
        """((k,) R^T v · p + shift in doubles, of any unit, what none of them is farther off than, the digits of R^T v).

        R^T v is exact; its leading digits, the shift in their unit, three products and three sums are rounded, by 2^-53
        each: a value is off by less than 2^-50 of its |terms|, at most those of the largest coordinates. Where terms
        underflow 2^-1060 is more than they lose, where digits do 2^-1074 of the coordinates.
        """
        d = tuple(sum(a * row[column] for a, row in zip(v, self._rows)) for column in range(3))
        along: np.ndarray = np.array(leading_digits(d))  # type: ignore[arg-type]
        digits = max(map(int.bit_length, d))
        constant = rounded(Fraction(shift), self._own_grid - digits)[0]
        with np.errstate(over="ignore", invalid="ignore"):  # infinities and what is no number tell nothing
            (x, y, z), (a, b, c) = self._columns, along
            values = a * x + b * y + c * z + constant
            error = 2.0**-50 * ((np.abs(along) * self._largest).sum() + abs(constant))
            error += 2.0**-1060 + 2.0**-1074 * self._largest.sum()
        return values, float(error), along

    def _made(self, values: list[float]) -> Iterator[Point]:
        whole = [_on_grid(value, self._own_grid) for value in values]
        for x, y, z in zip(whole[0::3], whole[1::3], whole[2::3]):
            yield tuple(a * x + b * y + c * z + t for a, b, c, t in self._rows)  # type: ignore[misc]

    def first_along(self, v: Point) -> int:
        """The lowest row among the points with the least product with v: O(k) doubles, and integers of the candidates.
        """
        candidates, along = self._lowest_along(v)
        # Of points whose coordinates along R^T v are equal, as on a side of a box, the first stands for all.
        used = self._points[candidates][:, along != 0.0]
        _, first = np.unique(used, axis=0, return_index=True) if used.size else (None, np.zeros(1, dtype=np.int64))
        return min(candidates[np.sort(first)].tolist(), key=lambda k: inner(v, self[k]))

    def lowest_along(self, v: Point) -> list[int]:
        """Rows, ascending, of candidates for the least product with v, all minimisers among them: O(k)."""
        return self._lowest_along(v)[0].tolist()

    def _lowest_along(self, v: Point) -> tuple[np.ndarray, np.ndarray]:
        """(numbers, digits of R^T v). What exceeds the least product by over twice their error is not the least."""
        values, error, along = self._products(v, 0)
        return np.flatnonzero(~(values > values.min() + 2.0 * error)), along

    @property
    def reach(self) -> int:
        """An integer that no coordinate exceeds: |R v + t| ≤ |R| |v| + |t|, row by row."""
        largest = [_on_grid(value, self._own_grid) for value in self._largest.tolist()]
        return max(sum(abs(entry) * value for entry, value in zip(row, (*largest, 1))) for row in self._rows)


def _on_grid(value: float, grid: int) -> int:
    """A double as a multiple of 2^grid, if its value is a multiple."""
    whole, denominator = value.as_integer_ratio()
    shift = 1 - denominator.bit_length() - grid
    return whole << shift if shift >= 0 else whole >> -shift


def on_one_grid(*groups: tuple[list[Point], int]) -> tuple[list[list[Point]], int]:
    """The groups of `placed` on the finest of their grids, and its exponent."""
    low = min(grid for _, grid in groups)
    return [[(x << g, y << g, z << g) for x, y, z in points] for points, grid in groups for g in (grid - low,)], low


def opposite(vector: Point) -> Point:
    """The vector times −1."""
    return -vector[0], -vector[1], -vector[2]


def in_integers(vector: Sequence[Fraction]) -> Point:
    """A vector of doubles times the least power of two that makes integers of them."""
    denominator = max(c.denominator for c in vector)
    x, y, z = (int(c * denominator) for c in vector)
    return x, y, z


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
