"""Reaches and membership of posed sets, and signs with roots, against decimals of 80 digits."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from curved_cells import CONTEXT, exact, vector
from curved_oracle import Body, away_from
from naive import random_pose, rng_of

import collide
from collide.certificates.exact_parts import exact_parts
from collide.certificates.point_and_plane import (
    flaw_of_normal,
    flaw_of_point,
    holds,
    in_lowest_terms,
    reaches,
    sign_with_roots,
)
from collide.certificates.proof_search import common_point

EYE = np.eye(4)


def shapes(rng) -> list:
    a, b, c = (float(x) for x in rng.uniform(0.1, 2.0, 3))
    return [
        collide.Cylinder(a, b), collide.Cone(a, b), collide.Ellipsoid((a, b, c)), collide.Sphere(a),
        collide.Capsule(a, b), collide.ConvexHull(rng.normal(size=(12, 3)), radius=a), collide.Box((a, b, c)),
    ]


def stretched(rng) -> np.ndarray:
    """A matrix other than a rotation."""
    X = random_pose(rng)
    X[:3, :3] += rng.normal(size=(3, 3)) * 0.2
    return X


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(6))
def test_reaches_are_supports(seed):
    rng = rng_of(f"reaches {seed}")
    for shape in shapes(rng):
        X = stretched(rng)
        (part,) = exact_parts(shape, X)
        with localcontext(CONTEXT):
            body = Body(shape, X)
        for n in rng.integers(-50, 51, (8, 3)).tolist():
            with localcontext(CONTEXT):
                largest = max(exact(r.a) + exact(r.b).sqrt() for r in reaches(part, tuple(n)))
                support = body.cells[0].support(vector(n))[0]
                support += body.cells[0].radius * sum(Decimal(x) ** 2 for x in n).sqrt()
                assert abs(largest - support) < Decimal("1e-70"), (shape, X, n)


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(6))
def test_points_are_held_where_the_oracle_says(seed):
    rng = rng_of(f"members {seed}")
    inside = outside = 0
    for shape in shapes(rng):
        X = stretched(rng)
        (part,) = exact_parts(shape, X)
        for x in (rng.normal(size=(20, 3)) * 0.7 + X[:3, 3]).tolist():
            point, away = [Fraction(c) for c in x], away_from(shape, X, x)
            if 0.0 < away < 1e-12:
                continue
            assert holds(part, in_lowest_terms(point)) == (away == 0.0), (shape, X, x, away)
            inside, outside = inside + (away == 0.0), outside + (away > 0.0)
    assert inside > 10 and outside > 10


def test_surfaces_belong_to_bodies():
    """Points of a surface are held, points an ulp farther out are not."""
    up = Fraction(1, 2**60)
    for shape, x, out in (
        (collide.Cylinder(5.0, 2.0), (3, 4, 1), (0, 0, 1)), (collide.Cylinder(5.0, 2.0), (3, 4, 0), (3, 4, 0)),
        (collide.Cone(5.0, 2.0), (3, 4, -1), (3, 4, 0)), (collide.Cone(5.0, 2.0), (0, 0, 1), (0, 0, 1)),
        (collide.Cone(5.0, 2.0), (Fraction(3, 2), 2, 0), (0, 0, 1)),
        (collide.Ellipsoid((5, 5, 1)), (3, 4, 0), (3, 4, 0)),
        (collide.Sphere(5.0), (3, 4, 0), (3, 4, 0)), (collide.Capsule(5.0, 2.0), (3, 0, 5), (0, 0, 1)),
        (collide.Box((2, 2, 2)), (1, 1, 1), (1, 0, 0)), (collide.Halfspace((0, 0, 1), 0.5), (9, 9, 0.5), (0, 0, 1)),
    ):
        (part,) = exact_parts(shape, EYE)
        at = [Fraction(c) for c in x]
        assert holds(part, in_lowest_terms(at)), shape
        assert not holds(part, in_lowest_terms([c + up * d for c, d in zip(at, out)])), shape


def test_a_plane_parts_strictly():
    ball, can = collide.Sphere(1.0), collide.Cylinder(1.0, 2.0)
    (a,), (touching,), (apart,) = (
        exact_parts(shape, collide.pose((x, 0, 0))) for shape, x in ((can, 0.0), (ball, -2.0), (ball, -2.0000001))
    )
    assert flaw_of_normal(a, apart, (1, 0, 0)) is None
    assert flaw_of_normal(a, touching, (1, 0, 0)) is not None
    assert flaw_of_normal(a, apart, (-1, 0, 0)) is not None and flaw_of_normal(a, apart, (0, 0, 0)) is not None
    assert flaw_of_point(a, touching, (-1, 0, 0, 1)) is None and flaw_of_point(a, apart, (-1, 0, 0, 1)) is not None
    assert flaw_of_point(a, touching, (1, 0, 0, -1)) is not None
    assert flaw_of_point(a, touching, (0, 0, 0, 0)) is not None


def test_a_half_space_is_parted_along_its_normal_alone():
    (floor,), (can,) = exact_parts(collide.Halfspace((0, 0, 1), 0.0), EYE), exact_parts(
        collide.Cylinder(1.0, 2.0), collide.pose((0, 0, 1.5))
    )
    assert flaw_of_normal(can, floor, (0, 0, 3)) is None and flaw_of_normal(floor, can, (0, 0, -3)) is None
    for n in ((0, 0, -1), (1, 0, 1000), (0, 0, 0)):
        assert "along its normal" in flaw_of_normal(can, floor, n)


def test_a_flat_matrix_holds_no_point():
    X = np.eye(4)
    X[2, 2] = 0.0
    for shape in (collide.Cylinder(1.0, 2.0), collide.Ellipsoid((1, 2, 3)), collide.Halfspace((1, 0, 0), 1.0)):
        (part,) = exact_parts(shape, X)
        assert not holds(part, (0, 0, 0, 1)), shape
        assert common_point(part, exact_parts(collide.Sphere(1.0), EYE)[0]) is None


def test_signs_with_roots():
    rng = rng_of("signs with roots")
    signs = []
    for k in range(600):
        x, y, z = (Fraction(int(i), int(d)) for i, d in zip(rng.integers(0, 30, 3), rng.integers(1, 9, 3)))
        a, b, c = (-x - y, x * x, y * y) if k % 3 == 0 else (-x, y, z)
        with localcontext(CONTEXT):
            value = exact(a) + exact(b).sqrt() + exact(c).sqrt()
            expected = 0 if abs(value) < Decimal("1e-60") else 1 if value > 0 else -1
        assert sign_with_roots(a, b, c) == expected, (a, b, c)
        signs.append(expected)
    assert min(map(signs.count, (-1, 0, 1))) > 10, signs
