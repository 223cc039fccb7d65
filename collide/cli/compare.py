"""The command ``collide compare``: its arguments, and its work. Imports the standard library alone before the run."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from typing import Any

from collide.cli import pages as cli_pages
from collide.cli import scenes as cli_scenes
from collide.cli.files import write_json
from collide.errors import InvalidArgument

EPILOG = """examples:
  collide compare workcell
  collide compare scene.yaml --engines fcl,coal --clearance 10cm
  collide compare panda_workbench --json comparison.json
  collide compare scene.yaml --engines fcl --fail-on peer-wrong
  collide compare scene.yaml --engines coal --save findings
  collide compare --from-fcl-error log.txt

The same scene is asked of every engine. Where two booleans differ, exact
arithmetic decides. A distance is wrong where it lies outside the exact one, or
outside the bracket that collide proves, by more than the tolerance: those are
listed with the amount, the worst first.
Engines come with: pip install 'collide-robotics[peers]'

--save writes one small case of every kind of wrong answer: NAME.json, a scene
that this command takes again, with the exact answer, its certificate and all
versions; NAME.py, which needs the other engine alone and prints its answer
beside the true one; NAME.md, the text of an issue for its tracker.

--from-fcl-error reads what FCL prints when it aborts ("Error with
configuration ... Shape 1 ... X_FS1"), from a log, a terminal or an issue, and
proves whether the two shapes meet, and how far apart or how deep they are.

exit status: 0 no answer of collide's is wrong, 1 one is, 2 error; with
--fail-on peer-wrong also 1 where another engine's boolean or distance is."""


def add_arguments(parser: argparse.ArgumentParser, length: Callable, part: Callable, engines: Callable) -> None:
    """Add the arguments of compare alone; the functions read a length, a fraction of 1, and names of engines."""
    parser.add_argument("--engines", type=engines, default="fcl,coal,pybullet", metavar="NAMES",
                        help="engines to ask, separated by commas; all, or help for a list (%(default)s)")
    parser.add_argument("--clearance", type=length, default=0.1, metavar="D",
                        help="compare distances up to this: 0.05 (metres), 50mm (default: 10cm)")
    parser.add_argument("--tolerance", type=part, default=1e-6, metavar="T",
                        help="distances off by more than this part of the pair's size are wrong (1e-6)")
    parser.add_argument("--fail-on", choices=("ours-wrong", "peer-wrong"), default="ours-wrong",
                        help="exit 1 where an answer of collide's is wrong (default), or where any engine's is")
    parser.add_argument("--save", metavar="DIR", help="write a small case of every kind of wrong answer to a folder")
    parser.add_argument("--from-fcl-error", metavar="FILE",
                        help="read what FCL printed when it aborted, and prove the answer; takes no SCENE")
    parser.add_argument("--all", action="store_true", help="do not shorten long lists")


def run(args: argparse.Namespace, progress: Callable) -> bool:
    """True: no answer is wrong that is asked about."""
    if bool(args.scenes) == bool(args.from_fcl_error):
        raise InvalidArgument(
            "--from-fcl-error takes no SCENE" if args.scenes else "name a SCENE, or give --from-fcl-error FILE"
        )
    if args.save and os.path.exists(args.save) and not os.path.isdir(args.save):
        raise InvalidArgument(f"--save: {args.save!r} is no folder")
    return (_answer_fcl if args.from_fcl_error else _compare)(args, progress)


def _compare(args: argparse.Namespace, progress: Callable) -> bool:
    scenes = cli_scenes.load_states(args, progress)
    if len(scenes) > 1:
        raise InvalidArgument("--state: compare takes one state")
    from collide.adapters.peers.compare import compare

    scene = scenes[0][1]
    limits = {"max_distance": args.clearance, "tolerance": args.tolerance}
    with progress("asking the engines"):
        comparison = compare(scene, engines=args.engines, **limits)
    if args.json:
        write_json(comparison.to_dict().items(), args.json)
    if args.html:
        cli_pages.write_comparison(args, scene, comparison, progress)
    if _has_stdout(args):
        from collide.reports import comparing, terminal

        width, whole_names = terminal.output_width(sys.stdout)
        terminal.write(comparing.render(comparison, everything=args.all, width=width, whole_names=whole_names))
    if args.save:
        from collide.adapters.fuzzing.scene_findings import save_findings

        _say_saved(save_findings(scene, args.engines, args.save, progress=progress, **limits), args)
    return not (comparison.ours_wrong or (args.fail_on == "peer-wrong" and comparison.peers_wrong))


def _answer_fcl(args: argparse.Namespace, progress: Callable) -> bool:
    """The proven answers to dumps of FCL's."""
    from collide.adapters.fuzzing.fcl_dump import answered, read_fcl_dumps
    from collide.adapters.fuzzing.proofs import proof

    if args.html:
        raise InvalidArgument("--html draws a comparison: save the pair (--save DIR) and compare its scene file")
    dumps = read_fcl_dumps(args.from_fcl_error)
    with progress("proving"):
        answers = [proof(dump.case) for dump in dumps]
    plain: list[dict[str, Any]] = [
        {"message": dump.message, "scene": dump.case.document(), "exact": known} for dump, known in zip(dumps, answers)
    ]
    if args.json:
        write_json({"dumps": plain}.items(), args.json)
    if _has_stdout(args):
        from collide.reports import terminal

        for k, (dump, known) in enumerate(zip(dumps, answers)):
            heading = f"dump {k + 1} of {len(dumps)}\n" if len(dumps) > 1 else ""
            terminal.write_text(heading + "".join(f"{line}\n" for line in answered(dump, known)))
    if args.save:
        _say_saved([_saved_dump(args.save, k, entry) for k, entry in enumerate(plain)], args)
    return True


def _saved_dump(folder: str, k: int, entry: dict[str, Any]) -> Any:
    from pathlib import Path

    from collide.base.whole_file import write_whole
    from collide.scenes.write_scene import document_text

    Path(folder).mkdir(parents=True, exist_ok=True)
    place = Path(folder) / f"fcl-error-{k + 1}.json"
    about = {"message": entry["message"], "exact": entry["exact"]}
    scene = {"collide": entry["scene"]["collide"], "about": about, "bodies": entry["scene"]["bodies"]}
    write_whole(place, document_text(scene))
    return place


def _say_saved(places: list, args: argparse.Namespace) -> None:
    if not _has_stdout(args):
        return
    from collide.reports import terminal

    if not places:
        terminal.write_text("\nnothing to save: no answer is wrong\n")
        return
    terminal.write_text(f"\n{len(places)} written to {args.save}:\n")
    for place in places:
        terminal.write_text(f"  {place}\n")


def _has_stdout(args: argparse.Namespace) -> bool:
    return "-" not in (args.json, args.html) and not args.quiet
