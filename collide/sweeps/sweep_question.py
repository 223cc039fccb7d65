"""The question of a sweep, as sent to the answering process: a robot among bodies, or scene after scene."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from collide.base.given_files import LARGEST_MESH, read_bytes
from collide.errors import CollideError, InvalidArgument, SceneError
from collide.robots.robot import Robot
from collide.robots.robot_checker import RobotChecker
from collide.sweeps.content_digest import digest

#: Scenes that a worker keeps loaded.
_MAX_LOADED = 4
#: Files print limits and values with rounded digits.
_SLACK = 1e-9


class Chunk(NamedTuple):
    """Rows start to stop of a sweep.

    blocks : (scene, block of configurations, or ``None`` for the scene's own), in sequence.
    """

    number: int
    start: int
    stop: int
    blocks: Sequence[tuple[int, Any]]

    def __str__(self) -> str:
        return f"chunk {self.number}, rows {self.start:,} to {self.stop - 1:,}"


class Checker(Protocol):
    """What answers about configurations: `collide.RobotChecker`, or what has these three."""

    robot: Robot

    def collides(self, Q: np.ndarray) -> np.ndarray:
        """(N,) bool."""

    def distances(self, Q: np.ndarray) -> Any:
        """Least distances, with the names of the bodies."""


class OneQuestion:
    """A checker, asked about every configuration.

    checker : see `Checker`.   distances : least distances are wanted, too.   values : the configurations are kept.
    """

    def __init__(self, checker: Any, distances: bool = False, values: bool = False):
        self.checker, self.distances, self.values = checker, distances, values

    @property
    def robot(self) -> Robot:
        """Whose configurations these are."""
        return self.checker.robot

    def answer(self, chunk: Chunk) -> dict[str, Any]:
        """The columns of a chunk; see docs/sweeps.md."""
        ((_, block),) = chunk.blocks
        columns = answer_rows(self.checker, block.of(self.robot), self.distances, self.values)
        return {"row": np.arange(chunk.start, chunk.stop), **columns}


class ScenesQuestion:
    """Scene files, each asked about every configuration, or about its own.

    paths : scene files.   options : of the loader.   make_checker : (path, options) → (checker, (dof,) configuration
    of its robot).
    """

    def __init__(
        self, paths: list[str], options: dict[str, Any], make_checker: Any, distances: bool = False,
        values: bool = False,
    ):
        self.paths, self.options, self.make_checker = paths, options, make_checker
        self.distances, self.values = distances, values
        self.digests = [file_digest(path) for path in paths]
        self._loaded: OrderedDict[int, tuple[Any, np.ndarray]] = OrderedDict()

    def __getstate__(self) -> dict:
        return {**vars(self), "_loaded": OrderedDict()}

    def checker(self, scene: int) -> tuple[Any, np.ndarray]:
        """The checker of a scene, and the scene's own configuration."""
        if scene not in self._loaded:
            place = self.paths[scene]
            self._refuse_change(scene)
            self._loaded[scene] = self.make_checker(place, self.options)
            self._refuse_change(scene)
            while len(self._loaded) > _MAX_LOADED:
                self._loaded.popitem(last=False)
        self._loaded.move_to_end(scene)
        return self._loaded[scene]

    def _refuse_change(self, scene: int) -> None:
        if file_digest(self.paths[scene]) != self.digests[scene]:
            raise SceneError(CHANGED, path=self.paths[scene])

    def answer(self, chunk: Chunk) -> dict[str, Any]:
        """The columns of a chunk, scene after scene."""
        pieces, names = [], []
        for scene, block in chunk.blocks:
            checker, q = self.checker(scene)
            Q = q[None] if block is None else block.of(checker.robot)
            pieces.append(answer_rows(checker, Q, self.distances, self.values))
            names += [self.paths[scene]] * len(Q)
        columns: dict[str, Any] = {"row": np.arange(chunk.start, chunk.stop), "scene": names}
        for key in pieces[0]:
            if any(key not in piece for piece in pieces):
                place = self.paths[chunk.blocks[0][0]]
                raise InvalidArgument(f"{place} and others are of different robots: no column {key}")
            columns[key] = _joined([piece[key] for piece in pieces])
        return columns


CHANGED = (
    "changed while the sweep ran: chunks that are done are of the scene as it was; run it again with --restart "
    "(restart=True), or put the file back"
)


def file_digest(path: str | Path) -> str:
    """Of the bytes of a file. Raises SceneError where it cannot be read."""
    return hashlib.sha256(read_bytes(Path(path), LARGEST_MESH, "scene")).hexdigest()[:32]


def _joined(values: list[Any]) -> Any:
    if isinstance(values[0], list):
        return [entry for piece in values for entry in piece]
    if isinstance(values[0], tuple):
        return tuple(np.concatenate([piece[k] for piece in values]) for k in range(2))
    return np.concatenate(values)


# --- rows ---------------------------------------------------------------------------------------


def answer_rows(checker: Any, Q: np.ndarray, distances: bool, values: bool) -> dict[str, Any]:
    """Columns about configurations: ``collides`` and whether answered, ``note``, and the other columns asked for.

    Rows with NaN or infinity, or outside the range of coordinates, are not answered; the note names the
    joint. Rows outside the limits are answered and noted.
    """
    robot: Robot = checker.robot
    notes = _notes(robot, Q)
    finite = np.isfinite(Q).all(axis=1)
    answered = np.zeros(len(Q), dtype=bool)
    collides = np.zeros(len(Q), dtype=bool)
    least = np.full(len(Q), np.nan)
    names: list[tuple[str, str] | None] = [None] * len(Q)
    for rows in _askable(checker, np.flatnonzero(finite), Q, notes):
        answered[rows] = True
        if distances:
            nearest = checker.distances(Q[rows])
            collides[rows], least[rows] = nearest.hit, nearest.distance
            for row, pair in zip(rows.tolist(), nearest.names):
                names[row] = pair
        else:
            collides[rows] = checker.collides(Q[rows])
    columns: dict[str, Any] = {"collides": (collides, answered)}
    if distances:
        columns["distance"] = least
        columns["body_a"], columns["body_b"] = ([pair and pair[k] for pair in names] for k in range(2))
    columns["note"] = notes
    if values:
        columns.update((name, Q[:, k].copy()) for k, name in enumerate(robot.joint_names))
    return columns


def _askable(checker: Any, rows: np.ndarray, Q: np.ndarray, notes: list[str | None]) -> list[np.ndarray]:
    """The rows with finite poses, in batches; forward kinematics refuses a whole batch for a row without."""
    if not len(rows):
        return []
    try:
        checker.robot.link_poses(Q[rows[(np.abs(Q[rows]) > 1e6).any(axis=1)]])
        return [rows]
    except CollideError:
        fine = []
        for row in rows.tolist():
            try:
                checker.robot.link_poses(Q[row])
                fine.append(row)
            except CollideError as error:
                notes[row] = str(error)
        return [np.array(fine, dtype=np.int64)] if fine else []


def _notes(robot: Robot, Q: np.ndarray) -> list[str | None]:
    """What is to be said of each row: joints that are not finite, or outside their limits."""
    notes: list[str | None] = [None] * len(Q)
    with np.errstate(invalid="ignore"):
        slack = _SLACK * np.maximum(1.0, np.abs(Q))
        below, above = robot.lower - slack > Q, robot.upper + slack < Q
    broken = ~np.isfinite(Q)
    for row in np.flatnonzero((below | above | broken).any(axis=1)).tolist():
        words = []
        for k in np.flatnonzero(below[row] | above[row] | broken[row]).tolist():
            name, value = robot.joint_names[k], Q[row, k]
            if broken[row, k]:
                words.append(f"{name} is {value:g}")
            else:
                words.append(f"{name} {value:.9g} outside [{robot.lower[k]:g}, {robot.upper[k]:g}]")
        notes[row] = "; ".join(words)
    return notes


def question_digest(checker: Any) -> str:
    """What of a checker decides its answers. Asked again while a sweep runs, it says whether the scene changed."""
    if not isinstance(checker, RobotChecker):
        return digest(checker.robot, *checker.state())
    checker.collides(np.zeros((0, checker.robot.dof)))  # makes the checker read its World
    setting = checker.setting
    around = setting.surroundings.bodies
    return digest(checker.robot, setting.bodies, setting.base, around, setting.self_pairs, setting.allowed)
