"""Distances of polygons: within their bounds of fractions over all corners and edges, points and normals too."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from planar_families import FAMILIES, magnitudes, pose_at
from planar_oracle import polygons_meet_exactly, squared_depth, squared_distance
from reproduction import reproducing

from collide import ConvexPolygon
from collide.polytopes import planar_pose, polygon_distance

AGAIN = """import numpy as np
from collide.polytopes import ConvexPolygon, polygon_distance
r = polygon_distance(ConvexPolygon({A}), ConvexPolygon({B}), np.array({X_WA}), np.array({X_WB}))
print(r.hit, r.distance, r.lower, r.upper, r.normal, r.point_a, r.point_b)"""


def size_of(A, B, X_WA, X_WB) -> float:
    shift = np.abs(X_WB[:2, 2] - X_WA[:2, 2]).sum()
    return float(sum(np.abs(p.vertices).max(axis=0).sum() for p in (A, B)) + shift)


def farthest(polygon, X, direction) -> float:
    return float(((polygon.vertices @ X[:2, :2].T + X[:2, 2]) @ direction).max())


def outside(polygon, X, point) -> float:
    """How far a point lies outside of a polygon, at least; below 0 inside."""
    corners = polygon.vertices @ X[:2, :2].T + X[:2, 2]
    edges = np.roll(corners, -1, axis=0) - corners
    edges = edges[edges.any(axis=1)]
    if len(corners) < 3:
        return float(max(*(corners.min(axis=0) - point), *(point - corners.max(axis=0))))
    normals = np.c_[edges[:, 1], -edges[:, 0]] / np.hypot(*edges.T)[:, None]
    return float((normals * (point - corners)).sum(axis=1).max())


@pytest.mark.many(6)
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_within_bounds_of_fractions(family):
    rng = np.random.default_rng(11)
    cases = [family(rng) for _ in range(70)]
    A, B = ([ConvexPolygon(case[k]) for case in cases] for k in range(2))
    X_WA, X_WB = (np.array([case[k] for case in cases]) for k in (2, 3))
    r = polygon_distance(A, B, X_WA, X_WB)
    for k in range(len(cases)):
        pair = A[k], B[k], X_WA[k], X_WB[k]
        with reproducing(AGAIN, A=A[k].vertices, B=B[k].vertices, X_WA=X_WA[k], X_WB=X_WB[k]):
            corners = A[k].vertices, B[k].vertices, X_WA[k], X_WB[k]
            hit = polygons_meet_exactly(*corners)
            assert r.hit[k] == hit and (r.distance[k] <= 0.0 if hit else r.distance[k] >= 0.0)
            square = squared_depth(*corners) if hit else squared_distance(*corners)
            low, high = (-r.upper[k], -r.lower[k]) if hit else (r.lower[k], r.upper[k])
            assert low >= 0.0 and low**2 * (1 - 1e-15) <= square <= high**2 * (1 + 1e-15)
            size = size_of(*pair)
            assert r.upper[k] - r.lower[k] <= 1e-13 * size
            normal = r.normal[k]
            assert abs(np.hypot(*normal) - 1.0) < 1e-14
            away = r.point_b[k] - r.point_a[k] - r.distance[k] * normal
            assert np.abs(away).max() <= 1e-13 * (size + np.abs(X_WA[k][:2, 2]).max())
            for polygon, X, point in ((A[k], X_WA[k], r.point_a[k]), (B[k], X_WB[k], r.point_b[k])):
                assert outside(polygon, X, point) <= 1e-13 * (size + np.abs(X_WA[k][:2, 2]).max())
            # Moved by −distance · normal, B lies beyond all of A along the normal.
            if r.distance[k] < -1e-12 * size or r.distance[k] > 1e-6 * size:
                beyond = -farthest(B[k], X_WB[k], -normal) - farthest(A[k], X_WA[k], normal)
                assert abs(beyond - r.distance[k]) <= 1e-12 * size + 1e-13 * np.abs(X_WA[k][:2, 2]).max()
    if family is not magnitudes:
        assert r.hit.any()


def test_large_polygons_equal_a_naive_loop():
    """Gaps and depths of two hundred corners against all corners and edges in numpy."""
    rng = np.random.default_rng(4)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 200))
    A = ConvexPolygon(np.c_[np.cos(angles), 0.5 * np.sin(angles)])
    B = ConvexPolygon(np.c_[0.3 * np.cos(angles), np.sin(angles)])
    X_WBs = np.array([pose_at(rng.uniform(-2, 2, 2), rng.uniform(0, 7)) for _ in range(30)])
    r = polygon_distance(A, B, planar_pose(), X_WBs)
    assert 6 < r.hit.sum() < 27
    for k, X_WB in enumerate(X_WBs):
        p, q = A.vertices, B.vertices @ X_WB[:2, :2].T + X_WB[:2, 2]
        if r.hit[k]:
            depths = []
            for a, b in ((p, q), (q, p)):
                edges = np.roll(a, -1, axis=0) - a
                out = np.c_[edges[:, 1], -edges[:, 0]] / np.hypot(*edges.T)[:, None]
                depths.append(((out * a).sum(axis=1) - (b @ out.T).min(axis=0)).min())
            assert abs(r.distance[k] + min(depths)) < 1e-13
        else:
            both = []
            for a, b in ((p, q), (q, p)):
                edges = np.roll(a, -1, axis=0) - a
                t = np.einsum("ijk,jk->ij", b[:, None] - a[None], edges) / (edges**2).sum(axis=1)
                near = a[None] + np.clip(t, 0, 1)[..., None] * edges[None]
                both.append(np.linalg.norm(near - b[:, None], axis=2).min())
            assert abs(r.distance[k] - min(both)) < 1e-13


def test_closed_forms():
    square = ConvexPolygon([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    r = polygon_distance(square, square, planar_pose(), planar_pose((3, 0.5)))
    assert (r.distance, r.hit, r.normal.tolist()) == (1.0, False, [1.0, 0.0])
    assert (r.point_a[0], r.point_b[0]) == (1, 2)
    r = polygon_distance(square, square, planar_pose(), planar_pose((0.5, 1.75)))
    assert (r.distance, r.normal.tolist()) == (-0.25, [0.0, 1.0]) and repr(r) == "PolygonDistances(-0.25 m)"
    r = polygon_distance(square, square, planar_pose(), planar_pose((5, 4)))
    assert abs(r.distance - np.hypot(3, 2)) < 1e-15 and r.point_a.tolist() == [1, 1] and r.point_b.tolist() == [4, 3]
    r = polygon_distance(square, square, planar_pose(), planar_pose((2, 0)))
    assert (r.distance, r.hit, r.lower <= 0.0 <= r.upper) == (0.0, True, True)
    point = ConvexPolygon([(0.5, 0)])
    assert polygon_distance(square, point, planar_pose(), planar_pose()).distance == -0.5
    assert polygon_distance(point, point, planar_pose(), planar_pose()).distance == 0.0


def test_polygons_a_hair_apart_have_a_positive_lower_bound():
    """Vertices put on edges and on vertices, in doubles: what is apart exactly is proven so, within fractions."""
    rng = np.random.default_rng(77)
    A, B, X_WA, X_WB = [], [], [], []
    for k in range(1500):
        corners = rng.normal(size=(int(rng.integers(3, 8)), 2))
        polygon, other = ConvexPolygon(corners), ConvexPolygon(rng.normal(size=(int(rng.integers(1, 6)), 2)))
        X, Y = (pose_at(rng.normal(size=2), rng.uniform(0, 7)) for _ in "AB")
        edge = (polygon.vertices[:2] if k % 3 else polygon.vertices[[0, 0]]) @ X[:2, :2].T + X[:2, 2]
        out = np.array([edge[1, 1] - edge[0, 1], edge[0, 0] - edge[1, 0]]) if k % 3 else edge[0] - X[:2, 2]
        turned = other.vertices @ Y[:2, :2].T
        first = int(np.argmin(turned @ out))
        Y[:2, 2] = edge[0] + rng.uniform() * (edge[1] - edge[0]) - turned[first]
        A.append(polygon), B.append(other), X_WA.append(X), X_WB.append(Y)
    X_WA, X_WB = np.array(X_WA), np.array(X_WB)
    r = polygon_distance(A, B, X_WA, X_WB)
    apart = np.flatnonzero(~r.hit)
    hair = apart[r.distance[apart] < 1e-14]
    assert len(hair) > 150, len(hair)
    assert (r.lower[apart] > 0.0).all() and (r.distance[apart] >= r.lower[apart]).all()
    assert (r.distance <= r.upper).all() and (r.lower <= r.distance).all()
    tight = 0
    for k in hair[:120].tolist():
        with reproducing(AGAIN, A=A[k].vertices, B=B[k].vertices, X_WA=X_WA[k], X_WB=X_WB[k]):
            square = squared_distance(A[k].vertices, B[k].vertices, X_WA[k], X_WB[k])
            assert Fraction(float(r.lower[k])) ** 2 <= square <= Fraction(float(r.upper[k])) ** 2
            assert abs(np.hypot(*r.normal[k]) - 1.0) < 1e-14
            tight += Fraction(float(r.lower[k])) ** 2 >= square * (1 - Fraction(1, 10**6))
    assert tight > 60, "bounds across the nearest features are the gap to six digits and more"


def test_what_double_doubles_leave_open_the_line_that_parts_them_tells():
    """A corner beside an edge of 2⁵³ m, both in integers: the gap is 2⁻⁵³ m, 2⁻¹⁰⁶ of the size."""
    big = 2.0**52
    edge = ConvexPolygon([(-big, -big + 1), (big, big - 1)])
    # x (big − 1) − y big, over 2 big: the corner (big / 2, …) is off the line by a fraction of a unit
    corner = ConvexPolygon([(big - 1, big - 2)])
    r = polygon_distance(edge, corner, planar_pose(), planar_pose())
    square = squared_distance(edge.vertices, corner.vertices, planar_pose(), planar_pose())
    assert not r.hit and 0 < square < 1e-30
    assert 0.0 < r.lower <= r.distance <= r.upper and Fraction(r.lower) ** 2 <= square <= Fraction(r.upper) ** 2
