"""OMPL's planners over a `RobotChecker`: states are valid where free, motions where proven free, or free at samples.

    from collide.adapters.planning.ompl import PlanningProblem
    problem = PlanningProblem(checker, joints=arm)
    si = problem.space_information()
    setup = ompl.geometric.SimpleSetup(si)
    setup.setStartAndGoalStates(problem.state(q0), problem.state(q1))
    if setup.solve(1.0):
        Q = problem.configurations(setup.getSolutionPath())

Motions are straight in the columns of a configuration, and turn the shorter way about joints without limits, as OMPL
interpolates them. docs/planning.md says what OMPL hands to validators written in Python.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np

from collide import CertifiedEdges, RobotChecker
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, MissingExtra, brief, listing

#: A motion that is not valid is tried up to sixteenths of its length, and sixteenths of the first that fails.
_PARTS = 16


class PlanningProblem:
    """A robot among bodies as OMPL sees it: a state space, which states are valid, and which motions.

    Parameters
    ----------
    checker : RobotChecker
        The next question sees every change of its World.
    joints : iterable of str, optional
        Columns of `Robot.joint_names` that are planned for, by default all.
    rest : (dof,) array_like, optional
        Where the other joints stay [rad or m], by default `Robot.default_configuration`.
    proven : bool
        Motions are valid where `RobotChecker.certify_edges` proves them free: an open one is not valid, and counted.
        Else motions are asked at samples, by `RobotChecker.edge_collides`.
    resolution : float, optional
        Of proofs, by default 1e-3; else the largest change of a column between samples, by default 0.05 [rad or m].

    Attributes
    ----------
    n_states, n_free, n_colliding, n_open : int
        States asked; motions that were free, colliding, and open, since the problem was made.

    Raises
    ------
    InvalidArgument
        Unknown joints; columns without limits that are lengths; `rest` of another shape.
    """

    def __init__(
        self, checker: RobotChecker, joints: Iterable[str] | None = None, rest=None, *, proven: bool = True,
        resolution: float | None = None,
    ):
        checks.instance("PlanningProblem: checker", checker, RobotChecker, "a collide.RobotChecker")
        self.checker, robot = checker, checker.robot
        names = list(robot.joint_names) if joints is None else checks.listed_entries(
            "PlanningProblem: joints", joints, "names of joints"
        )
        for name in names:
            if name not in robot.joint_names:
                raise InvalidArgument(
                    f"PlanningProblem: joints: unknown {brief(name)}; the robot has {listing(robot.joint_names)}"
                )
        self.joints = tuple(names)
        self._columns = np.array([robot.joint_names.index(name) for name in names], dtype=np.int64)
        self._rest = robot.default_configuration() if rest is None else robot.checked_configurations(rest, "rest")[0]
        self._lower, self._upper = robot.lower[self._columns], robot.upper[self._columns]
        continuous = {joint.name for joint in robot.joints if joint.type == "continuous"}
        self._turns = np.array([name in continuous for name in names], dtype=bool)
        for name, ends, turns in zip(names, zip(self._lower, self._upper), self._turns):
            if not turns and not np.isfinite(ends).all():
                raise InvalidArgument(f"PlanningProblem: joint {name} has no limits: leave it out of joints=")
        self.proven = checks.true_or_false("PlanningProblem: proven", proven)
        self.resolution = (1e-3 if proven else 0.05) if resolution is None else resolution
        self._space: Any = None
        self.n_states = self.n_free = self.n_colliding = self.n_open = 0

    # --- spaces and states ----------------------------------------------------------------------

    def state_space(self) -> Any:
        """The columns that are planned for; the same space at every call.

        Returns
        -------
        ompl.base.RealVectorStateSpace
            With the limits as bounds; where joints without limits turn, a CompoundStateSpace: the other columns, then
            a SO2StateSpace a joint.
        """
        if self._space is not None:
            return self._space
        base = _host()
        bounded = np.flatnonzero(~self._turns)
        vector, bounds = base.RealVectorStateSpace(len(bounded)), base.RealVectorBounds(len(bounded))
        for k, column in enumerate(bounded):
            bounds.setLow(k, float(self._lower[column]))
            bounds.setHigh(k, float(self._upper[column]))
        vector.setBounds(bounds)
        self._space = vector
        if self._turns.any():
            self._space = base.CompoundStateSpace()
            for space in (vector, *(base.SO2StateSpace() for _ in range(int(self._turns.sum())))):
                self._space.addSubspace(space, 1.0)
        return self._space

    def space_information(self) -> Any:
        """An ``ompl.base.SpaceInformation`` of `state_space`, with both validators.

        Returns
        -------
        ompl.base.SpaceInformation
            Not set up yet: planners and `SimpleSetup` do so.
        """
        information = _host().SpaceInformation(self.state_space())
        information.setStateValidityChecker(self.state_validity_checker(information))
        information.setMotionValidator(self.motion_validator(information))
        return information

    def state(self, q) -> Any:
        """A configuration as a state.

        Parameters
        ----------
        q : (dof,) array_like
            [rad or m]; columns that are not planned for are not looked at.

        Returns
        -------
        ompl.base.State
            Of `state_space`.
        """
        values = self.checker.robot.checked_configurations(q, "q")[0][self._columns]
        n = int((~self._turns).sum())
        state = self.state_space().allocState()
        vector = state if not self._turns.any() else state[0]
        vector[0:n] = values[~self._turns].tolist()
        for k, angle in enumerate(values[self._turns].tolist()):
            state[k + 1].value = float(np.arctan2(np.sin(angle), np.cos(angle)))
        return state

    def configuration(self, state) -> np.ndarray:
        """(dof,) [rad or m] of a state: the joints that are not planned for at rest.

        Parameters
        ----------
        state : ompl.base.State
            Of `state_space`, or of a space with the same subspaces.

        Returns
        -------
        (dof,) float64
        """
        q, n = self._rest.copy(), int((~self._turns).sum())
        if not self._turns.any():
            q[self._columns] = state[0:n]
            return q
        values = np.empty(len(self._columns))
        values[~self._turns] = state[0][0:n]
        values[self._turns] = [state[k + 1].value for k in range(int(self._turns.sum()))]
        q[self._columns] = values
        return q

    def configurations(self, path) -> np.ndarray:
        """(M, dof) [rad or m] of a path, each turn the shorter way on from the configuration before.

        Parameters
        ----------
        path : ompl.geometric.PathGeometric

        Returns
        -------
        (M, dof) float64
            Straight motions from row to row are the path's.
        """
        Q = np.array([self.configuration(state) for state in path.getStates()])
        for k in range(1, len(Q)):
            Q[k] = self._end(Q[k - 1], Q[k])
        return Q

    def _end(self, q0: np.ndarray, q1: np.ndarray) -> np.ndarray:
        """Where a motion from q0 to the state of q1 ends: by less than half a turn on about joints without limits."""
        turning = self._columns[self._turns]
        if not len(turning):
            return q1
        q1 = q1.copy()
        q1[turning] -= 2.0 * np.pi * np.round((q1[turning] - q0[turning]) / (2.0 * np.pi))
        return q1

    # --- validity -------------------------------------------------------------------------------

    def state_validity_checker(self, information) -> Any:
        """An ``ompl.base.StateValidityChecker``: valid is what is within the bounds and does not collide.

        Parameters
        ----------
        information : ompl.base.SpaceInformation

        Returns
        -------
        ompl.base.StateValidityChecker
            Its ``clearance`` is the least signed distance [m] of the tested pairs.
        """
        return _validators()[0](information, self)

    def motion_validator(self, information) -> Any:
        """An ``ompl.base.MotionValidator``.

        Parameters
        ----------
        information : ompl.base.SpaceInformation

        Returns
        -------
        ompl.base.MotionValidator
            ``checkMotion(s1, s2)``, and ``checkMotion(s1, s2, last_valid)`` with a list [state or None, time], which is
            written: see `last_valid`.
        """
        return _validators()[1](information, self)

    def is_free(self, Q0: np.ndarray, Q1: np.ndarray) -> np.ndarray:
        """Whether straight motions are valid; counted.

        Parameters
        ----------
        Q0, Q1 : (N, dof) or (dof,) array_like
            [rad or m]; all are asked in one call.

        Returns
        -------
        (N,) bool
        """
        if not self.proven:
            free = ~self.checker.edge_collides(Q0, Q1, resolution=self.resolution)
            self.n_free, self.n_colliding = self.n_free + int(free.sum()), self.n_colliding + int((~free).sum())
            return free
        edges = self.checker.certify_edges(Q0, Q1, resolution=self.resolution)
        self.n_free += int(edges.free.sum())
        self.n_colliding += int(edges.collides.sum())
        self.n_open += int(edges.is_open.sum())
        return edges.free

    def last_valid(self, q0: np.ndarray, q1: np.ndarray) -> tuple[np.ndarray, float]:
        """How far a motion is valid: up to a time with a motion from q0 to there that is valid.

        Parameters
        ----------
        q0, q1 : (dof,) float64
            Ends of the motion [rad or m].

        Returns
        -------
        (dof,) float64, float
            A configuration and its time t in [0, 1]; q0 and 0.0 where not even the first 256th is valid. The last such
            sixteenth, and the last such 256th behind: two calls.
        """
        begin, length = 0.0, 1.0
        for _ in range(2):
            times = begin + length * np.arange(1, _PARTS + 1) / _PARTS
            free = self.is_free(q0, q0 + times[:, None] * (q1 - q0))
            begin, length = (begin, *times)[int(np.append(free, False).argmin())], length / _PARTS
            if begin >= 1.0:
                break
        return q0 + begin * (q1 - q0), begin

    def certify_path(self, path) -> CertifiedEdges:
        """Proofs of all edges of a path in one call.

        Parameters
        ----------
        path : ompl.geometric.PathGeometric

        Returns
        -------
        CertifiedEdges
            ``free.all()``: the whole path is proven.
        """
        Q = self.configurations(path)
        return self.checker.certify_edges(Q[:-1], Q[1:], resolution=self.resolution if self.proven else 1e-3)


@cache
def _host() -> Any:
    """``ompl.base``. Raises MissingExtra."""
    try:
        from ompl import base
    except ImportError:
        raise MissingExtra("ompl", extra="ompl", purpose="plan with OMPL") from None
    return base


@cache
def _validators() -> tuple[type, type]:
    """Classes that OMPL calls. Its binding takes a single base, so that they ask a `PlanningProblem`."""
    base = _host()

    class StateValidityChecker(base.StateValidityChecker):  # type: ignore[name-defined]
        def __init__(self, information, problem: PlanningProblem):
            super().__init__(information)
            self._space, self.problem = information.getStateSpace(), problem

        def isValid(self, state) -> bool:
            self.problem.n_states += 1
            q = self.problem.configuration(state)
            return self._space.satisfiesBounds(state) and not self.problem.checker.collides(q)

        def clearance(self, state) -> float:
            return float(self.problem.checker.distances(self.problem.configuration(state)).distance[0])

    class MotionValidator(base.MotionValidator):  # type: ignore[name-defined]
        def __init__(self, information, problem: PlanningProblem):
            super().__init__(information)
            self.problem = problem

        def checkMotion(self, s1, s2, last_valid=None) -> bool:
            q0, q1 = map(self.problem.configuration, (s1, s2))
            q1 = self.problem._end(q0, q1)
            is_valid = bool(self.problem.is_free(q0, q1)[0])
            if last_valid is not None and not is_valid:
                q, last_valid[1] = self.problem.last_valid(q0, q1)
                last_valid[0] = self.problem.state(q)
            return is_valid

        def getValidMotionCount(self) -> int:
            return self.problem.n_free

        def getInvalidMotionCount(self) -> int:
            return self.problem.n_colliding + self.problem.n_open

    return StateValidityChecker, MotionValidator
