"""Shapes as scene files write them: one key, the kind, and its numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from collide.errors import InvalidPose, InvalidShape, brief
from collide.scenes.loaders import mesh_file as mesh_loader
from collide.scenes.loaders.fields import Fields, did_you_mean, placed, read_pose, scaled
from collide.scenes.loaders.mesh_shapes import element_shapes, extent, mirrors
from collide.shapes import (
    Box,
    Capsule,
    Compound,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    HeightField,
    HPolytope,
    Mesh,
    Shape,
    Sphere,
)

#: kind -> its keys
KINDS = {
    "box": ("size",),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
    "cylinder": ("radius", "length"),
    "cone": ("radius", "length"),
    "ellipsoid": ("radii",),
    "halfspace": ("normal", "offset"),
    "hull": ("points", "radius"),
    "hpolytope": ("normals", "offsets", "bounded"),
    "heightfield": ("heights", "cell", "bottom"),
    "mesh": ("file", "scale", "as", "vertices", "faces", "solid"),
    "compound": ("shape", "pose"),
}


@dataclass
class Described:
    """A shape, what it leaves out of the thing described, and what there is to say about it."""

    shape: Shape
    approximation: str | None = None
    notes: list[str] = field(default_factory=list)


def read_shape(data: Any, path: object, place: str, metres: float, mesh: Callable) -> Described:
    """A shape mapping such as ``{box: {size: [1, 2, 3]}}``.

    metres : in a unit of length.   mesh : (file name, place, how it is taken or None) -> `MeshFile`.
    """
    kinds = Fields(data, path, place)
    unknown = [kind for kind in kinds.data if kind not in KINDS]
    if unknown or len(kinds.data) != 1:
        complaint = (
            f"unknown shape {brief(unknown[0])}{did_you_mean(unknown[0], KINDS)}"
            if unknown
            else f"needs one shape, got {brief(data)}"
        )
        kinds.fail(f"{complaint}; known shapes are {', '.join(KINDS)}")
    kind = next(iter(kinds.data))
    try:
        if kind == "compound":
            return _compound(kinds, metres, mesh)
        fields = kinds.sub(kind, KINDS[kind])
        if kind == "mesh":
            return _mesh(fields, mesh) if "file" in fields else Described(_mesh_in_place(fields, metres))
        return Described(_plain(kind, fields, metres))
    except InvalidShape as error:
        raise InvalidShape(_placed(error, path, f"{place}.{kind}")) from None
    except InvalidPose as error:
        raise InvalidPose(_placed(error, path, f"{place}.{kind}")) from None


def _placed(error: Exception, path: object, place: str) -> str:
    """The message with its place before it, once: shapes nest."""
    return str(error) if str(error).startswith(f"{path}: ") else placed(error, path, place)


def _plain(kind: str, fields: Fields, metres: float) -> Shape:
    def length(key: str, default: float | None = None) -> float:
        return float(scaled(fields.number(key, default), metres))

    if kind == "box":
        return Box(scaled(fields.numbers("size", (3,)), metres))
    if kind == "sphere":
        return Sphere(length("radius"))
    if kind == "capsule":
        return Capsule(length("radius"), length("length"))
    if kind == "cylinder":
        return Cylinder(length("radius"), length("length"))
    if kind == "cone":
        return Cone(length("radius"), length("length"))
    if kind == "ellipsoid":
        return Ellipsoid(scaled(fields.numbers("radii", (3,)), metres))
    if kind == "halfspace":
        return Halfspace(fields.numbers("normal", (3,)), length("offset"))
    if kind == "hull":
        return ConvexHull(scaled(fields.numbers("points", (None, 3)), metres), radius=length("radius", 0.0))
    if kind == "heightfield":
        heights, sides = scaled(fields.numbers("heights", (None, None)), metres), _cell(fields, metres)
        return HeightField(heights, sides, bottom=length("bottom") if "bottom" in fields else None)
    normals = fields.numbers("normals", (None, 3))
    offsets = scaled(fields.numbers("offsets", (None,)), metres)
    return HPolytope(normals, offsets, bounded=fields.flag("bounded", True))


def _cell(fields: Fields, metres: float) -> np.ndarray | float:
    """A number, or two of them."""
    if isinstance(fields.get("cell"), list):
        return scaled(fields.numbers("cell", (2,)), metres)
    return scaled(fields.number("cell"), metres)


def _compound(kinds: Fields, metres: float, mesh: Callable) -> Described:
    items, about, notes = [], [], []
    for entry, place in kinds.items("compound"):
        item = Fields(entry, kinds.path, place, KINDS["compound"])
        if "shape" not in item:
            item.fail("'shape' is missing")
        inner = read_shape(item.data["shape"], item.path, item.place("shape"), metres, mesh)
        items.append((inner.shape, read_pose(item, "pose", metres)))
        about += [inner.approximation] if inner.approximation else []
        notes += inner.notes
    approximation = f"{len(about)} of {len(items)} parts: " + "; ".join(about) if about else None
    return Described(Compound(items), approximation, notes)


def _mesh_in_place(fields: Fields, metres: float) -> Mesh:
    """Facets that stand in the scene file itself, taken as they are."""
    beside = [key for key in ("scale", "as") if key in fields]
    if beside or "vertices" not in fields or "faces" not in fields:
        fields.fail(
            f"{beside[0]!r} goes with a file" if beside else "give either file, or vertices and faces"
        )
    vertices, faces = scaled(fields.numbers("vertices", (None, 3)), metres), fields.numbers("faces", (None, 3))
    if (faces != np.round(faces)).any():
        fields.fail("must be whole numbers, rows of vertices", "faces")
    return Mesh(vertices, faces.astype(np.int64), solid=fields.flag("solid", False) if "solid" in fields else None)


def _mesh(fields: Fields, mesh: Callable) -> Described:
    beside = [key for key in ("vertices", "faces", "solid") if key in fields]
    if beside:
        fields.fail(f"{beside[0]!r} stands in place of a file: give one of them")
    scale = _mesh_scale(fields)
    taken = fields.choice("as", mesh_loader.OPTIONS, "mesh") if "as" in fields else None
    file = mesh(fields.text("file"), fields.place("file"), taken)
    shapes = element_shapes(file, scale, f"{fields.path}: {fields.element}")
    about = [approximation for _, approximation in shapes if approximation]
    note = mesh_loader.size_note(extent(file, scale), fields.element)
    notes = [note] if note else []
    if mirrors(scale):
        notes.append(f"{fields.element}: the scale {scale.tolist()} mirrors; the mesh was mirrored")
    if len(shapes) == 1:
        return Described(shapes[0][0], about[0] if about else None, notes)
    return Described(Compound([(shape, np.eye(4)) for shape, _ in shapes]), "; ".join(about) or None, notes)


def _mesh_scale(fields: Fields) -> np.ndarray:
    if isinstance(fields.get("scale"), list):
        scale = fields.numbers("scale", (3,))
    else:
        scale = np.full(3, fields.number("scale", 1.0))
    if not scale.all():
        fields.fail(f"must not be 0, got {brief(fields.get('scale'))}", "scale")
    return scale
