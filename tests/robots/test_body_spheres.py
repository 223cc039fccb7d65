"""Spheres around and within boxes, cylinders and capsules, by points of these and by closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from naive import rng_of, unit

import collide
from collide.robots.body_spheres import spheres_of
from collide.robots.check_tables import RobotBody


def depth_of(shape: collide.Shape, points: np.ndarray) -> np.ndarray:
    """(n,) how deep points are within a shape, at least [m]; below 0 outside."""
    x, y, z = np.abs(points).T
    if isinstance(shape, collide.Box):
        return (0.5 * np.array(shape.size) - np.abs(points)).min(axis=1)
    if isinstance(shape, collide.Cylinder):
        return np.minimum(shape.radius - np.hypot(x, y), 0.5 * shape.length - z)
    return shape.radius - np.sqrt(x * x + y * y + np.maximum(z - 0.5 * shape.length, 0.0) ** 2)


def made_shapes(kind: str):
    rng = rng_of("body spheres", kind)
    for _ in range(40):
        a, b, c = 10.0 ** rng.uniform(-1.5, 0.0, 3)
        shapes = {"box": collide.Box((a, b, c)), "cylinder": collide.Cylinder(a, b), "capsule": collide.Capsule(a, b)}
        yield rng, shapes[kind]


@pytest.mark.parametrize("kind", ["box", "cylinder", "capsule"])
def test_spheres_hold_the_shape_and_lie_within(kind):
    largest_share = []
    for rng, shape in made_shapes(kind):
        made = spheres_of(RobotBody("link", 0, shape, 0.0))
        reach = 1.5 * float(np.abs(made.outer).max())
        points = rng.uniform(-reach, reach, (20_000, 3))
        points = points[depth_of(shape, points) >= 0.0]
        corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
        if kind == "box":
            points = np.concatenate([points, corners * 0.5 * np.array(shape.size)])
        if kind == "cylinder":
            angles = np.linspace(0.0, 7.0, 50)
            ring = np.column_stack([np.cos(angles), np.sin(angles), np.ones(50)])
            ring *= shape.radius, shape.radius, 0.5 * shape.length
            points = np.concatenate([points, ring, ring * (1, 1, -1)])
        gaps = np.linalg.norm(points[:, None] - made.outer[:, :3], axis=2) - made.outer[:, 3]
        assert len(points) >= 60 and gaps.min(axis=1).max() <= 0.0, (shape, points[gaps.min(axis=1).argmax()])
        assert 1 <= len(made.inner) and (made.inner[:, 3] > 0.0).all(), shape
        for x, y, z, radius in made.inner:
            around = (x, y, z) + radius * np.array([unit(v) for v in rng.normal(size=(200, 3))])
            assert depth_of(shape, around).min() >= -1e-15, (shape, (x, y, z, radius))
            assert depth_of(shape, np.array([(x, y, z)]))[0] >= radius, shape
        largest_share.append(float(made.inner[:, 3].max() / made.outer[:, 3].max()))
        assert len(made.outer) <= 8 and len(made.inner) <= 8
    assert max(largest_share) > 0.6  # what is as long as wide is nearly filled
