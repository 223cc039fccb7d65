"""The nearest point of a simplex that grew by one point, against every subset of its corners in Fractions."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact_simplex import determinant, exact, inner, nearest_to_origin
from naive import rng_of
from reproduction import reproducing

from collide.narrowphase.gjk import grown_simplex as G
from collide.numerics.vec3 import Vec3

pytestmark = pytest.mark.plain_kernels

SOURCE = "old, newest, error = {old}, {newest}, {error}  # tests/narrowphase/gjk/test_grown_simplex.py"
ULP = 2.0**-52


def grown(rng, n: int, kind: str) -> tuple[np.ndarray, np.ndarray] | None:
    """n old points with the nearest point in their midst, and one that lies lower, as GJK has them; None if not."""
    old, newest = rng.normal(size=(n, 3)), rng.normal(size=3)
    if kind == "lattice":
        old, newest = rng.integers(-2, 3, size=(n, 3)) * 0.5, rng.integers(-2, 3, size=3) * 0.5
    elif kind == "around":
        old, newest = old + np.array([0.0, 0.0, 1.0]), newest - np.array([0.0, 0.0, 2.0])
    elif kind == "thin":
        old[:, 2], newest[2] = 0.1, 0.1 * (1 - 1e-9)
    if kind == "any":
        return old, newest
    nearest = nearest_to_origin(old)
    if min(nearest.weights) <= 0 or inner(nearest.point, exact([newest])[0]) >= nearest.square:
        return None
    return old, newest


def nearest_with_newest(old, newest, error: float):
    A, B, C = (Vec3(*old[min(k, len(old) - 1)].tolist()) for k in range(3))
    return G.nearest_with_newest(len(old), A, B, C, Vec3(*newest.tolist()), error, 0.0)


def height_below(points) -> Fraction | None:
    """Squared distance of an origin strictly inside four points from the nearest face's plane; None elsewhere."""
    squares = []
    for k in range(4):
        a, b, c = (points[j] for j in range(4) if j != k)
        e, f, g = ([x - y for x, y in zip(p, a)] for p in (b, c, points[k]))
        side, volume = determinant([-x for x in a], e, f), determinant(g, e, f)
        if side * volume <= 0:
            return None
        normal = [e[(i + 1) % 3] * f[(i + 2) % 3] - e[(i + 2) % 3] * f[(i + 1) % 3] for i in range(3)]
        squares.append(side**2 / inner(normal, normal))
    return min(squares)


@pytest.mark.many(6)
@pytest.mark.parametrize("kind", ["random", "around", "lattice", "thin", "any"])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_nearest_point_or_none(n, kind):
    """What is said is the nearest point, of the corners and weights that are said; of what GJK has, it is nearly always
    found."""
    rng = rng_of("grown simplex", n, kind)
    seen: Counter = Counter()
    draws = (grown(rng, n, kind) for _ in range(20_000))
    for (old, newest), _ in zip((draw for draw in draws if draw is not None), range(120)):
        error = float(rng.choice([0.0, 1e-12]))
        with reproducing(SOURCE, old=old, newest=newest, error=error):
            nearest, square = nearest_with_newest(old, newest, error)
            seen[nearest.n_kept] += 1
            corners = np.array([*old, newest])
            true, size = nearest_to_origin(corners), float(np.abs(corners).max())
            if nearest.n_kept == G.INSIDE:
                depth = height_below(exact(corners))
                assert depth is not None and nearest.w0 > error
                assert Fraction(nearest.w0) ** 2 <= depth * (1 + Fraction(1, 10**12))
                continue
            if nearest.n_kept == G.NOT_FOUND:
                continue
            distance = math.sqrt(float(true.square))
            assert abs(math.hypot(*nearest.v) - math.sqrt(square)) <= 4 * ULP * size
            assert distance - 16 * ULP * size <= math.sqrt(square) <= distance * (1 + 2.0**-39) + 16 * ULP * size
            weights = (nearest.w0, nearest.w1, nearest.w2)[: nearest.n_kept]
            assert min(weights) >= 0.0 and abs(sum(weights) - 1.0) <= 4 * ULP
            kept = [newest, *(G.select(nearest.rotation, *rows(old, k)) for k in range(nearest.n_kept - 1))]
            assert np.abs(sum(w * p for w, p in zip(weights, kept)) - nearest.v).max() <= 16 * ULP * size
    assert sum(seen.values()) == 120
    found = {
        ("random", 1): [1, 2], ("random", 2): [2, 3], ("random", 3): [2, 3], ("around", 1): [2],
        ("around", 2): [2, 3], ("around", 3): [2, 3, G.INSIDE], ("thin", 2): [3], ("thin", 3): [3],
        ("lattice", 3): [3], ("any", 3): [3, G.NOT_FOUND],
    }
    assert all(seen[n_kept] >= 4 for n_kept in found.get((kind, n), [])), seen
    assert kind == "any" or (n == 3 and kind in ("thin", "lattice")) or seen[G.NOT_FOUND] <= 6, seen


def rows(old, k: int):
    """The k-th corner behind the newest for rotations 0, 1 and 2."""
    return [old[(rotation + k) % len(old)] for rotation in range(3)]
