"""A World as the scene that reports and pages are made of: its bodies, filters and allowed pairs as they stand."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field

from collide.scenes.description import Scene, SceneBody
from collide.worlds.world import World


@dataclass
class SceneOfWorld(Scene):
    """A `Scene` whose World is a copy of one that is there already, with groups of 32 bits.

    tested : that World; it is copied again for every question, which may then allow pairs in it.
    """

    tested: World = field(default_factory=World)

    def world(self) -> World:
        world = copy.copy(self.tested)
        for a, b, reason in self.allowed:
            world.allow(a, b, reason=reason)
        return world


def scene_of_world(world: World, name: str) -> SceneOfWorld:
    """The scene of a World as it stands now; later changes of the World do not reach it. O(bodies + allowed pairs).

    name : of the scene.
    """
    tested = copy.copy(world)
    bodies = [tested.body(identity) for identity in tested.ids]
    names = tested.names
    return SceneOfWorld(
        name,
        [SceneBody(body.name, body.shape, body.X_WB, body.static, body.group, body.mask) for body in bodies],
        [(names[a], names[b], reason) for (a, b), reason in tested.allowed.items()],
        tested=tested,
    )
