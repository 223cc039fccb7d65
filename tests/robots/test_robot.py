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


def test_pairs_are_of_two_links_with_geometry_in_their_order():
    ball = [LinkShape(Sphere(0.01), np.eye(4), None, "test")]
    pairs = [("c", "base", "SRDF"), ("a", "a", "self"), ("base", "c", "again"), ("a", "b", "SRDF"), ("b", "c", "SRDF")]
    robot = arm(geometry={link: ball for link in ("base", "b", "c")}, semantic_pairs=pairs)
    assert robot.disabled_pairs == [("base", "c", "SRDF"), ("b", "c", "SRDF")] and robot.rigid_pairs == []
    assert arm(semantic_pairs=[]).disabled_pairs == [("a", "b", "rigidly joined")]


def test_which_joints_move_which_links():
    """Also the joint that is fixed, which counts as the others in the order of the table."""
    robot = arm()
    names = [joint.name for joint in robot.sorted_joints]
    moved = {name: {link for k, link in enumerate(robot.links) if robot.moves[j, k]} for j, name in enumerate(names)}
    assert moved == {
        "turn": {"a", "b", "c", "left", "right"}, "weld": {"b", "c", "left", "right"}, "slide": {"c", "left", "right"},
        "left": {"left"}, "right": {"right"},
    }


@pytest.mark.parametrize(("argument", "value", "words"), [
    ("semantic_pairs", [("a", "b")], r"semantic_pairs must be \(link, link, reason\), three texts each"),
    ("semantic_pairs", [("a", "b", 3)], "semantic_pairs must be"),
    ("semantic_pairs", 3, "semantic_pairs"),
    ("geometry", {"a": [Sphere(1.0)]}, r"geometry\['a'\]"),
    ("geometry", 3, "geometry"),
    ("states", {"up": 3}, r"states\['up'\]"),
    ("notes", [3], "notes"),
    ("joints", ["turn"], "joints"),
])
def test_arguments_of_another_kind_are_named(argument, value, words):
    with pytest.raises(SceneError, match=words):
        arm(**{argument: value})


def test_links_without_elements_have_no_geometry():
    assert arm(geometry={"a": [], "b": ()}).geometry == {} and arm(geometry=None).geometry == {}


def test_a_prefix_is_put_before_all_names_and_none_gives_the_robot_itself():
    robot = arm(semantic_pairs=[("left", "right", "SRDF")], notes=["note"], sources=["arm.urdf"])
    assert robot.renamed("") is robot and robot.prefix == ""
    twice = robot.renamed("a_").renamed("b_")
    assert twice.prefix == "b_a_" and twice.root == "b_a_base" and twice.sources == robot.sources
    assert twice.semantic_pairs == (("b_a_left", "b_a_right", "SRDF"),) and arm().renamed("c").semantic_pairs is None
    assert {joint.name: joint.mimic and joint.mimic.joint for joint in twice.joints}["b_a_right"] == "b_a_left"


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


def limited(lower: float, upper: float, kind: str = "prismatic", **mimic) -> Robot:
    joints = [Joint("j0", "continuous" if mimic else kind, "a", "b", pose(), (1, 0, 0), lower, upper)]
    if mimic:
        joints.append(Joint("j1", kind, "b", "c", pose(), (1, 0, 0), lower, upper, Mimic("j0", **mimic)))
    return Robot("limited", ["a", "b", "c"][: len(joints) + 1], joints)


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_billionth_beyond_a_limit_is_within_it(kind):
    """Exactly a billionth, of 1 or of the value where that is larger; notes and batches say the same."""
    for limit, beyond in ((0.0, 1e-9), (-1024.0, 1024e-9), (1024.0, 1024e-9), (0.5, 1e-9)):
        for side in (-1.0, 1.0):
            robot = limited(limit, np.inf, kind) if side < 0 else limited(-np.inf, limit, kind)
            q = np.array([[limit], [limit + 0.999 * side * beyond], [limit + 1.01 * side * beyond]])
            assert robot.within_limits(q).tolist() == [True, True, False], (limit, side)
            assert [len(robot.limit_notes(row)) for row in q] == [0, 0, 1], (limit, side)
    for robot, value in ((limited(0.0, 1.0, kind), -1e-9), (limited(-1.0, 0.0, kind), 1e-9)):
        assert robot.within_limits([value]).all() and robot.limit_notes(np.array([value])) == []


def test_limits_of_joints_that_follow_count_and_those_of_others_do_not():
    robot = limited(0.0, 1.0, multiplier=-2.0, offset=0.5)
    q = np.array([[0.25], [-0.25], [0.26], [-0.26]])
    assert robot.within_limits(q).tolist() == [True, True, False, False]
    assert robot.limit_notes(np.array([-0.26])) == ["robot limited: joint j1 at 1.02 m is outside its limits [0, 1]"]
    assert robot.lower.tolist() == [-np.inf] and robot.upper.tolist() == [np.inf]
    assert limited(0.0, 1.0, "continuous").within_limits([[5.0]]).all()
    assert limited(0.0, 1.0).within_limits(np.zeros((0, 1))).shape == (0,)


def test_a_value_of_a_joint_that_follows_may_be_a_millionth_off():
    robot = limited(-10.0, 10.0, multiplier=1.0, offset=0.0)
    for value, n in ((0.0, 0), (1e-6, 0), (-1e-6, 0), (1.001e-6, 1), (-1.001e-6, 1)):
        assert len(robot.configuration({"j0": 0.0, "j1": value})[1]) == n, value


def test_values_may_start_from_a_configuration_that_stays_as_it_is():
    robot, start = arm(), np.array([0.5, 0.25])
    q, _ = robot.configuration({"slide": 0.375}, start)
    assert q.tolist() == [0.5, 0.375] and start.tolist() == [0.5, 0.25]
    with pytest.raises(InvalidArgument, match=r"start must have shape \(2,\), a value for each of turn, slide"):
        robot.configuration({}, np.zeros(3))


def test_the_value_of_one_joint():
    robot = arm()
    assert robot.joint_value("right", np.array([9.0, 0.125])) == -0.5  # 0.25 − (2 · 0.125 + 0.5)
    with pytest.raises(InvalidArgument, match=r"no joint 'weld' moves .* there are slide, turn|turn, slide"):
        robot.joint_value("weld", np.zeros(2))
    bare = Robot("bare", ["a", "b"], [Joint("fly", "floating", "a", "b")])
    with pytest.raises(InvalidArgument, match=r"no joint of the name 'fly' moves .*; there are none$"):
        bare.joint_value("fly", np.zeros(6))
    with pytest.raises(InvalidArgument, match="unknown joint 'fly'; it has fly/x, fly/y"):
        bare.configuration({"fly": 1.0})
    with pytest.raises(InvalidArgument, match="unknown joint 'j'; it has no joints"):
        Robot("stone", ["a"], []).configuration({"j": 1.0})


def test_a_default_that_is_not_zero_is_told():
    robot = limited(0.25, 1.0)
    assert robot.default_configuration().tolist() == [0.25] and limited(-1.0, -0.5).default_configuration() == [-0.5]
    assert robot.default_notes([], robot.default_configuration()) == [
        "robot limited: no value given for j0 = 0.25: 0 taken, or the limit nearest to 0"
    ]
    assert robot.default_notes({"j0"}, robot.default_configuration()) == []


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"trun": 0.1}, r"unknown joint 'trun'; it has turn, slide"),
        ({"turn": math.nan}, "joint turn: the value must be a finite number, got nan"),
        ({"turn": "far"}, "joint turn: the value must be a number, got 'far'"),
        ({"turn": True}, "joint turn: the value must be a finite number, got True"),
        ({"turn": math.inf}, "joint turn: the value must be a finite number, got inf"),
        ({"turn": 10**400}, "joint turn: the value must be a number"),
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
        ([[math.inf, 0]], r"q\[0\], joint turn, is inf"),
        ([[0, 0], [0, -math.inf]], r"q\[1\], joint slide, is -inf"),
        (np.zeros((2, 1)), r"one column for each of turn, slide; got \(2, 1\)"),
        (np.zeros((1, 2, 2)), r"must have shape \(2,\) or \(N, 2\).*got \(1, 2, 2\)"),
        (0.0, r"got \(\)"),
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


@pytest.mark.many(2)
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
