"""A robot from a file of any format that holds one."""

from __future__ import annotations

from pathlib import Path

from collide.base import argument_checks as checks
from collide.errors import SceneError
from collide.robots.robot import Robot
from collide.scenes.loaders import mjcf, sdformat, urdf
from collide.scenes.loaders.resources import named
from collide.scenes.loaders.xml_text import parse_xml


def load_robot(
    path, srdf=None, *, meshes: str = "mesh", package_path=(), missing_meshes: str = "error",
    seconds: dict[str, float] | None = None,
) -> Robot:
    """A `Robot` from a URDF, an MJCF or an SDFormat file, whatever it is called; options as of `urdf.load_robot`.

    MuJoCo looks for meshes itself, beside the file, and needs all of them: ``package_path`` and ``missing_meshes``
    are for URDFs.
    """
    path = checks.file_path("Robot.load: path", named(path, package_path), SceneError)
    root = None if Path(path).suffix.lower() == ".urdf" else parse_xml(Path(path), [])
    if root is not None and root.tag == "mujoco":
        return mjcf.load_robot(path, srdf, meshes=meshes, seconds=seconds)
    read = sdformat.load_robot if root is not None and sdformat.is_sdf(root) else urdf.load_robot
    return read(path, srdf, meshes=meshes, package_path=package_path, missing_meshes=missing_meshes, seconds=seconds)
