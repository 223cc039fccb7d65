"""Scenes written down as scene files (docs/scene-format.md): `load` reads back the same doubles.

Meshes and clouds stand in the file itself, so that one file holds all there is to know. Robots are written as the
bodies that their links are, where they stand now; their joints are left out, and `about` may say so.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from collide.base import argument_checks as checks
from collide.base.whole_file import write_whole
from collide.errors import SceneError
from collide.scenes.description import Scene
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
    Plane,
    PointCloud,
    Shape,
    Sphere,
    VoxelGrid,
)
from collide.worlds.world import World

VERSION = 1
#: Of groups and masks in scene files.
BITS = 0xFFFF


def save(scene, path, *, about: str | Mapping[str, Any] | None = None) -> None:
    """Write a scene, or a World, as a scene file in JSON.

    Parameters
    ----------
    scene : Scene or World
        Bodies with shapes and poses, groups and masks, and pairs never tested. Of a robot the bodies are written, at
        the poses they have; joints are not.
    path : str or Path
        The file, ending in .json; one that exists is overwritten, and never left half written.
    about : str or mapping, optional
        A remark for the file's ``about``, which nobody reads back.

    Raises
    ------
    SceneError
        Where the file does not end in .json, a shape has no form in scene files, or a group has more than 16 bits.
    OSError
        Where it cannot be written.
    """
    path = checks.file_path("save: path", path, SceneError)
    if about is not None and not isinstance(about, str):
        checks.mapping("save: about", about, "plain data, or a text", SceneError)
    if path.suffix.lower() != ".json":
        raise SceneError(f"save: path must end in .json, got {checks.brief(str(path))}")
    document = scene_document(*_bodies_and_allowed(scene), name=getattr(scene, "name", "") or path.stem, about=about)
    write_whole(path, document_text(document))


def scene_document(
    bodies: Iterable, allowed: Iterable[tuple] = (), *, name: str = "", about: str | Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """A scene file as plain data.

    bodies : with ``name``, ``shape``, ``X_WB`` (4, 4) [m], ``static``, ``group`` and ``mask``.
    allowed : (name, name) or (name, name, reason).
    """
    document: dict[str, Any] = {"collide": VERSION}
    document |= {"name": name} if name else {}
    document |= {"about": about} if about else {}
    document["bodies"] = [_body(body) for body in bodies]
    pairs = [[str(word) for word in pair] for pair in allowed]
    return document | ({"allow": pairs} if pairs else {})


def document_text(document: Mapping[str, Any]) -> str:
    """A scene document as JSON: one body a line, every double in the shortest digits that give it back."""
    lines = []
    for key, value in document.items():
        if key == "bodies":
            bodies = ",\n    ".join(json.dumps(body, allow_nan=False) for body in value)
            lines.append(f'  "bodies": [\n    {bodies}\n  ]' if value else '  "bodies": []')
        else:
            text = json.dumps(value, allow_nan=False, indent=2 if isinstance(value, Mapping) else None)
            lines.append(f"  {json.dumps(key)}: " + text.replace("\n", "\n  "))
    return "{\n" + ",\n".join(lines) + "\n}\n"


def shape_document(shape: Shape) -> dict[str, Any]:
    """A shape as scene files write it: one key, its kind. Raises SceneError for one that has no such form."""
    if isinstance(shape, Compound):
        return {"compound": [{"shape": shape_document(part), "pose": _pose(X)} for part, X in shape.items]}
    if isinstance(shape, VoxelGrid):
        grid = {"cells": _plain(shape.cells), "cell": _plain(shape.cell)}
        return {"voxels": grid if np.array_equal(shape.X, np.eye(4)) else grid | {"pose": _pose(shape.X)}}
    for kind, name, fields in _FORMS:
        if type(shape) is kind:
            return {name: {key: _plain(getattr(shape, field)) for key, field in fields.items()}}
    raise SceneError(f"a {type(shape).__name__} has no form in scene files")


#: Class, the key in scene files, and its keys with the attributes that they are.
_FORMS: tuple[tuple[type[Shape], str, dict[str, str]], ...] = (
    (Box, "box", {"size": "size"}),
    (Sphere, "sphere", {"radius": "radius"}),
    (Capsule, "capsule", {"radius": "radius", "length": "length"}),
    (Cylinder, "cylinder", {"radius": "radius", "length": "length"}),
    (Cone, "cone", {"radius": "radius", "length": "length"}),
    (Ellipsoid, "ellipsoid", {"radii": "radii"}),
    (Halfspace, "halfspace", {"normal": "normal", "offset": "offset"}),
    (ConvexHull, "hull", {"points": "points", "radius": "radius"}),
    (Plane, "plane", {"normal": "normal", "offset": "offset", "thickness": "thickness"}),
    (HPolytope, "hpolytope", {"normals": "normals", "offsets": "offsets", "bounded": "bounded"}),
    (HeightField, "heightfield", {"heights": "heights", "cell": "cell", "bottom": "bottom"}),
    (Mesh, "mesh", {"vertices": "vertices", "faces": "faces", "solid": "solid"}),
    (PointCloud, "cloud", {"points": "points", "radius": "radius"}),
)


def _bodies_and_allowed(scene) -> tuple[list, list[tuple]]:
    if isinstance(scene, Scene):
        return list(scene.bodies), list(scene.allowed)
    checks.instance("save: scene", scene, World, "a Scene or a World")
    bodies = [scene.body(i) for i in scene.ids]
    names = {body.id: body.name for body in bodies}
    allowed = scene._allowed  # pairs of ids; the World shows them nowhere else
    return bodies, [(names[a], names[b], *reason) for a, b, *reason in allowed if a in names and b in names]


def _body(body) -> dict[str, Any]:
    item: dict[str, Any] = {"name": str(body.name), "shape": shape_document(body.shape)}
    if not np.array_equal(body.X_WB, np.eye(4)):
        item["pose"] = _pose(body.X_WB)
    item |= {"static": True} if body.static else {}
    if body.group > BITS:
        raise SceneError(f'body "{body.name}": scene files have groups of 16 bits, got {body.group:#x}')
    mask = int(body.mask) & BITS  # no group has higher ones
    item |= {"group": int(body.group)} if body.group != 1 else {}
    return item | ({"mask": mask} if mask != BITS else {})


def _pose(X: np.ndarray) -> dict[str, Any]:
    """Only a translation, or the matrix as it stands: rotations are not rounded."""
    if np.array_equal(X[:3, :3], np.eye(3)):
        return {"xyz": _plain(X[:3, 3])}
    return {"matrix": _plain(X)}


def _plain(value) -> Any:
    """Numbers and lists of them; holes of a height field are null."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "f" and np.isnan(value).any():
        return [[None if np.isnan(number) else number for number in row] for row in value.tolist()]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value
