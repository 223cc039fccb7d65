"""PCD, the files of the Point Cloud Library: ascii, binary and binary_compressed, numbers of every type.

https://pointclouds.org/documentation/tutorials/pcd_file_format.html
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from collide.base.given_files import LARGEST_CLOUD, as_text
from collide.fields.lzf_kernel import unpack_lzf
from collide.scenes.loaders.point_text import numbers_in_columns
from collide.scenes.loaders.polygons import quoted, refuse, whole

#: Bytes that a header is looked for in.
_LONGEST_HEADER = 2**16
_LISTS = ("FIELDS", "SIZE", "TYPE", "COUNT")
_NUMBERS = ("WIDTH", "HEIGHT", "POINTS")
_KINDS = {f"{letter}{size}": f"<{letter.lower()}{size}" for letter in "IU" for size in (1, 2, 4, 8)}
_KINDS.update(F4="<f4", F8="<f8")
#: Numbers of one field in a point, at most.
_MAX_COUNT = 2**16


class _Header(NamedTuple):
    """kinds : numpy's type of each field.   counts : how many numbers it has.   begin : of the data, in bytes."""

    fields: list[str]
    kinds: list[str]
    counts: list[int]
    n_points: int
    data: str
    begin: int

    @property
    def point_size(self) -> int:
        """Bytes of a point."""
        return sum(np.dtype(kind).itemsize * count for kind, count in zip(self.kinds, self.counts))


@np.errstate(invalid="ignore")  # signalling NaNs
def read_points(content: bytes, path: Path) -> np.ndarray:
    """(n, 3) float64, finite or not; SceneError where what the header declares is not what follows.

    Fields besides x, y and z are left out, and so is the sensor's pose (VIEWPOINT).
    """
    header = _header(content, path)
    columns = [header.fields.index(axis) for axis in "xyz"]
    if not header.n_points:
        refuse(path, "holds no points")
    if header.data == "ascii":
        return _of_text(content, header, columns, path)
    body = np.frombuffer(content, dtype=np.uint8, offset=header.begin)
    if header.data == "binary_compressed":
        by_field = _unpacked(body, header, path)
        begin = [header.n_points * at for at in _offsets(header)]
        rows = [np.frombuffer(by_field, header.kinds[k], header.n_points, begin[k]) for k in columns]
        return np.stack([row.astype(np.float64) for row in rows], axis=1)
    size = header.n_points * header.point_size
    if len(body) < size or body[size:].tobytes().strip(b"\0\r\n \t"):
        refuse(path, f"its header declares {size} bytes of points, but {len(body)} follow")
    layout = np.dtype({
        "names": ["x", "y", "z"], "formats": [header.kinds[k] for k in columns],
        "offsets": [_offsets(header)[k] for k in columns], "itemsize": header.point_size,
    })
    points = np.frombuffer(content, layout, header.n_points, header.begin)
    return np.stack([points[axis].astype(np.float64) for axis in "xyz"], axis=1)


def _offsets(header: _Header) -> list[int]:
    """Where each field begins, in bytes of a point."""
    sizes = [np.dtype(kind).itemsize * count for kind, count in zip(header.kinds, header.counts)]
    return [0, *np.cumsum(sizes).tolist()]


def _unpacked(body: np.ndarray, header: _Header, path: Path) -> np.ndarray:
    """All numbers of the first field, then of the second, and so on, in bytes."""
    n_packed, size = np.frombuffer(body[:8].tobytes().ljust(8, b"\0"), "<u4").tolist()
    if size != header.n_points * header.point_size or len(body) < 8 + n_packed:
        refuse(
            path, f"its header declares {header.n_points * header.point_size} bytes of points, the data {size} in "
            f"{n_packed} packed bytes, of which {max(len(body) - 8, 0)} follow"
        )
    if size > LARGEST_CLOUD:
        refuse(path, f"unpacks to {size} bytes, more than the {LARGEST_CLOUD >> 20} MiB read of a cloud")
    unpacked = unpack_lzf(body[8 : 8 + n_packed], size)
    if unpacked is None:
        refuse(path, "its compressed data are damaged")
    return unpacked


def _of_text(content: bytes, header: _Header, columns: list[int], path: Path) -> np.ndarray:
    first = content[: header.begin].count(b"\n") + 1
    places = [0, *np.cumsum(header.counts).tolist()]
    text = as_text(content[header.begin :], path)
    points = numbers_in_columns(text, [places[k] for k in columns], path, first=first, width=places[-1])
    if len(points) != header.n_points:
        refuse(path, f"its header declares {header.n_points} points, but {len(points)} follow")
    with np.errstate(over="ignore", invalid="ignore"):  # of the precision that the header declares
        for axis, k in enumerate(columns):
            if header.kinds[k] == "<f4":
                points[:, axis] = points[:, axis].astype(np.float32)
    return points


# --- header -----------------------------------------------------------------------------------------


def _header(content: bytes, path: Path) -> _Header:
    entries: dict[str, list[str]] = {}
    begin, line = 0, 0
    while "DATA" not in entries:
        end = content.find(b"\n", begin, _LONGEST_HEADER)
        if end < 0:
            refuse(path, "its header has no line DATA: is it a PCD, and whole?")
        words, begin, line = content[begin:end].decode("utf-8", errors="replace").split(), end + 1, line + 1
        if not words or words[0].startswith("#"):
            continue
        if words[0] in entries:
            refuse(path, f"its header has two lines {quoted(words[0].encode())}", line)
        entries["FIELDS" if words[0] == "COLUMNS" else words[0]] = words[1:]
        if words[0] in _NUMBERS:
            entries[words[0]] = [str(_count(words, path, line))]
    fields, kinds, counts = _fields(entries, path)
    width, height = (int(entries.get(name, ["1"])[0]) for name in ("WIDTH", "HEIGHT"))
    n_points = int(entries.get("POINTS", [str(width * height)])[0])
    if not {"WIDTH", "POINTS"} & entries.keys():
        refuse(path, "its header must say WIDTH and HEIGHT, or POINTS")
    if "WIDTH" in entries and width * height != n_points:
        refuse(path, f"its header declares {width} × {height} points, and {n_points}")
    data = " ".join(entries["DATA"])
    if data not in ("ascii", "binary", "binary_compressed"):
        refuse(path, f"DATA must be ascii, binary or binary_compressed, got {quoted(data.encode())}")
    return _Header(fields, kinds, counts, n_points, data, begin)


def _fields(entries: dict[str, list[str]], path: Path) -> tuple[list[str], list[str], list[int]]:
    """(names, numpy's types, numbers a point) of the fields."""
    fields = entries.get("FIELDS", [])
    entries.setdefault("COUNT", ["1"] * len(fields))
    lengths = {name: len(entries.get(name, [])) for name in _LISTS}
    if len({*lengths.values()}) != 1:
        listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
        refuse(path, f"its header must say as many of FIELDS, SIZE, TYPE and COUNT, got {listed}")
    if any(fields.count(axis) != 1 for axis in "xyz"):
        refuse(path, f"FIELDS must have x, y and z, once each, got {quoted(' '.join(fields).encode())}")
    kinds = [_KINDS.get(letter + size, "") for letter, size in zip(entries["TYPE"], entries["SIZE"])]
    counts = [_count(["COUNT", word], path, None) for word in entries["COUNT"]]
    for name, kind, count in zip(fields, kinds, counts):
        if not kind or (name in "xyz" and count != 1) or count > _MAX_COUNT:
            refuse(
                path, f"field {quoted(name.encode())}: TYPE must be F of SIZE 4 or 8, or I or U of 1, 2, 4 or 8, and "
                f"COUNT 1 for x, y and z, at most {_MAX_COUNT} for others"
            )
    return fields, kinds, counts


def _count(words: list[str], path: Path, line: int | None) -> int:
    value = whole((words[1] if len(words) == 2 else "").encode(), words[0], path, line or 0)
    if not 0 <= value < 2**40:
        refuse(path, f"{words[0]} must be a number of points, got {value}", line)
    return value
