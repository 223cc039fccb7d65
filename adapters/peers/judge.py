"""The judge of disagreements: exact arithmetic says who is wrong, or the proven bracket does."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from collide.adapters.peers.exact_peer import INSIDE, ExactPeer, is_rounded
from collide.adapters.peers.protocol import Question, Table
from collide.adapters.peers.question import is_compound_or_mesh
from collide.reports import classes

if TYPE_CHECKING:
    from collide.adapters.peers.compare import Summary

EXACT, BRACKET = "exact arithmetic", "the proven bracket"



@dataclass
class Disagreement:
    """One pair on which an engine and the reference differ, or an engine contradicts itself.

    Distances are in metres, negative inside; None where an engine gives none.

    Parameters
    ----------
    engine : str
        The one that differs.
    kind : str
        "hit": the booleans differ. "distance": the distances do, by more than the tolerance, or the exact one lies
        outside a proven bracket. "inside": the engine sees surfaces that do not meet, and one body is inside the other.
        "contradiction": the engine's boolean and its own distance do not go together, or its bracket is upside down.
        "left out": a World reports no row where its own pair query finds one.
    a, b : str
        Names of the bodies.
    size : float
        Of the pair: the larger bounded body's diagonal [m].
    reference_hit, reference_distance : bool, float, or None
        What the reference answers; None where it was not asked.
    hit, distance : bool, float or None
        What the engine answers.
    exact_hit, exact_distance : bool, float, or None
        The verdict of exact arithmetic; None where it cannot tell. Of meshes that meet the distance is None.
    lower, upper : float or None
        The bracket that the reference proves [m]; None where there is none, or where it is unbounded.
    judged_by : str
        Exact arithmetic, or the bracket; empty where the pair is not judged.
    off : float or None
        How far the engine's distance is from the exact one, or outside the bracket [m]; None where not judged.
    touching : bool or None
        The pair touches within rounding; None where not judged.
    not_judged : str
        Why the pair is not judged; else empty.
    wrong, proven, undecided : list of str
        Engines that the verdict refutes, that claim a proof, and that say themselves that the boolean is open.
    note : str
        What the engine remarks.
    """

    engine: str
    kind: str
    a: str
    b: str
    size: float
    reference_hit: bool | None
    reference_distance: float | None
    hit: bool
    distance: float | None
    exact_hit: bool | None = None
    exact_distance: float | None = None
    lower: float | None = None
    upper: float | None = None
    judged_by: str = ""
    off: float | None = None
    touching: bool | None = None
    not_judged: str = ""
    wrong: list[str] = field(default_factory=list)
    proven: list[str] = field(default_factory=list)
    undecided: list[str] = field(default_factory=list)
    note: str = ""


class Judge:
    """Exact verdicts, each found once and only for pairs in dispute."""

    def __init__(self, question: Question, tolerance: float):
        self.question, self.tolerance = question, tolerance
        self.size = question.sizes()
        bodies = classes.body_sizes(question.bodies)
        self.rounding = [float(classes.roundings(bodies[i], bodies[j])) for i, j in question.pairs]
        self.compound_or_mesh = [is_compound_or_mesh(body.shape) for body in question.bodies]
        self._verdicts: dict[int, Table] = {}

    def verdict(self, k: int) -> Table:
        if k not in self._verdicts:
            alone = Question(self.question.bodies, [self.question.pairs[k]], isolated=True)
            self._verdicts[k] = ExactPeer().answer(alone)
        return self._verdicts[k]

    def settle(self, dispute: Disagreement, k: int, parties: list[tuple[str, np.void]]) -> Disagreement:
        """Write the verdict down, and who is wrong by it.

        parties : the engines concerned with their rows; where there are two the reference is the first.
        """
        table = self.verdict(k)
        row = table.rows[0]
        if row["answered"]:
            dispute.exact_hit, dispute.exact_distance = bool(row["hit"]), number_or_none(row["distance"])
            if dispute.kind == "hit" and table.reasons[0] == INSIDE and not dispute.hit:
                dispute.kind = "inside"
                parties = parties[:1]  # the reference alone knows insides
        why = self._not_exact(dispute, k, row["answered"], table.reasons[0])
        if not why:
            known = dispute.reference_distance if dispute.exact_distance is None else dispute.exact_distance
            dispute.touching = known is not None and bool(classes.is_touching(known, known, self.rounding[k]))
            self._charge(dispute, k, parties)
        elif len(parties) == 2 and dispute.lower is not None and dispute.upper is not None:
            self._charge_by_bracket(dispute, k, parties, why)
        else:
            dispute.not_judged = why
        return dispute

    def _not_exact(self, dispute: Disagreement, k: int, answered: bool, reason: str) -> str:
        """Why exact arithmetic says nothing about a dispute; empty where it does."""
        if not answered:
            return reason
        pair = self.question.pairs[k]
        exact = dispute.exact_distance
        touching = exact is not None and classes.is_touching(exact, exact, self.rounding[k])
        if touching and is_rounded(*(self.question.bodies[i] for i in pair)):
            return "touching within the rounding of the body itself"
        if dispute.kind == "distance" and dispute.exact_hit and any(self.compound_or_mesh[i] for i in pair):
            return "the depth of a union"
        return ""

    def _charge(self, dispute: Disagreement, k: int, parties: list[tuple[str, np.void]]) -> None:
        """Name who is wrong by the exact verdict, who claimed a proof, and who admitted not to know."""
        dispute.judged_by = EXACT
        truth = float(dispute.exact_distance or 0.0)
        if dispute.distance is not None and dispute.exact_distance is not None:
            dispute.off = abs(dispute.distance - truth)
        for name, answer in parties:
            missed = self.misses(k, answer, truth)
            if dispute.kind == "distance":
                refuted = missed or abs(answer["distance"] - truth) > self.tolerance * dispute.size
            else:
                refuted = missed or bool(answer["hit"]) != dispute.exact_hit
            if refuted:
                dispute.wrong.append(name)
            if missed or answer["certified"]:  # a bracket is a claim of proof, too
                dispute.proven.append(name)
            elif answer["undecided"]:
                dispute.undecided.append(name)

    def _charge_by_bracket(self, dispute: Disagreement, k: int, parties: list[tuple[str, np.void]], why: str) -> None:
        """Judge the engine by what the reference proves, where exact arithmetic cannot."""
        (reference, ours), (name, answer) = parties
        lower, upper = float(ours["lower"]), float(ours["upper"])
        dispute.touching = bool(classes.is_touching(lower, upper, self.rounding[k]))
        dispute.off = outside(answer["distance"], lower, upper) if answer["has_distance"] else None
        if dispute.kind == "distance":
            refuted = dispute.off is not None and dispute.off > self.tolerance * dispute.size
        elif dispute.touching:
            dispute.not_judged = why
            return
        else:
            refuted = bool(answer["hit"]) == (lower > 0.0)
        dispute.judged_by = BRACKET
        dispute.proven.append(reference)
        dispute.wrong += [name] if refuted else []

    def misses(self, k: int, answer: np.void, truth: float) -> bool:
        """Whether a proven bracket does not hold the exact distance, which was rounded once."""
        pair = self.question.pairs[k]
        if truth <= 0 and any(self.compound_or_mesh[i] for i in pair):
            return False  # exact arithmetic has the depths of parts, not of the union
        slack = self.rounding[k] if is_rounded(*(self.question.bodies[i] for i in pair)) else 0.0
        below = answer["lower"] > np.nextafter(truth, np.inf) + slack
        return bool(below or answer["upper"] < np.nextafter(truth, -np.inf) - slack)


def outside(distance: float, lower: float, upper: float) -> float:
    """How far a distance is outside a bracket [m]; 0 within it."""
    return float(max(lower - distance, distance - upper, 0.0))


def _dispute(judge: Judge, k: int, kind: str, theirs: Table, ours: Table | None = None) -> Disagreement:
    a, b = judge.question.names(k)
    row, reference = theirs.rows[k], None if ours is None else ours.rows[k]
    dispute = Disagreement(
        theirs.engine, kind, a, b, judge.size[k],
        None if reference is None else bool(reference["hit"]),
        None if reference is None else number_or_none(reference["distance"]),
        bool(row["hit"]), number_or_none(row["distance"]), note=theirs.reasons[k],
    )
    if reference is not None:
        dispute.lower, dispute.upper = number_or_none(reference["lower"]), number_or_none(reference["upper"])
    parties = [(theirs.engine, row)] if ours is None else [(ours.engine, reference), (theirs.engine, row)]
    return judge.settle(dispute, k, parties)


def contradictions(judge: Judge, table: Table) -> list[Disagreement]:
    """Where an engine contradicts itself."""
    disputes = []
    for k, row in enumerate(table.rows):
        if not row["answered"]:
            continue
        beyond_rounding = row["has_distance"] and abs(row["distance"]) > judge.rounding[k]
        opposed = beyond_rounding and not row["undecided"] and bool(row["hit"]) != bool(row["distance"] < 0)
        if opposed or row["lower"] > row["upper"]:
            disputes.append(_dispute(judge, k, "contradiction", table))
        elif "left this pair out" in table.reasons[k]:
            disputes.append(_dispute(judge, k, "left out", table))
    return disputes


def differences(judge: Judge, ours: Table, theirs: Table, summary: Summary) -> list[Disagreement]:
    """Where two engines differ, in their booleans or their distances; the largest differences go into the summary."""
    disputes = []
    for k in np.flatnonzero(ours.rows["answered"] & theirs.rows["answered"]).tolist():
        ours_row, theirs_row = ours.rows[k], theirs.rows[k]
        differing = _dispute(judge, k, "hit", theirs, ours) if ours_row["hit"] != theirs_row["hit"] else None
        disputes += [differing] if differing else []
        summary.agreeing += differing is None
        if not (ours_row["has_distance"] and theirs_row["has_distance"]) or (differing and differing.kind == "inside"):
            continue
        lower, upper = bracket_of(ours_row)
        is_deep = lower < -judge.rounding[k] and ours_row["hit"]
        if is_deep and any(judge.compound_or_mesh[i] for i in judge.question.pairs[k]):
            continue  # engines mean different things by the depth of a union
        difference = abs(float(ours_row["distance"]) - float(theirs_row["distance"]))
        (summary.depth if ours_row["hit"] else summary.gap).see(difference, *judge.question.names(k))
        missed = theirs.engine == "exact" and judge.misses(k, ours_row, float(theirs_row["distance"]))
        if missed or outside(theirs_row["distance"], lower, upper) > judge.tolerance * judge.size[k]:
            disputes.append(_dispute(judge, k, "distance", theirs, ours))
    return disputes


def bracket_of(row: np.void) -> tuple[float, float]:
    """What an engine proves of its distance, or the distance itself."""
    if math.isnan(row["lower"]) or math.isnan(row["upper"]):
        return float(row["distance"]), float(row["distance"])
    return float(row["lower"]), float(row["upper"])


def number_or_none(value) -> float | None:
    return float(value) if math.isfinite(value) else None
