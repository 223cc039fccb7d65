"""How near the truth answers are, how they are reached and what they cost: beside coal, python-fcl and pybullet.

    python benchmarks/accuracy.py --quick                             # a look at everything, no CSV
    python benchmarks/accuracy.py --table families --seeds 3 --cases 4 --only family=near_sep,plates,concentric
    python benchmarks/accuracy.py --table time --plot accuracy.png
    python benchmarks/accuracy.py --plot accuracy.png                 # what docs/accuracy.md shows

The hard pairs of `collide.scenes.families` against exact arithmetic with 60 digits: the largest error of every
engine, what collide leaves uncertified, brackets that miss (which ends the run), and its paths' shares and costs.
`accuracy_time.py` has errors against time, and brackets of curved pairs.

Errors are parts of the exact gap or depth, so 1 is an answer with no right digit. Where the exact value is 0 they are
parts of the size L of the smaller body, and so is the excess of a normal: what a translation along it would have to be
longer than the shortest one.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from decimal import Decimal
from functools import cache

import collide
from collide.adapters.bench.claims import Claim, Options, Row, check, grid, installed, main
from collide.adapters.peers import exact
from collide.adapters.peers.protocol import Question, engine
from collide.adapters.peers.stress_truth import gap_along, halfspace_distance
from collide.results import FORMULA, UNDECIDED
from collide.scenes.families import HALFSPACE, Case, generate, names

#: Digits of the truth, and what they leave open of it; half-spaces are judged to fewer.
DIGITS = 60
OPEN = {False: Decimal(10) ** (2 - DIGITS), True: Decimal(10) ** -28}
CLASSES = ("gap", "depth", "touch")
#: What can settle an answer of collide.
PATHS = ("doubles", "closed form", "exact", "undecided")
#: Calls of one question, whose fastest counts; a distance that is no length.
CALLS, UNBOUNDED = 5, 1e300


@cache
def cases_of(family: str, seeds: int, count: int) -> list[tuple[Case, Decimal, float]]:
    """(case, its exact signed distance, L: the diagonal of the smaller body that has one) [m]."""
    made = []
    for case in [case for seed in range(100, 100 + seeds) for case in generate(family, count, seed)]:
        flat = case.kind == HALFSPACE
        radii = {"radius_a": case.radius_a, "radius_b": case.radius_b}
        value = halfspace_distance(case)[1] if flat else exact.signed_distance(*case[2:8], digits=DIGITS, **radii)
        diagonals = [case.b.diagonal() + 2 * case.radius_b]
        diagonals += [] if flat else [case.a.diagonal() + 2 * case.radius_a]
        made.append((case, value, min((d for d in diagonals if d > 0), default=1.0)))
    return made


def fastest(ask: Callable) -> tuple[float, object]:
    """(µs, answer)."""
    taken, answer = math.inf, None
    for _ in range(CALLS):
        started = time.perf_counter()
        answer = ask()
        taken = min(taken, time.perf_counter() - started)
    return taken * 1e6, answer


def ours(case: Case) -> Row:
    us, result = fastest(lambda: collide.distance(*case.shapes()))
    row = result.rows[0]  # type: ignore[attr-defined]
    path = "undecided" if row["how"] == UNDECIDED else "exact" if row["exact"] else "doubles"
    if row["how"] == FORMULA and path == "doubles":
        path = "closed form"
    names = ("distance", "lower", "upper", "certified")
    return {name: row[name].item() for name in names} | {"normal": row["normal"], "path": path, "us": us}


def theirs(name: str, cases: list[Case]) -> list[Row | None]:
    """Answers of a peer, None for those that are no length."""
    table = engine(name).answer(Question.from_pairs([case.shapes() for case in cases]))
    return [
        {"distance": float(row["distance"]), "normal": row["normal"], "path": "", "us": math.nan, "certified": False}
        if row["answered"] and abs(row["distance"]) < UNBOUNDED else None for row in table.rows
    ]


def families(options: Options, family: str, peer: str) -> list[Row]:
    """The largest errors of an engine on one family, by class; what is uncertified, wrong, and which paths it took."""
    asked = cases_of(family, options.seeds, options.cases)
    cases = [case for case, _, _ in asked]
    answers = [ours(case) for case in cases] if peer == "collide" else theirs(peer, cases)
    row: Row = {f"{kind}s": 0 for kind in CLASSES} | {f"{kind}_error": "" for kind in CLASSES}
    row |= {"excess": 0.0, "wrong_signs": 0, "no_answer": 0, "uncertified": 0, "example": ""}
    certified: dict[str, float] = {}
    for (case, value, size), answer in zip(asked, answers):
        kind = "gap" if value > 0 else "depth" if value < 0 else "touch"
        row[f"{kind}s"] += 1
        if answer is None or math.isnan(answer["distance"]):
            row["no_answer"] += 1
            continue
        off = float(abs(Decimal(answer["distance"]) - value) / (abs(value) if value else Decimal(size)))
        row[f"{kind}_error"] = max(row[f"{kind}_error"] or 0.0, off)
        row["wrong_signs"] += (answer["distance"] <= 0.0) != (value <= 0)
        along = gap_along(case, tuple(answer["normal"].tolist()))
        row["excess"] = max(row["excess"], float(value - along) / size if along is not None else 0.0)
        if peer == "collide":
            slack = abs(value) * OPEN[case.kind == HALFSPACE]
            lower, upper = Decimal(answer["lower"]), Decimal(answer["upper"])
            check(lower - slack <= value <= upper + slack, f"a bracket misses {value:.20e} of\n{case.snippet()}")
            if answer["certified"]:
                certified[kind] = max(certified.get(kind, 0.0), off)
            else:
                row["uncertified"] += 1
                width = f"{float(upper - lower) / size:.0e}"
                row["example"] = row["example"] or f"{case.seed} {case.index}: {float(value):.2e}, bracket {width} L"
    if peer == "collide":
        row |= {f"{kind}_error_certified": certified.get(kind, "") for kind in CLASSES}
        for path in PATHS:
            us = [answer["us"] for answer in answers if answer and answer["path"] == path]
            row |= {f"share_{path}": len(us) / len(answers), f"us_{path}": statistics.median(us) if us else ""}
    return [row]


def family_cases(options: Options):
    if options.quick:
        options.seeds, options.cases = 1, 2
    peers = ["collide", *installed(coal="coal", fcl="fcl", pybullet="pybullet")]
    return grid(family=names()[: 3 if options.quick else None], peer=peers)


def arguments(parser) -> None:
    parser.add_argument("--seeds", type=int, default=20, help="seeds a family, from 100 on (default: 20)")
    parser.add_argument("--cases", type=int, default=10, help="cases a family and seed (default: 10)")


CLAIMS = [
    Claim("families", "largest errors of hard pairs", family_cases, families, file="accuracy-families"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS, arguments)
