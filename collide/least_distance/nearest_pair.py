"""The nearest points of the hull of points and the intersection of half-spaces: doubles propose, integers decide.

The smallest |y − x| with y = Σ λᵢ pᵢ (λ ≥ 0, Σ λ = 1) and a_j·x ≤ b_j is a convex quadratic program. Its conditions of
Karush, Kuhn and Tucker: u = y − x = Σ μ_j a_j with μ ≥ 0; μ_j > 0 only where a_j·x = b_j; u·pᵢ ≥ θ, and λᵢ > 0 only
where u·pᵢ = θ. They are a linear complementarity problem, solved by Lemke's method over a working set of some dozens of
rows. The rows most violated by its answer join the set, until no row is violated. No row leaves the working set, so the
search ends. u = 0 is a common point; a ray of the method is a combination of contradicting half-spaces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import mul
from typing import NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.least_distance.complementary_pivoting import decide_basis
from collide.least_distance.homogeneous_rows import HomogeneousRows, Violations
from collide.least_distance.pair_proposals import Work, propose_from_samples
from collide.numerics.exact_vectors import dot

APART, MEETING, EMPTY = "apart", "meeting", "empty"
#: Rows that violate the answer are added by so many a round.
_N_ADDED = 2


class NearestPair(NamedTuple):
    """An exact answer for some points and half-spaces, in integers over one denominator.

    kind : APART, MEETING or EMPTY.
    points, weights : rows of points, and λ · denominator, > 0.
    halfspaces, multipliers : rows of half-spaces, and μ · denominator, > 0.
    y, x, u : the point of the hull, the one of the half-spaces, and y − x, each times the denominator.
    plane : d + 1 integers; negative at points p with u·p < θ, the least u·p of all points.
    """

    kind: str
    points: list[int]
    weights: list[int]
    halfspaces: list[int]
    multipliers: list[int]
    y: list[int]
    x: list[int]
    u: list[int]
    plane: list[int]
    denominator: int

    @property
    def corner(self) -> list[int]:
        """Negative at half-spaces that do not hold x."""
        return [*(-number for number in self.x), self.denominator]


def nearest_pair(
    points: HomogeneousRows,
    halfspaces: HomogeneousRows,
    work: Work,
    point_rows: np.ndarray | None = None,
    halfspace_rows: np.ndarray | None = None,
    start: tuple[list[int], list[int]] | None = None,
) -> NearestPair:
    """The nearest pair of CH(points) and FH(halfspaces), exactly.

    Parameters
    ----------
    points, halfspaces : HomogeneousRows
        n ≥ 1 points, m ≥ 0 half-spaces in R^d.
    work : Work
        Counters and limit.
    point_rows, halfspace_rows : integer arrays, optional
        Only these rows; all by default.
    start : two lists of rows, optional
        Points and half-spaces to begin with.

    Returns
    -------
    NearestPair
        Checked against every row by proven signs.

    Raises
    ------
    UnsupportedQuery
        Where more rows were read than ``work`` allows.
    """
    first = 0 if point_rows is None else int(point_rows[0])
    working_points, working_halfspaces = ([first], []) if start is None else (list(start[0]) or [first], list(start[1]))
    proposal = propose_from_samples(
        points, halfspaces, work, point_rows, halfspace_rows, working_points, working_halfspaces
    )
    pair, working_points, working_halfspaces = None, proposal.points, proposal.halfspaces
    if proposal.is_settled:
        pair = settle_basis(points, halfspaces, working_points, working_halfspaces)
    return finish_exactly(
        pair, points, halfspaces, work, point_rows, halfspace_rows, working_points, working_halfspaces
    )


def finish_exactly(
    pair: NearestPair | None,
    points: HomogeneousRows,
    halfspaces: HomogeneousRows,
    work: Work,
    point_rows: np.ndarray | None,
    halfspace_rows: np.ndarray | None,
    working_points: list[int],
    working_halfspaces: list[int],
) -> NearestPair:
    """The nearest pair of all rows, starting from a pair of working sets, or without a pair: sets grow until no row is
    violated.

    Parameters and errors as in `nearest_pair`; ``pair`` is exact for the rows ``working_points`` and
    ``working_halfspaces``.
    """
    while True:
        if pair is not None:
            if pair.kind == EMPTY:
                return pair
            if not _add_violated(
                pair, points, halfspaces, point_rows, halfspace_rows, working_points, working_halfspaces, work
            ):
                return pair
        pair = _solve_in_integers(points, halfspaces, working_points, working_halfspaces, work)


def _add_violated(pair, points, halfspaces, point_rows, halfspace_rows, working_points, working_halfspaces, work):
    """Add the rows most violated by an exact answer to the working sets; False where no row is violated."""
    work.add("exact_rounds")
    violated = halfspaces.negative(pair.corner, halfspace_rows)
    _extend(working_halfspaces, violated)
    n_violated = len(violated.rows)
    if pair.kind == APART:
        violated = points.negative(pair.plane, point_rows)
        _extend(working_points, violated)
        n_violated += len(violated.rows)
    work.check(points, halfspaces)
    return n_violated > 0


def _extend(working: list[int], violated: Violations) -> None:
    """Add the rows that are violated most."""
    rows = violated.rows
    if len(rows) > _N_ADDED:
        rows = rows[np.argpartition(violated.values, _N_ADDED)[:_N_ADDED]]
    working.extend(row for row in rows.tolist() if row not in working)


# --- integers ---------------------------------------------------------------------------------------------------------


def settle_basis(
    points: HomogeneousRows, halfspaces: HomogeneousRows, point_rows: list[int], halfspace_rows: list[int]
) -> NearestPair | None:
    """The exact solution with these rows in the basis; None where the basis is singular or a weight or multiplier
    negative.

    The solution is the nearest pair of the rows of the basis; other rows are not looked at. With y = p₀ + Σ λᵢ eᵢ, eᵢ
    the edges from p₀, the multipliers μ and the weights λ are unknown: a_j·(p₀ + Σ λᵢ eᵢ − Σ μ_k a_k) = b_j and Σ μ_j
    a_j·eᵢ = 0. O((s + t)³) operations of integers.
    """
    d = points.dimension
    v, unit = _over_one_denominator([points.integers(row) for row in point_rows], d)
    a = [halfspaces.integers(row) for row in halfspace_rows]
    base, t = v[0], len(a)
    edges = [[x - y for x, y in zip(point, base)] for point in v[1:]]
    system = [
        [dot(a[j], a[k], d) for k in range(j, t)]
        + [-dot(a[j], edge, d) for edge in edges]
        + [dot(a[j], base, d) - unit * a[j][d]]
        for j in range(t)
    ] + [[0] * (len(edges) - i + 1) for i in range(len(edges))]
    solved = solve_symmetric(system)
    if solved is None:
        return None
    numerators, denominator = solved
    multipliers, weights = numerators[:t], numerators[t:]
    weights.insert(0, denominator - sum(weights))
    if min(weights) < 0 or min(multipliers, default=0) < 0:
        return None
    y = [denominator * place for place in base[:d]]
    for weight, edge in zip(weights[1:], edges):
        y = [total + weight * step for total, step in zip(y, edge)]
    u = [sum(map(mul, multipliers, along)) for along in zip(*a)][:d] or [0] * d
    of_points = [(row, unit * weight) for row, weight in zip(point_rows, weights) if weight]
    of_halfspaces = [(row, number) for row, number in zip(halfspace_rows, multipliers) if number]
    return NearestPair(
        APART if any(u) else MEETING, [row for row, _ in of_points], [weight for _, weight in of_points],
        [row for row, _ in of_halfspaces], [number for _, number in of_halfspaces], y,
        [p - q for p, q in zip(y, u)], u, [unit * number for number in u] + [-dot(u, base)], unit * denominator,
    )


def _over_one_denominator(vectors: list[Sequence[int]], d: int) -> tuple[list[Sequence[int]], int]:
    """Points as integers over the least common denominator, and that."""
    unit = math.lcm(*(vector[d] for vector in vectors))
    return [
        vector if vector[d] == unit else [number * (unit // vector[d]) for number in vector] for vector in vectors
    ], unit


def solve_symmetric(rows: list[list[int]]) -> tuple[list[int], int] | None:
    """The solution of symmetric equations: (numerators, denominator > 0); None where a leading minor is 0.

    Row k holds the coefficients k … n − 1 and the right-hand side. Fraction-free elimination (Bareiss 1968), of the
    upper half alone. No leading minor is 0 where the matrix is not singular, a positive definite block stands first and
    a block of zeros last.
    """
    n, previous = len(rows), 1
    for k, line in enumerate(rows):
        pivot = line[0]
        if pivot == 0:
            return None
        for i in range(k + 1, n):
            factor = line[i - k]
            rows[i] = [(pivot * x - factor * y) // previous for x, y in zip(rows[i], line[i - k :])]
        previous = pivot
    solution: list[int] = []
    for k in range(n - 1, -1, -1):
        pivot, *coefficients, right = rows[k]
        solution.insert(0, (previous * right - dot(coefficients, solution)) // pivot)
    return (solution, previous) if previous > 0 else ([-number for number in solution], -previous)


def _solve_in_integers(points, halfspaces, working_points, working_halfspaces, work: Work) -> NearestPair:
    """The nearest pair of the rows of working sets, by Lemke's method in integers."""
    work.add("exact_programs")
    v = [points.integers(row) for row in working_points]
    a = [halfspaces.integers(row) for row in working_halfspaces]
    d, n_points, n_halfspaces = points.dimension, len(v), len(a)
    base, size = v[0], n_points + n_halfspaces
    edges = [[point[k] * base[d] - base[k] * point[d] for k in range(d)] for point in v[1:]]
    spans = [point[d] * base[d] for point in v[1:]]
    M, q = [], []
    for edge, span in zip(edges, spans):
        M.append([0] * (n_points - 1) + [span] + [dot(edge, normal, d) for normal in a])
        q.append(0)
    M.append([-span for span in spans] + [0] * (n_halfspaces + 1))
    q.append(1)
    for normal in a:
        M.append(
            [-base[d] * dot(edge, normal, d) for edge in edges]
            + [0] + [base[d] * dot(normal, beside, d) for beside in a]
        )
        q.append(normal[d] * base[d] - dot(normal, base, d))
    basis, _ = decide_basis(M, q)
    work.add("exact_pivots", basis.n_pivots)
    if basis.ray is not None:
        return _contradiction(a, working_halfspaces, basis.ray[n_points:], d)
    is_basic = set(basis.variables)
    rows = [k for k in range(n_points) if (k + size - 1 if k else n_points - 1) in is_basic]
    pair = settle_basis(
        points, halfspaces, [working_points[k] for k in rows],
        [working_halfspaces[k] for k in range(n_halfspaces) if size + n_points + k in is_basic],
    )
    if pair is None:
        raise UnsupportedQuery("meets: a complementary basis without a solution, which no basis is")
    return pair


def _contradiction(a, working_halfspaces, multipliers: list[int], d: int) -> NearestPair:
    """Half-spaces of which a combination says 0 ≤ a negative number."""
    positive = [k for k, multiplier in enumerate(multipliers) if multiplier]
    normal = [sum(multipliers[k] * a[k][axis] for k in positive) for axis in range(d + 1)]
    if any(normal[:d]) or normal[d] >= 0 or min(multipliers) < 0:
        raise UnsupportedQuery("meets: a ray that contradicts nothing, which Lemke's method does not end on")
    zero = [0] * d
    return NearestPair(
        EMPTY, [], [], [working_halfspaces[k] for k in positive], [multipliers[k] for k in positive],
        zero, zero, zero, [*zero, 0], 1,
    )
