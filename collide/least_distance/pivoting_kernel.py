"""Lemke's method in doubles, in a kernel: w = M z + q, w ≥ 0, z ≥ 0, w·z = 0 with M positive semidefinite.

A dictionary of n rows and n + 2 columns: basic variable + Σ column·nonbasic variable = right-hand side. Variables are
numbered as in `complementary_pivoting.py`: w₀ … wₙ₋₁, z₀ … zₙ₋₁, and the artificial one, 2n.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64

#: A column's entry below this, relative to the largest, is taken for zero.
_PIVOT_TOLERANCE = 1e-11
#: Ratios this near to each other are taken for equal.
_TIE = 1e-14
#: `pivot_to_solution` came to no end.
UNCLEAR = -1


@kernel
def begin_dictionary(table, basic, nonbasic, n):
    """The dictionary of w = q + M z + artificial, but for −M and q, which the caller writes: −M[i, k] to
    table[i (n + 2) + k], q[i] to table[i (n + 2) + n + 1]."""
    for i in range(n):
        table[i * (n + 2) + n] = -1.0
        basic[i] = i
        nonbasic[i] = n + i
    nonbasic[n] = 2 * n


@kernel
def pivot_to_solution(table, basic, nonbasic, n, max_pivots):
    """How many exchanges led to a complementary basis; UNCLEAR where doubles came to no end."""
    width = n + 2
    row = 0
    for i in range(1, n):
        if table[i * width + n + 1] < table[row * width + n + 1]:
            row = i
    if table[row * width + n + 1] >= 0.0:
        return 0
    column = n
    for n_pivots in range(1, max_pivots + 1):
        _exchange(table, basic, nonbasic, n, row, column)
        leaving = nonbasic[column]
        if leaving == 2 * n:
            return n_pivots
        entering = leaving + n if leaving < n else leaving - n
        for k in range(n + 1):
            if nonbasic[k] == entering:
                column = k
        row = _leaving_row(table, basic, n, column)
        if row < 0:
            return UNCLEAR
    return UNCLEAR


@kernel
def _exchange(table, basic, nonbasic, n, row, column):
    """The basic variable of a row and the nonbasic one of a column change places."""
    width = n + 2
    at = row * width
    inverse = 1.0 / table[at + column]
    for k in range(width):
        table[at + k] *= inverse
    table[at + column] = inverse
    for i in range(n):
        if i != row:
            other_at = i * width
            factor = table[other_at + column]
            if factor != 0.0:
                for k in range(width):
                    table[other_at + k] -= factor * table[at + k]
                table[other_at + column] = -factor * inverse
    basic[row], nonbasic[column] = nonbasic[column], basic[row]


@kernel
def _leaving_row(table, basic, n, column):
    """The row of the least ratio; among ties the artificial variable's, else the row of the largest pivot. −1: no row.
    """
    width = n + 2
    steepest = 0.0
    for i in range(n):
        steepest = max(steepest, abs(table[i * width + column]))
    least = math.inf
    for i in range(n):
        slope = table[i * width + column]
        if slope > _PIVOT_TOLERANCE * steepest:
            least = min(least, table[i * width + n + 1] / slope)
    row = -1
    for i in range(n):
        slope = table[i * width + column]
        if slope > _PIVOT_TOLERANCE * steepest and table[i * width + n + 1] / slope <= least + _TIE:
            if basic[i] == 2 * n:
                return i
            if row < 0 or slope > table[row * width + column]:
                row = i
    return row


@entry("int64(int64, int64, int64, int64, int64)")
def solve_complementarity(M_at, q_at, n, max_pivots, work_at):
    """`pivot_to_solution` of a problem in arrays.

    M_at, q_at : addresses of M (n, n) and q (n,); afterwards q holds z.   work_at : address of n (n + 2) + 2 n + 1
    words: the dictionary, and afterwards the basic variables, as integers, in the n words behind it.
    """
    M = view_f64(M_at, n * n)
    q = view_f64(q_at, n)
    table = view_f64(work_at, n * (n + 2))
    basic = view_i64(work_at + 8 * n * (n + 2), n)
    nonbasic = view_i64(work_at + 8 * n * (n + 3), n + 1)
    begin_dictionary(table, basic, nonbasic, n)
    for i in range(n):
        for k in range(n):
            table[i * (n + 2) + k] = -M[i * n + k]
        table[i * (n + 2) + n + 1] = q[i]
    n_pivots = pivot_to_solution(table, basic, nonbasic, n, max_pivots)
    for i in range(n):
        q[i] = 0.0
    for i in range(n):
        if n <= basic[i] < 2 * n:
            q[basic[i] - n] = table[i * (n + 2) + n + 1]
    return n_pivots
