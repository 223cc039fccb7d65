"""Times of impact: `collide.time_of_impact` beside FCL's continuous collision and Bullet's cast, with their misses.

    python benchmarks/impacts.py [--quick]      # minutes; needs python-fcl, and panda3d for Bullet, for their columns

Random motions that start apart: two boxes, two hulls of 48 vertices, thin rods, a box and a mesh, and needles that fly
through thin plates. Engines take turns; times are medians of the turns, a motion, ratios are of medians. Ours is one
call of a batch (and "single": a call a motion); peers are loops over requests made beforehand, each in a process of
its own (`impact_peers.py`).

All are judged by dense sampling and subdivision (`tests/oracles/motion_oracle.py`), in the very same motions. "missed":
said to be free where there is a contact deeper than a hundredth of a millionth of the bodies' size. "late": such a
contact is more than a thousandth of the time before that said. "made up": said to hit where the bodies stay a
thousandth of their size apart.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path[:0] = [str(Path(__file__).parent), str(TESTS / "oracles"), str(TESTS / "families")]
import impact_peers
import motion_oracle as oracle
import motions

import collide

RESULTS = Path(__file__).parent / "results"
SEED = 21
#: In unit time, and in sizes of the bodies.
_LATE, _DEEP, _APART = 1e-3, 1e-8, 1e-3
#: Bullet turns no body by more than π/4 in a cast: where it is asked, turns are less [rad, three standard deviations].
_SMALL_TURN = 0.45


def started_apart(group: motions.Group, n: int) -> motions.Group:
    """The first n motions that are apart at the start."""
    A, B = group.motions()
    apart = np.flatnonzero(group.gap(*A.at(np.zeros(len(A.p0))), *B.at(np.zeros(len(A.p0)))) > 0.0)[:n]
    assert len(apart) == n
    return group._replace(**{name: getattr(group, name)[apart] for name in ("X_WA0", "X_WA1", "X_WB0", "X_WB1")})


def resting(group: motions.Group) -> motions.Group:
    """What was A rests and becomes B."""

    def gap(R_WA, p_WA, R_WB, p_WB):
        return group.gap(R_WB, p_WB, R_WA, p_WA)

    return group._replace(
        A=group.B, B=group.A, X_WA0=group.X_WB0, X_WA1=group.X_WB1, X_WB0=group.X_WA0, X_WB1=group.X_WA0, gap=gap
    )  # fmt: skip


def box_group(n: int, angle: float | None = None) -> motions.Group:
    rng = np.random.default_rng(SEED)
    return motions.random_group("boxes", rng, n, motions.boxes(rng), turn=angle)


def hull_group(n: int, angle: float | None = None) -> motions.Group:
    rng = np.random.default_rng(SEED + 1)
    points = 0.4 * rng.normal(size=(2, 48, 3))
    A, B = (collide.ConvexHull(p) for p in points)
    gap = oracle.polytope_gap(*oracle.hull_features(points[0]), *oracle.hull_features(points[1]))
    return motions.random_group("hulls", rng, n, (A, B, gap, 3.0), turn=angle)


def rod_group(n: int) -> motions.Group:
    rng = np.random.default_rng(SEED + 3)
    return motions.random_group("rods", rng, n, motions.rods(rng), spread=1.0, turn=_SMALL_TURN)


def needle_group(n: int) -> motions.Group:
    rng = np.random.default_rng(SEED + 2)
    needle, plate, gap, size = motions.needle_and_plate(rng)

    def turned(R_WA, p_WA, R_WB, p_WB):
        return gap(R_WB, p_WB, R_WA, p_WA)

    return motions.random_group("needles", rng, n, (plate, needle, turned, size), spread=0.3, turn=0.0, fast=1e4)


def mesh_group(n: int) -> motions.Group:
    rng = np.random.default_rng(SEED + 4)
    return motions.random_group("meshes", rng, n, motions.l_mesh_and_box(rng), spread=2.0, turn=_SMALL_TURN)


class Scene(NamedTuple):
    """make(n) : random motions.   rests : whether one body rests.   share : of n, where the judge is slow."""

    make: Callable[[int], motions.Group]
    rests: bool
    share: float = 1.0


SCENES = {
    "two boxes": Scene(box_group, False),
    "two boxes, one at rest": Scene(partial(box_group, angle=_SMALL_TURN), True),
    "two hulls of 48": Scene(hull_group, False, 0.1),
    "two hulls of 48, one at rest": Scene(partial(hull_group, angle=_SMALL_TURN), True, 0.1),
    "thin rods, one at rest": Scene(rod_group, True),
    "needles through a plate, 10 km": Scene(needle_group, True),
    "a box and an L of 20 facets at rest": Scene(mesh_group, True, 0.3),
}


class Ours:
    """collide, in this process."""

    def __init__(self, group: motions.Group):
        self.group = group

    def ask(self) -> tuple[np.ndarray, float]:
        begin = time.perf_counter()
        r = collide.time_of_impact(self.group.A, self.group.B, *self.group.poses)
        return np.where(r.hit, r.time, -1.0), time.perf_counter() - begin

    def close(self) -> None:
        pass


class OursSingle(Ours):
    """A call a motion."""

    def ask(self) -> tuple[np.ndarray, float]:
        ask, (A, B) = collide.time_of_impact, self.group[1:3]
        ends = list(zip(*self.group.poses))
        begin = time.perf_counter()
        answers = [ask(A, B, *X) for X in ends]
        return np.array([r.time if r.hit else -1.0 for r in answers]), time.perf_counter() - begin


class Verdict(NamedTuple):
    missed: int
    late: int
    made_up: int


def verdict(group: motions.Group, times: np.ndarray, least: np.ndarray) -> Verdict:
    """What the judge says of answers.   least : gap of each motion in all of its time [m]."""
    lower = np.where(times < 0.0, 1.0, np.maximum(times - _LATE, 0.0))
    deep = _DEEP * group.size + motions.resolution(group)
    seen = oracle.judge(group.gap, *group.motions(), lower, lower, tolerance=deep).missed
    seen |= oracle.subdivide(group.gap, *group.motions(), lower, group.speeds(), 1e-4 * group.size, deep).missed
    free = times < 0.0
    made_up = ~free & (least > _APART * group.size)
    return Verdict(int((seen & free).sum()), int((seen & ~free).sum()), int(made_up.sum()))


def measure(name: str, scene: Scene, n: int, turns: int, peers: list[str]) -> list[list]:
    """Rows of the table: a scene's engines."""
    n = max(int(n * scene.share), 50)
    group = scene.make(3 * n)
    group = started_apart(resting(group) if scene.rests else group, n)
    question = impact_peers.Question(group.A, group.B, group.poses)
    engines: dict = {"collide": Ours(group), "collide, single": OursSingle(group)}
    states = dict.fromkeys(engines, "")
    for peer in peers:
        if peer != "bullet" or scene.rests:
            engines[peer], n_zero = impact_peers.sane_process(peer, question)
            states[peer] = f"{n_zero} processes said 0 to all" if n_zero else ""
    answers = {engine: asked.ask() for engine, asked in engines.items()}
    seconds: dict[str, list[float]] = {engine: [] for engine in engines}
    for _ in range(turns):
        for engine, asked in engines.items():
            answer = asked.ask() if answers[engine] is not None else None
            if answer is not None:
                seconds[engine].append(answer[1])
    ones = np.ones(n)
    least = oracle.judge(group.gap, *group.motions(), ones, ones, samples=128).least
    rows = []
    for engine, answer in answers.items():
        engines[engine].close()
        if answer is None or not seconds[engine]:
            rows.append([name, n, engine, "died or took minutes", "", "", "", "", "", ""])
            continue
        spent = statistics.median(seconds[engine]) / n * 1e6
        ratio = spent / (statistics.median(seconds["collide"]) / n * 1e6)
        judged = verdict(group, answer[0], least)
        hits = int((answer[0] >= 0.0).sum())
        rows.append([name, n, engine, states[engine], hits, f"{spent:.2f}", f"{ratio:.2f}", *judged])
    return rows


COLUMNS = ["motions", "n", "engine", "state", "hits", "µs a motion", "times collide's", "missed", "late", "made up"]
_WIDTHS = (36, 6, 15, 27, 6, 9, 9, 6, 6, 6)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer motions, fewer turns, no file")
    parser.add_argument("--only", help="scenes whose names contain this")
    arguments = parser.parse_args()
    n, turns = (300, 2) if arguments.quick else (3000, 7)
    peers = []
    for peer, module in impact_peers.MODULES.items():
        try:
            importlib.import_module(module)
            peers.append(peer)
        except ImportError:
            print(f"{module} is not installed: its rows are left out")
    rows = []
    for name, scene in SCENES.items():
        if arguments.only and arguments.only not in name:
            continue
        for row in measure(name, scene, n, turns, peers):
            rows.append(row)
            print("  ".join(f"{cell!s:>{width}}" for cell, width in zip(row, _WIDTHS)), flush=True)
    if not (arguments.quick or arguments.only):
        with (RESULTS / "impacts.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(rows)


if __name__ == "__main__":
    main()
