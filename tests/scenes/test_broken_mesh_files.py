"""Mesh files that are wrong: formats by corruptions. Each is refused with its place and value, or a note says what was done.

The tetrahedron of every file is that of `tetrahedron()`: a file that is read must give it, exactly.
"""

from __future__ import annotations

import base64
import json
import math
import random
import struct
import sys
from collections import Counter

import numpy as np
import pytest

from collide.errors import CollideError, MissingExtra, SceneError
from collide.scenes import load
from collide.scenes import mesh_cache as cache
from collide.scenes.loaders.triangles import read_triangles


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """Prepared meshes away from the user's; the kernels stay where they are."""
    monkeypatch.setattr(cache, "directory", lambda: tmp_path / "cache")


POINTS = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 3.0)]
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]

STL = "solid tetra\n" + "".join(
    "facet normal 0 0 0\nouter loop\n" + "".join("vertex {} {} {}\n".format(*POINTS[k]) for k in face) + "endloop\nendfacet\n" for face in FACES
) + "endsolid tetra\n"
OBJ = "".join("v {} {} {}\n".format(*p) for p in POINTS) + "".join("f {} {} {}\n".format(*(k + 1 for k in face)) for face in FACES)
OFF = "OFF\n4 4 6\n" + "".join("{} {} {}\n".format(*p) for p in POINTS) + "".join("3 {} {} {}\n".format(*face) for face in FACES)
_PLY = (
    "ply\nformat {} 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
)
PLY = _PLY.format("ascii") + "".join("{} {} {}\n".format(*p) for p in POINTS) + "".join("3 {} {} {}\n".format(*face) for face in FACES)
DAE = f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="metre" meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="s"><float_array id="a" count="12">{" ".join(str(x) for p in POINTS for x in p)}</float_array>
<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{" ".join(str(k) for f in FACES for k in f)}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node id="n"><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#w"/></scene></COLLADA>
"""


def binary_stl(said: int = 4, left_out: int = 0) -> bytes:
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *(x for k in face for x in POINTS[k]), 0) for face in FACES)
    return b"binary".ljust(80) + struct.pack("<I", said) + facets[: len(facets) - left_out]


def binary_ply(order: str = "<", rows: bytes | None = None) -> bytes:
    words = "binary_little_endian" if order == "<" else "binary_big_endian"
    vertices = b"".join(struct.pack(order + "3d", *p) for p in POINTS)
    faces = b"".join(struct.pack(order + "B3i", 3, *face) for face in FACES) if rows is None else rows
    return _PLY.format(words).encode() + vertices + faces


def gltf(edit=lambda header: None, **numbers) -> dict:
    """The header of a glTF whose buffer is in it.   numbers : ``points`` and ``corners`` in place of its own."""
    data = np.array(numbers.get("points", POINTS), "<f4").tobytes() + np.array(numbers.get("corners", FACES), "<u2").tobytes()
    header = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": "tetra"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
        "buffers": [{"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
    }
    edit(header)
    return header


def glb(edit=lambda header: None) -> bytes:
    header = gltf(edit)
    data = base64.b64decode(header["buffers"][0].pop("uri").split(",")[1])
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


GOOD = {
    "ascii.stl": STL, "binary.stl": binary_stl(), "a.obj": OBJ, "a.off": OFF, "ascii.ply": PLY, "little.ply": binary_ply("<"),
    "big.ply": binary_ply(">"), "a.dae": DAE, "a.gltf": json.dumps(gltf()), "a.glb": glb(),
    "relative.obj": OBJ.split("f")[0] + "".join("f {} {} {}\n".format(*(k - 4 for k in face)) for face in FACES),
    "between.obj": "".join("v {} {} {}\n".format(*p) for p in POINTS[:3]) + "f -3 -1 -2\n" + "v 0 0 3\nf -4 -3 4\nf 2 -2 -1\nf -2/1/1 1/2/3 -1//4\n",
    "continued.obj": OBJ.replace("f 1 3 2", "f 1 \\\n3 \\\n2"), "crlf.obj": OBJ.replace("\n", "\r\n"), "crlf.ply": PLY.replace("\n", "\r\n"),
    "crlf.stl": STL.replace("\n", "\r\n"), "one line.off": OFF.replace("OFF\n", "OFF "), "comments.off": "# of ours\n" + OFF.replace("\n3 ", " # here\n3 "),
    "solid in the header.stl": b"solid" + binary_stl()[5:], "floats.off": OFF.replace("3 0 2 1", "3 0 2.0 1"),
}
NEEDS_TRIMESH = (".dae", ".gltf", ".glb")


def written(folder, name: str, content) -> str:
    """The path of a file of this content; skips where the format's library is not installed."""
    if name.endswith(NEEDS_TRIMESH):
        pytest.importorskip("trimesh")
    if name.endswith(".dae"):
        pytest.importorskip("collada")
    content = json.dumps(content) if isinstance(content, dict) else content
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return folder / name


def corners_of(vertices, faces) -> set:
    """The facets as corners, each from its least corner on: the order of vertices and facets is nobody's business."""
    found = set()
    for a, b, c in np.asarray(vertices, dtype=float)[np.asarray(faces)].tolist():
        found.add(min((tuple(a), tuple(b), tuple(c)), (tuple(b), tuple(c), tuple(a)), (tuple(c), tuple(a), tuple(b))))
    return found


@pytest.mark.parametrize("name", GOOD)
def test_what_is_right_is_read(tmp_path, name):
    ((_, vertices, faces),), notes = read_triangles(written(tmp_path, name, GOOD[name]))
    assert notes == [] and corners_of(vertices, faces) == corners_of(POINTS, FACES) and len(faces) == 4


@pytest.mark.parametrize("name", GOOD)
def test_what_each_format_needs(tmp_path, name, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    path = tmp_path / name
    content = GOOD[name]
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    if name.endswith(NEEDS_TRIMESH):
        with pytest.raises(MissingExtra, match=r"trimesh is needed to read the mesh .*robots"):
            load(path)
    else:
        assert len(load(path).bodies) == 1


def put(path: str, value):
    """gltf edit: ``accessors.0.count`` becomes the value; the entry is left out where it is None."""
    *above, last = (int(key) if key.isdigit() else key for key in path.split("."))

    def edit(header):
        for key in above:
            header = header[key]
        if value is None:
            del header[last]
        else:
            header[last] = value

    return edit


def nested(depth: int) -> str:
    return DAE.replace('<node id="n">', "<node>" * depth + '<node id="n">').replace("</node>", "</node>" * (depth + 1))


def doubled(levels: int) -> str:
    """Nodes that each repeat the next one twice."""
    nodes = "".join(f'<node id="n{k}"><instance_node url="#n{k + 1}"/><instance_node url="#n{k + 1}"/></node>' for k in range(levels))
    library = f'<library_nodes>{nodes}<node id="n{levels}"><instance_geometry url="#g"/></node></library_nodes>'
    return DAE.replace("<library_visual_scenes>", library + "<library_visual_scenes>").replace(
        '<instance_geometry url="#g"/></node></visual', '<instance_node url="#n0"/></node></visual'
    )


BAD = {
    # name of the case: (file, content, what the refusal says)
    "stl header says more": ("a.stl", binary_stl(5), "says 5 facets, but the file holds 4"),
    "stl header says fewer": ("a.stl", binary_stl(3), "says 3 facets, but the file holds 4"),
    "stl header says 4 billion": ("a.stl", binary_stl(2**32 - 1), "says 4294967295 facets, but the file holds 4: it was cut short"),
    "stl cut in a facet": ("a.stl", binary_stl(4, 7), r"says 4 facets, but the file holds 3\.86.*export it again"),
    "stl cut in the header": ("a.stl", binary_stl()[:70], "is no STL: it has 70 bytes"),
    "stl empty": ("a.stl", b"", "is no STL: it has 0 bytes"),
    "stl NaN": ("a.stl", binary_stl()[:96] + struct.pack("<f", math.nan) + binary_stl()[100:], "facet 0 is .*must be finite"),
    "stl ascii NaN": ("a.stl", STL.replace("vertex 1.0", "vertex nan", 1), "line 6: a coordinate must be a finite number, got 'nan'"),
    "stl ascii huge": ("a.stl", STL.replace("vertex 1.0", "vertex 1e999", 1), "line 6: .*got '1e999'"),
    "stl ascii text": ("a.stl", STL.replace("vertex 1.0", "vertex 1,0", 1), "line 6: .*got '1,0'"),
    "stl ascii two corners": ("a.stl", STL.replace("vertex 1.0 0.0 0.0\n", "", 1), "line 6: a facet of STL has three corners, this one 2"),
    "stl ascii four corners": ("a.stl", STL.replace("vertex 1.0 0.0 0.0\n", "vertex 1.0 0.0 0.0\n" * 2, 1), "line 8: .*this one 4"),
    "stl ascii two numbers": ("a.stl", STL.replace("vertex 1.0 0.0 0.0", "vertex 1.0 0.0", 1), "line 6: a vertex has three coordinates"),
    "stl ascii cut": ("a.stl", STL[:-30], "ends after vertex|ends after endloop|ends after endfacet|must stand here"),
    "obj 0": ("a.obj", OBJ.replace("f 1 3 2", "f 0 1 2"), "line 5: a face names vertex 0, but ids begin at 1: 'f 0 1 2'"),
    "obj beyond": ("a.obj", OBJ.replace("f 1 3 2", "f 1 3 5"), r"line 5: face 0 names vertex 5, but there are 1 \.\.\. 4"),
    "obj huge": ("a.obj", OBJ.replace("f 1 3 2", f"f 1 3 {10**30}"), "line 5: face 0 names vertex"),
    "obj before the first": ("a.obj", OBJ.replace("f 1 3 2", "f -5 -2 -1"), "line 5: a face names vertex -5, but there are 4 so far"),
    "obj NaN": ("a.obj", OBJ.replace("v 1.0", "v nan"), "line 2: a coordinate must be a finite number, got 'nan'"),
    "obj inf": ("a.obj", OBJ.replace("v 1.0", "v -inf"), "line 2: .*got '-inf'"),
    "obj underscore": ("a.obj", OBJ.replace("v 1.0", "v 1_0"), "line 2: .*got '1_0'"),
    "obj text": ("a.obj", OBJ.replace("f 1 3 2", "f a b c"), "line 5: a face names vertices by whole numbers, got 'f a b c'"),
    "obj fraction": ("a.obj", OBJ.replace("f 1 3 2", "f 1.5 3 2"), "line 5: .*whole numbers, got 'f 1.5 3 2'"),
    "obj two numbers": ("a.obj", OBJ.replace("v 1.0 0.0 0.0", "v 1.0 0.0"), "line 2: a vertex has three coordinates, got 'v 1.0 0.0'"),
    "obj no vertices": ("a.obj", "f 1 2 3\n", "line 1: face 0 names vertex 1, but there are none"),
    "off fewer faces": ("a.off", OFF[: OFF.rindex("3 ")], "line 2: says 4 vertices and 4 faces, 8 lines, but 7 follow"),
    "off more faces": ("a.off", OFF + "3 0 1 2\n", "line 2: .*8 lines, but 9 follow"),
    "off more vertices said": ("a.off", OFF.replace("4 4 6", "3000000000 4 6"), "line 2: .*but 8 follow"),
    "off negative count": ("a.off", OFF.replace("4 4 6", "-4 4 6"), "line 2: says -4 vertices"),
    "off count no number": ("a.off", OFF.replace("4 4 6", "four 4 6"), "line 2: a count must be a whole number, got 'four'"),
    "off negative id": ("a.off", OFF.replace("3 0 2 1", "3 0 2 -1"), r"line 7: face 0 names vertex -1, but there are 0 \.\.\. 3"),
    "off id beyond": ("a.off", OFF.replace("3 0 2 1", "3 0 2 4"), "line 7: face 0 names vertex 4"),
    "off id fraction": ("a.off", OFF.replace("3 0 2 1", "3 0 2.5 1"), "line 7: a vertex of a face must be a whole number, got '2.5'"),
    "off too few ids": ("a.off", OFF.replace("3 0 2 1", "4 0 2 1"), "line 7: a face of 4 corners has 3 numbers"),
    "off NaN": ("a.off", OFF.replace("1.0 0.0", "nan 0.0"), "line 4: .*got 'nan'"),
    "off four dimensions": ("a.off", OFF.replace("OFF", "4OFF"), "4OFF is not read"),
    "off binary": ("a.off", "OFF BINARY\n" + OFF[4:], "OFF BINARY is not read"),
    "off of something else": ("a.off", "PLY\n", "is no OFF: it begins with 'PLY'"),
    "ply fewer faces": ("a.ply", PLY[: PLY.rindex("3 ")], "declares 4 of face, but holds 3: it was cut short"),
    "ply more faces": ("a.ply", PLY + "3 0 1 2\n", "line 18: 1 more lines than its header declares, the first is '3 0 1 2'"),
    "ply vertices said": ("a.ply", PLY.replace("vertex 4", "vertex 3000000000"), "line 14: a row of vertex has 3 numbers, got 4|declares 3000000000 of vertex, but holds 8"),
    "ply fewer vertices said": ("a.ply", PLY.replace("vertex 4", "vertex 3"), "line 13: .*"),
    "ply negative count": ("a.ply", PLY.replace("vertex 4", "vertex -3"), "line 3: declares -3 of vertex"),
    "ply count no number": ("a.ply", PLY.replace("vertex 4", "vertex many"), "line 3: the count of vertex must be a whole number, got 'many'"),
    "ply negative id": ("a.ply", PLY.replace("3 0 2 1", "3 0 2 -1"), "line 14: face 0 names vertex -1"),
    "ply id beyond": ("a.ply", PLY.replace("3 0 2 1", "3 0 2 4"), "line 14: face 0 names vertex 4"),
    "ply id fraction": ("a.ply", PLY.replace("3 0 2 1", "3 0 2.5 1"), "line 14: vertex_indices must be a whole number, got '2.5'"),
    "ply length": ("a.ply", PLY.replace("3 0 2 1", "4 0 2 1"), "line 14: vertex_indices has 4 numbers, got 3"),
    "ply negative length": ("a.ply", PLY.replace("3 0 2 1", "-3 0 2 1"), "line 14: vertex_indices has -3 numbers"),
    "ply NaN": ("a.ply", PLY.replace("1.0 0.0", "nan 0.0"), r"vertex 1 is \[nan, 0.0, 0.0\]: coordinates must be finite"),
    "ply text": ("a.ply", PLY.replace("1.0 0.0", "x 0.0"), "line 11: x must be a number, got 'x'"),
    "ply strips": ("a.ply", PLY.replace("element face", "element tristrips"), "its faces are not lists called vertex_indices"),
    "ply header": ("a.ply", PLY.replace("property double x", "property triple x"), "line 4: this line of the header is not understood"),
    "ply no end": ("a.ply", PLY[:100], "no line end_header"),
    "ply binary cut": ("a.ply", binary_ply()[:-5], "declares 4 of face, but holds 3: it was cut short"),
    "ply binary more": ("a.ply", binary_ply() + b"more", "has 4 bytes more than its header declares"),
    "ply binary said": ("a.ply", binary_ply().replace(b"vertex 4", b"vertex 3000000000"), "declares 3000000000 of vertex, but holds"),
    "ply binary id": ("a.ply", binary_ply(">", struct.pack(">B3i", 3, 0, 2, -1) * 4), "face 0 names vertex -1"),
    "ply binary lengths": ("a.ply", binary_ply("<", struct.pack("<B3i", 250, 0, 2, 1) * 4), "declares 4 of face, but holds 0"),
    "dae NaN": ("a.dae", DAE.replace("1.0", "nan", 1).replace('version="nan', 'version="1.0'), '<float_array id="a">: number 3 is nan'),
    "dae text": ("a.dae", DAE.replace("3.0<", "x<"), "must hold a number at every place, got 'x'"),
    "dae negative id": ("a.dae", DAE.replace("<p>0 2 1", "<p>0 2 -1"), r"<triangles> <p>: corner 2 is vertex -1, but there are 0 \.\.\. 3"),
    "dae id beyond": ("a.dae", DAE.replace("<p>0 2 1", "<p>0 2 4"), "corner 2 is vertex 4"),
    "dae id no number": ("a.dae", DAE.replace("<p>0 2 1", "<p>0 2 NaN"), "must hold a whole number at every place, got 'NaN'"),
    "dae fewer ids": ("a.dae", DAE.replace("<p>0 2 1", "<p>"), "says 12 numbers, 1 a corner, but <p> holds 9"),
    "dae count": ("a.dae", DAE.replace('<triangles count="4"', '<triangles count="5"'), "says 15 numbers.*holds 12"),
    "dae negative count": ("a.dae", DAE.replace('<triangles count="4"', '<triangles count="-4"'), "count must be a whole number, 0 or more, got '-4'"),
    "dae array count": ("a.dae", DAE.replace('count="12"', 'count="15"'), "says count 15, but holds 12 numbers"),
    "dae accessor count": ("a.dae", DAE.replace('source="#a" count="4"', 'source="#a" count="5"'), "says 5 rows of 3, but there are 12 numbers"),
    "dae unit 0": ("a.dae", DAE.replace('meter="1"', 'meter="0"'), "meter must be a finite number above 0, got '0'"),
    "dae unit negative": ("a.dae", DAE.replace('meter="1"', 'meter="-1"'), "above 0, got '-1'"),
    "dae unit text": ("a.dae", DAE.replace('meter="1"', 'meter="x"'), "above 0, got 'x'"),
    "dae unit NaN": ("a.dae", DAE.replace('meter="1"', 'meter="nan"'), "above 0, got 'nan'"),
    "dae no source": ("a.dae", DAE.replace('source="#s"', 'source="#gone"'), "source names '#gone', which is not in the file"),
    "dae nested": ("a.dae", nested(5000), "nodes stand more than 100 deep in one another"),
    "dae doubled": ("a.dae", doubled(60), "with what it repeats it is .* nodes; read are at most 100,000"),
    "dae circle": ("a.dae", doubled(2).replace('<node id="n2">', '<node id="n2"><instance_node url="#n0"/>'), "stands below itself"),
    "dae cut": ("a.dae", DAE[:-40], "is not well-formed XML"),
    "gltf count": ("a.gltf", gltf(put("accessors.0.count", 5)), r"accessors\[0\]: has 5 entries, 60 bytes, but its bufferView has 48"),
    "gltf negative count": ("a.gltf", gltf(put("accessors.0.count", -4)), r"accessors\[0\]\.count: must be a whole number, 0 or more, got -4"),
    "gltf corners": ("a.gltf", gltf(put("accessors.1.count", 11)), "is made of triangles, but has 11 corners"),
    "gltf id beyond": ("a.gltf", gltf(corners=[(0, 2, 4), *FACES[1:]]), r"face 0 names vertices \[0, 2, 4\], but there are 0 … 3"),
    "gltf NaN": ("a.gltf", gltf(points=[*POINTS[:3], (0, 0, math.nan)]), "vertex 3 is .*nan.*: coordinates must be finite"),
    "gltf negative mesh": ("a.gltf", gltf(put("nodes.0.mesh", -1)), r"nodes\[0\]\.mesh: names entry -1 of meshes, which has 1"),
    "gltf negative accessor": ("a.gltf", gltf(put("meshes.0.primitives.0.indices", -1)), "names entry -1 of accessors, which has 2"),
    "gltf negative view": ("a.gltf", gltf(put("accessors.0.bufferView", -2)), "names entry -2 of bufferViews"),
    "gltf negative buffer": ("a.gltf", gltf(put("bufferViews.0.buffer", -1)), "names entry -1 of buffers"),
    "gltf negative offset": ("a.gltf", gltf(put("bufferViews.1.byteOffset", -24)), r"bufferViews\[1\]\.byteOffset: must be a whole number"),
    "gltf view beyond": ("a.gltf", gltf(put("bufferViews.1.byteLength", 9999)), "ends at byte 10047, but its buffer has 72"),
    "gltf sparse": ("a.gltf", gltf(put("accessors.0.sparse", {})), "its numbers are sparse, which is not read"),
    "gltf no view": ("a.gltf", gltf(put("accessors.0.bufferView", None)), "its numbers are kept by an extension"),
    "gltf signed ids": ("a.gltf", gltf(put("accessors.1.componentType", 5122)), "indices must be whole numbers without a sign, got type 5122"),
    "gltf packed": ("a.gltf", gltf(put("meshes.0.primitives.0.extensions", {"KHR_draco_mesh_compression": {}})), "its vertices are packed"),
    "gltf matrix": ("a.gltf", gltf(put("nodes.0.matrix", [1, 2])), r"nodes\[0\]\.matrix: must be 16 finite numbers, got \[1, 2\]"),
    "gltf translation": ("a.gltf", json.dumps(gltf(put("nodes.0.translation", [0, 0, math.inf]))), "must be 3 finite numbers"),
    "gltf circle": ("a.gltf", gltf(put("nodes.0.children", [0])), r"nodes\[0\]: stands below itself"),
    "gltf two parents": ("a.gltf", gltf(put("nodes", [{"children": [1, 1]}, {"mesh": 0}])), "node 1 is a child of node 0 too"),
    "gltf deep": ("a.gltf", "[" * 100_000, "lists and mappings stand more than 100 deep"),
    "gltf buffer outside": ("a.gltf", gltf(put("buffers.0.uri", "../x.bin")), "'../x.bin' is not beside the file"),
    "gltf buffer gone": ("a.gltf", gltf(put("buffers.0.uri", "x.bin")), r"x\.bin: no such file"),
    "gltf no list": ("a.gltf", gltf(put("nodes", 5)), "nodes: must be a list of mappings, got 5"),
    "gltf primitive": ("a.gltf", gltf(put("meshes.0.primitives", 5)), "is not glTF: an entry is missing or of another type"),
    "glb length": ("a.glb", glb()[:8] + struct.pack("<I", 99) + glb()[12:], "says that it has 99 bytes, but it has"),
    "glb cut": ("a.glb", glb()[:-20], "cut short or is damaged"),
    "glb chunk": ("a.glb", glb()[:12] + struct.pack("<I", 2**31) + glb()[16:], "a part of it says that it has 2147483648 bytes"),
    "glb empty": ("a.glb", b"glTF" + bytes(40), "is GLB of version 0"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_refused_with_place_and_value(tmp_path, case):
    name, content, message = BAD[case]
    with pytest.raises(SceneError, match=message) as refusal:
        load(written(tmp_path, name, content))
    assert str(refusal.value).startswith(str(tmp_path)) and "pip install" not in str(refusal.value) and len(str(refusal.value)) < 1000


@pytest.mark.parametrize(
    ("name", "content", "note"),
    [
        ("a.obj", OBJ + "f 1 2\n", "faces of fewer than three corners were left out: line 9"),
        ("a.off", OFF.replace("4 4 6", "4 5 6") + "2 0 1\n", "faces of fewer than three corners were left out: line 11"),
        ("a.ply", PLY.replace("face 4", "face 5") + "2 0 1\n", "faces of fewer than three corners were left out: face 4"),
        ("a.dae", DAE.replace('meter="1"', 'meter="0.001"'), "the file says its unit is 0.001 m; it was scaled to metres"),
        (
            "a.dae",
            DAE.replace("</node>", '<instance_controller url="#c"/></node>'),
            "meshes that bones move (<instance_controller>) were not read",
        ),
        (
            "a.dae",
            DAE.replace("Z_UP", "Y_UP"),
            "a.dae: <up_axis> Y_UP turned nothing: coordinates are as in the file, as RViz has them",
        ),
        ("a.gltf", gltf(lambda h: h["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 1})), "is lines (mode 1) and was not read"),
    ],
)
def test_what_is_left_out_is_noted(tmp_path, name, content, note):
    scene = load(written(tmp_path, name, content))
    assert any(note in one for one in scene.notes), scene.notes
    assert len(scene.bodies) == 1 and len(scene.bodies[0].shape.points) == 4


@pytest.mark.parametrize("name", ["ascii.stl", "binary.stl", "a.off", "ascii.ply", "little.ply", "big.ply", "a.dae", "a.glb", "a.gltf"])
def test_a_file_that_is_cut_short_is_refused(tmp_path, name):
    """Wherever it is cut: no format but OBJ lets a shorter file pass for a whole one, unless it loses the last number's digits or blanks."""
    content = GOOD[name].encode() if isinstance(GOOD[name], str) else GOOD[name]
    last = len(content.rstrip()) - (2 if name in ("a.off", "ascii.ply") else len("tetra") if name == "ascii.stl" else 0)
    refused = 0
    for k in random.Random(name).sample(range(last), min(last, 60)):
        with pytest.raises(CollideError):
            load(written(tmp_path, name, content[:k]))
        refused += 1
    assert refused > 40


@pytest.mark.many(2)
@pytest.mark.parametrize("name", GOOD)
def test_damaged_bytes_are_refused_or_read_never_more(tmp_path, name):
    """A few bytes of a file changed at random: an error of ours, or a scene of finite meshes."""
    content = bytearray(GOOD[name].encode() if isinstance(GOOD[name], str) else GOOD[name])
    rng, outcomes = random.Random(f"damage {name}"), Counter()
    for _ in range(60):
        spoilt = bytearray(content)
        for _ in range(rng.choice((1, 1, 2, 4))):
            at = rng.randrange(len(spoilt))
            spoilt[at : at + rng.choice((0, 1, 1, 3))] = rng.choice((b"-", b"9", b"0", b" ", b"\n", b"\xff", b"nan", bytes([rng.randrange(256)])))
        try:
            scene = load(written(tmp_path, name, bytes(spoilt)))
        except CollideError as error:
            outcomes["refused"] += 1
            assert len(str(error)) < 1000
            continue
        outcomes["read"] += 1
        points = [getattr(body.shape, "vertices", None) for body in scene.bodies]
        assert all(np.isfinite(one).all() for one in points if one is not None)
    assert outcomes["refused"] >= 5, outcomes


def test_numbers_as_trimesh_reads_them(tmp_path):
    """Polygons, several objects, and precision: the facets are trimesh's, whose readers these took the place of."""
    trimesh = pytest.importorskip("trimesh")
    rng = np.random.default_rng(0)
    points = rng.normal(size=(30, 3)).astype(np.float32).astype(float)
    polygons = [rng.permutation(30)[: rng.integers(3, 7)].tolist() for _ in range(40)]
    rows = "".join("{!r} {!r} {!r}\n".format(*row) for row in points.tolist())
    files = {
        "p.obj": rows.replace("\n", "\nv ").join(["v ", ""])[: -len("v ")] + "".join(f"f {' '.join(str(k + 1) for k in p)}\n" for p in polygons),
        "p.off": f"OFF\n30 40 0\n{rows}" + "".join(f"{len(p)} {' '.join(map(str, p))}\n" for p in polygons),
        "p.ply": _PLY.format("ascii").replace("vertex 4", "vertex 30").replace("face 4", "face 40").replace("double", "float") + rows
        + "".join(f"{len(p)} {' '.join(map(str, p))}\n" for p in polygons),
    }
    for name, text in files.items():
        path = written(tmp_path, name, text)
        ((_, vertices, faces),), _ = read_triangles(path)
        assert len(faces) == sum(len(p) - 2 for p in polygons)
        if name == "p.obj":  # trimesh cannot read the polygons of an OFF
            theirs = trimesh.load_scene(str(path), process=False).to_mesh()
        assert corners_of(vertices, faces) == corners_of(theirs.vertices, theirs.faces), name


def test_primitives_of_one_gltf_mesh_have_names_that_stay(tmp_path):
    """trimesh ends them at random, which would make every run's order of bodies another."""
    header = gltf(lambda h: h["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "indices": 1}))
    for _ in range(2):
        parts, _ = read_triangles(written(tmp_path, "a.gltf", header))
        assert [name for name, _, _ in parts] == ["tetra_1", "tetra_2"]


def test_tiny_moves_of_nodes_are_kept(tmp_path):
    """trimesh leaves out what moves by less than 1e-8."""
    nodes = [{"children": [1], "translation": [4e-9, 0, 0]}, {"mesh": 0, "translation": [0, 8e-9, 0]}]
    ((_, vertices, _),), _ = read_triangles(written(tmp_path, "a.gltf", gltf(put("nodes", nodes))))
    assert vertices[0].tolist() == [4e-9, 8e-9, 0]
