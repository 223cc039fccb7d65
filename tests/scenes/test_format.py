"""The project's own scene files: every key, every complaint, states, and the shipped scenes."""

from __future__ import annotations

import json
import math
import subprocess
import sys

import numpy as np
import pytest

from collide import scenes
from collide.errors import CollideError, InvalidArgument, InvalidPose, InvalidShape, MissingExtra, SceneError
from collide.scenes import generators, load
from collide.shapes import (
    Box,
    Capsule,
    Compound,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    HeightField,
    HPolytope,
    Mesh,
    Sphere,
)
from collide.transforms import pose, rotation_from_degrees

BALL = {"sphere": {"radius": 0.1}}
ARM = {
    "name": "arm",
    "links": [
        {"name": "base", "collision": [{"shape": BALL}]},
        {"name": "hand", "collision": [{"shape": BALL, "pose": {"xyz": [0, 0, 1]}}]},
        {"name": "tool"},
    ],
    "joints": [
        {"name": "slide", "type": "prismatic", "parent": "base", "child": "hand", "axis": [1, 0, 0], "limits": [0, 2]},
        {"name": "weld", "type": "fixed", "parent": "hand", "child": "tool", "origin": {"xyz": [0, 0, 1]}},
    ],
    "states": {"out": {"slide": 1.5}},
}


@pytest.fixture
def scene_of(tmp_path):
    """keys of the document -> the scene loaded from a JSON file of it."""

    def make(file="scene.json", /, **keys):
        (tmp_path / file).write_text(json.dumps({"collide": 1, **keys}))
        return load(tmp_path / file)

    return make


def body(shape=BALL, name="mug", **keys):
    return {"name": name, "shape": shape, **keys}


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ({"box": {"size": [1, 2, 3]}}, Box((1, 2, 3))),
        ({"sphere": {"radius": 1}}, Sphere(1)),
        ({"capsule": {"radius": 1, "length": 2}}, Capsule(1, 2)),
        ({"cylinder": {"radius": 1, "length": 2}}, Cylinder(1, 2)),
        ({"cone": {"radius": 1, "length": 2}}, Cone(1, 2)),
        ({"ellipsoid": {"radii": [1, 2, 3]}}, Ellipsoid((1, 2, 3))),
        ({"halfspace": {"normal": [0, 0, 1], "offset": -1}}, Halfspace((0, 0, 1), -1)),
        ({"hull": {"points": [[0, 0, 0], [1, 0, 0]], "radius": 0.5}}, ConvexHull([[0, 0, 0], [1, 0, 0]], radius=0.5)),
        (
            {"hpolytope": {"normals": np.vstack([np.eye(3), -np.eye(3)]).tolist(), "offsets": [1] * 6}},
            HPolytope(np.vstack([np.eye(3), -np.eye(3)]), [1] * 6),
        ),
        ({"heightfield": {"heights": [[0, 1, 0], [2, 0, 1]], "cell": 0.5}}, HeightField([[0, 1, 0], [2, 0, 1]], 0.5)),
        (
            {"heightfield": {"heights": [[0, 1], [2, 0]], "cell": [0.5, 2], "bottom": -3}},
            HeightField([[0, 1], [2, 0]], (0.5, 2), bottom=-3),
        ),
        (
            {"compound": [{"shape": BALL, "pose": {"xyz": [1, 0, 0]}}, {"shape": {"box": {"size": [1, 1, 1]}}}]},
            Compound([(Sphere(0.1), pose((1, 0, 0))), (Box((1, 1, 1)), np.eye(4))]),
        ),
    ],
)
def test_shapes(scene_of, shape, expected):
    assert scene_of(bodies=[body(shape)]).bodies[0].shape == expected


@pytest.mark.parametrize(
    "given",
    [
        {"xyz": [1, 2, 3], "rpy": [0.1, 0.2, 0.3]},
        {"xyz": [1, 2, 3], "rpy_deg": np.degrees([0.1, 0.2, 0.3]).tolist()},
        {"matrix": pose((1, 2, 3), rpy=(0.1, 0.2, 0.3)).tolist()},
    ],
)
def test_poses(scene_of, given):
    np.testing.assert_allclose(
        scene_of(bodies=[body(pose=given)]).bodies[0].X_WB, pose((1, 2, 3), rpy=(0.1, 0.2, 0.3)), atol=1e-15
    )


def test_quaternions(scene_of):
    wxyz = scene_of(bodies=[body(pose={"quat_wxyz": [0.9, 0.1, 0.2, 0.3]})]).bodies[0].X_WB
    xyzw = scene_of(bodies=[body(pose={"quat_xyzw": [0.1, 0.2, 0.3, 0.9]})]).bodies[0].X_WB
    assert np.array_equal(wxyz, xyzw) and np.array_equal(wxyz, pose(quat_wxyz=(0.9, 0.1, 0.2, 0.3)))


def test_right_angles_in_degrees_are_exact():
    assert rotation_from_degrees(np.array([0, 90, 0])).tolist() == [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    assert rotation_from_degrees(np.array([-180, 270, 360.0])).tolist() == [[0, 0, 1], [0, -1, 0], [1, 0, 0]]
    angles = np.array([12.0, 34.0, -56.0])
    np.testing.assert_allclose(rotation_from_degrees(angles), pose(rpy=np.radians(angles))[:3, :3], atol=1e-15)


@pytest.mark.parametrize(("unit", "factor"), [("m", 1), ("cm", 100), ("mm", 1000)])
def test_units(scene_of, unit, factor):
    scene = scene_of(
        units=unit,
        bodies=[
            body({"box": {"size": [0.25 * factor, 0.5 * factor, factor]}}, pose={"xyz": [0.3 * factor, 0, 0]}),
            body({"halfspace": {"normal": [0, 0, 1], "offset": 2 * factor}}, "floor"),
            body({"heightfield": {"heights": [[0, factor], [0, 0]], "cell": 0.3 * factor, "bottom": -factor}}, "hill"),
        ],
    )
    assert scene.bodies[0].shape == Box((0.25, 0.5, 1)) and scene.bodies[0].X_WB[0, 3] == 0.3
    assert scene.bodies[1].shape == Halfspace((0, 0, 1), 2)
    assert scene.bodies[2].shape == HeightField([[0, 1], [0, 0]], 0.3, bottom=-1)
    assert (len(scene.notes) == 0) == (unit == "m")


def test_filters_and_allowed_pairs(scene_of):
    scene = scene_of(
        bodies=[body(name="a", static=True, group=2, mask=5), body(name="b")],
        allow=[["a", "b"], ["b", "a", "glued"]],
        name="n",
    )
    a = scene.bodies[0]
    assert (a.static, a.group, a.mask, a.source.endswith('scene.json: bodies[0] "a"')) == (True, 2, 5, True)
    assert scene.allowed == [("a", "b", "allowed by the scene"), ("b", "a", "glued")] and scene.name == "n"


def test_meshes_and_urdf_beside_the_scene(scene_of, tmp_path):
    pytest.importorskip("trimesh")
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><link name="l"><collision><geometry><mesh '
        'filename="t.obj"/></geometry></collision></link></robot>'
    )
    scene = scene_of(
        units="mm",
        bodies=[body({"mesh": {"file": "t.obj", "scale": [2, 1, 1]}})],
        robots=[
            {"urdf": "r.urdf", "name": "left", "prefix": "l_", "base": "mobile"},
            {"urdf": "r.urdf", "name": "right", "prefix": "r_"},
        ],
    )
    mug = scene.body("mug")
    assert (
        isinstance(mug.shape, Mesh)
        and mug.shape.vertices.max() == 2
        and not mug.shape.solid
        and mug.approximation is None
    )
    hull = scene_of(bodies=[body({"mesh": {"file": "t.obj", "as": "hull"}})]).body("mug")
    assert hull.shape.points.max() == 1 and hull.approximation == "hull of 3 vertices of an open mesh"
    left = scene_of(robots=[{"urdf": "r.urdf", "meshes": "hull"}, {"urdf": "r.urdf", "prefix": "r_"}]).bodies
    assert [type(b.shape).__name__ for b in left] == ["ConvexHull", "Mesh"]
    assert [(b.name, b.owner, b.static) for b in scene.bodies[:2]] == [("l_l", "left", False), ("r_l", "right", True)]


def test_inline_robot_and_states(scene_of):
    scene = scene_of(
        robots=[{"robot": ARM, "pose": {"xyz": [0, 5, 0]}, "state": {"slide": 0.5}}], states={"far": {"slide": 2.5}}
    )
    assert scene.body("hand").X_WB[:3, 3].tolist() == [0.5, 5, 1] and scene.notes == []
    assert scene.allowed == [("base", "hand", "adjacent links")] and set(scene.states) == {"out", "far"}
    out = scene.with_state("out")
    assert out.body("hand").X_WB[0, 3] == 1.5 and scene.body("hand").X_WB[0, 3] == 0.5
    far = out.with_state("far")
    assert far.notes == ["robot arm: joint slide at 2.5 m is outside its limits [0, 2]"]
    assert far.with_state({"slide": 0.5}).notes == []
    with pytest.raises(InvalidArgument, match="unknown state 'up'; it has out, far"):
        scene.with_state("up")
    with pytest.raises(InvalidArgument, match="unknown joint 'slid'; its robots have slide"):
        scene.with_state({"slid": 1})


def test_a_named_state_for_a_robot(scene_of):
    assert scene_of(robots=[{"robot": ARM, "state": "out"}]).state == {"slide": 1.5}


def test_include(scene_of, tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/in.json").write_text(
        json.dumps({"collide": 1, "units": "mm", "bodies": [body({"sphere": {"radius": 100}}, "inner")]})
    )
    scene = scene_of(include=["parts/in.json"], bodies=[body()], allow=[["mug", "inner"]])
    assert [b.name for b in scene.bodies] == ["inner", "mug"] and scene.bodies[0].shape == Sphere(0.1)
    assert len(scene.sources) == 2
    (tmp_path / "parts/in.json").write_text(json.dumps({"collide": 1, "include": ["../scene.json"]}))
    with pytest.raises(SceneError, match=r"circle: scene\.json -> in\.json -> scene\.json"):
        scene_of(include=["parts/in.json"])


# --- bad input ------------------------------------------------------------------------------------

BAD = {
    "version": ({"collide": 2}, "collide: must be 1"),
    "unit": ({"units": "inch"}, "units: must be one of m, cm, mm, got 'inch'"),
    "key": ({"bodys": []}, r"unknown key 'bodys' \(did you mean 'bodies'\?\); known keys are collide, name"),
    "not a list": ({"bodies": {"name": "a"}}, "bodies: must be a list"),
    "not a mapping": ({"bodies": ["mug"]}, r"bodies\[0\]: must be a mapping with the keys name"),
    "body key": ({"bodies": [body(colour="red")]}, r"bodies\[0\]: unknown key 'colour'"),
    "no name": ({"bodies": [{"shape": BALL}]}, r"bodies\[0\]: 'name' is missing"),
    "no shape": ({"bodies": [{"name": "mug"}]}, r"bodies\[0\] \"mug\": 'shape' is missing"),
    "duplicate": (
        {"bodies": [body(), body()]},
        r'bodies\[1\] "mug": a body named "mug" exists already, from .*bodies\[0\]',
    ),
    "shape": (
        {"bodies": [body({"bx": {}})]},
        r"\"mug\".shape: unknown shape 'bx' \(did you mean 'box'\?\); known shapes are box",
    ),
    "two shapes": ({"bodies": [body({**BALL, "box": {"size": [1, 1, 1]}})]}, "needs one shape"),
    "shape key": (
        {"bodies": [body({"sphere": {"radios": 1}})]},
        r"shape.sphere: unknown key 'radios' \(did you mean 'radius'\?\)",
    ),
    "missing number": ({"bodies": [body({"capsule": {"radius": 1}})]}, "shape.capsule: 'length' is missing"),
    "negative": (
        {"bodies": [body({"sphere": {"radius": -1}})]},
        r'bodies\[0\] "mug".shape.sphere: Sphere: radius must be > 0, got -1',
    ),
    "NaN": ({"bodies": [body(pose={"xyz": [0, math.nan, 0]})]}, r'bodies\[0\] "mug".pose.xyz: must be finite numbers'),
    "text": ({"bodies": [body({"sphere": {"radius": "big"}})]}, "sphere.radius: must be a number, got 'big'"),
    "count": ({"bodies": [body(pose={"xyz": [0, 1]})]}, r"pose.xyz: must be 3 numbers, got \[0, 1\]"),
    "empty points": ({"bodies": [body({"hull": {"points": []}})]}, "hull.points: must be N × 3 numbers"),
    "NaN points": ({"bodies": [body({"hull": {"points": [[0, 0, math.nan]]}})]}, "hull.points: must be finite"),
    "empty polytope": (
        {"bodies": [body({"hpolytope": {"normals": [[1, 0, 0], [-1, 0, 0]], "offsets": [0, -1]}})]},
        "shape.hpolytope: HPolytope",
    ),
    "ragged heights": (
        {"bodies": [body({"heightfield": {"heights": [[0, 1], [2]], "cell": 1}})]},
        r"shape.heightfield.heights: must be N × N numbers, got \[\[0, 1\], \[2\]\]",
    ),
    "one row of heights": (
        {"bodies": [body({"heightfield": {"heights": [[0, 1]], "cell": 1}})]},
        r'"mug".shape.heightfield: HeightField: heights must have at least 2 rows and 2 columns',
    ),
    "cell": (
        {"bodies": [body({"heightfield": {"heights": [[0, 1], [0, 1]], "cell": [1, 2, 3]}})]},
        r"shape.heightfield.cell: must be 2 numbers, got \[1, 2, 3\]",
    ),
    "no cell": ({"bodies": [body({"heightfield": {"heights": [[0, 1], [0, 1]]}})]}, "heightfield: 'cell' is missing"),
    "high bottom": (
        {"bodies": [body({"heightfield": {"heights": [[0, 1], [0, 1]], "cell": 1, "bottom": 0.5}})]},
        r"shape.heightfield: HeightField: bottom must lie below all heights, got 0.5, and heights\[0, 0\] is 0.0",
    ),
    "nested": (
        {"bodies": [body({"compound": [{"shape": {"sphere": {"radius": 0}}}]})]},
        r"compound\[0\].shape.sphere: Sphere",
    ),
    "empty compound": ({"bodies": [body({"compound": []})]}, '"mug".shape.compound: Compound: items is empty'),
    "two rotations": ({"bodies": [body(pose={"rpy": [0, 0, 0], "rpy_deg": [0, 0, 0]})]}, "pose: give one of rpy"),
    "zero quaternion": (
        {"bodies": [body(pose={"quat_wxyz": [0, 0, 0, 0]})]},
        r'"mug".pose: pose: a quaternion of length 0',
    ),
    "no rotation": (
        {"bodies": [body(pose={"matrix": (2 * np.eye(4)).tolist()})]},
        '"mug".pose: matrix must end in the row',
    ),
    "mirror": ({"bodies": [body(pose={"matrix": np.diag([1, 1, -1, 1]).tolist()})]}, '"mug".pose: matrix mirrors'),
    "mask": ({"bodies": [body(mask=70000)]}, '"mug".mask: must be a whole number from 0 to 65535'),
    "static": ({"bodies": [body(static="no")]}, '"mug".static: must be true or false'),
    "allow": (
        {"bodies": [body()], "allow": [["mug", "mugg"]]},
        r"allow\[0\]: no body is called 'mugg' \(did you mean 'mug'\?\)",
    ),
    "allow itself": ({"bodies": [body()], "allow": [["mug", "mug"]]}, "never tested against itself"),
    "mesh": ({"bodies": [body({"mesh": {"file": "gone.stl"}})]}, r'"mug".shape.mesh.file: cannot find "gone.stl"'),
    "mesh scale": ({"bodies": [body({"mesh": {"file": "x.stl", "scale": 0}})]}, "mesh.scale: must not be 0"),
    "no robot": ({"robots": [{}]}, r"robots\[0\]: give one of urdf, mjcf and sdf, a file, or robot"),
    "urdf": ({"robots": [{"urdf": "gone.urdf"}]}, r'robots\[0\].urdf: cannot find "gone.urdf"'),
    "joint": (
        {"robots": [{"robot": ARM, "state": {"slid": 1}}]},
        r"state: unknown joint 'slid' \(did you mean 'slide'\?\)",
    ),
    "state": ({"robots": [{"robot": ARM, "state": "outt"}]}, r"state: unknown state 'outt' \(did you mean 'out'\?\)"),
    "NaN state": (
        {"robots": [{"robot": ARM, "state": {"slide": math.nan}}]},
        "state.slide: must be a finite number, got nan",
    ),
    "base": ({"robots": [{"robot": ARM, "base": "free"}]}, "base: must be one of fixed, mobile"),
    "twice": (
        {"robots": [{"robot": ARM}, {"robot": ARM}]},
        r"robots\[1\].*a body named \"base\" exists already.*prefix",
    ),
    "scene state": (
        {"robots": [{"robot": ARM}], "states": {"s": {"x": 1}}},
        "states.s: scene scene: values of its state name an unknown joint 'x'",
    ),
    "tree": ({"robots": [{"robot": {**ARM, "joints": []}}]}, r"robots\[0\].robot: 3 links have no parent"),
    "joint type": (
        {"robots": [{"robot": {**ARM, "joints": [{"name": "j", "type": "hinge", "parent": "a", "child": "b"}]}}]},
        "type: must be one of revolute",
    ),
    "limits": (
        {
            "robots": [
                {
                    "robot": {
                        **ARM,
                        "joints": [{"name": "j", "type": "revolute", "parent": "a", "child": "b", "limits": [1, 0]}],
                    }
                }
            ]
        },
        "the lower limit is above",
    ),
    "link pair": (
        {"robots": [{"robot": {**ARM, "allow": [["base", "hnd"]]}}]},
        r"unknown link 'hnd' \(did you mean 'hand'\?\)",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_clear_error(scene_of, case):
    keys, message = BAD[case]
    with pytest.raises((SceneError, InvalidShape, InvalidPose), match=message) as caught:
        scene_of(**keys)
    assert "scene.json" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.json", "{", "is not JSON"),
        ("a.json", '{"collide": 1, "collide": 1}', "the key 'collide' stands twice"),
        ("a.json", "[" * 100000, "a.json"),
        ("a.json", "{}", "is no scene: a scene file starts with the key collide: 1"),
        ("a.json", "[1]", "is no scene"),
        ("a.json", '{"j1": 0.5}', r"holds joint values, not a scene: give it as state= \(--state\)"),
        ("a.yaml", "collide: 1\ncollide: 1", "line 2, column 1: the key 'collide' stands twice"),
        ("a.yaml", "a: [", "is not YAML: line"),
        ("a.yaml", "!!python/object/apply:os.system ['true']", "is not YAML"),
        ("a.yaml", "", "is no scene"),
        ("a.yaml", b"\xff\xfe\x00", "a.yaml"),
        ("a.xyz", "", "unknown format '.xyz'"),
    ],
)
def test_files_that_are_no_scene(tmp_path, name, text, message):
    if name.endswith("yaml"):
        pytest.importorskip("yaml")
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(CollideError, match=message):
        load(tmp_path / name)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(SceneError, match=r"gone\.yaml: no such file"):
        load(tmp_path / "gone.yaml")
    with pytest.raises(SceneError, match="no shipped scene of that name; there are panda_workbench, workcell"):
        load("kitchen")
    with pytest.raises(SceneError, match="is a folder"):
        load(tmp_path)


def test_yaml_numbers_with_exponents(tmp_path):
    pytest.importorskip("yaml")
    (tmp_path / "s.yaml").write_text(
        "collide: 1\nbodies:\n- {name: a, shape: {sphere: {radius: 1e-3}}, pose: {xyz: [-2E+1, .5, 1]}}\n"
    )
    scene = load(tmp_path / "s.yaml")
    assert scene.bodies[0].shape == Sphere(0.001) and scene.bodies[0].X_WB[:3, 3].tolist() == [-20, 0.5, 1]


def test_yaml_without_pyyaml_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "yaml", None)
    (tmp_path / "s.yaml").write_text("collide: 1\n")
    with pytest.raises(MissingExtra, match=r"pip install 'collide-robotics\[robots\]'"):
        load(tmp_path / "s.yaml")


# --- joint states ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        '{"slide": 1.25}', '{"name": ["slide"], "position": [1.25]}', '{"joint_names": ["slide"], "positions": [1.25]}',
        '{"joint_state": {"header": {}, "name": ["slide"], "position": [1.25], "velocity": []}}',
    ],
)
def test_state_files(scene_of, tmp_path, text):
    scene_of(robots=[{"robot": ARM}])
    (tmp_path / "q.json").write_text(text)
    assert load(tmp_path / "scene.json", state=tmp_path / "q.json").state == {"slide": 1.25}
    assert load(tmp_path / "scene.json", state=str(tmp_path / "q.json")).notes == []
    assert load(tmp_path / "scene.json", state={"slide": 1.25}).state == {"slide": 1.25}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"x": 1}', "unknown joint 'x'; its robots have slide"),
        ('{"slide": "a"}', "q.json: slide: must be a number, got 'a'"),
        ('{"slide": NaN}', "q.json: slide: must be a finite number, got nan"),
        ('{"name": ["slide", "slide"], "position": [1, 2]}', 'joint "slide" stands twice'),
        ('{"name": ["slide"], "position": [1, 2]}', "must hold one value for each of the 1 joints"),
        ("[1]", "must be a mapping"),
    ],
)
def test_bad_state_files(scene_of, tmp_path, text, message):
    scene_of(robots=[{"robot": ARM}])
    (tmp_path / "q.json").write_text(text)
    with pytest.raises(SceneError, match=message):
        load(tmp_path / "scene.json", state=tmp_path / "q.json")
    with pytest.raises(SceneError, match="unknown state 'tucked'; it has out; there is no file"):
        load(tmp_path / "scene.json", state="tucked")


def test_state_of_a_scene_without_robots(scene_of, tmp_path):
    scene_of(bodies=[body()])
    with pytest.raises(SceneError, match="it has no robot with joints"):
        load(tmp_path / "scene.json", state={"j": 1})


# --- several files, worlds, shipped scenes ----------------------------------------------------------


def test_scenes_together(scene_of, tmp_path):
    scene_of("a.json", robots=[{"robot": ARM}], bodies=[body()])
    scene_of("b.json", bodies=[body(name="b")])
    both = load(tmp_path / "a.json", tmp_path / "b.json", state="out")
    assert [b.name for b in both.bodies] == ["base", "hand", "mug", "b"] and both.body("hand").X_WB[0, 3] == 1.5
    with pytest.raises(SceneError, match='a body named "b" exists already'):
        load(tmp_path / "b.json", tmp_path / "b.json")


def test_world_has_the_bodies_and_pairs(scene_of):
    scene = scene_of(
        robots=[{"robot": ARM, "state": "out"}],
        bodies=[body(pose={"xyz": [1.55, 0, 1]}), body(name="far", pose={"xyz": [9, 9, 9]})],
    )
    world = scene.world()
    assert sorted(world.names.values()) == ["base", "far", "hand", "mug"]
    assert world.collisions().names == [("hand", "mug")]
    assert world.stats["skipped"]["adjacent links"] == 1


def test_shipped_scenes_are_listed_and_found():
    assert scenes.shipped() == ["panda_workbench", "workcell"]
    for name in scenes.shipped():
        assert scenes.path(name).is_file()
    with pytest.raises(SceneError, match="no shipped scene has the name 'kitchen'; there are panda_workbench"):
        scenes.path("kitchen")


def test_workcell_needs_numpy_alone():
    program = (
        "import sys\n"
        "for name in ('yaml', 'trimesh', 'scipy', 'yourdfpy', 'numba', 'rich'): sys.modules[name] = None\n"
        "from collide.scenes import load\n"
        "scene = load('workcell')\n"
        "print(len(scene.bodies), len(scene.notes), scene.robots['arm'].dof)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["30", "0", "7"]


def test_workcell_is_the_generated_one():
    document = json.loads(scenes.path("workcell").read_text())
    assert document == generators.workcell_document(np.random.default_rng(0))


def test_panda_workbench():
    pytest.importorskip("yaml")
    pytest.importorskip("trimesh")
    try:
        scene = load("panda_workbench")
    except SceneError as error:
        if "[demo]" in str(error):
            pytest.skip("example-robot-data is not installed")
        raise
    assert scene.notes == [] and len([b for b in scene.bodies if b.owner is None and not b.static]) >= 12
    kinds = {type(b.shape).__name__ for b in scene.bodies}
    assert kinds == {
        "Halfspace",
        "Compound",
        "Box",
        "HPolytope",
        "Cylinder",
        "Sphere",
        "Capsule",
        "Cone",
        "Ellipsoid",
        "ConvexHull",
        "Mesh",
    }
    result = scene.world().distances(max_distance=0.05)
    near = {frozenset(names): row for row, names in zip(result.rows, result.names)}
    dips = near[frozenset(("panda_leftfinger", "parcel"))]["distance"]
    assert -0.005 < dips < -0.003
    assert near[frozenset(("mug", "shelf_board_2"))]["distance"] == pytest.approx(-0.0025, abs=1e-9)
    deep = [names for names, row in near.items() if row["distance"] < -1e-6]
    assert len(deep) == 2
    robot = {b.name for b in scene.bodies if b.owner}
    misses = [names for names, row in near.items() if names & robot and row["distance"] > 1e-6]
    assert 2 <= len(misses) <= 6
    touching = [names for names, row in near.items() if abs(row["distance"]) < 1e-9]
    assert len(touching) >= 10


def test_all_damaged_files_of_a_scene_are_named_at_once(tmp_path):
    (tmp_path / "good.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for name in ("x.obj", "y.obj"):
        (tmp_path / name).write_text("v 0 0 0\nf 1 2 3\n")
    files = [tmp_path / name for name in ("x.obj", "good.obj", "y.obj", "absent.obj")]
    urdf = "".join(
        f'<link name="l{k}"><collision><geometry><mesh filename="{file.name}"/></geometry></collision></link>'
        for k, file in enumerate(files)
    ) + "".join(
        f'<joint name="j{k}" type="fixed"><parent link="l0"/><child link="l{k}"/></joint>' for k in range(1, len(files))
    )
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{urdf}</robot>')
    bodies = [{"name": file.stem, "shape": {"mesh": {"file": file.name}}} for file in files]
    (tmp_path / "s.json").write_text(json.dumps({"collide": 1, "bodies": bodies}))
    for places in (files, [tmp_path / "r.urdf"], [tmp_path / "s.json"]):
        with pytest.raises(SceneError) as caught:
            load(*places)
        assert len(caught.value.messages) == 3 and str(caught.value).startswith("3 complaints: ")
        for name, message in zip(("x.obj", "y.obj", "absent.obj"), caught.value.messages):
            assert name in message
    with pytest.raises(SceneError) as caught:
        load(files[0], files[1])
    assert caught.value.messages == () and "x.obj" in str(caught.value)


@pytest.mark.parametrize("ending", ["urdf", "sdf"])
def test_angles_that_look_like_degrees_are_noted(tmp_path, ending):
    geometry = "<geometry><sphere><radius>1</radius></sphere></geometry>"
    text = {
        "urdf": '<robot name="r"><link name="a"><collision><origin rpy="0 0 {}"/><geometry><sphere radius="1"/>'
        "</geometry></collision></link></robot>",
        "sdf": '<sdf version="1.9"><model name="r"><link name="a"><collision name="c"><pose>0 0 0 0 0 {}</pose>'
        f"{geometry}</collision></link></model></sdf>",
    }[ending]
    for angle, is_noted in ((90, True), (6.2832, False)):
        file = tmp_path / f"r.{ending}"
        file.write_text(text.format(angle))
        notes = load(file).notes
        assert any(f'"0 0 {angle}" exceeds a full turn of radians: is it in degrees?' in n for n in notes) == is_noted
