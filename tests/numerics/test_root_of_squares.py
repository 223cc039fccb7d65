"""Lengths in a kernel are those of Python, bit by bit."""

from __future__ import annotations

import math

import numpy as np
from naive import rng_of

from collide.numerics.root_of_squares import root_of_squares


def test_roots_are_those_of_python():
    rng = rng_of("root of squares")
    seen = 0
    for _ in range(5000):
        x = rng.normal(size=3) * 10.0 ** rng.choice([0, 0, -50, 50, 8, -8], 3)
        x[rng.random(3) < 0.2] = 0.0
        if rng.random() < 0.2:  # whole lengths
            x = np.array([3.0, 4.0, 12.0]) * float(rng.integers(1, 2**40))
        x, y, z = x.tolist()
        assert root_of_squares(x, y, z) == math.hypot(x, y, z), f"root_of_squares({x!r}, {y!r}, {z!r})"
        seen += x * y * z != 0.0
    assert seen > 2000 and root_of_squares(0.0, 0.0, 0.0) == 0.0
