"""A robot of a scene, asked through a World, one configuration after the other."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.errors import InvalidArgument
from collide.robot import Robot
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

    @classmethod
    def from_scene(cls, scene, name=None):
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
