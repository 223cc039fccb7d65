"""Checks as SARIF 2.1.0, the form in which code hosts and editors take findings: a result for every pair.

The place of a result is the first file of the scene; bodies are its logical locations. GitHub wants a line, and gets 1.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

from collide import __version__
from collide.reports import checking
from collide.reports.checking import Check, Finding
from collide.reports.number_format import brief_length, parted

SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
NOT_ANSWERED, MISSING_MESH = "not-answered", "missing-mesh"
#: Kind of a finding → its rule in words, and what a baseline says of it.
RULES = {
    checking.COLLISION: ("Two bodies collide.", "new"),
    checking.DEEPER: ("Two bodies collide deeper than the baseline allows.", "updated"),
    checking.NEAR: ("Two bodies are nearer than the clearance.", "new"),
    checking.UNPROVEN: ("Two bodies are neither proven apart nor met along a trajectory.", "new"),
    checking.TOUCHING: ("Two bodies touch within rounding.", "new"),
    checking.SHALLOW: ("Two bodies collide, proven less deep than the limit.", "new"),
    checking.KNOWN: ("Two bodies collide, as the baseline knows.", "unchanged"),
    checking.GONE: ("A collision of the baseline is no more.", "absent"),
    NOT_ANSWERED: ("Whether two bodies collide is not known.", "new"),
    MISSING_MESH: ("A mesh is missing, and is not checked.", "new"),
}
_INDEX = {rule: k for k, rule in enumerate(RULES)}


def items(checks: Sequence[Check], sources: Sequence[str], missing_meshes: Sequence[str] = ()) -> Iterator[tuple]:
    """The log, key by key.

    sources : files of the scene.   missing_meshes : a sentence for every mesh left out.
    """
    place = _place(sources)
    results = [_result(check, finding, place) for check in checks for finding in check.findings]
    for check in checks:
        for entry in check.unanswered:
            text = f"{_state(check)}whether {entry['a']} and {entry['b']} collide is not known: {entry['why']}"
            results.append(_entry(NOT_ANSWERED, "warning", text, (entry["a"], entry["b"]), check, place))
    results += [_entry(MISSING_MESH, "warning", text, (), checks[0], place) for text in missing_meshes]
    driver = {
        "name": "collide", "version": __version__,
        "rules": [{"id": rule, "shortDescription": {"text": text}} for rule, (text, _) in RULES.items()],
    }
    yield "$schema", SCHEMA
    yield "version", "2.1.0"
    yield "runs", [{
        "tool": {"driver": driver}, "columnKind": "unicodeCodePoints",
        "invocations": [{"executionSuccessful": True}], "results": results,
    }]


def _result(check: Check, finding: Finding, place: list[dict]) -> dict:
    is_failing = any(finding is failing for failing in check.failing)
    measure = "unbounded depth" if finding.distance is None else parted(finding.distance)
    distance = "" if finding.what == checking.UNPROVEN else f", {measure}"
    where = f", from {finding.where} of the path" if finding.where else ""
    before = "" if finding.before is None else f", {brief_length(finding.before)} deep in the baseline"
    text = f"{_state(check)}{finding.a} and {finding.b}: {finding.what}{distance}{before}{where}"
    return _entry(finding.what, "error" if is_failing else "note", text, (finding.a, finding.b), check, place)


def _entry(rule: str, level: str, text: str, bodies: tuple, check: Check, place: list[dict]) -> dict:
    logical = [{"name": body, "fullyQualifiedName": f"{check.scene}/{body}", "kind": "object"} for body in bodies]
    location = {**(place[0] if place else {}), **({"logicalLocations": logical} if logical else {})}
    kind = checking.COLLISION if rule in (checking.KNOWN, checking.DEEPER, checking.GONE) else rule
    identity = "/".join([kind, check.label, *(sorted(bodies) or [text])])
    return {
        "ruleId": rule, "ruleIndex": _INDEX[rule], "level": level, "message": {"text": text},
        **({"locations": [location]} if location else {}), "partialFingerprints": {"bodies/v1": identity},
        **({"baselineState": RULES[rule][1]} if check.against_baseline else {}),
    }


def _state(check: Check) -> str:
    return f"{check.label}: " if check.label else ""


def _place(sources: Sequence[str]) -> list[dict]:
    """The physical location of all results: relative to the working folder where the file lies in the folder."""
    if not sources:
        return []
    file = Path(sources[0]).absolute()
    inside = os.path.relpath(file) if file.is_relative_to(Path.cwd()) else None
    uri = file.as_uri() if inside is None else quote(Path(inside).as_posix())
    return [{"physicalLocation": {"artifactLocation": {"uri": uri}, "region": {"startLine": 1}}}]
