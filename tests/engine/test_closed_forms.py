"""Pairs whose distance one can write down: spheres, capsules, half-spaces, aligned boxes."""

from __future__ import annotations

import math

import naive
import numpy as np
import pytest
from naive import Case, pose, random_pose, rng_of

import collide

EYE = np.eye(4)


def close(case: Case, truth: float, size: float, ulps: float = 64):
    """The distance is right to ulps of the size, and the bracket holds the rounded truth."""
    r = collide.distance(*case)
    slack = ulps * naive.ULP * size
    assert abs(r.distance - truth) <= slack, f"distance {r.distance}, expected {truth}"
    assert r.lower - 4 * naive.ULP * size <= truth <= r.upper + 4 * naive.ULP * size
    assert r.hit == (r.distance <= 0.0) or not r.certified
    return r


# --- spheres and capsules ---------------------------------------------------------------------------


def test_spheres():
    rng = rng_of("spheres")
    hits = []
    for _ in range(200):
        a, b = (float(x) for x in 10.0 ** rng.uniform(-2, 1, 2))
        X, Y = random_pose(rng, 1), random_pose(rng, 1)
        case = Case(collide.Sphere(a), collide.Sphere(b), X, Y)
        with naive.reproducible(case):
            d = Y[:3, 3] - X[:3, 3]
            r = close(case, float(np.linalg.norm(d)) - a - b, a + b + 3)
            assert np.abs(r.normal - naive.unit(d)).max() <= 64 * naive.ULP * (a + b + 3) / np.linalg.norm(d)
            hits.append(r.hit)
    assert 0.2 < naive.share(hits) < 0.8


def test_concentric_spheres_are_as_deep_as_both_radii():
    X = pose(naive.rotation(rng_of("concentric")), (0.1, 0.2, 0.3))
    r = collide.distance(collide.Sphere(0.5), collide.Sphere(0.25), X, X)
    assert r.hit and r.distance == pytest.approx(-0.75, rel=1e-14)
    assert np.linalg.norm(r.normal) == pytest.approx(1.0, rel=1e-15)
    assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() < 1e-15


def test_spheres_touch_exactly():
    for offset in ((3, 4, 0), (0, -3, 4), (5, 0, 0)):
        A, B = collide.Sphere(2.0), collide.Sphere(3.0)
        r = collide.distance(A, B, EYE, pose(t=offset))
        assert r.hit and r.certified and r.distance == 0.0
        above, below = (collide.Sphere(math.nextafter(3.0, up)) for up in (9.0, 0.0))
        assert collide.distance(A, below, EYE, pose(t=offset)).certified
        assert not collide.collide(A, below, EYE, pose(t=offset))
        assert collide.collide(A, above, EYE, pose(t=offset))


@pytest.mark.parametrize("height", [0.0, 0.3, 0.5, 0.9])
def test_sphere_beside_a_capsule(height):
    """Beside the segment the distance is across it, past its end it is to the end."""
    capsule, ball = collide.Capsule(0.25, 1.0), collide.Sphere(0.125)
    for across in (0.0, 0.1, 0.7):
        case = Case(capsule, ball, EYE, pose(t=(across, 0, height)))
        with naive.reproducible(case):
            close(case, math.hypot(across, max(height - 0.5, 0.0)) - 0.375, 2)


def test_sphere_centre_on_the_axis_of_a_capsule():
    for height in (-0.5, -0.2, 0.0, 0.5):
        r = close(Case(collide.Capsule(0.25, 1.0), collide.Sphere(0.125), EYE, pose(t=(0, 0, height))), -0.375, 2)
        assert abs(r.normal[2]) < 1e-12 or abs(height) == 0.5
        moved = pose(t=np.array([0, 0, height]) - r.distance * r.normal)
        assert abs(collide.distance(collide.Capsule(0.25, 1.0), collide.Sphere(0.125), EYE, moved).distance) < 1e-15


def test_capsules_parallel_crossing_collinear():
    A, B = collide.Capsule(0.1, 2.0), collide.Capsule(0.2, 1.0)
    across = pose([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # z turned to x
    table = [
        (pose(t=(1, 0, 0)), 0.7),
        (pose(t=(1, 0, 0.25)), 0.7),
        (pose(t=(0, 0, 3)), 1.2),  # collinear, apart
        (pose(t=(0, 0, 1.5)), -0.3),  # collinear, end on end
        (pose(t=(0, 0, 0)), -0.3),  # one axis inside the other
        (pose(t=(0, 0.5, 0)) @ across, 0.2),
        (pose(t=(0, 0, 0)) @ across, -0.3),  # axes cross
        (pose(t=(3, 0, 2)) @ across, math.hypot(2.5, 1.0) - 0.3),
    ]
    for X_WB, truth in table:
        case = Case(A, B, EYE, X_WB)
        with naive.reproducible(case):
            r = close(case, truth, 4)
            if r.hit:
                assert abs(collide.distance(*case.with_b_moved(-r.distance * r.normal)).distance) < 1e-14


def test_capsules_that_cross_leave_across_both_axes():
    turned = pose([[0, 0, 1], [0, 1, 0], [-1, 0, 0]], (0.05, 0.1, 0.2))
    r = close(Case(collide.Capsule(0.5, 4.0), collide.Capsule(0.25, 4.0), EYE, turned), -0.65, 6)
    assert np.abs(np.abs(r.normal) - (0, 1, 0)).max() < 1e-14


def test_capsules_against_sampled_segments():
    rng = rng_of("capsules")
    s = np.linspace(-0.5, 0.5, 2001)
    for _ in range(60):
        A, B = (collide.Capsule(float(rng.uniform(0.01, 0.2)), float(rng.uniform(0.1, 2))) for _ in range(2))
        X, Y = random_pose(rng), random_pose(rng)
        case = Case(A, B, X, Y)
        p, u = X[:3, 3] - Y[:3, 3], X[:3, 2] * A.length
        v = Y[:3, 2]
        points = p + s[:, None] * u
        along = np.clip(points @ v, -B.length / 2, B.length / 2)
        sampled = np.linalg.norm(points - along[:, None] * v, axis=1).min() - A.radius - B.radius
        with naive.reproducible(case):
            r = collide.distance(*case)
            if sampled + A.radius + B.radius > 0.05:  # the cores are apart, and sampling is second order
                assert r.distance <= sampled + 1e-14
                assert r.distance >= sampled - 2e-6


def test_capsule_of_no_length_is_a_sphere():
    rng = rng_of("no length")
    for _ in range(20):
        X, Y = random_pose(rng), random_pose(rng)
        one = collide.distance(collide.Capsule(0.3, 0.0), collide.Box((1, 1, 1)), X, Y).rows
        other = collide.distance(collide.Sphere(0.3), collide.Box((1, 1, 1)), X, Y).rows
        assert not naive.same_bits(one, other)


# --- half-spaces ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [kind for kind in naive.KINDS if kind != "Halfspace"])
def test_halfspace_against_everything(kind):
    rng = rng_of("halfspace", kind)
    hits = []
    for _ in range(40):
        shape = naive.one_of_each(rng)[kind]
        n, length = naive.unit(rng.normal(size=3)), float(10.0 ** rng.uniform(-2, 2))
        offset = float(rng.uniform(-0.5, 0.5))
        H = collide.Halfspace(n * length, offset * length)
        case = Case(H, shape, random_pose(rng, 0.4), random_pose(rng, 1.0))
        n_W = case.X_WA[:3, :3] @ n
        truth = naive.extent_along(shape, case.X_WB, n_W) - offset - float(n_W @ case.X_WA[:3, 3])
        with naive.reproducible(case):
            r = close(case, truth, 4)
            hits.append(r.hit)
            assert np.abs(r.normal - n_W).max() < 1e-14
            assert abs(n_W @ (r.point_a - case.X_WA[:3, 3]) - offset) < 1e-14, "point_a is not on the plane"
            assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() < 1e-14
            moved = case.with_b_moved(-r.distance * r.normal)
            assert abs(collide.distance(*moved).distance) < 1e-14
    assert 0.15 < naive.share(hits) < 0.9


def test_halfspaces_that_are_not_opposite_meet_without_end():
    up = collide.Halfspace((0, 0, 1), 0.0)
    cases = [(up, 2.0), (up, -2.0)]
    cases += [(collide.Halfspace((0, tilt, -1), 0.0), z) for tilt in (1e-9, 1e-17, 1e-30) for z in (-1.0, 0.0, 1000.0)]
    for other, z in cases:
        case = Case(up, other, EYE, pose(t=(0, 0, z)))
        with naive.reproducible(case):
            assert collide.collide(*case) and collide.collide(*case.swapped())
            with pytest.raises(collide.UnsupportedQuery, match="Halfspace"):
                collide.distance(*case)


def test_opposite_halfspaces_are_apart_or_share_a_slab():
    """A slab has a thickness: that is the way out."""
    up, down = collide.Halfspace((0, 0, 1), 0.0), collide.Halfspace((0, 0, -3), 0.0)
    for z in (0.5, 1e-300, 0.0, -1e-300, -0.5):
        case = Case(up, down, EYE, pose(t=(5, 5, z)))
        with naive.reproducible(case):
            r = collide.distance(*case)
            assert r.distance == z and r.lower <= z <= r.upper and r.hit == (z <= 0) == collide.collide(*case)
            assert np.array_equal(r.normal, (0, 0, 1)) and r.certified
            assert np.array_equal(r.point_b - r.point_a, r.distance * r.normal)


def test_halfspaces_in_a_batch_name_the_pose_that_has_no_answer():
    up, down = collide.Halfspace((0, 0, 1), 0.0), collide.Halfspace((0, 0, -1), 0.0)
    turned = pose([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    poses = np.array([pose(t=(0, 0, 1.0)), pose(t=(0, 0, -1.0)), turned])
    assert collide.collide(up, down, EYE, poses).tolist() == [False, True, True]
    with pytest.raises(collide.UnsupportedQuery, match="pose 2 of the batch"):
        collide.distance(up, down, EYE, poses)


# --- boxes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("offset", "truth"),
    [
        ((3, 0, 0), 2.0),
        ((2, 2, 0), math.sqrt(2)),
        ((2, 2, 2), math.sqrt(3)),
        ((0, -1.5, 0.25), 0.5),
        ((1, 0, 0), 0.0),
        ((1, 1, 0), 0.0),
        ((1, 1, 1), 0.0),
        ((0.75, 0.5, 0.25), -0.25),
        ((0, 0, 0.5), -0.5),
        ((0, 0, 0), -1.0),
        ((0.75, 0.75, 0.75), -0.25),
    ],
)
def test_unit_boxes(offset, truth):
    box = collide.Box((1, 1, 1))
    for turn in naive.LATTICE_ROTATIONS[::5]:
        case = Case(box, box, EYE, pose(turn, offset))
        with naive.reproducible(case):
            r = close(case, truth, 4, ulps=4)
            assert r.certified and r.hit == (truth <= 0)
            if truth == 0:
                assert r.distance == 0.0


def test_cube_on_its_edge():
    """A cube turned by 45° about z: its edge meets the face at half a diagonal."""
    box = collide.Box((1, 1, 1))
    c = math.sqrt(0.5)
    turned = np.array([[c, -c, 0], [c, c, 0], [0, 0, 1]])
    for x, truth in ((2.0, 1.5 - c), (1.0, 0.5 - c)):
        close(Case(box, box, EYE, pose(turned, (x, 0, 0))), truth, 4)


def test_box_in_the_middle_of_a_box_leaves_by_the_nearest_face():
    outer, inner = collide.Box((4, 5, 6)), collide.Box((1, 1, 1))
    r = close(Case(outer, inner, EYE, pose(t=(0.5, -0.25, 0.25))), -2.0, 12)
    assert np.abs(r.normal - (1, 0, 0)).max() < 1e-14


@pytest.mark.parametrize("other", ["Cylinder", "Cone", "Ellipsoid"])
def test_curved_shape_around_a_point(other):
    """The origin of each, as a small ball: as deep as the nearest face."""
    shape = {
        "Cylinder": collide.Cylinder(0.5, 2.0), "Cone": collide.Cone(1.0, 2.0),
        "Ellipsoid": collide.Ellipsoid((1, 2, 3)),
    }[other]
    depth = {"Cylinder": 0.5, "Cone": math.sin(math.atan2(1, 2)), "Ellipsoid": 1.0}[other]
    r = collide.distance(shape, collide.Sphere(0.125), EYE, EYE)
    truth = -depth - 0.125
    assert r.hit and r.lower <= truth + 1e-15 and r.upper >= truth - 1e-15
    # Every way out around the axis is equally short: many facets, a wide bracket, but an honest one.
    assert abs(r.distance - truth) <= r.upper - r.lower <= 1e-4
