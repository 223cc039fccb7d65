"""Verdicts of a Panda's random configurations in clutter, beside MuJoCo's and Pinocchio's; where they differ, judged.

Every tested pair of a configuration in question is asked of the oracle, which proves brackets in decimals of 80 digits.
"""

from __future__ import annotations

import importlib.util
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))
from curved_oracle import bracket
from robot_peers import MujocoRobot, PinocchioRobot, at_random, clutter, panda
from samples import sizes, told

import collide
from collide.errors import CollideError

PRESENT = [name for name in ("mujoco", "pinocchio") if importlib.util.find_spec(name)]
pytestmark = pytest.mark.skipif(not PRESENT, reason="neither mujoco nor pinocchio is installed")


def collides_exactly(checker: collide.RobotChecker, q: np.ndarray) -> bool | None:
    """Whether a tested pair meets, by an oracle that shares no code with the engine; None where it cannot tell."""
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


@sizes(60, 20_000)
def test_verdicts_that_differ_are_judged_in_our_favour(n):
    """n configurations among 10, 50 and 200 obstacles each."""
    try:
        robot, urdf = panda()
    except CollideError as error:
        pytest.skip(str(error))
    for obstacles in (10, 50, 200) if n > 100 else (50,):
        world = clutter(obstacles)
        checker, Q = collide.RobotChecker(robot, world), at_random(robot, n, seed=60)
        ours, answers, truths, counts = checker.collides(Q), {}, {}, Counter()
        if "mujoco" in PRESENT:
            mujoco = MujocoRobot(robot, world)
            answers["mujoco"] = mujoco.collides(mujoco.configurations(Q))
        if "pinocchio" in PRESENT:
            pinocchio = PinocchioRobot(robot, world, urdf)
            q = pinocchio.configurations(Q)
            answers |= {"pinocchio pairs": pinocchio.collides(q), "pinocchio manager": pinocchio.collides_by_manager(q)}
        for name, hits in answers.items():
            for k in np.flatnonzero(hits != ours).tolist():
                if k not in truths:
                    truths[k] = collides_exactly(checker, Q[k])
                assert truths[k] in (None, ours[k]), f"{obstacles} obstacles, {Q[k].tolist()}: {name} is right"
                counts["open" if truths[k] is None else f"{name} wrong"] += 1
        told(f"{obstacles} obstacles, {n} configurations, {ours.sum()} hits", counts)
        assert 0 < ours.sum() < n
