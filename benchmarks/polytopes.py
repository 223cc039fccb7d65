"""Hulls of points against intersections of half-spaces: rows read, depth, time; every algorithm beside the peers.

    python benchmarks/polytopes.py --fits       # ACIT and the default to 10^6 rows, exponents fitted, answers verified
    python benchmarks/polytopes.py --table      # all algorithms and the peers that are installed, interleaved
    python benchmarks/polytopes.py --judge 2000 # so many pairs a dimension against the rational simplex

Peers are asked whether there is a common point: HiGHS (`scipy.optimize.linprog`) with a variable a point; quadprog,
daqp, clarabel, osqp and proxsuite with the least distance (a hit below 1e-9); Drake's `HPolyhedron.IntersectsWith`.
Their answers are judged by ours, which are proven. Peers that are not installed are left out, and so are those that
took longer than --longest seconds before.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests" / "polytopes"), str(ROOT / "tests" / "oracles")]
import meeting_families
import rational_simplex

from collide import polytopes
from collide.errors import CollideError
from collide.polytopes.meets_query import ALGORITHMS

Question = meeting_families.Question
SIZES = (10_000, 30_000, 100_000, 300_000, 1_000_000)
TABLE = [(3, 30, 30), (2, 100, 50), (2, 100_000, 50), (3, 100, 30), (3, 1000, 100), (3, 100_000, 50),
         (3, 10_000, 10_000), (6, 1000, 50), (6, 100_000, 50), (7, 200, 100)]  # fmt: skip
#: What is said to have a common point, of distances that solvers give.
_HIT = 1e-9


# --- questions --------------------------------------------------------------------------------------------------------


def _ball(rng, n: int, d: int) -> np.ndarray:
    points = rng.normal(size=(n, d))
    return points / np.linalg.norm(points, axis=1)[:, None]


def balls(rng, d: int, n: int, m: int, gap: float, hull: np.ndarray | None = None) -> Question:
    """Points on a unit sphere, half-spaces tangent to another one."""
    normals = _ball(rng, m, d)
    shift = np.zeros(d)
    shift[0] = 2.0 + gap
    return Question(_ball(rng, n, d) if hull is None else hull, normals, 1.0 + normals @ shift)


def grazing(rng, d: int, n: int, m: int) -> Question:
    """Apart by 1e-12: the nearest points of a coarse answer are moved together."""
    question = balls(rng, d, n, m, 0.25)
    answer = polytopes.meets(*question)
    shift = (answer.distance - 1e-12) * answer.normal
    return question._replace(points=question.points + shift)


def moment_curve(rng, d: int, n: int, m: int) -> Question:
    """Points of (t, t², …), all of them corners, scaled to a unit box."""
    t = np.sort(rng.uniform(-1.0, 1.0, n))
    return balls(rng, d, n, m, 0.5, np.column_stack([t**k for k in range(1, d + 1)]))


FIT_FAMILIES: dict[str, Callable[[np.random.Generator, int, int, int], Question]] = {
    "apart": lambda rng, d, n, m: balls(rng, d, n, m, 0.5),
    "meeting": lambda rng, d, n, m: balls(rng, d, n, m, -0.1),
    "grazing": grazing,
    "slab": lambda rng, d, n, m: balls(rng, d, n, m, 0.3, _ball(rng, n, d) * ([1.0] + [5.0] * (d - 1))),
    "moment curve": moment_curve,
}


# --- rows read --------------------------------------------------------------------------------------------------------


def fits(args) -> Iterator[dict]:
    """Rows read by ACIT and by the default, with the exponent of n that fits best."""
    for algorithm in args.algorithms or ("acit", "active-set"):
        for d in args.dimensions or (3,):
            for family, make in FIT_FAMILIES.items():
                rows = []
                for n in (size for size in SIZES if size <= (args.largest if d == 3 else min(args.largest, 100_000))):
                    rows.append(_measured(algorithm, family, d, n, make))
                    print("  ".join(f"{value:.4g}" if isinstance(value, float) else str(value)
                                    for value in rows[-1].values()), flush=True)  # fmt: skip
                    yield rows[-1]
                read = [row["rows_read"] for row in rows]
                if len(rows) > 1:
                    exponent = np.polyfit(np.log([row["n"] for row in rows]), np.log(read), 1)[0]
                    print(f"{algorithm} d={d} {family}: rows read ~ n^{exponent:.3f}", flush=True)


def _measured(algorithm: str, family: str, d: int, n: int, make) -> dict:
    question = make(np.random.default_rng([n, d]), d, n, n)
    start = time.perf_counter()
    answer = polytopes.meets(*question, algorithm=algorithm)
    seconds = time.perf_counter() - start
    polytopes.verify(*question, answer)
    counters = answer.counters
    return {
        "algorithm": algorithm, "family": family, "d": d, "n": n, "hit": answer.hit, "distance": answer.distance,
        "seconds": seconds, "rows_read": counters["points_read"] + counters["halfspaces_read"],
        "depth": counters.get("depth", 0), "calls": counters.get("calls", 0),
        "base_calls": counters.get("base_calls", 0), "most_net_rounds": counters.get("most_net_rounds", 0),
        "nets_redrawn": counters.get("nets_redrawn", 0), "exact_programs": counters.get("exact_programs", 0),
    }  # fmt: skip


# --- peers ------------------------------------------------------------------------------------------------------------


def _linprog(question: Question) -> bool:
    """HiGHS: λ ≥ 0, Σ λ = 1, excess·λ ≤ 0, a variable a point."""
    from scipy.optimize import linprog

    excess = question.normals @ question.points.T - question.offsets[:, None]
    n = excess.shape[1]
    return linprog(np.zeros(n), excess, np.zeros(len(excess)), np.ones((1, n)), [1.0], method="highs").status == 0


def _program(question: Question):
    """min |Pᵀλ − x|² as (H, equality row, inequality matrix G z ≤ h) with z = (λ, x)."""
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

    H, equality, G, h, half = _program(question)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-9
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(H)), np.zeros(len(H)), sparse.csc_matrix(np.vstack((equality, G))),
        np.concatenate(([1.0], h)), [clarabel.ZeroConeT(1), clarabel.NonnegativeConeT(len(h))], settings,
    )  # fmt: skip
    return float(np.linalg.norm(half @ np.array(solver.solve().x))) <= _HIT


def _osqp(question: Question) -> bool:
    import osqp
    from scipy import sparse

    H, equality, G, h, half = _program(question)
    solver = osqp.OSQP()
    solver.setup(
        sparse.csc_matrix(np.triu(H)), np.zeros(len(H)), sparse.csc_matrix(np.vstack((equality, G))),
        np.concatenate(([1.0], np.full(len(h), -np.inf))), np.concatenate(([1.0], h)),
        verbose=False, eps_abs=1e-9, eps_rel=1e-9, max_iter=20_000,
    )  # fmt: skip
    return float(np.linalg.norm(half @ solver.solve().x)) <= _HIT


def _proxsuite(question: Question) -> bool:
    import proxsuite

    H, equality, G, h, half = _program(question)
    result = proxsuite.proxqp.dense.solve(
        H, np.zeros(len(H)), equality[None], np.array([1.0]), G, np.full(len(h), -1e30), h, eps_abs=1e-9
    )  # fmt: skip
    return float(np.linalg.norm(half @ result.x)) <= _HIT


def _drake(question: Question) -> bool:
    from pydrake.geometry.optimization import HPolyhedron, VPolytope

    return HPolyhedron(question.normals, question.offsets).IntersectsWith(VPolytope(question.points.T))


PEERS: dict[str, tuple[str, Callable[[Question], bool]]] = {
    "HiGHS, n variables": ("scipy", _linprog), "quadprog": ("quadprog", _quadprog), "daqp": ("daqp", _daqp),
    "clarabel": ("clarabel", _clarabel), "osqp": ("osqp", _osqp), "proxsuite": ("proxsuite", _proxsuite),
    "Drake": ("pydrake", _drake),
}  # fmt: skip
#: Solvers whose Hessian is a matrix of n by n doubles stop here.
_MAX_DENSE = 1000
#: Entries of the matrix that HiGHS is given at most.
_MAX_ENTRIES = 10_000_000


def _installed(module: str) -> bool:
    try:
        importlib.import_module(module)
    except ImportError:
        return False
    return True


def table(args) -> Iterator[dict]:
    """Medians of all contestants, interleaved, and how often they were wrong."""
    contestants: dict[str, Callable[[Question], bool]] = {
        name: (lambda question, name=name: polytopes.meets(*question, algorithm=name).hit) for name in ALGORITHMS
    }
    contestants.update({name: ask for name, (module, ask) in PEERS.items() if _installed(module)})
    for d, n, m in TABLE:
        questions = [balls(np.random.default_rng([d, n, m, k]), d, n, m, gap)
                     for k, gap in enumerate((0.5, -0.2, 1e-3, -1.5, 1.0)[: args.questions])]  # fmt: skip
        truths = []
        for question in questions:
            answer = polytopes.meets(*question)
            polytopes.verify(*question, answer)
            truths.append(answer.hit)
        seconds: dict[str, list[float]] = {}
        wrong: dict[str, int] = {}
        for _ in range(args.runs):
            for question, truth in zip(questions, truths):
                for name, ask in contestants.items():
                    if max(seconds.get(name, [0.0])) > args.longest or _too_large(name, n, m):
                        continue
                    start = time.perf_counter()
                    try:
                        hit: bool | None = ask(question)
                    except (ArithmeticError, RuntimeError, ValueError, CollideError) as error:  # no answer
                        hit = None
                        print(f"{name} d={d} n={n} m={m}: {type(error).__name__}: {str(error)[:80]}", file=sys.stderr)
                    seconds.setdefault(name, []).append(time.perf_counter() - start)
                    wrong[name] = wrong.get(name, 0) + (hit is None or bool(hit) != truth)
        for name, times in seconds.items():
            row = {"d": d, "n": n, "m": m, "contestant": name, "median_ms": 1e3 * statistics.median(times),
                   "least_ms": 1e3 * min(times), "largest_ms": 1e3 * max(times), "asked": len(times),
                   "wrong_or_refused": wrong[name]}  # fmt: skip
            print("  ".join(f"{value:.4g}" if isinstance(value, float) else str(value) for value in row.values()),
                  flush=True)  # fmt: skip
            yield row


def _too_large(name: str, n: int, m: int) -> bool:
    """Whether a contestant's matrices would not fit, or its subsets be too many."""
    if name == "HiGHS, n variables":
        return n * m > _MAX_ENTRIES
    return n > (_MAX_DENSE if name in PEERS and name != "Drake" else 40 if name == "brute-force" else n)


def judge(args) -> Iterator[dict]:
    """Every answer of many small pairs against the rational simplex, and its certificate verified."""
    for d in args.dimensions or (1, 2, 3, 4, 5):
        hits, in_integers = 0, 0
        for name, question in meeting_families.questions(7, d, args.judge, 30):
            answer = polytopes.meets(*question, algorithm=args.algorithms[0] if args.algorithms else "auto")
            polytopes.verify(*question, answer)
            if answer.hit != rational_simplex.have_common_point(*question):
                raise SystemExit(f"WRONG: {name} {question!r}")
            hits += answer.hit
            in_integers += answer.counters.get("exact_programs", 0) > 0
        row = {"d": d, "pairs": args.judge, "hits": hits, "begun_anew_in_integers": in_integers, "wrong": 0}
        print(row, flush=True)
        yield row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fits", action="store_true", help="rows read against n")
    parser.add_argument("--table", action="store_true", help="algorithms and peers")
    parser.add_argument("--judge", type=int, default=0, metavar="N", help="pairs a dimension against the oracle")
    parser.add_argument("--algorithms", nargs="+", choices=["auto", *ALGORITHMS], help="for --fits and --judge")
    parser.add_argument("--dimensions", nargs="+", type=int, help="for --fits, 3 by default, and for --judge, 1 to 5")
    parser.add_argument("--largest", type=int, default=SIZES[-1], help="the most rows of --fits")
    parser.add_argument("--runs", type=int, default=5, help="of --table, each of all questions")
    parser.add_argument("--questions", type=int, default=5, help="of --table a size")
    parser.add_argument("--longest", type=float, default=3.0, help="seconds that a contestant may take")
    parser.add_argument("--csv", type=Path, help="write rows to this file")
    args = parser.parse_args()
    parts = [part for part, wanted in ((fits, args.fits), (table, args.table), (judge, args.judge)) if wanted]
    for part in parts or [fits, table]:
        rows = list(part(args))
        if args.csv and rows:
            with args.csv.open("w", newline="") as file:
                writer = csv.DictWriter(file, list(rows[0]))
                writer.writeheader()
                writer.writerows(rows)


if __name__ == "__main__":
    main()
