"""Meshes as files of other programs: the same doubles come back, other readers agree, and wrong names are refused."""

from __future__ import annotations

import io
import json
import logging
import zipfile
from collections import Counter

import numpy as np
import pytest
import surfaces

import collide
from collide.errors import InvalidArgument, InvalidShape, SceneError
from collide.scenes import load
from collide.scenes.loaders.triangles import read_triangles
from collide.shapes.mesh_formats import PALETTE, SUFFIXES

EXACT = [suffix for suffix in SUFFIXES if suffix != ".glb"]


def odd_torus(seed: int = 3) -> collide.Mesh:
    """Coordinates that no 32 bits hold, some tiny, far from the origin."""
    rng = np.random.default_rng(seed)
    vertices, faces = surfaces.torus()
    vertices = vertices * rng.uniform(0.5, 2.0, 3) + rng.uniform(-1e3, 1e3, 3)
    vertices[5] = vertices[5].astype(np.float32)
    return collide.Mesh(vertices, faces)


def corners(vertices, faces) -> Counter:
    return Counter(tuple(map(tuple, triangle)) for triangle in np.asarray(vertices)[np.asarray(faces)].tolist())


@pytest.mark.parametrize("suffix", EXACT)
def test_triangles_come_back_as_the_same_doubles(suffix, tmp_path):
    mesh = odd_torus()
    mesh.save(tmp_path / f"t{suffix}")
    ((_, vertices, faces),), _ = read_triangles(tmp_path / f"t{suffix}")
    assert np.array_equal(vertices[faces], mesh.vertices[mesh.faces])
    (body,) = load(tmp_path / f"t{suffix}").bodies
    assert body.shape.solid and body.shape.volume == mesh.volume


def test_glb_rounds_relative_to_the_middle_and_says_so(tmp_path, caplog):
    pytest.importorskip("trimesh", reason="trimesh reads the meshes")
    mesh = odd_torus()
    with caplog.at_level(logging.WARNING, logger="collide"):
        mesh.save(tmp_path / "t.glb")
    (record,) = caplog.records
    told = float(record.getMessage().split("by up to ")[1].split()[0])
    ((_, vertices, faces),), _ = read_triangles(tmp_path / "t.glb")
    off = np.sqrt(np.square(vertices[faces] - mesh.vertices[mesh.faces]).sum(axis=-1)).max()
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    assert 0.0 < off <= 1.01 * told <= 2.0**-22 * size
    caplog.clear()
    exact = collide.Mesh(*surfaces.box())
    exact.save(tmp_path / "box.glb")
    ((_, vertices, faces),), _ = read_triangles(tmp_path / "box.glb")
    assert np.array_equal(vertices[faces], exact.vertices[exact.faces]) and not caplog.records


@pytest.mark.parametrize("suffix", list(SUFFIXES))
def test_another_reader_sees_the_same_triangles(suffix, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    if suffix == ".3mf":
        pytest.importorskip("lxml")
        pytest.importorskip("networkx")
    vertices, faces = surfaces.torus()
    vertices = vertices.astype(np.float32).astype(np.float64)
    collide.Mesh(vertices, faces).save(tmp_path / f"t{suffix}")
    read = trimesh.load(tmp_path / f"t{suffix}", force="mesh", process=False)
    assert np.allclose(np.asarray(read.vertices)[read.faces], vertices[faces], atol=1e-6, rtol=0.0)
    assert len(read.faces) == len(faces)


def crossing_boxes() -> collide.solids.boolean.BooleanResult:
    return collide.boolean(
        collide.Box((1, 1, 1)), collide.Box((0.4, 0.4, 3)), np.eye(4), collide.pose((0.1, 0.0, 0.0)), "union"
    )


def colours_in(path) -> Counter:
    """What a file says of colours, by a reader of its own: colour → how many facets."""
    suffix, content = path.suffix, path.read_bytes()
    if suffix == ".off":
        return Counter(tuple(map(int, line.split()[4:])) for line in content.decode().splitlines() if line[:2] == "3 ")
    if suffix == ".ply":
        head, rows = content.split(b"end_header\n")
        n, m = (int(line.split()[2]) for line in head.decode().splitlines() if line.startswith("element"))
        rows = rows[24 * n :]
        assert len(rows) == 16 * m
        return Counter(tuple(rows[16 * k + 13 : 16 * k + 16]) for k in range(m))
    if suffix == ".3mf":
        text = zipfile.ZipFile(io.BytesIO(content)).read("3D/3dmodel.model").decode()
        bases = [word.split('"')[1] for word in text.split("displaycolor=")[1:]]
        picks = [int(word.split('"')[1]) for word in text.split("p1=")[1:]]
        return Counter(tuple(bytes.fromhex(bases[k][1:7])) for k in picks)
    length = int.from_bytes(content[12:16], "little")
    header, data = json.loads(content[20 : 20 + length]), content[28 + length :]
    views = [data[v["byteOffset"] : v["byteOffset"] + v["byteLength"]] for v in header["bufferViews"]]
    ids, colours = np.frombuffer(views[0], "<u4").reshape(-1, 3), np.frombuffer(views[2], "u1").reshape(-1, 4)
    assert (colours[ids] == colours[ids][:, :1]).all()
    return Counter(tuple(row[:3]) for row in colours[ids[:, 0]].tolist())


@pytest.mark.parametrize("suffix", [".ply", ".off", ".3mf", ".glb"])
def test_facets_of_booleans_have_the_colours_of_their_bodies(suffix, tmp_path):
    r = crossing_boxes()
    r.save(tmp_path / f"r{suffix}")
    wanted = Counter(tuple(PALETTE[k].tolist()) for k in r.body.tolist())
    assert len(wanted) == 2 and colours_in(tmp_path / f"r{suffix}") == wanted
    if suffix == ".glb":
        pytest.importorskip("trimesh", reason="trimesh reads the meshes")
    (body,) = load(tmp_path / f"r{suffix}").bodies
    assert body.shape.solid and body.shape.volume == pytest.approx(r.mesh.volume, rel=1e-6)


def test_groups_of_obj_name_bodies_and_the_others_stay_plain(tmp_path):
    r = crossing_boxes()
    r.save(tmp_path / "r.obj")
    body, bodies = None, []
    for line in (tmp_path / "r.obj").read_text().splitlines():
        body = int(line[6:]) if line.startswith("g body") else body
        bodies += [body] if line.startswith("f ") else []
    assert bodies == r.body.tolist()
    r.save(tmp_path / "r.stl")
    r.mesh.save(tmp_path / "m.stl")
    assert (tmp_path / "r.stl").read_bytes() == (tmp_path / "m.stl").read_bytes()
    r.save(tmp_path / "r.npz")
    assert collide.Mesh.load(tmp_path / "r.npz") == r.mesh
    empty = collide.boolean(collide.Box((1, 1, 1)), collide.Box((2, 2, 2)), np.eye(4), np.eye(4), "difference")
    with pytest.raises(InvalidArgument, match="the result is empty, and no file was written"):
        empty.save(tmp_path / "empty.stl")
    assert not (tmp_path / "empty.stl").exists()


@pytest.mark.parametrize("name", ["x.step", "x.stl.gz", "x.gltf", "x.dae", "x.STLX"])
def test_other_suffixes_are_refused_with_those_there_are(name, tmp_path):
    listed = "must be one of .npz, .stl, .ply, .obj, .off, .3mf, .glb"
    for shape in (odd_torus(), crossing_boxes()):
        with pytest.raises(InvalidShape, match=listed):
            shape.save(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_the_same_mesh_gives_the_same_bytes(tmp_path):
    for suffix in SUFFIXES:
        for k in range(2):
            odd_torus().save(tmp_path / f"{k}{suffix.upper()}")
        assert (tmp_path / f"0{suffix.upper()}").read_bytes() == (tmp_path / f"1{suffix.upper()}").read_bytes()


def test_a_file_under_a_name_of_another_format_is_refused_by_name(tmp_path):
    """Every format under every other name; text STL as well."""
    contents = []
    for suffix in SUFFIXES:
        collide.Mesh(*surfaces.torus()).save(tmp_path / f"whole{suffix}")
        contents.append((suffix, (tmp_path / f"whole{suffix}").read_bytes()))
    collide.Mesh(*surfaces.box()).save(tmp_path / "binary.stl")
    contents += [
        (".stl", (tmp_path / "binary.stl").read_bytes()),
        (".obj", b"# made by hand\r\nmtllib a.mtl\no part\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        (".off", b"OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        (".ply", b"ply\r\nformat ascii 1.0\r\n"), (".dae", b'<?xml version="1.0"?>\n<!-- a -->\n<COLLADA>'),
        (".gltf", b'{"scene": 0, "asset": {"version": "2.0"}}'),
    ]
    assert any(content.startswith(b"solid") for _, content in contents)
    n = 0
    for holds, content in contents:
        for suffix in (".stl", ".obj", ".ply", ".dae", ".glb", ".gltf", ".off", ".3mf"):
            if suffix != holds:
                (tmp_path / f"part{suffix}").write_bytes(content)
                with pytest.raises(SceneError, match=rf"holds .*, not .* as its name says: call it part\{holds}"):
                    load(tmp_path / f"part{suffix}")
                n += 1
    assert n == 7 * len(contents)


def package(model: str) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as members:
        members.writestr("[Content_Types].xml", "<Types/>")
        members.writestr("3D/3dmodel.model", model)
    return packed.getvalue()


CORE = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"'
TETRA = (
    '<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>'
    '<vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/>'
    '<triangle v1="1" v2="2" v3="3"/><triangle v1="0" v2="3" v3="2"/></triangles></mesh>'
)


def model(mesh: str = TETRA, build: str = '<item objectid="1"/>', unit: str = "meter", more: str = "") -> str:
    return (
        f'<model unit="{unit}" {CORE}><resources><object id="1" name="tetra">{mesh}</object>{more}</resources>'
        f"<build>{build}</build></model>"
    )


def test_3mf_places_components_in_its_unit(tmp_path):
    """A component turned a quarter about z and moved, in an item mirrored in x, all in millimetres."""
    component = '<component objectid="1" transform="0 1 0 -1 0 0 0 0 1 10 0 0"/>'
    more = f'<object id="2"><components>{component}</components></object>'
    build = '<item objectid="2" transform="-1 0 0 0 1 0 0 0 1 0 0 5"/>'
    (tmp_path / "t.3mf").write_bytes(package(model(build=build, unit="millimeter", more=more)))
    ((name, vertices, faces),), notes = read_triangles(tmp_path / "t.3mf")
    assert name == "tetra" and notes == ["the file says its unit is millimeter; it was scaled to metres"]
    turned = np.array([(10, 0, 0), (10, 1, 0), (9, 0, 0), (10, 0, 1)])
    wanted = (turned * np.array([-1, 1, 1]) + np.array([0, 0, 5])) * 1e-3
    assert np.allclose(vertices, wanted, rtol=0, atol=1e-15)
    assert collide.Mesh(vertices, faces).solid


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"PK\x03\x04 [Content_Types].xml", "not a package that can be unpacked"),
        (package(model(TETRA.replace('x="1"', 'x="one"'))), "vertex 1 of object '1' needs finite numbers x, y, z, got"),
        (package(model(TETRA.replace('x="1"', 'x="nan"'))), "vertex 1 of object '1' needs finite numbers"),
        (package(model(TETRA.replace('v3="1"', 'v3="9"'))), "face 0 names vertex 9"),
        (package(model(TETRA.replace('v3="1"', 'v3="1.5"'))), "triangle 0 of object '1' names vertices by whole"),
        (package(model(unit="parsec")), "its unit must be one of micron"),
        (package(model(build='<item objectid="7"/>')), "<item> names object '7', which the file does not have"),
        (package(model(build='<item objectid="1" transform="1 0"/>')), "must be 12 finite numbers, got '1 0'"),
        (package(model(build="")), "has no vertices"),
        (
            package(model(build='<item objectid="1" xmlns:p="urn:production" p:path="/3D/part.model"/>')),
            "object '1' is in another file of the package",
        ),
        (package("<model>"), "not well-formed XML"), (package("<cube/>"), "its model begins with"),
        (
            package(
                model(
                    build='<item objectid="2"/>',
                    more='<object id="2"><components><component objectid="2"/></components></object>',
                )
            ),
            "stands within itself",
        ),
    ],
)
def test_damaged_3mf(content, words, tmp_path):
    (tmp_path / "t.3mf").write_bytes(content)
    with pytest.raises(SceneError, match=words):
        load(tmp_path / "t.3mf")
