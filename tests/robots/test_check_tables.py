"""Tables that kernels read: parts, boxes that hold them, swollen twins and what was lost in them."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from naive import pose, random_pose, rng_of, rotation
from random_robots import random_link_shape

import collide
from collide.lowering.packed_convex import pack_halfspace, pack_points
from collide.lowering.parts import parts_of
from collide.lowering.shape_table import POSE_SLOP, POSE_STRETCH, POSE_TERMS, TREE
from collide.robots.check_tables import (
    UNBOUNDED_HALF,
    BodyAround,
    RobotBody,
    box_of,
    check_tables,
    convex_parts_of,
    packed_within,
    surroundings_of,
    swollen,
    without_meshes,
)

CUBE = collide.Box((2.0, 2.0, 2.0))
BRICK = collide.Mesh(*collide.tessellate(CUBE))
OPEN_BRICK = collide.Mesh(BRICK.vertices, BRICK.faces[:-1])
IDENTITY = np.eye(3)[None]


def tables_of(*bodies: RobotBody, around=()):
    return check_tables(bodies, surroundings_of(around), IDENTITY)


# --- parts ----------------------------------------------------------------------------------------


def test_a_solid_mesh_that_is_its_hull_is_a_convex_part_and_others_are_held_by_parts():
    assert not convex_parts_of(CUBE).is_bound and not convex_parts_of(BRICK).is_bound
    assert len(convex_parts_of(BRICK).parts) == 1
    assert convex_parts_of(OPEN_BRICK).is_bound
    union = collide.Compound([(CUBE, np.eye(4)), (collide.Compound([(BRICK, pose(t=(3, 0, 0)))]), np.eye(4))])
    assert not convex_parts_of(union).is_bound and len(convex_parts_of(union).parts) == 2
    assert convex_parts_of(collide.Compound([(CUBE, np.eye(4)), (OPEN_BRICK, np.eye(4))])).is_bound


def test_shapes_of_convex_parts_that_are_the_same_set():
    assert without_meshes(CUBE) is CUBE and without_meshes(OPEN_BRICK) is None
    assert isinstance(without_meshes(BRICK), collide.ConvexHull)
    mixed = collide.Compound([(BRICK, np.eye(4)), (OPEN_BRICK, np.eye(4))])
    assert without_meshes(mixed) is None


# --- boxes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("shape", "half"), [
    (collide.Sphere(0.5), (0.5, 0.5, 0.5)), (collide.Capsule(0.25, 2.0), (0.25, 0.25, 1.25)),
    (collide.Cylinder(0.25, 2.0), (0.25, 0.25, 1.0)), (collide.Cone(0.25, 2.0), (0.25, 0.25, 1.0)),
    (collide.Ellipsoid((1.0, 2.0, 3.0)), (1.0, 2.0, 3.0)), (CUBE, (1.0, 1.0, 1.0)),
])
@pytest.mark.parametrize("by", [0.0, 0.125])
def test_boxes_of_sets_and_of_swollen_ones(shape, half, by):
    ((packed, _),) = parts_of(shape)
    box = box_of(swollen(packed, by))
    assert np.abs(box[:3]).max() == 0.0 and np.abs(box[3:] - (np.array(half) + by)).max() <= 1e-15


def test_a_box_stands_where_its_points_are_and_counts_the_slop():
    points = np.array([(1.0, 0, 0), (3.0, -2.0, 0.5)])
    assert box_of(pack_points(points, 0.25, 0.5)).tolist() == [2.0, -1.0, 0.25, 1.75, 1.75, 1.0]
    assert box_of(pack_halfspace((0, 0, 1.0), 2.0)).tolist() == [0, 0, 0, math.inf, math.inf, math.inf]


def test_boxes_of_bodies_hold_their_parts():
    """Corners of every part's own box, turned with it, are within the body's; some of them on each of its faces."""
    for seed in range(20):
        rng = rng_of("boxes of bodies", seed)
        shape = collide.Compound([(random_link_shape(rng, 0.3), random_pose(rng, 0.5)) for _ in range(3)])
        bodies = [RobotBody("first", 0, CUBE, 0.0), RobotBody("second", 1, shape, 0.125 * (seed % 2))]
        made = tables_of(*bodies)
        _, first, count, _ = made.bodies[1].tolist()
        corners = []
        for k in range(first + made.padded, first + made.padded + count):
            R, t = made.parts[k, :9].reshape(3, 3), made.parts[k, 9:12]
            box = made.part_boxes[k]
            corners += [R @ (box[:3] + np.array(s) * box[3:]) + t for s in np.ndindex(2, 2, 2)]
            corners += [R @ (box[:3] - np.array(s) * box[3:]) + t for s in np.ndindex(2, 2, 2)]
            corners += [R @ (box[:3] + (2 * np.array(s) - 1) * box[3:]) + t for s in np.ndindex(2, 2, 2)]
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        box = made.body_boxes[1]
        assert np.abs(box[:3] - box[3:] - low).max() <= 1e-14 and np.abs(box[:3] + box[3:] - high).max() <= 1e-14, seed


def test_a_body_without_end_has_a_box_of_numbers():
    plane = collide.Compound([(CUBE, np.eye(4)), (collide.Halfspace((0, 0, 1.0), 0.0), np.eye(4))])
    made = tables_of(RobotBody("link", 0, CUBE, 0.0), RobotBody("plate", 1, plane, 0.0))
    assert made.body_boxes[0].tolist() == [0, 0, 0, 1, 1, 1]
    assert made.body_boxes[1].tolist() == [0, 0, 0, *[UNBOUNDED_HALF] * 3] and np.isfinite(UNBOUNDED_HALF**2)


def test_rows_of_bodies_and_the_padded_twins_behind_them():
    two = collide.Compound([(CUBE, np.eye(4)), (collide.Sphere(0.5), pose(t=(2, 0, 0)))])
    around = [BodyAround("mesh", OPEN_BRICK, np.eye(4)), BodyAround("ball", collide.Sphere(1.0), np.eye(4))]
    plain = tables_of(RobotBody("a", 3, two, 0.0), RobotBody("b", 1, BRICK, 0.0), around=around)
    assert plain.bodies.tolist() == [[3, 0, 2, 0], [1, 2, 1, 0]] and plain.padded == 0
    assert plain.is_bound.tolist() == [0, 0, 0, 1, 0] and len(plain.poses) == 5
    padded = tables_of(RobotBody("a", 3, two, 0.0), RobotBody("b", 1, OPEN_BRICK, 0.25), around=around)
    assert padded.padded == 3 and padded.is_bound.tolist() == [0, 0, 1, 0, 0, 1, 1, 0]
    assert padded.part_boxes[:, 3].tolist() == [1.0, 0.5, 1.0, 1.0, 0.5, 1.25, 1.0, 1.0]
    assert (padded.parts[:3] == padded.parts[3:]).all()


def test_matrices_that_are_no_rotations_move_boxes_outwards():
    least = tables_of(RobotBody("a", 0, CUBE, 0.0)).slack
    assert 0.0 < least <= 1e-11
    skewed = np.eye(3)[None] * (1.0 + 1e-7)
    around = surroundings_of([])
    assert check_tables([RobotBody("a", 0, CUBE, 0.0)], around, skewed).slack >= 8 * 3 * 2e-7
    turned = np.array([rotation(rng_of("slack", k)) for k in range(20)])
    assert check_tables([RobotBody("a", 0, CUBE, 0.0)], around, turned).slack == least


# --- surroundings ---------------------------------------------------------------------------------


def test_parts_around_stand_where_their_bodies_do():
    rng = rng_of("surroundings")
    X_WB, X_BP = random_pose(rng, 2.0), random_pose(rng, 0.5)
    two = collide.Compound([(CUBE, np.eye(4)), (collide.Sphere(0.5), X_BP)])
    made = surroundings_of([BodyAround("a", collide.Sphere(1.0), np.eye(4)), BodyAround("b", two, X_WB)])
    assert made.body_of.tolist() == [0, 1, 1] and made.is_bound.tolist() == [False] * 3
    for row, expected in zip(made.poses, (np.eye(4), X_WB, X_WB @ X_BP)):
        assert np.abs(row[:9].reshape(3, 3) - expected[:3, :3]).max() <= 1e-15
        assert np.abs(row[9:12] - expected[:3, 3]).max() <= 1e-14
    # No row leads to terms of a product: what that lost is in the slop, and only the last part is a product.
    assert (made.poses[:, POSE_TERMS] == -1.0).all()
    assert made.poses[0, POSE_SLOP] == 0.0 < made.poses[2, POSE_SLOP] <= 1e-14
    assert (np.abs(made.poses[:, POSE_STRETCH] - 1.0) <= 1e-14).all() and made.tree is not None


def test_there_may_be_nothing_around():
    made = surroundings_of([])
    assert made.tree is None and made.packed == [] and len(made.poses) == len(made.body_of) == 0


def test_margins_swell_the_bodies_that_have_one():
    made = surroundings_of([BodyAround("a", CUBE, np.eye(4)), BodyAround("b", CUBE, np.eye(4), 0.25)])
    assert [packed.radius for packed in made.packed] == [0.0, 0.25] and [p.slop for p in made.packed] == [0.0, 0.0]


# --- swollen sets and what was lost ---------------------------------------------------------------


def test_swollen_sets_are_other_contents():
    ((ball, _),), ((rod, _),) = parts_of(collide.Sphere(0.5)), parts_of(collide.Cylinder(0.25, 1.0))
    for packed in (ball, rod):
        assert swollen(packed, 0.25).radius == packed.radius + 0.25
        assert swollen(packed, 0.25).content != swollen(packed, 0.5).content != packed.content


def test_a_radius_that_is_rounded_knows_by_how_much():
    """By fractions; sums without rounding have no slop at all."""
    ((ball, _),), n_rounded = parts_of(collide.Sphere(0.1)), 0
    for margin in rng_of("radius and margin").uniform(1e-3, 1.0, 60).tolist():
        made = packed_within(ball, margin, np.eye(3))
        lost = abs(Fraction(0.1) + Fraction(margin) - Fraction(made.radius))
        assert lost <= Fraction(made.slop) <= 2 * Fraction(float(np.spacing(made.radius))), margin
        n_rounded += lost != 0
    assert n_rounded > 10
    assert packed_within(ball._replace(slop=0.5), 0.25, np.eye(3)).slop >= 0.5
    ((half, _),) = parts_of(collide.Sphere(0.5))
    assert packed_within(half, 0.25, np.eye(3)).slop == 0.0


@pytest.mark.parametrize("scale", [1.0, 3.0, 0.1])
@pytest.mark.parametrize("slop", [0.0, 0.5])
def test_a_plane_is_shifted_by_the_margin_times_its_normals_length(scale, slop):
    """And its slop grows, by at least a rounding of the shift and by no more than a few hundred of them."""
    R = rotation(rng_of("plane within"))
    normal = scale * np.array([0.6, 0.0, 0.8])
    made = packed_within(pack_halfspace(normal, -0.7)._replace(slop=slop), 0.3, R)
    assert made.params[:3].tolist() == normal.tolist()
    assert abs(made.params[3] - (-0.7 + 0.3 * scale)) <= 1e-15 * (1 + scale)
    assert 2.0**-50 <= made.slop - slop <= 2.0**-40


def test_hulls_of_many_vertices_have_a_support_tree_and_it_serves_what_is_swollen():
    """Of a link, of its padded twin and of a body around, whatever its margin: without one, each support looks at all
    vertices, for every pair of parts and every configuration. No tree is built again when a margin changes.
    """
    points = rng_of("hull of many vertices").normal(size=(600, 3))
    hull = collide.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None])
    tables = [
        tables_of(
            RobotBody("link", 0, hull, 0.1), RobotBody("box", 1, CUBE, 0.1),
            around=[BodyAround("hull", hull, pose(t=(3.0, 0, 0)), margin)],
        ).table
        for margin in (0.0, 0.2, 0.3)
    ]
    trees = np.array([table.ints[: len(table.packed), TREE] for table in tables])
    assert all(table.is_built for table in tables)
    assert trees[:, [0, 2, 4]].all() and not trees[:, [1, 3]].any() and len(np.unique(trees)) == 2
