"""Ask several engines the same question and settle every disagreement by exact arithmetic.

    from collide.adapters.peers.compare import compare
    comparison = compare(scene, engines=("fcl", "coal", "pybullet"))
    comparison.ours_wrong       # how often collide is refuted by exact arithmetic, contradicts itself or fails
    headers, rows = comparison.table()

A boolean disagreement about a pair that touches within rounding (`collide.reports.classes`, as in reports) is "within
rounding": both engines computed with rounded numbers, and one ulp decides. It counts against an engine only where
that engine claims a proof.

A distance is wrong where it is off by more than the tolerance. What exact arithmetic cannot judge (cylinders, cones,
ellipsoids, half-spaces, depths of unions) is judged by the bracket that the reference proves, and ``judged_by`` says
so: a distance outside it by more than the tolerance is wrong, and so is a boolean that its sign refutes beyond
rounding. Where there is no bracket either, the pair is not judged, and counts against nobody.

The other engines see a mesh as a surface. Here a closed one is a solid, and a body wholly inside it hits: where exact
arithmetic finds that no surfaces meet and one body lies inside the other, a peer's "apart" is the right answer to
the question it understands. Such pairs are a class of their own, "inside", and no error of the peer.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass, field

import numpy as np

from collide.adapters.peers.answers import counted
from collide.adapters.peers.judge import Disagreement, Judge, contradictions, differences
from collide.adapters.peers.protocol import Peer, Question, Table, check_names, engine
from collide.adapters.peers.question import ask
from collide.errors import InvalidArgument

#: What other engines promise of a distance, as a part of the pair's size; larger differences are listed.
TOLERANCE = 1e-6


@dataclass
class Largest:
    """The largest difference between two engines' distances [m], and the pair it stands at."""

    difference: float = 0.0
    a: str = ""
    b: str = ""
    pairs: int = 0

    def see(self, difference: float, a: str, b: str) -> None:
        self.pairs += 1
        if difference > self.difference or not self.a:
            self.difference, self.a, self.b = difference, a, b


@dataclass
class Summary:
    """How one engine did. Counts are of pairs.

    skipped : why the engine was not asked at all; the rest is then 0.
    inside : pairs that it calls apart because it sees surfaces, one body being inside the other: neither
        an agreement nor a disagreement.
    agreeing : same boolean as the reference.   hit_disagreements : the other one.
    wrong : booleans that exact arithmetic refutes beyond rounding (or within it, where proven).
    wrong_within_rounding : refuted, but the pair touches within rounding, or the engine said itself
        that rounding leaves it open (undecided) and its bracket holds the truth.
    wrong_distances : off by more than the tolerance.   furthest_off : the worst of them.
    contradictions : boolean against own distance, beyond rounding.
    gap, depth : largest differences to the reference, apart and overlapping; overlaps of unions and meshes
        are left out, since engines mean different things by their depth.
    failed : each pair lost, with the reason and the kind of mishap.   unsupported : reasons and their counts.
    mishaps : how many answers of each kind of `collide.adapters.peers.answers.MISHAPS`: those of the failed, and
        distances that are NaN or no length.
    about, receives, cannot : which of its calls were asked, what it was really given, and what it cannot answer.
    seconds : spent in this engine's interface; not a benchmark.
    """

    engine: str
    version: str = ""
    skipped: str = ""
    asked: int = 0
    answered: int = 0
    hits: int = 0
    undecided: int = 0
    without_distance: int = 0
    agreeing: int = 0
    hit_disagreements: int = 0
    inside: int = 0
    distance_disagreements: int = 0
    wrong: int = 0
    wrong_within_rounding: int = 0
    wrong_distances: int = 0
    contradictions: int = 0
    not_judged: int = 0
    gap: Largest = field(default_factory=Largest)
    depth: Largest = field(default_factory=Largest)
    furthest_off: Largest = field(default_factory=Largest)
    mishaps: dict[str, int] = field(default_factory=dict)
    about: str = ""
    receives: list[str] = field(default_factory=list)
    cannot: list[str] = field(default_factory=list)
    failed: list[dict[str, str]] = field(default_factory=list)
    unsupported: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0


@dataclass
class Comparison:
    """What was asked, how each engine did, and every disagreement, as plain data.

    Parameters
    ----------
    reference : str
        The engine that the others are compared with.
    bodies, pairs : int
        How many were asked about.
    max_distance : float
        The clearance of interest [m].
    tolerance : float
        Of distances, as a part of the pair's size.
    summaries : list of Summary
        The reference first, then the engines in the order asked for.
    disagreements : list of Disagreement
        Engine by engine, pairs in the order asked.
    """

    reference: str
    bodies: int
    pairs: int
    max_distance: float
    tolerance: float
    summaries: list[Summary]
    disagreements: list[Disagreement]

    @property
    def ours_wrong(self) -> int:
        """How many answers of the reference are known to be wrong, or owed.

        Refuted booleans and distances, contradictions, and pairs on which it failed.
        """
        ours = self.summaries[0]
        return ours.wrong + ours.wrong_distances + ours.contradictions + len(ours.failed)

    @property
    def peers_wrong(self) -> int:
        """Answers of the other engines known to be wrong: refuted booleans and distances, and contradictions."""
        return sum(s.wrong + s.wrong_distances + s.contradictions for s in self.summaries[1:])

    def summary(self, name: str) -> Summary:
        """How one engine did.

        Parameters
        ----------
        name : str
            Of the engine.

        Returns
        -------
        Summary
            Its counts.

        Raises
        ------
        InvalidArgument
            Where it was not asked.
        """
        for summary in self.summaries:
            if summary.engine == name:
                return summary
        raise InvalidArgument(f"{name!r} was not asked; there are {', '.join(s.engine for s in self.summaries)}")

    def to_dict(self) -> dict:
        """The comparison for JSON.

        Returns
        -------
        dict
            Of dicts, lists, texts and finite numbers.
        """
        return asdict(self) | {"ours_wrong": self.ours_wrong, "peers_wrong": self.peers_wrong}

    def table(self) -> tuple[list[str], list[list[str]]]:
        """The comparison as text for printing, one row per engine.

        "differ" counts booleans, "inside" those that differ because the engine sees surfaces only, "wrong distances"
        those off by more than the tolerance, "furthest off" the worst of them, "largest" differences both engines' own.

        Returns
        -------
        headers : list of str
            Of the columns.
        rows : list of list of str
            A cell a column.
        """
        headers = [
            "engine", "version", "answered", "agree", "differ", "inside", "wrong", "within rounding", "not judged",
            "contradicts itself", "wrong distances", "furthest off", "largest gap difference",
            "largest depth difference",
            "failed", "unsupported", "mishaps",
        ]
        return headers, [_printed(s, s.engine == self.reference) for s in self.summaries]


def compare(
    of, engines=("fcl", "coal", "pybullet"), *, reference: str = "collide", max_distance: float = 0.0,
    tolerance: float = TOLERANCE, every_pair: bool = False, timeout: float = 10.0,
) -> Comparison:
    """Ask every engine about every pair that the scene tests, and judge what they disagree on.

    Parameters
    ----------
    of : Scene, World, Question, or iterable of (A, B, X_WA, X_WB)
        What is asked: shapes and their (4, 4) poses.
    engines : sequence of str
        Names from `collide.adapters.peers.protocol.ENGINES`; one whose package is missing is skipped with the reason.
    reference : str
        What the others are compared with.
    max_distance : float
        The clearance of interest [m]. Pairs with bounding boxes farther apart than this, and than a tenth of the scene,
        are not asked.
    tolerance : float
        Of distances, as a part of the pair's size.
    every_pair : bool
        Ask far pairs too.
    timeout : float
        How long an isolated engine may take for one pair [s].

    Returns
    -------
    Comparison
        Plain data; every disagreement is judged by exact arithmetic, or by the proven bracket.

    Raises
    ------
    InvalidArgument
        For unknown engines.
    MissingExtra
        Where the reference itself is missing.
    """
    if isinstance(engines, str) or not all(isinstance(name, str) for name in engines):
        raise InvalidArgument(f"engines must be a sequence of names, got {engines!r}")
    check_names((reference, *engines))
    question = ask(of, max_distance, every_pair=every_pair)
    judge = Judge(question, tolerance)
    ours_engine = engine(reference, isolated=False)
    ours = ours_engine.answer(question)
    summaries = [_counts(question, ours, ours_engine)]
    disagreements = contradictions(judge, ours)
    for name in dict.fromkeys(n for n in engines if n != reference):
        peer = engine(name, timeout=timeout)
        if peer.missing():
            summaries.append(Summary(name, skipped=str(peer.missing()), **_statement(peer)))
            continue
        theirs = peer.answer(question)
        summaries.append(_counts(question, theirs, peer))
        disagreements += contradictions(judge, theirs) + differences(judge, ours, theirs, summaries[-1])
    for summary in summaries:
        _tally(summary, disagreements, reference)
    return Comparison(
        reference, len(question.bodies), len(question.pairs), float(question.max_distance), tolerance,
        summaries, disagreements,
    )


def _statement(peer: Peer) -> dict:
    """What an engine says of itself."""
    return {"about": peer.about, "receives": list(peer.receives), "cannot": list(peer.cannot)}


def _counts(question: Question, table: Table, peer: Peer) -> Summary:
    """What can be counted from one engine's table alone."""
    rows = table.rows
    return Summary(
        table.engine, table.version,
        asked=len(rows), answered=int(rows["answered"].sum()), hits=int(rows["hit"].sum()),
        undecided=int(rows["undecided"].sum()),
        without_distance=int((rows["answered"] & ~rows["has_distance"]).sum()),
        failed=[
            {"a": a, "b": b, "reason": table.reasons[k], "mishap": table.mishaps[k]}
            for k in np.flatnonzero(rows["failed"]).tolist() for a, b in [question.names(k)]
        ],
        unsupported=dict(Counter(table.reasons[k] for k in np.flatnonzero(rows["unsupported"]))),
        mishaps=dict(Counter(filter(None, table.mishaps))), seconds=float(rows["seconds"].sum()), **_statement(peer),
    )


def _tally(summary: Summary, disagreements: list[Disagreement], reference: str) -> None:
    """Counts of the disagreements that concern one engine; a pair counts once for the reference."""
    wrong: set[tuple[str, str]] = set()
    rounding: set[tuple[str, str]] = set()
    distances: set[tuple[str, str]] = set()
    for d in disagreements:
        pair = d.a, d.b
        if d.engine == summary.engine:
            summary.hit_disagreements += d.kind == "hit"
            summary.inside += d.kind == "inside"
            summary.distance_disagreements += d.kind == "distance"
            summary.contradictions += d.kind in ("contradiction", "left out")
            summary.not_judged += bool(d.not_judged)
        if summary.engine in d.wrong:
            excused = summary.engine in d.undecided or (d.touching and summary.engine not in d.proven)
            (distances if d.kind == "distance" else rounding if excused else wrong).add(pair)
            if d.kind == "distance" and d.engine == summary.engine and d.off is not None:
                summary.furthest_off.see(d.off, *pair)
    summary.wrong, summary.wrong_within_rounding, summary.wrong_distances = map(len, (wrong, rounding, distances))


def _printed(s: Summary, is_reference: bool) -> list[str]:
    if s.skipped:
        return [s.engine, f"skipped: {s.skipped}", *[""] * 15]
    agree, differ, inside = ("", "", "") if is_reference else map(str, (s.agreeing, s.hit_disagreements, s.inside))
    largest = ("", "") if is_reference else (_length(s.gap), _length(s.depth))
    return [
        s.engine, s.version, f"{s.answered} of {s.asked}", agree, differ, inside, str(s.wrong),
        str(s.wrong_within_rounding),
        str(s.not_judged), str(s.contradictions), str(s.wrong_distances), _length(s.furthest_off), *largest,
        str(len(s.failed)), str(sum(s.unsupported.values())), counted(s.mishaps),
    ]


def _length(largest: Largest) -> str:
    return f"{largest.difference:.1e} m" if largest.pairs else "-"
