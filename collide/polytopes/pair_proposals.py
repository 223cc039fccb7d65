"""The nearest pair of points and half-spaces as doubles see it: nothing is proven here.

A linear complementarity problem of a working set (see `nearest_pair`), to which the rows that its answer violates most
are added until there is none; of many rows a sample first.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.polytopes.complementary_pivoting import propose_basis
from collide.polytopes.homogeneous_rows import HomogeneousRows

#: Doubles no longer tell a violation from rounding below this, relative to the size of the products.
_NOISE = 1e-14
#: Rounds in doubles before integers take over.
_MAX_ROUNDS = 200
#: So many rows are searched first, where there are _LEAST_STEP times as many: passes over all rows are then few.
_N_SAMPLED, _LEAST_STEP = 1024, 4

@dataclass
class Work:
    """What a query did, and the most it may do.

    Attributes
    ----------
    limit : int or None
        The most rows that may be read; None for no limit.
    counters : dict
        What is counted: rounds, pivots, calls, ….
    seen : list of HomogeneousRows
        Whose rows were read.
    """

    limit: int | None = None
    counters: dict[str, int] = field(default_factory=dict)
    seen: list[HomogeneousRows] = field(default_factory=list)

    def add(self, name: str, count: int = 1) -> None:
        """Count something."""
        self.counters[name] = self.counters.get(name, 0) + count

    def raise_to(self, name: str, value: int) -> None:
        """Keep the largest value of something."""
        self.counters[name] = max(self.counters.get(name, 0), value)

    def check(self, *rows: HomogeneousRows) -> None:
        """Raise UnsupportedQuery where more rows than the limit have been read, of these and of all seen before."""
        self.seen.extend(r for r in rows if not any(r is known for known in self.seen))
        n_read = sum(r.n_read for r in self.seen)
        if self.limit is not None and n_read > self.limit:
            raise UnsupportedQuery(
                f"meets: {n_read} rows were read, more than work={self.limit} allows; raise it or leave it out"
            )


class Proposal(NamedTuple):
    """points, halfspaces : rows of a basis that doubles take for optimal.   y, u : the nearest pair in doubles.

    weights, multipliers : y of the points, of sum 1, and u of the half-spaces, all ≥ 0.
    """

    points: list[int]
    halfspaces: list[int]
    y: np.ndarray
    u: np.ndarray
    weights: np.ndarray
    multipliers: np.ndarray


def propose_from_samples(
    points, halfspaces, work: Work, point_rows, halfspace_rows, working_points, working_halfspaces
):
    """What doubles take for the nearest pair, with few passes over many rows.

    As of Clarkson (1995): an even sample is searched; what violates its answer, in the mean at most d·n/r rows of n for
    a sample of r, joins it; and so on. A pass each time, and no more of them than the answer has rows.
    """
    some_points, some_halfspaces = _some(len(points), point_rows), _some(len(halfspaces), halfspace_rows)
    for _ in range(_MAX_ROUNDS):
        proposal = propose_pair(
            points, halfspaces, work, some_points, some_halfspaces, working_points, working_halfspaces
        )  # fmt: skip
        if proposal is None or (some_points is point_rows and some_halfspaces is halfspace_rows):
            return proposal
        working_points, working_halfspaces = list(proposal.points), list(proposal.halfspaces)
        n_violated = 0
        if some_halfspaces is not None and some_halfspaces is not halfspace_rows:
            violated = _violated(halfspaces, proposal.u - proposal.y, 1.0, halfspace_rows)
            some_halfspaces, n_violated = np.concatenate((some_halfspaces, violated)), len(violated)
        is_apart = float(np.abs(proposal.u).max()) > _NOISE * points.magnitude
        if is_apart and some_points is not None and some_points is not point_rows:
            values = points.values[proposal.points] @ proposal.u
            lasts = points.last_of(np.array(proposal.points))
            violated = _violated(points, proposal.u, -float((values / lasts).min()), point_rows)
            some_points, n_violated = np.concatenate((some_points, violated)), n_violated + len(violated)
        if n_violated == 0:
            return proposal
    return None


def _some(count: int, rows: np.ndarray | None) -> np.ndarray | None:
    """Some of many rows, evenly spread over them; few rows as they are."""
    step = (count if rows is None else len(rows)) // _N_SAMPLED
    if step < _LEAST_STEP:
        return rows
    return np.arange(0, count, step) if rows is None else rows[::step]


def _violated(rows: HomogeneousRows, vector: np.ndarray, last: float, subset: np.ndarray | None) -> np.ndarray:
    """The rows at which a function is negative, as far as doubles can tell; of very many those farthest from 0."""
    values = rows.products(vector, last, subset)
    at = np.flatnonzero(values < -_noise(rows, vector, last))
    if len(at) > 4 * _N_SAMPLED:
        at = at[np.argpartition(values[at], 4 * _N_SAMPLED)[: 4 * _N_SAMPLED]]
    return at if subset is None else subset[at]


def _noise(rows: HomogeneousRows, vector: np.ndarray, last: float) -> float:
    return _NOISE * (rows.magnitude * float(np.abs(vector).sum()) + rows.max_last * abs(last))


def propose_pair(
    points: HomogeneousRows,
    halfspaces: HomogeneousRows,
    work: Work,
    point_rows: np.ndarray | None,
    halfspace_rows: np.ndarray | None,
    working_points: list[int],
    working_halfspaces: list[int],
) -> Proposal | None:
    """What doubles take for the nearest pair, or None where they cannot tell. Working sets grow; nothing is proven."""
    with np.errstate(all="ignore"):  # what overflows is settled in integers
        for _ in range(_MAX_ROUNDS):
            work.add("rounds")
            p = points.values[working_points] / np.reshape(points.last_of(np.array(working_points)), (-1, 1))
            a, b = halfspaces.values[working_halfspaces], halfspaces.last_of(np.array(working_halfspaces, dtype=int))
            basis = _basis_in_doubles(p, a, np.broadcast_to(b, len(a)), work)
            if basis is None:
                return None
            weights, multipliers, active_points, active_halfspaces = basis
            u, y = multipliers @ a, weights @ p
            grown = _grow(halfspaces, u - y, 1.0, halfspace_rows, working_halfspaces)
            if float(np.abs(u).max()) > _NOISE * points.magnitude:
                grown |= _grow(points, u, -float((p @ u).min()), point_rows, working_points)
            work.check(points, halfspaces)
            if not grown:
                return Proposal(
                    [working_points[k] for k in active_points], [working_halfspaces[k] for k in active_halfspaces], y,
                    u, weights[active_points], multipliers[active_halfspaces],
                )  # fmt: skip
    return None


def _grow(rows: HomogeneousRows, vector: np.ndarray, last: float, subset, working: list[int]) -> bool:
    """Add the row with the least product to a working set, if doubles can tell that it is negative."""
    values = rows.products(vector, last, subset)
    k = int(np.argmin(values))
    if values[k] >= -_noise(rows, vector, last):
        return False
    row = k if subset is None else int(subset[k])
    if row in working:
        return False
    working.append(row)
    return True


def _basis_in_doubles(p: np.ndarray, a: np.ndarray, b: np.ndarray, work: Work):
    """(weights, multipliers, rows of p and of a in the basis) of the nearest pair of some rows; None where unclear."""
    n_points, n_halfspaces = len(p), len(a)
    if n_halfspaces == 0:
        weights = np.zeros(n_points)
        weights[0] = 1.0
        return weights, np.zeros(0), [0], []
    edges, size = p[1:] - p[0], n_points + n_halfspaces
    M, q = np.zeros((size, size)), np.empty(size)
    cross = edges @ a.T
    M[: n_points - 1, n_points - 1] = 1.0
    M[: n_points - 1, n_points:] = cross
    M[n_points - 1, : n_points - 1] = -1.0
    M[n_points:, : n_points - 1] = -cross.T
    M[n_points:, n_points:] = a @ a.T
    q[: n_points - 1], q[n_points - 1], q[n_points:] = 0.0, 1.0, b - a @ p[0]
    basis = propose_basis(M, q, 20 * size + 50)
    if basis is None:
        return None
    work.add("pivots", basis.n_pivots)
    z, is_basic = np.zeros(2 * size), np.zeros(2 * size, dtype=bool)
    z[basis.variables], is_basic[basis.variables] = basis.values, True
    edge_weights = np.maximum(z[size : size + n_points - 1], 0.0)
    weights = np.concatenate(([max(1.0 - edge_weights.sum(), 0.0)], edge_weights))
    active_points = [k + 1 for k in np.flatnonzero(is_basic[size : size + n_points - 1]).tolist()]
    if is_basic[n_points - 1]:
        active_points.insert(0, 0)
    return weights, np.maximum(z[size + n_points :], 0.0), active_points, np.flatnonzero(
        is_basic[size + n_points :]
    ).tolist()
