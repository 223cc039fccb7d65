"""MoveIt's .scene files, of both formats."""

from __future__ import annotations

import numpy as np
import pytest

from collide.errors import CollideError
from collide.scenes import load
from collide.shapes import Box, Compound, Cone, ConvexHull, Cylinder, Halfspace, Mesh, Sphere
from collide.transforms import pose

TETRAHEDRON = "mesh\n4 4\n0 0 0\n1 0 0\n0 2 0\n0 0 3\n0 2 1\n0 1 3\n1 2 3\n2 0 3\n"
AT_ORIGIN = "0 0 0\n0 0 0 1\n0 0 0 0\n"


@pytest.fixture
def scene_of(tmp_path):
    def make(text: str, **options):
        (tmp_path / "s.scene").write_text(text)
        return load(tmp_path / "s.scene", **options)

    return make


def test_objects_with_poses_of_their_own(scene_of):
    scene = scene_of(
        "kitchen shelf+\n* top board\n1 2 3\n0 0 0.70710678118654757 0.70710678118654757\n1\nbox\n0.5 0.6 0.7\n"
        "0.1 0 0\n0 0 0 1\n0.2 0.3 0.4 1\n0\n"
        "* pair\n0 0 1\n0 0 0 1\n2\nsphere\n0.1\n0 0 0.5\n0 0 0 1\n0 0 0 0\n"
        "cylinder\n0.2 0.3\n0 0 0\n0 0 0 0\n0 0 0 0\n"
        "1\nhandle\n0 0 0\n0 0 0 1\n.\n")
    assert scene.name == "kitchen shelf+" and [body.name for body in scene.bodies] == ["top board", "pair"]
    board = scene.body("top board")
    assert board.shape == Box((0.5, 0.6, 0.7)) and board.source.endswith('s.scene: object "top board"')
    np.testing.assert_allclose(board.X_WB, pose((1, 2.1, 3), rpy=(0, 0, np.pi / 2)), atol=1e-15)
    pair = scene.body("pair")
    assert pair.X_WB[:3, 3].tolist() == [0, 0, 1]
    assert pair.shape == Compound([(Sphere(0.1), pose((0, 0, 0.5))), (Cylinder(0.2, 0.3), np.eye(4))])


def test_the_older_format_and_every_shape(scene_of):
    shapes = {"c": ("cone\n0.1 0.2\n", Cone(0.1, 0.2)), "p": ("plane\n0 0 1 -0.5\n", Halfspace((0, 0, 1), 0.5)),
              "s": ("sphere\n0.25\n", Sphere(0.25))}
    text = "".join(f"* {name}\n1\n{written}{AT_ORIGIN}" for name, (written, _) in shapes.items())
    scene = scene_of(f"(noname)+\n{text}* m\n1\n{TETRAHEDRON}0 0 1\n0 0 0 1\n0 0 0 0\n* none\n0\n.\n")
    assert {name: scene.body(name).shape for name in shapes} == {name: shape for name, (_, shape) in shapes.items()}
    assert scene.body("m").X_WB[:3, 3].tolist() == [0, 0, 1]
    assert isinstance(scene.body("m").shape, (ConvexHull, Mesh)) and len(scene.bodies) == 4
    assert any('object "none" has no shape' in note for note in scene.notes)


def test_a_robot_comes_along_where_it_is_given(scene_of, tmp_path):
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><link name="l"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
        "</robot>")
    scene = scene_of(f"s\n* ball\n1\nsphere\n0.1\n{AT_ORIGIN}.\n", robot=tmp_path / "r.urdf")
    assert [tuple(sorted(pair)) for pair in scene.world().collisions().names] == [("ball", "l")]


@pytest.mark.parametrize(("text", "words"), [
    ("", "the file ends where the scene's name"),
    ("s\n", 'ends where "\\* NAME"'),
    ("s\nball\n.\n", 'line 2: must be "\\* NAME"'),
    ("s\n* a\n1\ntorus\n1\n.\n", "line 4: unknown shape 'torus'"),
    ("s\n* a\n1\nbox\n1 2\n.\n", "line 6: the numbers of a box must be 3 finite numbers"),
    ("s\n* a\n1\nbox\n1 2 nan\n.\n", "must be 3 finite numbers"),
    ("s\n* a\n1\nbox\n1 2 3 4\n0 0 0\n0 0 0 1\n0 0 0 0\n.\n", 'must be "\\* NAME"|expected'),
    ("s\n* a\n1\nsphere\n-1\n" + AT_ORIGIN + ".\n", "radius"),
    ("s\n* a\n1.5\nsphere\n1\n" + AT_ORIGIN + ".\n", "must be a whole number"),
    ("s\n* a\n1\nmesh\n4 1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 1 9\n" + AT_ORIGIN + ".\n", "names vertices"),
    ("s\n* a\n1\nsphere\n1\n" + AT_ORIGIN + "* a\n1\nsphere\n1\n" + AT_ORIGIN + ".\n", "exists already"),
])
def test_bad_files_are_refused(scene_of, text, words):
    with pytest.raises(CollideError, match="s.scene.*(" + words + ")"):
        scene_of(text)
