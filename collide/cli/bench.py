"""The command ``collide bench``: its arguments, and its work. Imports the standard library alone before the run."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from collide.cli.numbers import count, minutes

EPILOG = """examples:
  collide bench list                              what can be measured
  collide bench pareto --out measured             run time against error
  collide bench pareto --quick --out look         half a minute
  collide bench pareto --engines collide,coal,coal:tight --classes near,flush
  collide bench scaling --out measured            time and operations against n
  collide bench run convex -- --quick             a script of a clone's benchmarks/

pareto asks every engine and setting about the same pairs: random, near,
resting, flush, needles, large, meshes. Answers are judged in exact arithmetic;
then all engines are timed, each in a process of its own, in turns. Written are
  DIR/pareto.svg, pareto.png  error against time, log axes: a point at the
                              medians, lines to the p99 time and the largest
                              error; a red ring where booleans are wrong or
                              answers failed, with their numbers
  DIR/pareto.csv              a row a class and engine, with the machine
Leave the machine alone meanwhile, and read the ratios: they come from turns
taken together. Times are of an engine's call with geometry, poses and requests
made beforehand where its interface keeps them, in CPU seconds of the process;
the CSV's column `timed` says what is in each.

Wrong booleans are counted with and without pairs within 1e-12 of their size of
touching ("3 wrong, 1 apart"). Aborts, hangs and NaN are answers of their own.

Engines: pip install 'collide-robotics[peers]'; pictures: 'collide-robotics[plots]'

exit status: 0 measured, 2 error; of run, the script's own"""

_FILES = ("svg", "png")


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def add_arguments(parser: argparse.ArgumentParser, engines: Callable) -> None:
    """engines : reads names of engines."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", title="actions", required=True)
    pareto = actions.add_parser("pareto", help="run time against error, as one picture")
    pareto.add_argument("--classes", type=_names, metavar="NAMES", help="classes of pairs, commas between (all)")
    pareto.add_argument("--cases", type=count, metavar="N", help="pairs of a class (60; with --quick 12)")
    scaling = actions.add_parser("scaling", help="run time and operations against size, with slopes")
    scaling.add_argument("--sizes", type=_sizes, metavar="N,N", help="vertices of each hull (8 to 32,768)")
    libraries = "collide, coal, fcl, pybullet"
    for action, least, default in ((pareto, 3.0, "all that are installed"), (scaling, 2.0, libraries)):
        action.add_argument("--engines", type=engines, metavar="NAMES",
                            help=f"engines and settings, commas between ({default})")
        action.add_argument("--minutes", type=minutes, metavar="M",
                            help=f"about how long to time ({least:g}; with --quick 0.2)")
        action.add_argument("--seed", type=int, default=0, metavar="S", help="other seeds make other pairs (0)")
        action.add_argument("--out", metavar="DIR", default="bench-results", help="the folder (%(default)s)")
        action.add_argument("--quick", action="store_true", help="a look: fewer pairs, less time")
        action.add_argument("--csv-only", action="store_true", help="no picture, which needs the extra plots")
        action.add_argument("--quiet", action="store_true", help="no table, no progress; errors are still told")
    actions.add_parser("list", help="what can be measured, explained")
    script = actions.add_parser("run", help="run a script of a clone's benchmarks/")
    script.add_argument("name", metavar="NAME", help="as collide bench list prints it")
    script.add_argument("arguments", nargs="*", metavar="ARG", help="behind --, as they are")


def run(args: argparse.Namespace, progress: Callable) -> int:
    """The exit status."""
    if args.action == "list":
        return _list()
    if args.action == "run":
        from collide.adapters.bench.benchmark_scripts import run_script

        return run_script(args.name, args.arguments)
    return (_pareto if args.action == "pareto" else _scaling)(args, progress)


def _list() -> int:
    from collide.adapters.bench.benchmark_scripts import PACKAGED, scripts
    from collide.reports import terminal
    from collide.reports.tables import Column, Table

    columns = [Column("name", "label"), Column("what it measures", "text")]
    rows = [[name, about] for name, about in PACKAGED.items()]
    terminal.show_table(Table("BENCH  collide bench NAME", columns, rows))
    listed = scripts()
    terminal.write_text("\n")
    if not listed:
        terminal.write_text("The scripts of benchmarks/ are in a clone of the repository, not in a wheel.\n")
        return 0
    rows = [[script.name, script.about] for script in listed if script.runs]
    terminal.show_table(Table("SCRIPTS  collide bench run NAME -- ARGUMENTS", columns, rows))
    terminal.write_text("\n")
    parts = [[script.name, script.about] for script in listed if not script.runs]
    terminal.show_table(Table("PARTS  of the scripts, not run by themselves", columns, parts))
    return 0


def _pareto(args: argparse.Namespace, progress: Callable) -> int:
    from collide.adapters.bench import pareto, pareto_picture
    from collide.adapters.bench.bench_classes import CLASSES
    from collide.adapters.bench.machine_stamp import machine_stamp, write_csv

    places, stamp = _prepared(args, "pareto", pareto_picture.check_picture), machine_stamp()
    with progress("measuring") as rename:
        points = pareto.measure(
            args.engines or pareto.default_engines(), args.classes or list(CLASSES),
            minutes=args.minutes or (0.2 if args.quick else 3.0), n=args.cases or (12 if args.quick else 60),
            seed=args.seed, progress=_renamer(rename),
        )
    rows = [point.row() for point in points]
    write_csv(places[0], rows, stamp)
    if places[1:]:
        pareto_picture.draw(points, places[1:], stamp)
    if not args.quiet:
        heads = {
            "class": "class", "engine": "engine", "ratio": "× collide", "median_us": "µs", "p99_us": "p99",
            "median_error": "error", "max_error": "largest", "wrong": "wrong", "wrong_apart": "apart",
            "mishaps": "failed", "unsupported": "n/a",
        }
        _show("PARETO  time and error of signed distances; errors as parts of the size", heads, rows, places)
    return 0


def _scaling(args: argparse.Namespace, progress: Callable) -> int:
    from collide.adapters.bench import growth, scaling
    from collide.adapters.bench.machine_stamp import machine_stamp, write_csv
    from collide.adapters.bench.pareto import scaling_engines
    from collide.adapters.bench.pareto_picture import check_picture

    places, stamp = _prepared(args, "scaling", check_picture), machine_stamp()
    sizes = args.sizes or (scaling.SIZES[:5] if args.quick else scaling.SIZES)
    with progress("measuring") as rename:
        grown = scaling.measure(
            args.engines or scaling_engines(), sizes, minutes=args.minutes or (0.2 if args.quick else 2.0),
            seed=args.seed, progress=_renamer(rename),
        )
    write_csv(places[0], [row for growth in grown for row in growth.rows()], stamp)
    for place in places[1:]:
        growth.draw([row for of in grown for row in of.rows()], scaling.PANELS, place)
    if not args.quiet:
        rows = [
            {"what": g.name, "unit": g.unit, "slope": f"{g.slope:.2f}",
             **{str(n): f"{value:.3g}" for n, value in zip(g.sizes, g.values)}}
            for g in grown
        ]
        heads = {"what": "engine", "unit": "unit", **{str(n): f"n = {n:,}" for n in sizes}, "slope": "slope"}
        _show("SCALING  hulls of n points on a sphere; slope: value ~ n^slope", heads, rows, places)
    return 0


def _prepared(args: argparse.Namespace, name: str, check_picture: Callable) -> list[Any]:
    """The files to be written, the CSV first; refused before the work where they cannot be."""
    from pathlib import Path

    from collide.errors import InvalidArgument

    if args.seed < 0:
        raise InvalidArgument(f"--seed must be a whole number, 0 or more, got {args.seed}")
    folder = Path(args.out)
    pictures = [] if args.csv_only else [folder / f"{name}.{kind}" for kind in _FILES]
    for place in pictures:
        check_picture(str(place))
    folder.mkdir(parents=True, exist_ok=True)
    return [folder / f"{name}.csv", *pictures]


def _renamer(rename: Callable | None) -> Callable:
    return (lambda label: None) if rename is None else rename


def _show(title: str, heads: dict[str, str], rows: list[dict], places: list) -> None:
    from collide.reports import terminal
    from collide.reports.tables import Column, Table

    texts = ("class", "engine", "what", "unit", "mishaps")
    columns = [Column(head, "label" if key in texts else "number") for key, head in heads.items()]
    cells = [[str(row[key]) for key in heads] for row in rows]
    written = f"written: {', '.join(str(place) for place in places)}"
    terminal.show_table(Table(title, columns, cells, notes=[written]))


def _sizes(text: str) -> tuple[int, ...]:
    sizes = tuple(count(word) for word in text.split(","))
    if min(sizes) < 4:
        raise argparse.ArgumentTypeError(f"a hull has 4 vertices or more, got {text!r}")
    return sizes
