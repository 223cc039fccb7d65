"""Casts, rays and nearest bodies of a World against the same question asked of each body: unions, half-spaces, none."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose, random_pose, rng_of

import collide
from collide.casts.items_ahead import nearest_first
from collide.errors import InvalidArgument

BALL = collide.Sphere(0.25)
#: Two balls, one of them in a union within the union.
TWO = collide.Compound([(BALL, pose(t=(0, 1.0, 0))), (collide.Compound([(BALL, pose(t=(0.5, -1, 0)))]), np.eye(4))])


def scattered(seed: int) -> tuple[collide.World, list]:
    rng, world = rng_of("casts of a world", seed), collide.World()
    floor = collide.Halfspace((0, 0, 1.0), -2.0)
    shapes = [BALL, TWO, collide.Box((0.3, 0.5, 0.7)), TWO, collide.Capsule(0.1, 0.5), floor]
    for shape in shapes:
        X_WB = np.eye(4) if isinstance(shape, collide.Halfspace) else random_pose(rng, 1.5)
        world.add(shape, X_WB)
    world.remove(world.add(BALL))
    return world, [world.body(identity) for identity in world.ids]


def test_an_empty_world_is_met_by_nothing():
    world = collide.World()
    asked = (world.shape_cast(BALL, np.eye(4), (1.0, 0, 0)), world.raycast((0, 0, 0), (1.0, 0, 0)),
             world.nearest((0, 0, 0)))
    for hits in asked:
        assert len(hits) == 1 and hits.names == [None] and not hits["hit"][0] and hits["distance"][0] == np.inf
        assert hits["body"][0] == -1 and repr(hits) == "WorldHits(1 rows, 0 of them hits)"
    assert world.raycast((0, 0, 0), (1.0, 0, 0), all_hits=True).starts.tolist() == [0, 0]


def test_no_questions_have_no_rows():
    world, none = scattered(0)[0], np.zeros((0, 3))
    for asked in (world, collide.World()):
        assert len(asked.shape_cast(BALL, np.zeros((0, 4, 4)), none)) == len(asked.raycast(none, none)) == 0
        assert len(asked.nearest(none)) == 0 and asked.raycast(none, none, all_hits=True).starts.tolist() == [0]


@pytest.mark.parametrize("shape", [BALL, TWO], ids=["ball", "union"])
def test_a_shape_meets_what_it_meets_first(shape):
    """Also a union, whose box is around all of its parts; by every body asked alone."""
    n_hits = 0
    for seed in range(2):
        rng, (world, bodies) = rng_of("cast shapes", seed), scattered(seed)
        X_WS = np.array([random_pose(rng, 2.5) for _ in range(4)])
        X_WS[:, 2, 3] += 2.0
        directions = rng.normal(size=(4, 3)) - X_WS[:, :3, 3]
        hits = world.shape_cast(shape, X_WS, directions)
        for row, X, direction in zip(hits, X_WS, directions):
            alone = [collide.shape_cast(shape, X, direction, body.shape, body.X_WB) for body in bodies]
            least = min(float(one.distance) if one.hit else np.inf for one in alone)
            assert row["hit"] == (least < np.inf) and (not row["hit"] or abs(row["distance"] - least) <= 1e-9), seed
            n_hits += bool(row["hit"])
    assert 3 <= n_hits


def test_a_union_is_met_by_the_part_that_is_farthest_out():
    world = collide.World()
    post = world.add(BALL, pose(t=(4.0, 1.0, 0)))
    hits = world.shape_cast(TWO, [np.eye(4), pose(t=(0, 2.0, 0)), pose(t=(0, 4.0, 0))], (1.0, 0, 0))
    assert hits["body"].tolist() == [post, post, -1]
    assert np.allclose(hits["distance"][:2], (3.5, 3.0), atol=1e-12)


def test_rays_tell_the_part_and_the_body():
    """Numbers of parts begin anew with every body."""
    world = collide.World()
    ids = [world.add(TWO, pose(t=(2.0 * k, 0, 0)), name=f"two {k}") for k in range(3)]
    for y, item in ((1.0, 0), (-1.0, 1)):
        hits = world.raycast([(-1.0, y, 0)] * 2, [(1.0, 0, 0), (0, 0, 1.0)], all_hits=True)
        assert hits["item"].tolist() == [item] * 6 and hits["body"].tolist() == np.repeat(ids, 2).tolist()
        assert hits.starts.tolist() == [0, 6, 6] and hits.names == [f"two {k}" for k in (0, 0, 1, 1, 2, 2)]
        first = world.raycast((-1.0, y, 0), (1.0, 0, 0))
        assert first["item"].tolist() == [item] and first.names == ["two 0"]


def test_half_spaces_are_met_by_every_ray_and_are_near_to_every_point():
    """Two of them, one a body of a union: neither has a box. A ball is before them, and not met."""
    world = collide.World()
    world.add(BALL, pose(t=(0, 90.0, 0)))
    floor = world.add(collide.Halfspace((0, 0, 1.0), 0.0))
    wall = world.add(collide.Compound([(BALL, pose(t=(0, 0, 9.0))), (collide.Halfspace((1.0, 0, 0), -3.0), np.eye(4))]))
    rays = world.raycast([(0, 0, 1.0), (0, 0, 1.0), (0, 0, 1.0)], [(0, 0, -2.0), (-1.0, 0, 0), (1.0, 0, 0)])
    assert rays["body"].tolist() == [floor, wall, -1] and rays["distance"].tolist()[:2] == [0.5, 3.0]
    assert rays["item"].tolist() == [0, 1, -1]
    points = world.nearest([(0, 0, 1.0), (-2.5, 0, 1.0), (0, 0, -1.0)])
    assert points["body"].tolist() == [floor, wall, floor] and np.allclose(points["distance"], (1.0, 0.5, -1.0))


def test_what_is_exactly_at_the_limit_counts():
    world = collide.World()
    box = world.add(collide.Box((1.0, 1.0, 1.0)), pose(t=(2.0, 0, 0)))
    below = float(np.nextafter(1.5, 0.0))
    assert world.nearest((0, 0, 0), max_distance=1.5)["body"].tolist() == [box]
    assert world.nearest((0, 0, 0), max_distance=1.5 - 1e-12)["body"].tolist() == [-1]
    assert world.raycast((0, 0, 0), (1.0, 0, 0), max_distance=1.5)["hit"].all()
    assert not world.raycast((0, 0, 0), (1.0, 0, 0), max_distance=below)["hit"].any()
    cube = collide.Box((1.0, 1.0, 1.0))
    outside = world.query(cube, np.eye(4), max_distance=9.0)
    lower = float(outside.rows["lower"][0])  # not proven farther than this
    assert abs(lower - 1.0) <= 1e-12 and len(world.query(cube, np.eye(4), max_distance=lower)) == 1
    assert len(world.query(cube, np.eye(4), max_distance=0.999)) == 0


@pytest.mark.parametrize(
    ("group", "mask", "met"), [(None, None, 0), (2, None, 1), (None, 2, 1), (1, 1, 0), (4, None, -1)]
)
def test_bodies_are_left_out_by_group_and_mask(group, mask, met):
    world = collide.World()
    for k, bits in enumerate((1, 2)):
        world.add(BALL, pose(t=(1.0 + k, 0, 0)), group=bits, mask=bits)
    values = {"group": group, "mask": mask}
    assert world.raycast((0, 0, 0), (1.0, 0, 0), **values)["body"].tolist() == [met]
    assert world.shape_cast(collide.Sphere(0.1), np.eye(4), (1.0, 0, 0), **values)["body"].tolist() == [met]
    assert world.nearest((0, 0, 0), **values)["body"].tolist() == [met]


@pytest.mark.parametrize("name", ["group", "mask"])
@pytest.mark.parametrize("value", [-1, 2**32, 1.0, "1"])
def test_groups_and_masks_are_integers_of_32_bits(name, value):
    world = scattered(0)[0]
    assert len(world.nearest((0, 0, 0), **{name: 2**32 - 1})) == len(world.nearest((0, 0, 0), **{name: 0})) == 1
    with pytest.raises(InvalidArgument, match=f"World.nearest: {name} must be an integer of up to 32 bits, or None"):
        world.nearest((0, 0, 0), **{name: value})


def test_pairs_are_handed_out_by_twos_until_none_may_be_nearer():
    owner, bounds = np.array([0, 0, 0, 0, 1, 1]), np.array([0.0, 1.0, 2.0, 3.0, 5.0, 6.0])
    every = [some.tolist() for some in nearest_first(owner, bounds, np.full(2, np.inf))]
    assert every == [[0, 4], [1, 2, 5], [3]]
    assert [some.tolist() for some in nearest_first(owner, bounds, np.array([1.0, 5.0]))] == [[0, 4], [1]]
    assert list(nearest_first(owner[:0], bounds[:0], np.zeros(0))) == []


def test_the_first_cast_that_hits_may_be_any():
    """Of three casts the second alone meets the ball, or the last two, or all."""
    world = collide.World()
    world.add(BALL, pose(t=(2.0, 0, 0)))
    for aims in ([0, 1, 0], [0, 1, 1], [0, 0, 1], [1, 1, 1]):
        directions = np.array([(1.0, 0, 0) if aim else (-1.0, 0, 0) for aim in aims])
        hits = world.shape_cast(BALL, np.eye(4), directions)
        assert hits["hit"].astype(int).tolist() == aims, aims
        assert np.allclose(hits["distance"][hits["hit"]], 1.5)


def test_of_bodies_touched_at_once_one_body_fills_the_row():
    """The least id was told beside the point of whichever body came first in the batch."""
    rng, n_ties = np.random.default_rng(62), 0
    world, shapes = collide.World(), (collide.Box((1, 1, 1)), collide.Sphere(0.5))
    for k in range(60):
        world.add(shapes[k % 2], collide.pose(rng.integers(0, [6, 6, 2]).astype(float)))
    for shape in (*shapes, collide.Box((2.5, 1.5, 0.5))):
        for _ in range(120):
            X, direction = collide.pose(rng.integers(-2, 16, 3) * 0.5), rng.integers(-1, 2, 3) * 1.0
            if not direction.any():
                continue
            row = world.shape_cast(shape, X, direction).rows[0]
            if row["hit"] and not row["at_start"]:
                met = world.body(int(row["body"]))
                alone = collide.shape_cast(shape, X, direction, met.shape, met.X_WB)
                assert (row["normal"] == alone.normal).all() and (row["point"] == alone.point).all(), (shape, X)
                n_ties += 1
    assert n_ties > 25
