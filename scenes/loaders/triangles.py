"""Mesh files as they are: vertices and facets, nothing joined, left out or put in order.

STL, OBJ, PLY, OFF and 3MF are read here, strictly: a count, an id or a number that is wrong is told with its line.
COLLADA and glTF are checked here, and read by pycollada and trimesh. What a file holds must be what its name says.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np

from collide.errors import InvalidShape, MissingExtra, SceneError, cut
from collide.scenes.loaders import dae, gltf, obj, off, ply, stl, threemf
from collide.scenes.loaders.content_formats import refuse_another_format
from collide.scenes.loaders.files import MAX_PLACED, read_mesh_bytes
from collide.scenes.loaders.polygons import Part, Read
from collide.shapes.mesh import Mesh

_READERS: dict[str, Callable[[bytes, Path], Read]] = {
    ".stl": stl.read,
    ".obj": obj.read,
    ".ply": ply.read,
    ".off": off.read,
    ".3mf": threemf.read,
}
SUFFIXES = (".stl", ".obj", ".ply", ".dae", ".glb", ".gltf", ".off", ".3mf")


class MeshBytes(NamedTuple):
    """A mesh file that was opened: its suffix without .gz, its bytes unpacked, and the parts of a glTF."""

    path: Path
    suffix: str
    content: bytes
    gltf: gltf.Source | None = None

    @property
    def blobs(self) -> list[bytes]:
        """Everything that the meshes are made from, for the cache."""
        return [self.content, *(self.gltf.files.values() if self.gltf is not None else ())]


def open_mesh(path: Path) -> MeshBytes:
    """The bytes of a mesh file, unpacked (``.ply.gz``); SceneError where it is no file, or too large."""
    inner = Path(path.stem).suffix.lower() if path.suffix.lower() == ".gz" else path.suffix.lower()
    if inner not in SUFFIXES:
        raise SceneError(f"unknown mesh format {cut(inner)!r}; known are {', '.join(SUFFIXES)}", path=path)
    suffix, content = read_mesh_bytes(path)
    refuse_another_format(content, suffix, path)
    return MeshBytes(path, suffix, content, gltf.source(content, suffix, path) if suffix in (".glb", ".gltf") else None)


def read_triangles(path: Path) -> tuple[list[tuple[str, np.ndarray, np.ndarray]], list[str]]:
    """The meshes of a file and notes about it: (name, vertices (n, 3), facets (m, 3)) each.

    Vertices are in metres in the file's world frame.
    path : of a format in `SUFFIXES`, which may be packed (``.ply.gz``). Point clouds have no facets.
    Raises SceneError for what cannot be read, MissingExtra without the library that reads it.
    """
    parts, notes = triangles_of(open_mesh(path))
    return [(name, vertices, faces) for name, vertices, faces in parts], notes


def triangles_of(opened: MeshBytes) -> Read:
    """The meshes of a file that was opened; see `read_triangles`."""
    reader = _READERS.get(opened.suffix)
    return reader(opened.content, opened.path) if reader is not None else _by_trimesh(opened)


def read_meshes(place: str | Path) -> list[tuple[str, Mesh]]:
    """Everything with facets in a mesh file, by name, as surfaces; SceneError where there is nothing."""
    path = Path(place)
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


# --- COLLADA and glTF -----------------------------------------------------------------------------


class _Files(dict):
    """The files that a glTF refers to, as trimesh asks for them; all others are not there."""

    def get(self, name, default=None):
        return self[name]


def _by_trimesh(opened: MeshBytes) -> Read:
    path = opened.path
    try:
        import trimesh
    except ImportError:
        raise MissingExtra("trimesh", extra="robots", purpose=f"read the mesh {path.name}") from None
    notes = dae.check(opened.content, path) if opened.gltf is None else gltf.check(opened.gltf, path)
    try:
        loaded = trimesh.load_scene(
            BytesIO(opened.content), file_type=opened.suffix[1:], process=False, skip_materials=True,
            resolver=_Files(opened.gltf.files if opened.gltf is not None else {}),
        )
        edges = loaded.graph.to_edgelist()
    except ModuleNotFoundError as error:
        raise MissingExtra(
            error.name or "a mesh library", extra="robots", purpose=f"read the mesh {path.name}"
        ) from None
    except Exception as error:  # noqa: BLE001 - the readers of two formats raise what they like
        raise SceneError(f"is not a mesh that can be read: {_one_line(error)}", path=path) from None
    placed = sum(len(getattr(loaded.geometry.get(about.get("geometry")), "faces", ())) for _, _, about in edges)
    if placed > MAX_PLACED:
        raise SceneError(f"its nodes place {placed:,} facets; read are at most {MAX_PLACED:,}", path=path)
    metre = _metres(loaded.units)
    if metre != 1.0:
        notes = [f"the file says its unit is {metre:g} m; it was scaled to metres", *notes]
    # by name: the graph keeps no order
    placed_meshes = sorted(_placed(edges, str(loaded.graph.base_frame)), key=lambda item: item[0])
    shapes = {
        name: item for name, item in loaded.geometry.items() if isinstance(item, (trimesh.Trimesh, trimesh.PointCloud))
    }
    return Read(
        [_part(name, shapes[geometry], X_WG, metre) for name, geometry, X_WG in placed_meshes if geometry in shapes],
        notes,
    )


def _placed(edges: list, base: str) -> list[tuple[str, str, np.ndarray]]:
    """(node, geometry, X_WG) of every node with a geometry, in one walk from the base frame down."""
    below: dict[str, list] = {}
    for upper, lower, about in edges:
        below.setdefault(upper, []).append((lower, about))
    placed = []
    several: Counter[str] = Counter()
    waiting = [(base, np.eye(4))]
    while waiting:
        node, X_WN = waiting.pop()
        for lower, about in below.pop(node, ()):
            X = np.asarray(about.get("matrix", np.eye(4)), dtype=np.float64)
            X_WL = X if np.array_equal(X_WN, np.eye(4)) else X_WN @ X
            if about.get("geometry") is not None:
                name = str(lower)
                if re.fullmatch(re.escape(str(node)) + "_[0-9a-zA-Z]{6}", name):
                    # trimesh ends the names of several primitives of one glTF mesh at random
                    several[str(node)] += 1
                    name = f"{node}_{several[str(node)]}"
                placed.append((name, about["geometry"], X_WL))
            waiting.append((lower, X_WL))
    return placed


def _part(name: str, mesh, X_WG: np.ndarray, metre: float) -> Part:
    """A mesh or a cloud of points in the file's world frame, in metres."""
    vertices = np.array(getattr(mesh, "vertices", np.zeros((0, 3))), dtype=np.float64).reshape(-1, 3)
    faces = np.array(getattr(mesh, "faces", np.zeros((0, 3))), dtype=np.int64).reshape(-1, 3)
    if not np.array_equal(X_WG, np.eye(4)):
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused with its row
            vertices = vertices @ X_WG[:3, :3].T + X_WG[:3, 3]
    return Part(name, vertices * metre if metre != 1.0 else vertices, faces)


def _metres(units) -> float:
    """Metres in a unit as trimesh names it: "meters", "0.0254 * meters", "millimeters", None."""
    words = str(units or "meters").replace("*", " ").split()
    factor = float(words[0]) if len(words) == 2 else 1.0
    named = {
        "meters": 1.0,
        "m": 1.0,
        "millimeters": 1e-3,
        "mm": 1e-3,
        "centimeters": 1e-2,
        "cm": 1e-2,
        "inches": 0.0254,
    }
    return factor * named.get(words[-1], 1.0) if math.isfinite(factor) else 1.0


def _one_line(error: Exception) -> str:
    return cut(" ".join(str(error).split()) or type(error).__name__, 200)
