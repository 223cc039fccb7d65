"""Groups of items: every facet and part in one leaf of the tree, and planes that leave no pair of items out."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import random_pose, rng_of

import collide
from collide.certificates.body_groups import (
    BodyGroups,
    cut_pair,
    flaw_of_meeting,
    flaw_of_outside,
    flaw_of_planes,
    point_of,
)

EYE = np.eye(4)
RING, BALL = collide.Mesh(*block_ring()), collide.Mesh(*bumpy_sphere(60))
UNION = collide.Compound([
    (RING, collide.pose((1, 0, 0))), (collide.Cylinder(0.2, 1.0), EYE),
    (collide.Compound([(collide.Sphere(0.3), EYE), (BALL, collide.pose((0, 3, 0)))]), collide.pose((0, 0, 2))),
])


def _numbers(groups: BodyGroups, k: int = 0) -> list[int]:
    if groups.group(k).n_items == 1:
        return groups.numbers(k)
    return _numbers(groups, 2 * k + 1) + _numbers(groups, 2 * k + 2)


@pytest.mark.parametrize("shape", [RING, BALL, UNION, collide.Cone(1, 1)], ids=["ring", "ball", "union", "cone"])
def test_every_item_is_in_one_group(shape):
    groups = BodyGroups(shape, EYE)
    assert sorted(_numbers(groups)) == list(range(groups.n_items))
    facets = {RING: len(RING.faces), BALL: len(BALL.faces), UNION: len(RING.faces) + 2 + len(BALL.faces)}
    assert groups.n_items == facets.get(shape, 1)
    for k in range(0, groups.n_items, 7):
        assert groups.item(k) is not None
    assert groups.item(-1) is None and groups.item(groups.n_items) is None


def test_groups_hold_the_vertices_of_their_facets():
    groups = BodyGroups(BALL, EYE)
    for k in (0, 1, 2, 5, 6):
        _, facets, n = groups.group(k)
        (part,) = groups.parts(k)
        assert len(facets) == n
        corners = BALL.vertices[BALL.faces[facets]].reshape(-1, 3)
        assert {tuple(p) for p in part.points_P.tolist()} == {tuple(p) for p in corners.tolist()}


def test_parts_of_unions_stand_where_their_poses_put_them():
    X = random_pose(rng_of("groups of a union"))
    groups, first = BodyGroups(UNION, X), len(RING.faces) + 1
    corner = BALL.vertices[BALL.faces[0].min()] + [0, 3, 2]
    for number, place in ((first, [0, 0, 2]), (first + 1, corner)):
        x, y, z, w = point_of(groups.item(number))
        assert np.allclose(np.array([x, y, z]) / w, X[:3, :3] @ place + X[:3, 3])


def test_surfaces_are_the_connected_ones():
    two = collide.Mesh(
        np.concatenate([box()[0], box()[0] + 9.0]), np.concatenate([box()[1], box()[1] + len(box()[0])])
    )
    assert BodyGroups(two, EYE).surfaces == [0, len(box()[1])]
    assert len(BodyGroups(UNION, EYE).surfaces) == 4 and len(BodyGroups(BALL, EYE).surfaces) == 1


def test_planes_must_part_every_pair():
    small, X = collide.Mesh(*box((-0.1,) * 3, (0.1,) * 3)), EYE
    surface = collide.Mesh(RING.vertices, RING.faces, solid=False)
    middle = collide.pose(tuple(0.5 * (RING.vertices.min(axis=0) + RING.vertices.max(axis=0))))
    r = collide.distance(surface, small, X, middle)
    planes = {(c.part_a, c.part_b): c.pairs[0] for c in r.certificate}
    a, b = BodyGroups(surface, X), BodyGroups(small, middle)
    assert not r.hit and len(planes) > 2 and flaw_of_planes(a, b, planes) is None
    for pair, normal in list(planes.items())[:12]:
        rest = {key: n for key, n in planes.items() if key != pair}
        assert flaw_of_planes(a, b, rest) is not None
        assert "not on different sides" in flaw_of_planes(a, b, {**planes, pair: tuple(-c for c in normal)})
        children = dict.fromkeys(cut_pair(a, b, *pair), normal)
        if children:  # the plane of a pair parts the pairs within it, too; half of them is not enough
            assert flaw_of_planes(a, b, {**rest, **children}) is None
            assert flaw_of_planes(a, b, {**planes, **children}) is not None
            assert flaw_of_planes(a, b, {**rest, **dict(list(children.items())[:1])}) is not None
    assert flaw_of_planes(a, b, {}) is not None and flaw_of_planes(a, b, {(0, 0): (0, 0, 1)}) is not None
    assert flaw_of_planes(a, b, {**planes, (10**40, -3): (1, 0, 0)}) is not None


def test_outside_of_solids():
    inside, beside = BodyGroups(collide.Sphere(0.1), EYE), BodyGroups(collide.Sphere(0.1), collide.pose((9, 0, 0)))
    ball = BodyGroups(BALL, EYE)
    assert "part 0 of A" in flaw_of_outside(ball, inside, {}) and "part 0 of B" in flaw_of_outside(inside, ball, {})
    assert flaw_of_outside(ball, beside, {}) is None and flaw_of_outside(ball, inside, {(0, 0): (1, 0, 0)}) is None
    assert flaw_of_outside(BodyGroups(collide.Mesh(BALL.vertices, BALL.faces, solid=False), EYE), inside, {}) is None


def test_points_in_items_and_in_solids():
    ball, can = BodyGroups(BALL, EYE), BodyGroups(collide.Cylinder(0.1, 0.2), EYE)
    assert flaw_of_meeting(ball, can, -1, 0, (0, 0, 0, 1)) is None
    assert flaw_of_meeting(can, ball, 0, -1, (0, 0, 1, 10)) is None
    for i, j, point in ((-2, 0, (0, 0, 0, 1)), (0, 0, (0, 0, 0, 1)), (-1, 1, (0, 0, 0, 1)), (-1, -1, (0, 0, 0, 1)),
                        (-1, 0, (0, 0, 0, 0)), (-1, 0, (0, 0, 0, -1)), (-1, 0, (9, 0, 0, 1)),
                        (10**30, 0, (0, 0, 0, 1))):
        assert flaw_of_meeting(ball, can, i, j, point) is not None
