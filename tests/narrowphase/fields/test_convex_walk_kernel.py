"""Whether convex sets come within a margin of clouds, beside distances of all points in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, rng_of, rotation, unit
from reproduction import reproducing

import collide
from collide.lowering.parts import convex_set_of
from collide.narrowphase.facets.nearest_item_calls import Items, gap_rows, surface_states
from collide.narrowphase.fields.items_of import items_of

_SNIPPET = """
import collide, numpy as np
cloud = collide.PointCloud(np.array({points}), np.array({radius}))
print(collide.collide(cloud, {shape}, np.array({X_WC}), np.array({X_WS}), security_margin={margin}))
"""
HALF, RADIUS, LENGTH = np.array((0.05, 0.03, 0.12)), 0.04, 0.2


def from_segment(p):
    return np.linalg.norm(p - np.clip(p[:, 2:], -LENGTH / 2, LENGTH / 2) * (0.0, 0.0, 1.0), axis=1) - RADIUS


def from_box(p):
    away = np.abs(p) - HALF
    return np.linalg.norm(np.maximum(away, 0.0), axis=1) + np.minimum(away.max(axis=1), 0.0)


def from_cylinder(p):
    away = np.stack([np.hypot(p[:, 0], p[:, 1]) - RADIUS, np.abs(p[:, 2]) - LENGTH / 2], axis=1)
    return np.linalg.norm(np.maximum(away, 0.0), axis=1) + np.minimum(away.max(axis=1), 0.0)


CORNERS = HALF * (2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0)
#: Shapes, and signed distances of points from them in their frames.
SHAPES = {
    "sphere": (collide.Sphere(RADIUS), lambda p: np.linalg.norm(p, axis=1) - RADIUS),
    "box": (collide.Box(2.0 * HALF), from_box),
    "rounded hull": (collide.ConvexHull(CORNERS, radius=0.02), lambda p: from_box(p) - 0.02),
    "capsule": (collide.Capsule(RADIUS, LENGTH), from_segment),
    "cylinder": (collide.Cylinder(RADIUS, LENGTH), from_cylinder),
}


def clouds(rng):
    """(points, radius): in space, on a wall, of one radius or one each, points alone; far from the origin."""
    space = rng.uniform(-0.5, 0.5, (3000, 3))
    wall = np.where([True, True, False], space, 0.001 * space)
    yield space, 0.005
    yield wall, 0.0
    yield space, rng.uniform(0.0, 0.02, 3000)
    yield wall + np.array((4e3, -7e3, 1e3)), 0.004


@pytest.mark.many(3)
@pytest.mark.parametrize("name", SHAPES)
def test_states_are_those_of_all_points(name):
    """Half of the questions are asked at the very gap of the pair, a hair more or less."""
    rng, (shape, away) = rng_of("walks of convex sets", name), SHAPES[name]
    n_met = n_apart = n_near = 0
    for points, radius in clouds(rng):
        cloud, middle = collide.PointCloud(points, radius), 0.5 * (points.min(axis=0) + points.max(axis=0))
        tolerance = 1e-12 * (1.0 + np.abs(points).max())
        for _ in range(150):
            X_CS = pose(rotation(rng), middle + rng.uniform(-0.6, 0.6, 3))
            X_WC = pose(rotation(rng), rng.uniform(-1.0, 1.0, 3))
            gap = float((away((points - X_CS[:3, 3]) @ X_CS[:3, :3]) - radius).min())
            margin = float(max(rng.choice([0.0, gap - 1e-9, gap + 1e-9, rng.uniform(0.0, 0.3)]), 0.0))
            if abs(gap - margin) <= tolerance or abs(gap) <= tolerance:
                continue
            X_WS = X_WC @ X_CS
            with reproducing(
                _SNIPPET, points=points, radius=radius, shape=shape, X_WC=X_WC, X_WS=X_WS, margin=margin
            ):
                state = surface_states(walked(cloud), convex_set_of(shape), X_WC[None], X_WS[None], margin)
                assert bool(state.meets[0]) == (gap < 0.0), (gap, margin)
                assert bool(state.apart[0]) == (gap > margin), (gap, margin)
            n_met, n_apart, n_near = n_met + (gap < 0.0), n_apart + (gap > margin), n_near + (0.0 < gap < margin)
    assert min(n_met, n_apart, n_near) > 40, (n_met, n_apart, n_near)


@pytest.mark.parametrize("name", SHAPES)
def test_gaps_are_those_of_all_points(name):
    """The bracket holds the least of all distances, and the row names a point at the distance."""
    rng, (shape, away) = rng_of("gaps of convex sets", name), SHAPES[name]
    n_apart = n_met = 0
    for points, radius in clouds(rng):
        cloud, middle = collide.PointCloud(points, radius), 0.5 * (points.min(axis=0) + points.max(axis=0))
        tolerance = 1e-12 * (1.0 + np.abs(points).max())
        for _ in range(100):
            X_CS = pose(rotation(rng), middle + rng.uniform(-1.0, 1.0, 3) * rng.choice([0.6, 3.0, 100.0]))
            gaps = away((points - X_CS[:3, 3]) @ X_CS[:3, :3]) - radius
            with reproducing(_SNIPPET, points=points, radius=radius, shape=shape, X_WC=np.eye(4), X_WS=X_CS, margin=0):
                rows, written = gap_rows(walked(cloud), convex_set_of(shape), np.eye(4)[None], X_CS[None], False)
                row, least = rows[0], float(gaps.min())
                if written[0] and not row["hit"]:
                    assert row["certified"] and row["lower"] - tolerance <= least <= row["upper"] + tolerance
                    assert abs(gaps[row["part_a"]] - least) <= 1e-9 * (1.0 + least) + tolerance
                elif written[0]:
                    assert gaps[row["part_a"]] <= tolerance
                else:
                    assert abs(least) <= 1e-6
            n_apart, n_met = n_apart + (least > 0.0), n_met + (least < 0.0)
    assert n_apart > 100 and n_met > 20, (n_apart, n_met)


def walked(cloud: collide.PointCloud) -> Items:
    items = items_of(cloud).walked
    assert items is not None
    return items


def test_matrices_within_the_tolerance_of_rotations_part_nothing_that_meets():
    """The box of a set is turned by a matrix that stretches by 1e-5: a corner that is out there meets a point."""
    rng, met = rng_of("stretched sets"), 0
    box = collide.Box(2.0 * HALF)
    for _ in range(300):
        X = pose(rotation(rng) @ (np.eye(3) + 4e-6 * rng.normal(size=(3, 3))), rng.normal(size=3))
        corner = CORNERS[rng.integers(8)] + 1e-9 * rng.normal(size=3)
        places = np.array([X[:3, :3] @ corner + X[:3, 3], *rng.normal(size=(30, 3)) * 3.0])
        cloud = collide.PointCloud(places, 1e-8)
        state = surface_states(walked(cloud), convex_set_of(box), np.eye(4)[None], X[None])
        assert not state.apart[0]
        met += bool(state.meets[0])
    assert met > 290, met


def test_a_large_sheared_box_meets_the_ball_in_its_corner():
    """A matrix √(I + off · ones) with the diagonal of a box along x: the box's corner is farther out, along its own
    axes together, than the share by which each entry of RᵀR is off.
    """
    values, vectors = np.linalg.eigh(np.eye(3) + 9.9e-5 * np.ones((3, 3)))
    d = np.ones(3) / 3**0.5
    k = np.cross(d, (1.0, 0.0, 0.0))
    K = np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])
    R = (np.eye(3) + K + K @ K / (1.0 + d[0])) @ (vectors * np.sqrt(values)) @ vectors.T
    far = [(1.0, y, z) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
    for side in (10.0, 100.0, 400.0, 16e3):
        X = pose(R, -R @ np.full(3, 0.5 * side))
        for gap in (-1e-4, 1e-3):
            cloud = collide.PointCloud([(0.01 + gap, 0.0, 0.0), *far, (2.0, 0.0, 0.0)], 0.01)
            box, ball = collide.Box((side,) * 3), collide.Sphere(0.01)
            alone = collide.distance(ball, box, pose(t=(0.01 + gap, 0.0, 0.0)), X, signed=False)
            assert alone.hit == (gap < 0.0)
            assert collide.collide(cloud, box, np.eye(4), X) == alone.hit
            row = collide.distance(cloud, box, np.eye(4), X, signed=False)
            assert row.hit == alone.hit and row.lower <= alone.upper and alone.lower <= row.upper


@pytest.mark.parametrize(("scale", "away"), [(1e3, 1e14), (1e20, 0.0), (1e-3, 1e20)])
def test_numbers_beyond_floats_end_the_walk(scale, away):
    """Matrices are linear maps where poses are not checked."""
    cloud, box, X = collide.PointCloud(1e-3 * np.eye(3), 0.0), collide.Box((1e-3,) * 3), np.diag([scale] * 3 + [1.0])
    X[0, 3] = away
    points = [collide.ConvexHull(point[None]) for point in 1e-3 * np.eye(3)]
    hits = [collide.collide(point, box, np.eye(4), X, check_poses=False) for point in points]
    assert collide.collide(cloud, box, np.eye(4), X, check_poses=False) == any(hits)


def test_a_scaled_cloud_is_the_union_of_its_scaled_points():
    """Cores are linear images, balls are added to these in the world."""
    rng, n = rng_of("scaled clouds"), np.zeros(2, dtype=int)
    points = np.array([(1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 3.0, -1.0)])
    cloud, ball = collide.PointCloud(points, 0.01), collide.Sphere(0.01)
    for _ in range(150):
        X_WC = pose(rotation(rng) * rng.choice([0.05, 0.3, 1.0, 7.0]) @ np.diag(rng.uniform(0.5, 2.0, 3)))
        X_WB = pose(rotation(rng), X_WC[:3, :3] @ points[rng.integers(3)] + rng.normal(size=3) * 0.01)
        box = collide.Box(rng.uniform(1e-3, 0.02, 3))
        rows = [
            collide.distance(ball, box, pose(t=X_WC[:3, :3] @ point), X_WB, signed=False, check_poses=False)
            for point in points
        ]
        mine = collide.distance(cloud, box, X_WC, X_WB, signed=False, check_poses=False)
        assert mine.hit == any(row.hit for row in rows) == collide.collide(cloud, box, X_WC, X_WB, check_poses=False)
        assert mine.hit or mine.distance == pytest.approx(min(row.distance for row in rows), abs=1e-9)
        n += [mine.hit, not mine.hit]
    assert n.min() > 20, n


def test_places_that_floats_do_not_hold_are_left_to_others():
    cloud, X = collide.PointCloud(np.eye(3), 0.1), pose(t=(1e30, 0.0, 0.0))
    state = surface_states(walked(cloud), convex_set_of(collide.Box((1, 1, 1))), np.eye(4)[None], X[None])
    assert not state.meets[0] and not state.apart[0]
    _, written = gap_rows(walked(cloud), convex_set_of(collide.Box((1, 1, 1))), np.eye(4)[None], X[None])
    assert not written[0]
    row = collide.distance(cloud, collide.Box((1, 1, 1)), np.eye(4), X)
    assert not row.hit and row.distance == pytest.approx(1e30, rel=1e-15)


def test_a_single_call_answers_as_a_batch():
    rng = rng_of("single walks")
    cloud = collide.PointCloud(np.array([unit(p) for p in rng.normal(size=(5000, 3))]), 0.03)
    poses = np.array([pose(rotation(rng), rng.uniform(-1.2, 1.2, 3)) for _ in range(200)])
    for shape, _ in SHAPES.values():
        batch = collide.collide(cloud, shape, np.eye(4), poses)
        assert [collide.collide(shape, cloud, X, np.eye(4)) for X in poses] == batch.tolist()
        assert 10 < batch.sum() < 190
