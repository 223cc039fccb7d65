"""Differential properties on inputs that shrink: small integers first, then quarters, then any double.

A failure is reported by its smallest case, as source that can be pasted.
"""

from __future__ import annotations

from fractions import Fraction

import naive
import numpy as np
import pytest
from naive import Case

import collide
from collide.results import HOW, flipped

pytest.importorskip("hypothesis")
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

QUICK = settings(
    max_examples=120, derandomize=True, deadline=None, print_blob=False,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)

#: Integers come first and shrink towards 0; then quarters, then doubles that need all their bits.
COORDINATES = st.one_of(
    st.integers(-3, 3).map(float),
    st.integers(-12, 12).map(lambda k: k / 4),
    st.floats(-3, 3, allow_subnormal=False, width=32),
    st.floats(-3, 3).filter(lambda x: x == 0 or abs(x) > 1e-30),
)
POINTS = st.tuples(COORDINATES, COORDINATES, COORDINATES)
RADII = st.one_of(st.just(0.0), st.sampled_from([0.25, 0.5, 1.0]), st.floats(1e-3, 2))


def quaternion_rotation(q) -> np.ndarray:
    return collide.pose(quat_wxyz=q)[:3, :3]


ROTATIONS = st.one_of(
    st.sampled_from(list(naive.LATTICE_ROTATIONS)),
    st.tuples(*[st.integers(-3, 3)] * 4).filter(any).map(quaternion_rotation),
    st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(x * x for x in q) > 0.01).map(quaternion_rotation),
)
POSES = st.builds(naive.pose, ROTATIONS, POINTS)
HULLS = st.builds(
    lambda points, radius: collide.ConvexHull(points, radius=radius), st.lists(POINTS, min_size=1, max_size=9), RADII
)
CASES = st.builds(Case, HULLS, HULLS, POSES, POSES)
SIZES = st.sampled_from([0.25, 0.5, 1.0, 2.0])
CURVED = st.one_of(
    st.builds(collide.Cylinder, SIZES, SIZES),
    st.builds(collide.Cone, SIZES, SIZES),
    st.builds(lambda *radii: collide.Ellipsoid(radii), SIZES, SIZES, SIZES),
)


@QUICK
@given(CASES)
def test_hulls_agree_with_exact_arithmetic(case):
    with naive.reproducible(case):
        truth, hit = naive.exact_distance(case), naive.exact_hit(case)
        r = collide.distance(*case)
        assert Fraction(r.lower) <= truth <= Fraction(r.upper), f"{r.lower} ≤ {float(truth)} ≤ {r.upper} fails"
        assert r.hit == hit or HOW[r.how] == "undecided"
        assert collide.collide(*case) == r.hit
        assert abs(float(truth) - r.distance) <= r.upper - r.lower


@QUICK
@given(CASES)
def test_swapping_hulls(case):
    with naive.reproducible(case):
        one, other = collide.distance(*case).rows, collide.distance(*case.swapped()).rows
        if case.A != case.B or not np.array_equal(case.X_WA, case.X_WB):
            assert not naive.same_bits(one, flipped(other))


@QUICK
@given(CASES)
def test_witness_points_of_hulls(case):
    with naive.reproducible(case):
        r = collide.distance(*case)
        slack = 32 * naive.ULP * (naive.size(case) + float(np.abs(case.X_WA[:3, 3]).max()))
        assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() <= slack
        if r.certified:
            assert naive.distance_to_body(r.point_a, case.A, case.X_WA) <= slack, "point_a is not on A"
            assert naive.distance_to_body(r.point_b, case.B, case.X_WB) <= slack, "point_b is not on B"
            moved = case.with_b_moved(-r.distance * r.normal)
            assert abs(naive.exact_distance(moved)) <= slack, "moved, they do not touch"


@QUICK
@given(CURVED, HULLS, POSES, POSES)
def test_curved_shapes_are_consistent(curved, hull, X_WA, X_WB):
    case = Case(curved, hull, X_WA, X_WB)
    with naive.reproducible(case):
        r = collide.distance(*case)
        assert r.lower <= r.distance <= r.upper and np.isfinite([r.lower, r.upper, *r.normal, *r.point_a]).all()
        assert abs(np.linalg.norm(r.normal) - 1) < 1e-14
        assert not naive.same_bits(r.rows, flipped(collide.distance(*case.swapped()).rows))
        assert collide.collide(*case) == r.hit
        for n in (*np.eye(3), r.normal):
            assert naive.clearance_along(case, n) <= r.upper + 1e-13


@QUICK
@given(st.lists(st.tuples(st.one_of(HULLS, CURVED), POSES), min_size=2, max_size=6), st.sampled_from([0.0, 0.25, 1.0]))
def test_worlds_equal_brute_force(bodies, margin):
    world = collide.World()
    for shape, X in bodies:
        world.add(shape, X)
    rows = world.distances(max_distance=margin)
    expected = naive.brute_force(world, margin)
    assert [(int(row["a"]), int(row["b"])) for row in rows] == [(a, b) for a, b, _ in expected]
    for row, (_, _, other) in zip(rows, expected):
        assert not naive.same_bits(row, other)
    assert world.collides() == any(row["hit"] for _, _, row in expected)


def test_the_cases_are_neither_all_hits_nor_all_misses():
    hits = []

    @settings(QUICK, max_examples=100)
    @given(CASES)
    def collect(case):
        hits.append(collide.collide(*case))

    collect()
    assert 0.1 < naive.share(hits) < 0.95
