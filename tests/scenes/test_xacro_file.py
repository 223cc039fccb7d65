"""Robots in xacro: expanded by the package where it is installed, and told what is missing where it is not."""

from __future__ import annotations

import sys

import pytest

import collide
from collide.scenes import load

ARM = """<?xml version="1.0"?>
<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:property name="r" value="0.1"/>
<xacro:macro name="ball" params="name">
<link name="${name}"><collision><geometry><sphere radius="RADIUS"/></geometry></collision></link></xacro:macro>
<xacro:ball name="a"/><xacro:ball name="b"/>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="${3 * r} 0 0"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def arm(tmp_path, radius: str = "${r}"):
    place = tmp_path / "arm.urdf.xacro"
    place.write_text(ARM.replace("RADIUS", radius))
    return place


def test_macros_and_properties_are_expanded(tmp_path):
    pytest.importorskip("xacro", reason="extra [xacro] is not installed")
    scene = load(arm(tmp_path))
    assert [body.shape for body in scene.bodies] == [collide.Sphere(0.1)] * 2
    assert scene.bodies[1].X_WB[0, 3] == pytest.approx(0.3, abs=1e-15)
    assert collide.Robot.load(arm(tmp_path)).links == ("a", "b")


@pytest.mark.parametrize(
    ("radius", "message"),
    [("${nope}", "xacro cannot expand it: .*nope"), ("$(find x)", r"\$\(find NAME\) needs the environment of ROS")],
)
def test_what_xacro_refuses_names_the_file(tmp_path, radius, message):
    pytest.importorskip("xacro", reason="extra [xacro] is not installed")
    with pytest.raises(collide.errors.SceneError, match=rf"arm\.urdf\.xacro: .*{message}"):
        load(arm(tmp_path, radius))


def test_without_the_package_its_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(collide.errors.MissingExtra, match=r"expand arm\.urdf\.xacro: .*collide-robotics\[xacro\]"):
        load(arm(tmp_path))
