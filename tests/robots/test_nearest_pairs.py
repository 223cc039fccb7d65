"""The nearest pair of a configuration beside bodies that are not convex: rings, shells, terrains, unions with meshes.

Judges are pairs asked one by one, and for a share of the configurations every triangle against every other in numpy.
"""

from __future__ import annotations

import os
from fractions import Fraction

import naive_soups
import numpy as np
import pytest
from hollow_bodies import hollow_scene, torus
from naive import pose, rng_of
from random_robots import (
    asked_one_by_one,
    pairs_to_test,
    random_configurations,
    slider,
)

import collide

#: More for a soak.
N_SCENES = int(os.environ.get("COLLIDE_HOLLOW_SCENES", "12"))


def told(seed: int, q) -> str:
    return (
        f"\nfrom test_nearest_pairs import *\nrng, robot, world = hollow_scene({seed})\n"
        f"print(collide.RobotChecker(robot, world).distances({[q.tolist()]}).rows)\n"
    )


@pytest.mark.many(6)
@pytest.mark.parametrize("seed", range(N_SCENES))
def test_equal_to_the_least_of_pairs_asked_one_by_one(seed):
    rng, robot, world = hollow_scene(seed)
    checker = collide.RobotChecker(robot, world)
    Q = random_configurations(rng, robot, 12)
    limit = float(rng.choice([0.02, 0.1, 0.35]))
    hits = np.array([any(pairs) for pairs in asked_one_by_one(checker, Q, collide.collide)])
    some = np.append(np.flatnonzero(hits)[:1], np.flatnonzero(~hits)[:6])
    Q, hits = Q[some], hits[some]
    all_of, within = checker.distances(Q), checker.distances(Q, max_distance=limit)
    assert all_of.hit.tolist() == within.hit.tolist() == hits.tolist() and not (all_of.distance[hits] > 0.0).any()
    for k in np.flatnonzero(~hits).tolist():
        (pairs,) = asked_one_by_one(checker, Q[k : k + 1], collide.distance)
        lower, upper = min(r.lower for r in pairs), min(r.upper for r in pairs)
        row, near, say = all_of.rows[k], within.rows[k], told(seed, Q[k])
        least = min(r.distance for r in pairs)
        assert not row["hit"] and abs(row["distance"] - least) <= 1e-9, f"{row['distance']}, not {least}\n{say}"
        assert row["lower"] <= upper and lower <= row["upper"], say
        if least > limit + 1e-9:
            assert near["beyond"] and near["lower"] == limit, say
        else:
            assert near["distance"] == row["distance"] and within.names[k] == all_of.names[k], say


def test_equal_to_every_triangle_against_every_other():
    n_judged = n_far = 0
    for seed in range(4, N_SCENES):
        rng, robot, world = hollow_scene(seed)
        checker = collide.RobotChecker(robot, world)
        Q = random_configurations(rng, robot, 12)
        Q = Q[~checker.collides(Q)][:2]
        measured = checker.distances(Q)
        for k in range(len(Q)):
            row, limit = measured.rows[k], float(measured.distance[k]) + 1e-3

            def least(*case, limit=limit):
                gap = naive_soups.gap(*case, limit=limit)
                # A curved shape is no soup: its bracket is that of the engine.
                return collide.distance(*case).distance if gap is None else gap

            (gaps,) = asked_one_by_one(checker, Q[k : k + 1], least)
            assert abs(row["distance"] - min(gaps)) <= 1e-9, f"{row}: {min(gaps)}{told(seed, Q[k])}"
            n_judged += 1
            n_far += row["distance"] > 0.05
    assert n_judged >= 12 and n_far >= 6, (n_judged, n_far)


def test_a_hull_that_is_near_does_not_end_the_search():
    """A ball within a ring: the hull of the ring holds it, its facets are 0.8 m away, and a box is nearer."""
    world = collide.World()
    world.add(torus(1.0, 0.1, 16, 8), name="ring")
    box = world.add(collide.Box((0.2, 0.2, 0.2)), pose(t=(0, 0, 0.3)), name="box")
    checker = collide.RobotChecker(slider(), world)
    for limit in (np.inf, 0.35, 0.1):
        measured = checker.distances([[0.0]], max_distance=limit)
        assert measured.names == [("cart", "box")] and abs(measured.distance[0] - 0.1) <= 1e-12
    assert checker.distances([[0.0]], max_distance=0.09).beyond[0]
    world.remove(box)
    alone = checker.distances([[0.0]])
    assert alone.names == [("cart", "ring")] and 0.7 < alone.distance[0] < 0.8
    assert checker.distances([[0.0]], max_distance=0.7).beyond[0]


def test_unions_are_their_deepest_parts_wherever_a_pair_is_decided():
    """A union whose one part touches a wall exactly, which doubles leave open, while the other is 1/16 m inside."""
    deep, flush = collide.Box((0.5, 0.25, 0.5)), collide.Box((0.25, 0.25, 0.25))
    world = collide.World()
    wall = collide.Box((0.5, 0.5, 4.0))
    world.add(wall, pose(t=(0.375, 0, 0)), name="wall")
    for shift in (0.0, 0.125):
        union = collide.Compound([(deep, pose(t=(0, 0.3125, 0))), (flush, pose(t=(-shift, 0, 1.0)))])
        assert collide.distance(union, wall, np.eye(4), pose(t=(0.375, 0, 0))).distance <= -0.0625
        measured = collide.RobotChecker(slider(union), world).distances([[0.0]])
        assert measured.names == [("cart", "wall")] and measured.distance[0] == -0.0625, (shift, measured.rows)
        assert measured.lower[0] <= -0.0625 <= measured.upper[0] and measured.certified[0]


def test_brackets_of_swollen_meshes_hold_to_the_last_digit():
    """A mesh that touches a wall, both swollen: padding and margin in fractions, of which doubles round the sum."""
    notched = torus(0.5, 0.25, 8, 4)
    rng, n_rounded = rng_of("swollen meshes"), 0
    for _ in range(30):
        padding, margin = rng.uniform(1e-3, 0.3, 2).tolist()
        away = float(rng.choice([0.0, 0.125, 0.5]))
        world = collide.World()
        world.add(collide.Box((0.5, 4.0, 4.0)), pose(t=(1.0 + away, 0, 0)), name="wall", margin=margin)
        measured = collide.RobotChecker(slider(notched), world, padding=padding).distances([[0.0]])
        truth = Fraction(away) - Fraction(padding) - Fraction(margin)
        row = measured.rows[0]
        assert Fraction(float(row["lower"])) <= truth <= Fraction(float(row["upper"])), (padding, margin, away, row)
        assert row["upper"] - row["lower"] <= 1e-12
        n_rounded += Fraction(padding + margin) != Fraction(padding) + Fraction(margin)
    assert n_rounded > 5


def test_scenes_are_of_every_kind():
    """What the tests above are worth: configurations free and not, near pairs left to others and searched again."""
    free, kinds = [], set()
    for seed in range(N_SCENES):
        rng, robot, world = hollow_scene(seed)
        checker = collide.RobotChecker(robot, world)
        free += (~checker.collides(random_configurations(rng, robot, 12))).tolist()
        kinds |= {type(case[2]).__name__ for case in pairs_to_test(checker)}
    assert 0.3 < np.mean(free) < 0.95, np.mean(free)
    assert {"Mesh", "HeightField", "Compound", "Halfspace"} <= kinds, kinds
