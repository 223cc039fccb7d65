"""The time in which two balls may meet: never shorter than it is, by dense sampling, and not much longer."""

from __future__ import annotations

import numpy as np
import pytest

from collide.motion.swept_balls import time_of_balls
from collide.numerics.vec3 import Vec3

#: Kernels are called as the Python they are written in.
pytestmark = pytest.mark.plain_kernels


def test_no_time_of_nearness_is_left_out():
    rng = np.random.default_rng(1)
    times = np.linspace(0.0, 1.0, 4001)
    n_never = n_part = 0
    for _ in range(600):
        scale = 10.0 ** rng.uniform(-3, 4)
        d0, v = rng.normal(size=3) * scale, rng.normal(size=3) * 10.0 ** rng.uniform(-3, 4)
        if rng.integers(2):
            v = -d0 * rng.uniform(0.5, 3.0) + rng.normal(size=3) * 1e-3 * scale
        reach = 10.0 ** rng.uniform(-4, 1)
        distance = np.linalg.norm(d0 + times[:, None] * v, axis=1)
        near = times[distance <= reach]
        farthest = float(np.linalg.norm(d0) + np.linalg.norm(v))
        begin, end = time_of_balls(Vec3(*d0), Vec3(*v), farthest, reach, 0.0, 1.0)
        if begin > end:
            n_never += 1
            assert not len(near)
            continue
        assert 0.0 <= begin and end <= 1.0
        if len(near):
            assert begin <= near[0] and near[-1] <= end
            n_part += begin > 0.0 or end < 1.0
            slack = 1e-6 + 1e-3
            assert begin >= near[0] - slack - 1e-9 * farthest / max(reach, 1e-30) or begin == 0.0
    assert n_never > 100 and n_part > 60


def test_bodies_that_stand_still():
    still = Vec3(0.0, 0.0, 0.0)
    assert time_of_balls(Vec3(1.0, 0.0, 0.0), still, 1.0, 2.0, 0.2, 0.7) == (0.2, 0.7)
    begin, end = time_of_balls(Vec3(3.0, 0.0, 0.0), still, 3.0, 2.0, 0.0, 1.0)
    assert begin > end
