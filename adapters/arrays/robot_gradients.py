"""Distances of a robot and their gradients by q, as rows that an optimiser can add up."""

from __future__ import annotations

from typing import Any

import numpy as np

from collide.robots.robot_checker import RobotChecker


def robot_gradients(
    checker: RobotChecker, Q: np.ndarray, question: dict[str, Any]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """((M,) distances [m], (M, dof) gradients, (M,) the configuration of each) of the rows of `RobotChecker.distances`.

    A row beyond ``max_distance`` is this distance, with a gradient of 0. NaN where a distance has no derivative.
    """
    measured = checker.distances(Q, **question)
    beyond = measured.beyond
    values = np.where(beyond, question["max_distance"], measured.distance)
    return values, np.where(beyond[:, None], 0.0, measured.gradient), measured.configuration
