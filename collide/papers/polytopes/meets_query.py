"""`meets`: whether the hull of points and the intersection of half-spaces have a point in common, with proof."""

from __future__ import annotations

from collections.abc import Callable

from numpy.typing import ArrayLike

from collide.base.argument_checks import integer
from collide.errors import InvalidArgument, brief
from collide.least_distance.input_rows import InputRows, input_rows
from collide.least_distance.nearest_pair import NearestPair, nearest_pair
from collide.least_distance.pair_proposals import Work
from collide.papers.polytopes.acit import acit
from collide.papers.polytopes.alternatives import brute_force, gjk, lp_type
from collide.papers.polytopes.exact_answers import make_meeting
from collide.papers.polytopes.meeting import Meeting

#: The algorithms by name; benchmarks/polytopes.py compares them.
ALGORITHMS: dict[str, Callable[[InputRows, Work], NearestPair]] = {
    "active-set": lambda rows, work: nearest_pair(rows.points, rows.halfspaces, work),
    "acit": acit,
    "lp-type": lp_type,
    "gjk": gjk,
    "brute-force": brute_force,
}
#: What ``auto`` takes: benchmarks/polytopes.py.
AUTO = "active-set"


def meets(
    points: ArrayLike, normals: ArrayLike, offsets: ArrayLike, *, algorithm: str = "auto", work: int | None = None
) -> Meeting:
    """Whether CH(points) and FH = {x : normals @ x ≤ offsets} have a point in common, and how far apart they are.

    Parameters
    ----------
    points : (n, d) array_like, float64
        n ≥ 1 points, 1 ≤ d ≤ 8, of any position: flat, equal, within each other [any unit of length].
    normals : (m, d) array_like, float64
        m ≥ 1 outward normals, of any length but zero. FH may be unbounded, flat or empty.
    offsets : (m,) array_like, float64
        Of the half-spaces [units of normals·points].
    algorithm : str
        How it is found; answers are proven the same way. ``"auto"`` takes what is fastest; `ALGORITHMS` lists them.
    work : int, optional
        The most rows (points and half-spaces, each as often as it is looked at) that may be read.

    Returns
    -------
    Meeting
        ``hit``; ``point``, or ``distance``, ``point_p``, ``point_h``, ``normal`` with ``lower`` and ``upper``;
        ``certificate`` and ``counters``.

    Raises
    ------
    InvalidArgument
        Where numbers are NaN, beyond ±1e150, or have the wrong shape, a normal is zero, or d > 8.
    UnsupportedQuery
        Where more than ``work`` rows would have to be read.

    Notes
    -----
    The sets are closed: touching is a hit. The numbers given are taken as exact; doubles propose and integers decide.
    """
    if not isinstance(algorithm, str) or algorithm not in ("auto", *ALGORITHMS):
        known = ", ".join(ALGORITHMS)
        raise InvalidArgument(f"meets: algorithm must be auto or one of {known}, got {brief(algorithm)}")
    limit = None if work is None else min(integer("meets: work", work, 1), 2**62)
    rows = input_rows(points, normals, offsets)
    log = Work(limit)
    pair = ALGORITHMS[AUTO if algorithm == "auto" else algorithm](rows, log)
    counters = {
        **log.counters, "points_read": rows.points.n_read, "halfspaces_read": rows.halfspaces.n_read,
        "decided_in_integers": rows.points.n_exact + rows.halfspaces.n_exact,
    }
    return make_meeting(pair, rows, counters)
