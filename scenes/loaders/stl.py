"""STL, binary and ASCII: facets of three corners each, nothing shared."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from collide.scenes.loaders.polygons import Part, Read, floats, name_of, quoted, refuse

_HEADER = 84
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
#: What may follow a keyword of ASCII STL.
_NEXT = {
    b"solid": (b"facet", b"endsolid"), b"facet": (b"outer",), b"outer": (b"vertex",),
    b"vertex": (b"vertex", b"endloop"),
    b"endloop": (b"endfacet",), b"endfacet": (b"facet", b"endsolid"), b"endsolid": (b"solid",),
}


def read(content: bytes, path: Path) -> Read:
    """The facets of an STL; SceneError where its header's count or its lines' order contradicts them."""
    declared = int(np.frombuffer(content[80:84], "<u4")[0]) if len(content) >= _HEADER else None
    if declared is not None and len(content) == _HEADER + declared * _FACET.itemsize:
        corners = np.frombuffer(content, _FACET, offset=_HEADER)["corners"]
        if not np.isfinite(corners).all():
            k = int(np.argmax(~np.isfinite(corners).all(axis=(1, 2))))
            refuse(path, f"facet {k} is {corners[k].tolist()}: coordinates must be finite")
        return Read([_part(path.name, corners.reshape(-1, 3).astype(np.float64))], [])
    if (
        re.match(rb"(\xef\xbb\xbf)?\s*solid\b", content[:200], re.IGNORECASE)
        and b"\0" not in content[_HEADER : _HEADER + 400]
    ):
        return _ascii(content, path)
    if declared is None:
        refuse(
            path,
            f"is no STL: it has {len(content)} bytes, a binary one has 84 and more, an ASCII one begins with solid",
        )
    holds = (len(content) - _HEADER) / _FACET.itemsize
    refuse(
        path,
        f"its header says {declared} facets, but the file holds {holds:.10g}: it was cut short or is damaged (or is no "
        "STL); "
        "export it again",
    )


def _part(name: str, corners: np.ndarray) -> Part:
    return Part(name, corners, np.arange(len(corners), dtype=np.int64).reshape(-1, 3))


def _ascii(content: bytes, path: Path) -> Read:
    parts: list[Part] = []
    before, began, name = b"endsolid", 0, path.name
    corners: list[bytes] = []
    lines: list[int] = []
    for number, line in enumerate(content.removeprefix(b"\xef\xbb\xbf").splitlines(), 1):
        words = line.split()
        if not words:
            continue
        keyword = words[0].lower()
        if keyword not in _NEXT[before]:
            refuse(
                path,
                f"{' or '.join(word.decode() for word in _NEXT[before])} must stand here, got {quoted(line)}",
                number,
            )
        if keyword == b"vertex":
            if len(words) != 4:
                refuse(path, f"a vertex has three coordinates, got {quoted(line)}", number)
            corners += words[1:]
            lines.append(number)
        elif keyword == b"outer":
            began = len(lines)
        elif keyword == b"endloop" and len(lines) - began != 3:
            refuse(path, f"a facet of STL has three corners, this one {len(lines) - began}", number)
        elif keyword == b"solid":
            name, corners, lines = name_of(line, path.name), [], []
        elif keyword == b"endsolid" and lines:
            parts.append(_part(name, floats(corners, lines, path)))
        before = keyword
    if before != b"endsolid":
        refuse(path, f"ends after {before.decode()}, without endsolid: it was cut short; export it again")
    return Read(parts, [])
