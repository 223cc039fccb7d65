"""Shapes as scene files write them: one key, the kind, and its numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from collide.errors import InvalidPose, InvalidShape, brief
from collide.scenes.loaders import mesh_file as mesh_loader
from collide.scenes.loaders.cloud_file import read_cloud
from collide.scenes.loaders.fields import Fields, did_you_mean, placed, read_pose, scaled
from collide.scenes.loaders.mesh_parts import MeshFile
from collide.scenes.loaders.mesh_shapes import element_shapes, extent
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
    OcTree,
    Plane,
    PointCloud,
    Shape,
    Sphere,
    VoxelGrid,
)
from collide.shapes.shape import mirrors

#: kind -> its keys
KINDS = {
    "box": ("size",),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
    "cylinder": ("radius", "length"),
    "cone": ("radius", "length"),
    "ellipsoid": ("radii",),
    "halfspace": ("normal", "offset"),
    "plane": ("normal", "offset", "thickness"),
    "hull": ("points", "radius"),
    "hpolytope": ("normals", "offsets", "bounded"),
    "heightfield": ("heights", "cell", "bottom"),
    "mesh": ("file", "scale", "as", "vertices", "faces", "solid"),
    "cloud": ("points", "radius", "file", "scale", "drop_invalid"),
    "voxels": ("cells", "cell", "pose", "file", "threshold", "unknown"),
    "compound": ("shape", "pose"),
}


@dataclass
class Described:
    """A shape, what it leaves out of the thing described, and what there is to say about it."""

    shape: Shape
    approximation: str | None = None
    notes: list[str] = field(default_factory=list)


class Files(NamedTuple):
    """How files are read that shapes name. mesh : (file name, place, how it is taken or None) -> `MeshFile`.

    find : (file name, place) -> where the file is.
    """

    mesh: Callable[..., MeshFile]
    find: Callable[[str, str], Path]


def read_shape(data: Any, path: object, place: str, metres: float, files: Files) -> Described:
    """A shape mapping such as ``{box: {size: [1, 2, 3]}}``. metres : in a unit of length."""
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
            return _compound(kinds, metres, files)
        fields = kinds.sub(kind, KINDS[kind])
        if kind == "mesh":
            return _mesh(fields, files) if "file" in fields else Described(_mesh_in_place(fields, metres))
        if kind == "cloud":
            return _cloud(fields, metres, files)
        if kind == "voxels":
            return Described(_voxels(fields, metres, files))
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
    if kind == "plane":
        return Plane(fields.numbers("normal", (3,)), length("offset"), length("thickness", 0.0))
    if kind == "hull":
        return ConvexHull(scaled(fields.numbers("points", (None, 3)), metres), radius=length("radius", 0.0))
    if kind == "heightfield":
        heights = scaled(_heights(fields), metres)
        sides = _one_or_each(fields, "cell", (2,), metres)
        return HeightField(heights, sides, bottom=length("bottom") if "bottom" in fields else None)
    normals = fields.numbers("normals", (None, 3))
    offsets = scaled(fields.numbers("offsets", (None,)), metres)
    return HPolytope(normals, offsets, bounded=fields.flag("bounded", True))


def _one_or_each(fields: Fields, key: str, shape: tuple[int | None, ...], metres: float) -> np.ndarray | float:
    """A length for all, or a list with a length each."""
    if isinstance(fields.get(key), list):
        return scaled(fields.numbers(key, shape), metres)
    return scaled(fields.number(key), metres)


def _compound(kinds: Fields, metres: float, files: Files) -> Described:
    items, about, notes = [], [], []
    for entry, place in kinds.items("compound"):
        item = Fields(entry, kinds.path, place, KINDS["compound"])
        if "shape" not in item:
            item.fail("'shape' is missing")
        inner = read_shape(item.data["shape"], item.path, item.place("shape"), metres, files)
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


def _mesh(fields: Fields, files: Files) -> Described:
    beside = [key for key in ("vertices", "faces", "solid") if key in fields]
    if beside:
        fields.fail(f"{beside[0]!r} stands in place of a file: give one of them")
    scale = _mesh_scale(fields)
    taken = mesh_loader.meshes_option(fields, "as", "mesh") if "as" in fields else None
    file = files.mesh(fields.text("file"), fields.place("file"), taken)
    shapes = element_shapes(file, scale, f"{fields.path}: {fields.element}")
    about = [approximation for _, approximation in shapes if approximation]
    note = mesh_loader.size_note(extent(file, scale), fields.element)
    notes = [note] if note else []
    if mirrors(scale):
        notes.append(f"{fields.element}: the scale {scale.tolist()} mirrors; the mesh was mirrored")
    if len(shapes) == 1:
        return Described(shapes[0][0], about[0] if about else None, notes)
    return Described(Compound([(shape, np.eye(4)) for shape, _ in shapes]), "; ".join(about) or None, notes)


def _cloud(fields: Fields, metres: float, files: Files) -> Described:
    """Points that stand in the scene file itself, or in a file of their own."""
    radius = _one_or_each(fields, "radius", (None,), metres) if "radius" in fields else None
    if "file" not in fields:
        beside = [key for key in ("scale", "drop_invalid") if key in fields]
        if beside or "points" not in fields:
            fields.fail(f"{beside[0]!r} goes with a file" if beside else "give either points, or a file")
        points = scaled(fields.numbers("points", (None, 3)), metres)
        return Described(PointCloud(points, 0.0 if radius is None else radius))
    if "points" in fields:
        fields.fail("'points' stands in place of a file: give one of them")
    scale = fields.scale()
    if not scale > 0.0:
        fields.fail(f"must be above 0, got {scale:g}", "scale")
    path = files.find(fields.text("file"), fields.place("file"))
    cloud = read_cloud(path, radius, scale, drop_invalid=fields.flag("drop_invalid", False))
    about = mesh_loader.size_note(float(np.ptp(cloud.points, axis=0).max()), fields.element)
    left_out = f"{path.name}: {cloud.dropped} points that are not finite were left out" if cloud.dropped else None
    return Described(cloud, notes=[note for note in (left_out, about) if note])


def _heights(fields: Fields) -> np.ndarray:
    """Rows of heights, in which null is a hole."""
    table = fields.get("heights")
    is_table = isinstance(table, list) and all(isinstance(row, list) for row in table)
    if not is_table or not any(None in row for row in table):
        return fields.numbers("heights", (None, None))
    holes = [[value is None for value in row] for row in table]
    filled = [[0.0 if value is None else value for value in row] for row in table]
    heights = Fields({"heights": filled}, fields.path, fields.element).numbers("heights", (None, None)).copy()
    heights[np.array(holes)] = np.nan
    return heights


def _voxels(fields: Fields, metres: float, files: Files) -> Shape:
    """Cells that stand in the scene file itself, or a map in a file of its own."""
    if "file" in fields:
        beside = [key for key in ("cells", "cell") if key in fields]
        if beside:
            fields.fail(f"{beside[0]!r} stands in place of a file: give one of them")
        path, X = files.find(fields.text("file"), fields.place("file")), read_pose(fields, "pose", metres)
        options = {key: fields.get(key) for key in ("threshold", "unknown") if key in fields}
        if path.suffix.lower() != ".binvox":
            return OcTree.from_file(path, X=X, **options)
        if options or "pose" in fields:
            fields.fail("a .binvox file says where it stands, and which cells are occupied: give the file alone")
        return VoxelGrid.from_file(path)
    beside = [key for key in ("threshold", "unknown") if key in fields]
    if beside:
        fields.fail(f"{beside[0]!r} goes with a file")
    cells = fields.numbers("cells", (None, 3))
    if (cells != np.round(cells)).any() or np.abs(cells).max(initial=0.0) >= 2.0**53:
        fields.fail(f"must be whole numbers, got {brief(fields.get('cells'))}", "cells")
    sides = _one_or_each(fields, "cell", (3,), metres)
    return VoxelGrid(cells.astype(np.int64), sides, read_pose(fields, "pose", metres))


def _mesh_scale(fields: Fields) -> np.ndarray:
    if isinstance(fields.get("scale"), list):
        scale = fields.numbers("scale", (3,))
    else:
        scale = np.full(3, fields.scale())
    if not scale.all():
        fields.fail(f"must not be 0, got {brief(fields.get('scale'))}", "scale")
    return scale
