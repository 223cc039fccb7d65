"""Contacts of half-spaces, spheres and capsules, whose rows take no search: brackets against sixty-digit decimals."""

from __future__ import annotations

from decimal import Decimal, getcontext
from fractions import Fraction

import numpy as np
import pytest

import collide

getcontext().prec = 60


def exact_points(shape, X) -> list[list[Fraction]]:
    """Corners of a box, or ends of a segment or its only point, in the world."""
    if isinstance(shape, collide.Box):
        half = [Fraction(v) / 2 for v in np.asarray(shape.size).tolist()]
        own = [[sx * half[0], sy * half[1], sz * half[2]] for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]
    else:
        half = Fraction(shape.length) / 2 if isinstance(shape, collide.Capsule) else Fraction(0)
        own = [[Fraction(0), Fraction(0), s * half] for s in ((-1, 1) if half else (1,))]
    return [[sum(Fraction(X[i, j]) * p[j] for j in range(3)) + Fraction(X[i, 3]) for i in range(3)] for p in own]


def root(square: Fraction) -> Decimal:
    return (Decimal(square.numerator) / Decimal(square.denominator)).sqrt()


def square_of_segments(a, b) -> Fraction:
    """Of the distance of two segments or points: least over ends on the other, and over the lines' nearest points."""
    def sub(p, q):
        return [x - y for x, y in zip(p, q)]

    def dot(p, q):
        return sum(x * y for x, y in zip(p, q))

    def of_point(p, s):
        u = sub(s[-1], s[0])
        t = min(max(dot(sub(p, s[0]), u) / dot(u, u), Fraction(0)), Fraction(1)) if dot(u, u) else Fraction(0)
        w = sub(p, [x + t * y for x, y in zip(s[0], u)])
        return dot(w, w)

    best = min([of_point(p, b) for p in a] + [of_point(q, a) for q in b])
    u, v, w = sub(a[-1], a[0]), sub(b[-1], b[0]), sub(a[0], b[0])
    uu, uv, vv, uw, vw = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    area = uu * vv - uv * uv
    if area:
        s, t = (uv * vw - vv * uw) / area, (uu * vw - uv * uw) / area
        if 0 <= s <= 1 and 0 <= t <= 1:
            across = [x + s * y - t * z for x, y, z in zip(w, u, v)]
            best = min(best, dot(across, across))
    return best


def question(rng, kind: str):
    """(A, B, X_WA, X_WB): near each other, exchanged now and then; some level, some exactly so."""
    body = [collide.Sphere(0.1), collide.Capsule(0.1, 0.3), collide.Box(0.2, 0.3, 0.1)][rng.integers(3)]
    if kind == "segments":
        body = [collide.Sphere(0.1), collide.Capsule(0.1, 0.3)][rng.integers(2)]
    turn = [np.zeros(3), rng.uniform(-3, 3, 3), np.array([np.pi / 2, 0, 0.3])][rng.integers(3)]
    X_WB = collide.pose(rng.uniform(-0.15, 0.15, 3), rpy=turn)
    if kind == "plane":
        normal = rng.normal(size=3) if rng.integers(2) else np.array([0.0, 0.0, 1.0])
        other, X_WA = collide.Halfspace(normal, float(rng.uniform(-0.2, 0.1))), np.eye(4)
        if rng.integers(2):
            X_WA = collide.pose(rng.uniform(-0.1, 0.1, 3), rpy=rng.uniform(-3, 3, 3))
    else:
        other = [collide.Sphere(0.05), collide.Capsule(0.07, 0.5)][rng.integers(2)]
        X_WA = collide.pose(rng.uniform(-0.2, 0.2, 3), rpy=turn if rng.integers(2) else rng.uniform(-3, 3, 3))
    return (other, body, X_WA, X_WB) if rng.integers(2) else (body, other, X_WB, X_WA)


def truth(A, B, X_WA, X_WB) -> Decimal | None:
    """The signed distance, but for cores that meet: None."""
    if isinstance(B, collide.Halfspace):
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    if isinstance(A, collide.Halfspace):
        # {x : m·R⁻¹(x − p) ≤ b}; R⁻¹ of the matrix as it stands is cof(R)ᵀ / det R.
        R = [[Fraction(X_WA[i, j]) for j in range(3)] for i in range(3)]
        cof = [
            [
                R[(i + 1) % 3][(j + 1) % 3] * R[(i + 2) % 3][(j + 2) % 3]
                - R[(i + 1) % 3][(j + 2) % 3] * R[(i + 2) % 3][(j + 1) % 3]
                for j in range(3)
            ]
            for i in range(3)
        ]
        det = sum(R[0][j] * cof[0][j] for j in range(3))
        m = [Fraction(v) for v in np.asarray(A.normal).tolist()]
        n = [sum(cof[i][j] * m[j] for j in range(3)) for i in range(3)]
        p = [Fraction(X_WA[i, 3]) for i in range(3)]
        height = min(sum(n[i] * (q[i] - p[i]) for i in range(3)) for q in exact_points(B, X_WB))
        height -= Fraction(A.offset) * det
        gap = Decimal(height.numerator) / Decimal(height.denominator) / root(sum(v * v for v in n))
        return gap - Decimal(float(getattr(B, "radius", 0.0)))
    square = square_of_segments(exact_points(A, X_WA), exact_points(B, X_WB))
    return None if square == 0 else root(square) - Decimal(A.radius) - Decimal(B.radius)


@pytest.mark.parametrize("kind", ["plane", "segments"])
def test_brackets_hold_the_truth(kind):
    hits = gaps = none = 0
    for seed in range(400):
        A, B, X_WA, X_WB = question(np.random.default_rng(seed), kind)
        where = f'question(np.random.default_rng({seed}), "{kind}")'
        exact = truth(A, B, X_WA, X_WB)
        batch = collide.contacts(A, B, X_WA[None], X_WB[None], margin=0.05)
        single = collide.contacts(A, B, X_WA, X_WB, margin=0.05)
        again = collide.contacts(A, B, X_WA, X_WB, margin=0.05)
        assert batch.rows.tobytes() == single.rows.tobytes() == again.rows.tobytes(), where
        if exact is None:
            continue
        if not len(single):
            assert exact > Decimal("0.05"), where
            none += 1
            continue
        lower, upper = float(single.lower[0]), float(single.upper[0])
        assert Decimal(lower) <= exact <= Decimal(upper) and upper - lower < 1e-12, (where, lower, exact, upper)
        n = single.normal[0]
        between = single.point_b[0] - single.point_a[0] - single.distance[0] * n
        assert np.abs(between).max() < 1e-14 and abs(np.linalg.norm(n) - 1) < 1e-15, where
        assert abs(single.distance[0] - collide.distance(A, B, X_WA, X_WB).distance) < 1e-14, where
        hits, gaps = hits + (exact < 0), gaps + (exact > 0)
    assert hits > 100 and gaps > 15 and none > 15, (hits, gaps, none)
