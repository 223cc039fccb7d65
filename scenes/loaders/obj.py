"""Wavefront OBJ: the vertices and polygons of its objects; materials, groups, normals and curves are not looked at.

Read here because ids are counted from 1, negative ones back from where they stand, and an id of 0 or of a vertex that
is not there must be told with its line.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from collide.scenes.loaders.polygons import (
    NO_FACES,
    Part,
    Read,
    check_ids,
    degenerate_notes,
    fans,
    floats,
    name_of,
    quoted,
    refuse,
)


class _Object:
    """The polygons of one object, in the order of the file."""

    def __init__(self) -> None:
        self.corners: list[int] = []
        self.counts: list[int] = []
        self.lines: list[int] = []


def read(content: bytes, path: Path) -> Read:
    """One part for each object that has faces, by name; a file without faces is a cloud of its vertices."""
    objects: dict[str, _Object] = {}
    here: _Object | None = None
    name = path.name
    coordinates: list[bytes] = []
    lines: list[int] = []
    degenerate_lines: list[int] = []
    number = 0
    for line in _joined(content):
        number += 1 + line.count(b"\\\n")
        words = line.replace(b"\\\n", b" ").split()
        if not words:
            continue
        if words[0] == b"v":
            if len(words) < 4:
                refuse(path, f"a vertex has three coordinates, got {quoted(line)}", number)
            coordinates += words[1:4]
            lines.append(number)
        elif words[0] == b"f":
            if len(words) < 4:
                degenerate_lines.append(number)
                continue
            if here is None:
                here = objects.setdefault(name, _Object())
            here.corners += _ids(words, len(lines), number, line, path)
            here.counts.append(len(words) - 1)
            here.lines.append(number)
        elif words[0] == b"o":
            # equal names are one object, wherever its faces stand
            name, here = name_of(line, path.name), None
    vertices = floats(coordinates, lines, path)
    notes = degenerate_notes(degenerate_lines)
    if not objects:
        return Read([Part(path.name, vertices, NO_FACES)], notes)
    return Read([_part(name, group, vertices, path) for name, group in sorted(objects.items())], notes)


def _joined(content: bytes) -> list[bytes]:
    """The lines of a file; what a backslash continues is one of them, with the break inside."""
    lines = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
    if b"\\\n" not in content and b"\\\r" not in content:
        return lines
    joined: list[bytes] = []
    for line in lines:
        if joined and joined[-1].endswith(b"\\"):
            joined[-1] += b"\n" + line
        else:
            joined.append(line)
    return joined


def _ids(words: list[bytes], so_far: int, number: int, line: bytes, path: Path) -> list[int]:
    """Vertices of a face, from 0; ``5/1/2`` is vertex 5, and -1 the last one so far."""
    try:
        ids = [int(word.split(b"/", 1)[0]) for word in words[1:]]
    except ValueError:
        refuse(path, f"a face names vertices by whole numbers, got {quoted(line)}", number)
    if min(ids) <= 0:
        for id in ids:
            if id == 0 or id < -so_far:
                why = "ids begin at 1" if id == 0 else f"there are {so_far} so far"
                refuse(path, f"a face names vertex {id}, but {why}: {quoted(line)}", number)
        return [id - 1 if id > 0 else so_far + id for id in ids]
    return [id - 1 for id in ids]


def _part(name: str, group: _Object, vertices: np.ndarray, path: Path) -> Part:
    """The object with the vertices that it uses, in the order of the file."""
    try:
        corners, counts = np.array(group.corners, dtype=np.int64), np.array(group.counts, dtype=np.int64)
    except OverflowError:
        corners = np.array([min(id, 2**62) for id in group.corners], dtype=np.int64)
        counts = np.array(group.counts, dtype=np.int64)
    check_ids(corners, counts, len(vertices), 1, group.lines, path)
    used, corners = np.unique(corners, return_inverse=True)
    return Part(name, vertices[used], fans(corners.ravel(), counts))
