"""Bodies that rest on floors, and poses as near to each other as those of a solver at rest."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import collide
from collide.transforms import pose

#: How far the bodies are above their floor [m].
WITHIN = (-1e-5, 0.0, 1e-7)
CORNERS = 0.5 * np.array([[x, y, z] for x in (-0.3, 0.3) for y in (-0.2, 0.2) for z in (-0.1, 0.1)])
FACETS = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
    [1, 5, 7], [1, 7, 3],
]
PRISM = [
    [0.15 * np.cos(a), 0.15 * np.sin(a), z] for a in 2 * np.pi * np.arange(12) / 12 for z in (-0.05, 0.05)
]


class Resting(NamedTuple):
    """A shape, where it rests on the plane z = 0, and how many contacts it has there."""

    shape: collide.Shape
    X_WB: np.ndarray
    n_contacts: int


AT = (0.013, 0.021, 0.05)
BODIES = {
    "box": Resting(collide.Box((0.3, 0.2, 0.1)), pose(AT), 4),
    "mesh": Resting(collide.Mesh(CORNERS, FACETS), pose(AT), 4),
    "hull": Resting(collide.ConvexHull(PRISM), pose(AT), 12),
    "can": Resting(collide.Cylinder(0.05, 0.1), pose(AT), 8),
    "can on its side": Resting(collide.Cylinder(0.05, 0.2), pose(AT, rpy=(np.pi / 2, 0, 0.3)), 2),
}


def _table(cells: int = 7, size: float = 2.0) -> collide.Mesh:
    """A flat surface of facets, z = 0."""
    ends = np.linspace(-size / 2, size / 2, cells + 1)
    vertices = [[x, y, 0.0] for y in ends for x in ends]
    corners = [j * (cells + 1) + i for j in range(cells) for i in range(cells)]
    below = [[a, a + 1, a + cells + 2] for a in corners]
    return collide.Mesh(vertices, below + [[a, a + cells + 2, a + cells + 1] for a in corners], solid=False)


FLOORS = {
    "plane": (collide.Halfspace((0, 0, 1), 0), np.eye(4)),
    "box": (collide.Box((2, 2, 0.2)), pose((0, 0, -0.1))),
    "hull": (collide.ConvexHull([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-0.2, 0)]), np.eye(4)),
    "mesh": (_table(), np.eye(4)),
    "height field": (collide.HeightField(np.zeros((41, 41)), 0.05), np.eye(4)),
}


def moved_poses(X_WB: np.ndarray, above: float, steps: int, seed: str) -> Iterator[np.ndarray]:
    """Poses of a body that rests: no point of it is moved by a micrometre from one to the next."""
    rng = np.random.default_rng([ord(letter) for letter in seed])
    for _ in range(steps):
        shift, turn = (rng.normal(size=3) for _ in range(2))
        shift *= rng.uniform(0.0, 2e-7) / np.linalg.norm(shift)
        turn *= rng.uniform(0.0, 1.5e-6) / np.linalg.norm(turn)  # of bodies that reach 0.19 m
        X = pose(X_WB[:3, 3] + shift, R=pose(rpy=turn)[:3, :3] @ X_WB[:3, :3])
        X[2, 3] += above
        yield X
