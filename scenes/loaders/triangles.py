"""Mesh files as they are: vertices and facets, nothing joined, left out or put in order. Read by trimesh."""

from __future__ import annotations

import gzip
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from collide.errors import InvalidShape, MissingExtra, SceneError
from collide.scenes.loaders.files import read_bytes
from collide.shapes.mesh import Mesh

SUFFIXES = (".stl", ".obj", ".ply", ".dae", ".glb", ".gltf", ".off")


def read_triangles(path: Path) -> tuple[list[tuple[str, np.ndarray, np.ndarray]], list[str]]:
    """The meshes of a file by name, (n, 3) vertices in metres in the file's world frame and (m, 3) facets each, and notes.

    path : of a format in `SUFFIXES`, which may be packed (``.ply.gz``). Point clouds have no facets.
    Raises SceneError for what cannot be read, MissingExtra without the library that reads it.
    """
    packed = path.suffix.lower() == ".gz"
    inner = Path(path.stem) if packed else path
    suffix = inner.suffix.lower()
    if suffix not in SUFFIXES:
        raise SceneError(f"unknown mesh format {suffix!r}; known are {', '.join(SUFFIXES)}", path=path)
    try:
        import trimesh
    except ImportError:
        raise MissingExtra("trimesh", extra="robots", purpose=f"read the mesh {path.name}") from None
    options: dict[str, Any] = {"process": False}
    if suffix == ".obj":
        # Objects of the file are bodies; materials are not.
        options.update(split_objects=True, group_material=False, skip_materials=True)
    source: Any = str(path)
    if packed:
        source, options["file_type"] = BytesIO(_unpacked(path)), suffix[1:]
    try:
        loaded = trimesh.load_scene(source, **options)
        named = [(name, *loaded.graph.get(name)) for name in sorted(loaded.graph.nodes_geometry)]
    except ImportError as error:
        raise MissingExtra(error.name or "a mesh library", extra="robots", purpose=f"read the mesh {path.name}") from None
    except Exception as error:  # noqa: BLE001 - the readers of seven formats raise what they like
        raise SceneError(f"is not a mesh that can be read: {_one_line(error)}", path=path) from None
    metre = _metres(loaded.units)
    notes = [f"the file says its unit is {metre:g} m; it was scaled to metres"] if metre != 1.0 else []
    # by name: the graph keeps no order
    found = [(str(node), *_arrays(loaded.geometry[geometry], X_WG, metre)) for node, X_WG, geometry in named]
    return found, notes


def read_meshes(place: str | Path) -> list[tuple[str, Mesh]]:
    """Everything with facets in a mesh file, by name, as surfaces; SceneError where there is nothing."""
    path = Path(place)
    if not path.is_file():
        raise SceneError("no such file", path=path)
    parts = [(name, vertices, faces) for name, vertices, faces in read_triangles(path)[0] if len(faces)]
    if not parts:
        raise SceneError("has no facets", path=path)
    stem = path.name.split(".")[0]
    try:
        return [
            (stem if len(parts) == 1 else f"{stem}/{name}", Mesh(vertices, faces, solid=False))
            for name, vertices, faces in parts
        ]
    except InvalidShape as error:
        raise SceneError(str(error), path=path) from None


def _unpacked(path: Path) -> bytes:
    try:
        return gzip.decompress(read_bytes(path))
    except (OSError, EOFError, zlib.error) as error:
        raise SceneError(f"is not a gzip file that can be unpacked: {error}", path=path) from None


def _arrays(mesh, X_WG, metre: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) in the file's world frame and faces (m, 3) of a mesh or a point cloud."""
    X_WG = np.asarray(X_WG, dtype=np.float64)
    vertices = np.array(getattr(mesh, "vertices", np.zeros((0, 3))), dtype=np.float64).reshape(-1, 3)
    faces = np.array(getattr(mesh, "faces", np.zeros((0, 3))), dtype=np.int64).reshape(-1, 3)
    if not np.array_equal(X_WG, np.eye(4)):
        vertices = vertices @ X_WG[:3, :3].T + X_WG[:3, 3]
    return vertices * metre if metre != 1.0 else vertices, faces


def _metres(units) -> float:
    """Metres in a unit as trimesh names it: "meters", "0.0254 * meters", "millimeters", None."""
    words = str(units or "meters").replace("*", " ").split()
    factor = float(words[0]) if len(words) == 2 else 1.0
    named = {"meters": 1.0, "m": 1.0, "millimeters": 1e-3, "mm": 1e-3, "centimeters": 1e-2, "cm": 1e-2, "inches": 0.0254}
    return factor * named.get(words[-1], 1.0)


def _one_line(error: Exception) -> str:
    return (" ".join(str(error).split()) or type(error).__name__)[:200]
