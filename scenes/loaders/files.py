"""Limits on what is read out of scene and mesh files; their bytes come from `collide.base.given_files`.

A packed file is unpacked piece by piece, and each refusal says the limit and what to do about it.
"""

from __future__ import annotations

import gzip
import zlib
from io import BytesIO
from pathlib import Path

from collide.base.given_files import LARGEST_MESH, read_bytes
from collide.errors import SceneError

#: Lists and mappings inside one another, in YAML, JSON and the nodes of a mesh file.
DEEPEST = 100
#: Nodes that the aliases and merge keys of one YAML file may repeat, counted one by one.
MAX_REPEATED = 1_000_000
#: Files that a scene may include, each time that one is included counted.
MAX_INCLUDED = 1_000
#: Nodes of one mesh file, each time that one is repeated counted.
MAX_NODES = 100_000
#: Facets that the nodes of one mesh file place, each time that a mesh is placed counted.
MAX_PLACED = 50_000_000

_PIECE = 2**20


def read_mesh_bytes(path: Path, largest: int | None = None, what: str = "mesh") -> tuple[str, bytes]:
    """The suffix of a mesh file in small letters, and its bytes; of ``part.stl.gz`` those of ``part.stl``.

    largest : how many bytes are read, unpacked; by default those of a mesh.
    """
    largest = LARGEST_MESH if largest is None else largest
    content = read_bytes(path, largest, what)
    if path.suffix.lower() != ".gz":
        return path.suffix.lower(), content
    return Path(path.stem).suffix.lower(), _unpacked(content, path, largest, what)


def _unpacked(content: bytes, path: Path, largest: int, what: str) -> bytes:
    """The content of a gzip file, looked at piece by piece: a megabyte may hold a gigabyte."""
    unpacked = bytearray()
    try:
        with gzip.GzipFile(fileobj=BytesIO(content)) as packed:
            while piece := packed.read(_PIECE):
                unpacked += piece
                if len(unpacked) > largest:
                    raise SceneError(
                        f"unpacks to more than {largest >> 20} MiB, the most that is read of a {what}: "
                        "make it coarser, or cut it into parts",
                        path=path,
                    )
    except (OSError, EOFError, zlib.error) as error:
        raise SceneError(f"is not a gzip file that can be unpacked: {error}", path=path) from None
    return bytes(unpacked)
