"""Margins through the C interface: whether shapes come within a distance, as `collide(security_margin=…)` says."""

from __future__ import annotations

import math

import c_library as c
import numpy as np
import pytest
import soak_pairs

import collide
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

CONVEX = (
    "sphere", "box", "capsule", "hull", "swept hull", "flat hull", "h-polytope", "half-space", "cylinder", "cone",
    "ellipsoid",
)


def test_margins_near_the_distance_are_decided_as_python_does():
    asker, counts = c.Asker(), np.zeros(2, dtype=int)
    for number in range(350):
        k = soak_pairs.draw(131, number, 1e2, CONVEX)
        gap = float(collide.distance(k.A, k.B, k.X_WA, k.X_WB, signed=False).distance)
        own = c.CShape(k.A), c.CShape(k.B)
        for margin in (gap, math.nextafter(gap, 0.0), gap * (1 + 1e-6), 0.5 * gap, 0.0, 0.01):
            if margin and margin < 1e-50:
                continue
            wanted = collide.collide(k.A, k.B, k.X_WA, k.X_WB, security_margin=margin)
            status, found, _ = asker.within(*own, k.X_WA, k.X_WB, margin)
            assert (status, bool(found[0])) == (c.OK, wanted), (number, margin, gap)
            counts[int(wanted)] += 1
    assert counts.min() >= 400, counts


def test_margins_equal_to_the_distance_are_within():
    """Boxes, balls and a floor at distances that are doubles, and one digit nearer or farther."""
    asker, box, ball = c.Asker(), collide.Box(1, 1, 1), collide.Sphere(0.25)
    floor, decided = collide.Halfspace((0, 0, 1), 0.0), 0
    for A, B, height, gap in (
        (box, box, 1.75, 0.75), (floor, box, 0.625, 0.125), (box, ball, 1.375, 0.625), (floor, ball, 0.5, 0.25),
        (ball, ball, 1.0, 0.5),
    ):
        own, X = (c.CShape(A), c.CShape(B)), c.identity_at(0, 0, height)
        for margin in (gap, math.nextafter(gap, 0.0), math.nextafter(gap, 1.0)):
            status, found, _ = asker.within(*own, np.eye(4), X, margin)
            wanted = collide.collide(A, B, np.eye(4), X, security_margin=margin)
            assert (status, bool(found[0])) == (c.OK, wanted), (A, B, margin)
            decided += wanted == (margin >= gap)
    assert decided >= 14  # beside a half-space radius and margin sum up to no double: that counts as within


def test_batches_and_what_is_refused():
    asker, box, far = c.Asker(), c.CShape(collide.Box(1, 1, 1)), np.stack([np.eye(4)] * 40)
    far[:, 2, 3] = np.linspace(0.5, 3.0, 40)
    wanted = collide.collide(collide.Box(1, 1, 1), collide.Box(1, 1, 1), np.eye(4), far, security_margin=0.75)
    status, found, _ = asker.within(box, box, np.eye(4), far, 0.75)
    assert status == c.OK and found.tolist() == wanted.tolist() and 5 < wanted.sum() < 35
    far[7, 0, 0] = 3.0
    assert asker.within(box, box, np.eye(4), far, 0.75)[::2] == (c.INVALID_POSE, 7)
    for margin in (-1.0, math.nan, math.inf, 1e-60, 1e51):
        assert asker.within(box, box, np.eye(4), np.eye(4), margin)[0] == c.INVALID_ARGUMENT
    assert asker.within(box, box, np.eye(4), np.eye(4), 0.5, c.UNSIGNED)[0] == c.INVALID_ARGUMENT
    assert asker.within(box, box, far[:2], far[:3], 0.5)[0] == c.INVALID_ARGUMENT
