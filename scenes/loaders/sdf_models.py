"""The models of an SDFormat file, one by one: its links and joints, and the robots and bodies that they make.

A link that no joint holds is a body; links that joints hold together are a robot, a tree that starts at the world
where one of them is joined to it, else at the first link that is nobody's child. A joint that closes a loop of joints
before it is left out, with a note; so is what moves within a static model, whose links stand where they are.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from collide.errors import SceneError, cut, listing
from collide.robots.kinematic_tree import Joined, Joint, Mimic
from collide.robots.robot import LinkShape, Robot
from collide.scenes.description import SceneBody, free_name, link_body
from collide.scenes.loaders.robot_reading import BALL, Motion, Reading, chain
from collide.scenes.loaders.sdf_frames import MODEL, WORLD, Scope, is_identity, is_true, text_of
from collide.scenes.loaders.sdf_geometry import shapes_of_link
from collide.transforms import inverse_pose

#: Limits from here on are none: what libsdformat writes for a joint without limits.
NO_LIMIT = 1e16
JOINED, APART = "linked by a joint", "self_collide is off in the model"
_KINDS = {
    "revolute": 1, "continuous": 1, "prismatic": 1, "gearbox": 1, "screw": 1, "universal": 2, "revolute2": 2,
    "ball": 0, "fixed": 0,
}


@dataclass
class ModelLink:
    """A link, by its name within the model at the top.

    X_ML : (4, 4) pose in the model's frame.   bits : of <collide_bitmask>.   self_collide : of the link, else of its
    model; None where neither says.
    """

    name: str
    X_ML: np.ndarray
    shapes: list[LinkShape]
    bits: int
    self_collide: bool | None
    place: str


@dataclass
class ModelJoint:
    """A joint between two links of a model, or a link and the world.

    X_MJ : (4, 4) pose of its frame at rest in the model's frame.   motions : its coordinates; empty: fixed.
    """

    name: str
    parent: str
    child: str
    X_MJ: np.ndarray
    motions: list[Motion]


@dataclass
class Model:
    """A model with its links and joints, those of the models within it, too."""

    name: str
    reading: Reading
    static: bool
    links: dict[str, ModelLink] = field(default_factory=dict)
    joints: list[ModelJoint] = field(default_factory=list)

    def apart(self) -> list[tuple[str, str, str]]:
        """Pairs of links that are never tested: linked by a joint; neither collides with its own model."""
        pairs = {frozenset((joint.parent, joint.child)): JOINED for joint in self.joints}
        links = [link for link in self.links.values() if link.shapes]
        for k, a in enumerate(links):
            for b in links[k + 1 :]:
                values = {a.self_collide, b.self_collide}
                if True not in values and values != {None}:
                    pairs.setdefault(frozenset((a.name, b.name)), APART)
        order = {link.name: k for k, link in enumerate(links)}
        known = ((pair, why) for pair, why in pairs.items() if pair <= order.keys())
        numbered = sorted((sorted(order[link] for link in pair), why) for pair, why in known)
        return [(links[i].name, links[j].name, why) for (i, j), why in numbered]

    def groups(self) -> Iterator[tuple[list[ModelLink], list[ModelJoint]]]:
        """Links held together by joints, each group and all of them in the file's order, with their joints."""
        joined, joints = Joined(), [] if self.static else self.joints
        for joint in joints:
            if joint.parent != WORLD:
                joined.join(joint.parent, joint.child)
        groups: dict[str, tuple[list[ModelLink], list[ModelJoint]]] = {}
        for name, link in self.links.items():
            groups.setdefault(joined.leader(name), ([], []))[0].append(link)
        for joint in joints:
            groups[joined.leader(joint.child)][1].append(joint)
        yield from groups.values()


def read_model(scope: Scope) -> Model:
    """The model of a scope, those within it included. Raises SceneError, InvalidShape, InvalidPose."""
    model = Model(scope.name, scope.reading, scope.static)
    _add_scope(scope, "", np.eye(4), model)
    if not model.links:
        scope.reading.fail(f'model "{cut(scope.name)}"', "has no <link>")
    if not any(link.shapes for link in model.links.values()):
        scope.reading.notes.append(f'model "{cut(scope.name)}" has no collision geometry: nothing of it is checked')
    elif all(link.self_collide is None for link in model.links.values()) and len(model.links) > 1 and not model.static:
        scope.reading.notes.append(
            f'model "{cut(scope.name)}" does not say whether its links may collide with each other (<self_collide>): '
            "they are tested, those linked by a joint left out; Gazebo would not"
        )
    return model


def _add_scope(scope: Scope, prefix: str, X_MS: np.ndarray, model: Model) -> None:
    self_collide = scope.element.find("self_collide")
    of_model = None if self_collide is None else is_true(self_collide.text or "")
    for name, element in scope.frames.items():
        if element.tag != "link":
            continue
        place = f'link "{cut(prefix + name)}"'
        self_collide = element.find("self_collide")
        shapes, bits = shapes_of_link(scope, element, prefix + name)
        if not shapes and element.find("visual") is not None and element.find("collision") is None:
            scope.reading.notes.append(f"{place} has a visual but no collision geometry: it is NOT checked")
        model.links[prefix + name] = ModelLink(
            prefix + name, X_MS @ scope.X_SF(name, place), shapes, bits,
            of_model if self_collide is None else is_true(self_collide.text or ""), f"{scope.reading.path}: {place}",
        )
    for name, nested in scope.models.items():
        _add_scope(nested, f"{prefix}{name}::", X_MS @ scope.X_SF(name, f'model "{cut(prefix + name)}"'), model)
    for name, element in scope.frames.items():
        if element.tag == "joint":
            model.joints.append(_joint(scope, prefix, element, name, X_MS))


# --- joints --------------------------------------------------------------------------------------


def _joint(scope: Scope, prefix: str, element: ET.Element, name: str, X_MS: np.ndarray) -> ModelJoint:
    reading, place = scope.reading, f'joint "{cut(prefix + name)}"'
    ends = []
    for role in ("parent", "child"):
        named = text_of(element, role) or text_of(element.find(role), "link")
        if not named:
            reading.fail(place, f"needs <{role}>")
        link = scope.link_of(named, place)
        ends.append(link if link == WORLD else prefix + link)
    if ends[1] == WORLD:
        reading.fail(place, "its child is the world, which cannot move: make it the parent")
    if ends[0] == ends[1]:
        reading.fail(place, f'its parent and its child are one link, "{cut(ends[0])}"')
    kind = element.get("type")
    if kind not in _KINDS:
        reading.fail(place, f"unknown type {cut(str(kind))}; known are {', '.join(_KINDS)}")
    if kind == "gearbox":
        reading.notes.append(f"{place} is a gearbox: it was read as revolute, without its gear")
    motions = list(BALL) if kind == "ball" else []
    axes = [element.find(tag) for tag in ("axis", "axis2")[: _KINDS[kind]]]
    for k, axis in enumerate(axes):
        if axis is None:
            reading.fail(place, f"a {kind} joint needs <{('axis', 'axis2')[k]}>")
        turning = "prismatic" if kind == "prismatic" else "continuous" if kind == "continuous" else "revolute"
        suffix = ("/axis", "/axis2")[k] if len(axes) == 2 else ""
        motions.append(_motion(scope, prefix, axis, name, turning, suffix, place))
    if kind == "screw":
        motions.append(_advance(element, motions[0], prefix + name, place, reading))
    return ModelJoint(prefix + name, ends[0], ends[1], X_MS @ scope.X_SF(name, place), motions)


def _motion(
    scope: Scope, prefix: str, axis: ET.Element, joint: str, kind: str, suffix: str, place: str
) -> Motion:
    reading = scope.reading
    described = axis.find("xyz")
    xyz = reading.numbers(text_of(axis, "xyz", "0 0 1"), 3, "<axis> <xyz>", place)
    expressed_in = None if described is None else described.get("expressed_in")
    if expressed_in is None and is_true(text_of(axis, "use_parent_model_frame", _of_parent_model(scope))):
        expressed_in = MODEL
    if expressed_in is not None and expressed_in != joint:
        xyz = scope.X_SF(joint, place)[:3, :3].T @ (scope.X_SF(expressed_in, place)[:3, :3] @ xyz)
    limit, bounds = axis.find("limit"), []
    for tag, default in (("lower", "-1e16"), ("upper", "1e16")):
        text = text_of(limit, tag, default)
        value = float(text) if text.lstrip("+-").lower() in ("inf", "infinity") else float(
            reading.numbers(text, 1, f"<limit> <{tag}>", place)[0]
        )
        bounds.append(value if abs(value) < NO_LIMIT else math.copysign(math.inf, value))
    lower, upper = bounds
    if lower > upper:  # SDFormat: no limit
        reading.notes.append(
            f"{place} has limits [{lower:g}, {upper:g}], the lower above the upper: taken as unlimited"
        )
        lower, upper = -math.inf, math.inf
    if kind == "revolute" and lower == -math.inf and upper == math.inf:
        kind = "continuous"
    return Motion(suffix, kind, xyz, lower, upper, _mimic(axis, prefix, place, reading))


def _of_parent_model(scope: Scope) -> str:
    """Whether axes are those of the model's frame where they do not say: so they were up to version 1.4."""
    return "true" if scope.version < (1, 5) else "false"


def _mimic(axis: ET.Element, prefix: str, place: str, reading: Reading) -> Mimic | None:
    """follower = multiplier (leader − reference) + offset (SDFormat 1.11)."""
    mimic = axis.find("mimic")
    if mimic is None:
        return None
    leader = mimic.get("joint")
    if not leader:
        reading.fail(place, '<mimic> needs joint="..."')
    suffix = "/axis2" if mimic.get("axis") == "axis2" else ""
    multiplier, offset, reference = (
        float(reading.numbers(text_of(mimic, tag, default), 1, f"<mimic> <{tag}>", place)[0])
        for tag, default in (("multiplier", "1"), ("offset", "0"), ("reference", "0"))
    )
    return Mimic(prefix + leader + suffix, multiplier, offset - multiplier * reference)


def _advance(element: ET.Element, rotation: Motion, name: str, place: str, reading: Reading) -> Motion:
    """How far a screw moves along its axis as it turns."""
    if text := text_of(element, "screw_thread_pitch"):  # [m / turn]
        per_radian = float(reading.numbers(text, 1, "<screw_thread_pitch>", place)[0]) / math.tau
    else:  # [rad / m], of the opposite sign
        pitch = float(reading.numbers(text_of(element, "thread_pitch", "1"), 1, "<thread_pitch>", place)[0])
        if pitch == 0.0:
            reading.fail(place, "<thread_pitch> must not be 0")
        per_radian = -1.0 / pitch
    return Motion("/advance", "prismatic", rotation.axis, mimic=Mimic(name, per_radian, 0.0))


# --- robots and bodies ---------------------------------------------------------------------------


@dataclass
class Placed:
    """A robot, and where its root stands in the model's frame.   mobile : it is not joined to the world."""

    robot: Robot
    X_MR: np.ndarray
    mobile: bool


def bodies_and_robots(model: Model) -> tuple[list[SceneBody], list[Placed]]:
    """What a model puts into a scene: names as in the model, poses in its frame."""
    bodies, robots = [], []
    for links, joints in model.groups():
        if joints:
            robots.append(_robot(model, links, joints, only=len(links) == len(model.links)))
        else:
            bodies += [_body(link, model.static) for link in links if link.shapes]
    return bodies, robots


def _body(link: ModelLink, static: bool) -> SceneBody:
    """A link by itself, in the frame of its shape where it has one alone."""
    body, X_LB = link_body(link.name, tuple(link.shapes))
    body.static, body.X_WB = static, link.X_ML if is_identity(X_LB) else link.X_ML @ X_LB
    body.group = body.mask = link.bits
    return body


def _robot(model: Model, links: list[ModelLink], joints: list[ModelJoint], only: bool) -> Placed:
    """The tree of a group of links.   only : the model has no others."""
    is_held = any(joint.parent == WORLD for joint in joints)
    children = {joint.child for joint in joints}
    roots = [link.name for link in links if link.name not in children] or [links[0].name]
    root = WORLD if is_held else roots[0]
    taken = {link.name: 1 for link in links}
    root_name = free_name(WORLD, taken) if is_held else root
    made, lost = _tree(model, root, root_name, joints, taken)
    if lost:
        model.reading.notes.append(f"joints that close a loop are NOT kept: {listing(lost)}")
    names = [link for link in taken if link != root_name]
    pairs = [pair for pair in model.apart() if {pair[0], pair[1]} <= {link.name for link in links}]
    reading = model.reading
    name = model.name if only else f"{model.name}::{roots[0]}"
    try:
        robot = Robot(
            name, [root_name, *names], made, {link.name: link.shapes for link in links if link.shapes},
            semantic_pairs=pairs, sources=[str(reading.path)],
            missing_meshes=[f"{reading.path.name}: {note}" for note in reading.missing],
        )
    except SceneError as error:
        raise SceneError(error.what, path=reading.path, element=error.element) from None
    return Placed(robot, np.eye(4) if is_held else model.links[root].X_ML, not is_held)


def _tree(
    model: Model, root: str, root_name: str, joints: list[ModelJoint], taken: dict[str, int]
) -> tuple[list[Joint], list[str]]:
    """(joints from the root on, in the file's order; names of those that close a loop of joints before them)."""
    joined = Joined()
    tree = [joint for joint in joints if joined.join(joint.parent, joint.child)]
    at: dict[str, list[ModelJoint]] = {}
    for joint in tree:
        at.setdefault(joint.parent, []).append(joint)
        at.setdefault(joint.child, []).append(joint)
    waiting, reached_from = [root], {root: ""}
    while waiting:
        link = waiting.pop()
        for joint in at.get(link, ()):
            far = joint.child if link == joint.parent else joint.parent
            if far not in reached_from:
                reached_from[far] = link
                waiting.append(far)
    made: list[Joint] = []
    for joint in tree:
        forward = reached_from[joint.child] == joint.parent
        near, far = (joint.parent, joint.child) if forward else (joint.child, joint.parent)
        X_MN = np.eye(4) if near == WORLD else model.links[near].X_ML
        parent = root_name if near == root else near
        made += _links_of_joint(
            joint, forward, parent, far, inverse_pose(X_MN) @ joint.X_MJ, model.links[far].X_ML, taken
        )
    names = {joint.name for joint in tree}
    return made, [joint.name for joint in joints if joint.name not in names]


def _links_of_joint(
    joint: ModelJoint, forward: bool, parent: str, child: str, X_PJ: np.ndarray, X_ML: np.ndarray, taken: dict[str, int]
) -> list[Joint]:
    """A joint as joints of one coordinate each, and a fixed one where the child's frame is not the joint's."""
    X_JC = np.eye(4) if np.array_equal(joint.X_MJ, X_ML) else inverse_pose(joint.X_MJ) @ X_ML
    if not joint.motions:
        return [Joint(joint.name, "fixed", parent, child, X_PJ if is_identity(X_JC) else X_PJ @ X_JC)]
    motions = joint.motions if forward else [motion._replace(axis=-motion.axis) for motion in joint.motions[::-1]]

    def free_link(name: str) -> str:
        return free_name(name, taken)

    if is_identity(X_JC):
        return chain(joint.name, motions, parent, child, X_PJ, free_link)
    moved = free_link(f"{child}/{joint.name}")
    made = chain(joint.name, motions, parent, moved, X_PJ, free_link)
    return [*made, Joint(f"{joint.name}/fixed", "fixed", moved, child, X_JC)]
