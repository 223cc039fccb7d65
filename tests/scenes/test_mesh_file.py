"""Meshes: every format, several meshes a file, what a hull leaves out, and the cache of prepared inputs."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from collide.errors import CollideError, InvalidShape, SceneError
from collide.scenes import load
from collide.scenes import mesh_cache as cache
from collide.scenes.loaders import mesh_file as mesh_loader
from collide.shapes import Compound, ConvexHull

trimesh = pytest.importorskip("trimesh", reason="trimesh reads the meshes")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("COLLIDE_CACHE_DIR", str(tmp_path / "cache"))


def l_shape():
    """A closed mesh that is not convex: two boxes that share a face. Volume 2, hull 2.5."""
    profile = np.array([(0, 0), (2, 0), (2, 0.5), (0.5, 0.5), (0.5, 2), (0, 2.0)])
    vertices = np.array([(x, y, z) for z in (0, 1) for x, y in profile])
    caps = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [(a, c, b) for a, b, c in caps] + [(a + 6, b + 6, c + 6) for a, b, c in caps]
    for k in range(6):
        j = (k + 1) % 6
        faces += [(k, j, j + 6), (k, j + 6, k + 6)]
    return trimesh.Trimesh(vertices, faces, process=False)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "glb", "dae"])
def test_formats(tmp_path, suffix):
    if suffix == "dae":
        pytest.importorskip("collada")
    file = tmp_path / f"box.{suffix}"
    trimesh.creation.box((1, 2, 3)).export(file)
    scene = load(file)
    (body,) = scene.bodies
    assert body.name == "box" and not body.static and body.approximation is None
    assert body.source == f"{file}: box"
    assert isinstance(body.shape, ConvexHull) and len(body.shape.points) == 8
    assert np.abs(body.shape.points).max(axis=0).tolist() == [0.5, 1, 1.5]
    assert set(scene.seconds) == {"read", "meshes"}


def test_gltf_with_its_buffers(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(
        trimesh.creation.box((1, 1, 1)),
        node_name="left",
        transform=trimesh.transformations.translation_matrix((-2, 0, 0)),
    )
    scene.add_geometry(trimesh.creation.icosphere(1, 0.5), node_name="right")
    scene.export(tmp_path / "pair.gltf")
    for _ in range(2):  # read, then from the cache
        loaded = load(tmp_path / "pair.gltf")
        assert [body.name for body in loaded.bodies] == ["left", "right"]
        assert loaded.body("left").shape.points[:, 0].max() == -1.5
    for buffer in tmp_path.glob("*.bin"):
        buffer.unlink()
    with pytest.raises(SceneError, match=r"\.bin: no such file"):
        load(tmp_path / "pair.gltf")


def test_objects_of_one_file_are_bodies(tmp_path):
    (tmp_path / "two.obj").write_text(
        "o first\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no second\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf 4 5 6\n"
    )
    scene = load(tmp_path / "two.obj")
    assert len(scene.bodies) == 2 and [len(body.shape.vertices) for body in scene.bodies] == [3, 3]
    assert not any(body.shape.solid or body.approximation for body in scene.bodies)
    scene = load(tmp_path / "two.obj", meshes="hull")
    assert len(scene.bodies) == 2 and sorted(len(body.shape.points) for body in scene.bodies) == [3, 3]


def test_what_a_hull_leaves_out(tmp_path):
    pytest.importorskip("scipy")
    l_shape().export(tmp_path / "l.stl")
    hull = load(tmp_path / "l.stl", meshes="hull").bodies[0]
    mesh = l_shape()
    extra = round((mesh.convex_hull.volume / mesh.volume - 1) * 100)
    assert hull.approximation == f"hull of 12 vertices, fills {extra} % more volume"
    open_mesh = l_shape()
    open_mesh.faces = open_mesh.faces[1:]
    open_mesh.export(tmp_path / "open.stl")
    assert load(tmp_path / "open.stl", meshes="hull").bodies[0].approximation == "hull of 12 vertices of an open mesh"


def test_pieces(tmp_path):
    pytest.importorskip("coacd")
    l_shape().export(tmp_path / "l.stl")
    for _ in range(2):
        (body,) = load(tmp_path / "l.stl", meshes="pieces").bodies
        assert isinstance(body.shape, Compound) and len(body.shape.items) >= 2
        assert body.approximation == f"{len(body.shape.items)} convex pieces of a mesh of 12 vertices (coacd)"
    with pytest.raises(SceneError, match='meshes must be "mesh", "repaired", "hull" or "pieces", got \'tetra\''):
        load(tmp_path / "l.stl", meshes="tetra")


def test_pieces_of_a_convex_mesh_are_its_hull(tmp_path):
    """coacd resamples what it does not like: its one piece of a box turned inside out is one in a hundred too large."""
    pytest.importorskip("coacd")
    pytest.importorskip("scipy")
    box = trimesh.creation.box((1, 1, 1))
    trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False).export(tmp_path / "inverted.stl")
    box.export(tmp_path / "box.stl")
    for name in ("inverted.stl", "box.stl"):
        (body,) = load(tmp_path / name, meshes="pieces").bodies
        assert np.abs(body.shape.points).tolist() == [[0.5] * 3] * 8 and body.approximation is None, name


def test_messages_about_files_cut_short_and_numbers_out_of_range(tmp_path):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    (tmp_path / "cut.stl").write_bytes((tmp_path / "box.stl").read_bytes()[:-37])
    with pytest.raises(
        SceneError, match=r"cut\.stl: its header says 12 facets, but the file holds 11\.26: it was cut short"
    ):
        load(tmp_path / "cut.stl")
    (tmp_path / "big.obj").write_text("v 0 0 0\nv 1e60 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(SceneError, match=r"big\.obj: Mesh: vertices\[1, 0\] is 1e\+60") as refusal:
        load(tmp_path / "big.obj")
    assert str(refusal.value).count("big.obj") == 1


def test_repeated_and_unused_vertices(tmp_path):
    box = trimesh.creation.box((1, 1, 1))
    vertices = np.concatenate([box.vertices, box.vertices, [(9, 9, 9)]])
    faces = np.concatenate([box.faces[:6], box.faces[6:] + 8])
    (tmp_path / "b.obj").write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in vertices)
        + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)
    )
    file = mesh_loader.read_mesh(tmp_path / "b.obj")
    assert len(file.parts[0].points) == 8 and file.parts[0].closed


def test_point_cloud(tmp_path):
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "cloud.ply")
    scene = load(tmp_path / "cloud.ply")
    assert scene.bodies[0].approximation == "hull of 3 vertices without faces"
    assert "has points but no faces" in scene.notes[0]


def test_scale_and_units(tmp_path):
    trimesh.creation.box((500, 200, 100)).export(tmp_path / "part.stl")
    assert "is it in millimetres?" in load(tmp_path / "part.stl").notes[0]
    scene = load(tmp_path / "part.stl", scale=0.001)
    assert scene.notes == [] and scene.bodies[0].shape.points.max() == 0.25
    assert load(tmp_path / "part.stl", scale=-1).bodies[0].shape.points.min() == -250
    for scale in (0, float("nan"), "big"):
        with pytest.raises(SceneError, match="scale must be a finite number other than 0"):
            load(tmp_path / "part.stl", scale=scale)


def test_several_files_and_repeated_names(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        trimesh.creation.box((1, 1, 1)).export(tmp_path / folder / "part.stl")
    scene = load(tmp_path / "a/part.stl", tmp_path / "b/part.stl", tmp_path / "a/part.stl")
    assert [body.name for body in scene.bodies] == ["part", "part_2", "part_3"]
    assert scene.name == "part + part + part" and len(scene.sources) == 2


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.stl", b"", "a.stl"),
        ("a.stl", b"not a mesh at all", "a.stl"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 9\n", "a.ply"),
        ("a.obj", b"# nothing\n", "a.obj"),
        ("a.glb", b"glTF" + bytes(40), "a.glb"),
        ("a.gltf", b"{", "is not glTF"),
        ("a.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "line 1: a coordinate must be a finite number, got 'nan'"),
        ("a.3ds", b"", "unknown format '.3ds'; known are URDF"),
    ],
)
def test_bad_meshes(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(CollideError, match=message):
        load(tmp_path / name)


def test_hull_out_of_range_names_the_part(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InvalidShape, match=r"a\.obj: a: ConvexHull"):
        load(tmp_path / "a.obj", scale=1e60, meshes="hull")
    with pytest.raises(InvalidShape, match=r"a\.obj: a: Mesh\.scaled: factors\[0\] is 1e\+60; entries must be"):
        load(tmp_path / "a.obj", scale=1e60)


# --- the cache ------------------------------------------------------------------------------------


def test_cached_mesh_is_the_same(tmp_path):
    l_shape().export(tmp_path / "l.stl")
    first, second = load(tmp_path / "l.stl").bodies[0], load(tmp_path / "l.stl").bodies[0]
    assert first.shape == second.shape and first.approximation == second.approximation
    assert len(list(cache.directory().glob("*.npz"))) == 1
    assert not list(cache.directory().glob("*.part"))


def test_same_bytes_under_another_name(tmp_path):
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "one.ply")
    (tmp_path / "two.ply").write_bytes((tmp_path / "one.ply").read_bytes())
    for name in ("one", "two"):
        scene = load(tmp_path / f"{name}.ply")
        assert scene.bodies[0].name == name and scene.notes[0].startswith(f"{name}.ply: ")


def test_changed_file_is_read_again(tmp_path):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "b.stl")
    load(tmp_path / "b.stl")
    trimesh.creation.box((2, 2, 2)).export(tmp_path / "b.stl")
    assert load(tmp_path / "b.stl").bodies[0].shape.points.max() == 1.0


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 cut short", None, "foreign", "objects"])
def test_damaged_entries_are_passed_over(tmp_path, damage):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "b.stl")
    load(tmp_path / "b.stl")
    (entry,) = cache.directory().glob("*.npz")
    if damage is None:
        entry.write_bytes(entry.read_bytes()[:-50])
    elif damage == "foreign":
        np.savez(entry, something=np.arange(3))
    elif damage == "objects":
        np.savez(entry, about=np.array([{"x": 1}], dtype=object))
    else:
        entry.write_bytes(damage)
    assert len(load(tmp_path / "b.stl").bodies[0].shape.points) == 8
    assert cache.fetch(entry.stem) is not None  # mended


def test_unwritable_cache(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("a file where a folder should be")
    monkeypatch.setenv("COLLIDE_CACHE_DIR", str(tmp_path / "file"))
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "b.stl")
    assert len(load(tmp_path / "b.stl").bodies) == 1
    assert not cache.store("0" * 64, {"a": np.zeros(1)}) and cache.fetch("0" * 64) is None


def test_warm_load_imports_no_mesh_library(tmp_path):
    """In a fresh process, a robot whose meshes are prepared needs neither trimesh nor its company."""
    pytest.importorskip("collada")
    l_shape().export(tmp_path / "l.dae")
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><link name="a"><collision><geometry><mesh '
        'filename="l.dae"/></geometry></collision></link></robot>'
    )
    program = (
        "import json, sys\n"
        "import collide.scenes\n"
        "light = sorted({name.split('.')[0] for name in sys.modules})\n"
        "scene = collide.scenes.load(sys.argv[1])\n"
        "print(json.dumps([light, sorted({name.split('.')[0] for name in sys.modules}), "
        "len(scene.bodies[0].shape.vertices)]))\n"
    )
    for turn in ("cold", "warm"):
        done = subprocess.run(
            [sys.executable, "-c", program, str(tmp_path / "r.urdf")], capture_output=True, text=True, check=True
        )
        light, loaded, points = json.loads(done.stdout)
        assert points == 12
        assert not {"numba", "yaml", "trimesh", "scipy"} & set(light), "importing collide.scenes is light"
        heavy = {"trimesh", "yourdfpy", "lxml", "scipy", "numba"} & set(loaded)
        assert ("trimesh" in heavy) if turn == "cold" else not heavy
