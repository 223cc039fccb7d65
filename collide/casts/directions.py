"""Directions as callers hand them in, checked, and scaled to a length that kernels can work with."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide import argument_checks as checks

#: The largest component of a direction stays within these; its others are 0 or at least this part of the largest.
_DIRECTIONS = (1e-100, 1e100)
_MIN_RATIO = 2.0**-500


class Directions(NamedTuple):
    """Directions as kernels take them.

    vectors : (n, 3), the largest component of each at least ½ and below 1.
    exponents : (n,) int64: those given are vectors · 2^exponents.
    """

    vectors: np.ndarray
    exponents: np.ndarray

    def repeated(self, n: int) -> Directions:
        """n of them, where there is one or n."""
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


def checked_directions(caller: str, name: str, values, thing: str) -> tuple[Directions, bool]:
    """(directions, whether a single one was handed in). Raises InvalidArgument.

    thing : "a ray", for messages.
    """
    values_read, single = checks.vectors(caller, name, values)
    sizes = np.abs(values_read).max(axis=1)
    checks.refuse_rows(caller, name, values_read, sizes == 0.0, f"has length 0: {thing} needs a direction")
    low, high = _DIRECTIONS
    complaint = f"has no component within [{low:g}, {high:g}]"
    checks.refuse_rows(caller, name, values_read, (sizes < low) | (sizes > high), complaint)
    exponents = np.frexp(sizes)[1].astype(np.int64)
    scaled = np.ldexp(values_read, -exponents[:, None])
    thin = (scaled != 0.0) & (np.abs(scaled) < _MIN_RATIO)
    complaint = "has components that differ by more than 2^500; make them 0"
    checks.refuse_rows(caller, name, scaled, thin.any(axis=1), complaint)
    return Directions(scaled, exponents), single
