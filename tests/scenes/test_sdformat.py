"""SDFormat: frames, joints, includes and filters, and one clear complaint for bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest

from collide.errors import CollideError, SceneError
from collide.robots.robot import Robot
from collide.scenes import load
from collide.shapes import Box, Capsule, Compound, Cone, Cylinder, Ellipsoid, Halfspace
from collide.transforms import pose

TETRAHEDRA = """o small
v 1 0 0
v 2 0 0
v 1 1 0
v 1 0 1
f 1 3 2
f 1 2 4
f 2 3 4
f 3 1 4
o large
v 0 0 0
v 3 0 0
v 0 3 0
v 0 0 3
f 5 7 6
f 5 6 8
f 6 7 8
f 7 5 8
"""


def collision(shape: str, name: str = "c", more: str = "") -> str:
    return f'<collision name="{name}">{more}<geometry>{shape}</geometry></collision>'


UPRIGHT = "<axis><xyz>0 0 1</xyz></axis>"
BALL = collision("<sphere><radius>0.1</radius></sphere>")


def bitmask(bits: str) -> str:
    return f"<surface><contact><collide_bitmask>{bits}</collide_bitmask></contact></surface>"


def link(name: str, inside: str = BALL, at: str = "") -> str:
    return f'<link name="{name}">{f"<pose>{at}</pose>" if at else ""}{inside}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = UPRIGHT) -> str:
    return f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>{inside}</joint>'


def model(*inside: str, name: str = "m", about: str = "") -> str:
    return f'<model name="{name}"{about}>' + "\n".join(inside) + "</model>"


@pytest.fixture
def write(tmp_path):
    """what stands in <sdf> -> the path of a file of it."""

    def make(*inside: str, version: str = "1.7", name: str = "m.sdf"):
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f'<?xml version="1.0"?>\n<sdf version="{version}">' + "\n".join(inside) + "</sdf>\n")
        return file

    return make


def poses_of(scene) -> dict[str, np.ndarray]:
    """link -> its pose in the world, of all robots of a scene."""
    return {
        name: X for p in scene.placements.values() for name, X in zip(p.robot.links, p.robot.link_poses(p.q, p.X_WR)[0])
    }


def test_shapes_and_their_poses(write, tmp_path):
    (tmp_path / "t.obj").write_text(TETRAHEDRA)
    mesh = "<mesh><uri>t.obj</uri><scale>2 2 2</scale><submesh><name>small</name><center>true</center></submesh></mesh>"
    scene = load(write(model(
        link("box", collision("<box><size>1 2 3</size></box>", more="<pose degrees='true'>0.1 0.2 0.3 0 0 90</pose>")),
        link("cylinder", collision("<cylinder><radius>0.1</radius><length>0.4</length></cylinder>")),
        link("capsule", collision("<capsule><radius>0.1</radius><length>0.4</length></capsule>")),
        link("cone", collision("<cone><radius>0.1</radius><length>0.4</length></cone>")),
        link("ellipsoid", collision("<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>")),
        link("plane", collision("<plane><normal>0 1 0</normal><size>5 5</size></plane>")),
        link("mesh", collision(mesh)), link("two", BALL + BALL), link("none", ""),
    )))
    shapes = {body.name: body.shape for body in scene.bodies}
    assert shapes["m::box"] == Box((1, 2, 3)) and shapes["m::cylinder"] == Cylinder(0.1, 0.4)
    assert shapes["m::capsule"] == Capsule(0.1, 0.4) and shapes["m::cone"] == Cone(0.1, 0.4)
    assert shapes["m::ellipsoid"] == Ellipsoid((0.1, 0.2, 0.3)) and shapes["m::plane"] == Halfspace((0, 1, 0), 0)
    assert sorted(shapes["m::mesh"].points.tolist()) == [[-1, -1, -1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    assert isinstance(shapes["m::two"], Compound) and "m::none" not in shapes
    expected = [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]
    assert scene.body("m::box").X_WB.tolist() == expected
    assert scene.body("m::box").source.endswith('m.sdf: link "box" collision "c"')


def test_an_arm_is_a_robot(write):
    limits = "<limit><lower>-1</lower><upper>2</upper></limit>"
    robot = Robot.load(write(model(
        link("base"), link("arm", at="0 0 1 0 0 0"), link("hand", at="0 0 2 0 0 0"),
        joint("lift", "base", "arm", "prismatic", f"<axis><xyz>0 0 2</xyz>{limits}</axis>"),
        joint("turn", "arm", "hand", "revolute", "<pose>0.5 0 0 0 0 0</pose><axis><xyz>0 0 1</xyz></axis>"),
    )))
    assert robot.root == "base" and robot.joint_names == ("lift", "turn")
    assert (robot.lower.tolist(), robot.upper.tolist()) == ([-1, -math.inf], [2, math.inf])
    at = dict(zip(robot.links, robot.link_poses([0.25, math.pi / 2], np.eye(4))[0]))
    assert at["arm"][:3, 3].tolist() == [0, 0, 1.25]
    np.testing.assert_allclose(at["hand"][:3, 3], [0.5, -0.5, 2.25], atol=1e-15)  # about (0.5, 0)
    assert robot.disabled_pairs == [("base", "arm", "linked by a joint"), ("arm", "hand", "linked by a joint")]


def test_poses_are_relative_to_frames(write):
    scene = load(write(model(
        "<frame name='f' attached_to='a'><pose>0 0 1 0 0 0</pose></frame>",
        "<frame name='g'><pose relative_to='f' degrees='true'>1 0 0 0 0 90</pose></frame>",
        link("a", at="5 0 0 0 0 0"),
        "<link name='b'><pose relative_to='g' rotation_format='quat_xyzw'>1 0 0 0 0 0 1</pose>"
        + collision("<sphere><radius>1</radius></sphere>", more="<pose relative_to='f'>0 0 0.5 0 0 0</pose>")
        + "</link>",
        joint("j", "f", "b", "continuous", "<axis><xyz expressed_in='g'>1 0 0</xyz></axis>"),
        "<pose>0 0 100 0 0 0</pose>",
    )))
    at = poses_of(scene)
    assert at["a"][:3, 3].tolist() == [5, 0, 100]
    np.testing.assert_allclose(at["b"][:3, 3], [6, 1, 101], atol=1e-15)  # g is turned: its x is y
    np.testing.assert_allclose(scene.body("b").X_WB[:3, 3], [5, 0, 101.5], atol=1e-12)
    turned = poses_of(scene.with_state({"j": math.pi / 2}))["b"]
    np.testing.assert_allclose(turned[:3, :3], pose(R=at["b"][:3, :3])[:3, :3] @ pose(rpy=(math.pi / 2, 0, 0))[:3, :3],
                               atol=1e-15)  # about g's x, which is b's


@pytest.mark.parametrize(("version", "axis", "expected"), [
    ("1.4", "", [1, 0, 0]), ("1.5", "", [0, 1, 0]), ("1.7", "", [0, 1, 0]),
    ("1.5", "<use_parent_model_frame>true</use_parent_model_frame>", [1, 0, 0]),
])
def test_axes_of_old_files_are_those_of_the_model(write, version, axis, expected):
    """A link turned by 90° about z: an axis along x is the model's x, or the link's, the model's y."""
    scene = load(write(model(
        link("a"), link("b", at=f"0 0 0 0 0 {math.pi / 2!r}"),
        joint("j", "a", "b", inside=f"<axis><xyz>1 0 0</xyz>{axis}</axis>"),
    ), version=version))
    turned = poses_of(scene.with_state({"j": 0.5}))["b"] @ np.linalg.inv(poses_of(scene)["b"])
    np.testing.assert_allclose(turned[:3, :3] @ expected, expected, atol=1e-15)
    assert abs(turned[0, 0] - 1.0) + abs(turned[1, 1] - 1.0) > 0.1


def test_joints_of_several_coordinates(write):
    two = "<axis><xyz>0 0 1</xyz></axis><axis2><xyz>1 0 0</xyz></axis2>"
    screw = "<axis><xyz>0 0 1</xyz></axis><screw_thread_pitch>0.5</screw_thread_pitch>"
    old_screw = f"<axis><xyz>0 0 1</xyz></axis><thread_pitch>{-math.tau / 0.5}</thread_pitch>"
    scene = load(write(model(
        link("a"), link("b"), link("c"), link("d"), link("e"), joint("u", "a", "b", "universal", two),
        joint("ball", "b", "c", "ball", ""), joint("s", "c", "d", "screw", screw),
        joint("t", "d", "e", "screw", old_screw),
    )))
    assert [*scene.robots["m"].joint_names] == ["u/axis", "u/axis2", "ball/yaw", "ball/pitch", "ball/roll", "s", "t"]
    values = {"u/axis": 0.3, "u/axis2": 0.4, "ball/yaw": 0.1, "ball/pitch": 0.2, "ball/roll": 0.3, "s": 1.0, "t": 2.0}
    at = poses_of(scene.with_state(values))
    X = pose(rpy=(0, 0, 0.3)) @ pose(rpy=(0.4, 0, 0))
    np.testing.assert_allclose(at["b"], X, atol=1e-15)
    np.testing.assert_allclose(at["c"], X @ pose(rpy=(0.3, 0.2, 0.1)), atol=1e-15)
    X_CD = pose((0, 0, 0.5 / math.tau), rpy=(0, 0, 1.0))
    np.testing.assert_allclose(np.linalg.inv(at["c"]) @ at["d"], X_CD, atol=1e-15)
    X_DE = pose((0, 0, 1.0 / math.tau), rpy=(0, 0, 2.0))
    np.testing.assert_allclose(np.linalg.inv(at["d"]) @ at["e"], X_DE, atol=1e-15)


def test_joints_may_point_to_the_root_and_close_loops(write):
    scene = load(write(model(
        link("a"), link("b", at="1 0 0 0 0 0"), link("c", at="2 0 0 0 0 0"),
        joint("ab", "a", "b"), joint("cb", "c", "b"), joint("ac", "a", "c"),
    )))
    robot = scene.robots["m"]
    assert robot.root == "a" and robot.joint_names == ("ab", "cb") and "NOT kept: ac" in " ".join(scene.notes)
    backwards = load(write(model(
        link("b", at="1 0 0 0 0 0"), link("a"), link("c", at="2 0 0 0 0 0"),
        joint("world", "world", "c"), joint("cb", "b", "c"),
        joint("ab", "a", "b", inside="<pose>0 1 0 0 0 0</pose><axis><xyz>0 0 1</xyz></axis>"),
    )))
    q = {"cb": 0.3, "ab": 0.7}
    at = poses_of(backwards.with_state(q))
    X_BC = pose((1, 0, 0)) @ pose(rpy=(0, 0, 0.3))  # about the origin of c
    np.testing.assert_allclose(np.linalg.inv(at["b"]) @ at["c"], X_BC, atol=1e-15)
    X_AB = pose((1, 1, 0)) @ pose(rpy=(0, 0, 0.7)) @ pose((0, -1, 0))
    np.testing.assert_allclose(np.linalg.inv(at["a"]) @ at["b"], X_AB, atol=1e-15)
    assert not backwards.body("b").static and not backwards.body("c").static


def test_limits_and_mimic(write):
    mimic = '<mimic joint="j"><multiplier>2</multiplier><offset>0.5</offset><reference>0.25</reference></mimic>'
    robot = Robot.load(write(model(
        link("a"), link("b"), link("c"), link("d"), joint("j", "a", "b"),
        joint("k", "b", "c", inside=f"<axis><xyz>0 0 1</xyz>{mimic}</axis>"),
        joint("l", "c", "d", inside="<axis><xyz>0 0 1</xyz><limit><lower>1</lower><upper>-1</upper></limit></axis>"),
    )))
    assert robot.joint_names == ("j", "l") and robot.upper.tolist() == [math.inf, math.inf]
    at = dict(zip(robot.links, robot.link_poses([1.0, 0.0], np.eye(4))[0]))
    np.testing.assert_allclose(np.linalg.inv(at["b"]) @ at["c"], pose(rpy=(0, 0, 2 * (1.0 - 0.25) + 0.5)), atol=1e-15)
    assert "the lower above the upper" in " ".join(robot.notes)


def test_models_within_models_and_includes(write, tmp_path):
    write(model(link("blade"), link("rim", at="0 0 1 0 0 0"), joint("spin", "rim", "blade"), name="wheel",
                about=' placement_frame="rim"'), name="wheel/wheel.sdf")
    (tmp_path / "wheel/model.config").write_text(
        '<model><sdf version="1.5">old.sdf</sdf><sdf version="1.10">wheel.sdf</sdf></model>')
    place = "<name>{}</name><pose relative_to='hub'>{} 0 0 0 0 0</pose>"
    scene = load(write(
        "<world name='w'>", model(
            link("hub", at="0 0 3 0 0 0"), "<include><uri>model://wheel</uri>" + place.format("left", 1) + "</include>",
            "<include><uri>wheel/wheel.sdf</uri>" + place.format("right", 2) + "</include>",
            joint("l", "hub", "left::rim", "fixed", ""), joint("r", "hub", "right", "fixed", ""), name="car"),
        "<include><uri>wheel</uri><static>true</static></include>", "</world>", name="w.sdf"))
    at = poses_of(scene)
    assert at["car::left::rim"][:3, 3].tolist() == [1, 0, 3] and at["car::right::blade"][:3, 3].tolist() == [2, 0, 2]
    assert scene.body("wheel::rim").static and scene.body("wheel::blade").X_WB[:3, 3].tolist() == [0, 0, -1]
    assert [*scene.robots["car"].joint_names] == ["car::left::spin", "car::right::spin"]
    assert scene.name == "w" and [source.rsplit("/", 1)[1] for source in scene.sources] == ["w.sdf", "wheel.sdf"]


def test_which_pairs_are_tested(write):
    apart = "<self_collide>false</self_collide>"
    bits = BALL.replace("<geometry>", bitmask("0x01") + "<geometry>")
    other = bits.replace("0x01", "2")
    touching = [link(name) for name in "abc"]
    silent = load(write(model(*touching, joint("ab", "a", "b"))))
    assert {frozenset(pair) for pair in silent.world().collisions().names} == {frozenset("ac"), frozenset("bc")}
    assert any("Gazebo would not" in note for note in silent.notes)
    off = load(write(model(*touching, joint("ab", "a", "b"), apart)))
    assert len(off.world().collisions()) == 0 and all(why != "" for *_, why in off.allowed)
    one = load(write(model(
        link("a"), link("b"), link("c", "<self_collide>1</self_collide>" + BALL), joint("ab", "a", "b"), apart)))
    assert len(one.world().collisions()) == 2
    masked = load(write("<world name='w'>", model(link("l", bits), name="x"), model(link("l", other), name="y"),
                        model(link("l", BALL), name="z"), "</world>"))
    assert {frozenset(pair) for pair in masked.world().collisions().names} == {
        frozenset(("x::l", "z::l")), frozenset(("y::l", "z::l"))}


def test_what_is_left_out_is_noted(write):
    scene = load(write(
        "<world name='w'><actor name='walker'/><state/>",
        model(link("a", collision("<heightmap><uri>h.png</uri></heightmap>") + BALL), link("b", "<visual name='v'/>")),
        model(link("a", "")), "</world>"))
    text = "\n".join(scene.notes)
    for words in (
        "actors are NOT read", "the state that a world was saved in is NOT read", "an image of heights, is not read",
        'link "b" has a visual but no collision', "one was called m_2", 'model "m_2" has no collision geometry',
    ):
        assert words in text


def test_a_robot_among_other_things(write, tmp_path):
    arm = model(link("a"), link("b"), joint("j", "a", "b"), name="arm")
    path = write("<world name='w'>", arm, model(link("l"), name="table"), "</world>")
    (tmp_path / "m.srdf").write_text(
        '<robot name="arm"><group name="g"><joint name="j"/></group>'
        '<group_state name="up" group="g"><joint name="j" value="1"/></group_state></robot>')
    robot = Robot.load(path)
    assert robot.name == "arm" and robot.states == {"up": {"j": 1.0}}
    assert any("no part of the robot: table::l" in note for note in robot.notes)
    assert [body.name for body in load(path, state={"arm::j": 1.0}).bodies] == ["arm::a", "arm::b", "table::l"]


@pytest.mark.parametrize(("inside", "words"), [
    ("", "has no <model>"),
    (model(), "has no <link>"),
    (model(link("a"), link("a")), "used twice"),
    (model(link("")), 'needs a name'),
    (model(link("a::b")), "is no name"),
    (model(link("a", at="1 2 3")), "must be 6 finite numbers"),
    (model("<link name='a'><pose relative_to='b'/></link>"), 'unknown frame "b"'),
    (model(*(f"<link name='{a}'><pose relative_to='{b}'/></link>" for a, b in ("ab", "ba"))), "in a circle"),
    (model(link("a", "<collision name='c'/>")), "needs <geometry> with one shape"),
    (model(link("a", collision("<torus/>"))), "unknown shape <torus>"),
    (model(link("a", collision("<box/>"))), "<box> needs <size>"),
    (model(link("a", collision("<sphere><radius>-1</radius></sphere>"))), "radius"),
    (model(link("a", collision("<mesh/>"))), "<mesh> needs <uri>"),
    (model(link("a", collision("<mesh><uri>model://gone/a.stl</uri></mesh>"))), "GZ_SIM_RESOURCE_PATH"),
    (model(link("a"), joint("j", "a", "gone")), 'unknown link or frame "gone"'),
    (model(link("a"), joint("j", "a", "a")), "are one link"),
    (model(link("a"), joint("j", "a", "world")), "cannot move"),
    (model(link("a"), link("b"), joint("j", "a", "b", "elastic")), "unknown type elastic"),
    (model(link("a"), link("b"), joint("j", "a", "b", "universal")), "needs <axis2>"),
    (model(link("a"), link("b"), joint("j", "a", "b", inside="<axis><xyz>0 0 0</xyz></axis>")), "names no direction"),
    (model(link("a", BALL.replace("<geometry>", bitmask("70000") + "<geometry>"))), "16 bits"),
    (model(link("a"), "<include merge='true'><uri>x.sdf</uri></include>"), "merge"),
    (model("<include><uri>https://fuel.gazebosim.org/1.0/x</uri></include>"), "download it first"),
    (model("<include><uri>m.sdf</uri></include>"), "includes more than"),
    ("<world name='a'/><world name='b'/>", "has 2 worlds"),
])
def test_bad_files_are_refused(write, inside, words):
    path = write(inside)
    with pytest.raises(CollideError, match="(?s)" + words.replace("(", r"\(")) as caught:
        load(path)
    assert str(path) in str(caught.value) and len(str(caught.value)) < 2000


def test_files_without_one_robot(write):
    two = write(*(model(link("a"), link("b"), joint("j", "a", "b"), name=name) for name in ("x", "y")))
    with pytest.raises(SceneError, match="2 robots: x, y"):
        Robot.load(two)
    with pytest.raises(SceneError, match="no joint in it"):
        Robot.load(write(model(link("a")), name="one.sdf"))
    assert [*load(two).robots] == ["x", "y"]


def test_a_part_of_an_mjcf_model(tmp_path):
    (tmp_path / "part.xml").write_text("<mujocoinclude/>")
    with pytest.raises(SceneError, match="give the file that includes it"):
        load(tmp_path / "part.xml")


def test_long_chains_of_frames_links_and_models(write):
    """A rope of 500 links, each posed by the one before it: no depth of Python's is reached."""
    links = [link("l0")] + [
        f'<link name="l{k}"><pose relative_to="l{k - 1}">0.1 0 0 0 0 0</pose>{BALL if k % 200 == 0 else ""}</link>'
        for k in range(1, 500)
    ]
    frames = ["<frame name='f0' attached_to='l0'/>"] + [
        f"<frame name='f{k}' attached_to='f{k - 1}'/>" for k in range(1, 500)]
    joints = [joint(f"j{k}", f"l{k - 1}", f"l{k}", "fixed", "") for k in range(1, 500)]
    scene = load(write(model(*links[::-1], *frames[::-1], *joints, joint("world", "world", "f499", "fixed", ""))))
    np.testing.assert_allclose(scene.body("l400").X_WB[:3, 3], [40, 0, 0], atol=1e-9)
    assert scene.body("l400").static
