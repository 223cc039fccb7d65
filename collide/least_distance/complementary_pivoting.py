"""Lemke's method for linear complementarity problems, in doubles to propose and in integers to decide.

Given M and q: w = M z + q, w ≥ 0, z ≥ 0, w·z = 0. Where M is positive semidefinite (as of every convex quadratic
program) the method ends at a solution, or on a ray, a certificate that no w, z ≥ 0 exist (Cottle, Pang and Stone 1992,
The linear complementarity problem, theorem 4.4.12).

Variables are numbered: w₀ … wₙ₋₁, z₀ … zₙ₋₁, and the artificial variable, 2n.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.kernels import address_of
from collide.least_distance.pivoting_kernel import UNCLEAR, solve_complementarity


class Basis(NamedTuple):
    """The end of the method.

    variables : (n,) the basic variable of each row.   values : theirs.
    ray : None at a solution; else z of a ray: n numbers ≥ 0, in the arithmetic of the method.
    n_pivots : exchanges of a variable.
    """

    variables: list[int]
    values: list
    ray: list | None
    n_pivots: int


def propose_solution(M: np.ndarray, q: np.ndarray, max_pivots: int) -> np.ndarray | None:
    """z in doubles; None where doubles came to no end.

    Parameters
    ----------
    M : (n, n) float64
        Positive semidefinite.
    q : (n,) float64
        The right-hand side.
    max_pivots : int
        Give up after so many.
    """
    n, M, z = len(q), np.ascontiguousarray(M), np.array(q)
    work = np.empty(n * (n + 4) + 1)
    n_pivots = solve_complementarity(address_of(M), address_of(z), n, max_pivots, address_of(work))
    return None if n_pivots == UNCLEAR else z


def decide_basis(M: list[list[int]], q: list[int]) -> tuple[Basis, int]:
    """A complementary basis in integers, whatever the degeneracy: (basis, denominator > 0 of its values and ray).

    Pivots are fraction-free (Edmonds 1967), ties are broken lexicographically, so that no basis comes twice.

    Parameters
    ----------
    M : n rows of n integers
        Positive semidefinite but for positive factors of rows and columns.
    q : n integers
        The right-hand side.

    Raises
    ------
    UnsupportedQuery
        Where M is of another kind: never for two convex sets.
    """
    n = len(q)
    table = np.empty((n, 2 * n + 2), dtype=object)
    table[:, :n] = [[int(i == k) for k in range(n)] for i in range(n)]
    table[:, n : 2 * n] = [[-entry for entry in line] for line in M]
    table[:, 2 * n] = -1
    table[:, -1] = q
    variables, denominator = list(range(n)), 1
    row = min(range(n), key=lambda k: (q[k], -k))
    if q[row] >= 0:
        return Basis(variables, list(q), None, 0), 1
    entering, n_pivots = 2 * n, 0
    while True:
        pivot = table[row, entering]
        line, column = table[row].copy(), table[:, entering].copy()
        table = (table * pivot - column[:, None] * line) // denominator
        table[row] = line
        denominator = pivot
        if denominator < 0:
            table, denominator = -table, -denominator
        leaving, variables[row] = variables[row], entering
        n_pivots += 1
        if leaving == 2 * n:
            return Basis(variables, table[:, -1].tolist(), None, n_pivots), denominator
        entering = leaving + n if leaving < n else leaving - n
        leaving_row = _lexicographic_row(table, variables, entering)
        if leaving_row is None:
            return Basis(variables, table[:, -1].tolist(), _ray(table, variables, entering, denominator), n_pivots), (
                denominator
            )
        row = leaving_row


def _lexicographic_row(table: np.ndarray, variables: list[int], entering: int) -> int | None:
    """The row of the lexicographically least (right-hand side, inverse of the basis) over the entering column.

    The artificial variable leaves wherever it may: then the basis is complementary.
    """
    n = len(variables)
    best = None
    for row in range(n):
        if table[row, entering] > 0 and (best is None or _is_less(table, row, best, entering, n)):
            best = row
    artificial = variables.index(2 * n)
    if best is None or table[artificial, entering] <= 0:
        return best
    level = table[artificial, -1] * table[best, entering] == table[best, -1] * table[artificial, entering]
    return artificial if level else best


def _is_less(table: np.ndarray, a: int, b: int, entering: int, n: int) -> bool:
    for place in (2 * n + 1, *range(n)):
        difference = table[a, place] * table[b, entering] - table[b, place] * table[a, entering]
        if difference:
            return difference < 0
    raise UnsupportedQuery("two rows of a basis are proportional, which no basis has")


def _ray(table: np.ndarray, variables: list[int], entering: int, denominator: int) -> list[int]:
    """z along the ray on which the entering variable grows."""
    n = len(variables)
    ray = [0] * (2 * n + 1)
    ray[entering] = denominator
    for row, variable in enumerate(variables):
        ray[variable] = -table[row, entering]
    return ray[n : 2 * n]
