"""Whether the hull of points meets the intersection of half-spaces: a linear program in all points, in Fractions.

max Σ λ with λ ≥ 0, Σ λ ≤ 1 and Σ λᵢ (a_j·pᵢ − b_j) ≤ 0 for every half-space: 1 where they have a common point, else 0.
Solved by the simplex method in dictionary form, with Bland's rule; some milliseconds for 10 + 10 rows, a tenth of a
second for 30 + 30. Nothing of the engine is used.
"""

from __future__ import annotations

from fractions import Fraction


def have_common_point(points, normals, offsets) -> bool:
    """Whether CH(points) ∩ {x : normals·x ≤ offsets} is not empty; rows of doubles, integers or fractions."""
    p = [[Fraction(x) for x in row] for row in _rows(points)]
    a = [[Fraction(x) for x in row] for row in _rows(normals)]
    b = [Fraction(x) for x in _row(offsets)]
    excess = [[sum(x * y for x, y in zip(normal, point)) - offset for point in p] for normal, offset in zip(a, b)]
    return largest_sum(excess) == 1


def _rows(values):
    return [_row(row) for row in values]


def _row(row):
    return row.tolist() if hasattr(row, "tolist") else list(row)


def largest_sum(excess: list[list[Fraction]]) -> Fraction:
    """max Σ λ with excess·λ ≤ 0, Σ λ ≤ 1, λ ≥ 0."""
    n = len(excess[0])
    # each line: basic variable = right - Σ coefficients · nonbasic variables; the last line is the objective
    lines = [[Fraction(0), *row] for row in excess] + [[Fraction(1)] + [Fraction(1)] * n]
    objective = [Fraction(0)] + [Fraction(-1)] * n
    columns, basic = list(range(n)), list(range(n, n + len(lines)))
    while True:
        entering = min((k for k in range(n) if objective[k + 1] < 0), key=lambda k: columns[k], default=None)
        if entering is None:
            return objective[0]
        place = entering + 1
        leaving = min(
            (i for i in range(len(lines)) if lines[i][place] > 0),
            key=lambda i: (lines[i][0] / lines[i][place], basic[i]),
        )
        pivot = lines[leaving][place]
        line = [x / pivot for x in lines[leaving]]
        line[place] = 1 / pivot
        lines[leaving] = line
        for i, row in enumerate([*lines, objective]):
            if i != leaving and row[place]:
                factor = row[place]
                row[:] = [x - factor * y for x, y in zip(row, line)]
                row[place] = -factor / pivot
        columns[entering], basic[leaving] = basic[leaving], columns[entering]
