"""What is wrong with answers to cases: judged exactly, by collide's proven bracket, or by being no answer at all.

A flaw has a kind and the class of the pair's position; a shrunk case must show a flaw of the same kind and class.
Booleans of pairs that touch within rounding count against nobody (`collide.adapters.peers.compare`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from collide.adapters.fuzzing.fuzz_case import Case, isolated
from collide.adapters.fuzzing.nearest_points import POINTS_TOLERANCE, points_off
from collide.adapters.fuzzing.support_bounds import SLACK, lower_bound
from collide.adapters.peers.answers import ABORTED, HUNG, NO_LENGTH, NOT_A_NUMBER, RAISED, STATUSES, Table
from collide.adapters.peers.collide_peer import CollidePeer
from collide.adapters.peers.compare import TOLERANCE, Summary
from collide.adapters.peers.exact_peer import INSIDE, ExactPeer
from collide.adapters.peers.judge import BRACKET, EXACT, Disagreement, Judge, contradictions, differences
from collide.adapters.peers.question import Question, has_mesh, is_compound_or_mesh
from collide.reports import classes
from collide.shapes import Mesh

FALSE_HIT, FALSE_MISS, WRONG_GAP, WRONG_DEPTH = "false hit", "false miss", "wrong gap", "wrong depth"
WRONG_POINTS = "wrong points"
CONTRADICTION, LEFT_OUT, WRONG_BRACKET = "contradicts itself", "left out of a World", "wrong bracket"
#: The kinds, the gravest first. Those that are no answers are the protocol's mishaps.
KINDS = (
    ABORTED, HUNG, RAISED, FALSE_MISS, FALSE_HIT, NOT_A_NUMBER, NO_LENGTH, WRONG_GAP, WRONG_DEPTH, WRONG_POINTS,
    CONTRADICTION, LEFT_OUT, WRONG_BRACKET,
)
OURS = "collide"
#: A gap or a depth below this part of the pair's size is near touching.
NEAR = 1e-3
#: Products of facets above which exact arithmetic is not asked of its own accord.
MAX_FACET_PAIRS = 40_000
POSITIONS = ("apart", "near", "touching", "shallow", "deep", "meeting", "inside")


class Flaw(NamedTuple):
    """One wrong answer, or one that was owed.

    kind : of `KINDS`.   position : of `POSITIONS`: "meeting" is of meshes and unions, whose depth nobody knows.
    hit, distance [m], reason : what the engine said; None where it said nothing.
    exact_hit, exact_distance, lower, upper : the verdict [m]; None where not known.
    judged_by : exact arithmetic, the proven bracket, or empty where no judge is needed.
    severity : how far the number is off, or the gap of a wrong boolean, as a part of the pair's size; inf: no answer.
    """

    engine: str
    kind: str
    position: str
    hit: bool | None
    distance: float | None
    reason: str
    exact_hit: bool | None
    exact_distance: float | None
    lower: float | None
    upper: float | None
    judged_by: str
    severity: float

    def same_way(self, flaw: Flaw) -> bool:
        """Whether a flaw of a simpler case is the same engine's, of the same kind, in the same class of position.

        Where nobody knows how deep bodies meet, as of meshes, their parts may meet to any depth.
        """
        same = self.position == flaw.position or (self.position == "meeting" and flaw.position in ("shallow", "deep"))
        return same and (self.engine, self.kind) == (flaw.engine, flaw.kind)


class Examiner:
    """Asks collide, exact arithmetic and any engines the pairs of cases, and says what is wrong with each answer.

    Parameters
    ----------
    answers : mapping of str to callable
        Engine → function from a `Question` of unrelated pairs to a `Table`.
    tolerance : float
        Of distances, as a part of the pair's size.
    """

    def __init__(self, answers: dict[str, Callable[[Question], Table]], tolerance: float = TOLERANCE):
        self.answers, self.tolerance = answers, tolerance

    def flaws(self, cases: Sequence[Case], engines: Sequence[str] | None = None) -> list[list[Flaw]]:
        """The flaws of every case; of an engine at most one a case, the gravest.

        cases : pairs, or Worlds, of which collide alone is judged.
        engines : which to ask; None: all, and collide itself.
        """
        pairs = [k for k, case in enumerate(cases) if not case.world]
        flaws: list[list[Flaw]] = [[] for _ in cases]
        if pairs:
            for k, of_pair in zip(pairs, self._of_pairs([cases[k] for k in pairs], engines)):
                flaws[k] = of_pair
        for k, case in enumerate(cases):
            if case.world and (engines is None or OURS in engines):
                flaws[k] = world_flaws(case)
        return flaws

    def _of_pairs(self, cases: list[Case], engines: Sequence[str] | None) -> list[list[Flaw]]:
        question = isolated(cases)
        judge = Judge(question, self.tolerance)
        ours = CollidePeer().answer(question)
        truth = _Truth(question, ours, judge)
        flaws: list[list[Flaw]] = [[] for _ in cases]
        if engines is None or OURS in engines:
            exact = truth.table_of_small()
            disputes = contradictions(judge, ours) + differences(judge, ours, exact, Summary("exact"))
            _gravest(flaws, truth, ours, disputes, OURS)
            _add_wrong_points(flaws, cases, truth, ours, OURS)
            for k, case in enumerate(cases):
                if not flaws[k] and not exact.rows["has_distance"][k]:
                    flaws[k] += _refuted_by_supports(case, truth, ours, k)
        for name in self.answers if engines is None else [name for name in engines if name != OURS]:
            table = self.answers[name](question)
            disputes = contradictions(judge, table) + differences(judge, ours, table, Summary(name))
            _gravest(flaws, truth, table, disputes, name)
            _add_wrong_points(flaws, cases, truth, table, name)
        return flaws


class _Truth:
    """What is known of every pair of a question."""

    def __init__(self, question: Question, ours: Table, judge: Judge):
        self.question, self.ours, self.judge = question, ours, judge

    def table_of_small(self) -> Table:
        """Exact answers to the pairs that do not take long; the others stand as unsupported."""
        table = Table(self.question, "exact", ExactPeer().version)
        wanted = [k for k, (i, j) in enumerate(self.question.pairs) if self._n_facets(i) * self._n_facets(j)
                  <= MAX_FACET_PAIRS]
        for event in ExactPeer().stream(self.question, wanted):
            if event.kind in STATUSES:
                table.record(event)
                alone = Table(Question(self.question.bodies, [self.question.pairs[event.at]]), "exact", table.version)
                alone.record(event._replace(at=0))
                self.judge._verdicts[event.at] = alone  # found once
        return table

    def _n_facets(self, i: int) -> int:
        shape = self.question.bodies[i].shape
        return len(shape.faces) if isinstance(shape, Mesh) else 1

    def position(self, k: int, dispute: Disagreement | None = None) -> str:
        """The class of pair k's position, by the verdict where there is one, else by what collide says."""
        row, size = self.ours.rows[k], self.judge.size[k]
        hit, distance = bool(row["hit"]), float(row["distance"])
        if dispute is not None and dispute.exact_hit is not None:
            hit = dispute.exact_hit
            distance = distance if dispute.exact_distance is None else dispute.exact_distance
        if abs(distance) <= self.judge.rounding[k]:
            return "touching"
        shapes = [self.question.bodies[i].shape for i in self.question.pairs[k]]
        if hit and any(map(is_compound_or_mesh, shapes)):
            return "inside" if any(map(has_mesh, shapes)) and self.is_inside(k) else "meeting"
        if hit:
            return "shallow" if abs(distance) <= NEAR * size else "deep"
        return "near" if distance <= NEAR * size else "apart"

    def is_inside(self, k: int) -> bool:
        i, j = self.question.pairs[k]
        if self._n_facets(i) * self._n_facets(j) > MAX_FACET_PAIRS:
            return False
        return self.judge.verdict(k).reasons[0] == INSIDE


def _gravest(flaws: list[list[Flaw]], truth: _Truth, table: Table, disputes: list[Disagreement], name: str) -> None:
    """Add an engine's flaws, one a case at most."""
    by_case: dict[int, list[Flaw]] = {}
    for dispute in disputes:
        k = int(dispute.a[1:]) if dispute.a[1:].isdigit() else 0
        flaw = _of_dispute(truth, k, dispute, name)
        if flaw is not None:
            by_case.setdefault(k, []).append(flaw)
    for k, row in enumerate(table.rows):
        mishap = table.mishaps[k]
        if mishap:
            hit = bool(row["hit"]) if row["answered"] else None
            by_case.setdefault(k, []).append(_mishap(truth, k, name, mishap, hit, table.reasons[k]))
    for k, several in by_case.items():
        flaws[k].append(min(several, key=lambda flaw: KINDS.index(flaw.kind)))


def _add_wrong_points(flaws: list[list[Flaw]], cases: list[Case], truth: _Truth, table: Table, name: str) -> None:
    """An engine's nearest points that are none, of pairs about which it says nothing else that is wrong."""
    for k, case in enumerate(cases):
        row, size = table.rows[k], truth.judge.size[k] or 1.0
        if any(flaw.engine == name for flaw in flaws[k]) or row["hit"] or truth.ours.rows["hit"][k]:
            continue
        off, why = points_off(case, row, float(truth.ours.rows["upper"][k]))
        if off > POINTS_TOLERANCE * size + truth.judge.rounding[k]:  # a tiny body may be far away
            gap, distance = truth.ours.rows[k], _number(row["distance"])
            flaws[k].append(Flaw(
                name, WRONG_POINTS, truth.position(k), False, distance, why, False, _number(gap["distance"]),
                _number(gap["lower"]), _number(gap["upper"]), BRACKET, off / size,
            ))


def _of_dispute(truth: _Truth, k: int, d: Disagreement, name: str) -> Flaw | None:
    """A disagreement as a flaw of one engine; None where that engine is not to blame."""
    size = truth.judge.size[k] or 1.0  # two points have none
    position = truth.position(k, d)
    blamed = name in d.wrong
    if d.kind == "left out":
        return _flaw(d, name, LEFT_OUT, position, math.inf)
    if d.kind == "contradiction":
        same = d.distance is not None and abs(d.distance) > 1e-12 * size
        return _flaw(d, name, CONTRADICTION, position, abs(d.distance or 0.0) / size) if same else None
    if not blamed or d.kind == "inside":
        return None
    if d.kind == "distance":
        if name == OURS:
            return _flaw(d, name, WRONG_BRACKET, position, math.inf)
        hit = d.reference_hit if d.exact_hit is None else d.exact_hit
        return _flaw(d, name, WRONG_DEPTH if hit else WRONG_GAP, position, (d.off or 0.0) / size)
    answer = d.reference_hit if name == OURS else d.hit
    excused = name in d.undecided or (d.touching and name not in d.proven)
    if excused or position == "touching":
        return None
    known = d.reference_distance if d.exact_distance is None else d.exact_distance
    return _flaw(d, name, FALSE_HIT if answer else FALSE_MISS, position, abs(known or 0.0) / size)


def _flaw(d: Disagreement, name: str, kind: str, position: str, severity: float) -> Flaw:
    ours = name == OURS and d.engine != OURS
    hit, distance = (d.reference_hit, d.reference_distance) if ours else (d.hit, d.distance)
    return Flaw(
        name, kind, position, hit, distance, d.note, d.exact_hit, d.exact_distance, d.lower, d.upper,
        d.judged_by, severity,
    )


def _mishap(truth: _Truth, k: int, name: str, mishap: str, hit: bool | None, reason: str) -> Flaw:
    row = truth.ours.rows[k]
    verdict = truth.judge.verdict(k)
    exact, lower, upper = verdict.rows[0], float(row["lower"]), float(row["upper"])
    known = bool(exact["answered"])
    return Flaw(
        name, mishap, truth.position(k), hit, None, reason,
        bool(exact["hit"]) if known else None, float(exact["distance"]) if exact["has_distance"] else None,
        lower if math.isfinite(lower) else None, upper if math.isfinite(upper) else None,
        EXACT if known else BRACKET if math.isfinite(lower + upper) else "", math.inf,
    )


def _refuted_by_supports(case: Case, truth: _Truth, ours: Table, k: int) -> list[Flaw]:
    """collide's bracket against a direction along which the bodies are farther apart than it says."""
    row = ours.rows[k]
    if not row["answered"] or not math.isfinite(row["upper"]):
        return []
    bound = lower_bound(*case.pair())
    slack = SLACK * float(max(classes.body_sizes(case.bodies[:2])))
    if bound is None or bound[0] <= float(row["upper"]) + slack:
        return []
    lower, upper = float(row["lower"]), float(row["upper"])
    return [Flaw(
        OURS, WRONG_BRACKET, truth.position(k), bool(row["hit"]), float(row["distance"]),
        f"along {np.round(bound[1], 6).tolist()} the bodies are {bound[0]!r} m apart", None, None, lower, upper,
        "support functions", (bound[0] - upper) / (truth.judge.size[k] or 1.0),
    )]


def world_flaws(case: Case) -> list[Flaw]:
    """Where a World says something else about the first two bodies than their pair query: collide's flaw."""
    bodies = [body._replace(name=f"b{k}") for k, body in enumerate(case.bodies)]
    question = Question(bodies, [(0, 1)], max_distance=0.1)
    world = CollidePeer().answer(question)
    alone = CollidePeer().answer(isolated([case]))
    ours, expected = world.rows[0], alone.rows[0]
    disjoint = ours["lower"] > expected["upper"] or ours["upper"] < expected["lower"]
    reason = world.reasons[0]
    if bool(ours["hit"]) == bool(expected["hit"]) and not disjoint and not reason and ours["answered"]:
        return []
    return [Flaw(
        OURS, LEFT_OUT if ours["answered"] else "exception", "deep" if expected["hit"] else "apart", bool(ours["hit"]),
        _number(ours["distance"]), reason, bool(expected["hit"]), _number(expected["distance"]), None, None,
        "its own pair query", math.inf,
    )]


def _number(value) -> float | None:
    return float(value) if math.isfinite(value) else None
