"""Worlds, reports and trajectories beside bodies that are not convex: what ends a search, against all pairs one by one.

A search that a bound of one pair ends too early loses another pair. Judges: `collide.distance` of every pair without a
World, and for the nearest pair of a share of the scenes every triangle against every other in numpy.
"""

from __future__ import annotations

import os

import naive_soups
import numpy as np
import pytest
from hollow_bodies import hollow
from naive import pose, random_pose, rng_of

import collide
from collide.reports import report
from collide.reports.trajectory_report import follow, sample
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot
from collide.scenes import Scene, SceneBody
from collide.scenes.loaders.trajectories import Trajectory

#: More for a soak.
N_SCENES = int(os.environ.get("COLLIDE_HOLLOW_SCENES", "10"))
POINT = collide.ConvexHull(np.zeros((1, 3)))


def bodies(seed: int, n: int = 6) -> list[tuple]:
    """(shape, X_WB): few of them overlap, many are within each other's hulls."""
    rng = rng_of("hollow worlds", seed)
    made = [(hollow(rng, float(rng.choice([0.08, 0.3, 0.8]))), random_pose(rng, 1.3)) for _ in range(n)]
    if seed % 4 == 0:
        made.append((collide.Halfspace((0.2, 0.0, 1.0), -1.1), np.eye(4)))
    return made


def one_by_one(made: list[tuple]) -> dict[tuple[int, int], object]:
    """Rows of all pairs."""
    return {
        (i, j): collide.distance(made[i][0], made[j][0], made[i][1], made[j][1]).rows[0]
        for i in range(len(made)) for j in range(i + 1, len(made))
    }


@pytest.mark.many(6)
@pytest.mark.parametrize("seed", range(N_SCENES))
def test_worlds_name_the_nearest_and_all_within_a_distance(seed):
    made = bodies(seed)
    say = f"from test_hollow_worlds import *; print(one_by_one(bodies({seed})))"
    rows = one_by_one(made)
    world = collide.World()
    ids = [world.add(shape, X_WB) for shape, X_WB in made]
    for limit in (0.0, 0.05, 0.3, np.inf):
        within = {pair for pair, row in rows.items() if not row["lower"] > limit}
        told = world.distances(limit).rows
        assert {(ids.index(row["a"]), ids.index(row["b"])) for row in told} == within, (limit, say)
        nearest = world.minimum(limit).rows
        least = min((row["distance"] for row in rows.values()), default=np.inf)
        assert len(nearest) == (least <= limit), (limit, say)
        assert not len(nearest) or nearest["distance"][0] == least, (limit, nearest, say)


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(N_SCENES))
def test_nearest_bodies_of_points(seed):
    made = bodies(seed)
    world = collide.World()
    ids = [world.add(shape, X_WB) for shape, X_WB in made]
    points = rng_of("points among hollow bodies", seed).uniform(-1.5, 1.5, (30, 3))
    every, within = world.nearest(points), world.nearest(points, max_distance=0.2)
    n_inside = 0
    for k, p in enumerate(points):
        gaps = [collide.distance(POINT, shape, pose(t=p), X).distance for shape, X in made]
        least = min(gaps)
        say = f"from test_hollow_worlds import *; print(one_by_one(bodies({seed}))), point {p.tolist()}: {gaps}"
        assert every.rows["distance"][k] == least and ids.index(every.rows["body"][k]) == gaps.index(least), say
        assert (within.rows["body"][k] >= 0) == (least <= 0.2), say
        n_inside += least < 0
    assert n_inside < 30


def scene_of(made: list[tuple], carried: collide.Shape | None = None) -> Scene:
    """Bodies that stand still, but for the first, which a robot moves along x and turns; ``carried`` it moves alone."""
    joints = [Joint("slide", "prismatic", "base", "cart", made[0][1], (1.0, 0.0, 0.0), -3.0, 3.0),
              Joint("turn", "revolute", "cart", "hand", np.eye(4), (0.0, 0.6, 0.8), -3.0, 3.0)]
    geometry = {"hand": [LinkShape(made[0][0], np.eye(4), None, "test")]}
    if carried is not None:
        joints.append(Joint("fixed", "fixed", "cart", "wedge", np.linalg.inv(made[0][1])))
        geometry["wedge"] = [LinkShape(carried, np.eye(4), None, "test")]
    robot = Robot("mover", ["base", "cart", "hand", *list(geometry)[1:]], joints, geometry)
    scene = Scene("hollow", [SceneBody(f"body{k}", shape, X) for k, (shape, X) in enumerate(made) if k])
    scene.place_robot(robot, np.eye(4))
    return scene


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(N_SCENES))
def test_reports_list_what_is_within_the_clearance(seed):
    made = bodies(seed)
    rows, scene, clearance = one_by_one(made), scene_of(made), 0.25
    numbers = {body.name: 0 if body.name == "hand" else int(body.name[4:]) for body in scene.bodies}
    found = report.make(scene, clearance=clearance)
    told = {
        name: {tuple(sorted((numbers[pair["a"]], numbers[pair["b"]]))): pair for pair in getattr(found, name).dicts()}
        for name in ("colliding", "near", "touching")
    }
    say = f"from test_hollow_worlds import *; print(report.make(scene_of(bodies({seed})), clearance={clearance}))"
    assert set(told["colliding"]) == {pair for pair, row in rows.items() if row["hit"]}, say
    assert set(told["near"]) == {p for p, row in rows.items() if not row["hit"] and row["lower"] <= clearance}, say
    for pair, entry in told["near"].items():
        assert entry["distance"] == rows[pair]["distance"], say


def test_trajectories_tell_the_least_clearance():
    n_free = n_judged = 0
    for seed in range(N_SCENES):
        made = bodies(seed, 5)
        scene = scene_of(made)
        trajectory = Trajectory("test", [{"slide": -0.2, "turn": 0.0}, {"slide": 0.2, "turn": 0.5}], None)
        found = follow(scene, trajectory, clearance=0.02, resolution=0.05)
        path = sample(scene, trajectory, 0.05)
        robot = next(iter(scene.placements.values())).robot
        X_WLs = robot.link_poses(path.configurations["mover"])[:, robot.links.index("hand")]
        least = []
        for X in X_WLs:
            least += one_by_moved(made, X)
        say = f"from test_hollow_worlds import *; scene_of(bodies({seed}, 5)): {found['least']}"
        assert found["collides"] == any(row["hit"] for row in least), say
        told = found["least"]["distance"]
        if not found["collides"]:
            assert told == min(row["distance"] for row in least), say
            n_free += 1
            k = found["least"]["at"]["sample"]
            gaps = [
                naive_soups.gap(made[0][0], shape, X_WLs[k], X_WB, limit=told + 1e-3) for shape, X_WB in made[1:]
            ]
            if None not in gaps:
                assert abs(min(gaps) - told) <= 1e-9, (gaps, say)
                n_judged += 1
    assert n_free >= 2 and n_judged >= 1, (n_free, n_judged)


@pytest.mark.parametrize("stretch", [1.07, 1.2, 1.4])
def test_a_pair_known_by_a_lower_bound_does_not_end_a_search(stretch):
    """Two wedges √2 m apart of which only 1 m is proven, and two balls nearer than that: theirs is the least clearance.

    The first search is within a hundredth of the scene, 1.05 m.
    """
    wedge = collide.HPolytope([[1, 0, 0], [0, 1, 0]], [0, 0], bounded=False)
    other, X_WB = collide.HPolytope([[-1, 0, 0], [0, -1, 0]], [0, 0], bounded=False), pose(t=(1, 1, 0))
    row = collide.distance(wedge, other, np.eye(4), X_WB).rows[0]
    assert row["lower"] < 1.001 and row["distance"] > 1.4
    ball, at = collide.Sphere(0.1), np.array([-104.8, 50.0, 0.0])
    made = [(ball, pose(t=at)), (ball, pose(t=at + np.array([0, stretch + 0.2, 0]))), (other, X_WB)]
    scene = scene_of(made, carried=wedge)
    trajectory = Trajectory("test", [{"slide": 0.0, "turn": 0.0}, {"slide": -1e-3, "turn": 0.0}], None)
    for clearance in (0.0, 0.3, 1.05):
        found = follow(scene, trajectory, clearance=clearance)
        assert found["least"]["distance"] == pytest.approx(stretch, abs=1e-9), (clearance, found["least"])


def one_by_moved(made: list[tuple], X_WA: np.ndarray) -> list:
    """Rows of the first body, at another pose, with each of the others."""
    return [collide.distance(made[0][0], shape, X_WA, X_WB).rows[0] for shape, X_WB in made[1:]]
