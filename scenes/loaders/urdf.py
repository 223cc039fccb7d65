"""URDF: links, joints and collision geometry of a robot, read with every number checked.

Read from the XML itself, so that a complaint can name the link, the element and the text it found
there. Inertial and transmission elements are not looked at, visual ones only for pictures
(`visual_shapes.py`). The SRDF beside a URDF (`srdf.find_srdf`) says which pairs are never tested.
"""

from __future__ import annotations

import math
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from collide.errors import InvalidPose, InvalidShape, SceneError, cut, listing
from collide.robots.kinematic_tree import Joint, Mimic
from collide.robots.robot import LinkShape, Robot
from collide.scenes.description import free_name
from collide.scenes.loaders.fields import placed, read_each
from collide.scenes.loaders.mesh_shapes import Taken
from collide.scenes.loaders.robot_reading import BALL, Reading, chain, opened
from collide.scenes.loaders.srdf import find_srdf, read_srdf
from collide.scenes.loaders.xml_text import parse_xml
from collide.shapes.primitives import Box, Capsule, Cylinder, Halfspace, Sphere
from collide.shapes.shape import Shape
from collide.transforms import pose


def load_robot(
    path, srdf=None, *, meshes: str = "mesh", package_path: Iterable = (), missing_meshes: str = "error",
    seconds: dict[str, float] | None = None,
) -> Robot:
    """A `Robot` from a URDF file.

    srdf : path of the SRDF; None looks beside the URDF, False does without.
    meshes : "mesh", "hull" or "pieces".   package_path : folders that hold packages.
    missing_meshes : "error", or "skip" to leave such a link unchecked, which is noted.
    seconds : receives the time spent on ``meshes`` and on the rest, ``read``.

    Raises SceneError, InvalidShape or InvalidPose naming file, link or joint, and value.
    """
    started = time.perf_counter()
    reading = opened(path, meshes, package_path, missing_meshes)
    path = reading.path
    root = parse_xml(path, reading.notes)
    if root.tag != "robot":
        advice = "; a scene file names an MJCF model under mjcf" if root.tag == "mujoco" else ""
        reading.fail(f"<{root.tag}>", f"the outermost element of a URDF is <robot>{advice}")
    robot = _build(root, reading, find_srdf(path, root.get("name"), srdf))
    reading.add_time(seconds, started)
    return robot


def _build(root: ET.Element, reading: Reading, srdf: Path | None) -> Robot:
    links = [_name(element, "link", k, reading) for k, element in enumerate(root.findall("link"))]
    if not links:
        reading.fail("<robot>", "has no <link>" + _advice(root))
    elements = dict(zip(links, root.findall("link")))
    geometry = dict(zip(links, read_each(links, lambda name: link_shapes(elements[name], name, reading))))
    taken = dict.fromkeys(links, 1)
    joints: list[Joint] = []
    for k, element in enumerate(root.findall("joint")):
        joint = _joint(element, _name(element, "joint", k, reading), reading)
        joints += _of_single_coordinates(joint, taken, reading)
    links += [link for link in taken if link not in geometry]
    _note_unchecked(root, geometry, reading)
    semantics = read_srdf(srdf, links, [joint.name for joint in joints]) if srdf is not None else None
    sources = [str(reading.path)] + ([str(srdf)] if srdf is not None else [])
    try:
        return Robot(
            root.get("name") or reading.path.stem, links, joints, geometry,
            semantic_pairs=semantics.pairs if semantics else None,
            states=semantics.states if semantics else None,
            notes=[f"{reading.path.name}: {note}" for note in reading.notes] + (semantics.notes if semantics else []),
            missing_meshes=[f"{reading.path.name}: {note}" for note in reading.missing], sources=sources,
        )
    except SceneError as error:
        raise SceneError(error.what, path=reading.path, element=error.element) from None


def _note_unchecked(root: ET.Element, geometry: dict, reading: Reading) -> None:
    bare = [
        element.get("name", "") for element in root.findall("link")
        if element.find("visual") is not None and element.find("collision") is None
    ]
    if bare:
        reading.notes.append(f"links with a visual but no collision geometry are NOT checked: {listing(bare)}")
    if not any(geometry.values()):
        reading.notes.append("no link has collision geometry: nothing of this robot is checked")


# --- XML ----------------------------------------------------------------------------------------


def _of_single_coordinates(joint: Joint, taken: dict[str, int], reading: Reading) -> list[Joint]:
    """A joint, or in place of Bullet's "spherical" ones three that turn about an axis each."""
    if joint.type != "spherical":
        return [joint]
    reading.notes.append(
        f"{_place('joint', joint.name)} is spherical, as Bullet has it: its columns are NAME/yaw, NAME/pitch, "
        "NAME/roll, without limits"
    )
    return chain(joint.name, BALL, joint.parent, joint.child, joint.X_PJ, lambda name: free_name(name, taken))


def _advice(root: ET.Element) -> str:
    if root.find("deformable") is not None:
        return ": it describes a soft body (<deformable>), and bodies here are rigid"
    if any("}" in str(element.tag) for element in root.iter()):
        return "; it looks like xacro: expand it first (xacro in.xacro > out.urdf)"
    return ""


def _name(element: ET.Element, kind: str, k: int, reading: Reading) -> str:
    name = element.get("name")
    if not name:
        reading.fail(f"{kind} {k}", f'<{kind}> needs a name="..."')
    return name


def _place(kind: str, name: str) -> str:
    return f'{kind} "{cut(name)}"'


def floats(
    element: ET.Element, attribute: str, count: int, place: str, reading: Reading, default: str | None = None
) -> np.ndarray:
    """``count`` finite numbers of an attribute, separated by blanks or commas."""
    text = element.get(attribute, default)
    if text is None:
        reading.fail(place, f'<{element.tag}> needs {attribute}="..."')
    return reading.numbers(text, count, f"<{element.tag}> {attribute}", place)


def _origin(element: ET.Element, place: str, reading: Reading) -> np.ndarray:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    xyz = floats(origin, "xyz", 3, place, reading, "0 0 0")
    try:
        rpy = floats(origin, "rpy", 3, place, reading, "0 0 0")
        return pose(xyz, R=reading.rotation(rpy, f"{place} <origin>"))
    except InvalidPose as error:
        raise InvalidPose(placed(error, reading.path, f"{place} <origin>")) from None


# --- joints -------------------------------------------------------------------------------------


def _joint(element: ET.Element, name: str, reading: Reading) -> Joint:
    place = _place("joint", name)
    ends = {}
    for role in ("parent", "child"):
        end = element.find(role)
        if end is None or not end.get("link"):
            reading.fail(place, f'needs <{role} link="..."/>')
        ends[role] = end.get("link") or ""
    kind = element.get("type")
    if kind is None:
        reading.fail(place, '<joint> needs a type="..."')
    axis = element.find("axis")
    direction = np.array([1.0, 0.0, 0.0]) if axis is None else floats(axis, "xyz", 3, place, reading, "1 0 0")
    lower, upper = _limits(element, kind, place, reading)
    return Joint(
        name, kind, ends["parent"], ends["child"], _origin(element, place, reading), direction,
        lower, upper, _mimic(element, place, reading),
    )


def _limits(element: ET.Element, kind: str, place: str, reading: Reading) -> tuple[float, float]:
    if kind not in ("revolute", "prismatic"):
        return -math.inf, math.inf
    limit = element.find("limit")
    if limit is None:
        reading.notes.append(f"{place} is {kind} but has no <limit>: taken as unlimited")
        return -math.inf, math.inf
    lower = float(floats(limit, "lower", 1, place, reading, "0")[0])
    upper = float(floats(limit, "upper", 1, place, reading, "0")[0])
    if lower > upper:
        reading.notes.append(
            f"{place} has limits [{lower:g}, {upper:g}] the wrong way round: read as [{upper:g}, {lower:g}]"
        )
        lower, upper = upper, lower
    return lower, upper


def _mimic(element: ET.Element, place: str, reading: Reading) -> Mimic | None:
    mimic = element.find("mimic")
    if mimic is None:
        return None
    if not mimic.get("joint"):
        reading.fail(place, '<mimic> needs a joint="..."')
    return Mimic(
        mimic.get("joint") or "",
        float(floats(mimic, "multiplier", 1, place, reading, "1")[0]),
        float(floats(mimic, "offset", 1, place, reading, "0")[0]),
    )


# --- collision geometry --------------------------------------------------------------------------


def link_shapes(link: ET.Element, name: str, reading: Reading, tag: str = "collision") -> list[LinkShape]:
    """The shapes of a <link>, of its elements of one tag: "collision", or "visual" for what it looks like."""
    shapes: list[LinkShape] = []
    elements = link.findall(tag)
    for k, element in enumerate(elements):
        place = _place("link", name) + (f" {tag} {k}" if len(elements) > 1 else "")
        X_LG = _origin(element, place, reading)
        source = f"{reading.path}: {place}"
        for shape, approximation in _element_shapes(element, place, reading):
            shapes.append(LinkShape(shape, X_LG, approximation, source))
    return shapes


def _element_shapes(described: ET.Element, place: str, reading: Reading) -> list[tuple[Shape, str | None]]:
    geometry = described.find("geometry")
    children = [] if geometry is None else [child for child in geometry if isinstance(child.tag, str)]
    if len(children) != 1:
        reading.fail(place, f"<{described.tag}> needs <geometry> with one shape in it, found {len(children)}")
    element = children[0]
    if element.tag == "mesh":
        return [*_mesh_shapes(element, place, reading)]
    if element.tag == "cdf":
        name = cut(element.get("filename", ""))
        reading.notes.append(
            f"{place}: {name}, a grid of distances of Bullet's, is not read: that link is NOT checked by it"
        )
        return []
    try:
        shape = _primitive(element, place, reading)
    except InvalidShape as error:
        raise InvalidShape(placed(error, reading.path, place)) from None
    sizes = [value for attribute in ("size", "radius", "length") for value in np.ravel(getattr(shape, attribute, ()))]
    reading.note_size(float(max(sizes, default=1.0)), place)
    return [(shape, None)]


def _primitive(element: ET.Element, place: str, reading: Reading):
    def number(attribute: str) -> float:
        return float(floats(element, attribute, 1, place, reading)[0])

    if element.tag == "box":
        return Box(floats(element, "size", 3, place, reading))
    if element.tag == "sphere":
        return Sphere(number("radius"))
    if element.tag == "cylinder":
        return Cylinder(number("radius"), number("length"))
    if element.tag == "capsule":
        return Capsule(number("radius"), number("length"))
    if element.tag == "plane":  # of Bullet
        return Halfspace(floats(element, "normal", 3, place, reading, "0 0 1"), 0.0)
    reading.fail(place, f"unknown shape <{cut(element.tag)}>; known are box, sphere, cylinder, capsule, mesh and plane")


def _mesh_shapes(element: ET.Element, place: str, reading: Reading) -> list[Taken]:
    filename = element.get("filename")
    if not filename:
        reading.fail(place, '<mesh> needs a filename="..."')
    return reading.mesh_shapes(filename, _mesh_scale(element, place, reading), place)


def _mesh_scale(element: ET.Element, place: str, reading: Reading) -> np.ndarray:
    text = element.get("scale", "1 1 1")
    single = len(text.replace(",", " ").split()) == 1
    return np.broadcast_to(floats(element, "scale", 1 if single else 3, place, reading, "1 1 1"), (3,)).copy()
