"""Where the points of one body are, seen from another, exactly: two affine maps as given, and integers."""

from __future__ import annotations

from fractions import Fraction
from math import lcm

import numpy as np
from numpy.typing import ArrayLike

from collide.base.argument_checks import array
from collide.errors import InvalidPose

#: Magnitudes of entries.
_LARGEST = 1e50

Rows = list[list[Fraction]]


def affine_map(name: str, X: ArrayLike | None, d: int) -> Rows:
    """A homogeneous matrix as fractions, entry by entry as given; ``None`` is the identity. Raises InvalidPose."""
    if X is None:
        return [[Fraction(int(i == k)) for k in range(d + 1)] for i in range(d + 1)]
    read = array(name, X, f"({d + 1}, {d + 1})", InvalidPose)
    if read.shape != (d + 1, d + 1) or not (np.abs(read) <= _LARGEST).all():
        raise InvalidPose(f"{name} must be a finite ({d + 1}, {d + 1}) matrix within ±{_LARGEST:g}, got {read.shape}")
    if read[d, d] != 1.0 or read[d, :d].any():
        raise InvalidPose(f"{name} must end in the row (0, …, 0, 1), got {read[d].tolist()}")
    return [[Fraction(x) for x in row] for row in read.tolist()]


def inverse(name: str, X: Rows) -> Rows:
    """The inverse map. Raises InvalidPose for a singular map."""
    n = len(X)
    table = [[*row, *(Fraction(int(i == k)) for k in range(n))] for i, row in enumerate(X)]
    for k in range(n):
        pivot = next((i for i in range(k, n) if table[i][k]), None)
        if pivot is None:
            raise InvalidPose(f"{name} has determinant 0: it flattens the body and has no inverse")
        table[k], table[pivot] = table[pivot], table[k]
        table[k] = [x / table[k][k] for x in table[k]]
        for i in range(n):
            if i != k and table[i][k]:
                table[i] = [x - table[i][k] * y for x, y in zip(table[i], table[k])]
    return [row[n:] for row in table]


def product(X: Rows, Y: Rows) -> Rows:
    """X Y."""
    return [[sum((x * y[k] for x, y in zip(row, Y)), Fraction(0)) for k in range(len(Y))] for row in X]


def homogeneous_integers(X: Rows) -> list[list[int]]:
    """A map as integers, times one positive number."""
    common = lcm(*(x.denominator for row in X for x in row))
    return [[int(x * common) for x in row] for row in X]


def as_doubles(X: Rows) -> np.ndarray:
    """A map, each entry rounded once."""
    return np.array([[float(x) for x in row] for row in X])
