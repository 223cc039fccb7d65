"""A robot from a file of any format that holds one."""

from __future__ import annotations

from pathlib import Path

from collide.base import argument_checks as checks
from collide.errors import SceneError
from collide.robots.robot import Robot
from collide.scenes.loaders import mjcf, urdf
from collide.scenes.loaders.xml_text import parse_xml


def load_robot(
    path, srdf=None, *, meshes: str = "mesh", package_path=(), missing_meshes: str = "error",
    seconds: dict[str, float] | None = None,
) -> Robot:
    """A `Robot` from a URDF or an MJCF file, whatever it is called; options as of `urdf.load_robot`.

    MuJoCo looks for meshes itself, beside the file, and needs all of them: ``package_path`` and ``missing_meshes``
    are for URDFs.
    """
    path = checks.file_path("Robot.load: path", path, SceneError)
    if is_mjcf(path):
        return mjcf.load_robot(path, srdf, meshes=meshes, seconds=seconds)
    return urdf.load_robot(
        path, srdf, meshes=meshes, package_path=package_path, missing_meshes=missing_meshes, seconds=seconds
    )


def is_mjcf(path) -> bool:
    """Whether the outermost element of an XML file is <mujoco>; files called .urdf are not opened."""
    return Path(path).suffix.lower() != ".urdf" and parse_xml(Path(path), []).tag == "mujoco"
