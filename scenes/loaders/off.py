"""OFF: a line of counts, a line for each vertex, a line for each polygon."""

from __future__ import annotations

import re
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
    quoted,
    refuse,
    whole,
    wholes,
)

_KIND = re.compile(rb"(?:ST)?C?N?(4?n?)OFF(\s*BINARY)?", re.IGNORECASE)


def read(content: bytes, path: Path) -> Read:
    """The polygons of an OFF as triangles; SceneError where its counts are not what follows, with line and value."""
    lines = [(number, line.split(b"#")[0].strip()) for number, line in enumerate(content.splitlines(), 1)]
    lines = [(number, line) for number, line in lines if line]
    kind = _KIND.match(lines[0][1]) if lines else None
    if kind is None:
        refuse(path, f"is no OFF: it begins with {quoted(lines[0][1]) if lines else 'nothing'}, not OFF")
    if kind[1] or kind[2]:
        refuse(path, f"{kind[0].decode()} is not read: only OFF in text and in three dimensions is", lines[0][0])
    rest = lines[0][1][kind.end() :].strip()  # the counts may stand beside the word
    lines = [(lines[0][0], rest), *lines[1:]] if rest else lines[1:]
    if not lines or len(lines[0][1].split()) < 2:
        refuse(
            path,
            f"the counts of vertices and faces must stand after OFF, got {quoted(lines[0][1]) if lines else 'nothing'}",
        )
    n, m = (whole(word, "a count", path, lines[0][0]) for word in lines[0][1].split()[:2])
    if n < 0 or m < 0:
        refuse(path, f"says {n} vertices and {m} faces: counts must be 0 or more", lines[0][0])
    if len(lines) - 1 != n + m:
        refuse(
            path,
            f"says {n} vertices and {m} faces, {n + m} lines, but {len(lines) - 1} follow: it was cut short or is "
            "damaged",
            lines[0][0],
        )
    return _table(lines[1 : n + 1], lines[n + 1 :], path)


def _table(vertex_lines: list[tuple[int, bytes]], face_lines: list[tuple[int, bytes]], path: Path) -> Read:
    coordinates: list[bytes] = []
    for number, line in vertex_lines:
        words = line.split()[:3]
        if len(words) < 3:
            refuse(path, f"a vertex has three coordinates, got {quoted(line)}", number)
        coordinates += words
    vertices = floats(coordinates, [number for number, _ in vertex_lines], path)
    ids: list[bytes] = []
    counts: list[int] = []
    numbers: list[int] = []
    degenerate_lines: list[int] = []
    for number, line in face_lines:
        words = line.split()
        count = int(words[0]) if words[0].isdigit() else whole(words[0], "the count of corners", path, number)
        if count < 0 or len(words) < count + 1:
            refuse(path, f"a face of {count} corners has {len(words) - 1} numbers: {quoted(line)}", number)
        if count < 3:
            degenerate_lines.append(number)
            continue
        ids += words[1 : count + 1]
        counts.append(count)
        numbers.append(number)
    corners, sizes = wholes(ids, "a vertex of a face", path, numbers, counts), np.array(counts, dtype=np.int64)
    check_ids(corners, sizes, len(vertices), 0, numbers, path)
    return Read(
        [Part(path.name, vertices, fans(corners, sizes) if counts else NO_FACES)], degenerate_notes(degenerate_lines)
    )
