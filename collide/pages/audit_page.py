"""The data of a page on pieces around links: the scene, with all that lies outside in the colour of collisions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from collide.pages import drawing
from collide.pages.body_verdicts import FREE
from collide.pages.drawn_shapes import PosedShape
from collide.pages.page_file import DataBlock, ReportBlock
from collide.reports import report
from collide.reports.checking import Finding
from collide.reports.classes import COLLIDING

_NOTE = (
    "links are drawn as far as they are outside their {kind}, in the colour of collisions; links inside are hidden by "
    "their {kind}. Wires show whole links. No pair of bodies was tested"
)


def audit_blocks(
    scene, looks: Mapping[str, Sequence[PosedShape]], findings: Sequence[Finding], verdict: str, kind: str
) -> list[ReportBlock | DataBlock]:
    """The blocks of a page.

    scene : of links and pieces, no pair tested.   looks : link → the parts outside its pieces.   findings : a row
    for each link outside: the link, its pieces, minus the greatest distance [m].   verdict : all of it in a line.
    kind : "spheres" or "pieces".
    """
    note = _NOTE.format(kind=kind)
    drawn = drawing.of_scene(scene, report.make(scene), kind=drawing.SPHERES, looks=looks, notes=[note])
    outside = {finding.a for finding in findings}
    for body in drawn["bodies"]:
        body["verdict"] = COLLIDING if body["name"] in outside else FREE
    return [
        ReportBlock("report", _items(scene, findings, verdict)), DataBlock("drawing", drawn),
        DataBlock("contacts", []),
    ]


def _items(scene, findings: Sequence[Finding], verdict: str) -> Iterator[tuple[str, object]]:
    for key, value in report.make(scene).items():
        if key == "verdict":
            yield key, {"text": verdict, "collides": bool(findings), "shallow": 0, "touching": 0}
        else:
            yield key, [] if key == "skipped" else value
    check = {"label": "", "verdict": verdict, "fails": bool(findings), "against_baseline": False}
    yield "check", [check | {"findings": [finding._asdict() for finding in findings]}]
