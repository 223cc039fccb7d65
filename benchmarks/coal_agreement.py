"""The same calls answered by coal and by its stand-in: which differ, who is right, and what a call costs.

python benchmarks/coal_agreement.py [--calls 10000] [--seed 22]

Pairs are those of `host_agreement.py`, a quarter of them on a grid, where bodies touch; every eighth has a half-space
or a plane for its second body. Each is asked for contacts with coal's default request and with Pinocchio's, which wants
none, and for its signed distance. coal answers in a child process. Where booleans differ, or signed distances by more
than a micrometre, `tests/oracles/curved_oracle.py` judges both: it proves a bracket of the signed distance in decimals
of 80 digits and shares no code with the engine.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from host_agreement import CORNERS, FACETS, asked_of_both, calls

from collide.adapters.hosts import coal_api

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "oracles"))
from curved_oracle import bracket

#: Distances that differ by no more are not told apart [m].
TOLERANCE = 1e-6
#: Sets of infinite extent that take the place of the second body of every eighth pair.
FLAT = ("Halfspace", "Plane")


class Reply(NamedTuple):
    """hit : of the default request.   hit_without_contact : of Pinocchio's.   distance : signed [m]."""

    hit: bool
    hit_without_contact: bool
    distance: float


def geometry(coal, kind: str, s: np.ndarray):
    """A geometry of a kind and three lengths."""
    if kind in FLAT:
        return getattr(coal, kind)(s / np.linalg.norm(s), 0.1)
    if kind == "Box":
        return coal.Box(*s)
    if kind == "Sphere":
        return coal.Sphere(s[0] / 2)
    if kind in ("Capsule", "Cylinder", "Cone"):
        return getattr(coal, kind)(s[0] / 2, s[1])
    if kind == "Ellipsoid":
        return coal.Ellipsoid(*(s / 2))
    if kind == "Convex":
        points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        for point in CORNERS * s:
            points.append(point)
        for facet in FACETS:
            triangles.append(coal.Triangle(*facet))
        return coal.Convex(points, triangles)
    model = coal.BVHModelOBBRSS()
    model.beginModel(12, 8)
    model.addVertices(CORNERS * s)
    model.addTriangles(np.array(FACETS))
    model.endModel()
    return model


def pairs(n: int, seed: int):
    """(kind, lengths, rotation, translation) of both bodies."""
    for k, pair in enumerate(calls(n, seed)):
        if k % 8 == 1:
            pair[1] = (FLAT[k // 8 % 2], *pair[1][1:])
        yield pair


def answers(coal, n: int, seed: int) -> list:
    """[replies, medians of the microseconds of a second call of collide and of distance: of pairs without a mesh and
    with one].
    """
    replies, spent, meshed = [], [], []
    for pair in pairs(n, seed):
        a, b = (geometry(coal, kind, s) for kind, s, _, _ in pair)
        X_a, X_b = (coal.Transform3s(R, t) for _, _, R, t in pair)
        request, no_contact = coal.CollisionRequest(), coal.CollisionRequest()
        no_contact.enable_contact = False
        asked = coal.ComputeCollision(a, b)
        measured = coal.ComputeDistance(a, b)
        result = coal.DistanceResult()
        measured(X_a, X_b, coal.DistanceRequest(), result)
        hit_without = asked(X_a, X_b, no_contact, coal.CollisionResult()) > 0
        collision = coal.CollisionResult()
        times = [time.perf_counter()]
        hit = asked(X_a, X_b, request, collision) > 0
        times.append(time.perf_counter())
        distance = measured(X_a, X_b, coal.DistanceRequest(), result)
        times.append(time.perf_counter())
        spent.append(1e6 * np.diff(times))
        meshed.append("BVHModel" in (pair[0][0], pair[1][0]))
        replies.append(Reply(hit, hit_without, float(distance)))
    is_meshed, microseconds = np.array(meshed), np.array(spent)
    return [replies, [np.median(microseconds[which], axis=0).tolist() for which in (~is_meshed, is_meshed)]]


def truth_of(pair):
    """The oracle's bracket of the signed distance; a plane is as far as its farther half-space."""
    (kind_a, s_a, R_a, t_a), (kind_b, s_b, R_b, t_b) = pair
    a, b = geometry(coal_api, kind_a, s_a), geometry(coal_api, kind_b, s_b)
    X_a, X_b = (coal_api.Transform3s(R, t)._X for R, t in ((R_a, t_a), (R_b, t_b)))
    sides = [bracket(a._shape, B, X_a, X_b) for B in b._shapes]
    return max(side.lower for side in sides), max(side.upper for side in sides)


def judge_boolean(truth, hit: bool) -> bool | None:
    """Whether ``hit`` is right; None where the bodies touch as nearly as can be said."""
    lower, upper = truth
    if lower > 0 or upper < 0 or lower == upper:
        return hit == (upper <= 0)
    return None


def is_near(truth, distance: float) -> bool:
    """Whether a signed distance is within the bracket, or a micrometre of it."""
    return float(truth[0]) - TOLERANCE <= distance <= float(truth[1]) + TOLERANCE


def compare(pair, ours: Reply, theirs: Reply, counts: Counter) -> None:
    """Judge what differs between two replies."""
    are_meshes = pair[0][0] == pair[1][0] == "BVHModel"
    differs = {name: getattr(ours, name) != getattr(theirs, name) for name in ("hit", "hit_without_contact")}
    differs["distance"] = abs(ours.distance - theirs.distance) > TOLERANCE and not (are_meshes and ours.hit)
    if not any(differs.values()):
        return
    truth = truth_of(pair)
    for name in ("hit", "hit_without_contact"):
        if differs[name]:
            verdict = judge_boolean(truth, getattr(ours, name))
            counts[name, {True: "coal wrong", False: "OURS WRONG", None: "touching"}[verdict]] += 1
            if verdict is not None:
                print(f"# {name}: {pair!r}, signed distance {float(truth[0])!r} … {float(truth[1])!r}")
    if differs["distance"]:
        sign = "gap" if truth[0] > 0 else "depth"
        rights = is_near(truth, ours.distance), is_near(truth, theirs.distance)
        if sign == "depth" and "BVHModel" in (pair[0][0], pair[1][0]):
            sign = "depth, mesh"
        verdict = {
            (True, False): "coal wrong", (False, True): "OURS WRONG", (True, True): "both right",
            (False, False): "both wrong",
        }[rights]  # fmt: skip
        counts[sign, verdict] += 1
        if verdict in ("OURS WRONG", "both wrong"):
            print(f"# {pair!r}\n#   ours {ours}, coal {theirs}, truth {float(truth[0])!r} … {float(truth[1])!r}")


def main() -> None:
    arguments, answered = asked_of_both(__file__, __doc__, answers, "coal", coal_api)
    if answered is None:
        return
    (ours, our_times), (theirs, their_times) = answered
    counts: Counter = Counter()
    for pair, mine, reply in zip(pairs(arguments.calls, arguments.seed), ours, theirs):
        compare(pair, mine, Reply(*reply), counts)
    print(f"{arguments.calls} calls, {sum(reply.hit for reply in ours)} hits; what differs:")
    for (what, verdict), count in sorted(counts.items()):
        print(f"  {what:20} {verdict:20} {count}")
    for j, pairs_of in enumerate(("without a mesh", "with a mesh")):
        for k, name in enumerate(("collide", "distance")):
            print(f"median of {name}, pairs {pairs_of}: {our_times[j][k]:.2f} µs, coal {their_times[j][k]:.2f} µs")


if __name__ == "__main__":
    main()
