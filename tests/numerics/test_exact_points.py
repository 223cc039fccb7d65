"""Points under poses in integers, against Fractions; where a ray enters a triangle, against its edges one by one."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from naive import random_pose, rng_of
from naive_triangles import world_points
from reproduction import reproducing

from collide.numerics import exact_points as E


def random_points(rng, n: int) -> np.ndarray:
    return rng.normal(size=(n, 3)) * 2.0 ** rng.integers(-60, 60, size=(n, 3))


def test_doubles_as_integers():
    rng = rng_of("integers")
    for values in (random_points(rng, 20), np.array([0.0, -0.0]), np.array([5e-324, 1e308]), np.array([3.0])):
        whole, exponent = E.integers(values)
        assert [Fraction(x) for x in values.ravel().tolist()] == [n * Fraction(2) ** exponent for n in whole]
    assert E.integers([0.0, 0.0]) == ([0, 0], 0)


def test_placed_points_are_exact():
    rng = rng_of("placed")
    for _ in range(50):
        X, points = random_pose(rng), random_points(rng, 4)
        numbers, grid = E.placed(X, points)
        assert [[Fraction(2) ** grid * x for x in p] for p in numbers] == world_points(points, X)


def test_groups_come_onto_one_grid():
    rng = rng_of("one grid")
    X = [random_pose(rng) for _ in range(3)]
    points = [random_points(rng, n) * scale for n, scale in ((1, 1.0), (3, 1e-20), (2, 1e12))]
    groups, grid = E.on_one_grid(*(E.placed(*pair) for pair in zip(X, points)))
    assert [[[Fraction(2) ** grid * x for x in p] for p in group] for group in groups] == [
        world_points(p, pose) for p, pose in zip(points, X)
    ]


def test_rounding_down_and_up():
    rng = rng_of("rounded")
    exact = 0
    for _ in range(300):
        value = Fraction(int(rng.integers(-(2**62), 2**62)), int(rng.integers(1, 2**62)))
        if rng.random() < 0.3:
            value = Fraction(int(rng.integers(-(2**52), 2**52)), 8)
        exponent = int(rng.integers(-80, 80))
        nearest, low, high = E.rounded(value, exponent)
        true = value * Fraction(2) ** exponent
        assert nearest == float(true) and low <= nearest <= high
        assert Fraction(low) <= true <= Fraction(high) and high <= math.nextafter(low, math.inf)
        exact += low == high
    assert 10 < exact < 290
    most = math.nextafter(math.inf, 0.0)
    assert E.rounded(Fraction(1), 2000) == (math.inf, most, math.inf)
    assert E.rounded(Fraction(-1), 2000) == (-math.inf, -math.inf, -most)


def test_leading_digits_keep_the_direction():
    rng = rng_of("leading digits")
    for _ in range(100):
        vector = tuple(int(x) << int(rng.integers(0, 400)) for x in rng.integers(-(2**40), 2**40, 3))
        found = E.leading_digits(vector)
        assert 0.5 <= max(map(abs, found)) < 1.0
        scale = Fraction(max(abs(x) for x in found)) / max(abs(x) for x in vector)
        assert all(abs(Fraction(f) - scale * x) <= Fraction(1, 2**52) for f, x in zip(found, vector))
    assert E.leading_digits((0, 0, 0)) == (0.0, 0.0, 0.0)


# --- rays ---------------------------------------------------------------------------------------


def entry_by_candidates(triangle, origin, direction) -> Fraction | None:
    """The least t ≥ 0 with origin + t·direction in the closed triangle: of all t at which something can begin, the
    least whose point is in the triangle, judged by solving for it."""
    v = [E.minus(p, origin) for p in triangle]
    n = E.cross(E.minus(v[1], v[0]), E.minus(v[2], v[0]))
    slope = E.inner(n, direction)
    candidates = {Fraction(0)}
    if slope:
        candidates.add(Fraction(E.inner(n, v[0]), slope))
    square = E.inner(direction, direction)
    for p, q in ((v[0], v[1]), (v[1], v[2]), (v[2], v[0])):
        candidates.add(Fraction(E.inner(p, direction), square))
        edge = E.minus(q, p)
        across = E.cross(direction, edge)
        if across != (0, 0, 0):
            candidates.add(Fraction(E.inner(E.cross(p, edge), across), E.inner(across, across)))
    inside = [t for t in candidates if t >= 0 and in_triangle(tuple(t * x for x in direction), v)]
    return min(inside) if inside else None


def in_triangle(x, v) -> bool:
    n = E.cross(E.minus(v[1], v[0]), E.minus(v[2], v[0]))
    if n == (0, 0, 0):
        return any(on_segment(x, v[i], v[j]) for i, j in ((0, 1), (1, 2), (2, 0)))
    if E.inner(n, E.minus(x, v[0])) != 0:
        return False
    return all(
        E.inner(n, E.cross(E.minus(q, p), E.minus(x, p))) >= 0 for p, q in ((v[0], v[1]), (v[1], v[2]), (v[2], v[0]))
    )


def on_segment(x, p, q) -> bool:
    edge, way = E.minus(q, p), E.minus(x, p)
    if edge == (0, 0, 0):
        return way == (0, 0, 0)
    return E.cross(edge, way) == (0, 0, 0) and 0 <= E.inner(edge, way) <= E.inner(edge, edge)


@pytest.mark.many(2)
@pytest.mark.parametrize("size", [2, 5, 1000])
def test_where_rays_enter_triangles(size):
    """Small lattices: rays in the triangle's plane, along its edges, through corners, and triangles without area."""
    rng = rng_of("enters", size)
    met = flat = at_once = 0
    for _ in range(3000):
        origin, direction, *triangle = (
            tuple(int(x) for x in row) for row in rng.integers(-size, size + 1, size=(5, 3))
        )
        if rng.random() < 0.5:  # towards a point of the triangle, on an edge in half of the cases
            weights = rng.multinomial(4, [1 / 3] * 3) if rng.random() < 0.5 else rng.multinomial(4, [0.5, 0.5, 0.0])
            origin = tuple(4 * x for x in origin)
            direction = E.minus(tuple(int(w) for w in weights @ np.array(triangle)), origin)
            triangle = [tuple(4 * x for x in p) for p in triangle]
        if direction == (0, 0, 0):
            continue
        true = entry_by_candidates(triangle, origin, direction)
        if true is None:
            continue
        with reproducing(
            "from collide.numerics.exact_points import enters; print(enters({t}, {o}, {d}))",
            t=triangle,
            o=origin,
            d=direction,
        ):
            assert E.enters(triangle, origin, direction) == true
        met += 1
        at_once += true == 0
        flat += not E.inner(E.cross(E.minus(triangle[1], triangle[0]), E.minus(triangle[2], triangle[0])), direction)
    assert met > 800 and (size > 2 or min(flat, at_once) > 20), (met, flat, at_once)


# --- points that are made when they are asked for ------------------------------------------------


def drawn_points(rng, kind: int) -> np.ndarray:
    points = rng.normal(size=(int(rng.integers(1, 30)), 3))
    if kind == 1:  # on a grid: many have equal products
        return np.round(3 * points) / 4
    if kind == 2:  # of all magnitudes, denormal ones and such as overflow among them
        return points * 2.0 ** rng.integers(-1070, 1021, points.shape)
    return points + rng.choice((0.0, 2.0**30))


def drawn_vector(rng, kind: int) -> tuple[int, int, int]:
    low, high = ((-2, 3), (-(2**40), 2**40))[int(rng.integers(2))]
    x, y, z = rng.integers(low, high, 3).tolist()
    return (x << 1100, y, z) if kind == 2 and rng.integers(2) else (x, y, z)


def by_fractions(points: np.ndarray, poses: list[np.ndarray]) -> list[list[Fraction]]:
    exact = [[Fraction(v) for v in p] for p in points.tolist()]
    for X in poses:
        rows = [[Fraction(v) for v in row] for row in X[:3].tolist()]
        exact = [[sum((a * b for a, b in zip(row, p)), row[3]) for row in rows] for p in exact]
    return exact


@pytest.mark.parametrize("kind", range(3))
def test_the_first_point_along_a_vector_is_that_of_fractions(kind):
    rng, ties, open_signs, signs = rng_of("points along a vector", kind), 0, 0, 0
    for case in range(150):
        points, poses = drawn_points(rng, kind), [random_pose(rng) for _ in range(case % 3)]
        if case % 5 == 0:
            poses = [np.diag((1.0, -1.0, -1.0, 1.0))]
        v = drawn_vector(rng, kind)
        placed, exact = E.PlacedPoints(points, poses), by_fractions(points, poses)
        told = f"{points.tolist()}, {[X.tolist() for X in poses]}, {v}"
        unit = Fraction(2) ** placed.grid
        assert [[x * unit for x in p] for p in placed] == exact, told
        assert placed[len(points) - 1] == list(placed)[-1], told
        finer = placed.on_grid(placed.grid - 7)
        assert finer[0] == tuple(x << 7 for x in placed[0]), told
        products = [sum(a * b for a, b in zip(v, p)) for p in exact]
        assert placed.first_along(v) == products.index(min(products)), told
        ties += products.count(min(products)) > 1
        last = [sum(a * b for a, b in zip(v, exact[-1]))] * len(exact)
        for seen, heights in ((placed, products), (placed.minus(placed[-1]), [a - b for a, b in zip(products, last)])):
            for sign, height in zip(seen.signs_along(v).tolist(), heights):
                assert sign == 0 or sign == (height > 0) - (height < 0), told
                open_signs += sign == 0 and height != 0
                signs += height != 0
    assert ties > (8 if kind == 1 else -1) and signs > 500, (ties, signs)
    assert kind == 2 or open_signs < 0.05 * signs, (open_signs, signs)
