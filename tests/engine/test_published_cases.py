"""Pairs that other engines answer wrongly, collected from their tests and issues or found by search."""

from __future__ import annotations

import json
from fractions import Fraction

import naive
import numpy as np
import pytest
from naive import Case

import collide
from collide.narrowphase.bounds import PROMISE_DEPTH
from collide.results import HOW

CASES = naive.SHARED / "data" / "cases"
#: References found by sampling directions are good to this much.
SAMPLED = 1e-8


def read(name: str) -> list[dict]:
    path = CASES / name
    if not path.exists():
        pytest.skip(f"shared/data/cases/{name} is not beside this checkout")
    return json.loads(path.read_text())


MAKERS = {
    "box": lambda d: collide.Box(d["size"]),
    "sphere": lambda d: collide.ConvexHull([(0, 0, 0)], radius=d["radius"]),  # some have radius 0
    "capsule": lambda d: collide.Capsule(d["radius"], d["length"]),
    "cylinder": lambda d: collide.Cylinder(d["radius"], d["length"]),
    "ellipsoid": lambda d: collide.Ellipsoid(d["radii"]),
    "convex": lambda d: collide.ConvexHull(d["vertices"]),
}


def published(record: dict) -> Case:
    A, B = (MAKERS[record[side]["type"]](record[side]) for side in "ab")
    return Case(A, B, np.array(record["Ta"]), np.array(record["Tb"]))


def is_polytope(shape: collide.Shape) -> bool:
    return not isinstance(shape, (collide.Cylinder, collide.Cone, collide.Ellipsoid))


def test_published_cases_agree_with_their_references():
    records = read("published_cases.json")
    assert len(records) == 134
    hits = []
    for record in records:
        case = published(record)
        with naive.reproducible(case):
            r = collide.distance(*case)
            hits.append(r.hit)
            slack = (SAMPLED if record["ref_how"] == "sampled" else 1e-12) * max(1.0, abs(record["ref"]))
            assert abs(r.distance - record["ref"]) <= slack + (r.upper - r.lower), (record["id"], r, record["ref"])
            assert r.lower <= record["ref"] + slack and r.upper >= record["ref"] - slack, record["id"]
            assert np.isfinite(np.concatenate([r.normal, r.point_a, r.point_b])).all()
            assert r.hit == collide.collide(*case)
    assert 0.3 < naive.share(hits) < 0.9


def test_published_polytopes_are_exactly_right():
    """Judged by exact arithmetic, not by the references: some of those are sampled."""
    judged = 0
    for record in read("published_cases.json"):
        case = published(record)
        if not (is_polytope(case.A) and is_polytope(case.B)):
            continue
        with naive.reproducible(case):
            truth = naive.exact_distance(case)
            r = collide.distance(*case)
            assert Fraction(r.lower) <= truth <= Fraction(r.upper), record["id"]
            assert r.hit == naive.exact_hit(case) and HOW[r.how] != "undecided", record["id"]
            judged += 1
    assert judged >= 110


def test_published_normals_separate():
    """A step along the normal by the distance brings to touch, whatever normal the source has."""
    for record in read("published_cases.json"):
        case = published(record)
        with naive.reproducible(case):
            r = collide.distance(*case)
            again = collide.distance(*case.with_b_moved(-r.distance * r.normal))
            scale = float(np.abs(case.X_WA[:3, 3]).max() + np.abs(case.X_WB[:3, 3]).max()) + 10.0
            assert abs(again.distance) <= 2 * (r.upper - r.lower) + (again.upper - again.lower) + 1e-14 * scale


def test_pairs_on_which_peers_fail_are_right():
    records = read("peer_failures.json")
    assert len(records) == 43
    for record in records:
        A, B = collide.ConvexHull(record["P"]), collide.ConvexHull(record["Q"])
        case = Case(A, B, naive.pose(record["R1"], record["t1"]), naive.pose(record["R2"], record["t2"]))
        truth = Fraction(record["exact"]) * (-1 if record["hit"] else 1)
        with naive.reproducible(case):
            r = collide.distance(*case)
            digits = abs(truth) / 10**38
            assert r.hit == record["hit"] == collide.collide(*case), f"{record['fam']} {record['id']}"
            assert Fraction(r.lower) <= truth + digits and truth - digits <= Fraction(r.upper)
            assert HOW[r.how] != "undecided"
            if r.certified:
                assert abs(r.distance - float(truth)) <= PROMISE_DEPTH * abs(float(truth))


def test_hulls_that_a_peer_calls_free():
    records = read("coal_false_negatives.json")
    assert len(records) == 4
    for record in records:
        A, B = collide.ConvexHull(record["A"]), collide.ConvexHull(record["B"])
        case = Case(A, B, np.array(record.get("TA", np.eye(4))), np.array(record.get("TB", np.eye(4))))
        with naive.reproducible(case):
            r = collide.distance(*case)
            assert r.hit and r.certified and collide.collide(*case)
            assert r.distance == pytest.approx(record["truth"], rel=1e-12)
            assert Fraction(r.lower) <= naive.exact_distance(case) <= Fraction(r.upper)
