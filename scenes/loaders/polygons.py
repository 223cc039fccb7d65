"""What the readers of mesh files share: rows of numbers with their lines, polygons as fans of triangles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from collide.errors import SceneError, brief, cut


class Part(NamedTuple):
    """One mesh of a file: (n, 3) vertices, (m, 3) facets, none of a cloud of points."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray


class Read(NamedTuple):
    """The meshes of a file, and what its reader wants to say."""

    parts: list[Part]
    notes: list[str]


NO_FACES = np.zeros((0, 3), dtype=np.int64)


def refuse(path: Path, what: str, line: int | None = None) -> NoReturn:
    """line : counted from 1."""
    raise SceneError(what, path=path, element=None if line is None else f"line {line}")


def quoted(line: bytes) -> str:
    """A line of a file for a message."""
    return brief(line.decode("utf-8", errors="replace").strip())


def numbers(words: Sequence[bytes]) -> np.ndarray | None:
    """Words as float64; None where one of them is no number."""
    if b"_" in b" ".join(words):  # Python takes 1_0 for ten
        return None
    try:
        return np.array(list(map(float, words)), dtype=np.float64)
    except ValueError:
        return None


def floats(words: Sequence[bytes], lines: Sequence[int], path: Path) -> np.ndarray:
    """(n, 3) of three words a line; SceneError with line and value for what is no finite number."""
    values = numbers(words)
    if values is None or not np.isfinite(values).all():
        k = next(k for k, word in enumerate(words) if (value := numbers([word])) is None or not np.isfinite(value[0]))
        refuse(path, f"a coordinate must be a finite number, got {quoted(words[k])}", lines[k // 3])
    return values.reshape(-1, 3)


def wholes(words: Sequence[bytes], what: str, path: Path, lines: Sequence[int], counts: Sequence[int]) -> np.ndarray:
    """int64 ids; SceneError with line and value. Files that keep them as 3.0 mean 3.

    counts : how many of the words stand in each of the lines.
    """
    try:
        if b"_" not in b" ".join(words):
            return np.array(list(map(int, words)), dtype=np.int64)
    except (ValueError, OverflowError):
        pass
    values = [_whole(word) for word in words]
    if None in values:
        k = values.index(None)
        line = lines[int(np.searchsorted(np.cumsum(counts), k, side="right"))]
        refuse(path, f"{what} must be a whole number, got {quoted(words[k])}", line)
    return np.array(values, dtype=np.int64)


def whole(word: bytes, what: str, path: Path, line: int) -> int:
    """One number of `wholes`."""
    return int(wholes([word], what, path, [line], [1])[0])


def _whole(word: bytes) -> int | None:
    value = numbers([word])
    if value is None or value[0] != np.floor(value[0]) or not abs(value[0]) < 2**53:
        return None
    return int(value[0])


def fans(corners: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """(m, 3) triangles of polygons: a fan around the first corner of each, in the order of the file.

    corners : ids of all polygons in one row.   counts : how many each has, 3 or more.
    """
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    triangles = counts - 2
    first = np.repeat(np.cumsum(counts) - counts, triangles)
    k = np.arange(len(first)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return np.stack([corners[first], corners[first + k + 1], corners[first + k + 2]], axis=1)


def check_ids(
    corners: np.ndarray, counts: np.ndarray, vertices: int, first: int, lines: Sequence[int] | None, path: Path
) -> None:
    """Refuse polygons with a corner that is no vertex, by line or by number.

    corners : from 0.   first : what the file calls the first vertex, for the message.
    """
    outside = (corners < 0) | (corners >= vertices)
    if outside.any():
        k = int(np.searchsorted(np.cumsum(counts), int(np.argmax(outside)), side="right"))
        there = f"there are {first} ... {vertices - 1 + first}" if vertices else "there are none"
        what = f"face {k} names vertex {int(corners[np.argmax(outside)]) + first}, but {there}"
        refuse(path, what, None if lines is None else lines[k])


def degenerate_notes(lines: Sequence[int], what: str = "line") -> list[str]:
    """A note about polygons of one or two corners."""
    if not lines:
        return []
    more = f" and {len(lines) - 5} more" if len(lines) > 5 else ""
    return [f"faces of fewer than three corners were left out: {what} {', '.join(map(str, lines[:5]))}{more}"]


def name_of(line: bytes, default: str) -> str:
    """What stands after the first word of a line."""
    words = line.split(None, 1)
    return cut(words[1].decode("utf-8", errors="replace").strip()) if len(words) == 2 else default
