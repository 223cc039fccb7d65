"""What bodies look like where that is not what is tested: the visual meshes of robots, the meshes that hulls stand for.

For pictures alone: nothing here changes what is tested, and what cannot be read is left out with a note.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from collide.base.given_files import starts_like_xml
from collide.errors import CollideError, cut, listing
from collide.robots.robot import LinkShape, Robot
from collide.scenes.description import Placement, Scene
from collide.scenes.loaders.urdf import Reading, link_shapes
from collide.scenes.loaders.xml_text import parse_xml
from collide.shapes.shape import Shape


@dataclass
class Looks:
    """What bodies look like.

    shapes : body name → shapes and their poses X_BS (4, 4) in the frame of the body.   notes : for the reader.
    """

    shapes: dict[str, list[tuple[Shape, np.ndarray]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def visual_shapes(scene: Scene, *, whole: Scene | None = None, package_path: Iterable = ()) -> Looks:
    """What the bodies of a scene look like, where that differs from their shapes.

    Parameters
    ----------
    scene : Scene
        As it is tested.
    whole : Scene, optional
        The same scene with its meshes as they are: bodies that are approximations look like theirs of the same name.
    package_path : iterable of paths
        Folders in which ``package://`` names are looked for first.

    Returns
    -------
    Looks
        Without the bodies that look like their shape.
    """
    looks = Looks()
    if whole is not None:
        _look_whole(scene, whole, looks)
    read: dict[str, list[list[LinkShape] | None]] = {}
    for placement in scene.placements.values():
        path = _urdf_of(placement.robot)
        if path is not None:
            if str(path) not in read:
                read[str(path)] = _visuals(path, tuple(map(Path, package_path)), looks)
            _look_like_robot(placement, read[str(path)], looks)
    return looks


def _look_whole(scene: Scene, whole: Scene, looks: Looks) -> None:
    bodies, frames, whole_frames = {body.name: body for body in whole.bodies}, _frames(scene), _frames(whole)
    for body in scene.bodies:
        if body.approximation and body.name in bodies:
            X_BS = np.linalg.inv(frames[body.name]) @ whole_frames[body.name]
            looks.shapes[body.name] = [(bodies[body.name].shape, X_BS)]


def _frames(scene: Scene) -> dict[str, np.ndarray]:
    """Body name → its pose in the link that carries it, where one does, else in the world: the same in every state."""
    carried = {name: X_LB for placement in scene.placements.values() for name, (_, X_LB) in placement.carried.items()}
    return {body.name: carried.get(body.name, body.X_WB) for body in scene.bodies}


def _look_like_robot(placement: Placement, visuals: list[list[LinkShape] | None], looks: Looks) -> None:
    robot = placement.robot
    if len(visuals) != len(robot.links):  # the file is another one by now
        return
    at = {link: k for k, link in enumerate(robot.links)}
    for name, (link, X_LB) in placement.carried.items():
        elements = visuals[at[link]]
        if elements and name == link and link in robot.geometry:  # not a part that it carries
            X_BL = np.linalg.inv(X_LB)
            looks.shapes[name] = [(element.shape, X_BL @ element.X_LG) for element in elements]


def _urdf_of(robot: Robot) -> Path | None:
    """The URDF that a robot was read from; None where it comes from another file, or from none."""
    if not robot.sources:
        return None
    path = Path(robot.sources[0])
    return path if path.is_file() and starts_like_xml(path) else None


def _visuals(path: Path, package_path: tuple, looks: Looks) -> list[list[LinkShape] | None]:
    """The visual shapes of every link, in the order of the file; None of one whose visual cannot be read."""
    try:
        root = parse_xml(path, [])
    except CollideError:
        return []
    if root.tag != "robot":
        return []
    reading = Reading(path, package_path=package_path)
    unread: dict[str, str] = {}
    visuals: list[list[LinkShape] | None] = []
    for element in root.findall("link"):
        name = element.get("name") or ""
        try:
            visuals.append(link_shapes(element, name, reading, "visual"))
        except CollideError as error:
            unread[name] = str(error)
            visuals.append(None)
    if unread:
        first = next(iter(unread.values()))
        looks.notes.append(
            f"{path.name}: drawn as tested, for their visuals cannot be read: {listing(unread)} ({cut(first, 300)})"
        )
    return visuals
