"""MoveIt planning scenes: all of MotionBenchMaker, and the parts of the format it does not use."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import collide
from collide.errors import CollideError, InvalidShape, SceneError
from collide.fields.octree_files import StreamLeaves, binary_stream
from collide.scenes import load
from collide.shapes import Box, Compound, Cone, Cylinder, Halfspace, Mesh

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
SCENES = sorted((SHARED / "scenes/motionbenchmaker").glob("*/*/scene*.yaml")) if SHARED.is_dir() else []

#: MoveIt calls every start and goal free. This pair meets here: the URDF that comes with the scenes has a
#: ball of 0.2 m for the Fetch's head.
STAND_INS_MEET = {
    "bookshelf_tall_fetch/scene0003/goal": {("head_pan_link", "upperarm_roll_link")},
}

URDF = """<robot name="crane">
 <link name="base"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
 <link name="boom"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
 <link name="hook"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
 <link name="tip"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
 <joint name="lift" type="prismatic"><parent link="base"/><child link="boom"/><axis xyz="0 0 1"/><limit lower="0" upper="2"/></joint>
 <joint name="swing" type="continuous"><parent link="boom"/><child link="hook"/></joint>
 <joint name="weld" type="fixed"><parent link="hook"/><child link="tip"/></joint>
</robot>"""


@pytest.mark.many(10)
@pytest.mark.skipif(not SCENES, reason="../shared/data is absent")
@pytest.mark.parametrize("family", sorted({file.parent for file in SCENES}), ids=lambda folder: folder.name)
def test_motion_bench_maker(family):
    pytest.importorskip("yaml")
    pytest.importorskip("trimesh")
    for file in sorted(family.glob("scene*.yaml")):
        scene = load(file, missing_meshes="skip")
        start, goal = scene.with_state("start"), scene.with_state("goal")
        (robot,) = scene.robots.values()
        assert scene.state == start.state != goal.state
        assert all(scene.states["goal"][joint] == pytest.approx(goal.state[joint]) for joint in robot.joint_names if joint in scene.states["goal"])
        assert not any("no value given" in note for note in start.notes)
        obstacles = [body for body in scene.bodies if body.owner is None]
        assert len(obstacles) > 3 and all(body.static for body in obstacles)
        names = {body.name for body in scene.bodies}
        assert all(a in names and b in names for a, b, _ in scene.allowed)
        reasons = {reason for _, _, reason in scene.allowed}
        assert {reason for reason in reasons if not reason.startswith("SRDF: ")} <= {"allowed by the scene", "rigidly joined"}
        for name, there in (("start", start), ("goal", goal)):
            hits = there.world().collisions().names
            assert set(hits) <= STAND_INS_MEET.get(f"{family.name}/{file.stem}/{name}", set())
        moved = [a.name for a, b in zip(start.bodies, goal.bodies) if not np.array_equal(a.X_WB, b.X_WB)]
        assert moved and set(moved) <= {body.name for body in scene.bodies if body.owner}
        assert len(scene.sources) >= 4  # scene, request, URDF, SRDF


@pytest.fixture
def planning_scene(tmp_path):
    """keys of the document -> the scene; the robot stands in robots/crane."""
    pytest.importorskip("yaml")
    (tmp_path / "robots/crane").mkdir(parents=True)
    (tmp_path / "robots/crane/crane.urdf").write_text(URDF)

    def make(objects=(), request=None, options=None, **keys):
        (tmp_path / "work").mkdir(exist_ok=True)
        file = tmp_path / "work" / "scene0001.yaml"
        file.write_text(json.dumps({"robot_model_name": "crane", "world": {"collision_objects": list(objects)}, **keys}))
        if request is not None:
            (tmp_path / "work" / "request0001.yaml").write_text(json.dumps(request))
        return load(file, **(options or {}))

    return make


def thing(name="thing", **keys):
    return {"id": name, **keys}


def test_objects(planning_scene):
    scene = planning_scene(
        [
            thing("box", primitives=[{"type": "box", "dimensions": [1, 2, 3]}], primitive_poses=[{"position": [1, 0, 0], "orientation": [0, 0, 0, 0]}]),
            thing("can", primitives=[{"type": 3, "dimensions": [0.4, 0.1]}], primitive_poses=[{"position": {"x": 1, "y": 2, "z": 3}, "orientation": {"x": 0, "y": 0, "z": 1, "w": 0}}]),
            thing("cone", primitives=[{"type": "cone", "dimensions": [0.4, 0.1]}]),
            thing("two", primitives=[{"type": "sphere", "dimensions": [1]}] * 2, primitive_poses=[{"position": [0, 0, 0]}, {"position": [1, 0, 0]}]),
            thing("mesh", meshes=[{"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]], "triangles": [[0, 1, 2]]}]),
            thing("floor", planes=[{"coef": [0, 0, 1, 0.5]}]),
            thing("gone", operation=1),
        ]
    )
    shapes = {body.name: body.shape for body in scene.bodies}
    assert shapes["box"] == Box((1, 2, 3)) and shapes["can"] == Cylinder(0.1, 0.4) and shapes["cone"] == Cone(0.1, 0.4)
    assert isinstance(shapes["two"], Compound) and shapes["floor"] == Halfspace((0, 0, 1), -0.5) and "gone" not in shapes
    assert isinstance(shapes["mesh"], Mesh) and not shapes["mesh"].solid and scene.body("mesh").approximation is None
    np.testing.assert_allclose(scene.body("can").X_WB, [[-1, 0, 0, 1], [0, -1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], atol=1e-15)


def test_pose_of_the_object_comes_before_that_of_its_parts(planning_scene):
    quarter = [0, 0, np.sqrt(0.5), np.sqrt(0.5)]
    scene = planning_scene([
        thing("box", pose={"position": [1, 0, 0], "orientation": quarter}, primitives=[{"type": "sphere", "dimensions": [1]}],
              primitive_poses=[{"position": [2, 0, 0], "orientation": [0, 0, 0, 1]}])
    ])
    np.testing.assert_allclose(scene.body("box").X_WB[:3, 3], (1, 2, 0), atol=1e-15)


def test_frames(planning_scene):
    ball = {"primitives": [{"type": "sphere", "dimensions": [1]}], "primitive_poses": [{"position": [0, 0, 1]}]}
    fixed = [{"child_frame_id": "bench", "transform": {"translation": [5, 0, 0], "rotation": [0, 0, 0, 1]}}]
    state = {"joint_state": {"name": ["lift", "swing"], "position": [0.5, 0]}}
    scene = planning_scene(
        [thing("a", header={"frame_id": "bench"}, **ball), thing("b", header={"frame_id": "boom"}, **ball)],
        fixed_frame_transforms=fixed, robot_state=state,
    )
    assert scene.body("a").X_WB[:3, 3].tolist() == [5, 0, 1] and scene.body("b").X_WB[:3, 3].tolist() == [0, 0, 1.5]
    with pytest.raises(SceneError, match=r"collision_objects\[0\] \"a\".header.frame_id: unknown frame 'attic'; known are world, base"):
        planning_scene([thing("a", header={"frame_id": "attic"}, **ball)])


def test_states(planning_scene):
    scene = planning_scene(
        robot_state={
            "joint_state": {"name": ["lift", "swing"], "position": [0.25, 1.0]},
            "multi_dof_joint_state": {"joint_names": ["world"], "transforms": [{"translation": [0, 0, 7], "rotation": [0, 0, 0, 1]}]},
        },
        request={
            "start_state": {"joint_state": {"name": ["lift"], "position": [0.5]}},
            "goal_constraints": [{"joint_constraints": [{"joint_name": "lift", "position": 3}]}, {"joint_constraints": [{"joint_name": "swing", "position": 2}]}],
        },
    )
    assert scene.states["start"] == {"lift": 0.5, "swing": 1.0}
    assert scene.states["goal"] == {"lift": 3.0, "swing": 1.0} and scene.states["goal_2"] == {"lift": 0.5, "swing": 2.0}
    assert scene.state == {"lift": 0.5, "swing": 1.0}
    assert scene.body("boom").X_WB[2, 3] == 7.5
    goal = scene.with_state("goal")
    assert goal.body("boom").X_WB[2, 3] == 10 and "lift at 3 m is outside its limits [0, 2]" in goal.notes[-1]
    assert goal.with_state("start").notes == scene.notes


def test_matrix(planning_scene):
    ball = {"primitives": [{"type": "sphere", "dimensions": [1]}]}
    matrix = {
        "entry_names": ["base", "boom", "a"], "entry_values": [[False, False, True], [False, False, False], [True, False, False]],
        "default_entry_names": ["b", "hook"], "default_entry_values": [True, False],
    }
    scene = planning_scene([thing("a", **ball), thing("b", **ball)], allowed_collision_matrix=matrix)
    assert set(scene.allowed) == {
        ("base", "a", "allowed by the scene"), ("base", "b", "allowed by the scene"), ("boom", "b", "allowed by the scene"),
        ("tip", "b", "allowed by the scene"), ("a", "b", "allowed by the scene"), ("hook", "tip", "rigidly joined"),
        ("boom", "tip", "adjacent links"),  # the matrix does not name tip
    }
    # of links that the matrix does not name, the robot's own pairs hold
    del matrix["default_entry_names"], matrix["default_entry_values"]
    scene = planning_scene(allowed_collision_matrix=matrix)
    assert ("boom", "hook", "adjacent links") in scene.allowed and ("base", "boom", "adjacent links") not in scene.allowed
    assert "does not name hook, tip" in scene.notes[-1]
    # without a matrix they all do
    assert ("base", "boom", "adjacent links") in planning_scene().allowed


def test_attached_objects_move_with_their_link(planning_scene):
    grasped = {
        "link_name": "hook", "touch_links": ["tip"],
        "object": thing("load", primitives=[{"type": "box", "dimensions": [1, 1, 1]}], primitive_poses=[{"position": [0, 0, -1]}]),
    }
    scene = planning_scene(robot_state={"joint_state": {"name": ["lift", "swing"], "position": [0.5, 0]}, "attached_collision_objects": [grasped]})
    load_body = scene.body("load")
    assert load_body.owner == "crane" and not load_body.static and load_body.X_WB[2, 3] == -0.5
    assert ("load", "hook", "attached to the link") in scene.allowed
    assert scene.with_state({"lift": 1.5}).body("load").X_WB[2, 3] == 0.5


def test_robot_not_found_names_the_option(planning_scene, tmp_path):
    (tmp_path / "robots/crane/crane.urdf").rename(tmp_path / "elsewhere.urdf")
    with pytest.raises(SceneError, match=r"needs the URDF of robot 'crane'.*--robot path.urdf"):
        planning_scene()
    assert planning_scene(options={"robot": tmp_path / "elsewhere.urdf"}).robots["crane"].dof == 2
    # found by the name the URDF itself gives, in a folder of another name
    (tmp_path / "robots/other").mkdir()
    (tmp_path / "elsewhere.urdf").rename(tmp_path / "robots/other/machine.urdf")
    assert planning_scene().robots["crane"].dof == 2


@pytest.mark.parametrize(
    ("objects", "keys", "message"),
    [
        ([thing(primitives=[{"type": "torus", "dimensions": [1]}])], {}, r'"thing".primitives\[0\].type: unknown primitive \'torus\''),
        ([thing(primitives=[{"type": "box", "dimensions": [1, 1]}])], {}, r"dimensions: must be 3 numbers, got \[1, 1\]"),
        ([thing(primitives=[{"type": "box", "dimensions": [1, 1, -1]}])], {}, r'primitives\[0\]: Box: size.z must be ≥ 0'),
        ([thing(primitives=[{"type": "sphere", "dimensions": [float("nan")]}])], {}, "must be finite"),
        ([thing()], {}, '"thing": has no primitives, meshes or planes'),
        ([{}], {}, r"collision_objects\[0\]: 'id' is missing"),
        ([thing(primitives=[{"type": "sphere", "dimensions": [1]}])] * 2, {}, 'a body named "thing" exists already'),
        ([], {"robot_state": {"joint_state": {"name": ["a"], "position": [1]}}}, "none of the joints a is known; robot crane has lift, swing"),
        ([], {"robot_state": {"joint_state": {"name": ["lift"], "position": []}}}, "one value for each of the 1 joints"),
        ([], {"robot_state": {"joint_state": {"name": ["lift"], "position": [float("nan")]}}}, "finite number, got nan"),
        ([], {"allowed_collision_matrix": {"entry_names": ["a", "b"], "entry_values": [[True]]}}, "2 rows of 2 values"),
        ([], {"robot_state": {"attached_collision_objects": [{"link_name": "nose", "object": thing()}]}}, "unknown link 'nose'"),
    ],
)
def test_bad_scenes(planning_scene, objects, keys, message):
    with pytest.raises(CollideError, match=message) as caught:
        planning_scene(objects, **keys)
    assert "scene0001.yaml" in str(caught.value)


def test_a_request_is_not_a_scene(planning_scene, tmp_path):
    planning_scene(request={"start_state": {"joint_state": {"name": ["lift"], "position": [0]}}})
    with pytest.raises(SceneError, match="is a MoveIt planning request: give the scene file"):
        load(tmp_path / "work/request0001.yaml")


def test_an_octomap_is_an_obstacle(planning_scene):
    tree = collide.OcTree(([[0, 0, 0], [4, 0, 0]], [2, 0], [3.5, -2.0]), 0.25)
    leaves = StreamLeaves(0.25, tree.leaves.cell, tree.leaves.exponent, tree.leaves.log_odds >= 0.0)
    data = np.frombuffer(binary_stream(leaves)[0], dtype=np.int8).tolist()
    octomap = {"id": "OcTree", "resolution": 0.25, "binary": True, "data": data}
    origin = {"position": {"x": 1, "y": 2, "z": 3}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    scene = planning_scene(world={"octomap": {"header": {"frame_id": ""}, "origin": origin, "octomap": octomap}})
    body = scene.body("<octomap>")
    assert body.shape == collide.OcTree(tree.leaves, 0.25) and body.X_WB[:3, 3].tolist() == [1, 2, 3]
    assert body.shape.count == 64 and not any("octomap" in note for note in scene.notes)
    free = binary_stream(leaves._replace(occupied=leaves.occupied & False))[0]
    empty = {**octomap, "data": np.frombuffer(free, dtype=np.int8).tolist()}
    notes = planning_scene(world={"octomap": {"octomap": empty}}).notes
    assert any("no cell of the octomap is occupied" in note for note in notes)
    for change, match in (({"data": data[:-1]}, "whole number of nodes"), ({"id": "Else"}, "id must be one of")):
        with pytest.raises(InvalidShape, match=rf"scene0001\.yaml: world\.octomap\.octomap: .*{match}"):
            planning_scene(world={"octomap": {"octomap": {**octomap, **change}}})
