"""Differences, products and determinants of Python integers and fractions: nothing is rounded.

Judges have their own: `collide.papers.polytopes.verify_exclusion`, the validators of hulls and hierarchies, the exact
peer. With these a mistake would judge itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from operator import mul
from typing import TypeVar

#: What sums and products are exact of.
Exact = TypeVar("Exact", int, Fraction)


def minus(a: Sequence[Exact], b: Sequence[Exact]) -> tuple[Exact, Exact, Exact]:
    """The difference of two vectors of three."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def cross(a: Sequence[Exact], b: Sequence[Exact]) -> tuple[Exact, Exact, Exact]:
    """The cross product of two vectors of three."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def inner(a, b):
    """The inner product of two vectors of three."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def dot(a: Sequence[Exact], b: Sequence[Exact], count: int | None = None) -> Exact:
    """The inner product of two vectors of any length, or of their first ``count`` numbers."""
    return sum(map(mul, a, b if count is None else b[:count]))  # type: ignore[return-value]


def determinant(rows: Sequence[Sequence[int]]) -> int:
    """Of a matrix of integers, by fraction-free elimination (Bareiss 1968): O(n³) products; 1 of an empty matrix."""
    rows, sign, previous = [list(row) for row in rows], 1, 1
    for k in range(len(rows) - 1):
        pivot = next((i for i in range(k, len(rows)) if rows[i][k]), None)
        if pivot is None:
            return 0
        if pivot != k:
            rows[k], rows[pivot], sign = rows[pivot], rows[k], -sign
        for i in range(k + 1, len(rows)):
            rows[i] = [(x * rows[k][k] - y * rows[i][k]) // previous for x, y in zip(rows[i], rows[k])]
        previous = rows[k][k]
    return sign * rows[-1][-1] if rows else 1
