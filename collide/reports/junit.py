"""Checks as JUnit XML: a test case for every body, so that a server shows the failing bodies, and since when.

A body fails with its first counted collision; both bodies of the pair fail, each naming the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

from collide.reports.checking import Check, Finding
from collide.reports.number_format import brief_length
from collide.reports.tables import printable


def text(checks: list[Check]) -> Iterator[str]:
    """The file, piece by piece: a suite for every state."""
    cases = sum(len(check.bodies) for check in checks)
    failures = sum(len(_failing(check)) for check in checks)
    errors = sum(len(_unanswered(check)) for check in checks)
    yield '<?xml version="1.0" encoding="UTF-8"?>\n'
    yield f'<testsuites name="collide check" tests="{cases}" failures="{failures}" errors="{errors}">\n'
    for check in checks:
        yield from _suite(check)
    yield "</testsuites>\n"


def _suite(check: Check) -> Iterator[str]:
    failing, unanswered, reported = _failing(check), _unanswered(check), _reported(check)
    name = _attribute(f"{check.scene}: {check.label}" if check.label else check.scene)
    yield (
        f'  <testsuite name={name} tests="{len(check.bodies)}" failures="{len(failing)}" errors="{len(unanswered)}" '
        'skipped="0">\n'
    )
    for body in check.bodies:
        inside = [
            *(
                f"<failure message={_attribute(_message(body, findings))} type={_attribute(findings[0].what)}>"
                f"{_text(_lines(body, findings))}</failure>"
                for findings in [failing.get(body)]
                if findings
            ),
            *(f'<error message={_attribute(why)} type="not answered"/>' for why in unanswered.get(body, [])[:1]),
            *(
                f"<system-out>{_text(_lines(body, findings))}</system-out>"
                for findings in [reported.get(body)]
                if findings
            ),
        ]
        case = f"    <testcase classname={name} name={_attribute(body)}"
        yield f"{case}>\n      " + "\n      ".join(inside) + "\n    </testcase>\n" if inside else f"{case}/>\n"
    yield f"    <system-out>{_text(check.verdict())}</system-out>\n  </testsuite>\n"


def _by_body(findings: list[Finding]) -> dict[str, list[Finding]]:
    by_body: dict[str, list[Finding]] = {}
    for finding in findings:
        for body in (finding.a, finding.b):
            by_body.setdefault(body, []).append(finding)
    return by_body


def _failing(check: Check) -> dict[str, list[Finding]]:
    return _by_body(check.failing)


def _reported(check: Check) -> dict[str, list[Finding]]:
    """What is worth telling and fails nothing: known, shallow and touching pairs."""
    failing = set(map(id, check.failing))
    return _by_body([finding for finding in check.findings if id(finding) not in failing])


def _unanswered(check: Check) -> dict[str, list[str]]:
    failing = _failing(check)
    by_body: dict[str, list[str]] = {}
    for entry in check.unanswered:
        for body, partner in ((entry["a"], entry["b"]), (entry["b"], entry["a"])):
            if body not in failing:
                by_body.setdefault(body, []).append(f"whether it collides with {partner} is not known: {entry['why']}")
    return by_body


def _message(body: str, findings: list[Finding]) -> str:
    more = f" and {len(findings) - 1} more" if len(findings) > 1 else ""
    return f"{_line(body, findings[0])}{more}"


def _lines(body: str, findings: list[Finding]) -> str:
    return "\n".join(_line(body, finding) for finding in findings)


def _line(body: str, finding: Finding) -> str:
    partner = finding.b if finding.a == body else finding.a
    depth = "unbounded" if finding.distance is None else brief_length(finding.depth)
    before = "" if finding.before is None else f", {brief_length(finding.before)} in the baseline"
    where = f", from {finding.where} of the path" if finding.where else ""
    return f"{finding.what} with {partner}: {depth} deep{before}{where}"


def _text(words: str) -> str:
    """Text that XML 1.0 allows: other characters are written out."""
    return escape("\n".join(printable(line) for line in words.split("\n")))


def _attribute(words: str) -> str:
    return quoteattr(printable(words))
