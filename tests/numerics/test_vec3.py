"""Small vectors: the sums in the order that error bounds and equal bits count on, and rotations that undo each
other."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, rng_of, rotation

from collide.numerics import vec3 as V

pytestmark = pytest.mark.plain_kernels


def random_vectors(rng, n: int) -> list[V.Vec3]:
    return [V.Vec3(*row) for row in (rng.normal(size=(n, 3)) * 2.0 ** rng.integers(-30, 30, size=(n, 3))).tolist()]


def test_sums_run_from_left_to_right():
    rng = rng_of("sums of vectors")
    other_order = 0
    for a, b in zip(random_vectors(rng, 300), random_vectors(rng, 300)):
        assert V.dot(a, b) == (a.x * b.x + a.y * b.y) + a.z * b.z
        other_order += V.dot(a, b) != a.x * b.x + (a.y * b.y + a.z * b.z)
        assert V.cross(a, b) == V.neg(V.cross(b, a)) == tuple(
            a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3] for k in range(3)
        )
        assert V.sub(V.add(a, b), b) == tuple((x + y) - y for x, y in zip(a, b))
        assert V.scale(0.25, a) == tuple(0.25 * x for x in a)
    assert other_order > 10, "the order would not be noticed"


def test_where_vectors_stand():
    values = list(map(float, range(20)))
    assert V.vec3_at(values, 4) == (4.0, 5.0, 6.0)
    assert V.column_at(values, 5, 3) == (3.0, 8.0, 13.0)
    V.put_vec3(values, 7, V.Vec3(-1.0, -2.0, -3.0))
    assert values[6:11] == [6.0, -1.0, -2.0, -3.0, 10.0]


def test_rotations():
    rng = rng_of("rotations of vectors")
    for R in LATTICE_ROTATIONS:
        rows = [7.0, *R.ravel().tolist()]
        for a in random_vectors(rng, 5):
            assert V.rotate(rows, 1, a) == tuple(R @ a) and V.rotate_back(rows, 1, V.rotate(rows, 1, a)) == a
    for _ in range(50):
        R = rotation(rng)
        (a,) = random_vectors(rng, 1)
        rows = R.ravel().tolist()
        size = float(np.abs(a).sum())
        for found, M in ((V.rotate(rows, 0, a), R), (V.rotate_back(rows, 0, a), R.T)):
            for k in range(3):
                exact = sum(Fraction(m) * Fraction(x) for m, x in zip(M[k].tolist(), a))
                assert abs(Fraction(found[k]) - exact) <= 3 * 2.0**-53 * size
