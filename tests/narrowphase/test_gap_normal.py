"""Normals of small gaps of curved bodies: what the support along them proves, judged by closed forms in long doubles."""

from __future__ import annotations

import numpy as np
import pytest
from contact_oracle import ConvexBody

import collide

MAKE = {
    "cylinder": lambda rng: collide.Cylinder(rng.uniform(0.1, 0.5), rng.uniform(0.2, 1.0)),
    "cone": lambda rng: collide.Cone(rng.uniform(0.1, 0.5), rng.uniform(0.2, 1.0)),
    "ellipsoid": lambda rng: collide.Ellipsoid(rng.uniform(0.1, 0.5, 3)),
    "box": lambda rng: collide.Box(rng.uniform(0.2, 1.0, 3)),
    "hull": lambda rng: collide.ConvexHull(rng.normal(size=(8, 3)) * 0.4),
    "capsule": lambda rng: collide.Capsule(0.2, 0.6),
}
#: Of S, about 2 here: by so much a gap may be larger than along its normal. A normal off by θ costs about R θ² / 2.
ALLOWED = 2e-8


def posed(R, p) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R, p
    return X


def pairs(a: str, gap: float, n: int):
    """Pairs of a kind with each of the others, about so far apart."""
    rng = np.random.default_rng([len(a), round(-np.log10(gap))])
    for b in MAKE:
        for _ in range(n):
            A, B = MAKE[a](rng), MAKE[b](rng)
            R, Q = (collide.pose(quat_wxyz=rng.normal(size=4))[:3, :3] for _ in range(2))
            away = rng.normal(size=3)
            X_WA, X_WB = posed(R, rng.normal(size=3) * 0.1), posed(Q, 3.0 * away / np.linalg.norm(away))
            for _ in range(3):
                r = collide.distance(A, B, X_WA, X_WB)
                X_WB[:3, 3] += (gap - r.distance) * r.normal
            yield A, B, X_WA, X_WB


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("a", ["cylinder", "cone", "ellipsoid"])
def test_along_the_normal_bodies_are_as_far_apart_as_told(a, gap):
    """Leaning by 0.07 they overlapped by 1e-2 along it, at gaps of 1e-9."""
    n_gaps = 0
    for A, B, X_WA, X_WB in pairs(a, gap, 8):
        r = collide.distance(A, B, X_WA, X_WB)
        of_a, of_b = ConvexBody(A, X_WA), ConvexBody(B, X_WB)
        apart = float(-(of_a.support(r.normal) + of_b.support(-r.normal)))
        where = f"{A!r}, {B!r}, X_WA = {X_WA.tolist()!r}, X_WB = {X_WB.tolist()!r}"
        assert abs(np.linalg.norm(r.normal) - 1.0) < 1e-14, where
        assert apart <= r.upper + 1e-14 and r.lower <= r.upper, where
        assert r.lower <= max(apart, 0.0) + 1e-14 or r.lower <= r.distance, where
        swapped = collide.distance(B, A, X_WB, X_WA)
        assert swapped.lower == r.lower and np.array_equal(swapped.normal, -r.normal), where
        if r.distance > 0.1 * gap:
            n_gaps += 1
            assert r.distance - apart <= ALLOWED, (where, r.distance - apart)
            for body, point in ((of_a, r.point_a), (of_b, r.point_b)):
                assert abs(float(body.signed(point[None])[0])) <= ALLOWED, where
    assert n_gaps >= 36  # of 48


def test_a_can_on_a_tilted_box_by_formula():
    """The lowest point of a rim over a face: the normal is that of the face, at any gap."""
    box, can = collide.Box((2.0, 2.0, 2.0)), collide.Cylinder(0.3, 1.0)
    rng = np.random.default_rng(3)
    for gap in 10.0 ** rng.uniform(-10, -2, 60):
        tilt, turn = rng.uniform(0.1, 1.4), rng.uniform(-np.pi, np.pi)
        lowest = 0.3 * np.sin(tilt) + 0.5 * np.cos(tilt)
        X_WB = collide.pose((0, 0, 1.0 + lowest + gap), rpy=(tilt, 0, turn))
        r = collide.distance(box, can, np.eye(4), X_WB)
        sine = float(np.linalg.norm(np.cross(r.normal, (0, 0, 1))))
        assert r.lower <= gap + 1e-15 and gap - 1e-15 <= r.upper, (gap, tilt, turn)
        assert sine < 1e-3, (gap, tilt, turn, sine)
