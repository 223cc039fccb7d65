"""Points, normals and heights in integers, against the same in Fractions."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact_bodies import ExactBodies, drawn
from exact_simplex import inner
from naive import reproducible, rng_of

from collide.narrowphase.exact import exact_directions as D
from collide.narrowphase.exact import exact_workspace as W
from collide.numerics.digits import BITS

pytestmark = pytest.mark.plain_kernels

ERROR = Fraction(2.0**-80)


def cross(a, b):
    return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]


def sign(x) -> int:
    return (x > 0) - (x < 0)


@pytest.mark.parametrize("kind", ["any", "lattice", "far apart in size"])
def test_normals_and_heights(kind):
    rng = rng_of("exact directions", kind)
    seen: Counter = Counter()
    for _ in range(60):
        case = drawn(rng, kind)
        bodies = ExactBodies(*case)
        exact, difference = bodies.exact, bodies.difference()
        pairs = [list(difference)[k] for k in rng.integers(0, len(difference), 4)]
        with reproducible(case):
            for k, (i, j) in enumerate(pairs):
                W.set_point(exact, k, i, j)
                assert bodies.point(k) == difference[i, j]
            a, b, c, p = (difference[ij] for ij in pairs)
            true = cross([x - y for x, y in zip(b, a)], [x - y for x, y in zip(c, a)])
            normal = D.set_normal(exact)
            assert normal.side == sign(inner(true, a))
            unit = Fraction(2) ** int(2 * BITS * exact.grid)
            facing = [x if normal.side >= 0 else -x for x in true]
            assert [unit * x for x in bodies.direction(normal.n)] == facing
            seen[normal.side] += 1
            assert D.side_of(exact, normal.n, 3) == sign(inner(facing, p))
            length = D.direction_length(exact, normal.n)
            square = inner(facing, facing)
            if square == 0:
                assert length.value.high == 0.0
                seen["no area"] += 1
                continue
            height = D.height_along(exact, normal.n, length, 3)
            value = Fraction(float(height.high)) + Fraction(float(height.low))
            ratio = inner(facing, p)
            assert abs(value * abs(value) * square - ratio * abs(ratio)) <= 4 * ERROR * ratio * ratio
            rounded = np.array(D.direction_double(exact, normal.n))
            scaled = np.array([float(x / max(map(abs, facing))) for x in facing])
            assert np.abs(rounded / np.linalg.norm(rounded) - scaled / np.linalg.norm(scaled)).max() <= 2.0**-50
            D.reverse_direction(exact, normal.n)
            assert [unit * x for x in bodies.direction(normal.n)] == [-x for x in facing]
    assert min(seen[1], seen[-1]) >= 5 and (kind != "lattice" or min(seen[0], seen["no area"]) >= 5), seen
