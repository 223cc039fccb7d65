"""Points of a patch that may carry: against planes through one, two and three points; patches that must keep them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from collide.contact import carrying_points, contact_points, reduce_patch
from collide.contact.carrying_points import (
    CELLS,
    GENTLEST,
    MAX_CLASSED,
    ON_WALL,
    STEEP,
    choose_carrying,
    mark_carrying,
)
from collide.contact.manifold_points import POINT, ManifoldPoints
from collide.kernels import address_of

pytestmark = pytest.mark.plain_kernels
TOLERANCE = 1e-9


def patch(places: np.ndarray, gaps: np.ndarray) -> contact_points.PatchPoints:
    n = len(places)
    numbers = np.zeros((n + 1, POINT))
    numbers[:n, :2], numbers[:n, 2] = places, gaps
    manifold = ManifoldPoints(numbers.ravel(), np.zeros(2 * n + 2, dtype=np.int64))
    return contact_points.PatchPoints(manifold, np.zeros(n + 1), np.arange(n + 1), np.zeros(18))


def space(n: int) -> reduce_patch.HullSpace:
    return hull_space(max(n + 16, CELLS))


def hull_space(n: int) -> reduce_patch.HullSpace:
    columns = np.zeros(reduce_patch.column_words(n))
    of_hull = reduce_patch.HullSpace(*(np.zeros(n, dtype=np.int64) for _ in range(5)), address_of(columns))
    _columns[of_hull.columns] = columns
    return of_hull


#: Memory of which spaces hold the addresses.
_columns: dict[int, np.ndarray] = {}


def gentlest(places: np.ndarray, gaps: np.ndarray, i: int) -> float:
    """The square of the least slope of a plane through point i that is nowhere above the others, by all candidates."""
    d = np.delete(places, i, axis=0) - places[i]
    h = np.delete(gaps, i) - gaps[i]
    slopes = [np.zeros(2), *(d * (h / (d**2).sum(axis=1))[:, None])]
    for a, b in itertools.combinations(range(len(d)), 2):
        if abs(np.linalg.det(d[[a, b]])) > 1e-9:
            slopes.append(np.linalg.solve(d[[a, b]], h[[a, b]]))
    slopes = np.array(slopes)
    below = (slopes @ d.T <= h + 1e-12).all(axis=1)
    return float((slopes[below] ** 2).sum(axis=1).min(initial=np.inf))


@pytest.mark.many(6)
@pytest.mark.parametrize("seed", range(8))
def test_against_all_planes(seed):
    rng = np.random.default_rng(seed)
    counts = {"carrying": 0, "plain": 0, "gentle": 0, "inside": 0}
    for _ in range(12):
        n = int(rng.integers(4, 22))
        places = rng.normal(size=(n, 2))
        gaps = 0.2 * rng.choice([1.0, 0.1, 0.01]) * rng.normal(size=n) + 0.3 * rng.integers(0, 2) * (places**2).sum(1)
        points, of_hull = patch(places, gaps), space(n)
        n_corners = reduce_patch.hull_of_patch(points, n, TOLERANCE, of_hull)
        standing = np.flatnonzero(of_hull.remaining[:n] != ON_WALL)
        corners = set(of_hull.corners[:n_corners].tolist())
        mark_carrying(points.manifold.points, n, n_corners, TOLERANCE, of_hull)
        for at, i in enumerate(standing.tolist()):
            square = gentlest(places[standing], gaps[standing], at)
            where = f"point {i} of places = {places.tolist()}, gaps = {gaps.tolist()}: {square}"
            kind = of_hull.remaining[i]
            slopes = 4.0 ** -np.arange(GENTLEST - STEEP + 1) * (1 + 1e-9)
            assert np.abs(np.sqrt(square) / slopes - 1.0).min() > 1e-7, where  # neither way by rounding
            assert kind == STEEP - 1 + (np.sqrt(square) <= slopes).sum(), where
            counts["carrying"] += kind >= STEEP
            counts["gentle"] += kind > STEEP
            counts["inside"] += kind >= STEEP and i not in corners
            counts["plain"] += kind < STEEP
    assert min(counts.values()) > 8, counts


def test_flat_patches_are_their_corners():
    """Points within a flat patch, or on its sides, carry nothing that the corners do not."""
    u, v = np.meshgrid(np.arange(5.0), np.arange(4.0))
    places = np.stack([u.ravel(), v.ravel()], axis=1)
    for tilt in ((0.0, 0.0), (1e-3, -2e-3), (0.3, 0.1)):
        points, of_hull = patch(places, places @ tilt), space(len(places))
        target = patch(places, np.zeros(len(places)))
        n = reduce_patch.reduce_patch(points, len(places), TOLERANCE, 8, target, of_hull)
        kept = target.manifold.points.reshape(-1, POINT)[of_hull.order[:n], :2]
        assert {tuple(p) for p in kept.tolist()} == {(0.0, 0.0), (4.0, 0.0), (0.0, 3.0), (4.0, 3.0)}, tilt


@pytest.mark.parametrize("max_contacts", [3, 4, 8, 50])
def test_what_touches_is_not_left_out_for_what_hangs_above(max_contacts):
    """A stone on three bumps, among points of its rim that are higher: the bumps stay, however few are asked for."""
    angles = np.arange(10) * (2 * np.pi / 10)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    bumps = np.array([[0.3, 0.0], [-0.2, 0.3], [-0.1, -0.4]])
    places, gaps = np.concatenate([rim, bumps]), np.concatenate([np.full(10, 0.006), [-1e-4, -1.1e-4, -0.9e-4]])
    points, of_hull, target = patch(places, gaps), space(len(places)), patch(places, gaps)
    n = reduce_patch.reduce_patch(points, len(places), TOLERANCE, max_contacts, target, of_hull)
    assert n == min(max_contacts, 13)
    chosen = target.pairs[of_hull.order[:n]].tolist()
    assert chosen[0] == 11 and {10, 11, 12} <= set(chosen) and len(set(chosen)) == n


def test_of_one_class_the_farthest_are_chosen():
    places = np.array([[0.0, 0.0], [0.1, 0.0], [1.0, 0.0], [5.0, 5.0], [0.0, 1.0]])
    points = patch(places, np.zeros(5)).manifold.points
    order = np.zeros(5, dtype=np.int64)
    kinds = np.array([GENTLEST, GENTLEST, GENTLEST, STEEP, GENTLEST])
    assert choose_carrying(points, 5, 3, kinds, order) == 3
    assert order[:3].tolist() == [0, 2, 4]


@pytest.mark.many(2)
@pytest.mark.parametrize("shape", ["rough", "bowl"])
def test_of_many_points_few_are_asked_and_each_compared_with_all(shape, monkeypatch):
    """More than MAX_CLASSED points: at most CELLS are asked whether they carry, whichever do so do it among all of
    them, the deepest comes first, and what is kept spans as much as what is kept of all."""
    rng = np.random.default_rng(5)
    n = 2 * MAX_CLASSED
    places = rng.uniform(-1, 1, (n, 2))
    gaps = 0.1 * (places**2).sum(axis=1) if shape == "bowl" else 1e-3 * rng.normal(size=n)
    asked, steps = [], [0]
    slope_below, span_on_border = carrying_points._slope_below, carrying_points._span_on_border

    def counted(p, i, *others):
        asked.append(i)
        return slope_below(p, i, *others)

    def counted_steps(columns_at, at_i, n_before, *others):
        steps[0] += n_before
        return span_on_border(columns_at, at_i, n_before, *others)

    monkeypatch.setattr(carrying_points, "_slope_below", counted)
    monkeypatch.setattr(carrying_points, "_span_on_border", counted_steps)
    points, of_hull, target = patch(places, gaps), space(n), patch(places, gaps)
    kept = reduce_patch.reduce_patch(points, n, TOLERANCE, 8, target, of_hull)
    chosen = target.pairs[of_hull.order[:kept]]
    assert kept == 8 and chosen[0] == np.argmin(gaps)
    assert len(asked) <= CELLS < MAX_CLASSED and len(set(asked)) == len(asked)
    assert steps[0] <= 16 * n * len(asked)  # of n² / 2 in the order of a sweep
    carrying = [i for i in asked if of_hull.remaining[i] >= STEEP]
    assert len(carrying) > 4
    for i in carrying[:6]:
        away, rise = np.delete(places - places[i], i, axis=0), np.delete(gaps - gaps[i], i)
        found = linprog([0, 0, 1], np.hstack([away, -np.ones((n - 1, 1))]), rise, bounds=[(-1, 1), (-1, 1), (0, None)])
        assert found.fun < 2 * TOLERANCE, f"point {i} of seed 5, {shape}, does not carry: {found.fun}"
    monkeypatch.setattr(carrying_points, "MAX_CLASSED", n)
    of_all = target.pairs[of_hull.order[: reduce_patch.reduce_patch(points, n, TOLERANCE, 8, target, of_hull)]]
    assert (np.ptp(places[chosen], axis=0) > 0.6 * np.ptp(places[of_all], axis=0)).all()


def test_corners_are_compared_once_though_walls_fall_layer_by_layer():
    """A pit with steep walls of many layers: the hull is that of its ground, as by all points that are on no wall."""
    rng = np.random.default_rng(7)
    angles, layers = rng.uniform(0, 2 * np.pi, 600), np.repeat(np.arange(20), 30)
    radii = 1.0 + 0.001 * layers
    wall = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    ground = rng.uniform(-0.5, 0.5, (200, 2))
    places, gaps = np.concatenate([ground, wall]), np.concatenate([np.zeros(200), 0.1 + 5.0 * layers])
    points, of_hull = patch(places, gaps), space(len(places))
    n_corners = reduce_patch.hull_of_patch(points, len(places), TOLERANCE, of_hull)
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    rise = gaps[:, None] - gaps
    is_wall = ((rise > TOLERANCE) & (rise - TOLERANCE > 2.0 * apart)).any(axis=1)
    assert is_wall[200:].mean() > 0.9
    standing = np.flatnonzero(~is_wall)
    expected = set(standing[ConvexHull(places[standing]).vertices].tolist())
    assert set(of_hull.corners[:n_corners].tolist()) == expected
    assert set(np.unique(of_hull.remaining[: len(places)]).tolist()) <= {ON_WALL, ON_WALL + 1}
