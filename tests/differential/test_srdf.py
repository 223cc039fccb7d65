"""Disabled pairs that `collide srdf` proposes beside those of SRDF files that ship with robots: the table of its page.

n configurations a robot, meshes as hulls; pairs that an SRDF would then be wrong about are asked again with the
meshes as they are. A pair that only we disable is to be free in another sample; one that we call wrong meets at the
configuration that comes with it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from samples import sizes

import collide
from collide.sweeps.link_bodies import link_bodies, link_poses, moving_columns, pair_gaps, pair_hits
from collide.sweeps.pair_comparison import PairDifference, compare_pairs
from collide.sweeps.pair_proposal import propose_disabled_pairs
from collide.sweeps.pair_search import N_STARTS, search_downhill
from collide.sweeps.random_configurations import random_configurations

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "robots"


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


@sizes(100, 10_000)
def test_what_we_propose_holds_and_what_we_call_wrong_meets(n):
    listed = list(robots(installed()))[: 1 if n <= 100 else None]
    if not listed:
        pytest.skip("no robots with SRDF are here")
    print("\n| robot | pairs | in both | only theirs | wrong | of these by meshes | only here | met by the search |")
    n_judged = 0
    for name, urdf, srdf in listed:
        try:
            robot = collide.Robot.load(urdf, srdf=srdf, meshes="hull", missing_meshes="skip")
            if not robot.semantic_pairs:
                continue
            proposal = propose_disabled_pairs(robot, n)
            result = compare_pairs(proposal, robot.semantic_pairs)
            confirmed = with_meshes(urdf, srdf, result.wrong, n)
        except collide.CollideError as error:
            print(f"| {name} | {' '.join(str(error).split())[:80]} |")
            continue
        counts = (proposal.pairs, result.both, result.only_theirs, result.wrong, confirmed, result.only_ours)
        cells = [name, *(str(len(pairs)) for pairs in counts), str(sum(pair.searched for pair in proposal.pairs))]
        print(f"| {' | '.join(cells)} |")
        bodies = link_bodies(robot)
        place = {body.link: k for k, body in enumerate(bodies)}
        poses = link_poses(robot, random_configurations(robot, 1, n))
        for pair in [p for p in proposal.pairs if p.reason == "Never"]:
            i, j = sorted((place[pair.a], place[pair.b]))
            share = float(pair_hits(bodies[i], bodies[j], poses).mean())
            assert share <= 10.0 / n, f"{name}: {pair.a} and {pair.b} collide in {share:.2%} of another sample"
            n_judged += 1
        for pair in result.wrong:
            i, j = sorted((place[pair.a], place[pair.b]))
            assert pair_hits(bodies[i], bodies[j], link_poses(robot, pair.q[None])).all(), f"{name}: {pair}"
    assert n_judged
