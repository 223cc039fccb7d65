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


def shown(line: bytes) -> str:
    """A line of a file for a message."""
    return brief(line.decode("utf-8", errors="replace").strip())


def floats(rows: Sequence[Sequence[bytes]], lines: Sequence[int], path: Path) -> np.ndarray:
    """(n, 3) of rows of three words each; SceneError with line and value for what is no finite number."""
    try:
        if any(b"_" in word for row in rows for word in row):  # Python takes 1_0 for ten
            raise ValueError
        found = np.array([[float(word) for word in row] for row in rows], dtype=np.float64).reshape(-1, 3)
    except ValueError:
        found = None
    if found is None or not np.isfinite(found).all():
        for row, line in zip(rows, lines):
            for word in row:
                if not _is_finite(word):
                    refuse(path, f"a coordinate must be a finite number, got {shown(word)}", line)
    assert found is not None
    return found


def _is_finite(word: bytes) -> bool:
    try:
        return b"_" not in word and bool(np.isfinite(float(word)))
    except ValueError:
        return False


def whole(word: bytes, what: str, path: Path, line: int | None) -> int:
    """A count or an id; files that keep them as 3.0 mean 3."""
    try:
        number = float(word) if b"." in word or b"e" in word.lower() else int(word)
        if b"_" in word or number != int(number):
            raise ValueError
    except (ValueError, OverflowError):
        refuse(path, f"{what} must be a whole number, got {shown(word)}", line)
    return int(number)


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


def check_ids(corners: np.ndarray, counts: np.ndarray, vertices: int, first: int, lines: Sequence[int] | None, path: Path) -> None:
    """Refuse polygons with a corner that is no vertex, by line or by number.

    corners : from 0.   first : what the file calls the first vertex, for the message.
    """
    outside = (corners < 0) | (corners >= vertices)
    if outside.any():
        k = int(np.searchsorted(np.cumsum(counts), int(np.argmax(outside)), side="right"))
        there = f"there are {first} ... {vertices - 1 + first}" if vertices else "there are none"
        what = f"face {k} names vertex {int(corners[np.argmax(outside)]) + first}, but {there}"
        refuse(path, what, None if lines is None else lines[k])


def few_corners(lines: Sequence[int], what: str = "line") -> list[str]:
    """A note about polygons of one or two corners."""
    if not lines:
        return []
    more = f" and {len(lines) - 5} more" if len(lines) > 5 else ""
    return [f"faces of fewer than three corners were left out: {what} {', '.join(map(str, lines[:5]))}{more}"]


def name_of(line: bytes, default: str) -> str:
    """What stands after the first word of a line."""
    words = line.split(None, 1)
    return cut(words[1].decode("utf-8", errors="replace").strip()) if len(words) == 2 else default
