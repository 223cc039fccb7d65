"""The arguments of every command, and their help.

Imports the standard library alone, so that ``--help`` answers at once. `parse` gives a namespace whose ``command`` is
the name of a command, ``None`` without a command.
"""

from __future__ import annotations

import argparse
import math
import re
from typing import NoReturn

from collide import __version__
from collide.base.units import UNIT_NAMES, UNITS
from collide.cli import bench as cli_bench
from collide.cli import compare as cli_compare
from collide.cli import config_command as cli_config
from collide.cli import engines as cli_engines
from collide.cli import export_command as cli_export
from collide.cli import fuzz as cli_fuzz
from collide.cli import locality_command as cli_locality
from collide.cli import numbers as cli_numbers
from collide.cli import pages as cli_pages
from collide.cli import papers_command as cli_papers
from collide.cli import solid_commands as cli_solids
from collide.cli import spheres_command as cli_spheres
from collide.cli import srdf as cli_srdf
from collide.cli import sweep_command as cli_sweep
from collide.cli import view as cli_view
from collide.errors import CollideError, InvalidArgument
from collide.reports.number_format import parse_length


class UsageError(Exception):
    """What is wrong with the arguments, in one line."""


class _Parser(argparse.ArgumentParser):
    """argparse with the one-line errors of the rest, and no guessing at shortened options."""

    def __init__(self, *args, **kwargs):
        kwargs.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        super().__init__(*args, allow_abbrev=False, **kwargs)

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (see: {self.prog} --help)")


class _Version(argparse.Action):
    def __call__(self, parser, namespace, values, option_string=None):
        print(f"collide {__version__}")
        raise SystemExit(0)


def parse(argv: list[str]) -> argparse.Namespace:
    """The arguments of a command; UsageError where they are wrong, SystemExit after help and version."""
    return parser().parse_args(_with_negative_states(argv))


#: Options whose value may begin with a minus.
_WITH_NUMBERS = ("--state", "--pose", "--box", "--rpy", "--rpy-deg")


def _with_negative_states(argv: list[str]) -> list[str]:
    """``--state -0.5,1`` as ``--state=-0.5,1``: argparse takes a leading minus for an option."""
    joined: list[str] = []
    for word in argv:
        if joined and joined[-1] in _WITH_NUMBERS and re.match(r"-[\d.]", word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


_TOP = """examples:
  collide scenes                          the scenes that come with collide
  collide report workcell                 a first report, nothing else needed
  collide report panda_workbench --clearance 50mm
  collide report part_a.stl part_b.obj    do two meshes meet?
  collide check scene.yaml && echo free   for scripts
  collide view panda_workbench            look at it, in a browser
  collide solid a.stl difference b.stl --out c.3mf
  collide doctor                          is this installation sound?

exit status: 0 done or free, 1 collision found, 2 error (one line on stderr)"""

_REPORT = """examples:
  collide report workcell
  collide report panda_workbench --clearance 50mm
  collide report robot.urdf --srdf robot.srdf --state joints.yaml
  collide report robot.urdf --state 0,-0.8,0,-2.4,0,1.6,0.8,0,0
  collide report planning_scene.yaml --robot panda.urdf --state start,goal
  collide report robot.urdf cell.yaml --trajectory plan.csv --clearance 2cm
  collide report part_a.stl part_b.obj --scale mm --meshes pieces
  collide report robot.urdf --repair              solids of broken meshes
  collide report scene.yaml --json - | jq '.colliding[] | [.a, .b, .depth]'
  collide report panda_workbench --html page.html       to look at, in a browser
  collide report cell.yaml --clearance 2cm --csv pairs.csv

A scene is a file (URDF, MJCF, SDFormat, planning scene, mesh, scene YAML) or
the name of a shipped one; several files make one scene.

The first page holds what needs a person: collisions, then what is nearer than
the clearance. A body that is in many pairs takes one row, contacts within
rounding one line. --all lists everything, --proofs tells how each answer is
known.

A pair is touching where its proven bracket lower <= distance <= upper reaches
to both sides of 0, or lies within 2^-40 (a trillionth) of the coordinates.

A trajectory is looked at in samples. Nothing is certified between them unless
--certify is given, which proves one moving robot free at all times, or names
where its path collides or could not be proven; the report says which.

The exit status is 0 whenever a report was made: use `collide check` to branch
on collisions. The JSON is described in docs/report-schema.md."""

_CHECK = """examples:
  collide check scene.yaml && echo free
  collide check robot.urdf --state joints.yaml --min-depth 0.1mm
  collide check scene.yaml | cut -f2,3       the names of the pairs
  collide check cell.yaml --write-baseline known.json     once, then in CI:
  collide check cell.yaml --baseline known.json --junit collisions.xml
  collide check cell.yaml --trajectory plan.csv --certify --clearance 50mm

Each line of output is one pair, fields separated by tabs: `collision`,
`shallow`, `touching`, `near` (than --clearance) or `unproven` (--certify; the
distance is 0 there), body A, body B, signed distance in metres (negative:
overlapping); of several states a fifth field, the state; of a trajectory the
share of the path, where the collision begins. The verdict goes to stderr, and
there which bodies are surfaces without an inside or not the shape the scene
names.

With a baseline, collisions that it knows are printed as `known` and do not
count; one that got deeper counts as new and is printed as `deeper`; one that
is no more is printed as `gone`. docs/ci.md has a workflow to copy.

exit status: 0 free, 1 collision, 2 error. Pairs that touch within rounding are
printed, and do not count as collisions unless --touching-is-collision is given."""

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

_SCENES = """examples:
  collide scenes
  collide scenes --copy workcell             to ./workcell.json, for editing
  collide scenes --copy workcell cell.json && collide report cell.json"""

_DOCTOR = """examples:
  collide doctor
  collide doctor && collide report workcell       only where all is sound
  COLLIDE_CACHE_DIR=/tmp/c collide doctor         another folder for caches

Shows versions, optional packages and the extras that bring them, where compiled
kernels and prepared inputs are kept, and asks a few pairs with known answers.

exit status: 0 sound, 1 something is broken"""


def parser() -> argparse.ArgumentParser:
    """The parser of everything."""
    made = _Parser(
        prog="collide", epilog=_TOP,
        description="Which bodies of a robot scene collide, how deep, how near the others are, and how that is known.",
    )
    made.add_argument("--version", action=_Version, nargs=0, help="show the version and leave")
    commands = made.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    _add_report(commands)
    _add_check(commands)
    _add_view(commands)
    _add_compare(commands)
    _add_stress(commands)
    fuzz = _add(commands, "fuzz", "search other engines for wrong answers, shrunk to small cases", cli_fuzz.EPILOG)
    cli_fuzz.add_arguments(fuzz, cli_engines.engines)
    bench = _add(commands, "bench", "run time against error, and against size", cli_bench.EPILOG)
    cli_bench.add_arguments(bench, cli_engines.engines)
    locality = _add(commands, "locality", "how local are these meshes?", cli_locality.EPILOG)
    cli_locality.add_arguments(locality)
    _output_arguments(locality)
    papers = _add(commands, "papers", "the structures of three papers, each at work", cli_papers.EPILOG)
    cli_papers.add_arguments(papers)
    _output_arguments(papers)
    _add_scenes(commands)
    cli_srdf.add_arguments(_add(commands, "srdf", "which links of a robot can collide at all?", cli_srdf.EPILOG))
    spheres = _add(commands, "spheres", "spheres around a robot's links, proven, and audits", cli_spheres.EPILOG)
    cli_spheres.add_arguments(spheres)
    sweep = _add(commands, "sweep", "millions of configurations, to files", cli_sweep.EPILOG)
    cli_sweep.add_arguments(sweep, _scene_arguments)
    export = _add(commands, "export", "a robot in its scene, for programs in C", cli_export.EPILOG)
    cli_export.add_arguments(export, _scene_arguments, _length)
    _add_solid_commands(commands)
    config = _add(commands, "config", "how programs in C and C++ find the library", cli_config.EPILOG)
    cli_config.add_arguments(config)
    _add(commands, "doctor", "is this installation sound?", _DOCTOR)
    return made


def _add(commands, name: str, summary: str, epilog: str) -> argparse.ArgumentParser:
    return commands.add_parser(name, help=summary, description=summary[0].upper() + summary[1:], epilog=epilog)


def _add_solid_commands(commands) -> None:
    for name, summary, epilog, add_arguments in (
        ("solid", "union, intersection or difference of solids", cli_solids.SOLID, cli_solids.add_solid_arguments),
        ("cells", "a solid, or free space, as convex cells", cli_solids.CELLS, cli_solids.add_cells_arguments),
        ("obstacle", "where a translating body meets another", cli_solids.OBSTACLE, cli_solids.add_obstacle_arguments),
    ):
        parser = _add(commands, name, summary, epilog)
        add_arguments(parser, _mesh_arguments, _length)
        _output_arguments(parser)
        cli_pages.add_argument(parser)


def _add_stress(commands) -> None:
    parser = _add(commands, "stress", "the hard families, judged exactly", _STRESS)
    parser.add_argument("--family", action="append", metavar="NAME", help="only this one; may be given again")
    parser.add_argument("--cases", type=cli_numbers.count, default=40, metavar="N", help="cases a family (40)")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="other seeds make other cases (0)")
    parser.add_argument("--engine", type=cli_engines.one_engine, default="collide", metavar="E",
                        help="whom to ask, such as coal or coal:nesterov; help lists them (collide)")
    parser.add_argument("--save", metavar="FILE", help="write every refuted answer with a snippet that repeats it")
    _output_arguments(parser)


def _add_report(commands) -> None:
    parser = _add(commands, "report", "what collides, what is near, and how that is known", _REPORT)
    _scene_arguments(parser)
    _motion_arguments(parser)
    _clearance_argument(parser)
    _pair_arguments(parser)
    parser.add_argument("--all", action="store_true", help="every pair, mesh and note, and what --proofs shows")
    parser.add_argument("--proofs", action="store_true",
                        help="how each answer is known, which pairs were never tested, and what took how long")
    parser.add_argument("--geometry", action="store_true",
                        help="add poses, shapes and triangles of every body to the JSON, to draw it from")
    parser.add_argument("--csv", metavar="FILE",
                        help="write every pair that collides, touches or is near as a line of a table")
    _output_arguments(parser)
    cli_pages.add_argument(parser)
    cli_pages.add_glb_argument(parser)


def _add_view(commands) -> None:
    parser = _add(commands, "view", "look at a scene in a browser, while its files are edited", cli_view.EPILOG)
    _scene_arguments(parser)
    _motion_arguments(parser)
    _clearance_argument(parser)
    _pair_arguments(parser)
    cli_view.add_arguments(parser)


def _clearance_argument(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--clearance", type=_length, default=0.0, metavar="D",
                        help="list pairs nearer than this too: 0.05 (metres), 50mm, 5cm")


def _add_check(commands) -> None:
    parser = _add(commands, "check", "is the scene free of collisions? for scripts", _CHECK)
    _scene_arguments(parser)
    _motion_arguments(parser)
    parser.add_argument("--min-depth", type=_length, default=0.0, metavar="D",
                        help="collisions proven less deep than this do not count: 0.001 (metres), 1mm")
    parser.add_argument("--clearance", type=_length, default=0.0, metavar="D",
                        help="robots nearer than this to anything but themselves count as colliding: 0.05 (metres), "
                             "50mm")
    parser.add_argument("--allow-missing-meshes", action="store_true",
                        help="with --missing-meshes skip: free counts although what was skipped is not checked")
    parser.add_argument("--touching-is-collision", action="store_true",
                        help="count pairs that touch within rounding as collisions")
    _pair_arguments(parser)
    group = parser.add_argument_group("continuous integration")
    group.add_argument("--baseline", metavar="FILE",
                       help="known collisions, from --write-baseline or --json: only new ones count")
    group.add_argument("--baseline-tolerance", type=_length, default=1e-4, metavar="D",
                       help="a known collision deeper than it was by more than this counts as new (0.1mm)")
    group.add_argument("--write-baseline", metavar="FILE", help="write the collisions there are as known ones; exit 0")
    group.add_argument("--junit", metavar="FILE", help="write JUnit XML, a test case for every body")
    group.add_argument("--sarif", metavar="FILE", help="write SARIF 2.1.0, a result for every pair, for code hosts")
    group.add_argument("--csv", metavar="FILE",
                       help="write the lines of output as a table: what,a,b,distance,state,where")
    _output_arguments(parser)
    cli_pages.add_argument(parser)
    cli_pages.add_glb_argument(parser)


def _add_compare(commands) -> None:
    parser = _add(commands, "compare", "ask other engines about the same scene", cli_compare.EPILOG)
    _scene_arguments(parser, at_least=0)
    cli_compare.add_arguments(parser, _length, _part, cli_engines.engines)
    _output_arguments(parser)
    cli_pages.add_argument(parser)


def _add_scenes(commands) -> None:
    parser = _add(commands, "scenes", "the scenes that come with collide", _SCENES)
    parser.add_argument("--copy", nargs="+", metavar=("NAME", "DEST"), help="copy a scene's file, to be changed")
    parser.add_argument("--force", action="store_true", help="let --copy overwrite a file")


def _scene_arguments(parser: argparse.ArgumentParser, at_least: int = 1) -> None:
    group = parser.add_argument_group("scene")
    group.add_argument("scenes", nargs="+" if at_least else "*", metavar="SCENE",
                       help="a file, or the name of a shipped scene")
    group.add_argument(
        "--state",
        action="append",
        metavar="VALUES",
        help="joint values: a state's name, a YAML or JSON file, 0,0.5,... in the order of the joints, "
        "or joint=0.5,...; several names or files, separated by commas or given again, are several states",
    )
    group.add_argument("--robot", metavar="FILE", help="the robot of a planning scene: URDF, MJCF or SDFormat")
    group.add_argument("--srdf", metavar="FILE", help="disabled pairs and named states (default: beside the robot)")
    _mesh_arguments(group)


def _mesh_arguments(group) -> None:
    """How mesh files are found and taken.   group : a parser, or a group of one."""
    kind = group.add_mutually_exclusive_group()
    kind.add_argument("--meshes", type=_meshes, metavar="HOW",
                      help="how meshes enter: mesh (as they are, the default), repaired, hull (convex hulls), hull:64 "
                           "(of at most 64 of their vertices), hull+:64 (of at most 64 corners around them) or pieces "
                           "(unions of convex pieces)")
    kind.add_argument("--repair", action="store_const", const="repaired", dest="meshes",
                      help="--meshes repaired: make solids of broken meshes (holes, facets turned over, repeats), and "
                           "say what was done")
    group.add_argument("--missing-meshes", choices=("error", "skip"),
                       help="what to do about mesh files that are missing")
    group.add_argument("--package-path", action="append", metavar="DIR",
                       help="where package:// is looked for; may be given more than once")
    group.add_argument("--scale", type=_scale, metavar="S", help="factor for mesh files, or their unit: 0.001 or mm")


def _motion_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("motion")
    group.add_argument("--trajectory", metavar="FILE",
                       help="follow joint values, waypoint by waypoint: CSV, YAML or JSON, also ROS's JointTrajectory")
    group.add_argument("--certify", action="store_true",
                       help="prove the path free at all times, not only at samples")
    group.add_argument("--resolution", type=_resolution, default=0.02, metavar="STEP",
                       help="no joint moves more between two samples of it: radians, or metres (0.02)")


def _pair_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--ignore", action="append", default=[], metavar="A,B",
                        help="do not test this pair of bodies; may be given again, and the report says so")
    parser.add_argument("--depth", choices=("quick", "least"), default="quick",
                        help="least: search the shortest way out of overlapping bodies, some 0.5 s a pair with meshes "
                             "(quick: a way out)")


def _output_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", metavar="FILE|-", help="write JSON to a .json file, or - for standard output")
    parser.add_argument("--quiet", action="store_true", help="no table, no progress; errors are still told")


def _length(text: str) -> float:
    try:
        return parse_length(text)
    except InvalidArgument as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _meshes(text: str) -> str:
    """What meshes become, checked before any file is read."""
    from collide.scenes.loaders.mesh_file import check_meshes_option

    try:
        check_meshes_option(text)
    except CollideError as error:
        raise argparse.ArgumentTypeError(str(error).removeprefix("meshes ")) from None
    return text


def _scale(text: str) -> float:
    """A factor, or the unit that mesh files are written in."""
    if text in UNITS:
        return UNITS[text]
    number = _number(text, f"must be a number or one of the units {UNIT_NAMES}, got {text!r}")
    if not math.isfinite(number) or number == 0:
        raise argparse.ArgumentTypeError(f"must be a finite number other than 0, got {text!r}")
    return number


def _part(text: str) -> float:
    number = _number(text, f"must be a part of the pair's size such as 1e-6, got {text!r}")
    if not 0 <= number < math.inf:
        raise argparse.ArgumentTypeError(f"must be finite and not negative, got {text!r}")
    return number


def _resolution(text: str) -> float:
    number = _number(text, f"must be a number of radians, or metres, got {text!r}")
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"must be above 0 and finite, got {text!r}")
    return number


def _number(text: str, complaint: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(complaint) from None
