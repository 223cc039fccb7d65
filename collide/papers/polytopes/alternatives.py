"""Alternatives to ACIT in section 2 of Barba and Mulzer: Clarkson's sampling, GJK, brute force.

Each proposes first rows of the exact search, and the exact search proves all answers in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations

import numpy as np

from collide.errors import UnsupportedQuery
from collide.least_distance.complementary_pivoting import propose_solution
from collide.least_distance.input_rows import InputRows
from collide.least_distance.nearest_pair import APART, NearestPair, nearest_pair
from collide.least_distance.pair_proposals import Work
from collide.papers.polytopes.seidel_program import seidel_program

#: Subsets of d points that brute force tries at most.
MAX_SUBSETS = 200_000
#: Rounds of GJK before the exact search takes over.
_MAX_ROUNDS = 60
#: The cube that bounds linear programs, in sizes of the input.
_REACH = 1e6


# --- Clarkson's sampling ----------------------------------------------------------------------------------------------


def lp_type(rows: InputRows, work: Work) -> NearestPair:
    """The nearest pair as an LP-type problem in the points, and for each sample of points an LP-type problem in the
    half-spaces.

    Clarkson (1995), Las Vegas algorithms for linear and integer programming, the first algorithm: samples of d√n rows
    with the retained rows; violating rows are retained, if at most 2√n. Expected O(d) rounds of each.

    Parameters
    ----------
    rows : InputRows
        Rows of the question.
    work : Work
        Counters and limit.
    """
    points, halfspaces, rng = rows.points, rows.halfspaces, np.random.default_rng(0)
    d = points.dimension

    def of_points(point_rows: np.ndarray) -> NearestPair:
        def of_halfspaces(halfspace_rows: np.ndarray) -> NearestPair:
            work.add("base_calls")
            return nearest_pair(points, halfspaces, work, point_rows, halfspace_rows)

        def not_holding(pair: NearestPair) -> np.ndarray:
            return halfspaces.negative(pair.corner).rows if pair.kind != "empty" else np.zeros(0, dtype=int)

        return _clarkson(len(halfspaces), d, rng, work, of_halfspaces, not_holding)

    def nearer(pair: NearestPair) -> np.ndarray:
        return points.negative(pair.plane).rows if pair.kind == APART else np.zeros(0, dtype=int)

    return _clarkson(len(points), d, rng, work, of_points, nearer)


def _clarkson(
    n: int,
    d: int,
    rng: np.random.Generator,
    work: Work,
    solve: Callable[[np.ndarray], NearestPair],
    violators: Callable[[NearestPair], np.ndarray],
) -> NearestPair:
    n_sample, retained = math.ceil((d + 1) * math.sqrt(n)), np.zeros(0, dtype=int)
    if n <= 2 * n_sample:
        return solve(np.arange(n))
    while True:
        work.add("samples")
        pair = solve(np.union1d(retained, rng.choice(n, n_sample, replace=False)))
        violated = violators(pair)
        if not len(violated):
            return pair
        if len(violated) <= 2 * math.sqrt(n):
            retained = np.union1d(retained, violated)


# --- GJK --------------------------------------------------------------------------------------------------------------


def gjk(rows: InputRows, work: Work) -> NearestPair:
    """GJK in d dimensions: the support of CH is a product, that of FH a linear program of d variables (Seidel's).

    Gilbert, Johnson and Keerthi 1988. Support points are kept until the end; the point of their hull nearest the origin
    is a small quadratic program.

    Parameters
    ----------
    rows : InputRows
        What was asked.
    work : Work
        Counters and limit.
    """
    points, halfspaces = rows.points, rows.halfspaces
    rng, d = np.random.default_rng(0), points.dimension
    b = np.broadcast_to(halfspaces.last, len(halfspaces))
    norms = np.linalg.norm(halfspaces.values, axis=1)
    reach = _REACH * max(points.magnitude, float((np.abs(b) / norms).max()), 1e-300)
    used_points, corners, direction = [0], [], -points.values[0]
    corner = seidel_program(halfspaces.values, b, direction, reach, rng)
    if corner is None:
        return nearest_pair(points, halfspaces, work)
    corners.append(corner)
    for _ in range(_MAX_ROUNDS):
        work.add("gjk_rounds")
        differences = points.values[used_points] - np.array(corners)
        nearest = _nearest_to_origin(differences)
        if nearest is None or float(np.abs(nearest).max()) <= 1e-12 * points.magnitude:
            break
        values = points.products(nearest, 0.0)
        halfspaces.n_read += len(halfspaces)
        corner = seidel_program(halfspaces.values, b, nearest, reach, rng)
        work.check(points, halfspaces)
        row = int(np.argmin(values))
        if corner is None or values[row] - corner @ nearest >= nearest @ nearest * (1 - 1e-12):
            break
        used_points.append(row)
        corners.append(corner)
    slack = np.min([(b - halfspaces.values @ corner) / norms for corner in corners[-d - 1 :]], axis=0)
    tight = np.argsort(slack)[: 2 * d]
    return nearest_pair(
        points, halfspaces, work, start=(list(dict.fromkeys(used_points[-2 * d :])), sorted(tight.tolist()))
    )


def _nearest_to_origin(points: np.ndarray) -> np.ndarray | None:
    """The point of the hull of some points that is nearest the origin, in doubles."""
    edges, n = points[1:] - points[0], len(points)
    M, q = np.zeros((n, n)), np.ones(n)
    M[: n - 1, : n - 1] = edges @ edges.T
    M[: n - 1, n - 1], M[n - 1, : n - 1] = 1.0, -1.0
    q[: n - 1] = edges @ points[0]
    z = propose_solution(M, q, 20 * n + 50)
    return None if z is None else points[0] + np.maximum(z[: n - 1], 0.0) @ edges


# --- brute force ------------------------------------------------------------------------------------------------------


def brute_force(rows: InputRows, work: Work) -> NearestPair:
    """All facets of CH by trying every d points, then a linear program of d + 1 variables over them and FH.

    Parameters
    ----------
    rows : InputRows
        What was asked.
    work : Work
        Counters and limit.

    Raises
    ------
    UnsupportedQuery
        Where there are more than `MAX_SUBSETS` subsets of d points.
    """
    points, halfspaces = rows.points, rows.halfspaces
    n, d = points.values.shape
    if math.comb(n, d) > MAX_SUBSETS:
        raise UnsupportedQuery(
            f"meets: {n} points have {math.comb(n, d)} subsets of {d}, brute force tries {MAX_SUBSETS}: ask with 'auto'"
        )
    normals, offsets, members = _facets(points.values)
    work.add("facets", len(normals))
    points.n_read += n * max(math.comb(n, d), 1)
    work.check(points, halfspaces)
    if not len(normals):  # a flat hull has none
        return nearest_pair(points, halfspaces, work)
    norms = np.linalg.norm(halfspaces.values, axis=1)
    a = np.vstack((normals, halfspaces.values / norms[:, None]))
    b = np.concatenate((offsets, np.broadcast_to(halfspaces.last, len(norms)) / norms))
    objective = np.zeros(d + 1)
    objective[d] = 1.0
    reach = _REACH * max(points.magnitude, float(np.abs(b).max()), 1e-300)
    lifted = np.column_stack((a, np.ones(len(a))))
    deepest = seidel_program(lifted, b, objective, reach, np.random.default_rng(0))
    if deepest is None:
        return nearest_pair(points, halfspaces, work)
    tight = np.argsort(b - lifted @ deepest)[: d + 2].tolist()
    start = {row for k in tight if k < len(normals) for row in members[k]}
    return nearest_pair(
        points, halfspaces, work, start=(sorted(start), sorted(k - len(normals) for k in tight if k >= len(normals)))
    )


def _facets(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[tuple[int, ...]]]:
    """(unit normals, offsets, their d points) of the planes through d points with all points on a single side."""
    d, normals, offsets = points.shape[1], [], []
    members: list[tuple[int, ...]] = []
    size = float(np.abs(points - points.mean(axis=0)).max())
    for subset in combinations(range(len(points)), d):
        corner = points[subset[0]]
        _, lengths, directions = np.linalg.svd(np.vstack((points[list(subset[1:])] - corner, np.zeros(d))))
        if d > 1 and lengths[d - 2] <= 1e-10 * size:
            continue
        heights = (points - corner) @ directions[-1]
        for sign in (1.0, -1.0):
            if (sign * heights).max() <= 1e-10 * size:
                normals.append(sign * directions[-1])
                offsets.append(sign * float(corner @ directions[-1]))
                members.append(subset)
    return np.array(normals), np.array(offsets), members
