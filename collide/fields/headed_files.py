"""Files with a header of text lines and a line ``data``, then bytes: OctoMap's, and binvox."""

from __future__ import annotations

import math
from pathlib import Path

from collide.base import argument_checks as checks
from collide.base.given_files import LARGEST_CLOUD, read_bytes
from collide.errors import InvalidShape, SceneError

#: Bytes that a header is looked for in.
_LONGEST_HEADER = 2**16


def content_of(kind: str, path: str | Path) -> bytes:
    """The bytes of a file of at most 2 GiB. kind : "binvox", for messages. Raises InvalidShape."""
    try:
        return read_bytes(checks.file_path(f"{kind}: path", path, InvalidShape), LARGEST_CLOUD, "cloud")
    except SceneError as error:
        raise InvalidShape(f"{kind}: {error}") from None


def first_line(content: bytes) -> str:
    """The first line, without white space at its end, cut to 80 bytes."""
    return content[:80].partition(b"\n")[0].decode("utf-8", errors="replace").rstrip()


def header_of(content: bytes, what: str) -> tuple[dict[str, str], int]:
    """(lines by their first words, without comments, where the data begin). Raises InvalidShape without a line data."""
    entries: dict[str, str] = {}
    begin = 0
    while True:
        end = content.find(b"\n", begin, _LONGEST_HEADER)
        if end < 0:
            raise InvalidShape(f"{what}: its header has no line 'data': was it cut short?")
        line, begin = content[begin:end].decode("utf-8", errors="replace").strip(), end + 1
        if line == "data":
            return entries, begin
        if line and not line.startswith("#"):
            name, _, value = line.partition(" ")
            entries[name] = value.strip()


def numbers_of(entries: dict[str, str], name: str, n: int, what: str) -> list[float]:
    """Numbers of a line of a header. Raises InvalidShape for anything but n finite numbers."""
    words = entries.get(name, "").split()
    try:
        read = [float(word) for word in words]
    except ValueError:
        read = []
    if len(read) != n or not all(map(math.isfinite, read)):
        raise InvalidShape(f"{what}: {name} must be {n} finite number{'s' * (n > 1)}, got "
                           f"{checks.brief(entries.get(name))}")
    return read
