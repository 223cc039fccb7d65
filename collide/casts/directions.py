"""Directions as callers hand them in, checked, and scaled to a length that kernels can work with."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide import argument_checks as checks
from collide.errors import InvalidArgument

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


def vectors(caller: str, name: str, values) -> tuple[np.ndarray, bool]:
    """((n, 3) finite float64, whether a single vector was handed in). Raises InvalidArgument."""
    array = checks.array(f"{caller}: {name}", values, "(3,) or (N, 3)", InvalidArgument)
    if array.ndim not in (1, 2) or array.shape[-1] != 3:
        raise InvalidArgument(f"{caller}: {name} must be (3,) or (N, 3), got {array.shape}")
    rows = np.ascontiguousarray(array.reshape(-1, 3))
    refuse_rows(caller, name, rows, ~np.isfinite(rows).all(axis=1), "has entries that are not finite")
    return rows, array.ndim == 1


def refuse_rows(caller: str, name: str, rows: np.ndarray, bad: np.ndarray, complaint: str) -> None:
    """Raises InvalidArgument naming the first bad row, where there is one."""
    if bad.any():
        k = int(np.argmax(bad))
        raise InvalidArgument(f"{caller}: {name}[{k}] {complaint}, got {rows[k].tolist()}")


def checked_directions(caller: str, name: str, values, thing: str) -> tuple[Directions, bool]:
    """(directions, whether a single one was handed in). Raises InvalidArgument.

    thing : "a ray", for messages.
    """
    given, single = vectors(caller, name, values)
    sizes = np.abs(given).max(axis=1)
    refuse_rows(caller, name, given, sizes == 0.0, f"has length 0: {thing} needs a direction")
    low, high = _DIRECTIONS
    complaint = f"has no component within [{low:g}, {high:g}]"
    refuse_rows(caller, name, given, (sizes < low) | (sizes > high), complaint)
    exponents = np.frexp(sizes)[1].astype(np.int64)
    scaled = np.ldexp(given, -exponents[:, None])
    thin = (scaled != 0.0) & (np.abs(scaled) < _MIN_RATIO)
    complaint = "has components that differ by more than 2^500; make them 0"
    refuse_rows(caller, name, scaled, thin.any(axis=1), complaint)
    return Directions(scaled, exponents), single
