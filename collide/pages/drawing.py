"""What a page draws: every body at its pose with its verdict, as plain data (docs/pages.md).

``shown`` is what a body looks like, ``tested`` what was asked about where that is another shape: the hull of a mesh, or
the collision mesh of a robot's link.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from collide.pages.body_verdicts import body_verdicts
from collide.pages.drawn_shapes import MAX_FACETS, PosedShape, ShapeTable
from collide.reports.classes import body_sizes
from collide.reports.number_format import brief_length, count
from collide.reports.report import Report

VERSION = 1
#: Kinds of page.
REPORT, CHECK, COMPARE, SPHERES = "report", "check", "compare", "spheres"
_ITSELF = np.eye(4)


def of_scene(
    scene, report: Report, *, kind: str = REPORT, looks: Mapping[str, Sequence[PosedShape]] | None = None,
    notes: Sequence[str] = (), max_facets: int = MAX_FACETS,
) -> dict:
    """The drawing of a scene, as the page's block ``drawing`` has it.

    Parameters
    ----------
    scene : `collide.scenes.Scene`.
    report : of the scene, by `collide.reports.report.make`: source of the verdicts.
    kind : "report", "check", "compare" or "spheres".
    looks : body name → its look, where other than the tested shape: shapes with their poses X_BS in the
        body's frame (4, 4).
    notes : for the reader, on ``looks``.
    max_facets : approximate number of facets of the page; larger meshes are simplified.

    Returns
    -------
    dict of plain data: no NaN, no infinity.
    """
    table = ShapeTable(2.0 * (float(body_sizes(scene.bodies).max(initial=0.0)) or 1.0), max_facets)
    verdicts = body_verdicts(scene, report)
    bodies = [_body(body, table, looks or {}, verdicts[body.name]) for body in scene.bodies]
    shapes = table.written()
    return {
        "version": VERSION, "kind": kind, "size": extent(bodies, table.boxes()),
        "notes": [*notes, *_about(bodies, shapes, table)], "contacts": None, "shapes": shapes, "bodies": bodies,
        "states": None,
    }


def _body(body, table: ShapeTable, looks: Mapping[str, Sequence[PosedShape]], verdict: str) -> dict:
    tested = table.row([(body.shape, _ITSELF)])
    visual = table.row(looks[body.name]) if body.name in looks else tested
    if table.is_empty(visual):
        visual = tested
    return {
        "name": body.name, "static": bool(body.static), "owner": getattr(body, "owner", None),
        "kind": type(body.shape).__name__, "X_WB": [float(x) for x in np.asarray(body.X_WB).ravel()], "shown": visual,
        "tested": None if visual == tested else tested, "verdict": verdict, "note": body.approximation,
    }


def extent(bodies: Sequence[Mapping], boxes: Sequence[np.ndarray | None]) -> float:
    """The longest side of the box around all bounded bodies [m]; 1 without bounded bodies.

    bodies : as of `of_scene`.   boxes : of their shapes, as of `ShapeTable.boxes`.
    """
    corners = []
    for body in bodies:
        box = boxes[body["shown"]]
        if box is not None:
            X_WB = np.array(body["X_WB"]).reshape(4, 4)
            middle, half = box.mean(axis=0), 0.5 * (box[1] - box[0])
            centre, reach = X_WB[:3, :3] @ middle + X_WB[:3, 3], np.abs(X_WB[:3, :3]) @ half
            corners += [centre - reach, centre + reach]
    return (float(np.ptp(corners, axis=0).max()) if corners else 0.0) or 1.0


def _about(bodies: list[dict], shapes: list[dict], table: ShapeTable) -> list[str]:
    """What is drawn otherwise than it is, in words."""
    notes = []
    fewer = [shape for shape in shapes if shape["simplified_from"] is not None]
    if fewer:
        before, after = (sum(shape[key] for shape in fewer) for key in ("simplified_from", "triangle_count"))
        off = brief_length(max(shape["deviation"] for shape in fewer))
        notes.append(
            f"{count(len(fewer), 'mesh', 'meshes')} drawn with {after} facets instead of {before}, at most {off} off: "
            "for display only, tests know nothing of it"
        )
    clouds = [shape for shape in shapes if shape["points"] is not None]
    if clouds:
        drawn, of = (sum(shape["points"][key] for shape in clouds) for key in ("count", "of"))
        off = brief_length(max(shape["deviation"] for shape in clouds))
        part = f"{drawn} of {of} points: of each cloud the first of every few" if drawn < of else count(of, "point")
        notes.append(f"{count(len(clouds), 'cloud')} drawn, {part}, at most {off} off")
    bare = [body["name"] for body in bodies if table.is_empty(body["shown"])]
    if bare:
        notes.append(f"{count(len(bare), 'body', 'bodies')} without triangles, not drawn: {', '.join(bare[:5])}")
    return notes
