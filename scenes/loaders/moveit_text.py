"""MoveIt's .scene files: obstacles as text, as RViz and `PlanningScene::saveGeometryToStream` write them.

The first line is the scene's name. Each object begins with ``* NAME``; then, since MoveIt 1.1, its pose; how many
shapes it has, and of each its kind, its numbers, its pose in the object and its colour; then its subframes, where it
has a pose. A line with a dot ends the file. Lengths are metres, quaternions x, y, z, w.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NoReturn

import numpy as np

from collide.base.given_files import read_bytes
from collide.errors import InvalidPose, InvalidShape, SceneError, brief, cut
from collide.robots.robot import LinkShape
from collide.scenes.description import Scene, link_body
from collide.scenes.loaders.fields import placed
from collide.scenes.loaders.mesh_shapes import Taken, inline_shape
from collide.shapes.primitives import Box, Cone, Cylinder, Halfspace, Sphere
from collide.transforms import pose

#: Most shapes of an object, and corners and triangles of a mesh: counts are believed before their rows are read.
MAX_COUNT = 50_000_000
_LENGTHS = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2, "plane": 4}


def load_text_scene(path: Path, meshes: str = "mesh") -> Scene:
    """The scene of a .scene file: a body for each object, free to move.

    meshes : "mesh", or anything else for the hulls of their vertices. Raises SceneError, InvalidShape, InvalidPose
    naming file, line and object.
    """
    text = _Text(path)
    scene = Scene(text.line("the scene's name"), sources=[str(path)])
    while (line := text.line('"* NAME" of an object, or "." at the end')) != ".":
        if not line.startswith("*") or not line[1:].strip():
            text.fail(f'must be "* NAME" of an object, or "." at the end, got {brief(line)}')
        _add_object(scene, text, line[1:].strip(), meshes)
    return scene


def _add_object(scene: Scene, text: _Text, name: str, meshes: str) -> None:
    element = f'object "{cut(name)}"'
    has_pose = text.words_ahead() > 1
    X_WO = text.pose(element) if has_pose else np.eye(4)
    shapes = []
    for _ in range(text.count("how many shapes the object has", 1000)):
        kind, source = text.line("the kind of a shape"), f"{text.path}: {element}"
        try:
            shape, approximation = _shape(kind, text, meshes, element)
        except InvalidShape as error:
            raise InvalidShape(placed(error, text.path, element)) from None
        X_OS = text.pose(element)
        text.numbers(4, "a colour")
        shapes.append(LinkShape(shape, X_OS, approximation, source))
    for _ in range(text.count("how many subframes the object has", 1000) if has_pose else 0):
        text.line("the name of a subframe")
        text.pose(element)
    if not shapes:
        scene.notes.append(f"{text.path.name}: {element} has no shape: it is NOT checked")
        return
    body, X_OB = link_body(name, tuple(shapes))
    body.X_WB = X_WO @ X_OB if has_pose else X_OB
    scene.add(body)


def _shape(kind: str, text: _Text, meshes: str, element: str) -> Taken:
    if kind == "mesh":
        n, m = (text.count(what, MAX_COUNT) for what in ("how many vertices", "how many triangles"))
        vertices = text.numbers(3 * n, f"{n} vertices").reshape(-1, 3)
        faces = text.numbers(3 * m, f"{m} triangles").reshape(-1, 3)
        if (faces != np.floor(faces)).any():
            text.fail("a triangle must name its vertices by whole numbers")
        try:
            return inline_shape(vertices, faces.astype(np.int64), meshes, element)
        except SceneError as error:
            raise SceneError(error.what, path=text.path, element=element) from None
    if kind not in _LENGTHS:
        text.fail(f"unknown shape {brief(kind)}; known are {', '.join(_LENGTHS)} and mesh")
    numbers = text.numbers(_LENGTHS[kind], f"the numbers of a {kind}")
    if kind == "plane":  # a·x + b·y + c·z + d = 0, the solid behind the normal
        return Taken(Halfspace(numbers[:3], -numbers[3]), None)
    if kind == "box":
        return Taken(Box(numbers), None)
    if kind == "sphere":
        return Taken(Sphere(numbers[0]), None)
    return Taken((Cylinder if kind == "cylinder" else Cone)(numbers[0], numbers[1]), None)


class _Text:
    """The words of a file, line by line."""

    def __init__(self, path: Path):
        self.path = path
        try:
            self._lines = read_bytes(path).decode("utf-8").splitlines()
        except UnicodeDecodeError as error:
            raise SceneError(f"is no text: {error}", path=path) from None
        self._at, self._words = 0, []  # type: tuple[int, list[str]]

    def fail(self, what: str) -> NoReturn:
        raise SceneError(what, path=self.path, element=f"line {self._at}")

    def line(self, what: str) -> str:
        """The next line that is not blank. Raises SceneError where the file ends before."""
        if self._words:
            self.fail(f"expected {what}, got {brief(' '.join(self._words))}")
        self._fill(what)
        words, self._words = " ".join(self._words), []
        return words

    def words_ahead(self) -> int:
        """How many words the next line has."""
        self._fill("an object")
        return len(self._words)

    def numbers(self, count: int, what: str) -> np.ndarray:
        """(count,) finite numbers, in as many lines as they take."""
        values: list[float] = []
        while len(values) < count:
            self._fill(what)
            taken, self._words = self._words[: count - len(values)], self._words[count - len(values) :]
            try:
                values += map(float, taken)
            except ValueError:
                self.fail(f"{what} must be {count} finite numbers, got {brief(' '.join(taken))}")
        if not all(map(math.isfinite, values)):
            self.fail(f"{what} must be {count} finite numbers, got one that is not")
        return np.array(values)

    def count(self, what: str, max_count: int) -> int:
        number = self.numbers(1, what)[0]
        if number != math.floor(number) or not 0 <= number <= max_count:
            self.fail(f"{what} must be a whole number from 0 to {max_count:,}, got {number:g}")
        return int(number)

    def pose(self, element: str) -> np.ndarray:
        """(4, 4) from a translation and a quaternion; four zeros mean no rotation, as MoveIt takes them."""
        p, quat = self.numbers(3, "a translation"), self.numbers(4, "a quaternion x, y, z, w")
        try:
            return pose(p, quat_xyzw=quat) if quat.any() else pose(p)
        except InvalidPose as error:
            raise InvalidPose(placed(error, self.path, f"{element}, line {self._at}")) from None

    def _fill(self, what: str) -> None:
        while not self._words:
            if self._at == len(self._lines):
                self.fail(f"the file ends where {what} should stand")
            self._words, self._at = self._lines[self._at].split(), self._at + 1
