"""Names and arguments of other libraries: the message says what to write, and what it says to write exists."""

from __future__ import annotations

import inspect
import re
from types import SimpleNamespace

import numpy as np
import pytest

import collide
from collide.base import foreign_names
from collide.base.foreign_arguments import foreign_arguments

FUNCTIONS = {
    **{name: getattr(collide, name) for name in foreign_names.FOREIGN_ARGUMENTS if hasattr(collide, name)},
    "WorldScene.add": collide.World().add,
}
BOX = collide.Box((1, 1, 1))
CUBE = SimpleNamespace(vertices=np.zeros((4, 3)), faces=np.zeros((2, 3), dtype=int))


@pytest.mark.parametrize("name", foreign_names.FOREIGN_NAMES)
def test_a_name_of_another_library_says_what_to_write(name):
    with pytest.raises(AttributeError, match=rf"no attribute '{name}': write collide\.") as caught:
        getattr(collide, name)
    for written in re.findall(r"collide((?:\.\w+)+)", str(caught.value)):
        value = collide
        for part in written[1:].split("."):
            value = getattr(value, part)


@pytest.mark.parametrize(("name", "meant"), [
    ("distances", "distance"), ("half_space", "Halfspace"), ("PointClod", "PointCloud"), ("sphere", "Sphere"),
    ("Convex_Hull", "ConvexHull"), ("time_of_impcat", "time_of_impact"), ("scene", "scenes"),
])
def test_a_misspelt_name_is_told_the_nearest(name, meant):
    known = foreign_names.FOREIGN_NAMES
    wanted = "write" if name in known else re.escape(f"did you mean collide.{meant}?")
    with pytest.raises(AttributeError, match=wanted):
        getattr(collide, name)


def test_a_name_of_nothing_gets_no_advice():
    with pytest.raises(AttributeError, match=r"^module 'collide' has no attribute 'zzzzqqq'$"):
        collide.zzzzqqq  # noqa: B018
    assert not hasattr(collide, "__zzzz__")


@pytest.mark.parametrize(
    ("function", "argument"),
    [(f, a) for f, known in foreign_names.FOREIGN_ARGUMENTS.items() for a in known if a != foreign_names._TOO_MANY],
)
def test_a_foreign_argument_says_what_to_write(function, argument):
    call = FUNCTIONS[function]
    assert argument not in inspect.signature(call).parameters, "no foreign argument: the function has it"
    advice = foreign_names.FOREIGN_ARGUMENTS[function][argument]
    with pytest.raises(TypeError, match=re.escape(f"'{argument}': write {advice}")):
        call(**{argument: 1.0})
    named = re.match(r"(\w+)=", advice)
    assert named is None or named[1] in inspect.signature(call).parameters


def test_arguments_too_many():
    with pytest.raises(TypeError, match=r"given: write World\.add\(shape, X_WB, name='b'\)"):
        collide.World().add("b", BOX, np.eye(4))
    with pytest.raises(collide.InvalidArgument, match=r"the shape comes first: World\.add\(shape, X_WB, name='b'\)"):
        collide.World().add("b", BOX)
    with pytest.raises(TypeError, match=r"given: write pose\(xyz, R=rotation\)"):
        collide.pose((0, 0, 0), (1, 0, 0, 0))


def test_a_type_error_of_the_function_itself_is_left_as_it_is():
    def pose(xyz):
        raise TypeError("pose() got an unexpected keyword argument 'quat'")

    pose.__qualname__ = "pose"
    with pytest.raises(TypeError, match=r"'quat'$"):
        foreign_arguments(pose)(1)
    assert foreign_arguments(pose).__wrapped__ is pose


@pytest.mark.parametrize(("ask", "advice"), [
    (lambda: collide.distance(CUBE, BOX, np.eye(4), np.eye(4)), r"becomes one by collide\.Mesh\(mesh\)"),
    (lambda: collide.collide(BOX, CUBE, np.eye(4), np.eye(4)), r"becomes one by collide\.Mesh\(mesh\)"),
    (lambda: collide.contacts(BOX, CUBE, np.eye(4), np.eye(4)), r"becomes one by collide\.Mesh\(mesh\)"),
    (lambda: collide.World().add(CUBE), r"becomes one by collide\.Mesh\(mesh\)"),
    (lambda: collide.World().add(SimpleNamespace(vertices=1, triangles=2)), r"Mesh\(mesh\.vertices, mesh\.triangles\)"),
    (lambda: collide.World().add("part.stl"), r"collide\.scenes\.load\(path\)\.bodies\[0\]\.shape"),
    (lambda: collide.ConvexHull(CUBE), r"ConvexHull\(mesh\.vertices\)"),
    (lambda: collide.Mesh("part.stl"), r"collide\.scenes\.load\(path\)"),
])
def test_what_is_no_shape_is_told_how_to_become_one(ask, advice):
    with pytest.raises(collide.CollideError, match=advice):
        ask()


@pytest.mark.parametrize(("X", "advice"), [
    ((1.0, 2.0, 3.0), r"a position alone is collide\.pose\(\(1\.0, 2\.0, 3\.0\)\)"),
    ([1, 2, 3], r"a position alone is collide\.pose\(\(1\.0, 2\.0, 3\.0\)\)"),
    (np.zeros((5, 3)), r"positions alone are collide\.poses\(positions\)"),
    (np.eye(3), r"a rotation alone is collide\.pose\(R=rotation\)"),
    (None, r"the identity is collide\.pose\(\)"),
])
def test_positions_and_rotations_are_no_poses(X, advice):
    with pytest.raises(collide.InvalidPose, match=advice):
        collide.distance(BOX, BOX, np.eye(4), X)
    if X is not None:
        with pytest.raises(collide.InvalidPose, match=advice):
            collide.World().add(BOX, X)


@pytest.mark.parametrize("name", foreign_names.FOREIGN_METHODS)
def test_a_method_of_another_library_says_what_to_write(name):
    with pytest.raises(AttributeError, match=f"'World' object has no attribute '{name}': write ") as caught:
        getattr(collide.World(), name)
    for method in re.findall(r"(?:write |or |and )(\w+)\(", str(caught.value)):
        assert hasattr(collide.World, method)


def test_misspelt_methods_and_private_names():
    with pytest.raises(AttributeError, match=r"'distence': did you mean distances\?"):
        collide.World().distence  # noqa: B018
    with pytest.raises(AttributeError, match=r"'_packd'$"):
        collide.World()._packd  # noqa: B018
