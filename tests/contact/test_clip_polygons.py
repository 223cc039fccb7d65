"""Clipping of polygons and segments against naive intersections, tags of sides included."""

from __future__ import annotations

import numpy as np
import pytest

from collide.contact.clip_polygons import Clipped, clip_polygons, clip_segment, corner_of_b
from collide.contact.support_face import SupportFace

pytestmark = pytest.mark.plain_kernels


def polygon(rng, n: int) -> np.ndarray:
    """A convex polygon, counter-clockwise."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, n))
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) * rng.uniform(0.3, 1.5) + rng.normal(size=2) * 0.5


def face(points: np.ndarray) -> SupportFace:
    corners = np.column_stack([points, np.zeros(len(points))]).ravel()
    none = np.zeros(len(points), dtype=np.int64)
    return SupportFace(len(points), -1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, corners, none, none, -1)


def clip(P: np.ndarray, Q: np.ndarray, tolerance: float = 0.0):
    """(corners, sides) of the overlap of two polygons; Q is handed over as it is seen from behind."""
    n = 2 * (len(P) + len(Q))
    first, second = (Clipped(np.zeros(2 * n), np.zeros(n, dtype=np.int64)) for _ in range(2))
    count, in_second = clip_polygons(face(P), face(Q[::-1]), tolerance, first, second)
    points, sides = second if in_second else first
    return points[: 2 * count].reshape(-1, 2), sides[:count]


def inside(p, polygon, slack: float = 1e-12) -> bool:
    d, w = np.roll(polygon, -1, axis=0) - polygon, p - polygon
    return bool((d[:, 0] * w[:, 1] - d[:, 1] * w[:, 0] >= -slack).all())


def area(p) -> float:
    x, y = np.asarray(p).T
    return 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def sampled_area(P, Q, m: int = 400) -> float:
    """Area of the overlap by counting cells of a grid."""
    low, high = np.minimum(P.min(axis=0), Q.min(axis=0)), np.maximum(P.max(axis=0), Q.max(axis=0))
    x = (np.arange(m) + 0.5) / m
    grid = np.stack(np.meshgrid(*(low[k] + x * (high - low)[k] for k in range(2))), axis=-1).reshape(-1, 2)
    both = np.ones(len(grid), dtype=bool)
    for one in (P, Q):
        for a, b in zip(one, np.roll(one, -1, axis=0)):
            both &= (b - a)[0] * (grid - a)[:, 1] - (b - a)[1] * (grid - a)[:, 0] >= 0
    return both.mean() * float(np.prod(high - low))


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(60))
def test_overlaps_of_polygons(seed):
    rng = np.random.default_rng(seed)
    P, Q = polygon(rng, int(rng.integers(3, 9))), polygon(rng, int(rng.integers(3, 9)))
    points, sides = clip(P, Q)
    wanted = sampled_area(P, Q)
    got = area(points) if len(points) > 2 else 0.0
    assert abs(got - wanted) < 0.02, (seed, got, wanted)
    assert all(inside(p, P, 1e-9) and inside(p, Q, 1e-9) for p in points)
    for k, (p, side) in enumerate(zip(points, sides.tolist())):  # each side lies on the side it is said to be of
        a, b = (P[side], P[(side + 1) % len(P)]) if side >= 0 else (Q[-1 - side], Q[(-side) % len(Q)])
        for q in (p, points[(k + 1) % len(points)]):
            d, w = b - a, q - a
            assert abs(d[0] * w[1] - d[1] * w[0]) < 1e-9, (seed, k, side)
        if side < 0:
            corner = corner_of_b(face(Q[::-1]), -1 - side)
            assert np.array_equal(Q[::-1][corner], Q[-1 - side])


def test_equal_and_touching_polygons():
    square = np.array([(0.0, 0), (1, 0), (1, 1), (0, 1)])
    assert abs(area(clip(square, square)[0]) - 1.0) < 1e-15
    assert len(clip(square, square + 3.0)[0]) == 0
    beside, _ = clip(square, square + np.array((1.0, 0.25)))
    assert len(beside) >= 2 and np.abs(beside[:, 0] - 1.0).max() == 0.0
    assert len(clip(square, square + np.array((1.0 + 1e-09, 0.25)))[0]) == 0
    assert len(clip(square, square + np.array((1.0 + 1e-09, 0.25)), 1e-8)[0]) >= 2


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(60))
def test_segments(seed):
    rng = np.random.default_rng(seed)
    P = polygon(rng, int(rng.integers(3, 9)))
    a, b = rng.normal(size=(2, 2))
    is_b = bool(seed % 2)
    low, high, low_side, high_side = clip_segment(face(P[::-1] if is_b else P), is_b, *a, *b, 0.0)
    t = (np.arange(2000) + 0.5) / 2000
    within = [inside(a + s * (b - a), P, 0.0) for s in t]
    if not any(within):
        assert high - low < 1e-3
        return
    seen = t[within]
    assert abs(low - seen[0]) < 1e-3 and abs(high - seen[-1]) < 1e-3
    assert (low_side < 0) == inside(a, P, 0.0) and (high_side < 0) == inside(b, P, 0.0)
