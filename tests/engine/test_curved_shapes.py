"""Cylinders, cones and ellipsoids: between polytopes inside and around them, and by certificate.

A signed distance falls when a body grows. The polytope inside therefore bounds the truth from above
and the one around it from below, both by exact arithmetic.
"""

from __future__ import annotations

import math
from itertools import combinations_with_replacement

import naive
import numpy as np
import pytest
from naive import Case, pose, random_pose, rng_of

import collide
from collide.narrowphase.bounds import PROMISE_CURVED
from collide.results import HOW

CURVED = ("Cylinder", "Cone", "Ellipsoid")
EYE = np.eye(4)
#: Corners of polygons around an axis, and rings of a polytope in an ellipsoid.
SIDES, RINGS = 360, 36
#: How far a witness point of a curved shape about 1 m large may be off it.
WITNESS = 2 * PROMISE_CURVED


def points_inside(shape: collide.Shape) -> tuple[np.ndarray, float]:
    """(corners on the surface, factor): the hull is inside, and times the factor around the shape.

    Around: polygons by 1/cos of half a side; for the ellipsoid by 1/cos of the largest angle between
    a direction and its nearest corner, before the sphere is stretched.
    """
    if isinstance(shape, collide.Ellipsoid):
        polar, around = np.meshgrid(np.linspace(0, np.pi, RINGS + 1), np.arange(2 * RINGS) * np.pi / RINGS)
        sphere = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
        return sphere.reshape(-1, 3) * shape.radii, 1 / math.cos(math.sqrt(0.5) * math.pi / RINGS)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = np.stack([shape.radius * np.cos(angle), shape.radius * np.sin(angle), 0 * angle], axis=1)
    low, high = (0, 0, -shape.length / 2), (0, 0, shape.length / 2)
    top = [high] if isinstance(shape, collide.Cone) else ring + high
    return np.vstack([ring + low, top]), 1 / math.cos(math.pi / SIDES)


def polytopes(shape: collide.Shape) -> tuple[collide.Shape, collide.Shape]:
    """(inside, around); shapes with corners stand for themselves."""
    if not isinstance(shape, (collide.Cylinder, collide.Cone, collide.Ellipsoid)):
        return shape, shape
    points, factor = points_inside(shape)
    scale = (factor, factor, factor if isinstance(shape, collide.Ellipsoid) else 1.0)
    return collide.ConvexHull(points), collide.ConvexHull(points * scale)


def shape_of(kind: str, rng) -> collide.Shape:
    return naive.one_of_each(rng)[kind]


@pytest.mark.many(14)
@pytest.mark.parametrize("kind_a", CURVED)
@pytest.mark.parametrize("kind_b", ["Sphere", "Box", "Capsule", "ConvexHull", *CURVED])
def test_between_the_polytopes_inside_and_around(kind_a, kind_b):
    rng = rng_of("between", kind_a, kind_b)
    hits = []
    for _ in range(5):
        A, B = shape_of(kind_a, rng), shape_of(kind_b, rng)
        case = Case(A, B, random_pose(rng, 0.55), random_pose(rng, 0.55))
        (inner_a, outer_a), (inner_b, outer_b) = polytopes(A), polytopes(B)
        above = float(naive.exact_distance(Case(inner_a, inner_b, *case[2:])))
        below = float(naive.exact_distance(Case(outer_a, outer_b, *case[2:])))
        with naive.reproducible(case):
            r = collide.distance(*case)
            hits.append(r.hit)
            assert below <= above + 1e-15 and above - below < 0.01
            assert below - 1e-15 <= r.upper and r.lower <= above + 1e-15, f"{below} … {above} against {r.rows}"
            assert below - (r.upper - r.lower) <= r.distance <= above + (r.upper - r.lower)
            assert r.certified
    assert 0.0 < naive.share(hits)


PAIRS = [pair for pair in combinations_with_replacement(naive.KINDS, 2) if set(pair) & set(CURVED)]
CONVEX_PAIRS = [pair for pair in PAIRS if not set(pair) & {"Compound", "Halfspace"}]


@pytest.mark.many(2)
@pytest.mark.parametrize(("kind_a", "kind_b"), CONVEX_PAIRS)
def test_the_normal_is_a_certificate_and_no_direction_does_better(kind_a, kind_b):
    rng = rng_of("certificate", kind_a, kind_b)
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    hits = []
    for _ in range(12):
        case = Case(shape_of(kind_a, rng), shape_of(kind_b, rng), random_pose(rng, 0.6), random_pose(rng, 0.6))
        with naive.reproducible(case):
            r = collide.distance(*case)
            hits.append(r.hit)
            slack, width = 1e-14, r.upper - r.lower
            found = naive.clearance_along(case, r.normal)
            # The bound may stand from an earlier round than the normal, which is good to about 1e-7.
            assert r.lower - width - 1e-6 <= found <= r.upper + slack, f"{found} along the normal"
            for near in (directions, naive.unit(r.normal) + 0.03 * directions):
                for n in near[:120]:
                    assert naive.clearance_along(case, naive.unit(n)) <= r.upper + slack, n
            assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() <= slack
            assert depth_outside(case.A, case.X_WA, r.point_a) <= WITNESS, "point_a"
            assert depth_outside(case.B, case.X_WB, r.point_b) <= WITNESS, "point_b"
            moved = case.with_b_moved(-r.distance * r.normal)
            again = collide.distance(*moved)
            assert again.lower - slack <= r.upper - r.lower and again.upper >= -(r.upper - r.lower) - slack
    assert 0.0 < naive.share(hits) < 1.0


def depth_outside(shape: collide.Shape, X: np.ndarray, point: np.ndarray) -> float:
    """A bound on how far a world point is outside a body, from implicit formulas; ≤ 0 inside."""
    x, y, z = X[:3, :3].T @ (point - X[:3, 3])
    if isinstance(shape, collide.Ellipsoid):
        return (math.sqrt(sum((c / r) ** 2 for c, r in zip((x, y, z), shape.radii))) - 1) * shape.radii.max()
    if isinstance(shape, collide.Cylinder):
        return max(math.hypot(x, y) - shape.radius, abs(z) - shape.length / 2)
    if isinstance(shape, collide.Cone):
        slant = math.hypot(shape.radius, shape.length)
        side = (math.hypot(x, y) * shape.length + (z - shape.length / 2) * shape.radius) / slant
        return max(side, -z - shape.length / 2)
    if isinstance(shape, collide.HPolytope):
        return float(((shape.normals @ (x, y, z) - shape.offsets) / np.linalg.norm(shape.normals, axis=1)).max())
    return naive.distance_to_body(point, shape, X)


# --- configurations of high symmetry ----------------------------------------------------------------

CYLINDER, CONE, BALL = collide.Cylinder(0.5, 2.0), collide.Cone(0.5, 2.0), collide.Ellipsoid((0.5, 0.5, 1.0))
BOX = collide.Box((1.0, 1.0, 2.0))
UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0])
SYMMETRIC = {
    "coaxial cylinders apart": (CYLINDER, CYLINDER, pose(t=(0, 0, 2.5)), 0.5),
    "coaxial cylinders, cap on cap": (CYLINDER, CYLINDER, pose(t=(0, 0, 2)), 0.0),
    "coaxial cylinders, one in the other": (CYLINDER, collide.Cylinder(0.25, 1.0), EYE, -0.75),
    "parallel cylinders apart": (CYLINDER, CYLINDER, pose(t=(2, 0, 0)), 1.0),
    "parallel cylinders, side on side": (CYLINDER, CYLINDER, pose(t=(1, 0, 0)), 0.0),
    "parallel cylinders, shifted along": (CYLINDER, CYLINDER, pose(t=(1, 0, 0.7)), 0.0),
    "cylinders, caps shifted": (CYLINDER, CYLINDER, pose(t=(0.3, 0.2, 2)), 0.0),
    "apex touches a face": (BOX, CONE, pose(UPSIDE_DOWN, (0.1, 0.2, 2)), 0.0),
    "apex above a face": (BOX, CONE, pose(UPSIDE_DOWN, (0.1, 0.2, 2.25)), 0.25),
    "apex in a face": (BOX, CONE, pose(UPSIDE_DOWN, (0.1, 0.2, 1.875)), -0.125),
    "apex on apex": (CONE, CONE, pose(UPSIDE_DOWN, (0, 0, 2)), 0.0),
    "apexes apart": (CONE, CONE, pose(UPSIDE_DOWN, (0, 0, 3)), 1.0),
    "base on base": (CONE, CONE, pose(UPSIDE_DOWN, (0, 0, -2)), 0.0),
    "cone on a cylinder's cap": (CYLINDER, CONE, pose(t=(0, 0, 2)), 0.0),
    "ellipsoid on a face": (BOX, BALL, pose(t=(0, 0, 2)), 0.0),
    "ellipsoid above a cap": (CYLINDER, BALL, pose(t=(0, 0, 2.5)), 0.5),
    "ellipsoids pole to pole": (BALL, BALL, pose(t=(0, 0, 2)), 0.0),
    "ellipsoids side to side": (BALL, BALL, pose(t=(1.5, 0, 0)), 0.5),
    "sphere on a cap's middle": (CYLINDER, collide.Sphere(0.25), pose(t=(0, 0, 1.25)), 0.0),
    "sphere beside a rim": (CYLINDER, collide.Sphere(0.25), pose(t=(0.8, 0, 1.4)), 0.25),
    "capsule along a cylinder": (CYLINDER, collide.Capsule(0.25, 1), pose(t=(1, 0, 0)), 0.25),
}


@pytest.mark.parametrize("name", SYMMETRIC)
def test_configurations_of_high_symmetry(name):
    A, B, X_WB, truth = SYMMETRIC[name]
    rng = rng_of(name)
    for X in (EYE, *(pose(naive.LATTICE_ROTATIONS[k], rng.integers(-8, 9, 3) / 8) for k in (3, 10, 17))):
        case = Case(A, B, X, X @ X_WB)
        with naive.reproducible(case):
            r = collide.distance(*case)
            ulps = 32 * naive.ULP * 4
            assert r.lower - ulps <= truth <= r.upper + ulps, f"{r.lower} ≤ {truth} ≤ {r.upper} fails"
            assert abs(r.distance - truth) <= (r.upper - r.lower) + ulps
            assert r.upper - r.lower <= 1e-4
            assert np.isfinite(np.concatenate([r.normal, r.point_a, r.point_b])).all()
            if truth != 0:
                assert r.hit == (truth < 0) == collide.collide(*case)
            else:
                assert r.hit or not r.certified or abs(r.lower) < ulps
                assert HOW[r.how] != "undecided" or (r.hit and not r.certified)


def test_near_contacts_of_curved_shapes_are_on_the_right_side():
    """A ball above an ellipsoid's pole at gaps down to 1e-12: what is not provable is a hit without certificate."""
    for k in range(2, 13):
        for sign in (1, -1):
            gap = sign * 10.0**-k
            case = Case(BALL, collide.Sphere(0.25), EYE, pose(t=(0, 0, 1.25 + gap)))
            with naive.reproducible(case):
                r = collide.distance(*case)
                assert r.lower - 1e-15 <= gap <= r.upper + 1e-15
                assert collide.collide(*case) == r.hit
                assert r.hit == (gap < 0) or HOW[r.how] == "undecided"
