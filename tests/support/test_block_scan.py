"""The scan in vectors against the same scan one number at a time, and against Python's own floats: bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from collide.kernels import address_of, entry, view_f64, view_i64
from collide.numerics.vec3 import Vec3
from collide.support.block_scan import farthest, farthest_listed, farthest_one_by_one
from collide.support.support_mapping import support_vertex

pytestmark = pytest.mark.own_kernels

COUNTS = (*range(8, 140), *range(144, 513, 8), 511, 1024, 2047, 2048)


WAYS = ("one by one", "vectors", "vectors for lists")


def _scan_all(at_coordinates, size, start, stride, count, at_directions, n, way, at_index, at_value):
    coordinates = view_f64(at_coordinates, size)
    g = view_f64(at_directions, 3 * n)
    index = view_i64(at_index, n)
    value = view_f64(at_value, n)
    for i in range(n):
        if way == 1:
            index[i], value[i] = farthest(coordinates, start, stride, count, g[3 * i], g[3 * i + 1], g[3 * i + 2])
        elif way == 2:
            index[i], value[i] = farthest_listed(
                coordinates, start, stride, count, g[3 * i], g[3 * i + 1], g[3 * i + 2]
            )
        else:
            index[i], value[i] = farthest_one_by_one(
                coordinates, start, stride, count, g[3 * i], g[3 * i + 1], g[3 * i + 2]
            )


scan_all = entry("void(int64,int64,int64,int64,int64,int64,int64,int64,int64,int64)")(_scan_all)


def _support(at_coordinates, n, m, gx, gy, gz):
    return support_vertex(view_f64(at_coordinates, 3 * m), m, Vec3(gx, gy, gz))


support = entry("int64(int64,int64,int64,float64,float64,float64)")(_support)


def scanned(coordinates, start, stride, count, directions, way=1):
    """(indices, values) for every direction."""
    assert start >= 0 and start + 2 * stride + count <= len(coordinates)
    index, value = np.empty(len(directions), dtype=np.int64), np.empty(len(directions))
    scan_all(
        address_of(coordinates), len(coordinates), start, stride, count, address_of(directions), len(directions),
        way, address_of(index), address_of(value),
    )
    return index, value


def expected(coordinates, start, stride, count, direction):
    """Python's floats round every product and every sum by itself; `max` keeps the first of equals."""
    x, y, z = (coordinates[start + axis * stride :][:count].tolist() for axis in range(3))
    gx, gy, gz = direction.tolist()
    values = [a * gx + b * gy + c * gz for a, b, c in zip(x, y, z)]
    index = max(range(count), key=values.__getitem__)
    return index, values[index] + 0.0


def check(coordinates, start, stride, count, directions):
    got = [scanned(coordinates, start, stride, count, directions, way) for way in range(len(WAYS))]
    for i, direction in enumerate(directions):
        want = expected(coordinates, start, stride, count, direction)
        for name, (index, value) in zip(WAYS, got):
            assert (index[i], value[i].tobytes()) == (want[0], np.float64(want[1]).tobytes()), (
                f"{name}: ({index[i]}, {value[i]!r}), not {want}: coordinates = "
                f"np.array({coordinates.tolist()}); start, stride, count = {start}, {stride}, {count}; g = "
                f"{direction.tolist()}"
            )


@pytest.mark.parametrize("start, gap", [(0, 0), (5, 3)])
def test_random_points(start, gap):
    """Every count, blocks off their alignment and apart, with bait on either side of them."""
    rng = np.random.default_rng(41)
    for count in COUNTS:
        stride = count + gap
        coordinates = np.full(start + 3 * stride + 8, 1e3)
        for axis in range(3):
            coordinates[start + axis * stride :][:count] = rng.normal(size=count)
        check(coordinates, start, stride, count, rng.normal(size=(6, 3)))


def test_planted_maximum_at_every_place():
    rng = np.random.default_rng(42)
    g = np.array([[0.25, -1.0, 0.5]])
    for count in (*range(8, 100), *range(104, 513, 8)):
        coordinates = rng.uniform(-1, 1, size=3 * count)
        for place in range(count):
            kept = coordinates[count + place]
            coordinates[count + place] = -9.0
            index, _ = scanned(coordinates, 0, count, count, g)
            assert index[0] == place, (count, place)
            coordinates[count + place] = kept


def test_lowest_index_wins_ties():
    rng = np.random.default_rng(43)
    g = np.array([[1.0, 0.0, 0.0]])
    for count in (*range(8, 40), 64, 71, 128, 256):
        for _ in range(200):
            coordinates = np.zeros(3 * count)
            coordinates[:count] = rng.integers(-3, 0, size=count)
            ties = rng.choice(count, size=rng.integers(2, 6), replace=False)
            coordinates[ties] = 2.0
            index, value = scanned(coordinates, 0, count, count, g)
            assert (index[0], value[0]) == (ties.min(), 2.0), (count, ties.tolist())


def test_small_integers_tie_everywhere():
    rng = np.random.default_rng(44)
    for count in (*range(8, 42), 80, 136, 512):
        for _ in range(8):
            coordinates = rng.integers(-2, 3, size=3 * count).astype(float)
            check(coordinates, 0, count, count, rng.integers(-2, 3, size=(10, 3)).astype(float))


def test_zeros_of_both_signs():
    rng = np.random.default_rng(45)
    for count in (8, 13, 16, 23, 24, 64):
        for _ in range(50):
            coordinates = rng.choice([0.0, -0.0, -1.0], size=3 * count)
            check(coordinates, 0, count, count, np.abs(rng.choice([0.0, -0.0, 1.0], size=(4, 3))))
            check(coordinates, 0, count, count, rng.choice([0.0, -0.0, 1.0], size=(4, 3)))


def test_nothing_is_contracted():
    """Values that a fused multiply-add would round otherwise, and equal ones that it would tell apart."""
    rng = np.random.default_rng(46)
    for count in (8, 64):
        coordinates = rng.uniform(1, 2, size=3 * count)
        coordinates[2 * count :] = coordinates[:count]
        g = rng.uniform(1, 2, size=(40, 3))
        g[:, 2] = -g[:, 0]
        check(coordinates, 0, count, count, g)


def test_very_large_and_very_small():
    rng = np.random.default_rng(47)
    for count in (8, 24, 128):
        for size in (1e-300, 1e-160, 1e150, 1e300):
            check(rng.normal(size=3 * count) * size, 0, count, count, rng.normal(size=(4, 3)))
        with np.errstate(over="ignore"):  # all values −∞: the first of them
            check(np.full(3 * count, -1e300), 0, count, count, np.full((1, 3), 1e300))


def test_filling_never_wins():
    """`support_vertex` scans copies of vertex 0 too."""
    rng = np.random.default_rng(48)
    for n in range(1, 41):
        m = -(-n // 8) * 8
        points = rng.integers(-2, 3, size=(n, 3)).astype(float)
        columns = np.concatenate([points, np.repeat(points[:1], m - n, axis=0)]).T.copy()
        for g in rng.integers(-2, 3, size=(10, 3)).astype(float):
            values = (points * g).sum(axis=1)
            assert support(address_of(columns), n, m, *g) == values.argmax(), (points.tolist(), g.tolist())


def test_same_bits_as_plain_python():
    """The twin as Python runs it, uncompiled."""
    plain = getattr(farthest_one_by_one, "py_func", farthest_one_by_one)
    rng = np.random.default_rng(49)
    for count in (8, 16, 56):
        coordinates, g = rng.normal(size=3 * count), rng.normal(size=(20, 3))
        index, value = scanned(coordinates, 0, count, count, g)
        for i in range(len(g)):
            assert (index[i], value[i]) == plain(coordinates, 0, count, count, *g[i])
