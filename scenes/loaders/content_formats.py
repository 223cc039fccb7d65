"""Which mesh format a file holds, by its first bytes: a file under a name of another format is refused by name."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from collide.errors import SceneError

#: Suffix → what content of the format begins with. Packages and JSON may hold anything: their inside is looked for.
_BEGINS = {
    ".ply": re.compile(rb"ply[ \t]*\r?[\n\r][ \t]*(format|comment|obj_info)\b"),
    ".glb": re.compile(rb"glTF[\x01\x02]\0\0\0"),
    ".3mf": re.compile(rb"PK\x03\x04(?s:.*)(\[Content_Types\]\.xml|_rels/\.rels|3D/3dmodel\.model)"),
    ".dae": re.compile(rb"\s*(<\?xml[^>]*\?>\s*)?(<!--(?s:.*?)-->\s*)*<(\w+:)?COLLADA\b"),
    ".gltf": re.compile(rb"\s*\{(?s:.*)\"asset\"\s*:\s*\{"),
    ".off": re.compile(rb"(ST)?C?N?4?n?OFF\b(\s*BINARY\b|\s*(#[^\n]*)?[\n\r]|[ \t]+\d)"),
    ".stl": re.compile(rb"\s*solid\b[^\n\r]*[\n\r]\s*(facet\s+normal|endsolid)\b", re.IGNORECASE),
    ".obj": re.compile(rb"(\s*(#|mtllib|[og]\s)[^\n\r]*[\n\r])*\s*v[ \t]+[-+.\d][^\n\r]*[\n\r]"),
}
_NAMES = {".dae": "COLLADA", ".gltf": "glTF", ".glb": "GLB"}
#: Bytes that are looked at.
_HEAD = 4096


def refuse_another_format(content: bytes, suffix: str, path: Path) -> None:
    """SceneError where content begins as another mesh format does, and not as that of its suffix: the name to give.

    content : of a mesh file, unpacked.   suffix : of its name, ".stl" and such, without ".gz".
    """
    if _is_binary_stl(content):
        holds = [".stl"]
    else:
        start = content[:_HEAD].removeprefix(b"\xef\xbb\xbf")
        holds = [known for known, begin in _BEGINS.items() if begin.match(start)]
    if holds and suffix not in holds:
        name = path.name.removesuffix(".gz")
        right = name[: len(name) - len(suffix)] + holds[0]
        raise SceneError(f"holds {_name(holds[0])}, not {_name(suffix)} as its name says: call it {right}", path=path)


def _name(suffix: str) -> str:
    return _NAMES.get(suffix, suffix[1:].upper())


def _is_binary_stl(content: bytes) -> bool:
    """Whether the length is that of as many facets as the header declares, which hardly any text is."""
    return len(content) > 84 and len(content) == 84 + 50 * int(np.frombuffer(content[80:84], "<u4")[0])
