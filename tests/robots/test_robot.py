"""Robot: the tree, forward kinematics against an independent computation, limits, pairs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from random_robots import DEMO

from collide.errors import InvalidArgument, InvalidPose, SceneError
from collide.robots.kinematic_tree import Joint, Mimic
from collide.robots.robot import LinkShape, Robot
from collide.shapes import Sphere
from collide.transforms import pose

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"


def arm(**changes) -> Robot:
    """base -turn(z)-> a -weld-> b -slide(x)-> c, and a finger that follows the slide of a finger."""
    joints = [
        Joint("turn", "revolute", "base", "a", pose((0, 0, 1)), (0, 0, 2.0), -2.0, 2.0),
        Joint("weld", "fixed", "a", "b", pose((0.5, 0, 0))),
        Joint("slide", "prismatic", "b", "c", pose((0, 0, 0.1)), (1, 0, 0), 0.1, 0.4),
        Joint("left", "prismatic", "c", "left", pose(), (0, 1, 0), -1.0, 1.0, Mimic("slide", 2.0, 0.5)),
        Joint("right", "prismatic", "c", "right", pose(), (0, 1, 0), -1.0, 1.0, Mimic("left", -1.0, 0.25)),
    ]
    joints = changes.pop("joints", joints)
    links = changes.pop("links", ["base", "a", "b", "c", "left", "right"])
    ball = [LinkShape(Sphere(0.01), np.eye(4), None, "test")]
    return Robot("arm", links, joints, changes.pop("geometry", {link: ball for link in links}), **changes)


def test_forward_kinematics_by_hand():
    robot = arm()
    assert robot.joint_names == ("turn", "slide") and robot.dof == 2
    X = robot.link_poses([math.pi / 2, 0.3])[0]
    place = {link: X[k] for k, link in enumerate(robot.links)}
    np.testing.assert_allclose(place["b"][:3, 3], (0, 0.5, 1), atol=1e-15)
    np.testing.assert_allclose(place["c"][:3, 3], (0, 0.8, 1.1), atol=1e-15)
    # left stands at 2·0.3 + 0.5 = 1.1 along y of c, which points to −x of the world
    np.testing.assert_allclose(place["left"][:3, 3], (-1.1, 0.8, 1.1), atol=1e-15)
    # right follows left: −1.1 + 0.25
    np.testing.assert_allclose(place["right"][:3, 3], (0.85, 0.8, 1.1), atol=1e-15)


def test_root_pose_moves_everything():
    robot, X_WR = arm(), pose((1, 2, 3), rpy=(0.1, 0.2, 0.3))
    moved, still = robot.link_poses([0.4, 0.2], X_WR)[0], robot.link_poses([0.4, 0.2])[0]
    np.testing.assert_allclose(moved, X_WR @ still, atol=1e-14)


def test_a_row_gives_the_same_bits_alone_and_in_a_batch():
    robot, rng = arm(), np.random.default_rng(3)
    Q = rng.uniform(-3, 3, (257, robot.dof))
    batch = robot.link_poses(Q)
    assert batch.shape == (257, 6, 4, 4)
    for k in (0, 1, 100, 256):
        assert np.array_equal(batch[k], robot.link_poses(Q[k])[0])


def test_turning_about_a_coordinate_axis_keeps_exact_zeros_and_ones():
    X = arm().link_poses([0.7, 0.2])[0, 1]
    assert X[2, 2] == 1.0 and (X[2, :2] == 0).all() and (X[:2, 2] == 0).all()


def test_planar_and_floating_joints_have_named_columns():
    joints = [
        Joint("drive", "planar", "base", "a", axis=(0, 0, 1)),
        Joint("fly", "floating", "a", "b"),
    ]
    robot = arm(joints=joints, links=["base", "a", "b"])
    assert robot.joint_names == (
        "drive/x", "drive/y", "drive/yaw", "fly/x", "fly/y", "fly/z", "fly/roll", "fly/pitch", "fly/yaw",
    )
    X = robot.link_poses([1.0, 2.0, 0.5, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6])[0]
    np.testing.assert_allclose(X[1], pose((1, 2, 0), rpy=(0, 0, 0.5)), atol=1e-15)
    np.testing.assert_allclose(X[2], X[1] @ pose((0.1, 0.2, 0.3), rpy=(0.4, 0.5, 0.6)), atol=1e-15)


def test_all_joints_fixed():
    robot = arm(joints=[Joint("weld", "fixed", "base", "a", pose((0, 0, 1)))], links=["base", "a"])
    assert robot.dof == 0 and robot.link_poses([])[0, 1, 2, 3] == 1.0
    assert robot.disabled_pairs == [("base", "a", "rigidly joined")]


# --- pairs ----------------------------------------------------------------------------------------


def test_pairs_without_semantics_are_clusters_and_their_neighbours():
    robot = arm()
    assert robot.rigid_clusters == (("base",), ("a", "b"), ("c",), ("left",), ("right",))
    assert robot.base_links == ("base",)
    assert robot.disabled_pairs == [
        ("base", "a", "adjacent links"), ("base", "b", "adjacent links"), ("a", "b", "rigidly joined"),
        ("a", "c", "adjacent links"), ("b", "c", "adjacent links"), ("c", "left", "adjacent links"),
        ("c", "right", "adjacent links"),
    ]


def test_semantics_replace_neighbours_but_not_welds():
    robot = arm(semantic_pairs=[("right", "left", "SRDF: Never"), ("base", "nowhere", "SRDF: Never")])
    assert robot.disabled_pairs == [("a", "b", "rigidly joined"), ("left", "right", "SRDF: Never")]


def test_renamed_keeps_the_kinematics():
    robot = arm(states={"up": {"turn": 0.5}})
    other = robot.renamed("left_")
    assert other.joint_names == ("left_turn", "left_slide") and other.states == {"up": {"left_turn": 0.5}}
    assert np.array_equal(other.link_poses([0.5, 0.2]), robot.link_poses([0.5, 0.2]))
    assert [(a, b) for a, b, _ in other.disabled_pairs] == [
        ("left_" + a, "left_" + b) for a, b, _ in robot.disabled_pairs
    ]


# --- configurations -------------------------------------------------------------------------------


def test_missing_values_stand_at_zero_or_the_nearest_limit():
    robot = arm()
    q, notes = robot.configuration({})
    assert q.tolist() == [0.0, 0.1] and notes == []
    assert robot.default_notes((), q) == [
        "robot arm: no value given for turn, slide = 0.1: 0 taken, or the limit nearest to 0"
    ]
    assert robot.default_notes(("turn", "slide"), q) == []


def test_values_outside_limits_are_used_and_noted():
    q, notes = arm().configuration({"turn": 2.5, "slide": 0.3})
    assert q.tolist() == [2.5, 0.3]
    assert notes[0] == "robot arm: joint turn at 2.5 rad is outside its limits [-2, 2]"
    # 2·0.3 + 0.5 is beyond the limit of the joint that follows
    assert notes[1] == "robot arm: joint left at 1.1 m is outside its limits [-1, 1]"


def test_values_of_joints_that_cannot_take_one_are_noted():
    _, notes = arm().configuration({"slide": 0.2, "left": 0.0, "weld": 0.3, "right": -0.65})
    assert "joint weld is fixed; its value 0.3 was not used" in notes[0]
    assert "joint left follows slide and stands at 0.9; the value 0 was not used" in notes[1]
    assert len(notes) == 2


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"trun": 0.1}, r"unknown joint 'trun'; it has turn, slide"),
        ({"turn": math.nan}, "joint turn: the value must be a finite number, got nan"),
        ({"turn": "far"}, "joint turn: the value must be a number, got 'far'"),
        ({"turn": True}, "joint turn"),
    ],
)
def test_refused_values(values, message):
    with pytest.raises(InvalidArgument, match=message):
        arm().configuration(values)


@pytest.mark.parametrize(
    ("q", "message"),
    [
        ([1.0], r"one column for each of turn, slide; got \(1,\)"),
        ([math.nan, 0], r"q\[0\], joint turn, is nan"),
        ("up", "must be real numbers"),
    ],
)
def test_refused_configurations(q, message):
    with pytest.raises(InvalidArgument, match=message):
        arm().link_poses(q)


# --- trees that are none --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("links", "joints", "message"),
    [
        (["a", "b", "a"], [], r'link "a": the name is used twice \(links 0 and 2\)'),
        (["a", "b"], [], r"2 links have no parent \(a, b\)"),
        (["a"], [Joint("j", "fixed", "a", "z")], 'joint "j": its child is link "z", which the robot does not have'),
        (["a", "b"], [Joint("j", "glide", "a", "b")], 'joint "j": unknown type "glide"; known are revolute'),
        (
            ["a", "b", "c"],
            [Joint("j", "fixed", "a", "c"), Joint("k", "fixed", "b", "c")],
            'joint "k": link "c" has two parents',
        ),
        (
            ["r", "a", "b"],
            [Joint("j", "fixed", "a", "b"), Joint("k", "fixed", "b", "a")],
            "the joints make a cycle, .*a.*b",
        ),
        (["a"], [Joint("j", "fixed", "a", "a")], "cycle, a -> a"),
        (
            ["a", "b"],
            [Joint("j", "revolute", "a", "b", axis=(0, 0, 0))],
            r'joint "j": axis \[0.0, 0.0, 0.0\] has length 0',
        ),
        (["a", "b"], [Joint("j", "revolute", "a", "b", mimic=Mimic("j", np.inf))], 'joint "j" mimic: multiplier inf'),
        (
            ["a", "b", "c", "d"],
            [
                Joint("j", "revolute", "a", "b"),
                Joint("k", "revolute", "b", "c", mimic=Mimic("j", 1e200)),
                Joint("l", "revolute", "c", "d", mimic=Mimic("k", 1e200)),
            ],
            'joint "l" mimic: along the chain to joint "j" its multiplier becomes inf',
        ),
        ([], [], "no links"),
    ],
)
def test_refused_trees(links, joints, message):
    with pytest.raises(SceneError, match=message):
        Robot("r", links, joints)


def chain(*mimics: Mimic | None, kind: str = "revolute", **options) -> Robot:
    """A chain of joints j0, j1, ... about z, each 1 m above the last."""
    up = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]])
    joints = [
        Joint(f"j{k}", kind, f"l{k}", f"l{k + 1}", up, np.array([1.0, 0, 0]), -2.0, 2.0, mimic)
        for k, mimic in enumerate(mimics)
    ]
    return Robot("arm", [f"l{k}" for k in range(len(mimics) + 1)], joints, **options)


@pytest.mark.parametrize(
    ("mimics", "free", "why"),
    [
        ((None, Mimic("gone", 2.0)), ("j0", "j1"), {"j1": 'it mimics joint "gone", which does not exist'}),
        ((Mimic("j0"), None), ("j0", "j1"), {"j0": "joints mimic each other in a circle, j0 -> j0"}),
        (
            (Mimic("j1"), Mimic("j2"), Mimic("j0"), Mimic("j2", -1.0, 0.5)),
            ("j0", "j1", "j2"),
            dict.fromkeys(("j0", "j1", "j2"), "in a circle"),
        ),
    ],
)
def test_a_broken_mimic_joint_is_a_joint_of_its_own_and_noted(mimics, free, why):
    robot = chain(*mimics, sources=["/models/arm.urdf"], notes=["first"])
    assert robot.joint_names == free and robot.notes[0] == "first" and len(robot.notes) == 1 + len(why)
    for note in robot.notes[1:]:
        joint = note.split('"')[1]
        assert (
            note.startswith(f'arm.urdf: joint "{joint}": ') and why.pop(joint) in note and "a joint of its own" in note
        )
    q, notes = robot.configuration({name: 0.25 for name in free})
    assert notes == [] and robot.joint_value(free[-1], q) == 0.25
    if len(mimics) == 4:
        assert robot.joint_value("j3", q) == 0.25  # what follows a joint of the circle follows it still
    assert robot.renamed("left_").notes == robot.notes


def test_a_planar_joint_cannot_follow():
    robot = chain(None, Mimic("j0"), kind="planar")
    assert robot.dof == 6 and "a planar joint has no single value" in robot.notes[0]


def test_links_that_leave_the_range_of_poses_are_named():
    """By a mimic's multiplier, by values, by origins: an error with file, link and joint, and no warning of numpy's."""
    robot = chain(None, Mimic("j0", 1e308), kind="revolute", sources=["a.urdf"])
    with pytest.raises(
        InvalidPose,
        match=r'^a\.urdf: robot arm: link "l2" stands at .*joint "j1", which follows j0, and at its value = inf',
    ):
        robot.link_poses([[0.0], [100.0]])
    robot = chain(None, None, kind="prismatic")
    with pytest.raises(
        InvalidPose,
        match=r'robot arm: link "l1" stands at \[1e\+60, 0\.0, 1\.0\].*joint "j0" and at its value = 1e\+60',
    ):
        robot.link_poses([1e60, 1.0])
    far = np.eye(4)
    far[0, 3] = 7e49
    joints = [Joint("j", "fixed", "a", "b", far), Joint("k", "fixed", "b", "c", far)]
    with pytest.raises(InvalidPose, match='link "c" stands at'):
        Robot("r", ["a", "b", "c"], joints).link_poses([])
    for kind, values in (("floating", [1e308] * 6), ("planar", [1e308] * 3)):
        with pytest.raises(InvalidPose, match='link "l1"'):
            chain(None, kind=kind).link_poses(values)


def test_an_axis_of_any_length_is_a_direction():
    for length in (1e-8, 1.0, 1e200, 1.7e308):
        robot = Robot("r", ["a", "b"], [Joint("j", "prismatic", "a", "b", axis=np.array([0.0, length, 0.0]))])
        assert robot.joints[0].axis.tolist() == [0, 1, 0]


class Counted(str):
    """A name that counts how often names are compared: lists compare one by one, dictionaries hardly ever."""

    comparisons = 0

    def __eq__(self, other):
        Counted.comparisons += 1
        return str.__eq__(self, other)

    __hash__ = str.__hash__


@pytest.mark.parametrize("order", ["root first", "root last", "star"])
@pytest.mark.parametrize("mimic", [False, True])
def test_trees_are_read_in_one_pass(order, mimic):
    def comparisons(n: int) -> int:
        links = [Counted(f"l{k}") for k in range(n + 1)]
        joints = [
            Joint(
                Counted(f"j{k}"), "revolute", Counted("l0" if order == "star" else f"l{k}"), Counted(f"l{k + 1}"),
                mimic=Mimic(Counted(f"j{k - 1}")) if mimic and k else None,
            )
            for k in range(n)
        ]
        Counted.comparisons = 0
        Robot("r", links[:: -1 if order == "root last" else 1], joints[:: -1 if order == "root last" else 1])
        return Counted.comparisons

    few, many = comparisons(100), comparisons(200)
    assert 200 < few and many < 2.2 * few, (few, many)



def test_geometry_of_an_unknown_link():
    with pytest.raises(SceneError, match='link "x": unknown link; the robot has a'):
        Robot("r", ["a"], [], {"x": [LinkShape(Sphere(1), np.eye(4), None, "")]})


def test_long_chains_need_no_recursion():
    n = 3000
    links = [f"l{k}" for k in range(n)]
    joints = [Joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", pose((0, 0, 1)), (0, 1, 0)) for k in range(n - 1)]
    robot = Robot("chain", links, joints)
    assert robot.link_poses(np.zeros(n - 1))[0, -1, 2, 3] == n - 1


# --- against another implementation ---------------------------------------------------------------


def urdf_files() -> list[Path]:
    files = sorted((SHARED / "robots").glob("*/*.urdf")) if SHARED.is_dir() else []
    names = (
        "panda_description",
        "ur_description",
        "talos_data",
        "tiago_description",
        "pr2_description",
        "allegro_hand_description",
    )
    for name in names if DEMO else ():
        files += sorted((DEMO / name).rglob("*.urdf"))[:2]
    return files


@pytest.mark.parametrize("file", urdf_files(), ids=lambda file: file.name)
def test_forward_kinematics_against_yourdfpy(file):
    yourdfpy = pytest.importorskip("yourdfpy")
    pytest.importorskip("trimesh")
    robot = Robot.load(file, missing_meshes="skip")
    other = yourdfpy.URDF.load(str(file), load_meshes=False)
    rng = np.random.default_rng(11)
    q = rng.uniform(-1, 1, robot.dof)
    other.update_cfg(q[[robot.joint_names.index(name) for name in other.actuated_joint_names]])
    X = robot.link_poses(q)[0]
    for k, link in enumerate(robot.links):
        np.testing.assert_allclose(X[k], other.get_transform(link, robot.root), atol=1e-12)
