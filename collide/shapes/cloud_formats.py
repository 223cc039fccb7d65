"""Points as files that other programs read: PCD, PLY, text; all of them hold the same doubles."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from collide.base.whole_file import whole_file
from collide.shapes import mesh_formats

#: Lines made at once.
_LINES = 4096
_NO_FACES = np.zeros((0, 3), dtype=np.int64)


def write_points(path, points: np.ndarray, suffix: str) -> None:
    """Write points (n, 3) float64 [m] to a file, whole or not at all, by its suffix, one of `SUFFIXES`.

    Raises OSError where the file cannot be written.
    """
    with whole_file(path) as file:
        file.writelines(SUFFIXES[suffix](points))


def _pcd(points: np.ndarray) -> Iterator[bytes]:
    """Binary PCD, numbers of 64 bits, seen from the origin."""
    n = len(points)
    yield (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA binary\n"
    ).encode()
    yield points.astype("<f8").tobytes()


def _text(points: np.ndarray) -> Iterator[bytes]:
    """A point a line, of all digits: readers get the same doubles."""
    for begin in range(0, len(points), _LINES):
        yield "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in points[begin : begin + _LINES].tolist()).encode()


#: What a cloud can be written as, by the suffix of the file.
SUFFIXES: dict[str, Callable[[np.ndarray], Iterator[bytes]]] = {
    ".pcd": _pcd, ".ply": lambda points: mesh_formats.SUFFIXES[".ply"](points, _NO_FACES, None), ".xyz": _text,
}
