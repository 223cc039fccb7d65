"""What a planner asks of a robot: configurations and motions, single and many, obstacles that move, parts attached.

    python benchmarks/robot_checks.py                  # two minutes
    python benchmarks/robot_checks.py --table single
    python benchmarks/robot_checks.py --quick          # half a minute; no file

batches   µs a configuration at random and a motion of 1 rad from a free one, in scenes of MotionBenchMaker (from
          ../shared/data): robots of spheres (the published spherised URDFs), of hulls, of meshes as they are. Motions
          are proven (``certify_edges``), or sampled every 0.01 rad (``edge_collides``). "by pairs" leaves out spheres
          and maps: each near pair is asked of the narrowphase. The share that spheres and maps leave open is told
single    µs a call from Python: one configuration, one motion proven or sampled, a path of 100 motions a motion, one
          obstacle moved and one configuration asked, a pair allowed, an object attached and detached, a checker made
          of a loaded scene

CPU time, one thread. `tests/robots/test_sphere_lanes.py` and its neighbours judge the verdicts.
"""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path

import numpy as np
from inputs import SHARED

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, main
from collide.scenes import load

ROBOTS = ("panda", "fetch", "ur5")
#: So many configurations are enough for spheres and maps.
ENOUGH = 10**6


@cache
def scene_of(robot: str, family: str, meshes: str):
    folder = SHARED / "scenes" / "motionbenchmaker" / robot / f"{family}_{robot}"
    return load(min(folder.glob("scene*.yaml")), meshes=meshes)


@cache
def checker_of(robot: str, family: str, geometry: str) -> collide.RobotChecker:
    """geometry : "spheres", "hull" or "mesh"."""
    checker = collide.RobotChecker.from_scene(scene_of(robot, family, "hull" if geometry == "spheres" else geometry))
    if geometry != "spheres":
        return checker
    urdf = SHARED / "robots" / robot / f"{robot}_spherized.urdf"
    spherised = collide.Robot.load(urdf, srdf=urdf.with_name(f"{robot}.srdf"))
    world = collide.World()
    for body in checker.setting.surroundings.bodies:
        if body.name not in spherised.links:
            world.add(body.shape, body.X_WB, name=body.name, static=True)
    # The UR5's spheres of these links always meet, and its SRDF leaves the pair out (`collide srdf --compare`).
    always = [("fts_robotside", "wrist_2_link")] if robot == "ur5" else []
    return collide.RobotChecker(spherised, world, X_WR=checker._X_WR, allowed=always)


def by_pairs(checker: collide.RobotChecker) -> collide.RobotChecker:
    """The same robot in the same World, without spheres and maps."""
    plain = collide.RobotChecker(checker.robot, checker.world, X_WR=checker._X_WR, allowed=checker._asked)
    plain._spheres_among = lambda around: None  # type: ignore[method-assign]
    plain._n_asked, plain._setting = ENOUGH, None
    plain.prepare()
    return plain


def at_random(checker: collide.RobotChecker, n: int) -> np.ndarray:
    rng, robot = np.random.default_rng(1), checker.robot
    return rng.uniform(np.maximum(robot.lower, -3.0), np.minimum(robot.upper, 3.0), (n, robot.dof))


def motions_of(checker: collide.RobotChecker, n: int) -> tuple[np.ndarray, np.ndarray]:
    """From free configurations, 1 rad long where limits allow."""
    Q = at_random(checker, 40 * n)
    Q = Q[~checker.collides(Q)][:n]
    way = np.random.default_rng(2).normal(size=Q.shape)
    ends = Q + way / np.linalg.norm(way, axis=1)[:, None]
    return Q, np.clip(ends, np.maximum(checker.robot.lower, -9.0), np.minimum(checker.robot.upper, 9.0))


def share_open(checker: collide.RobotChecker, Q: np.ndarray) -> float:
    """Of configurations, what spheres and maps leave to the narrowphase."""
    from collide.kernels import address_of
    from collide.robots.check_configurations import check_configurations

    space, n_open, verdicts = checker._workspace(checker.setting), 0, np.zeros(8, dtype=np.uint8)
    space.stand(checker.setting)
    for k in range(0, len(Q) - 7, 8):
        q = np.ascontiguousarray(Q[k : k + 8])
        check_configurations(space.address, address_of(q), q.shape[1], 0, 8, address_of(verdicts))
        n_open += int((space._spheres.verdicts[1] != 0.0).sum())
    return n_open / (len(Q) // 8 * 8)


def batches(options: Options, robot: str, geometry: str, family: str) -> Race:
    checker = checker_of(robot, family, geometry)
    checker._count(ENOUGH)
    plain, is_mesh = by_pairs(checker), geometry == "mesh"
    Q = at_random(checker, 4_000 if is_mesh else 20_000)
    some, (q0, q1) = Q[: 400 if is_mesh else 4_000], motions_of(checker, 50 if is_mesh else 500)
    checker.certify_edges(q0, q1), plain.certify_edges(q0, q1)  # trees of meshes
    edges = checker.certify_edges(q0, q1)
    tasks = {
        "configurations": partial(checker.collides, Q), "by pairs": partial(plain.collides, some),
        "motions proven": partial(checker.certify_edges, q0, q1),
        "motions by pairs": partial(plain.certify_edges, q0, q1),
        "motions sampled": partial(checker.edge_collides, q0, q1),
    }
    per = {"configurations": len(Q), "by pairs": len(some)} | dict.fromkeys(list(tasks)[2:], len(q0))
    differ = float((checker.collides(some) != plain.collides(some)).sum())
    columns = {"hit": float(checker.collides(Q).mean()), "left_open": share_open(checker, some), "differ": differ,
               "proven_free": float(edges.free.mean()), "motions_open": float(edges.is_open.mean())}
    return Race(tasks, per, columns)


def batch_cases(options: Options):
    if not Path(SHARED).is_dir():
        return
    yield from grid(
        robot=ROBOTS[: 1 if options.quick else None], geometry=("spheres", "hull", "mesh"),
        family=("bookshelf_small", "cage", "table_pick")[: 1 if options.quick else None],
    )


def single(options: Options, robot: str, geometry: str) -> Race:
    checker = checker_of(robot, "bookshelf_small", geometry)
    checker._count(ENOUGH)
    q0, q1 = motions_of(checker, 300)
    free = checker.certify_edges(q0, q1).free
    q0, q1 = q0[free][:100].copy(), q1[free][:100].copy()
    path = np.concatenate([q0[:1] + t * (q1[:1] - q0[:1]) for t in np.linspace(0.0, 1.0, 101)])
    q, a, b, scene = q0[0].copy(), q0[0].copy(), q1[0].copy(), scene_of(robot, "bookshelf_small", "hull")
    name, world, link = checker.around[0], checker.world, checker.bodies[0]
    X, shape, X_LS = world.body(name).X_WB.copy(), collide.Box((0.05, 0.05, 0.1)), collide.pose((0.0, 0.0, 0.1))
    n = 1 if options.quick else 5

    def moved() -> None:
        for _ in range(100 * n):
            X[0, 3] += 1e-9
            world.set_pose(name, X)
            checker.collides(q)

    def attached() -> None:
        for _ in range(10 * n):
            checker.attach("object", link, shape, X_LS)
            checker.detach("object")

    def times(k: int, call, *arguments) -> None:
        for _ in range(k):
            call(*arguments)

    tasks = {
        "collides": partial(times, 200 * n, checker.collides, q),
        "certify_edges": partial(times, 50 * n, checker.certify_edges, a, b),
        "edge_collides": partial(times, 50 * n, checker.edge_collides, a, b),
        "path of 100": partial(times, 10 * n, checker.certify_edges, path[:-1], path[1:]),
        "obstacle moved": moved, "attach and detach": attached,
        "allow": partial(times, 20 * n, checker.allow, checker.bodies[0], checker.bodies[-1]),
        "from_scene": partial(times, 5 * n, collide.RobotChecker.from_scene, scene),
    }
    counts = (200 * n, 50 * n, 50 * n, 1000 * n, 100 * n, 10 * n, 20 * n, 5 * n)
    return Race(tasks, dict(zip(tasks, map(float, counts))), {})


def single_cases(options: Options):
    if Path(SHARED).is_dir():
        yield from grid(robot=ROBOTS[: 1 if options.quick else None], geometry=("spheres", "hull", "mesh"))


CLAIMS = [
    Claim("batches", "µs a configuration or motion", batch_cases, batches, file="robot-checks_batches", turns=5),
    Claim("single", "µs a call", single_cases, single, file="robot-checks_single", turns=5),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
