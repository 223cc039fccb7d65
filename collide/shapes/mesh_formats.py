"""Triangles as files that other programs read: STL, PLY, OBJ; all of them hold the same doubles."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from collide.base.whole_file import whole_file

#: A facet of a binary STL file: its normal, its corners, two bytes that nobody reads.
_STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_PLY_FACE = np.dtype([("count", "u1"), ("ids", "<i4", 3)])


def write_triangles(path, vertices: np.ndarray, faces: np.ndarray, suffix: str) -> None:
    """Write triangles to a file, by its suffix, one of `SUFFIXES`.

    path : the file; an existing file is replaced, by all of the new file or not at all.
    vertices : (n, 3) float64 [m].   faces : (m, 3) ids.
    Raises OSError where the file cannot be written.
    """
    with whole_file(path) as file:
        file.writelines(SUFFIXES[suffix](vertices, faces))


def _stl(vertices: np.ndarray, faces: np.ndarray) -> Iterator[bytes]:
    """Binary where its numbers of 32 bits are the coordinates, else text of all digits; normals are the reader's.

    Rounded corners could fall together, or bend what is flat.
    """
    with np.errstate(over="ignore"):
        corners = vertices.astype("<f4")[faces]
    if np.array_equal(corners.astype(np.float64), vertices[faces]):
        facets = np.zeros(len(faces), dtype=_STL_FACET)
        facets["corners"] = corners
        yield b"binary STL by collide".ljust(80) + len(faces).to_bytes(4, "little")
        yield facets.tobytes()
        return
    yield b"solid mesh\n"
    for triangle in vertices[faces].tolist():
        lines = "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in triangle)
        yield f"facet normal 0 0 0\nouter loop\n{lines}endloop\nendfacet\n".encode()
    yield b"endsolid mesh\n"


def _ply(vertices: np.ndarray, faces: np.ndarray) -> Iterator[bytes]:
    """Binary PLY, numbers of 64 bits."""
    properties = "\n".join(f"property double {axis}" for axis in "xyz")
    yield (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{properties}\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    yield vertices.astype("<f8").tobytes()
    rows = np.zeros(len(faces), dtype=_PLY_FACE)
    rows["count"], rows["ids"] = 3, faces
    yield rows.tobytes()


def _obj(vertices: np.ndarray, faces: np.ndarray) -> Iterator[bytes]:
    """Text of all digits: readers get the same doubles."""
    for x, y, z in vertices.tolist():
        yield f"v {x!r} {y!r} {z!r}\n".encode()
    for a, b, c in (faces + 1).tolist():
        yield f"f {a} {b} {c}\n".encode()


#: What a mesh can be written as, by the suffix of the file.
SUFFIXES: dict[str, Callable[[np.ndarray, np.ndarray], Iterator[bytes]]] = {".stl": _stl, ".ply": _ply, ".obj": _obj}
