"""Checks of a report for scripts: pairs counted as collisions, and new pairs among them.

A baseline is a JSON file of known collisions: written by `baseline_text`, or any report's. A collision is known if the
baseline has the pair and the pair is at most a tolerance deeper than in the baseline.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from collide.base.given_files import read_text
from collide.errors import InvalidArgument, SceneError
from collide.reports import trajectory_report as trajectory
from collide.reports.number_format import brief_length, count
from collide.reports.report import Report
from collide.reports.tables import printable

SCHEMA = "collide-baseline/1"
COLLISION, SHALLOW, TOUCHING, KNOWN, DEEPER, GONE = "collision", "shallow", "touching", "known", "deeper", "gone"
#: Nearer than the clearance; neither proven apart nor met along a trajectory.
NEAR, UNPROVEN = "near", "unproven"
#: Classes that a baseline may hold.
_KNOWN_CLASSES = (COLLISION, TOUCHING)
#: Names of the kinds of findings, by class of the report; the worst first.
_CLASSES = {COLLISION: "colliding", SHALLOW: "shallow", TOUCHING: "touching", NEAR: "near"}


class Finding(NamedTuple):
    """A pair found by a check: ``what`` names its kind; signed distance [m], ``None`` for unbounded depths.

    where : of a trajectory, the share of the path at the begin of contact.   before : depth in the baseline [m].
    """

    what: str
    a: str
    b: str
    distance: float | None
    where: str = ""
    before: float | None = None

    @property
    def depth(self) -> float:
        return math.inf if self.distance is None else max(0.0, -self.distance)


@dataclass
class Check:
    """The findings in a state, and whether they fail the check.

    label : of the state, "" without a named state.   failing : findings counted as collisions; ``findings``
        begins with them.
    """

    label: str
    scene: str
    bodies: list[str]
    summary: str
    findings: list[Finding] = field(default_factory=list)
    failing: list[Finding] = field(default_factory=list)
    unanswered: list[dict] = field(default_factory=list)
    against_baseline: bool = False

    @property
    def fails(self) -> bool:
        return bool(self.failing)

    def lines(self, several: bool) -> Iterator[str]:
        """A line a finding, fields separated by tabs; with the state where a check has several."""
        for finding in self.findings:
            measure = "unbounded" if finding.distance is None else repr(finding.distance)
            extra = [text for text in (printable(self.label) if several else "", finding.where) if text]
            yield "\t".join((finding.what, printable(finding.a), printable(finding.b), measure, *extra))

    def verdict(self) -> str:
        label = f"{self.label}: " if self.label else ""
        if not self.against_baseline:
            return label + self.summary
        counts = {what: sum(finding.what == what for finding in self.findings) for what in (KNOWN, DEEPER, GONE)}
        new = len(self.failing) - counts[DEEPER]
        parts = [count(new, "new collision") if new else "no new collision"]
        parts += [f"{counts[DEEPER]} known and deeper than before"] if counts[DEEPER] else []
        parts += [f"{counts[what]} {word}" for what, word in ((KNOWN, "known"), (GONE, "gone")) if counts[what]]
        deeper = next((finding for finding in self.findings if finding.what == DEEPER), None)
        deepened = "" if deeper is None else (
            f"; {deeper.a} and {deeper.b}: {brief_length(deeper.depth)} deep, was {_length(deeper.before)}"
        )
        return f"{label}{', '.join(parts)}{deepened} ({self.summary})"


def _length(depth: float | None) -> str:
    return "unbounded" if depth is None or math.isinf(depth) else brief_length(depth)


def check(
    report: Report, label: str, *, touching_counts: bool, known: Baseline | None, tolerance: float,
    robots: Sequence[frozenset[str]] = (),
) -> Check:
    """Sort the pairs of a report, and of its trajectory, into failing and other findings.

    touching_counts : pairs touching within rounding count as collisions.   known : from `read_baseline`, or ``None``.
    tolerance : the most a known collision may be deeper than in the baseline [m].
    robots : bodies of each robot, which are to keep clear of all but themselves; without, all bodies are.
    """
    made = Check(label, report.scene["name"], report.bodies, report.verdict(), against_baseline=known is not None)
    made.unanswered = [*report.unanswered, *(report.trajectory or {}).get("unanswered", [])]
    if report.trajectory is not None:
        proof = report.trajectory.get("proof")
        how = "sampled, not certified in between" if proof is None else proof["text"]
        made.summary = f"{trajectory.verdict(report.trajectory)}, {how}; at the start: {made.summary}"
        if proof is not None and proof["why"] is not None:
            made.unanswered.append({"a": "the robots", "b": "what is around", "why": proof["why"]})
    clearance = report.query["clearance"]
    unmatched = dict(known.of(label)) if known is not None else {}
    for finding in _pairs(report):
        keeps_clear = not robots or any((finding.a in robot) != (finding.b in robot) for robot in robots)
        counts = finding.what in (COLLISION, UNPROVEN) or (finding.what == NEAR and keeps_clear)
        counts |= finding.what == TOUCHING and (touching_counts or (clearance > 0.0 and keeps_clear))
        entry = unmatched.pop(_key(finding), None)
        if counts and entry is not None:
            before = math.inf if entry.distance is None else entry.depth
            deeper = finding.depth > before + tolerance
            finding = finding._replace(what=DEEPER if deeper else KNOWN, before=before)
            counts = deeper
        (made.failing if counts else made.findings).append(finding)
    made.findings[:0] = made.failing
    gone = [entry for entry in unmatched.values() if entry.what == COLLISION or touching_counts]
    made.findings += [entry._replace(what=GONE) for entry in gone]
    return made


def _pairs(report: Report) -> Iterator[Finding]:
    """Pairs met by the trajectory, each in its worst class; then pairs of the start without a moving body."""
    followed: dict[frozenset, Finding] = {}
    for what, name in _CLASSES.items():
        for pair in (report.trajectory or {}).get(name, []):
            finding = Finding(what, pair["a"], pair["b"], pair["distance"], trajectory.place(pair["from"]))
            followed.setdefault(frozenset((pair["a"], pair["b"])), finding)
    for finding in _of_proof((report.trajectory or {}).get("proof")):
        if finding.what == UNPROVEN or frozenset((finding.a, finding.b)) not in followed:
            followed[frozenset((finding.a, finding.b, finding.what))] = finding
    yield from followed.values()
    for what, name in _CLASSES.items():
        for pair in getattr(report, name):
            if frozenset((pair.a, pair.b)) not in followed:
                yield Finding(what, pair.a, pair.b, pair.distance)


def _of_proof(proof: dict | None) -> Iterator[Finding]:
    """The first collision of a proof, and the first open interval of each pair not proven apart."""
    if proof is None:
        return
    first = proof["first_collision"]
    if first is not None:
        what = COLLISION if first["distance"] <= 0.0 else NEAR
        at = {"share": first["share"], "time": first["time"]}
        yield Finding(what, first["a"], first["b"], first["distance"], trajectory.place(at))
    seen: set[frozenset] = set()
    for entry in proof["open"]:
        pair = frozenset((entry["a"], entry["b"]))
        if pair not in seen:
            seen.add(pair)
            at = {"share": entry["begin"], "time": None}
            yield Finding(UNPROVEN, entry["a"], entry["b"], 0.0, trajectory.place(at))


def csv_text(checks: Iterable[Check]) -> str:
    """The findings as a table for spreadsheets; distances in metres, empty where a depth is unbounded."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(("what", "a", "b", "distance", "state", "where"))
    for result in checks:
        rows.writerows((f.what, f.a, f.b, f.distance, result.label, f.where) for f in result.findings)
    return out.getvalue()


# --- baselines ----------------------------------------------------------------------------------


class Baseline(NamedTuple):
    """Known collisions by state; a baseline of one state without a name holds for every state."""

    states: dict[str, dict[tuple, Finding]]

    def of(self, label: str) -> dict[tuple, Finding]:
        return self.states.get(label, self.states.get("", {}))


def _key(finding: Finding) -> tuple:
    """What makes a pair the same: its bodies in any order, and whether it collides or touches."""
    return (TOUCHING if finding.what == TOUCHING else COLLISION, frozenset((finding.a, finding.b)))


def baseline_text(checks: Iterable[Check]) -> str:
    """The collisions of checks as the text of a baseline: sorted by name, one a line, for version control."""
    entries = []
    for result in checks:
        for finding in result.findings:
            if finding.what in _KNOWN_CLASSES:
                depth = None if math.isinf(finding.depth) else finding.depth
                state = {"state": result.label} if result.label else {}
                entries.append({**state, "class": finding.what, "a": finding.a, "b": finding.b, "depth": depth})
    entries.sort(key=lambda entry: (entry.get("state", ""), entry["class"], entry["a"], entry["b"]))
    lines = ",\n    ".join(json.dumps(entry, ensure_ascii=False) for entry in entries)
    listed = f"[\n    {lines}\n  ]" if entries else "[]"
    return f'{{\n  "schema": "{SCHEMA}",\n  "collisions": {listed}\n}}\n'


def read_baseline(path) -> Baseline:
    """The known collisions in a file: a baseline, or the JSON of a report.

    Raises InvalidArgument where the file is neither, naming what is wrong with it.
    """
    try:
        data = json.loads(read_text(Path(path)))
    except SceneError as error:
        raise InvalidArgument(f"--baseline: {error}") from None
    except (ValueError, RecursionError) as error:
        raise InvalidArgument(f"--baseline: {path}: is not JSON: {error}") from None
    schema = data.get("schema") if isinstance(data, dict) else None
    try:
        return Baseline(_states(data, str(schema)))
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise InvalidArgument(
            f"--baseline: {path}: is damaged ({type(error).__name__}: {error}): write it anew with --write-baseline"
        ) from None
    except _Unknown:
        raise InvalidArgument(
            f"--baseline: {path}: is neither a baseline nor the JSON of a report (schema {schema!r}): write one with "
            "collide check SCENE --write-baseline FILE"
        ) from None


class _Unknown(Exception):
    """A file of another kind."""


def _states(data: dict, schema: str) -> dict[str, dict[tuple, Finding]]:
    if schema == SCHEMA:
        entries = [(entry.get("state", ""), entry["class"], entry) for entry in data["collisions"]]
    elif schema.startswith("collide-states/"):
        entries = [(entry["name"], what, e) for entry in data["states"] for what, e in _of_report(entry["report"])]
    elif schema.startswith("collide-report/"):
        entries = [("", what, entry) for what, entry in _of_report(data)]
    else:
        raise _Unknown
    states: dict[str, dict[tuple, Finding]] = {state: {} for state, _, _ in entries}
    for state, what, entry in entries:
        depth = entry["depth"]
        finding = Finding(str(what), str(entry["a"]), str(entry["b"]), None if depth is None else -float(depth))
        if what not in _KNOWN_CLASSES:
            raise ValueError(f"class {what!r}")
        states[state][_key(finding)] = finding
    return states


def _of_report(data: dict) -> Iterator[tuple[str, dict]]:
    """The collisions of a report, shallow ones and those of its trajectory included, and what touches."""
    yield from ((COLLISION, entry) for name in ("colliding", "shallow") for entry in data[name])
    yield from ((TOUCHING, {**entry, "depth": 0.0}) for entry in data["touching"])
    for entry in (data.get("trajectory") or {}).get("colliding", []):
        distance = entry["distance"]
        yield COLLISION, {**entry, "depth": None if distance is None else max(0.0, -distance)}
