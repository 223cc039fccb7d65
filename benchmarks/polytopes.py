"""Hulls of points against intersections of half-spaces: rows read, depth, time; every algorithm beside the peers.

    python benchmarks/polytopes.py --fits       # ACIT and the default to 10^6 rows, exponents fitted, answers verified
    python benchmarks/polytopes.py --fits --highs --plot docs/pictures/polytopes-rows.png
    python benchmarks/polytopes.py --table      # all algorithms and the peers that are installed, interleaved
    python benchmarks/polytopes.py --judge 2000 # so many pairs a dimension against the rational simplex

Peers are asked whether there is a common point, each in the form that suits it (`polytope_peers.py`); solvers of
quadratic programs have one where the distance is below 1e-9. Their answers are judged by ours, which are proven. Peers
that are not installed are left out, and so are those that took longer than --longest seconds before.
"""

from __future__ import annotations

import argparse
import csv
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "tests" / "polytopes"), str(ROOT / "tests" / "oracles")]
import meeting_families
import rational_simplex
from polytope_peers import PEERS, is_installed, linprog

from collide import polytopes
from collide.errors import CollideError
from collide.polytopes.meets_query import ALGORITHMS

Question = meeting_families.Question
SIZES = (10_000, 30_000, 100_000, 300_000, 1_000_000)
TABLE = [(3, 30, 30), (2, 100, 50), (2, 100_000, 50), (3, 100, 30), (3, 1000, 100), (3, 100_000, 50),
         (3, 10_000, 10_000), (6, 1000, 50), (6, 100_000, 50), (7, 200, 100)]  # fmt: skip
#: Gaps above this are seen by HiGHS, whose tolerance it is.
_SEEN_BY_HIGHS = 1e-7


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
    """Rows read by ACIT and by the default, with what of n fits them."""
    everything = []
    for algorithm in args.algorithms or ("acit", "active-set"):
        for d in args.dimensions or (3,):
            for family, make in FIT_FAMILIES.items():
                if args.families and family not in args.families:
                    continue
                rows = []
                for n in (size for size in SIZES if size <= (args.largest if d == 3 else min(args.largest, 100_000))):
                    rows.append(_measured(algorithm, family, d, n, make, args.highs and algorithm == "acit"))
                    print("  ".join(f"{value:.4g}" if isinstance(value, float) else str(value)
                                    for value in rows[-1].values()), flush=True)  # fmt: skip
                    yield rows[-1]
                everything += rows
                if len(rows) > 2:
                    print(f"{algorithm} d={d} {family}: {_fit(rows)}", flush=True)
    if args.plot:
        plot(everything, args.plot)


def _fit(rows: list[dict]) -> str:
    """The exponents of n over all sizes and over the largest two, and c + k·n with the least relative errors."""
    n, read = (np.array([row[name] for row in rows], dtype=float) for name in ("n", "rows_read"))
    exponent = np.polyfit(np.log(n), np.log(read), 1)[0]
    last = np.log(read[-1] / read[-2]) / np.log(n[-1] / n[-2])
    (c, k), *_ = np.linalg.lstsq(np.column_stack((1 / read, n / read)), np.ones(len(n)), rcond=None)
    off = np.abs((c + k * n) / read - 1).max()
    return f"rows read ~ n^{exponent:.3f}, n^{last:.3f} at last; {c:.0f} + {k:.2f} n within {off:.0%}"


def _measured(algorithm: str, family: str, d: int, n: int, make, with_highs: bool) -> dict:
    question = make(np.random.default_rng([n, d]), d, n, n)
    start = time.perf_counter()
    answer = polytopes.meets(*question, algorithm=algorithm)
    seconds = time.perf_counter() - start
    polytopes.verify(*question, answer)
    highs, highs_seconds = "", 0.0
    if with_highs and (answer.hit or answer.distance > _SEEN_BY_HIGHS):
        start = time.perf_counter()
        try:
            highs = "agrees" if linprog(question) == answer.hit else "DISAGREES"
        except RuntimeError as error:
            highs = f"no answer: {str(error)[:60]}"
        highs_seconds = time.perf_counter() - start
    counters = answer.counters
    return {
        "algorithm": algorithm, "family": family, "d": d, "n": n, "hit": answer.hit, "distance": answer.distance,
        "seconds": seconds, "rows_read": counters["points_read"] + counters["halfspaces_read"],
        "depth": counters.get("depth", 0), "calls": counters.get("calls", 0),
        "base_calls": counters.get("base_calls", 0), "most_net_rounds": counters.get("most_net_rounds", 0),
        "nets_redrawn": counters.get("nets_redrawn", 0), "exact_programs": counters.get("exact_programs", 0),
        "highs": highs, "highs_seconds": highs_seconds,
    }  # fmt: skip


def plot(rows: list[dict], place: Path) -> None:
    """Rows read against n, a line a family, a panel an algorithm and dimension."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    panels = list(dict.fromkeys((row["algorithm"], row["d"]) for row in rows))
    figure, axes = plt.subplots(1, len(panels), figsize=(4.6 * len(panels), 4.2), sharey=True, squeeze=False)
    for axis, panel in zip(axes[0], panels):
        of_panel = [row for row in rows if (row["algorithm"], row["d"]) == panel]
        for family, marker in zip(FIT_FAMILIES, "osD^v"):
            of_family = [row for row in of_panel if row["family"] == family]
            axis.loglog([row["n"] for row in of_family], [row["rows_read"] for row in of_family], marker=marker,
                        markersize=4, linewidth=1.2, label=family)  # fmt: skip
        n = np.array([min(row["n"] for row in of_panel), max(row["n"] for row in of_panel)])
        axis.loglog(n, 2 * n, color="grey", linestyle=":", label="every row once")
        axis.loglog(n, 20 * n, color="grey", linestyle="--", label="ten times")
        axis.set_title(f"{panel[0]}, d = {panel[1]}", fontsize=10)
        axis.set_xlabel("points, and as many half-spaces")
        axis.grid(alpha=0.25)
    axes[0][0].set_ylabel("rows read")
    axes[0][0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(place, dpi=90)


# --- peers ------------------------------------------------------------------------------------------------------------


def table(args) -> Iterator[dict]:
    """Medians of all contestants, in another order each time, and how often they were wrong."""
    contestants: dict[str, Callable[[Question], bool]] = {
        name: (lambda question, name=name: polytopes.meets(*question, algorithm=name).hit) for name in ALGORITHMS
    }
    contestants.update({name: ask for name, (module, ask, _) in PEERS.items() if is_installed(module)})
    asked = args.contestants or list(contestants)
    if missing := set(asked) - set(contestants):
        raise SystemExit(f"no contestants: {', '.join(sorted(missing))}; there are {', '.join(contestants)}")
    order = np.random.default_rng(0)
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
                for name in order.permutation(asked).tolist():  # whoever follows Drake finds the caches empty
                    if max(seconds.get(name, [0.0])) > args.longest or _too_large(name, n):
                        continue
                    start = time.perf_counter()
                    try:
                        hit: bool | None = contestants[name](question)
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


def _too_large(name: str, n: int) -> bool:
    """Whether a contestant's matrices would not fit, or its subsets be too many."""
    return n > (PEERS[name][2] if name in PEERS else 40 if name == "brute-force" else n)


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
    parser.add_argument("--families", nargs="+", choices=list(FIT_FAMILIES), help="for --fits: these alone")
    parser.add_argument("--highs", action="store_true", help="with --fits: HiGHS beside ACIT where it can see the gap")
    parser.add_argument("--plot", type=Path, help="with --fits: a picture of them (needs matplotlib)")
    parser.add_argument("--contestants", nargs="+", help="of --table: these alone")
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
