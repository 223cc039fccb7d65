"""An ellipsoid by its numbers: params = its three radii along x, y and z."""

from __future__ import annotations

import math

import numpy as np

from collide.curved.chords import ROUNDING, ball_chord
from collide.curved.unit_polytopes import MARGIN, unit_ball
from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, divide, dot, max_abs, norm


@kernel(inline=True)
def ellipsoid_support(params, at, g):
    """The point of an ellipsoid farthest along g: D² g / |D g|, the gradient of |D g|, D the diagonal of the radii."""
    a, b, c = params[at], params[at + 1], params[at + 2]
    scaled = Vec3(a * g.x, b * g.y, c * g.z)
    largest = max_abs(scaled)
    if largest == 0.0:
        return Vec3(a, 0.0, 0.0)
    scaled = divide(scaled, largest)
    unit = divide(scaled, math.sqrt(dot(scaled, scaled)))
    return Vec3(a * unit.x, b * unit.y, c * unit.z)


@kernel(inline=True)
def ellipsoid_normal(params, at, p):
    """An outward normal at a point p of the surface."""
    a, b, c = params[at], params[at + 1], params[at + 2]
    return Vec3(p.x / a / a, p.y / b / b, p.z / c / c)


@kernel
def ellipsoid_chord(line, radii):
    """Of an ellipsoid along the axes: a unit ball in units of its radii."""
    o, d = line.origin, line.direction
    least = min(radii.x, radii.y, radii.z)
    m = Vec3(o.x / radii.x, o.y / radii.y, o.z / radii.z)
    g = Vec3(d.x / radii.x, d.y / radii.y, d.z / radii.z)
    return ball_chord(m, g, 1.0, line.error / least + ROUNDING * norm(m), 0)


def ellipsoid_extents(params: np.ndarray, g: np.ndarray) -> np.ndarray:
    """(…,) how far an ellipsoid reaches along g (…, 3)."""
    scaled = g * params[:3]
    return np.sqrt(
        scaled[..., 0] * scaled[..., 0] + scaled[..., 1] * scaled[..., 1] + scaled[..., 2] * scaled[..., 2]
    )


def within_ellipsoid(params: np.ndarray, points: np.ndarray, error: np.ndarray | float) -> np.ndarray:
    """(m,) bool: whether points (3, m), each coordinate off by ``error`` at most, are within."""
    (x, y, z), (a, b, c) = points, params[:3].tolist()
    return np.sqrt((x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2) + 2.0 * error / min(a, b, c) <= 1.0


def ellipsoid_polytopes(params: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3) of a polytope around an ellipsoid, and of a polytope within."""
    points, least = unit_ball()
    return points * ((1 + MARGIN) / least) * params[:3], points * (1 - MARGIN) * params[:3]
