"""The same calls answered by python-fcl and by its stand-in: which differ, judged; and what a call costs.

python benchmarks/host_agreement.py [--calls 10000] [--seed 22]

python-fcl is asked in a child process, which it may end. Where booleans differ, `tests/oracles/exact_verdict.py` says
who is right: a bracket of the signed distance in 80 digits that leaves out 0, or a common point in fractions. Where
gaps differ by more than a micrometre, that bracket. Neither shares code with collide.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numpy as np

import collide
from collide.adapters.hosts import fcl_api

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "oracles"))

from curved_oracle import bracket
from exact_verdict import verdict

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
FACETS = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
    [1, 5, 7], [1, 7, 3],
]  # fmt: skip
KINDS = ("Box", "Sphere", "Capsule", "Cylinder", "Ellipsoid", "Convex", "Cone", "BVHModel")


def geometry(fcl, kind: str, s: np.ndarray):
    """A geometry of a kind and three lengths."""
    if kind == "Box":
        return fcl.Box(*s)
    if kind == "Sphere":
        return fcl.Sphere(s[0] / 2)
    if kind in ("Capsule", "Cylinder", "Cone"):
        return getattr(fcl, kind)(s[0] / 2, s[1])
    if kind == "Ellipsoid":
        return fcl.Ellipsoid(*(s / 2))
    if kind == "Convex":
        return fcl.Convex(CORNERS * s, 12, np.concatenate([[3, *facet] for facet in FACETS]))
    model = fcl.BVHModel()
    model.beginModel(12, 8)
    model.addSubModel(CORNERS * s, np.array(FACETS))
    model.endModel()
    return model


def calls(n: int, seed: int, kinds: tuple[str, ...] = KINDS):
    """(kind, lengths, rotation, translation) of both bodies, a quarter of them on a grid, where bodies touch."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        pair = []
        for _ in range(2):
            kind = kinds[rng.integers(len(kinds))]
            R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            s, t = rng.uniform(0.2, 1.0, 3), rng.uniform(-0.6, 0.6, 3)
            if k % 4 == 0:
                R, s, t = np.eye(3), np.round(4 * s + 0.5) / 4, np.round(4 * t) / 4
            pair.append((kind, s, R * np.sign(np.linalg.det(R)), t))
        yield pair


def answers(fcl, n: int, seed: int) -> list:
    """(hit, gap of pairs apart else None), call by call, and microseconds a call of collide."""
    replies, spent = [], 0.0
    for pair in calls(n, seed):
        a, b = (fcl.CollisionObject(geometry(fcl, kind, s), fcl.Transform(R, t)) for kind, s, R, t in pair)
        fcl.collide(a, b)
        begin = time.perf_counter()
        hit = fcl.collide(a, b) > 0
        spent += time.perf_counter() - begin
        replies.append([hit, None if hit else float(fcl.distance(a, b))])
    return [replies, 1e6 * spent / max(n, 1)]


def question_of(pair) -> tuple:
    """(A, B, X_WA, X_WB) of a call, as collide has them."""
    a, b = (fcl_api.CollisionObject(geometry(fcl_api, k, s), fcl_api.Transform(R, t)) for k, s, R, t in pair)
    return a._geometry._shape, b._geometry._shape, a._X, b._X


def judged(pair, hit: bool) -> str:
    """Who is right about a pair whose booleans differ; hit : what the stand-in says."""
    question = question_of(pair)
    r = collide.distance(*question)  # proposes points that both may hold
    truth = verdict(*question, [0.5 * (r.point_a + r.point_b), r.point_a, r.point_b])
    if truth == "open":
        return "open"
    how = "they touch in a point" if truth == "touch" else truth
    return f"{how}: python-fcl wrong" if hit == (truth != "apart") else f"{how}: OURS WRONG"


#: Gaps that differ by more are judged [m].
_GAP = 1e-6


def judged_gap(pair, gap: float, their_gap: float) -> str:
    """Whose gap is within 50 nm of the bracket: collide promises 2⁻²⁶ of the size of curved pairs."""
    truth = bracket(*question_of(pair))
    low, high = float(truth.lower) - 5e-8, float(truth.upper) + 5e-8
    if high - low > 2e-7:
        return "open"
    right = [name for name, value in (("ours", gap), ("python-fcl", their_gap)) if low <= value <= high]
    return f"{' and '.join(right) or 'nobody'} right"


def asked_of_both(file: str, description: str | None, answers: Callable, host: str, drop_in) -> tuple:
    """(arguments of the command line, (answers of the drop-in, those of the host)); None for these in the child, which
    prints the host's: hosts may abort.

    file : the script, run once more as the child.   answers : (module, calls, seed) to what JSON can hold.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--calls", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=22)
    parser.add_argument("--host", action="store_true", help=f"answer with {host}, as JSON (the child)")
    arguments = parser.parse_args()
    if arguments.host:
        print("ANSWERS", json.dumps(answers(import_module(host), arguments.calls, arguments.seed)))
        return arguments, None
    command = [sys.executable, file, "--host", "--calls", str(arguments.calls), "--seed", str(arguments.seed)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    theirs = json.loads(done.stdout.split("ANSWERS")[1])
    return arguments, (answers(drop_in, arguments.calls, arguments.seed), theirs)


def main() -> None:
    arguments, answered = asked_of_both(__file__, __doc__, answers, "fcl", fcl_api)
    if answered is None:
        return
    (ours, our_time), (theirs, their_time) = answered
    counts: dict[tuple[str, str], int] = {}
    gaps: dict[str, int] = {}
    worst = 0.0
    for pair, (hit, gap), (their_hit, their_gap) in zip(calls(arguments.calls, arguments.seed), ours, theirs):
        if hit != their_hit:
            key = "–".join(sorted(body[0] for body in pair)), judged(pair, hit)
            counts[key] = counts.get(key, 0) + 1
        elif not hit:
            worst = max(worst, abs(gap - their_gap))
            if abs(gap - their_gap) > _GAP:
                key_of_gap = judged_gap(pair, gap, their_gap)
                gaps[key_of_gap] = gaps.get(key_of_gap, 0) + 1
    print(f"{arguments.calls} calls, {sum(hit for hit, _ in ours)} hits, {sum(counts.values())} booleans differ")
    for (kinds, who), count in sorted(counts.items()):
        print(f"  {kinds:24} {who:40} {count}")
    print(f"gaps that differ by more than {_GAP:g} m:", ", ".join(f"{who} {n}" for who, n in sorted(gaps.items())))
    print(f"greatest difference of gaps: {worst:.2g} m")
    print(f"the second call of collide with two new geometries: {our_time:.2f} µs, python-fcl {their_time:.2f} µs")


if __name__ == "__main__":
    main()
