"""Sines and cosines of kernels against Taylor's series in decimals of sixty digits."""

from __future__ import annotations

import math
from decimal import Decimal

import numpy as np
import pytest
from decimal_angles import decimal_sine_cosine

from collide.numerics.sine_cosine import LARGEST_ANGLE, angle_of, sine_cosine

#: Kernels are called as the Python they are written in.
pytestmark = pytest.mark.plain_kernels

def test_both_are_good_to_two_units():
    rng = np.random.default_rng(1)
    angles = [0.0, 1e-300, math.pi / 4, math.pi / 2, math.pi, 2 * math.pi, 1e5, LARGEST_ANGLE]
    angles += (10.0 ** rng.uniform(-12, 6, 400)).tolist() + (np.arange(1, 200) * (math.pi / 2)).tolist()
    worst = 0.0
    for angle in angles:
        values, truth = sine_cosine(angle), decimal_sine_cosine(angle)
        worst = max(worst, *(abs(float(Decimal(v) - t)) for v, t in zip(values, truth)))
    assert 0.3 * 2.0**-53 < worst <= 2.0 * 2.0**-53
    assert sine_cosine(0.0) == (0.0, 1.0)


def test_angles_come_back():
    rng = np.random.default_rng(2)
    angles = [*(10.0 ** rng.uniform(-15, 0, 300)), *rng.uniform(0.0, math.pi, 500)]
    for angle in angles:
        back = angle_of(3.0 * math.sin(angle), 3.0 * math.cos(angle))
        assert abs(back - angle) <= 8 * 2.0**-53 * max(angle, 1e-16)
    assert angle_of(0.0, 1.0) == 0.0 and angle_of(0.0, -1.0) == math.pi and angle_of(0.0, 0.0) == 0.0
