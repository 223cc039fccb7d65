"""The command ``collide srdf``: its arguments, and its work. Imports the standard library alone before the run."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable

from collide.base.whole_file import write_whole
from collide.cli.files import check_place, write_json
from collide.cli.numbers import count, count_or_none
from collide.errors import InvalidArgument

EPILOG = """examples:
  collide srdf robot.urdf --out robot.srdf
  collide srdf robot.urdf --samples 100000 --all
  collide srdf robot.urdf --compare robot.srdf
  collide srdf panda_workbench --json - | jq '.pairs[] | [.a, .b, .reason]'

Proposes which pairs of a robot's links need no test, as MoveIt's setup
assistant does, from configurations drawn evenly within the limits:
  Adjacent  joined by a joint, or through links without collision geometry
  Default   in collision at the default configuration
  Always    in collision in every configuration of the sample
  Never     in collision in none of them
A sample is no proof. Every pair that is Never in the sample is searched
besides: its nearest configurations are followed downhill, and where that ends
in a collision, the pair is tested. The file says how many configurations were
drawn, and what that leaves open.

The file keeps what the robot's SRDF, beside it or given, says besides: groups,
states, end effectors, virtual joints. --pairs-only leaves them out.

--compare judges the disabled pairs of an SRDF: one that it says never collide,
and that do, is wrong, and a configuration is shown. A pair that it leaves out,
and that collides in every configuration of the sample, is named: with the file
the robot is never free.

ROBOT is a URDF, MJCF or SDFormat file, or a scene (a file or a shipped one)
with a robot in it.

exit status: 0 done, 1 the SRDF compared with is wrong about a pair, or leaves
out one that always collides, 2 error"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("robot", metavar="ROBOT", help="a URDF, MJCF or SDFormat file, or a scene with a robot in it")
    parser.add_argument("--name", metavar="NAME", help="which robot, of a scene with several")
    parser.add_argument("--samples", type=count, default=10_000, metavar="N", help="configurations drawn (10000)")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="other seeds draw others (0)")
    parser.add_argument("--rounds", type=count_or_none, default=24, metavar="N",
                        help="of the search for rare collisions; 0: no search (24)")
    parser.add_argument("--always", type=_share, default=1.0, metavar="SHARE",
                        help="share of the sample that makes a pair Always (1; MoveIt: 0.95)")
    parser.add_argument("--out", metavar="F.srdf", help="write the SRDF")
    parser.add_argument("--force", action="store_true", help="let --out overwrite a file")
    parser.add_argument("--srdf", metavar="F.srdf", help="whose groups and states are kept (default: beside the robot)")
    parser.add_argument("--pairs-only", action="store_true", help="write disabled pairs, and nothing that an SRDF has")
    parser.add_argument("--compare", metavar="F.srdf", help="an SRDF to be judged")
    parser.add_argument("--meshes", choices=("mesh", "hull", "pieces"),
                        help="how meshes enter: as they are (default), as convex hulls, or as unions of convex pieces")
    parser.add_argument("--missing-meshes", choices=("error", "skip"), help="what to do about missing mesh files")
    parser.add_argument("--package-path", action="append", metavar="DIR", help="where package:// is looked for")
    parser.add_argument("--all", action="store_true", help="list every pair")
    parser.add_argument("--json", metavar="FILE|-", help="write JSON to a .json file, or - for standard output")
    parser.add_argument("--quiet", action="store_true", help="no table, no progress; errors are still told")


def run(args: argparse.Namespace, progress: Callable) -> bool:
    """Whether the compared SRDF, if given, is right."""
    from pathlib import Path

    from collide.sweeps.pair_comparison import compare_pairs
    from collide.sweeps.pair_proposal import propose_disabled_pairs
    from collide.sweeps.pair_tables import to_dict
    from collide.sweeps.srdf_text import srdf_text

    _check_out(args)
    carried: list[tuple[str, str]] = []
    with progress("reading the robot"):
        robot = robot_of(args.robot, args.name, load_options(args))
        if args.srdf is not None and str(Path(args.srdf)) not in robot.sources:
            raise InvalidArgument(f"--srdf: {args.robot} is a scene, which names the SRDF of each of its robots itself")
        theirs = None if args.compare is None else _disabled_pairs(robot, args.compare)
        if args.out and not args.pairs_only:
            carried = _carried(robot)
    proposal = propose_disabled_pairs(
        robot, args.samples, seed=args.seed, rounds=args.rounds, always_share=args.always, progress=progress
    )
    comparison = None if theirs is None else compare_pairs(proposal, theirs)
    if args.out:
        write_whole(args.out, srdf_text(proposal, [text for _, text in carried]))
    if args.json:
        write_json(to_dict(proposal, comparison, args.compare).items(), args.json)
    if args.json != "-" and not args.quiet:
        _print(proposal, comparison, args, carried)
    return comparison is None or not (comparison.wrong or comparison.left_out)


def _print(proposal, comparison, args: argparse.Namespace, carried: list[tuple[str, str]]) -> None:
    from collide.reports import terminal
    from collide.reports.tables import wrapped
    from collide.sweeps import pair_tables

    width, _ = terminal.output_width(sys.stdout)

    def say(text: str) -> None:
        terminal.write_text("\n".join(wrapped(text, width)) + "\n")

    say(pair_tables.summary(proposal))
    tables = pair_tables.proposal_tables(proposal, args.all)
    if comparison is not None:
        tables += pair_tables.comparison_tables(comparison, os.path.basename(args.compare))
    for table in tables:
        terminal.write_text("\n")
        terminal.show_table(table)
    if comparison is not None:
        say("")
        say(pair_tables.comparison_words(comparison, os.path.basename(args.compare)))
    if carried:
        say("")
        say(_carried_words(proposal.robot, carried))
    for note in proposal.notes if args.all else ():
        say(f"note: {note}")


def _carried(robot) -> list[tuple[str, str]]:
    """(tag, text) of what the SRDF that was read with a robot says besides collisions."""
    from pathlib import Path

    from collide.scenes.loaders.srdf import other_elements

    return [element for file in robot.sources[1:] for element in other_elements(Path(file), robot.prefix)]


def _carried_words(robot, carried: list[tuple[str, str]]) -> str:
    counts: dict[str, int] = {}
    for tag, _ in carried:
        counts[tag] = counts.get(tag, 0) + 1
    listed = ", ".join(f"{n} {tag}" for tag, n in counts.items())
    return f"kept from {os.path.basename(robot.sources[1])}: {listed}"


def _check_out(args: argparse.Namespace) -> None:
    """Before the work, not after it: where the SRDF goes."""
    if args.out is None:
        return
    if not args.out.lower().endswith(".srdf"):
        raise InvalidArgument(f"--out: {args.out!r} must end in .srdf")
    if os.path.exists(args.out) and not args.force:
        raise InvalidArgument(
            f"--out: {args.out} exists: --force overwrites it; groups and states of the robot's own SRDF are kept"
        )
    if args.json not in (None, "-"):
        check_place("--json", args.json, ".json")


def load_options(args: argparse.Namespace) -> dict:
    """What the loaders are told, as far as the arguments say."""
    options = ("meshes", "missing_meshes", "package_path", "srdf")
    return {name: getattr(args, name) for name in options if getattr(args, name, None) is not None}


def robot_of(place: str, name: str | None, options: dict):
    """The robot of a file or a scene; InvalidArgument for a file without robots, or for several robots and no name."""
    from collide.scenes import load

    scene = load(place, **options)
    if name is None and len(scene.robots) == 1:
        return next(iter(scene.robots.values()))
    if name in scene.robots:
        return scene.robots[name]
    what = f"has no robot {name!r}" if name is not None else "has several robots" if scene.robots else "has no robot"
    names = ", ".join(scene.robots)
    known = f": --name takes one of {names}" if names else ": give a file of a robot, or a scene with one"
    raise InvalidArgument(f"{place} {what}{known}")


def _disabled_pairs(robot, place: str) -> list[tuple[str, str, str]]:
    from pathlib import Path

    from collide.scenes.loaders.srdf import read_srdf

    pairs = read_srdf(Path(place), list(robot.links), [joint.name for joint in robot.joints]).pairs
    if not pairs:
        raise InvalidArgument(f"--compare: {place} disables no pair of links of robot {robot.name}")
    return pairs


def _share(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0.5 <= number <= 1:
        raise argparse.ArgumentTypeError(f"must be a share from 0.5 to 1, got {text!r}")
    return number
