"""Points and half-spaces as homogeneous vectors: doubles at hand for every row, integers for the rows that need them.

A point v/v₀ (v₀ > 0) is the vector (v, v₀), a half-space {x : a·x ≤ b} the vector (a, b). A point lies in a half-space
where a·v − b·v₀ ≤ 0. The polar of a point is a half-space with the same numbers, and the other way round: a polar is
the same rows read in the other sense.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

#: Half a unit in the last place of 1.
_UNIT = 2.0**-53
#: From so many doubtful rows on, equal ones are looked for first.
_DEDUPLICATED_FROM = 64


class Violations(NamedTuple):
    """rows : indices of rows at which a linear function is proven negative.   values : it, in doubles, scaled."""

    rows: np.ndarray
    values: np.ndarray


class HomogeneousRows:
    """k homogeneous vectors of d + 1 numbers.

    Parameters
    ----------
    values : (k, d) float64
        The first d numbers of each row.
    last : (k,) float64, or float
        The last number of each row, or of all rows.
    integers : callable
        Row number → the row as d + 1 integers, exactly, but for a positive factor of the row.
    error : float
        No number of ``values`` and ``last`` differs from the exact one by more than this times itself.
    """

    __slots__ = ("_integers", "_known", "error", "last", "magnitude", "max_last", "n_exact", "n_read", "values")

    def __init__(
        self,
        values: np.ndarray,
        last: np.ndarray | float,
        integers: Callable[[int], Sequence[int]],
        error: float = 0.0,
    ):
        self.values, self.last, self.error = values, last, error
        self._integers = integers
        self._known: dict[int, Sequence[int]] = {}
        self.magnitude = max(float(values.max()), -float(values.min())) if values.size else 0.0
        self.max_last = float(np.abs(last).max()) if np.size(last) else 0.0
        self.n_read = self.n_exact = 0

    def __len__(self) -> int:
        return len(self.values)

    @property
    def dimension(self) -> int:
        """d."""
        return self.values.shape[1]

    def integers(self, row: int) -> Sequence[int]:
        """A row as d + 1 integers, but for a positive factor."""
        vector = self._known.get(row)
        if vector is None:
            vector = self._known[row] = self._integers(row)
        return vector

    def last_of(self, rows: np.ndarray) -> np.ndarray | float:
        """The last numbers of some rows."""
        return self.last[rows] if isinstance(self.last, np.ndarray) else self.last

    def products(self, vector: np.ndarray, last: float, rows: np.ndarray | None = None) -> np.ndarray:
        """(vector, last) · row of all rows, or of some, in doubles."""
        self.n_read += len(self.values) if rows is None else len(rows)
        products = (self.values if rows is None else self.values[rows]) @ vector
        products += (self.last if rows is None else self.last_of(rows)) * last
        return products

    def negative(self, function: Sequence[int], rows: np.ndarray | None = None) -> Violations:
        """The rows at which a linear function, given by d + 1 integers, is negative: proven, row by row.

        A product of d + 1 terms in doubles is off by at most (d + 2) units of the sum of its terms' magnitudes, in
        whatever order they are summed (Higham 2002, section 3.1); to that come the error of the rows and the rounding
        of the function. Rows nearer to zero are decided in integers.
        """
        bits = max(max(abs(number) for number in function).bit_length(), 1)
        scaled = [number / (1 << bits) for number in function]
        vector = np.array(scaled[:-1])
        values = self.products(vector, scaled[-1], rows)
        size = self.magnitude * float(np.abs(vector).sum()) + self.max_last * abs(scaled[-1])
        bound = ((self.dimension + 6) * _UNIT + self.error) * 1.01 * size + 1e-290
        near = np.flatnonzero(values <= bound)
        negative = values[near] < -bound
        doubtful = np.flatnonzero(~negative)
        if len(doubtful):
            places = near[doubtful] if rows is None else rows[near[doubtful]]
            negative[doubtful] = self._negative_exactly(function, places)
        at = near[negative]
        return Violations(at if rows is None else rows[at], values[at])

    def _negative_exactly(self, function: Sequence[int], rows: np.ndarray) -> np.ndarray:
        """Whether the function is negative, by integers, at each of some rows."""
        if len(rows) > _DEDUPLICATED_FROM and self.error == 0.0:
            whole = np.column_stack((self.values[rows], np.broadcast_to(self.last_of(rows), len(rows))))
            _, first, inverse = np.unique(whole, axis=0, return_index=True, return_inverse=True)
            if len(first) < len(rows):
                return self._signs(function, rows[first])[inverse.ravel()]
        return self._signs(function, rows)

    def _signs(self, function: Sequence[int], rows: np.ndarray) -> np.ndarray:
        self.n_exact += len(rows)
        return np.array([dot(function, self.integers(row)) < 0 for row in rows.tolist()], dtype=bool)


def dot(a: Sequence[int], b: Sequence[int]) -> int:
    """The inner product of two vectors of integers."""
    return sum(x * y for x, y in zip(a, b))


def as_integers(numbers: Sequence[float]) -> tuple[list[int], int]:
    """Doubles as integers over one power of two: (numerators, denominator)."""
    ratios = [number.as_integer_ratio() for number in numbers]
    denominator = max(ratio[1] for ratio in ratios)
    return [numerator * (denominator // below) for numerator, below in ratios], denominator
