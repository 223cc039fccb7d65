"""Solvers that are asked whether a hull of points and half-spaces have a common point, each in the form it does best.

HiGHS, through scipy and by itself, has a sparse linear program of n + d variables: Σ λᵢ pᵢ = x, Σ λ = 1, λ ≥ 0,
normals·x ≤ offsets. clarabel and osqp have the least |Σ λᵢ pᵢ − x| as a sparse program of n + 2d variables; quadprog,
daqp and proxsuite, whose matrices are dense, one of n + d. Drake has `HPolyhedron.IntersectsWith`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

#: What is said to have a common point, of distances that solvers give.
_HIT = 1e-9
#: What each method of HiGHS is given before it counts as without an answer.
_HIGHS_SECONDS = 20.0


class Question(NamedTuple):
    """Points (n, d), normals (m, d) and offsets (m,)."""

    points: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray


def _constraints(question: Question, extra: int = 0):
    """(equalities, their right-hand side, inequalities), sparse, in λ, x and, where asked for, Σ λᵢ pᵢ − x."""
    from scipy import sparse

    points, normals, offsets = question
    n, d = points.shape
    unit = sparse.identity(d)
    of_place = [sparse.csc_matrix(points.T), -unit] + ([-unit] if extra else [])
    of_sum = sparse.csc_matrix(np.concatenate((np.ones(n), np.zeros(d + extra)))[None])
    inside = sparse.hstack((sparse.csc_matrix((len(offsets), n)), normals, sparse.csc_matrix((len(offsets), extra))))
    return sparse.vstack((sparse.hstack(of_place), of_sum)).tocsc(), np.append(np.zeros(d), 1.0), inside.tocsc()


def linprog(question: Question) -> bool:
    """HiGHS through scipy: its simplex method, where that has no answer its interior points."""
    import scipy.optimize

    n, d = question.points.shape
    equalities, right, inside = _constraints(question)
    bounds = np.column_stack((np.append(np.zeros(n), np.full(d, -np.inf)), np.full(n + d, np.inf)))
    for method in ("highs-ds", "highs-ipm"):
        answer = scipy.optimize.linprog(
            np.zeros(n + d), inside, question.offsets, equalities, right, bounds, method=method,
            options={"time_limit": _HIGHS_SECONDS},
        )
        if answer.status in (0, 2):
            return answer.status == 0
    raise RuntimeError(answer.message)


def _highspy(question: Question) -> bool:
    import highspy
    from scipy import sparse

    n, d = question.points.shape
    equalities, right, inside = _constraints(question)
    rows = sparse.vstack((equalities, inside)).tocsc()
    program = highspy.HighsLp()
    program.num_col_, program.num_row_ = n + d, rows.shape[0]
    program.col_cost_ = np.zeros(n + d)
    program.col_lower_ = np.append(np.zeros(n), np.full(d, -np.inf))
    program.col_upper_ = np.full(n + d, np.inf)
    program.row_lower_ = np.append(right, np.full(len(question.offsets), -np.inf))
    program.row_upper_ = np.append(right, question.offsets)
    program.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    program.a_matrix_.start_, program.a_matrix_.index_, program.a_matrix_.value_ = rows.indptr, rows.indices, rows.data
    solver = highspy.Highs()
    solver.silent()
    solver.passModel(program)
    solver.run()
    return solver.getModelStatus() == highspy.HighsModelStatus.kOptimal


def _sparse_program(question: Question):
    """(upper half of the Hessian, rows, lower and upper bounds) of ½ |r|² in λ, x and r."""
    from scipy import sparse

    n, d = question.points.shape
    equalities, right, inside = _constraints(question, extra=d)
    positive = sparse.hstack((sparse.identity(n), sparse.csc_matrix((n, 2 * d))))
    hessian = sparse.diags(np.append(np.zeros(n + d), np.ones(d))).tocsc()
    rows = sparse.vstack((equalities, positive, inside)).tocsc()
    lower = np.concatenate((right, np.zeros(n), np.full(len(question.offsets), -np.inf)))
    return hessian, rows, lower, np.concatenate((right, np.full(n, np.inf), question.offsets))


def _program(question: Question):
    """min |Σ λᵢ pᵢ − x|² as (H, equality row, inequality matrix G z ≤ h) with z = (λ, x), dense."""
    points, normals, offsets = question
    n, d = points.shape
    half = np.hstack((points.T, -np.eye(d)))
    H = half.T @ half
    equality = np.concatenate((np.ones(n), np.zeros(d)))
    G = np.vstack((np.hstack((-np.eye(n), np.zeros((n, d)))), np.hstack((np.zeros((len(normals), n)), normals))))
    return H, equality, G, np.concatenate((np.zeros(n), offsets)), half


def _quadprog(question: Question) -> bool:
    import quadprog

    H, equality, G, h, half = _program(question)
    regular = H + 1e-12 * np.eye(len(H))
    z = quadprog.solve_qp(regular, np.zeros(len(H)), np.vstack((equality, -G)).T, np.concatenate(([1.0], -h)), 1)[0]
    return float(np.linalg.norm(half @ z)) <= _HIT


def _daqp(question: Question) -> bool:
    import daqp

    H, equality, G, h, half = _program(question)
    A, upper = np.vstack((equality, G)), np.concatenate(([1.0], h))
    lower = np.concatenate(([1.0], np.full(len(h), -1e30)))
    sense = np.zeros(len(upper), dtype=np.int32)
    sense[0] = 5
    z = daqp.solve(H, np.zeros(len(H)), A, upper, lower, sense, eps_prox=1e-6, primal_tol=1e-9, dual_tol=1e-9)[0]
    return float(np.linalg.norm(half @ z)) <= _HIT


def _clarabel(question: Question) -> bool:
    import clarabel
    from scipy import sparse

    n, d = question.points.shape
    hessian, rows, lower, upper = _sparse_program(question)
    signs = np.concatenate((np.ones(d + 1), -np.ones(n), np.ones(len(question.offsets))))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-9
    solver = clarabel.DefaultSolver(
        hessian, np.zeros(n + 2 * d), sparse.csc_matrix(sparse.diags(signs) @ rows),
        np.where(np.isfinite(upper), upper, lower),
        [clarabel.ZeroConeT(d + 1), clarabel.NonnegativeConeT(n + len(question.offsets))], settings,
    )
    return float(np.linalg.norm(np.array(solver.solve().x)[n + d :])) <= _HIT


def _osqp(question: Question) -> bool:
    import osqp

    n, d = question.points.shape
    hessian, rows, lower, upper = _sparse_program(question)
    solver = osqp.OSQP()
    solver.setup(
        hessian, np.zeros(n + 2 * d), rows, lower, upper, verbose=False, eps_abs=1e-9, eps_rel=1e-9, max_iter=20_000
    )
    return float(np.linalg.norm(solver.solve().x[n + d :])) <= _HIT


def _proxsuite(question: Question) -> bool:
    import proxsuite

    H, equality, G, h, half = _program(question)
    result = proxsuite.proxqp.dense.solve(
        H, np.zeros(len(H)), equality[None], np.array([1.0]), G, np.full(len(h), -1e30), h, eps_abs=1e-9
    )
    return float(np.linalg.norm(half @ result.x)) <= _HIT


def _drake(question: Question) -> bool:
    from pydrake.geometry.optimization import HPolyhedron, VPolytope

    return HPolyhedron(question.normals, question.offsets).IntersectsWith(VPolytope(question.points.T))


#: Name → (module, who answers, the most points it is given).
PEERS: dict[str, tuple[str, Callable[[Question], bool], int]] = {
    "HiGHS (scipy)": ("scipy", linprog, 10**6), "highspy": ("highspy", _highspy, 10**6),
    "quadprog": ("quadprog", _quadprog, 1000), "daqp": ("daqp", _daqp, 1000),
    "clarabel": ("clarabel", _clarabel, 10**6), "osqp": ("osqp", _osqp, 10**6),
    "proxsuite": ("proxsuite", _proxsuite, 1000), "Drake": ("pydrake", _drake, 10**6),
}
