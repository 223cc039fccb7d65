"""Shapes of every kind invented from random numbers: sizes as people write them, or any, and poses of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from collide.scenes import families
from collide.scenes.families.ingredients import EXACT_ROTATIONS, rotation
from collide.shapes import (
    Box,
    Capsule,
    Compound,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    HeightField,
    HPolytope,
    Mesh,
    Shape,
    Sphere,
)
from collide.transforms import pose

Random = np.random.Generator


def length(rng: Random) -> float:
    """A length as people write it, or any [m]."""
    kind = rng.random()
    if kind < 0.4:
        return float(rng.choice([0.1, 0.2, 0.25, 0.3, 0.5, 1.0, 1.5, 2.0, 3.0]))
    if kind < 0.8:
        return float(round(rng.uniform(0.01, 2.0), 2)) or 0.5
    return float(10.0 ** rng.uniform(-3, 1.5))


def _box_mesh(size: np.ndarray) -> Mesh:
    corners = (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5) * size
    faces = [(0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 5, 1), (0, 4, 5), (2, 3, 7), (2, 7, 6), (0, 2, 6),
             (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    return Mesh(corners, faces)


def _hull(rng: Random) -> Shape:
    points = rng.standard_normal((int(rng.integers(4, 20)), 3)) * length(rng)
    if rng.random() < 0.5:
        points = np.round(points, 2)
    return ConvexHull(points, radius=length(rng) if rng.random() < 0.1 else 0.0)


def _hpolytope(rng: Random) -> Shape:
    normals = np.concatenate([np.eye(3), -np.eye(3), np.round(rng.uniform(-1, 1, (3, 3)), 1)])
    normals = normals[np.abs(normals).sum(axis=1) > 0]
    return HPolytope(normals, np.full(len(normals), length(rng)))


def _mesh(rng: Random) -> Shape:
    if rng.random() < 0.5:
        return _box_mesh(np.array([length(rng) for _ in range(3)]))
    case = families.generate(str(rng.choice(families.mesh_names())), 1, int(rng.integers(1 << 30)))[0]
    return case.shapes()[int(rng.integers(2))]


def _height_field(rng: Random) -> Shape:
    heights = rng.uniform(0, 1, rng.integers(2, 5, 2)) * length(rng)
    return HeightField(np.round(heights, 2) if rng.random() < 0.5 else heights, length(rng))


def _halfspace(rng: Random) -> Shape:
    normal = np.eye(3)[int(rng.integers(3))] if rng.random() < 0.5 else np.round(rng.standard_normal(3), 2)
    return Halfspace(normal, float(rng.choice([0.0, -length(rng)])))


def _compound(rng: Random) -> Shape:
    parts = [(_CONVEX[int(rng.integers(len(_CONVEX)))](rng), any_pose(rng)) for _ in range(3)]
    return Compound(parts)


_CONVEX: list[Callable[[Random], Shape]] = [
    lambda rng: Sphere(length(rng)),
    lambda rng: Box([length(rng) for _ in range(3)]),
    lambda rng: Capsule(length(rng), length(rng)),
    lambda rng: Cylinder(length(rng), length(rng)),
    lambda rng: Cone(length(rng), length(rng)),
    lambda rng: Ellipsoid([length(rng) for _ in range(3)]),
    _hull,
]
_SHAPES = [*_CONVEX, *_CONVEX, _hpolytope, _mesh, _mesh, _height_field, _compound, _halfspace]


def any_shape(rng: Random) -> Shape:
    """A shape of any kind, primitives twice as often as each of the others."""
    return _SHAPES[int(rng.integers(len(_SHAPES)))](rng)


def any_rotation(rng: Random) -> np.ndarray:
    """None, a quarter turn and its like, barely tilted, in steps of 15 degrees, or any: (3, 3)."""
    kind = rng.random()
    if kind < 0.35:
        return np.eye(3)
    if kind < 0.55:
        return EXACT_ROTATIONS[int(rng.integers(len(EXACT_ROTATIONS)))]
    if kind < 0.7:  # barely tilted
        return pose(rpy=rng.standard_normal(3) * 10.0 ** rng.uniform(-9, -2))[:3, :3]
    if kind < 0.8:
        return pose(rpy=np.radians(15.0) * rng.integers(0, 24, 3))[:3, :3]
    return rotation(rng)


def any_pose(rng: Random, spread: float = 1.0) -> np.ndarray:
    """Anywhere within ± spread [m], in half of the cases to centimetres: (4, 4)."""
    t = rng.uniform(-spread, spread, 3)
    return pose(np.round(t, 2) if rng.random() < 0.5 else t, R=any_rotation(rng))


def reach(shape: Shape) -> float:
    """The largest of a shape's numbers [m], which it surely fits a few times of; 1 where it has none."""
    from_origin = [1.0]
    for name in ("radius", "length"):
        from_origin += [float(getattr(shape, name))] if hasattr(shape, name) else []
    for name in ("size", "radii", "points", "vertices"):
        from_origin += [float(np.abs(getattr(shape, name)).max())] if hasattr(shape, name) else []
    return max(from_origin[1:] or from_origin)


def extent(shape: Shape) -> tuple[float, float] | None:
    """The least and the greatest z of a shape in its own frame [m]; None where that is not plain."""
    if isinstance(shape, Sphere):
        return -shape.radius, shape.radius
    if isinstance(shape, Box):
        return -shape.size[2] / 2, shape.size[2] / 2
    if isinstance(shape, Capsule):
        return -shape.length / 2 - shape.radius, shape.length / 2 + shape.radius
    if isinstance(shape, Cylinder | Cone):
        return -shape.length / 2, shape.length / 2
    if isinstance(shape, Ellipsoid):
        return -shape.radii[2], shape.radii[2]
    points = getattr(shape, "points", None) if isinstance(shape, ConvexHull) else getattr(shape, "vertices", None)
    return None if points is None else (float(points[:, 2].min()), float(points[:, 2].max()))
