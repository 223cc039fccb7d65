"""A small model of tables, laid out once and drawn by either renderer.

A column is a ``name`` (shortened in its middle in a narrow page), a ``number`` (never
shortened: a column without space is left out whole), a ``label`` (a number aligned to the
left) or a ``text`` (wrapped).
"""

from __future__ import annotations

import sys
import textwrap
import unicodedata
from dataclasses import dataclass, field

GAP = 2
INDENT = 2
_NAME_COMFORT = 20  # names are shortened to this before a number column is given up ...
_NAME_LEAST = 6     # ... and to this once there are none left to give up
_TEXT_LEAST = 12


#: For terminals that cannot encode the real ones; as many cells where tables use them.
_PLAIN = str.maketrans(
    {"…": "~", "─": "-", "µ": "u", "→": ">", "≈": "~", "≤": "<=", "≥": ">=", "–": "-", "−": "-", "×": "x"}
)


@dataclass(frozen=True)
class Column:
    """title; kind: name, number, label or text; optional: 0 always shown, larger is given up earlier."""

    title: str
    kind: str = "number"
    optional: int = 0


@dataclass
class Table:
    """rows: one list of texts each, as long as ``columns``. more: rows left out of a long list."""

    title: str
    columns: list[Column]
    rows: list[list[str]]
    style: str = "plain"
    notes: list[str] = field(default_factory=list)
    more: int = 0


@dataclass
class Layout:
    """A table cut to a width: every cell is a list of lines, none wider than its column."""

    columns: list[Column]
    widths: list[int]
    rows: list[list[list[str]]]
    dropped: list[str]


def printable(text: str) -> str:
    """The text with control characters written out: names come from files, and terminals obey."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def write_text(text: str, stream=None) -> None:
    """Write text to a stream whose encoding may know ASCII only."""
    stream = sys.stdout if stream is None else stream
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        text = text.translate(_PLAIN).encode(encoding, "backslashreplace").decode(encoding)
    stream.write(text)


def width_of(text: str) -> int:
    """Terminal cells: two for wide East Asian characters, none for combining ones."""
    if text.isascii():
        return len(text)
    return sum(
        0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text
    )


def shorten(text: str, width: int) -> str:
    """The text with its middle replaced by … where it is wider than ``width``."""
    if width_of(text) <= width:
        return text
    if width < 2:
        return "…"[:width]
    tail = (width - 1) // 2
    return _cut(text, width - 1 - tail) + "…" + _cut(text[::-1], tail)[::-1]


def _cut(text: str, width: int) -> str:
    used = 0
    for k, character in enumerate(text):
        used += width_of(character)
        if used > width:
            return text[:k]
    return text


def pad(text: str, width: int, right: bool = False) -> str:
    """The text filled with blanks to ``width`` cells."""
    blanks = " " * max(0, width - width_of(text))
    return blanks + text if right else text + blanks


def lay_out(table: Table, width: int, whole_names: bool = False) -> Layout:
    """Choose the columns and widths for ``width`` cells.

    whole_names : never shorten a name, whatever the width (output that goes to a file).
    """
    visible = list(range(len(table.columns)))
    natural = [
        max([width_of(column.title), *(width_of(printable(row[k])) for row in table.rows)])
        for k, column in enumerate(table.columns)
    ]
    least = [
        _least(column, natural[k], natural[k] if whole_names else _NAME_COMFORT)
        for k, column in enumerate(table.columns)
    ]
    while _total(least, visible) > width - INDENT:
        candidates = [k for k in visible if table.columns[k].optional]
        if not candidates:
            break
        visible.remove(max(candidates, key=lambda k: table.columns[k].optional))
    if not whole_names and _total(least, visible) > width - INDENT:
        least = [_least(column, natural[k], _NAME_LEAST) for k, column in enumerate(table.columns)]
    widths = _share(natural, least, visible, width - INDENT)
    columns = [table.columns[k] for k in visible]
    rows = [[_cell(row[k], table.columns[k], w) for k, w in zip(visible, widths)] for row in table.rows]
    dropped = [column.title for k, column in enumerate(table.columns) if k not in visible]
    return Layout(columns, widths, rows, dropped)


def _least(column: Column, natural: int, name: int) -> int:
    return min(natural, {"name": name, "text": _TEXT_LEAST}.get(column.kind, natural))


def _total(widths: list[int], visible: list[int]) -> int:
    return sum(widths[k] for k in visible) + GAP * (len(visible) - 1)


def _share(natural: list[int], least: list[int], visible: list[int], width: int) -> list[int]:
    """Start from the least widths and hand out what is left, a cell at a time, where it is missed most."""
    widths = {k: least[k] for k in visible}
    spare = width - _total(least, visible)
    while spare > 0:
        wanting = [k for k in visible if widths[k] < natural[k]]
        if not wanting:
            break
        widths[min(wanting, key=lambda k: widths[k] / natural[k])] += 1
        spare -= 1
    return [widths[k] for k in visible]


def _cell(text: str, column: Column, width: int) -> list[str]:
    text = printable(text)
    if column.kind == "name":
        return [shorten(text, width)]
    if column.kind == "text":
        return textwrap.wrap(text, max(width, 1), break_on_hyphens=False) or [""]
    return [text]


#: A line is pieces of text, each with its role: title, head, rule, name, label, number, text, note.
Line = list[tuple[str, str]]


def table_lines(table: Table, layout: Layout, width: int) -> list[Line]:
    """The table as lines: title, headings, a rule, rows, notes. Renderers only add colour.

    A title's part after two blanks is a hint, left out where it does not fit.
    """
    title, _, hint = table.title.partition("  ")
    lines: list[Line] = [[(title, "title")]]
    if hint and width_of(table.title) <= width:
        lines[0].append(("  " + hint, "note"))
    if any(column.title for column in layout.columns):
        lines.append(_row_line(layout, [shorten(c.title, w) for c, w in zip(layout.columns, layout.widths)], "head"))
        lines.append(_row_line(layout, ["─" * w for w in layout.widths], "rule"))
    for row in layout.rows:
        for k in range(max(len(cell) for cell in row)):
            lines.append(_row_line(layout, [cell[k] if k < len(cell) else "" for cell in row]))
    return lines + [[(note, "note")] for note in _footnotes(table, width)]


def _row_line(layout: Layout, cells: list[str], role: str | None = None) -> Line:
    line: Line = []
    for k, (text, column, width) in enumerate(zip(cells, layout.columns, layout.widths)):
        lead = " " * (GAP if k else INDENT)
        filled = pad(text, width, column.kind == "number")
        last = k == len(cells) - 1
        line.append((lead + (filled.rstrip() if last else filled), role or column.kind))
    return line


def _footnotes(table: Table, width: int) -> list[str]:
    notes = [f"… and {table.more} more (--all)"] if table.more else []
    return [line for note in notes + table.notes for line in wrapped(note, width, INDENT)]


def missing_columns(titles: list[str], width: int) -> list[Line]:
    """A remark for the whole report about columns left out of its tables for want of space."""
    if not titles:
        return []
    remark = f"No room at this width for: {', '.join(titles)}. A wider terminal or --json shows them."
    return [[], *([(line, "note")] for line in wrapped(remark, width))]


def wrapped(text: str, width: int, indent: int = 0, hanging: int = 0) -> list[str]:
    """Prose cut to a width."""
    return textwrap.wrap(
        printable(text), max(width, 20), initial_indent=" " * indent,
        subsequent_indent=" " * (indent + hanging), break_on_hyphens=False, break_long_words=False,
    ) or [""]
