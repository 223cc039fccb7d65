"""`shape_cast`: exact between polytopes, bracketed between curved shapes, the same single, batched and threaded."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import naive
import numpy as np
import pytest
from cast_oracles import cast_from_below, exact_first_contact
from naive import random_pose, rng_of
from reproduction import reproducing

import collide
from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery

EYE = np.eye(4)
AGAIN = (
    "import collide, numpy as np\n"
    "print(collide.shape_cast(collide.ConvexHull({A}), np.array({X}), {d}, collide.ConvexHull({B}), np.eye(4)))"
)


def lattice_case(rng):
    """Two small solids on a lattice, a right-angled pose and a direction: edges, faces and corners that graze."""
    A, B = (rng.integers(-2, 3, size=(4, 3)) for _ in range(2))
    X = EYE.copy()
    X[:3, :3] = np.eye(3)[rng.permutation(3)]
    X[:3, 0] *= np.linalg.det(X[:3, :3])
    X[:3, 3] = rng.integers(-4, 5, size=3)
    return A, B, X, rng.integers(-2, 3, size=3)


def test_polytopes_exactly():
    """First contact, grazing or not, to the last digit: hits, misses and starts in contact."""
    rng = rng_of("lattice casts")
    outcomes = []
    while len(outcomes) < 150:
        A, B, X, d = lattice_case(rng)
        if not d.any():
            continue
        placed = A @ X[:3, :3].T + X[:3, 3]
        try:
            truth = exact_first_contact(placed.astype(int).tolist(), B.tolist(), tuple(d.tolist()))
        except ValueError:
            continue
        with reproducing(AGAIN, A=A, B=B, X=X, d=tuple(d.tolist())):
            r = collide.shape_cast(collide.ConvexHull(A), X, d, collide.ConvexHull(B), EYE)
            assert r.certified
            assert r.hit == (truth is not None)
            if truth is not None:
                assert Fraction(float(r.lower)) <= truth <= Fraction(float(r.upper))
                assert r.lower <= r.distance <= r.upper <= r.lower + 1e-11
                assert r.at_start == (truth == 0) or r.distance < 1e-11
                limit = float(truth)
                if Fraction(limit) == truth:
                    question = collide.ConvexHull(A), X, d, collide.ConvexHull(B), EYE
                    assert collide.shape_cast(*question, max_distance=limit).hit
                    before = np.nextafter(limit, 0)
                    assert limit == 0 or not collide.shape_cast(*question, max_distance=before).hit
        outcomes.append("miss" if truth is None else "start" if truth == 0 else "hit")
    assert min(outcomes.count(kind) for kind in ("miss", "start", "hit")) > 10, outcomes


def test_grazing_is_told_to_the_last_digit():
    box = collide.Box((1, 1, 1))
    for y, met in ((1.0, True), (np.nextafter(1.0, 2), False), (np.nextafter(1.0, 0), True)):
        r = collide.shape_cast(box, collide.pose((-5, y, 0)), (2, 0, 0), box, EYE)
        assert (r.hit, r.certified) == (met, True)
        assert r.distance == (2.0 if met else math.inf)
    resting = collide.pose((0, 0, 1))
    for d in ((1, 0, 0), (0, 0, 1), (0, 0, -1), (1, 0, 1e-9)):
        r = collide.shape_cast(box, resting, d, box, EYE)
        assert (r.hit, r.distance, r.at_start, r.certified) == (True, 0.0, True, True)
    floor = collide.Halfspace((0, 0, 1), 0.0)
    above = collide.pose((0, 0, np.nextafter(0.5, 1)))
    assert not collide.shape_cast(box, above, (1, 0, 0), floor, EYE).hit
    assert collide.shape_cast(box, above, (1, 0, -1e-8), floor, EYE).hit


@pytest.mark.many(2)
@pytest.mark.parametrize("kind_a", ["Sphere", "Box", "Capsule", "Cylinder", "Cone", "Ellipsoid", "ConvexHull"])
def test_every_pair_of_convex_shapes(kind_a):
    """Brackets hold what planes prove from below, and come as near; what planes prove free is a miss."""
    rng = rng_of(f"casts of {kind_a}")
    shapes = {
        "Sphere": collide.Sphere(0.5), "Box": collide.Box((1.0, 0.7, 0.4)), "Capsule": collide.Capsule(0.2, 0.7),
        "Cylinder": collide.Cylinder(0.4, 0.6), "Cone": collide.Cone(0.4, 0.7),
        "Ellipsoid": collide.Ellipsoid((0.5, 0.3, 0.2)),
        "ConvexHull": collide.ConvexHull(0.4 * rng.normal(size=(10, 3)), radius=0.1),
    }
    hits = []
    A = shapes[kind_a]
    for B in shapes.values():
        for _ in range(6):
            X_WA, X_WB = random_pose(rng, 3.0), random_pose(rng, 0.2)
            d = X_WB[:3, 3] - X_WA[:3, 3] + 0.6 * rng.normal(size=3)
            source = "A, B = {A!r}, {B!r}; collide.shape_cast(A, np.array({X}), {d}, B, np.array({Y}))"
            with reproducing(source, A=A, B=B, X=X_WA, Y=X_WB, d=d):
                r = collide.shape_cast(A, X_WA, d, B, X_WB)
                free = cast_from_below(A, B, X_WA, X_WB, d, rng)
                assert r.hit == np.isfinite(free)
                hits.append(bool(r.hit))
                if not r.hit:
                    assert r.certified and np.isinf(r.distance) and (r.normal == 0).all()
                    continue
                assert r.lower <= r.distance <= r.upper
                assert r.upper >= free * (1 - 1e-13) - 1e-13
                assert abs(r.distance - free) <= 2e-5
                if not r.at_start:
                    assert r.upper - r.lower <= 1e-7 and abs(np.linalg.norm(r.normal) - 1) < 1e-12
                    assert r.normal @ d > 0
                    X_hit = X_WA.copy()
                    X_hit[:3, 3] += r.distance * d
                    assert abs(collide.distance(A, B, X_hit, X_WB).distance) < 1e-7
                    point = collide.pose(r.point)
                    for shape, X in ((A, X_hit), (B, X_WB)):
                        assert abs(collide.distance(collide.Sphere(1e-9), shape, point, X).distance) < 1e-6
    assert 0.4 < np.mean(hits) < 0.98


def test_turned_round():
    """A moved along d meets B where B moved along −d meets A."""
    rng = rng_of("casts turned round")
    for kind_a, kind_b in itertools.product(["Box", "Cylinder", "Capsule", "ConvexHull"], repeat=2):
        A, B = naive.one_of_each(rng)[kind_a], naive.one_of_each(rng)[kind_b]
        X, Y = (np.array([random_pose(rng, 1.5) for _ in range(20)]) for _ in range(2))
        d = Y[:, :3, 3] - X[:, :3, 3] + 0.1
        r, s = collide.shape_cast(A, X, d, B, Y), collide.shape_cast(B, Y, -d, A, X)
        sure = r.certified & s.certified
        assert sure.mean() > 0.9
        assert (r.hit == s.hit)[sure].all()
        both = sure & r.hit & ~r.at_start
        assert (np.maximum(r.lower, s.lower)[both] <= np.minimum(r.upper, s.upper)[both]).all()


def test_compounds_are_their_items():
    rng = rng_of("casts of compounds")
    items = [(shape, random_pose(rng, 0.5)) for shape in (collide.Box((1, 0.2, 0.3)), collide.Sphere(0.3))]
    union, A = collide.Compound(items), collide.Compound([(collide.Cone(0.3, 0.5), random_pose(rng, 0.3))])
    X, Y = (np.array([random_pose(rng, s) for _ in range(40)]) for s in (3.0, 0.2))
    d = Y[:, :3, 3] - X[:, :3, 3]
    whole = collide.shape_cast(A, X, d, union, Y)
    each = [collide.shape_cast(A, X, d, shape, Y @ X_CS) for shape, X_CS in items]
    nearest = np.min([r.distance for r in each], axis=0)
    assert (whole.hit == np.isfinite(nearest)).all() and 0.2 < whole.hit.mean()
    np.testing.assert_allclose(whole.distance[whole.hit], nearest[whole.hit], rtol=0, atol=1e-9)
    assert set(whole.item_b[whole.hit].tolist()) == {0, 1} and (whole.item_a[~whole.hit] == -1).all()


def test_one_by_one_in_batches_and_in_threads():
    rng = rng_of("casts in batches")
    shapes = list(naive.one_of_each(rng).values())
    shapes = [shape for shape in shapes if not isinstance(shape, collide.Halfspace)]
    n = 1300
    A = [shapes[k % len(shapes)] for k in range(n)]
    X, Y = (np.array([random_pose(rng, 1.5) for _ in range(n)]) for _ in range(2))
    d = Y[:, :3, 3] - X[:, :3, 3]
    B = collide.Box((0.5, 0.6, 0.7))
    together = collide.shape_cast(A, X, d, B, Y)
    threaded = collide.shape_cast(A, X, d, B, Y, threads=2)
    for one, other in zip(together, threaded):
        assert one.tobytes() == other.tobytes()
    for k in range(0, n, 97):
        alone = collide.shape_cast(A[k], X[k], d[k], B, Y[k])
        assert [np.asarray(v).tobytes() for v in alone] == [v[k].tobytes() for v in together]


@pytest.mark.parametrize("scale", [1e-40, 1e-9, 1e9, 1e40])
def test_any_size(scale):
    """Lengths multiplied by anything: t is the same."""
    A, B = collide.Box((scale, scale, scale)), collide.Capsule(0.5 * scale, scale)
    r = collide.shape_cast(A, collide.pose((-5 * scale, 0.3 * scale, 0)), (scale, 0, 0), B, EYE)
    assert r.hit and r.certified and abs(r.distance - 4.0) < 1e-9 and r.lower <= 4.0 <= r.upper
    r = collide.shape_cast(A, collide.pose((-5 * scale, 3 * scale, 0)), (scale, 0, 0), B, EYE)
    assert not r.hit and r.certified


def test_far_and_thin():
    """10^4 m in one cast, a needle against a plate of a micrometre: nothing is jumped over."""
    needle = collide.ConvexHull([(0, 0, -0.5), (0, 0, 0.5), (1e-6, 0, 0), (0, 1e-6, 0)])
    plate = collide.Box((1e-6, 1, 1))
    for start in (-1e4, -1.0):
        r = collide.shape_cast(needle, collide.pose((start, 0.1, 0.2)), (1, 0, 0), plate, EYE)
        assert r.hit and r.lower <= -start - 5e-7 <= r.upper + 1e-6
    r = collide.shape_cast(needle, collide.pose((-1e4, 0.1, 0.2)), (1e4, 0, 0), plate, EYE, max_distance=0.99)
    assert not r.hit and r.certified


def test_what_is_refused():
    box, floor = collide.Box((1, 1, 1)), collide.Halfspace((0, 0, 1), 0.0)
    for d, words in (((0, 0, 0), "length 0"), ((0, np.nan, 1), "not finite"), ((0, 1), r"\(3,\)")):
        with pytest.raises(InvalidArgument, match=words):
            collide.shape_cast(box, EYE, d, box, EYE)
    with pytest.raises(InvalidArgument, match="max_distance"):
        collide.shape_cast(box, EYE, (1, 0, 0), box, EYE, max_distance=-1.0)
    with pytest.raises(InvalidArgument, match="B must be a shape"):
        collide.shape_cast(box, EYE, (1, 0, 0), "box", EYE)
    with pytest.raises(InvalidArgument, match="lengths do not match"):
        collide.shape_cast(box, np.tile(EYE, (2, 1, 1)), np.ones((3, 3)), box, EYE)
    with pytest.raises(InvalidArgument, match=r"lengths do not match: .*A 1"):
        collide.shape_cast([box], EYE, np.ones((3, 3)), box, EYE)  # as of distance: a list has a shape for each
    with pytest.raises(InvalidPose):
        collide.shape_cast(box, -EYE, (1, 0, 0), box, EYE)
    for A in (floor, collide.Compound([(box, EYE), (floor, EYE)])):
        with pytest.raises(UnsupportedQuery, match=f"A: {type(A).__name__} has no end"):
            collide.shape_cast(A, EYE, (1, 0, 0), box, EYE)
    assert collide.shape_cast(box, EYE, np.zeros((0, 3)), box, EYE).hit.shape == (0,)
