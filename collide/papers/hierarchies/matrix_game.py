"""Two constant-size polyhedra compared: CH(P*) against ρ0(Q*), by the value of a matrix game.

The value of min over x ∈ CH(P*) of max over z ∈ CH(Q*) of ⟨x, z⟩ is at most 1 exactly where some x of CH(P*) has
⟨x, q⟩ ≤ 1 for all q ∈ Q*, i.e. where CH(P*) and ρ0(Q*) meet; the value is above 1 exactly where some z of CH(Q*) has
⟨p, z⟩ > 1 for all p ∈ P*, i.e. where the plane ρ(z) separates them. So a single small linear program answers both
questions of a round of the walk, with the witness of either: Theorem 3.7 is its duality.

Solved by the simplex method on the condensed tableau (A. W. Tucker's), all in doubles: its outcome is a proposal.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.numerics.vec3 import dot, vec3_at

#: P* and Q* have at most so many points.
MAX_POINTS = 130
#: Doubles of workspace: the tableau, with a row and a column to spare.
TABLEAU = (MAX_POINTS + 1) * (MAX_POINTS + 1)
#: Integers of workspace: what stands in rows and columns.
LABELS = 2 * MAX_POINTS
#: Pivots before the game is given up.
_PIVOTS = 200
#: A column counts as improving when its price is below this; prices are of the order of one.
_MIN_PRICE = 1e-13

#: An x as deep in ρ0(Q*) as this is taken as it is; nearer to its boundary the best one is looked for.
DEEP = 0.4

#: Outcomes of a game: its value is at most 1, is more, or it could not be solved.
MEET, APART, UNSOLVED = range(3)


@kernel
def solve_game(P, n, Q, m, table, labels, x_weights, z_weights):
    """(MEET, APART or UNSOLVED, pivots, tests); weights of an x for MEET, of a z for APART.

    P, Q : three doubles a point, n and m of them.   x_weights, z_weights : n and m doubles, out.
    The x of MEET need not be the best one, see DEEP.
    """
    width = n + 1
    low = 1e300
    high = -1e300
    first = 0
    least = 1e300
    for a in range(n):
        top = -1e300
        for b in range(m):
            value = dot(vec3_at(P, 3 * a), vec3_at(Q, 3 * b))
            table[b * width + a] = value
            low = min(low, value)
            top = max(top, value)
        high = max(high, top)
        if top < least:
            least = top
            first = a
    for a in range(n):
        x_weights[a] = 0.0
    if least <= DEEP:  # one point alone
        x_weights[first] = 1.0
        return MEET, 0, n * m
    shift = 0.125 * (high - low) - low
    if not shift + low > 0.0:
        shift = 1.0 - low
    _fill(table, n, m, shift, labels)
    column = first
    for pivots in range(1, _PIVOTS + 1):
        row = _leaving(table, n, m, column, labels)
        if row < 0:
            return UNSOLVED, pivots, n * m
        _pivot(table, n, m, row, column)
        labels[row], labels[MAX_POINTS + column] = labels[MAX_POINTS + column], labels[row]
        total = table[m * width + n]
        if 1.0 - shift * total <= DEEP * total:  # 1 / total − shift ≤ DEEP
            break
        column = _entering(table, n, m)
        if column < 0:
            break
    else:
        return UNSOLVED, _PIVOTS, n * m
    if 1.0 - shift * total <= total:
        _read_x(table, n, m, labels, x_weights)
        return MEET, pivots, n * m
    total = 0.0
    for b in range(m):
        z_weights[b] = 0.0
    for a in range(n):
        if labels[MAX_POINTS + a] >= n:
            price = max(table[m * width + a], 0.0)
            z_weights[labels[MAX_POINTS + a] - n] = price
            total += price
    if not total > 0.0:
        return UNSOLVED, pivots, n * m
    for b in range(m):
        z_weights[b] /= total
    return APART, pivots, n * m


@kernel
def _read_x(table, n, m, labels, x_weights):
    total = 0.0
    for b in range(m):
        if labels[b] < n:
            x_weights[labels[b]] = max(table[b * (n + 1) + n], 0.0)
            total += x_weights[labels[b]]
    for b in range(m):
        if labels[b] < n:
            x_weights[labels[b]] /= total


@kernel
def _fill(table, n, m, shift, labels):
    """Columns 0 … n − 1 are the points of P*, rows 0 … m − 1 the slacks of those of Q*; all entries positive."""
    width = n + 1
    for b in range(m):
        for a in range(n):
            table[b * width + a] += shift
        table[b * width + n] = 1.0
        labels[b] = n + b
    for a in range(n):
        table[m * width + a] = -1.0
        labels[MAX_POINTS + a] = a
    table[m * width + n] = 0.0


@kernel
def _entering(table, n, m):
    """The column with the lowest price, −1 where none improves."""
    best = -1
    least = -_MIN_PRICE
    for a in range(n):
        price = table[m * (n + 1) + a]
        if price < least:
            least = price
            best = a
    return best


@kernel
def _leaving(table, n, m, column, labels):
    """The row that limits the column: least ratio, then smallest label."""
    width = n + 1
    best = -1
    least = 1e300
    for b in range(m):
        step = table[b * width + column]
        if step > 1e-14:
            ratio = table[b * width + n] / step
            if ratio < least or (ratio == least and best >= 0 and labels[b] < labels[best]):
                least = ratio
                best = b
    return best


@kernel
def _pivot(table, n, m, row, column):
    width = n + 1
    inverse = 1.0 / table[row * width + column]
    for a in range(n + 1):
        table[row * width + a] *= inverse
    table[row * width + column] = inverse
    for b in range(m + 1):
        if b != row:
            factor = table[b * width + column]
            if factor != 0.0:
                for a in range(n + 1):
                    table[b * width + a] -= factor * table[row * width + a]
                table[b * width + column] = -factor * inverse
