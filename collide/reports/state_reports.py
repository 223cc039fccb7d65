"""Reports of a scene in several states, and along a trajectory: a single page, a single JSON."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import Any, NamedTuple

from collide.reports import classes, terminal
from collide.reports.number_format import count, lengths
from collide.reports.report import Report
from collide.reports.report_tables import depth_texts
from collide.reports.tables import Column, Line, Table, lay_out, table_lines, wrapped
from collide.reports.trajectory_report import place, verdict

SCHEMA = "collide-states/1"
#: Pairs shown of a trajectory, unless all are asked for.
_SHORT = 12


class Stated(NamedTuple):
    """A report and its state: the label as the user wrote the state, "" without a named state.

    watch : follower of the trajectory, if any (`collide.reports.trajectory_report.Watch`).
    """

    label: str
    scene: Any
    report: Report
    watch: Any = None


def items(made: list[Stated]) -> Iterator[tuple[str, object]]:
    """The JSON of one report, or of several states: (key, value), in order."""
    if len(made) == 1:
        yield from made[0].report.items()
        return
    yield "schema", SCHEMA
    yield "verdict", {"text": _verdict(made), "collides": any(state.report.collides for state in made)}
    yield "states", [{"name": state.label, "report": state.report.to_dict()} for state in made]


def csv_text(made: list[Stated]) -> str:
    """Every listed pair as a line for spreadsheets, deepest or nearest first of each class; lengths in metres.

    Empty fields are unbounded: a depth without end, or a bracket without an upper end. Vectors take three columns.
    """
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    vectors = {name: [f"{name}_{axis}" for axis in "xyz"] for name in ("normal", "point_a", "point_b")}
    plain = ("a", "b", "distance", "lower", "upper", "how", "certified")
    rows.writerow(("state", "class", *plain, *(column for columns in vectors.values() for column in columns)))
    for state in made:
        for name in classes.NAMES:
            for pair in getattr(state.report, name).dicts():
                numbers = [number for vector in vectors for number in pair[vector]]
                rows.writerow((state.label, name, *(pair[field] for field in plain), *numbers))
    return out.getvalue()


def render(made: list[Stated], *, everything: bool, proofs: bool, width: int, whole_names: bool) -> list[Line]:
    """The page of a single report, or a table of the states and the page of each, as given by `terminal.render`."""
    layout: dict[str, Any] = {"everything": everything, "proofs": proofs, "width": width, "whole_names": whole_names}
    if len(made) == 1:
        return _page(made[0].report, **layout)
    style = "colliding" if any(state.report.colliding for state in made) else "free"
    lines: list[Line] = [[(line, style)] for line in wrapped(_verdict(made), width, hanging=2)]
    table = _state_table(made)
    lines += [[], *table_lines(table, lay_out(table, width, whole_names), width)]
    for state in made:
        lines += [[], [(terminal.rule(f"STATE {state.label}", width), "title")], *_page(state.report, **layout)]
    return lines


def _verdict(made: list[Stated]) -> str:
    colliding = [state.label for state in made if state.report.colliding]
    if not colliding:
        return f"no collision in {count(len(made), 'state')}"
    return f"collisions in {len(colliding)} of {len(made)} states: {', '.join(colliding)}"


def _state_table(made: list[Stated]) -> Table:
    columns = [Column("state", "name"), Column("collisions"), Column("touching"), Column("near"), Column("deepest")]
    rows = []
    for label, _, report, _ in made:
        deepest = depth_texts(report.colliding[:1])
        numbers = [str(len(pairs)) for pairs in (report.colliding, report.touching, report.near)]
        rows.append([label, *numbers, deepest[0].strip() if deepest else "-"])
    return Table("STATES", columns, rows)


def _page(report: Report, *, everything: bool, proofs: bool, width: int, whole_names: bool) -> list[Line]:
    page = terminal.render(report, everything=everything, proofs=proofs, width=width, whole_names=whole_names)
    trajectory = report.trajectory
    if trajectory is None:
        return page
    first = (trajectory.get("proof") or {}).get("first_collision")
    meets = trajectory["collides"] or (first is not None and first["distance"] <= 0.0)
    style = "colliding" if meets else "free"
    lines: list[Line] = [[(line, style)] for line in wrapped(verdict(trajectory), width, hanging=2)]
    lines += [[(line, "note")] for line in wrapped(_how_sampled(trajectory), width, hanging=2)]
    for table in _trajectory_tables(trajectory, None if everything else _SHORT):
        lines += [[], *table_lines(table, lay_out(table, width, whole_names), width)]
    return [*lines, [], [(terminal.rule("AT THE START", width), "title")], *page]


def _how_sampled(trajectory: dict) -> str:
    proof = trajectory.get("proof")
    how = ": by sampling, not certified in between" if proof is None else f"; {proof['text']}"
    notes = f"; {count(len(trajectory['notes']), 'note')}: {trajectory['notes'][0]}" if trajectory["notes"] else ""
    return (
        f"{count(trajectory['samples'], 'sample')} through {count(trajectory['waypoints'], 'waypoint')}, no joint "
        "moving more than "
        f"{trajectory['resolution']:g} rad or m between two of them{how}{notes}"
    )


def _trajectory_tables(trajectory: dict, limit: int | None) -> list[Table]:
    tables = [
        _motion_table("COLLIDING ALONG THE PATH  in the order they begin", trajectory["colliding"], "depth", limit),
        _motion_table("NEAR ALONG THE PATH  nearest first", trajectory["near"], "distance", limit),
        Table(
            "NOT ANSWERED ALONG THE PATH",
            [Column("body A", "name"), Column("body B", "name"), Column("because", "text")],
            [[entry["a"], entry["b"], entry["why"]] for entry in trajectory["unanswered"]],
        ),
    ]
    return [table for table in tables if table.rows]


def _motion_table(title: str, pairs: list[dict], measure: str, limit: int | None) -> Table:
    listed = pairs[:limit]
    sizes = [abs(pair["distance"]) if pair["distance"] is not None else float("inf") for pair in listed]
    columns = [
        Column("body A", "name"),
        Column("body B", "name"),
        Column(measure),
        Column("at"),
        Column("samples", optional=1),
    ]
    cells = zip(
        [pair["a"] for pair in listed], [pair["b"] for pair in listed], lengths(sizes),
        [place(pair["at"]) for pair in listed],
        [str(pair["samples"]) for pair in listed],
    )
    rows = [list(row) for row in cells]
    if measure == "depth":
        columns.insert(2, Column("from"))
        for row, pair in zip(rows, listed):
            row.insert(2, place(pair["from"]))
    return Table(title, columns, rows, more=len(pairs) - len(listed))
