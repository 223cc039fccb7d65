"""Disabled pairs that `collide srdf` proposes beside those of the SRDF that ship with robots: a table of who is right.

    python benchmarks/srdf_agreement.py [--samples 10000] [FOLDER ...]

Pairs are sampled with meshes as hulls; those that an SRDF would then be wrong about are asked again with the meshes as
they are. FOLDERs hold robots, each with URDF and SRDF of one name in one folder, or in ``urdf/`` or ``robots/`` and
``srdf/``; by default those of ../shared/data and of example-robot-data, where they are.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import collide
from collide.sweeps.link_bodies import link_bodies, link_poses, moving_columns, pair_gaps, pair_hits
from collide.sweeps.pair_comparison import PairDifference, compare_pairs
from collide.sweeps.pair_proposal import propose_disabled_pairs
from collide.sweeps.pair_search import N_STARTS, search_downhill
from collide.sweeps.random_configurations import random_configurations

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data" / "robots"


def installed() -> list[Path]:
    """Folders of robots that are here."""
    packages = (Path(path) for path in sys.path if path.endswith("site-packages"))
    places = [SHARED, *(path / "cmeel.prefix/share/example-robot-data/robots" for path in packages)]
    return [place for place in places if place.is_dir()]


def robots(folders: list[Path]) -> Iterator[tuple[str, Path, Path]]:
    """(name, URDF, SRDF) of every SRDF with a URDF of its name."""
    for folder in folders:
        for srdf in sorted(folder.rglob("*.srdf")):
            owner = srdf.parent.parent if srdf.parent.name == "srdf" else srdf.parent
            places = [place / f"{srdf.stem}.urdf" for place in (srdf.parent, owner / "urdf", owner / "robots")]
            for urdf in [place for place in places if place.is_file()][:1]:
                yield f"{owner.name}/{srdf.stem}", urdf, srdf


def with_meshes(
    urdf: Path, srdf: Path, wrong: list[PairDifference], samples: int
) -> list[tuple[PairDifference, float]]:
    """Those of the pairs that collide with meshes as they are, and the share of the sample in which they do."""
    robot = collide.Robot.load(urdf, srdf=srdf, missing_meshes="skip")
    bodies = link_bodies(robot)
    place = {body.link: k for k, body in enumerate(bodies)}
    columns = moving_columns(robot, bodies)
    Q = random_configurations(robot, 0, samples)
    poses = link_poses(robot, Q)
    confirmed = []
    for pair in wrong:
        i, j = sorted((place[pair.a], place[pair.b]))
        share = float(pair_hits(bodies[i], bodies[j], poses).mean())
        if not share and len(columns[i, j]):
            gaps = pair_gaps(bodies[i], bodies[j], poses, slice(1000))
            starts = np.vstack([Q[np.argsort(gaps)[:N_STARTS]], pair.q])
            met = search_downhill(robot, bodies[i], bodies[j], columns[i, j], starts, 24, 0).gap <= 0
        else:
            met = share > 0
        if met:
            confirmed.append((pair, share))
    return confirmed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--samples", type=int, default=10_000)
    args = parser.parse_args()
    print("| robot | pairs | in both | only theirs | wrong | of these by meshes | only here | met by the search | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, urdf, srdf in robots(args.folders or installed()):
        try:
            robot = collide.Robot.load(urdf, srdf=srdf, meshes="hull", missing_meshes="skip")
            begin = time.perf_counter()
            if not robot.semantic_pairs:
                print(f"| {name} | disables nothing | | | | | | | |", flush=True)
                continue
            proposal = propose_disabled_pairs(robot, args.samples)
            seconds = time.perf_counter() - begin
            result = compare_pairs(proposal, robot.semantic_pairs)
            confirmed = with_meshes(urdf, srdf, result.wrong, args.samples)
        except collide.CollideError as error:
            print(f"| {name} | {' '.join(str(error).split())[:80]} | | | | | | | |", flush=True)
            continue
        counts = (proposal.pairs, result.both, result.only_theirs, result.wrong, confirmed, result.only_ours)
        cells = [name, *(str(len(pairs)) for pairs in counts), str(sum(pair.searched for pair in proposal.pairs))]
        print(f"| {' | '.join([*cells, f'{seconds:.1f}'])} |", flush=True)
        for pair, share in sorted(confirmed, key=lambda entry: -entry[1])[:3]:
            text = f"in {100 * share:.2g} % of the sample" if share else "met by the search"
            print(f"    {pair.a} and {pair.b}: {text}, hulls {1e3 * (pair.depth or 0):.1f} mm deep")


if __name__ == "__main__":
    main()
