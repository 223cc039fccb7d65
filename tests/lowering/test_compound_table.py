"""Bodies laid out for kernels: balls hold their parts, poses and counts are those of the parts, placed as tables do."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, one_of_each, pose, random_pose, rng_of, rotation
from reproduction import reproducing

import collide
from collide.kernels import address_of
from collide.lowering import compound_table as T
from collide.lowering.compound_layout import layout_of
from collide.lowering.extents import extent_of
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.parts import bounding_parts_of
from collide.lowering.place_parts import BALL_MARGIN, gap_of_balls, place_ball, place_part, write_terms
from collide.lowering.shape_table import (
    LOW_PARTS,
    POSE,
    POSE_SLOP,
    POSE_STRETCH,
    POSE_TERMS,
    TERM_ROW,
    TERMS,
    pose_table,
)


def shapes_of(rng) -> list[collide.Shape]:
    each = one_of_each(rng)
    each["Far"] = collide.Compound([(each["Cone"], random_pose(rng, 30.0)), (each["Compound"], random_pose(rng, 5.0)),
                                    (each["ConvexHull"], np.eye(4))])
    each["Mesh"] = collide.Mesh(*collide.tessellate(each["Box"])[:2])
    return list(each.values())


def directions(rng, n: int) -> np.ndarray:
    v = rng.normal(size=(n, 3))
    return np.vstack([v / np.linalg.norm(v, axis=1)[:, None], np.eye(3), -np.eye(3)])


@pytest.mark.parametrize("seed", range(4))
def test_balls_hold_their_parts_and_are_not_much_larger(seed):
    rng = rng_of("balls", seed)
    v = directions(rng, 20)
    for shape in shapes_of(rng):
        parts = bounding_parts_of(shape)
        body = T.lay_out(parts)
        assert len(body.packed) == len(parts) and body.parts.shape == (len(parts), T.PART)
        assert all(a is b for a, (b, _) in zip(body.packed, parts))
        for row, (packed, X) in zip(body.parts, parts):
            assert np.array_equal(row[:9].reshape(3, 3), X[:3, :3]) and np.array_equal(row[9:12], X[:3, 3])
            assert row[T.TURNED] == (not np.array_equal(X, np.eye(4)))
            assert row[T.MEASURE] == packed.reach + np.abs(X[:3, 3]).sum() and row[T.SWEPT_RADIUS] == packed.radius
            if packed.kind == HALFSPACE:
                assert row[T.BALL] == math.inf
                continue
            centre, ball = row[T.CENTRE : T.CENTRE + 3], row[T.BALL] + row[T.SWEPT_RADIUS]
            heights = np.array([extent_of(packed, X, n) for n in v])
            assert (heights <= v @ centre + ball + 1e-14).all()
            assert ball <= 4.0 * (heights - v @ centre).max() + packed.slop + 1e-9
            body_centre = body.ball[T.BODY_CENTRE : T.BODY_CENTRE + 3]
            assert np.linalg.norm(centre - body_centre) + row[T.BALL] <= body.ball[T.BODY_BALL]
            assert np.linalg.norm(centre) + ball <= body.ball[T.BODY_REACH] * (1 + 1e-14)
        assert body.ball[T.BODY_SWEPT] == max(packed.radius for packed, _ in parts)
        assert math.isfinite(body.ball[T.BODY_REACH])
        assert layout_of(shape) is layout_of(shape) and np.array_equal(layout_of(shape).parts, body.parts)


@pytest.mark.parametrize("n", [1, T.GROUP, T.GROUP + 1, 16, 17, 700])
def test_groups_hold_the_balls_of_their_parts_and_are_small(n):
    """Every part, and every group but the last, is a member of one group; groups of sixteen of many parts take little
    of the union's size."""
    rng = rng_of("groups of parts", n)
    items = [(collide.Capsule(r, 0.02), random_pose(rng, 1.0)) for r in rng.uniform(0.01, 0.03, n)]
    body = layout_of(collide.Compound(items))
    assert np.array_equal(np.sort(body.by_place), np.arange(n))
    parts_of, members = [[place] for place in range(n)], []
    for group in body.groups:
        first, end = group[[T.MEMBERS, T.MEMBERS_END]].astype(int)
        members += range(first, end)
        assert 0 < end - first <= T.GROUP
        parts_of.append([place for member in range(first, end) for place in parts_of[member]])
        for row in body.parts[body.by_place[parts_of[-1]]]:
            apart = math.dist(row[T.CENTRE : T.CENTRE + 3], group[:3])
            assert apart + row[T.BALL] <= group[3] and row[T.SWEPT_RADIUS] <= group[4]
    assert members == list(range(n + len(body.groups) - 1)) and sorted(parts_of[-1]) == list(range(n))
    of_sixteen = [group[3] for group, parts in zip(body.groups, parts_of[n:]) if len(parts) == 16]
    assert n < 700 or np.median(of_sixteen) < 0.4 * body.ball[T.BODY_BALL]


def test_parts_of_one_place_keep_their_order():
    item = collide.Sphere(0.1), collide.pose((1e-310, 2.0, 3.0))
    assert layout_of(collide.Compound([item] * 40)).by_place.tolist() == list(range(40))


def test_matrices_that_stretch_have_larger_balls():
    hull = collide.ConvexHull([(1, 0, 0), (-1, 0, 0), (0, 1, 0)])
    ((packed, _),) = bounding_parts_of(hull)
    X = np.diag((3.0, 1.0, 1.0, 1.0))
    row = T.lay_out([(packed, X)]).parts[0]
    for corner in hull.points @ X[:3, :3].T:
        assert np.linalg.norm(corner - row[T.CENTRE : T.CENTRE + 3]) <= row[T.BALL]


def test_tables_of_bodies_stand_one_behind_the_other():
    rng = rng_of("compound table")
    shapes = shapes_of(rng)
    bodies = [layout_of(shape) for shape in shapes]
    table = T.CompoundTable(bodies)
    counts = [len(body.packed) for body in bodies]
    assert table.counts.tolist() == counts and table.first.tolist() == [sum(counts[:k]) for k in range(len(counts))]
    assert [p.content for p in table.table.packed] == [p.content for body in bodies for p in body.packed]
    assert table.max_parts == 2 * max(counts) and len(table.addresses) == 7
    assert np.array_equal(table._parts, np.concatenate([body.parts for body in bodies]))
    n_groups = [len(body.groups) for body in bodies]
    expected = [[sum(counts[:k]), counts[k], sum(n_groups[:k]), n_groups[k]] for k in range(len(counts))]
    assert table._bodies.tolist() == expected
    assert np.array_equal(table._by_place, np.concatenate([body.by_place for body in bodies]))
    assert np.array_equal(table._groups, np.concatenate([body.groups for body in bodies]))


@pytest.mark.parametrize("which", [None, [1, 1], [2]])
def test_trees_are_those_of_the_bodies_asked_about(which):
    rng = rng_of("trees of bodies", which)
    points = rng.normal(size=(3, 300, 3))
    hulls = [collide.ConvexHull(p / np.linalg.norm(p, axis=1)[:, None]) for p in points]
    table = T.CompoundTable([layout_of(hull) for hull in hulls])
    assert not table.table.is_built
    table.build_trees(None if which is None else np.array(which))
    built = [0, 1] if which is None else sorted(set(which))
    assert [k for k in range(3) if table.table.ints[k, 6] != 0] == built
    table.build_trees(np.arange(3))
    assert table.table.is_built and (table.table.ints[:, 6] != 0).all()


def bodies_and_parts(rng) -> list[tuple[np.ndarray, np.ndarray]]:
    """(X_WB, X_BP): at the origin and not, parts turned and not, tiny and huge numbers."""
    drawn = []
    for k in range(24):
        X_WB = [np.eye(4), random_pose(rng, 10.0 ** rng.integers(-3, 4)), pose(LATTICE_ROTATIONS[k], (1.0, 2.0, 3.0))][
            k % 3
        ]
        X_BP = [np.eye(4), random_pose(rng), pose(t=rng.normal(size=3)), pose(rotation(rng))][(k // 3) % 4]
        drawn.append((X_WB, X_BP))
    tiny = np.eye(4)
    tiny[:3, :3] = rotation(rng) * 2.0**-500
    drawn.append((tiny, pose(rotation(rng) * 2.0**-450, (2.0**-460, 0.0, 1.0))))
    return drawn


@pytest.mark.plain_kernels
def test_parts_are_placed_as_pose_tables_have_them():
    """The same bits as of many at once, their exact terms included."""
    rng, n_terms = rng_of("placed parts"), 0
    ((packed, _),) = bounding_parts_of(collide.Box((1, 2, 3)))
    for X_WB, X_BP in bodies_and_parts(rng):
        with reproducing("X_WB, X_BP = {X_WB}, {X_BP}  # tests/lowering/test_compound_table.py", X_WB=X_WB, X_BP=X_BP):
            table = pose_table(X_WB[None], X_BP[None], np.array([packed.reach]))
            parts = T.lay_out([(packed, X_BP)]).parts.ravel()
            poses, terms = np.zeros(2 * POSE), np.zeros(TERM_ROW)
            poses[:9], poses[9:12], poses[POSE_STRETCH] = X_WB[:3, :3].ravel(), X_WB[:3, 3], 1.25
            place_part(poses, POSE, 0, parts, 0, address_of(terms))
            row, expected = poses[POSE:], table.rows[0]
            assert np.array_equal(row[:12], expected[:12])
            assert row[POSE_SLOP] == pytest.approx(expected[POSE_SLOP], rel=1e-13)
            assert (row[POSE_TERMS] >= 0.0) == (expected[POSE_TERMS] >= 0.0)
            assert row[POSE_STRETCH] == (1.25 if np.array_equal(X_BP, np.eye(4)) else -1.0)
            if row[POSE_TERMS] < 0.0:
                continue
            n_terms += 1
            assert row[POSE_TERMS] == 1.0  # the row itself
            write_terms(poses, 0, parts, 0, address_of(terms))
            for k in range(12):
                mine = sum(map(Fraction, terms[TERMS * k : TERMS * (k + 1)].tolist()))
                assert mine == table.exact(0)[k]
            np.testing.assert_allclose(terms[LOW_PARTS:], table.terms[0, LOW_PARTS:], rtol=1e-9, atol=0)
            without = poses.copy()
            place_part(without, POSE, 0, parts, 0, 0)
            assert np.array_equal(without, poses)
    assert n_terms > 8


@pytest.mark.plain_kernels
def test_balls_in_the_world_and_their_gaps():
    rng = rng_of("balls in the world")
    for _ in range(30):
        balls, world = np.zeros(2 * T.BALL_IN_WORLD), []
        for k in range(2):
            X, centre, radii = random_pose(rng, 2.0), rng.normal(size=3), rng.uniform(0.1, 1.0, 2)
            poses = np.zeros(POSE)
            poses[:9], poses[9:12], poses[POSE_STRETCH] = X[:3, :3].ravel(), X[:3, 3], 1.5
            numbers = np.array([9.0, *centre, *radii])
            place_ball(poses, 0, numbers, 1, *X[:3, 3].tolist(), balls, T.BALL_IN_WORLD * k)
            at = balls[T.BALL_IN_WORLD * k : T.BALL_IN_WORLD * (k + 1)]
            np.testing.assert_allclose(at[:3], X[:3, :3] @ centre + X[:3, 3], rtol=0, atol=1e-14)
            assert at[3] == 1.5 * radii[0] + radii[1]
            world.append((at[:3].copy(), at[3]))
        gap = np.linalg.norm(world[0][0] - world[1][0]) - world[0][1] - world[1][1]
        assert gap_of_balls(balls, 0, T.BALL_IN_WORLD) == pytest.approx(gap, abs=8 * BALL_MARGIN)
        assert gap_of_balls(balls, T.BALL_IN_WORLD, 0) == gap_of_balls(balls, 0, T.BALL_IN_WORLD)
