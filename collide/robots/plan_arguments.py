"""What `plan` is asked for: start and goals as arrays or by name, joints that move, and the box of samples."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief, listing
from collide.robots.robot import Robot
from collide.robots.robot_checker import RobotChecker

#: How far a joint without limits is turned beyond start and goals, on either side [rad].
_HALF_TURN = math.pi


def positive(name: str, value) -> float:
    """A positive number; InvalidArgument for anything else."""
    number = checks.number(value)
    if number is None or not 0.0 < number < math.inf:
        raise InvalidArgument(f"plan: {name} must be a positive number, got {brief(value)}")
    return number


def checked_ends(robot: Robot, start, goal) -> np.ndarray:
    """(1 + k, dof) the start and k goals. Raises InvalidArgument."""
    q0 = _configurations(robot, "start", start, None)
    if len(q0) != 1:
        raise InvalidArgument(f"plan: start must be a single configuration ({robot.dof},), got {len(q0)}")
    goals = _configurations(robot, "goal", goal, q0[0])
    if not len(goals):
        raise InvalidArgument("plan: goal must be one configuration or several, got none")
    return np.concatenate([q0, goals])


def _configurations(robot: Robot, name: str, values, others: np.ndarray | None) -> np.ndarray:
    """(k, dof) of arrays, or of mappings joint → value.   others : values of joints that a mapping leaves out."""
    entries = values if isinstance(values, (list, tuple)) else [values]
    if entries and all(isinstance(entry, Mapping) for entry in entries):
        try:
            return np.array([robot.configuration(entry, others)[0] for entry in entries])
        except InvalidArgument as error:
            raise InvalidArgument(f"plan: {name}: {error}") from None
    return np.ascontiguousarray(robot.checked_configurations(values, f"plan: {name}"))


def _hint(robot: Robot, q: np.ndarray) -> str:
    """What may have gone wrong with values outside the limits: degrees, or columns in another order."""
    is_angle = _turns(robot)
    in_radians = np.where(is_angle, np.deg2rad(q), q)
    if np.abs(q[is_angle]).max(initial=0.0) > 2.0 * math.pi and robot.within_limits(in_radians)[0]:
        return "As degrees all are within: np.deg2rad makes radians of them"
    return (
        f"Columns are {listing(robot.joint_names)}, in this order; a mapping {{joint: value}} leaves no doubt, "
        "and np.clip(q, robot.lower, robot.upper) is within"
    )


def sampled_box(robot: Robot, joints: Iterable[str] | None, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(dof,) least and largest values of samples: the limits, or of a joint at rest the start's value.

    Raises InvalidArgument for ends out of limits, unknown joints, goals that need others, and lengths without limits.
    """
    lower, upper = _column_limits(robot)
    slack = 1e-9 * np.maximum(1.0, np.abs(ends))  # as of `Robot.within_limits`
    if ((ends < lower - slack) | (ends > upper + slack)).any():
        _refuse_ends_out_of_limits(robot, ends)
    moves = np.ones(robot.dof, dtype=bool)
    if joints is not None:
        names = checks.listed_texts("plan: joints", joints, "names of joints")
        unknown = [name for name in names if name not in robot.joint_names]
        if unknown or not names:
            what = f"unknown {brief(unknown[0])}" if unknown else f"no name in {brief(joints)}"
            raise InvalidArgument(f"plan: joints: {what}; the robot has {listing(robot.joint_names)}")
        moves = np.array([name in names for name in robot.joint_names])
    differs = np.flatnonzero((ends != ends[0]).any(axis=0) & ~moves)
    if len(differs):
        raise InvalidArgument(
            f"plan: joint {robot.joint_names[differs[0]]} differs between start and goal, and joints= does not name it"
        )
    low, high = ends.min(axis=0), ends.max(axis=0)
    lower, upper = np.minimum(lower, low), np.maximum(upper, high)
    unbounded = moves & (np.isinf(lower) | np.isinf(upper))
    if not unbounded.any():
        return np.where(moves, lower, ends[0]), np.where(moves, upper, ends[0])
    for column in np.flatnonzero(unbounded & ~_turns(robot)).tolist():
        raise InvalidArgument(
            f"plan: joint {robot.joint_names[column]} has no limits to draw samples within; name other joints in "
            "joints=, or give the robot's joint limits"
        )
    lower = np.where(unbounded, low - _HALF_TURN, lower)
    upper = np.where(unbounded, high + _HALF_TURN, upper)
    return np.where(moves, lower, ends[0]), np.where(moves, upper, ends[0])


def _refuse_ends_out_of_limits(robot: Robot, ends: np.ndarray) -> None:
    for row in np.flatnonzero(~robot.within_limits(ends)).tolist():
        raise InvalidArgument(
            f"plan: the {_name_of_end(row, ends)} is out of limits: {'; '.join(robot.limit_notes(ends[row]))}. "
            f"{_hint(robot, ends[row])}"
        )


def _column_limits(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """(dof,) lower and upper limits of columns, narrowed to the limits of mimicking joints."""
    lower, upper = robot.lower.copy(), robot.upper.copy()
    for joint in robot.joints:
        if joint.mimic is None or joint.type not in ("revolute", "prismatic"):
            continue
        driver, multiplier, offset = robot._drivers[joint.name]
        if multiplier == 0.0:
            continue
        column = robot._columns[driver]
        ends = sorted(((joint.lower - offset) / multiplier, (joint.upper - offset) / multiplier))
        lower[column], upper[column] = max(lower[column], ends[0]), min(upper[column], ends[1])
    return lower, upper


def _turns(robot: Robot) -> np.ndarray:
    """(dof,) bool: columns that are angles."""
    revolute = {joint.name for joint in robot.joints if joint.type in ("revolute", "continuous")}
    return np.array([name in revolute or name.endswith(("/roll", "/pitch", "/yaw")) for name in robot.joint_names])


def refuse_collisions(checker: RobotChecker, ends: np.ndarray) -> None:
    """InvalidArgument where the start or a goal collides, naming the deepest pair."""
    for row in np.flatnonzero(checker.collides(ends)).tolist():
        pair = checker.explain(ends[row]).collisions[0]
        raise InvalidArgument(
            f"plan: the {_name_of_end(row, ends)} collides: {pair.a} and {pair.b}, {-pair.distance * 1e3:.3g} mm deep; "
            "checker.explain(q) tells all, and allowed= of RobotChecker leaves pairs out"
        )


def _name_of_end(row: int, ends: np.ndarray) -> str:
    return "start" if row == 0 else "goal" if len(ends) == 2 else f"goal {row - 1}"
