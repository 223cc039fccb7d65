"""Bounding boxes of posed convex sets: never too small, judged in Fractions, and larger by rounding only."""

from __future__ import annotations

from fractions import Fraction

import naive
import numpy as np
import pytest
from naive import pose, random_pose, rng_of
from naive_triangles import world_points

import collide
from collide.broadphase.bounding_boxes import boxes_of, least_distances, widened
from collide.lowering.parts import parts_of
from collide.lowering.shape_table import ShapeTable, pose_table
from collide.worlds.world_parts import WorldParts

EYE = np.eye(4)


def box_of(shape: collide.Shape, X_WB: np.ndarray) -> np.ndarray:
    (packed, X_BP), = parts_of(shape)
    table = ShapeTable([packed])
    table.build_trees(np.zeros(1, dtype=np.int64))
    return boxes_of(
        table, pose_table(X_WB[None], X_BP[None], np.array([packed.reach])).rows, np.zeros(1, dtype=np.int64)
    )[0]


def reaches(shape: collide.Shape, g, bound: Fraction) -> bool:
    """Whether a curved shape's support value along g, in its own frame, is at most the bound: exactly, without
    roots."""
    x, y, z = g
    if isinstance(shape, collide.Ellipsoid):
        square = sum((Fraction(r) * c) ** 2 for r, c in zip(shape.radii.tolist(), g))
        return bound >= 0 and square <= bound**2
    radius, half = Fraction(float(shape.radius)), Fraction(float(shape.length)) / 2
    rest = bound - half * abs(z) if isinstance(shape, collide.Cylinder) else bound + half * z
    disc = rest >= 0 and radius**2 * (x * x + y * y) <= rest**2
    return disc and (not isinstance(shape, collide.Cone) or half * z <= bound)


def holds(shape: collide.Shape, X: np.ndarray, box) -> bool:
    if isinstance(shape, (collide.Ellipsoid, collide.Cylinder, collide.Cone)):
        for axis in range(3):
            g, t = [Fraction(v) for v in X[axis, :3].tolist()], Fraction(float(X[axis, 3]))
            if not reaches(shape, g, Fraction(box[3 + axis]) - t) or not reaches(
                shape, [-v for v in g], t - Fraction(box[axis])
            ):
                return False
        return True
    points, radius = naive.corners(shape)
    r = Fraction(float(radius))
    return all(
        Fraction(box[axis]) <= p[axis] - r and p[axis] + r <= Fraction(box[3 + axis])
        for p in world_points(points, X)
        for axis in range(3)
    )


def shapes(rng) -> dict[str, collide.Shape]:
    kinds = naive.one_of_each(rng)
    kinds["Point"] = collide.ConvexHull([rng.normal(size=3)])
    kinds["LargeHull"] = collide.ConvexHull(naive.hull_points(rng, 300))
    kinds["Needle"] = collide.ConvexHull(rng.normal(size=(5, 3)) * (1e3, 1e-9, 1e-9))
    return {name: kinds[name] for name in kinds if name not in ("Compound", "Halfspace", "HPolytope")}


@pytest.mark.parametrize("kind", shapes(rng_of("kinds")))
def test_boxes_hold_their_shapes_tightly(kind):
    rng = rng_of("boxes", kind)
    for k in range(12):
        shape = shapes(rng)[kind]
        X = random_pose(rng, 10.0 ** rng.integers(-6, 7))
        if k % 3 == 0:
            X = pose(naive.LATTICE_ROTATIONS[k], rng.integers(-3, 4, 3) * 0.25)
        box = box_of(shape, X)
        with naive.reproducible(naive.Case(shape, shape, X, X)):
            assert holds(shape, X, box.tolist())
            slack = 1e-13 * (np.abs(X[:3, 3]).max() + 2000.0 * (kind == "Needle") + 10.0)
            for axis, n in enumerate(np.eye(3)):
                assert naive.extent_along(shape, X, n) - slack <= box[axis]
                assert box[3 + axis] <= -naive.extent_along(shape, X, -n) + slack


def test_halfspaces_have_no_bounds():
    assert np.array_equal(box_of(collide.Halfspace((0, 0, 1), 2.0), EYE), [-np.inf] * 3 + [np.inf] * 3)


def test_parts_with_poses_of_their_own():
    """The product of two poses is rounded; the box holds the part where it exactly is."""
    rng = rng_of("boxes of parts")
    for _ in range(20):
        hull = collide.ConvexHull(naive.hull_points(rng, 8))
        X_WB, X_BP = random_pose(rng, 1e6), random_pose(rng, 1e3)
        (packed, _), = parts_of(hull)
        rows = pose_table(X_WB[None], X_BP[None], np.array([packed.reach])).rows
        box = boxes_of(ShapeTable([packed]), rows, np.zeros(1, dtype=np.int64))[0].tolist()
        in_body = world_points(hull.points, X_BP)
        W = [[Fraction(v) for v in row] for row in X_WB[:3].tolist()]
        for p in in_body:
            for axis in range(3):
                x = sum(w * c for w, c in zip(W[axis], p)) + W[axis][3]
                assert Fraction(box[axis]) <= x <= Fraction(box[3 + axis]), naive.spell(hull)


def test_bodies_that_are_moved_at_once_have_the_boxes_and_poses_of_new_ones():
    """Bodies of one part and nothing around it are moved by one kernel, which writes poses as `pose_table` does: bit by
    bit, and of those that moved alone.
    """
    rng, parts, n_moved = rng_of("moved at once"), WorldParts(), 0
    kinds = [shape for shape in shapes(rng).values() if len(parts_of(shape)) == 1] + [collide.Halfspace((0, 0, 1), 0)]
    X_WBs = np.array([random_pose(rng, 2.0) for _ in kinds])
    parts.append(kinds, X_WBs)
    for _ in range(5):
        is_moved = rng.random(len(kinds)) < 0.4
        (moved,) = is_moved.nonzero()
        X_WBs[moved] = [random_pose(rng, 2.0) for _ in moved]
        given = X_WBs.copy()
        given[np.setdiff1d(np.arange(len(kinds)), moved)] = np.nan
        n, bodies = parts.single.move(is_moved, given, None)
        assert n == len(moved) and bodies.tolist() == moved.tolist() and not is_moved.any()
        new = WorldParts()
        new.append(kinds, X_WBs)
        assert parts.boxes.tobytes() == new.boxes.tobytes() and parts.poses.rows.tobytes() == new.poses.rows.tobytes()
        n_moved += len(moved)
    assert n_moved > 10


def test_widened_boxes_hold_their_room_exactly_and_no_bound_is_ever_nan():
    rng = rng_of("widened boxes")
    for _ in range(300):
        low = rng.normal(size=(8, 3)) * 10.0 ** rng.uniform(-12, 12, (8, 3))
        boxes = np.hstack([low, low + np.abs(rng.normal(size=(8, 3))) * 10.0 ** rng.uniform(-12, 12, (8, 3))])
        ends = rng.random((8, 6)) < 0.2
        boxes[ends] = np.where(np.arange(6) < 3, -np.inf, np.inf)[np.nonzero(ends)[1]]
        room = np.where(rng.random(8) < 0.4, 0.0, 10.0 ** rng.uniform(-15, 8, 8))
        wide = widened(boxes, room)
        assert not np.isnan(wide).any() and (np.isinf(wide) == ends).all(), (boxes, room)
        assert wide[room == 0].tobytes() == boxes[room == 0].tobytes()
        for k, axis in np.argwhere(~ends & (room > 0)[:, None]).tolist():
            sign, b, r = (-1 if axis < 3 else 1), Fraction(boxes[k, axis]), Fraction(room[k])
            out = sign * (Fraction(wide[k, axis]) - b) - r
            assert 0 <= out <= (abs(b) + 2 * r) / 2**49, (boxes[k].tolist(), room[k])


def test_bounds_of_gaps_are_those_of_the_boxes():
    """Beside numpy: apart, overlapping, without end, with a NaN, which bounds nothing along its axis."""
    rng, rounding = rng_of("gaps of boxes"), 2.0**-24
    low = rng.normal(size=(300, 3)) * 2.0
    boxes = np.hstack([low, low + rng.uniform(0.0, 2.0, (300, 3))])
    boxes[:9], boxes[9, 0], boxes[10, 5] = [-np.inf] * 3 + [np.inf] * 3, -np.inf, np.inf
    boxes[11, 1], boxes[12] = np.nan, np.nan
    pairs = rng.permutation(np.stack(np.triu_indices(300, 1), axis=1))
    a, b = boxes[pairs[:, 0]], boxes[pairs[:, 1]]
    gaps = np.maximum(a[:, :3] - b[:, 3:], b[:, :3] - a[:, 3:])
    gaps = np.where(np.isnan(gaps), -np.inf, gaps)
    true = np.where((gaps > 0).any(axis=1), np.linalg.norm(np.maximum(gaps, 0.0), axis=1), gaps.max(axis=1))
    bounds = least_distances(boxes, pairs, rounding)
    assert not np.isnan(bounds).any() and (np.isinf(bounds) == np.isinf(true)).all()
    finite = np.isfinite(true)
    sizes = np.maximum(np.abs(true), np.abs(np.where(np.isfinite(a), a, 0.0)).max(axis=1))[finite]
    below = true[finite] - bounds[finite]
    assert (below > 0.5 * rounding * sizes).all() and (below < 2 * rounding * sizes).all()
    assert (true > 0).sum() > 1000 and (true[finite] < 0).sum() > 500 and (~finite).sum() > 500
