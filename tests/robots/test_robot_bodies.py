"""What moves with a robot's links, which pairs of it are tested, and what is said of arguments that are none."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose
from random_robots import slider

import collide
from collide.errors import InvalidArgument, InvalidPose
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot
from collide.robots.robot_bodies import PairRules, bodies_around, paths_to_root, refuse_own_margins, robot_bodies

BALL = collide.Sphere(0.1)
ELEMENT = [LinkShape(BALL, np.eye(4), None, "test")]


def test_bodies_go_from_the_last_link_to_the_root_and_objects_come_behind():
    robot = slider(base=ELEMENT)
    bodies, objects = robot_bodies(robot, [("tool", "cart", BALL), ("cap", "base", BALL, pose(t=(1, 2, 3)), "x")], 0.25)
    assert [(body.name, body.link, body.padding) for body in bodies] == [
        ("cart", 1, 0.25), ("base", 0, 0.25), ("tool", 1, 0.25), ("cap", 0, 0.25),
    ]
    assert objects["tool"].touch == () and objects["cap"].touch == ("x",)
    assert np.array_equal(objects["tool"].X_LS, np.eye(4)) and objects["cap"].X_LS[:3, 3].tolist() == [1, 2, 3]


def test_a_pose_that_the_caller_changes_later_is_not_changed():
    X_LS = pose(t=(1.0, 0, 0))
    _, objects = robot_bodies(slider(), [("tool", "cart", BALL, X_LS)], 0.0)
    X_LS[0, 3] = 5.0
    assert objects["tool"].X_LS[0, 3] == 1.0


def test_links_without_geometry_have_no_body_and_an_object_alone_is_enough():
    bare = Robot("bare", ["base"], [])
    assert [body.name for body in robot_bodies(bare, [("tool", "base", BALL)], 0.0)[0]] == ["tool"]
    with pytest.raises(InvalidArgument, match="robot bare has no collision geometry, so nothing can be tested"):
        robot_bodies(bare, [], 0.0)


@pytest.mark.parametrize("padding", [1e6, np.inf, np.nan, -1e-300, "wide", None, True + 1j])
def test_a_padding_is_a_length(padding):
    with pytest.raises(InvalidArgument, match=r"^padding must be a length \[m\], 0 or more, got "):
        robot_bodies(slider(), [], padding)
    with pytest.raises(InvalidArgument, match=r'^padding of "cart" must be a length \[m\], 0 or more, got '):
        robot_bodies(slider(), [], {"cart": padding})


def test_paddings_that_are_lengths_and_those_by_name():
    largest = float(np.nextafter(1e6, 0.0))
    assert robot_bodies(slider(), [], largest)[0][0].padding == largest
    assert robot_bodies(slider(), [], 0)[0][0].padding == 0.0
    bodies, _ = robot_bodies(slider(base=ELEMENT), [("tool", "cart", BALL)], {"tool": 0.5, "base": 0.125})
    assert {body.name: body.padding for body in bodies} == {"tool": 0.5, "cart": 0.0, "base": 0.125}
    with pytest.raises(InvalidArgument, match="padding: no link or attached object is called 'hand'"):
        robot_bodies(slider(), [], {"cart": 0.1, "hand": 0.1})


@pytest.mark.parametrize(("attached", "error", "words"), [
    ([("tool", "cart")], InvalidArgument, r"attached must be objects \(name, link, shape, X_LS, touch\)"),
    ([("tool", "cart", BALL, None, (), 1)], InvalidArgument, "attached must be objects"),
    ([("", "cart", BALL)], InvalidArgument, "attached: a name must be a non-empty string, got ''"),
    ([(7, "cart", BALL)], InvalidArgument, "attached: a name must be a non-empty string, got 7"),
    ([("tool", "hand", BALL)], InvalidArgument, "\"tool\": slider has no link 'hand'; it has base, cart"),
    ([("tool", "cart", "ball")], InvalidArgument, "\"tool\": not a shape but 'ball'"),
    ([("tool", "cart", BALL, np.eye(3))], InvalidPose, 'attached "tool": X_LS'),
    ([("tool", "cart", BALL)] * 2, InvalidArgument, 'the name "tool" is used twice'),
    ([("base", "cart", BALL)], InvalidArgument, 'the name "base" is used twice'),
])
def test_objects_that_are_none_are_told(attached, error, words):
    with pytest.raises(error, match=words):
        robot_bodies(slider(), attached, 0.0)


def test_what_is_around_is_what_is_not_named_like_a_link_with_geometry():
    world = collide.World()
    for name in ("base", "cart", "wall"):
        world.add(BALL, pose(t=(len(name), 0, 0)), name=name, margin=0.25 if name == "wall" else 0.0)
    around = bodies_around(world, slider())
    assert [(body.name, body.X_WB[0, 3], body.margin) for body in around] == [("base", 4.0, 0.0), ("wall", 4.0, 0.25)]


def test_margins_of_links_are_told_with_their_partner():
    def told(world) -> str:
        with pytest.raises(InvalidArgument) as raised:
            refuse_own_margins(world._pack(), slider(base=ELEMENT))
        return str(raised.value)

    for names in (("wall", "cart"), ("cart", "wall")):
        world = collide.World()
        for name in names:
            world.add(BALL, name=name)
        refuse_own_margins(world._pack(), slider())
        world.set_margin("wall", 0.5)
        refuse_own_margins(world._pack(), slider())  # of a body around
        world.set_margin("cart", 0.5, partner="wall")
        assert 'the World has a margin of "cart" and "wall", a link of the robot' in told(world)
        world.set_margin("cart", None, partner="wall")
        world.set_margin("cart", 0.5)
        assert 'the World has a margin of "cart", a link of the robot' in told(world)


def filters(robot=None, world=None, attached=(), allowed=(), mobile=False):
    robot = robot or slider(base=ELEMENT)
    world = world or collide.World()
    bodies, objects = robot_bodies(robot, attached, 0.0)
    links, items = bodies[: len(bodies) - len(objects)], list(objects.values())
    rules = PairRules(robot, links, objects, world, bodies_around(world, robot), allowed, mobile)
    made = rules.of_links()
    for k, body in enumerate(bodies[len(links) :]):
        made = rules.with_object(made, items[:k], items[k], body.link)
    return made


def test_objects_may_touch_their_link_and_what_they_are_told_to():
    world = collide.World()
    for name in ("table", "shelf"):
        world.add(BALL, name=name)
    tool = ("tool", "cart", BALL, None, ("table", "base"))
    made = filters(world=world, attached=[tool])
    # bodies: cart, base, tool.   Of tool and cart it is the same link; base is next to cart in the tree.
    assert made.self_pairs.shape == (0, 2) and made.self_pairs.dtype == np.int64
    assert made.allowed.tolist() == [[0, 0], [0, 0], [1, 0]]
    assert made.reasons == {
        "moves with the same link": 1, "attached object may touch": 2, "adjacent links": 1,
    }
    assert filters(world=world, attached=[tool[:3]]).self_pairs.tolist() == [[1, 2]]


def test_two_objects_of_one_link_are_never_tested():
    tools = [("left", "cart", BALL), ("right", "cart", BALL), ("stand", "base", BALL)]
    made = filters(slider(), attached=tools)
    # bodies: cart, left, right, stand
    assert made.self_pairs.tolist() == [[0, 3], [1, 3], [2, 3]] and made.reasons == {"moves with the same link": 3}
    assert made.starts == (0, 0, 0) and len(made.of_first(2).self_pairs) == 0 and made.of_first(3) is made


def test_static_and_sleeping_bodies_rest_with_the_base_alone():
    world = collide.World()
    for name, static in (("floor", True), ("crate", False), ("cat", False)):
        world.add(BALL, name=name, static=static)
    world.sleep(["crate"])
    made = filters(world=world)  # bodies: cart, base
    assert made.allowed.tolist() == [[0, 0, 0], [1, 1, 0]]
    assert filters(world=world, mobile=True).allowed.tolist() == [[0, 0, 0], [0, 0, 0]]
    # A reason that is given is told before the one that the body sleeps, and after the one that it is static.
    reasons = filters(world=world, allowed=[("base", "crate", "stays"), ("base", "floor", "lies")]).reasons
    assert reasons == {"static–static": 1, "stays": 1, "adjacent links": 1}


@pytest.mark.parametrize(("groups", "is_tested"), [((1, 1, 1, 1), True), ((2, 1, 1, 2), True), ((2, 1, 1, 1), False),
                                                   ((1, 1, 1, 2), False), ((2, 3, 1, 1), False)])
def test_both_masks_must_hold_the_other_group(groups, is_tested):
    world = collide.World()
    world.add(BALL, name="cart", group=groups[0], mask=groups[1])
    world.add(BALL, name="wall", group=groups[2], mask=groups[3])
    made = filters(slider(), world)
    assert made.allowed.tolist() == [[int(not is_tested)]]
    assert made.reasons == ({} if is_tested else {"filtered by group and mask": 1})


def test_an_object_named_like_a_body_of_the_world_is_not_that_body():
    world = collide.World()
    world.add(BALL, name="tool", group=2, mask=0)
    world.add(BALL, name="wall")
    made = filters(slider(), world, [("tool", "cart", BALL)])
    assert made.allowed[1, 1] == 0  # the attached object is of group 1, with all


def test_pairs_that_the_caller_allows():
    world = collide.World()
    world.add(BALL, name="wall")
    for pair in (("cart", "wall"), ["wall", "cart"], ("cart", "wall", "reason of mine")):
        made = filters(slider(), world, allowed=[pair])
        assert made.allowed.tolist() == [[1]] and made.reasons == {pair[2] if len(pair) == 3 else "allowed": 1}
    assert filters(slider(), world, allowed=[("base", "wall")]).allowed.tolist() == [[0]]  # a link without geometry
    for wrong in ("ab", ("cart",), ("cart", "wall", "why", "so"), 3):
        with pytest.raises(InvalidArgument, match="allowed must be pairs of names, got"):
            filters(slider(), world, allowed=[wrong])
    for wrong in (("cart", "hand"), ("hand", "cart")):
        with pytest.raises(InvalidArgument, match="allowed: no link, attached object or body is called 'hand'"):
            filters(slider(), world, allowed=[wrong])


def test_paths_name_the_joints_that_move_from_the_link_to_the_root():
    joints = [
        Joint("turn", "revolute", "base", "a"), Joint("weld", "fixed", "a", "b"), Joint("fly", "floating", "b", "c"),
        Joint("slide", "prismatic", "base", "d"),
    ]
    robot = Robot("tree", ["c", "b", "base", "a", "d"], joints)
    assert paths_to_root(robot, [0, 1, 2, 3, 4]) == [["fly", "turn"], ["turn"], [], ["turn"], ["slide"]]
    assert paths_to_root(robot, []) == []
