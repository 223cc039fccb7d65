"""Manifolds of convex polytopes judged by fractions and by naive clipping: brackets, features, reduction."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from contact_oracle import failures_of_convex
from naive_triangles import cross, inner, minus, world_points

import collide
from collide.contact.support_face import EDGE, FACE, VERTEX
from collide.hull.exact_hull import convex_hull

EYE = np.eye(4)


def prism(rng, n: int) -> np.ndarray:
    """Corners of a prism over a regular n-gon; its ends are coplanar exactly."""
    angles = 2 * np.pi * np.arange(n) / n
    ring = np.round(np.stack([np.cos(angles), np.sin(angles)], axis=1), 6) * rng.uniform(0.2, 0.6)
    return np.concatenate([np.column_stack([ring, np.full(n, z)]) for z in (-0.25, 0.25)])


def polytope(rng) -> collide.ConvexHull | collide.Box:
    kind = rng.integers(4)
    if kind == 0:
        return collide.Box(rng.uniform(0.2, 1.0, 3))
    if kind == 1:
        return collide.ConvexHull(prism(rng, int(rng.integers(3, 12))))
    if kind == 2:  # a box turned and rounded: its faces are flat but for rounding
        R = collide.pose((0, 0, 0), rpy=rng.uniform(-3, 3, 3))[:3, :3]
        return collide.ConvexHull(np.array(list(itertools.product((-0.3, 0.4), repeat=3))) @ R.T)
    return collide.ConvexHull(rng.normal(size=(int(rng.integers(6, 20)), 3)) * 0.3)


def points_of(shape) -> np.ndarray:
    if isinstance(shape, collide.Box):
        return np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * shape.size
    return shape.points


def face_to_face(rng):
    """Two polytopes with a face of each nearly against each other: (A, B, X_WA, X_WB)."""
    A, B = polytope(rng), polytope(rng)
    X_WA = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))
    planes = []
    for shape in (A, B):
        points = points_of(shape)
        facets = convex_hull(points).facets
        T = points[facets[rng.integers(len(facets))]]
        n = np.cross(T[1] - T[0], T[2] - T[0])
        planes.append((n / np.linalg.norm(n), T.mean(axis=0)))
    (n_a, p_a), (n_b, p_b) = planes
    n, p = X_WA[:3, :3] @ n_a, X_WA[:3, :3] @ p_a + X_WA[:3, 3]
    # Turn B so that its face looks against A's, then about the normal, then a little out of it.
    axis = np.cross(n_b, -n)
    if np.linalg.norm(axis) > 1e-12:
        sine, cosine = np.linalg.norm(axis), float(n_b @ -n)
        R = _turn(axis / sine, np.arctan2(sine, cosine))
    else:
        R = np.eye(3) if n_b @ -n > 0 else _turn(np.linalg.svd(n[None])[2][-1], np.pi)
    tilt = float(rng.choice([0.0, 1e-9, 1e-4, 1e-2, 0.2]))
    R = _turn(rng.permutation(np.eye(3))[0], tilt) @ _turn(n, rng.uniform(-3, 3)) @ R
    X_WB = np.eye(4)
    X_WB[:3, :3] = R
    X_WB[:3, 3] = p - R @ p_b + n * float(rng.choice([-1e-3, -1e-6, 0.0, 1e-6, 1e-3]))
    return A, B, X_WA, X_WB


def _turn(axis, angle):
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def height(T, place, n) -> Fraction | None:
    """t such that place + t n is in the plane of a triangle of fractions; None where that is steep."""
    normal = cross(minus(T[1], T[0]), minus(T[2], T[0]))
    slope = inner(normal, n)
    if 4 * slope * slope < inner(normal, normal):
        return None
    return inner(normal, minus(T[0], place)) / slope


def test_gaps_are_those_of_the_planes_named():
    """At each point, the two hull triangles named are so far apart along the normal, in fractions."""
    judged = several = 0
    for seed in range(250):
        A, B, X_WA, X_WB = face_to_face(np.random.default_rng(seed))
        where = f"face_to_face(np.random.default_rng({seed}))"
        triangles = [points_of(S)[convex_hull(points_of(S)).facets] for S in (A, B)]
        c = collide.contacts(A, B, X_WA, X_WB, margin=0.02, max_contacts=64)
        several += len(c) > 2
        for row in c:
            if row["feature_a"] % 4 == EDGE and row["feature_b"] % 4 == EDGE and len(c) == 1:
                continue  # edges that cross: no face is across the normal
            n = [Fraction(v) for v in row["normal"].tolist()]
            place = [Fraction(v) for v in row["point_a"].tolist()]
            T, S = (
                world_points(triangle[row[f"facet_{side}"]], X)
                for triangle, side, X in zip(triangles, "ab", (X_WA, X_WB))
            )
            heights = height(T, place, n), height(S, place, n)
            if None in heights:
                continue
            gap, slack = heights[1] - heights[0], Fraction(1, 10**14)  # the place itself is rounded
            assert row["lower"] - slack <= gap <= row["upper"] + slack, (where, float(gap), row)
            assert row["upper"] - row["lower"] < 1e-9
            judged += 1
    assert judged > 500 and several > 150


def shadow(shape, X, n, c, side):
    """Polygon (k, 2) of the face named, seen along n, counter-clockwise; from the naive hull of its coplanar points."""
    points = points_of(shape)
    T = points[convex_hull(points).facets[c[f"facet_{side}"]]]
    normal = np.cross(T[1] - T[0], T[2] - T[0])
    normal /= np.linalg.norm(normal)
    flat = points[np.abs((points - T[0]) @ normal) < 1e-9]
    e = np.linalg.svd(n[None])[2][1:]
    if np.linalg.det(np.vstack([e, n])) < 0:
        e = e[::-1]
    q = (flat @ X[:3, :3].T + X[:3, 3]) @ e.T
    centre = q.mean(axis=0)
    return q[np.argsort(np.arctan2(*(q - centre).T[::-1]))], e


def naive_overlap_area(P, Q) -> float:
    """Area of the overlap of two convex polygons: all corners and crossings that lie in both, in order."""
    def inside(p, polygon):
        d = np.roll(polygon, -1, axis=0) - polygon
        w = p - polygon
        return (d[:, 0] * w[:, 1] - d[:, 1] * w[:, 0] >= -1e-12).all()

    points = [p for p in P if inside(p, Q)] + [q for q in Q if inside(q, P)]
    for a, b in zip(P, np.roll(P, -1, axis=0)):
        for c, d in zip(Q, np.roll(Q, -1, axis=0)):
            M = np.column_stack([b - a, c - d])
            if abs(np.linalg.det(M)) > 1e-14:
                s, t = np.linalg.solve(M, c - a)
                if 0 <= s <= 1 and 0 <= t <= 1:
                    points.append(a + s * (b - a))
    return polygon_area(np.array(points)) if len(points) > 2 else 0.0


def polygon_area(p) -> float:
    p = p[np.argsort(np.arctan2(*(p - p.mean(axis=0)).T[::-1]))]
    x, y = p.T
    return 0.5 * abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()))


def test_all_of_the_overlap_is_there():
    """With room for all contacts and a wide margin they span the whole overlap of the two faces."""
    judged = 0
    for seed in range(200):
        A, B, X_WA, X_WB = face_to_face(np.random.default_rng(seed))
        c = collide.contacts(A, B, X_WA, X_WB, margin=3.0, max_contacts=100)
        if len(c) < 3 or (c.feature_a % 4 == EDGE).all() or (c.feature_b % 4 == EDGE).all():
            continue
        n = c.normal[0]
        P, e = shadow(A, X_WA, n, c.rows[0], "a")
        Q, _ = shadow(B, X_WB, n, c.rows[0], "b")
        area = naive_overlap_area(P, Q)
        spanned = polygon_area(c.point @ e.T)
        assert abs(area - spanned) < 1e-6 * max(area, 1e-3), (seed, area, spanned)
        judged += 1
    assert judged > 100


def test_features_name_what_meets():
    """A vertex named is where the contact is; names stay when the bodies move by less than the eye sees."""
    vertices = steady = moved = 0
    for seed in range(120):
        A, B, X_WA, X_WB = face_to_face(np.random.default_rng(1000 + seed))
        c = collide.contacts(A, B, X_WA, X_WB, margin=0.02)
        for row in c:
            for side, shape, X in (("a", A, X_WA), ("b", B, X_WB)):
                assert row[f"feature_{side}"] % 4 in (VERTEX, EDGE, FACE)
                if row[f"feature_{side}"] % 4 == VERTEX:
                    p = points_of(shape)[row[f"feature_{side}"] // 4] @ X[:3, :3].T + X[:3, 3]
                    assert np.abs(p - row[f"point_{side}"]).max() < 1e-6
                    vertices += 1
        keys = {(row["feature_a"], row["feature_b"]) for row in c}
        assert len(keys) == len(c), f"two contacts of one name: seed {1000 + seed}"
        X = X_WB.copy()
        X[:3, 3] += 1e-9
        d = collide.contacts(A, B, X_WA, X, margin=0.02)
        moved += len(c) > 2
        steady += len(c) > 2 and keys == {(row["feature_a"], row["feature_b"]) for row in d}
    assert vertices > 200 and moved > 60 and steady > 0.8 * moved


@pytest.mark.parametrize("most", [1, 2, 3, 4, 5])
def test_reduction_keeps_the_deepest_and_the_area(most):
    A, B = collide.Box(1, 1, 1), collide.ConvexHull(prism(np.random.default_rng(0), 11))
    for seed in range(20):
        rng = np.random.default_rng(seed)
        X_WB = collide.pose((*rng.uniform(-0.6, 0.6, 2), 0.749), rpy=(*rng.normal(size=2) * 1e-4, rng.uniform(-3, 3)))
        full = collide.contacts(A, B, EYE, X_WB, margin=0.01, max_contacts=64)
        few = collide.contacts(A, B, EYE, X_WB, margin=0.01, max_contacts=most)
        assert len(few) == min(most, len(full))
        assert few.distance[0] == full.distance[0] == full.distance.min()
        rows = {row.tobytes() for row in full.rows}
        assert all(row.tobytes() in rows for row in few.rows)
        if most >= 3 and len(full) > most:
            best = max(
                polygon_area(full.point[list(some)][:, :2]) for some in itertools.combinations(range(len(full)), most)
            )
            assert polygon_area(few.point[:, :2]) > 0.6 * best, (seed, most)


def test_exchanging_the_bodies_exchanges_the_columns():
    for seed in range(60):
        A, B, X_WA, X_WB = face_to_face(np.random.default_rng(seed))
        c, d = collide.contacts(A, B, X_WA, X_WB, margin=0.01), collide.contacts(B, A, X_WB, X_WA, margin=0.01)
        assert len(c) == len(d)
        for field, opposite in (("point", "point"), ("facet", "facet"), ("feature", "feature")):
            assert np.array_equal(c.rows[f"{field}_a"], d.rows[f"{opposite}_b"]), seed
            assert np.array_equal(c.rows[f"{field}_b"], d.rows[f"{opposite}_a"]), seed
        assert np.array_equal(c.distance, d.distance) and np.array_equal(c.normal, 0.0 - d.normal)


def judged(A, B, X_WA, X_WB, margin):
    """Rows of contacts, which the judge finds right."""
    rows = collide.contacts(A, B, X_WA, X_WB, margin=margin).rows
    failures = failures_of_convex(A, B, X_WA, X_WB, margin, rows, collide.distance(A, B, X_WA, X_WB))
    assert not failures, "; ".join(failures)
    return rows


_OFF = 1e-14 * np.array([[-1, -2, -1], [-2, -1, -1], [0, 2, -2], [-1, 1, -2]])
#: A nearly collinear hull's normal leant by up to 2.5e-3: rows with false brackets, and a gap told as an overlap.
NEEDLES = [
    (collide.ConvexHull([[-0.4, 0.8, -0.6], [-0.3, 0.6, 0.5]]),
     collide.ConvexHull(np.outer([-0.5, 0, -0.375, -0.125], [4, -8, 9]) / 8 + _OFF), EYE, 0.5, 0.3212176887586335),
    (collide.Box((1, 1, 1)), collide.ConvexHull(np.outer([-0.2, 0.3, 0.7], [0.1, 0.7, 0.3])),
     collide.pose((-0.5, 0.6, -0.3), rpy=(-1.1, 0, 1.3)), 0.2, 0.0494379204379737),
]


@pytest.mark.parametrize(("A", "B", "X_WB", "margin", "gap"), NEEDLES)
def test_hulls_that_are_lines_but_for_rounding_are_lines(A, B, X_WB, margin, gap):
    rows = judged(A, B, EYE, X_WB, margin)
    assert abs(rows["distance"][0] - gap) < 1e-15 and rows["lower"].min() > gap - 1e-12


def test_no_row_of_a_sliver_lies_beyond_the_margin():
    """Its flatness was added to the margin: a row lay 0.22 beyond 0."""
    needle = collide.ConvexHull(np.outer([-0.7, 0.1, 0.9], [-3, -5, -4]) / 8)
    X_WB = collide.pose((0, 0.21951219512195116, -0.724390243902439))
    assert len(judged(needle, collide.Box((1, 1, 1)), EYE, X_WB, 0.0)) == 1


def test_sides_of_a_sliver_end_at_its_tips():
    """Moved out by a tolerance, the sides of a sharp triangle meet far beyond its tip: an edge had a row there."""
    for width in (1e-3, 1e-6, 1e-9, 1e-12):
        A = collide.ConvexHull([[0, 0, 0], [1, width, 0], [1, -width, 0]])
        B = collide.ConvexHull([[-3e-15 / width, -1, 1e-3], [-3e-15 / width, 1, 1e-3]])
        judged(A, B, EYE, EYE, 0.1)


GROUNDS = [
    collide.Halfspace((0, 0, 1), 0.0), collide.Box((4, 4, 1)),
    collide.ConvexHull([[-2, -2, 0], [2, -2, 0], [0, 3, 0.0]]),
]


@pytest.mark.parametrize("other", GROUNDS)
def test_rows_of_swept_bodies_lie_on_their_surface(other):
    """Moved by the radius along the normal, the second end of a capsule that leans by 0.7 lay 0.235 inside it."""
    bodies = [
        collide.Capsule(0.3, 1.0), collide.ConvexHull([[-0.5, 0, 0], [0.5, 0, 0], [0, 0.6, 0.1]], radius=0.2),
        collide.ConvexHull(list(itertools.product((-0.3, 0.3), repeat=3)), radius=0.1),
    ]
    several = 0
    for body, lean in itertools.product(bodies, (1e-9, 1e-4, 0.05, 0.3, 0.7)):
        X_WB = collide.pose((0, 0.1, 1.0), rpy=(0.5 * np.pi + lean, 0.3 * lean, 0.4))
        X_WB[2, 3] -= collide.distance(other, body, EYE, X_WB).distance + 1e-3
        several += len(judged(other, body, EYE, X_WB, 1.5)) > 1
    assert several >= 12, several


def test_both_ends_of_a_line_along_an_edge_are_there():
    """A capsule or a cylinder along an edge of a box or of its hull, turned by a hair about the normal: one half lies
    over one face, the other over another."""
    size, corners = np.array([1.0, 0.5, 0.5]), np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    beside = np.concatenate([corners, [[-0.1, 0.5, 0.5], [0.2, 0.5, 0.5]]]) * size
    turned = collide.pose((0, 0, 0), rpy=(0.3, -1.1, 2.0))
    for angle, lean, gap, body in itertools.product(
        (0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-4), (-0.5, 0.0, 0.3), (-1e-3, 0.0, 1e-9),
        (collide.Capsule(0.1, 0.6), collide.Cylinder(0.1, 0.6)),
    ):
        out = np.array([0.0, np.cos(np.pi / 4 + lean), np.sin(np.pi / 4 + lean)])
        along = np.cos(angle) * np.eye(3)[0] + np.sin(angle) * np.cross(out, np.eye(3)[0])
        X_WB = np.eye(4)
        X_WB[:3, :3] = np.stack([out, np.cross(along, out), along], axis=1)
        X_WB[:3, 3] = size * (0, 0.5, 0.5) + (0.1 + gap) * out
        hull = collide.ConvexHull(beside @ turned[:3, :3].T)
        for A, X in ((collide.Box(size), EYE), (hull, turned)):
            rows = judged(A, body, EYE, X @ X_WB, 1e-6)
            ends = rows["point_b"] @ (X[:3, :3] @ along)
            assert abs(np.ptp(ends) - 0.6) < 1e-6, (angle, lean, gap, body, A, rows["distance"])
