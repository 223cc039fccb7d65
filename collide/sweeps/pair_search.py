"""Downhill: from configurations with two links near each other to a configuration with a collision, where found.

A sample misses rare hits: two fingers that meet in a single configuration of a million. The gap of two links is a
function of the joints between them; the search follows its decrease in random steps of shrinking size.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.robots.robot import Robot
from collide.sweeps.link_bodies import LinkBody, link_poses, pair_gaps
from collide.sweeps.random_configurations import sampled_limits

#: Starts that are followed, and steps tried from each in a round.
N_STARTS, N_STEPS = 8, 12
#: Length of the first steps, as a share of each joint's range, and what it becomes after a round without success.
_FIRST_STEP, _SHORTER = 0.15, 0.6


class Nearest(NamedTuple):
    """The least gap [m] that was met between two links, 0 where they collide, and the configuration (dof,)."""

    gap: float
    q: np.ndarray


def search_downhill(
    robot: Robot, A: LinkBody, B: LinkBody, columns: np.ndarray, starts: np.ndarray, rounds: int, seed: int
) -> Nearest:
    """The least gap of two links met on the way down from some configurations.

    Parameters
    ----------
    robot : Robot
        Whose links.
    A, B : LinkBody
        The two links.
    columns : (k,) int
        Columns that move the links against each other, at least one.
    starts : (n, dof) float64
        Where to start from [rad or m].
    rounds : int
        How many times steps are tried; a collision ends the search.
    seed : int
        Of the random steps.

    Returns
    -------
    Nearest
        Within the limits.
    """
    random = np.random.default_rng(seed)
    lower, upper = sampled_limits(robot)
    at = starts.copy()
    gaps = pair_gaps(A, B, link_poses(robot, at))
    scale = np.full(len(at), _FIRST_STEP)
    for _ in range(rounds):
        if gaps.min() <= 0.0:
            break
        steps = random.normal(size=(len(at), N_STEPS, len(columns))) * scale[:, None, None]
        # Some steps along a single joint: limits make corners, seldom reached by a step along all joints.
        steps[:, ::2] *= np.eye(len(columns))[random.integers(0, len(columns), (len(at), (N_STEPS + 1) // 2))]
        tried = np.repeat(at[:, None], N_STEPS, axis=1)
        tried[..., columns] += steps * (upper - lower)[columns]
        tried = np.clip(tried, lower, upper)
        reached = pair_gaps(A, B, link_poses(robot, tried.reshape(-1, robot.dof))).reshape(len(at), N_STEPS)
        best = reached.argmin(axis=1)
        rows = np.arange(len(at))
        better = reached[rows, best] < gaps
        at[better], gaps[better] = tried[rows, best][better], reached[rows, best][better]
        scale[~better] *= _SHORTER
    nearest = int(gaps.argmin())
    return Nearest(float(gaps[nearest]), at[nearest])
