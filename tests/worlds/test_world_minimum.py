"""The nearest pair of a World against the least of all pairs: overlaps, ties, pairs that boxes hide, limits."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from naive import pose, random_pose, rng_of

import collide
from collide.worlds.minimum import lower_bounds
from collide.worlds.packed_world import PackedWorld

BOX = collide.Box((1.0, 1.0, 1.0))


def least_pair(world: collide.World) -> tuple[float, tuple[int, int]]:
    """By every pair; of several as near the one with the least ids."""
    bodies = [world.body(identity) for identity in world.ids]
    asked = [(collide.distance(a.shape, b.shape, a.X_WB, b.X_WB).distance, (a.id, b.id))
             for a, b in itertools.combinations(bodies, 2)]
    return min(asked)


def told(world: collide.World, limit: float = np.inf) -> tuple[float, tuple[int, int]] | None:
    rows = world.minimum(limit).rows
    return (float(rows["distance"][0]), (int(rows["a"][0]), int(rows["b"][0]))) if len(rows) else None


@pytest.mark.parametrize("spread", [0.3, 0.6, 3.0])
def test_the_least_of_all_pairs_of_balls(spread):
    """Overlaps of all of them, of some, of none: more pairs than are asked at once, added in no order."""
    for seed in range(6):
        rng, world = rng_of("nearest of balls", spread, seed), collide.World()
        for _ in range(12):
            world.add(collide.Sphere(float(rng.uniform(0.1, 0.5))), pose(t=rng.uniform(-spread, spread, 3)))
        assert told(world) == least_pair(world), f"spread {spread}, seed {seed}"


def test_of_pairs_as_near_the_first_is_told():
    """Cubes of a lattice, half a metre apart, in shuffled places; some are taken out again."""
    for seed in range(4):
        rng, world = rng_of("nearest of a lattice", seed), collide.World()
        for cell in rng.permutation(list(itertools.product(range(3), repeat=3))):
            world.add(BOX, pose(t=1.5 * cell))
        for identity in rng.choice(27, 5, replace=False).tolist():
            world.remove(identity)
        assert told(world) == least_pair(world) and told(world)[0] == 0.5, seed


def test_a_pair_nearer_by_a_hair_is_not_hidden_by_one_whose_boxes_meet():
    """Boxes of two balls meet, so that the balls are asked first; two cubes are nearer by a share of 2^-26, 2^-40."""
    for share in (2.0**-26, 2.0**-30, 2.0**-40):
        world, ball = collide.World(), collide.Sphere(0.5)
        world.add(ball)
        world.add(ball, pose(t=(0.8, 0.8, 0)))
        gap = float(np.hypot(0.8, 0.8) - 1.0)
        world.add(BOX, pose(t=(50.0, 0, 0)))
        world.add(BOX, pose(t=(51.0 + gap * (1.0 - share), 0, 0)))
        distance, pair = told(world)
        assert pair == (2, 3) and distance < gap, (share, distance, gap)


def test_deep_overlaps_of_meshes_are_not_judged_by_their_boxes():
    """A cube without its lid within another one: its boxes overlap deeply, its surfaces are apart."""
    mesh = collide.tessellate(collide.Box((4.0, 4.0, 4.0)))
    world = collide.World()
    world.add(collide.Mesh(mesh.vertices, mesh.faces[:-2]))
    world.add(BOX)
    world.add(BOX, pose(t=(0.75, 0, 0)))
    assert told(world)[1] == (1, 2) and told(world)[0] == -0.25
    world.set_pose(2, pose(t=(40.0, 0, 0)))
    assert told(world)[1] == (0, 1) and abs(told(world)[0] - 1.5) <= 1e-12


def test_half_spaces_are_the_deepest_of_all():
    world = collide.World()
    world.add(BOX, pose(t=(0, 0, 3.0)))
    floor = world.add(collide.Halfspace((0, 0, 1.0), 0.0))
    assert told(world) == (2.5, (0, floor))
    world.add(collide.Halfspace((1.0, 0, 0), -9.0))
    assert told(world)[0] == -np.inf and told(world)[1] == (1, 2)


@pytest.mark.parametrize("n", [0, 1])
def test_of_fewer_than_two_bodies_there_is_no_pair(n):
    world = collide.World()
    for _ in range(n):
        world.add(BOX)
    assert told(world) is None and told(world, 0.0) is None


def test_limits_count_what_is_exactly_as_far():
    world = collide.World()
    world.add(BOX)
    world.add(BOX, pose(t=(1.25, 0, 0)))
    assert told(world, 0.25) == told(world) == (0.25, (0, 1))
    assert told(world, 0.25 - 1e-12) is None and told(world, 0.0) is None
    world.set_pose(1, pose(t=(1.0, 0, 0)))
    assert told(world, 0.0) == (0.0, (0, 1))


def test_bounds_are_below_every_distance():
    """Gaps of boxes along an axis or across a corner, how deep boxes overlap; none of half-spaces and meshes there."""
    world, mesh = collide.World(), collide.tessellate(collide.Box((1.0, 1.0, 1.0)))
    for x, y in ((0, 0), (3.0, 0), (4.5, 5.0), (0.25, 0)):
        world.add(BOX, pose(t=(x, y, 0)))
    world.add(collide.Mesh(mesh.vertices, mesh.faces[:-2]), pose(t=(0.25, 0, 0)))
    world.add(collide.Halfspace((0, 0, 1.0), -9.0))
    pairs = np.array([(0, 1), (1, 2), (0, 3), (0, 4), (1, 4), (0, 5)])
    bounds = lower_bounds(world._pack(), pairs)
    expected = [2.0, np.hypot(0.5, 4.0), -0.75, -np.inf, 1.75, -np.inf]
    for bound, value in zip(bounds.tolist(), expected):
        assert bound == value if np.isinf(value) else value - 1e-6 <= bound < value, bounds


def asked_pairs(world: collide.World, monkeypatch) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """The rows of `minimum`, and every pair that was answered for them, as often as it was."""
    asked: list[tuple[int, int]] = []
    answer = PackedWorld.answer

    def counted(packed, candidates, *rest, **named):
        asked.extend(map(tuple, candidates.tolist()))
        return answer(packed, candidates, *rest, **named)

    with monkeypatch.context() as patch:
        patch.setattr(PackedWorld, "answer", counted)
        rows = world.minimum().rows
    return rows, asked


@pytest.mark.parametrize("seed", range(8))
def test_pairs_are_asked_once_and_the_row_is_that_of_the_pair(seed, monkeypatch):
    """Two to seven bodies, meshes and unions among them, deep in one another or apart: no pair whose depth is told, and
    none that was asked without a limit, is asked again; rows are those of `distances`, to the last bit.
    """
    rng, n_overlaps = rng_of("each pair once", seed), 0
    mesh = collide.Mesh(*collide.tessellate(collide.Ellipsoid((0.4, 0.3, 0.5))))
    union = collide.Compound([(BOX, pose()), (mesh, pose(t=(0.6, 0, 0)))])
    shapes = [mesh, union, BOX, collide.Cylinder(0.3, 0.8), collide.Sphere(0.4)]
    for case in range(6):
        world, spread = collide.World(), (0.3, 3.0)[case % 2]
        for _ in range(int(rng.integers(2, 8))):
            world.add(shapes[int(rng.integers(5))], random_pose(rng, spread))
        rows, asked = asked_pairs(world, monkeypatch)
        every = world.distances().rows
        pair = every[(every["a"] == rows["a"][0]) & (every["b"] == rows["b"][0])]
        assert rows.tobytes() == pair.tobytes(), f"seed {seed}, case {case}"
        n_overlaps += int(rows["hit"][0])
        repeated = len(asked) - len(set(asked))
        assert repeated == 0 or (repeated == 1 and not rows["hit"][0] and len(asked) > 17), f"seed {seed}, case {case}"
    assert n_overlaps >= 2
