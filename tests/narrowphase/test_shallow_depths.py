"""Shallow overlaps of ellipsoids and cylinders: found without EPA, judged by decimals of 80 digits, and by formulas."""

from __future__ import annotations

import math
from collections import Counter

import curved_oracle
import naive
import numpy as np
import pytest
from naive import Case, random_pose, rng_of

import collide
from collide.lowering.parts import convex_set_of
from collide.narrowphase.bounds import ERROR, PROMISE_CURVED, TOLERANCE_CURVED

EYE = np.eye(4)
#: Expansions of EPA are counted from this bit on.
EXPANSION = 65536
PAIRS = (
    "ellipsoid ellipsoid", "ellipsoid cylinder", "ellipsoid box", "ellipsoid capsule", "ellipsoid sphere",
    "cylinder cylinder", "cylinder box",
)
#: What the least depth along a face, a side or a ball proves, of overlaps in any position; the others take EPA.
SHARE = {"cylinder cylinder": 0.3, "cylinder box": 0.4}


def shape(kind: str, rng):
    a, b, c = rng.uniform(0.5, 1.0, 3)
    if kind == "ellipsoid":
        return collide.Ellipsoid((a, b, c))
    if kind == "cylinder":
        return collide.Cylinder(a, 2.0 * b)
    if kind == "box":
        return collide.Box((a, b, c))
    # Their cores have to overlap: they are thin.
    return collide.Capsule(1e-4, a) if kind == "capsule" else collide.Sphere(1e-4)


def overlapping(kinds: str, rng, depth: float) -> Case:
    """Two bodies that overlap by about so much, B pushed into A along the normal of their gap."""
    A, B = (shape(kind, rng) for kind in kinds.split())
    X_WA, X_WB = random_pose(rng, 1.0), random_pose(rng, 1.0)
    if rng.random() < 0.4:  # axes that are parallel, or nearly
        X_WB[:3, :3] = X_WA[:3, :3] @ collide.pose(rpy=rng.normal(size=3) * 10.0 ** rng.uniform(-12, -3))[:3, :3]
        if rng.random() < 0.5:
            X_WB[:3, :3] = X_WB[:3, :3] @ collide.pose(rpy=(math.pi / 2, 0, 0))[:3, :3]
    X_WB[:3, 3] = X_WA[:3, 3] + rng.normal(size=3) * 0.3
    X_WB[:3, 3] += 5.0 * naive.unit(rng.normal(size=3)) if rng.random() < 0.7 else 5.0 * X_WA[:3, rng.integers(3)]
    gap = collide.distance(A, B, X_WA, X_WB)
    X_WB[:3, 3] -= (gap.distance + depth) * gap.normal
    return Case(A, B, X_WA, X_WB) if rng.random() < 0.5 else Case(B, A, X_WB, X_WA)


def size_of(case: Case) -> float:
    packed = [convex_set_of(body) for body in (case.A, case.B)]
    return sum(p.reach + p.radius for p in packed) + float(np.linalg.norm(case.X_WB[:3, 3] - case.X_WA[:3, 3]))


def judge(case: Case, r, *, matrices: bool = False) -> None:
    """The bracket holds the truth; points lie on their bodies, to half of its width."""
    size = size_of(case)
    truth = curved_oracle.bracket(*case, guesses=[tuple(r.normal.tolist())])
    assert float(truth.upper - truth.lower) <= 2.0**-26 * size, "the oracle is too wide to judge"
    assert r.lower <= float(truth.upper) and float(truth.lower) <= r.upper
    assert r.hit and r.upper - r.lower <= PROMISE_CURVED * size * (4 if matrices else 1)
    assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() <= 64 * ERROR * size
    for body, X, p in ((case.A, case.X_WA, r.point_a), (case.B, case.X_WB, r.point_b)):
        assert curved_oracle.away_from(body, X, p) <= 0.5 * (r.upper - r.lower) + 64 * ERROR * size


@pytest.mark.many(6)
@pytest.mark.parametrize("kinds", PAIRS)
def test_the_bracket_holds(kinds):
    rng, seen = rng_of("shallow depths", kinds), Counter()
    while seen["asked"] < 20:
        case = overlapping(kinds, rng, 10.0 ** rng.uniform(-7, -1.5))
        with naive.reproducible(case):
            r = collide.distance(*case)
            if not r.hit or r.how == "swept overlap":
                continue
            seen["asked"] += 1
            judge(case, r)
            if r.iterations < EXPANSION:
                seen["without EPA"] += 1
                assert r.upper - r.lower <= (TOLERANCE_CURVED + 4 * ERROR) * size_of(case)
            swapped = collide.distance(case.B, case.A, case.X_WB, case.X_WA)
            assert (swapped.distance, swapped.lower, swapped.upper) == (r.distance, r.lower, r.upper)
            assert (swapped.normal == -r.normal).all() and (swapped.point_a == r.point_b).all()
            for _ in range(2):  # whatever was asked before
                assert collide.distance(*case).rows.tobytes() == r.rows.tobytes()
    assert seen["without EPA"] >= SHARE.get(kinds, 0.9) * seen["asked"], seen


@pytest.mark.many(2)
@pytest.mark.parametrize("kinds", ["ellipsoid ellipsoid", "ellipsoid box", "cylinder cylinder", "cylinder box"])
def test_matrices_that_are_no_rotations(kinds):
    """The ball of a stretched ellipsoid is another one, and so is the depth of a point in a sheared cylinder."""
    rng, seen = rng_of("shallow depths of matrices", kinds), Counter()
    while seen["asked"] < 8:
        case = overlapping(kinds, rng, 10.0 ** rng.uniform(-5, -2))
        for X in (case.X_WA, case.X_WB):
            if rng.random() < 0.7:
                X[:3, :3] = X[:3, :3] @ (np.eye(3) + rng.normal(size=(3, 3)) * rng.choice([1e-13, 1e-7, 1e-2, 0.1]))
        with naive.reproducible(case):
            r = collide.distance(*case, check_poses=False)
            if not r.hit:
                continue
            seen["asked"] += 1
            seen["without EPA"] += r.iterations < EXPANSION
            judge(case, r, matrices=True)
    assert seen["without EPA"] >= 1, "no matrix was ever taken"


def test_flat_and_thin_ellipsoids():
    """Where no ball is large enough for the overlap EPA answers; the bracket holds either way."""
    rng, seen = rng_of("flat ellipsoids"), Counter()
    while seen["asked"] < 16:
        A = collide.Ellipsoid(10.0 ** rng.uniform(-2, 0, 3))
        B = collide.Ellipsoid(10.0 ** rng.uniform(-2, 0, 3))
        X_WA, X_WB = random_pose(rng, 0.1), random_pose(rng, 0.5)
        r = collide.distance(A, B, X_WA, X_WB)
        X_WB[:3, 3] -= (r.distance + 10.0 ** rng.uniform(-7, -3)) * r.normal
        case = Case(A, B, X_WA, X_WB)
        with naive.reproducible(case):
            r = collide.distance(*case)
            if r.hit:
                seen["asked"] += 1
                seen["EPA" if r.iterations >= EXPANSION else "ball"] += 1
                judge(case, r)
    assert seen["EPA"] >= 2 and seen["ball"] >= 2, seen


@pytest.mark.parametrize("depth", [2.0**-6, 2.0**-20, 2.0**-32])
def test_depths_known_by_their_positions(depth):
    """Level faces, parallel and crossed sides, corners: the depth is a difference of doubles."""
    can, brick, egg = collide.Cylinder(0.5, 2.0), collide.Box(2, 2, 1), collide.Ellipsoid(0.5, 0.75, 1.0)
    lying, crossed = (math.pi / 2, 0, 0), (0, math.pi / 2, 0)
    cases = {
        "standing on a box": (brick, can, (0.125, 0.25, 1.5 - depth), None, (0, 0, 1)),
        "over its edge": (brick, can, (1.25, 0.0, 1.5 - depth), None, (0, 0, 1)),
        "lying on a box": (brick, can, (0.125, 0.0, 1.0 - depth), lying, (0, 0, 1)),
        "on a smaller box": (collide.Box(0.25, 0.25, 1), can, (0, 0, 1.5 - depth), None, (0, 0, 1)),
        "end on end": (can, can, (0.25, 0.125, 2.0 - depth), None, (0, 0, 1)),
        "side by side": (can, can, (1.0 - depth, 0.0, 0.5), None, (1, 0, 0)),
        "crossed": (collide.Cylinder(0.5, 1.0), can, (1.0 - depth, 0, 0.25), lying, (1, 0, 0)),
        "crossed at its middle": (can, can, (0.0, 1.0 - depth, 0.25), crossed, (0, 1, 0)),
        "ellipsoid on a box": (brick, egg, (0.25, 0.5, 1.5 - depth), None, (0, 0, 1)),
        "ellipsoid on an end": (can, egg, (0.25, 0.125, 2.0 - depth), None, (0, 0, 1)),
        "ellipsoid beside a cylinder": (can, egg, (1.0 - depth, 0, 0.5), None, (1, 0, 0)),
        "two ellipsoids": (egg, egg, (0, 0, 2.0 - depth), None, (0, 0, 1)),
    }
    for name, (A, B, t, rpy, n) in cases.items():
        X = collide.pose(t, rpy=rpy or (0, 0, 0))
        r = collide.distance(A, B, EYE, X)
        size = size_of(Case(A, B, EYE, X))
        assert r.iterations < EXPANSION, name
        assert r.lower <= -depth <= r.upper and abs(r.distance + depth) <= 2 * TOLERANCE_CURVED * size, name
        assert np.abs(r.normal - n).max() <= 1e-5, name
