"""How near the truth answers are, how they are reached and what they cost: beside coal, python-fcl and pybullet.

    python benchmarks/accuracy.py --quick                             # a look at everything, no CSV
    python benchmarks/accuracy.py --part families --seeds 3 --cases 4 --families near_sep,plates,concentric
    python benchmarks/accuracy.py --part time --plot accuracy.png
    python benchmarks/accuracy.py --seeds 20 --cases 10 --plot accuracy.png   # what docs/accuracy.md shows

Parts: "families", the hard pairs of `collide.scenes.families` against exact arithmetic with 60 digits: the largest
error of every engine, what collide leaves uncertified, brackets that miss (there must be none), and the share and cost
of each of its paths; "time", hulls of 8, 128 and 2,048 vertices at relative gaps and depths of 1e-1 to 1e-12: the error
of every engine setting against µs a call; "curved", bracket widths of cylinders, cones and ellipsoids in units of the
size S of docs/conventions.md.

Errors are parts of the exact gap or depth, so 1 is an answer with no right digit. Where the exact value is 0 they are
parts of the size L of the smaller body, and so is the excess of a normal: what a translation along it would have to be
longer than the shortest one.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import time
from decimal import Decimal
from importlib.util import find_spec
from pathlib import Path

from accuracy_engines import ENGINES, PATHS, Answer, ask, missing
from convex import aligned, log, say, write
from startup import machine

from collide.adapters.peers import exact
from collide.adapters.peers.stress_truth import gap_along, halfspace_distance
from collide.scenes.families import HALFSPACE, Case, generate, names

PARTS = ("families", "time", "curved")
#: Digits of the truth, and what they leave open of it.
DIGITS = 60
OPEN = Decimal(10) ** (2 - DIGITS)
#: Half-spaces are judged to fewer.
OPEN_HALFSPACE = Decimal(10) ** -28
CLASSES = ("gap", "depth", "touch")


# --- hard families --------------------------------------------------------------------------------


def truth_of(case: Case) -> Decimal:
    """The exact signed distance, to `DIGITS` digits [m]."""
    if case.kind == HALFSPACE:
        return halfspace_distance(case)[1]
    return exact.signed_distance(*case[2:8], digits=DIGITS, radius_a=case.radius_a, radius_b=case.radius_b)


def size_of(case: Case) -> float:
    """L: the diagonal of the smaller body that has one [m]."""
    diagonals = [case.b.diagonal() + 2 * case.radius_b]
    if case.kind != HALFSPACE:
        diagonals.append(case.a.diagonal() + 2 * case.radius_a)
    return min((d for d in diagonals if d > 0), default=1.0)


class Tally:
    """Counts and largest errors of one engine on one family."""

    def __init__(self, family: str, name: str):
        self.family, self.engine = family, name
        self.cases = dict.fromkeys(CLASSES, 0)
        self.errors: dict[str, float] = {}
        self.certified: dict[str, float] = {}
        self.wrong = self.missed = self.failed = 0
        self.excess = 0.0
        self.uncertified = dict.fromkeys(CLASSES, 0)
        self.example = ""
        self.us: dict[str, list[float]] = {}

    def count(self, case: Case, value: Decimal, answer: Answer) -> None:
        kind = "gap" if value > 0 else "depth" if value < 0 else "touch"
        self.cases[kind] += 1
        if answer.failed or math.isnan(answer.distance):
            self.failed += 1
            return
        off = abs(Decimal(answer.distance) - value)
        scale = abs(value) if value else Decimal(size_of(case))
        self.errors[kind] = max(self.errors.get(kind, 0.0), float(off / scale))
        if answer.certified:
            self.certified[kind] = max(self.certified.get(kind, 0.0), float(off / scale))
        self.wrong += (answer.distance <= 0.0) != (value <= 0)
        along = gap_along(case, answer.normal)
        if along is not None:
            self.excess = max(self.excess, float(value - along) / size_of(case))
        self.us.setdefault(answer.path, []).append(answer.us)
        if self.engine == "collide":
            self._count_bracket(case, value, answer, kind)

    def _count_bracket(self, case: Case, value: Decimal, answer: Answer, kind: str) -> None:
        slack = abs(value) * (OPEN_HALFSPACE if case.kind == HALFSPACE else OPEN)
        if not Decimal(answer.lower) - slack <= value <= Decimal(answer.upper) + slack:
            self.missed += 1
            log(f"a bracket misses: {answer.lower!r} ≤ {value:.20e} ≤ {answer.upper!r} of\n{case.snippet()}")
        if not answer.certified:
            self.uncertified[kind] += 1
            width = (answer.upper - answer.lower) / size_of(case)
            self.example = (
                self.example or f"seed {case.seed} index {case.index}: {float(value):.2e}, bracket {width:.0e} L"
            )

    def row(self) -> dict:
        timed = {path: [us for us in taken if not math.isnan(us)] for path, taken in self.us.items()}
        row: dict = {"family": self.family, "engine": self.engine}
        row |= {f"{kind}s": self.cases[kind] for kind in CLASSES}
        for kind in CLASSES:
            row[f"{kind}_error"] = f"{self.errors[kind]:.1e}" if kind in self.errors else ""
            row[f"{kind}_error_certified"] = f"{self.certified[kind]:.1e}" if kind in self.certified else ""
        row |= {"normal_excess": f"{self.excess:.1e}", "wrong_signs": self.wrong, "no_answer": self.failed}
        if self.engine == "collide":
            row |= {f"uncertified_{kind}s": self.uncertified[kind] for kind in CLASSES}
            row |= {"missed": self.missed, "example": self.example}
        else:
            row |= dict.fromkeys([*(f"uncertified_{kind}s" for kind in CLASSES), "missed", "example"], "")
        count = sum(map(len, self.us.values()))
        for path in PATHS:
            timings = timed.get(path, [])
            row[f"share_{path}"] = f"{len(timings) / count:.3f}" if self.engine == "collide" and count else ""
            row[f"us_{path}"] = f"{statistics.median(timings):.1f}" if timings else ""
        row["us"] = (
            f"{statistics.median(every):.1f}" if (every := [us for timings in timed.values() for us in timings]) else ""
        )
        return row


def families(wanted: list[str], seeds: range, cases: int, engines: list[str]) -> list[dict]:
    """A row a family and engine, and one of each engine over all families."""
    rows, started = [], time.perf_counter()
    for k, family in enumerate(wanted):
        tallies = {name: Tally(family, name) for name in engines}
        asked = [case for seed in seeds for case in generate(family, cases, seed)]
        values = [truth_of(case) for case in asked]
        for name in engines:
            for case, value, answer in zip(asked, values, ask(name, asked)):
                tallies[name].count(case, value, answer)
        rows += [tally.row() for tally in tallies.values()]
        say(f"{family} ({k + 1} of {len(wanted)}), {time.perf_counter() - started:.0f} s")
    return rows


def show_families(rows: list[dict]) -> None:
    ours = [r for r in rows if r["engine"] == "collide"]
    if ours:
        columns = {
            "family": "family", "gaps": "gaps", "depths": "overlaps", "touchs": "touching",
            "gap_error_certified": "gap error", "depth_error_certified": "depth error",
            "normal_excess": "normal excess", "missed": "missed",
        }  # fmt: skip
        lines = [[*columns.values(), "uncertified", "doubles / exact / other", "µs", "µs exact"]]
        for r in ours:
            shares = [float(r[f"share_{path}"] or 0) for path in PATHS]
            lines.append([*(str(r[c]) for c in columns), str(sum(r[f"uncertified_{kind}s"] for kind in CLASSES)),
                          f"{shares[0]:.0%} / {shares[2]:.0%} / {shares[1] + shares[3]:.0%}",
                          r["us_doubles"] or r["us_closed form"], r["us_exact"]])  # fmt: skip
        aligned("collide: largest errors of certified answers", lines)
        for r in ours:
            if r["example"]:
                log(f"uncertified: {r['family']}, {r['example']}")
        total = {key: sum(r[key] for r in ours) for key in ("gaps", "depths", "touchs", "missed", "wrong_signs")}
        log(", ".join(f"{name} {count}" for name, count in total.items()))
    others = [name for name in dict.fromkeys(r["engine"] for r in rows) if name != "collide"]
    if others:
        by_key = {(r["family"], r["engine"]): r for r in rows}
        lines = [["family", *others]]
        for family in dict.fromkeys(r["family"] for r in rows):
            cells = [by_key[family, name] for name in others]
            lines.append(
                [family, *(f"{r['gap_error'] or '-'} {r['depth_error'] or '-'} {r['normal_excess']}" for r in cells)]
            )
        aligned("the others: largest error of gaps, of depths, excess of normals", lines)


# --- bracket widths -------------------------------------------------------------------------------


def curved(seeds: range, count: int) -> list[dict]:
    """A row a pair of kinds and kind of pose: the largest widths over all seeds."""
    import numpy as np
    from accuracy_curved import PAIRS, POSES, widths

    rows = []
    for a, b in PAIRS:
        for kind in POSES:
            per_seed = [widths(a, b, kind, count, seed) for seed in seeds]
            width, hits, certified = (
                np.concatenate([getattr(f, name) for f in per_seed]) for name in per_seed[0]._fields[:3]
            )
            row: dict = {"a": a, "b": b, "poses": kind, "gaps": int((~hits).sum()), "depths": int(hits.sum())}
            for name, of in (("gap", width[~hits]), ("depth", width[hits])):
                row[f"{name}_width"] = f"{of.max():.2e}" if len(of) else ""
                row[f"{name}_width_999"] = f"{np.sort(of)[int(0.999 * (len(of) - 1))]:.2e}" if len(of) else ""
                row[f"{name}_width_median"] = f"{np.median(of):.2e}" if len(of) else ""
            certified_widths = width[hits & certified]
            row["depth_width_certified"] = f"{certified_widths.max():.2e}" if len(certified_widths) else ""
            row |= {"uncertified": int((~certified).sum()), "us": f"{min(f.us for f in per_seed):.1f}"}
            rows.append(row)
        say(f"{a} and {b}")
    return rows


def show_curved(rows: list[dict]) -> None:
    columns = (
        "a", "b", "poses", "gaps", "depths", "gap_width", "depth_width", "depth_width_certified", "uncertified", "us",
    )  # fmt: skip
    aligned("the largest brackets in units of S", [list(columns), *([str(r[c]) for c in columns] for r in rows)])


# --- the command ----------------------------------------------------------------------------------


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=[*PARTS, "all"], default="all", help="what to measure (default: all)")
    parser.add_argument("--seeds", type=int, default=20, help="how many seeds, counted from --first-seed (default: 20)")
    parser.add_argument("--first-seed", type=int, default=100, help="the first seed (default: 100)")
    parser.add_argument("--cases", type=int, default=10, help="cases a family and seed (default: 10); pairs of curved "
                                                              "bodies are a hundred times as many")  # fmt: skip
    parser.add_argument("--families", help="families, commas between (default: all; `collide stress` prints them)")
    parser.add_argument("--engines", default="collide,coal,coal_t9,fcl,pybullet",
                        help="whom to ask: collide, coal, coal_t9 (tolerance 1e-9), fcl, pybullet, commas between "
                             "(default: all); what is not installed is left out with a word")  # fmt: skip
    parser.add_argument(
        "--plot",
        metavar="FILE",
        type=Path,
        help='draw the parts "time" and "curved": FILE.png becomes FILE-time.png, FILE-gaps.png and '
        "FILE-curved.png (needs the extra plots)",
    )
    parser.add_argument("--quick", action="store_true", help="a look: 1 seed, 3 cases, small hulls, no CSV")
    parser.add_argument("--no-csv", action="store_true", help="print the tables alone")
    args = parser.parse_args()
    if args.quick:
        args.seeds, args.cases, args.no_csv = 1, 3, True
    if min(args.seeds, args.cases) < 1 or args.first_seed < 0:
        parser.error("at least one seed and one case are needed, and seeds from 0 on")
    args.families = args.families.split(",") if args.families else names()
    args.engines = [word for word in args.engines.split(",") if word]
    for kind, requested, known in (("family", args.families, names()), ("engine", args.engines, ENGINES)):
        if unknown := [word for word in requested if word not in known]:
            parser.error(f"no {kind} {', '.join(unknown)}: there are {', '.join(known)}")
    if args.plot and find_spec("matplotlib") is None:
        parser.error("--plot needs matplotlib: pip install 'collide-robotics[plots]'")
    return args


def main() -> None:
    args, about = arguments(), machine()
    for name in list(args.engines):
        if reason := missing(name):
            say(f"left out: {name} ({reason})")
            args.engines.remove(name)
    log(", ".join(f"{name} {value}" for name, value in about.items()))
    seeds = range(args.first_seed, args.first_seed + args.seeds)
    for part in PARTS if args.part == "all" else [args.part]:
        if part == "families":
            rows = families(args.families, seeds, args.cases, args.engines)
            show_families(rows)
        elif part == "curved":
            rows = curved(range(seeds.start, seeds.start + min(args.seeds, 4)), 100 * args.cases)
            show_curved(rows)
        else:
            from accuracy_time import error_against_time, show_time

            rows = error_against_time((8, 128) if args.quick else (8, 128, 2048), args.engines, quick=args.quick)
            show_time(rows)
        if args.plot and part != "families":
            from accuracy_plots import plot

            for place in plot(part, rows, args.plot):
                log(f"drawn to {place.name}")
        if not args.no_csv:
            log(f"written to benchmarks/results/{write(f'accuracy-{part}', rows, about).name}")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
