"""The point of a small simplex that is nearest the origin, in Fractions: every subset of its corners, one by one."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations
from typing import NamedTuple


class Nearest(NamedTuple):
    """``square`` = |point|², ``point`` = Σ weights · corners."""

    square: Fraction
    point: tuple[Fraction, ...]
    weights: tuple[Fraction, ...]


def exact(points) -> list[tuple[Fraction, ...]]:
    """Rows of doubles, integers or fractions."""
    rows = [row.tolist() if hasattr(row, "tolist") else row for row in points]
    return [tuple(Fraction(x) for x in row) for row in rows]


def inner(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b)), Fraction(0))


def solved(rows: list[list[Fraction]], right: list[Fraction]) -> list[Fraction] | None:
    """The solution of a square system by Gauss and Jordan; None where it has none or many."""
    n = len(rows)
    table = [[*row, value] for row, value in zip(rows, right)]
    for k in range(n):
        pivot = next((i for i in range(k, n) if table[i][k]), None)
        if pivot is None:
            return None
        table[k], table[pivot] = table[pivot], table[k]
        table[k] = [x / table[k][k] for x in table[k]]
        for i in range(n):
            if i != k:
                table[i] = [x - table[i][k] * y for x, y in zip(table[i], table[k])]
    return [row[n] for row in table]


def nearest_to_origin(points) -> Nearest:
    """Of the hull of affinely dependent or independent points (n, 3), n small. The first of equals by number of
    corners."""
    corners = exact(points)
    best = None
    for count in range(1, min(len(corners), 4) + 1):
        for chosen in combinations(range(len(corners)), count):
            first, *others = (corners[k] for k in chosen)
            edges = [[x - y for x, y in zip(other, first)] for other in others]
            shares = solved([[inner(e, f) for f in edges] for e in edges], [-inner(first, e) for e in edges])
            if shares is None or min([*shares, 1 - sum(shares)]) < 0:
                continue
            weights = [Fraction(0)] * len(corners)
            for k, share in zip(chosen, [1 - sum(shares, Fraction(0)), *shares]):
                weights[k] = share
            point = tuple(sum((w * c[axis] for w, c in zip(weights, corners)), Fraction(0)) for axis in range(3))
            square = inner(point, point)
            if best is None or square < best.square:
                best = Nearest(square, point, tuple(weights))
    assert best is not None
    return best


def determinant(a, b, c) -> Fraction:
    """a · (b × c) of three exact vectors."""
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
