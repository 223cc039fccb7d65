"""The point of a simplex nearest the origin, against the exact one in Fractions; what the simplex's faces prove."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact_simplex import determinant, exact, inner, nearest_to_origin, solved
from naive import rng_of
from reproduction import reproducing

from collide.narrowphase.gjk import simplex as S
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.numerics.vec3 import Vec3

pytestmark = pytest.mark.plain_kernels

SOURCE = "corners = {corners}  # tests/narrowphase/gjk/test_simplex.py"
ALL_FACES = 15
ULP = 2.0**-52


def rows_of(corners) -> list[float]:
    """Corners as GJK keeps them: POINT doubles each, the difference first."""
    rows = [0.0] * (POINT * len(corners))
    for k, corner in enumerate(np.asarray(corners, dtype=float).tolist()):
        rows[POINT * k : POINT * k + 3] = corner
    return rows


def corners_of(rng, n: int, kind: str) -> np.ndarray:
    corners = rng.normal(size=(n, 3))
    if kind == "around the origin":
        corners -= corners.mean(axis=0) + 0.02 * rng.normal(size=3)
    elif kind == "lattice":
        corners = rng.integers(-2, 3, size=(n, 3)) * 0.5
    elif kind == "thin":  # within 1e-13 of a plane near the origin
        corners[:, 2] = 1e-13 * rng.normal(size=n)
        corners = corners @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    elif kind == "needle":
        corners = corners[:1] * np.linspace(0.5, 1.5, n)[:, None] + 1e-9 * rng.normal(size=(n, 3))
    elif kind == "far":
        corners += rng.normal(size=3) * 100.0
    elif kind == "tiny":
        corners *= 1e-60
    return corners


KINDS = ("random", "around the origin", "lattice", "thin", "needle", "far", "tiny")


def nearest(corners, faces: int = ALL_FACES) -> tuple[float, list[float], list[float]]:
    weights = [0.0] * 7
    square = S.nearest_in_simplex(rows_of(corners), len(corners), weights, faces)
    return square, weights[:4], weights[4:]


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_nearest_point(n, kind):
    """A convex combination, so never nearer than the nearest point; and as near as rounding allows."""
    rng = rng_of("nearest in simplex", n, kind)
    features: Counter = Counter()
    for _ in range(60):
        corners = corners_of(rng, n, kind)
        if n == 4 and least_depth(exact(corners)) is not None:
            continue  # the origin is inside: not asked then
        with reproducing(SOURCE, corners=corners):
            square, weights, point = nearest(corners)
            true, size = nearest_to_origin(corners), float(np.abs(corners).max()) or 1.0
            assert min(weights) >= 0.0 and abs(sum(weights) - 1.0) <= 4 * ULP and not any(weights[n:])
            for axis in range(3):
                combined = sum(Fraction(w) * Fraction(float(c[axis])) for w, c in zip(weights, corners))
                assert abs(combined - Fraction(point[axis])) <= 8 * ULP * size
            length = math.sqrt(square)
            assert abs(length - math.hypot(*point)) <= 4 * ULP * length
            assert length >= float(true.square) ** 0.5 - 8 * ULP * size
            assert length <= float(true.square) ** 0.5 + (1e-6 if kind in ("thin", "needle") else 1e-13) * size
        features[sum(w > 0.0 for w in weights)] += 1
    assert n == 1 or len(features) >= 2 or kind in ("around the origin", "needle"), features


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["random", "around the origin", "lattice", "thin", "far"])
def test_faces_in_sight_prove_what_they_leave_out(kind):
    """A face that is left out holds no nearest point; where all four are, the origin is as deep as said, wherever the
    corners are within their error."""
    rng = rng_of("faces in sight", kind)
    seen: Counter = Counter()
    for _ in range(120):
        corners = corners_of(rng, 4, kind)
        error = float(rng.choice([0.0, 1e-12, 1e-2]))
        with reproducing(SOURCE + "; error = {error}", corners=corners, error=error):
            faces, clearance = S.faces_in_sight(rows_of(corners), error)
            points = exact(corners)
            depth = least_depth(points)
            if faces == 0:
                assert depth is not None and Fraction(error) < Fraction(clearance)
                assert Fraction(clearance) ** 2 <= depth * (1 + Fraction(1, 10**14))
                seen["inside"] += 1
                continue
            assert clearance == -1.0
            true = nearest_to_origin(corners).square
            kept = [nearest_to_origin(np.delete(corners, k, axis=0)).square for k in range(4) if faces >> k & 1]
            if depth is None:
                assert min(kept) == true
            seen["some left out" if faces != ALL_FACES else "all kept"] += 1
    wanted = {
        "random": ["some left out"],
        "around the origin": ["inside", "some left out"],
        "far": ["some left out"],
        "lattice": ["some left out"],
        "thin": ["all kept"],
    }
    assert all(seen[what] >= 10 for what in wanted[kind]), seen


def least_depth(points) -> Fraction | None:
    """Squared distance of an origin strictly inside four points from their faces' planes; None elsewhere."""
    a, b, c, d = points
    whole = determinant(*([x - y for x, y in zip(p, a)] for p in (b, c, d)))
    squares = []
    for p, q, r in ((b, c, d), (a, d, c), (a, b, d), (a, c, b)):
        part = determinant(p, q, r)
        if whole == 0 or part * whole <= 0:
            return None
        e, f = [x - y for x, y in zip(q, p)], [x - y for x, y in zip(r, p)]
        n = [e[(k + 1) % 3] * f[(k + 2) % 3] - e[(k + 2) % 3] * f[(k + 1) % 3] for k in range(3)]
        squares.append(part**2 / inner(n, n))
    return min(squares)


def test_face_weights_are_barycentric():
    rng = rng_of("face weights")
    for _ in range(100):
        corners, at = corners_of(rng, 3, "random"), rng.normal(size=3)
        with reproducing(SOURCE, corners=corners):
            found = S.face_weights(*(Vec3(*corner) for corner in corners.tolist()), Vec3(*at.tolist()))
            a, b, c = exact(corners)
            e, f, w = ([x - y for x, y in zip(p, a)] for p in (b, c, exact([at])[0]))
            beta, gamma = solved([[inner(e, e), inner(e, f)], [inner(e, f), inner(f, f)]], [inner(w, e), inner(w, f)])
            thinness = float(inner(e, e) * inner(f, f) / (inner(e, e) * inner(f, f) - inner(e, f) ** 2))
            for value, true in zip(found, (1 - beta - gamma, beta, gamma)):
                assert abs(value - float(true)) <= 1e-13 * thinness * (1 + max(map(abs, found)))
    collinear = [(0.0, 1.0, 2.0), (1.0, 2.0, 3.0), (2.0, 3.0, 4.0)]
    assert S.face_weights(*(Vec3(*corner) for corner in collinear), Vec3(0.5, 0.5, 0.5)) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("n", [2, 3])
def test_directions_across_features(n):
    """Orthogonal to the feature to rounding, and on the side of the direction that was there."""
    rng = rng_of("across", n)
    for _ in range(100):
        corners = corners_of(rng, n, "random")
        v = nearest_to_origin(corners - 0.0).point if n == 2 else tuple(map(Fraction, rng.normal(size=3).tolist()))
        v = [float(x) for x in v]
        with reproducing(SOURCE + "; v = {v}", corners=corners, v=v):
            direction = np.array(S.across_simplex(rows_of(corners), n, Vec3(*v)))
            edges = corners[1:] - corners[0]
            lengths = np.linalg.norm(edges, axis=1) * np.linalg.norm(direction)
            assert (np.abs(edges @ direction) <= 16 * ULP * lengths * (1 + np.linalg.norm(v))).all()
            assert direction @ v >= 0.0
    flat = rows_of([(0.0, 1.0, 2.0), (1.0, 2.0, 3.0), (2.0, 3.0, 4.0)])
    assert S.across_simplex(flat, 3, Vec3(0.1, 0.2, 0.3)) == (0.1, 0.2, 0.3)


@pytest.mark.parametrize("height", [1.0, 1e-5, 1e-12])
def test_weights_of_an_enclosed_origin(height):
    """Weights ≥ 0 of sum 1 whose point misses the origin by no more than is said, and by little even of thin
    tetrahedra."""
    rng = rng_of("weigh enclosed", height)
    cases = 0
    while cases < 60:
        corners = corners_of(rng, 4, "around the origin") * (1.0, 1.0, height)
        if least_depth(exact(corners)) is None:
            continue
        cases += 1
        with reproducing(SOURCE, corners=corners):
            weights = [0.0] * 4
            missed, size = S.weigh_enclosed(rows_of(corners), weights)
            assert min(weights) >= 0.0 and abs(sum(weights) - 1.0) <= 4 * ULP
            by = sum(
                abs(sum(Fraction(w) * Fraction(float(c[axis])) for w, c in zip(weights, corners))) for axis in range(3)
            )
            assert by <= missed + 8 * ULP * size and missed <= 8 * ULP * size
    flat = corners_of(rng, 4, "random") * (1.0, 1.0, 0.0)
    assert S.weigh_enclosed(rows_of(flat), [0.0] * 4)[0] == math.inf
