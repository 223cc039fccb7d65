"""OMPL's planners with our validators: its paths judged by dense samples, motions by `certify_edges` itself.

The bodies are few and known, so that what must be valid is known too.
"""

from __future__ import annotations

import sys

import numpy as np
import pytest

import collide
from collide.adapters.planning import ompl as bridge
from collide.errors import MissingExtra
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot

BALL = [LinkShape(collide.Sphere(0.05), np.eye(4), None, "test")]


@pytest.fixture(scope="module")
def base():
    base = pytest.importorskip("ompl.base", reason="ompl is not installed")
    from ompl import util

    util.setLogLevel(util.LOG_ERROR)
    util.RNG.setSeed(7)
    return base


def cart(**joints) -> Robot:
    """base -x-> cart -y-> tip, with a ball at the tip."""
    chain = [Joint("x", "prismatic", "base", "cart", np.eye(4), (1.0, 0, 0), -1.0, 1.0),
             Joint("y", "prismatic", "cart", "tip", np.eye(4), (0, 1.0, 0), -1.0, 1.0)]
    return Robot("cart", ["base", "cart", "tip"], chain, {"tip": BALL})


def walled(thickness: float = 0.02) -> collide.RobotChecker:
    """A wall across x = 0.1 with a gap above y = 0.2."""
    world = collide.World()
    world.add(collide.Box((thickness, 1.2, 0.2)), collide.pose((0.1, -0.4, 0)), name="wall", static=True)
    return collide.RobotChecker(cart(), world)


def pendulum() -> collide.RobotChecker:
    """A rod of 0.4 m that turns without limits on a slide; a stop at 90 degrees."""
    rod = [LinkShape(collide.Box((0.4, 0.05, 0.05)), collide.pose((0.2, 0, 0)), None, "test")]
    joints = [Joint("turn", "continuous", "base", "rod", np.eye(4), (0, 0, 1.0)),
              Joint("lift", "prismatic", "rod", "tip", np.eye(4), (0, 0, 1.0), -0.2, 0.2)]
    world = collide.World()
    world.add(collide.Box((0.1, 0.1, 1.0)), collide.pose((0, 0.3, 0)), name="stop", static=True)
    return collide.RobotChecker(Robot("pendulum", ["base", "rod", "tip"], joints, {"tip": rod}), world)


def solved(problem, planner: str, q0, q1, seconds: float = 5.0):
    from ompl import base, geometric

    information = problem.space_information()
    setup = geometric.SimpleSetup(information)
    setup.setPlanner(getattr(geometric, planner)(information))
    setup.setStartAndGoalStates(problem.state(q0), problem.state(q1))
    assert setup.solve(seconds).getStatus() == base.PlannerStatus.EXACT_SOLUTION
    path = setup.getSolutionPath()
    geometric.PathSimplifier(information).simplifyMax(path)
    return path


@pytest.mark.parametrize("planner", ["RRTConnect", "PRM", "KPIECE1", "BITstar"])
def test_paths_of_planners_are_proven(base, planner):
    checker = walled(0.002)  # samples at OMPL's own resolution would step over the wall
    problem = bridge.PlanningProblem(checker)
    q0, q1 = np.array([-0.8, -0.5]), np.array([0.8, -0.5])
    path = solved(problem, planner, q0, q1)
    Q = problem.configurations(path)
    assert (Q[0] == q0).all() and (Q[-1] == q1).all() and Q[:, 1].max() > 0.2
    assert problem.certify_path(path).free.all()
    t = np.linspace(0, 1, 2000)[:, None, None]
    assert not checker.collides((Q[:-1] + t * (Q[1:] - Q[:-1])).reshape(-1, 2)).any()
    assert problem.n_free > 0 and problem.n_colliding > 0


def test_motions_are_valid_where_certified(base):
    checker = walled()
    problem = bridge.PlanningProblem(checker)
    information = problem.space_information()
    information.setup()
    validator = information.getMotionValidator()
    Q = np.random.default_rng(3).uniform(-1, 1, (2, 200, 2))
    free = checker.certify_edges(*Q).free
    asked = [validator.checkMotion(problem.state(a), problem.state(b)) for a, b in zip(*Q)]
    assert asked == free.tolist() and 20 < free.sum() < 180
    assert (validator.getValidMotionCount(), validator.getInvalidMotionCount()) == (free.sum(), (~free).sum())
    batch = bridge.PlanningProblem(checker)
    assert (batch.is_free(*Q) == free).all() and batch.n_free == free.sum()
    states = [information.isValid(problem.state(q)) for q in Q[0]]
    assert states == (~checker.collides(Q[0])).tolist() and not all(states)


def test_states_out_of_bounds_are_not_valid(base):
    problem = bridge.PlanningProblem(walled())
    information = problem.space_information()
    information.setup()
    assert information.isValid(problem.state([-0.9, 0.0])) and not information.isValid(problem.state([-1.1, 0.0]))
    clearance = information.getStateValidityChecker().clearance(problem.state([-0.9, 0.0]))
    assert clearance == pytest.approx(0.1 - 0.01 + 0.9 - 0.05, abs=1e-12)


def test_sampled_motions_step_over_what_proofs_see(base):
    checker, q0, q1 = walled(0.002), [-0.03, -0.5], [0.37, -0.5]
    sampled = bridge.PlanningProblem(checker, proven=False, resolution=0.3)
    assert sampled.is_free(q0, q1)[0] and sampled.n_free == 1
    assert not bridge.PlanningProblem(checker, proven=False, resolution=0.01).is_free(q0, q1)[0]
    assert not bridge.PlanningProblem(checker).is_free(q0, q1)[0]


def test_open_motions_are_not_valid_and_counted(base):
    """The ball slides a nanometre above a floor: free at every sample, proven by none at this resolution."""
    world = collide.World()
    world.add(collide.Box((4, 1, 1)), collide.pose((0, -0.55 - 1e-9, 0)), name="floor", static=True)
    problem = bridge.PlanningProblem(collide.RobotChecker(cart(), world))
    information = problem.space_information()
    information.setup()
    validator = information.getMotionValidator()
    assert not validator.checkMotion(problem.state([-0.5, 0.0]), problem.state([0.5, 0.0]))
    assert (problem.n_free, problem.n_colliding, problem.n_open) == (0, 0, 1)
    assert validator.getInvalidMotionCount() == 1


def test_the_last_valid_state_of_a_motion(base):
    """The ball meets the wall at x = 0.04, 21/64 of the way from -0.8 plus a little; the motion to there is proven."""
    checker = walled()
    problem = bridge.PlanningProblem(checker)
    information = problem.space_information()
    information.setup()
    validator, last = information.getMotionValidator(), [None, 0.0]
    begin, end = problem.state([-0.8, 0.0]), problem.state([0.8, 0.0])
    assert not validator.checkMotion(begin, end, last)
    q, time = problem.configuration(last[0]), last[1]
    assert q[0] == pytest.approx(-0.8 + 1.6 * time) and 0.84 / 1.6 - 1 / 256 <= time < 0.84 / 1.6
    assert checker.certify_edges([-0.8, 0.0], q).free[0]
    last = [None, 0.5]
    assert validator.checkMotion(begin, problem.state([-0.1, 0.0]), last) and last == [None, 0.5]
    assert problem.last_valid(np.array([-0.8, 0.0]), np.array([-0.1, 0.0]))[1] == 1.0
    q, time = problem.last_valid(np.array([0.0399999, 0.0]), np.array([0.2, 0.0]))
    assert time == 0.0 and q[0] == 0.0399999


def test_joints_without_limits_turn_the_shorter_way(base):
    """From 170 to -170 degrees is 20 degrees by the back, away from the stop; from 80 to 100 meets the stop."""
    checker = pendulum()
    problem = bridge.PlanningProblem(checker)
    information = problem.space_information()
    information.setup()
    degrees = np.deg2rad
    there = problem.state([degrees(170), 0.1]), problem.state([degrees(-170), -0.1])
    assert information.checkMotion(*there)
    q = problem.configuration(there[1])
    assert q == pytest.approx([degrees(-170), -0.1])
    assert not information.checkMotion(problem.state([degrees(60), 0.0]), problem.state([degrees(120), 0.0]))
    path = solved(problem, "RRTConnect", [degrees(60), 0.0], [degrees(120), 0.0])
    Q = problem.configurations(path)
    assert abs(Q[-1, 0] - degrees(120 - 360)) < 1e-9 and problem.certify_path(path).free.all()
    assert np.abs(np.diff(Q[:, 0])).max() <= np.pi


def test_joints_not_planned_for_rest(base):
    checker = walled()
    problem = bridge.PlanningProblem(checker, joints=["y"], rest=[0.1, 0.0])
    assert problem.state_space().getDimension() == 1
    assert (problem.configuration(problem.state([0.7, 0.5])) == [0.1, 0.5]).all()
    assert not problem.is_free([0.1, 0.5], [0.1, 0.1])[0]


def test_what_is_refused():
    with pytest.raises(collide.InvalidArgument, match="unknown 'z'; the robot has x, y"):
        bridge.PlanningProblem(walled(), joints=["z"])
    joints = [Joint("fly", "floating", "base", "tip", np.eye(4))]
    flying = collide.RobotChecker(Robot("flying", ["base", "tip"], joints, {"tip": BALL}))
    with pytest.raises(collide.InvalidArgument, match="joint fly/x has no limits"):
        bridge.PlanningProblem(flying)
    with pytest.raises(collide.InvalidArgument, match=r"a collide\.RobotChecker"):
        bridge.PlanningProblem(cart())


def test_without_ompl_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ompl", None)
    bridge._host.cache_clear()
    with pytest.raises(MissingExtra, match=r"pip install 'collide-robotics\[ompl\]'"):
        bridge.PlanningProblem(walled()).space_information()
    bridge._host.cache_clear()
