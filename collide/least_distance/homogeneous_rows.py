"""Points and half-spaces as homogeneous vectors: doubles at hand for every row, integers for the rows that need them.

A point v/v₀ (v₀ > 0) is the vector (v, v₀), a half-space {x : a·x ≤ b} the vector (a, b). A point lies in a half-space
where a·v − b·v₀ ≤ 0. The polar of a point is a half-space with the same numbers, and the other way round: a polar is
the same rows read in the other sense.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.least_distance.row_products import BLOCK, RECORD, products_below
from collide.numerics.exact_vectors import dot

#: Half a unit in the last place of 1.
_UNIT = 2.0**-53
#: So many rows near a plane have room at first.
_N_BELOW = 1024
#: From so many doubtful rows on, equal ones are looked for first.
_DEDUPLICATED_FROM = 64


class Violations(NamedTuple):
    """rows : indices of rows at which a linear function is negative.   values : its values at these rows, in doubles,
    scaled.
    """

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
    magnitude : float, optional
        The largest magnitude in ``values``, where it is known.
    """

    __slots__ = (
        "_integers", "_known", "_record", "error", "last", "magnitude", "max_last", "n_exact", "n_read", "values",
    )

    def __init__(
        self,
        values: np.ndarray,
        last: np.ndarray | float,
        integers: Callable[[int], Sequence[int]],
        error: float = 0.0,
        magnitude: float | None = None,
    ):
        self.values, self.error = np.ascontiguousarray(values), error
        self.last = np.ascontiguousarray(last) if isinstance(last, np.ndarray) else last
        self._integers = integers
        self._known: dict[int, Sequence[int]] = {}
        if magnitude is None:
            magnitude = max(float(values.max()), -float(values.min())) if values.size else 0.0
        self.magnitude = magnitude
        self.max_last = float(np.abs(last).max()) if np.size(last) else 0.0
        self.n_read = self.n_exact = 0
        self._record: tuple[np.ndarray, np.ndarray] | None = None

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

    def record(self, rows: np.ndarray | None = None) -> int:
        """Address of what kernels are told of all rows, or of some: `row_products.py`. Good until the next call."""
        if self._record is None:
            lasts = self.last if isinstance(self.last, np.ndarray) else np.array([self.last])
            words = np.array([address_of(self.values), address_of(lasts), len(lasts) > 1, len(self), 0, 0, 0, 0])
            words[RECORD - 2 :].view(np.float64)[:] = self.magnitude, self.max_last
            self._record = words, lasts
        words = self._record[0]
        if rows is None:
            words[4:6] = 0
        else:
            words[4:6] = address_of(rows) or 1, len(rows)  # 0 would mean all
        return address_of(words)

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
        bits = max(max(map(abs, function)).bit_length(), 1)
        vector = np.array([number / (1 << bits) for number in function])
        size = self.magnitude * float(np.abs(vector[:-1]).sum()) + self.max_last * abs(float(vector[-1]))
        bound = ((self.dimension + 6) * _UNIT + self.error) * 1.01 * size + 1e-290
        near = self.below(vector, bound, rows)
        is_negative = near.values < -bound
        doubtful = np.flatnonzero(~is_negative)
        if len(doubtful):
            is_negative[doubtful] = self._negative_exactly(function, near.rows[doubtful])
        return Violations(near.rows[is_negative], near.values[is_negative])

    def below(self, vector: np.ndarray, bound: float, rows: np.ndarray | None = None) -> Violations:
        """The rows, of all or of some, whose product in doubles with d + 1 numbers is ≤ a bound."""
        self.n_read += len(self) if rows is None else len(rows)
        record, capacity = self.record(rows), _N_BELOW
        while True:
            at, values = np.empty(capacity, dtype=np.int64), np.empty(capacity + BLOCK)
            count = products_below(
                record, self.dimension, address_of(vector), bound, address_of(at), address_of(values), capacity
            )
            if count <= capacity:
                return Violations(at[:count], values[:count])
            capacity = count

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


def as_integers(numbers: Sequence[float]) -> tuple[list[int], int]:
    """Doubles as integers over one power of two: (numerators, denominator)."""
    ratios = [number.as_integer_ratio() for number in numbers]
    denominator = max(ratio[1] for ratio in ratios)
    return [numerator * (denominator // below) for numerator, below in ratios], denominator
