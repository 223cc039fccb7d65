"""Calls answered by coal and by its stand-in: what differs is judged by brackets in decimals of 80 digits."""

from __future__ import annotations

from collections import Counter

import pytest

pytest.importorskip("coal", reason="coal is not installed")
from curved_oracle import bracket
from host_pairs import Coal, calls, coal_geometry
from samples import sizes, told

from collide.adapters.bench.child_contestant import InChild
from collide.adapters.hosts import coal_api

#: Distances that differ by no more are not told apart [m].
TOLERANCE = 1e-6
SEED = 2206


def truth_of(pair) -> tuple:
    """The oracle's bracket of the signed distance; a plane is as far as its farther half-space."""
    (kind_a, s_a, R_a, t_a), (kind_b, s_b, R_b, t_b) = pair
    a, b = coal_geometry(coal_api, kind_a, s_a), coal_geometry(coal_api, kind_b, s_b)
    X_a, X_b = (coal_api.Transform3s(R, t)._X for R, t in ((R_a, t_a), (R_b, t_b)))
    sides = [bracket(a._shape, B, X_a, X_b) for B in b._shapes]
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
        meshes = pair[0][0] == pair[1][0] == "BVHModel" and mine[0]
        differs = abs(mine[2] - reply[2]) > TOLERANCE and not meshes
        if differs or mine[:2] != reply[:2]:
            truth = truth_of(pair)
            who = {}
            for name, a, b in zip(("hit", "hit without contact"), mine, reply):
                if a != b:
                    who[name] = judged_hit(truth, a)
            if differs:
                has_mesh = "BVHModel" in (pair[0][0], pair[1][0])
                sign = "gap" if truth[0] > 0 else "depth of a mesh" if has_mesh else "depth"
                who[sign] = judged_distance(truth, mine[2], reply[2])
            counts.update(who.items())
            assert "OURS WRONG" not in who.values(), f"[*calls({n}, {SEED}, flat=True)][{k}]: {who}, {mine}, {reply}"
    told(f"{n} calls of coal, {sum(hit for hit, *_ in ours)} hits; what differs:", counts)
    assert 0.3 * n < sum(hit for hit, *_ in ours) < 0.7 * n and sum(counts.values()) < 0.2 * n and counts
