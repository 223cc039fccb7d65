"""What is proven of spans: the bound of f″ by differences of exact motions, the chord by functions that reach it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from motion_oracle import BodyMotion
from scipy.spatial.transform import Rotation

import collide
from collide.lowering.compound_table import PART
from collide.motion.kept_axis import axis_turning, curvature, is_free_between
from collide.motion.moving_body import ANGLE, BODY, OMEGA, REACH_OF_CORE, set_body
from collide.motion.moving_pair import MovingPair
from collide.motion.speed_bound import speed_bound
from collide.numerics.vec3 import Vec3

#: Kernels are called as the Python they are written in.
pytestmark = pytest.mark.plain_kernels

NO_PART = np.zeros(PART)


def test_the_chord_is_sharp_and_never_wrong():
    """Of all functions with these ends and f″ ≤ K the lowest is a parabola: free where the test says so, and where the
    test is nearly passed, nearly 0."""
    rng = np.random.default_rng(1)
    x = np.linspace(0.0, 1.0, 2001)
    n_free = n_sharp = 0
    for _ in range(3000):
        s0, s1, passed = 10.0 ** rng.uniform(-9, 1, 3)
        bound = (math.sqrt(s0) + math.sqrt(s1)) ** 2 * 2.0 / passed**2 * 10.0 ** rng.uniform(-2, 2)
        lowest = ((1 - x) * s0 + x * s1 - 0.5 * bound * passed**2 * x * (1 - x)).min()
        free = is_free_between(s0, s1, bound, passed)
        assert not (free and lowest < -1e-12 * max(s0, s1))
        n_free += free
        if not free and is_free_between(s0, s1, 0.98 * bound, passed):
            n_sharp += 1
            assert lowest <= 1e-3 * max(s0, s1)
        assert not is_free_between(0.0, s1, bound, passed) and not is_free_between(s0, -s1, 0.0, passed)
    assert 1000 < n_free < 2000 and n_sharp >= 5


def _moving(rng, omega_scale: float):
    """(MovingPair without shapes, both bodies' motions) of points within 1 of their origins."""
    X = [collide.pose(rng.uniform(-2, 2, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(4)]
    omegas = rng.normal(size=(2, 3)) * omega_scale
    for k in range(2):
        X[2 * k + 1] = collide.moved_poses(X[2 * k], X[2 * k + 1][:3, 3] - X[2 * k][:3, 3], omegas[k])
    a, b = np.zeros(BODY), np.zeros(BODY)
    set_body(a, X[0].ravel(), X[1].ravel(), omegas[0].copy(), True, NO_PART, 0, 1.0)
    set_body(b, X[2].ravel(), X[3].ravel(), omegas[1].copy(), True, NO_PART, 0, 1.0)
    d0, d1 = X[2][:3, 3] - X[0][:3, 3], X[3][:3, 3] - X[1][:3, 3]
    farthest = max(np.linalg.norm(d0), np.linalg.norm(d1))
    pair = MovingPair(a, b, None, Vec3(*d0), Vec3(*(d1 - d0)), float(farthest), 0.0, False, 9.0, 0.0, 0.0)
    return pair, BodyMotion(X[0][None], X[1][None], omegas[:1]), BodyMotion(X[2][None], X[3][None], omegas[1:])


def test_no_second_derivative_is_beyond_the_bound():
    rng = np.random.default_rng(2)
    worst = 0.0
    for _ in range(400):
        pair, A, B = _moving(rng, 10.0 ** rng.uniform(-1, 1))
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        omega_a, omega_b = pair.a[OMEGA : OMEGA + 3], pair.b[OMEGA : OMEGA + 3]
        turning = [np.zeros(3), omega_a, omega_b, 0.5 * (omega_a + omega_b), rng.normal(size=3)][rng.integers(5)]
        bound = curvature(pair, axis_turning(Vec3(*n), Vec3(*turning)))
        r_a, r_b = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        time, h = float(rng.uniform(0.01, 0.99)), 1e-4

        def f(t, n=n, turning=turning, r_a=r_a, r_b=r_b, A=A, B=B):
            at = np.array([t])
            (R_a, p_a), (R_b, p_b) = A.at(at), B.at(at)
            x = (p_b[0] + R_b[0] @ r_b) - (p_a[0] + R_a[0] @ r_a)
            return float(Rotation.from_rotvec(t * turning).apply(n) @ x)

        second = (f(time + h) - 2.0 * f(time) + f(time - h)) / h**2
        assert second <= bound * (1 + 1e-4) + 1e-5
        worst = max(worst, second / bound if bound > 1e-6 else 0.0)
    assert worst > 0.5, "a bound that is never approached is not to be trusted either"


def test_no_speed_is_beyond_the_bound():
    rng = np.random.default_rng(3)
    worst = 0.0
    for _ in range(300):
        pair, A, B = _moving(rng, 10.0 ** rng.uniform(-1, 1))
        if rng.integers(3) == 0:  # bodies that turn together
            pair.b[OMEGA : OMEGA + 3], pair.b[ANGLE] = pair.a[OMEGA : OMEGA + 3], pair.a[ANGLE]
            B.omega = A.omega
        v = np.array(pair.v)
        d = [Vec3(*(np.array(pair.d0) + t * v)) for t in (0.0, 1.0)]
        bound = speed_bound(pair.a, pair.b, pair.v, *d)
        assert pair.a[REACH_OF_CORE] >= 1.0
        r_a, r_b = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))

        def gap(t, r_a=r_a, A=A, B=B, r_b=r_b):
            at = np.array([t])
            (R_a, p_a), (R_b, p_b) = A.at(at), B.at(at)
            return float(np.linalg.norm((p_b[0] + R_b[0] @ r_b) - (p_a[0] + R_a[0] @ r_a)))

        time, h = float(rng.uniform(0.01, 0.99)), 1e-6
        # two points of fixed places in their bodies: the change of the distance of two balls about them
        speed = abs(gap(time + h) - gap(time - h)) / (2 * h)
        assert speed <= bound * (1 + 1e-6) + 1e-6
        worst = max(worst, speed / bound)
    assert worst > 0.4
