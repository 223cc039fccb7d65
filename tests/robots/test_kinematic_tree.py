"""Joints checked one by one, the tree they make, and chains of joints that follow each other."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from collide.errors import SceneError
from collide.robots.kinematic_tree import (
    COLUMNS,
    Joint,
    Mimic,
    broken_mimics,
    broken_note,
    checked_joint,
    indices_of,
    resolve_mimics,
    rigid_clusters,
    tree_of,
)

LINKS = {"a": 0, "b": 1}


def joint(kind: str = "revolute", **changes) -> Joint:
    return Joint(**{"name": "j", "type": kind, "parent": "a", "child": "b", **changes})


def follower(name: str, followed: str | None = None, *numbers: float, kind: str = "revolute") -> Joint:
    return joint(kind, name=name, child=f"of {name}", mimic=Mimic(followed, *numbers) if followed else None)


# --- one joint ------------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", [(0.0, 1.0), (1.0, 0.0, 0.0, 0.0), ((0.0, 0.0, 1.0),), (0.0, math.nan, 1.0),
                                  (math.inf, 0.0, 0.0)])
@pytest.mark.parametrize("kind", ["revolute", "fixed"])
def test_an_axis_is_three_finite_numbers(axis, kind):
    with pytest.raises(SceneError, match='joint "j": axis must be 3 finite numbers, got'):
        checked_joint(joint(kind, axis=axis), LINKS)


@pytest.mark.parametrize(("kind", "is_refused"), [
    ("revolute", True), ("continuous", True), ("prismatic", True), ("planar", True), ("floating", False),
    ("fixed", False),
])
def test_an_axis_of_no_length_is_refused_where_it_is_used(kind, is_refused):
    for axis in ((0.0, 0.0, 0.0), (0.0, -1e-9, 0.0)):
        if is_refused:
            with pytest.raises(SceneError, match=r'joint "j": axis .* has length 0 and names no direction'):
                checked_joint(joint(kind, axis=axis), LINKS)
        else:
            assert checked_joint(joint(kind, axis=axis), LINKS).axis.tolist() == list(axis)


def test_an_axis_of_length_one_keeps_its_bits_and_others_have_length_one():
    unit = np.array([0.6, 0.0, 0.8])
    assert checked_joint(joint(axis=unit), LINKS).axis.tolist() == unit.tolist()
    for axis in ((0, 0, -2.0), (2e-9, 0, 0), (3e150, -4e150, 0), (1.0, 1.0, 1.0)):
        checked = checked_joint(joint(axis=axis), LINKS).axis
        size = max(map(abs, axis))
        expected = np.array(axis) / size / math.sqrt(sum((x / size) ** 2 for x in axis))
        assert np.abs(checked - expected).max() <= 3e-16, axis


@pytest.mark.parametrize("limits", [(math.nan, 1.0), (-1.0, math.nan), (math.nan, math.nan)])
def test_limits_that_are_no_numbers_are_told(limits):
    with pytest.raises(SceneError, match=r'joint "j": limits must be numbers, got \[') as raised:
        checked_joint(joint(lower=limits[0], upper=limits[1]), LINKS)
    assert f"[{limits[0]}, {limits[1]}]" in str(raised.value)


@pytest.mark.parametrize("role", ["parent", "child"])
def test_links_that_the_robot_does_not_have_are_named(role):
    with pytest.raises(SceneError, match=f'joint "j": its {role} is link "c", which the robot does not have'):
        checked_joint(joint(**{role: "c"}), LINKS)
    assert checked_joint(joint(), LINKS).child == "b"


def test_a_fixed_joint_follows_nothing():
    mimic = Mimic("k", 2.0, 0.5)
    assert checked_joint(joint("fixed", mimic=mimic), LINKS).mimic is None
    for kind in COLUMNS.keys() - {"fixed"}:
        assert checked_joint(joint(kind, mimic=mimic), LINKS).mimic == mimic


def test_names_used_twice_are_told_with_their_places():
    assert indices_of("link", ["b", "a"]) == {"b": 0, "a": 1} and indices_of("link", []) == {}
    with pytest.raises(SceneError, match=r'joint "b": the name is used twice \(joints 1 and 3\): rename one'):
        indices_of("joint", ["a", "b", "c", "b"])


# --- the tree -------------------------------------------------------------------------------------


def links_up(**parents: str) -> list[Joint]:
    """child=parent."""
    return [joint("fixed", name=f"to {child}", parent=parent, child=child) for child, parent in parents.items()]


def test_parents_come_before_children_and_siblings_keep_their_order():
    root, order = tree_of(["d", "c", "b", "a", "r"], links_up(d="b", c="a", b="r", a="r"))
    assert root == "r" and [each.child for each in order] == ["b", "a", "d", "c"]
    assert tree_of(["one"], []) == ("one", [])


def test_a_cycle_is_told_in_its_order_with_a_joint_of_it():
    """Below a cycle hangs another link, which is no part of it; a tree stands beside it."""
    joints = links_up(b="a", c="b", a="c", tail="c", leaf="root")
    with pytest.raises(SceneError) as raised:
        tree_of(["root", "leaf", "tail", "a", "b", "c"], joints)
    text = str(raised.value)
    told = text.split("cycle, ")[1].split(":")[0].split(" -> ")
    assert told[0] == told[-1] and sorted(told[:-1]) == ["a", "b", "c"] and "tail" not in " ".join(told)
    parent_of = {each.child: each.parent for each in joints}
    assert all(parent_of[child] == parent for parent, child in pairwise(told)), text


def test_a_long_cycle_is_told_by_its_ends():
    def told(n: int) -> str:
        with pytest.raises(SceneError) as raised:
            tree_of([f"l{k}" for k in range(n)], links_up(**{f"l{k}": f"l{(k + 1) % n}" for k in range(n)}))
        return str(raised.value)

    assert told(11).count(" -> ") == 11 and "..." not in told(11)  # twelve names, the first one twice
    assert told(12).count(" -> ") == 12 and " -> ... -> " in told(12)  # six, the dots, six


def test_a_link_of_two_parents_and_several_roots_are_refused():
    with pytest.raises(SceneError, match=r'joint "to c": link "c" has two parents: .* child of joint "to c"'):
        tree_of(["a", "b", "c"], [*links_up(c="a"), *links_up(c="b")])
    with pytest.raises(SceneError, match=r"3 links have no parent \(a, b, d\): a robot is one tree"):
        tree_of(["a", "b", "c", "d"], links_up(c="a"))
    with pytest.raises(SceneError, match="the robot has no links"):
        tree_of([], [])


def test_clusters_are_what_fixed_joints_weld():
    joints = [*links_up(b="a", d="c", e="d"), joint("revolute", parent="b", child="c", name="turn")]
    assert rigid_clusters(["e", "a", "b", "c", "d"], joints) == (("e", "c", "d"), ("a", "b"))
    assert rigid_clusters(["a", "b"], [joint("floating")]) == (("a",), ("b",))
    assert rigid_clusters(["a"], []) == (("a",),)


# --- joints that follow others --------------------------------------------------------------------


def test_a_chain_is_composed_from_its_end():
    """value(c) = −1 · value(b) + 0.25 and value(b) = 2 · value(a) + 0.5, whatever order the joints come in."""
    joints = [follower("c", "b", -1.0, 0.25), follower("b", "a", 2.0, 0.5), follower("a"), follower("free")]
    for listed in (joints, joints[::-1]):
        drivers = resolve_mimics(listed)
        assert drivers == {"a": ("a", 1.0, 0.0), "b": ("a", 2.0, 0.5), "c": ("a", -2.0, -0.25),
                           "free": ("free", 1.0, 0.0)}
        assert broken_mimics(listed) == {}
    assert resolve_mimics([joint("fixed"), joint("floating", name="k")]) == {}


@pytest.mark.parametrize("numbers", [(1e200, 0.0), (2.0, 1.7e308)])
def test_a_chain_that_leaves_the_doubles_is_refused(numbers):
    joints = [follower("a"), follower("b", "a", *numbers), follower("c", "b", *numbers)]
    with pytest.raises(SceneError, match=r'joint "c" mimic: along the chain to joint "a".*both must be finite'):
        resolve_mimics(joints)
    assert resolve_mimics(joints[:2])["b"] == ("a", *numbers)


@pytest.mark.parametrize("numbers", [(math.nan, 0.0), (1.0, math.inf), (math.inf, math.nan)])
def test_multiplier_and_offset_must_both_be_finite(numbers):
    with pytest.raises(SceneError, match=r'joint "b" mimic: multiplier .* and offset .* must be finite'):
        broken_mimics([follower("a"), follower("b", "a", *numbers)])


def test_circles_are_told_whole_and_what_hangs_on_them_is_not_broken():
    joints = [follower("x", "a"), follower("a", "b"), follower("b", "c"), follower("c", "a"), follower("self", "self"),
              follower("y", "x")]
    broken = broken_mimics(joints)
    assert broken.keys() == {"a", "b", "c", "self"}
    assert broken["self"] == "joints mimic each other in a circle, self -> self"
    assert broken["b"].endswith("a -> b -> c -> a")


def test_what_cannot_follow_or_be_followed_is_told():
    joints = [
        follower("weld", kind="fixed"), follower("plane", "a", kind="planar"), follower("a"),
        follower("of weld", "weld"), follower("of plane", "plane"), follower("of nothing", "nothing"),
    ]
    broken = broken_mimics(joints)
    assert broken["plane"] == "a planar joint has no single value that could follow another"
    for name in ("weld", "plane", "nothing"):
        expected = f'it mimics joint "{name}", which does not exist or has no single value'
        assert broken[f"of {name}"] == expected
    assert broken.keys() == {"plane", "of weld", "of plane", "of nothing"}
    assert broken_note("plane", broken["plane"]).startswith('joint "plane": a planar joint has no single value')
