"""Digests: equal for equal content, on any process; different for any number, name or order that differs."""

from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest
from plain_robots import arm_checker, chain, joint, robot_of

import collide
from collide import Box, Compound, Sphere, World, pose
from collide.sweeps.content_digest import digest
from collide.sweeps.sweep_question import question_digest

MESH = collide.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def world(*, x=0.0, name="b", radius=1.0, allow=False, static=False, group=1, margin=0.0, asleep=False):
    made = World()
    made.add(Box((1, 1, 1)), name="a")
    made.add(Sphere(radius), pose((x, 0, 0)), name=name, static=static, group=group, margin=margin)
    if allow:
        made.allow("a", name)
    if asleep:
        made.sleep([name])
    return made


VALUES = [
    1, 1.0, True, "1", b"1", None, (1, 2), (1, (2,)), ((1,), 2), {"a": 1}, {"a": 2}, {"b": 1}, 0.0, -0.0, float("nan"),
    np.zeros(2), np.zeros((2, 1)), np.zeros((1, 2)), np.zeros(2, np.float32), np.zeros(0), np.ones(2), "", (), {},
    Box((1, 1, 1)), Box((1, 1, 2)), Sphere(1), MESH, MESH.scaled(2.0), Compound([(Sphere(1), np.eye(4))]),
    Compound([(Sphere(1), pose((0, 0, 1)))]), collide.ConvexHull(np.eye(3)), collide.ConvexHull(np.eye(3), radius=0.1),
    world(), world(x=1e-300), world(name="c"), world(radius=1.5), world(allow=True), world(static=True), world(group=2),
    world(margin=0.1), world(asleep=True),
    chain(3, length=1, width=1), chain(4, length=1, width=1), chain(3, length=1, width=2),
    robot_of(["l0", "l1"], [joint("j0", "revolute", "l0", "l1")], {}),
    robot_of(["l0", "l1"], [joint("j0", "continuous", "l0", "l1")], {}),
    robot_of(["l0", "l1"], [joint("j0", "revolute", "l0", "l1", upper=1.0)], {}),
    robot_of(["l0", "l1"], [joint("j0", "revolute", "l0", "l1", at=(0, 0, 1e-12))], {}),
]


def test_different_content_has_different_digests():
    digests = [digest(value) for value in VALUES]
    same = [(k, i) for k in range(len(VALUES)) for i in range(k) if digests[k] == digests[i]]
    assert not same, same
    assert all(len(text) == 32 and int(text, 16) >= 0 for text in digests)


def test_equal_content_has_one_digest():
    for value in VALUES:
        copy = pickle.loads(pickle.dumps(value))
        assert digest(copy) == digest(value), value
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    assert digest(np.arange(6.0).reshape(2, 3).T) == digest(np.ascontiguousarray(np.arange(6.0).reshape(2, 3).T))
    queried = Box((1, 1, 1))
    collide.collide(queried, queried, np.eye(4), np.eye(4))  # leaves what it prepared in the shape
    assert digest(queried) == digest(Box((1, 1, 1)))


def test_another_process_agrees():
    code = (
        "import numpy as np, collide\nfrom collide.sweeps.content_digest import digest\n"
        "print(digest({'z': (1.5, None), 'a': np.arange(3.0)}, collide.Box((1, 2, 3)), 'x'))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60,
                          env={"PYTHONHASHSEED": "5", "PYTHONPATH": ":".join(filter(None, sys.path))})
    assert done.stdout.strip() == digest({"z": (1.5, None), "a": np.arange(3.0)}, Box((1, 2, 3)), "x")


def test_whatever_decides_answers_is_in_the_digest_of_a_question():
    tool = ("tool", "l2", Box((0.1, 0.1, 0.1)), pose((1, 0, 0)), ())
    changes = [
        {}, {"length": 1.5}, {"margin": 0.1}, {"margin": 0.2}, {"radius": 0.4}, {"at": (2.5, 0, 0.1)}, {"name": "b"},
        {"allow": ["l2"]}, {"allow": ["l1", "l2"]}, {"padding": 0.1}, {"padding": {"l2": 0.1}},
        {"X_WR": pose((0, 0, 1))}, {"attached": [tool]}, {"attached": [(*tool[:3], pose((1, 0, 1)), ())]},
    ]
    digests = [question_digest(arm_checker(**change)) for change in changes]
    same = [(changes[k], changes[i]) for k in range(len(changes)) for i in range(k) if digests[k] == digests[i]]
    assert not same, same
    assert digests == [question_digest(arm_checker(**change)) for change in changes]
    checker = arm_checker()
    checker.world.set_margin("ball", 0.1)
    assert question_digest(checker) == digests[2], "as of a World made with the margin"


def test_what_has_no_digest_is_named():
    with pytest.raises(TypeError, match="set"):
        digest([{1, 2}])
