"""URDF and SRDF: what is read, where meshes are found, and one clear complaint for bad input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from collide.errors import CollideError, SceneError
from collide.robots.robot import Robot
from collide.scenes import load
from collide.scenes.loaders import resources
from collide.shapes import Box, Capsule, Compound, ConvexHull, Cylinder, Halfspace, Sphere
from collide.transforms import pose

TETRAHEDRON = """o tetra
v 0 0 0
v 1 0 0
v 0 2 0
v 0 0 3
f 1 3 2
f 1 2 4
f 2 3 4
f 3 1 4
"""


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>'


def collision(shape: str, origin: str = "") -> str:
    return f"<collision>{origin}<geometry>{shape}</geometry></collision>"


def joint(name: str, parent: str, child: str, kind: str = "fixed", inside: str = "") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


BALL = collision('<sphere radius="0.1"/>')
LIMITS = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


@pytest.fixture
def robot_of(tmp_path):
    """body of <robot> -> the robot loaded from a file of it."""

    def make(*parts: str, root: str = '<robot name="r">', name: str = "r.urdf", **options) -> Robot:
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text('<?xml version="1.0"?>\n' + root + "\n".join(parts) + "</robot>\n")
        return Robot.load(file, **options)

    return make


def test_shapes_and_their_poses(robot_of):
    robot = robot_of(
        link("a", collision('<box size="1 2,3"/>', '<origin xyz="0.1 0.2 0.3" rpy="0 0 1.5707963267948966"/>')
             + collision('<cylinder radius="0.1" length="0.4"/>')),
        link("b", BALL), link("c", collision('<capsule radius="0.1" length="0.4"/>')),
        joint("j", "a", "b", "revolute", '<origin xyz="0 0 1"/><axis xyz="0 1 0"/>' + LIMITS), joint("k", "b", "c"),
    )
    box, cylinder = robot.geometry["a"]
    assert box.shape == Box((1, 2, 3)) and cylinder.shape == Cylinder(0.1, 0.4)
    np.testing.assert_allclose(box.X_LG, [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]], atol=1e-15)
    assert robot.geometry["b"][0].shape == Sphere(0.1) and robot.geometry["c"][0].shape == Capsule(0.1, 0.4)
    assert box.source.endswith('r.urdf: link "a" collision 0') and box.approximation is None
    assert (robot.lower, robot.upper) == ([-1], [1])


def test_a_link_becomes_one_body(robot_of, tmp_path):
    robot_of(link("a", BALL + BALL), link("b", collision('<sphere radius="0.1"/>', '<origin xyz="0 0 2"/>')), link("c"),
             joint("j", "a", "b", "prismatic", LIMITS), joint("k", "b", "c"))
    scene = load(tmp_path / "r.urdf", state={"j": 0.5})
    assert [(body.name, body.static, body.owner) for body in scene.bodies] == [("a", True, "r"), ("b", False, "r")]
    assert isinstance(scene.body("a").shape, Compound)
    assert scene.body("b").X_WB[:3, 3].tolist() == [0.5, 0, 2]
    assert scene.allowed == [("a", "b", "adjacent links")] and scene.notes == []


def test_srdf_beside_in_the_neighbour_folder_given_and_refused(robot_of, tmp_path):
    pairs = (
        '<robot name="r"><disable_collisions link1="a" link2="c" reason="Never"/><disable_collisions link1="a" '
        'link2="x"/>'
        '<group_state name="up" group="g"><joint name="j" value="0.5"/></group_state></robot>'
    )
    parts = (link("a", BALL), link("b", BALL), link("c", BALL), joint("j", "a", "b", "revolute", LIMITS),
             joint("k", "b", "c", "continuous"))
    (tmp_path / "urdf").mkdir()
    (tmp_path / "srdf").mkdir()
    (tmp_path / "srdf" / "r.srdf").write_text(pairs)
    robot = robot_of(*parts, name="urdf/whatever.urdf")
    assert robot.disabled_pairs == [("a", "c", "SRDF: Never")]
    assert robot.states == {"up": {"j": 0.5}} and "r.srdf: links that the robot does not have: x" in robot.notes
    assert robot_of(*parts, name="urdf/whatever.urdf", srdf=False).disabled_pairs[0][2] == "adjacent links"
    (tmp_path / "r.srdf").write_text(pairs.replace("Never", "Adjacent"))
    assert robot_of(*parts).disabled_pairs == [("a", "c", "SRDF: Adjacent")]
    with pytest.raises(SceneError, match=r"gone\.srdf: no such file"):
        robot_of(*parts, srdf="gone.srdf")
    scene = load(tmp_path / "r.urdf", state="up")
    assert scene.state == {"j": 0.5, "k": 0.0} and scene.notes[-1].endswith(
        "no value given for k: 0 taken, or the limit nearest to 0"
    )


def test_deep_mimic(robot_of):
    parts = [link("l0", BALL)]
    for k in range(5):
        follow = f'<mimic joint="j{k - 1}" multiplier="2" offset="0.125"/>' if k else ""
        parts += [link(f"l{k + 1}", BALL), joint(f"j{k}", f"l{k}", f"l{k + 1}", "prismatic", LIMITS + follow)]
    robot = robot_of(*parts)
    assert robot.joint_names == ("j0",)
    values = [0.25]
    for _ in range(4):
        values.append(2 * values[-1] + 0.125)
    assert robot.link_poses([0.25])[0, -1, 0, 3] == sum(values)


def test_a_broken_mimic_is_noted_and_the_robot_is_loaded(robot_of, tmp_path):
    """The finger of one of 69 robots of example-robot-data mimics a joint that is not there."""
    robot_of(link("a", BALL), link("b", BALL), link("c", BALL), joint("j", "a", "b", "prismatic", LIMITS),
             joint("k", "b", "c", "prismatic", LIMITS + '<mimic joint="gone"/>'))
    scene = load(tmp_path / "r.urdf", state={"k": 0.5})
    assert scene.body("c").X_WB[0, 3] == 0.5 and set(scene.state) == {"j", "k"}
    (note,) = [note for note in scene.notes if "mimic" in note]
    assert note.startswith('r.urdf: joint "k": it mimics joint "gone", which does not exist')


# --- meshes ---------------------------------------------------------------------------------------


def test_mesh_as_hull_mirrored_and_scaled(robot_of, tmp_path):
    pytest.importorskip("trimesh")
    (tmp_path / "t.obj").write_text(TETRAHEDRON)
    robot = robot_of(link("a", collision('<mesh filename="t.obj" scale="-1 1 0.5"/>')))
    shape = robot.geometry["a"][0].shape
    assert isinstance(shape, ConvexHull)
    assert sorted(shape.points.tolist()) == [[-1, 0, 0], [0, 0, 0], [0, 0, 1.5], [0, 2, 0]]
    assert robot.notes == ['r.urdf: link "a": the mesh scale "-1 1 0.5" mirrors; the mesh was mirrored']
    assert robot_of(link("a", collision('<mesh filename="t.obj" scale="2"/>'))).geometry["a"][0].shape.points.max() == 6


@pytest.mark.parametrize(
    ("filename", "place"),
    [
        ("package://arm/meshes/t.obj", "arm/meshes/t.obj"),
        ("package://elsewhere/meshes/t.obj", "meshes/t.obj"),
        ("model://arm/t.obj", "arm/t.obj"),
        ("../t.obj", "t.obj"),
        ("file://{root}/t.obj", "t.obj"),
        (r"..\t.obj", "t.obj"),
    ],
)
def test_where_meshes_are_found(robot_of, tmp_path, filename, place):
    pytest.importorskip("trimesh")
    (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / place).write_text(TETRAHEDRON)
    robot_of(link("a", collision(f'<mesh filename="{filename.format(root=tmp_path)}"/>')), name="deep/r.urdf")


def test_packages_from_the_environment_and_the_option(robot_of, tmp_path, monkeypatch):
    pytest.importorskip("trimesh")
    for place in ("ros/arm/t.obj", "prefix/share/arm/t.obj", "given/t.obj"):
        (tmp_path / "far" / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "far" / place).write_text(TETRAHEDRON)
    part = link("a", collision('<mesh filename="package://arm/t.obj"/>'))
    with pytest.raises(SceneError, match="package_path"):
        robot_of(part)
    with monkeypatch.context() as patch:
        patch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "far/ros"))
        robot_of(part)
    with monkeypatch.context() as patch:
        patch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "far/prefix"))
        robot_of(part)
    robot_of(part, package_path=[tmp_path / "far/given"])


def test_missing_mesh_names_everything_and_can_be_skipped(robot_of, tmp_path):
    part = link("a", BALL + collision('<mesh filename="package://arm/gone.stl"/>'))
    with pytest.raises(SceneError) as caught:
        robot_of(part)
    text = str(caught.value)
    for expected in (
        "r.urdf",
        'link "a" collision 1',
        "package://arm/gone.stl",
        str(tmp_path / "arm/gone.stl"),
        "--missing-meshes skip",
    ):
        assert expected in text
    robot = robot_of(part, missing_meshes="skip")
    assert len(robot.geometry["a"]) == 1
    assert robot.notes == [
        'r.urdf: link "a" collision 1 has no collision mesh package://arm/gone.stl: that link is NOT checked by it'
    ]


def test_remote_files_are_not_fetched(robot_of):
    with pytest.raises(SceneError, match="files are not fetched over https"):
        robot_of(link("a", collision('<mesh filename="https://example.org/a.stl"/>')))


def test_package_of_the_demo_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setattr(resources, "installed_folders", list)
    with pytest.raises(SceneError, match=r"pip install 'collide-robotics\[demo\]'"):
        resources.find("package://example-robot-data/robots/x.urdf", tmp_path / "scene.yaml")


def test_links_that_are_not_checked_are_named(robot_of):
    robot = robot_of(link("a", "<visual><geometry/></visual>"), link("b"), joint("j", "a", "b"))
    assert robot.notes == [
        "r.urdf: links with a visual but no collision geometry are NOT checked: a",
        "r.urdf: no link has collision geometry: nothing of this robot is checked",
    ]


@pytest.mark.parametrize(("size", "word"), [("300 1 1", "millimetres"), ("1e-6 1e-6 1e-6", "is its unit right")])
def test_suspicious_sizes_are_noted(robot_of, size, word):
    (note,) = robot_of(link("a", collision(f'<box size="{size}"/>'))).notes
    assert word in note and 'link "a"' in note


# --- bad input ------------------------------------------------------------------------------------


def test_undeclared_prefixes_are_tolerated_and_noted(robot_of):
    robot = robot_of(link("a", BALL), '<xacro:property name="x" value="1"/>')
    assert robot.links == ("a",)
    assert robot.notes[0] == "r.urdf: XML prefix not declared: xacro; what carries it was not read"


def test_declared_leftovers_and_default_namespace(robot_of):
    robot = robot_of(
        link("a", BALL), "<x:thing/>", root='<robot name="r" xmlns="http://example.org/urdf" xmlns:x="http://example.org/x">'
    )
    assert robot.links == ("a",) and "elements of another namespace were not read: thing" in robot.notes[0]


BAD = {
    "no name": (["<link/>"], "link 0: <link> needs a name"),
    "no link": ([""], "<robot>: has no <link>"),
    "xacro": (["<xacro:arm/>"], "expand it first"),
    "duplicate": ([link("a"), link("a")], r'link "a": the name is used twice \(links 0 and 1\)'),
    "two roots": ([link("a"), link("b")], r"2 links have no parent \(a, b\)"),
    "cycle": ([link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")], "the joints make a cycle"),
    "unknown link": ([link("a"), joint("j", "a", "z")], 'joint "j": its child is link "z"'),
    "unknown type": ([link("a"), link("b"), joint("j", "a", "b", "bendy")], 'joint "j": unknown type "bendy"'),
    "no child": (
        [link("a"), '<joint name="j" type="fixed"><parent link="a"/></joint>'],
        'joint "j": needs <child link',
    ),
    "zero axis": (
        [link("a"), link("b"), joint("j", "a", "b", "continuous", '<axis xyz="0 0 0"/>')],
        r'joint "j": axis \[0.0, 0.0, 0.0\]',
    ),
    "NaN": (
        [link("a", collision('<box size="1 nan 1"/>'))],
        'link "a": <box> size must be 3 finite numbers, got "1 nan 1"',
    ),
    "count": ([link("a", collision('<box size="1 1"/>'))], '<box> size must be 3 finite numbers, got "1 1"'),
    "text": (
        [link("a", collision('<sphere radius="${r}"/>'))],
        'must be one finite number, got "\\${r}"; expand the xacro first',
    ),
    "negative": ([link("a", collision('<sphere radius="-1"/>'))], 'link "a": Sphere: radius must be > 0'),
    "no attribute": ([link("a", collision('<cylinder radius="1"/>'))], "<cylinder> needs length="),
    "origin": (
        [link("a", collision('<sphere radius="1"/>', '<origin xyz="0 0"/>'))],
        'link "a": <origin> xyz must be 3 finite',
    ),
    "unknown shape": ([link("a", collision('<torus r="1"/>'))], "unknown shape <torus>; known are box"),
    "empty geometry": ([link("a", collision(""))], "needs <geometry> with one shape in it, found 0"),
    "two shapes": ([link("a", collision('<sphere radius="1"/><sphere radius="1"/>'))], "found 2"),
    "zero scale": (
        [link("a", collision('<mesh filename="t.obj" scale="1 0 1"/>'))],
        'scale must not be 0, got "1 0 1"',
    ),
    "no filename": ([link("a", collision("<mesh/>"))], "<mesh> needs a filename"),
    "broken": (["<link"], "is not well-formed XML"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_clear_error(robot_of, case):
    parts, message = BAD[case]
    with pytest.raises(CollideError, match=message) as caught:
        robot_of(*parts)
    assert "r.urdf" in str(caught.value)


def test_limits_that_are_missing_or_reversed_are_noted(robot_of):
    robot = robot_of(
        link("a", BALL), link("b", BALL), link("c", BALL), joint("j", "a", "b", "revolute"),
        joint("k", "b", "c", "revolute", '<limit lower="1" upper="-2"/>'),
    )
    assert robot.lower.tolist() == [-np.inf, -2] and robot.upper.tolist() == [np.inf, 1]
    assert 'joint "j" is revolute but has no <limit>' in robot.notes[0]
    assert 'read as [-2, 1]' in robot.notes[1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<sdf/>", "SDF"),
        ("<kml/>", "<kml> is no format known here"),
        ('<robot name="r"><disable_collisions link1="a" link2="b"/></robot>', "is an SRDF: give the URDF"),
        ("", "not well-formed XML"),
    ],
)
def test_other_xml(tmp_path, text, message):
    (tmp_path / "a.xml").write_text(text)
    with pytest.raises(SceneError, match=message):
        load(tmp_path / "a.xml")


def test_binary_is_not_a_robot(tmp_path):
    (tmp_path / "a.urdf").write_bytes(bytes(range(256)))
    with pytest.raises(SceneError, match=r"a\.urdf"):
        load(tmp_path / "a.urdf")


def test_demo_robots_load():
    names = ("panda_description/urdf/panda.urdf", "ur_description/urdf/ur5_robot.urdf")
    for name in names:
        try:
            file = resources.find(f"package://example-robot-data/robots/{name}", Path(__file__))
        except SceneError:
            pytest.skip("example-robot-data is not installed")
        pytest.importorskip("trimesh")
        robot = Robot.load(file)
        assert robot.geometry and robot.semantic_pairs is not None


# --- what Bullet reads besides ----------------------------------------------------------------------


def test_what_only_bullet_reads_is_read_with_a_note(robot_of):
    robot = robot_of(
        link("a", collision('<plane normal="0 1 0"/>')), link("b", collision('<cdf filename="b.cdf"/>') + BALL),
        link("c", BALL),
        joint("j", "a", "b", "revolute", '<origin xyz="0 0 1" rpy="0.1 0.2 0.3 0"/><limit lower="-1.5." upper="2."/>'),
        joint("k", "b", "c", "spherical", '<origin xyz="0 0 1"/>'),
    )
    assert robot.geometry["a"][0].shape == Halfspace((0, 1, 0), 0) and len(robot.geometry["b"]) == 1
    assert robot.joint_names == ("j", "k/yaw", "k/pitch", "k/roll") and robot.lower[0] == -1.5
    X_AB, X_BC = pose((0, 0, 1), rpy=(0.1, 0.2, 0.3)), pose((0, 0, 1), rpy=(0.3, 0.2, 0.1))
    at = dict(zip(robot.links, robot.link_poses([0, 0.1, 0.2, 0.3], np.eye(4))[0]))
    np.testing.assert_allclose(at["b"], X_AB, atol=1e-15)
    np.testing.assert_allclose(np.linalg.inv(at["b"]) @ at["c"], X_BC, atol=1e-15)
    notes = " ".join(robot.notes)
    for words in ("four numbers", "without the dot", "grid of distances", "spherical, as Bullet has it"):
        assert words in notes


def test_a_soft_body_is_refused_by_name(robot_of):
    with pytest.raises(SceneError, match="soft body"):
        robot_of('<deformable name="torus"/>')


def test_bullets_own_files_stand_where_bullet_has_them():
    bullet = pytest.importorskip("pybullet", reason="the package pybullet is not installed")
    data = pytest.importorskip("pybullet_data", reason="the package pybullet is not installed").getDataPath()
    client = bullet.connect(bullet.DIRECT)
    try:
        for name in ("quadruped/microtaur/microtaur", "biped/biped2d_pybullet", "racecar/racecar_differential"):
            name += ".urdf"
            body, robot = bullet.loadURDF(f"{data}/{name}", physicsClientId=client), Robot.load(f"{data}/{name}")
            at = dict(zip(robot.links, robot.link_poses(np.zeros(robot.dof), np.eye(4))[0]))
            theirs = {}
            for k in range(bullet.getNumJoints(body, physicsClientId=client)):
                state = bullet.getLinkState(body, k, computeForwardKinematics=1, physicsClientId=client)
                link_name = bullet.getJointInfo(body, k, physicsClientId=client)[12].decode()
                theirs[link_name] = pose(state[4], quat_xyzw=state[5])
            first = next(iter(theirs))
            X_WR = theirs[first] @ np.linalg.inv(at[first])
            assert len(theirs) > 5
            for link_name, X_WL in theirs.items():  # in single precision
                np.testing.assert_allclose(X_WR @ at[link_name], X_WL, atol=1e-6, err_msg=f"{name} {link_name}")
    finally:
        bullet.disconnect(client)
