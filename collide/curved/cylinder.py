"""A cylinder by its numbers: params = (radius, half length)."""

from __future__ import annotations

import math

import numpy as np

from collide.curved.chords import clipped_cylinder, slab_chord
from collide.curved.unit_polytopes import ring, rings_around
from collide.kernels import kernel
from collide.numerics.vec3 import Vec3


@kernel(inline=True)
def rim_point(radius, g):
    """(x, y, radius times the length of (gx, gy)): the point of a disc across z farthest along g, and how far."""
    largest = max(abs(g.x), abs(g.y))
    x = 0.0
    y = 0.0
    across = 0.0
    if largest > 0.0:
        ux = g.x / largest
        uy = g.y / largest
        length = math.sqrt(ux * ux + uy * uy)
        x = radius * (ux / length)
        y = radius * (uy / length)
        across = radius * (length * largest)
    return x, y, across


@kernel(inline=True)
def cylinder_support(params, at, g):
    """The point of a cylinder farthest along g."""
    x, y, _ = rim_point(params[at], g)
    return Vec3(x, y, params[at + 1] if g.z > 0.0 else -params[at + 1])


@kernel(inline=True)
def cylinder_normal(p):
    """An outward normal of the side at a point p of the side."""
    return Vec3(p.x, p.y, 0.0)


@kernel
def cylinder_chord(line, radius, half):
    """Of a cylinder along z from −half to half."""
    o, d = line.origin, line.direction
    slab = slab_chord(o.z, d.z, -half, half, line, 1, 2)
    return clipped_cylinder(slab, Vec3(o.x, o.y, 0.0), Vec3(d.x, d.y, 0.0), radius, line, 0)


def cylinder_extents(params: np.ndarray, g: np.ndarray) -> np.ndarray:
    """(…,) how far a cylinder reaches along g (…, 3)."""
    return rim_extents(params[0], g) + params[1] * np.abs(g[..., 2])


def rim_extents(radius: float, g: np.ndarray) -> np.ndarray:
    """(…,) how far a disc across z reaches along g (…, 3)."""
    return radius * np.sqrt(g[..., 0] * g[..., 0] + g[..., 1] * g[..., 1])


def within_cylinder(params: np.ndarray, points: np.ndarray, error: np.ndarray | float) -> np.ndarray:
    """(m,) bool: whether points (3, m), each coordinate off by ``error`` at most, are within."""
    x, y, z = points
    return (np.sqrt(x * x + y * y) + 2.0 * error <= params[0]) & (np.abs(z) + error <= params[1])


def cylinder_polytopes(params: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3) of a polytope around a cylinder, and of a polytope within."""
    half = float(params[1])
    outer, inner = (np.vstack([ring(r, -half), ring(r, -half) * (1.0, 1.0, -1.0)]) for r in rings_around(params[0]))
    return outer, inner
