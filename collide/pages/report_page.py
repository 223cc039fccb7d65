"""The data of a page: the report's JSON, and the drawn data beside."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from collide.pages import drawing, drawn_contacts, drawn_states
from collide.pages.drawn_shapes import PosedShape
from collide.pages.page_file import DataBlock, ReportBlock
from collide.reports import state_reports
from collide.reports.checking import Check
from collide.reports.report import Report
from collide.reports.state_reports import Stated

Looks = Mapping[str, Sequence[PosedShape]]


def report_blocks(
    made: list[Stated], looks: Looks, notes: Sequence[str] = (), checks: Sequence[Check] | None = None
) -> list[ReportBlock | DataBlock]:
    """The blocks of a report, or of a check.

    Parameters
    ----------
    made : the reports, a report a state.
    looks, notes : as of `drawing.of_scene`.
    checks : the counted collisions, a check a state, for the page of a check.
    """
    first = made[0]
    kind = drawing.REPORT if checks is None else drawing.CHECK
    drawn = drawing.of_scene(first.scene, first.report, kind=kind, looks=looks, notes=notes)
    if len(made) > 1:
        drawn["states"] = drawn_states.of_states(made)
    elif first.watch is not None:
        drawn["states"] = drawn_states.of_trajectory(first)
    contacts, about = drawn_contacts.of_states(made)
    if about is not None:
        drawn["contacts"], drawn["notes"] = about, [*drawn["notes"], about["note"]]
    return [
        ReportBlock("report", _items(made, checks)), DataBlock("drawing", drawn), DataBlock("contacts", contacts),
    ]


def comparison_blocks(
    scene, comparison: dict, ours: Report, looks: Looks, notes: Sequence[str] = ()
) -> list[ReportBlock | DataBlock]:
    """The blocks of a comparison of engines.

    Parameters
    ----------
    scene : which was compared.
    comparison : `collide.adapters.peers.compare.Comparison.to_dict`.
    ours : the report of collide's own answers.
    looks, notes : as of `drawing.of_scene`.
    """
    drawn = drawing.of_scene(scene, ours, kind=drawing.COMPARE, looks=looks, notes=notes)
    return [
        ReportBlock("report", comparison.items()), ReportBlock("ours", ours.items()), DataBlock("drawing", drawn),
    ]


def _items(made: list[Stated], checks: Sequence[Check] | None) -> Iterator[tuple[str, object]]:
    yield from state_reports.items(made)
    if checks is not None:
        yield "check", [_of_check(check) for check in checks]


def _of_check(check: Check) -> dict:
    findings = [finding._asdict() for finding in check.findings]
    return {
        "label": check.label, "verdict": check.verdict(), "fails": check.fails,
        "against_baseline": check.against_baseline, "findings": findings,
    }
