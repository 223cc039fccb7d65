"""What a sweep found, as a line, a table of the rows that need a person, and JSON."""

from __future__ import annotations

from typing import Any

from collide.reports.number_format import brief_length
from collide.reports.tables import Column, Table
from collide.sweeps.sweep_results import SweepResults

SCHEMA = "collide-sweep-summary/1"


def summary(results: SweepResults) -> list[str]:
    """The verdict in a sentence or two."""
    parts = [f"{results.colliding:,} in collision", f"{results.free:,} free"]
    if results.unanswered:
        parts.append(f"{results.unanswered:,} without an answer")
    if results.outside:
        parts.append(f"{results.outside:,} outside the limits")
    sentences = [f"{results.rows:,} {'row' if results.rows == 1 else 'rows'}: {', '.join(parts)}"]
    if results.least is not None:
        distance, row, a, b = results.least
        sentences.append(f"least distance {brief_length(distance)}, row {row:,}, {a} and {b}")
    return sentences


def tables(results: SweepResults) -> list[Table]:
    """The first rows that were not answered, or are outside the limits."""
    if not results.named:
        return []
    rows = [[str(row), note] for row, note in results.named]
    more = results.unanswered + results.outside - len(rows)
    notes = [f"… and {more:,} more: rows whose note is not null"] if more else []
    return [Table("ROWS TO LOOK AT", [Column("row"), Column("note", "text")], rows, notes=notes)]


def to_dict(results: SweepResults) -> dict[str, Any]:
    """Plain data for JSON."""
    least = results.least
    return {
        "schema": SCHEMA, "folder": str(results.folder), "rows": results.rows, "colliding": results.colliding,
        "free": results.free, "unanswered": results.unanswered, "outside": results.outside,
        "named": [{"row": row, "note": note} for row, note in results.named],
        "least": None if least is None else dict(zip(("distance", "row", "a", "b"), least)),
    }
