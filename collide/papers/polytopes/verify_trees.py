"""Check the certificate of a `TreeMeeting` by substitution in fractions; nothing of the engine is used."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from collide.certificates.certificate import CertificateRefused
from collide.papers.polytopes.trees_meet_query import TreeMeeting
from collide.papers.polytopes.verified_arguments import as_answer, as_halfspaces, as_matrix, as_points
from collide.papers.polytopes.verify_meeting import largest_value


def verify_trees(
    points: ArrayLike,
    normals: ArrayLike,
    offsets: ArrayLike,
    answer: TreeMeeting,
    X_WP: ArrayLike | None = None,
    X_WR: ArrayLike | None = None,
) -> None:
    """Check an answer of `trees_meet` against points, half-spaces and poses, row by row, in fractions.

    Parameters
    ----------
    points : (n, d) array_like, float64
        Of the body made from points, in its frame.
    normals, offsets : (m, d), (m,) array_like, float64
        Of the other, in its frame.
    answer : TreeMeeting
        With its certificate.
    X_WP, X_WR : (k, k) array_like, float64, optional
        k = d + 1. Poses of the points and of the half-spaces; the identity by default.

    Raises
    ------
    CertificateRefused
        With the reason, where the certificate does not prove the answer.

    Notes
    -----
    A hit: at most d + 1 points with positive weights of sum 1, moved by X_WP, are moved by the inverse of X_WR into
    every half-space. A miss: at most d half-spaces with positive multipliers, u·x ≤ c of which every point exceeds.
    """
    p = as_points("verify_trees", points)
    d = p.shape[1]
    a, b = as_halfspaces("verify_trees", normals, offsets, d)
    proof = as_answer("verify_trees", "answer", answer, TreeMeeting).certificate
    if proof is None:
        raise CertificateRefused("trees: the answer has no certificate: ask with certificate=True")
    M_P, M_R = (as_matrix("verify_trees", name, X, d + 1) for name, X in (("X_WP", X_WP), ("X_WR", X_WR)))
    if proof.kind == "common point":
        _check(answer.hit, "a common point is a hit")
        _check_rows(proof.points, proof.weights, len(p), d + 1)
        _check(sum(proof.weights) == 1, "weights do not sum to 1")
        x = [sum((w * Fraction(float(p[row, k])) for row, w in zip(proof.points, proof.weights)), Fraction(0))
             for k in range(d)]
        x_W = [sum((m * y for m, y in zip(line, x)), line[d]) for line in M_P[:d]]
        x_R = _solve([line[:d] for line in M_R[:d]], [y - line[d] for y, line in zip(x_W, M_R)])
        highest, row = largest_value(np.column_stack((a, b)), [*x_R, Fraction(-1)])
        _check(highest <= 0, f"half-space {row} does not hold the point")
        return
    _check(not answer.hit and proof.kind == "separating plane", "a miss is proven by a plane")
    _check_rows(proof.halfspaces, proof.multipliers, len(a), d)
    terms = list(zip(proof.halfspaces, proof.multipliers))
    u_R = [sum((m * Fraction(float(a[row, k])) for row, m in terms), Fraction(0)) for k in range(d)]
    c = sum((m * Fraction(float(b[row])) for row, m in terms), Fraction(0))
    # In W the plane is u_W·(x − t_R) ≤ c with u_R = M_Rᵀ u_W; of a point p, x = M_P p + t_P.
    u_W = _solve([[M_R[i][k] for i in range(d)] for k in range(d)], u_R)
    constant = sum((u * (M_P[i][d] - M_R[i][d]) for i, u in enumerate(u_W)), Fraction(0)) - c
    u_P = [sum((u * M_P[i][k] for i, u in enumerate(u_W)), Fraction(0)) for k in range(d)]
    highest, row = largest_value(p, [-u for u in u_P])
    _check(constant - highest > 0, f"the plane does not separate point {row} from the half-spaces")


def _check(condition: bool, reason: str) -> None:
    if not condition:
        raise CertificateRefused(f"trees: {reason}")


def _check_rows(rows, numbers, count: int, max_rows: int) -> None:
    _check(0 < len(rows) == len(numbers) == len(set(rows)) <= max_rows, "rows and their numbers do not match")
    _check(all(type(row) is int and 0 <= row < count for row in rows), f"no such rows: {rows}")
    _check(all(isinstance(number, (int, Fraction)) and number > 0 for number in numbers), "a number is not > 0")


def _solve(rows: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """The solution of n equations, by elimination."""
    table = [[*row, value] for row, value in zip(rows, right)]
    for k in range(len(table)):
        pivot = next((i for i in range(k, len(table)) if table[i][k]), None)
        _check(pivot is not None, "a pose has no inverse")
        assert pivot is not None
        table[k], table[pivot] = table[pivot], table[k]
        table[k] = [x / table[k][k] for x in table[k]]
        for i in range(len(table)):
            if i != k and table[i][k]:
                table[i] = [x - table[i][k] * y for x, y in zip(table[i], table[k])]
    return [row[-1] for row in table]
