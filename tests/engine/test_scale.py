"""Nothing absolute: a problem times 2^k has its answer times 2^k, bit by bit."""

from __future__ import annotations

import math
from itertools import combinations_with_replacement

import naive
import numpy as np
import pytest
from naive import Case, pose, random_pose, rng_of

import collide
from collide.lowering.parts import parts_of
from collide.narrowphase.bounds import EXACT_ERROR
from collide.results import HOW

#: What scales, and what stays as it is.
LENGTHS = ("distance", "lower", "upper", "point_a", "point_b")
PURE = ("normal", "vertices_a", "vertices_b", "iterations", "count", "how", "exact", "hit", "certified", "beyond")


def scaled(shape: collide.Shape, s: float) -> collide.Shape:
    """The shape times s, a power of two, so that no number is rounded."""
    if isinstance(shape, collide.Compound):
        return collide.Compound([(scaled(part, s), scaled_pose(X, s)) for part, X in shape.items])
    if isinstance(shape, collide.HPolytope):
        return collide.HPolytope(shape.normals, shape.offsets * s)
    if isinstance(shape, collide.Halfspace):
        return collide.Halfspace(shape.normal, shape.offset * s)
    if isinstance(shape, collide.ConvexHull):
        return collide.ConvexHull(shape.points * s, radius=shape.radius * s)
    return type(shape)(*(getattr(shape, field) * s for field in shape._fields))


def scaled_pose(X: np.ndarray, s: float) -> np.ndarray:
    return pose(X[:3, :3], X[:3, 3] * s)


def scaled_case(case: Case, s: float) -> Case:
    return Case(scaled(case.A, s), scaled(case.B, s), scaled_pose(case.X_WA, s), scaled_pose(case.X_WB, s))


def keeps_order(case: Case, other: Case) -> bool:
    """Whether every pair of parts is worked on in the same order, which goes by a digest of the numbers."""

    def order(case):
        parts_a, parts_b = ([packed.content for packed, _ in parts_of(shape)] for shape in (case.A, case.B))
        return [(a > b) - (a < b) for a in parts_a for b in parts_b]

    return order(case) == order(other)


def assert_scales(case: Case, s: float):
    """Bit by bit; only the brackets of both must meet where the bodies changed roles inside the engine."""
    larger = scaled_case(case, s)
    one, other = collide.distance(*case).rows[0], collide.distance(*larger).rows[0]
    with naive.reproducible(larger):
        assert one["hit"] == other["hit"] and one["certified"] == other["certified"]
        assert other["lower"] <= one["upper"] * s and one["lower"] * s <= other["upper"]
        if keeps_order(case, larger):
            # Integers hand their distance over in doubles, good to 2⁻⁴⁷: not the same at every scale.
            spread = 4 * EXACT_ERROR if HOW[one["how"]] == "exact arithmetic" else 0.0
            for field in ("distance", "lower", "upper") if spread else ():
                assert math.isclose(one[field] * s, other[field], rel_tol=spread), field
            for field in ("point_a", "point_b") if spread else LENGTHS:
                assert np.array_equal(one[field] * s, other[field]), f"{field}: {one[field]} · {s}, got {other[field]}"
            assert not naive.same_bits(one, other, PURE)


@pytest.mark.parametrize(
    ("kind_a", "kind_b"), [pair for pair in combinations_with_replacement(naive.KINDS, 2) if set(pair) != {"Halfspace"}]
)
def test_every_pair_scales_by_powers_of_two(kind_a, kind_b):
    rng = rng_of("scale", kind_a, kind_b)
    for k in (-60, int(rng.integers(-60, 61)), 60):
        A, B = naive.one_of_each(rng)[kind_a], naive.one_of_each(rng)[kind_b]
        poses = random_pose(rng, 0.6), random_pose(rng, 0.6)
        assert_scales(Case(A, B, *poses), 2.0**k)
        if kind_a == kind_b:  # the order of equal shapes goes by their poses, and always scales
            assert keeps_order(Case(A, A, *poses), scaled_case(Case(A, A, *poses), 2.0**k)) or kind_a == "Compound"
            assert_scales(Case(A, A, *poses), 2.0**k)


@pytest.mark.many(2)
@pytest.mark.parametrize("k", range(-60, 61, 5))
def test_touching_and_nearly_touching_scale_too(k):
    """Where the sign hangs on the last bit, any absolute tolerance would show."""
    rng = rng_of("touch", k)
    box = collide.Box((1, 0.5, 0.25))
    cases = [
        Case(box, box, np.eye(4), pose(t=(1, 0.25, 0.125))),
        Case(box, box, np.eye(4), pose(t=(1 + 2**-52, 0.25, 0.125))),
        Case(box, box, np.eye(4), pose(t=(1 - 2**-53, 0, 0))),
        Case(collide.Sphere(2), collide.Sphere(3), np.eye(4), pose(t=(3, 4, 0))),
        Case(box, collide.Capsule(0.1, 0.5), random_pose(rng), random_pose(rng)),
    ]
    hull = collide.ConvexHull(naive.hull_points(rng, 10))
    near = Case(hull, hull, random_pose(rng), random_pose(rng))
    cases += [naive.with_gap(near, gap) for gap in (1e-14, -1e-14, 1e-16)]
    near = near._replace(B=collide.ConvexHull(naive.hull_points(rng, 10)))
    cases += [naive.with_gap(near, gap) for gap in (1e-15, -1e-15)]
    for case in cases:
        assert_scales(case, 2.0**k)


def test_scales_near_the_ends_of_the_documented_range():
    """Up to 1e50 m and down to 1e-50 m; beyond, shapes refuse by name."""
    rng = rng_of("ends")
    for kind in ("Box", "ConvexHull", "Cylinder", "Capsule"):
        A, B = naive.one_of_each(rng)[kind], naive.one_of_each(rng)["Box"]
        for k in (-150, -120, 120, 150):
            for spread in (0.3, 1.5):
                case = Case(A, B, random_pose(rng, spread), random_pose(rng, spread))
                assert_scales(case, 2.0**k)


def test_micrometres_and_kilometres_in_one_world():
    """A screw of 50 µm rests on terrain of 4 km, above and below it by a nanometre."""
    terrain = collide.Box((4000.0, 4000.0, 2.0))
    screw = collide.Cylinder(20e-6, 50e-6)
    cube = collide.Box((50e-6, 50e-6, 50e-6))
    world = collide.World()
    world.add(terrain, pose(t=(0, 0, -1)), name="terrain", static=True)
    world.add(cube, pose(t=(1e-3, 0, 25e-6 + 1e-9)), name="hovering")
    world.add(cube, pose(t=(0, 1e-3, 25e-6 - 1e-9)), name="sunk")
    world.add(screw, pose(t=(0, 0, 25e-6 + 1e-9)), name="screw")
    world.add(collide.Sphere(1e-6), pose(t=(22e-6, 0, 25e-6)), name="grain")
    rows = world.distances(max_distance=1e-5)
    found = {frozenset(pair): row for row, pair in zip(rows, rows.names)}

    def between(a, b):
        return found[frozenset((a, b))]

    assert between("terrain", "hovering")["distance"] == pytest.approx(1e-9, rel=1e-2)
    assert between("terrain", "sunk")["distance"] == pytest.approx(-1e-9, rel=1e-2)
    assert between("terrain", "sunk")["hit"] and not between("terrain", "hovering")["hit"]
    assert between("screw", "grain")["distance"] == pytest.approx(1e-6, rel=1e-9)
    assert len(found) == 4  # three on the terrain, and the grain beside the screw
    assert world.collisions().names == [("terrain", "sunk")]


def test_tiny_against_huge_keeps_the_sign():
    rng = rng_of("tiny and huge")
    hits = []
    for _ in range(40):
        A = collide.ConvexHull(naive.hull_points(rng, 12) * 1e4)
        B = collide.ConvexHull(naive.hull_points(rng, 12) * 1e-4)
        case = Case(A, B, random_pose(rng), random_pose(rng, 1e4))
        case = naive.with_gap(case, float(rng.choice([-1, 1])) * 1e-4 * 10.0 ** rng.uniform(-3, 0.5))
        with naive.reproducible(case):
            hit = naive.exact_hit(case)
            assert collide.collide(*case) == hit == collide.distance(*case).hit
            hits.append(hit)
    assert 0.2 < naive.share(hits) < 0.8
