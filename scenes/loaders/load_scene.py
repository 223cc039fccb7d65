"""`load`: which format a file is in, and several files as one scene."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from collide import scenes
from collide.base import argument_checks as checks
from collide.base.given_files import starts_like_xml
from collide.base.units import scale_factor
from collide.errors import LONGEST_PLACE, InvalidArgument, SceneError, cut
from collide.robots.robot import Robot
from collide.scenes.description import Scene, SceneBody, free_name
from collide.scenes.loaders import mesh_file as mesh_loader
from collide.scenes.loaders import mjcf, moveit, moveit_text, scene_yaml, sdformat, states, urdf
from collide.scenes.loaders.documents import read_document
from collide.scenes.loaders.fields import read_each
from collide.scenes.loaders.mesh_shapes import part_shape
from collide.scenes.loaders.resources import named
from collide.scenes.loaders.robot_file import load_robot
from collide.scenes.loaders.xml_text import parse_xml

FORMATS = (
    "URDF, MJCF and SDFormat (.urdf, .xml, .sdf, .world), scene files and MoveIt planning scenes "
    "(.yaml, .yml, .json, .scene), "
    f"meshes ({', '.join(mesh_loader.SUFFIXES)})"
)


@dataclass(frozen=True)
class Options:
    """What the loaders are told; see `load`."""

    robot: Any = None
    srdf: Any = None
    meshes: str = "mesh"
    package_path: tuple = ()
    scale: float = 1.0
    missing_meshes: str = "error"

    def for_robots(self) -> dict[str, Any]:
        return {"meshes": self.meshes, "package_path": self.package_path, "missing_meshes": self.missing_meshes}


def load(
    path,
    *more_paths,
    state: str | Path | Mapping[str, float] | None = None,
    robot: Robot | str | Path | None = None,
    srdf: str | Path | bool | None = None,
    meshes: str = "mesh",
    package_path: str | Path | Iterable = (),
    scale: float | str | None = None,
    missing_meshes: str = "error",
    progress=None,
) -> Scene:
    """A scene from one file, several files together, or the name of a shipped scene.

    Parameters
    ----------
    path : str or Path
        A URDF, an MJCF or an SDFormat file (an SRDF beside it is read too), a MoveIt planning scene, a mesh, a scene
        file (docs/scene-format.md), ``package://`` and a file in a package, or the name of a shipped scene.
    *more_paths
        Further files of the same scene.
    state : str, Path or mapping of str to float, optional
        The name of a state that the files define, a file of joint values, or joint → value [rad or m].
    robot : Robot, str or Path, optional
        For MoveIt planning scenes: the robot, or its file.
    srdf : str, Path or bool, optional
        The SRDF of a URDF; None looks beside it, False does without.
    meshes : {"mesh", "repaired", "hull", "hull:64", "hull+:64", "pieces"}
        "mesh": triangles as they are, a `collide.Mesh`, solid where they close; "repaired": the same, meshes that are
        no solids repaired as by `collide.repaired`; "hull": the convex hull of the vertices; "hull:64": of at most
        64 of them; "hull+:64": of at most 64 corners around all, proven (docs/nested_hulls.md); "pieces": a
        union of convex pieces (coacd). Each body's ``approximation`` says what was repaired, or what hulls and pieces
        leave out or add.
    package_path : str, Path or iterable of them
        Folders in which ``package://`` names are looked for first.
    scale : float or str, optional
        Factor on the vertices of mesh files that are named directly, or their unit: 0.001 or "mm".
    missing_meshes : {"error", "skip"}
        "skip": links whose mesh is absent are not checked, which is noted.
    progress : callable, optional
        As of `collide.boolean`: the label says which of several files is read.

    Returns
    -------
    Scene
        With everything in metres and radians, at the state named or the default configuration.

    Raises
    ------
    SceneError, InvalidShape, InvalidPose, MissingExtra
        Naming file, element and value.
    """
    started = time.perf_counter()
    factor = 1.0 if scale is None else scale_factor("scale", scale, SceneError)
    options = Options(robot, srdf, meshes, tuple(_paths(package_path)), factor, missing_meshes)
    mesh_loader.check_meshes_option(meshes)
    files = [named(path_or_name, options.package_path) for path_or_name in (path, *more_paths)]
    with nullcontext() if progress is None else progress("reading the scene") as set_label:

        def read(entry: tuple[int, Any]) -> Scene:
            k, path_or_name = entry
            if set_label and len(files) > 1:
                set_label(f"reading the scene: {k / len(files):.0%}, {cut(str(path_or_name), LONGEST_PLACE)}")
            return _load_one(_resolve(path_or_name), options)

        parts = read_each(enumerate(files), read)
    scene = parts[0] if len(parts) == 1 else _together(parts)
    if state is not None:
        scene = _in_state(scene, state)
    scene.seconds["read"] = time.perf_counter() - started - scene.seconds.get("meshes", 0.0)
    return scene


def _paths(package_path) -> list[Path]:
    if isinstance(package_path, (str, Path)):
        package_path = [package_path]
    folders = checks.listed_entries("package_path", package_path, "a folder, or a sequence of folders", SceneError)
    return [checks.file_path("package_path", folder, SceneError) for folder in folders]


def _resolve(path) -> Path:
    """The file meant: a path, or the bare name of a shipped scene."""
    if not isinstance(path, (str, Path)):
        raise SceneError(f"path must be a file or the name of a shipped scene, got {checks.brief(path)}")
    if not str(path):
        raise SceneError("path is '': give a file, or the name of a shipped scene")
    file = Path(path)
    if _exists(file):
        return file
    if str(path) in scenes.shipped():
        return scenes.path(str(path))
    if file.suffix or len(file.parts) > 1:
        raise SceneError("no such file", path=cut(str(path), LONGEST_PLACE))
    raise SceneError(
        f"no such file, and no shipped scene of that name; there are {', '.join(scenes.shipped())}",
        path=cut(str(path), LONGEST_PLACE),
    )


def _exists(file: Path) -> bool:
    try:
        return file.exists()
    except (OSError, ValueError):  # a name longer than any file's, or with a zero in it
        return False


def _in_state(scene: Scene, state: str | Path | Mapping[str, float]) -> Scene:
    """The scene with its robots at a named state, at values, or at the values in a file."""
    if isinstance(state, Path) or (
        isinstance(state, str) and state not in scene.states and _exists(Path(state)) and not Path(state).is_dir()
    ):
        path, state = state, states.read_state(state)
    else:
        path = None
    try:
        return scene.with_state(state)
    except InvalidArgument as error:
        advice = "; there is no file of joint values of that name either" if isinstance(state, str) else ""
        raise SceneError(f"{error}{advice}", path=path) from None


def _load_one(path: Path, options: Options) -> Scene:
    suffix = path.suffix.lower()
    if suffix in mesh_loader.SUFFIXES:
        return load_meshes(path, options)
    if path.is_dir():
        raise SceneError(f"is a folder; name a file in it. Known formats: {FORMATS}", path=path)
    if suffix in (".yaml", ".yml", ".json"):
        return _load_document(path, options)
    if suffix == ".scene":
        return _load_text_scene(path, options)
    if suffix in (".urdf", ".xml", ".xacro", ".srdf", ".sdf", ".mjcf", ".world") or starts_like_xml(path):
        return _load_xml(path, options)
    raise SceneError(f"unknown format {path.suffix!r}; known are {FORMATS}", path=path)


def _load_xml(path: Path, options: Options) -> Scene:
    root = parse_xml(path, [])
    if root.tag == "mujoco":
        return _load_mjcf(path, options)
    if sdformat.is_sdf(root):
        seconds: dict[str, float] = {}
        scene = sdformat.load_scene(path, options.srdf, seconds=seconds, **options.for_robots())
        scene.seconds = seconds
        return scene
    if root.tag == "mujocoinclude":
        raise SceneError("is a part of an MJCF model (<mujocoinclude>): give the file that includes it", path=path)
    if root.tag != "robot":
        raise SceneError(f"<{root.tag}> is no format known here; known are {FORMATS}", path=path)
    if root.find("link") is None and root.find("disable_collisions") is not None:
        raise SceneError("is an SRDF: give the URDF, and this file as srdf= (--srdf)", path=path)
    scene = Scene("")
    robot = urdf.load_robot(path, options.srdf, seconds=scene.seconds, **options.for_robots())
    scene.name = robot.name
    scene.place_robot(robot, np.eye(4))
    return scene


def _load_text_scene(path: Path, options: Options) -> Scene:
    """The obstacles of a MoveIt scene as text, and the robot where one is given, its root at the world's origin."""
    scene = moveit_text.load_text_scene(path, options.meshes)
    if options.robot is not None:
        robot = options.robot
        if not isinstance(robot, Robot):
            robot = load_robot(robot, options.srdf, seconds=scene.seconds, **options.for_robots())
        scene.place_robot(robot, np.eye(4))
    return scene


def _load_mjcf(path: Path, options: Options) -> Scene:
    scene = Scene("")
    file = mjcf.load_mjcf(path, options.srdf, meshes=options.meshes, seconds=scene.seconds)
    scene.name = file.robot.name
    mjcf.place_mjcf(scene, file, np.eye(4))
    return scene


def _load_document(path: Path, options: Options) -> Scene:
    data = read_document(path)
    if moveit.is_planning_scene(data):
        return moveit.load_planning_scene(
            path, data, robot=options.robot, srdf=options.srdf, **options.for_robots()
        )
    if isinstance(data, dict) and "collide" in data:
        return scene_yaml.build(data, path, **options.for_robots())
    if isinstance(data, dict) and ("start_state" in data or "goal_constraints" in data):
        raise SceneError("is a MoveIt planning request: give the scene file beside it", path=path)
    if states.looks_like_state(data):
        raise SceneError("holds joint values, not a scene: give it as state= (--state)", path=path)
    raise SceneError(
        "is no scene: a scene file starts with the key collide: 1 (docs/scene-format.md), "
        "a MoveIt planning scene has robot_model_name",
        path=path,
    )


def load_meshes(path: Path, options: Options) -> Scene:
    """One body for each mesh of a file, free to move, so that bodies of a file are tested too."""
    scale, started = options.scale, time.perf_counter()
    file = mesh_loader.read_mesh(path, options.meshes)
    scene = Scene(path.stem, sources=[str(path)], notes=list(file.notes))
    names: dict[str, int] = {}
    for part in file.parts:
        source = f"{path}: {part.name}"
        shape, approximation = part_shape(part, scale, source)
        note = mesh_loader.size_note(float(np.ptp(part.points, axis=0).max()) * abs(scale), source)
        scene.notes += [note] if note else []
        scene.add(SceneBody(free_name(part.name, names), shape, np.eye(4), source=source, approximation=approximation))
    scene.seconds["meshes"] = time.perf_counter() - started
    return scene


def _together(parts: list[Scene]) -> Scene:
    """Several scenes as one; a mesh whose name is taken is numbered, anything else must be renamed."""
    more = f" and {len(parts) - 3} more" if len(parts) > 4 else ""
    whole = Scene(" + ".join(part.name for part in (parts[:3] if more else parts)) + more)
    names: dict[str, int] = {}
    for part in parts:
        for body in part.bodies:
            if (
                body.owner is None
                and not part.robots
                and len(part.sources) == 1
                and Path(part.sources[0]).suffix.lower() in mesh_loader.SUFFIXES
            ):
                body = replace(body, name=free_name(body.name, names))
            names.setdefault(body.name, 1)
            whole.add(body)
        for name in part.robots:
            if name in whole.robots:
                raise SceneError(
                    f"two robots are called {name}; write a scene file that gives them prefixes", path=part.sources[0]
                )
        whole.robots.update(part.robots)
        whole.placements.update(part.placements)
        whole.allowed += part.allowed
        whole.notes += part.notes
        whole.state_notes += part.state_notes
        whole.sources += [source for source in part.sources if source not in whole.sources]
        for name, values in part.states.items():
            whole.states.setdefault(name, {}).update(values)
        for stage, spent in part.seconds.items():
            whole.seconds[stage] = whole.seconds.get(stage, 0.0) + spent
    return whole
