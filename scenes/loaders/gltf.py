"""glTF and GLB: checked here, then read by trimesh, which takes negative indices and packed data without a word."""

from __future__ import annotations

import math
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple, NoReturn
from urllib.parse import unquote

import numpy as np

from collide.base.given_files import LARGEST_MESH, read_bytes
from collide.errors import SceneError, brief
from collide.scenes.loaders.documents import read_json
from collide.scenes.loaders.polygons import refuse

_JSON, _BIN = 0x4E4F534A, 0x004E4942
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
#: What packs vertices in a way of its own.
_PACKED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_mesh_quantization")
_POINTS, _TRIANGLES, _STRIP, _FAN = 0, 4, 5, 6


class Source(NamedTuple):
    """The header of a file, its binary chunk, and the files that it refers to, by the name they have in it."""

    header: dict
    chunk: bytes | None
    files: dict[str, bytes]


def source(content: bytes, suffix: str, path: Path) -> Source:
    """Check a glTF or GLB, and list its notes.

    Raises SceneError for lengths that are not those of the file, and for files outside its folder.
    """
    text, chunk = (content, None) if suffix == ".gltf" else _chunks(content, path)
    header = read_json(text, path, "glTF: its text is not JSON")
    buffers = header.get("buffers", []) if isinstance(header, dict) else None
    if not isinstance(buffers, list) or not all(isinstance(buffer, dict) for buffer in buffers):
        refuse(path, "is not glTF: its text is not JSON with a list of buffers")
    files: dict[str, bytes] = {}
    for k, buffer in enumerate(buffers):
        uri = buffer.get("uri")
        if uri is None or (isinstance(uri, str) and uri.startswith("data:")):
            continue
        if not isinstance(uri, str):
            _at(path, f"buffers[{k}].uri", f"must be a name, got {brief(uri)}")
        files[uri] = read_bytes(_beside(path, uri, k), LARGEST_MESH, "mesh")
    return Source(header, chunk, files)


def _chunks(content: bytes, path: Path) -> tuple[bytes, bytes | None]:
    """The JSON text and the binary chunk of a GLB, whose lengths must be those of the file."""
    if content[:4] != b"glTF" or len(content) < 20:
        refuse(path, "is no GLB: it must begin with glTF and have 20 bytes or more")
    version, length = np.frombuffer(content[4:12], "<u4").tolist()
    if version != 2:
        refuse(path, f"is GLB of version {version}; read is version 2")
    if length != len(content):
        refuse(
            path,
            f"says that it has {length} bytes, but it has {len(content)}: it was cut short or is damaged; export it "
            "again",
        )
    text = chunk = None
    at = 12
    while at + 8 <= len(content):
        size, kind = np.frombuffer(content[at : at + 8], "<u4").tolist()
        if at + 8 + size > len(content):
            refuse(
                path,
                f"a part of it says that it has {size} bytes, but {len(content) - at - 8} follow: the file is damaged",
            )
        if kind == _JSON and text is None:
            text = content[at + 8 : at + 8 + size]
        elif kind == _BIN and chunk is None:
            chunk = content[at + 8 : at + 8 + size]
        at += 8 + size
    if text is None:
        refuse(path, "is no GLB: it has no part with JSON")
    return text, chunk


def _beside(path: Path, uri: str, k: int) -> Path:
    name = PurePosixPath(unquote(uri).replace("\\", "/"))
    if "://" in uri or name.is_absolute() or ".." in name.parts:
        _at(path, f"buffers[{k}].uri", f"{brief(uri)} is not beside the file, where alone its buffers are read")
    return path.parent / name


def _at(path: Path, element: str, what: str) -> NoReturn:
    raise SceneError(what, path=path, element=element)


# --- what trimesh will read -----------------------------------------------------------------------


def check(source: Source, path: Path) -> list[str]:
    """Notes about what is not read; SceneError for counts, ids and references that do not fit together."""
    looked = _Check(source.header, path)
    try:
        return looked.all()
    except (TypeError, AttributeError, KeyError, ValueError, OverflowError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(
            f"is not glTF: an entry is missing or of another type ({brief(str(error))})", path=path
        ) from None


class _Check:
    def __init__(self, header: dict, path: Path):
        self.header, self.path = header, path
        self.notes: dict[str, None] = {}
        self._lists: dict[str, list] = {}

    def all(self) -> list[str]:
        for k, view in enumerate(self._list("bufferViews")):
            where = f"bufferViews[{k}]"
            size = self._entry("buffers", view.get("buffer"), f"{where}.buffer").get("byteLength")
            start = self._count(view.get("byteOffset", 0), f"{where}.byteOffset")
            length = self._count(view.get("byteLength"), f"{where}.byteLength")
            if start + length > self._count(size, "buffers.byteLength"):
                _at(self.path, where, f"ends at byte {start + length}, but its buffer has {size}")
        for k, mesh in enumerate(self._list("meshes")):
            for j, primitive in enumerate(mesh["primitives"]):
                self._primitive(primitive, f"meshes[{k}].primitives[{j}]")
        self._nodes()
        return list(self.notes)

    def _list(self, key: str) -> list:
        if key not in self._lists:
            values = self.header.get(key, [])
            if not isinstance(values, list) or not all(isinstance(entry, dict) for entry in values):
                _at(self.path, key, f"must be a list of mappings, got {brief(values)}")
            self._lists[key] = values
        return self._lists[key]

    def _count(self, value: Any, where: str) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            _at(self.path, where, f"must be a whole number, 0 or more, got {brief(value)}")
        return value

    def _entry(self, key: str, index: Any, where: str) -> dict:
        """What an index names: Python would take -1 for the last entry."""
        entries = self._list(key)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(entries):
            _at(self.path, where, f"names entry {brief(index)} of {key}, which has {len(entries)}")
        return entries[index]

    def _primitive(self, primitive: dict, where: str) -> None:
        packed = [name for name in primitive.get("extensions") or {} if name in _PACKED[:2]]
        if packed:
            _at(
                self.path,
                where,
                f"its vertices are packed ({packed[0]}), which is not read: export it without compression",
            )
        mode = primitive.get("mode", _TRIANGLES)
        if mode not in (_POINTS, _TRIANGLES, _STRIP):
            kind = "a fan of triangles" if mode == _FAN else "lines"
            self.notes[f"{where} is {kind} (mode {brief(mode)}) and was not read"] = None
            return
        vertices = self._accessor(primitive["attributes"].get("POSITION"), f"{where}.attributes.POSITION", "VEC3")
        corners = vertices["count"]
        if "indices" in primitive:
            corners = self._accessor(primitive["indices"], f"{where}.indices", "SCALAR")["count"]
        if mode == _TRIANGLES and corners % 3:
            _at(
                self.path,
                where,
                f"is made of triangles, but has {corners} corners, not three each: was the file cut short?",
            )

    def _accessor(self, index: Any, where: str, kind: str) -> dict:
        accessor = self._entry("accessors", index, where)
        count, component = (
            self._count(accessor.get("count"), f"accessors[{index}].count"),
            accessor.get("componentType"),
        )
        if not isinstance(component, int) or component not in _COMPONENTS or accessor.get("type") != kind:
            _at(
                self.path,
                f"accessors[{index}]",
                f"holds {brief(accessor.get('type'))} of type {brief(component)}, which {where} cannot be",
            )
        if kind == "SCALAR" and component not in (5121, 5123, 5125):
            _at(self.path, f"accessors[{index}]", f"indices must be whole numbers without a sign, got type {component}")
        if "sparse" in accessor or "bufferView" not in accessor or accessor.get("normalized"):
            why = "normalized" if accessor.get("normalized") else "kept by an extension"
            why = "sparse" if "sparse" in accessor else why
            _at(
                self.path,
                f"accessors[{index}]",
                f"its numbers are {why}, which is not read: export the mesh with plain numbers",
            )
        view = self._entry("bufferViews", accessor["bufferView"], f"accessors[{index}].bufferView")
        row = _WIDTHS[kind] * np.dtype(_COMPONENTS[component]).itemsize
        stride = self._count(view.get("byteStride", row), f"bufferViews[{accessor['bufferView']}].byteStride")
        end = self._count(accessor.get("byteOffset", 0), f"accessors[{index}].byteOffset") + (
            stride * (count - 1) + row if count else 0
        )
        if end > view["byteLength"] or (stride < row and count > 1):
            what = f"has {count} entries, {end} bytes, but its bufferView has {view['byteLength']}"
            _at(self.path, f"accessors[{index}]", f"{what}: it was cut short or is damaged")
        return accessor

    def _nodes(self) -> None:
        parents: dict[int, int] = {}
        nodes = self._list("nodes")
        for k, node in enumerate(nodes):
            for child in node.get("children", []):
                self._entry("nodes", child, f"nodes[{k}].children")
                if child in parents:
                    _at(
                        self.path,
                        f"nodes[{k}].children",
                        f"node {child} is a child of node {parents[child]} too: nodes are trees",
                    )
                parents[child] = k
            if "mesh" in node:
                self._entry("meshes", node["mesh"], f"nodes[{k}].mesh")
            for key, count in (("matrix", 16), ("translation", 3), ("rotation", 4), ("scale", 3)):
                if key in node and not _finite(node[key], count):
                    _at(self.path, f"nodes[{k}].{key}", f"must be {count} finite numbers, got {brief(node[key])}")
        rooted: set[int] = set()
        for k in range(len(nodes)):
            walked: set[int] = set()
            while k in parents and k not in rooted:
                if k in walked:
                    _at(self.path, f"nodes[{k}]", "stands below itself: nodes are trees")
                walked.add(k)
                k = parents[k]
            rooted |= walked
        for scene in self._list("scenes"):
            for root in scene.get("nodes", []):
                self._entry("nodes", root, "scenes.nodes")
        if "scene" in self.header:
            self._entry("scenes", self.header["scene"], "scene")


def _finite(values: Any, count: int) -> bool:
    return (
        isinstance(values, list)
        and len(values) == count
        and all(
            isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value) for value in values
        )
    )
