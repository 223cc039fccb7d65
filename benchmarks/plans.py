"""Paths of MotionBenchMaker's problems with every edge proven free: `collide.plan`, and OMPL with our validators.

    python benchmarks/plans.py                        # ten minutes, OMPL's five of them
    python benchmarks/plans.py --table problems
    python benchmarks/plans.py --quick                # a minute; no file

problems  Panda, UR5 with a Robotiq 85, Fetch, as hulls, in all scenes of seven families (from ../shared/data): ms a
          problem by family, three seeds each, every edge of the path and of the shortened path proven free; the share
          solved within 10 s; ms of the proofs alone, and samples asked. Starts and goals that collide as hulls are left
          out and counted: as meshes the UR5's are free
robots    the same by robot: hulls, and the spheres that VAMP ships, which do not enclose the links
peers     the first problems of each family beside OMPL's RRT-Connect and PathSimplifier with `PlanningProblem`, proven
          and sampled at 0.05 rad, within 2 s

CPU time of one thread. Of others, as measured on a machine with two shared cores: VAMP's RRT-Connect in C++ 0.083 ms
median and 0.49 ms mean a problem of the Panda, unproven, on its own spheres; roboplan 9 and 21 ms, unproven, on meshes.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from inputs import SHARED

import collide
from collide.adapters.bench.claims import Claim, Options, Row, grid, installed, main
from collide.adapters.planning.ompl import PlanningProblem
from collide.scenes import load

ROBOTS = ("panda", "ur5", "fetch")
FOLDERS = ("motionbenchmaker", "motionbenchmaker_more")
SEEDS = 3


class Problem(NamedTuple):
    """A checker of the robot in its scene, a start and a goal (dof,), and the joints that move."""

    checker: collide.RobotChecker
    q0: np.ndarray
    q1: np.ndarray
    joints: list[str]

    @property
    def is_free(self) -> bool:
        return not self.checker.collides([self.q0, self.q1]).any()


def scenes(robot: str, family: str) -> list[Path]:
    folders = [SHARED / "scenes" / folder / robot / family for folder in FOLDERS]
    return [path for folder in folders if folder.is_dir() for path in sorted(folder.glob("scene*.yaml"))]


def families(robot: str) -> list[str]:
    folder = SHARED / "scenes" / FOLDERS[0] / robot
    return sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []


@cache
def spheres(robot: str) -> collide.Robot:
    """VAMP's spheres, with the robot's SRDF."""
    folder = SHARED / "robots" / robot
    return collide.Robot.load(folder / f"{robot}_spherized.urdf", srdf=folder / f"{robot}.srdf")


def problem(scene: Path, geometry: str) -> Problem:
    loaded = load(scene, meshes="hull")
    checker = collide.RobotChecker.from_scene(loaded)
    if geometry == "spheres":
        robot = scene.parts[-3]
        allowed = [("fts_robotside", "wrist_2_link")] if robot == "ur5" else []  # docs/disabled-pairs.md
        checker = collide.RobotChecker(spheres(robot), checker.world, X_WR=checker.link_poses(
            checker.robot.default_configuration())[0, checker.robot.links.index(checker.robot.root)], allowed=allowed)
    request = yaml.safe_load((scene.parent / scene.name.replace("scene", "request")).read_text(encoding="utf-8"))
    state, robot = request["start_state"]["joint_state"], checker.robot
    known = {joint.name for joint in robot.joints}
    begin = {name: value for name, value in zip(state["name"], state["position"]) if name in known}
    goal = {entry["joint_name"]: entry["position"] for entry in request["goal_constraints"][0]["joint_constraints"]}
    q0, _ = robot.configuration(begin)
    q1, _ = robot.configuration(goal, q0)
    # Some files have 3.1415926536 where the limit is 3.14159.
    return Problem(checker, *np.clip([q0, q1], robot.lower, robot.upper), list(goal))


@cache
def problems(robot: str, family: str, geometry: str, max_scenes: int) -> tuple[list[Problem], int]:
    """Those with a free start and goal, and how many are left out."""
    every = [problem(scene, geometry) for scene in scenes(robot, family)[:max_scenes]]
    free = [case for case in every if case.is_free]
    return free, len(every) - len(free)


def timed(call) -> tuple[float, Any]:
    """(ms of CPU time, what was returned)."""
    started = time.process_time()
    answer = call()
    return 1e3 * (time.process_time() - started), answer


def solved(case: Problem, seed: int) -> Row:
    """One plan, with the proofs of its edges asked once more alone."""
    collides = case.checker.collides
    collides(case.q0)  # tables of the World
    ms, plan = timed(lambda: collide.plan(case.checker, case.q0, case.q1, joints=case.joints, seed=seed))
    row = {"ms": ms, "solved": bool(plan), "edges": plan.n_edges, "samples": plan.n_checked, "refused": plan.n_refused}
    if not plan:
        return row
    paths = plan.path, plan.simplified
    begin, end = (np.concatenate([path[some] for path in paths]) for some in (slice(-1), slice(1, None)))
    row["proofs_ms"], edges = timed(lambda: case.checker.certify_edges(begin, end))
    assert edges.free.all(), "an edge of a plan is not proven when it is asked again"
    return row | {"length": plan.length}


def summary(rows: list[Row], left_out: int) -> Row:
    """Medians, means and shares of rows of problems and seeds."""
    def of(name: str) -> list[float]:
        return [row[name] for row in rows if name in row] or [float("nan")]

    ms = of("ms")
    return {
        "asked": len(rows), "left_out": left_out, "solved": float(np.mean(of("solved"))), "median_ms": np.median(ms),
        "mean_ms": np.mean(ms), "p95_ms": np.percentile(ms, 95), "proofs_ms": np.median(of("proofs_ms")),
        "samples": np.median(of("samples")), "refused": np.mean(of("refused")), "length": np.median(of("length")),
    }


def of_family(options: Options, robot: str, family: str) -> list[Row]:
    cases, left_out = problems(robot, family, "hulls", 2 if options.quick else 100)
    return [summary([solved(case, seed) for case in cases for seed in range(SEEDS)], left_out)]


def of_robot(options: Options, robot: str, geometry: str) -> list[Row]:
    rows, left_out = [], 0
    for family in families(robot):
        cases, without = problems(robot, family, geometry, 2 if options.quick else 100)
        rows += [solved(case, seed) for case in cases for seed in range(SEEDS)]
        left_out += without
    return [summary(rows, left_out)]


def by_ompl(case: Problem, seed: int, proven: bool) -> Row:
    from ompl import base, geometric, util

    util.setLogLevel(util.LOG_NONE)
    asked = PlanningProblem(case.checker, case.joints, case.q0, proven=proven)
    information = asked.space_information()
    setup = geometric.SimpleSetup(information)
    setup.setPlanner(geometric.RRTConnect(information))
    setup.setStartAndGoalStates(asked.state(case.q0), asked.state(case.q1))

    def plan():
        is_solved = setup.solve(2.0).getStatus() == base.PlannerStatus.EXACT_SOLUTION
        if is_solved:
            geometric.PathSimplifier(information).reduceVertices(setup.getSolutionPath())
        return is_solved

    ms, is_solved = timed(plan)
    row = {"ms": ms, "solved": bool(is_solved), "refused": asked.n_open}
    if is_solved:
        Q = asked.configurations(setup.getSolutionPath())
        row["length"] = float(np.linalg.norm(np.diff(Q, axis=0), axis=1).sum())
        row["proofs_ms"], edges = timed(lambda: case.checker.certify_edges(Q[:-1], Q[1:]))
        row["unproven"] = float(not edges.free.all())
    return row


def beside_ompl(options: Options, robot: str) -> Iterator[Row]:
    n_scenes = 1 if options.quick else 3
    cases = [case for family in families(robot) for case in problems(robot, family, "hulls", n_scenes)[0]]
    yield {"engine": "collide.plan"} | summary([solved(case, 0) for case in cases], 0)
    if installed(ompl="ompl"):
        for name, proven in (("ompl, proven", True), ("ompl, sampled", False)):
            rows = [by_ompl(case, 0, proven) for case in cases]
            unproven = sum(row.get("unproven", 0.0) for row in rows)
            yield {"engine": name} | summary(rows, 0) | {"unproven": unproven}


CLAIMS = [
    Claim("problems", "ms a problem, every edge proven", lambda o: (
        row for robot in ROBOTS for row in grid(robot=[robot], family=families(robot))
    ), of_family, unit="ms", file="plans"),
    Claim("robots", "ms a problem, every edge proven, by robot",
          lambda o: grid(robot=ROBOTS if families("panda") else (), geometry=("hulls", "spheres")), of_robot, unit="ms",
          file="plans-robots"),
    Claim("peers", "ms a problem beside OMPL's RRT-Connect with our validators",
          lambda o: grid(robot=ROBOTS if families("panda") else ()), beside_ompl, unit="ms", file="plans-peers"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
