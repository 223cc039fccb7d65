"""Clarkson's sampling, GJK, brute force: the same answers as the default; Seidel's program against its corners."""

from __future__ import annotations

import sys
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
import meeting_families as families

import collide
from collide import polytopes
from collide.least_distance.complementary_pivoting import decide_basis, propose_solution
from collide.papers.polytopes.seidel_program import seidel_program


@pytest.mark.parametrize(
    ("algorithm", "d"),
    [*((name, d) for name in ("lp-type", "brute-force") for d in (1, 2, 3, 4)), ("gjk", 1), ("gjk", 2), ("gjk", 3)],
)
def test_alternatives_give_the_same_answers(algorithm, d):
    hits = []
    for _, question in families.questions(41, d, 18, 8):
        answer, default = polytopes.meets(*question, algorithm=algorithm), polytopes.meets(*question)
        polytopes.verify(*question, answer)
        assert (answer.hit, answer.lower, answer.upper) == (default.hit, default.lower, default.upper)
        hits.append(answer.hit)
    assert 0.2 <= np.mean(hits) <= 0.8


@pytest.mark.parametrize("algorithm", ["lp-type", "gjk"])
def test_alternatives_of_many_rows(algorithm):
    rng = np.random.default_rng(2)
    points, normals = rng.normal((4, 0, 0), 1.0, (3000, 3)), rng.normal(size=(2000, 3))
    answer = polytopes.meets(points, normals, np.ones(2000), algorithm=algorithm)
    assert not answer.hit and answer.distance == polytopes.meets(points, normals, np.ones(2000)).distance
    if algorithm == "lp-type":
        assert answer.counters["samples"] >= 2
    else:
        assert answer.counters["gjk_rounds"] >= 2


def test_brute_force_says_what_is_too_much():
    with pytest.raises(collide.UnsupportedQuery, match="brute force tries"):
        polytopes.meets(np.zeros((500, 3)), [[1.0, 0, 0]], [1.0], algorithm="brute-force")


@pytest.mark.many(2)
@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_seidel_finds_the_best_corner(d):
    rng, n_found = np.random.default_rng(7), 0
    for _ in range(25):
        a, b, f = rng.normal(size=(9, d)), rng.uniform(-0.2, 1.0, 9), rng.normal(size=d)
        x = seidel_program(a, b, f, 50.0, np.random.default_rng(0))
        best = _best_corner(np.vstack((a, np.eye(d), -np.eye(d))), np.concatenate((b, np.full(2 * d, 50.0))), f)
        assert (x is None) == (best is None)
        if x is not None:
            assert (a @ x <= b + 1e-9).all() and x @ f == pytest.approx(best, abs=1e-7)
            n_found += 1
    assert n_found >= 10


def _best_corner(a: np.ndarray, b: np.ndarray, f: np.ndarray) -> float | None:
    """The largest f·x of all corners, every d planes one by one."""
    best = None
    for rows in combinations(range(len(a)), a.shape[1]):
        system = a[list(rows)]
        if abs(np.linalg.det(system)) > 1e-12:
            x = np.linalg.solve(system, b[list(rows)])
            if (a @ x <= b + 1e-9).all() and (best is None or x @ f > best):
                best = float(x @ f)
    return best


def test_lemke_in_doubles_solves_what_integers_solve():
    """Problems of random semidefinite matrices: the kernel's solution is one, where integers say that there is one."""
    rng, n_solved, n_rays = np.random.default_rng(8), 0, 0
    for _ in range(120):
        n = int(rng.integers(1, 9))
        factor = rng.integers(-3, 4, (n, rng.integers(1, 4)))
        skew = np.triu(rng.integers(-2, 3, (n, n)), 1) * rng.integers(0, 2)
        M, q = factor @ factor.T + skew - skew.T, rng.integers(-6, 5, n)
        basis, _ = decide_basis(M.tolist(), q.tolist())
        z = propose_solution(M.astype(float), q.astype(float), 20 * n + 50)
        if z is None:
            n_rays += basis.ray is not None
            continue
        w = M @ z + q
        assert basis.ray is None and z.min() >= -1e-9 and w.min() >= -1e-9 and abs(w @ z) <= 1e-9 * (1 + z.max() ** 2)
        n_solved += 1
    assert n_solved >= 80 and n_rays >= 5
