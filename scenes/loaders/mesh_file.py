"""Mesh files: read once, looked at, and kept as arrays (`collide.scenes.mesh_cache`).

Afterwards neither trimesh nor scipy nor a compiler is imported. `mesh_shapes.py` makes shapes of what is read here.
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidShape, MissingExtra, SceneError
from collide.scenes import mesh_cache as cache
from collide.scenes.loaders.fields import Fields, did_you_mean
from collide.scenes.loaders.hull_levels import split_level
from collide.scenes.loaders.mesh_parts import MeshFile, MeshPart, described, distinct
from collide.scenes.loaders.triangles import SUFFIXES, MeshBytes, open_mesh, triangles_of

#: What a mesh may become: itself, itself repaired, the hull of its vertices, or a union of convex pieces.
OPTIONS = ("mesh", "repaired", "hull", "pieces")
#: The same as users are told.
OPTION_NAMES = '"mesh", "repaired", "hull", "hull:64", "hull+:64" or "pieces"'
REPAIRED = "repaired"
#: Those that keep its facets.
AS_THEY_ARE = ("mesh", REPAIRED)
#: A mesh whose volume is this much of its hull's is its hull.
CONVEX_RATIO = 1.0 - 1e-6


def read_mesh(path: Path, meshes: str = "mesh") -> MeshFile:
    """The meshes of a file, from the cache of prepared inputs or by its reader.

    meshes : "mesh" for the triangles, "repaired" for those of a solid where one can be made of them, "hull", "hull:64"
        and "hull+:64" (`hull_levels.py`), or "pieces" for a convex decomposition of every mesh.
    """
    check_meshes_option(meshes)
    meshes, level = split_level(meshes)
    if path.suffix.lower() not in SUFFIXES:
        raise SceneError(f"unknown mesh format {path.suffix!r}; known are {', '.join(SUFFIXES)}", path=path)
    opened = open_mesh(path)
    # Without scipy the volume of a hull is unknown; once it is installed the mesh is looked at again.
    known = meshes not in AS_THEY_ARE and importlib.util.find_spec("scipy") is not None
    entry = cache.key(opened.blobs, {"meshes": meshes, "suffix": opened.suffix, "volumes": known})
    file = _from_cache(entry)
    if file is None:
        file, raw = _read(opened, meshes)
        if meshes == "pieces":
            for part, (vertices, faces) in zip(file.parts, raw):
                part.pieces = _decompose(vertices, faces, path)
        cache.store(entry, _pack(file))
    for part in file.parts:
        part.level = level
    # The entry knows the bytes alone: a file of the same bytes may have another name.
    if len(file.parts) == 1:
        file.parts[0].name = path.stem
    file.notes = [f"{path.name}: {note}" for note in file.notes]
    return file


def _from_cache(entry: str) -> MeshFile | None:
    arrays = cache.fetch(entry)
    try:
        return None if arrays is None else _unpack(arrays)
    except (KeyError, ValueError, TypeError, IndexError):
        return None  # made by something else: read the file again


def check_meshes_option(meshes: str) -> None:
    if not isinstance(meshes, str) or split_level(meshes)[0] not in OPTIONS:
        raise SceneError(f"meshes must be {OPTION_NAMES}, got {checks.brief(meshes)}")


def meshes_option(fields: Fields, key: str, default: str) -> str:
    """An option for meshes in a scene file."""
    value = fields.text(key) if key in fields else default
    try:
        check_meshes_option(value)
    except SceneError:
        fields.fail(f"must be {OPTION_NAMES}, got {checks.brief(value)}{did_you_mean(value, OPTIONS)}", key)
    return value


def size_note(extent: float, what: str) -> str | None:
    """A note where something is so large or small that its unit may be wrong. extent : [m]."""
    if extent > 100.0:
        return (
            f"{what} is {extent:g} m across: is it in millimetres? A scale of 0.001 would make it {extent / 1000:g} m"
        )
    if 0.0 < extent < 1e-5:
        return f"{what} is {extent:g} m across: is its unit right?"
    return None


# --- reading ------------------------------------------------------------------------------------


def _read(opened: MeshBytes, meshes: str) -> tuple[MeshFile, list[tuple[np.ndarray, np.ndarray]]]:
    triangles, notes = triangles_of(opened)
    path, notes = opened.path, list(notes)
    parts, raw = [], []
    for name, vertices, faces in triangles:
        if len(vertices):
            part, about = _describe(meshes, name, vertices, faces, path)
            parts.append(part)
            raw.append((vertices, faces))
            notes += about
    if not parts:
        raise SceneError(
            "has no vertices; a mesh needs at least one (is the file cut short, or of another format?)", path=path
        )
    return MeshFile(parts, notes), raw


def _describe(
    meshes: str, label: str, vertices: np.ndarray, faces: np.ndarray, path: Path
) -> tuple[MeshPart, list[str]]:
    if not np.isfinite(vertices).all():
        row = int(np.argmax(~np.isfinite(vertices).all(axis=1)))
        raise SceneError(f"vertex {row} is {vertices[row].tolist()}: coordinates must be finite", path=path)
    outside = ((faces < 0) | (faces >= len(vertices))).any(axis=1)
    if outside.any():
        row = int(np.argmax(outside))
        raise SceneError(
            f"face {row} names vertices {faces[row].tolist()}, but there are 0 … {len(vertices) - 1}", path=path
        )
    notes = []
    used = np.unique(faces) if len(faces) else np.arange(len(vertices))
    if len(used) < len(vertices):
        notes.append(f"{len(vertices) - len(used)} vertices that no face uses were left out")
    if not len(faces):
        notes.append("has points but no faces; their hull was taken")
    elif meshes in AS_THEY_ARE:
        return _as_it_is(label, vertices, faces, path, meshes == REPAIRED), notes
    closed, fill = _volumes(vertices, faces, path)
    return MeshPart(label, distinct(vertices[used]), fill, closed, len(faces)), notes


def part_of_arrays(label: str, vertices: np.ndarray, faces: np.ndarray, meshes: str, path: Path) -> MeshPart:
    """A mesh that another reader has read, (n, 3) vertices and (m, 3) faces, taken as `read_mesh` takes one."""
    part = _as_it_is(label, vertices, faces, path, meshes == REPAIRED)
    if meshes in AS_THEY_ARE:
        return part
    meshes, level = split_level(meshes)
    whole = MeshPart(label, distinct(vertices[np.unique(faces)]), np.nan, part.closed, part.faces, level=level)
    if part.own_hull:
        whole.fill = 1.0
    elif meshes == "pieces":
        whole.pieces = _decompose(vertices, faces, path)
    return whole


def _as_it_is(label: str, vertices: np.ndarray, faces: np.ndarray, path: Path, repair: bool) -> MeshPart:
    try:
        return described(label, vertices, faces, repair)
    except InvalidShape as error:
        raise SceneError(str(error), path=path, element=None if label == path.name else label) from None


def _volumes(vertices: np.ndarray, faces: np.ndarray, path: Path) -> tuple[bool, float]:
    """Whether the mesh is closed, and its volume over that of its hull (NaN where unknown)."""
    if len(faces) < 4:
        return False, np.nan
    try:
        import trimesh
    except ImportError:
        raise MissingExtra("trimesh", extra="robots", purpose=f"compare the mesh {path.name} with its hull") from None
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
        return [distinct(vertices)]
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


# --- arrays for the cache -------------------------------------------------------------------------


def _pack(file: MeshFile) -> dict[str, np.ndarray]:
    """A mesh file as arrays; texts as the bytes of one JSON string, since the cache holds numbers alone."""
    about: dict[str, Any] = {"notes": file.notes, "parts": []}
    arrays: dict[str, np.ndarray] = {}
    for k, part in enumerate(file.parts):
        fill = None if np.isnan(part.fill) else part.fill
        pieces = None if part.pieces is None else len(part.pieces)
        about["parts"].append(
            {
                "name": part.name, "fill": fill, "closed": bool(part.closed), "faces": part.faces, "pieces": pieces,
                "own_hull": bool(part.own_hull), "repairs": part.repairs,
            }
        )
        arrays[f"points{k}"] = part.points
        if part.facets is not None:
            arrays[f"facets{k}"] = part.facets
        for j, points in enumerate(part.pieces or []):
            arrays[f"piece{k}_{j}"] = points
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    return arrays


def _unpack(arrays: Mapping[str, np.ndarray]) -> MeshFile:
    about = json.loads(arrays["about"].tobytes())
    parts = []
    for k, text in enumerate(about["parts"]):
        pieces = None if text["pieces"] is None else [_points(arrays[f"piece{k}_{j}"]) for j in range(text["pieces"])]
        fill = np.nan if text["fill"] is None else float(text["fill"])
        points = _points(arrays[f"points{k}"])
        facets = _facets(arrays[f"facets{k}"], len(points)) if f"facets{k}" in arrays else None
        parts.append(
            MeshPart(
                text["name"], points, fill, text["closed"], text["faces"], pieces, facets, bool(text["own_hull"]),
                repairs=text["repairs"],
            )
        )
    return MeshFile(parts, list(about["notes"]))


def _points(array: np.ndarray) -> np.ndarray:
    if array.dtype != np.float64 or array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise ValueError("not an array of points")
    return array


def _facets(array: np.ndarray, points: int) -> np.ndarray:
    if array.dtype != np.int32 or array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise ValueError("not an array of facets")
    if array.min() < 0 or array.max() >= points:
        raise ValueError("facets of other points")
    return array
