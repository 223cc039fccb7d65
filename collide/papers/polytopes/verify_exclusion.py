"""Check the planes of an `Exclusion`, and once a body the excluded boundary, in integers and fractions.

No code of the engine is used. The boundary is of the points rounded to a grid; each point is within a unit of its grid
point, so planes are checked with a unit to spare: if P meets R, the hull of the grid's points meets R widened by a box
of a unit, a part of every half-space widened by the unit.
"""

from __future__ import annotations

from fractions import Fraction
from math import lcm

import numpy as np
from numpy.typing import ArrayLike

from collide.certificates.certificate import CertificateRefused
from collide.papers.polytopes.exclusion import HullBoundary
from collide.papers.polytopes.trees_meet_query import TreeMeeting
from collide.papers.polytopes.verified_arguments import as_answer, as_halfspaces, as_matrix, as_points
from collide.papers.polytopes.verify_trees import _check, _solve


def verify_boundary(points: ArrayLike, boundary: HullBoundary) -> None:
    """Check that simplices cover the boundary of a hull: once a body, O(n f) products of integers.

    Parameters
    ----------
    points : (n, d) array_like, float64
        Of the body.
    boundary : HullBoundary
        As of `hull_boundary`.

    Raises
    ------
    CertificateRefused
        With the reason.

    Notes
    -----
    Checked: each simplex lies in a hyperplane with all points on a side; every side of a simplex belongs to an even
    number of simplices; and the middle of the first is in no other. A cycle modulo 2 on a sphere that covers a point
    once covers the whole sphere.
    """
    as_answer("verify_boundary", "boundary", boundary, HullBoundary)
    p, whole, facets = as_points("verify_boundary", points), boundary.whole, boundary.facets
    d = p.shape[1]
    _check(whole.shape == p.shape and whole.dtype == np.int64, "the grid has no row for each point")
    unit = Fraction(boundary.unit)
    centre = [Fraction(x) for x in boundary.centre.tolist()]
    for row, (point, numbers) in enumerate(zip(p.tolist(), whole.tolist())):
        off = max(abs(Fraction(x) - c - unit * k) for x, c, k in zip(point, centre, numbers))
        _check(off <= unit, f"point {row} is more than a unit from its place on the grid")
    _check(len(facets) > d and facets.min() >= 0 and facets.max() < len(p), "no such simplices")
    corners, every = whole.astype(object)[facets], whole.astype(object)
    middle = corners[0].sum(axis=0)  # times d
    n_holding = 0
    for simplex in corners:
        a = [(-1) ** k * _determinant(np.delete(simplex[1:] - simplex[0], k, axis=1).tolist()) for k in range(d)]
        _check(any(a), "a simplex is flat")
        heights = every @ np.array(a, dtype=object) - sum(x * y for x, y in zip(a, simplex[0]))
        _check(heights.max() <= 0 or heights.min() >= 0, "a simplex is not on the boundary: points on both sides")
        on_plane = sum(x * int(y) for x, y in zip(a, middle)) == d * sum(x * int(y) for x, y in zip(a, simplex[0]))
        n_holding += on_plane and _holds(simplex, middle, a)
    _check(n_holding == 1, "the middle of the first simplex is in others too")
    sides = np.concatenate([np.delete(np.sort(facets, axis=1), k, axis=1) for k in range(d)])
    counts = np.unique(sides, axis=0, return_counts=True)[1]
    _check(bool((counts % 2 == 0).all()), "a side of a simplex has nothing beyond it")


def verify_exclusion(
    boundary: HullBoundary,
    normals: ArrayLike,
    offsets: ArrayLike,
    answer: TreeMeeting,
    X_WP: ArrayLike | None = None,
    X_WR: ArrayLike | None = None,
) -> None:
    """Check that the planes of a miss leave out the hull: O(n log n) products, and O(f d log n) looks at their signs.

    Parameters
    ----------
    boundary : HullBoundary
        Of the body made from points, in its frame; `verify_boundary` has checked it.
    normals, offsets : (m, d), (m,) array_like, float64
        Of the other, in its frame; only the rows that planes are made of are read.
    answer : TreeMeeting
        A miss with its exclusion.
    X_WP, X_WR : (k, k) array_like, float64, optional
        k = d + 1. Poses of the points and of the half-spaces; the identity by default.

    Raises
    ------
    CertificateRefused
        With the reason, where the planes do not prove the miss.
    """
    caller = "verify_exclusion"
    d = as_answer(caller, "boundary", boundary, HullBoundary).whole.shape[1]
    proof = as_answer(caller, "answer", answer, TreeMeeting).exclusion
    a, b = as_halfspaces(caller, normals, offsets, d)
    poses = [as_matrix(caller, name, X, d + 1) for name, X in (("X_WP", X_WP), ("X_WR", X_WR))]
    if answer.hit or proof is None:
        raise CertificateRefused("trees: the answer has no planes: it is a hit, or integers over all rows settled it")
    map_RP = _relative(poses[0], poses[1], d)
    unit, centre = Fraction(boundary.unit), [Fraction(x) for x in boundary.centre.tolist()]
    outside = [Fraction(x) for x in proof.outside]
    is_left_out = np.zeros(len(boundary.facets), dtype=bool)
    for plane in proof.planes:
        u, c = _combined(plane.rows, plane.multipliers, a, b, d)
        _check(sum(x * y for x, y in zip(u, outside)) <= c, "the point outside is not in a plane's half-space")
        # On the grid u·(M(centre + unit·k) + t) > c + unit·|Mᵀu|₁.
        v = [sum((u[i] * map_RP[i][k] for i in range(d)), Fraction(0)) for k in range(d)]
        c += unit * sum(abs(x) for x in v) - sum(x * y for x, y in zip(v, centre))
        c -= sum((u[i] * map_RP[i][d] for i in range(d)), Fraction(0))
        is_left_out |= _all_above(boundary, [unit * x for x in v], c)
    _check(bool(is_left_out.all()), "a boundary simplex is beyond none of the planes")
    o_P = _solve([line[:d] for line in map_RP], [x - line[d] for x, line in zip(outside, map_RP)])
    o = [(x - c) / unit for x, c in zip(o_P, centre)]
    is_left_out[:] = False
    for numbers in proof.ray_planes:
        *g, h = [Fraction(x) for x in numbers]
        _check(sum(x * y for x, y in zip(g, o)) > h, "the point outside is not beyond a plane of its ray")
        _check(sum(x * Fraction(y) for x, y in zip(g, proof.ray)) >= 0, "the ray comes back through a plane")
        is_left_out |= _all_above(boundary, [-x for x in g], -h, or_on=True)
    _check(any(proof.ray) and bool(is_left_out.all()), "a boundary simplex is below none of the ray's planes")


def _all_above(boundary: HullBoundary, u: list[Fraction], c: Fraction, or_on: bool = False) -> np.ndarray:
    """(f,) bool: u·k > c, or ≥ c, at all corners k of a simplex."""
    common = lcm(c.denominator, *(x.denominator for x in u))
    heights = boundary.whole.astype(object) @ np.array([int(x * common) for x in u], dtype=object) - int(c * common)
    is_above = (heights >= 0) if or_on else (heights > 0)
    return is_above.astype(bool)[boundary.facets].all(axis=1)


def _combined(rows, multipliers, a: np.ndarray, b: np.ndarray, d: int) -> tuple[list[Fraction], Fraction]:
    _check(0 < len(rows) == len(multipliers) == len(set(rows)) <= d, "rows and multipliers of a plane do not match")
    _check(all(type(row) is int and 0 <= row < len(a) for row in rows), f"no such rows: {rows}")
    _check(all(x >= 0.0 for x in multipliers), "a multiplier is negative")
    terms = [(Fraction(x), row) for x, row in zip(multipliers, rows)]
    u = [sum((x * Fraction(float(a[row, k])) for x, row in terms), Fraction(0)) for k in range(d)]
    return u, sum((x * Fraction(float(b[row])) for x, row in terms), Fraction(0))


def _relative(M_P: list[list[Fraction]], M_R: list[list[Fraction]], d: int) -> list[list[Fraction]]:
    """(d, d + 1): from the frame of the points to that of the half-spaces."""
    matrix = [line[:d] for line in M_R[:d]]
    columns = [_solve(matrix, [line[k] for line in M_P[:d]]) for k in range(d)]
    columns.append(_solve(matrix, [p[d] - r[d] for p, r in zip(M_P[:d], M_R[:d])]))
    return [[column[i] for column in columns] for i in range(d)]


def _holds(simplex: np.ndarray, middle: np.ndarray, a: list[int]) -> bool:
    """Whether middle / d, on the hyperplane of a simplex with normal a, is in it, its sides included."""
    d = len(a)
    signs = []
    for k in range(d):
        rows = [(d * corner - middle).tolist() for i, corner in enumerate(simplex) if i != k]
        signs.append((-1) ** k * _determinant([*rows, a]))
    return all(x >= 0 for x in signs) or all(x <= 0 for x in signs)


def _determinant(rows: list[list[int]]) -> int:
    """By expansion: at most 8 × 8, of which few are asked for."""
    if len(rows) == 1:
        return int(rows[0][0])
    return sum(
        (-1) ** k * int(x) * _determinant([row[:k] + row[k + 1 :] for row in rows[1:]])
        for k, x in enumerate(rows[0]) if x
    )
