"""The command ``collide``: arguments in, reports out, exit statuses for scripts.

Exit statuses: 0 done (``check``: free), 1 a finding (``check``: a collision,
``compare``, ``fuzz``: an answer of ours proven wrong, ``doctor``: something is broken), 2 an error, told in
a line on stderr, 130 interrupted, 141 the reader of a pipe went away.

This module imports the standard library alone, so that ``--help`` answers at once; each command
imports its own modules.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from contextlib import contextmanager

from collide.base.whole_file import write_whole
from collide.cli import arguments
from collide.cli import bench as cli_bench
from collide.cli import compare as cli_compare
from collide.cli import config_command as cli_config
from collide.cli import export_command as cli_export
from collide.cli import fuzz as cli_fuzz
from collide.cli import locality_command as cli_locality
from collide.cli import pages as cli_pages
from collide.cli import papers_command as cli_papers
from collide.cli import scenes as cli_scenes
from collide.cli import solid_commands as cli_solids
from collide.cli import spheres_command as cli_spheres
from collide.cli import srdf as cli_srdf
from collide.cli import sweep_command as cli_sweep
from collide.cli import view as cli_view
from collide.cli.files import check_place, copy_scene, first_words, print_lines, write_json
from collide.errors import CollideError, InvalidArgument, UnsupportedQuery
from collide.reports.number_format import count

_STARTED = time.perf_counter()

FREE, YES, ERROR, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 130, 141


def main(argv: list[str] | None = None) -> int:
    """Run a command; never raises, never prints a traceback unless COLLIDE_TRACEBACK=1.

    argv : arguments without the program's name; ``None`` takes ``sys.argv``.
    Returns the exit status.
    """
    try:
        status = _run(sys.argv[1:] if argv is None else argv)
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        _drop_stdout()
        return PIPE_CLOSED
    except KeyboardInterrupt:
        _say("interrupted")
        return INTERRUPTED
    except Exception as error:  # noqa: BLE001 - the last net under every command
        return _fail(error)


def _run(argv: list[str]) -> int:
    try:
        args = arguments.parse(argv)
    except arguments.UsageError as wrong:
        _say(f"error: {wrong}")
        return ERROR
    except SystemExit as stop:  # argparse after --help and --version
        return stop.code if isinstance(stop.code, int) else ERROR
    if args.command is None:
        arguments.parser().print_help()
        return FREE
    if getattr(args, "json", None) not in (None, "-"):
        check_place("--json", args.json, ".json")  # before the work, not after it
    if getattr(args, "html", None) is not None:
        cli_pages.check_page_place(args.html)
    if getattr(args, "glb", None) is not None:
        check_place("--glb", args.glb, ".glb")
    if getattr(args, "json", None) == getattr(args, "html", None) == "-":
        raise InvalidArgument("--json and --html: standard output takes one of them")
    with _log_on_stderr(getattr(args, "quiet", False)):
        return _COMMANDS[args.command](args)


def _fail(error: Exception) -> int:
    if os.environ.get("COLLIDE_TRACEBACK") == "1":
        import traceback

        traceback.print_exc()
    if isinstance(error, CollideError):
        what = str(error)
    elif isinstance(error, OSError) and error.strerror is not None:
        what = f"{error.filename}: {error.strerror}" if error.filename is not None else f"writing: {error.strerror}"
    elif isinstance(error, ModuleNotFoundError) and error.name == "numpy":
        what = f"{error.name} is not installed: pip install collide-robotics"
    elif isinstance(error, MemoryError):
        what = "out of memory"
    else:
        what = (
            f"this is a bug in collide: {type(error).__name__}: {error} "
            "(COLLIDE_TRACEBACK=1 shows where; please report it)"
        )
    for message in getattr(error, "messages", ()) or (what,):
        _say("error: " + " ".join(message.split()))
    return ERROR


def _drop_stdout() -> None:
    """Python flushes stdout once more at exit: give it somewhere to go."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (OSError, ValueError):  # a stdout without a file behind it
        pass


def _say(text: str) -> None:
    from collide.reports.tables import printable, write_text

    try:
        write_text(f"collide: {printable(text)}\n", sys.stderr)
        sys.stderr.flush()
    except OSError:  # nobody reads stderr either
        pass


@contextmanager
def _log_on_stderr(quiet: bool):
    """Warnings of the library (a cache that cannot be written) as lines like the command's own."""
    import logging

    class Lines(logging.Handler):
        def emit(self, record):
            _say(f"{record.levelname.lower()}: {record.getMessage()}")

    log, lines = logging.getLogger("collide"), Lines(logging.ERROR if quiet else logging.WARNING)
    log.addHandler(lines)
    try:
        yield
    finally:
        log.removeHandler(lines)


# --- commands -----------------------------------------------------------------------------------


def _report(args) -> int:
    from collide.reports import terminal

    if args.geometry and not args.json:
        raise InvalidArgument("--geometry adds to the JSON of a report: give --json FILE too")
    if args.csv:
        check_place("--csv", args.csv, ".csv")
    progress = _progress(args.quiet)
    made = cli_scenes.reports(args, progress, _STARTED, clearance=args.clearance)
    if args.geometry:
        from collide.reports import scene_geometry as geometry

        for state_report in made:
            state_report.report.geometry = geometry.of_scene(state_report.scene)
    _write_reports(made, args.json)
    if args.csv:
        from collide.reports.state_reports import csv_text

        write_whole(args.csv, csv_text(made))
    if args.html:
        cli_pages.write_report(args, made, progress)
    if args.glb:
        cli_pages.write_glb(args.glb, made[0], progress)
    if _has_stdout(args):
        from collide.reports import state_reports as states

        width, whole_names = terminal.output_width(sys.stdout)
        layout = {"everything": args.all, "proofs": args.proofs or args.all, "width": width, "whole_names": whole_names}
        terminal.write(states.render(made, **layout))
    return FREE


def _check(args) -> int:
    from collide.reports import checking, junit, sarif

    known = checking.read_baseline(args.baseline) if args.baseline else None
    places = {"--write-baseline": ".json", "--junit": ".xml", "--csv": ".csv", "--sarif": ".sarif"}
    for option, suffix in places.items():
        place = getattr(args, option[2:].replace("-", "_"))
        if place:
            check_place(option, place, suffix)
    progress = _progress(args.quiet)
    made = cli_scenes.reports(args, progress, _STARTED, min_depth=args.min_depth, clearance=args.clearance)
    checks = [
        checking.check(
            result.report, result.label, touching_counts=args.touching_is_collision, known=known,
            tolerance=args.baseline_tolerance,
            robots=_robots(result.scene) if args.clearance else (),
        )
        for result in made
    ]
    _write_reports(made, args.json)
    if args.write_baseline:
        write_whole(args.write_baseline, checking.baseline_text(checks))
    if args.junit:
        write_whole(args.junit, junit.text(checks))
    if args.sarif:
        report = made[0].report
        write_json(sarif.items(checks, report.scene["sources"], report.missing_meshes), args.sarif)
    if args.csv:
        write_whole(args.csv, checking.csv_text(checks))
    if args.html:
        cli_pages.write_check(args, made, checks, progress)
    if args.glb:
        cli_pages.write_glb(args.glb, made[0], progress)
    if _has_stdout(args):
        print_lines(line for result in checks for line in result.lines(len(checks) > 1))
    if not args.quiet:
        for result in checks:
            _say(result.verdict())
        _say_what_was_taken(made[0].report)
    if args.write_baseline:
        return FREE
    if any(result.fails for result in checks):
        return YES
    missing = made[0].report.missing_meshes
    if missing and not args.allow_missing_meshes:
        raise UnsupportedQuery(
            f"whether the scene is free is not known: {count(len(missing), 'mesh is', 'meshes are')} missing and NOT "
            "checked (--allow-missing-meshes takes the rest for the whole)"
        )
    unanswered = [entry for result in checks for entry in result.unanswered]
    if unanswered:
        first = unanswered[0]
        raise UnsupportedQuery(f"whether the scene is free is not known: {first['a']} and {first['b']}: {first['why']}")
    return FREE


def _robots(scene) -> list[frozenset[str]]:
    """Bodies of each robot."""
    return [frozenset(placement.carried) for placement in scene.placements.values()]


def _say_what_was_taken(report) -> None:
    """Free may mean less than it seems: what has no inside, and what stands in for something else."""
    surfaces = sorted({entry["body"] for entry in report.meshes if not entry["solid"]})
    others = sorted({entry["body"] for entry in report.approximations})
    for entry in (*(f"not checked: {mesh}" for mesh in report.missing_meshes), *report.asks):
        _say(entry)
    for bodies, what in ((surfaces, "surfaces without an inside"), (others, "not the shape the scene names")):
        if bodies:
            more = f" and {len(bodies) - 3} more" if len(bodies) > 3 else ""
            _say(f"{what}: {', '.join(bodies[:3])}{more} (see: collide report)")


def _has_stdout(args) -> bool:
    """Whether tables may be printed: standard output is not taken by JSON or a page, and nobody asked for quiet."""
    return "-" not in (args.json, args.html) and not args.quiet


def _progress(quiet: bool) -> Callable:
    from collide.reports.progress import Progress, silent

    return silent if quiet else Progress()


def _stress(args) -> int:
    from collide.adapters.peers.stress import run
    from collide.reports import terminal
    from collide.reports.tables import Column, Table

    progress = _progress(args.quiet)
    with progress("asking the hard families"):
        table = run(args.family or None, n=args.cases, seed=args.seed, engine=args.engine)
    if args.json:
        write_json(table.to_dict().items(), args.json)
    if args.save:
        table.save(args.save)
    if args.json != "-" and not args.quiet:
        headers, rows = table.table()
        kinds = ["label", *["number"] * (len(headers) - 2), "text"]
        columns = [Column(title, kind, optional=int(k > 5)) for k, (title, kind) in enumerate(zip(headers, kinds))]
        title = f"STRESS  {args.engine}, {args.cases} cases a family, seed {args.seed}; judged in exact arithmetic"
        terminal.show_table(Table(title, columns, rows))
    if not args.quiet:
        _say(
            f"{count(table.wrong, 'wrong answer')}, {table.failed} failed, {table.undecided} left open by {args.engine}"
        )
    return YES if args.engine == "collide" and (table.wrong or table.failed) else FREE


def _scenes(args) -> int:
    if args.copy:
        print(copy_scene(args.copy, args.force))
        return FREE
    from collide.reports import terminal
    from collide.reports.tables import Column, Table
    from collide.scenes import path, shipped

    rows = [[name, first_words(path(name))] for name in shipped()]
    table = Table(
        "SCENES  collide report NAME", [Column("name", "label"), Column("what it is", "text")], rows,
        notes=["collide scenes --copy NAME makes a copy to change"],
    )
    terminal.show_table(table)
    return FREE


def _doctor(args) -> int:
    from collide.reports import doctor, terminal

    progress = _progress(False)
    examination = doctor.examine(progress)
    for table in examination.tables():
        terminal.show_table(table)
        print()
    print(examination.verdict())
    return FREE if examination.sound else YES


def _write_reports(made: list, place: str | None) -> None:
    if place:
        from collide.reports import state_reports as states

        write_json(states.items(made), place)


_COMMANDS: dict[str, Callable] = {
    "report": _report, "check": _check, "stress": _stress,
    "locality": lambda args: cli_locality.run(args, _progress(args.quiet)),
    "papers": cli_papers.run, "scenes": _scenes, "doctor": _doctor, "config": cli_config.run,
    "export": lambda args: cli_export.run(args, _progress(args.quiet)),
    "bench": lambda args: cli_bench.run(args, _progress(getattr(args, "quiet", True))),
    "compare": lambda args: FREE if cli_compare.run(args, _progress(args.quiet)) else YES,
    "fuzz": lambda args: FREE if cli_fuzz.run(args, _progress(args.quiet)) else YES,
    "srdf": lambda args: FREE if cli_srdf.run(args, _progress(args.quiet)) else YES,
    "spheres": lambda args: FREE if cli_spheres.run(args, _progress(args.quiet)) else YES,
    "solid": lambda args: cli_solids.run_solid(args, _progress(args.quiet)),
    "cells": lambda args: cli_solids.run_cells(args, _progress(args.quiet)),
    "obstacle": lambda args: cli_solids.run_obstacle(args, _progress(args.quiet)),
    "sweep": lambda args: FREE if cli_sweep.run(args, _progress(args.quiet)) else YES,
    "view": lambda args: cli_view.run(args, _progress(args.quiet), _STARTED, _say),
}
