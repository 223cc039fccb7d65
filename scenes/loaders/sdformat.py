"""SDFormat: models and worlds of Gazebo, Drake and others, as robots and as scenes.

Read from the XML itself: includes are followed, frames resolved (`sdf_frames.py`), models taken apart into bodies and
robots (`sdf_models.py`). What is there besides collision geometry, links and joints is not looked at.
"""

from __future__ import annotations

import time
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from collide.base.given_files import is_file
from collide.errors import SceneError, cut, listing
from collide.robots.robot import Robot
from collide.scenes.description import Scene, free_name
from collide.scenes.loaders import resources
from collide.scenes.loaders.files import DEEPEST, MAX_INCLUDED
from collide.scenes.loaders.robot_reading import Reading, opened
from collide.scenes.loaders.sdf_frames import Scope, is_identity, is_true, text_of
from collide.scenes.loaders.sdf_models import Model, Placed, bodies_and_robots, read_model
from collide.scenes.loaders.srdf import find_srdf, read_srdf
from collide.scenes.loaders.xml_text import parse_xml

_FRAMES = ("link", "joint", "frame")
_UNREAD = {
    "actor": "actors are", "population": "populations are", "state": "the state that a world was saved in is",
    "road": "roads are", "joint": "joints between models are",
}
#: What files without a version are taken for.
NEWEST = (2,)


def is_sdf(root: ET.Element) -> bool:
    """Whether this is the outermost element of an SDFormat file."""
    return root.tag in ("sdf", "gazebo", "world", "model")


def load_scene(
    path, srdf=None, *, meshes: str = "mesh", package_path: Iterable = (), missing_meshes: str = "error",
    seconds: dict[str, float] | None = None,
) -> Scene:
    """The `Scene` of a file: its world, or its models, each at its pose.

    Bodies are called MODEL::LINK, joints MODEL::JOINT; where the file has one model alone that has joints, LINK and
    JOINT.   srdf : of a file with one robot.   Other options as of `urdf.load_robot`.

    Raises SceneError, InvalidShape or InvalidPose naming file, element and value.
    """
    started = time.perf_counter()
    file = _File(opened(path, meshes, package_path, missing_meshes))
    around, models = file.read()
    scene = Scene(around.name, sources=[str(file.reading.path)])
    made = [(model, X_WM, *bodies_and_robots(model)) for model, X_WM in models]
    n_robots = sum(len(robots) for *_, robots in made)
    for model, X_WM, bodies, robots in made:
        prefix = "" if len(made) == 1 and robots else f"{model.name}::"
        for body in bodies:
            scene.add(replace(body, name=prefix + body.name, X_WB=X_WM @ body.X_WB))
        for placed in robots:
            robot = _with_srdf(placed.robot, file.reading.path, srdf) if n_robots == 1 else placed.robot
            _place(scene, model, robot, placed, X_WM, prefix)
        names = {body.name for body in scene.bodies}
        within = {link for placed in robots for link in placed.robot.links}
        scene.allowed += [
            (prefix + a, prefix + b, why) for a, b, why in model.apart()
            if not {a, b} <= within and {prefix + a, prefix + b} <= names
        ]
    scene.notes += [f"{file.reading.path.name}: {note}" for note in dict.fromkeys(file.reading.notes)]
    scene.sources = [*dict.fromkeys([*scene.sources, *map(str, file.included)])]
    file.reading.add_time(seconds, started)
    return scene


def load_robot(
    path, srdf=None, *, meshes: str = "mesh", package_path: Iterable = (), missing_meshes: str = "error",
    seconds: dict[str, float] | None = None,
) -> Robot:
    """The only robot of a file, without what stands around it, which is noted; options as of `load_scene`.

    Raises SceneError for a file with none, or several.
    """
    started = time.perf_counter()
    file = _File(opened(path, meshes, package_path, missing_meshes))
    reading, (_, models) = file.reading, file.read()
    made = [(model, *bodies_and_robots(model)) for model, _ in models]
    robots = [(model, placed) for model, _, of_model in made for placed in of_model]
    if len(robots) != 1:
        names = listing(placed.robot.name for _, placed in robots)
        what = f"it has {len(robots)} robots: {names}" if robots else "no joint in it holds links together"
        raise SceneError(f"{what}; load the file as a scene", path=reading.path)
    robot = _with_srdf(robots[0][1].robot, reading.path, srdf)
    robot.notes += [f"{reading.path.name}: {note}" for note in dict.fromkeys(reading.notes)]
    if around := [f"{model.name}::{body.name}" for model, bodies, _ in made for body in bodies]:
        robot.notes.append(
            f"{reading.path.name}: what stands around is no part of the robot: {listing(around)} (a scene loaded from "
            "the file has it)"
        )
    reading.add_time(seconds, started)
    return robot


def _with_srdf(robot: Robot, path: Path, srdf) -> Robot:
    """The robot with what its SRDF says besides: pairs never tested, and states."""
    file = find_srdf(path, robot.name, srdf)
    if file is None:
        return robot
    semantics = read_srdf(file, list(robot.links), [joint.name for joint in robot.joints])
    return Robot(
        robot.name, robot.links, robot.joints, robot.geometry,
        semantic_pairs=[*(robot.semantic_pairs or ()), *semantics.pairs], states=semantics.states,
        notes=[*robot.notes, *semantics.notes], missing_meshes=robot.missing_meshes,
        sources=[*robot.sources, str(file)],
    )


def _place(scene: Scene, model: Model, robot: Robot, placed: Placed, X_WM: np.ndarray, prefix: str) -> None:
    X_WR = X_WM if is_identity(placed.X_MR) else X_WM @ placed.X_MR
    placement = scene.place_robot(robot.renamed(prefix), X_WR, name=robot.name, mobile=placed.mobile)
    for name, (link, _) in placement.carried.items():
        body = scene.body(name)
        body.group = body.mask = model.links[link.removeprefix(prefix)].bits


class _File:
    """One file while its scopes are made, those of the files that it includes with them."""

    def __init__(self, reading: Reading):
        self.reading = reading
        self.included: list[Path] = []

    def read(self) -> tuple[Scope, list[tuple[Model, np.ndarray]]]:
        """The world, or what stands for it, and its models with their poses X_WM."""
        path = self.reading.path
        root = parse_xml(path, self.reading.notes)
        if not is_sdf(root):
            self.reading.fail(f"<{root.tag}>", "the outermost element of an SDFormat file is <sdf>")
        version = root.get("version", "")
        worlds = [root] if root.tag == "world" else root.findall("world")
        if len(worlds) > 1:
            names = listing(world.get("name", "") for world in worlds)
            self.reading.fail("<sdf>", f"has {len(worlds)} worlds, {names}: a file for each of them can be read")
        if worlds:
            around = worlds[0]
        else:
            around = ET.Element("world")
            around.extend([root] if root.tag == "model" else root.findall("model"))
        scope = self._scope(around.get("name") or path.stem, around, self.reading, version, 0)
        models = [(read_model(model), scope.X_SF(name, f'model "{cut(name)}"')) for name, model in scope.models.items()]
        if not models:
            self.reading.fail(f"<{root.tag}>", "has no <model>")
        if not worlds and len(models) == 1:
            scope.name = models[0][0].name
        return scope, models

    def _scope(self, name: str, element: ET.Element, reading: Reading, version: str, depth: int) -> Scope:
        scope = Scope(
            name, element, reading, element, element.get("placement_frame") or None,
            is_true(text_of(element, "static", "false")), _numbers(version) or NEWEST,
        )
        place = f'{element.tag} "{cut(name)}"'
        if depth > DEEPEST:
            reading.fail(place, f"models are in one another more than {DEEPEST} deep")
        for child in element:
            if child.tag in _FRAMES and (child.tag != "joint" or element.tag == "model"):
                self._add(scope, child, place)
            elif child.tag == "model":
                self._add_model(scope, child, child.get("name"), reading, version, depth, place)
            elif child.tag == "include":
                self._include(scope, child, depth, place)
            elif child.tag in _UNREAD and element.tag == "world":
                reading.notes.append(f"{place}: {_UNREAD[child.tag]} NOT read")
        return scope

    def _add(self, scope: Scope, child: ET.Element, place: str) -> None:
        name = child.get("name")
        if not name:
            scope.reading.fail(place, f'<{child.tag}> needs a name="..."')
        self._check_free(scope, name, place)
        scope.frames[name] = child

    def _check_free(self, scope: Scope, name: str, place: str) -> None:
        if name in scope.frames or name in scope.models:
            scope.reading.fail(place, f'the name "{cut(name)}" is used twice: rename one')
        if "::" in name or (name.startswith("__") and name.endswith("__")):
            scope.reading.fail(place, f'"{cut(name)}" is no name: it has a meaning in SDFormat')

    def _add_model(
        self, scope: Scope, element: ET.Element, name: str | None, reading: Reading, version: str, depth: int,
        place: str,
    ) -> Scope:
        if not name:
            scope.reading.fail(place, '<model> needs a name="..."')
        if name in scope.models and scope.element.tag == "world":
            name = free_name(name, dict.fromkeys(scope.models, 1))
            scope.reading.notes.append(f"{place}: the name of a model is used twice; one was called {cut(name)}")
        self._check_free(scope, name, place)
        model = self._scope(name, element, reading, version, depth + 1)
        model.static |= scope.static and scope.element.tag == "model"
        scope.models[name] = model
        return model

    # --- includes -------------------------------------------------------------------------------

    def _include(self, scope: Scope, include: ET.Element, depth: int, place: str) -> None:
        """A model of another file, with the name, pose and placement that the include gives it."""
        uri = text_of(include, "uri")
        if not uri:
            scope.reading.fail(place, "<include> needs <uri>")
        if is_true(include.get("merge", "false")):
            scope.reading.fail(place, f'<include merge="true"> of {cut(uri)} is not read: include it without merge')
        file = self._included_file(uri, scope.reading, place)
        self.included.append(file)
        if len(self.included) > MAX_INCLUDED or depth >= DEEPEST:
            scope.reading.fail(place, f"with this the file includes more than {MAX_INCLUDED:,} others")
        reading = scope.reading.beside(file)
        root = parse_xml(file, reading.notes)
        models = [root] if root.tag == "model" else root.findall("model") if is_sdf(root) else []
        if len(models) != 1:
            what = f"{len(models)} models" if models else "no <model> of SDFormat"
            scope.reading.fail(place, f"the included file {file} has {what}; it must have one")
        name = text_of(include, "name") or models[0].get("name")
        model = self._add_model(scope, models[0], name, reading, root.get("version", ""), depth, place)
        if include.find("pose") is not None:
            model.placed_by = include
            model.frame_of_pose = text_of(include, "placement_frame") or model.frame_of_pose
        if include.find("static") is not None:
            model.static = is_true(text_of(include, "static"))

    def _included_file(self, uri: str, reading: Reading, place: str) -> Path:
        """The file that a URI names: itself, or of a folder the one that its model.config names."""
        if Path(uri).suffix.lower() in (".sdf", ".world", ".urdf", ".xml"):
            return resources.find(uri, reading.path, reading.package_path, element=place)
        folder, where = uri.rstrip("/"), reading.package_path
        try:
            config = resources.find(f"{folder}/model.config", reading.path, where, element=place)
        except resources.NotFound:
            return resources.find(f"{folder}/model.sdf", reading.path, where, element=place)
        named = sorted(parse_xml(config, []).findall("sdf"), key=lambda entry: _numbers(entry.get("version", "")))
        files = [config.parent / name for entry in named if (name := (entry.text or "").strip())]
        if not files or not is_file(files[-1]):
            reading.fail(place, f"{config} names no SDFormat file that is there")
        return files[-1]


def _numbers(version: str) -> tuple[int, ...]:
    """The numbers of a version, to be compared; none of what is no version."""
    words = version.split(".")
    return tuple(map(int, words)) if all(word.isdigit() for word in words) else ()
