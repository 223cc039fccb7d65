"""Directions scaled by powers of two to lengths within kernels' range, and t scaled back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Directions(NamedTuple):
    """Directions as kernels take them.

    vectors : (n, 3), the largest component of each at least ½ and below 1.
    exponents : (n,) int64: those given are vectors · 2^exponents.
    """

    vectors: np.ndarray
    exponents: np.ndarray

    def repeated(self, n: int) -> Directions:
        """n directions, from a single direction or n."""
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
