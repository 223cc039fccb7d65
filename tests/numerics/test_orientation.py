"""On which side of a plane a point lies: every stage against Fractions, and every stage is needed by some cloud."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact_simplex import determinant, exact
from naive import rng_of
from reproduction import reproducing

from collide.numerics import orientation as O

pytestmark = pytest.mark.plain_kernels

SOURCE = "points = {cloud}; axis = {axis}  # tests/numerics/test_orientation.py: Cloud(points).side(0, 1, 2, 3, axis)"


class Cloud:
    """Points as `orientation` has them: scaled, and as they came, with its workspaces."""

    def __init__(self, points):
        self.originals = np.asarray(points, dtype=float).ravel().tolist()
        self.points = [0.0] * len(self.originals)
        self.work, self.digits = [0.0] * O.WORK, [0] * O.DIGITS
        self.exponent = O.survey(self.originals, self.points, len(self.originals) // 3, self.work)

    def side(self, a: int, b: int, c: int, d: int, axis: int = -1) -> int:
        return O.orientation(O.CloudView(self.points, self.originals, self.work, self.digits, 0, 0), a, b, c, d, axis)


def sign(x) -> int:
    return (x > 0) - (x < 0)


def true_side(points, axis: int = -1) -> int:
    a, b, c, d = exact(points)
    third = [Fraction(k == axis) for k in range(3)] if axis >= 0 else [x - y for x, y in zip(d, a)]
    return sign(determinant(third, [x - y for x, y in zip(b, a)], [x - y for x, y in zip(c, a)]))


def near_a_plane(rng) -> np.ndarray:
    """Three random points and a fourth in their plane but for rounding."""
    points = rng.normal(size=(4, 3))
    u, v = rng.normal(size=2)
    points[3] = points[0] + u * (points[1] - points[0]) + v * (points[2] - points[0])
    return points


def lattice(rng) -> np.ndarray:
    return rng.integers(-2, 3, size=(4, 3)) * 0.125


def of_all_sizes(rng) -> np.ndarray:
    """Coordinates below what expansions can multiply without underflow, beside large ones; flat in half of the
    cases."""
    points = rng.integers(-2, 3, size=(4, 3)) * 2.0 ** rng.choice([-900, -600, 0], size=(4, 3))
    if rng.random() < 0.5:
        points[3] = points[0] + (points[1] - points[0])
    return points


def line_of_doubles(rng) -> np.ndarray:
    """Points on a line, moved by an ulp or not at all."""
    points = np.outer(rng.normal(size=4), rng.normal(size=3))
    points[3] *= 1 + rng.integers(-1, 2, size=3) * 2.0**-52
    return points


def of_the_whole_range(rng) -> np.ndarray:
    return rng.uniform(-1, 1, size=(4, 3)) * 10.0 ** rng.integers(-320, 308, size=(4, 3))


def coplanar(rng) -> np.ndarray:
    """Exactly, with full mantissas; or but for a coordinate that is nearly nothing."""
    points = rng.normal(size=(4, 3))
    points[:, 2] = points[:, 0] * rng.choice([1.0, -2.0, 0.25])
    if rng.random() < 0.6:
        points[int(rng.integers(4)), 2] += rng.choice([5e-324, 1e-310, 1e-200, 2.0**-52])
    return points * rng.choice([1.0, 2.0**900, 2.0**-500])


def crowded(rng) -> np.ndarray:
    """Two of the points 2⁻⁵⁰ apart."""
    points = rng.uniform(-1, 1, size=(4, 3))
    points[3] = points[2] + rng.uniform(-1, 1, 3) * 2.0**-50
    return points


CLOUDS = {
    "random": lambda rng: rng.normal(size=(4, 3)), "near a plane": near_a_plane, "lattice": lattice,
    "of all sizes": of_all_sizes, "a line of doubles": line_of_doubles,
    "denormal": lambda rng: rng.integers(-2, 3, size=(4, 3)) * 5e-324, "of the whole range": of_the_whole_range,
    "coplanar": coplanar, "crowded": crowded,
}


@pytest.mark.many(6)
@pytest.mark.parametrize("kind", CLOUDS)
def test_sides_are_exact(kind):
    rng = rng_of("sides", kind)
    seen: Counter = Counter()
    for _ in range(250):
        points = CLOUDS[kind](rng)
        axis = int(rng.integers(-1, 3)) if rng.random() < 0.3 else -1
        if axis >= 0:
            points[3] = points[0]
        with reproducing(SOURCE, cloud=points, axis=axis):
            cloud, true = Cloud(points), true_side(points, axis)
            assert cloud.side(0, 1, 2, 3, axis) == true
            assert cloud.side(0, 2, 1, 3, axis) == -true
            if axis < 0:
                assert cloud.side(1, 2, 0, 3) == true and cloud.side(1, 0, 3, 2) == true
        seen[true] += 1
    flat = 20 if kind in ("lattice", "of all sizes", "denormal", "coplanar") else 0
    assert min(seen[-1], seen[1]) >= 20 and seen[0] >= flat, seen


def test_stages_agree_and_are_needed():
    """Expansions and digits say what Fractions say, of all clouds; doubles and pairs leave some to them."""
    rng = rng_of("stages")
    needed: Counter = Counter()
    for kind, draw in CLOUDS.items():
        for _ in range(80):
            points = draw(rng)
            with reproducing(SOURCE, cloud=points, axis=-1):
                cloud, true = Cloud(points), true_side(points)
                assert O.by_digits(cloud.originals, cloud.digits, 0, 1, 2, 3, -1) == true
                O.write_differences(cloud.points, cloud.work, 0, 1, 2, 3, -1)
                value, size = O.double_determinant(cloud.work)
                wide = cloud.work[0] != 0.0 and O.too_wide(cloud.originals, cloud.work[0], 0, 1, 2, 3)
                if abs(value) > 2.0**-49 * size + O.UNDERFLOW:
                    assert sign(value) == true
                    needed[kind, "doubles"] += 1
                elif wide:
                    needed[kind, "digits"] += 1
                else:
                    assert O.by_expansions(cloud.work) == true
                    pairs = O.dd_determinant(cloud.work)
                    known = abs(pairs) > 2.0**-100 * size
                    assert not known or sign(pairs) == true
                    needed[kind, "pairs" if known else "expansions"] += 1
    assert needed["random", "doubles"] > 70 and needed["near a plane", "pairs"] > 10, needed
    assert needed["a line of doubles", "expansions"] > 20 and needed["of all sizes", "digits"] > 10, needed


def test_lattices_are_settled_by_their_quantum():
    """Of points on a lattice every determinant is a multiple of a known power of two, and one known to be smaller is
    0."""
    rng = rng_of("quantum")
    flat = 0
    for _ in range(300):
        points = lattice(rng)
        cloud = Cloud(points)
        quantum = cloud.work[1]
        if not points.any():
            continue
        assert 0.0 < quantum <= 1.0
        scaled = [Fraction(x) for x in cloud.points]
        a, b, c, d = (scaled[3 * k : 3 * k + 3] for k in range(4))
        value = determinant(*([x - y for x, y in zip(p, a)] for p in (d, b, c)))
        assert (value / Fraction(quantum)).denominator == 1
        flat += value == 0
    assert flat > 10
    assert Cloud([(0.1, 0.2, 0.3), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]).work[1] == 0.0  # no such lattice


def test_scaling_is_by_a_power_of_two():
    for factor in (1.0, 2.0**-1070, 2.0**1000, 0.3, 1e300):
        points = np.array([(1.0, -3.0, 0.5), (0.25, 2.0, 3.0)]) * factor
        cloud = Cloud(points)
        assert 0.5 <= max(map(abs, cloud.points)) < 1.0
        assert [Fraction(x) * Fraction(2) ** cloud.exponent for x in cloud.points] == [
            Fraction(x) for x in points.ravel().tolist()
        ]


def test_no_overflow_of_differences():
    """The largest doubles of both signs: their differences are no doubles, their sides are known."""
    most = np.finfo(float).max
    points = [(-most, -most, 0.0), (most, -most, 0.0), (-most, most, 0.0), (0.0, 0.0, most)]
    assert Cloud(points).side(0, 1, 2, 3) == true_side(points) == 1
