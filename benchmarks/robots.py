"""Configurations and motions of robots checked: collide beside MuJoCo and Pinocchio, and what certificates cost.

    python benchmarks/robots.py                       # three minutes; prints tables and writes results/robots_*.csv
    python benchmarks/robots.py --table clutter       # one of clutter, verdicts, motions, batches
    python benchmarks/robots.py --quick               # half a minute; no file

clutter    thousand configurations a second: a Panda (9 hulls, 8 boxes of fingers; meshes of example-robot-data) over a
           table with 10, 50 and 200 boxes and hulls, at random configurations, whether anything collides. Ours stops at
           the first hit and proves both verdicts; MuJoCo makes all contacts, Pinocchio stops at the first hit: pair by
           pair, and through its broadphase manager. One thread each
batches    µs a configuration of ours by the size of the batch, in the same scenes, and of distances with gradients
verdicts   60,000 configurations of these scenes: which differ, and who is right by brackets in decimals of 80 digits
           (`tests/oracles/curved_oracle.py`), every tested pair
motions    scenes of MotionBenchMaker (from ../shared/data): configurations a second at random, motions of 32 samples a
           second, motions proven free or hit a second, and the share that stays open. Motions begin at random free
           configurations and change every joint by up to 0.5 rad

Engines take turns; medians of their turns, CPU time.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "oracles"))
from convex import log, say, write
from robot_peers import MujocoRobot, PinocchioRobot
from startup import machine

import collide
from collide.scenes import load
from collide.scenes.loaders.resources import installed_folders

TABLES = ("clutter", "batches", "verdicts", "motions")
OBSTACLES = (10, 50, 200)
#: Thousand configurations a second that ours is to reach at least.
BARS = {10: 521.0, 50: 342.0, 200: 261.0}
#: Calls about few configurations are timed so many configurations at a time.
_LEAST = 200
SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
PANDA = "example-robot-data/robots/panda_description/urdf/panda.urdf"


def panda() -> tuple[collide.Robot, str]:
    folder = next((f for f in installed_folders() if (f / "example-robot-data").is_dir()), None)
    if folder is None:
        sys.exit("this needs robots of example-robot-data: pip install example-robot-data")
    path = folder / PANDA
    srdf = path.parents[1] / "srdf" / "panda.srdf"
    return collide.Robot.load(path, srdf=srdf, meshes="hull", package_path=[folder]), str(path)


def clutter(n: int, seed: int = 0) -> collide.World:
    """A table and n boxes and hulls around a robot, none within 0.25 m of its axis."""
    rng = np.random.default_rng([seed, n])
    world = collide.World()
    world.add(collide.Box((2.0, 2.0, 0.04)), collide.pose((0, 0, -0.05)), name="table", static=True)
    k = 0
    while k < n:
        p = rng.uniform((-0.9, -0.9, 0.0), (0.9, 0.9, 1.1))
        if np.hypot(p[0], p[1]) < 0.25:
            continue
        size = rng.uniform(0.02, 0.07)
        points = rng.normal(size=(32, 3))
        points *= size / np.linalg.norm(points, axis=1)[:, None]
        shape = collide.Box(2 * size * rng.uniform(0.5, 1.0, 3)) if k % 2 else collide.ConvexHull(points)
        X = collide.pose(p, rpy=rng.uniform(-3.1, 3.1, 3))
        world.add(shape, X, name=f"obstacle{k}", static=True)
        k += 1
    return world


def at_random(robot: collide.Robot, n: int, seed: int = 5) -> np.ndarray:
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    return np.random.default_rng(seed).uniform(low, high, (n, robot.dof))


def medians(tasks: dict, seconds: float, least: int = 5) -> dict[str, float]:
    """Median seconds of each task, which take turns until so many seconds are over."""
    for task in tasks.values():
        task()
    times: dict[str, list[float]] = {name: [] for name in tasks}
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(next(iter(times.values()))) < least:
        for name, task in tasks.items():
            begin = time.process_time()
            task()
            times[name].append(time.process_time() - begin)
    return {name: statistics.median(spent) for name, spent in times.items()}


def clutter_table(quick: bool) -> list[dict]:
    robot, urdf = panda()
    rows = []
    for n in OBSTACLES:
        world = clutter(n)
        checker = collide.RobotChecker(robot, world)
        Q = at_random(robot, 600)
        large = at_random(robot, 6000)
        mujoco, pinocchio = MujocoRobot(robot, world), PinocchioRobot(robot, world, urdf)
        qpos, q_pin = mujoco.configurations(Q), pinocchio.configurations(Q)
        tasks = {
            "collide": partial(checker.collides, large), "mujoco": partial(mujoco.collides, qpos),
            "pinocchio pairs": partial(pinocchio.collides, q_pin),
            "pinocchio manager": partial(pinocchio.collides_by_manager, q_pin),
        }  # fmt: skip
        spent = medians(tasks, 1.0 if quick else 12.0)
        rates = {name: (6000 if name == "collide" else 600) / seconds / 1e3 for name, seconds in spent.items()}
        bar = BARS[n]
        log(
            f"{n:>4} obstacles, {100 * checker.collides(Q).mean():.0f} % hit: ours {rates['collide']:.0f}k/s (bar "
            f"{bar:.0f}); " + ", ".join(f"{name} {rate:.1f}k ({rates['collide'] / rate:.1f} ×)"
                                        for name, rate in rates.items() if name != "collide")
        )  # fmt: skip
        rows.append({"obstacles": n, "hit": float(checker.collides(Q).mean()), "bar": bar} | rates)
    return rows


def in_batches(ask, Q: np.ndarray, m: int) -> None:
    """Ask about configurations m at a time, _LEAST of them or m."""
    for begin in range(0, max(m, _LEAST), m):
        ask(Q[begin : begin + m])


def batches_table(quick: bool) -> list[dict]:
    robot, _ = panda()
    rows = []
    for n in OBSTACLES:
        checker = collide.RobotChecker(robot, clutter(n))
        Q = at_random(robot, 10_000)
        sizes = [("collides", m) for m in (1, 10, 100, 1000, 10_000)] + [("distances", m) for m in (1, 100, 2000)]
        tasks = {f"{name} {m}": partial(in_batches, getattr(checker, name), Q, m) for name, m in sizes}
        spent = medians(tasks, 1.0 if quick else 6.0)
        each = {name: 1e6 * seconds / max(int(name.split()[1]), _LEAST) for name, seconds in spent.items()}
        log(f"{n:>4} obstacles, µs a configuration: " + ", ".join(f"{name} {us:.2f}" for name, us in each.items()))
        rows.append({"obstacles": n} | each)
    return rows


def verdicts_table(quick: bool) -> list[dict]:
    """Every configuration on which ours, MuJoCo and Pinocchio do not agree, judged pair by pair."""
    robot, urdf = panda()
    rows = []
    for n in OBSTACLES:
        world = clutter(n)
        checker = collide.RobotChecker(robot, world)
        Q = at_random(robot, 500 if quick else 20_000, seed=60)
        ours = checker.collides(Q)
        mujoco, pinocchio = MujocoRobot(robot, world), PinocchioRobot(robot, world, urdf)
        peers = {
            "mujoco": mujoco.collides(mujoco.configurations(Q)),
            "pinocchio pairs": pinocchio.collides(pinocchio.configurations(Q)),
            "pinocchio manager": pinocchio.collides_by_manager(pinocchio.configurations(Q)),
        }
        truth: dict[int, bool | None] = {}
        for name, hits in peers.items():
            counts: Counter = Counter()
            for k in np.flatnonzero(hits != ours).tolist():
                if k not in truth:
                    truth[k] = collides_exactly(checker, Q[k])
                right = truth[k]
                counts["open" if right is None else "OURS WRONG" if right != ours[k] else f"{name} wrong"] += 1
            log(f"{n:>4} obstacles, {len(Q)} configurations: {name} differs in {sum(counts.values())}: {dict(counts)}")
            rows.append({"obstacles": n, "configurations": len(Q), "peer": name} | dict(counts))
    return rows


def collides_exactly(checker: collide.RobotChecker, q: np.ndarray) -> bool | None:
    """Whether a tested pair meets, by an oracle that shares no code with the engine; None where it cannot tell."""
    from curved_oracle import bracket

    report = checker.explain(q)
    robot, world = checker.robot, checker.world
    X_WL = dict(zip(robot.links, checker.link_poses(q)[0]))
    shapes = {link: [(e.shape, X_WL[link] @ e.X_LG) for e in robot.geometry[link]] for link in robot.geometry}
    shapes |= {world.body(i).name: [(world.body(i).shape, world.body(i).X_WB)] for i in world.ids}
    is_open = False
    for pair in (*report.collisions, *report.nearest):
        for A, X_WA in shapes[pair.a]:
            for B, X_WB in shapes[pair.b]:
                lower, upper, *_ = bracket(A, B, X_WA, X_WB)
                if upper <= 0.0:
                    return True
                is_open |= lower <= 0.0
    return None if is_open else False


def motions_table(quick: bool) -> list[dict]:
    if not (SHARED / "scenes").is_dir():
        say("motions: skipped, ../shared/data has no scenes")
        return []
    rows = []
    for name in ("panda", "ur5", "fetch"):
        families = sorted((SHARED / "scenes" / "motionbenchmaker" / name).iterdir())
        for family in families[: 1 if quick else None]:
            path = min(family.glob("scene*.yaml"))
            for meshes in ("hull", "mesh"):
                rows.append(motions_of(name, family.name, path, meshes, quick))
    return rows


def motions_of(name: str, family: str, path: Path, meshes: str, quick: bool) -> dict:
    scene = load(path, meshes=meshes)
    checker = collide.RobotChecker.from_scene(scene)
    Q = at_random(checker.robot, 20_000 if meshes == "hull" else 2_000)
    free = Q[~checker.collides(Q)][:400 if meshes == "hull" else 60]
    rng = np.random.default_rng(7)
    ends = np.clip(free + rng.uniform(-0.5, 0.5, free.shape), checker.robot.lower, checker.robot.upper)
    steps = np.linspace(0.0, 1.0, 32)[:, None, None]
    samples = (free + steps * (ends - free)).reshape(-1, checker.robot.dof)
    sample = Q[: 4_000 if meshes == "hull" else 300]
    spent = medians(
        {
            "configurations": lambda: checker.collides(sample), "sampled": lambda: checker.collides(samples),
            "certified": lambda: checker.certify_edges(free, ends),
        },
        0.5 if quick else 3.0, least=3,
    )  # fmt: skip
    edges = checker.certify_edges(free, ends)
    row = {
        "robot": name, "family": family, "meshes": meshes, "hit": float(checker.collides(sample).mean()),
        "configurations a second": len(sample) / spent["configurations"],
        "motions of 32 a second": len(free) / spent["sampled"],
        "certified a second": len(free) / spent["certified"], "proven free": float(edges.free.mean()),
        "collide": float(edges.collides.mean()), "open": float(edges.is_open.mean()),
        "configurations a proof": edges.n_checked / max(len(free), 1),
    }  # fmt: skip
    log(
        f"{name:>6} {family:28} {meshes:4}: {row['configurations a second'] / 1e3:6.0f}k configurations/s, "
        f"{row['motions of 32 a second'] / 1e3:6.1f}k motions of 32/s, {row['certified a second'] / 1e3:6.1f}k "
        f"certified/s, {100 * row['open']:.1f} % open"
    )
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", choices=TABLES)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    about = machine()
    log(str(about))
    for table in TABLES if arguments.table is None else (arguments.table,):
        rows = globals()[f"{table}_table"](arguments.quick)
        if rows and not arguments.quick:
            write(f"robots_{table}", rows, about)


if __name__ == "__main__":
    main()
