"""Obstacles with a known motion: bodies of a robot behind floating joints, whose columns follow the motion.

Bounds of motions then hold of obstacles as they do of links (`motion_bounds.py`): nothing else is needed.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief, listing
from collide.robots.checker_scene import CheckerScene
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot
from collide.robots.splines import Spline

#: Root of a robot with moving obstacles: a name that no file has.
_WORLD = "world of moving obstacles"


def among_moving(
    checker: CheckerScene, name: str, spline: Spline, moving: Mapping[str, Spline]
) -> tuple[CheckerScene, Spline]:
    """(a checker of the robot with obstacles as links, the motion of all columns).

    moving : as of `RobotChecker.certify_spline`, whose name is in messages.   Raises InvalidArgument.
    """
    moving = checks.mapping(f"{name}: moving", moving, "name of a body → its Spline")
    world = copy.copy(checker.world)
    known = [body for body in world.names.values() if body not in checker.robot.geometry]
    joints, geometry, margins = [], {}, {}
    for body_name, motion in moving.items():
        if body_name not in known:
            raise InvalidArgument(
                f"{name}: moving names {brief(body_name)}, which is no body around the robot; there are "
                f"{listing(known) or 'none'}"
            )
        body = world.body(body_name)
        if body.shape.is_field:
            raise InvalidArgument(
                f"{name}: moving[{brief(body_name)}] is a {type(body.shape).__name__}, which stands still: give a mesh "
                "or convex shapes that hold it"
            )
        spline, X_LG = _with_motion(f"{name}: moving[{brief(body_name)}]", spline, motion, body.X_WB)
        joints.append(Joint(f"motion of {body_name}", "floating", _WORLD, body_name))
        geometry[body_name] = (LinkShape(body.shape, X_LG, None, "moving obstacle"),)
        margins[body_name] = body.margin
        world.set_margin(body_name, 0.0)
    return _with_obstacles(checker, world, joints, geometry, margins), spline


def _with_motion(what: str, spline: Spline, motion, X_WB: np.ndarray) -> tuple[Spline, np.ndarray]:
    """(the motion with the six columns of an obstacle behind, the shape's pose in the obstacle's frame)."""
    try:
        motion = Spline.of(motion)
    except InvalidArgument as error:
        raise InvalidArgument(f"{what}: {error}") from None
    if motion.columns not in (3, 6):
        raise InvalidArgument(f"{what} must have 3 columns, x y z, or 6, with roll pitch yaw; got {motion.columns}")
    X_LG = np.eye(4)
    if motion.columns == 3:
        X_LG[:3, :3] = X_WB[:3, :3]
        points, sizes = motion.control_points, motion._magnitudes
        points, sizes = np.concatenate([points, 0.0 * points], axis=2), np.concatenate([sizes, 0.0 * sizes], axis=1)
        motion = Spline(motion.breaks, points, sizes)
    try:
        return spline.beside(motion), X_LG
    except InvalidArgument as error:
        raise InvalidArgument(f"{what}: {error}") from None


def _with_obstacles(checker: CheckerScene, world, joints: list[Joint], geometry, margins) -> CheckerScene:
    """The checker with obstacles as links, which are tested against the robot alone."""
    robot, obstacles = checker.robot, list(geometry)
    base = Joint(_WORLD, "fixed", _WORLD, robot.root, checker._X_WR)
    among = [(a, b, "both are obstacles") for k, a in enumerate(obstacles) for b in obstacles[k + 1 :]]
    extended = Robot(
        robot.name, [_WORLD, *robot.links, *obstacles], [base, *robot.joints, *joints], {**robot.geometry, **geometry},
        semantic_pairs=[*robot.disabled_pairs, *among],
    )
    around = [body for body in world.names.values() if body not in extended.geometry]
    known = {*extended.links, *checker._objects, *around}
    asked = [pair for pair in checker._asked if known.issuperset(pair[:2])]
    asked += [(a, b, "both are obstacles") for a in obstacles for b in around]
    padding = {body.name: body.padding for body in checker._bodies} | margins
    objects = list(checker._objects.values())
    return CheckerScene(extended, world, None, objects, padding, asked, checker._mobile, frozenset(obstacles))
