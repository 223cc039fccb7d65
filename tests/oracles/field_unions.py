"""Fields as unions of what they are made of, item by item: a Compound answers the same questions in another way."""

from __future__ import annotations

import numpy as np

import collide

EYE = np.eye(4)
_CORNERS = np.array(list(np.ndindex(2, 2, 2)), dtype=bool)


def as_union(field: collide.Shape) -> collide.Compound:
    """Balls of a cloud, by row, or cells of a grid in ascending order."""
    if isinstance(field, collide.PointCloud):
        balls = zip(field.points, field.radii.tolist())
        return collide.Compound([(collide.ConvexHull(p[None], radius=r), EYE) for p, r in balls])
    shifts = bool((field.X[:3, :3] == np.eye(3)).all())
    shift, X = (field.X[:3, 3], EYE) if shifts else (np.zeros(3), field.X)
    low, high = field.cells * field.cell + shift, (field.cells + 1) * field.cell + shift
    return collide.Compound([(collide.ConvexHull(np.where(_CORNERS, h, l)), X) for l, h in zip(low, high)])


def random_grid(rng: np.random.Generator, most: int = 6) -> collide.VoxelGrid:
    """Few cells of an array or a list, at an integer place, shifted or turned; or leaves of an octree."""
    shape, how = rng.integers(1, most + 1, 3), rng.integers(4)
    occupied = rng.random(shape) < rng.choice([0.1, 0.5, 0.9])
    occupied.flat[rng.integers(occupied.size)] = True
    cell = float(rng.choice([0.1, 0.125, 0.3]))
    if how == 0:
        return collide.VoxelGrid(occupied, (cell, 0.1, 0.25), collide.pose(rng.uniform(-0.3, 0.3, 3)))
    if how == 1:
        return collide.VoxelGrid(np.argwhere(occupied) - rng.integers(0, 6, 3), cell)
    if how == 2:
        return collide.VoxelGrid(occupied, cell, collide.pose(rng.normal(size=3) * 0.2, rpy=rng.uniform(-3, 3, 3)))
    return collide.OcTree(random_leaves(rng, int(rng.integers(1, 4))), cell)


def random_leaves(rng: np.random.Generator, depth: int) -> collide.OcTreeLeaves:
    """Leaves of two cubes side by side, divided at random, some of them unknown; at least one is occupied."""
    leaves = [(-1, 0, 0, 0, 1.0)]

    def divide(x: int, y: int, z: int, exponent: int) -> None:
        if exponent == 0 or rng.random() < 0.3:
            if rng.random() < 0.85:
                leaves.append((x, y, z, exponent, float(rng.choice([-0.4, 0.85]))))
            return
        half = 1 << exponent - 1
        for i, j, k in np.ndindex(2, 2, 2):
            divide(x + half * i, y + half * j, z + half * k, exponent - 1)

    divide(0, 0, 0, depth)
    divide(0, 0, 1 << depth, depth)
    rows = np.array(leaves)
    return collide.OcTreeLeaves(rows[:, :3].astype(int), rows[:, 3].astype(int), rows[:, 4])
