"""Scale factors as numbers and as units, the same in Python, in YAML and on the command line."""

from __future__ import annotations

import json

import numpy as np
import pytest

from collide.base.units import UNITS, scale_factor
from collide.cli import arguments
from collide.errors import InvalidArgument, SceneError
from collide.scenes import load
from collide.scenes.loaders.scene_yaml import build


@pytest.fixture
def tetrahedron(tmp_path):
    file = tmp_path / "t.obj"
    file.write_text("v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 100\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    return file


@pytest.mark.parametrize("unit", [unit for unit in UNITS if unit])
def test_python_yaml_and_command_agree(unit, tetrahedron):
    of_python = load(tetrahedron, scale=unit).bodies[0].shape
    item = {"name": "t", "shape": {"mesh": {"file": "t.obj", "scale": unit}}}
    of_yaml = build({"collide": 1, "bodies": [item]}, tetrahedron.with_name("scene.yaml")).bodies[0].shape
    factor = arguments.parse(["report", str(tetrahedron), "--scale", unit]).scale
    of_command = load(tetrahedron, scale=factor).bodies[0].shape
    assert of_python == of_yaml == of_command
    assert np.abs(of_python.points).max() == pytest.approx(100 * UNITS[unit], rel=1e-15)


@pytest.mark.parametrize("value", ["inch", "", " ", 0, np.nan, True, None, [1, 2], "0.001"])
def test_what_is_no_scale(value, tetrahedron):
    with pytest.raises(InvalidArgument, match="scale must be a finite number other than 0, or a unit, one of m, km"):
        scale_factor("scale", value)
    if value is not None:
        with pytest.raises(SceneError, match="scale must be"):
            load(tetrahedron, scale=value)


def test_a_cloud_in_millimetres(tmp_path):
    (tmp_path / "c.xyz").write_text("0 0 0\n1000 0 0\n")
    scene = tmp_path / "s.json"
    shape = {"cloud": {"file": "c.xyz", "scale": "mm", "radius": 0.01}}
    scene.write_text(json.dumps({"collide": 1, "bodies": [{"name": "c", "shape": shape}]}))
    assert load(scene).bodies[0].shape.points[:, 0].tolist() == [0.0, 1.0]
    scene.write_text(scene.read_text().replace("mm", "parsec"))
    with pytest.raises(SceneError, match="must be a number or a unit, one of m, km"):
        load(scene)
