"""Derivatives of times of impact beside differences of times whose brackets are 1e-13 wide."""

from __future__ import annotations

import numpy as np
import pytest
from naive import hull_points, random_pose, rng_of

import collide
from collide.motion.impact_derivatives import _rotation_vectors

STEP = 1e-5


def turned(phi: np.ndarray) -> np.ndarray:
    """(3, 3) the rotation about φ by its length."""
    K = np.array([[0.0, -phi[2], phi[1]], [phi[2], 0.0, -phi[0]], [-phi[1], phi[0], 0.0]])
    angle = float(np.linalg.norm(phi))
    return np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * K @ K


def motion(rng):
    """A start that is apart, and velocities that lead two bodies together, with a turn below a third of one."""
    X_WA0, X_WB0 = random_pose(rng, 0.1), random_pose(rng, 0.1)
    away = rng.normal(size=3)
    X_WB0[:3, 3] += 3.0 * away / np.linalg.norm(away)
    velocity = 1.5 * (X_WA0[:3, 3] - X_WB0[:3, 3]) + rng.normal(size=3) * 0.3
    return X_WA0, X_WB0, rng.normal(size=3) * 0.2, velocity, rng.normal(size=3), rng.normal(size=3)


def time(A, B, X_WA0, X_WB0, velocity_a, velocity_b, omega_a, omega_b) -> float:
    ends = [collide.moved_poses(X, v, w) for X, v, w in ((X_WA0, velocity_a, omega_a), (X_WB0, velocity_b, omega_b))]
    impact = collide.time_of_impact(
        A, B, X_WA0, ends[0], X_WB0, ends[1], omega_WA=omega_a, omega_WB=omega_b, tolerance=1e-13
    )
    return 0.5 * (impact.lower + impact.upper) if impact.hit and impact.upper - impact.lower < 1e-12 else np.nan


def shapes(rng) -> dict[str, collide.Shape]:
    return {
        "ball": collide.Sphere(0.4), "capsule": collide.Capsule(0.2, 0.6), "box": collide.Box((0.6, 0.8, 0.5)),
        "hull": collide.ConvexHull(hull_points(rng, 12)), "ellipsoid": collide.Ellipsoid((0.3, 0.4, 0.5)),
        "cylinder": collide.Cylinder(0.3, 0.7),
    }


@pytest.mark.parametrize("kind", ["ball", "capsule", "box", "hull", "ellipsoid", "cylinder"])
def test_slopes_of_times(kind):
    rng = rng_of("impact derivatives", kind)
    asked = 0
    for _ in range(8):
        B = list(shapes(rng).values())[int(rng.integers(6))]
        A, X = shapes(rng)[kind], motion(rng)
        X_WA0, X_WB0, velocity_a, velocity_b, omega_a, omega_b = X
        ends = [collide.moved_poses(X_WA0, velocity_a, omega_a), collide.moved_poses(X_WB0, velocity_b, omega_b)]
        told = collide.impact_derivatives(A, B, X_WA0, ends[0], X_WB0, ends[1], omega_WA=omega_a, omega_WB=omega_b)
        if told.reason[0] is not None:
            assert np.isnan(told.d_time_A).all() and np.isnan(told.d_time_velocity_B).all()
            continue
        t, slopes = told.impact.time[0], {name: np.empty(6) for name in ("A", "B", "velocity_A", "velocity_B")}
        for side, name in ((0, "A"), (1, "B")):
            o = (X_WA0, X_WB0)[side][:3, 3] + t * (velocity_a, velocity_b)[side]
            for j in range(6):
                ways = []
                for sign in (STEP, -STEP):
                    change, moved, sped = sign * np.eye(6)[j], [x.copy() for x in X], [x.copy() for x in X]
                    R = turned(change[:3])
                    moved[side][:3, :3] = R @ X[side][:3, :3]
                    moved[side][:3, 3] = R @ (X[side][:3, 3] - o) + o + change[3:]
                    moved[2 + side], moved[4 + side] = R @ X[2 + side], R @ X[4 + side]
                    sped[4 + side] = sped[4 + side] + change[:3]
                    sped[2 + side] = sped[2 + side] + change[3:]
                    ways.append([time(A, B, *way) for way in (moved, sped)])
                slopes[name][j], slopes[f"velocity_{name}"][j] = (np.array(ways[0]) - ways[1]) / (2 * STEP)
        for name, slope in slopes.items():
            if np.isnan(slope).any():
                continue
            answer = getattr(told, f"d_time_{name}")[0]
            assert np.abs(slope - answer).max() <= 1e-5 * (1 + np.abs(slope).max()), (kind, B, X, name, slope, answer)
            asked += 1
    assert asked >= 12


def test_reasons():
    ball, far = collide.Sphere(0.5), collide.pose((3, 0, 0))
    X = np.eye(4)
    told = collide.impact_derivatives(
        ball, ball, X, X, np.array([far, far, collide.pose((0.5, 0, 0)), collide.pose((3, 1.0 - 1e-14, 0))]),
        np.array([collide.pose((1.5, 0, 0)), X, X, collide.pose((-3, 1.0 - 1e-14, 0))]),
    )
    assert told.reason[0] == "the bodies do not meet" and told.reason[1] is None
    assert told.reason[2] == "the bodies are in contact at the start" and told.reason[3] is not None
    assert np.allclose(told.d_time_B[1], [0, 0, 0, 1 / 3, 0, 0]) and np.isclose(told.rate[1], -3.0)
    box = collide.Box((1, 1, 1))
    flat = collide.impact_derivatives(box, box, X, X, far, X)
    assert flat.reason[0].startswith("the distance has no derivative at the contact: several pairs of points")
    assert np.isnan(flat.d_time_A).all() and np.isnan(flat.rate).all()


def test_turns_are_those_of_rotations():
    rng = rng_of("turns")
    phi = rng.normal(size=(200, 3))
    phi *= (rng.choice([1e-9, 1e-3, 0.5, 3.0, np.pi - 1e-7], size=200) / np.linalg.norm(phi, axis=1))[:, None]
    X = np.tile(np.eye(4), (200, 1, 1))
    X[:, :3, :3] = [turned(row) for row in phi]
    assert np.abs(_rotation_vectors(np.tile(np.eye(4), (200, 1, 1)), X) - phi).max() < 1e-7
