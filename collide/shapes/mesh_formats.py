"""Triangles as files of other programs: STL, PLY, OBJ, OFF, 3MF and GLB, with a colour for every body of origin.

All but GLB hold the same doubles. GLB has numbers of 32 bits: coordinates are rounded, and by how much is logged.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator

import numpy as np

from collide.base.log import log
from collide.base.whole_file import whole_file

#: A facet of a binary STL file: its normal, its corners, two bytes that nobody reads.
_STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_PLY_FACE = np.dtype([("count", "u1"), ("ids", "<i4", 3)])
_PLY_COLOURED = np.dtype([*_PLY_FACE.descr, ("colour", "u1", 3)])
#: Colours of bodies in turn, red, green and blue of 255; told apart by colour-blind readers (M. Okabe, K. Ito, 2002).
PALETTE = np.array(
    [(0, 114, 178), (230, 159, 0), (0, 158, 115), (204, 121, 167), (86, 180, 233), (213, 94, 0), (240, 228, 66),
     (120, 120, 120)],
    dtype=np.uint8,
)
_Body = np.ndarray | None


def write_triangles(path, vertices: np.ndarray, faces: np.ndarray, suffix: str, body: _Body = None) -> None:
    """Write triangles to a file, by its suffix, one of `SUFFIXES`.

    path : the file; an existing file is replaced, by all of the new file or not at all.
    vertices : (n, 3) float64 [m].   faces : (m, 3) ids.   body : (m,) the body of origin of every facet; facets of a
    body have a colour of `PALETTE` in PLY, OFF, 3MF and GLB, a group in OBJ.
    Raises OSError where the file cannot be written.
    """
    with whole_file(path) as file:
        file.writelines(SUFFIXES[suffix](vertices, faces, body))
    if suffix == ".glb" and (moved := _rounded(vertices)[2]) > 0.0:
        log.warning("%s: GLB has numbers of 32 bits; coordinates were rounded by up to %.2g m", path, moved)


def _stl(vertices: np.ndarray, faces: np.ndarray, body: _Body) -> Iterator[bytes]:
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


def _ply(vertices: np.ndarray, faces: np.ndarray, body: _Body) -> Iterator[bytes]:
    """Binary PLY, numbers of 64 bits."""
    properties = "\n".join(f"property double {axis}" for axis in "xyz")
    colours = "" if body is None else "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    yield (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{properties}\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\n{colours}end_header\n"
    ).encode()
    yield vertices.astype("<f8").tobytes()
    rows = np.zeros(len(faces), dtype=_PLY_FACE if body is None else _PLY_COLOURED)
    rows["count"], rows["ids"] = 3, faces
    if body is not None:
        rows["colour"] = _colours(body)
    yield rows.tobytes()


def _obj(vertices: np.ndarray, faces: np.ndarray, body: _Body) -> Iterator[bytes]:
    """Text of all digits: readers get the same doubles. Groups name the bodies of facets."""
    for x, y, z in vertices.tolist():
        yield f"v {x!r} {y!r} {z!r}\n".encode()
    group = None
    for (a, b, c), of in zip((faces + 1).tolist(), [None] * len(faces) if body is None else body.tolist()):
        if of != group:
            group = of
            yield f"g body{of}\n".encode()
        yield f"f {a} {b} {c}\n".encode()


def _off(vertices: np.ndarray, faces: np.ndarray, body: _Body) -> Iterator[bytes]:
    """Text of all digits."""
    yield f"OFF\n{len(vertices)} {len(faces)} 0\n".encode()
    for x, y, z in vertices.tolist():
        yield f"{x!r} {y!r} {z!r}\n".encode()
    rows = faces if body is None else np.column_stack([faces, _colours(body)])
    for row in rows.tolist():
        yield f"3 {' '.join(map(str, row))}\n".encode()


_3MF_TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)
_3MF_RELATIONS = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Target="/3D/3dmodel.model" Id="rel0" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
)


def _3mf(vertices: np.ndarray, faces: np.ndarray, body: _Body) -> Iterator[bytes]:
    """A package with one object in metres, text of all digits; the same bytes at every time of day."""
    import io
    import zipfile  # here: a start of the library need not load it

    packed = io.BytesIO()
    parts = {
        "[Content_Types].xml": _3MF_TYPES, "_rels/.rels": _3MF_RELATIONS,
        "3D/3dmodel.model": "".join(_3mf_model(vertices, faces, body)),
    }
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as members:
        for name, text in parts.items():
            members.writestr(zipfile.ZipInfo(name), text, zipfile.ZIP_DEFLATED)
    yield packed.getvalue()


def _3mf_model(vertices: np.ndarray, faces: np.ndarray, body: _Body) -> Iterator[str]:
    yield (
        '<?xml version="1.0" encoding="UTF-8"?>\n<model unit="meter" xml:lang="en-US" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>\n'
    )
    if body is None:
        yield '<object id="1" type="model"><mesh><vertices>\n'
        materials = [""] * len(faces)
    else:
        bodies, which = np.unique(body, return_inverse=True)
        bases = "".join(
            f'<base name="body {k}" displaycolor="#{bytes(colour).hex().upper()}FF"/>'
            for k, colour in zip(bodies.tolist(), _colours(bodies))
        )
        yield f'<basematerials id="2">{bases}</basematerials>\n'
        yield '<object id="1" type="model" pid="2" pindex="0"><mesh><vertices>\n'
        materials = [f' pid="2" p1="{k}"' for k in which.tolist()]
    for x, y, z in vertices.tolist():
        yield f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>\n'
    yield "</vertices><triangles>\n"
    for (a, b, c), material in zip(faces.tolist(), materials):
        yield f'<triangle v1="{a}" v2="{b}" v3="{c}"{material}/>\n'
    yield '</triangles></mesh></object>\n</resources><build><item objectid="1"/></build></model>\n'


def _glb(vertices: np.ndarray, faces: np.ndarray, body: _Body) -> Iterator[bytes]:
    """One mesh of 32-bit numbers; of facets of several bodies every body has vertices, and a colour, of its own."""
    positions, translation, _ = _rounded(vertices)
    indices, colours = faces, None
    if body is not None:
        keys, indices = np.unique(faces + len(vertices) * body[:, None].astype(np.int64), return_inverse=True)
        positions = positions[keys % len(vertices)]
        colours = np.full((len(keys), 4), 255, dtype=np.uint8)
        colours[:, :3] = _colours(keys // len(vertices))
    chunks = [indices.astype("<u4").tobytes(), positions.tobytes(), *([] if colours is None else [colours.tobytes()])]
    starts = np.cumsum([0, *map(len, chunks)]).tolist()
    accessors = [
        {"bufferView": 0, "componentType": 5125, "count": 3 * len(faces), "type": "SCALAR"},
        {"bufferView": 1, "componentType": 5126, "count": len(positions), "type": "VEC3",
         "min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()},
        {"bufferView": 2, "componentType": 5121, "count": len(positions), "type": "VEC4", "normalized": True},
    ][: len(chunks)]
    attributes = {"POSITION": 1} if colours is None else {"POSITION": 1, "COLOR_0": 2}
    header = {
        "asset": {"version": "2.0", "generator": "collide"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "mesh", **({"translation": translation.tolist()} if translation.any() else {})}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 0, "mode": 4}]}],
        "buffers": [{"byteLength": starts[-1]}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(chunk)} for start, chunk in zip(starts, chunks)
        ],
        "accessors": accessors,
    }
    yield from glb_file(header, chunks)


def glb_file(header: dict, chunks: list[bytes]) -> Iterator[bytes]:
    """The bytes of a GLB file: its JSON, then its buffer, of chunks whose lengths are multiples of 4."""
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    size = sum(map(len, chunks))
    yield b"glTF" + np.array([2, 12 + 8 + len(text) + 8 + size, len(text)], dtype="<u4").tobytes() + b"JSON" + text
    yield np.array([size], dtype="<u4").tobytes() + b"BIN\0"
    yield from chunks


def _rounded(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """(positions of 32 bits, a translation (3,) to add, how far the farthest vertex is off [m]).

    Where coordinates are no numbers of 32 bits they are taken from the middle of their box: the error is then a share
    of the size, however far from the origin the mesh is.
    """
    with np.errstate(over="ignore"):
        positions = vertices.astype("<f4")
    if np.array_equal(positions.astype(np.float64), vertices):
        return positions, np.zeros(3), 0.0
    middle = 0.5 * vertices.min(axis=0) + 0.5 * vertices.max(axis=0)
    positions = (vertices - middle).astype("<f4")
    off = positions.astype(np.float64) + middle - vertices
    return positions, middle, float(np.sqrt(np.square(off).sum(axis=1)).max())


def _colours(body: np.ndarray) -> np.ndarray:
    """(k, 3) uint8 of bodies (k,)."""
    return PALETTE[body % len(PALETTE)]


#: What a mesh can be written as, by the suffix of the file.
SUFFIXES: dict[str, Callable[[np.ndarray, np.ndarray, _Body], Iterator[bytes]]] = {
    ".stl": _stl, ".ply": _ply, ".obj": _obj, ".off": _off, ".3mf": _3mf, ".glb": _glb,
}
