"""PLY, in text and binary: the vertices and polygons of the elements that its header declares."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from collide.scenes.loaders.polygons import (
    NO_FACES,
    Part,
    Read,
    check_ids,
    degenerate_notes,
    fans,
    numbers,
    quoted,
    refuse,
    whole,
    wholes,
)

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
    "int64": "i8", "uint64": "u8",
}
_CORNERS = ("vertex_indices", "vertex_index")
_ENDIAN = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


class _Property(NamedTuple):
    """kind : numpy's code of its numbers.   length : that of the count before them, of a list; else None."""

    name: str
    kind: str
    length: str | None


class _Element(NamedTuple):
    name: str
    rows: int
    properties: list[_Property]


#: Of one element: property -> its column, or the values of its lists in one row and their lengths; and the line of each
#: row.
_Columns = dict[str, "np.ndarray | tuple[np.ndarray, np.ndarray]"]


def read(content: bytes, path: Path) -> Read:
    """The polygons of a PLY as triangles; SceneError where what its header declares is not what follows."""
    elements, columns, body = _columns(content, path)
    vertices = _coordinates(columns, path)
    if not np.isfinite(vertices).all():
        row = int(np.argmax(~np.isfinite(vertices).all(axis=1)))
        refuse(path, f"vertex {row} is {vertices[row].tolist()}: coordinates must be finite")
    faces = next((columns["face"][key] for key in _CORNERS if key in columns.get("face", {})), None)
    if faces is None:
        if any(element.rows for element in elements if element.name in ("face", "tristrips")):
            refuse(path, f"its faces are not lists called {' or '.join(_CORNERS)}, which alone are read")
        return Read([Part(path.name, vertices, NO_FACES)], [])
    if not isinstance(faces, tuple):
        refuse(path, "its faces are no lists")
    corners, counts = faces
    degenerate = np.flatnonzero(counts < 3)
    check_ids(corners, counts, len(vertices), 0, body.lines, path)
    if len(degenerate):
        corners, counts = corners[np.repeat(counts >= 3, counts)], counts[counts >= 3]
    return Read(
        [Part(path.name, vertices, fans(corners, counts) if len(counts) else NO_FACES)],
        degenerate_notes(degenerate.tolist(), "face"),
    )


def read_points(content: bytes, path: Path) -> np.ndarray:
    """(n, 3) float64 vertices of a PLY, finite or not, whatever else it holds; SceneError as of `read`."""
    return _coordinates(_columns(content, path)[1], path)


def _columns(content: bytes, path: Path) -> tuple[list[_Element], dict[str, _Columns], _Text | _Binary]:
    endian, elements, at = _header(content, path)
    body = _Text(content, at, path) if not endian else _Binary(content, at, endian, path)
    columns = {element.name: body.element(element) for element in elements}
    body.end()
    return elements, columns, body


def _coordinates(columns: dict[str, _Columns], path: Path) -> np.ndarray:
    vertex = columns.get("vertex", {})
    if not all(isinstance(vertex.get(axis), np.ndarray) for axis in "xyz"):
        refuse(path, "its header declares no element vertex with the properties x, y and z")
    return np.stack([np.asarray(vertex[axis], dtype=np.float64) for axis in "xyz"], axis=1)


# --- header -----------------------------------------------------------------------------------------


def _header(content: bytes, path: Path) -> tuple[str, list[_Element], int]:
    """Byte order (empty: text), elements, and where the data begin."""
    end = re.search(rb"^[ \t]*end_header[ \t]*(\r\n|\n|\r)", content[: 2**20], re.MULTILINE)
    if not content.startswith(b"ply") or end is None:
        refuse(
            path,
            "is no PLY: it must begin with ply and have a line end_header"
            if end
            else "its header has no line end_header: is it cut short?",
        )
    form: str | None = None
    elements: list[_Element] = []
    for number, line in enumerate(content[: end.start()].splitlines(), 1):
        words = line.decode("utf-8", errors="replace").split()
        if not words or words[0] in ("ply", "comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) == 3 and words[1] in _ENDIAN:
            form = words[1]
        elif words[0] == "element" and len(words) == 3:
            count = whole(words[2].encode(), f"the count of {words[1]}", path, number)
            if count < 0:
                refuse(path, f"declares {count} of {words[1]}: a count must be 0 or more", number)
            elements.append(_Element(words[1], count, []))
        elif words[0] == "property" and elements and (prop := _property(words)):
            elements[-1].properties.append(prop)
        else:
            refuse(path, f"this line of the header is not understood: {quoted(line)}", number)
    if form is None:
        refuse(path, "its header has no line format")
    return _ENDIAN[form], elements, end.end()


def _property(words: list[str]) -> _Property | None:
    if len(words) == 3 and words[1] in _TYPES:
        return _Property(words[2], _TYPES[words[1]], None)
    if len(words) == 5 and words[1] == "list" and words[2] in _TYPES and words[3] in _TYPES:
        return _Property(words[4], _TYPES[words[3]], _TYPES[words[2]])
    return None


# --- text -------------------------------------------------------------------------------------------


class _Text:
    """Rows of an ASCII PLY: one line each, as long as their properties say."""

    def __init__(self, content: bytes, at: int, path: Path):
        first = content[:at].count(b"\n") or content[:at].count(b"\r")
        lines = content[at:].splitlines()
        self._rows = [(first + k, words) for k, line in enumerate(lines, 1) if (words := line.split())]
        self._at, self._path = 0, path
        self.lines: list[int] | None = None

    def element(self, element: _Element) -> _Columns:
        rows = self._rows[self._at : self._at + element.rows]
        if len(rows) < element.rows:
            refuse(
                self._path,
                f"declares {element.rows} of {element.name}, but holds {len(rows)}: it was cut short or is damaged; "
                "export it again",
            )
        self._at += element.rows
        if element.name == "face":
            self.lines = [line for line, _ in rows]
        return self._equal_rows(element, rows) or self._row_by_row(element, rows)

    def _equal_rows(self, element: _Element, rows: list) -> _Columns | None:
        """All rows at once, where their lists are as long as those of the first; None where anything is amiss."""
        width = len(rows[0][1]) if rows else 0
        if not rows or any(len(words) != width for _, words in rows):
            return None
        table = numbers([word for _, words in rows for word in words])
        columns: _Columns = {}
        at = 0
        for prop in element.properties:
            if table is None or at >= width:
                return None
            if prop.length and (
                table[at] % 1 or not 0 <= table[at] < width - at or (table[at::width] != table[at]).any()
            ):
                return None
            count, at = (int(table[at]), at + 1) if prop.length else (1, at)
            values = table.reshape(-1, width)[:, at : at + count].ravel()
            if prop.kind[0] != "f" and not ((values == np.floor(values)) & (np.abs(values) < 2**53)).all():
                return None
            values = _as(values, prop)
            columns[prop.name] = (values, np.full(len(rows), count, dtype=np.int64)) if prop.length else values
            at += count
        return columns if at == width else None

    def _row_by_row(self, element: _Element, rows: list) -> _Columns:
        values: list[list[bytes]] = [[] for _ in element.properties]
        counts: list[list[int]] = [[] for _ in element.properties]
        lines = [line for line, _ in rows]
        for line, words in rows:
            at = 0
            for k, prop in enumerate(element.properties):
                count, shift = 1, 0
                if prop.length:
                    count, shift = (
                        whole(self._word(line, words, at, prop), f"the length of {prop.name}", self._path, line),
                        1,
                    )
                lists = words[at + shift : at + shift + count] if count >= 0 else []
                if len(lists) != count:
                    refuse(
                        self._path,
                        f"{prop.name} has {count} numbers, got {len(lists)}: {quoted(b' '.join(words))}",
                        line,
                    )
                values[k] += lists
                counts[k].append(count)
                at += shift + count
            if at != len(words):
                refuse(
                    self._path,
                    f"a row of {element.name} has {at} numbers, got {len(words)}: {quoted(b' '.join(words))}",
                    line,
                )
        columns: _Columns = {}
        for k, prop in enumerate(element.properties):
            column = self._column(values[k], prop, lines, counts[k])
            columns[prop.name] = (column, np.array(counts[k], dtype=np.int64)) if prop.length else column
        return columns

    def _word(self, line: int, words: list[bytes], at: int, prop: _Property) -> bytes:
        if at >= len(words):
            refuse(self._path, f"{prop.name} is missing: {quoted(b' '.join(words))}", line)
        return words[at]

    def _column(self, words: list[bytes], prop: _Property, lines: list[int], counts: list[int]) -> np.ndarray:
        if prop.kind[0] != "f":
            return wholes(words, prop.name, self._path, lines, counts)
        values = numbers(words)
        if values is None:
            k = next(k for k, word in enumerate(words) if numbers([word]) is None)
            line = lines[int(np.searchsorted(np.cumsum(counts), k, side="right"))]
            refuse(self._path, f"{prop.name} must be a number, got {quoted(words[k])}", line)
        return _as(values, prop)

    def end(self) -> None:
        if self._at < len(self._rows):
            line, words = self._rows[self._at]
            more = len(self._rows) - self._at
            refuse(
                self._path, f"{more} more lines than its header declares, the first is {quoted(b' '.join(words))}", line
            )


def _as(values: np.ndarray, prop: _Property) -> np.ndarray:
    """Numbers of the precision that the header declares."""
    if prop.kind[0] != "f":
        return values.astype(np.int64)
    with np.errstate(over="ignore"):  # beyond the largest float is infinite, and refused as such
        return values.astype(prop.kind)


# --- binary -----------------------------------------------------------------------------------------


class _Binary:
    """Rows of a binary PLY, packed without gaps."""

    lines: list[int] | None = None

    def __init__(self, content: bytes, at: int, endian: str, path: Path):
        self._content, self._at, self._endian, self._path = content, at, endian, path

    def element(self, element: _Element) -> _Columns:
        if not element.rows or not element.properties:
            none = np.zeros(0)
            return {
                prop.name: (none.astype(np.int64), none.astype(np.int64)) if prop.length else none
                for prop in element.properties
            }
        return self._equal_rows(element) or self._row_by_row(element)

    def _equal_rows(self, element: _Element) -> _Columns | None:
        """All rows at once, where their lists are as long as those of the first."""
        fields, at = [], self._at
        for k, prop in enumerate(element.properties):
            if prop.length:
                count = int(self._take(prop.length, 1, at, element, 0)[0])
                fields += [
                    (f"n{k}", self._endian + prop.length),
                    (f"v{k}", self._endian + prop.kind, (self._sane(count, prop),)),
                ]
                at += np.dtype(prop.length).itemsize + count * np.dtype(prop.kind).itemsize
            else:
                fields.append((f"v{k}", self._endian + prop.kind))
                at += np.dtype(prop.kind).itemsize
        layout = np.dtype(fields)
        if self._at + layout.itemsize * element.rows > len(self._content):
            if not any(prop.length for prop in element.properties):
                self._cut_short(element, (len(self._content) - self._at) // layout.itemsize)
            return None
        rows = np.frombuffer(self._content, layout, element.rows, self._at)
        for k, prop in enumerate(element.properties):
            if prop.length and (rows[f"n{k}"] != rows[f"n{k}"][0]).any():
                return None
        self._at += layout.itemsize * element.rows
        return {
            prop.name: (_native(rows[f"v{k}"]).ravel(), rows[f"n{k}"].astype(np.int64))
            if prop.length
            else _native(rows[f"v{k}"])
            for k, prop in enumerate(element.properties)
        }

    def _row_by_row(self, element: _Element) -> _Columns:
        lists: list[list[np.ndarray]] = [[] for _ in element.properties]
        counts: list[list[int]] = [[] for _ in element.properties]
        for row in range(element.rows):
            for k, prop in enumerate(element.properties):
                count = 1
                if prop.length:
                    count = self._sane(int(self._take(prop.length, 1, self._at, element, row)[0]), prop)
                    self._at += np.dtype(prop.length).itemsize
                    counts[k].append(count)
                lists[k].append(self._take(prop.kind, count, self._at, element, row))
                self._at += np.dtype(prop.kind).itemsize * count
        columns: _Columns = {}
        for k, prop in enumerate(element.properties):
            values = _native(np.concatenate(lists[k]))
            columns[prop.name] = (values, np.array(counts[k], dtype=np.int64)) if prop.length else values
        return columns

    def _sane(self, count: int, prop: _Property) -> int:
        if not 0 <= count <= len(self._content):
            refuse(
                self._path,
                f"a list of {prop.name} has the length {count}: the file is damaged, or declares other types than it "
                "holds",
            )
        return count

    def _take(self, kind: str, count: int, at: int, element: _Element, row: int) -> np.ndarray:
        if at + np.dtype(kind).itemsize * count > len(self._content):
            self._cut_short(element, row)
        return np.frombuffer(self._content, self._endian + kind, count, at)

    def _cut_short(self, element: _Element, holds: int) -> NoReturn:
        refuse(
            self._path,
            f"declares {element.rows} of {element.name}, but holds {holds}: it was cut short or is damaged; export it "
            "again",
        )

    def end(self) -> None:
        remaining = self._content[self._at :]
        if remaining.strip(b"\0\r\n \t"):
            refuse(
                self._path,
                f"has {len(remaining)} bytes more than its header declares: the counts are wrong, or the file is "
                "damaged",
            )


@np.errstate(invalid="ignore")  # signalling NaNs
def _native(values: np.ndarray) -> np.ndarray:
    return values.astype(np.float64 if values.dtype.kind == "f" else np.int64)
