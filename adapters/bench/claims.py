"""What a script of benchmarks/ is made of, and the command line that all of them share.

    CLAIMS = [Claim("worlds", "Worlds beside managers", cases, measure, unit="us")]
    if __name__ == "__main__":
        main(__doc__, CLAIMS)

A claim has cases, each a dict of columns that name it (n=128, layout="pit"); `measure(options, **case)` makes inputs,
checks the answers, and returns a `Race` of contestants that are ready to be asked, or rows of what it counted. The
harness takes turns, makes rows, and writes them: a table to the terminal, a CSV to benchmarks/results, a picture.
"""

from __future__ import annotations

import argparse
import csv
import importlib.util
import io
import itertools
import math
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, cast

from collide.adapters.bench.benchmark_scripts import FOLDER
from collide.adapters.bench.growth import Panel, draw
from collide.adapters.bench.machine_stamp import file_name, machine_stamp
from collide.adapters.bench.pareto_picture import check_picture
from collide.adapters.bench.turns import race
from collide.base.whole_file import write_whole
from collide.errors import CollideError, InvalidArgument
from collide.reports import terminal
from collide.reports.tables import Column, Table, lay_out

RESULTS = FOLDER / "results"
#: Units of times, by how many of them a second has.
UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
#: Turns of a look, and seconds of its cases.
QUICK_TURNS, QUICK_SECONDS = 3, 1.0
Row = dict[str, Any]
Options = argparse.Namespace


class Race(NamedTuple):
    """Contestants on one case. The first is ours: ratios are theirs by ours.

    tasks : name → a call; one that gives `Seconds` has measured itself.
    per : what a call's seconds are divided by: its pairs, bodies, rays; or by name.
    columns : of all rows of the case.   beside : name → columns beside its times.
    bars : name → what the claim's figure is to meet.   close : called behind the last turn.
    """

    tasks: dict[str, Callable[[], Any]]
    per: float | dict[str, float] = 1.0
    columns: Row = {}
    beside: dict[str, Row] = {}
    bars: dict[str, float] = {}
    close: Callable[[], object] = bool


class Claim(NamedTuple):
    """One table.

    name : of the table, and of its CSV (`file` where that is another).   sentence : what stands above it.
    cases(options) : the cases.   measure(options, **case) : a `Race`, or rows.
    unit : of times, of `UNITS`.   clock : around a call.   turns, seconds : at most, of a case.
    bar : the figure that bars are for: a "ratio" is to be as large at least, a "median" as small.
    notes(rows) : lines under the table.   panels : of the picture that --plot draws.
    everywhere : rows are counts, the same on every machine: the file's name has none.
    asked_for : measured only where --table names it.
    """

    name: str
    sentence: str
    cases: Callable[[Options], Iterable[Row]]
    measure: Callable[..., Race | Iterable[Row]]
    unit: str = "us"
    clock: Callable[[], float] = time.process_time
    turns: int = 9
    seconds: float = 20.0
    bar: str = "ratio"
    notes: Callable[[list[Row]], Iterable[str]] | None = None
    panels: tuple[Panel, ...] = ()
    everywhere: bool = False
    asked_for: bool = False
    file: str = ""


def grid(**columns: Iterable[Any]) -> Iterator[Row]:
    """A case for every combination of values, the last column's change first."""
    for values in itertools.product(*columns.values()):
        yield dict(zip(columns, values))


def installed(**packages: str) -> list[str]:
    """Those of some contestants whose package can be imported: name=package. Others are named once."""
    present = []
    for name, package in packages.items():
        try:
            missing = importlib.util.find_spec(package) is None
        except ModuleNotFoundError:
            missing = True
        if not missing:
            present.append(name)
        elif name not in _ABSENT:
            _ABSENT.add(name)
            say(f"left out: {name} ({package} is not installed)")
    return present


_ABSENT: set[str] = set()


def say(text: str) -> None:
    """Progress, beside the results."""
    print(text, file=sys.stderr, flush=True)


def rows_of(claim: Claim, case: Row, race_or_rows: Race | Iterable[Row], options: Options) -> list[Row]:
    """The rows of one case: of a race the median, least and largest of each contestant's turns."""
    if not isinstance(race_or_rows, Race):
        return [case | row for row in cast("Iterable[Row]", race_or_rows)]
    asked = race_or_rows
    try:
        max_turns = options.repeats or (QUICK_TURNS if options.quick else claim.turns)
        seconds = QUICK_SECONDS if options.quick else claim.seconds
        taken = race(asked.tasks, clock=claim.clock, min_turns=min(3, max_turns), max_turns=max_turns, seconds=seconds)
    finally:
        asked.close()
    scale, rows, ours = UNITS[claim.unit], [], float("nan")
    for number, (name, times) in enumerate(taken.items()):
        per = asked.per[name] if isinstance(asked.per, dict) else asked.per
        each = [seconds * scale / per for seconds in times]
        median = statistics.median(each)
        ours = ours if number else median
        figures = {"median": median, "least": min(each), "largest": max(each)}
        row: Row = {"engine": name, "turns": len(each), **{f"{k}_{claim.unit}": v for k, v in figures.items()}}
        row["ratio"] = median / ours if ours else float("nan")
        if asked.bars:
            row |= {"bar": "", "verdict": ""}
        if name in asked.bars:
            bar = asked.bars[name]
            met = row["ratio"] >= bar if claim.bar == "ratio" else median <= bar
            row |= {"bar": bar, "verdict": "met" if met else "missed"}
        rows.append(case | asked.columns | row | asked.beside.get(name, {}))
    return rows


def measured(claim: Claim, options: Options) -> tuple[list[Row], list[str]]:
    """(rows, names of the columns that name a case) of a claim; of an interrupted one those so far."""
    rows: list[Row] = []
    keys: dict[str, None] = {}
    started = time.perf_counter()
    try:
        for case in claim.cases(options):
            if all(str(case.get(key, "")) in values for key, values in options.only.items() if key in case):
                keys |= dict.fromkeys(case)
                say(f"{claim.name} {', '.join(f'{k} {v}' for k, v in case.items())} ({_seconds(started)})")
                rows += rows_of(claim, case, claim.measure(options, **case), options)
    except KeyboardInterrupt:
        say(f"{claim.name}: interrupted; what was measured before stands below")
        options.no_csv = True
    return rows, list(keys)


def _seconds(started: float) -> str:
    return f"{time.perf_counter() - started:.0f} s"


def show(claim: Claim, rows: list[Row], keys: list[str]) -> None:
    """The table, its notes, and how many bars are met."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    same = {key: str(rows[0].get(key, "")) for key in columns if len({str(row.get(key, "")) for row in rows}) == 1}
    if len(rows) > 2:
        columns = [key for key in columns if key not in same or isinstance(rows[0].get(key), float)]
    texts = {key for key in columns if any(isinstance(row.get(key), str) and row[key] for row in rows)}
    needed = {*keys, "engine", f"median_{claim.unit}", "ratio", "bar", "verdict"}
    heads = [
        Column(key.replace("_us", "_µs").replace("_", " "), "label" if key in texts else "number",
               0 if key in needed else k + 1)
        for k, key in enumerate(columns)
    ]
    notes = [*(claim.notes(rows) if claim.notes else ())]
    if len(rows) > 2 and (everywhere := [f"{key} {same[key]}" for key in same if key not in columns and same[key]]):
        notes.append(f"in all rows: {', '.join(everywhere)}")
    if judged := [row for row in rows if row.get("verdict")]:
        missed = [row for row in judged if row["verdict"] == "missed"]
        names = ("; missed: " + ", ".join(_case_name(row) for row in missed)) if missed else ""
        notes.append(f"bars met: {len(judged) - len(missed)} of {len(judged)}{names}")
    cells = [[_cell(row.get(key, "")) for key in columns] for row in rows]
    table = Table(f"{claim.name.upper()}  {claim.sentence}", heads, cells, notes=notes)
    if dropped := lay_out(table, terminal.output_width(sys.stdout)[0]).dropped:
        notes.append(f"no room at this width, in the CSV alone: {', '.join(dropped)}")
    terminal.show_table(table)
    terminal.write_text("\n")


def _case_name(row: Row) -> str:
    return " ".join(str(row[key]) for key in itertools.takewhile(lambda key: key != "turns", row))


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.4g}" if abs(value) < 1e4 else f"{value:,.0f}"
    return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)


def write(claim: Claim, rows: list[Row], keys: list[str], stamp: dict[str, str], partial: bool) -> Path:
    """The CSV; of a partial run the rows that the file has of other cases stay. Floats have six digits."""
    place = RESULTS / file_name(claim.file or claim.name, {} if claim.everywhere else stamp)
    lines = [{**{k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()}, **stamp} for row in rows]
    if partial and place.is_file():
        with place.open(newline="", encoding="utf-8") as file:
            earlier = list(csv.DictReader(file))
        again = {tuple(str(line.get(key, "")) for key in keys) for line in lines}
        lines = [line for line in earlier if tuple(line.get(key, "") for key in keys) not in again] + lines
    text = io.StringIO(newline="")
    names = dict.fromkeys(key for line in lines for key in line)
    writer = csv.DictWriter(text, [*(n for n in names if n not in stamp), *stamp], restval="", lineterminator="\n",
                            extrasaction="ignore")
    writer.writeheader()
    writer.writerows(lines)
    place.parent.mkdir(exist_ok=True)
    write_whole(place, text.getvalue())
    return place


def parser_of(description: str | None, claims: list[Claim]) -> argparse.ArgumentParser:
    """The arguments that every script has."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [claim.name for claim in claims]
    some = [claim.name for claim in claims if not claim.asked_for]
    parser.add_argument("--table", nargs="+", choices=names, default=some, metavar="NAME",
                        help=f"of {', '.join(names)} (default: {'all' if some == names else ', '.join(some)})")
    parser.add_argument("--only", action="append", default=[], metavar="COLUMN=VALUE,VALUE",
                        help="these cases alone; other rows of the CSV stay")
    parser.add_argument("--repeats", type=int, metavar="N", help="turns at most (each table has its own)")
    parser.add_argument("--quick", action="store_true", help="a look: small cases, few turns, no CSV")
    parser.add_argument("--no-csv", action="store_true", help="print the tables alone")
    if any(claim.panels for claim in claims):
        parser.add_argument("--plot", type=Path, metavar="FILE", help="draw what was measured (needs matplotlib)")
    return parser


def main(
    description: str | None, claims: list[Claim], more: Callable[[argparse.ArgumentParser], object] | None = None,
    arguments: list[str] | None = None,
) -> None:
    """Measure what the command line asks for.

    more : adds a script's own arguments.   arguments : instead of the command line's.
    """
    parser = parser_of(description, claims)
    if more is not None:
        more(parser)
    options = parser.parse_args(arguments)
    try:
        _main(parser, claims, options)
    except CollideError as error:
        raise SystemExit(f"error: {error}") from None


def _main(parser: argparse.ArgumentParser, claims: list[Claim], options: Options) -> None:
    options.only = dict(_case_values(parser, text) for text in options.only)
    if options.repeats is not None and options.repeats < 1:
        parser.error(f"--repeats must be 1 or more, got {options.repeats}")
    if getattr(options, "plot", None):
        check_picture(str(options.plot))
    stamp = machine_stamp()
    print(", ".join(f"{name} {value}" for name, value in stamp.items()), flush=True)
    for claim in [claim for claim in claims if claim.name in options.table]:
        rows, keys = measured(claim, options)
        if not rows:
            say(f"{claim.name}: nothing was measured")
            continue
        show(claim, rows, keys)
        if not (options.quick or options.no_csv):
            print(f"written to {write(claim, rows, keys, stamp, bool(options.only)).relative_to(FOLDER.parent)}")
        if claim.panels and options.plot:
            several = sum(bool(c.panels) for c in claims if c.name in options.table) > 1
            place = options.plot.with_name(f"{options.plot.stem}-{claim.name}{options.plot.suffix or '.png'}")
            draw(rows, claim.panels, place if several else options.plot)


def _case_values(parser: argparse.ArgumentParser, text: str) -> tuple[str, list[str]]:
    column, equals, values = text.partition("=")
    if not equals or not column or not values:
        parser.error(f"--only takes COLUMN=VALUE,VALUE, got {text!r}")
    return column, values.split(",")


def check(holds: bool, message: str) -> None:
    """Complain about an answer that a claim rests on.

    Raises InvalidArgument with the message: a wrong answer is not timed.
    """
    if not holds:
        raise InvalidArgument(f"wrong answers are not timed: {message}")
