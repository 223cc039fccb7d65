"""The command ``collide fuzz``: its arguments, and its work. Imports the standard library alone before the run."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

from collide.cli.files import write_json
from collide.cli.numbers import count, minutes
from collide.errors import InvalidArgument

EPILOG = """examples:
  collide fuzz --engines coal --minutes 10
  collide fuzz --engines fcl,coal,pybullet --minutes 60 --seed 7 --save found
  collide fuzz --engines fcl,coal,pybullet --save found --seed 7 --resume
  collide compare found/coal-false-miss-box-cylinder-shallow.json --engines coal
  collide fuzz --draw found/coal-*.json --picture plate.png

Scenes are invented: pairs of all shapes and meshes at random, nearly touching,
resting on each other, thin, flat, tiny against huge, concentric; Worlds of many
bodies; a robot over its bench. Every engine is asked about every pair, in a
process of its own. Where one differs exact arithmetic decides, or the bracket
that collide proves; a crash, a hang and a distance that is no number are wrong
answers of their own. Each wrong answer is shrunk while the engine still errs in
the same way: fewer bodies, facets and points, plainer poses, shorter numbers.

Of every kind (engine, error, the two shapes, how they stand) the folder gets
  NAME.json  a scene, with the exact answer, its certificate and all versions:
             collide compare NAME.json --engines ENGINE shows it again
  NAME.py    the same in the engine's own calls: 20 lines that need it alone
  NAME.md    the text of an issue for its tracker
and fuzz.json, the state. A search that is interrupted or killed goes on with
--resume, and loses the round it was in. Equal seeds invent equal scenes.
Shrinking takes half of the time at most; kinds that wait for it are counted,
and --resume goes on with them.

Booleans of pairs that touch within rounding count against nobody.
Engines come with: pip install 'collide-robotics[peers]'

exit status: 0 no answer of collide's is wrong, 1 one is, 2 error, 130
interrupted"""


#: Findings listed without --all.
SHORT = 20


def add_arguments(parser: argparse.ArgumentParser, engines: Callable) -> None:
    """engines : reads names of engines."""
    parser.add_argument("--engines", type=engines, default="fcl,coal,pybullet", metavar="NAMES",
                        help="engines to search, separated by commas; all, or help for a list (%(default)s)")
    parser.add_argument("--minutes", type=minutes, default=60.0, metavar="M", help="how long to search (60)")
    parser.add_argument("--rounds", type=count, metavar="N", help="stop after so many rounds in all")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="other seeds invent other scenes (0)")
    parser.add_argument("--save", metavar="DIR", default="fuzz-findings",
                        help="the folder of findings and state, made if need be (%(default)s)")
    parser.add_argument("--resume", action="store_true", help="go on with the search that DIR holds")
    parser.add_argument("--timeout", type=minutes, default=5.0, metavar="T",
                        help="seconds that an engine may take for one pair (5)")
    parser.add_argument("--draw", nargs="+", metavar="FINDING",
                        help="search nothing: draw these scene files of findings as one plate")
    parser.add_argument("--picture", metavar="FILE", default="findings.png",
                        help="where --draw writes: .png, .svg or .pdf (%(default)s)")
    parser.add_argument("--all", action="store_true", help="do not shorten the list of findings")
    parser.add_argument("--json", metavar="FILE|-", help="write counts and findings as JSON, or - to standard output")
    parser.add_argument("--quiet", action="store_true", help="no table, no progress; errors are still told")


def run(args: argparse.Namespace, progress: Callable) -> bool:
    """True: no answer of collide's is wrong."""
    if args.draw:
        return _draw(args)
    from collide.adapters.fuzzing.fuzz_run import fuzz

    if args.seed < 0:
        raise InvalidArgument(f"--seed must be a whole number, 0 or more, got {args.seed}")
    try:
        result = fuzz(
            args.engines, args.save, minutes=args.minutes, rounds=args.rounds, seed=args.seed, resume=args.resume,
            timeout=args.timeout, progress=progress,
        )
    except KeyboardInterrupt:
        print(f"collide: what was found is in {args.save}: --resume goes on", file=sys.stderr)
        raise
    if args.json:
        write_json({**result.to_dict(), "ours": result.ours, "findings": _listed(result)}.items(), args.json)
    if args.json != "-" and not args.quiet:
        _print(result, args)
    return not result.ours


def _draw(args: argparse.Namespace) -> bool:
    from collide.adapters.fuzzing.case_plate import draw_findings

    drawn = draw_findings(args.draw, args.picture)
    if not args.quiet:
        print(f"{drawn} findings drawn: {args.picture}")
    return True


def _listed(result: Any) -> list[dict[str, Any]]:
    return [
        {"file": f"{f.stem}.json", "kind": list(f.kind), "times": f.times, "minimal": f.is_minimal}
        for f in result.findings()
    ]


def _print(result: Any, args: argparse.Namespace) -> None:
    from collide.adapters.fuzzing.disagreements import KINDS
    from collide.reports import terminal
    from collide.reports.tables import Column, Table

    counts = result.counts()
    met = [kind for kind in KINDS if any(counts[name][kind] for name in counts)]
    rows = [[name, *(str(counts[name][kind]) for kind in met), str(sum(counts[name].values()))] for name in counts]
    columns = [Column("engine", "label"), *(Column(kind) for kind in met), Column("all")]
    title = f"FUZZING  wrong answers to {result.pairs} pairs, seed {result.seed}, {result.rounds} rounds"
    terminal.show_table(Table(title, columns, rows))
    sources = (f"{n} {name}" for name, n in sorted(result.invented.items()) if not name.startswith("shape "))
    terminal.write_text(f"pairs invented: {', '.join(sources)}\n")
    findings = result.findings()
    if findings:  # names of files say engine, error, shapes and position, and stay whole on a narrow terminal
        listed = findings[: None if args.all else SHORT]
        title = f"FINDINGS  {len(findings)} kinds of wrong answers, a small case of each, in {result.folder}"
        more = [f"  {len(findings) - len(listed)} more: --all"] if len(listed) < len(findings) else []
        more += [f"  {len(result.waiting)} kinds wait to be shrunk: --resume goes on"] if result.waiting else []
        terminal.write_text("\n".join(["", title, *(f"  {f.stem}.json" for f in listed), *more, ""]))
