"""Rows of casts onto half-spaces: brackets hold the fall of every vertex, in Fractions, and of balls."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from cast_oracles import support_heights
from naive import LATTICE_ROTATIONS, hull_points, pose, random_pose, rng_of
from reproduction import reproducing

import collide
from collide.casts import cast_pairs as P
from collide.casts.cast_onto_plane import cast_onto_plane
from collide.casts.convex_casts import workspace
from collide.casts.portal import BEHIND, HIT, LEVEL, MISS, OPEN
from collide.casts.posed_parts import posed_sides
from collide.kernels import address_of, view_f64, view_i64
from collide.lowering.shape_table import INTS, NUMBERS, POSE
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.posed_pair import posed_pair, size_and_slop
from collide.numerics.vec3 import Vec3

SOURCE = "points, X, d, limit = {points}, {X}, {d}, {limit}  # onto z ≤ 0; tests/casts/test_cast_onto_plane.py"
FLOOR = collide.Halfspace((0, 0, 1), 0.0)


def row_of(A, X_WA, d, limit, B=FLOOR, X_WB=None) -> np.ndarray:
    pairs = posed_sides(A, B, X_WA[None], (np.eye(4) if X_WB is None else X_WB)[None], 1).all_pairs(np.arange(1))
    pairs.parts.table.build_trees(pairs.parts.shape_of)
    row, question = np.zeros(P.CAST_ROW), np.array([*d, limit])
    P.cast_pairs(
        *pairs.parts.table.addresses, address_of(pairs.parts.poses.rows), address_of(pairs.parts.shape_of),
        address_of(pairs.pairs), address_of(question), 1, address_of(row), *workspace(),
    )
    return row


@pytest.mark.parametrize("kind", ["lattice", "random"])
def test_brackets_hold_the_fall_of_the_lowest_vertex(kind):
    rng, seen = rng_of("onto a plane", kind), Counter()
    for _ in range(80):
        points, X = hull_points(rng, int(rng.integers(1, 9))), random_pose(rng, 1.0)
        d = rng.normal(size=3)
        if kind == "lattice":
            points, X = rng.integers(-2, 3, points.shape) * 0.5, pose(LATTICE_ROTATIONS[int(rng.integers(24))])
            d = rng.integers(-2, 3, 3) * 0.25
        d = d if d.any() else np.array((0, 0, -1.0))
        X[2, 3] = rng.integers(0, 4)
        limit = float(rng.choice([math.inf, 2.0]))
        R, at = ([[Fraction(v) for v in r] for r in X[:3, :3].tolist()], Fraction(X[2, 3]))
        heights = [sum(r * Fraction(c) for r, c in zip(R[2], p)) + at for p in points.tolist()]
        height, pace = min(heights), -Fraction(float(d[2]))
        with reproducing(SOURCE, points=points, X=X, d=d, limit=limit):
            row = row_of(collide.ConvexHull(points), X, d, limit)
            status = int(row[P.STATUS])
            seen[status] += 1
            if status == HIT:
                t = height / pace
                assert 0 < Fraction(row[P.LOWER]) <= t <= Fraction(row[P.UPPER]) and t <= limit
                p = row[P.TOUCHING : P.TOUCHING + 3]
                assert abs(p[2]) < 1e-12 and np.array_equal(row[P.NORMAL : P.NORMAL + 3], (0, 0, -1))
            elif status == MISS:
                assert (height > 0 and pace <= 0) or height / pace > limit
            elif status == LEVEL:
                assert abs(pace) < Fraction(1, 2**40) and Fraction(row[P.LOWER]) <= height <= Fraction(row[P.UPPER])
            elif status == BEHIND:
                assert height < Fraction(1, 10**12)
                if height > 0 and pace > 0:
                    assert height / pace <= Fraction(row[P.UPPER])
            else:
                assert status == OPEN and Fraction(row[P.LOWER]) <= limit < Fraction(row[P.UPPER])
    assert seen[HIT] > 5 and seen[MISS] > 10 and seen[BEHIND] > 3, seen


@pytest.mark.parametrize(
    "shape", [collide.Sphere(0.4), collide.Capsule(0.2, 0.8), collide.Cylinder(0.3, 0.6), collide.Cone(0.3, 0.6),
              collide.Ellipsoid((0.5, 0.3, 0.2)), collide.Box((0.3, 0.5, 0.7))], ids=lambda s: type(s).__name__,
)
def test_shapes_fall_as_far_as_they_reach(shape):
    """Onto a turned and moved plane whose normal is no unit vector."""
    rng = rng_of("shapes onto a plane", type(shape).__name__)
    for _ in range(8):
        half, X_WB = collide.Halfspace(rng.normal(size=3) * 3, float(rng.normal())), random_pose(rng)
        nhat = X_WB[:3, :3] @ half.normal / np.linalg.norm(half.normal)
        offset = half.offset / np.linalg.norm(half.normal) + nhat @ X_WB[:3, 3]
        X_WA = random_pose(rng)
        X_WA[:3, 3] = (offset + rng.uniform(1, 3)) * nhat + np.cross(nhat, rng.normal(size=3))
        d = 0.3 * rng.normal(size=3) - nhat
        gap = -support_heights(shape, X_WA, -nhat[None])[0] - offset
        row = row_of(shape, X_WA, d / 4, math.inf, half, X_WB)
        assert row[P.STATUS] == HIT and row[P.LOWER] <= row[P.VALUE] <= row[P.UPPER]
        assert row[P.VALUE] == pytest.approx(-4 * gap / (nhat @ d), rel=1e-12)
        np.testing.assert_allclose(row[P.NORMAL : P.NORMAL + 3], -nhat, rtol=0, atol=1e-12)
        p = row[P.TOUCHING : P.TOUCHING + 3]
        assert abs(nhat @ p - offset) < 1e-12
        moved = X_WA.copy()
        moved[:3, 3] += row[P.VALUE] * d / 4
        assert abs(support_heights(shape, moved, -nhat[None])[0] + offset) < 1e-12


@pytest.mark.plain_kernels
def test_the_entry_by_itself():
    """The kernel is called as Python on what the row was made of."""
    box = collide.Box((2, 2, 2))
    pairs = posed_sides(box, FLOOR, collide.pose((0.5, 0, 4))[None], np.eye(4)[None], 1).all_pairs(np.arange(1))
    ints_at, numbers_at = pairs.parts.table.addresses
    ints, numbers = view_i64(ints_at, 2 * INTS), view_f64(numbers_at, 2 * NUMBERS)
    poses, (pa, pb) = pairs.parts.poses.rows.ravel(), pairs.pairs[0].tolist()
    assert len(poses) == 2 * POSE
    sa, sb = pairs.parts.shape_of[[pa, pb]].tolist()
    pair = posed_pair(ints, numbers, poses, sa, pa, sb, pb)
    size, slop, _ = size_and_slop(numbers, poses, sa, pa, sb, pb)
    assert slop == 0.0 and size > 4.0
    for d, limit, status in (((0, 0, -0.5), math.inf, HIT), ((0, 0, -0.5), 5.9, MISS), ((0, 0, -0.5), 6.0, OPEN),
                             ((0.5, 0, 0), math.inf, LEVEL), ((0.5, 0, 0.25), math.inf, MISS)):
        met = cast_onto_plane(pair, Vec3(*map(float, d)), size, slop, limit)
        assert met.status == status, (d, limit)
        if status in (HIT, OPEN):
            assert met.lower <= 6.0 <= met.upper and met.upper - met.lower <= 16.0 * ERROR * size
    inside = cast_onto_plane(pair._replace(t=Vec3(-0.5, 0.0, 0.0)), Vec3(0.0, 0.0, 0.5), size, slop, math.inf)
    assert inside.status == BEHIND and inside.lower < 0.0 and inside.upper == -1.0
