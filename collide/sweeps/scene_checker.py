"""A robot of a scene, asked through a World, one configuration after the other."""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import numpy as np

from collide.errors import InvalidArgument
from collide.robot import Robot
from collide.sweeps.content_digest import digest
from collide.sweeps.sweep_question import file_digest, question_digest
from collide.world import World


class LeastDistances(NamedTuple):
    """hit (N,) bool, distance (N,) [m], names: a pair of bodies a row."""

    hit: np.ndarray
    distance: np.ndarray
    names: list[tuple[str | None, str | None]]


class SceneChecker:
    def __init__(self, robot: Robot, X_WR: np.ndarray, world: World, carried: dict[str, tuple[str, np.ndarray]]):
        self.robot, self.X_WR, self.world, self.carried = robot, X_WR, world, carried

    def state(self) -> list[Any]:
        bodies = [self.world.body(identity) for identity in self.world.ids]
        others = [(b.name, b.shape, b.X_WB) for b in bodies if b.name not in self.carried]
        return [self.X_WR, {k: list(v) for k, v in self.carried.items()}, others]

    def _rows(self, Q):
        index = {link: k for k, link in enumerate(self.robot.links)}
        names = list(self.carried)
        for X_WLs in self.robot.link_poses(Q, self.X_WR):
            X = np.array([X_WLs[index[link]] @ X_LB for link, X_LB in self.carried.values()])
            self.world.set_poses(names, X)
            yield

    def collides(self, Q):
        return np.array([self.world.collides() for _ in self._rows(Q)], dtype=bool)

    def distances(self, Q):
        hit, least, pairs = [], [], []
        for _ in self._rows(Q):
            rows = self.world.distances()
            k = int(rows["distance"].argmin())
            hit.append(bool(rows["hit"].any())); least.append(float(rows["distance"][k])); pairs.append(rows.names[k])
        return LeastDistances(np.array(hit, bool), np.array(least), pairs)


def checker_of(scene: Any, name: str | None = None) -> SceneChecker:
    """What checks a robot of a scene among all else that is in it, as it stands.

    name : of the robot, where the scene has several.
    """
    if name is None and len(scene.placements) == 1:
        name = next(iter(scene.placements))
    if name not in scene.placements:
        what = f"has no robot {name!r}" if name is not None else "has several robots" if scene.placements else "has none"
        known = f": name one of {', '.join(scene.placements)}" if scene.placements else ": give a robot, or its URDF"
        raise InvalidArgument(f"scene {scene.name}: a sweep asks about one robot; it {what}{known}")
    placement = scene.placements[name]
    return SceneChecker(placement.robot, placement.X_WR, scene.world(), placement.carried)


def load_checker(place: str, options: dict[str, Any]) -> tuple[SceneChecker, np.ndarray]:
    """The checker of a scene file, and the configuration in which its robot is."""
    from collide.scenes import load

    scene = load(place, **options)
    checker = checker_of(scene)
    return checker, next(iter(scene.placements.values())).q


class SceneWatch:
    """A scene from files, and whether it is still the same: they are read again where they were written to.

    places, name, options : files, the robot, and what `collide.scenes.load` is told.
    """

    def __init__(self, places: list[str], name: str | None, options: dict[str, Any]):
        self._question = places, name, options
        self.checker, self._sources = self._load()
        self._digest, self._stamps = question_digest(self.checker), self._stamps_now()

    def _load(self) -> tuple[SceneChecker, list[str]]:
        from collide.scenes import load

        places, name, options = self._question
        scene = load(*places, **options)
        return checker_of(scene, name), scene.sources

    def _stamps_now(self) -> list[tuple[int, int] | None]:
        return [_stamp(source) for source in self._sources]

    def look(self, final: bool) -> str:
        """The digest of the scene as its files are now; meshes are looked at the last time only."""
        stamps = self._stamps_now()
        if final or stamps != self._stamps:
            self._digest, self._stamps = question_digest(self._load()[0]), stamps
        return self._digest


class FilesWatch:
    """Files by their bytes."""

    def __init__(self, files: list[str], options: dict[str, Any]):
        self._files, self._options = files, {key: str(value) for key, value in options.items()}
        self._stamps: list[tuple[int, int] | None] = []
        self._digest = ""

    def look(self, final: bool) -> str:
        """The digest of what the files hold now; they are read where they were written to."""
        stamps = [_stamp(file) for file in self._files]
        if stamps != self._stamps:
            self._digest = digest(self._options, [file_digest(file) for file in self._files])
            self._stamps = stamps
        return self._digest


def _stamp(file: str) -> tuple[int, int] | None:
    try:
        status = os.stat(file)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
