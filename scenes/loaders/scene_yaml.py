"""The project's own scene files, YAML or JSON: docs/scene-format.md describes every key.

Every complaint names the file and the place in it, ``bodies[3] "mug".pose.xyz``.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from collide.base.given_files import LARGEST_TEXT, read_text
from collide.errors import InvalidArgument, SceneError, brief, listing
from collide.robots.robot import Robot
from collide.scenes.description import Scene, SceneBody
from collide.scenes.loaders import mjcf, resources, sdformat, shape_yaml, urdf
from collide.scenes.loaders.documents import parse_document
from collide.scenes.loaders.fields import Fields, did_you_mean, read_each, read_pose
from collide.scenes.loaders.files import MAX_INCLUDED
from collide.scenes.loaders.mesh_file import MeshFile, meshes_option, read_mesh
from collide.scenes.loaders.robot_yaml import inline_robot
from collide.scenes.loaders.states import state_of

VERSION = 1
#: Metres in a unit of length.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}

_SCENE = ("collide", "name", "about", "units", "include", "robots", "bodies", "allow", "states")
_ROBOT = ("urdf", "mjcf", "sdf", "srdf", "robot", "name", "prefix", "pose", "state", "base", "meshes")
_BODY = ("name", "about", "shape", "pose", "static", "group", "mask")


@dataclass
class _Included:
    """How many files a scene has included so far, and their characters: files that include many multiply."""

    files: int = 0
    characters: int = 0


@dataclass
class _Building:
    """What one `build` hands down: the scene, the file being read, and how meshes are taken."""

    scene: Scene
    path: Path
    metres: float
    meshes: str
    package_path: tuple
    missing_meshes: str
    open_files: tuple[Path, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)
    included: _Included = field(default_factory=lambda: _Included())
    mesh_files: dict[tuple[Path, str], MeshFile] = field(default_factory=dict)

    def mesh(self, filename: str, place: str, taken: str | None = None):
        """The mesh file that a shape names, read; its time counts as ``meshes``.

        taken : how the shape itself says that the mesh is taken; else as meshes of the scene are.
        """
        started = time.perf_counter()
        key = self.find(filename, place), taken or self.meshes
        if key not in self.mesh_files:
            self.mesh_files[key] = read_mesh(*key)
            self.scene.notes += [note for note in self.mesh_files[key].notes if note not in self.scene.notes]
        file = self.mesh_files[key]
        self.seconds["meshes"] = self.seconds.get("meshes", 0.0) + time.perf_counter() - started
        return file

    def find(self, filename: str, place: str) -> Path:
        """Where the file is that a shape names."""
        return resources.find(filename, self.path, self.package_path, element=place)


def build(
    data: Any, path, *, meshes: str = "mesh", package_path: Iterable = (), missing_meshes: str = "error",
) -> Scene:
    """The scene that a document of this format describes.

    data : the document, as plain data.   path : of the file it came from; names in it are relative to that.
    """
    path = Path(path)
    named = isinstance(data, Mapping) and data.get("name")
    scene = Scene(Fields(data, path).text("name") if named else path.stem)
    _build_into(_Building(scene, path, 1.0, meshes, tuple(package_path), missing_meshes, seconds=scene.seconds), data)
    return scene


def _build_into(building: _Building, data: Any) -> None:
    document = Fields(data, building.path, "", _SCENE)
    if document.get("collide") != VERSION or isinstance(document.get("collide"), bool):
        document.fail(f"must be {VERSION}, the version of the format; got {brief(document.get('collide'))}", "collide")
    building.metres = UNITS[document.choice("units", UNITS, "m")]
    scene = building.scene
    scene.sources.append(str(building.path))
    if building.metres != 1.0:
        scene.notes.append(
            f"{building.path.name}: lengths are in {document.get('units')}; they were turned into metres"
        )
    for entry, place in document.items("include"):
        _include(building, entry, place)
    for entry, place in document.items("robots"):
        _add_robot(building, Fields(entry, building.path, place, _ROBOT))
    bodies = (Fields(entry, building.path, place, _BODY) for entry, place in document.items("bodies"))
    read_each(bodies, lambda body: _add_body(building, body))
    names = {body.name: None for body in scene.bodies}
    for entry, place in document.items("allow"):
        scene.allowed.append(_allowed_pair(document, entry, place, names))
    if document.get("states") is not None:
        _add_states(document, scene)


def _include(building: _Building, entry: Any, place: str) -> None:
    if not isinstance(entry, str):
        raise SceneError(f"must be the name of a file, got {brief(entry)}", path=building.path, element=place)
    file = resources.find(entry, building.path, building.package_path, element=place)
    chain = (*building.open_files, building.path.resolve())
    if file.resolve() in chain:
        names = " -> ".join(included.name for included in (*chain, file))
        raise SceneError(f"files include each other in a circle: {names}", path=building.path, element=place)
    text, so_far = read_text(file), building.included
    so_far.files, so_far.characters = so_far.files + 1, so_far.characters + len(text)
    for number, limit, of_what in (
        (so_far.files, MAX_INCLUDED, "files"),
        (so_far.characters, LARGEST_TEXT, "characters"),
    ):
        if number > limit:
            what = (
                f"with this the scene includes more than {limit:,} {of_what}, repeats counted: put their bodies "
                "in one file"
            )
            raise SceneError(what, path=building.path, element=place)
    _build_into(replace(building, path=file, metres=1.0, open_files=chain), parse_document(text, file))


# --- robots -------------------------------------------------------------------------------------


def _add_robot(building: _Building, entry: Fields) -> None:
    file = _read_robot(building, entry)
    prefix = _prefix(entry)
    robot = (file.robot if isinstance(file, mjcf.MjcfFile) else file).renamed(prefix)
    name = entry.text("name", robot.name)
    X_WR = read_pose(entry, "pose", building.metres)
    mobile = entry.choice("base", ("fixed", "mobile"), "fixed") == "mobile"
    values = _robot_state(entry, robot)
    try:
        if isinstance(file, mjcf.MjcfFile):
            mjcf.place_mjcf(building.scene, file, X_WR, values, prefix=prefix, name=name, mobile=mobile)
        else:
            building.scene.place_robot(robot, X_WR, values, name=name, mobile=mobile)
    except InvalidArgument as error:
        entry.fail(str(error), "state")
    except SceneError as error:
        raise SceneError(error.what, path=building.path, element=entry.element) from None


def _prefix(entry: Fields) -> str:
    return entry.text("prefix") if entry.get("prefix") else ""


def _read_robot(building: _Building, entry: Fields) -> Robot | mjcf.MjcfFile:
    if sum(key in entry for key in ("urdf", "mjcf", "sdf", "robot")) != 1:
        entry.fail("give one of urdf, mjcf and sdf, a file, or robot, a description with links and joints")
    meshes = meshes_option(entry, "meshes", building.meshes)
    if "robot" in entry:
        return inline_robot(
            entry, building.metres, shape_yaml.Files(
                lambda filename, place, taken=None: building.mesh(filename, place, taken or meshes), building.find
            ),
        )
    srdf = entry.get("srdf")
    if isinstance(srdf, str):
        srdf = resources.find(srdf, building.path, building.package_path, element=entry.place("srdf"))
    elif srdf is not None and srdf is not False:
        entry.fail(f"must be the name of a file, or false to do without, got {brief(srdf)}", "srdf")
    key = next(key for key in ("mjcf", "sdf", "urdf") if key in entry)
    file = resources.find(entry.text(key), building.path, building.package_path, element=entry.place(key))
    if key == "mjcf":
        return mjcf.load_mjcf(file, srdf, meshes=meshes, seconds=building.seconds)
    return (sdformat if key == "sdf" else urdf).load_robot(
        file, srdf, meshes=meshes, package_path=building.package_path,
        missing_meshes=building.missing_meshes, seconds=building.seconds,
    )


def _robot_state(entry: Fields, robot: Robot) -> dict[str, float]:
    """Joint values by the robot's names: a mapping with or without the prefix, or a named state."""
    state = entry.get("state")
    if state is None:
        return {}
    if isinstance(state, str):
        if state not in robot.states:
            entry.fail(
                f"unknown state {brief(state)}{did_you_mean(state, robot.states)}; known are "
                f"{listing(robot.states) or 'none'}",
                "state",
            )
        return dict(robot.states[state])
    prefix = _prefix(entry)
    known = set(robot.joint_names) | {joint.name for joint in robot.joints}
    values = {}
    for joint, value in state_of(state, entry.path, entry.place("state")).items():
        full = joint if joint in known else prefix + joint
        if full not in known:
            entry.fail(
                f"unknown joint {brief(joint)}{did_you_mean(joint, known)}; robot {robot.name} has "
                f"{listing(robot.joint_names)}",
                "state",
            )
        values[full] = value
    return values


# --- bodies -------------------------------------------------------------------------------------


def _add_body(building: _Building, entry: Fields) -> None:
    name = entry.text("name")
    entry.named(name)
    if "shape" not in entry:
        entry.fail("'shape' is missing")
    described = shape_yaml.read_shape(
        entry.data["shape"], entry.path, entry.place("shape"), building.metres,
        shape_yaml.Files(building.mesh, building.find),
    )
    building.scene.add(
        SceneBody(
            name, described.shape, read_pose(entry, "pose", building.metres), static=entry.flag("static", False),
            group=entry.bits("group", 1), mask=entry.bits("mask", 0xFFFF),
            source=f"{building.path}: {entry.element}", approximation=described.approximation,
        )
    )
    building.scene.notes += described.notes


def _allowed_pair(document: Fields, entry: Any, place: str, names: Mapping[str, None]) -> tuple[str, str, str]:
    if not isinstance(entry, list) or len(entry) not in (2, 3) or not all(isinstance(word, str) for word in entry):
        raise SceneError(
            f"must be [body, body] or [body, body, reason], got {brief(entry)}", path=document.path, element=place
        )
    for name in entry[:2]:
        if name not in names:
            raise SceneError(
                f"no body is called {brief(name)}{did_you_mean(name, names)}; bodies are {listing(names)}",
                path=document.path, element=place,
            )
    if entry[0] == entry[1]:
        raise SceneError(
            f"a body is never tested against itself, got {brief(entry)}", path=document.path, element=place
        )
    return entry[0], entry[1], entry[2] if len(entry) == 3 else "allowed by the scene"


def _add_states(document: Fields, scene: Scene) -> None:
    states = document.sub("states", ())
    for name in states.data:
        values = state_of(states.data[name], document.path, f"states.{name}")
        try:
            scene.joint_shares(values)
        except InvalidArgument as error:
            states.fail(str(error), str(name))
        scene.states[str(name)] = values
