"""`Plane` with meshes and octrees, judged by fractions: every corner through an exact inverse of the plane's pose."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from collide.adapters.hosts import fcl_api as fcl

#: One eighth of the root of a tree of 16 levels, cut in two: boxes of 3276.8 times r.
TREES = (bytes([2, 0]), bytes([3, 0, 0, 0x80]), bytes([3, 0x80, 2, 0x82]))


def fractions(values) -> list:
    return [Fraction(x) for x in np.asarray(values).ravel().tolist()]


def exact_inverse(R) -> list[list[Fraction]]:
    """Of a matrix (3, 3), by elimination."""
    rows = [fractions(R[i]) + [Fraction(int(i == j)) for j in range(3)] for i in range(3)]
    for i in range(3):
        k = next(k for k in range(i, 3) if rows[k][i])
        rows[i], rows[k] = rows[k], rows[i]
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for k in range(3):
            if k != i:
                rows[k] = [x - rows[k][i] * y for x, y in zip(rows[k], rows[i])]
    return [row[3:] for row in rows]


def exact_heights(plane, body, corners: list) -> list[Fraction]:
    """n · X_WP⁻¹ X_WB q − d of corners q, each three fractions."""
    n, d, inverse = fractions(plane._geometry.n), Fraction(plane._geometry.d), exact_inverse(plane.getRotation())
    t, R, s = fractions(plane.getTranslation()), body.getRotation(), fractions(body.getTranslation())
    heights = []
    for q in corners:
        p = [sum(a * b for a, b in zip(fractions(row), q)) + s[k] - t[k] for k, row in enumerate(R)]
        heights.append(sum(n[i] * inverse[i][j] * p[j] for i in range(3) for j in range(3)) - d)
    return heights


def mesh_of(triangles: np.ndarray):
    model = fcl.BVHModel()
    model.beginModel()
    for triangle in triangles:
        model.addTriangle(*triangle)
    model.endModel()
    return model


def random_case(rng, k: int):
    """(plane, body, corners of each cell): poses that are rotations or turns by quarters, numbers on a grid or not."""
    on_grid = k % 2 == 0
    grid = (lambda x: np.round(4 * x) / 4) if on_grid else (lambda x: x)
    if k % 3 < 2:
        m = int(rng.integers(1, 6))
        triangles = grid(rng.uniform(-1, 1, (m, 1, 3)) + rng.uniform(-0.3, 0.3, (m, 3, 3)))
        cells = [[fractions(q) for q in triangle] for triangle in triangles]
        geometry = mesh_of(triangles)
    else:
        geometry = fcl.OcTree(2.0**-16 if on_grid else 1e-5, TREES[k % len(TREES)])
        cells = []
        for middle, half in zip(geometry._middles, geometry._half_edges[:, 0]):
            cells.append([[Fraction(m) + s * Fraction(float(half)) for m, s in zip(middle.tolist(), signs)]
                          for signs in np.ndindex(2, 2, 2) for signs in [[2 * s - 1 for s in signs]]])

    def pose():
        R = np.eye(3)[rng.permutation(3)] * rng.choice([-1.0, 1.0], 3) if on_grid else rng.normal(size=(3, 3))
        R = R if on_grid else np.linalg.qr(R)[0]
        return fcl.Transform(R * np.sign(np.linalg.det(R)), grid(rng.uniform(-1, 1, 3)))

    n = np.eye(3)[rng.integers(3)] if on_grid else rng.normal(size=3)
    plane = fcl.CollisionObject(fcl.Plane(n, float(grid(rng.uniform(-1, 1)))), pose())
    return plane, fcl.CollisionObject(geometry, pose()), cells


@pytest.mark.slow
def test_sides_are_exact():
    """Whether they meet, and how far apart they are, as fractions have it."""
    rng = np.random.default_rng(22)
    n_hits = n_apart = n_touching = n_both_sides = 0
    for k in range(450):
        plane, body, cells = random_case(rng, k)
        case = f"random_case(default_rng(22), …) number {k}"
        heights = [exact_heights(plane, body, cell) for cell in cells]
        if k % 5 == 4:  # the plane through a corner, to rounding: doubles alone do not know
            plane._geometry.d = float(Fraction(plane._geometry.d) + heights[0][0])
            heights = [exact_heights(plane, body, cell) for cell in cells]
        truth = any(min(h) <= 0 <= max(h) for h in heights)
        n_hits, n_apart = n_hits + truth, n_apart + (not truth)
        n_touching += truth and not any(min(h) < 0 < max(h) for h in heights)
        result = fcl.DistanceResult()
        pair = (plane, body) if k % 2 else (body, plane)
        assert bool(fcl.collide(*pair)) == truth, case
        gap = fcl.distance(*pair, fcl.DistanceRequest(True), result)
        assert result.o1 is body._geometry and result.o2 is plane._geometry, case
        on_body, on_plane = result.nearest_points
        n = plane.getRotation() @ plane._geometry.n
        d = plane._geometry.d + n @ plane.getTranslation()
        assert abs(n @ on_plane - d) < 1e-9, case
        if truth:
            assert gap == -1.0 and np.allclose(on_body, on_plane), case
            continue
        n_both_sides += len({h[0] > 0 for h in heights}) == 2
        assert math.isclose(gap, min(abs(h) for cell in heights for h in cell), abs_tol=1e-12), case
        assert math.isclose(np.linalg.norm(on_body - on_plane), gap, abs_tol=1e-9), case
    assert n_hits > 120 and n_apart > 80, (n_hits, n_apart)
    assert n_touching > 20 and n_both_sides > 15, (n_touching, n_both_sides)


def test_moving_planes_stop_at_the_nearer_side():
    """A plane between two facets meets the one that it flies towards, in fractions of the way."""
    above, below = np.array([[0.0, 0, 2], [1, 0, 2], [0, 1, 3]]), np.array([[0.0, 0, -1], [1, 0, -1.5], [0, 1, -1]])
    both = fcl.CollisionObject(mesh_of(np.array([above, below])))
    plane = fcl.CollisionObject(fcl.Plane(np.array([0.0, 0, 1]), 0.0))
    up, down = fcl.Transform([0.0, 0, 8.0]), fcl.Transform([0.0, 0, -8.0])
    for end, truth in ((up, 0.25), (down, 0.125)):
        for result in (fcl.ContinuousCollisionResult(),):
            time = fcl.continuousCollide(plane, end, both, fcl.Transform(), None, result)
            assert math.isclose(time, truth, abs_tol=1e-9) and result.is_collide
            assert math.isclose(fcl.continuousCollide(both, fcl.Transform(), plane, end), truth, abs_tol=1e-9)
    assert fcl.continuousCollide(plane, fcl.Transform([0.0, 0, 1.0]), both, fcl.Transform()) == 1.0


@pytest.mark.parametrize("tree", TREES)
def test_depths_clear_the_plane(tree):
    """Moving along a contact's normal by the depth of the deepest takes octree and plane apart."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        geometry = fcl.OcTree(2.0**-16, tree)
        body = fcl.CollisionObject(geometry, fcl.Transform(rng.normal(size=4), rng.uniform(-0.2, 0.2, 3)))
        plane = fcl.CollisionObject(fcl.Plane(rng.normal(size=3), rng.uniform(-0.2, 0.2)))
        result = fcl.CollisionResult()
        if not fcl.collide(body, plane, fcl.CollisionRequest(20, True), result):
            continue
        deepest = result.contacts[0]
        assert deepest.o1 is geometry and deepest.o2 is plane._geometry and deepest.b1 >= 0
        depth = fcl.distance(body, plane, fcl.DistanceRequest(True, True))
        assert math.isclose(deepest.penetration_depth, -depth, rel_tol=1e-9)
        body.setTranslation(body.getTranslation() - (deepest.penetration_depth + 1e-9) * deepest.normal)
        assert not fcl.collide(body, plane)
