"""Configuration obstacles of polygons: where they meet, figure 10's n³ holes, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from planar_obstacle_judge import (
    HALF_TURN,
    cases,
    combs,
    frame,
    judge_planar,
    letter_u,
    snippet_planar,
    square,
    turned_by,
)

import collide
from collide.errors import CollideError, InvalidArgument, InvalidPose, UnsupportedQuery
from collide.solids import planar_obstacle as module

obstacle = collide.configuration_obstacle


@pytest.mark.parametrize("name", cases())
def test_positions_are_where_the_polygons_meet(name):
    """Around, within 1e-9 of an edge, an ulp off, and on it, where they touch."""
    for seed in range(2 if "star" in name else 1):
        v = judge_planar(*cases(seed)[name], 40, 4, seed)
        assert not v.wrong, f"{v.wrong[:3]}\n{snippet_planar(name, 40, 4, seed)}"
        assert 4 < v.n_in < v.n_points - 4


def test_combs_and_zigzags_count_n_cubed():
    """n² teeth cut n spikes apart: between them are n³ holes."""
    for n in (2, 4, 6):
        r = obstacle(*combs(n))
        assert len(r.rings) == n**3 + 1
        assert sum(map(len, r.rings)) >= 4 * n**3


def test_areas_and_rings():
    r = obstacle([square()], [square()])
    assert r.area == 4.0 and r.rings[0].tolist() == [[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]
    r = obstacle(frame(), [square(size=0.5)])
    assert sorted(map(len, r.rings)) == [4, 4] and r.area == 3.5**2 - 0.5**2
    assert len(obstacle(frame(), [square()]).rings) == 1
    r = obstacle(frame(), [square(size=1 - 2.0**-40)])
    assert len(r.rings) == 2 and np.ptp(r.rings[1], axis=0).tolist() == [2.0**-40] * 2
    r = obstacle(frame(), [square(size=2.0)])
    assert r.area == 25.0 and r.n_asked  # the overlap is a ring: its Euler characteristic is 0


def test_it_is_a_slice_of_the_one_in_space():
    """Prisms over the polygons: the obstacle of heights 1 and 1 has volume area · 2."""
    A, B, R = letter_u(), np.array([(0.0, 0.0), (2.0, 0.0), (0.5, 0.5), (0.0, 2.0)]), turned_by(0.4)
    X = np.eye(3)
    X[:2, :2] = R
    volume = obstacle(_prism(A[0]), _prism(B), X).mesh.report.volume
    assert volume == pytest.approx(2.0 * obstacle(A, [B], R).area, rel=1e-12)


def _prism(ring):
    """Of a polygon of few corners, by ears."""
    n = len(ring)
    left, flat = list(range(n)), []
    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            corners = ring[[a, b, c]]
            if _twice(corners) > 0 and not any(_inside(corners, ring[p]) for p in left if p not in (a, b, c)):
                flat.append((a, b, c))
                left.pop(k)
                break
    flat = np.array([*flat, tuple(left)])
    k = np.arange(n)
    sides = [np.stack([k, (k + 1) % n, (k + 1) % n + n], axis=1), np.stack([k, (k + 1) % n + n, k + n], axis=1)]
    vertices = np.concatenate([np.column_stack([ring, np.full(n, z)]) for z in (0.0, 1.0)])
    return collide.Mesh(vertices, np.concatenate([flat[:, ::-1], flat + n, *sides]))


def _twice(corners):
    (a, b), (c, d), (e, f) = corners
    return (c - a) * (f - b) - (d - b) * (e - a)


def _inside(corners, p):
    return all(_twice([corners[i], corners[i - 2], p]) >= 0 for i in range(3))


def test_bad_input():
    b = [square()]
    for bad, words in [
        ([], "list of rings"), ([[(0, 0), (1, 0)]], "ring 0 of A must be"), ([square() * np.nan], "finite corners"),
        ([np.array([(0, 0), (1, 1), (1, 0), (0, 1)])], "touch or cross"), ([square()[::-1]], "wind -1 times"),
        ([square(size=3.0), square(1.0, 1.0)], "wind 2 times"), ([square(), square(1.0)], "touch or cross"),
        ([np.repeat(square(), 2, axis=0)], "one place"), ("polygon", "ring 0 of A"),
        ([np.array([(0, 0), (2, 0), (1, 0), (1, 1)])], "touch or cross"),
    ]:
        with pytest.raises(InvalidArgument, match=words):
            obstacle(bad, b)
    with pytest.raises(InvalidArgument, match="list of rings"):
        obstacle(b, None)
    with pytest.raises(InvalidArgument, match=r"\(2, 2\) rotation"):
        obstacle(b, b, np.eye(3))
    for R in (2 * np.eye(2), np.diag([1.0, -1.0])):
        with pytest.raises(InvalidPose):
            obstacle(b, b, R)
    with pytest.raises(UnsupportedQuery, match="time_limit"):
        obstacle(b, b, time_limit=1e-9)
    with pytest.raises(UnsupportedQuery, match="memory=100"):
        obstacle(letter_u(), frame(), HALF_TURN, memory=100)
    with pytest.raises(InvalidArgument, match="two solids or two polygons"):
        obstacle(b, collide.Box((1, 1, 1)))


def test_faults_are_noticed(monkeypatch):
    """Reflex corners left out, faces of number 0 left out."""

    def noticed(name) -> bool:
        try:
            return bool(judge_planar(*cases()[name], 200, 0, 1).wrong)
        except CollideError:
            return True

    def convex_alone(*args, right=module._corner_counts):
        return np.maximum(right(*args), 0)

    for fault_name, fault, name in (
        ("_corner_counts", convex_alone, "letters"),
        ("polygons_meet_at", lambda P, Q, x: False, "a frame and a larger square"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(module, fault_name, fault)
            assert noticed(name), fault_name


def test_turned_by_any_angle():
    r = obstacle([square()], [square(-0.5, -0.5)], turned_by(0.4))
    assert r.area == pytest.approx(2.0 + 2.0 * (np.cos(0.4) + np.sin(0.4)), rel=1e-14)
