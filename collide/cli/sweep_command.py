"""The command ``collide sweep``: its arguments, and its work. Imports the standard library alone before the run."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

from collide.cli.files import write_json
from collide.cli.numbers import count, count_or_none
from collide.errors import InvalidArgument

EPILOG = """examples:
  collide sweep panda_workbench --random 1000000 --out free
  collide sweep cell.yaml --configurations plan.parquet --distances --out plan
  collide sweep robot.urdf cell.yaml --configurations q.npy --out q --workers 16
  collide sweep scene*.yaml --each --robot panda.urdf --out scenes
  collide sweep cell.yaml --random 10000000 --out big --scheduler tcp://hq:8786

Each configuration gets a row: does the robot collide, with itself or with the
scene? With --distances also the least distance and the two bodies. The rows
stand in DIR/chunk-00000000.parquet and so on, in their order:
  python -c "import pandas; print(pandas.read_parquet('free'))"

A sweep that is interrupted, killed, or loses its machine goes on when the same
command is given again: every chunk is written once, and whole. Where the scene,
the robot or the configurations are no longer the same, it refuses (--restart
throws away what is there). With --scheduler the workers of a Dask cluster
answer; files are written here.

Configurations: .npy (rows in the order of the joints), .csv or .parquet with a
column a joint. Rows that are not numbers are left without an answer and named;
rows outside the limits are answered and named.

With --each every SCENE is one of its own, asked about the state it has, or
about all the configurations.

Needs: pip install 'collide-robotics[sweep]'

exit status: 0 done, 2 error, 130 interrupted"""


def add_arguments(parser: argparse.ArgumentParser, add_scene_arguments: Callable) -> None:
    add_scene_arguments(parser)
    group = parser.add_argument_group("sweep")
    group.add_argument("--out", metavar="DIR", required=True, help="the folder of the answers, made if need be")
    group.add_argument("--configurations", metavar="FILE", help="a .npy, .csv or .parquet file")
    group.add_argument("--random", type=count, metavar="N", help="so many configurations, drawn within the limits")
    group.add_argument("--seed", type=int, default=0, metavar="S", help="other seeds draw others (0)")
    group.add_argument("--each", action="store_true", help="every SCENE is one of its own")
    group.add_argument("--name", metavar="NAME", help="which robot, of a scene with several")
    group.add_argument("--distances", action="store_true", help="least distances and their bodies, too")
    group.add_argument("--values", action="store_true", help="write the configurations, too")
    group.add_argument("--workers", type=count_or_none, metavar="N",
                       help="processes of this machine; 0: this one (default: one for each core)")
    group.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster: tcp://host:8786")
    group.add_argument("--chunk", type=count, metavar="N", help="rows of a chunk")
    group.add_argument("--restart", action="store_true", help="throw away what is in DIR, and begin anew")
    parser.add_argument("--json", metavar="FILE|-", help="write the summary as JSON, or - to standard output")
    parser.add_argument("--quiet", action="store_true", help="no summary, no progress; errors are still told")


def run(args: argparse.Namespace, progress: Callable) -> bool:
    """True: done."""
    if args.configurations is not None and args.random is not None:
        raise InvalidArgument("--configurations and --random: give one of them")
    if args.configurations is None and args.random is None and not args.each:
        raise InvalidArgument("which configurations? give --configurations FILE or --random N")
    if args.state is not None and len(args.state) > 1:
        raise InvalidArgument("--state: a sweep takes one state, for what is no joint of the robot asked about")
    if args.each and args.name is not None:
        raise InvalidArgument("--name: with --each every scene has one robot")
    try:
        results = (_each if args.each else _together)(args, progress)
    except KeyboardInterrupt:
        print("collide: what is done is kept: the same command goes on", file=sys.stderr)
        raise
    if args.json:
        write_json(_summary_dict(results).items(), args.json)
    if args.json != "-" and not args.quiet:
        _print(results)
    return True


def _together(args: argparse.Namespace, progress: Callable) -> Any:
    """All files are one scene."""
    from collide.scenes.scene_sweeps import sweep_scene

    asked = _drawn(args) if args.random else args.configurations
    return sweep_scene(args.scenes, asked, args.out, robot=args.name, **_options(args, progress))


def _each(args: argparse.Namespace, progress: Callable) -> Any:
    """Every file is a scene of its own."""
    from collide.scenes import path, shipped
    from collide.scenes.scene_sweeps import sweep_scenes

    files = [str(path(place)) if place in shipped() else place for place in args.scenes]
    asked = _drawn(args) if args.random else args.configurations
    return sweep_scenes(files, args.out, configurations=asked, **_options(args, progress))


def _options(args: argparse.Namespace, progress: Callable) -> dict[str, Any]:
    """What both are told."""
    return {
        "options": _load_options(args), "distances": args.distances, "values": args.values, "chunk": args.chunk,
        "workers": args.workers, "scheduler": args.scheduler, "restart": args.restart, "progress": progress,
    }


def _drawn(args: argparse.Namespace) -> Any:
    from collide.sweeps.configurations import DrawnConfigurations

    return DrawnConfigurations(args.random, args.seed)


def _load_options(args: argparse.Namespace) -> dict[str, Any]:
    names = ("robot", "srdf", "meshes", "missing_meshes", "package_path", "scale")
    options = {name: getattr(args, name) for name in names if getattr(args, name) is not None}
    return {**options, "state": args.state[0]} if args.state else options


def _print(results: Any) -> None:
    from collide.reports import terminal
    from collide.reports.tables import wrapped
    from collide.sweeps.sweep_tables import summary, tables

    width, _ = terminal.output_width(sys.stdout)
    for sentence in summary(results):
        terminal.write_text("\n".join(wrapped(sentence, width)) + "\n")
    for table in tables(results):
        terminal.write_text("\n")
        terminal.show_table(table)


def _summary_dict(results: Any) -> dict[str, Any]:
    from collide.sweeps.sweep_tables import to_dict

    return to_dict(results)
