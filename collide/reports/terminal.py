"""The report as a person reads it in a terminal: the verdict first, the proofs last.

One set of tables, two ways to draw it: with colours through `rich` where that is installed and the
output is a terminal, as plain aligned text everywhere else.
"""

from __future__ import annotations

import math
import os
import shutil
import sys

from collide.reports.report import Pair, Report
from collide.reports.tables import Column, Line, Table, lay_out, missing_columns, table_lines, wrapped
from collide.reports.units import brief_length, coordinates, count, directions, lengths, seconds, widths

#: Rows shown of each long list, unless all are asked for.
SHORT = 12
#: Cells a line may take where the output is no terminal and says nothing about its width.
PIPE_WIDTH = 120
_MARK = "≈ "


def render(report: Report, *, everything: bool = False, width: int = 80, whole_names: bool = False) -> list[Line]:
    """The report as lines of (text, role) pieces.

    everything : no list is shortened.   width : cells a line may take.
    whole_names : never shorten a name (for output that goes to a file).
    """
    limit = None if everything else SHORT
    style = "colliding" if report.colliding else "touching" if report.touching or report.shallow else "free"
    lines: list[Line] = [[(line, style)] for line in wrapped(report.verdict(), width, hanging=2)]
    lines += [[(line, "note")] for line in wrapped(_scene_line(report), width, hanging=2)]
    dropped: dict[str, None] = {}  # a set that keeps its order
    for table in _tables(report, limit):
        layout = lay_out(table, width, whole_names)
        dropped.update(dict.fromkeys(layout.dropped))
        lines.append([])
        lines += [[(t, _role(role, table.style)) for t, role in line] for line in table_lines(table, layout, width)]
    lines += _prose("NOTES", [f"- {note}" for note in report.notes], width, hanging=2)
    lines += _prose("TIME", _times(report), width)
    return lines + missing_columns(list(dropped), width)


def _role(role: str, style: str) -> str:
    return style if role == "title" and style != "plain" else role


def _scene_line(report: Report) -> str:
    scene = report.scene
    kind = "robot" if len(scene["robots"]) == 1 else "robots"
    robots = f", {kind} {', '.join(scene['robots'])}" if scene["robots"] else ""
    return f"{scene['name']}: {count(scene['bodies'], 'body', 'bodies')} ({scene['static']} fixed){robots}"


#: Stages in the order they run; any others follow.
_STAGES = ("read", "meshes", "compile", "pack", "broadphase", "narrowphase", "report")


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


# --- tables -------------------------------------------------------------------------------------


def _tables(report: Report, limit: int | None) -> list[Table]:
    shallower = f"SHALLOW  proven less deep than {brief_length(report.query['min_depth'])}, deepest first"
    near = f"NEAR  apart, nearer than {brief_length(report.query['clearance'])}, nearest first"
    tables = [
        _pair_table("COLLIDING  deepest first", "colliding", report.colliding, "depth", limit),
        _pair_table(shallower, "touching", report.shallow, "depth", limit),
        _pair_table("TOUCHING  gap or overlap below rounding", "touching", report.touching, "within", limit),
        _pair_table(near, "near", report.near, "distance", limit),
        _unanswered_table(report),
        _mesh_table(report, limit),
        _approximation_table(report, limit),
        _skip_table(report),
        _proof_table(report),
    ]
    return [table for table in tables if table.rows]


def _pair_table(title: str, style: str, pairs: list[Pair], measure: str, limit: int | None) -> Table:
    """A class of pairs; ``measure`` says what its number is: depth, distance or within."""
    shown = pairs[:limit]
    unit, on_a = coordinates([pair.point_a for pair in shown])
    columns = [
        (Column("body A", "name"), [_marked(pair, pair.a) for pair in shown]),
        (Column("body B", "name"), [_marked(pair, pair.b) for pair in shown]),
        (Column(measure), _at_most(shown, lengths([_measured(pair, measure) for pair in shown]))),
        (Column(f"at x y z [{unit}]", "label", 1), on_a),
        (Column("normal A→B", "label", 2), directions([pair.normal for pair in shown])),
    ]
    if measure == "within":
        columns.append((Column("exactly", "label", 3), [_verdict(pair) for pair in shown]))
    else:
        columns.append((Column("known to", "number", 3), widths([_bracket(pair) for pair in shown])))
        columns.append((Column("decided by", "label", 4), [pair.how for pair in shown]))
    if any(pair.part_a or pair.part_b for pair in shown):
        columns.append((Column("parts", "label", 5), [f"{pair.part_a}, {pair.part_b}" for pair in shown]))
    rows = [list(cells) for cells in zip(*(cells for _, cells in columns))]
    notes = _bracket_notes(shown, measure, limit)
    return Table(title, [column for column, _ in columns], rows, style, notes, more=len(pairs) - len(shown))


def _bracket_notes(pairs: list[Pair], measure: str, limit: int | None) -> list[str]:
    """A line for each pair whose number is proven less tightly than promised."""
    wide = [pair for pair in pairs if not pair.certified and measure != "within" and not _is_bound(pair)]
    notes = ["≤: a move that long along the normal parts the bodies, proven; a shorter one may do"] if any(
        map(_is_bound, pairs)
    ) and measure != "within" else []
    notes += [
        f"{pair.a} and {pair.b}: {measure} known to {lengths([_bracket(pair)])[0].strip()} only, wider than promised"
        for pair in wide
    ]
    if limit and len(notes) > 3:
        notes[3:] = [f"… and {len(notes) - 3} more with a wide bracket (--all)"]
    return notes


def _is_bound(pair: Pair) -> bool:
    """Whether no depth is known but that it is not larger: of bodies that are not convex."""
    return pair.depth is not None and pair.upper == 0.0 and pair.depth > 0.0


def _at_most(pairs: list[Pair], texts: list[str]) -> list[str]:
    return [f"≤ {text}" if _is_bound(pair) else text for pair, text in zip(pairs, texts)]


def _verdict(pair: Pair) -> str:
    """What exact arithmetic says of a pair that rounding cannot tell."""
    if not pair.decided:
        return "open"
    return "meet" if pair.depth is not None else "apart"


def _marked(pair: Pair, name: str) -> str:
    return _MARK + name if name in pair.approximated else name


def _measured(pair: Pair, measure: str) -> float:
    if measure == "within":
        return max(abs(_or_infinite(pair.lower)), abs(_or_infinite(pair.upper)))
    return _or_infinite(pair.depth if measure == "depth" else pair.distance)


def _or_infinite(value: float | None) -> float:
    return math.inf if value is None else value


def _bracket(pair: Pair) -> float:
    return _or_infinite(pair.upper) - pair.lower if pair.lower is not None else math.inf


def _approximation_table(report: Report, limit: int | None) -> Table:
    shown = report.approximations[:limit]
    return Table(
        f"APPROXIMATED  marked {_MARK.strip()} above: answers hold for what stands in",
        [Column("body", "name"), Column("stands in", "text")],
        [[entry["body"], entry["what"]] for entry in shown],
        more=len(report.approximations) - len(shown),
    )


def _mesh_table(report: Report, limit: int | None) -> Table:
    """Surfaces before solids: what has no inside is what a reader has to know."""
    rows = sorted(report.meshes, key=lambda entry: entry["solid"])
    shown = rows[:limit]
    return Table(
        "MESHES  as they are, triangle by triangle",
        [Column("body", "name"), Column("taken as", "text")],
        [[entry["body"], entry["what"]] for entry in shown],
        more=len(rows) - len(shown),
    )


def _unanswered_table(report: Report) -> Table:
    return Table(
        "NOT ANSWERED  near each other; whether they collide is not known",
        [Column("body A", "name"), Column("body B", "name"), Column("because", "text")],
        [[entry["a"], entry["b"], entry["why"]] for entry in report.unanswered],
        "colliding",
    )


def _skip_table(report: Report) -> Table:
    return Table(
        "NEVER TESTED  nothing is claimed about these pairs",
        [Column("pairs"), Column("why", "text")],
        [
            [str(entry["pairs"]), entry["reason"] + (f": {entry['meaning']}" if entry["meaning"] else "")]
            for entry in report.skipped
        ],
    )


def _proof_table(report: Report) -> Table:
    return Table(
        "HOW EACH ANSWER IS KNOWN",
        [Column("pairs"), Column("argument", "label"), Column("because", "text")],
        [[str(entry["pairs"]), entry["how"], entry["sentence"]] for entry in report.proofs],
    )


# --- drawing ------------------------------------------------------------------------------------

#: Role → rich style. Colour repeats what the words say; it never carries meaning alone.
_STYLES = {
    "colliding": "bold red", "touching": "bold yellow", "near": "bold cyan", "free": "bold green",
    "title": "bold", "head": "dim", "rule": "dim", "note": "dim", "label": "none", "text": "none",
    "name": "none", "number": "bold",
}
#: For terminals that cannot encode the real ones; as many cells where tables use them.
_PLAIN = str.maketrans(
    {"…": "~", "─": "-", "µ": "u", "→": ">", "≈": "~", "≤": "<=", "≥": ">=", "–": "-", "−": "-", "×": "x"}
)


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
    """Lay one table out for a stream and print it there."""
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


def write_text(text: str, stream=None) -> None:
    """Write text to a stream whose encoding may know ASCII only."""
    stream = sys.stdout if stream is None else stream
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        text = text.translate(_PLAIN).encode(encoding, "backslashreplace").decode(encoding)
    stream.write(text)
