"""Distances and booleans of hulls against exact arithmetic, family by family.

Nothing is compared with a tolerance where a proof is promised: lower ≤ truth ≤ upper holds for the
Fractions themselves. Each family also states which share of its cases hits, so that none goes blind.
"""

from __future__ import annotations

from fractions import Fraction

import naive
import numpy as np
import pytest
from naive import Case, pose, random_pose, rng_of

import collide
from collide.narrowphase.bounds import ERROR, PROMISE_CURVED, PROMISE_DEPTH, PROMISE_GAP, PROMISE_STORED
from collide.results import HOW

#: Witness points, and the pose that brings to touch, in units of the size of the pair.
FEW_ULPS = 64 * naive.ULP


def hulls(rng, radii=(0.0, 0.0), n=(None, None)) -> Case:
    A, B = (collide.ConvexHull(naive.hull_points(rng, k), radius=r) for k, r in zip(n, radii))
    return Case(A, B, random_pose(rng), random_pose(rng))


def random_pair(rng):
    return hulls(rng).with_b_moved(rng.normal(size=3) * 0.9)


def swept(rng):
    radii = rng.choice([0.0, 1e-3, 0.1, 0.7], 2)
    return hulls(rng, radii, rng.integers(1, 24, 2)).with_b_moved(rng.normal(size=3) * 1.4)


def near_touching(rng):
    return naive.with_gap(hulls(rng, n=rng.integers(4, 20, 2)), rng.choice([-1, 1]) * 10.0 ** -rng.integers(2, 16))


def swept_near_touching(rng):
    radii = rng.choice([0.05, 0.3], 2)
    case = hulls(rng, radii, rng.integers(1, 12, 2)).with_b_moved(3 * naive.unit(rng.normal(size=3)))
    return naive.with_gap(case, rng.choice([-1, 1]) * 10.0 ** -rng.integers(2, 16))


def flat(rng):
    """Polygons against polygons or hulls: crossing, in one plane, or resting on each other."""
    n = int(rng.integers(3, 12))
    P = naive.hull_points(rng, n) * (1, 1, 0)
    Q = naive.hull_points(rng, n) * (1, 1, rng.integers(0, 2))
    X = random_pose(rng)
    if rng.random() < 0.4:  # the same plane, in the same frame
        return Case(collide.ConvexHull(P), collide.ConvexHull(Q + np.array([rng.uniform(0, 3), 0, 0])), X, X)
    return Case(collide.ConvexHull(P), collide.ConvexHull(Q), X, random_pose(rng, 0.7))


def thin(rng):
    """Points and segments, doubled vertices, points along one line."""
    n = int(rng.integers(1, 4))
    line = np.outer(rng.uniform(-1, 1, 4), rng.normal(size=3))
    P = [naive.hull_points(rng, n), line, np.repeat(naive.hull_points(rng, 6), 2, axis=0)][rng.integers(3)]
    Q = naive.hull_points(rng, 8) if rng.random() < 0.6 else np.outer(rng.uniform(-1, 1, 3), rng.normal(size=3))
    X_WB = random_pose(rng, 0.3)
    if rng.random() < 0.2:
        X_WB[:3, 3] -= X_WB[:3, :3] @ Q[0]  # a vertex at the origin of W
    return Case(collide.ConvexHull(P), collide.ConvexHull(Q), random_pose(rng, 0.3), X_WB)


def lattice_points(rng, normal, feature):
    """Integer points on one side of a lattice plane through 0 that touch it in a feature around 0."""
    rest = []
    while len(rest) < 5:
        x = rng.integers(-6, 7, 3)
        if x @ normal > 0:
            rest.append(x)
    return np.array([*feature, *rest], dtype=float)


def lattice_touch(rng):
    """Touching by construction: two features of integer points meet in the plane between the bodies."""
    while True:
        u, v = rng.integers(-4, 5, (2, 3))
        normal = np.cross(u, v)
        if normal.any():
            break
    features = [(u, v, -u - v), (u, -u), (v, -v), (np.zeros(3),), (v - u, u, -v)]
    below, above = features[rng.integers(5)], features[rng.integers(5)]
    P = -lattice_points(rng, normal, [-x for x in below]) / 16
    Q = lattice_points(rng, normal, above) / 16
    if rng.random() < 0.15:
        Q = np.vstack([Q, Q[:1]])
    R = naive.LATTICE_ROTATIONS[rng.integers(24)]
    poses = []
    shift = rng.integers(-64, 65, 3) / 8
    for points in (P, Q):
        own = rng.integers(-16, 17, 3) / 4
        points -= own
        poses.append(pose(R, R @ own + shift))
    return Case(collide.ConvexHull(P), collide.ConvexHull(Q), *poses)


def lattice_touch_one_ulp(rng):
    case = lattice_touch(rng)
    X = case.X_WB.copy()
    k = int(np.argmax(np.abs(X[:3, 3]) * rng.random(3)))  # not a zero: its neighbour is 5e-324, see below
    X[k, 3] = np.nextafter(X[k, 3], rng.choice([-np.inf, np.inf]))
    return case._replace(X_WB=X)


def boxes_flush(rng):
    """Stacked boxes with two-decimal sizes, nominally flush: rounding of the input decides."""
    low, high = (np.round(rng.uniform(0.1, 1.0, 3), 2) for _ in range(2))
    R = [np.eye(3), naive.rotation(rng), naive.LATTICE_ROTATIONS[rng.integers(24)]][rng.integers(3)]
    at = np.round(rng.uniform(-1, 1, 3), 2)
    lift = np.array([0.01, -0.02, (low[2] + high[2]) / 2])
    return Case(collide.Box(low), collide.Box(high), pose(R, at), pose(R, at + R @ lift))


def nested(rng):
    inner = 10.0 ** rng.uniform(-3, -0.7)
    A, B = collide.ConvexHull(naive.hull_points(rng, 30)), collide.ConvexHull(inner * naive.hull_points(rng, 12))
    return Case(A, B, pose(naive.rotation(rng)), random_pose(rng, 0.5))


def identical(rng):
    shapes = [collide.ConvexHull(naive.hull_points(rng, 14)), collide.Box(rng.uniform(0.2, 1, 3))]
    A, X = shapes[rng.integers(2)], random_pose(rng)
    return Case(A, A, X, X)


def needles(rng):
    squeeze = 10.0 ** -rng.integers(2, 5)  # thinner ones are among the open faults
    axes = [(1, squeeze, squeeze), (1, 1, squeeze)][rng.integers(2)]
    A = collide.ConvexHull(naive.hull_points(rng, 10) * axes)
    case = Case(A, collide.ConvexHull(naive.hull_points(rng, 10)), random_pose(rng), random_pose(rng))
    return naive.with_gap(case, rng.choice([-1, 1]) * squeeze * 10.0 ** rng.uniform(-2, -0.5))


def far_from_the_origin(rng):
    far = rng.normal(size=3) * 10.0 ** rng.integers(3, 8)
    case = hulls(rng, n=(12, 12)).with_b_moved(rng.normal(size=3) * 0.8)
    X_WA = case.X_WA.copy()
    X_WA[:3, 3] += far
    return case._replace(X_WA=X_WA).with_b_moved(far)


def bad_rotations(rng):
    case = hulls(rng, n=(10, 10)).with_b_moved(rng.normal(size=3) * 0.8)
    X_WA, X_WB = (X + np.pad(1e-7 * rng.normal(size=(3, 3)), (0, 1)) for X in case[2:])
    return case._replace(X_WA=X_WA, X_WB=X_WB)


#: family: (generator, cases, least and largest share that hits)
FAMILIES = {
    "random": (random_pair, 60, 0.3, 0.9),
    "swept": (swept, 60, 0.2, 0.9),
    "near touching": (near_touching, 72, 0.3, 0.7),
    "swept near touching": (swept_near_touching, 60, 0.3, 0.7),
    "flat": (flat, 60, 0.2, 0.9),
    "thin": (thin, 60, 0.05, 0.9),
    "lattice touch": (lattice_touch, 90, 1.0, 1.0),
    "lattice touch, one ulp": (lattice_touch_one_ulp, 90, 0.3, 0.9),
    "boxes flush": (boxes_flush, 60, 0.2, 0.9),
    "nested": (nested, 30, 0.7, 1.0),
    "identical": (identical, 18, 1.0, 1.0),
    "needles": (needles, 45, 0.3, 0.7),
    "far from the origin": (far_from_the_origin, 36, 0.3, 0.95),
    "bad rotations": (bad_rotations, 36, 0.3, 0.95),
}


def cases_of(family):
    generator, count, _, _ = FAMILIES[family]
    rng = rng_of(family)
    return [generator(rng) for _ in range(count)]


@pytest.mark.many(6)
@pytest.mark.parametrize("family", FAMILIES)
def test_the_bracket_holds_and_the_sign_is_right(family):
    hits = []
    for case in cases_of(family):
        with naive.reproducible(case):
            truth, hit = naive.exact_distance(case), naive.exact_hit(case)
            r = collide.distance(*case)
            hits.append(hit)
            assert Fraction(r.lower) <= truth <= Fraction(r.upper), f"{r.lower} ≤ {float(truth)} ≤ {r.upper} fails"
            assert r.lower <= r.distance <= r.upper
            if HOW[r.how] == "undecided":
                assert r.lower <= 0.0 < r.upper and r.hit and not r.certified
            else:
                assert r.hit == hit == (r.distance <= 0.0), f"hit is {r.hit}, exactly {hit}"
                assert r.lower > 0.0 or r.upper <= 0.0
            assert collide.collide(*case) == r.hit
            assert_promise(r)
    _, _, least, largest = FAMILIES[family]
    assert least <= naive.share(hits) <= largest, f"{naive.share(hits):.2f} of the cases hit"


def assert_promise(r):
    """What `certified` says, and that it is not withheld where it is due."""
    width = Fraction(r.upper) - Fraction(r.lower)
    promised = Fraction(abs(r.distance)) * Fraction(PROMISE_GAP if r.distance > 0.0 else PROMISE_DEPTH)
    decided = r.lower > 0.0 or r.upper <= 0.0
    assert r.certified == (decided and width <= promised * (1 + Fraction(naive.ULP)))


@pytest.mark.many(2)
@pytest.mark.parametrize("family", FAMILIES)
def test_bodies_of_points_are_decided_and_certified(family):
    """Doubles leave a sign open only within a few ulps of touching; there integers decide."""
    open_ones = [case for case in cases_of(family) if not collide.distance(*case).certified]
    assert not open_ones, f"{len(open_ones)} cases without certificate, the first:\n{naive.snippet(open_ones[0])}"


@pytest.mark.many(2)
@pytest.mark.parametrize("family", FAMILIES)
def test_witness_points_and_normal(family):
    for case in cases_of(family):
        with naive.reproducible(case):
            r = collide.distance(*case)
            # Witness points are rounded in the world: their own coordinates count, not the gap's.
            slack = FEW_ULPS * (naive.size(case) + float(np.abs(case.X_WA[:3, 3]).max()))
            assert abs(float(r.normal @ r.normal) - 1) <= 8 * naive.ULP
            assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() <= slack
            assert naive.distance_to_body(r.point_a, case.A, case.X_WA) <= slack, "point_a is not on A"
            assert naive.distance_to_body(r.point_b, case.B, case.X_WB) <= slack, "point_b is not on B"


def test_witness_points_of_segments_end_to_end():
    """The foot of the origin is an end of the feature that decided, within rounding: not its other end."""
    apart = 0
    for seed in range(100):
        rng = naive.rng_of("end to end", seed)
        ends = rng.normal(size=(2, 3))
        X = naive.random_pose(rng)
        Y = X.copy()
        Y[:3, 3] += (X[:3, :3] * (ends[seed % 2] - ends[1 - seed % 2])).sum(axis=1)
        segment = collide.ConvexHull(ends)
        r = collide.distance(segment, segment, X, Y)
        case = f"ConvexHull({ends.tolist()}), X_WA = {X.tolist()}, X_WB = {Y.tolist()}"
        apart += not r.hit
        assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() < 1e-14 and r.distance < 1e-14, case
    assert apart > 50, apart


@pytest.mark.many(2)
@pytest.mark.parametrize("family", FAMILIES)
def test_moving_by_the_distance_brings_to_touch(family):
    for case in cases_of(family):
        with naive.reproducible(case):
            r = collide.distance(*case)
            moved = case.with_b_moved(-r.distance * r.normal)
            slack = FEW_ULPS * (naive.size(case) + float(np.abs(case.X_WA[:3, 3]).max()))
            assert abs(naive.exact_distance(moved)) <= slack, (
                f"still {float(naive.exact_distance(moved))} from touching"
            )


@pytest.mark.many(2)
@pytest.mark.parametrize("family", FAMILIES)
def test_distance_beyond_a_limit_is_a_proven_lower_bound(family):
    for case in cases_of(family)[::4]:
        with naive.reproducible(case):
            truth = naive.exact_distance(case)
            full = collide.distance(*case)
            for limit in (0.0, abs(float(truth)) / 2, 2 * abs(float(truth))):
                r = collide.distance(*case, max_distance=limit)
                if r.beyond:
                    assert limit <= r.lower and Fraction(r.lower) <= truth and not r.hit
                    assert r.distance == r.lower and r.upper == np.inf
                elif truth > 0:
                    assert Fraction(r.lower) <= truth <= Fraction(r.upper)
                else:
                    assert r.distance == full.distance
                assert r.hit == full.hit


def test_the_promises_are_no_weaker_than_documented():
    assert ERROR <= 2.0**-47 and PROMISE_GAP <= 4 * 2.0**-52 and PROMISE_DEPTH <= 1e-12
    assert PROMISE_STORED <= 2.0**-40 and PROMISE_CURVED <= 2.0**-26


def test_magnitudes_that_span_too_many_bits_stay_open_and_say_so():
    """One unit box 5e-324 off another's face: a thousand bits apart, which the exact stage does not hold."""
    box = collide.Box((1, 1, 1))
    for tiny in (5e-324, -5e-324):
        r = collide.distance(box, box, pose(t=(0, 0, 1)), pose(t=(1, tiny, 1)))
        assert r.hit and HOW[r.how] in ("undecided", "exact arithmetic")
        assert r.certified == (HOW[r.how] == "exact arithmetic")
        assert r.lower <= 0.0 <= r.upper
