"""What bodies look like: visual meshes of robots and meshes behind hulls stand where their links stand."""

from __future__ import annotations

import numpy as np
import pytest

from collide import Box, Sphere, pose
from collide.scenes import load
from collide.scenes.loaders.visual_shapes import visual_shapes

URDF = """<robot name="arm">
  <link name="base"><visual><geometry><sphere radius="0.3"/></geometry></visual></link>
  <link name="upper">
    <visual><origin xyz="0 0 0.5" rpy="0.2 0 0.1"/><geometry><box size="0.1 0.2 0.9"/></geometry></visual>
    <visual><geometry><sphere radius="0.12"/></geometry></visual>
    <collision><origin xyz="0 0.1 0.4" rpy="0 0.3 0"/>
      <geometry><cylinder radius="0.2" length="1"/></geometry></collision>
  </link>
  <link name="hand">
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <link name="lost">
    <visual><geometry><mesh filename="nowhere.stl"/></geometry></visual>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="1 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3"/></joint>
  <joint name="wrist" type="fixed"><parent link="upper"/><child link="hand"/><origin xyz="0 0 1"/></joint>
  <joint name="loss" type="fixed"><parent link="upper"/><child link="lost"/><origin xyz="0 1 1"/></joint>
</robot>
"""
#: An open mesh, so that its hull is an approximation: a corner of a cube, a triangle missing.
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n"


@pytest.fixture
def urdf(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(URDF, encoding="utf-8")
    return path


def test_visuals_stand_where_their_link_stands(urdf):
    for angle in (0.0, 0.7):
        scene = load(urdf, state={"shoulder": angle})
        looks = visual_shapes(scene)
        assert set(looks.shapes) == {"upper"}, "base is no body, hand has no visual, lost has no file"
        X_WL = pose((1, 0, 0), rpy=(0, 0, angle))
        X_WB = scene.body("upper").X_WB
        assert not np.allclose(X_WB, X_WL), "the body's frame is that of its collision element"
        (box, X_BS), (ball, X_BQ) = looks.shapes["upper"]
        assert box == Box((0.1, 0.2, 0.9)) and ball == Sphere(0.12)
        assert X_WB @ X_BS == pytest.approx(X_WL @ pose((0, 0, 0.5), rpy=(0.2, 0, 0.1)), abs=1e-14)
        assert X_WB @ X_BQ == pytest.approx(X_WL, abs=1e-14)
        assert "lost" in looks.notes[0] and "nowhere.stl" in looks.notes[0] and len(looks.notes) == 1


def test_robots_placed_twice(urdf, tmp_path):
    scene_file = tmp_path / "two.yaml"
    scene_file.write_text(
        "collide: 1\nrobots:\n"
        "  - {urdf: arm.urdf, prefix: left_, pose: {xyz: [0, 0, 5]}}\n"
        "  - {urdf: arm.urdf, prefix: right_}\n",
        encoding="utf-8",
    )
    scene = load(scene_file)
    looks = visual_shapes(scene)
    assert set(looks.shapes) == {"left_upper", "right_upper"}
    (_, X_BS), _ = looks.shapes["left_upper"]
    assert (scene.body("left_upper").X_WB @ X_BS)[:3, 3] == pytest.approx((1, 0, 5.5))


def test_meshes_behind_hulls_in_any_state(tmp_path, urdf):
    (tmp_path / "nowhere.stl").write_bytes(b"")
    (tmp_path / "corner.obj").write_text(OBJ, encoding="utf-8")
    urdf.write_text(
        URDF.replace("nowhere.stl", "corner.obj").replace(
            '<sphere radius="0.1"/>', '<mesh filename="corner.obj" scale="0.1 0.1 0.1"/>'
        ),
        encoding="utf-8",
    )
    hulls, whole = load(urdf, state={"shoulder": 0.4}, meshes="hull"), load(urdf)
    looks = visual_shapes(hulls, whole=whole)
    assert set(looks.shapes) == {"upper", "hand", "lost"} and not looks.notes
    ((mesh, X_BS),) = looks.shapes["hand"]
    assert mesh.meshed and len(mesh.faces) == 3 and not hulls.body("hand").shape.meshed
    assert X_BS == pytest.approx(np.eye(4), abs=1e-15), "the other scene is in another state"
    ((visual, _),) = looks.shapes["lost"]
    assert np.ptp(visual.vertices, axis=0) == pytest.approx((1, 1, 1)), "a robot's visual before its collision mesh"
    single = visual_shapes(load(tmp_path / "corner.obj", meshes="hull"), whole=load(tmp_path / "corner.obj"))
    assert len(single.shapes["corner"][0][0].faces) == 3


def test_nothing_to_show(tmp_path, urdf):
    assert visual_shapes(load("workcell")).shapes == {}
    scene = load(urdf)
    urdf.unlink()
    assert visual_shapes(scene).shapes == {}, "the file is gone"
    urdf.write_text("<robot name='other'><link name='a'/></robot>", encoding="utf-8")
    assert visual_shapes(scene).shapes == {}, "it is another one"
    urdf.write_text("<robot", encoding="utf-8")
    assert visual_shapes(scene).shapes == {}
