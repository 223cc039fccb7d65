"""A scene as binary glTF: bodies where they stand, in the colours of their verdicts, by the rules of the format."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from collide import Box, Halfspace, PointCloud, Sphere, pose
from collide.pages.body_verdicts import body_verdicts
from collide.pages.scene_glb import COLOURS, scene_glb
from collide.reports import report
from collide.scenes import Scene, SceneBody

X_TURNED = pose((2.0, 0.1, 0.2), rpy=(0.3, -0.4, 0.5))


def scene() -> Scene:
    box = Box((1, 2, 3))
    return Scene("s", [
        SceneBody("floor", Halfspace((0, 0, 1), -9.0), np.eye(4), static=True), SceneBody("a", box, np.eye(4)),
        SceneBody("b", box, pose((0.9, 0, 0))), SceneBody("c", box, pose((30.0, 0, 0))),
        SceneBody("ball", Sphere(0.5), X_TURNED), SceneBody("dust", PointCloud(np.zeros((3, 3))), pose((50.0, 0, 0))),
    ])


def parsed(data: bytes) -> tuple[dict, bytes]:
    """(JSON, buffer) of a GLB; asserts lengths and alignment as the format has them."""
    magic, version, length, json_length, json_kind = struct.unpack_from("<4sIIII", data)
    assert (magic, version, length, json_kind) == (b"glTF", 2, len(data), 0x4E4F534A) and json_length % 4 == 0
    header = json.loads(data[20 : 20 + json_length])
    size, kind = struct.unpack_from("<II", data, 20 + json_length)
    assert kind == 0x004E4942 and size % 4 == 0 and 28 + json_length + size == len(data)
    return header, data[28 + json_length :]


def triangles_of(header: dict, buffer: bytes, mesh: int) -> np.ndarray:
    """(n, 3, 3) corners of a mesh's triangles."""

    def column(accessor: int, dtype: str, width: int) -> np.ndarray:
        about = header["accessors"][accessor]
        view = header["bufferViews"][about["bufferView"]]
        chunk = buffer[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        return np.frombuffer(chunk, dtype).reshape(about["count"], width)

    (primitive,) = header["meshes"][mesh]["primitives"]
    corners = column(primitive["attributes"]["POSITION"], "<f4", 3)
    about = header["accessors"][primitive["attributes"]["POSITION"]]
    assert about["min"] == corners.min(axis=0).tolist() and about["max"] == corners.max(axis=0).tolist()
    return corners[column(primitive["indices"], "<u4", 1).reshape(-1, 3)]


def test_bodies_stand_where_they_are_in_the_colour_of_their_verdict():
    made = scene()
    checked = report.make(made)
    verdicts = body_verdicts(made, checked)
    assert {verdicts["a"], verdicts["c"]} == {"colliding", "free"}, "the case has both"
    header, buffer = parsed(b"".join(scene_glb(made, checked)))
    root, *nodes = header["nodes"]
    assert root["children"] == list(range(1, len(made.bodies) + 1))
    assert header["buffers"][0]["byteLength"] == len(buffer)
    for body, node in zip(made.bodies, nodes, strict=True):
        assert node["name"] == body.name and node["extras"]["verdict"] == verdicts[body.name]
        assert np.array_equal(np.array(node["matrix"]).reshape(4, 4).T, body.X_WB)
        if body.name == "dust":
            assert "mesh" not in node
            continue
        (primitive,) = header["meshes"][node["mesh"]]["primitives"]
        material = header["materials"][primitive["material"]]
        assert material["name"] == verdicts[body.name]
        linear = np.array(material["pbrMetallicRoughness"]["baseColorFactor"][:3])
        assert np.allclose(255 * linear ** (1 / 2.2), COLOURS[verdicts[body.name]], atol=0.01)
    by_name = {node["name"]: node for node in nodes}
    assert by_name["a"]["mesh"] == by_name["b"]["mesh"] != by_name["c"]["mesh"], "once for a shape and a verdict"
    corners = triangles_of(header, buffer, by_name["a"]["mesh"]).reshape(-1, 3)
    assert np.ptp(corners, axis=0).tolist() == [1, 2, 3]
    assert np.linalg.norm(triangles_of(header, buffer, by_name["ball"]["mesh"]), axis=-1).max() <= 0.5 * 1.2


def test_z_points_up_in_a_viewer():
    x, y, z, w = parsed(b"".join(scene_glb(scene(), report.make(scene()))))[0]["nodes"][0]["rotation"]
    assert np.allclose([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], [0, 1, 0])


def test_a_scene_without_triangles_is_a_file_as_well():
    dust = Scene("d", [SceneBody("dust", PointCloud(np.zeros((1, 3))), np.eye(4))])
    header, buffer = parsed(b"".join(scene_glb(dust, report.make(dust))))
    assert buffer == b"" and not {"meshes", "materials", "accessors", "bufferViews", "buffers"} & set(header)


def test_trimesh_reads_it(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    file = tmp_path / "s.glb"
    file.write_bytes(b"".join(scene_glb(scene(), report.make(scene()))))
    read = trimesh.load(file)
    assert {"a", "b", "c", "ball", "floor"} <= set(read.graph.nodes)
    X = read.graph.get("c")[0]
    assert np.allclose(X[:3, 3], [30.0, 0.0, 0.0]) and np.allclose(X[:3, :3] @ [0, 0, 1], [0, 1, 0])
