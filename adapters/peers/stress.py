"""Ask an engine the hard families, and count what exact arithmetic refutes.

    from collide.adapters.peers.stress import run
    table = run(None, n=40, seed=1)                  # every family, collide itself
    table = run(["near_sep"], n=300, engine="coal")
    headers, rows = table.table();  table.wrong;  table.save("wrong.json")

collide is asked in this process, both its boolean and its distance, and each must be right by itself.
Other engines are asked through the peers' protocol, those that can end the interpreter in a child
process. Nothing counts as wrong that an engine itself calls undecided: those rows are counted apart.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from decimal import Decimal
from typing import NamedTuple

import collide
from collide.adapters.peers.answers import FAILED, RAISED, UNSUPPORTED, counted
from collide.adapters.peers.protocol import Peer, Question, check_names, complaint, engine
from collide.adapters.peers.stress_truth import Truth, gap_along, truth
from collide.base.whole_file import write_whole
from collide.errors import UnsupportedQuery
from collide.results import HOW, UNDECIDED
from collide.scenes.families import Case, MeshCase, generate, mesh_names, names

#: Cases that go to a peer at a time: a child process that dies often is not given up.
BATCH = 50

HIT, BRACKET, CRASH = "boolean", "bracket", "failed"


#: Why an engine's "apart" is no answer to the question.
SURFACES = "one mesh lies inside the other, and this engine sees surfaces"


class Reply(NamedTuple):
    """What an engine says about one case; distances in m, NaN where it gives none.

    hits : every boolean it gave: one, or that of the boolean query and that of the distance.
    how : which of its arguments decided (collide only).   undecided : it says rounding leaves the
        boolean open.   certified : it calls its answer certified (collide only).
        failed, unsupported : the reason where there is no answer, else "".
    mishap : one of `collide.adapters.peers.answers.MISHAPS`, or "".
    """

    hits: tuple[bool, ...] = ()
    distance: float = math.nan
    lower: float = math.nan
    upper: float = math.nan
    how: str = ""
    undecided: bool = False
    certified: bool = False
    normal: tuple[float, float, float] = (math.nan,) * 3
    failed: str = ""
    unsupported: str = ""
    mishap: str = ""


@dataclass
class Finding:
    """One answer that exact arithmetic refutes, or one that was owed.

    kind : "boolean", "bracket" (the proven bracket misses the exact value or the distance given) or "failed".
    exact : the signed distance to 30 digits [m].   gap : its size as a part of L.
    case : the numbers, as `Case.from_dict` takes them.   snippet : Python that asks collide again.
    """

    kind: str
    engine: str
    family: str
    index: int
    exact: str
    gap: float
    answer: dict
    case: dict
    snippet: str


@dataclass
class FamilyResult:
    """How an engine did on one family. Counts are of cases; gaps are |exact gap| / L.

    hits : by exact arithmetic.   wrong : refuted booleans, of them `false_hits` and `false_misses`.
    wrong_gap, undecided_gap : the largest gap among the wrong, and among the undecided; None: there
        are none.   undecided_wrong : of the undecided, those whose boolean is not the exact one.
    missed : proven brackets that do not hold the exact value, by `missed_by` of L at most, or not the
        engine's own distance.
    certified : answers that the engine calls so.
    how : what decided, and how often.   failed, unsupported : without an answer; `reasons` say why.
    mishaps : answers of their own kind, counted: exceptions, aborts, hangs, and distances that are no length.
    distance_error, depth_error : largest error as a part of the exact gap or depth; the same as a part
        of L in distance_error_of_size and depth_error_of_size; None: nothing to compare.
    normal_excess : by how much the gap along the normal given falls short of the exact signed distance, at
        most, as a part of L: 0 for the right normal, whichever of several it is.
    """

    family: str
    cases: int = 0
    hits: int = 0
    answered: int = 0
    wrong: int = 0
    false_hits: int = 0
    false_misses: int = 0
    wrong_gap: float | None = None
    undecided: int = 0
    undecided_wrong: int = 0
    undecided_gap: float | None = None
    missed: int = 0
    missed_by: float | None = None
    certified: int = 0
    failed: int = 0
    unsupported: int = 0
    distance_error: float | None = None
    distance_error_of_size: float | None = None
    depth_error: float | None = None
    depth_error_of_size: float | None = None
    normal_excess: float | None = None
    how: dict[str, int] = field(default_factory=dict)
    reasons: dict[str, int] = field(default_factory=dict)
    mishaps: dict[str, int] = field(default_factory=dict)

    def see(self, name: str, value: float | Decimal) -> None:
        """Keep the larger of a recorded largest value and this one."""
        known = getattr(self, name)
        if known is None or value > known:
            setattr(self, name, float(value))


@dataclass
class StressTable:
    """Who was asked what, one row a family, and every finding, as plain data.

    Parameters
    ----------
    engine, version : str
        Who was asked.
    n, seed : int
        Cases a family, and the seed they were made with.
    families : list of FamilyResult
        Counts and largest errors.
    findings : list of Finding
        Every refuted answer, with a snippet that repeats it.
    """

    engine: str
    version: str
    n: int
    seed: int
    families: list[FamilyResult]
    findings: list[Finding]

    @property
    def wrong(self) -> int:
        """Refuted booleans and brackets that miss, over all families."""
        return sum(f.wrong + f.missed for f in self.families)

    @property
    def failed(self) -> int:
        """Cases without an answer that the engine did not refuse by name."""
        return sum(f.failed for f in self.families)

    @property
    def undecided(self) -> int:
        """Cases that the engine itself leaves open."""
        return sum(f.undecided for f in self.families)

    def to_dict(self) -> dict:
        """The table for JSON, the findings' numbers included.

        Returns
        -------
        dict
            Of dicts, lists, texts and finite numbers.
        """
        return {**asdict(self), "wrong": self.wrong, "failed": self.failed, "undecided": self.undecided}

    def save(self, path) -> None:
        """Write every finding to a JSON file, numbers and snippet.

        Parameters
        ----------
        path : str or Path
            The file; one that exists is overwritten.
        """
        data = {"engine": self.engine, "version": self.version, "n": self.n, "seed": self.seed}
        text = json.dumps({**data, "findings": [asdict(f) for f in self.findings]}, indent=1, allow_nan=False)
        write_whole(path, text + "\n")

    def table(self) -> tuple[list[str], list[list[str]]]:
        """The table as text for printing, a row a family and one of totals.

        "wrong" is followed by its largest gap as a part of L, p for false hits and n for false misses; errors are parts
        of the exact value, the normal's excess of L.

        Returns
        -------
        headers : list of str
            Of the columns.
        rows : list of list of str
            A cell a column.
        """
        headers = [
            "family", "cases", "hits", "wrong", "undecided", "missed brackets", "failed", "unsupported", "mishaps",
            "distance error", "depth error", "normal excess", "decided by",
        ]
        rows = [_printed(f) for f in self.families]
        return headers, [*rows, _printed(self.total())] if len(rows) > 1 else rows

    def total(self) -> FamilyResult:
        """All families as one row.

        Returns
        -------
        FamilyResult
            Named "all": counts added, the largest of errors.
        """
        total = FamilyResult("all")
        for f in self.families:
            for name, value in vars(f).items():
                if isinstance(value, dict):
                    setattr(total, name, dict(Counter(getattr(total, name)) + Counter(value)))
                elif isinstance(value, float):
                    total.see(name, value)
                elif isinstance(value, int):
                    setattr(total, name, getattr(total, name) + value)
        return total


def run(
    families: Iterable[str] | str | None = None, n: int = 40, seed: int = 0, engine: str = "collide", *,
    timeout: float = 10.0, progress: Callable[[FamilyResult], None] | None = None,
) -> StressTable:
    """Ask one engine n cases of each family, and judge every answer in exact arithmetic.

    Parameters
    ----------
    families : str or iterable of str, optional
        Names of `collide.scenes.families`; None for all of them.
    n : int
        Cases a family.
    seed : int
        Other seeds make other cases.
    engine : str
        A name of `collide.adapters.peers.protocol.ENGINES`.
    timeout : float
        Of an isolated engine's answer to one case [s].
    progress : callable, optional
        Called with each family's result as it comes.

    Returns
    -------
    StressTable
        A row a family, and every refuted answer.

    Raises
    ------
    InvalidArgument
        For unknown families and engines.
    MissingExtra
        Where the engine is absent.
    """
    check_names([engine])
    wanted = (
        [*names(), *mesh_names()] if families is None else [families] if isinstance(families, str) else list(families)
    )
    for family in wanted:
        generate(family, 0, seed)  # complain before the work begins
    peer = _peer(engine, timeout)
    table = StressTable(engine, peer.version, n, seed, [], [])
    with peer.staying():
        for family in wanted:
            cases = generate(family, n, seed)
            result = FamilyResult(family)
            for case, reply in zip(cases, _ask(peer, cases)):
                table.findings += _judge(result, engine, case, truth(case), reply)
            table.families.append(result)
            if progress is not None:
                progress(result)
    return table


# --- asking ---------------------------------------------------------------------------------------


def _peer(name: str, timeout: float) -> Peer:
    peer = engine(name, timeout=timeout)
    peer.require()
    return peer


def _ask(peer: Peer, cases: list[Case | MeshCase]) -> list[Reply]:
    if peer.name == "collide":
        return [_ask_collide(case) for case in cases]
    replies: list[Reply] = []
    for start in range(0, len(cases), BATCH):
        table = peer.answer(Question.from_pairs([case.shapes() for case in cases[start : start + BATCH]]))
        replies += map(_from_row, table.rows, table.reasons, table.mishaps)
    return replies


def _from_row(row, reason: str, mishap: str) -> Reply:
    """A row of the protocol's table as a reply."""
    if not row["answered"]:
        failed = bool(row[FAILED]) or not row[UNSUPPORTED]
        return Reply(failed=reason or "no answer", mishap=mishap) if failed else Reply(unsupported=reason)
    normal = tuple(row["normal"].tolist())
    return Reply((bool(row["hit"]),), float(row["distance"]), normal=normal, mishap=mishap)


def _ask_collide(case: Case | MeshCase) -> Reply:
    """The engine's boolean and its distance; an exception is a failure, whatever its kind."""
    try:
        question = case.shapes()
        hit = bool(collide.collide(*question))
        row = collide.distance(*question).rows[0]
    except UnsupportedQuery as error:
        return Reply(unsupported=complaint(error))
    except Exception as error:  # noqa: BLE001 - any failure of the engine under test is a finding
        return Reply(failed=complaint(error), mishap=RAISED)
    return Reply(
        (hit, bool(row["hit"])), float(row["distance"]), float(row["lower"]), float(row["upper"]),
        HOW[row["how"]], bool(row["how"] == UNDECIDED), bool(row["certified"]), tuple(row["normal"].tolist()),
    )


# --- judging --------------------------------------------------------------------------------------


def _judge(result: FamilyResult, name: str, case: Case | MeshCase, exact: Truth, reply: Reply) -> list[Finding]:
    """Count one reply, and return what is wrong with it."""
    result.cases += 1
    result.hits += exact.hit
    if name != "collide" and exact.inside and not (reply.failed or reply.unsupported or any(reply.hits)):
        reply = Reply(unsupported=SURFACES)
    if reply.mishap:
        result.mishaps[reply.mishap] = result.mishaps.get(reply.mishap, 0) + 1
    if reply.failed or reply.unsupported:
        result.failed += bool(reply.failed)
        result.unsupported += not reply.failed
        reason = reply.failed or reply.unsupported
        result.reasons[reason] = result.reasons.get(reason, 0) + 1
        return [_finding(CRASH, name, case, exact, reply)] if reply.failed else []
    result.answered += 1
    result.certified += reply.certified
    if reply.how:
        result.how[reply.how] = result.how.get(reply.how, 0) + 1
    kinds = [HIT] if _count_boolean(result, exact, reply) else []
    kinds += [BRACKET] if _count_bracket(result, name, exact, reply) else []
    _count_errors(result, exact, reply)
    along = gap_along(case, reply.normal)
    if along is not None and exact.distance is not None:
        result.see("normal_excess", max(0.0, float(exact.distance - along)) / exact.size)
    return [_finding(kind, name, case, exact, reply) for kind in kinds]


def _gap(exact: Truth) -> float:
    if exact.distance is None:
        return 0.0
    return abs(float(exact.distance)) / exact.size


def _count_boolean(result: FamilyResult, exact: Truth, reply: Reply) -> bool:
    """Whether a boolean is refuted, and not left open by the engine itself."""
    refuted = any(hit != exact.hit for hit in reply.hits)
    if reply.undecided:
        result.undecided += 1
        result.undecided_wrong += refuted
        result.see("undecided_gap", _gap(exact))
        return False
    if refuted:
        result.wrong += 1
        result.false_misses += exact.hit
        result.false_hits += not exact.hit
        result.see("wrong_gap", _gap(exact))
    return refuted


def _count_bracket(result: FamilyResult, name: str, exact: Truth, reply: Reply) -> bool:
    """Whether a proven bracket misses the exact value, or the engine's own distance; only collide
    gives any."""
    if name != "collide":
        return False
    lower, distance, upper = reply.lower, reply.distance, reply.upper
    if lower <= distance <= upper and not exact.misses(lower, upper):
        return False
    result.missed += 1
    if not (math.isnan(lower) or math.isnan(upper)):
        about = exact.distance or Decimal(0)
        ends = (Decimal(lower) - about, about - Decimal(upper))
        result.see("missed_by", float(max(*ends, Decimal(0))) / exact.size)
    return True


def _count_errors(result: FamilyResult, exact: Truth, reply: Reply) -> None:
    if not abs(reply.distance) < math.inf:
        return
    error, name = exact.off(reply.distance), "depth_error" if exact.hit else "distance_error"
    if error is None or exact.distance is None:
        return
    result.see(f"{name}_of_size", float(error) / exact.size)
    if exact.distance:
        result.see(name, error / abs(exact.distance))


def _finding(kind: str, name: str, case: Case | MeshCase, exact: Truth, reply: Reply) -> Finding:
    # JSON has no NaN and no infinity.
    answer = {key: _plain(value) for key, value in reply._asdict().items()}
    return Finding(
        kind, name, case.family, case.index, str(exact.distance), _gap(exact), answer, case.to_dict(), case.snippet()
    )


def _plain(value):
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# --- printing -------------------------------------------------------------------------------------


def _printed(f: FamilyResult) -> list[str]:
    return [
        f.family, str(f.cases), str(f.hits), _wrong(f),
        _with_gap(f.undecided, f.undecided_gap), _with_gap(f.missed, f.missed_by), str(f.failed), str(f.unsupported),
        counted(f.mishaps),
        _part(f.distance_error), _part(f.depth_error), _part(f.normal_excess), _shares(f),
    ]


def _wrong(f: FamilyResult) -> str:
    kinds = [f"{count}{letter}" for count, letter in ((f.false_hits, "p"), (f.false_misses, "n")) if count]
    return f"{' '.join(kinds)} @{f.wrong_gap:.0e}" if kinds and f.wrong_gap is not None else "0"


def _with_gap(count: int, gap: float | None) -> str:
    return f"{count} @{gap:.0e}" if count and gap is not None else str(count)


def _part(error: float | None) -> str:
    return "-" if error is None else f"{error:.0e}"


def _shares(f: FamilyResult) -> str:
    total = sum(f.how.values())
    return ", ".join(f"{name} {count / total:.0%}" for name, count in sorted(f.how.items(), key=lambda kv: -kv[1]))
