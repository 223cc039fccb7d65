"""3MF: the objects of a package, as its build places them, in metres; colours and settings of printers are not read."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
import zipfile
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import numpy as np

from collide.base.given_files import LARGEST_MESH
from collide.errors import SceneError, brief
from collide.scenes.loaders.files import DEEPEST, MAX_NODES, MAX_PLACED
from collide.scenes.loaders.polygons import Part, Read, check_ids, numbers, refuse

_CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
_MODEL = "3D/3dmodel.model"
_RELATIONS, _MODEL_TYPE = "_rels/.rels", "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_METRES = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}


def read(content: bytes, path: Path) -> Read:
    """One part for each mesh that the build places; SceneError for what is damaged, with element and value."""
    root = _model(content, path)
    unit = root.get("unit", "millimeter")
    if unit not in _METRES:
        refuse(path, f"its unit must be one of {', '.join(_METRES)}, got {brief(unit)}")
    objects = {entry.get("id"): entry for entry in root.iter(f"{_CORE}object")}
    meshes: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    parts: list[Part] = []
    n_facets = 0
    for name, mesh, X in _placed(root, objects, path):
        if name not in meshes:
            meshes[name] = _mesh(mesh, name, path)
        vertices, faces = meshes[name]
        n_facets += len(faces)
        if n_facets > MAX_PLACED or len(parts) > MAX_NODES:
            refuse(path, f"its build places more than {MAX_PLACED:,} facets or {MAX_NODES:,} objects")
        if not np.array_equal(X, np.eye(4)):
            with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused with its row
                vertices = vertices @ X[:3, :3].T + X[:3, 3]
            if np.linalg.det(X[:3, :3]) < 0.0:
                faces = faces[:, ::-1]
        parts.append(Part(objects[name].get("name") or f"object {name}", vertices * _METRES[unit], faces))
    note = [] if unit == "meter" else [f"the file says its unit is {unit}; it was scaled to metres"]
    return Read(parts, note)


def _model(content: bytes, path: Path) -> ET.Element:
    """The outermost element of the package's model."""
    try:
        with zipfile.ZipFile(BytesIO(content)) as members:
            name = _MODEL
            if _RELATIONS in members.namelist():
                for relation in ET.fromstring(_unpacked(members, _RELATIONS, path)):
                    if relation.get("Type") == _MODEL_TYPE:
                        name = (relation.get("Target") or "").lstrip("/")
            if name not in members.namelist():
                refuse(path, f"is no 3MF: the package has no {brief(name)}")
            root = ET.fromstring(_unpacked(members, name, path))
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError) as error:
        raise SceneError(f"is no 3MF: it is not a package that can be unpacked: {error}", path=path) from None
    except (ET.ParseError, ValueError, LookupError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"its model is not well-formed XML: {error}", path=path) from None
    if root.tag != f"{_CORE}model":
        refuse(path, f"its model begins with <{brief(root.tag)}>, not with <model> of 3MF")
    return root


def _unpacked(members: zipfile.ZipFile, name: str, path: Path) -> bytes:
    """A member, as far as a mesh may be large, whatever size it says."""
    with members.open(name) as file:
        content = file.read(LARGEST_MESH + 1)
    if len(content) > LARGEST_MESH:
        refuse(path, f"{name} unpacks to more than {LARGEST_MESH >> 20} MiB, the most that is read of a mesh")
    return content


def _placed(root: ET.Element, objects: dict, path: Path) -> Iterator[tuple[str, ET.Element, np.ndarray]]:
    """(id of an object, its mesh, its pose and scale in the build) of every mesh placed."""
    build = root.find(f"{_CORE}build")
    waiting = [(item, np.eye(4), 0) for item in reversed(list(build if build is not None else ()))]
    n_nodes = 0
    while waiting:
        place, X, depth = waiting.pop()
        n_nodes += 1
        id = place.get("objectid") or ""
        if depth > DEEPEST or n_nodes > MAX_NODES:
            refuse(path, f"object {brief(id)} stands within itself, or {MAX_NODES:,} are placed")
        if any(key.endswith("}path") for key in place.attrib):
            refuse(path, f"object {brief(id)} is in another file of the package, which is not read: export it as one")
        if id not in objects:
            refuse(path, f"<{place.tag.rsplit('}', 1)[-1]}> names object {brief(id)}, which the file does not have")
        X = X @ _transform(place.get("transform"), id, path)
        mesh = objects[id].find(f"{_CORE}mesh")
        if mesh is not None:
            yield id, mesh, X
        parts = objects[id].findall(f"{_CORE}components/{_CORE}component")
        waiting += [(part, X, depth + 1) for part in reversed(parts)]


def _transform(text: str | None, id, path: Path) -> np.ndarray:
    """(4, 4) of twelve numbers, rows of a matrix that vectors stand before."""
    X = np.eye(4)
    if text is not None:
        try:
            entries = [float(word) for word in text.split()]
        except ValueError:
            entries = []
        if len(entries) != 12 or not all(map(math.isfinite, entries)):
            refuse(path, f"the transform of object {brief(id)} must be 12 finite numbers, got {brief(text)}")
        X[:3] = np.array(entries).reshape(4, 3).T
    return X


def _mesh(mesh: ET.Element, name: str, path: Path) -> tuple[np.ndarray, np.ndarray]:
    vertices = mesh.findall(f"{_CORE}vertices/{_CORE}vertex")
    triangles = mesh.findall(f"{_CORE}triangles/{_CORE}triangle")
    points = _numbers(vertices, ("x", "y", "z"), name, path)
    corners = _numbers(triangles, ("v1", "v2", "v3"), name, path)
    check_ids(corners.ravel(), np.full(len(triangles), 3), len(points), 0, None, path)
    if (corners != np.floor(corners)).any():
        k = int(np.argmax((corners != np.floor(corners)).any(axis=1)))
        refuse(path, f"triangle {k} of object {brief(name)} names vertices by whole numbers, got {corners[k].tolist()}")
    return points, corners.astype(np.int64)


def _numbers(elements: list[ET.Element], keys: tuple[str, ...], name: str, path: Path) -> np.ndarray:
    """(n, 3) finite numbers of elements' attributes."""
    values = numbers([(element.get(key) or "").encode() for element in elements for key in keys])
    if values is None or not np.isfinite(values).all():
        for k, element in enumerate(elements):
            row = numbers([(element.get(key) or "").encode() for key in keys])
            if row is None or not np.isfinite(row).all():
                kind, got = element.tag.rsplit("}", 1)[-1], [element.get(key) for key in keys]
                what = f"{kind} {k} of object {brief(name)}"
                refuse(path, f"{what} needs finite numbers {', '.join(keys)}, got {brief(got)}")
    assert values is not None
    return values.reshape(-1, 3)
