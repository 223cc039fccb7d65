"""Bodies that are far from their convex hulls, and robots among them: rings, shells, terrains, unions with meshes."""

from __future__ import annotations

import numpy as np
from naive import random_pose, rng_of
from random_robots import random_link_shape, random_robot

import collide


def torus(radius: float, tube: float, n: int = 8, m: int = 4) -> collide.Mesh:
    """A solid ring around z: its hull fills the hole."""
    u, v = np.meshgrid(2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m, indexing="ij")
    away = radius + tube * np.cos(v)
    corners = np.stack([away * np.cos(u), away * np.sin(u), tube * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    a, b = i * m + j, (i + 1) % n * m + j
    c, d = (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m
    return collide.Mesh(corners, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))


def shell(radius: float) -> collide.Mesh:
    """The lower half of a sphere as an open surface."""
    ball = collide.tessellate(collide.Sphere(radius), size=0.7 * radius)
    below = (np.asarray(ball.vertices)[ball.faces][:, :, 2] < 0.1 * radius).all(axis=1)
    return collide.Mesh(ball.vertices, np.asarray(ball.faces)[below], solid=False)


def hollow(rng, size: float) -> collide.Shape:
    """A body that is far from its convex hull, or one that is not."""
    kind = int(rng.integers(6))
    if kind == 0:
        return torus(size, 0.2 * size)
    if kind == 1:
        return shell(size)
    if kind == 2:
        return collide.HeightField(rng.uniform(-0.4, 0.4, (4, 5)) * size, cell=0.8 * size)
    if kind == 3:
        ring = torus(size, 0.2 * size), random_pose(rng, size)
        return collide.Compound([ring, (collide.Sphere(0.2 * size), np.eye(4))])
    if kind == 4:
        return collide.Compound([(collide.Box(0.4 * size * np.ones(3)), random_pose(rng, size)) for _ in range(2)])
    return random_link_shape(rng, 0.5 * size)


def hollow_scene(seed: int):
    """(robot, World) of few small links among large rings, shells and terrains."""
    rng = rng_of("hollow bodies", seed)
    of_links = hollow if seed % 2 else random_link_shape
    robot = random_robot(rng, n_links=4, shape=lambda rng, size: of_links(rng, size), size=0.06)
    world = collide.World()
    for k in range(5):
        world.add(hollow(rng, float(rng.uniform(0.3, 0.9))), random_pose(rng, 1.2), name=f"body{k}")
    if seed % 3 == 0:
        world.add(collide.Halfspace((0.1, 0.0, 1.0), -float(rng.uniform(0.6, 1.2))), name="ground")
    return rng, robot, world
