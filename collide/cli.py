"""The command ``collide``: arguments in, reports out, exit statuses for scripts.

Exit statuses: 0 done (``check``: free), 1 what was asked about is so (``check``: a collision,
``compare``: an answer of ours proven wrong, ``doctor``: something is broken), 2 an error, told in
one line on stderr, 130 interrupted, 141 the reader of a pipe went away.

This module imports the standard library alone, so that ``--help`` answers at once; each command
imports what it needs.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from contextlib import contextmanager, suppress
from typing import NoReturn

from collide.errors import CollideError, InvalidArgument, UnsupportedQuery
from collide.reports.units import UNITS, count, parse_length

_STARTED = time.perf_counter()

FREE, YES, ERROR, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 130, 141


def main(argv: list[str] | None = None) -> int:
    """Run one command; never raises, never prints a traceback unless COLLIDE_TRACEBACK=1.

    argv : arguments without the program's name; None takes ``sys.argv``.
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
    parser = _parser()
    try:
        args = parser.parse_args(argv)
    except SystemExit as stop:  # argparse after --help, --version or a usage error
        return stop.code if isinstance(stop.code, int) else ERROR
    if args.command is None:
        parser.print_help()
        return FREE
    with _log_on_stderr(getattr(args, "quiet", False)):
        return args.run(args)


def _fail(error: Exception) -> int:
    if os.environ.get("COLLIDE_TRACEBACK") == "1":
        import traceback

        traceback.print_exc()
    if isinstance(error, CollideError):
        what = str(error)
    elif isinstance(error, OSError) and error.filename is not None:
        what = f"{error.filename}: {error.strerror}"
    elif isinstance(error, ModuleNotFoundError) and error.name in ("numpy", "numba", "llvmlite"):
        what = f"{error.name} is not installed: pip install collide-robotics"
    elif isinstance(error, MemoryError):
        what = "out of memory"
    else:
        what = (
            f"this is a bug in collide: {type(error).__name__}: {error} "
            "(COLLIDE_TRACEBACK=1 shows where; please report it)"
        )
    _say("error: " + " ".join(what.split()))
    return ERROR


def _drop_stdout() -> None:
    """Python flushes stdout once more at exit: give it somewhere to go."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (OSError, ValueError):  # a stdout without a file behind it
        pass


def _say(text: str) -> None:
    from collide.reports.tables import printable
    from collide.reports.terminal import write_text

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

    report = _make(args, clearance=args.clearance)
    if args.json:
        _write_json(report.to_dict(), args.json)
    if args.json != "-" and not args.quiet:
        width, whole_names = terminal.output_width(sys.stdout)
        terminal.write(terminal.render(report, everything=args.all, width=width, whole_names=whole_names))
    return FREE


def _check(args) -> int:
    from collide.reports import terminal
    from collide.reports.tables import printable

    report = _make(args, min_depth=args.min_depth)
    if args.json:
        _write_json(report.to_dict(), args.json)
    if args.json != "-" and not args.quiet:
        classes = {"collision": report.colliding, "shallow": report.shallow, "touching": report.touching}
        for what, pairs in classes.items():
            for pair in pairs:
                measure = "unbounded" if pair.distance is None else repr(pair.distance)
                terminal.write_text("\t".join((what, printable(pair.a), printable(pair.b), measure)) + "\n")
        sys.stdout.flush()
    if not args.quiet:
        _say(report.verdict())
        _say_what_was_taken(report)
    if report.colliding or (args.touching_is_collision and report.touching):
        return YES
    if report.unanswered:
        first = report.unanswered[0]
        raise UnsupportedQuery(f"whether the scene is free is not known: {first['a']} and {first['b']}: {first['why']}")
    return FREE


def _say_what_was_taken(report) -> None:
    """Free may mean less than it seems: what has no inside, and what stands in for something else."""
    surfaces = sorted({entry["body"] for entry in report.meshes if not entry["solid"]})
    others = sorted({entry["body"] for entry in report.approximations})
    for bodies, what in ((surfaces, "surfaces without an inside"), (others, "not the shape the scene names")):
        if bodies:
            more = f" and {len(bodies) - 3} more" if len(bodies) > 3 else ""
            _say(f"{what}: {', '.join(bodies[:3])}{more} (see: collide report)")


def _make(args, **limits):
    """Load the scene of the arguments and make its report."""
    progress = _progress(args.quiet)
    scene = _load(args, progress)
    _watch_compiler(progress)
    from collide.reports import report

    return report.make(scene, progress=progress, started=_STARTED, **limits)


def _progress(quiet: bool) -> Callable:
    from collide.reports.progress import Progress, silent

    return silent if quiet else Progress()


def _watch_compiler(progress: Callable) -> None:
    """Let the kernel compiler show its progress too; imports numba, so not before the scene is read."""
    from collide import _jit

    _jit.on_compile = lambda _kernel: progress("compiling kernels (once per version)")


def _load(args, progress: Callable):
    with progress("reading the scene"):
        from collide.scenes import load

        options = ("robot", "srdf", "meshes", "missing_meshes", "package_path", "scale")
        given = {name: getattr(args, name) for name in options if getattr(args, name) is not None}
        return load(*args.scenes, state=args.state, **given)


def _compare(args) -> int:
    progress = _progress(args.quiet)
    scene = _load(args, progress)
    _watch_compiler(progress)
    from collide.adapters.peers.compare import compare

    engines = [name.strip() for name in args.engines.split(",") if name.strip()]
    with progress("asking the engines"):
        comparison = compare(scene, engines=engines, max_distance=args.clearance)
    if args.json:
        _write_json(comparison.to_dict(), args.json)
    if args.json != "-" and not args.quiet:
        from collide.reports import comparing, terminal

        width, whole_names = terminal.output_width(sys.stdout)
        lines = comparing.render(comparison, everything=args.all, width=width, whole_names=whole_names)
        terminal.write(lines)
    return YES if comparison.ours_wrong else FREE


def _stress(args) -> int:
    from collide.adapters.peers.stress import run
    from collide.reports import terminal
    from collide.reports.tables import Column, Table

    progress = _progress(args.quiet)
    _watch_compiler(progress)
    with progress("asking the hard families"):
        table = run(args.family or None, n=args.cases, seed=args.seed, engine=args.engine)
    if args.json:
        _write_json(table.to_dict(), args.json)
    if args.save:
        table.save(args.save)
    if args.json != "-" and not args.quiet:
        headers, rows = table.table()
        kinds = ["label", *["number"] * (len(headers) - 2), "text"]
        columns = [Column(title, kind, optional=int(k > 5)) for k, (title, kind) in enumerate(zip(headers, kinds))]
        title = f"STRESS  {args.engine}, {args.cases} cases a family, seed {args.seed}; judged in exact arithmetic"
        terminal.show_table(Table(title, columns, rows))
    if not args.quiet:
        _say(f"{count(table.wrong, 'wrong answer')}, {table.failed} failed, {table.undecided} left open by {args.engine}")
    return YES if args.engine == "collide" and (table.wrong or table.failed) else FREE


def _locality(args) -> int:
    from collide.reports import locality, terminal
    from collide.scenes.loaders.triangles import read_meshes

    if args.plot:
        locality.check_plot(args.plot)
    progress = _progress(args.quiet)
    measured = []
    for place in args.meshes:
        with progress(f"reading {place}"):
            meshes = read_meshes(place)
        _watch_compiler(progress)
        for name, mesh in meshes:

            def about(label: str, name=name):
                return progress(f"{name}: {label}")

            found = mesh.locality(repeated=args.repeated, progress=about)
            with progress(f"{name}: building trees"):
                measured.append(locality.Measured(name, place, found, mesh.tree_figures()))
    if args.plot:
        with progress("drawing"):
            locality.plot(measured, args.plot)
    if args.json:
        _write_json(locality.to_dict(measured, args.repeated), args.json)
    if args.json != "-" and not args.quiet:
        for k, table in enumerate(locality.tables(measured)):
            terminal.write_text("\n" if k else "")
            terminal.show_table(table)
    return FREE


def _scenes(args) -> int:
    if args.copy:
        print(_copy_scene(args.copy, args.force))
        return FREE
    from collide.reports import terminal
    from collide.reports.tables import Column, Table
    from collide.scenes import path, shipped

    rows = [[name, _first_words(path(name))] for name in shipped()]
    table = Table(
        "SCENES  collide report NAME", [Column("name", "label"), Column("what it is", "text")], rows,
        notes=["collide scenes --copy NAME makes a copy to change"],
    )
    terminal.show_table(table)
    return FREE


def _copy_scene(words: list[str], force: bool) -> str:
    """Copy a shipped scene's file; gives the path of the copy."""
    import shutil
    from pathlib import Path

    from collide.scenes import path

    if len(words) > 2:
        raise InvalidArgument(f"--copy takes a name and at most one destination, got {' '.join(words)}")
    source = path(words[0])
    target = Path(words[1] if len(words) == 2 else source.name)
    if target.is_dir():
        target = target / source.name
    if target.exists() and not target.is_file():
        raise InvalidArgument(f"{target} is no file: a scene is not copied there")
    if target.exists() and not force:
        raise InvalidArgument(f"{target} exists already: give another destination, or --force to overwrite it")
    shutil.copyfile(source, target)
    return str(target)


def _first_words(file) -> str:
    """What a scene file says it is: its ``about``, else its first comment, else what it counts."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".json":
        import json

        data = json.loads(text)
        robots, bodies = (len(data.get(key, [])) for key in ("robots", "bodies"))
        return data.get("about") or f"{count(robots, 'robot')}, {count(bodies, 'body', 'bodies')}"
    for start in ("about:", "#"):
        for line in text.splitlines():
            if line.startswith(start) and line[len(start):].strip():
                return line[len(start):].strip().strip("\"'")
    return ""


def _doctor(args) -> int:
    from collide.reports import doctor, terminal

    progress = _progress(False)
    with suppress(ImportError):  # what is not installed, the examination will say
        _watch_compiler(progress)
    examination = doctor.examine(progress)
    for table in examination.tables():
        terminal.show_table(table)
        print()
    print(examination.verdict())
    return FREE if examination.sound else YES


def _write_json(data: dict, place: str) -> None:
    import json

    text = json.dumps(data, indent=2, allow_nan=False, ensure_ascii=place == "-") + "\n"
    if place == "-":
        sys.stdout.write(text)
        return
    # "--json a.yaml b.yaml" must not overwrite a scene
    if not place.lower().endswith(".json") and (os.path.isfile(place) or not os.path.exists(place)):
        raise InvalidArgument(f"--json: {place!r} must end in .json, or be - for standard output")
    if _is_scene(place):
        raise InvalidArgument(f"--json: {place!r} is a scene; it is not overwritten by a report")
    with open(place, "w", encoding="utf-8") as file:
        file.write(text)


def _is_scene(place: str) -> bool:
    import json

    if not os.path.isfile(place):
        return False
    try:
        with open(place, encoding="utf-8") as file:
            data = json.load(file)
    except ValueError:
        return False
    return isinstance(data, dict) and ("collide" in data or "robot_model_name" in data)


# --- arguments ----------------------------------------------------------------------------------


class _Parser(argparse.ArgumentParser):
    """argparse with the one-line errors of the rest, and no guessing at shortened options."""

    def __init__(self, *args, **kwargs):
        kwargs.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        super().__init__(*args, allow_abbrev=False, **kwargs)

    def error(self, message: str) -> NoReturn:
        _say(f"error: {message} (see: {self.prog} --help)")
        raise SystemExit(ERROR)


class _Version(argparse.Action):
    def __call__(self, parser, namespace, values, option_string=None):
        import collide

        print(f"collide {collide.__version__}")
        raise SystemExit(FREE)


_TOP = """examples:
  collide scenes                          the scenes that come with collide
  collide report workcell                 a first report, nothing else needed
  collide report panda_workbench --clearance 50mm
  collide report part_a.stl part_b.obj    do two meshes meet?
  collide check scene.yaml && echo free   for scripts
  collide doctor                          is this installation sound?

exit status: 0 done or free, 1 collision found, 2 error (one line on stderr)"""

_REPORT = """examples:
  collide report workcell
  collide report panda_workbench --clearance 50mm
  collide report robot.urdf --srdf robot.srdf --state joints.yaml
  collide report planning_scene.yaml --robot panda.urdf --state goal
  collide report part_a.stl part_b.obj --scale mm --meshes pieces
  collide report scene.yaml --json - | jq '.colliding[] | [.a, .b, .depth]'

A scene is a file (URDF, planning scene, mesh, scene YAML) or the name of a
shipped one; several files make one scene. The exit status is 0 whenever a
report was made: use `collide check` to branch on collisions. The JSON is
described in docs/report-schema.md."""

_CHECK = """examples:
  collide check scene.yaml && echo free
  collide check robot.urdf --state joints.yaml --min-depth 0.1mm
  collide check scene.yaml | cut -f2,3       the names of the pairs

Each line of output is one pair, fields separated by tabs: `collision`,
`shallow` or `touching`, body A, body B, signed distance in metres (negative:
overlapping). The verdict goes to stderr, and there which bodies are surfaces
without an inside or not the shape the scene names.

exit status: 0 free, 1 collision, 2 error. Pairs that touch within rounding are
printed, and do not count as collisions unless --touching-is-collision is given."""

_COMPARE = """examples:
  collide compare workcell
  collide compare scene.yaml --engines fcl,coal --clearance 10cm
  collide compare panda_workbench --json comparison.json

The same scene is asked of every engine; where two answers differ, exact
arithmetic decides.
Engines come with: pip install 'collide-robotics[peers]'

exit status: 0 no answer of collide's is wrong, 1 one is, 2 error"""

_STRESS = """examples:
  collide stress                                 every family, 40 cases each
  collide stress --family needles --family flat --cases 300 --seed 7
  collide stress --engine coal --json coal.json  the same cases asked of a peer
  collide stress --save wrong.json               every refuted answer, as Python

The families are the cases collision libraries get wrong: exact contact, flush
and tilted boxes, gaps of one unit in the last place, needles, plates, tiny
against huge. Each answer is judged by exact rational arithmetic that shares no
code with the engine.

exit status: 0 no answer of collide's is wrong, 1 one is, 2 error"""

_LOCALITY = """examples:
  collide locality bunny.ply
  collide locality teapot.ply dragon.ply.gz --plot stretches.png
  collide locality part.stl --json - | jq '.meshes[].local_stretch'

How fast meshes can be tested for collision is bounded by how local they are
(Erickson, "Local polyhedra and geometric graphs", 2003):
  global stretch   longest edge over shortest
  local stretch    longest edge at a vertex, over the distance to its nearest
                   other vertex; of order k: to its k-th nearest
Each is given for its worst vertex, and as a distribution: one bad vertex does
not slow a mesh down, long edges packed closely together do. --plot draws how
many vertices have which stretch: pip install 'collide-robotics[plots]' first.
The last table is about the trees: the one that queries walk, and the graded
box-tree that the paper's bounds are proven for, its outliers and its bounds.
docs/locality.md explains the numbers and what to do about large ones.

Vertices with equal coordinates are one vertex. Vertices that no facet uses
count as neighbours.

exit status: 0 measured, 2 error"""

_SCENES = """examples:
  collide scenes
  collide scenes --copy workcell             to ./workcell.json, for editing
  collide scenes --copy workcell cell.json && collide report cell.json"""

_DOCTOR = """Shows versions, optional packages and the extras that bring them, where compiled
kernels and prepared inputs are kept, and asks a few pairs with known answers.

exit status: 0 sound, 1 something is broken"""


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="collide", epilog=_TOP,
        description="Which bodies of a robot scene collide, how deep, how near the others are, and how that is known.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and leave")
    parser.set_defaults(command=None)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    _add_report(commands)
    _add_check(commands)
    _add_compare(commands)
    _add_stress(commands)
    _add_locality(commands)
    _add_scenes(commands)
    _add(commands, "doctor", _doctor, "is this installation sound?", _DOCTOR)
    return parser


def _add(commands, name: str, run: Callable, summary: str, epilog: str) -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=summary, description=summary[0].upper() + summary[1:], epilog=epilog)
    parser.set_defaults(run=run)
    return parser


def _add_stress(commands) -> None:
    parser = _add(commands, "stress", _stress, "the hard families, judged exactly", _STRESS)
    parser.add_argument("--family", action="append", metavar="NAME", help="only this one; may be given again")
    parser.add_argument("--cases", type=_positive_count, default=40, metavar="N", help="cases a family (40)")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="other seeds make other cases (0)")
    parser.add_argument("--engine", default="collide", metavar="E", help="collide, fcl, coal or pybullet (collide)")
    parser.add_argument("--save", metavar="FILE", help="write every refuted answer with a snippet that repeats it")
    _output_arguments(parser)


def _add_locality(commands) -> None:
    parser = _add(commands, "locality", _locality, "how local are these meshes?", _LOCALITY)
    parser.add_argument("meshes", nargs="+", metavar="MESH", help="a mesh file: PLY, STL, OBJ, OFF, DAE, GLB, glTF; .gz too")
    parser.add_argument("--plot", metavar="FILE", help="draw the distributions: a .png, .svg or .pdf file")
    parser.add_argument("--repeated", action="store_true",
                        help="count vertices with equal coordinates one by one, as Table 1 of the paper does")
    _output_arguments(parser)


def _positive_count(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of cases (1 or more)")
    return number


def _add_report(commands) -> None:
    parser = _add(commands, "report", _report, "what collides, what is near, and how that is known", _REPORT)
    _scene_arguments(parser)
    parser.add_argument("--clearance", type=_length, default=0.0, metavar="D",
                        help="list pairs nearer than this too: 0.05 (metres), 50mm, 5cm")
    parser.add_argument("--all", action="store_true", help="do not shorten long lists")
    _output_arguments(parser)


def _add_check(commands) -> None:
    parser = _add(commands, "check", _check, "is the scene free of collisions? for scripts", _CHECK)
    _scene_arguments(parser)
    parser.add_argument("--min-depth", type=_length, default=0.0, metavar="D",
                        help="collisions proven less deep than this do not count: 0.001 (metres), 1mm")
    parser.add_argument("--touching-is-collision", action="store_true",
                        help="count pairs that touch within rounding as collisions")
    _output_arguments(parser)


def _add_compare(commands) -> None:
    parser = _add(commands, "compare", _compare, "ask other engines about the same scene", _COMPARE)
    _scene_arguments(parser)
    parser.add_argument("--engines", default="fcl,coal,pybullet", metavar="NAMES",
                        help="engines to ask, separated by commas (default: %(default)s)")
    parser.add_argument("--clearance", type=_length, default=0.1, metavar="D",
                        help="compare distances up to this: 0.05 (metres), 50mm (default: 10cm)")
    parser.add_argument("--all", action="store_true", help="do not shorten long lists")
    _output_arguments(parser)


def _add_scenes(commands) -> None:
    parser = _add(commands, "scenes", _scenes, "the scenes that come with collide", _SCENES)
    parser.add_argument("--copy", nargs="+", metavar=("NAME", "DEST"), help="copy a scene's file, to be changed")
    parser.add_argument("--force", action="store_true", help="let --copy overwrite a file")


def _scene_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("scene")
    group.add_argument("scenes", nargs="+", metavar="SCENE", help="a file, or the name of a shipped scene")
    group.add_argument("--state", metavar="FILE|NAME", help="joint values: a YAML or JSON file, or a state's name")
    group.add_argument("--robot", metavar="URDF", help="the robot of a planning scene")
    group.add_argument("--srdf", metavar="FILE", help="disabled pairs and named states (default: beside the URDF)")
    group.add_argument("--meshes", choices=("mesh", "hull", "pieces"),
                       help="how meshes enter: as they are (default), as convex hulls, or as unions of convex pieces")
    group.add_argument("--missing-meshes", choices=("error", "skip"),
                       help="what to do about mesh files that are missing")
    group.add_argument("--package-path", action="append", metavar="DIR",
                       help="where package:// is looked for; may be given more than once")
    group.add_argument("--scale", type=_scale, metavar="S", help="factor for mesh files, or their unit: 0.001 or mm")


def _output_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", metavar="FILE|-", help="write JSON to a .json file, or - for standard output")
    parser.add_argument("--quiet", action="store_true", help="no table, no progress; errors are still told")


def _length(text: str) -> float:
    try:
        return parse_length(text)
    except InvalidArgument as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _scale(text: str) -> float:
    """A factor, or the unit that mesh files are written in."""
    if text in UNITS:
        return UNITS[text]
    try:
        return float(text)
    except ValueError:
        units = ", ".join(unit for unit in UNITS if unit.isascii() and unit)
        raise argparse.ArgumentTypeError(f"must be a number or one of the units {units}, got {text!r}") from None
