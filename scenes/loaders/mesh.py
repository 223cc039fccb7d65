"""Meshes as convex shapes: the hull of the vertices, or a union of convex pieces.

A mesh is read once by trimesh and kept as arrays (`collide.scenes.cache`); afterwards neither
trimesh nor scipy is imported. What the shape leaves out of the mesh is said for every body.
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from collide.errors import InvalidShape, MissingExtra, SceneError
from collide.scenes import cache
from collide.scenes.loaders.documents import read_bytes
from collide.scenes.loaders.triangles import SUFFIXES, read_triangles
from collide.shapes.base import Shape
from collide.shapes.compound import Compound
from collide.shapes.hull import ConvexHull

#: A mesh whose volume is this much of its hull's is its hull.
CONVEX_RATIO = 1.0 - 1e-6


@dataclass
class MeshPart:
    """One mesh of a file.

    points : (n, 3) distinct vertices that faces use, in the file's world frame and units.
    fill : volume of the mesh over the volume of its hull; NaN where it has none (open, or scipy is absent).
    closed : watertight, with consistent winding.
    faces : how many triangles.
    pieces : the convex pieces as point sets, where a decomposition was asked for.
    """

    name: str
    points: np.ndarray
    fill: float
    closed: bool
    faces: int
    pieces: list[np.ndarray] | None = None


@dataclass
class MeshFile:
    """The parts of a mesh file, and what its reader wants to say."""

    parts: list[MeshPart]
    notes: list[str]


def read_mesh(path: Path, meshes: str = "hull") -> MeshFile:
    """The meshes of a file, from the cache of prepared inputs or through trimesh.

    meshes : "hull", or "pieces" for a convex decomposition of every mesh.
    """
    check_meshes_option(meshes)
    if path.suffix.lower() not in SUFFIXES:
        raise SceneError(f"unknown mesh format {path.suffix!r}; known are {', '.join(SUFFIXES)}", path=path)
    blobs = [read_bytes(path)]
    if path.suffix.lower() == ".gltf":
        blobs += _gltf_buffers(blobs[0], path)
    # Without scipy a volume is unknown; once it is installed the mesh is looked at again.
    known = importlib.util.find_spec("scipy") is not None
    entry = cache.key(blobs, {"meshes": meshes, "suffix": path.suffix.lower(), "volumes": known})
    file = _kept(entry)
    if file is None:
        file, raw = _read_with_trimesh(path)
        if meshes == "pieces":
            for part, (vertices, faces) in zip(file.parts, raw):
                part.pieces = _decompose(vertices, faces, path)
        cache.store(entry, _pack(file))
    # The entry knows the bytes alone: a file of the same bytes may have another name.
    if len(file.parts) == 1:
        file.parts[0].name = path.stem
    file.notes = [f"{path.name}: {note}" for note in file.notes]
    return file


def _kept(entry: str) -> MeshFile | None:
    arrays = cache.fetch(entry)
    try:
        return None if arrays is None else _unpack(arrays)
    except (KeyError, ValueError, TypeError, IndexError):
        return None  # made by something else: read the file again


def mesh_shape(part: MeshPart, scale, place: str) -> tuple[Shape, str | None]:
    """A part as a shape, and what the shape leaves out of it (None: nothing).

    scale : (3,) factors; negative ones mirror.   place : for messages.
    """
    factors = np.broadcast_to(np.asarray(scale, dtype=np.float64), (3,))
    try:
        if part.pieces is not None:
            shape: Shape = _union([ConvexHull(points * factors) for points in part.pieces])
            return shape, _about_pieces(part)
        return ConvexHull(part.points * factors), _about_hull(part)
    except InvalidShape as error:
        raise InvalidShape(f"{place}: {error}") from None


def element_parts(file: MeshFile) -> list[MeshPart]:
    """The parts of a file that stands for one thing, such as a link.

    Closed meshes stay apart: the union of their hulls is nearer to them than one hull. Open ones may
    be patches of one surface, whose hulls would leave out the inside: they become one point set.
    """
    parts = file.parts
    if len(parts) == 1 or all(part.closed for part in parts) or parts[0].pieces is not None:
        return parts
    points = _distinct(np.concatenate([part.points for part in parts]))
    return [MeshPart(parts[0].name, points, np.nan, False, sum(part.faces for part in parts))]


def check_meshes_option(meshes: str) -> None:
    if meshes not in ("hull", "pieces"):
        raise SceneError(f'meshes must be "hull" or "pieces", got {meshes!r}')


def size_note(extent: float, what: str) -> str | None:
    """A note where something is so large or small that its unit may be wrong. extent : [m]."""
    if extent > 100.0:
        return f"{what} is {extent:g} m across: is it in millimetres? A scale of 0.001 would make it {extent / 1000:g} m"
    if 0.0 < extent < 1e-5:
        return f"{what} is {extent:g} m across: is its unit right?"
    return None


def _union(hulls: list[ConvexHull]) -> Shape:
    return hulls[0] if len(hulls) == 1 else Compound([(hull, np.eye(4)) for hull in hulls])


def _about_hull(part: MeshPart) -> str | None:
    hull = f"hull of {len(part.points)} vertices"
    if not part.faces:
        return f"{hull} without faces"
    if not part.closed:
        return f"{hull} of an open mesh"
    if np.isnan(part.fill):
        return f"{hull} of a closed mesh"
    if part.fill >= CONVEX_RATIO:
        return None
    extra = (1.0 / part.fill - 1.0) * 100.0
    amount = f"{extra:.0f}" if extra >= 10 else f"{extra:.2g}"
    return f"{hull}, fills {amount} % more volume"


def _about_pieces(part: MeshPart) -> str | None:
    pieces = part.pieces or []
    if len(pieces) == 1 and part.closed and part.fill >= CONVEX_RATIO:
        return None
    return f"{len(pieces)} convex pieces of a mesh of {len(part.points)} vertices (coacd)"


# --- reading ------------------------------------------------------------------------------------


def _read_with_trimesh(path: Path) -> tuple[MeshFile, list[tuple[np.ndarray, np.ndarray]]]:
    found, notes = read_triangles(path)
    import trimesh  # what is missing has been told by now

    parts, raw = [], []
    for name, vertices, faces in found:
        if len(vertices):
            part, about = _describe(trimesh, name, vertices, faces, path)
            parts.append(part)
            raw.append((vertices, faces))
            notes += about
    if not parts:
        raise SceneError("has no vertices; a mesh needs at least one", path=path)
    return MeshFile(parts, notes), raw


def _describe(trimesh, label: str, vertices: np.ndarray, faces: np.ndarray, path: Path) -> tuple[MeshPart, list[str]]:
    if not np.isfinite(vertices).all():
        row = int(np.argmax(~np.isfinite(vertices).all(axis=1)))
        raise SceneError(f"vertex {row} is {vertices[row].tolist()}: coordinates must be finite", path=path)
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise SceneError(f"a face names vertex {faces.max()}, but there are {len(vertices)}", path=path)
    notes = []
    used = np.unique(faces) if len(faces) else np.arange(len(vertices))
    if len(used) < len(vertices):
        notes.append(f"{len(vertices) - len(used)} vertices that no face uses were left out")
    if not len(faces):
        notes.append("has points but no faces; their hull was taken")
    closed, fill = _volumes(trimesh, vertices, faces)
    return MeshPart(label, _distinct(vertices[used]), fill, closed, len(faces)), notes


def _distinct(vertices: np.ndarray) -> np.ndarray:
    """Every point once, in the order of first appearance; −0.0 and 0.0 are one number."""
    _, first = np.unique(vertices + 0.0, axis=0, return_index=True)
    return np.ascontiguousarray(vertices[np.sort(first)] + 0.0)


def _volumes(trimesh, vertices: np.ndarray, faces: np.ndarray) -> tuple[bool, float]:
    """Whether the mesh is closed, and its volume over that of its hull (NaN where unknown)."""
    if len(faces) < 4:
        return False, np.nan
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.merge_vertices()
    if not (mesh.is_watertight and mesh.is_winding_consistent):
        return False, np.nan
    try:
        hull = float(mesh.convex_hull.volume)
    except Exception:  # noqa: BLE001 - scipy absent, or Qhull refusing a flat mesh: the figure is a courtesy
        return True, np.nan
    return True, min(1.0, abs(float(mesh.volume)) / hull) if hull > 0 else np.nan


def _decompose(vertices: np.ndarray, faces: np.ndarray, path: Path) -> list[np.ndarray]:
    """Convex pieces by coacd, each the points of a hull."""
    if len(faces) < 4:
        return [_distinct(vertices)]
    try:
        import coacd
    except ImportError:
        raise MissingExtra("coacd", extra="decompose", purpose=f"cut {path.name} into convex pieces") from None
    coacd.set_log_level("error")
    pieces = coacd.run_coacd(coacd.Mesh(vertices, faces), seed=0)
    pieces = [np.unique(np.asarray(points, dtype=np.float64), axis=0) for points, _ in pieces if len(points)]
    if not pieces:
        raise SceneError("the convex decomposition found no piece; use its hull instead", path=path)
    return pieces


def _gltf_buffers(blob: bytes, path: Path) -> list[bytes]:
    """The files a glTF text refers to: they are part of it, for the cache."""
    try:
        buffers = json.loads(blob).get("buffers", [])
        names = [str(buffer["uri"]) for buffer in buffers if "uri" in buffer]
    except (ValueError, AttributeError, TypeError, KeyError):
        raise SceneError("is not glTF: its text is not JSON with a list of buffers", path=path) from None
    return [read_bytes(path.parent / name) for name in names if not name.startswith("data:")]


# --- arrays for the cache -------------------------------------------------------------------------


def _pack(file: MeshFile) -> dict[str, np.ndarray]:
    """A mesh file as arrays; texts as one JSON string, since the cache holds no objects."""
    about: dict[str, Any] = {"notes": file.notes, "parts": []}
    arrays: dict[str, np.ndarray] = {}
    for k, part in enumerate(file.parts):
        fill = None if np.isnan(part.fill) else part.fill
        pieces = None if part.pieces is None else len(part.pieces)
        about["parts"].append(
            {"name": part.name, "fill": fill, "closed": bool(part.closed), "faces": part.faces, "pieces": pieces}
        )
        arrays[f"points{k}"] = part.points
        for j, points in enumerate(part.pieces or []):
            arrays[f"piece{k}_{j}"] = points
    arrays["about"] = np.array(json.dumps(about))
    return arrays


def _unpack(arrays: Mapping[str, np.ndarray]) -> MeshFile:
    about = json.loads(str(arrays["about"]))
    parts = []
    for k, text in enumerate(about["parts"]):
        pieces = None if text["pieces"] is None else [_points(arrays[f"piece{k}_{j}"]) for j in range(text["pieces"])]
        fill = np.nan if text["fill"] is None else float(text["fill"])
        parts.append(MeshPart(text["name"], _points(arrays[f"points{k}"]), fill, text["closed"], text["faces"], pieces))
    return MeshFile(parts, list(about["notes"]))


def _points(array: np.ndarray) -> np.ndarray:
    if array.dtype != np.float64 or array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise ValueError("not an array of points")
    return array
