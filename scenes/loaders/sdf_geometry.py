"""What collides on a link of an SDFormat file: its <collision> elements as shapes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np

from collide.errors import InvalidShape, cut, listing
from collide.robots.robot import LinkShape
from collide.scenes.loaders.fields import placed
from collide.scenes.loaders.mesh_parts import MeshFile, MeshPart, described
from collide.scenes.loaders.mesh_shapes import Taken
from collide.scenes.loaders.robot_reading import Reading
from collide.scenes.loaders.sdf_frames import Scope, frame_in_pose, is_true, pose_of, text_of
from collide.shapes.primitives import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Sphere
from collide.shapes.shape import Shape
from collide.transforms import inverse_pose

#: The bits of a collision that names none: <collide_bitmask>.
ALL_BITS = 0xFFFF
_UNREAD = {"heightmap": "an image of heights", "image": "boxes made of an image", "polyline": "an extruded outline"}


def shapes_of_link(scope: Scope, link: ET.Element, name: str) -> tuple[list[LinkShape], int]:
    """The shapes of a link, posed in its frame, and its bits: all that one of its collisions has.

    name : of the link in its scope, for messages. Raises SceneError, InvalidShape, InvalidPose.
    """
    reading, shapes, bits = scope.reading, [], set()
    for k, element in enumerate(link.findall("collision")):
        place = f'link "{cut(name)}" collision "{cut(element.get("name") or str(k))}"'
        X_LG = _pose_in_link(scope, element, link.get("name") or "", place)
        taken = _taken(element, place, reading)
        if taken:
            bits.add(_bits(element, place, reading))
        source = f"{reading.path}: {place}"
        shapes += [LinkShape(shape, X_LG, approximation, source) for shape, approximation in taken]
    if len(bits) > 1:
        masks = " and ".join(f"{mask:#x}" for mask in sorted(bits))
        reading.notes.append(
            f'link "{cut(name)}": its collisions have the bits {masks}; the link was given all of them'
        )
    together = 0
    for mask in bits:
        together |= mask
    return shapes, together if bits else ALL_BITS


def _pose_in_link(scope: Scope, element: ET.Element, link: str, place: str) -> np.ndarray:
    X_FG = pose_of(element, place, scope.reading)
    relative_to = frame_in_pose(element, link)
    if relative_to == link:
        return X_FG
    return inverse_pose(scope.X_SF(link, place)) @ scope.X_SF(relative_to, place) @ X_FG


def _bits(element: ET.Element, place: str, reading: Reading) -> int:
    text = text_of(element.find("surface/contact"), "collide_bitmask")
    if not text:
        return ALL_BITS
    try:
        bits = int(text, 0)
    except ValueError:
        bits = -1
    if not 0 <= bits <= ALL_BITS:
        reading.fail(place, f'<collide_bitmask> must be a whole number of 16 bits, got "{cut(text)}"')
    return bits


def _taken(element: ET.Element, place: str, reading: Reading) -> list[Taken]:
    geometry = element.find("geometry")
    children = [] if geometry is None else [child for child in geometry if isinstance(child.tag, str)]
    children = [child for child in children if not child.tag.startswith("{")]
    if len(children) != 1:
        reading.fail(place, f"<collision> needs <geometry> with one shape in it, found {len(children)}")
    thing = children[0]
    if thing.tag == "empty":
        return []
    if thing.tag in _UNREAD:
        reading.notes.append(f"{place}: <{thing.tag}>, {_UNREAD[thing.tag]}, is not read: it is NOT checked")
        return []
    if thing.tag == "mesh":
        return _mesh(thing, place, reading)
    try:
        shape, sizes = _primitive(thing, place, reading)
    except InvalidShape as error:
        raise InvalidShape(placed(error, reading.path, place)) from None
    if len(sizes):
        reading.note_size(float(max(sizes)), place)
    return [Taken(shape, None)]


def _primitive(element: ET.Element, place: str, reading: Reading) -> tuple[Shape, np.ndarray]:
    """A shape, and its lengths [m]."""

    def numbers(tag: str, count: int, default: str | None = None) -> np.ndarray:
        text = text_of(element, tag, default or "")
        if not text:
            reading.fail(place, f"<{element.tag}> needs <{tag}>")
        return reading.numbers(text, count, f"<{element.tag}> <{tag}>", place)

    if element.tag == "plane":  # without ends: <size> is what is drawn
        return Halfspace(numbers("normal", 3, "0 0 1"), 0.0), np.zeros(0)
    if element.tag == "box":
        return Box(size := numbers("size", 3)), size
    if element.tag == "ellipsoid":
        return Ellipsoid(radii := numbers("radii", 3)), radii
    if element.tag not in ("sphere", "capsule", "cylinder", "cone"):
        reading.fail(place, f"unknown shape <{cut(element.tag)}>; known are box, sphere, cylinder, capsule, cone, "
                     "ellipsoid, plane and mesh")
    radius = float(numbers("radius", 1)[0])
    if element.tag == "sphere":
        return Sphere(radius), np.array([radius])
    length = float(numbers("length", 1)[0])
    made = {"capsule": Capsule, "cylinder": Cylinder, "cone": Cone}[element.tag]
    return made(radius, length), np.array([radius, length])


def _mesh(element: ET.Element, place: str, reading: Reading) -> list[Taken]:
    uri = text_of(element, "uri") or text_of(element, "filename")
    if not uri:
        reading.fail(place, "<mesh> needs <uri>")
    scale = reading.numbers(text_of(element, "scale", "1 1 1"), 3, "<mesh> <scale>", place)
    submesh = element.find("submesh")
    if submesh is None:
        return reading.mesh_shapes(uri, scale, place)

    def meant(file: MeshFile) -> list[MeshPart]:
        wanted = text_of(submesh, "name")
        parts = [part for part in file.parts if part.name == wanted]
        if not parts:
            names = listing(part.name for part in file.parts)
            reading.fail(place, f'the mesh has no submesh "{cut(wanted)}"; it has {names}')
        return [_centred(part) for part in parts] if is_true(text_of(submesh, "center", "false")) else parts

    return reading.mesh_shapes(uri, scale, place, meant)


def _centred(part: MeshPart) -> MeshPart:
    """A part moved so that the middle of its bounding box is at the origin, as Gazebo moves it."""
    middle = 0.5 * (part.points.min(axis=0) + part.points.max(axis=0))
    if part.facets is not None:
        return replace(described(part.name, part.points - middle, part.facets), repairs=part.repairs)
    return replace(
        part, points=part.points - middle, pieces=part.pieces and [piece - middle for piece in part.pieces], made={}
    )
