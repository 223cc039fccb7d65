"""Asymmetric convex intersection testing by primal-dual pruning with nets (Barba and Mulzer 2019, section 4).

A call has points I and half-spaces J of a space. The call samples the points, solves for the sample N in the polar
space, where the two sets change their parts, adds the points of I in conflict with the answer, and repeats, up to an
answer without conflicts. Sets of at most α rows each go to an exact base solver. Both spaces are made once, and calls
are rows of them: the polar of the polar is the original space.

Beyond the text: conflict sets are open (of closed ones the rows of N on the plane itself are always members). Touching
sets are apart in neither space: a third answer, whose rounds count as rounds of case 1. A sample is not
proven to be a net: its conflict sets are counted in every round, and a sample with a conflict set above ε|I| is drawn
again, twice as large.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers
from collide.least_distance.input_rows import InputRows
from collide.least_distance.interior_point import interior_point
from collide.least_distance.nearest_pair import APART, NearestPair, finish_exactly, nearest_pair
from collide.least_distance.pair_proposals import Work, propose_from_samples
from collide.papers.polytopes.recentred_polars import (
    Centre,
    Space,
    common_point,
    common_point_of_polar,
    pair_in_input,
    recentred_spaces,
)

PRIMAL, POLAR = 0, 1
#: A region without interior is inflated by this, relative to the size of the points.
_INFLATION = 2.0**-20
#: Every second level is at most half as large as the one before last.
_MAX_DEPTH = 100
#: The most samples drawn in a call.
_MAX_DRAWS = 24

#: (points, half-spaces, work, rows of points, rows of half-spaces) → their nearest pair, exactly.
BaseSolver = Callable[[HomogeneousRows, HomogeneousRows, Work, np.ndarray, np.ndarray], NearestPair]


class Sizes(NamedTuple):
    """ε of the nets, the number of rows of a sample, and α, the most rows that the base solver sees of either kind."""

    epsilon: float
    sample: int
    alpha: int


class Verdict(NamedTuple):
    """The relation of two sets.

    space : PRIMAL or POLAR, the space of the gap; ``None`` for touching sets.
    pairs : (primal, polar) nearest pairs, ``None`` where not computed.
    """

    space: int | None
    pairs: tuple[NearestPair | None, NearestPair | None]

    def pair(self, space: int) -> NearestPair:
        """The nearest pair in a space, where it was computed."""
        pair = self.pairs[space]
        if pair is None:
            raise AssertionError("meets: an invariant of ACIT fails: a pair was asked for that no case has")
        return pair


def sizes(d: int) -> Sizes:
    """ε = 1/(2(2d + 1)²(d + 1)), for a linear recurrence; samples of 2d/ε rows; α of two samples.

    For a random sample of r of n rows, with an answer determined by d rows, at most d(n − r)/(r + 1) rows conflict in
    the mean (Clarkson 1988): with r = 2d/ε at most half of εn.
    """
    inverse = 2 * (2 * d + 1) ** 2 * (d + 1)
    return Sizes(1.0 / inverse, 2 * d * inverse, 4 * d * inverse)


class PrimalDualPruning:
    """One run of the recursion.

    Parameters
    ----------
    spaces : (Space, Space)
        The primal and the polar.
    work : Work
        Counters and limit.
    limits : Sizes
        ε, the size of samples, α.
    base : BaseSolver
        Answers what has at most α rows of either kind.
    """

    def __init__(self, spaces: tuple[Space, Space], work: Work, limits: Sizes, base: BaseSolver = nearest_pair):
        self.spaces, self.work, self.limits, self.base = spaces, work, limits, base
        self.rng = np.random.default_rng(0)

    def test(self, space: int, point_rows: np.ndarray, halfspace_rows: np.ndarray, depth: int = 1) -> Verdict:
        """TEST(P, H) of the paper, for rows of a space."""
        self.work.add("calls")
        self.work.raise_to("depth", depth)
        if depth > _MAX_DEPTH:
            raise UnsupportedQuery(f"meets: {_MAX_DEPTH} levels of samples did not get smaller; ask with 'auto'")
        if max(len(point_rows), len(halfspace_rows)) <= self.limits.alpha:
            return self.solve_base(space, point_rows, halfspace_rows)
        n_sample = self.limits.sample
        if len(point_rows) <= n_sample:  # all of them are a net: nothing can conflict
            return self.test(1 - space, halfspace_rows, point_rows, depth + 1)
        for _ in range(_MAX_DRAWS):
            net = self.rng.choice(point_rows, size=min(n_sample, len(point_rows)), replace=False)
            verdict = self.test_with_net(space, point_rows, halfspace_rows, net, depth)
            if verdict is not None:
                return verdict
            self.work.add("nets_redrawn")
            n_sample *= 2
        raise UnsupportedQuery(f"meets: {_MAX_DRAWS} samples were no nets; ask with algorithm='auto'")

    def test_with_net(self, space, point_rows, halfspace_rows, net: np.ndarray, depth: int) -> Verdict | None:
        """The loop of the paper; None where the sample turns out to be no net."""
        d, phase, rounds, touches = self.spaces[space].points.dimension, 0, 0, 0
        while True:
            verdict = self.test(1 - space, halfspace_rows, net, depth + 1)
            this_phase = 1 if verdict.space is None else 0 if verdict.space == space else 2
            _require(this_phase >= phase, "case 2 after case 1")
            phase, touches = this_phase, touches + (this_phase == 1)
            rounds += 1
            self.work.add("net_rounds")
            self.work.raise_to("most_net_rounds", rounds)
            conflicts = self.conflicts(space, verdict, point_rows)
            self.work.check(*self.spaces[PRIMAL], *self.spaces[POLAR])
            if not len(conflicts):
                return verdict
            if len(conflicts) > self.limits.epsilon * len(point_rows):
                return None
            _require(rounds - max(touches - 1, 0) < 2 * d + 1, f"more than {2 * d + 1} rounds")
            grown = np.union1d(net, conflicts)
            _require(len(grown) == len(net) + len(conflicts), "a point of the net conflicts")
            net = grown

    def conflicts(self, space: int, verdict: Verdict, point_rows: np.ndarray) -> np.ndarray:
        """Rows of the points in conflict with the answer for the net: points strictly beyond its plane."""
        if verdict.space == space:  # case 2: apart here, and points nearer than the net's
            return self.spaces[space].points.negative(verdict.pair(space).plane, point_rows).rows
        pair = verdict.pair(1 - space)  # case 1: apart in the polar space, and polars that do not hold the point
        return self.spaces[1 - space].halfspaces.negative(pair.corner, point_rows).rows

    def solve_base(self, space: int, point_rows: np.ndarray, halfspace_rows: np.ndarray) -> Verdict:
        """The exact answer for at most α rows of either kind: apart here, else apart in the polar, else touching."""
        self.work.add("base_calls")
        here, beyond = self.spaces[space], self.spaces[1 - space]
        pair = self.base(here.points, here.halfspaces, self.work, point_rows, halfspace_rows)
        if pair.kind == APART:
            return Verdict(space, (pair, None) if space == PRIMAL else (None, pair))
        polar = self.base(beyond.points, beyond.halfspaces, self.work, halfspace_rows, point_rows)
        pairs = (pair, polar) if space == PRIMAL else (polar, pair)
        return Verdict(1 - space if polar.kind == APART else None, pairs)


def _require(condition: bool, what: str) -> None:
    """Check an invariant of the paper; a failure raises AssertionError, since the answer would be wrong."""
    if not condition:
        raise AssertionError(f"meets: an invariant of ACIT fails: {what}")


# --- theorem 4.5 ------------------------------------------------------------------------------------------------------


def acit(rows: InputRows, work: Work, limits: Sizes | None = None, base: BaseSolver = nearest_pair) -> NearestPair:
    """The nearest pair of all rows by theorem 4.5: a point inside FH, whether it is in CH, then the recursion.

    Parameters
    ----------
    rows : InputRows
        What was asked.
    work : Work
        Counters and limit.
    limits : Sizes, optional
        ε, samples and α; `sizes` of the dimension by default.
    base : BaseSolver, optional
        Answers what has at most α rows.

    Returns
    -------
    NearestPair
        Checked against every row by proven signs.
    """
    points, halfspaces = rows.points, rows.halfspaces
    limits = limits or sizes(points.dimension)
    pair = _with_interior(points, halfspaces, work, limits, base)
    if pair is not None:
        return finish_exactly(pair, points, halfspaces, work, None, None, list(pair.points), list(pair.halfspaces))
    # No interior: what is found for a slightly larger region is where the exact search begins.
    work.add("flat_or_empty")
    pair = _with_interior(points, _inflated(halfspaces, _INFLATION * (points.magnitude or 1.0)), work, limits, base)
    start = None if pair is None else (pair.points, pair.halfspaces)
    return nearest_pair(points, halfspaces, work, start=start)


def _with_interior(points, halfspaces, work: Work, limits: Sizes, base: BaseSolver) -> NearestPair | None:
    """Theorem 4.5 for a region with interior; ``None`` without interior."""
    spaces = None
    for exactly in (False, True):  # a proposed point is proven inside by the offsets of all half-spaces from it
        if spaces is None and (interior := interior_point(halfspaces, work, exactly)) is not None:
            spaces = recentred_spaces(points, halfspaces, interior)
    if spaces is None:
        return None
    primal, polar, centre = spaces
    pair = _centre_in_hull(primal, points, work)
    if pair is None:
        run = PrimalDualPruning((primal, polar), work, limits, base)
        verdict = run.test(PRIMAL, np.arange(len(points)), np.arange(len(halfspaces)))
        pair = _of_verdict(verdict, points, polar, centre)
    points.n_read += primal.points.n_read + polar.halfspaces.n_read
    halfspaces.n_read += primal.halfspaces.n_read + polar.points.n_read
    points.n_exact += primal.points.n_exact + polar.halfspaces.n_exact
    halfspaces.n_exact += primal.halfspaces.n_exact + polar.points.n_exact
    for rows in (*primal, *polar):  # counted now
        rows.n_read = rows.n_exact = 0
    return pair


def _centre_in_hull(primal: Space, points: HomogeneousRows, work: Work) -> NearestPair | None:
    """The origin of the primal space, inside FH, as a common point if in CH; else ``None``."""
    work.add("whole_programs")
    d, origin = points.dimension, _origin(points.dimension)
    proposal = propose_from_samples(primal.points, origin, work, None, None, [0], [])
    if proposal.is_settled:
        away, _ = as_integers([*(-proposal.u).tolist(), 0.0])
        if any(away) and len(primal.points.negative(away).rows) == len(points):
            return None
    nearest = nearest_pair(primal.points, origin, work)
    if nearest.kind == APART:
        return None
    work.add("centre_in_hull")
    _require(len(nearest.points) <= d + 1, f"more than {d + 1} points")
    return common_point(points, nearest.points, [Fraction(weight) for weight in nearest.weights])


def _of_verdict(verdict: Verdict, points: HomogeneousRows, polar: Space, centre: Centre) -> NearestPair:
    if verdict.space == PRIMAL:
        return pair_in_input(verdict.pair(PRIMAL), centre)
    if verdict.space == POLAR:
        return common_point_of_polar(verdict.pair(POLAR), points, polar)
    touching = verdict.pair(PRIMAL)
    return common_point(points, touching.points, [Fraction(weight) for weight in touching.weights])


def _origin(d: int) -> HomogeneousRows:
    """The origin as 2d half-spaces."""
    values = np.vstack((np.eye(d), -np.eye(d)))
    return HomogeneousRows(values, 0.0, lambda row: [*map(int, values[row].tolist()), 0])


def _inflated(halfspaces: HomogeneousRows, by: float) -> HomogeneousRows:
    values, last = halfspaces.values, np.broadcast_to(halfspaces.last + by, len(halfspaces))
    return HomogeneousRows(values, last, lambda row: as_integers([*values[row].tolist(), float(last[row])])[0])
