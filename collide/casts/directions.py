"""Directions scaled by powers of two to lengths within kernels' range, and t scaled back."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import entry, view_f64, view_i64

#: The largest component of a direction stays within these; its others are 0 or at least this part of the largest.
SHORTEST, LONGEST = 1e-100, 1e100
MIN_RATIO = 2.0**-500


class Directions(NamedTuple):
    """Directions as kernels take them.

    vectors : (n, 3), the largest component of each at least ½ and below 1.
    exponents : (n,) int64: those given are vectors · 2^exponents.
    """

    vectors: np.ndarray
    exponents: np.ndarray

    def repeated(self, n: int) -> Directions:
        """n directions, from a single direction or n."""
        if len(self.vectors) == n:
            return self
        return Directions(
            np.ascontiguousarray(np.broadcast_to(self.vectors, (n, 3))),
            np.ascontiguousarray(np.broadcast_to(self.exponents, (n,))),
        )

    def limits(self, limit: float) -> np.ndarray:
        """(n,) a limit of t in units of the vectors."""
        with np.errstate(over="ignore", under="ignore"):
            return np.ldexp(limit, self.exponents)

    def t_of(self, t: np.ndarray) -> np.ndarray:
        """t (n, …) in units of the vectors, in those of the directions given."""
        with np.errstate(over="ignore", under="ignore"):
            return np.ldexp(t, -self.exponents.reshape(-1, *[1] * (t.ndim - 1)))


@entry("int64(int64, int64, int64, int64)")
def scale_directions(values_at, n, vectors_at, exponents_at):
    """Write the vectors and exponents of n finite directions; returns n, or the number of the first bad direction."""
    values, vectors, exponents = view_f64(values_at, 3 * n), view_f64(vectors_at, 3 * n), view_i64(exponents_at, n)
    for k in range(n):
        size = 0.0
        for i in range(3 * k, 3 * k + 3):
            size = max(size, abs(values[i]))
        if not SHORTEST <= size <= LONGEST:
            return k
        exponent = int(math.frexp(size)[1])
        exponents[k] = exponent
        for i in range(3 * k, 3 * k + 3):
            vectors[i] = math.ldexp(values[i], -exponent)
            if vectors[i] != 0.0 and abs(values[i]) < MIN_RATIO * size:
                return k
    return n
