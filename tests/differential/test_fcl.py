"""Calls answered by python-fcl and by its stand-in: what differs is judged by fractions and brackets in 80 digits."""

from __future__ import annotations

from collections import Counter

import pytest

pytest.importorskip("fcl", reason="python-fcl is not installed")
from curved_oracle import bracket
from exact_verdict import verdict
from host_pairs import Fcl, calls, fcl_geometry
from samples import sizes, told

import collide
from collide.adapters.bench.child_contestant import InChild
from collide.adapters.hosts import fcl_api

#: Gaps that differ by more are judged, and right within so much of the bracket: 2⁻²⁶ of the size of curved pairs [m].
DIFFER, RIGHT = 1e-6, 5e-8
SEED = 22


def question_of(pair) -> tuple:
    """(A, B, X_WA, X_WB) of a call, as collide has them."""
    a, b = (fcl_api.CollisionObject(fcl_geometry(fcl_api, k, s), fcl_api.Transform(R, t)) for k, s, R, t in pair)
    return a._geometry._shape, b._geometry._shape, a._X, b._X


def judged_hit(pair, hit: bool) -> str:
    question = question_of(pair)
    r = collide.distance(*question)  # proposes points that both may hold
    truth = verdict(*question, [0.5 * (r.point_a + r.point_b), r.point_a, r.point_b])
    if truth == "open":
        return "open"
    return "python-fcl wrong" if hit == (truth != "apart") else "OURS WRONG"


def judged_gap(pair, gap: float, their_gap: float) -> str:
    truth = bracket(*question_of(pair))
    low, high = float(truth.lower) - RIGHT, float(truth.upper) + RIGHT
    if high - low > 4 * RIGHT:
        return "open"
    right = [name for name, value in (("ours", gap), ("python-fcl", their_gap)) if low <= value <= high]
    return {("ours",): "python-fcl wrong", ("ours", "python-fcl"): "both right"}.get(tuple(right), "OURS WRONG")


@sizes(200, 10_000)
def test_what_differs_is_judged_in_our_favour(n):
    ours, child, counts = Fcl("collide.adapters.hosts.fcl_api").answers(n, SEED), InChild(Fcl, "fcl"), Counter()
    theirs = child.call("answers", n, SEED)
    child.close()
    assert theirs is not None, child.failures
    for k, (pair, (hit, gap), (their_hit, their_gap)) in enumerate(zip(calls(n, SEED), ours, theirs)):
        what = "boolean" if hit != their_hit else "gap" if not hit and abs(gap - their_gap) > DIFFER else ""
        if what:
            who = judged_hit(pair, hit) if what == "boolean" else judged_gap(pair, gap, their_gap)
            counts[what, who] += 1
            assert who != "OURS WRONG", f"{what} of [*calls({n}, {SEED})][{k}]: {gap}, python-fcl {their_gap}"
    told(f"{n} calls of python-fcl, {sum(hit for hit, _ in ours)} hits; what differs:", counts)
    assert 0.3 * n < sum(hit for hit, _ in ours) < 0.8 * n and counts
