"""Configurations and motions of robots checked: collide beside MuJoCo and Pinocchio, and what certificates cost.

    python benchmarks/robots.py                       # three minutes
    python benchmarks/robots.py --table clutter
    python benchmarks/robots.py --quick               # half a minute; no file

clutter    µs a configuration: a Panda (9 hulls, 8 boxes of fingers; meshes of example-robot-data) over a table with 10,
           50 and 200 boxes and hulls, at random configurations, whether anything collides. Ours stops at the first hit
           and proves both verdicts; MuJoCo makes all contacts, Pinocchio stops at the first hit: pair by pair, and
           through its broadphase manager. One thread each. Bars are µs that ours is to stay below
batches    µs a configuration of ours by the size of the batch, in the same scenes, and of distances with gradients
distances  µs a configuration of ours, with gradients: rows per robot, link and pair, with the world, among links, and
           both, within three limits; and how many rows come of it
motions    scenes of MotionBenchMaker (from ../shared/data): µs a random configuration, a motion of 32 samples, and a
           motion proven free or hit, with the share that stays open. Motions begin at random free configurations and
           change every joint by up to 0.5 rad

planned    a Panda over a table with 10, 50 and 200 boxes and hulls: µs a motion proven or hit, of the same waypoints as
           straight motions, as segments of a path, as cubic B-splines, quintic segments at rest and Bézier curves of
           degree 7; and µs a box of configurations of half a tenth of a radian, with at most 500 cells

CPU time. `tests/differential/test_robots.py` judges the verdicts of these scenes.
"""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path

import numpy as np
from inputs import SHARED
from robot_peers import MujocoRobot, PinocchioRobot, at_random, clutter, panda

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main
from collide.scenes import load

OBSTACLES = (10, 50, 200)
#: Thousand configurations a second that ours is to reach at least.
BARS = {10: 521.0, 50: 342.0, 200: 261.0}


def cluttered(options: Options, obstacles: int) -> Race:
    (robot, urdf), world = panda(), clutter(obstacles)
    checker, Q, large = collide.RobotChecker(robot, world), at_random(robot, 600), at_random(robot, 6000)
    tasks: dict = {"collide": partial(checker.collides, large)}
    if installed(mujoco="mujoco"):
        mujoco = MujocoRobot(robot, world)
        tasks["mujoco"] = partial(mujoco.collides, mujoco.configurations(Q))
    if installed(pinocchio="pinocchio"):
        pinocchio = PinocchioRobot(robot, world, urdf)
        asked = pinocchio.configurations(Q)
        tasks["pinocchio pairs"] = partial(pinocchio.collides, asked)
        tasks["pinocchio manager"] = partial(pinocchio.collides_by_manager, asked)
    per = dict.fromkeys(tasks, 600.0) | {"collide": 6000.0}
    return Race(tasks, per, {"hit": float(checker.collides(Q).mean())}, bars={"collide": 1e3 / BARS[obstacles]})


def batches(options: Options, obstacles: int, question: str, batch: int) -> Race:
    checker = collide.RobotChecker(panda()[0], clutter(obstacles))
    return Race({"collide": partial(getattr(checker, question), at_random(checker.robot, batch))}, batch)


def batch_cases(options: Options):
    yield from grid(obstacles=OBSTACLES, question=["collides"], batch=(1, 10, 100, 1000, 10_000))
    yield from grid(obstacles=OBSTACLES, question=["distances"], batch=(1, 100, 2000))


def near(options: Options, per: str, between: str, max_distance: float) -> Race:
    checker = collide.RobotChecker(panda()[0], clutter(50))
    Q = at_random(checker.robot, 500 if per == "pair" and max_distance == np.inf else 2000)
    ask = partial(checker.distances, Q, per=per, between=between, max_distance=max_distance)
    return Race({"collide": ask}, len(Q), {"rows": len(ask()) / len(Q)})


def near_cases(options: Options):
    yield from grid(per=["robot", "link", "pair"], between=["all"], max_distance=(0.05, 0.2, np.inf))
    yield from grid(per=["robot", "link", "pair"], between=["world", "self"], max_distance=(0.2,))


@cache
def checker_of(path: Path, meshes: str) -> collide.RobotChecker:
    return collide.RobotChecker.from_scene(load(path, meshes=meshes))


def motions(options: Options, robot: str, family: str, meshes: str) -> Race:
    folder = SHARED / "scenes" / "motionbenchmaker" / robot / family
    checker, hulls = checker_of(min(folder.glob("scene*.yaml")), meshes), meshes == "hull"
    Q = at_random(checker.robot, 20_000 if hulls else 2_000)
    free = Q[~checker.collides(Q)][: 400 if hulls else 60]
    rng, sample = np.random.default_rng(7), Q[: 4_000 if hulls else 300]
    ends = np.clip(free + rng.uniform(-0.5, 0.5, free.shape), checker.robot.lower, checker.robot.upper)
    samples = (free + np.linspace(0.0, 1.0, 32)[:, None, None] * (ends - free)).reshape(-1, checker.robot.dof)
    edges = checker.certify_edges(free, ends)
    tasks = {
        "configurations": lambda: checker.collides(sample), "motions of 32": lambda: checker.collides(samples),
        "certified": lambda: checker.certify_edges(free, ends),
    }
    per = {"configurations": len(sample), "motions of 32": len(free), "certified": len(free)}
    columns = {"hit": float(checker.collides(sample).mean()), "proven_free": float(edges.free.mean()),
               "collide": float(edges.collides.mean()), "open": float(edges.is_open.mean()),
               "configurations_a_proof": edges.n_checked / max(len(free), 1)}
    return Race(tasks, per, columns)


def motion_cases(options: Options):
    folder = SHARED / "scenes" / "motionbenchmaker"
    for robot in ("panda", "ur5", "fetch") if folder.is_dir() else ():
        for family in sorted((folder / robot).iterdir())[: 1 if options.quick else None]:
            yield from grid(robot=[robot], family=[family.name], meshes=("hull", "mesh"))


def planned(options: Options, obstacles: int) -> Race:
    """Motions of up to 0.5 rad a joint from free configurations, and how many are proven free of each kind."""
    robot = panda()[0]
    checker, rng = collide.RobotChecker(robot, clutter(obstacles)), np.random.default_rng(11)
    Q = at_random(robot, 4000)
    free = Q[~checker.collides(Q)][:200]
    ends = np.clip(free + rng.uniform(-0.5, 0.5, free.shape), robot.lower, robot.upper)
    inner = [free + s * (ends - free) + rng.uniform(-0.05, 0.05, free.shape) for s in np.linspace(0.15, 0.85, 6)]
    points = np.stack([free, *inner, ends], axis=1)
    knots = np.concatenate([[0.0] * 4, np.linspace(0.2, 0.8, 4), [1.0] * 4])
    splines = {
        "path": [collide.Spline.straight(pair) for pair in points[:, [0, 7]]],
        "B-spline": [collide.Spline.bspline(knots, row, 3) for row in points],
        "quintic": [collide.Spline.min_jerk(row[[0, 7]]) for row in points],
        "degree 7": [collide.Spline.bezier(row) for row in points],
    }

    def prove(motions: list[collide.Spline]) -> list[bool]:
        return [checker.certify_spline(motion).is_free for motion in motions]

    lo, hi = free - 0.025, free + 0.025
    tasks = {"straight": lambda: checker.certify_edges(free, ends),
             "straight one by one": lambda: [checker.certify_edges(a, b).free[0] for a, b in zip(free, ends)]}
    tasks |= {name: partial(prove, motions) for name, motions in splines.items()}
    tasks["box"] = lambda: checker.certify_boxes(lo, hi, max_cells=500)
    columns = {"straight_free": float(checker.certify_edges(free, ends).free.mean())}
    columns |= {f"{name}_free": float(np.mean(prove(motions))) for name, motions in splines.items()}
    columns["box_free"] = float(checker.certify_boxes(lo, hi, max_cells=500).free.mean())
    return Race(tasks, dict.fromkeys(tasks, float(len(free))), columns)


CLAIMS = [
    Claim("clutter", "µs a configuration", lambda o: grid(obstacles=OBSTACLES), cluttered, file="robots_clutter",
          bar="median"),
    Claim("batches", "µs a configuration", batch_cases, batches, file="robots_batches", seconds=2.0),
    Claim("distances", "µs a configuration", near_cases, near, file="robots_distances", seconds=2.0),
    Claim("planned", "µs a motion or box", lambda o: grid(obstacles=OBSTACLES), planned, file="robots_planned",
          turns=5),
    Claim("motions", "µs a configuration or motion", motion_cases, motions, file="robots_motions", turns=5),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
