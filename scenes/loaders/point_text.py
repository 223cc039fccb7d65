"""Text with a point a line: x, y and z, and whatever follows; numbers parted by spaces, commas or semicolons."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from collide.base.given_files import as_text
from collide.scenes.loaders.polygons import quoted, refuse

#: What begins a comment: gnuplot's mark, CloudCompare's.
_COMMENTS = ("#", "//")
#: The first line that is neither empty nor a comment.
_FIRST = re.compile(r"^[^\S\n]*(?!#|//|\s)(.+)$", re.MULTILINE)


def read_points(content: bytes, path: Path) -> np.ndarray:
    """(n, 3) float64, finite or not; SceneError with the line of what is no number.

    A first line of words that names columns x, y and z says which they are; without one they are the first three.
    """
    text = as_text(content, path)
    comments = [mark for mark in _COMMENTS if mark in text]
    first = _FIRST.search(text)
    if first is None:
        refuse(path, "holds no points")
    delimiter = next((mark for mark in ";," if mark in first[1]), None)
    names = [word.strip(" \t\r\"'").lower() for word in first[1].split(delimiter)]
    twice = next((axis for axis in "xyz" if names.count(axis) > 1), None)
    if twice is not None:
        refuse(path, f"has two columns {twice}", text.count("\n", 0, first.end()) + 1)
    if not {"x", "y", "z"} <= {*names}:
        return numbers_in_columns(text, (0, 1, 2), path, delimiter=delimiter, comments=comments)
    number = text.count("\n", 0, first.end()) + 2
    columns = [names.index(axis) for axis in "xyz"]
    text = text[first.end() :]
    return numbers_in_columns(text, columns, path, first=number - 1, delimiter=delimiter, comments=comments)


def numbers_in_columns(
    text: str, columns: Sequence[int], path: Path, *, first: int = 1, width: int | None = None,
    delimiter: str | None = None, comments: Sequence[str] = (),
) -> np.ndarray:
    """(n, k) float64 of k columns of a text.

    first : number of the text's first line in its file, for messages.   width : how many words each line must have.
    delimiter : between words; ``None`` for white space.   comments : marks of what is passed over.
    Raises SceneError with the line of what is no number, or missing.
    """
    if _FIRST.search(text) is None:
        return np.zeros((0, len(columns)))
    if width is not None:
        for number, line in enumerate(io.StringIO(text), first):
            if line.strip() and len(line.split(delimiter)) != width:
                refuse(path, f"must have {width} words, got {quoted(line.encode())}", number)
    try:
        return np.loadtxt(
            io.StringIO(text), usecols=tuple(columns), delimiter=delimiter, comments=list(comments) or None, ndmin=2,
        )
    except ValueError as error:
        _refuse_line(text, columns, path, first, delimiter, comments, str(error))


def _refuse_line(text, columns, path, first, delimiter, comments, reason) -> NoReturn:
    """Name the first line of a text that `numpy.loadtxt` refuses."""
    for number, line in enumerate(io.StringIO(text), first):
        for mark in comments:
            line = line.partition(mark)[0]
        words = line.split(delimiter)
        try:
            [float(words[k]) for k in columns if line.strip()]
        except (ValueError, IndexError):
            refuse(path, f"must have numbers in columns {', '.join(str(k + 1) for k in columns)}, got "
                   f"{quoted(line.encode())}", number)
    refuse(path, f"cannot be read: {reason}")
