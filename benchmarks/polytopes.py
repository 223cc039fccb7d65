"""Hulls of points against intersections of half-spaces: rows read, depth, time; every algorithm beside the peers.

    python benchmarks/polytopes.py --table fits     # ACIT and the default to 10^6 rows, exponents fitted, verified
    python benchmarks/polytopes.py --table fits --highs --plot docs/pictures/polytopes-rows.png
    python benchmarks/polytopes.py --table peers    # all algorithms and the peers that are installed, interleaved
    python benchmarks/polytopes.py --table judge --judge 2000 # so many pairs a dimension against the rational simplex

Peers are asked whether there is a common point, each in the form that suits it (`polytope_peers.py`); solvers of
quadratic programs have one where the distance is below 1e-9. Their answers are judged by ours, which are proven. Peers
that are not installed are left out, and so are those that took longer than --longest seconds for one question.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from inputs import use_tests

use_tests("papers/polytopes", "oracles")
import meeting_families
import rational_simplex
from polytope_peers import PEERS, linprog

from collide import polytopes
from collide.adapters.bench.claims import Claim, Options, Race, check, grid, installed, main
from collide.adapters.bench.growth import Panel, groups, power_of
from collide.errors import CollideError
from collide.papers.polytopes.meets_query import ALGORITHMS

Question = meeting_families.Question
SIZES = (10_000, 30_000, 100_000, 300_000, 1_000_000)
TABLE = [(3, 30, 30), (2, 100, 50), (2, 100_000, 50), (3, 100, 30), (3, 1000, 100), (3, 100_000, 50),
         (3, 10_000, 10_000), (6, 1000, 50), (6, 100_000, 50), (7, 200, 100)]
#: Gaps above this are seen by HiGHS, whose tolerance it is.
_SEEN_BY_HIGHS = 1e-7


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


def fits(options: Options, algorithm: str, d: int, family: str, n: int) -> list[dict]:
    """Rows read by an algorithm."""
    question = FIT_FAMILIES[family](np.random.default_rng([n, d]), d, n, n)
    start = time.process_time()
    answer = polytopes.meets(*question, algorithm=algorithm)
    row = {"hit": answer.hit, "distance": answer.distance, "seconds": time.process_time() - start}
    polytopes.verify(*question, answer)
    counters = answer.counters
    row["rows_read"] = counters["points_read"] + counters["halfspaces_read"]
    names = ("depth", "calls", "base_calls", "most_net_rounds", "nets_redrawn", "exact_programs")
    row |= {name: counters.get(name, 0) for name in names}
    if options.highs and algorithm == "acit" and (answer.hit or answer.distance > _SEEN_BY_HIGHS):
        start = time.process_time()
        try:
            row["highs"] = "agrees" if linprog(question) == answer.hit else "DISAGREES"
        except RuntimeError as error:
            row["highs"] = f"no answer: {str(error)[:60]}"
        row["highs_seconds"] = time.process_time() - start
    return [row]


def fit_cases(options: Options):
    largest = 30_000 if options.quick else SIZES[-1]
    for d in options.dimensions or (3,):
        sizes = [n for n in SIZES if n <= (largest if d == 3 else min(largest, 100_000))]
        yield from grid(algorithm=("acit", "active-set"), d=[d], family=FIT_FAMILIES, n=sizes)


def fit_notes(rows):
    """The exponents of n over all sizes and over the largest two, and c + k·n with the least relative errors."""
    for key, some in groups(rows, "algorithm", "d", "family"):
        n, read = (np.array([row[name] for row in some], dtype=float) for name in ("n", "rows_read"))
        if len(n) > 2:
            (c, k), *_ = np.linalg.lstsq(np.column_stack((1 / read, n / read)), np.ones(len(n)), rcond=None)
            off = np.abs((c + k * n) / read - 1).max()
            last = np.log(read[-1] / read[-2]) / np.log(n[-1] / n[-2])
            yield (f"{' '.join(map(str, key))}: rows read ~ n^{power_of(n, read):.3f}, n^{last:.3f} at last; "
                   f"{c:.0f} + {k:.2f} n within {off:.0%}")


def peers(options: Options, d: int, n: int, m: int) -> Race:
    """All contestants on five questions, apart, touching and deep; what refuses a question counts as wrong about it."""
    gaps = (0.5, -0.2, 1e-3, -1.5, 1.0)[: 2 if options.quick else 5]
    questions = [balls(np.random.default_rng([d, n, m, k]), d, n, m, gap) for k, gap in enumerate(gaps)]
    truths = []
    for question in questions:
        answer = polytopes.meets(*question)
        polytopes.verify(*question, answer)
        truths.append(answer.hit)
    contestants: dict[str, Callable] = {
        name: lambda q, name=name: polytopes.meets(*q, algorithm=name).hit
        for name in ALGORITHMS if name != "brute-force" or n <= 40
    }
    present = installed(**{name: module for name, (module, _, _) in PEERS.items()})
    contestants |= {name: PEERS[name][1] for name in present if n <= PEERS[name][2]}
    tasks, beside = {}, {}
    for name, ask in contestants.items():
        start = time.perf_counter()
        answers = [answer_of(ask, question) for question in questions]
        beside[name] = {"wrong_or_refused": sum(hit is not truth for hit, truth in zip(answers, truths))}
        if time.perf_counter() - start <= options.longest * len(questions):
            tasks[name] = lambda ask=ask: [answer_of(ask, question) for question in questions]
    return Race(tasks, len(questions), beside=beside)


def answer_of(ask: Callable, question: Question) -> bool | None:
    try:
        return bool(ask(question))
    except (ArithmeticError, RuntimeError, ValueError, CollideError):
        return None


def judge(options: Options, d: int) -> list[dict]:
    """Every answer of many small pairs against the rational simplex, and its certificate verified."""
    count = 20 if options.quick else options.judge
    hits, in_integers = 0, 0
    for name, question in meeting_families.questions(7, d, count, 30):
        answer = polytopes.meets(*question)
        polytopes.verify(*question, answer)
        check(answer.hit == rational_simplex.have_common_point(*question), f"{name} {question!r}")
        hits += answer.hit
        in_integers += answer.counters.get("exact_programs", 0) > 0
    return [{"pairs": count, "hits": hits, "begun_anew_in_integers": in_integers, "wrong": 0}]


def arguments(parser) -> None:
    parser.add_argument("--dimensions", nargs="+", type=int, help="for fits, 3 by default")
    parser.add_argument("--highs", action="store_true", help="with fits: HiGHS beside ACIT where it can see the gap")
    parser.add_argument("--judge", type=int, default=2000, metavar="N", help="pairs a dimension (default: 2000)")
    parser.add_argument("--longest", type=float, default=3.0, help="seconds that a question may take a contestant")


CLAIMS = [
    Claim("fits", "rows read against n", fit_cases, fits, notes=fit_notes, file="polytopes-fits", everywhere=True,
          panels=tuple(Panel(f"{name}: rows read", "n", "rows_read", "family", "xy",
                             lambda row, name=name: row["algorithm"] == name) for name in ("acit", "active-set"))),
    Claim("peers", "ms a question", lambda o: ({"d": d, "n": n, "m": m} for d, n, m in TABLE[: 2 if o.quick else None]),
          peers, unit="ms", turns=5, seconds=60.0, file="polytopes"),
    Claim("judge", "against the rational simplex", lambda o: grid(d=(1, 2, 3, 4, 5)), judge, asked_for=True,
          file="polytopes-judged", everywhere=True),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS, arguments)
