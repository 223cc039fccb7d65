"""Disabled pairs that `collide srdf` proposes beside those of the SRDF that ship with robots: a table of who is right.

    python benchmarks/srdf_agreement.py [--samples 10000] [--meshes hull|mesh] [FOLDER ...]

FOLDERs hold robots, each with URDF and SRDF of one name in one folder or in ``urdf/`` and ``srdf/``; by default the
robots of ../shared/data and of example-robot-data, where they are.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import collide
from collide.sweeps.pair_comparison import compare_pairs
from collide.sweeps.pair_proposal import propose_disabled_pairs

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data" / "robots"


def installed() -> list[Path]:
    """Folders of robots that are here."""
    places = [SHARED, *(Path(path) / "cmeel.prefix/share/example-robot-data/robots" for path in sys.path)]
    return [place for place in places if place.is_dir()]


def robots(folders: list[Path]):
    """(name, URDF, SRDF) of every SRDF with a URDF of its name."""
    for folder in folders:
        for srdf in sorted(folder.rglob("*.srdf")):
            for urdf in (srdf.with_suffix(".urdf"), srdf.parent.parent / "urdf" / f"{srdf.stem}.urdf",
                         srdf.parent.parent / "robots" / f"{srdf.stem}.urdf"):  # fmt: skip
                if urdf.is_file():
                    owner = srdf.parent.parent if srdf.parent.name == "srdf" else srdf.parent
                    yield f"{owner.name}/{srdf.stem}", urdf, srdf
                    break


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--meshes", choices=("hull", "mesh"), default="hull")
    args = parser.parse_args()
    print("| robot | pairs | both | only theirs | wrong | only here | searched | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, urdf, srdf in robots(args.folders or installed()):
        try:
            robot = collide.Robot.load(urdf, srdf=srdf, meshes=args.meshes, missing_meshes="skip")
            begin = time.perf_counter()
            proposal = propose_disabled_pairs(robot, args.samples)
        except collide.CollideError as error:
            print(f"| {name} | {' '.join(str(error).split())[:100]} | | | | | | |", flush=True)
            continue
        result = compare_pairs(proposal, robot.semantic_pairs or [])
        searched = sum(pair.searched for pair in proposal.pairs)
        counts = (proposal.pairs, result.both, result.only_theirs, result.wrong, result.only_ours)
        cells = [name, *(str(len(pairs)) for pairs in counts), str(searched), f"{time.perf_counter() - begin:.1f}"]
        print(f"| {' | '.join(cells)} |", flush=True)
        for pair in result.wrong:
            share = f"{100 * pair.share:.3g} %" if pair.share else "searched"
            print(f"    {name}: {pair.a} and {pair.b}, {pair.reason}: {1e3 * (pair.depth or 0):.1f} mm deep, {share}")


if __name__ == "__main__":
    main()
