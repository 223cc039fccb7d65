"""A piece of a batch of configurations: whether they collide, by the kernels, then by what these leave to others."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.robots import open_pairs
from collide.robots.check_configurations import COLLIDES, IS_OPEN, check_configurations
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.checker_scene import CheckerScene


def check_piece(checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, out: np.ndarray) -> None:
    """``out`` (n,) becomes whether configurations q (n, dof) collide."""
    verdicts = np.empty(len(q), dtype=np.uint8)
    done = 0
    while done < len(q):
        done = check_configurations(
            space.address, address_of(q), checker.robot.dof, done, len(q), address_of(verdicts)
        )
        pairs = space.open_pairs
        if len(pairs):
            space.ask_meshes(checker.setting)
            pairs = pairs[verdicts[pairs[:, 0]] == IS_OPEN]
            hits = open_pairs.are_hits(*asked_poses(checker, pairs, q), *both_bodies(checker), once=True)
            verdicts[pairs[hits, 0]] = COLLIDES
    out[:] = verdicts == COLLIDES


def both_bodies(checker: CheckerScene) -> tuple:
    """Bodies that move, and bodies around."""
    return checker.setting.bodies, checker.setting.surroundings.bodies


def asked_poses(checker: CheckerScene, pairs: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(pairs whose configurations are rows of the poses, (k, links, 4, 4) poses) of the configurations they name."""
    asked, inverse = np.unique(pairs[:, 0], return_inverse=True)
    pairs = pairs.copy()
    pairs[:, 0] = inverse.reshape(-1)
    return pairs, checker.link_poses(q[asked])
