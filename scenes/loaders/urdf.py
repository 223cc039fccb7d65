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
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidPose, InvalidShape, SceneError, cut, listing
from collide.robots.kinematic_tree import Joint, Mimic
from collide.robots.robot import LinkShape, Robot
from collide.scenes.loaders import mesh_file as mesh_loader
from collide.scenes.loaders import resources
from collide.scenes.loaders.fields import placed
from collide.scenes.loaders.mesh_shapes import element_shapes, extent, mirrors
from collide.scenes.loaders.srdf import find_srdf, read_srdf
from collide.scenes.loaders.xml_text import parse_xml
from collide.shapes.primitives import Box, Capsule, Cylinder, Sphere
from collide.shapes.shape import Shape
from collide.transforms import pose

MISSING_MESHES = ("error", "skip")


@dataclass
class Reading:
    """One URDF being read: where it lies, how meshes are taken, and what there is to say."""

    path: Path
    meshes: str = "mesh"
    package_path: tuple = ()
    missing_meshes: str = "error"
    notes: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    mesh_files: dict[Path, mesh_loader.MeshFile] = field(default_factory=dict)
    seconds: float = 0.0

    def fail(self, element: str, what: str) -> NoReturn:
        raise SceneError(what, path=self.path, element=element)


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
    path = Path(path)
    mesh_loader.check_meshes_option(meshes)
    if not isinstance(missing_meshes, str) or missing_meshes not in MISSING_MESHES:
        raise SceneError(f'missing_meshes must be "error" or "skip", got {checks.brief(missing_meshes)}')
    reading = Reading(path, meshes, tuple(_as_paths(package_path)), missing_meshes)
    root = parse_xml(path, reading.notes)
    if root.tag != "robot":
        advice = "; a scene file names an MJCF model under mjcf" if root.tag == "mujoco" else ""
        reading.fail(f"<{root.tag}>", f"the outermost element of a URDF is <robot>{advice}")
    robot = _build(root, reading, find_srdf(path, root.get("name"), srdf))
    if seconds is not None:
        seconds["meshes"] = seconds.get("meshes", 0.0) + reading.seconds
        seconds["read"] = seconds.get("read", 0.0) + time.perf_counter() - started - reading.seconds
    return robot


def _build(root: ET.Element, reading: Reading, srdf: Path | None) -> Robot:
    links = [_name(element, "link", k, reading) for k, element in enumerate(root.findall("link"))]
    if not links:
        reading.fail("<robot>", "has no <link>" + _expand_advice(root))
    joints = [
        _joint(element, _name(element, "joint", k, reading), reading) for k, element in enumerate(root.findall("joint"))
    ]
    geometry = {name: link_shapes(element, name, reading) for name, element in zip(links, root.findall("link"))}
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


def _expand_advice(root: ET.Element) -> str:
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
    wanted = "one finite number" if count == 1 else f"{count} finite numbers"
    try:
        values = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        advice = "; expand the xacro first" if "${" in text or "$(" in text else ""
        reading.fail(place, f'<{element.tag}> {attribute} must be {wanted}, got "{cut(text)}"{advice}')
    if len(values) != count or not all(map(math.isfinite, values)):
        reading.fail(place, f'<{element.tag}> {attribute} must be {wanted}, got "{cut(text)}"')
    return np.array(values)


def _origin(element: ET.Element, place: str, reading: Reading) -> np.ndarray:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    xyz = floats(origin, "xyz", 3, place, reading, "0 0 0")
    try:
        return pose(xyz, rpy=floats(origin, "rpy", 3, place, reading, "0 0 0"))
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
        for shape, approximation in _element_shapes(element, name, place, reading):
            shapes.append(LinkShape(shape, X_LG, approximation, source))
    return shapes


def _element_shapes(described: ET.Element, link: str, place: str, reading: Reading) -> list[tuple[Shape, str | None]]:
    geometry = described.find("geometry")
    children = [] if geometry is None else [child for child in geometry if isinstance(child.tag, str)]
    if len(children) != 1:
        reading.fail(place, f"<{described.tag}> needs <geometry> with one shape in it, found {len(children)}")
    element = children[0]
    if element.tag == "mesh":
        return _mesh_shapes(element, link, place, reading)
    try:
        shape = _primitive(element, place, reading)
    except InvalidShape as error:
        raise InvalidShape(placed(error, reading.path, place)) from None
    sizes = [value for attribute in ("size", "radius", "length") for value in np.ravel(getattr(shape, attribute, ()))]
    _note_size(float(max(sizes)), place, reading)
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
    reading.fail(place, f"unknown shape <{cut(element.tag)}>; known are box, sphere, cylinder, capsule and mesh")


def _mesh_shapes(element: ET.Element, link: str, place: str, reading: Reading) -> list[tuple[Shape, str | None]]:
    filename = element.get("filename")
    if not filename:
        reading.fail(place, '<mesh> needs a filename="..."')
    scale = _mesh_scale(element, place, reading)
    try:
        file = resources.find(filename, reading.path, reading.package_path, element=place)
    except resources.NotFound as error:
        if reading.missing_meshes == "skip":
            missing = f"{place} has no collision mesh {cut(filename, 240)}: that link is NOT checked by it"
            reading.notes.append(missing)
            reading.missing.append(missing)
            return []
        raise SceneError(
            f"{error.what}\n    (missing_meshes=\"skip\", --missing-meshes skip, loads the robot without it)",
            path=reading.path, element=place,
        ) from None
    started = time.perf_counter()
    if file not in reading.mesh_files:
        reading.mesh_files[file] = mesh_loader.read_mesh(file, reading.meshes)
        reading.notes += reading.mesh_files[file].notes
    shapes = [
        (shape, about) for shape, about in element_shapes(reading.mesh_files[file], scale, f"{reading.path}: {place}")
    ]
    _note_size(extent(reading.mesh_files[file], scale), place, reading)
    reading.seconds += time.perf_counter() - started
    return shapes


def _mesh_scale(element: ET.Element, place: str, reading: Reading) -> np.ndarray:
    text = element.get("scale", "1 1 1")
    single = len(text.replace(",", " ").split()) == 1
    scale = np.broadcast_to(floats(element, "scale", 1 if single else 3, place, reading, "1 1 1"), (3,)).copy()
    if not scale.all():
        reading.fail(place, f'<mesh> scale must not be 0, got "{cut(text)}"')
    if mirrors(scale):
        reading.notes.append(f'{place}: the mesh scale "{cut(text)}" mirrors; the mesh was mirrored')
    return scale


def _note_size(extent: float, place: str, reading: Reading) -> None:
    note = mesh_loader.size_note(extent, place)
    if note:
        reading.notes.append(note)


def _as_paths(package_path) -> list[Path]:
    folders = [package_path] if isinstance(package_path, (str, Path)) else list(package_path)
    return [Path(entry) for entry in folders]


