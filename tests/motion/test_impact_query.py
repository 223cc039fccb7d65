"""`time_of_impact` as callers see it: closed forms, batches, threads, lists, swapping, bad input."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from functools import partial

import motions
import numpy as np
import pytest

import collide
from collide import CollideError, InvalidArgument, InvalidPose, UnsupportedQuery

BOX, BALL = collide.Box((1, 1, 1)), collide.Sphere(0.5)
HERE = np.eye(4)


def at(*xyz, rpy=None) -> np.ndarray:
    return collide.pose(xyz, rpy=rpy)


def same(a, b) -> bool:
    return all(np.float64(x).tobytes() == np.float64(y).tobytes() for x, y in zip(a, b))


def test_a_ball_flies_into_a_box():
    r = collide.time_of_impact(BOX, BALL, HERE, HERE, at(3, 0, 0), at(-3, 0, 0))
    assert r.hit is True and r.certified is True
    assert r.lower <= 1 / 3 <= r.upper and r.upper - r.lower <= 1e-9 and r.time == r.lower
    assert r.normal == pytest.approx([1, 0, 0], abs=1e-9)
    assert r.point_a == pytest.approx([0.5, 0, 0], abs=1e-8) and r.point_b == pytest.approx([0.5, 0, 0], abs=1e-8)


def test_free_and_at_the_start():
    free = collide.time_of_impact(BOX, BALL, HERE, HERE, at(3, 0, 0), at(3, 5, 0))
    assert (free.hit, free.time, free.lower, free.upper, free.certified) == (False, 1.0, 1.0, 1.0, True)
    assert not np.any([free.normal, free.point_a, free.point_b])
    start = collide.time_of_impact(BOX, BALL, HERE, HERE, at(0.9, 0, 0), at(5, 0, 0))
    assert (start.hit, start.time, start.upper, start.certified) == (True, 0.0, 0.0, True)
    expected = collide.distance(BOX, BALL, HERE, at(0.9, 0, 0))
    assert (start.normal == expected.normal).all() and (start.point_a == expected.point_a).all()


@pytest.mark.parametrize("x, hit", [(1.0, True), (math.nextafter(1.0, 2.0), None)])
def test_a_start_that_just_touches_is_decided_exactly(x, hit):
    """Two boxes face to face: touching exactly is contact at 0; one unit in the last place apart, and going away,
    cannot be told from rounding in between, and is said to be open, not proven."""
    r = collide.time_of_impact(BOX, BOX, HERE, HERE, at(x, 0, 0), at(x + 1.0, 0, 0))
    if hit:
        assert (r.hit, r.upper, r.certified) == (True, 0.0, True)
    else:
        assert r.lower == 0.0 and not r.certified and r.upper == math.inf


def _exact_time(d0, d1, half) -> Fraction | None:
    """When boxes with parallel axes first touch, in rationals: d0 and d1 from one centre to the other, half the sum of
    their sizes."""
    begin, end = Fraction(0), Fraction(1)
    for x0, x1, h in zip(d0, d1, half):
        v = x1 - x0
        if v == 0:
            if abs(x0) > h:
                return None
            continue
        first, last = sorted(((-h - x0) / v, (h - x0) / v))
        begin, end = max(begin, first), min(end, last)
    return begin if begin <= end else None


def test_boxes_that_slide_are_judged_in_rationals():
    """No tolerance: the exact time lies in the bracket, and what is said to be free is free. A third of the numbers are
    eighths: corners that just pass, faces that slide along each other."""
    rng = np.random.default_rng(17)
    n, n_hits, n_open = 3000, 0, 0
    sizes = rng.integers(1, 9, (2, 3)) / 8.0
    p = rng.uniform(-2, 2, (4, n, 3))
    p[:, ::3] = rng.integers(-16, 17, p[:, ::3].shape) / 8.0
    p[2, 1::3] *= 10.0 ** rng.uniform(0, 4, (len(p[2, 1::3]), 1))
    X = np.tile(np.eye(4), (4, n, 1, 1))
    X[:, :, :3, 3] = p
    r = collide.time_of_impact(collide.Box(sizes[0]), collide.Box(sizes[1]), *X)
    half = [(Fraction(a) + Fraction(b)) / 2 for a, b in sizes.T.tolist()]
    for k in range(n):
        a0, a1, b0, b1 = ([Fraction(x) for x in of[k].tolist()] for of in p)
        truth = _exact_time([b - a for a, b in zip(a0, b0)], [b - a for a, b in zip(a1, b1)], half)
        said = f"sizes {sizes.tolist()}, from {p[:, k].tolist()}: {r.lower[k]!r} … {r.upper[k]!r}, exactly {truth}"
        if truth is None:
            assert not r.hit[k] or r.upper[k] == math.inf, said
            n_open += r.hit[k]
        else:
            assert r.hit[k] and r.lower[k] <= truth, said
            assert r.upper[k] == math.inf or truth <= Fraction(r.upper[k]), said
            n_hits += 1
    assert 200 < n_hits < 2800 and n_open < 30


def test_a_needle_turns_into_a_plate():
    """Closed form: the tip of a rod of length 2 at height 1/2 above a half-space, turning by a right angle."""
    rod = collide.ConvexHull([(-1, 0, 0), (1, 0, 0)])
    plane = collide.Halfspace((0, 0, 1), 0.0)
    r = collide.time_of_impact(plane, rod, HERE, HERE, at(0, 0, 0.5), at(0, 0, 0.5, rpy=(0, math.pi / 2, 0)))
    truth = math.asin(0.5) / (math.pi / 2)
    assert r.lower <= truth + 1e-15 and truth - 1e-15 <= r.upper and r.certified


@pytest.mark.parametrize("turns", [0.75, 3.25, 40.25, 1000.25])
def test_motions_of_many_turns(turns):
    """A rod beside a ball: it is met within the first turn, however many follow; a ball just out of reach never is."""
    rod, omega = collide.Box((2, 0.01, 0.01)), np.array([0, 0, 2 * math.pi * turns])
    end = collide.moved_poses(HERE, (0, 0, 0), omega)
    near, far = at(0, 1.05, 0), at(0, 1.2, 0)
    ball = collide.Sphere(0.1)
    hit = collide.time_of_impact(rod, ball, HERE, end, near, near, omega_WA=omega)
    free = collide.time_of_impact(rod, ball, HERE, end, far, far, omega_WA=omega)
    assert hit.hit and hit.certified and 0.1 < hit.time * turns * 4 < 1.0
    assert not free.hit


def test_the_shortest_way_is_taken_without_an_angular_velocity():
    """A blade turns by 3/4 of a turn one way, or by 1/4 the other; the ball stands in the longer way."""
    blade, ball = collide.Box((2, 0.1, 0.1)), collide.Sphere(0.1)
    omega = np.array([0, 0, 1.5 * math.pi])
    end = collide.moved_poses(HERE, (0, 0, 0), omega)
    where = at(*(0.8 * np.array([math.cos(0.7), math.sin(0.7), 0])))
    assert collide.time_of_impact(blade, ball, HERE, end, where, where, omega_WA=omega).hit
    other = at(*(0.8 * np.array([math.cos(-0.7), math.sin(-0.7), 0])))
    long_way = collide.time_of_impact(blade, ball, HERE, end, other, other, omega_WA=omega)
    short_way = collide.time_of_impact(blade, ball, HERE, end, other, other)
    assert short_way.hit and long_way.hit and short_way.time != long_way.time


def _random(n: int, seed: int) -> motions.Group:
    return motions.FAMILIES["boxes at random"](np.random.default_rng(seed), n)


def test_batches_singles_and_threads_give_the_same_bits():
    group = _random(900, 1)
    r = collide.time_of_impact(group.A, group.B, *group.poses)
    assert same(r, collide.time_of_impact(group.A, group.B, *group.poses, threads=2))
    assert 200 < r.hit.sum() < 800
    for k in range(0, 900, 60):
        one = collide.time_of_impact(group.A, group.B, *(X[k] for X in group.poses))
        assert same(one, [column[k] for column in r])


def test_single_calls_of_one_pair_from_many_threads():
    """Each thread has its own memory: what one asks does not reach another's answer."""
    group = _random(400, 7)
    r = collide.time_of_impact(group.A, group.B, *group.poses)
    collide.time_of_impact(group.A, group.B, *(X[0] for X in group.poses))
    with ThreadPoolExecutor(4) as threads:
        single = partial(collide.time_of_impact, group.A, group.B)
        ones = list(threads.map(lambda k: single(*(X[k] for X in group.poses)), range(400)))
    for k, one in enumerate(ones):
        assert same(one, [column[k] for column in r])


def test_a_prepared_pair_refuses_what_any_refuses():
    """The short way of single calls leaves bad poses, other types and turns to the long one."""
    collide.time_of_impact(BOX, BALL, HERE, HERE, at(3, 0, 0), at(-3, 0, 0))
    with pytest.raises(InvalidPose, match="X_WB1"):
        collide.time_of_impact(BOX, BALL, HERE, HERE, at(3, 0, 0), np.diag([1.0, 1, 1.1, 1]))
    with pytest.raises(InvalidPose, match="X_WA1"):
        collide.time_of_impact(BOX, BALL, HERE, np.full((4, 4), np.nan), at(3, 0, 0), at(-3, 0, 0))
    plain = collide.time_of_impact(BOX, BALL, HERE, HERE, at(3, 0, 0), at(-3, 0, 0))
    for X in (HERE.tolist(), np.eye(4, dtype=np.float32), np.asfortranarray(HERE), np.eye(8)[::2, ::2]):
        assert same(plain, collide.time_of_impact(BOX, BALL, X, HERE, at(3, 0, 0), at(-3, 0, 0)))
    turned = collide.time_of_impact(BOX, BALL, HERE, HERE, at(3, 0, 0), at(-3, 0, 0), omega_WA=(0, 0, 2 * math.pi))
    assert turned.hit and turned.time < plain.time


def test_swapping_swaps_points_and_negates_the_normal_exactly():
    for family in ("boxes at random", "a sphere and a round or square body", "half-spaces", "spinning rods"):
        g = motions.FAMILIES[family](np.random.default_rng(4), 60)
        r = collide.time_of_impact(g.A, g.B, *g.poses, omega_WA=g.omega_WA, omega_WB=g.omega_WB)
        s = collide.time_of_impact(
            g.B, g.A, g.X_WB0, g.X_WB1, g.X_WA0, g.X_WA1, omega_WA=g.omega_WB, omega_WB=g.omega_WA
        )
        assert same((r.hit, r.lower, r.upper, r.certified), (s.hit, s.lower, s.upper, s.certified)), family
        assert same((r.point_a, r.point_b), (s.point_b, s.point_a)), family
        assert same((r.normal + 0.0,), (0.0 - s.normal,)), family
        assert r.hit.sum() >= 10


def test_lists_of_shapes_and_single_poses_broadcast():
    shapes = [BALL, BOX, collide.Capsule(0.2, 1.0), collide.Compound([(BOX, at(0, 0, 2)), (BALL, HERE)])] * 3
    X0, X1 = at(4, 0.1, 0.2), at(-4, 0.2, 0.1, rpy=(0.3, 0.2, 0.1))
    r = collide.time_of_impact(BOX, shapes, HERE, HERE, X0, X1)
    picked = collide.ShapeSet(shapes[:4])
    assert r.hit.shape == (12,)
    for k, shape in enumerate(shapes[:4]):
        one = collide.time_of_impact(BOX, shape, HERE, HERE, X0, X1)
        assert same(one, [column[k] for column in r]) and same(one, [column[k + 4] for column in r])
    assert same(r, collide.time_of_impact(BOX, picked[np.arange(12) % 4], HERE, HERE, X0, X1))
    none = collide.time_of_impact(BOX, BALL, HERE, HERE, np.zeros((0, 4, 4)), X1)
    assert none.hit.shape == (0,) and none.normal.shape == (0, 3)


def test_compounds_meet_where_their_first_parts_do():
    rng = np.random.default_rng(9)
    parts = [
        (collide.Box(rng.uniform(0.1, 0.5, 3)), at(*rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3)))
        for _ in range(5)
    ]
    union, other = collide.Compound(parts), collide.Capsule(0.1, 0.7)
    group = _random(60, 2)
    r = collide.time_of_impact(union, other, *group.poses)
    assert 10 <= r.hit.sum() <= 55
    lower = np.full(60, 1.0)
    for number, part in enumerate(parts):
        alone = collide.time_of_impact(collide.Compound([part]), other, *group.poses)
        assert (r.lower <= alone.lower + 1e-9).all()
        mine = r.hit & (r.part_a == number) & (r.lower > 0.0)
        assert np.abs(r.lower - alone.lower)[mine].max(initial=0.0) <= 2e-9
        lower = np.minimum(lower, alone.lower)
    assert np.abs(lower - r.lower).max() <= 2e-9


def test_poses_in_motion_begin_and_end_where_they_are_given():
    group = _random(50, 3)
    for time, X in ((0.0, group.X_WA0), (1.0, group.X_WA1)):
        assert np.abs(collide.poses_in_motion(group.X_WA0, group.X_WA1, time) - X).max() <= 1e-15 * 4
    half = collide.poses_in_motion(HERE, at(2, 0, 0, rpy=(0, 0, 1.0)), 0.5)
    assert half == pytest.approx(at(1, 0, 0, rpy=(0, 0, 0.5)), abs=1e-15)
    omega = (0.0, 0.0, 7.0)
    end = collide.moved_poses(HERE, (1, 2, 3), omega)
    assert end == pytest.approx(at(1, 2, 3, rpy=(0, 0, 7.0 - 2 * math.pi)), abs=1e-14)
    assert collide.poses_in_motion(HERE, end, 0.25, omega_WA=omega) == pytest.approx(
        at(0.25, 0.5, 0.75, rpy=(0, 0, 1.75)), abs=1e-14
    )


def test_up_to_its_time_a_motion_is_free_by_distance():
    """The engine's own booleans at poses on the way, which the search does not ask."""
    group = _random(60, 6)
    r = collide.time_of_impact(group.A, group.B, *group.poses)
    for share in np.linspace(0.0, 0.999, 25):
        X_WA = collide.poses_in_motion(group.X_WA0, group.X_WA1, share * r.lower)
        X_WB = collide.poses_in_motion(group.X_WB0, group.X_WB1, share * r.lower)
        assert not (collide.collide(group.A, group.B, X_WA, X_WB) & (r.lower > 0.0)).any()
    moving = r.hit & (r.lower > 0.0)
    X_WA = collide.poses_in_motion(group.X_WA0, group.X_WA1, r.lower)
    X_WB = collide.poses_in_motion(group.X_WB0, group.X_WB1, r.lower)
    gaps = collide.distance(group.A, group.B, X_WA, X_WB)
    assert moving.sum() >= 15 and (np.abs(gaps.distance[moving]) < 1e-7).all()
    assert (np.abs(gaps.point_a - r.point_a)[moving] < 1e-4).mean() > 0.8


# --- bad input ----------------------------------------------------------------------------------

GOOD = {"A": BOX, "B": BALL, "X_WA0": HERE, "X_WA1": HERE, "X_WB0": at(3, 0, 0), "X_WB1": at(-3, 0, 0)}
TWO = np.stack([HERE, HERE])
BAD = [
    ({"A": "box"}, InvalidArgument, "A must be a shape"),
    ({"B": None}, InvalidArgument, "B must be a shape"),
    ({"X_WA1": np.full((4, 4), np.nan)}, InvalidPose, "X_WA1"),
    ({"X_WB0": np.diag([2.0, 1, 1, 1])}, InvalidPose, "X_WB0"),
    ({"X_WB0": np.diag([-1.0, 1, 1, 1])}, InvalidPose, "X_WB0"),
    ({"X_WB1": np.zeros((3, 3))}, InvalidPose, "X_WB1"),
    ({"X_WA0": TWO, "X_WB0": np.stack([HERE] * 3)}, InvalidArgument, "lengths do not match"),
    ({"A": [BOX, BOX, BOX], "X_WA0": TWO}, InvalidArgument, "lengths do not match"),
    ({"omega_WA": (0, 0)}, InvalidArgument, "omega_WA must be"),
    ({"omega_WB": (0, 0, math.inf)}, InvalidArgument, "omega_WB"),
    ({"omega_WB": (0, 0, math.nan)}, InvalidArgument, "omega_WB"),
    ({"omega_WA": (0, 0, 2e6)}, InvalidArgument, "cut the motion"),
    ({"omega_WA": (0, 0, 1.0)}, InvalidArgument, "moved_poses"),
    ({"omega_WA": "fast"}, InvalidArgument, "omega_WA"),
    ({"tolerance": 0.0}, InvalidArgument, "tolerance"),
    ({"tolerance": math.nan}, InvalidArgument, "tolerance"),
    ({"tolerance": -1.0}, InvalidArgument, "tolerance"),
    ({"threads": 0}, InvalidArgument, "threads"),
]


@pytest.mark.parametrize("change, error, words", BAD, ids=[str(list(case[0].items()))[:40] for case in BAD])
def test_bad_input_is_refused_by_name(change, error, words):
    with pytest.raises(error, match=words):
        collide.time_of_impact(**{**GOOD, **change})
    assert issubclass(error if isinstance(error, type) else error[0], CollideError)


def test_two_half_spaces_that_start_apart_are_refused():
    up, down = collide.Halfspace((0, 0, 1), 0.0), collide.Halfspace((0, 0, -1), -1.0)
    with pytest.raises(UnsupportedQuery, match="half-spaces"):
        collide.time_of_impact(up, down, HERE, HERE, HERE, HERE)
    r = collide.time_of_impact(up, up, HERE, HERE, HERE, at(0, 0, 5))
    assert r.hit and r.time == 0.0 and r.certified
