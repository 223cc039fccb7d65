"""SRDF: which pairs of links are never tested, and named joint values."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path

from collide.base import argument_checks as checks
from collide.base.given_files import is_file
from collide.errors import SceneError, cut, listing
from collide.scenes.loaders.xml_text import parse_xml

#: Elements about collisions: what a proposal of disabled pairs replaces.
COLLISIONS = ("disable_collisions", "enable_collisions", "disable_default_collisions")
#: Attributes that name links or joints of the robot, by element.
_NAMES = {
    "link": ("name",), "joint": ("name",), "chain": ("base_link", "tip_link"), "end_effector": ("parent_link",),
    "virtual_joint": ("name", "child_link"), "passive_joint": ("name",), "joint_property": ("joint_name",),
    "link_sphere_approximation": ("link",),
}


@dataclass
class Semantics:
    """What an SRDF says.

    pairs : (link, link, "SRDF: reason").   states : name -> {joint: value}.
    """

    pairs: list[tuple[str, str, str]] = field(default_factory=list)
    states: dict[str, dict[str, float]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def find_srdf(robot: Path, robot_name: str | None, srdf) -> Path | None:
    """The SRDF given, or the one beside the file of a robot: same stem, or ../srdf/NAME.srdf; None where none is."""
    if srdf is False:
        return None
    if srdf is not None:
        path = checks.file_path("srdf", srdf, SceneError)
        if not is_file(path):
            raise SceneError("no such file", path=path)
        return path
    for folder in (robot.parent, robot.resolve().parent.parent / "srdf"):
        for stem in dict.fromkeys(filter(None, (robot.stem, robot_name))):
            if is_file(folder / f"{stem}.srdf"):
                return folder / f"{stem}.srdf"
    return None


def read_srdf(path: Path, links: list[str], joints: list[str]) -> Semantics:
    """Read an SRDF for a robot with these links and joints.

    Entries about links or joints the robot does not have are left out and noted.
    """
    semantics = Semantics()
    root = parse_xml(path, semantics.notes)
    if root.tag != "robot":
        raise SceneError("the outermost element of an SRDF is <robot>", path=path, element=f"<{root.tag}>")
    strangers: list[str] = []
    known = set(links)
    for element in root.findall("disable_collisions"):
        a, b = element.get("link1"), element.get("link2")
        if not a or not b:
            raise SceneError("needs link1 and link2", path=path, element="<disable_collisions>")
        unknown = [link for link in (a, b) if link not in known]
        strangers += unknown
        if not unknown:
            semantics.pairs.append((a, b, f"SRDF: {element.get('reason') or 'no reason given'}"))
    _read_states(root, path, joints, semantics)
    if strangers:
        semantics.notes.append(f"links that the robot does not have: {listing(dict.fromkeys(strangers))}")
    semantics.notes = [f"{path.name}: {note}" for note in semantics.notes]
    return semantics


def _read_states(root, path: Path, joints: list[str], semantics: Semantics) -> None:
    """Group states. Two groups may share a name ("home" of an arm and of its gripper): one state."""
    known = set(joints)
    for state in root.findall("group_state"):
        name = state.get("name")
        if not name:
            raise SceneError('needs a name="..."', path=path, element="<group_state>")
        values = semantics.states.setdefault(name, {})
        for joint in state.findall("joint"):
            label, text = joint.get("name", ""), joint.get("value", "")
            words = text.split()
            if label not in known or len(words) != 1:
                semantics.notes.append(
                    f'state "{cut(name)}": joint "{cut(label)}" with value "{cut(text)}" was left out'
                )
                continue
            try:
                value = float(words[0])
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise SceneError(
                    f'the value must be a finite number, got "{cut(text)}"',
                    path=path,
                    element=f'state "{cut(name)}" joint "{cut(label)}"',
                )
            values[label] = value


def other_elements(path: Path, prefix: str = "") -> list[tuple[str, str]]:
    """(tag, text) of all that an SRDF says but for collisions: groups, states, end effectors, virtual joints.

    prefix : put before names of links and joints, as `Robot.renamed` does. In the order of the file; elements of a
    namespace, which SRDF has not, are left out.
    """
    root = parse_xml(path, [])
    elements = []
    for element in root:
        if not isinstance(element.tag, str) or element.tag in COLLISIONS or "}" in element.tag:
            continue
        for inner in element.iter():
            for attribute in _NAMES.get(str(inner.tag), ()) if prefix else ():
                if inner.get(attribute):
                    inner.set(attribute, prefix + inner.get(attribute, ""))
        ET.indent(element, "  ", level=1)
        element.tail = None
        elements.append((element.tag, ET.tostring(element, encoding="unicode")))
    return elements
