"""Calls answered by coal and by its stand-in: what differs is judged by brackets in decimals of 80 digits."""

from __future__ import annotations

from collections import Counter

import pytest

pytest.importorskip("coal", reason="coal is not installed")
from curved_oracle import bracket
from host_pairs import CORNERS, FACETS, FLAT, Coal, calls, coal_geometry
from samples import sizes, told

from collide import ConvexHull
from collide.adapters.bench.child_contestant import InChild
from collide.adapters.hosts import coal_api

#: Distances that differ by no more are not told apart [m].
TOLERANCE = 1e-6
SEED = 2206


def truth_of(pair, facets=(-1, -1)) -> tuple:
    """The oracle's bracket of the signed distance; a plane is as far as its farther half-space.

    facets : of either body one to be asked instead of all of it, −1 for all.
    """
    bodies, poses = [], []
    for (kind, s, R, t), facet in zip(pair, facets):
        whole = coal_geometry(coal_api, kind, s)._shapes
        bodies.append(whole if facet < 0 else [ConvexHull(s * CORNERS[FACETS[facet]])])
        poses.append(coal_api.Transform3s(R, t)._X)
    (A,), sides_of_b = bodies
    sides = [bracket(A, B, *poses) for B in sides_of_b]
    return max(side.lower for side in sides), max(side.upper for side in sides)


def judged_hit(truth: tuple, hit: bool) -> str:
    lower, upper = truth
    if not (lower > 0 or upper < 0 or lower == upper):
        return "touching"
    return "coal wrong" if hit == (upper <= 0) else "OURS WRONG"


def judged_distance(truth: tuple, ours: float, theirs: float) -> str:
    right = [float(truth[0]) - TOLERANCE <= d <= float(truth[1]) + TOLERANCE for d in (ours, theirs)]
    return {(True, False): "coal wrong", (True, True): "both right"}.get(tuple(right), "OURS WRONG")


@sizes(200, 10_000)
def test_what_differs_is_judged_in_our_favour(n):
    ours, child, counts = Coal("collide.adapters.hosts.coal_api").answers(n, SEED), InChild(Coal, "coal"), Counter()
    theirs = child.call("answers", n, SEED)
    child.close()
    assert theirs is not None, child.failures
    for k, (pair, mine, reply) in enumerate(zip(calls(n, SEED, flat=True), ours, theirs)):
        # depths of two meshes that meet are no part of what coal answers
        n_meshes = [kind for kind, *_ in pair].count("BVHModel")
        differs = abs(mine[2] - reply[2]) > TOLERANCE and not (n_meshes == 2 and mine[0])
        if n_meshes == 1 and mine[0] and pair[1][0] not in FLAT:  # of one facet, which may be another one in coal
            truth = truth_of(pair, mine[3])
            assert judged_distance(truth, mine[2], mine[2]) == "both right", f"call {k}: {truth}, {mine}"
            counts["depth of a facet", "another one" if differs else "the same"] += 1
            differs = False
        if differs or mine[:2] != reply[:2]:
            truth = truth_of(pair)
            who = {}
            for name, a, b in zip(("hit", "hit without contact"), mine, reply):
                if a != b:
                    who[name] = judged_hit(truth, a)
            if differs:
                sign = "gap" if truth[0] > 0 else "depth of a mesh" if n_meshes else "depth"
                who[sign] = judged_distance(truth, mine[2], reply[2])
            counts.update(who.items())
            assert "OURS WRONG" not in who.values(), f"[*calls({n}, {SEED}, flat=True)][{k}]: {who}, {mine}, {reply}"
    told(f"{n} calls of coal, {sum(hit for hit, *_ in ours)} hits; what differs:", counts)
    assert 0.3 * n < sum(hit for hit, *_ in ours) < 0.7 * n and sum(counts.values()) < 0.2 * n and counts
