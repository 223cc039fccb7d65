"""Times of impact: `collide.time_of_impact` beside FCL's continuous collision and Bullet's cast, with their misses.

    python benchmarks/impacts.py [--quick]      # minutes; needs python-fcl, and panda3d for Bullet, for their columns

Random motions that start apart: two boxes, two hulls of 48 vertices, thin rods, a box and a mesh, and needles that fly
through thin plates. µs of the processor a motion. Ours is one call of a batch (and "single": a call a motion); peers
are loops over requests made beforehand, each in a process of its own (`impact_peers.py`).

All are judged by dense sampling and subdivision (`tests/oracles/motion_oracle.py`), in the very same motions. "missed":
said to be free where there is a contact deeper than a hundredth of a millionth of the bodies' size. "late": such a
contact is more than a thousandth of the time before that said. "made up": said to hit where the bodies stay a
thousandth of their size apart.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from inputs import use_tests

use_tests("oracles", "families")
import impact_peers
import motion_oracle as oracle
import motions

import collide
from collide.adapters.bench.child_contestant import InChild
from collide.adapters.bench.claims import Claim, Options, Race, installed, main
from collide.adapters.bench.turns import Seconds

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
    )


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


def verdict(group: motions.Group, times: np.ndarray, least: np.ndarray) -> dict:
    """What the judge says of answers.   least : gap of each motion in all of its time [m]."""
    lower = np.where(times < 0.0, 1.0, np.maximum(times - _LATE, 0.0))
    deep = _DEEP * group.size + motions.resolution(group)
    seen = oracle.judge(group.gap, *group.motions(), lower, lower, tolerance=deep).missed
    seen |= oracle.subdivide(group.gap, *group.motions(), lower, group.speeds(), 1e-4 * group.size, deep).missed
    free = times < 0.0
    made_up = ~free & (least > _APART * group.size)
    return {"missed": int((seen & free).sum()), "late": int((seen & ~free).sum()), "made_up": int(made_up.sum())}


def measure(options: Options, scene: str, n: int) -> Race:
    of = SCENES[scene]
    group = of.make(3 * n)
    group = started_apart(resting(group) if of.rests else group, n)
    A, B = group.A, group.B

    def ours() -> np.ndarray:
        r = collide.time_of_impact(A, B, *group.poses)
        return np.where(r.hit, r.time, -1.0)

    ends = list(zip(*group.poses))
    tasks: dict = {"collide": ours, "collide, single": lambda: [collide.time_of_impact(A, B, *X) for X in ends]}
    answers, beside, children = {"collide": ours()}, {}, []
    for peer in installed(fcl="fcl", bullet="panda3d"):
        if peer == "bullet" and not of.rests:
            continue
        child, first, n_zero = sane_process(peer, impact_peers.Question(A, B, group.poses))
        children.append(child)
        state = "died or took minutes" if first is None else f"{n_zero} processes said 0 to all" if n_zero else ""
        beside[peer] = {"state": state}
        if first is not None:
            answers[peer] = first[0]
            tasks[peer] = lambda child=child: Seconds((child.call("ask") or (0, np.nan))[1])
    least = oracle.judge(group.gap, *group.motions(), np.ones(n), np.ones(n), samples=128).least
    for name, times in answers.items():
        hits = {"hits": int((times >= 0.0).sum())}
        beside[name] = beside.get(name, {}) | hits | verdict(group, times, least)
    return Race(tasks, n, beside=beside, close=lambda: [child.close() for child in children])


def sane_process(peer: str, question: impact_peers.Question) -> tuple:
    """(child, its answer, how many before it said 0 to everything): the last one after 12."""
    for k in range(12):
        child = InChild(impact_peers.PEERS[peer], question)
        answer = child.call("ask")
        if answer is None or answer[0].any() or k == 11:
            break
        child.close()
    return child, answer, k


def cases(options: Options):
    n = 300 if options.quick else 3000
    return [{"scene": name, "n": max(int(n * scene.share), 50)} for name, scene in SCENES.items()]


CLAIMS = [Claim("impacts", "µs a motion", cases, measure, turns=7, seconds=120.0, everywhere=True)]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
