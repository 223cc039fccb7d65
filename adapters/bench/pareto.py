"""Run time against error: every engine and setting on the same pairs, by class, in turns.

    from collide.adapters.bench.pareto import measure
    points = measure(["collide", "coal", "coal:tight"], ["near", "flush"], minutes=1.0)

Each pair is answered once through the peers' protocol, where a crash or a hang is an answer of its own kind, and judged
in exact arithmetic. What was answered is then timed, `timed_calls.py`, in rounds in which all engines take their turns.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from collide.adapters.bench.bench_classes import cases_of, check_classes
from collide.adapters.bench.engine_timer import BATCH, EngineTimer
from collide.adapters.bench.timed_calls import has_prepared_call, what_is_timed
from collide.adapters.bench.turns import turns
from collide.adapters.peers.answers import counted
from collide.adapters.peers.protocol import ENGINES, Question, Table, check_names, engine, load_engine
from collide.adapters.peers.stress_truth import Truth, truth
from collide.scenes.families import Case, MeshCase

#: Pairs nearer to touching than this part of their size are counted apart.
TOUCHING = 1e-12
#: Rounds of a class.
MIN_ROUNDS, MAX_ROUNDS = 3, 25
#: How long an engine may take for one answer [s], and for one turn through a class.
ANSWER_TIMEOUT, TURN_TIMEOUT = 3.0, 20.0
#: Engines whose times are fitted against the size of hulls.
LIBRARIES = ("collide", "coal", "fcl", "pybullet")
#: The engine that ratios are taken against.
REFERENCE = "collide"


@dataclass
class Point:
    """One engine in one class.

    us, error : (n,) of each pair, NaN where there is none: the median µs of a call over the rounds; |distance − exact|
        over the size of the smaller body.
    wrong, wrong_apart : refuted booleans, of all pairs and of those farther than `TOUCHING` from touching; what an
        engine itself calls undecided is not among them.   apart : how many such pairs there are.
    mishaps : answers of their own kind, by kind.   unsupported : pairs that it has no shapes for.
    ratio : its time over collide's for the same pair, the median over pairs, of that the median over rounds;
        of a batch the ratio of the means.
    """

    kind: str
    engine: str
    version: str
    pairs: int
    us: np.ndarray
    error: np.ndarray
    answered: int = 0
    with_distance: int = 0
    apart: int = 0
    wrong: int = 0
    wrong_apart: int = 0
    unsupported: int = 0
    undecided: int = 0
    rounds: int = 0
    ratio: float = math.nan
    mishaps: dict[str, int] = field(default_factory=dict)
    reason: str = ""

    @property
    def failed(self) -> int:
        """Pairs without an answer, or without a usable number where one was due, that it did not refuse by name."""
        return sum(self.mishaps.values())

    def row(self) -> dict:
        """The point for the CSV; µs and errors with four digits, empty where there are none."""
        row: dict = {
            "class": self.kind, "engine": self.engine, "version": self.version, "ratio": number(self.ratio),
            "median_us": number(quantile(self.us, 0.5)), "p99_us": number(quantile(self.us, 0.99)),
            "min_us": number(quantile(self.us, 0.0)), "max_us": number(quantile(self.us, 1.0)),
            "median_error": number(quantile(self.error, 0.5)), "p99_error": number(quantile(self.error, 0.99)),
            "max_error": number(quantile(self.error, 1.0)),
        }
        names = ("pairs", "answered", "with_distance", "wrong", "wrong_apart", "apart", "undecided", "unsupported")
        row |= {name: getattr(self, name) for name in names}
        return row | {
            "mishaps": counted(self.mishaps), "reason": self.reason, "rounds": self.rounds,
            "timed": what_is_timed(self.engine),
        }


def default_engines() -> list[str]:
    """Every engine and setting that is installed and has a call of its own prepared here, and ours in batches.

    Others are timed where they are named: with their adapter around them, which would be unfair unasked.
    """
    names = [name for name, spec in ENGINES.items() if has_prepared_call(name) and not load_engine(spec).missing()]
    return [name for k, name in enumerate([*names[:1], BATCH, *names[1:]]) if k < 2 or name != BATCH]


def scaling_engines() -> list[str]:
    """Of those the collision libraries, which take hulls of any size as they are."""
    return [name for name in default_engines() if name.partition(":")[0] in LIBRARIES]


def check_engines(names: list[str]) -> None:
    """Complain about unknown engines, and about those that are not installed."""
    known = [name for name in names if name != BATCH]
    check_names(known)
    for name in known:
        load_engine(ENGINES[name]).require()


def measure(
    engines: list[str], classes: list[str], *, minutes: float = 3.0, n: int = 60, seed: int = 0,
    progress: Callable[[str], object] | None = None,
) -> list[Point]:
    """All engines on all classes.

    engines : of `ENGINES`, or "collide:batch".   classes : of `CLASSES`.   minutes : about how long to time in all;
    answering and judging come before it.   n : pairs of a class.   seed : other seeds make other pairs.
    progress : told what comes next.

    Raises InvalidArgument for unknown names, MissingExtra for an engine that is not installed.
    """
    check_engines(engines)
    check_classes(classes)
    report = progress or (lambda label: None)
    report("making and judging pairs")
    cases = {name: cases_of(name, n, seed) for name in classes}
    truths = {name: [truth(case) for case in cases[name]] for name in classes}
    every = [case for name in classes for case in cases[name]]
    tables = {}
    for asked in dict.fromkeys(map(engine_of, engines)):
        report(f"{asked} answers")
        tables[asked] = _answers(asked, every)
    answered = {e: tables[engine_of(e)].rows["answered"].reshape(len(classes), n) for e in engines}
    pairs = {name: [case.shapes() for case in cases[name]] for name in classes}
    timers = [
        EngineTimer(e, ENGINES[engine_of(e)], groups_of(answered[e], pairs), TURN_TIMEOUT) for e in engines
    ]
    points: list[Point] = []
    try:
        for k, name in enumerate(classes):
            report(f"timing {name}")
            rows = slice(k * n, (k + 1) * n)
            made = [judged(name, e, tables[engine_of(e)], truths[name], rows) for e in engines]
            _time(made, timers, [answered[e][k] for e in engines], k, 60.0 * minutes / len(classes))
            points += made
    finally:
        for timer in timers:
            timer.close()
    return points


def groups_of(answered: np.ndarray, pairs: dict[str, list]) -> list[list]:
    """The pairs of each class that an engine has answered.   answered : (classes, n) bools."""
    groups = zip(answered, pairs.values())
    return [[pair for pair, is_answered in zip(group, row) if is_answered] for row, group in groups]


def _answers(name: str, cases: list[Case | MeshCase]) -> Table:
    """All answers of one engine; of all but ours in child processes."""
    peer = engine(name, isolated=None if name == "collide" else True, timeout=ANSWER_TIMEOUT)
    return peer.answer(Question.from_pairs([case.shapes() for case in cases]))


def judged(kind: str, name: str, table: Table, truths: list[Truth], of: slice) -> Point:
    """An engine's answers as a point that has no times yet.   of : the class's rows of the table."""
    rows, nothing = table.rows[of], np.full(len(truths), math.nan)
    point = Point(kind, name, table.version, len(truths), nothing.copy(), nothing.copy())
    point.answered, point.with_distance = int(rows["answered"].sum()), int(rows["has_distance"].sum())
    point.unsupported, point.undecided = int(rows["unsupported"].sum()), int(rows["undecided"].sum())
    point.mishaps = dict(Counter(mishap for mishap in table.mishaps[of] if mishap))
    silent = Counter(r for r, row in zip(table.reasons[of], rows) if r and not row["answered"])
    point.reason = silent.most_common(1)[0][0] if silent else ""
    for k, (row, exact) in enumerate(zip(rows, truths)):
        apart = exact.distance is None or abs(float(exact.distance)) > TOUCHING * exact.size
        point.apart += apart
        off = exact.off(float(row["distance"])) if row["has_distance"] else None
        if off is not None:
            point.error[k] = float(off) / exact.size
        surfaces = exact.inside and name.partition(":")[0] != "collide"
        if row["answered"] and not row["undecided"] and not surfaces and bool(row["hit"]) != exact.hit:
            point.wrong += 1
            point.wrong_apart += apart
    return point


def _time(
    points: list[Point], timers: list[EngineTimer], answered: list[np.ndarray], group: int, seconds: float
) -> None:
    """Fill in the times: rounds in which every engine takes its turn, the first one another each time."""
    running = [asked for asked in zip(points, timers, answered) if asked[2].any()]
    taken: dict[str, list[np.ndarray]] = {point.engine: [] for point, _, _ in running}
    for contestants in turns(running, MIN_ROUNDS, MAX_ROUNDS, seconds):
        for point, timer, rows in contestants:
            times = np.full(len(rows), math.nan)
            times[rows] = timer.seconds(group)
            taken[point.engine].append(times)
    for point, timer, _ in running:
        if group in timer.failures:
            failure = timer.failures[group]
            point.mishaps[failure] = point.mishaps.get(failure, 0) + 1
            point.reason = point.reason or f"{failure} while it was timed"
        point.rounds, point.us = len(taken[point.engine]), 1e6 * over_rounds(taken[point.engine])
        if REFERENCE in taken:
            ratio = mean_ratio if point.engine == BATCH else median_ratio
            point.ratio = ratio(taken[point.engine], taken[REFERENCE])


def engine_of(name: str) -> str:
    """The engine in `ENGINES` that a timed name is."""
    return "collide" if name == BATCH else name


def over_rounds(rounds: list[np.ndarray]) -> np.ndarray:
    """(n,) the median over rounds of each pair; NaN where a round has none."""
    return np.median(np.array(rounds), axis=0)


def median_ratio(theirs: list[np.ndarray], ours: list[np.ndarray]) -> float:
    """The median over rounds of the median over pairs of their time over ours."""
    per_round = [quantile(a / b, 0.5) for a, b in zip(theirs, ours)]
    return quantile(np.array(per_round), 0.5)


def mean_ratio(theirs: list[np.ndarray], ours: list[np.ndarray]) -> float:
    """The median over rounds of the mean of their times over the mean of ours: a batch has no times of single pairs."""
    return quantile(np.array([np.nanmean(a) / np.nanmean(b) for a, b in zip(theirs, ours)]), 0.5)


def quantile(values: np.ndarray, share: float) -> float:
    """Of the numbers among the values; NaN where there are none."""
    numbers = values[np.isfinite(values)]
    return float(np.quantile(numbers, share)) if len(numbers) else math.nan


def number(value: float) -> str:
    """Four digits, or nothing for NaN."""
    return "" if math.isnan(value) else f"{value:.4g}"
