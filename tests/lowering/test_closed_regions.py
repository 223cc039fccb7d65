"""Regions closed by boxes: sizes by the inequality that makes answers the same, and what has no end is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive import corners, hull_points, one_of_each, random_pose, rng_of
from reproduction import reproducing

import collide
from collide.errors import UnsupportedQuery
from collide.lowering import closed_regions as C

HALF = collide.HPolytope([(0, 0, 1)], [0.0], bounded=False)
CORNER = collide.HPolytope([(0, 0, 1), (1, 0, 0)], [-3.0, 2.0], bounded=False)
ONE = 1.0 - 1e-12


def body(rng) -> collide.ConvexHull:
    return collide.ConvexHull(hull_points(rng, int(rng.integers(1, 9))), radius=float(rng.choice([0.0, 0.4])))


def farthest(shape, X_WB, X_WR) -> float:
    """How far points of a body are from the origin of a region's frame."""
    points, radius = corners(shape)
    world = points @ X_WB[:3, :3].T + X_WB[:3, 3]
    return float(np.linalg.norm(world - X_WR[:3, 3], axis=1).max()) + radius


@pytest.mark.parametrize("region", [HALF, CORNER], ids=["half", "corner"])
@pytest.mark.parametrize("swapped", [False, True])
def test_sizes_hold_what_matters(region, swapped):
    """s ≥ 2 ρ + m, a power of two, and not absurdly large."""
    rng = rng_of("box sizes", swapped, len(region.offsets))
    for _ in range(40):
        shape = body(rng)
        X_WR, X_WB = (np.array([random_pose(rng, 10.0 ** rng.integers(-2, 3)) for _ in range(3)]) for _ in range(2))
        leeway = rng.uniform(0, 5, 3)
        pair = (shape, region, X_WB, X_WR) if swapped else (region, shape, X_WR, X_WB)
        with reproducing("X_WR, X_WB = {R}, {B}", R=X_WR, B=X_WB):
            sizes = C.sizes_at(*pair, leeway)
            for k in range(3):
                rho = farthest(shape, X_WB[k], X_WR[k]) + leeway[k]
                assert sizes[k] >= (2.0 * rho + region.boundary_within) * ONE
                assert sizes[k] <= 40.0 * (rho + farthest(shape, np.eye(4), np.eye(4)) + region.boundary_within) + 1e-40
                assert math.frexp(sizes[k])[0] == 0.5
            assert (C.sizes_at(*pair) <= sizes).all()


def test_stretched_frames_need_larger_boxes():
    rng, shape = rng_of("stretched"), collide.ConvexHull(hull_points(rng_of("s"), 6))
    X_WR, X_WB = np.array([np.diag((0.25, 1.0, 4.0, 1.0))]), np.array([random_pose(rng)])
    size = C.sizes_at(CORNER, shape, X_WR, X_WB)[0]
    world = shape.points @ X_WB[0, :3, :3].T + X_WB[0, :3, 3]
    in_region = world @ np.linalg.inv(X_WR[0, :3, :3]).T
    assert size >= 2 * np.linalg.norm(in_region, axis=1).max() + CORNER.boundary_within
    assert size > C.sizes_at(CORNER, shape, np.array([np.eye(4)]), X_WB)[0]


@pytest.mark.parametrize("kind", [*one_of_each(rng_of("kinds")), "Mesh"])
def test_reach_holds_all_points(kind):
    rng = rng_of("reach", kind)
    shape = one_of_each(rng)[kind] if kind != "Mesh" else collide.Mesh(*collide.tessellate(collide.Box((1, 2, 3)))[:2])
    reach = C.reach_of(shape)
    if kind == "Halfspace":
        assert reach == math.inf
        return
    vertices = np.asarray(collide.tessellate(shape, tolerance=0.05)[0])
    farthest_point = np.linalg.norm(vertices, axis=1).max()
    assert farthest_point * (1 - 1e-9) <= reach and (kind == "Compound" or reach < 1.2 * farthest_point + 1e-9)


def test_reach_of_what_has_no_end_and_what_is_shifted():
    assert C.reach_of(HALF) == math.inf
    half = collide.Halfspace((0, 0, 1), 0.0)
    assert C.reach_of(collide.Compound([(half, np.eye(4)), (collide.Sphere(1.0), np.eye(4))])) == math.inf
    far = collide.Compound([(collide.Sphere(0.5), collide.pose((3, 4, 0))), (collide.Sphere(1.0), np.eye(4))])
    assert 5.5 <= C.reach_of(far) < 5.5 * (1 + 1e-3)


def test_pairs_are_closed_one_by_one():
    """What is no region stays the shape it is; boxes are those of the poses and the leeway of each pair."""
    rng, n = rng_of("closed shapes"), 6
    ball, box = collide.Sphere(0.5), collide.Box((1, 1, 1))
    A, B = [ball, HALF, box, HALF, ball, CORNER], [HALF, ball, box, ball, CORNER, box]
    X_WA, X_WB = (np.array([random_pose(rng, 10.0) for _ in range(n)]) for _ in range(2))
    leeway = rng.uniform(0, 9, n)
    out_a, out_b = C.closed_shapes(A, B, X_WA, X_WB, n, leeway)
    for k in range(n):
        a, b = slice(k, k + 1), (A[k], B[k])
        if not (A[k].is_region or B[k].is_region):
            assert out_a[k] is A[k] and out_b[k] is B[k]
            continue
        size = C.sizes_at(*b, X_WA[a], X_WB[a], leeway[a])[0]
        found, other, given = (out_a[k], out_b[k], B[k]) if A[k].is_region else (out_b[k], out_a[k], A[k])
        region = A[k] if A[k].is_region else B[k]
        assert other is given and not found.is_region and found is C.closed(region, size)
        assert np.abs(found.vertices).max() == size
        assert (region.normals @ found.vertices.T <= region.offsets[:, None] + 1e-9 * size).all()
    assert C.closed_shapes(ball, box, X_WA, X_WB, n) == (ball, box)
    one_a, one_b = C.closed_shapes(ball, HALF, X_WA[:1], X_WB, n)
    assert one_a == [ball] * n and len({id(shape) for shape in one_b}) <= n
    for k in range(n):
        assert one_b[k] is C.closed(HALF, C.sizes_at(ball, HALF, X_WA[:1], X_WB[k : k + 1])[0])


@pytest.mark.parametrize("swapped", [False, True])
def test_closings_share_out_the_poses(swapped):
    rng, n, ball = rng_of("closings", swapped), 20, collide.Sphere(0.5)
    X_WA, X_WB = (np.array([random_pose(rng, 10.0 ** rng.integers(-1, 3)) for _ in range(n)]) for _ in range(2))
    A, B = (ball, HALF) if swapped else (HALF, ball)
    sizes, seen = C.sizes_at(A, B, X_WA, X_WB), []
    for a, b, some in C.closings(A, B, X_WA, X_WB):
        assert (a if swapped else b) is ball
        assert (b if swapped else a) is C.closed(HALF, sizes[some[0]]) and len(set(sizes[some].tolist())) == 1
        seen += some.tolist()
    assert sorted(seen) == list(range(n)) and len(set(sizes.tolist())) > 3


def test_what_has_no_end_twice_is_refused_by_name():
    X = np.eye(4)[None]
    half = collide.Halfspace((0, 0, 1), 0.0)
    for A, B, words in (
        (HALF, half, r"HPolytope\(bounded=False\) and Halfspace: neither has an end.*collide\(\) and distance\(\)"),
        (half, HALF, r"Halfspace and HPolytope\(bounded=False\)"),
        (HALF, CORNER, "neither has an end"),
        (collide.Compound([(half, np.eye(4))]), HALF, "ask about the items of the Compound"),
    ):
        with pytest.raises(UnsupportedQuery, match=words):
            C.sizes_at(A, B, X, X)
    far = collide.pose((9e49, 0, 0))[None]
    with pytest.raises(UnsupportedQuery, match="a body may be"):
        C.sizes_at(HALF, collide.Sphere(1.0), X, far)


def test_boxes_have_a_least_size():
    sizes = C.box_sizes(HALF, np.array([0.0, 1e-60, 1.0]))
    assert (sizes > 0.0).all() and sizes[0] == sizes[1] and sizes[2] in (4.0, 8.0)
