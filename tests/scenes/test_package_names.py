"""Files named by the package that they are in, in calls and commands."""

from __future__ import annotations

import pytest

import collide
from collide.cli.main import main
from collide.scenes import load

LINK = '<link name="a"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
URDF = f'<robot name="arm">{LINK}</robot>'


@pytest.fixture()
def packages(tmp_path):
    (tmp_path / "arms" / "urdf").mkdir(parents=True)
    (tmp_path / "arms" / "urdf" / "arm.urdf").write_text(URDF)
    return tmp_path


def test_a_robot_is_found_in_its_package(packages, monkeypatch):
    name = "package://arms/urdf/arm.urdf"
    assert collide.Robot.load(name, package_path=[packages]).links == ("a",)
    assert [body.name for body in load(name, package_path=packages).bodies] == ["a"]
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(packages))
    assert collide.Robot.load(name).links == ("a",)
    assert main(["report", name]) == 0


def test_packages_that_are_not_there_are_told_with_the_places_searched(packages):
    with pytest.raises(collide.SceneError, match=r'cannot find "package://legs/leg.urdf".*package_path'):
        collide.Robot.load("package://legs/leg.urdf", package_path=[packages])
    with pytest.raises(collide.SceneError, match="files are not fetched over https"):
        load("https://example.com/arm.urdf")
