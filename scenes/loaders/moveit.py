"""MoveIt planning scenes: a robot by name, obstacles, an allowed-collision matrix, start and goal.

``sceneNNNN.yaml`` holds the scene; ``requestNNNN.yaml`` beside it, where there is one, gives the
states "start" and "goal". The robot's URDF is not in these files: it is given, or looked for in
``robots/`` folders near the scene.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from collide.base.given_files import head
from collide.errors import InvalidPose, InvalidShape, SceneError, brief, listing
from collide.robots.robot import Robot
from collide.scenes.description import Scene, SceneBody
from collide.scenes.loaders.documents import read_document
from collide.scenes.loaders.fields import Fields, did_you_mean, placed
from collide.scenes.loaders.mesh_shapes import inline_shape
from collide.scenes.loaders.robot_file import load_robot
from collide.scenes.loaders.states import state_of
from collide.shapes.compound import Compound
from collide.shapes.octree import OcTree
from collide.shapes.primitives import Box, Cone, Cylinder, Halfspace, Sphere
from collide.shapes.shape import Shape
from collide.transforms import as_poses, pose

ALLOWED = "allowed by the scene"
#: shape_msgs/SolidPrimitive: type -> (name, how many dimensions)
_TYPES = {1: "box", 2: "sphere", 3: "cylinder", 4: "cone"}
_DIMENSIONS = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2}


def is_planning_scene(data: Any) -> bool:
    return isinstance(data, dict) and "robot_model_name" in data


def load_planning_scene(
    path: Path, data: Mapping[str, Any], *, robot=None, srdf=None, meshes: str = "mesh",
    package_path: Iterable = (), missing_meshes: str = "error",
) -> Scene:
    """The scene of a planning-scene document.

    robot : a `Robot` or the path of its file; None looks for it near the scene file.
    """
    fields = Fields(data, path)
    scene = Scene(fields.text("name") if data.get("name") else path.stem, sources=[str(path)])
    model = fields.text("robot_model_name")
    if not isinstance(robot, Robot):
        file = Path(robot) if robot is not None else find_robot(model, path)
        robot = load_robot(
            file, srdf, meshes=meshes, package_path=package_path, missing_meshes=missing_meshes, seconds=scene.seconds
        )
    if robot.name != model:
        scene.notes.append(f"{path.name} was made for robot {model}; the URDF given describes {robot.name}")
    states, X_WR = _read_states(fields, robot, scene)
    start = {**states.get("scene", {}), **states.get("start", {})}
    scene.place_robot(robot, X_WR, start, name=robot.name, allowed=())
    # MoveIt's goal constrains the planned joints; the others stay as at the start.
    scene.states.update(
        {name: {**states.get("scene", {}), **states.get("start", {}), **joints} for name, joints in states.items()}
    )
    frames = _Frames(fields, scene, robot)
    _add_objects(fields, scene, frames, meshes)
    _add_octomap(fields, scene, frames)
    _add_attached(fields, scene, robot, meshes)
    _allow_pairs(fields, scene, robot)
    _note_what_is_ignored(fields, scene)
    return scene


# --- the robot -----------------------------------------------------------------------------------


def find_robot(model: str, scene_path: Path) -> Path:
    """The URDF of a robot called ``model`` in a ``robots/`` folder near the scene or the current directory.

    By name first, ``robots/MODEL/MODEL.urdf`` or ``robots/MODEL/urdf/MODEL.urdf``; else any URDF
    directly in ``robots/*/`` that says it describes ``model``, the one with an SRDF beside it before others.
    """
    places = [*scene_path.resolve().parents, Path.cwd(), *Path.cwd().parents]
    folders = [folder for folder in dict.fromkeys(place / "robots" for place in places) if folder.is_dir()]
    for folder in folders:
        for candidate in (folder / model / f"{model}.urdf", folder / model / "urdf" / f"{model}.urdf"):
            if os.path.isfile(candidate):  # which says no to names that are too long, where Path raises
                return candidate
    for folder in folders:
        matching = [file for file in sorted(folder.glob("*/*.urdf")) if _described_robot(file) == model]
        if matching:
            return min(matching, key=lambda file: (not file.with_suffix(".srdf").is_file(), len(file.name)))
    searched = ", ".join(map(str, folders)) or "no folder called robots above the scene file or the current directory"
    raise SceneError(
        f"it needs the URDF of robot {brief(model)}, which is not in the file and was not found ({searched}); "
        "say where it is with robot= (--robot path.urdf)",
        path=scene_path, element="robot_model_name",
    )


def _described_robot(file: Path) -> str | None:
    """The name in a URDF's <robot> tag, from its first bytes."""
    start = head(file, 4096).decode("utf-8", errors="replace")
    tag = re.search(r"<robot\b[^>]*?\bname\s*=\s*[\"']([^\"']*)", start)
    return tag.group(1) if tag else None


# --- states --------------------------------------------------------------------------------------


def _read_states(fields: Fields, robot: Robot, scene: Scene) -> tuple[dict[str, dict[str, float]], np.ndarray]:
    """The states "scene", "start" and "goal", where there are such, and the pose of the robot's root."""
    states: dict[str, dict[str, float]] = {}
    X_WR = np.eye(4)
    if isinstance(fields.get("robot_state"), dict):
        states["scene"], X_WR = _robot_state(
            Fields(fields.get("robot_state"), fields.path, "robot_state"), robot, scene, X_WR
        )
    request = _request_file(Path(str(fields.path)))
    if request is not None:
        scene.sources.append(str(request))
        asked = Fields(read_document(request), request)
        if isinstance(asked.get("start_state"), dict):
            states["start"], X_WR = _robot_state(
                Fields(asked.get("start_state"), request, "start_state"), robot, scene, X_WR
            )
        for k, (goal, place) in enumerate(asked.items("goal_constraints")):
            values = _goal(Fields(goal, request, place))
            if values:
                states["goal" if k == 0 else f"goal_{k + 1}"] = values
    return states, X_WR


def _request_file(path: Path) -> Path | None:
    request = path.with_name(path.name.replace("scene", "request", 1))
    return request if request != path and request.is_file() else None


def _robot_state(state: Fields, robot: Robot, scene: Scene, X_WR: np.ndarray) -> tuple[dict[str, float], np.ndarray]:
    """Joint values the robot knows, and where a virtual joint puts its root."""
    values = state_of(state.get("joint_state") or {}, state.path, state.place("joint_state"))
    known = {joint.name for joint in robot.joints} | set(robot.joint_names)
    strangers = [joint for joint in values if joint not in known]
    if strangers and len(strangers) == len(values):
        state.fail(
            f"none of the joints {listing(strangers)} is known; robot {robot.name} has {listing(robot.joint_names)}"
        )
    if strangers:
        scene.notes.append(
            f"{Path(str(state.path)).name}: joints that robot {robot.name} does not have: {listing(strangers)}"
        )
    multi = state.get("multi_dof_joint_state")
    if isinstance(multi, dict) and multi.get("joint_names"):
        transforms = Fields(multi, state.path, state.place("multi_dof_joint_state")).items("transforms")
        if transforms:
            X_WR = _transform(Fields(*_swap(transforms[0], state.path)))
    return {joint: value for joint, value in values.items() if joint in known}, X_WR


def _goal(goal: Fields) -> dict[str, float]:
    values = {}
    for entry, place in goal.items("joint_constraints"):
        constraint = Fields(entry, goal.path, place)
        values[constraint.text("joint_name")] = constraint.number("position")
    return values


# --- frames and poses ------------------------------------------------------------------------------


def _swap(entry: tuple[Any, str], path: object) -> tuple[Any, object, str]:
    return entry[0], path, entry[1]


def _vector(fields: Fields, key: str, names: str) -> np.ndarray:
    """A list of numbers, or a mapping of the letters in ``names`` to numbers."""
    value = fields.get(key)
    if isinstance(value, dict):
        inner = fields.sub(key, tuple(names))
        return np.array([inner.number(name, 0.0) for name in names])
    return fields.numbers(key, (len(names),))


def _pose(fields: Fields, position: str = "position", orientation: str = "orientation") -> np.ndarray:
    """A geometry_msgs Pose; a quaternion of zeros means no rotation, as MoveIt takes it."""
    p = _vector(fields, position, "xyz") if position in fields else np.zeros(3)
    q = _vector(fields, orientation, "xyzw") if orientation in fields else np.zeros(4)
    try:
        return pose(p, quat_wxyz=q[[3, 0, 1, 2]]) if q.any() else pose(p)
    except InvalidPose as error:
        raise InvalidPose(placed(error, fields.path, fields.element)) from None


def _transform(fields: Fields) -> np.ndarray:
    return _pose(fields, "translation", "rotation")


class _Frames:
    """Poses of the frames that objects may be given in."""

    def __init__(self, fields: Fields, scene: Scene, robot: Robot):
        placement = scene.placements[robot.name]
        X_WLs = robot.link_poses(placement.q, placement.X_WR)[0]
        self.known = {"": np.eye(4), "world": np.eye(4)}
        self.known.update(zip(robot.links, X_WLs))
        for entry, place in fields.items("fixed_frame_transforms"):
            stamped = Fields(entry, fields.path, place)
            if isinstance(stamped.get("transform"), dict):
                X = _transform(Fields(stamped.get("transform"), fields.path, place + ".transform"))
                self.known[str(stamped.get("child_frame_id", ""))] = X
                header = stamped.get("header")
                if isinstance(header, dict):
                    self.known.setdefault(str(header.get("frame_id", "")), np.eye(4))

    def pose(self, fields: Fields) -> np.ndarray:
        header = fields.get("header")
        frame = str(header.get("frame_id") or "") if isinstance(header, dict) else ""
        frame = frame.lstrip("/")
        if frame not in self.known:
            fields.fail(
                f"unknown frame {brief(frame)}; known are {listing(filter(None, self.known))}", "header.frame_id"
            )
        return self.known[frame]


# --- obstacles -----------------------------------------------------------------------------------


def _add_objects(fields: Fields, scene: Scene, frames: _Frames, meshes: str) -> None:
    world = fields.sub("world", ()) if isinstance(fields.get("world"), dict) else None
    for entry, place in world.items("collision_objects") if world else ():
        thing = Fields(entry, fields.path, place)
        name = thing.text("id")
        thing.named(name)
        if thing.get("operation", 0) in (1, "REMOVE", "remove"):
            continue
        X_WO = frames.pose(thing) @ (
            _pose(thing.sub("pose", ("position", "orientation"))) if thing.get("pose") else np.eye(4)
        )
        shape, X_OS, approximation = object_shape(thing, meshes)
        scene.add(
            SceneBody(
                name, shape, _in_world(X_WO @ X_OS, thing), static=True, source=f"{fields.path}: {thing.element}",
                approximation=approximation
            )
        )


def _add_octomap(fields: Fields, scene: Scene, frames: _Frames) -> None:
    """The map of a sensed world, under MoveIt's name for it."""
    world = fields.sub("world", ()) if isinstance(fields.get("world"), dict) else None
    placed_map = world.sub("octomap", ()) if world is not None and isinstance(world.get("octomap"), dict) else None
    cells = placed_map.get("octomap") if placed_map is not None else None
    if placed_map is None or not isinstance(cells, dict) or not cells.get("data"):
        return
    X_WO = frames.pose(placed_map)
    if placed_map.get("origin"):
        X_WO = X_WO @ _pose(placed_map.sub("origin", ("position", "orientation")))
    try:
        tree = OcTree.from_message(cells)
    except InvalidShape as error:
        if "leaves is occupied" in str(error):
            scene.notes.append(f"{Path(str(fields.path)).name}: no cell of the octomap is occupied")
            return
        raise InvalidShape(placed(error, fields.path, "world.octomap.octomap")) from None
    place = _in_world(X_WO, placed_map)
    scene.add(SceneBody("<octomap>", tree, place, static=True, source=f"{fields.path}: world.octomap"))


def _in_world(X_WB: np.ndarray, thing: Fields) -> np.ndarray:
    """A pose that was multiplied together; InvalidPose names the object where it left the range of numbers."""
    try:
        return as_poses(X_WB, "its pose in the world")[0]
    except InvalidPose as error:
        raise InvalidPose(placed(error, thing.path, thing.element)) from None


def object_shape(thing: Fields, meshes: str = "mesh") -> tuple[Shape, np.ndarray, str | None]:
    """The shape of a collision object, its pose in the object, and its approximation; several make a compound.

    meshes : "mesh" takes triangles as they are, anything else the hull of their vertices.
    """
    items: list[tuple[Shape, np.ndarray]] = []
    about: list[str] = []
    for kind, poses, make in (
        ("primitives", "primitive_poses", _primitive),
        ("meshes", "mesh_poses", lambda fields: _inline_mesh(fields, meshes)),
        ("planes", "plane_poses", _plane),
    ):
        places = thing.items(poses)
        for k, (entry, place) in enumerate(thing.items(kind)):
            try:
                shape, approximation = make(Fields(entry, thing.path, place))
            except InvalidShape as error:
                raise InvalidShape(placed(error, thing.path, place)) from None
            X = (
                _pose(Fields(places[k][0], thing.path, f"{thing.element}.{poses}[{k}]"))
                if k < len(places)
                else np.eye(4)
            )
            items.append((shape, X))
            about += [approximation] if approximation else []
    if not items:
        thing.fail("has no primitives, meshes or planes")
    if len(items) == 1:
        return items[0][0], items[0][1], about[0] if about else None
    return Compound(items), np.eye(4), "; ".join(about) or None


def _primitive(fields: Fields) -> tuple[Shape, str | None]:
    kind = fields.get("type")
    name = _TYPES.get(kind) if isinstance(kind, int) else str(kind).lower()
    if name not in _DIMENSIONS:
        fields.fail(
            f"unknown primitive {brief(kind)}{did_you_mean(kind, _DIMENSIONS)}; known are {', '.join(_DIMENSIONS)}",
            "type",
        )
    size = fields.numbers("dimensions", (_DIMENSIONS[name],))
    if name == "box":
        return Box(size), None
    if name == "sphere":
        return Sphere(size[0]), None
    return (Cylinder if name == "cylinder" else Cone)(size[1], size[0]), None  # height comes first


def _inline_mesh(fields: Fields, meshes: str) -> tuple[Shape, str | None]:
    vertices = fields.get("vertices")
    if isinstance(vertices, list) and vertices and isinstance(vertices[0], dict):
        points = np.array(
            [
                _vector(Fields({"p": v}, fields.path, f"{fields.element}.vertices[{k}]"), "p", "xyz")
                for k, v in enumerate(vertices)
            ]
        )
    else:
        points = fields.numbers("vertices", (None, 3))
    try:
        return inline_shape(points, _triangles(fields), meshes, fields.element)
    except SceneError as error:
        raise SceneError(error.what, path=fields.path, element=fields.element) from None


def _triangles(fields: Fields) -> np.ndarray:
    """(m, 3) ids; each triangle is a list of three or a shape_msgs/MeshTriangle. No triangles: a cloud of points."""
    indices = fields.get("triangles")
    if not indices:
        return np.zeros((0, 3), dtype=np.int64)
    if isinstance(indices, list) and isinstance(indices[0], dict):
        indices = [entry.get("vertex_indices") if isinstance(entry, dict) else None for entry in indices]
    faces = Fields({"triangles": indices}, fields.path, fields.element).numbers("triangles", (None, 3))
    if (faces != np.floor(faces)).any() or np.abs(faces).max() >= 2**31:
        fields.fail("must be whole numbers, the rows of vertices", "triangles")
    return faces.astype(np.int64)


def _plane(fields: Fields) -> tuple[Shape, str | None]:
    """a·x + b·y + c·z + d = 0, the solid behind the normal (a, b, c)."""
    a, b, c, d = fields.numbers("coef", (4,))
    return Halfspace((a, b, c), -d), None


def _add_attached(fields: Fields, scene: Scene, robot: Robot, meshes: str) -> None:
    """Objects that a link carries: they move with it and may touch the links named."""
    state = fields.get("robot_state")
    if not isinstance(state, dict):
        return
    for entry, place in Fields(state, fields.path, "robot_state").items("attached_collision_objects"):
        attached = Fields(entry, fields.path, place)
        link = attached.text("link_name")
        if link not in robot.links:
            attached.fail(f"unknown link {brief(link)}; robot {robot.name} has {listing(robot.links)}", "link_name")
        thing = attached.sub("object", ())
        name = thing.text("id")
        X_LO = _pose(thing.sub("pose", ("position", "orientation"))) if thing.get("pose") else np.eye(4)
        shape, X_OS, approximation = object_shape(thing, meshes)
        body = SceneBody(name, shape, np.eye(4), source=f"{fields.path}: {thing.element}", approximation=approximation)
        scene.carry(robot.name, link, body, X_LO @ X_OS)
        for toucher in dict.fromkeys((link, *attached.words("touch_links"))):
            if toucher in robot.geometry:
                scene.allowed.append((name, toucher, "attached to the link"))


# --- the allowed-collision matrix -------------------------------------------------------------------


def _allow_pairs(fields: Fields, scene: Scene, robot: Robot) -> None:
    """The matrix decides, where there is one; links welded together are never tested.

    A matrix that MoveIt wrote names every link of the robot it was made for. About links of this
    robot that it does not name it says nothing: there the robot's own pairs hold, which is noted.
    """
    names = [body.name for body in scene.bodies]
    pairs: dict[tuple[str, str], str] = {}
    disabled_pairs = robot.disabled_pairs
    matrix = (
        fields.sub("allowed_collision_matrix", ()) if isinstance(fields.get("allowed_collision_matrix"), dict) else None
    )
    if matrix is not None and matrix.get("entry_names"):
        pairs.update({pair: ALLOWED for pair in matrix_pairs(matrix, names)})
        named = {*matrix.words("entry_names"), *matrix.words("default_entry_names")}
        strangers = [link for link in robot.links if link in robot.geometry and link not in named]
        disabled_pairs = [(a, b, reason) for a, b, reason in disabled_pairs if a in strangers or b in strangers]
        if disabled_pairs:
            scene.notes.append(
                f"{Path(str(fields.path)).name}: the allowed-collision matrix does not name {listing(strangers)}; "
                "for these the pairs that the robot itself disables hold"
            )
    for a, b, reason in (*disabled_pairs, *robot.rigid_pairs):
        if (b, a) not in pairs:
            pairs.setdefault((a, b), reason)
    scene.allowed += [(a, b, reason) for (a, b), reason in pairs.items()]


def matrix_pairs(matrix: Fields, names: list[str]) -> list[tuple[str, str]]:
    """Pairs of bodies, in the order of ``names``, that the matrix allows.

    An entry for the pair decides; else the defaults of its members, of which a False wins.
    """
    entries = matrix.words("entry_names")
    rows: list[Any] = [row.get("enabled") if isinstance(row, dict) else row for row, _ in matrix.items("entry_values")]
    if len(rows) != len(entries) or any(not isinstance(row, list) or len(row) != len(entries) for row in rows):
        matrix.fail(
            f"must hold {len(entries)} rows of {len(entries)} values, one for each of entry_names", "entry_values"
        )
    default_names = matrix.words("default_entry_names")
    default_values = [value for value, _ in matrix.items("default_entry_values")]
    if len(default_names) != len(default_values):
        matrix.fail(f"must hold one value for each of {len(default_names)} default_entry_names", "default_entry_values")
    index = {name: k for k, name in enumerate(entries)}
    default = dict(zip(default_names, map(bool, default_values)))
    allowed = []
    for k, a in enumerate(names):
        for b in names[k + 1 :]:
            if a in index and b in index:
                decided = bool(rows[index[a]][index[b]]) or bool(rows[index[b]][index[a]])
            else:
                votes = [default[name] for name in (a, b) if name in default]
                decided = bool(votes) and all(votes)
            if decided:
                allowed.append((a, b))
    return allowed


def _note_what_is_ignored(fields: Fields, scene: Scene) -> None:
    for key, neutral in (("link_padding", 0), ("link_scale", 1)):
        for entry, _ in fields.items(key):
            value = entry.get("padding" if key == "link_padding" else "scale") if isinstance(entry, dict) else None
            if value not in (None, neutral):
                scene.notes.append(f"{key} of {entry.get('link_name')} is {brief(value)}: not applied")


