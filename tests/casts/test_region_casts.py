"""How far casts onto regions are followed: what lies beyond changes nothing, and what is not settled is said."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive import rng_of
from reproduction import reproducing

import collide
from collide.casts.region_casts import Way, are_proven, are_to_be_asked_again, limits_of

BALL = collide.Sphere(0.25)


def way(normals, offsets, at, vector, X_WB=None) -> Way:
    region = collide.HPolytope(normals, offsets, bounded=False)
    return Way(BALL, collide.pose(at), region, np.eye(4) if X_WB is None else X_WB, np.array(vector, dtype=float))


def last_behind(normals, offsets, at, vector) -> float:
    """t from which the ball is behind every plane that it moves towards; 0 where it is behind all at once."""
    last = 0.0
    for n, b in zip(np.asarray(normals, dtype=float), offsets):
        length = np.linalg.norm(n)
        height, rate = (n @ np.asarray(at) - b) / length, -(n @ np.asarray(vector)) / length
        if rate > 0 and height + 0.25 > 0:
            last = max(last, (height + 0.25) / rate)
    return last


def test_the_way_ends_behind_all_planes_that_are_approached():
    rng = rng_of("ways")
    for _ in range(60):
        normals, offsets = rng.normal(size=(4, 3)), rng.uniform(0.1, 1.0, 4)
        at, vector = rng.normal(size=3) * 3, rng.normal(size=3)
        with reproducing("normals, offsets, at, v = {n}, {b}, {at}, {v}", n=normals, b=offsets, at=at, v=vector):
            found = way(normals, offsets, at, vector)
            last = last_behind(normals, offsets, at, vector)
            assert found.near <= found.far and found.is_whole and not found.misses
            assert found.far >= last
            # not absurdly far: behind the planes, or as far as the boundary and the body are, with some room
            size = np.linalg.norm(at) + 0.26 + 2.0
            assert found.far <= max(last * 1.01, size / np.linalg.norm(vector)) * 1.1


def test_planes_that_are_hardly_approached_need_a_second_look():
    slow = way([(0, 0, 1), (1, 0, 0)], [0.0, 100.0], (0, 0, 5), (1, 0, -(2.0**-12)))
    assert slow.near < 2.0**12 * 5 <= slow.far and slow.is_whole and not slow.misses
    slower = way([(0, 0, 1)], [0.0], (0, 0, 5), (1, 0, -(2.0**-40)))
    assert slower.far == pytest.approx(2.0**24 * slower.near) and not slower.is_whole
    behind = way([(0, 0, 1)], [0.0], (0, 0, -5), (1, 0, -(2.0**-40)))
    assert behind.far == behind.near and behind.is_whole


def test_bodies_moved_along_a_plane_before_them_miss():
    """Exactly along: never met. An ulp towards it: rounding cannot tell, and it is not said to be whole."""
    for z, vector, misses, is_whole in (
        (2.0, (1, 0, 0), True, True), (0.1, (1, 0, 0), False, True), (-2.0, (1, 0, 0), False, True),
        (2.0, (1, 0, -(2.0**-60)), False, False), (2.0, (1, 0, 2.0**-60), True, True),
    ):
        found = way([(0, 0, 1), (1, 0, 0)], [0.0, 50.0], (0, 0, z), vector)
        assert (found.misses, found.is_whole) == (misses, is_whole), (z, vector)


def test_frames_are_told_apart():
    """A region turned and moved with all that moves towards it has the same way."""
    rng = rng_of("frames of ways")
    normals, offsets = rng.normal(size=(3, 3)), rng.uniform(0.1, 1.0, 3)
    X = collide.pose((3.0, -2.0, 1.0), quat_wxyz=(0.5, 0.5, 0.5, 0.5))
    at, vector = rng.normal(size=3) * 3, rng.normal(size=3)
    here = way(normals, offsets, at, vector)
    there = way(normals, offsets, X[:3, :3] @ at + X[:3, 3], X[:3, :3] @ vector, X)
    assert there.near == pytest.approx(here.near) and there.far == pytest.approx(here.far)
    twice = way(normals, offsets, at, 2.0 * vector)
    assert twice.near == pytest.approx(0.5 * here.near)


class Fixed:
    """A way with given numbers."""

    def __init__(self, near: float, far: float, is_whole: bool, misses: bool):
        self.near, self.far, self.is_whole, self.misses = near, far, is_whole, misses


WAYS = [
    Fixed(1.0, 1.0, True, False),
    Fixed(1.0, 4.0, True, False),
    Fixed(1.0, 4.0, False, False),
    Fixed(1.0, 4.0, True, True),
]


@pytest.mark.parametrize("limit", [0.5, 1.0, 2.0, 4.0, 8.0, math.inf])
@pytest.mark.parametrize("hit", [False, True])
def test_looks(limit, hit):
    """By hand, way by way."""
    limits, hits = np.full(4, limit), np.full(4, hit)
    assert limits_of(WAYS, limits, far=False).tolist() == [min(limit, 1.0)] * 4
    assert limits_of(WAYS, limits, far=True).tolist() == [min(limit, far) for far in (1.0, 4.0, 4.0, 4.0)]
    again = are_to_be_asked_again(WAYS, hits, limits)
    assert again.tolist() == ([1, 2] if not hit and limit > 1.0 else [])
    assert are_proven(WAYS, hits, limits).tolist() == [True, True, hit or limit <= 4.0, True]
