"""Configurations drawn evenly between a robot's limits: row k is the same whoever draws it, alone or in any batch."""

from __future__ import annotations

import math

import numpy as np

from collide.robots.robot import Robot


def sampled_limits(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Between what each column is drawn.

    Parameters
    ----------
    robot : Robot
        Whose limits.

    Returns
    -------
    lower, upper : (dof,) float64
        The limits [rad or m]. Angles without limits, or with more than a turn, get -π to π (a turn around 0, or from
        the lower limit where 0 is outside); lengths without limits stay at 0, or at the limit there is.
    """
    lower, upper = robot.lower.copy(), robot.upper.copy()
    angles = np.array([_is_angle(robot, name) for name in robot.joint_names], dtype=bool)
    for k in range(robot.dof):
        if angles[k] and not upper[k] - lower[k] <= 2 * math.pi:
            start = max(lower[k], -math.pi)
            lower[k], upper[k] = min(start, upper[k] - 2 * math.pi), min(start + 2 * math.pi, upper[k])
        elif not angles[k] and not math.isfinite(upper[k] - lower[k]):
            lower[k] = upper[k] = float(np.clip(0.0, lower[k], upper[k]))
    return lower, upper


def unlimited_lengths(robot: Robot) -> list[str]:
    """Columns that are lengths without limits, and so are never drawn.

    Parameters
    ----------
    robot : Robot
        Whose columns.

    Returns
    -------
    list of str
        Names of columns.
    """
    unbounded = ~np.isfinite(robot.upper - robot.lower)
    return [name for name, is_free in zip(robot.joint_names, unbounded) if is_free and not _is_angle(robot, name)]


def random_configurations(robot: Robot, start: int, stop: int, seed: int = 0) -> np.ndarray:
    """Rows start to stop of a seed's sequence of random configurations.

    Parameters
    ----------
    robot : Robot
        Rows are within its limits, as of `sampled_limits`.
    start, stop : int
        Rows; any split of a range gives the same rows.
    seed : int
        Not negative.

    Returns
    -------
    (stop - start, dof) float64
        [rad or m], evenly distributed.
    """
    lower, upper = sampled_limits(robot)
    bits = np.random.PCG64(seed)
    bits.advance(start * robot.dof)  # a double takes one draw
    share = np.random.Generator(bits).random((stop - start, robot.dof))
    return np.clip(lower + share * (upper - lower), lower, upper)


def _is_angle(robot: Robot, column: str) -> bool:
    joint, _, suffix = column.rpartition("/")
    for candidate in robot.joints:
        if candidate.name == column:
            return candidate.type in ("revolute", "continuous")
        if joint and candidate.name == joint:
            return suffix in ("roll", "pitch", "yaw")
    return False
