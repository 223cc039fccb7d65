"""Robots made in a few words, for tests of sampling and of sweeps."""

from __future__ import annotations

from itertools import product

import numpy as np

from collide import Box, Robot, RobotChecker, Sphere, World, pose
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape


def joint(name, kind, parent, child, *, axis=(1, 0, 0), at=(0, 0, 0), lower=None, upper=None) -> Joint:
    """A joint whose frame stands at ``at`` in its parent."""
    lower = lower if lower is not None else 0.0 if kind == "prismatic" else -np.pi
    upper = upper if upper is not None else np.pi
    return Joint(name, kind, parent, child, pose(at), np.array(axis, dtype=float), lower, upper)


def robot_of(links, joints, geometry, **options) -> Robot:
    """geometry : link → (shape, position of its centre in the link)."""
    elements = {link: [LinkShape(shape, pose(p_LG), None, "test")] for link, (shape, p_LG) in geometry.items()}
    return Robot("plain", links, joints, elements, **options)


def chain(n, *, length, width) -> Robot:
    """An arm of n boxes, joints by turns about y and z."""
    links = [f"l{k}" for k in range(n)]
    joints = [
        joint(f"j{k}", "revolute", links[k], links[k + 1], axis=((0, 1, 0), (0, 0, 1))[k % 2], at=(length, 0, 0),
              lower=-2.5, upper=2.5)
        for k in range(n - 1)
    ]
    shape = Box((length, width, width))
    return robot_of(links, joints, {link: (shape, (length / 2, 0, 0)) for link in links})


def arm_checker(*, length=1.0, margin=0.0, radius=0.3, at=(2.5, 0, 0), name="ball", allow=(), **how) -> RobotChecker:
    """An arm of three boxes beside a ball."""
    world = World()
    world.add(Sphere(radius), pose(at), name=name, margin=margin)
    how["allowed"] = [(link, name) for link in allow]
    return RobotChecker(chain(3, length=length, width=0.1), world, **how)


def box_corners(size) -> np.ndarray:
    """(8, 3) corners of a box around the origin."""
    return np.array(list(product(*((-s / 2, s / 2) for s in size))))
