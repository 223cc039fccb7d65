"""The report for a terminal: the verdict first, then findings for a person to judge, proofs on request.

The same tables are drawn in two ways: with colours through `rich` where installed and the
output is a terminal, as plain aligned text everywhere else. Tables and progress are laid out without `rich`: the
command works where numpy alone is installed, and `rich` takes 34 to 71 ms to import.
"""

from __future__ import annotations

import os
import shutil
import sys
from typing import TYPE_CHECKING

from collide.reports.number_format import count, seconds
from collide.reports.report_tables import looked_at_first, tables
from collide.reports.tables import Line, Table, lay_out, missing_columns, table_lines, wrapped, write_text

if TYPE_CHECKING:
    from collide.reports.report import Report

#: Cells a line may take where the output is no terminal and says nothing about its width.
PIPE_WIDTH = 120


def render(
    report: Report, *, everything: bool = False, proofs: bool = False, width: int = 80, whole_names: bool = False
) -> list[Line]:
    """The report as lines of (text, role) pieces.

    everything : no list is shortened or told in a line.   proofs : how each answer is known, and what took how long.
    width : cells a line may take.   whole_names : never shorten a name (for output that goes to a file).
    """
    style = "colliding" if report.colliding else "touching" if report.touching or report.shallow else "free"
    lines: list[Line] = [[(line, style)] for line in wrapped(report.verdict(), width, hanging=2)]
    lines += [[(line, "note")] for line in wrapped(_scene_line(report), width, hanging=2)]
    for text in looked_at_first(report):
        lines += [[(line, "touching")] for line in wrapped(text, width, hanging=2)]
    dropped: dict[str, None] = {}  # a set that keeps its order
    for table in tables(report, everything, proofs):
        layout = lay_out(table, width, whole_names)
        dropped.update(dict.fromkeys(layout.dropped))
        lines.append([])
        lines += [[(t, _role(role, table.style)) for t, role in line] for line in table_lines(table, layout, width)]
    lines += _prose("NOTES", [f"- {note}" for note in report.notes] if everything else [], width, hanging=2)
    lines += _prose("TIME", _times(report) if proofs else [], width)
    return lines + missing_columns(list(dropped), width)


def rule(title: str, width: int) -> str:
    """A line across the page, with a title, at the begin of a part."""
    return f"── {title} ".ljust(min(width, PIPE_WIDTH), "─")[: max(width, len(title) + 4)]


def _role(role: str, style: str) -> str:
    return style if role == "title" and style != "plain" else role


def _scene_line(report: Report) -> str:
    scene = report.scene
    kind = "robot" if len(scene["robots"]) == 1 else "robots"
    robots = f", {kind} {', '.join(scene['robots'])}" if scene["robots"] else ""
    return f"{scene['name']}: {count(scene['bodies'], 'body', 'bodies')} ({scene['static']} fixed){robots}"


#: Stages in the order they run; any others follow.
_STAGES = ("read", "meshes", "pack", "broadphase", "narrowphase", "report")


def _times(report: Report) -> list[str]:
    others = [name for name in report.seconds if name not in (*_STAGES, "other", "total")]
    spent = {name: report.seconds.get(name, 0.0) for name in (*_STAGES, *others)}
    stages = [f"{name} {seconds(s)}" for name, s in spent.items() if s >= 5e-5]
    known = [f"{name} {version}" for name, version in report.versions.items() if version and name != "machine"]
    stages.append(f"imports and the rest {seconds(report.seconds['other'])}")
    return [
        f"{seconds(report.seconds['total'])} in all: {', '.join(stages)}",
        f"{', '.join(known)}, {report.versions['machine'] or 'unknown machine'}",
    ]


def _prose(title: str, paragraphs: list[str], width: int, hanging: int = 0) -> list[Line]:
    if not paragraphs:
        return []
    lines: list[Line] = [[], [(title, "title")]]
    for paragraph in paragraphs:
        lines += [[(line, "text")] for line in wrapped(paragraph, width, 2, hanging)]
    return lines


# --- drawing ------------------------------------------------------------------------------------

#: Role → rich style. Colour repeats what the words say; it never carries meaning alone.
_STYLES = {
    "colliding": "bold red", "touching": "bold yellow", "near": "bold cyan", "free": "bold green",
    "title": "bold", "head": "dim", "rule": "dim", "note": "dim", "label": "none", "text": "none",
    "name": "none", "number": "bold",
}


def output_width(stream) -> tuple[int, bool]:
    """``(cells, whole_names)`` for a stream: the terminal's width, or COLUMNS, or a page for a pipe."""
    if is_terminal(stream) or os.environ.get("COLUMNS", "").isdigit():
        return max(30, shutil.get_terminal_size((80, 24)).columns), False
    return PIPE_WIDTH, True


def is_terminal(stream) -> bool:
    """True where a person reads directly."""
    try:
        return bool(stream.isatty())
    except (AttributeError, ValueError):
        return False


def write(lines: list[Line], stream=None) -> None:
    """Print lines, in colour where that is wanted and possible.

    Colour needs a terminal, no NO_COLOR in the environment, and `rich`.
    """
    stream = sys.stdout if stream is None else stream
    console = _rich_console(stream)
    if console is None:
        write_text("".join("".join(text for text, _ in line).rstrip() + "\n" for line in lines), stream)
        return
    from rich.text import Text

    for line in lines:
        console.print(Text.assemble(*((text, _STYLES.get(role, "none")) for text, role in line)), soft_wrap=True)


def show_table(table: Table, stream=None) -> None:
    """Lay a table out for a stream and print the lines to the stream."""
    stream = sys.stdout if stream is None else stream
    width, whole_names = output_width(stream)
    write(table_lines(table, lay_out(table, width, whole_names), width), stream)


def _rich_console(stream):
    if not is_terminal(stream) or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return None
    try:
        from rich.console import Console
    except ImportError:
        return None
    console = Console(file=stream, highlight=False, markup=False, emoji=False)
    return console if console.color_system and (console.encoding or "").lower().startswith("utf") else None
