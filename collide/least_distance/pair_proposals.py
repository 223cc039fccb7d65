"""The nearest pair of points and half-spaces as doubles see it: nothing is proven here.

A linear complementarity problem of a working set (see `nearest_pair`). The rows most violated by its answer join the
set, until no row is violated; of many rows a sample is searched first.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import local
from typing import NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.kernels import address_of
from collide.least_distance.homogeneous_rows import HomogeneousRows
from collide.least_distance.proposal_kernel import (
    FULL,
    HALFSPACES_READ,
    LISTS,
    MAX_D,
    N_BASIC_HALFSPACES,
    N_BASIC_POINTS,
    NOISE,
    ROUNDS,
    SETTLED,
    U,
    Y,
    n_doubles,
    n_integers,
    propose_rows,
)

#: Samples of one question before integers take over.
_MAX_SAMPLES = 200
#: So many rows are searched first, where there are _LEAST_STEP times as many: passes over all rows are then few.
_N_SAMPLED, _LEAST_STEP = 1024, 4
#: Of those that violate an answer so many join the sample.
_MAX_ADDED = 4096
#: Working sets of so many rows have room at first.
_CAPACITY = 40


@dataclass
class Work:
    """Work done by a query, and its limit.

    Attributes
    ----------
    limit : int, optional
        The most rows to be read; no limit if None.
    counters : dict
        Numbers of rounds, pivots, calls, …, by name.
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

    def remaining(self, *rows: HomogeneousRows) -> int:
        """How many more rows may be read, of these and of all seen before; −1 for no limit."""
        if self.limit is None:
            return -1
        self._see(rows)
        return max(self.limit - sum(r.n_read for r in self.seen), 0)

    def _see(self, rows: tuple[HomogeneousRows, ...]) -> None:
        self.seen.extend(r for r in rows if not any(r is known for known in self.seen))

    def check(self, *rows: HomogeneousRows) -> None:
        """Raise UnsupportedQuery where more rows than the limit have been read, of these and of all seen before."""
        if self.limit is None:
            return
        self._see(rows)
        n_read = sum(r.n_read for r in self.seen)
        if n_read > self.limit:
            raise UnsupportedQuery(
                f"meets: {n_read} rows were read, more than work={self.limit} allows; raise it or leave it out"
            )


class Proposal(NamedTuple):
    """points, halfspaces : rows of a basis, optimal as far as doubles can tell.   y, u : the nearest pair in doubles.

    is_settled : False where doubles came to no end; the rows are then the rows of their last step.
    """

    points: list[int]
    halfspaces: list[int]
    y: np.ndarray
    u: np.ndarray
    is_settled: bool


def propose_from_samples(
    points, halfspaces, work: Work, point_rows, halfspace_rows, working_points, working_halfspaces
) -> Proposal:
    """What doubles take for the nearest pair, with few passes over many rows.

    As of Clarkson (1995): an even sample is searched; what violates its answer, in the mean at most d·n/r rows of n for
    a sample of r, joins it; and so on. A pass each time, and no more of them than the answer has rows.
    """
    some_points, some_halfspaces = _some(len(points), point_rows), _some(len(halfspaces), halfspace_rows)
    for _ in range(_MAX_SAMPLES):
        proposal = propose_pair(
            points, halfspaces, work, some_points, some_halfspaces, working_points, working_halfspaces
        )
        if not proposal.is_settled or (some_points is point_rows and some_halfspaces is halfspace_rows):
            return proposal
        working_points, working_halfspaces = list(proposal.points), list(proposal.halfspaces)
        n_violated = 0
        if some_halfspaces is not None and some_halfspaces is not halfspace_rows:
            violated = _violated(halfspaces, proposal.u - proposal.y, 1.0, halfspace_rows)
            some_halfspaces, n_violated = np.concatenate((some_halfspaces, violated)), len(violated)
        is_apart = float(np.abs(proposal.u).max()) > NOISE * points.magnitude
        if is_apart and some_points is not None and some_points is not point_rows:
            values = points.values[proposal.points] @ proposal.u
            lasts = points.last_of(np.array(proposal.points))
            violated = _violated(points, proposal.u, -float((values / lasts).min()), point_rows)
            some_points, n_violated = np.concatenate((some_points, violated)), n_violated + len(violated)
        if n_violated == 0:
            return proposal
    return proposal._replace(is_settled=False)


def _some(count: int, rows: np.ndarray | None) -> np.ndarray | None:
    """Some of many rows, evenly spread over them; few rows as they are."""
    step = (count if rows is None else len(rows)) // _N_SAMPLED
    if step < _LEAST_STEP:
        return rows
    return np.arange(0, count, step) if rows is None else np.ascontiguousarray(rows[::step])


def _violated(rows: HomogeneousRows, vector: np.ndarray, last: float, subset: np.ndarray | None) -> np.ndarray:
    """The rows at which a function is negative, as far as doubles can tell; of more than _MAX_ADDED the most negative.
    """
    size = rows.magnitude * float(np.abs(vector).sum()) + rows.max_last * abs(last)
    at, values = rows.below(np.append(vector, last), -NOISE * size, subset)
    return at if len(at) <= _MAX_ADDED else at[np.argpartition(values, _MAX_ADDED)[:_MAX_ADDED]]


def propose_pair(
    points: HomogeneousRows,
    halfspaces: HomogeneousRows,
    work: Work,
    point_rows: np.ndarray | None,
    halfspace_rows: np.ndarray | None,
    working_points: list[int],
    working_halfspaces: list[int],
) -> Proposal:
    """What doubles take for the nearest pair. Nothing is proven."""
    assert points.dimension <= MAX_D
    records = points.record(point_rows), halfspaces.record(halfspace_rows)
    state = _of_thread.state
    while state.capacity <= max(len(working_points), len(working_halfspaces)):
        _of_thread.state = state = _State(2 * state.capacity)
    state.begin(working_points, working_halfspaces)
    while True:
        ended = propose_rows(points.dimension, *records, *state.arguments, work.remaining(points, halfspaces))
        if ended != FULL:
            break
        _of_thread.state = state = state.enlarged()
    rounds, pivots, points_read, halfspaces_read = state.integers[ROUNDS : HALFSPACES_READ + 1].tolist()
    work.add("rounds", rounds)
    work.add("pivots", pivots)
    points.n_read += points_read
    halfspaces.n_read += halfspaces_read
    work.check(points, halfspaces)
    return state.proposal(points.dimension, ended == SETTLED)


class _State:
    """The state of a search in `propose_rows`, with room for ``capacity`` rows of either kind."""

    def __init__(self, capacity: int):
        self.capacity = capacity
        self.doubles = np.zeros(n_doubles(capacity))
        self.integers = np.zeros(n_integers(capacity), dtype=np.int64)
        self.arguments = address_of(self.doubles), address_of(self.integers), capacity

    def begin(self, points: list[int], halfspaces: list[int]) -> None:
        """Working sets to begin with."""
        self.integers[:LISTS] = 0
        for which, working in enumerate((points, halfspaces)):
            first = LISTS + which * self.capacity
            self.integers[which], self.integers[first : first + len(working)] = len(working), working

    def enlarged(self) -> _State:
        """The same with twice the room."""
        larger = _State(2 * self.capacity)
        larger.integers[:LISTS] = self.integers[:LISTS]
        for which in range(4):
            first, rows = LISTS + which * larger.capacity, self.rows(which, self.capacity)
            larger.integers[first : first + self.capacity] = rows
        return larger

    def rows(self, which: int, count: int) -> list[int]:
        """The first rows of a list: 0, 1 working points and half-spaces, 2, 3 those of the basis."""
        first = LISTS + which * self.capacity
        return self.integers[first : first + count].tolist()

    def proposal(self, d: int, is_settled: bool) -> Proposal:
        """The basis found and its pair; of an unsettled search the last basis, and the rows added after its step."""
        n_points, n_halfspaces = self.integers[N_BASIC_POINTS : N_BASIC_HALFSPACES + 1].tolist()
        points, halfspaces = self.rows(2, n_points), self.rows(3, n_halfspaces)
        if not is_settled:
            first = -1 if points else 0  # from the first where there was no step
            n_points, n_halfspaces = self.integers[:2].tolist()
            points += [row for row in self.rows(0, n_points)[first:] if row not in points]
            halfspaces += [row for row in self.rows(1, n_halfspaces)[first:] if row not in halfspaces]
        y, u = self.doubles[Y : Y + d].copy(), self.doubles[U : U + d].copy()
        return Proposal(points, halfspaces, y, u, is_settled)


class _OfThread(local):
    """The state of a thread, made when the thread first asks; replaced by a larger state when too small."""

    def __init__(self) -> None:
        self.state = _State(_CAPACITY)


_of_thread = _OfThread()
