"""Checks as JUnit XML: a test case for every body, so that a server shows which body fails, and since when.

A body fails where a collision counts that it is in; both bodies of the pair do, each naming the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

from collide.reports.checking import Check, Finding
from collide.reports.number_format import brief_length
from collide.reports.tables import printable


def text(checks: list[Check]) -> Iterator[str]:
    """The file, piece by piece: a suite for every state."""
    cases = sum(len(one.bodies) for one in checks)
    failures = sum(len(_failing(one)) for one in checks)
    errors = sum(len(_unanswered(one)) for one in checks)
    yield '<?xml version="1.0" encoding="UTF-8"?>\n'
    yield f'<testsuites name="collide check" tests="{cases}" failures="{failures}" errors="{errors}">\n'
    for one in checks:
        yield from _suite(one)
    yield "</testsuites>\n"


def _suite(check: Check) -> Iterator[str]:
    failing, unanswered, told = _failing(check), _unanswered(check), _told(check)
    name = _attribute(f"{check.scene}: {check.label}" if check.label else check.scene)
    yield (
        f'  <testsuite name={name} tests="{len(check.bodies)}" failures="{len(failing)}" errors="{len(unanswered)}" '
        'skipped="0">\n'
    )
    for body in check.bodies:
        inside = [
            *(f"<failure message={_attribute(_message(body, found))} type={_attribute(found[0].what)}>"
              f"{_text(_lines(body, found))}</failure>" for found in [failing.get(body)] if found),
            *(f'<error message={_attribute(why)} type="not answered"/>' for why in unanswered.get(body, [])[:1]),
            *(f"<system-out>{_text(_lines(body, found))}</system-out>" for found in [told.get(body)] if found),
        ]  # fmt: skip
        case = f"    <testcase classname={name} name={_attribute(body)}"
        yield f"{case}>\n      " + "\n      ".join(inside) + "\n    </testcase>\n" if inside else f"{case}/>\n"
    yield f"    <system-out>{_text(check.verdict())}</system-out>\n  </testsuite>\n"


def _by_body(findings: list[Finding]) -> dict[str, list[Finding]]:
    found: dict[str, list[Finding]] = {}
    for finding in findings:
        for body in (finding.a, finding.b):
            found.setdefault(body, []).append(finding)
    return found


def _failing(check: Check) -> dict[str, list[Finding]]:
    return _by_body(check.failing)


def _told(check: Check) -> dict[str, list[Finding]]:
    """What is worth telling and fails nothing: known, shallow and touching pairs."""
    failing = set(map(id, check.failing))
    return _by_body([finding for finding in check.findings if id(finding) not in failing])


def _unanswered(check: Check) -> dict[str, list[str]]:
    failing = _failing(check)
    found: dict[str, list[str]] = {}
    for entry in check.unanswered:
        for body, other in ((entry["a"], entry["b"]), (entry["b"], entry["a"])):
            if body not in failing:
                found.setdefault(body, []).append(f"whether it collides with {other} is not known: {entry['why']}")
    return found


def _message(body: str, findings: list[Finding]) -> str:
    more = f" and {len(findings) - 1} more" if len(findings) > 1 else ""
    return f"{_line(body, findings[0])}{more}"


def _lines(body: str, findings: list[Finding]) -> str:
    return "\n".join(_line(body, finding) for finding in findings)


def _line(body: str, finding: Finding) -> str:
    other = finding.b if finding.a == body else finding.a
    depth = "unbounded" if finding.distance is None else brief_length(finding.depth)
    before = "" if finding.before is None else f", {brief_length(finding.before)} in the baseline"
    where = f", from {finding.where} of the path" if finding.where else ""
    return f"{finding.what} with {other}: {depth} deep{before}{where}"


def _text(words: str) -> str:
    """Text that XML 1.0 allows: other characters are written out."""
    return escape("\n".join(printable(line) for line in words.split("\n")))


def _attribute(words: str) -> str:
    return quoteattr(printable(words))
