"""Motions of two bodies as arrays: poses at both ends, and angular velocities where they turn."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class Motions(NamedTuple):
    """n motions, checked: poses (n, 4, 4) or (1, 4, 4) of A and B at both ends; angular velocities (n, 3), (1, 3) or
    None."""

    X_WA0: np.ndarray
    X_WA1: np.ndarray
    X_WB0: np.ndarray
    X_WB1: np.ndarray
    omega_WA: np.ndarray | None
    omega_WB: np.ndarray | None

    def picked(self, some: np.ndarray) -> Motions:
        """Motions by their numbers; a single pose for all stays as given."""
        columns: list[Any] = [X if X is None or len(X) == 1 else np.ascontiguousarray(X[some]) for X in self]
        return Motions(*columns)

    def swapped(self) -> Motions:
        """Those of B and A."""
        return Motions(self.X_WB0, self.X_WB1, self.X_WA0, self.X_WA1, self.omega_WB, self.omega_WA)

    def exchanged(self, is_larger: np.ndarray, is_equal: np.ndarray) -> np.ndarray:
        """(n,) bool: motions to be worked on as those of B and A: where A's shape is the larger, or is equal and its
        poses are."""
        out = is_larger.copy()
        some = np.flatnonzero(is_equal)
        if len(some):
            of = self.picked(some).spread(len(some))
            a, b = (np.concatenate([X0, X1], axis=1).reshape(len(some), -1) for X0, X1 in (of[:2], of[2:4]))
            first = (a != b).argmax(axis=1)
            rows = np.arange(len(some))
            out[some] = a[rows, first] > b[rows, first]
        return out

    def spread(self, n: int) -> Motions:
        """The same with n of everything."""
        columns: list[Any] = [X if X is None else np.broadcast_to(X, (n, *X.shape[1:])) for X in self]
        return Motions(*columns)
