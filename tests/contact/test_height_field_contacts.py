"""Bodies at rest on height fields: contacts where they are known, and none from the edges between cells."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from contact_scenes import world_corners
from mesh_shapes import box
from naive import pose, rng_of, spell
from naive_terrain import Terrain
from stepper import Step, Stepper

import collide

EYE = np.eye(4)
MARGIN = 1e-3


def flat(rows=9, columns=11, cell=0.25):
    return collide.HeightField(np.zeros((rows, columns)), cell)


def near(points, wanted, tolerance=1e-9) -> bool:
    """The same points, in any order."""
    off = np.abs(np.asarray(points)[:, None] - np.asarray(wanted)[None]).max(axis=2)
    return off.shape == (len(wanted), len(wanted)) and max(off.min(axis=0).max(), off.min(axis=1).max()) < tolerance


def cells_hold(field, rows, points) -> bool:
    """Whether the facets of rows are triangles on top, below their points but for rounding."""
    cells = field.cells_of(rows.facet_a)
    row_count, columns = field.heights.shape
    v = points[:, 1] / field.cell[1] + 0.5 * (row_count - 1) - cells.row
    u = points[:, 0] / field.cell[0] + 0.5 * (columns - 1) - cells.column
    over = np.where(cells.triangle == 0, u - v, v - u)
    return bool((cells.row >= 0).all() and min(u.min(), v.min(), (1 - u).min(), (1 - v).min(), over.min()) > -1e-6)


@pytest.mark.parametrize("height", [0.0, 1e-6, -1e-6, 5e-4, -1e-4])
def test_a_box_on_a_flat_field_stands_on_its_four_corners(height):
    """Wherever it stands: on lines of the grid, across them, turned."""
    field, rng = flat(), rng_of("box on a flat field", height)
    for number in range(16):
        sides = rng.integers(1, 5, 3) / 8 if number % 2 else rng.uniform(0.1, 0.9, 3)
        place = rng.integers(-5, 6, 2) / 8 if number % 2 else rng.uniform(-0.5, 0.5, 2)
        X_WB = collide.pose((*place, 0.5 * sides[2] + height), rpy=(0, 0, 0 if number % 4 == 1 else rng.uniform(-3, 3)))
        c = collide.contacts(field, collide.Box(sides), EYE, X_WB, margin=MARGIN)
        told = f"{spell(sides)} at {spell(X_WB)}: {c.rows}"
        assert len(c) == 4 and set(c.patch) == {0}, told
        assert np.abs(c.normal - (0, 0, 1)).max() < 1e-12 and np.abs(c.distance - height).max() < 1e-12, told
        half = tuple((0.5 * sides).tolist())
        corners = world_corners(box(tuple(-h for h in half), half)[0], X_WB)
        assert near(c.point_b, corners[corners[:, 2] < height + 1e-9]), told
        assert cells_hold(field, c, c.point_a), told


def test_a_ball_on_a_flat_field_has_one_contact_over_faces_edges_and_grid_points():
    field = flat()
    for place in ((0.0, 0.0), (0.125, 0.0), (0.0, 0.125), (0.125, 0.125), (0.1, 0.03), (0.25, -0.25), (0.3, 0.2)):
        for height in (0.0, 1e-9, 5e-4, -1e-9, -1e-4, -0.05):
            c = collide.contacts(field, collide.Sphere(0.2), EYE, pose(t=(*place, 0.2 + height)), margin=MARGIN)
            told = f"{place}, {height}: {c.rows}"
            assert len(c) == 1 and np.abs(c.normal[0] - (0, 0, 1)).max() < 1e-9, told
            assert abs(c.distance[0] - height) < 1e-12 and cells_hold(field, c, c.point_a), told


def test_a_box_on_a_slope_stands_on_its_four_corners():
    """The slope is flat in doubles: cells lie in one plane."""
    x = np.arange(-4, 5) * 0.25
    rng = rng_of("box on a slope")
    for rise in (0.5, -0.25, 1.0):
        field = collide.HeightField(np.tile(rise * x, (9, 1)), 0.25)
        X_WS = collide.pose(rpy=(0, -math.atan(rise), 0))
        for _ in range(8):
            X_SB = collide.pose((*rng.uniform(-0.3, 0.3, 2), 0.1 + 1e-6), rpy=(0, 0, rng.uniform(-3, 3)))
            c = collide.contacts(field, collide.Box((0.3, 0.4, 0.2)), EYE, X_WS @ X_SB, margin=MARGIN)
            told = f"rise {rise}, {spell(X_SB)}: {c.rows}"
            assert len(c) == 4 and np.abs(c.normal - X_WS[:3, 2]).max() < 1e-9, told
            assert np.abs(c.distance - 1e-6).max() < 1e-12 and cells_hold(field, c, c.point_a), told


def test_a_plate_on_peaks_stands_on_them_alone():
    heights = np.random.default_rng(0).uniform(-0.5, -0.1, (7, 7))
    peaks = [(1, 1), (1, 5), (5, 2), (4, 5)]
    for i, j in peaks:
        heights[i, j] = 0.0
    field = collide.HeightField(heights, 0.25)
    wanted = [((j - 3) * 0.25, (i - 3) * 0.25, 0.0) for i, j in peaks]
    for height in (1e-6, 1e-4):
        c = collide.contacts(field, collide.Box((1.4, 1.4, 0.2)), EYE, pose(t=(0, 0, 0.1 + height)), margin=MARGIN)
        assert near(c.point_a, wanted) and np.abs(c.normal - (0, 0, 1)).max() < 1e-12, c.rows
        assert np.abs(c.distance - height).max() < 1e-12, c.rows


def test_a_ball_over_bumps_touches_where_it_is_nearest():
    """One contact, at the distance and in the direction of the nearest point, in fractions."""
    rng, told = rng_of("ball over bumps"), Counter()
    for number in range(60):
        field = collide.HeightField(rng.normal(size=(5, 4)) * 0.15, (0.25, 0.3))
        centre = rng.uniform((-0.25, -0.25, 0.45), (0.25, 0.25, 0.95)).tolist()
        terrain = Terrain(field.heights.tolist(), field.cell.tolist(), field.bottom)
        if terrain.holds(centre):
            continue
        square = terrain.squared_distance(centre)
        radius = math.sqrt(square) - 1e-4
        c = collide.contacts(field, collide.Sphere(radius), EYE, pose(t=centre), margin=1.05e-4)
        source = f"{number}: {spell(field)}, Sphere({radius!r}) at {centre}: {c.rows}"
        assert c.lower[0] <= c.distance[0] <= c.upper[0], source
        assert (Fraction(c.distance[0]) + Fraction(radius)) ** 2 == pytest.approx(square, rel=1e-12), source
        foot = np.array(centre) - c.normal[0] * math.sqrt(square)
        assert float(terrain.squared_distance(foot.tolist())) < 1e-24, source
        told[len(c)] += 1
    assert told[1] > 40 and told.total() - told[1] <= 2, told


def bumpy_bowl(seed: int) -> collide.HeightField:
    x, y = np.meshgrid(np.linspace(-2, 2, 41), np.linspace(-2, 2, 41))
    rough = rng_of("bumpy bowl", seed).normal(size=x.shape) * 0.004
    return collide.HeightField(0.05 * (x * x + y * y) + 0.03 * np.sin(7 * x) * np.cos(6 * y) + rough, 0.1)


def stepped(stepper: Stepper, seconds: float) -> list[Step]:
    """Steps in which energy never rises above what there was, but for the error of a substep of free fall."""
    start = stepper.energy()
    steps = [stepper.step() for _ in range(round(seconds / stepper.dt))]
    assert max(step.energy for step in steps) <= start + stepper.mass.sum() * (9.81 * stepper.dt / 8) ** 2
    return steps


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_bodies_that_fall_on_bumps_stay_there(seed):
    """A box and a tetrahedron, from above and askew: for two seconds they stay within a tenth of a millimetre, sink
    less than half of one, and gain no energy. A patch has all the peaks that carry (`carrying_points.py`)."""
    stepper, size = Stepper(friction=0.6), np.array([0.3, 0.2, 0.1])
    stepper.add(bumpy_bowl(seed), EYE)
    inertia = (np.square(size).sum() - np.square(size)) / 12
    stepper.add(collide.Box(size), collide.pose((-0.6, 0.1, 0.35), rpy=(0.2, 0.1, 0.5)), 1.0, inertia)
    corners = 0.15 * np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])
    stepper.add(collide.ConvexHull(corners), collide.pose((-0.5, -0.6, 0.5)), 1.0, np.full(3, 0.009))
    last = stepped(stepper, 6.0)[-120:]
    places = np.array([step.X[1:, :3, 3] for step in last])
    assert np.ptp(places, axis=0).max() < 1e-4, np.ptp(places, axis=0)
    assert {key[:2] for step in last for key in step.keys} == {(0, 1), (0, 2)}
    assert min(step.contacts["distance"].min() for step in last) > -5e-4
    assert all(len(step.keys) >= 6 and step.contacts["normal"][:, 2].min() > 0.8 for step in last)


def test_a_ball_rolls_over_bumps_and_never_through():
    """Its centre stays a radius above the surface, but for what the springs of contacts give way."""
    field, stepper, radius = bumpy_bowl(0), Stepper(friction=0.6), 0.12
    stepper.add(field, EYE)
    ball = stepper.add(collide.Sphere(radius), pose(t=(0.9, -0.6, 0.4)), 1.0, np.full(3, 0.4 * radius**2))
    steps = stepped(stepper, 5.0)
    centres = np.array([step.X[ball] for step in steps])
    gaps = collide.distance(field, collide.Sphere(radius), EYE, centres).distance
    assert gaps.min() > -0.005 and sum(len(step.keys) > 0 for step in steps) > 200
    assert np.linalg.norm(centres[-1, :2, 3] - centres[0, :2, 3]) > 0.1  # it did roll
