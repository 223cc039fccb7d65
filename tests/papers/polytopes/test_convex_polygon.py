"""ConvexPolygon: an exact hull, immutable, what is no polygon refused by name."""

from __future__ import annotations

import copy
import pickle
from fractions import Fraction

import numpy as np
import pytest
from reproduction import reproducing

from collide import ConvexPolygon
from collide.errors import InvalidShape


def naive_corners(points) -> set[tuple[float, float]]:
    """Points that are no convex combination of others: by all lines through two points, in fractions."""
    unique = sorted({(float(x) + 0.0, float(y) + 0.0) for x, y in points})
    exact = [(Fraction(x), Fraction(y)) for x, y in unique]
    corners = set()
    for i, (x, y) in enumerate(exact):
        rest = [(p - x, q - y) for k, (p, q) in enumerate(exact) if k != i]
        if not rest:
            corners.add(unique[i])
            continue
        # A corner sees all others within less than half a turn: some of them has all others on its left, none behind.
        if any(all(a * q - b * p > 0 or (a * q == b * p and a * p + b * q > 0) for p, q in rest) for a, b in rest):
            corners.add(unique[i])
    return corners


@pytest.mark.parametrize("seed", range(6))
def test_hull_is_exact(seed):
    rng = np.random.default_rng(seed)
    flat = 0
    for k in range(40):
        n = int(rng.choice([1, 2, 3, 5, 9, 16]))
        points = rng.integers(-3, 4, (n, 2)) * 0.1 if k % 2 else rng.normal(size=(n, 2))
        if k % 5 == 0:  # on a line, or within an ulp of it
            points = rng.integers(-4, 5, n)[:, None] * np.array([[0.1, 0.3]])
        with reproducing("from collide import ConvexPolygon; print(ConvexPolygon({points}).vertices)", points=points):
            polygon = ConvexPolygon(points)
            corners = [tuple(v) for v in polygon.vertices.tolist()]
            assert len(set(corners)) == len(corners) and set(corners) == naive_corners(points)
            assert np.array_equal(polygon.vertices, points[polygon.ids])
            flat += len(corners) < 3
            for i in range(len(corners) if len(corners) > 2 else 0):
                (ax, ay), (bx, by), (cx, cy) = (
                    (Fraction(x), Fraction(y)) for x, y in (corners[i - 2], corners[i - 1], corners[i])
                )
                assert (bx - ax) * (cy - ay) > (by - ay) * (cx - ax)
    assert flat >= 8


def test_counter_clockwise_corners_stay():
    corners = np.array([(1.0, 1.0), (0.0, 1.0), (0.0, 0.0), (1.0, 0.0)])
    polygon = ConvexPolygon(corners)
    assert np.array_equal(polygon.vertices, corners) and polygon.ids.tolist() == [0, 1, 2, 3]
    assert ConvexPolygon(corners[::-1]).ids.tolist() == [1, 0, 3, 2]
    assert ConvexPolygon([(0, 0)] * 1000).vertices.tolist() == [[0, 0]]


def test_is_immutable_and_a_value():
    polygon = ConvexPolygon([(0, 0), (2, 0), (0, 1)])
    with pytest.raises(AttributeError, match="immutable"):
        polygon.vertices = 0
    with pytest.raises(AttributeError, match="cannot be deleted"):
        del polygon.vertices
    with pytest.raises(ValueError, match="read-only"):
        polygon.vertices[0, 0] = 1
    assert copy.copy(polygon) is polygon and copy.deepcopy(polygon) is polygon
    assert pickle.loads(pickle.dumps(polygon)) == polygon and len({polygon, ConvexPolygon(polygon.vertices)}) == 1
    assert polygon != ConvexPolygon([(0, 0), (2, 0), (0, 2)]) and repr(polygon) == "ConvexPolygon(<3 vertices>)"


@pytest.mark.parametrize(
    ("points", "complaint"),
    [
        ([], "points is empty"), ([(0, 0, 0)], r"points must have shape \(N, 2\)"),
        (np.zeros((0, 2)), "points is empty"), ([(0, np.nan)], r"points\[0, 1\] is nan"),
        ([(1e60, 0)], "within ±1e"), ([(1e-60, 0)], "at least 1e-50"), ("no", "real numbers"),
    ],
)
def test_refused(points, complaint):
    with pytest.raises(InvalidShape, match=complaint):
        ConvexPolygon(points)
