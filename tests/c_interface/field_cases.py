"""Point clouds and voxel grids beside shapes of all kinds, in Python and in C, for tests of the C interface."""

from __future__ import annotations

import c_library as c
import numpy as np

import collide

EYE = np.eye(4)
#: Matrices of zeros and ones.
_TURNS = [np.eye(3), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])]
_PLANES = np.vstack([3.0 * np.eye(3), [[-1.0, -1.0, -3.0]]])  # corners at thirds


def shapes(random) -> list[collide.Shape]:
    """Of all kinds, about 0.3 m large, many of sizes that are eighths."""
    size, points, normal = random.integers(1, 5, 3) / 8.0, random.normal(size=(64, 3)), 1.0 * random.integers(-2, 3, 3)
    normal[2] += 0.5
    return [
        collide.Box(size), collide.Sphere(0.25), collide.Capsule(0.125, 0.25), collide.ConvexHull(0.2 * points),
        collide.Cylinder(0.125, 0.25), collide.Halfspace(normal, random.normal()),
        collide.Box(random.uniform(0.05, 0.5, 3)), collide.Cone(0.25, 0.25), collide.Ellipsoid((0.25, 0.125, 0.125)),
        collide.ConvexHull(0.15 * points[:20], radius=0.125), collide.ConvexHull(random.normal(size=(300, 3)) * 0.1),
        collide.HPolytope(_PLANES, 0.4 * np.ones(4)), collide.ConvexHull(points[:1] * 0.1),
    ]


def cloud_of(random) -> collide.PointCloud:
    """Few points on eighths or many anywhere; without a radius, with one, or one each."""
    grid = random.integers(-6, 7, (40, 3)) / 8.0
    points = [grid, np.repeat(grid[:8], 5, axis=0), random.normal(size=(400, 3)), random.normal(size=(1, 3))]
    chosen = points[random.integers(4)]
    radii = [0.0, 0.125, 0.05, random.integers(0, 3, len(chosen)) / 8.0]
    return collide.PointCloud(chosen, radii[random.integers(4)])


def grid_of(random) -> tuple[collide.VoxelGrid, np.ndarray]:
    """(grid, array) of some cells, at the origin or shifted."""
    occupied = random.random(random.integers(1, 20, 3)) < random.choice([0.02, 0.2, 0.9])
    occupied.flat[random.integers(occupied.size)] = True
    cell = (0.125, 0.125, 0.25) if random.random() < 0.5 else random.uniform(0.05, 0.3, 3)
    X = c.identity_at(*(random.integers(-8, 9, 3) / 8.0 if random.random() < 0.5 else random.normal(size=3)))
    return collide.VoxelGrid(occupied, cell, EYE if random.random() < 0.3 else X), occupied


def field_and_own(random, number: int) -> tuple[collide.Shape, c.CField]:
    if number % 2:
        cloud = cloud_of(random)
        return cloud, c.CField(cloud)
    grid, occupied = grid_of(random)
    return grid, c.CField(grid, occupied)


def poses_about(random, field) -> tuple[np.ndarray, np.ndarray]:
    """Quarter turns and eighths, where bodies are flush, or any; the shape about an item of the field."""
    X, Y = EYE.copy(), EYE.copy()
    items = field.points if isinstance(field, collide.PointCloud) else field.cells * field.cell + field.X[:3, 3]
    item = items[random.integers(len(items))]
    if random.random() < 0.5:
        X[:3, :3], Y[:3, :3] = _TURNS[random.integers(3)], _TURNS[random.integers(3)]
        X[:3, 3], beside = random.integers(-4, 5, 3) / 8.0, random.integers(-4, 5, 3) / 8.0
    else:
        X, Y = (collide.pose(random.normal(size=3), quat_wxyz=random.normal(size=4)) for _ in range(2))
        beside = random.normal(size=3) * random.choice([0.05, 0.3, 1.0])
    Y[:3, 3] = X[:3, :3] @ (item + beside) + X[:3, 3]
    return X, Y


def near_touching(random, field, shape, X, Y) -> np.ndarray:
    """The shape's pose moved to where it touches, but for a gap or an overlap of 1e-17 to 1e-6 m."""
    row = collide.distance(field, shape, X, Y, signed=False).rows[0]
    Y = Y.copy()
    Y[:3, 3] -= row["normal"] * (row["distance"] + random.choice([-1.0, 0.0, 1.0]) * 10.0 ** random.uniform(-17, -6))
    return Y


def cases(seed: int, n: int):
    """(name, field, shape, their handles, poses)."""
    for number in range(n):
        random = np.random.default_rng([seed, number])
        field, own = field_and_own(random, number)
        shape = shapes(random)[number // 2 % 13]
        X, Y = poses_about(random, field)
        if number % 3 == 0:
            Y = near_touching(random, field, shape, X, Y)
        yield f"case {number} of {seed}: {field!r}, {shape!r}", field, shape, own, c.CShape(shape), X, Y
