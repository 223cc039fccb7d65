"""Poses in between against the motion in decimals: off by no more than the slop that is written down."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest
from decimal_angles import decimal_sine_cosine

import collide
from collide.lowering.compound_table import PART, TURNED
from collide.lowering.shape_table import POSE, POSE_SLOP
from collide.motion.moving_body import ANGLE, BODY, OMEGA, POSE_ERROR, REACH_OF_CORE, place_body, set_body
from collide.numerics.vec3 import Vec3

#: Kernels are called as the Python they are written in.
pytestmark = pytest.mark.plain_kernels

NO_PART = np.zeros(PART)


def decimal_rotation(omega, time: float) -> list[list[Decimal]]:
    """Rot(τω), to fifty digits; the angle is a product of a double and a root, so sine and cosine are of a decimal."""
    with localcontext() as context:
        context.prec = 60
        w = [Decimal(float(c)) for c in omega]
        angle = sum(c * c for c in w).sqrt()
        if angle == 0:
            return [[Decimal(int(i == j)) for j in range(3)] for i in range(3)]
        x, y, z = (c / angle for c in w)
        turned = Decimal(time) * angle
        # sine and cosine of the nearest double, then of the rest by the sum formulas
        near = float(turned)
        s, c = decimal_sine_cosine(near)
        rest = turned - Decimal(near)
        s, c = s * (1 - rest * rest / 2) + c * rest, c * (1 - rest * rest / 2) - s * rest
        v = 1 - c
        return [
            [c + v * x * x, v * x * y - s * z, v * x * z + s * y],
            [v * x * y + s * z, c + v * y * y, v * y * z - s * x],
            [v * x * z - s * y, v * y * z + s * x, c + v * z * z],
        ]


def times(M, R):
    return [[sum(M[i][k] * R[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


@pytest.mark.parametrize("largest", [0.0, 1e-6, 1.0, 3.0, 300.0, 1e5])
def test_poses_are_off_by_no_more_than_their_slop(largest):
    rng = np.random.default_rng(6)
    worst = 0.0
    for _ in range(12):
        R0, omega = collide.pose(rpy=rng.uniform(-3, 3, 3)), rng.normal(size=3) * largest
        given = largest > 3.0
        X1 = collide.moved_poses(R0, (0, 0, 0), omega)
        body, row = np.zeros(BODY), np.zeros(POSE)
        reach = 10.0 ** rng.uniform(-3, 3)
        set_body(body, R0.ravel(), X1.ravel(), np.ascontiguousarray(omega), given, NO_PART, 0, reach)
        w = body[OMEGA : OMEGA + 3]
        for time in (*rng.uniform(0, 1, 3), 0.0, 1.0):
            place_body(body, float(time), row, 0, Vec3(0.0, 0.0, 0.0), 0.0)
            with localcontext() as context:
                context.prec = 60
                start = [[Decimal(v) for v in r] for r in R0[:3, :3].tolist()]
                end = [[Decimal(v) for v in r] for r in X1[:3, :3].tolist()]
                turned, last = times(decimal_rotation(w, float(time)), start), times(decimal_rotation(w, 1.0), start)
                square = Decimal(0)
                for i in range(3):
                    for j in range(3):
                        truth = turned[i][j] + Decimal(float(time)) * (end[i][j] - last[i][j])
                        square += (truth - Decimal(float(row[3 * i + j]))) ** 2
                off = float(square.sqrt()) * reach
            assert off <= row[POSE_SLOP] == body[POSE_ERROR]
            worst = max(worst, off / row[POSE_SLOP]) if row[POSE_SLOP] else worst
    assert worst > (1e-3 if largest else -1.0), "the slop is not to be idle"


def test_a_part_moves_with_its_body():
    rng = np.random.default_rng(7)
    for _ in range(20):
        X0, X1 = (collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(2))
        X_BP = collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3))
        part = np.zeros(PART)
        part[:9], part[9:12], part[TURNED] = X_BP[:3, :3].ravel(), X_BP[:3, 3], 1.0
        body, row, time = np.zeros(BODY), np.zeros(POSE), float(rng.uniform())
        set_body(body, X0.ravel(), X1.ravel(), np.zeros(3), False, part, 0, 0.5)
        X = collide.poses_in_motion(X0, X1, time)
        place_body(body, time, row, 0, Vec3(*X[:3, 3]), 0.0)
        assert row[:9].reshape(3, 3) == pytest.approx((X @ X_BP)[:3, :3], abs=1e-14)
        assert row[9:12] == pytest.approx((X @ X_BP)[:3, 3], abs=1e-14)
        assert body[REACH_OF_CORE] >= np.linalg.norm(X_BP[:3, 3]) + 0.5
        assert body[ANGLE] <= np.pi + 1e-12
