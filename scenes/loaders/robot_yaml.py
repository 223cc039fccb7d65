"""Robots described in a scene file itself: links with shapes, joints, pairs never tested, states."""

from __future__ import annotations

import math

import numpy as np

from collide.errors import SceneError, brief, listing
from collide.robots.kinematic_tree import COLUMNS, Joint, Mimic
from collide.robots.robot import LinkShape, Robot
from collide.scenes.loaders.fields import Fields, did_you_mean, read_pose
from collide.scenes.loaders.shape_yaml import Files, read_shape
from collide.scenes.loaders.states import state_of

_ROBOT = ("name", "links", "joints", "allow", "states")
_LINK = ("name", "collision")
_COLLISION = ("shape", "pose")
_JOINT = ("name", "type", "parent", "child", "origin", "axis", "limits", "mimic")


def inline_robot(entry: Fields, metres: float, files: Files) -> Robot:
    """The robot under the key ``robot`` of an entry of ``robots``.

    metres : in a unit of length; limits and joint values are always metres and radians.
    """
    fields = entry.sub("robot", _ROBOT)
    notes: list[str] = []
    links: list[str] = []
    geometry: dict[str, list[LinkShape]] = {}
    for data, place in fields.items("links"):
        link = Fields(data, fields.path, place, _LINK)
        name = link.text("name")
        link.named(name)
        links.append(name)
        geometry[name] = _collision(link, metres, files, notes)
    joints = [_joint(Fields(data, fields.path, place, _JOINT), metres) for data, place in fields.items("joints")]
    pairs = _pairs(fields, links) if fields.get("allow") is not None else None
    try:
        robot = Robot(
            fields.text("name", "robot"), links, joints, geometry, semantic_pairs=pairs, notes=notes,
            sources=[str(fields.path)],
        )
    except SceneError as error:
        raise SceneError(
            error.what, path=fields.path, element=": ".join(filter(None, (fields.element, error.element)))
        ) from None
    if fields.get("states") is not None:
        robot.states = _states(fields, robot)
    return robot


def _collision(link: Fields, metres: float, files: Files, notes: list[str]) -> list[LinkShape]:
    shapes = []
    for data, place in link.items("collision"):
        element = Fields(data, link.path, place, _COLLISION)
        if "shape" not in element:
            element.fail("'shape' is missing")
        described = read_shape(element.data["shape"], link.path, element.place("shape"), metres, files)
        shapes.append(
            LinkShape(
                described.shape, read_pose(element, "pose", metres), described.approximation, f"{link.path}: {place}"
            )
        )
        notes += described.notes
    return shapes


def _joint(fields: Fields, metres: float) -> Joint:
    name = fields.text("name")
    fields.named(name)
    kind = fields.choice("type", COLUMNS, "")
    axis = fields.numbers("axis", (3,)) if "axis" in fields else np.array([0.0, 0.0, 1.0])
    lower, upper = -math.inf, math.inf
    if kind in ("revolute", "prismatic"):
        if "limits" not in fields:
            fields.fail(f"a {kind} joint needs limits: [lower, upper]")
        lower, upper = fields.numbers("limits", (2,))
        if lower > upper:
            fields.fail(f"the lower limit is above the upper one: {brief(fields.get('limits'))}", "limits")
    mimic = None
    if fields.get("mimic") is not None:
        follow = fields.sub("mimic", Mimic._fields)
        mimic = Mimic(follow.text("joint"), follow.number("multiplier", 1.0), follow.number("offset", 0.0))
    return Joint(
        name, kind, fields.text("parent"), fields.text("child"), read_pose(fields, "origin", metres), axis,
        float(lower), float(upper), mimic,
    )


def _pairs(fields: Fields, links: list[str]) -> list[tuple[str, str, str]]:
    pairs, known = [], set(links)
    for entry, place in fields.items("allow"):
        if not isinstance(entry, list) or len(entry) not in (2, 3) or not all(isinstance(word, str) for word in entry):
            raise SceneError(
                f"must be [link, link] or [link, link, reason], got {brief(entry)}", path=fields.path, element=place
            )
        for link in entry[:2]:
            if link not in known:
                raise SceneError(
                    f"unknown link {brief(link)}{did_you_mean(link, links)}", path=fields.path, element=place
                )
        pairs.append((entry[0], entry[1], entry[2] if len(entry) == 3 else "allowed by the robot"))
    return pairs


def _states(fields: Fields, robot: Robot) -> dict[str, dict[str, float]]:
    states, known = {}, set(robot.joint_names)
    for name, data in fields.sub("states", ()).data.items():
        place = f"{fields.place('states')}.{name}"
        values = state_of(data, fields.path, place)
        for joint in values:
            if joint not in known:
                raise SceneError(
                    f"unknown joint {brief(joint)}{did_you_mean(joint, robot.joint_names)}; it has "
                    f"{listing(robot.joint_names)}",
                    path=fields.path,
                    element=place,
                )
        states[str(name)] = values
    return states
